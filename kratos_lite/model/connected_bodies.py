"""Bodies of a mesh: sets of elements that are joined by faces, and the nodes at which they hang together."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh import Faces, Mesh, components, distinct, with_rows
from kratos_lite.records import record
from kratos_lite.typing import Array, Ints

FEW = 40
"""Up to this many bodies that hang together are looked at with full matrices."""


@record(frozen=True)
class Bodies:
    """Which nodes belong to which bodies: a node has one pair (node, body) for each body around it.

    Attributes
    ----------
    part : (n,) int, the first body of each node, -1 for nodes without elements.
    node, body : all pairs, sorted by node.
    """

    part: Ints
    node: Ints
    body: Ints

    @property
    def joints(self) -> tuple[Ints, Ints]:
        """Nodes that belong to a further body, and that body."""
        further = self.body != self.part[self.node]
        return self.node[further], self.body[further]

    def frames(self, points: Array) -> tuple[Array, Array]:
        """Return the center (b, 3) and the size (b,) of each body."""
        order = np.argsort(self.body, kind="stable")
        X, start = points[self.node[order]], np.flatnonzero(np.diff(self.body[order], prepend=-1))
        low, high = np.minimum.reduceat(X, start), np.maximum.reduceat(X, start)
        return (low + high) / 2, np.maximum((high - low).max(axis=1), np.finfo(float).tiny)


def bodies(mesh: Mesh, faces: Faces | None = None) -> Bodies:
    """Return the bodies of a mesh: sets of elements that are joined by faces."""
    faces = faces or mesh.all_faces
    joined = np.stack([faces.element[faces.one], faces.element[faces.other]], axis=1)
    root = components(mesh.n_elements, joined)
    is_root = root == np.arange(len(root))
    body = (np.cumsum(is_root) - 1)[root]
    found = _of_elements(mesh, body)
    while len(pairs := _locked(mesh.points, found)):
        label = components(int(body.max()) + 1, pairs)
        body = np.searchsorted(distinct(label), label)[body]
        found = _of_elements(mesh, body)
    return found


def _locked(points: Array, found: Bodies) -> Ints:
    """Return pairs (k, 2), among many bodies, that share three nodes not in a line: neither can turn."""
    node, second = found.joints
    if len(node) < 3 or found.body.max() < FEW:
        return np.zeros((0, 2), dtype=np.int64)
    key = found.part[node] * (found.body.max() + 1) + second
    order = np.argsort(key, kind="stable")
    X, start = points[node[order]], np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(np.append(start, len(order)))
    group = np.repeat(np.arange(len(start)), count)
    arms = X - (np.add.reduceat(X, start) / count[:, None])[group]
    spread = np.linalg.svd(np.add.reduceat(arms[:, :, None] * arms[:, None, :], start), compute_uv=False)
    flat = spread[:, 1] > 1e-8 * spread[:, 0]
    return np.stack([found.part[node], second], axis=1)[order[start[flat]]]


def _of_elements(mesh: Mesh, body: Ints) -> Bodies:
    """Return the bodies of the nodes from those of the elements."""
    part = np.full(mesh.n_nodes, -1)
    if not body.any():
        part[mesh.used_nodes()] = 0
        node = np.flatnonzero(part == 0)
        return Bodies(part, node, np.zeros_like(node))
    pairs = []
    for block, at in with_rows(mesh.blocks):
        owner = np.broadcast_to(body[at, None], block.nodes.shape)
        part[block.nodes] = owner
        pairs.append((block.nodes, owner))
    node = np.flatnonzero(part >= 0)
    shared = [(nodes[mask], owner[mask]) for nodes, owner in pairs if (mask := part[nodes] != owner).any()]
    if not shared:
        return Bodies(part, node, part[node])
    further, owner = (np.concatenate(both) for both in zip(*shared, strict=True))
    count = int(body.max()) + 1
    every = np.concatenate([node * count + part[node], further.astype(np.int64) * count + owner])
    node, owner = np.divmod(distinct(every), count)
    part[node[::-1]] = owner[::-1]
    return Bodies(part, node, owner)

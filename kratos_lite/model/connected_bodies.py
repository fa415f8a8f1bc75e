"""Bodies of a mesh: sets of elements that are joined by faces, and the nodes at which they hang together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.mesh import Mesh, components, distinct, with_rows
from kratos_lite.typing import Array, Ints

FEW = 40
"""Up to this many bodies that hang together are looked at with full matrices."""


@dataclass(frozen=True)
class Bodies:
    """Which nodes belong to which bodies: a node has one pair (node, body) for each body around it."""

    part: Ints  # (n,) int, the first body of each node, -1 for nodes without elements
    node: Ints  # all pairs, sorted by node
    body: Ints
    count: int  # number of bodies

    @property
    def joints(self) -> tuple[Ints, Ints]:
        """Nodes that belong to a further body, and that body."""
        further = self.body != self.part[self.node]
        return self.node[further], self.body[further]

    def joined(self, mesh: Mesh) -> tuple[Ints, Ints, Array]:
        """Return the first and the further body of each joint, and its place (k, 3)."""
        node, second = self.joints
        return self.part[node], second, mesh.points[node]

    def frames(self, mesh: Mesh) -> tuple[Array, Array]:
        """Return the center (b, 3) and the size (b,) of each body."""
        order = np.argsort(self.body, kind="stable")
        X, start = mesh.points[self.node[order]], np.flatnonzero(np.diff(self.body[order], prepend=-1))
        low, high = np.minimum.reduceat(X, start), np.maximum.reduceat(X, start)
        return (low + high) / 2, np.maximum((high - low).max(axis=1), np.finfo(float).tiny)

    def described(self, mesh: Mesh) -> tuple[Ints, Ints]:
        """Return the number of nodes of each body (b,), and the id of its first one."""
        first = np.zeros(self.count, dtype=np.int64)
        first[self.body[::-1]] = self.node[::-1]
        return np.bincount(self.body, minlength=self.count), mesh.node_ids[first]


def bodies(mesh: Mesh) -> Bodies:
    """Return the bodies of a mesh: sets of elements that are joined by faces."""
    faces = mesh.all_faces
    pairs = np.stack([faces.element[faces.one], faces.element[faces.other]], axis=1)
    body, count = np.arange(mesh.n_elements), mesh.n_elements
    while True:
        label = components(count, pairs)
        known = distinct(label)
        body, count = np.searchsorted(known, label)[body], len(known)
        joined = _of_elements(mesh, body, count)
        if not len(pairs := _locked(mesh, joined)):
            return joined


def _locked(mesh: Mesh, connected: Bodies) -> Ints:
    """Return pairs (k, 2), among many bodies, that share three nodes not in a line: neither can turn."""
    if connected.count <= FEW:
        return np.zeros((0, 2), dtype=np.int64)
    one, other, X = connected.joined(mesh)
    if len(one) < 3:
        return np.zeros((0, 2), dtype=np.int64)
    key = one * connected.count + other
    order = np.argsort(key, kind="stable")
    X, start = X[order], np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(np.append(start, len(order)))
    group = np.repeat(np.arange(len(start)), count)
    arms = X - (np.add.reduceat(X, start) / count[:, None])[group]
    spread = np.linalg.svd(np.add.reduceat(arms[:, :, None] * arms[:, None, :], start), compute_uv=False)
    flat = spread[:, 1] > 1e-8 * spread[:, 0]
    return np.stack([one, other], axis=1)[order[start[flat]]]


def _of_elements(mesh: Mesh, body: Ints, count: int) -> Bodies:
    """Return the bodies of the nodes from those of the elements."""
    part = np.full(mesh.n_nodes, -1)
    if not body.any():
        part[mesh.used_nodes()] = 0
        node = np.flatnonzero(part == 0)
        return Bodies(part, node, np.zeros_like(node), count)
    pairs = []
    for block, at in with_rows(mesh.blocks):
        owner = np.broadcast_to(body[at, None], block.nodes.shape)
        part[block.nodes] = owner
        pairs.append((block.nodes, owner))
    node = np.flatnonzero(part >= 0)
    shared = [(nodes[mask], owner[mask]) for nodes, owner in pairs if (mask := part[nodes] != owner).any()]
    if not shared:
        return Bodies(part, node, part[node], count)
    further, owner = (np.concatenate(both) for both in zip(*shared, strict=True))
    every = np.concatenate([node * count + part[node], further.astype(np.int64) * count + owner])
    node, owner = np.divmod(distinct(every), count)
    part[node[::-1]] = owner[::-1]
    return Bodies(part, node, owner, count)

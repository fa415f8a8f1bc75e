"""Mobility: which rigid motions the supports leave free, part by part, hinges included.

Elements that share faces form a body.  Bodies that share single nodes or an edge only are joined
there, and can turn about the joint: each is given its six rigid modes, and supports, constraints
and joints are the equations that these must meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kratos_lite.errors import MAX_PROBLEMS, ModelError
from kratos_lite.mesh import Mesh, distinct, with_rows
from kratos_lite.supports import Supports, rigid_modes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
MAX_HINGED = 300
"""More bodies than this that hang together by edges or corners are taken as one."""


def components(n_nodes: int, connectivity: Sequence[NDArray[np.integer]]) -> Ints:
    """Return for each node the smallest node row of its connected part (itself where unconnected)."""
    labels = np.arange(n_nodes)
    while True:
        before = labels.copy()
        for nodes in connectivity:
            smallest = labels[nodes].min(axis=1)
            np.minimum.at(labels, nodes.ravel(), np.repeat(smallest, nodes.shape[1]))
        labels = labels[labels]
        if (labels == before).all():
            return labels


@dataclass(frozen=True)
class Faces:
    """Every face of every element, with keys that are equal for equal sets of nodes.

    Attributes
    ----------
    element : (f,) int, row of the element.
    corners, nodes : (f,) keys of the corner nodes and of all nodes.
    """

    element: Ints
    corners: NDArray[np.uint64]
    nodes: NDArray[np.uint64]

    def pairs(self) -> tuple[Ints, Ints]:
        """Return rows of faces that have the same corners, as two arrays."""
        order = np.argsort(self.corners, kind="stable")
        same = np.flatnonzero(self.corners[order][1:] == self.corners[order][:-1])
        return order[same], order[same + 1]


def node_keys(mesh: Mesh) -> NDArray[np.uint64]:
    """Return one hashed number per node; sums of them tell sets of nodes apart.

    Source: Steele, Lea, Flood, "Fast splittable pseudorandom number generators" (2014): SplitMix64.
    """
    x = np.arange(1, mesh.n_nodes + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ x >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ x >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return x ^ x >> np.uint64(31)


def all_faces(mesh: Mesh) -> Faces:
    """Return the faces of all elements."""
    key = node_keys(mesh)
    element, corners, nodes = [np.zeros(0, np.int64)], [np.zeros(0, np.uint64)], [np.zeros(0, np.uint64)]
    for block, at in with_rows(mesh.blocks):
        for face in block.shape.faces if block.shape is not None else ():
            mine = key[block.nodes[:, list(face)]]
            element.append(np.arange(at.start, at.stop))
            corners.append(mine[:, : 3 if len(face) in (3, 6) else 4].sum(axis=1))
            nodes.append(mine.sum(axis=1))
    return Faces(np.concatenate(element), np.concatenate(corners), np.concatenate(nodes))


def check_joints(mesh: Mesh) -> list[str]:
    """Warn of elements with the same nodes, and of faces joined at their corners only."""
    key, warnings = node_keys(mesh), []
    ids = mesh.element_ids
    sums = np.concatenate([key[block.nodes].sum(axis=1) for block in mesh.blocks if len(block)])
    order = np.argsort(sums, kind="stable")
    twins = np.flatnonzero(sums[order][1:] == sums[order][:-1])
    if len(twins):
        a, b = sorted(ids[order[twins[0] : twins[0] + 2]].tolist())
        warnings.append(f"{len(twins)} elements have the same nodes as another ({a} and {b}): both count")
    faces = all_faces(mesh)
    one, other = faces.pairs()
    open_ = np.flatnonzero(faces.nodes[one] != faces.nodes[other])
    if len(open_):
        a, b = sorted((ids[faces.element[one[open_[0]]]].item(), ids[faces.element[other[open_[0]]]].item()))
        warnings.append(
            f"{len(open_)} pairs of elements ({a} and {b}) share the corners of a face but not its further "
            "nodes: the face can gape; use the same order on both sides"
        )
    halves = _halved_squares(mesh, key)
    if len(halves):
        warnings.append(
            f"{len(halves)} four-sided faces (the first of element {ids[halves[0]]}) meet triangles: "
            "the faces can gape; put a pyramid or a wedge between"
        )
    return warnings


def _halved_squares(mesh: Mesh, key: NDArray[np.uint64]) -> Ints:
    """Return the elements with a four-sided face of which three corners are a triangular face."""
    squares, triangles, elements = [], [], [np.zeros(0, np.int64)]
    for block, at in with_rows(mesh.blocks):
        for face in block.shape.faces if block.shape is not None else ():
            if len(face) in (3, 6):
                triangles.append(key[block.nodes[:, list(face[:3])]].sum(axis=1))
            else:
                squares.append(key[block.nodes[:, list(face[:4])]])
                elements.append(np.arange(at.start, at.stop))
    if not (squares and triangles):
        return elements[0]
    corner = np.concatenate(squares)
    three = corner.sum(axis=1, keepdims=True) - corner
    return np.concatenate(elements)[np.isin(three, np.concatenate(triangles)).any(axis=1)]


@dataclass(frozen=True)
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
        """Return the centre (b, 3) and the size (b,) of each body."""
        order = np.argsort(self.body, kind="stable")
        X, start = points[self.node[order]], np.flatnonzero(np.diff(self.body[order], prepend=-1))
        low, high = np.minimum.reduceat(X, start), np.maximum.reduceat(X, start)
        return (low + high) / 2, np.maximum((high - low).max(axis=1), np.finfo(float).tiny)


def bodies(mesh: Mesh) -> Bodies:
    """Return the bodies of a mesh: sets of elements that are joined by faces."""
    faces = all_faces(mesh)
    one, other = faces.pairs()
    joined = np.stack([faces.element[one], faces.element[other]], axis=1)
    root = components(mesh.n_elements, [joined] if len(joined) else [])
    names = distinct(root)
    body = np.searchsorted(names, root)
    nodes = np.concatenate([b.nodes.ravel() for b in mesh.blocks])
    size = np.concatenate([np.full(len(b), b.nodes.shape[1]) for b in mesh.blocks])
    owners = np.repeat(body, size)
    found = _of_pairs(mesh.n_nodes, nodes.astype(np.int64), owners)
    if len(distinct(found.joints[1])) > MAX_HINGED:
        label = components(len(names), [np.stack([found.part[found.joints[0]], found.joints[1]], axis=1)])
        label = np.searchsorted(distinct(label), label)
        found = _of_pairs(mesh.n_nodes, found.node, label[found.body])
    return found


def _of_pairs(n_nodes: int, node: Ints, body: Ints) -> Bodies:
    count = int(body.max()) + 1
    node, body = np.divmod(distinct(node * count + body), count)
    part = np.full(n_nodes, -1)
    part[node[::-1]] = body[::-1]
    return Bodies(part, node, body)


def check_supports(mesh: Mesh, supports: Supports) -> None:
    """Raise ModelError that names the rigid modes which the supports leave free, part by part."""
    found = bodies(mesh)
    equations = _equations(found, supports)
    frames = found.frames(mesh.points)
    problems = []
    for group in _groups(len(frames[0]), equations):
        modes = _free_modes(mesh, frames, group, equations)
        problems += _name_modes(mesh, found, group, modes)
    if problems:
        shown = "; ".join(problems[:MAX_PROBLEMS])
        raise ModelError(f"the supports leave rigid motions free: {shown}. Fix more nodes or components")


@dataclass(frozen=True)
class Equations:
    """What the rigid motions must meet, entry by entry: equation, degree of freedom, body, weight."""

    row: Ints
    dof: Ints
    body: Ints
    weight: Array


def _equations(found: Bodies, supports: Supports) -> Equations:
    """Return fixed components, constraints, and the equal motion of bodies where they are joined."""
    part, (node, second) = found.part, found.joints
    row, dof, weight = supports.rows_of_constraints()
    body = part[dof // 3]
    first = int(row.max(initial=-1)) + 1
    joint = (3 * node[:, None] + np.arange(3)).ravel()
    rows = first + np.arange(len(joint))
    ones = np.ones(len(joint))
    row, dof = np.concatenate([row, rows, rows]), np.concatenate([dof, joint, joint])
    body = np.concatenate([body, part[joint // 3], np.repeat(second, 3)])
    weight = np.concatenate([weight, ones, -ones])
    known = body >= 0
    return Equations(row[known], dof[known], body[known], weight[known])


def _groups(n_bodies: int, equations: Equations) -> list[list[int]]:
    """Return the bodies in groups that equations tie together."""
    order = np.argsort(equations.row, kind="stable")
    row, body = equations.row[order], equations.body[order]
    tied = (row[1:] == row[:-1]) & (body[1:] != body[:-1])
    pairs = np.stack([body[1:][tied], body[:-1][tied]], axis=1)
    label = components(n_bodies, [pairs] if len(pairs) else [])
    members = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[members])) + 1
    return [group.tolist() for group in np.split(members, cuts)]


def _free_modes(
    mesh: Mesh, frames: tuple[Array, Array], group: list[int], equations: Equations
) -> list[Array]:
    """Return the free modes (6, k) of each body of a group.

    A rotation is scaled with the size of its body, so that all modes move points about as far.
    """
    mine = np.isin(equations.body, group)
    rows = distinct(equations.row[mine])
    row = np.searchsorted(rows, equations.row[mine])
    dof, body, weight = equations.dof[mine], equations.body[mine], equations.weight[mine]
    C = np.zeros((len(rows), 6 * len(group)))
    for i, p in enumerate(group):
        centre, size = frames[0][p], float(frames[1][p])
        here = body == p
        R = rigid_modes(mesh.points[dof[here] // 3], centre).reshape(-1, 3, 6)
        R = R[np.arange(len(R)), dof[here] % 3] / np.array([1, 1, 1, size, size, size])
        np.add.at(C[:, 6 * i : 6 * i + 6], row[here], R * weight[here, None])
    C /= np.maximum(np.abs(C).max(axis=1, keepdims=True, initial=0), np.finfo(float).tiny)
    triangle = np.linalg.qr(np.vstack([C, np.zeros((C.shape[1], C.shape[1]))]), mode="r")
    _, values, directions = np.linalg.svd(triangle)
    free = directions[values <= 1e-7 * max(float(values.max(initial=0)), np.finfo(float).tiny)].T
    return [free[6 * i : 6 * i + 6] for i in range(len(group))]


def _name_modes(mesh: Mesh, found: Bodies, group: list[int], modes: list[Array]) -> list[str]:
    """Return one sentence for each part that can still move."""
    named = []
    for p, free in zip(group, modes, strict=True):
        words = _motions(free)
        if words:
            nodes = found.node[found.body == p]
            if found.body.max() == 0:
                who = f"the body ({len(nodes)} nodes)"
            else:
                who = f"the part of node {mesh.node_ids[nodes[0]]} ({len(nodes)} nodes)"
            hangs = len(group) > 1 and np.isin(nodes, found.joints[0]).any()
            hint = " (it hangs on a node or an edge only)" if hangs else ""
            named.append(f"{who} can still move: {words}{hint}")
    return named


def _motions(free: Array) -> str:
    """Name the span of free modes (6, k): translations and rotations, by axis where they are along one."""
    if not free.size or np.abs(free).max() < 1e-9:
        return ""
    U, values, _ = np.linalg.svd(free, full_matrices=False)
    span = U[:, values > 1e-6]
    rotation = np.linalg.svd(span[3:])
    turning = rotation[1] > 1e-6 if span.shape[1] else np.zeros(0, dtype=bool)
    n_turn = int(turning.sum())
    still = span @ rotation[2].T[:, n_turn:]
    words = []
    if still.shape[1]:
        words.append("translation " + _axes(still[:3]))
    if n_turn:
        words.append("rotation about " + _axes(rotation[0][:, :n_turn]))
    return "; ".join(words)


def _axes(directions: Array) -> str:
    """Name a span of directions (3, k): by letters if it is spanned by axes, else by vectors."""
    Q, _ = np.linalg.qr(directions)
    inside = (Q**2).sum(axis=1) > 1 - 1e-6
    if inside.sum() == Q.shape[1]:
        return ", ".join(letter for letter, yes in zip("xyz", inside, strict=True) if yes)
    return ", ".join("(" + " ".join(f"{c:.3g}" for c in q / np.abs(q).max()) + ")" for q in Q.T)

"""Rigid-body modes: which of them the supports leave free, part by part, hinges included.

Elements that share faces form a body.  Bodies that share single nodes or an edge only are joined
there, and can turn about the joint: each is given its six rigid-body modes, and supports, constraints
and joints are the equations that these must meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.errors import MAX_PROBLEMS, ModelError
from kratos_lite.mesh import NO_ROWS, Faces, Mesh, components, distinct, equal_sets, with_rows
from kratos_lite.mesh.topology import Sets, corners, faces_of, set_keys
from kratos_lite.model.supports import Supports
from kratos_lite.solvers.constraint_map import rigid_modes
from kratos_lite.typing import Array, Ints

MAX_HINGED = 300
"""More bodies than this that hang together by edges or corners are taken as one."""
FREE = 1e-7
"""Singular value, as a share of the largest, up to which a rigid mode is free."""
SAMPLE = 48
"""_Constraints for each body that are looked at first: a few of very many show that nothing is free."""


def check_joints(mesh: Mesh, faces: Faces | None = None) -> list[str]:
    """Warn of elements with the same nodes, and of faces joined at their corners only."""
    faces = faces or mesh.all_faces
    warnings = []
    one, other = equal_sets([(block.nodes, [range(block.nodes.shape[1])]) for block in mesh.blocks])
    if len(one):
        ids = mesh.element_ids
        a, b = sorted((ids[one[0]].item(), ids[other[0]].item()))
        warnings.append(f"{len(one)} elements have the same nodes as another ({a} and {b}): both count")
    one, other = faces.non_conforming()
    if len(one):
        a, b = sorted(mesh.element_ids[faces.element[[one[0], other[0]]]].tolist())
        warnings.append(
            f"{len(one)} pairs of elements ({a} and {b}) share the corners of a face but not its further "
            "nodes: the mesh is non-conforming there; use elements of the same order on both sides"
        )
    halves = _halved_squares(mesh)
    if len(halves):
        warnings.append(
            f"{len(halves)} four-sided faces (the first of element {mesh.element_ids[halves[0]]}) meet "
            "triangles: the mesh is non-conforming there; put pyramids or wedges between"
        )
    return warnings


def _halved_squares(mesh: Mesh) -> Ints:
    """Return the elements with a four-sided face of which three corners are a triangular face."""
    sizes = {len(corners(face)) for block in mesh.blocks if len(block) for face in faces_of(block)}
    if sizes != {3, 4}:
        return NO_ROWS
    triangles: list[Sets] = []
    thirds: list[Sets] = []
    elements = [NO_ROWS]
    for block, at in with_rows(mesh.blocks):
        found = [corners(face) for face in faces_of(block)]
        triangles.append((block.nodes, [face for face in found if len(face) == 3]))
        for square in (face for face in found if len(face) == 4):
            thirds.append((block.nodes, [square[:i] + square[i + 1 :] for i in range(4)]))
            elements.append(np.arange(at.start, at.stop))
    keys = set_keys(triangles + thirds)
    n_triangles = sum(len(cells) * len(columns) for cells, columns in triangles)
    meets, start = [], n_triangles
    for cells, columns in thirds:
        stop = start + len(cells) * len(columns)
        meets.append(np.isin(keys[start:stop].reshape(4, -1), keys[:n_triangles]).any(axis=0))
        start = stop
    return np.concatenate(elements)[np.concatenate(meets)]


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
    if len(distinct(found.joints[1])) > MAX_HINGED:
        pairs = np.stack([found.part[found.joints[0]], found.joints[1]], axis=1)
        label = components(int(is_root.sum()), pairs)
        label = np.searchsorted(distinct(label), label)
        found = _of_elements(mesh, label[body])
    return found


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


def check_supports(mesh: Mesh, supports: Supports, found: Bodies | None = None) -> Ints:
    """Raise ModelError that names the rigid modes which the supports leave free, part by part.

    Return the number of the part of each node (n,), -1 for nodes without elements: parts are bodies
    that neither nodes nor constraints tie to others.
    """
    found = found or bodies(mesh)
    equations = _equations(found, supports)
    frames = found.frames(mesh.points)
    group_of = _groups(len(frames[0]), equations)
    problems = []
    for group, mine in zip(*_by_group(group_of, equations), strict=True):
        problems += _name_modes(mesh, found, group, _free_modes(mesh, frames, group, mine))
    if problems:
        shown = "; ".join(problems[:MAX_PROBLEMS])
        raise ModelError(f"the supports leave rigid-body modes free: {shown}. Fix more nodes or components")
    return np.where(found.part >= 0, group_of[found.part], -1)


@dataclass(frozen=True)
class _Constraints:
    """What rigid-body modes must meet, entry by entry: equation, degree of freedom, body, weight."""

    row: Ints
    dof: Ints
    body: Ints
    weight: Array

    def take(self, rows: Ints) -> _Constraints:
        """Return some of the entries."""
        return _Constraints(self.row[rows], self.dof[rows], self.body[rows], self.weight[rows])


def _equations(found: Bodies, supports: Supports) -> _Constraints:
    """Return fixed components, constraints, and the equal motion of bodies where they are joined."""
    part, (node, second) = found.part, found.joints
    row, dof, weight = supports.constraint_rows()
    body = part[dof // 3]
    first = int(row.max(initial=-1)) + 1
    joint = (3 * node[:, None] + np.arange(3)).ravel()
    rows = first + np.arange(len(joint))
    ones = np.ones(len(joint))
    row, dof = np.concatenate([row, rows, rows]), np.concatenate([dof, joint, joint])
    body = np.concatenate([body, part[joint // 3], np.repeat(second, 3)])
    weight = np.concatenate([weight, ones, -ones])
    known = body >= 0
    return _Constraints(row[known], dof[known], body[known], weight[known])


def _groups(n_bodies: int, equations: _Constraints) -> Ints:
    """Return for each body (b,) the number of its group: bodies that equations tie together."""
    if n_bodies == 1:
        return np.zeros(1, dtype=np.int64)
    order = np.argsort(equations.row, kind="stable")
    row, body = equations.row[order], equations.body[order]
    tied = (row[1:] == row[:-1]) & (body[1:] != body[:-1])
    label = components(n_bodies, np.stack([body[1:][tied], body[:-1][tied]], axis=1))
    return (np.cumsum(label == np.arange(n_bodies)) - 1)[label]


def _by_group(group_of: Ints, equations: _Constraints) -> tuple[list[list[int]], list[_Constraints]]:
    """Return the bodies of each group, and its equations."""
    numbers = np.arange(1, int(group_of.max()) + 1)
    members = np.argsort(group_of, kind="stable")
    groups = np.split(members, np.searchsorted(group_of[members], numbers))
    owner = group_of[equations.body]
    order = np.argsort(owner, kind="stable")
    mine = np.split(order, np.searchsorted(owner[order], numbers))
    return [group.tolist() for group in groups], [equations.take(rows) for rows in mine]


def _free_modes(
    mesh: Mesh, frames: tuple[Array, Array], group: list[int], equations: _Constraints
) -> list[Array]:
    """Return the free modes (6, k) of each body of a group under its equations.

    A rotation is scaled with the size of its body, so that all modes move points about as far.
    """
    rows = distinct(equations.row)
    row = np.searchsorted(rows, equations.row)
    if len(rows) > 2 * SAMPLE * len(group):
        count = SAMPLE * len(group)
        chosen = np.linspace(0, len(rows) - 3, count).astype(np.int64) + np.arange(count) % 3
        some = np.full(len(rows), -1)
        some[chosen] = np.arange(count)
        mine = np.flatnonzero(some[row] >= 0)
        least = _spectrum(mesh, frames, group, equations.take(mine), some[row[mine]])[0].min()
        # further equations lift the smallest value; the largest is at most the root of all squares
        if least > 2 * FREE * (6 * len(group) * len(rows)) ** 0.5:
            return [np.zeros((6, 0))] * len(group)
    values, directions = _spectrum(mesh, frames, group, equations, row)
    free = directions[values <= FREE * max(float(values.max(initial=0)), np.finfo(float).tiny)].T
    return [free[6 * i : 6 * i + 6] for i in range(len(group))]


def _spectrum(
    mesh: Mesh, frames: tuple[Array, Array], group: list[int], equations: _Constraints, row: Ints
) -> tuple[Array, Array]:
    """Return singular values and right singular vectors of equations, by number `row`, on rigid modes."""
    dof, body, weight = equations.dof, equations.body, equations.weight
    C = np.zeros((int(row.max(initial=-1)) + 1, 6 * len(group)))
    for i, p in enumerate(group):
        center, size = frames[0][p], float(frames[1][p])
        here = body == p
        R = rigid_modes(mesh.points[dof[here] // 3], center).reshape(-1, 3, 6)
        R = R[np.arange(len(R)), dof[here] % 3] / np.array([1, 1, 1, size, size, size])
        np.add.at(C[:, 6 * i : 6 * i + 6], row[here], R * weight[here, None])
    C /= np.maximum(np.abs(C).max(axis=1, keepdims=True, initial=0), np.finfo(float).tiny)
    triangle = np.linalg.qr(np.vstack([C, np.zeros((C.shape[1], C.shape[1]))]), mode="r")
    _, values, directions = np.linalg.svd(triangle)
    return values, directions


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

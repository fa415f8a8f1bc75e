"""Joints of elements: cells of the same nodes, faces joined at corners alone, nodes that coincide."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kratos_lite.mesh import NO_ROWS, Mesh, equal_sets, mask_of, with_rows
from kratos_lite.mesh.centers import keys_of
from kratos_lite.mesh.topology import corners, faces_of
from kratos_lite.model.supports import Supports
from kratos_lite.typing import Array, Ints

NORMAL = np.array([0.5257311, 0.6180340, 0.5844215])
"""Direction along which nodes are sorted; no plane of a usual mesh is normal to it."""
MOST = 64
"""Nodes at one place that are compared with one another."""


def check_joints(mesh: Mesh) -> Iterator[str]:
    """Warn of elements with the same nodes, and of faces joined at their corners only."""
    faces, ids = mesh.all_faces, mesh.element_ids
    same = equal_sets([(block.nodes, [range(block.nodes.shape[1])]) for block in mesh.blocks])
    if len(same[0]):
        yield f"{len(same[0])} elements have the same nodes as another ({_first(ids, *same)}): both count"
    one, other = (faces.element[face] for face in faces.non_conforming())
    if len(one):
        yield (
            f"{len(one)} pairs of elements ({_first(ids, one, other)}) share the corners of a face but not "
            "its further nodes: the mesh is non-conforming there; use elements of the same order on both "
            "sides"
        )
    squares = _halved_squares(mesh)
    if len(squares):
        yield (
            f"{len(squares)} four-sided faces (the first of element {ids[squares[0]]}) meet "
            "triangles: the mesh is non-conforming there; put pyramids or wedges between"
        )


def _first(ids: Ints, one: Ints, other: Ints) -> str:
    """Return the ids of the first pair of elements."""
    return "{} and {}".format(*sorted([ids[one[0]], ids[other[0]]]))


def _halved_squares(mesh: Mesh) -> Ints:
    """Return the elements of four-sided faces of which three corners are a triangular face."""
    faces = [(block, at, corners(f)) for block, at in with_rows(mesh.blocks) for f in faces_of(block)]
    if {len(face) for block, _, face in faces if len(block)} != {3, 4}:
        return NO_ROWS
    known = np.concatenate([keys_of(block.nodes[:, face]) for block, _, face in faces if len(face) == 3])
    elements = [NO_ROWS]
    for block, at, face in faces:
        if len(face) == 4:
            thirds = [keys_of(np.delete(block.nodes[:, face], i, axis=1)) for i in range(4)]
            elements.append(at.start + np.flatnonzero(np.isin(thirds, known).any(axis=0)))
    return np.concatenate(elements)


def check_coincident(mesh: Mesh, supports: Supports) -> Iterator[str]:
    """Warn of different nodes at the same place (within 1e-8 of the mean spacing) that nothing ties."""
    used = np.flatnonzero(mesh.used_nodes())
    if len(used) < 2:
        return
    X = mesh.points[used]
    size = max(float(np.ptp(x)) for x in X.T)  # by columns, which is faster
    pairs = np.sort(used[_at_one_place(X, 1e-8 * size / len(used) ** (1 / 3))], axis=1)
    of_ties = [NO_ROWS, *(nodes for tie in supports.ties for nodes in tie.nodes_of)]
    inside = mask_of(np.concatenate(of_ties), mesh.n_nodes)
    pairs = pairs[~inside[pairs].all(axis=1)]
    if len(pairs):
        every, key = supports.constraints, np.array([mesh.n_nodes, 1])
        ends = np.stack([every.dependents[every.owner], every.independents], axis=1) // 3
        apart = mesh.node_ids[pairs[~np.isin(pairs @ key, np.sort(ends, axis=1) @ key)]].tolist()
        if apart:
            shown = ", ".join(f"{min(pair)} and {max(pair)}" for pair in apart[:3])
            more = " …" if len(apart) > 3 else ""
            yield f"{len(apart)} pairs of nodes coincide ({shown}{more}); they are not joined"


def _at_one_place(X: Array, tolerance: float) -> Ints:
    """Return the rows (k, 2) of points at the same place."""
    along = X @ NORMAL
    order = np.argsort(along, kind="stable")
    X, along = X[order], along[order]
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for step in range(1, min(len(X), MOST)):
        close = np.flatnonzero(along[step:] - along[:-step] <= 2 * tolerance)
        if not len(close):
            break
        near = close[(np.abs(X[close + step] - X[close]) <= tolerance).all(axis=1)]
        pairs.append(np.column_stack([order[near], order[near + step]]))
    return np.concatenate(pairs)

"""Joints of elements: cells of the same nodes, faces joined at corners alone, nodes that coincide."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh import NO_ROWS, Mesh, equal_sets, with_rows
from kratos_lite.mesh.centers import keys_of
from kratos_lite.mesh.topology import corners, faces_of
from kratos_lite.solvers.constraints import Constraints
from kratos_lite.typing import Array, Ints

NORMAL = np.array([0.5257311, 0.6180340, 0.5844215])
"""Direction along which nodes are sorted; no plane of a usual mesh is normal to it."""
MOST = 64
"""Nodes at one place that are compared with one another."""


def check_joints(mesh: Mesh) -> list[str]:
    """Warn of elements with the same nodes, and of faces joined at their corners only."""
    faces = mesh.all_faces
    warnings = []
    one, other = equal_sets([(block.nodes, [range(block.nodes.shape[1])]) for block in mesh.blocks])
    count, ids = _pairs(mesh, one, other)
    if count:
        warnings.append(f"{count} elements have the same nodes as another ({ids}): both count")
    open_ = faces.non_conforming()
    count, ids = _pairs(mesh, *(faces.element[chosen] for chosen in open_))
    if count:
        warnings.append(
            f"{count} pairs of elements ({ids}) share the corners of a face but not its further "
            "nodes: the mesh is non-conforming there; use elements of the same order on both sides"
        )
    elements = _halved_squares(mesh)
    count, ids = _pairs(mesh, elements, elements)
    if count:
        warnings.append(
            f"{count} four-sided faces (the first of element {ids.split()[0]}) meet "
            "triangles: the mesh is non-conforming there; put pyramids or wedges between"
        )
    return warnings


def _pairs(mesh: Mesh, one: Ints, other: Ints) -> tuple[int, str]:
    """Return how many pairs of elements there are, and the ids of the first."""
    if not len(one):
        return 0, ""
    a, b = sorted(mesh.element_ids[[one[0], other[0]]].tolist())
    return len(one), f"{a} and {b}"


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


def check_coincident(mesh: Mesh, constraints: Constraints | None = None) -> list[str]:
    """Warn of different nodes at the same place (within 1e-8 of the mean spacing) that nothing ties."""
    used = np.flatnonzero(mesh.used_nodes())
    if len(used) < 2:
        return []
    X, ids = mesh.points[used], mesh.node_ids[used]
    size = max(float(np.ptp(x)) for x in X.T)  # by columns, which is faster
    coincident = _nodes_at_one_place(X, ids, 1e-8 * size / len(used) ** (1 / 3))
    if coincident and constraints is not None:
        ends = constraints.dependents[constraints.owner] // 3, constraints.independents // 3
        pairs = np.unique(np.stack(ends, axis=1), axis=0)
        tied = set(map(frozenset, mesh.node_ids[pairs].tolist()))
        coincident = [pair for pair in coincident if frozenset(pair) not in tied]
    if not coincident:
        return []
    shown = ", ".join(f"{min(pair)} and {max(pair)}" for pair in coincident[:3])
    more = " …" if len(coincident) > 3 else ""
    return [f"{len(coincident)} pairs of nodes coincide ({shown}{more}); they are not joined"]


def _nodes_at_one_place(X: Array, ids: Ints, tolerance: float) -> list[tuple[int, int]]:
    """Return the ids of nodes at the same place."""
    along = X @ NORMAL
    order = np.argsort(along, kind="stable")
    X, along = X[order], along[order]
    pairs: list[tuple[int, int]] = []
    for step in range(1, min(len(X), MOST)):
        close = np.flatnonzero(along[step:] - along[:-step] <= 2 * tolerance)
        if not len(close):
            break
        near = close[(np.abs(X[close + step] - X[close]) <= tolerance).all(axis=1)]
        pairs += [(int(ids[order[i]]), int(ids[order[i + step]])) for i in near]
    return pairs

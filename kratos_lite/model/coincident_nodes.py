"""Coincident nodes: different ones at the same place, which a mesh has where its pieces are not joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.mesh import Mesh
from kratos_lite.solvers.constraint_map import MultiPointConstraint
from kratos_lite.typing import Array, Ints

NORMAL = np.array([0.5257311, 0.6180340, 0.5844215])
"""Direction along which nodes are sorted; no plane of a usual mesh is normal to it."""
MOST = 64
"""Nodes at one place that are compared with one another."""


def check_coincident(mesh: Mesh, constraints: Sequence[MultiPointConstraint] = ()) -> list[str]:
    """Warn of different nodes at the same place (within 1e-8 of the mean spacing) that nothing ties."""
    rows = np.flatnonzero(mesh.used_nodes())
    if len(rows) < 2:
        return []
    X, ids = mesh.points[rows], mesh.node_ids[rows]
    size = max(float(np.ptp(x)) for x in X.T)  # by columns, which is faster
    found = _pairs(X, ids, 1e-8 * size / len(rows) ** (1 / 3))
    if found and constraints:
        pairs = {
            frozenset((c.dependent // 3, independent // 3))
            for c in constraints
            for independent in c.independents
        }
        tied = {frozenset(mesh.node_ids[list(pair)].tolist()) for pair in pairs}
        found = [pair for pair in found if frozenset(pair) not in tied]
    if not found:
        return []
    shown = ", ".join(f"{min(pair)} and {max(pair)}" for pair in found[:3])
    more = " …" if len(found) > 3 else ""
    return [f"{len(found)} pairs of nodes coincide ({shown}{more}); they are not joined"]


def _pairs(X: Array, ids: Ints, tolerance: float) -> list[tuple[int, int]]:
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

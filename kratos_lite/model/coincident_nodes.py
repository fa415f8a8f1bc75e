"""Coincident nodes: different ones at the same place, which a mesh has where its pieces are not joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.mesh import Mesh
from kratos_lite.solvers.constraint_map import MultiPointConstraint
from kratos_lite.typing import Array, Ints, Mask

NORMAL = np.array([0.5257311, 0.6180340, 0.5844215])
"""Direction along which nodes are sorted; no plane of a usual mesh is normal to it."""
MOST = 64
"""Nodes at one place that are compared with one another."""


def check_coincident(mesh: Mesh, used: Mask, constraints: Sequence[MultiPointConstraint] = ()) -> list[str]:
    """Warn of different nodes at the same place (within 1e-8 of the mean spacing) that nothing ties."""
    rows = np.flatnonzero(used & mesh.own_nodes)
    ranks, X, ids = mesh.ranks, mesh.points[rows], mesh.node_ids[rows]
    count = ranks.sum(len(rows))
    low = ranks.min(np.array([x.min(initial=np.inf) for x in X.T]))  # by columns, which is faster
    high = ranks.max(np.array([x.max(initial=-np.inf) for x in X.T]))
    if count < 2:
        return []
    tolerance = 1e-8 * float((high - low).max()) / count ** (1 / 3)
    ties = {frozenset((c.slave // 3, master // 3)) for c in constraints for master in c.masters}
    tied = np.array([mesh.node_ids[sorted(pair)] for pair in ties if len(pair) == 2], dtype=np.int64)
    mine = np.ones(len(rows), dtype=bool)
    if mesh.subdomain is not None:
        X, ids, mine, tied = _sliced(mesh, X, ids, tied.reshape(-1, 2), tolerance)
    found = _pairs(X, ids, mine, tolerance)
    if found and len(tied):
        known = set(map(frozenset, tied.tolist()))
        found = [pair for pair in found if frozenset(pair[1:]) not in known]
    n = ranks.sum(len(found))
    if not n:
        return []
    every = [one for some in ranks.gather(found[:3]) for one in some]
    shown = ", ".join(f"{min(a, b)} and {max(a, b)}" for _, a, b in sorted(every, key=lambda one: one[0])[:3])
    return [f"{n} pairs of nodes coincide ({shown}{' …' if n > 3 else ''}); they are not joined"]


def _pairs(X: Array, ids: Ints, mine: Mask, tolerance: float) -> list[tuple[int, int, int]]:
    """Return places between and ids of nodes at the same place, the first of them of those that are mine."""
    along = X @ NORMAL
    order = np.argsort(along, kind="stable")
    X, along = X[order], along[order]
    pairs: list[tuple[int, int, int]] = []
    for step in range(1, min(len(X), MOST)):
        close = np.flatnonzero(along[step:] - along[:-step] <= 2 * tolerance)
        if not len(close):
            break
        near = close[(np.abs(X[close + step] - X[close]) <= tolerance).all(axis=1) & mine[order[close]]]
        pairs += [(step, int(ids[order[i]]), int(ids[order[i + step]])) for i in near]
    return pairs


def _sliced(mesh: Mesh, X: Array, ids: Ints, tied: Ints, tolerance: float) -> tuple[Array, Ints, Mask, Ints]:
    """Return the nodes in the slice of this rank and a little beyond, which are in it, and the ties of all.

    Slices normal to the direction along which nodes are sorted have about as many nodes each.
    """
    ranks, along = mesh.ranks, X @ NORMAL
    sample = np.sort(
        np.concatenate(ranks.gather(np.quantile(along, np.linspace(0, 1, 33)) if len(X) else along))
    )
    cuts = sample[np.arange(1, ranks.size) * len(sample) // ranks.size]
    home, last = np.searchsorted(cuts, along, side="right"), np.searchsorted(cuts, along - 2 * tolerance)
    near = np.flatnonzero(last < home)  # the slice before may have a node at the same place
    rows, to = np.append(np.arange(len(X)), near), np.append(home, last[near])
    places = np.concatenate(ranks.send(to, X[rows]))
    known = np.concatenate(ranks.send(to, ids[rows]))
    mine = np.concatenate(ranks.send(to, to == home[rows]))
    return places, known, mine, np.concatenate(ranks.gather(tied))

"""Selection: which part, nodes or elements of a mesh a name, a predicate, a mask or indices mean."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.errors import MeshError, nearest
from kratos_lite.mesh.blocks import NO_ROWS, Cells, Part, distinct, mask_of, without_repeats
from kratos_lite.tabular import in_units
from kratos_lite.typing import Array, ArrayLike, Ints
from kratos_lite.validation import finite, of_places, whole_numbers

Where: TypeAlias = "str | Callable[[Array], ArrayLike] | ArrayLike"
"""Nodes by part name, by a point (x, y, z) in m, by a predicate on the points (n, 3), by rows or a mask."""
WhereElements: TypeAlias = "str | int | ArrayLike | None"
"""Elements by part name, by property id, by element indices, or all."""

AT_NODE = 1e-6
"""Distance from a point up to which a node lies at it, as fraction of the size of the mesh."""
ONE_PLACE = 1e-9
"""Distance between nodes at one place, as fraction of the size of the mesh."""
SKEW = np.array([0.5411961, 0.6180340, 0.5702238])
"""A direction along which hardly any two nodes of a mesh are equally far."""
SIDES = {letter + sign: (axis, end) for axis, letter in enumerate("xyz") for end, sign in enumerate("-+")}
"""Names of the sides of the bounding box: axis and end."""


def spread(X: Array, count: int, first: Sequence[int] = (), least: float = 0.0) -> list[int]:
    """Return at most so many rows of points (n, d), spread: first ones, or the outermost, then the farthest.

    What follows is farther than `least` from all before it.
    """
    if not len(X):
        return []
    chosen = list(first) or [int(np.linalg.norm(X - X.mean(axis=0), axis=1).argmax())]
    away = np.min([np.linalg.norm(X - X[row], axis=1) for row in chosen], axis=0)
    while len(chosen) < count and away.max() > least:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(X - X[chosen[-1]], axis=1))
    return chosen[:count]


def find_part(name: Any, parts: Mapping[str, Part], mesh: Cells) -> Part:
    """Return a part by its full name, a side of the bounding box, or the part whose last word the name is."""
    if not isinstance(name, str):
        raise MeshError(
            f"a part is known by its name; got {name!r}: see nodes(where) and add_part(name, where)"
        )
    if name in parts:
        return parts[name]
    if name in SIDES and mesh.whole and np.isfinite(mesh.extent).all():
        return Part(nodes=_side(mesh, *SIDES[name]))
    ends = [full for full in parts if full.rsplit(".", 1)[-1] == name]
    if len(ends) == 1:
        return parts[ends[0]]
    if ends:
        raise MeshError(f"part {name!r} is not unique; write one of {', '.join(ends)}")
    have = ", ".join(part for part in parts if part not in SIDES)
    have = f"have {have} and" if have else "have"
    raise MeshError(f"there is no part {name!r}; {have} the sides x- … z+.{nearest(name, [*parts, *SIDES])}")


def _side(mesh: Cells, axis: int, end: int) -> Ints:
    low, high = mesh.extent[:, axis].tolist()
    return np.flatnonzero(np.abs(mesh.points[:, axis] - (high if end else low)) <= 1e-6 * (high - low))


def find_nodes(where: Callable[[Array], ArrayLike] | ArrayLike, mesh: Cells) -> Ints:
    """Return the indices of nodes by a point, predicate, mask or indices, each once and in this order."""
    points = mesh.points
    if (point := point_of(where)) is not None:
        rows = nodes_at(point, mesh)
        if mesh.whole and not len(rows):
            text = f"there is no node at {point.tolist()} m; {near(point, points)}"
            cure = "choose that one, or read values anywhere in the mesh by result.at(points)"
            raise MeshError(f"{in_units(text, mesh.units)}; {cure}")
        return rows
    n, chosen = len(points), of_places(where, points, "a choice of nodes") if callable(where) else where
    if _is_mask(chosen):
        return _indices(chosen, "nodes", n)
    known = "nodes are chosen by part name, point (x, y, z), predicate, mask or indices; these"
    rows = whole_numbers(chosen, known, error=MeshError)
    return without_repeats(whole_numbers(rows, "node indices", size=n, error=MeshError).ravel())


def point_of(where: Any) -> Array | None:
    """Return the point (3,) in m that a choice of nodes means, or None if it means anything else."""
    if isinstance(where, (tuple, list)):
        if len(where) != 3 or not all(isinstance(x, (int, float, np.number)) for x in where):
            return None
        if all(type(x) is int for x in where):
            point = ", ".join(f"{x}.0" for x in where)
            raise MeshError(
                f"{where} may be a point or three node indices: write ({point}) for the point in m, "
                f"np.array({list(where)}) for the indices"
            )
        if not any(isinstance(x, (float, np.floating)) for x in where):
            return None
    elif not (isinstance(where, np.ndarray) and where.shape == (3,) and where.dtype.kind == "f"):
        return None
    return finite(where, "a point", (3,), error=MeshError)


def nodes_at(point: Array, mesh: Cells) -> Ints:
    """Return the rows of the nodes at a point (3,), nearest first."""
    if not len(mesh.points):
        return NO_ROWS
    (low, high), (along, order) = mesh.extent, mesh.places
    size = float(np.linalg.norm(high - low))
    middle, reach = float((point - low) @ SKEW), 2 * AT_NODE * size
    start, stop = np.searchsorted(along, middle - reach), np.searchsorted(along, middle + reach, side="right")
    rows = np.sort(order[start:stop])
    distance = np.linalg.norm(mesh.points[rows] - point, axis=1)
    rows = rows[np.argsort(distance, kind="stable")][: int((distance <= AT_NODE * size).sum())]
    # all at one place, but not the other side of a thin plate
    apart = np.linalg.norm(mesh.points[rows] - mesh.points[rows[:1]], axis=1)
    return rows[apart <= ONE_PLACE * size]


def near(point: Array, points: Array) -> str:
    """Return which node is near to a point (3,), in words."""
    if not len(points):
        return "there are no nodes"
    distance = np.linalg.norm(points - point, axis=1)
    row = int(distance.argmin())
    return f"the nearest node is that at {points[row].tolist()} m (row {row}), {distance[row]:.3g} m away"


def _is_mask(chosen: Any) -> bool:
    """Return whether a choice is made of True and False."""
    if isinstance(chosen, (list, tuple)):
        return len(chosen) > 0 and all(isinstance(item, (bool, np.bool_)) for item in chosen)
    return getattr(chosen, "dtype", None) == np.bool_


def _indices(mask: Any, what: str, n: int) -> Ints:
    if np.shape(mask) != (n,):
        cure = "; of places X (n, 3) x is X[:, 0]" if what == "nodes" else ""
        raise MeshError(f"a mask of {what} must have shape ({n},); got {np.shape(mask)}{cure}")
    return np.flatnonzero(mask)


def find_elements(where: WhereElements, part: Part | None, mesh: Cells) -> Ints:
    """Return the indices of elements by a part, property id or indices."""
    if isinstance(where, (int, np.integer)) and not isinstance(where, bool):
        ids = np.concatenate([NO_ROWS, *(block.properties for block in mesh.blocks)])
        rows = np.flatnonzero(ids == where)
        if mesh.whole and not len(rows):
            raise MeshError(f"no element has property {where}; the properties are {distinct(ids).tolist()}")
        return rows
    if part is not None:
        rows = part.elements if len(part.elements) else elements_among(part.nodes, mesh)
        if mesh.whole and not len(rows):
            raise MeshError(
                f"part {where!r} has no elements, as none has all its nodes there; name a part of the body, "
                "not of its surface, or give rows of elements"
            )
        return rows
    m = sum(map(len, mesh.blocks))
    if _is_mask(where):
        return _indices(where, "elements", m)
    what = "elements are chosen by part name, property id, mask or indices; these"
    rows = whole_numbers(where, what, ("k",), error=MeshError)
    return whole_numbers(rows, "element indices", size=m, error=MeshError)


def elements_among(nodes: Ints, mesh: Cells) -> Ints:
    """Return the indices of the elements that have all their nodes among these."""
    inside = mask_of(nodes, len(mesh.points))
    rows = (inside[block.nodes].all(axis=1) for block in mesh.blocks)
    return np.flatnonzero(np.concatenate([NO_ROWS, *rows]))

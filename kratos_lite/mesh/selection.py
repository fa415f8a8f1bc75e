"""Selection: which part, nodes or elements of a mesh a name, a predicate, a mask or rows mean."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kratos_lite.errors import MeshError, nearest
from kratos_lite.mesh.blocks import NO_ROWS, Part, distinct, without_repeats
from kratos_lite.mesh.cells import Cells
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import whole_numbers

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Where: TypeAlias = "str | Callable[[Array], ArrayLike] | ArrayLike"
"""Nodes by part name, by a predicate on the points (n, 3), or by node rows or a mask."""
WhereElements: TypeAlias = "str | int | ArrayLike | None"
"""Elements by part name, by property id, by element rows, or all."""

SIDES = {letter + sign: (axis, end) for axis, letter in enumerate("xyz") for end, sign in enumerate("-+")}
"""Names of the sides of the bounding box: axis and end."""


def find_part(name: Any, parts: Mapping[str, Part], points: Array) -> Part:
    """Return a part by its full name, a side of the bounding box, or the part whose last word the name is."""
    if not isinstance(name, str):
        raise MeshError(
            f"a part is known by its name; got {name!r}: see nodes(where) and add_part(name, where)"
        )
    if name in parts:
        return parts[name]
    if name in SIDES and len(points):
        return Part(nodes=_side(points, *SIDES[name]))
    ends = [full for full in parts if full.rsplit(".", 1)[-1] == name]
    if len(ends) == 1:
        return parts[ends[0]]
    if ends:
        raise MeshError(f"part {name!r} is not unique; write one of {', '.join(ends)}")
    have = ", ".join(part for part in parts if part not in SIDES)
    have = f"have {have} and" if have else "have"
    raise MeshError(f"there is no part {name!r}; {have} the sides x- … z+.{nearest(name, parts)}")


def _side(points: Array, axis: int, end: int) -> Ints:
    x = points[:, axis]
    low, high = float(x.min()), float(x.max())
    return np.flatnonzero(np.abs(x - (high if end else low)) <= 1e-6 * (high - low))


def find_nodes(where: Callable[[Array], ArrayLike] | ArrayLike, points: Array) -> Ints:
    """Return the rows of nodes by a predicate, a mask or rows, each once and in the order given."""
    n, chosen = len(points), where(points.copy()) if callable(where) else where
    if getattr(chosen, "dtype", None) == np.bool_ or (isinstance(chosen, (list, tuple)) and _flags(chosen)):
        if np.shape(chosen) != (n,):
            raise MeshError(f"a node mask must have shape ({n},); got {np.shape(chosen)}")
        return np.flatnonzero(chosen)
    rows = whole_numbers(
        chosen, "nodes are chosen by part name, predicate, mask or rows; rows", error=MeshError
    )
    return without_repeats(whole_numbers(rows, "node rows", size=n, error=MeshError).ravel())


def _flags(chosen: Sequence[Any]) -> bool:
    return len(chosen) > 0 and all(isinstance(one, (bool, np.bool_)) for one in chosen)


def find_elements(where: int | ArrayLike, cells: Cells) -> Ints:
    """Return the rows of elements by property id or rows."""
    if isinstance(where, (int, np.integer)) and not isinstance(where, bool):
        ids = np.concatenate([NO_ROWS, *(block.properties for block in cells.blocks)])
        rows = np.flatnonzero(ids == where)
        if not len(rows):
            raise MeshError(f"no element has property {where}; the properties are {distinct(ids).tolist()}")
        return rows
    what = "elements are chosen by part name, property id or rows; rows"
    rows = whole_numbers(where, what, ("k",), error=MeshError)
    return whole_numbers(rows, "element rows", size=sum(map(len, cells.blocks)), error=MeshError)


def elements_among(nodes: Ints, cells: Cells) -> Ints:
    """Return the rows of the elements that have all their nodes among these."""
    inside = np.zeros(len(cells.points), dtype=bool)
    inside[nodes] = True
    rows = (inside[block.nodes].all(axis=1) for block in cells.blocks)
    return np.flatnonzero(np.concatenate([NO_ROWS, *rows]))

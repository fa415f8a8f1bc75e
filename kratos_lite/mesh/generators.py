"""Meshes of simple bodies: a box and a hollow cylinder, of any element of the library."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.formulations import is_unnamed
from kratos_lite.elements.kinematic_linear import UNNAMED
from kratos_lite.errors import InputError
from kratos_lite.mesh import SIDES, Mesh, Part
from kratos_lite.mesh.centers import raise_order
from kratos_lite.shapes import Shape
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import finite

Counts: TypeAlias = tuple[int, int, int]
"""Bricks along x, y, z."""
MOST_NUMBERS = 2**31
"""Nodes of all cells together, which int32 numbers."""


SPLITS: dict[str, list[list[int]]] = {
    "hexahedron": [list(range(8))],
    "wedge": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
    "tetrahedron": [[0, 1, 2, 6], [0, 5, 1, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 4, 5, 6], [0, 7, 4, 6]],
    "pyramid": [[*reversed(face), 8] for face in Hexahedron8.faces],
}
"""Cells of one brick by family; tetrahedra lie around its diagonal 0-6, corner 8 is its center."""


def _grid(cells: Counts, low: Counts, high: Counts) -> tuple[Array, Ints]:
    """Return points of the unit cube and bricks (m, 8), of those between two corners of the grid."""
    axes = [np.arange(a, b + 1) / n for n, a, b in zip(cells, low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape([len(axis) for axis in axes])
    ends = [(slice(0, -1), slice(1, None))[i] for i in (0, 1)]
    corners = [number[ends[i], ends[j], ends[k]].ravel() for i, j, k in (Hexahedron8.nodes > 0).astype(int)]
    return points, np.stack(corners, axis=1)


def cut_bricks(points: Array, bricks: Ints, shape: type[Shape]) -> tuple[Array, Ints]:
    """Return points and cells (m, k) of a shape, with straight edges, into which bricks (b, 8) are cut."""
    split = np.array(SPLITS[shape.cell])
    if shape.cell == "pyramid":
        bricks = np.column_stack([bricks, np.arange(len(bricks)) + len(points)])
        points = np.vstack([points, points[bricks[:, :8]].mean(axis=1)])
    return raise_order(points, bricks[:, split].reshape(-1, split.shape[1]), shape)


def counts_of(cells: Sequence[int]) -> Counts:
    """Return three whole numbers ≥ 1; InputError for anything else."""
    counts = finite(cells, "cells")
    if counts.shape != (3,) or (counts < 1).any() or (counts != counts.round()).any():
        raise InputError(f"cells must be three whole numbers ≥ 1; got {cells}")
    i, j, k = map(int, counts.tolist())
    return i, j, k


def kind_of(element: str) -> tuple[str, type[Shape]]:
    """Return the name of the block of such elements, and their shape; InputError if there are none."""
    if not isinstance(element, str):
        raise InputError(f"element must be a name such as KinematicLinear3D8N; got {element!r}")
    nodes = element.upper().removeprefix("3D")
    if nodes[-1:] == "N" and nodes[:-1].isdigit():
        element = UNNAMED + nodes
    cls = ELEMENTS[element]
    if cls.shape.cell not in SPLITS:
        raise InputError(f"{element} has cell {cls.shape.cell!r}; boxes are made of {', '.join(SPLITS)}")
    return element if is_unnamed(element) else cls.__name__, cls.shape


def unit_cells(
    cells: Counts, shape: type[Shape], low: Counts = (0, 0, 0), high: Counts | None = None
) -> tuple[Array, Ints]:
    """Return points (n, 3) and cells (m, k) of the unit cube, or of the bricks between two corners of it.

    Nodes of the grid come first, by x, y, z, then the centers of bricks, if any, and the nodes between those.
    """
    high = cells if high is None else high
    i, j, k = (b - a for a, b in zip(low, high, strict=True))
    if i * j * k * len(SPLITS[shape.cell]) * len(shape.nodes) >= MOST_NUMBERS:
        what, most = f"a mesh of {i:.6g} × {j:.6g} × {k:.6g} bricks", MOST_NUMBERS // len(shape.nodes)
        raise InputError(f"{what} has more than the {most} cells possible; take fewer")
    return cut_bricks(*_grid(cells, low, high), shape)


def sides_of(unit: Array, sides: dict[str, tuple[int, int]]) -> dict[str, Part]:
    """Return parts by their axis and end in the unit cube."""
    return {name: Part(nodes=np.flatnonzero(unit[:, axis] == end)) for name, (axis, end) in sides.items()}


def box(
    size: Sequence[float] = (1.0, 1.0, 1.0),
    cells: Sequence[int] = (1, 1, 1),
    element: str = "Element3D8N",
    origin: Sequence[float] = (0.0, 0.0, 0.0),
) -> Mesh:
    """Return a box with parts ``x- x+ y- y+ z- z+``, the nodes of its six sides.

    Parameters
    ----------
    size : edge lengths in m, > 0.
    cells : bricks along x, y, z; a brick holds one hexahedron, two wedges or six tetrahedra or pyramids.
    element : name of the element, or its number of nodes, ``"20N"``, which means ``Element3D20N``: it and its
        kin are computed by one that does not lock.
    origin : the corner with the smallest coordinates, m.

    Returns
    -------
    Mesh

    Raises
    ------
    InputError
        If a length or a number of cells is not positive, or there is no such element.

    Examples
    --------
    >>> mesh = box((1, 1, 1), cells=(2, 2, 2), element="KinematicLinear3D20N")
    >>> mesh.n_nodes, mesh.n_elements, len(mesh.nodes("z+"))
    (81, 8, 21)
    """
    corner, lengths = corner_and_lengths(size, origin)
    name, shape = kind_of(element)
    unit, nodes = unit_cells(counts_of(cells), shape)
    return Mesh(corner + unit * lengths, {name: nodes}, parts=sides_of(unit, SIDES))


def corner_and_lengths(size: Sequence[float], origin: Sequence[float]) -> tuple[Array, Array]:
    """Return the corner (3,) and the lengths (3,) of a box; InputError if they make none."""
    lengths, corner = finite(size, "size"), finite(origin, "origin")
    if lengths.shape != (3,) or corner.shape != (3,) or (lengths <= 0).any():
        raise InputError(f"size must be three lengths > 0 m and origin three numbers; got {size}, {origin}")
    return corner, lengths


def annulus(
    inner: float, outer: float, width: float, cells: Sequence[int] = (2, 16, 1), element: str = "Element3D20N"
) -> Mesh:
    """Return a hollow cylinder about z with parts ``inner outer z- z+``.

    Parameters
    ----------
    inner, outer : radii in m, 0 < inner < outer.
    width : length along z in m; z runs from 0 to `width`.
    cells : bricks along the radius, around (≥ 3) and along z.
    element : name of the element, as for `box`; mid-edge nodes lie on the circles.

    Returns
    -------
    Mesh

    Raises
    ------
    InputError
        If the radii, the width or the cells make no hollow cylinder, or there is no such element.

    Examples
    --------
    >>> wheel = annulus(0.1, 0.45, 0.1, cells=(2, 12, 1))
    >>> wheel.n_elements, sorted(wheel.parts)
    (24, ['inner', 'outer', 'z+', 'z-'])
    """
    sizes = finite([inner, outer, width], "inner, outer and width")
    if sizes.shape != (3,) or not (0 < sizes[0] < sizes[1] and sizes[2] > 0):
        raise InputError(f"an annulus needs 0 < inner < outer and width > 0; got {inner}, {outer}, {width}")
    (name, shape), counts = kind_of(element), counts_of(cells)
    if counts[1] < 3:
        raise InputError(f"an annulus needs at least 3 cells around; got {cells[1]}")
    unit, nodes = unit_cells(counts, shape)
    ends = (np.flatnonzero(unit[:, 1] == end) for end in (1, 0))
    seam, start = (rows[np.lexsort((unit[rows, 0], unit[rows, 2]))] for rows in ends)
    target = np.arange(len(unit))
    target[seam] = start
    kept, renumbered = np.unique(target, return_inverse=True)
    unit = unit[kept]
    r = inner + (outer - inner) * unit[:, 0]
    angle = 2 * np.pi * unit[:, 1]
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), width * unit[:, 2]])
    parts = sides_of(unit, {"inner": (0, 0), "outer": (0, 1), "z-": (2, 0), "z+": (2, 1)})
    return Mesh(points, {name: renumbered[nodes]}, parts=parts)

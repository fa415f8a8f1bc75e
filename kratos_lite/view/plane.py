"""Planes that cut a body open: clipped facets and edges, and the section through the cells."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.mesh import Block
from kratos_lite.registry import remembered
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import finite, number, short

COLLAPSED = {
    "hexahedron": (0, 1, 2, 3, 4, 5, 6, 7),
    "wedge": (0, 1, 2, 2, 3, 4, 5, 5),
    "pyramid": (0, 1, 2, 3, 4, 4, 4, 4),
    "tetrahedron": (0, 1, 2, 2, 3, 3, 3, 3),
}
"""Corners of each cell that the corners of a cube are moved to, so that one lattice serves all cells."""
POLYGONS = 6000
"""Cells of lattices to aim at in a section."""
FINEST = 8
ROUNDING = 1e-12
"""Of distances within a cell."""
Corners: TypeAlias = "dict[int, list[tuple[int, int]]]"
CLIPPED_LINES: Corners = {1: [(0, 0), (0, 1)], 2: [(0, 0), (1, 1)]}
CLIPPED_TRIANGLES: Corners = {
    1: [(0, 0), (0, 1), (0, 2), (0, 2)],
    2: [(0, 2), (0, 0), (1, 1), (1, 2)],
    3: [(0, 0), (1, 1), (2, 2), (2, 2)],
}
CUT_TRIANGLES: Corners = {1: [(0, 1), (0, 2)], 2: [(0, 2), (1, 2)]}
CUT_TETRAHEDRA: Corners = {
    1: [(0, 1), (0, 2), (0, 3), (0, 3)],
    2: [(0, 2), (0, 3), (1, 3), (1, 2)],
    3: [(0, 3), (1, 3), (2, 3), (2, 3)],
}
"""See `_parts`."""


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane n·X = offset of the undeformed body; what lies on one side is taken away."""

    normal: Array  # (3,) unit vector
    offset: float  # m
    side: float  # 1 if n·X > offset is taken away, else -1

    def distance(self, X: Array) -> Array:
        """Return how far points (n, 3) lie beyond the plane, (n,) m."""
        return self.side * (X @ self.normal - self.offset)

    def check(self, X: Array) -> None:
        """Raise InputError if the plane leaves nothing of points (n, 3)."""
        if not (self.distance(X) < 0).any():
            low, high = (X @ self.normal).min(), (X @ self.normal).max()
            raise InputError(
                f"clip leaves nothing to draw: along the normal of the plane, at {self.offset:g} m, the body "
                f"spans {low:g} … {high:g} m"
            )


def plane_of(clip: Any, towards: Array, what: str = "clip") -> Plane:
    """Return the plane of ("x", 0.5) or (normal, offset) that opens the body to a viewer in a direction."""
    if isinstance(clip, (str, float, int)) or not hasattr(clip, "__len__") or len(clip) != 2:
        raise InputError(
            f"{what} is a plane, such as ('x', 0.5) or ((1, 1, 0), 0.5), a normal and an offset in m; "
            f"got {short(clip)}"
        )
    axis, offset = clip
    if isinstance(axis, str):
        if axis not in ("x", "y", "z"):
            raise InputError(f"{what}: an axis is x, y or z; got {axis!r}")
        normal = np.eye(3)["xyz".index(axis)]
    else:
        normal = finite(axis, f"the normal of {what}", (3,))
    length = float(np.linalg.norm(normal))
    if length == 0:
        raise InputError(f"the normal of {what} must not be zero")
    sign = -1.0 if normal @ towards < -1e-9 * length else 1.0
    return Plane(normal / length, number(offset, f"the offset of {what}", unit="m") / length, sign)


# ---- parts of simplices ----------------------------------------------------------------------------


def _parts(d: Array, field: Array, simplices: Ints, corners_of: Corners) -> tuple[Ints, Array]:
    """Return cells (p,) and corners (p, k, *) of parts of simplices, where d is linear in each."""
    # `corners_of` says by the number of points with d ≤ 0, which count first, between which points d = 0 is
    # the corner of a part; (i, i) is the point itself.
    inside = d[:, simplices] <= 0
    count = inside.sum(axis=2)
    cells, parts = [], []
    for number_inside, corners in corners_of.items():
        cell, which = np.nonzero(count == number_inside)
        order = np.argsort(~inside[cell, which], axis=1, kind="stable")
        points = np.take_along_axis(simplices[which], order, axis=1)
        ends = [(points[:, i], points[:, j]) for i, j in corners]
        between = [_between(field[cell, a], field[cell, b], d[cell, a], d[cell, b]) for a, b in ends]
        cells.append(cell)
        parts.append(np.stack(between, axis=1))
    return np.concatenate(cells), np.concatenate(parts)


def _between(a: Array, b: Array, d: Array, e: Array) -> Array:
    """Return where d, linear from a to b, is 0."""
    change = d - e
    t = np.where(change == 0, 0.5, d / np.where(change == 0, 1.0, change))
    return a + t[:, None] * (b - a)


def clip_facets(P: Array, d: Array) -> tuple[Array, Ints]:
    """Return the parts of facets (m, 4, 3) with d ≤ 0, d (m, 4) linear, and the facet of each part."""
    inside = d <= 0
    whole = np.flatnonzero(inside.all(axis=1))
    mixed = np.flatnonzero(inside.any(axis=1) & ~inside.all(axis=1))
    owner, parts = _parts(d[mixed], P[mixed], np.array([[0, 1, 2], [0, 2, 3]]), CLIPPED_TRIANGLES)
    return np.concatenate([P[whole], parts]), np.concatenate([whole, mixed[owner]])


def clip_lines(E: Array, d: Array) -> tuple[Array, Ints]:
    """Return the parts of segments (m, 2, 3) with d ≤ 0, d (m, 2) linear, and the segment of each part."""
    owner, parts = _parts(d, E, np.array([[0, 1]]), CLIPPED_LINES)
    return parts, owner


def cut_facets(P: Array, d: Array) -> Array:
    """Return the segments (k, 2, 3) of facets (m, 4, 3) where d (m, 4), linear, is 0."""
    return _parts(d, P, np.array([[0, 1, 2], [0, 2, 3]]), CUT_TRIANGLES)[1]


# ---- sections --------------------------------------------------------------------------------------


@remembered
def _lattice(n: int) -> tuple[Array, Ints, Ints]:
    """Return points of the cube -1 … 1, the tetrahedra of n³ cubes, and the triangles on its sides."""
    steps = np.linspace(-1, 1, n + 1)
    points = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    stride = np.array([(n + 1) ** 2, n + 1, 1])
    first = np.array([i @ stride for i in product(range(n), repeat=3)])
    paths = [np.cumsum([0, *(stride[k] for k in order)]) for order in permutations(range(3))]
    tetrahedra = np.concatenate([first[:, None] + path for path in paths])
    faces = np.concatenate([np.delete(tetrahedra, k, axis=1) for k in range(4)])
    place = points[faces]
    side = ((place == place[:, :1]).all(axis=1) & (np.abs(place[:, 0]) == 1)).any(axis=1)
    return points, tetrahedra, faces[side]


def cut_cells(
    block: Block, distance: Array, nodal: Array, parts: int | None = None
) -> tuple[Ints, Array, Array]:
    """Return the section through the cells of a block where the distance (n,) of its nodes is 0.

    These are the cell (p,) of each polygon, nodal values (n, c) and reference coordinates at its corners
    (p, 4, c + 3), and these values along the edges (k, 2, c + 3) of the cells, each of which is cut into
    `parts` cubed.
    """
    assert block.shape is not None
    shape, d = block.shape, distance[block.nodes]
    # A curved cell reaches beyond its nodes by less than its size.
    reach = 0.25 * np.ptp(d, axis=1) if len(shape.nodes) > shape.corners else 0.0
    crossed = np.flatnonzero((d.min(axis=1) - reach <= 0) & (d.max(axis=1) + reach > 0))
    nodes = block.nodes[crossed]
    n = parts or int(np.clip(np.sqrt(POLYGONS / max(len(crossed), 1)), 1, FINEST))
    points, tetrahedra, sides = _lattice(n)
    xi = Hexahedron8.N(points) @ shape.nodes[list(COLLAPSED[shape.cell])]
    N = shape.N(xi)
    d = d[crossed] @ N.T
    d[np.abs(d) <= ROUNDING * np.abs(d).max(axis=1, keepdims=True)] = 0.0  # a side on the plane is cut once
    field = np.einsum("pa,mac->mpc", N, nodal[nodes])
    field = np.concatenate([field, np.broadcast_to(xi, (*field.shape[:2], 3))], axis=-1)
    cells, corners = _parts(d, field, tetrahedra, CUT_TETRAHEDRA)
    _, edges = _parts(d, field, sides, CUT_TRIANGLES)
    return crossed[cells], corners, edges[np.abs(edges[:, 0] - edges[:, 1]).max(axis=1, initial=0.0) > 0]

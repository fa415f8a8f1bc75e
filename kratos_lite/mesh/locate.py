"""Locate: the elements of a mesh that contain given points, and where in them the points lie."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, MeshError
from kratos_lite.mesh.blocks import NO_ROWS, Cells, with_rows
from kratos_lite.mesh.boxes import BoxTree, cell_boxes, curvature, is_solid, nearest_element
from kratos_lite.shapes import Shape
from kratos_lite.shapes.inverse import inverse_map, outside_by
from kratos_lite.tabular import in_units
from kratos_lite.typing import Array, ArrayLike, Csr, Ints, Mask, Rows
from kratos_lite.validation import finite

POINTS_AT_ONCE = 2**14
"""Points that are searched for together, so that candidates take little memory."""
FEW = 8
"""Points whose boxes are found sooner one by one than by a tree."""
NEAR_EDGE = 1e-6
"""Points this near the boundary of their cell, in reference coordinates, may lie in another as well."""
CURVED = 0.1
"""Curvature above which Newton from the middle of a cell may reach another xi; measured from 0.12 up.

Beside the apex of a pyramid, where the Jacobian has no limit, any curvature suffices.
"""
STARTS = 4
"""Points near nodes of such a cell, those nearest to the point, from which Newton starts again."""


@dataclass(frozen=True, eq=False)
class Located:
    """Points (...) in a mesh: the element that contains each, and where in it the point lies."""

    mesh: Cells  # the mesh
    points: Array  # (..., 3) float, m; the points
    # (...) int, index of the element, the lowest of those that contain the point; -1 outside the mesh
    rows: Ints
    block: Ints  # (...) int, the same as number of the block and row in it; -1 outside
    cell: Ints
    xi: Array  # (..., 3) float, reference coordinates; nan outside

    @property
    def inside(self) -> Mask:
        """Whether each point lies in the mesh, (...)."""
        return self.rows >= 0

    def __getitem__(self, chosen: Any) -> Located:
        """Return some of the points: by number, rows or a mask such as `inside`."""
        parts = (self.points, self.rows, self.block, self.cell, self.xi)
        return Located(self.mesh, *(np.asarray(part[chosen]) for part in parts))

    def require(self) -> Located:
        """Return itself if all points lie in the mesh; MeshError that names the first that does not."""
        outside = np.argwhere(~np.asarray(self.inside))
        if not len(outside):
            return self
        i = tuple(outside[0])
        x = self.points[i]
        which = "the point" if not i else f"point {', '.join(map(str, i))}"
        more = f" (and {len(outside) - 1} more of {self.rows.size})" if len(outside) > 1 else ""
        text = f"{which} at {x.tolist()} m{more} lies outside the mesh, {nearest_element(self.mesh, x)}"
        cure = "move it into the mesh, or choose those inside by the mask mesh.locate(points).inside"
        raise MeshError(f"{in_units(text, self.mesh.units)}; {cure}")

    # ---- values ------------------------------------------------------------------------------

    def interpolate(self, nodal: ArrayLike) -> Array:
        """Return Σ N_a v_a at the points, (..., *), of nodal values v (n, *); nan outside the mesh."""
        values = np.asarray(nodal, dtype=float)
        if values.shape[:1] != (len(self.mesh.points),):
            raise InputError(f"nodal values must have shape ({len(self.mesh.points)}, …); got {values.shape}")
        out = np.full((self.rows.size, *values.shape[1:]), np.nan)
        for at, nodes, N in self._by_block():
            out[at] = np.einsum("ma,ma...->m...", N, values[nodes])
        return out.reshape((*self.rows.shape, *values.shape[1:]))

    def weights(self) -> Csr:
        """Return the shape functions as a sparse matrix W (m, n), one row per point."""
        from scipy.sparse import csr_array

        self.require()
        parts = list(self._by_block())
        rows = np.concatenate([NO_ROWS, *(np.repeat(at, nodes.shape[1]) for at, nodes, _ in parts)])
        columns = np.concatenate([NO_ROWS, *(nodes.ravel() for _, nodes, _ in parts)])
        entries = np.concatenate([np.zeros(0), *(N.ravel() for _, _, N in parts)])
        return csr_array((entries, (rows, columns)), shape=(self.rows.size, len(self.mesh.points)))

    def nodes_and_weights(self, point: int = 0) -> tuple[Ints, Array]:
        """Return the nodes (k,) of the element that contains one point, and their shape functions (k,)."""
        one = self[point] if self.rows.ndim else self
        _, nodes, N = next(one.require()._by_block())
        return nodes[0].astype(np.int64), N[0]

    def _by_block(self) -> Iterator[tuple[Ints, Rows, Array]]:
        """Yield, for each block, points (m,) in it, counted through, nodes (m, k) and N (m, k)."""
        numbers, cells, xi = np.ravel(self.block), np.ravel(self.cell), self.xi.reshape(-1, 3)
        for number, block in enumerate(self.mesh.blocks):
            at = np.flatnonzero(numbers == number)
            if len(at) and block.shape is not None:
                yield at, block.nodes[cells[at]], block.shape.N(xi[at])


def locate(mesh: Cells, points: ArrayLike, search: Search) -> Located:
    """Return the elements that contain points (..., 3), by the inverse isoparametric map."""
    # A tree of bounding boxes gives the candidates of each point, which are tried nearest first.
    x = finite(points, "points to locate")
    if x.shape[-1:] != (3,):
        raise InputError(f"points to locate must have shape (m, 3) or (3,); got {x.shape}")
    flat = x.reshape(-1, 3)
    parts = [search.find(flat[i : i + POINTS_AT_ONCE]) for i in range(0, len(flat), POINTS_AT_ONCE)]
    rows = np.concatenate([NO_ROWS, *(part[0] for part in parts)])
    xi = np.concatenate([np.zeros((0, 3)), *(part[1] for part in parts)])
    block = np.where(rows >= 0, search.block_of(rows), -1)
    cell = np.where(rows >= 0, rows - search.starts[block], -1)
    rows, block, cell = (value.reshape(x.shape[:-1]) for value in (rows, block, cell))
    return Located(mesh, x, rows, block, cell, xi.reshape(x.shape))


class Search:
    """The elements of a mesh, ready to be searched; one without a shape contains nothing."""

    def __init__(self, mesh: Cells) -> None:
        self.points, self.blocks = mesh.points, mesh.blocks
        ends = [0, *(at.stop for _, at in with_rows(mesh.blocks))]
        n, self.starts = ends[-1], np.array(ends[:-1])
        low, high, self.middle = np.full((n, 3), np.inf), np.full((n, 3), -np.inf), np.zeros((n, 3))
        for block, at in with_rows(mesh.blocks):
            if is_solid(block):
                low[at], high[at] = cell_boxes(mesh.points, block)
                self.middle[at] = (low[at] + high[at]) / 2
        self.size = (high - low).max(axis=1, initial=0.0)
        self.boxes = low, high

    @cached_property
    def tree(self) -> BoxTree:
        """The tree of all boxes."""
        return BoxTree(*self.boxes)

    def around(self, x: Array) -> tuple[Ints, Ints]:
        """Return pairs of points and elements in whose boxes they lie; a few points need no tree."""
        if len(x) > FEW:
            return self.tree.around(x)
        low, high = self.boxes
        at, row = np.nonzero(((low <= x[:, None]) & (x[:, None] <= high)).all(axis=2))
        return at, row

    def block_of(self, rows: Ints) -> Ints:
        """Return the number of the block of each element row."""
        return np.searchsorted(self.starts, rows, side="right") - 1

    def find(self, x: Array) -> tuple[Ints, Array]:
        """Return element indices (m,) and xi (m, 3) of points (m, 3); -1 and nan outside."""
        at, row = self.around(x)
        distance = ((x[at] - self.middle[row]) ** 2).sum(axis=1) / self.size[row] ** 2
        order = np.lexsort((row, distance, at))
        at, row = at[order], row[order]
        element, xi = np.full(len(x), -1), np.full((len(x), 3), np.nan)
        first = np.searchsorted(at, np.arange(len(x) + 1))
        tried = first[:-1].copy()
        pending = np.flatnonzero(tried < first[1:])
        while len(pending):
            self._try(x, pending, row[tried[pending]], element, xi)
            tried[pending] += 1
            pending = pending[(element[pending] < 0) & (tried[pending] < first[pending + 1])]
        lost = element[at] < 0
        self._retry(x, at[lost], row[lost], element, xi)
        lower = self._near_edge(element, xi)[at] & (row < element[at])
        order = np.lexsort((-row[lower], at[lower]))  # the lowest row is the last to be written
        self._try(x, at[lower][order], row[lower][order], element, xi)
        return element, xi

    def _by_block(self, rows: Ints) -> Iterator[tuple[type[Shape], Ints, Array]]:
        """Yield, for each block, which of some elements are in it, and their nodes (m, k, 3)."""
        numbers = self.block_of(rows)
        for number, block in enumerate(self.blocks):
            chosen = np.flatnonzero(numbers == number)
            if len(chosen) and block.shape is not None:
                cells = rows[chosen] - self.starts[number]
                yield block.shape, chosen, self.points[block.nodes[cells]]

    def _try(self, x: Array, at: Ints, rows: Ints, element: Ints, xi: Array) -> None:
        """Write element and xi of those points x[at] that lie in the elements in `rows`."""
        hits, where = np.zeros(len(at), dtype=bool), np.zeros((len(at), 3))
        for shape, chosen, X in self._by_block(rows):
            inverse = inverse_map(shape, X, x[at[chosen]])
            hits[chosen], where[chosen] = inverse.inside, inverse.xi
        element[at[hits]], xi[at[hits]] = rows[hits], where[hits]

    def _retry(self, x: Array, at: Ints, rows: Ints, element: Ints, xi: Array) -> None:
        """Try strongly curved cells again from elsewhere; from the middle Newton may reach another xi."""
        for shape, chosen, X in self._by_block(rows):
            if len(shape.nodes) == shape.corners:
                continue
            pyramid = shape.cell == "pyramid"
            curved = curvature(shape, X) > (0 if pyramid else CURVED)
            pending, cells = chosen[curved], X[curved]
            middle = shape.nodes[: shape.corners].mean(axis=0)
            starts = middle + 0.8 * (shape.nodes - middle)  # on the way from there to each node
            images = shape.N(starts) @ cells
            order = ((images - x[at[pending], None]) ** 2).sum(axis=2).argsort(axis=1)
            for start in order.T[: len(starts) if pyramid else STARTS]:
                missing = element[at[pending]] < 0
                pairs = pending[missing]
                inverse = inverse_map(
                    shape, cells[missing], x[at[pairs]], max_iterations=15, start=starts[start[missing]]
                )
                hits = pairs[inverse.inside]
                element[at[hits]], xi[at[hits]] = rows[hits], inverse.xi[inverse.inside]

    def _near_edge(self, element: Ints, xi: Array) -> Mask:
        """Return which points lie so near the boundary of their cell that others may contain them too."""
        near = np.zeros(len(element), dtype=bool)
        for shape, chosen, _ in self._by_block(element):
            near[chosen] = outside_by(shape.cell, xi[chosen]) > -NEAR_EDGE
        return near

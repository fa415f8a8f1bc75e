"""Refinement: cells cut into smaller ones, where they are marked, or raised to quadratic ones.

Neighbors that share an edge or a face differ by one level at most; more cells are cut where needed.  New
points and nodal values follow the isoparametric map of the cell that they are made in.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import MeshError
from kratos_lite.mesh import hanging
from kratos_lite.mesh.blocks import Block, mask_of, with_rows
from kratos_lite.mesh.centers import Centers, Keys, are_among, keys_of, sorted_keys
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.refine_cells import CellRefiner, Cut, name_of
from kratos_lite.mesh.refined_mesh import RefinedMesh
from kratos_lite.mesh.subdivision import across, child_cells, shortest_diagonal, unchanged
from kratos_lite.shapes import Shape
from kratos_lite.shapes.faces import Line3, Quadrilateral8, Quadrilateral9, Triangle6
from kratos_lite.shapes.hexahedra import Hexahedron20
from kratos_lite.shapes.pyramids import Pyramid13
from kratos_lite.shapes.tetrahedra import Tetrahedron4, Tetrahedron10
from kratos_lite.shapes.wedges import Wedge15
from kratos_lite.typing import Array, ArrayLike, Ints, Mask, Rows
from kratos_lite.validation import finite

QUADRATIC: dict[str, type[Shape]] = {
    shape.cell: shape
    for shape in (Line3, Triangle6, Quadrilateral8, Tetrahedron10, Pyramid13, Wedge15, Hexahedron20)
}
"""The quadratic shape of each family with the fewest nodes."""


def refine(mesh: Mesh, elements: ArrayLike | None = None, keep: ArrayLike | None = None) -> RefinedMesh:
    """Return a mesh in which elements are cut into smaller ones of the same type.

    A hexahedron, tetrahedron or wedge gives 8, a pyramid 6 and 4 tetrahedra.  Where a neighbor stays as it
    is, nodes hang: they take what its edge or face interpolates.  Edges along the direction `keep` (3,) stay
    whole, but those of elements beside which such an edge is cut already.
    """
    marked = mask_of(mesh.elements(elements), mesh.n_elements)
    centers = hanging.known_centers(mesh.blocks, mesh.hanging, mesh.n_nodes)
    refiner = CellRefiner(mesh, centers, _target)
    direction = None if keep is None else finite(keep, "keep", (3,), error=MeshError)
    marked, axes = _closed(mesh, centers, marked, direction)
    cut, whole = _cut_entities(mesh, marked), _cut_entities(mesh, marked & (axes < 0))
    return refiner.refined_mesh(
        lambda block, at: _cuts(mesh, block, np.flatnonzero(marked[at]), axes[at][marked[at]]),
        lambda block, at: _condition_cuts(mesh, block, cut, whole, direction),
    )


def _target(block: Block, cell: str) -> tuple[str, type[Shape]]:
    """Return name and shape of the children of a block: of the same order."""
    shape = block.known_shape
    if cell != shape.cell:
        shape = Tetrahedron4 if len(shape.nodes) == shape.corners else Tetrahedron10
        return name_of(block.name, shape), shape
    return block.name, shape


def axes_along(mesh: Mesh, block: Block, direction: Array) -> Ints:
    """Return the axis of each cell (m,) all of whose edges are straight and along a direction (3,), or -1."""
    shape = block.known_shape
    axes = np.full(len(block), -1)
    if shape.cell not in ("hexahedron", "wedge", "quadrilateral", "line"):
        return axes
    pairs = np.array(shape.edges or ((0, 1),))
    steps = np.ptp(shape.nodes[pairs], axis=1) > 0
    for axis in (2,) if shape.cell == "wedge" else range(shape.nodes.shape[1]):
        ends = pairs[steps[:, axis] & (steps.sum(axis=1) == 1)]
        axes[_are_along(mesh, block.nodes[:, ends], direction).all(axis=1)] = axis
    return axes


def _are_along(mesh: Mesh, ends: Ints | Rows, direction: Array) -> Mask:
    """Return which edges, from one of two nodes (..., 2) to the other, are along a direction (3,)."""
    edges = mesh.points[ends[..., 1]] - mesh.points[ends[..., 0]]
    off = np.linalg.norm(np.cross(edges, direction), axis=-1)
    return np.asarray(off <= 1e-6 * np.linalg.norm(edges, axis=-1) * np.linalg.norm(direction))


def _kept_axes(mesh: Mesh, marked: Mask, direction: Array | None) -> Ints:
    """Return the axis (m,) of each marked element along a direction, or -1 without one."""
    axes = np.full(mesh.n_elements, -1)
    for block, at in with_rows(mesh.blocks):
        cells = np.flatnonzero(marked[at])
        if not len(cells):
            continue
        if block.shape is None or block.shape.nodes.shape[1] != 3:
            raise MeshError(f"{mesh.place(block, int(cells[0]))}: cells of this type cannot be refined")
        if direction is not None:
            axes[at.start + cells] = along = axes_along(mesh, block.take(cells), direction)
            if (along < 0).any():
                raise MeshError(f"block {block.name}: not every element has edges along {direction.tolist()}")
    return axes


def _cuts_across(block: Block, cells: Ints, axes: Ints) -> list[Cut]:
    """Return those cells of a block that keep an axis with the children that they are cut into."""
    return [
        (cells[axes == axis], across(block.known_shape.cell, axis))
        for axis in range(3)
        if (axes == axis).any()
    ]


def _cuts(mesh: Mesh, block: Block, cells: Ints, axes: Ints) -> list[Cut]:
    """Return cells of a block, which keep an axis or none, with the children that they are cut into."""
    cuts, cells = _cuts_across(block, cells, axes), cells[axes < 0]
    if not len(cells):
        return cuts
    if block.known_shape.cell != "tetrahedron":
        return [*cuts, (cells, child_cells(block.known_shape.cell))]
    shortest = shortest_diagonal(mesh.points[block.nodes[cells, :4]])
    along = [(cells[shortest == diagonal], child_cells("tetrahedron", diagonal)) for diagonal in range(3)]
    return [cut for cut in along if len(cut[0])]


def _condition_cuts(mesh: Mesh, block: Block, cut: Keys, whole: Keys, direction: Array | None) -> list[Cut]:
    """Return likewise the conditions on edges and faces that are cut, or cut as a whole."""
    shape = block.shape
    if shape is None or shape.cell == "point" or not len(block):
        return []
    keys = keys_of(block.nodes[:, : shape.corners])
    cells = np.flatnonzero(are_among(keys, cut))
    axes = np.full(len(cells), -1)
    if direction is not None:
        axes = axes_along(mesh, block.take(cells), direction)
        axes[are_among(keys[cells], whole)] = -1
    cuts, cells = _cuts_across(block, cells, axes), cells[axes < 0]
    return [*cuts, (cells, child_cells(shape.cell))] if len(cells) else cuts


# ---- one level between neighbors ---------------------------------------------------------------------


def _closed(mesh: Mesh, centers: Centers, marked: Mask, direction: Array | None) -> tuple[Mask, Ints]:
    """Return the marked elements with those that must be cut with them, and the axis (m,) that each keeps.

    An element keeps none if a neighbor has cut one of its edges along it, or if a larger neighbor keeps none:
    the parts of their face, halved in two directions, would not match.
    """
    if mesh.hanging is None:
        return marked, _kept_axes(mesh, marked, direction)
    splits = _splits(mesh, centers)
    parts, keys = _parts_of(splits), _keys_by_element(mesh)
    marked = _spread(marked, keys, parts)
    axes = _kept_axes(mesh, marked, direction)
    if direction is not None:
        for split in splits:
            if split.shape.cell == "line":
                axes[split.elements[_are_along(mesh, split.corners, direction)]] = -1
        axes[_spread(marked & (axes < 0), parts, keys)] = -1
    return marked, axes


def _spread(chosen: Mask, hot: tuple[Keys, Ints], reached: tuple[Keys, Ints]) -> Mask:
    """Return the chosen elements and those that they reach: whose keys `reached` are `hot` ones of chosen."""
    chosen = chosen.copy()
    while True:
        need = reached[1][are_among(reached[0], sorted_keys(hot[0][chosen[hot[1]]])) & ~chosen[reached[1]]]
        if not len(need):
            return chosen
        chosen[need] = True


def _splits(mesh: Mesh, centers: Centers) -> list[hanging.Split]:
    """Return the edges and faces that are split."""
    corner, existing = hanging.is_corner(mesh.blocks, mesh.n_nodes), hanging.existing_keys(mesh.blocks)
    edges = hanging.split_edges(mesh.blocks, centers, corner)
    return [*edges, *hanging.split_faces(mesh.blocks, centers, corner, existing)]


def _parts_of(splits: Sequence[hanging.Split]) -> tuple[Keys, Ints]:
    """Return the keys of the halves and quarters of split edges and faces, and whose these are."""
    parts, owners = [np.zeros(0, dtype=np.uint64)], [np.zeros(0, dtype=np.int64)]
    for split in splits:
        inside = split.children()
        parts += [keys_of(child) for child in inside]
        owners += [split.elements] * len(inside)
    return np.concatenate(parts), np.concatenate(owners)


def _keys_by_element(mesh: Mesh) -> tuple[Keys, Ints]:
    """Return the keys of the edges and faces of all elements, and the element of each."""
    keys, element = [], []
    for block, at in with_rows(mesh.blocks):
        if block.shape is not None and len(block):
            of_block = hanging.entity_keys(block)
            keys.append(of_block.ravel())
            element.append(np.repeat(np.arange(at.start, at.stop), of_block.shape[1]))
    return np.concatenate(keys), np.concatenate(element)


def _cut_entities(mesh: Mesh, marked: Mask) -> Keys:
    """Return the keys of the edges and faces of the elements that are cut."""
    keys = [
        hanging.entity_keys(block.take(marked[at]))
        for block, at in with_rows(mesh.blocks)
        if block.shape is not None and marked[at].any()
    ]
    return sorted_keys(*keys)


# ---- order -------------------------------------------------------------------------------------------


def raised(mesh: Mesh, element_of: Callable[[str], str] | None = None) -> RefinedMesh:
    """Return the same cells as quadratic elements; conditions follow the faces that they lie on."""
    if mesh.hanging is not None:
        raise MeshError("a mesh with hanging nodes keeps its order: raise the order first, then refine")
    names = {block.name: (element_of or quadratic)(block.name) for block in mesh.blocks}
    centered = any(len(ELEMENTS[name].nodes) == 27 for name in names.values())

    def target(block: Block, cell: str) -> tuple[str, type[Shape]]:
        if block.name in names:
            return names[block.name], ELEMENTS[names[block.name]].shape
        shape = Quadrilateral9 if centered and cell == "quadrilateral" else QUADRATIC[cell]
        return name_of(block.name, shape), shape

    def whole(block: Block, at: slice) -> list[Cut]:
        shape = block.shape
        if shape is None or shape.cell == "point" or not len(block):
            return []
        if ELEMENTS[names[block.name]].shape.cell != shape.cell if block.name in names else False:
            raise MeshError(f"{names[block.name]} cannot take the place of {block.name}")
        return [(np.arange(len(block)), [unchanged(shape.cell)])]

    centers = hanging.known_centers(mesh.blocks, None, mesh.n_nodes)
    return CellRefiner(mesh, centers, target).refined_mesh(whole, whole)


def quadratic(name: str) -> str:
    """Return the name of the quadratic element of the same family as an element."""
    shape = ELEMENTS[name].shape
    return name if len(shape.nodes) > shape.corners else name_of(name, QUADRATIC[shape.cell])

"""Opposite faces: across the elements of a mesh, from face to face and from neighbor to neighbor."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from kratos_lite.mesh import NO_ROWS, Block, Faces, Mesh, with_rows
from kratos_lite.mesh.topology import corners, faces_of
from kratos_lite.registry import remembered
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Mask


@remembered
def opposite_of(shape: type[Shape]) -> tuple[int, ...]:
    """Return the face of a cell that shares no corner with each of its faces, -1 where there is none.

    >>> from kratos_lite.shapes.wedges import Wedge6
    >>> opposite_of(Wedge6)
    (1, 0, -1, -1, -1)
    """
    sets = [set(corners(face)) for face in shape.faces]
    return tuple(next((j for j, other in enumerate(sets) if not mine & other), -1) for mine in sets)


class OppositeFaces:
    """All faces of the elements of a mesh, with the neighbor of each and the face opposite in its element.

    Parameters
    ----------
    mesh : points and elements.
    faces : its faces, numbered as they are.
    """

    def __init__(self, mesh: Mesh, faces: Faces) -> None:
        self.mesh, self.faces = mesh, faces

    @cached_property
    def mate(self) -> Ints:
        """The same face of the neighbor; -1 where it has none."""
        mate = np.full(len(self.faces.element), -1)
        mate[self.faces.one], mate[self.faces.other] = self.faces.other, self.faces.one
        return mate

    @cached_property
    def outer(self) -> Mask:
        """Whether a face has no neighbor."""
        return self.mate < 0

    def beyond(self, values: Mask) -> Mask:
        """Return what each face (f,) has on its other side; False where there is nothing."""
        return np.asarray((self.mate >= 0) & values[self.mate])

    def number(self, block: int, face: Ints | int, cells: Ints) -> Ints:
        """Return the numbers of faces, by the number of their block, their face of the cell and cells."""
        blocks = self.mesh.blocks
        start = sum(len(faces_of(before)) * len(before) for before in blocks[:block])
        return start + np.asarray(face) * len(blocks[block]) + cells

    @cached_property
    def opposite(self) -> Ints:
        """The face on the other side of the element, or -1."""
        found, start = [NO_ROWS], 0
        for block, _ in with_rows(self.mesh.blocks):
            other = np.array(opposite_of(block.shape) if block.shape else NO_ROWS)[:, None]
            found.append(np.where(other < 0, -1, start + other * len(block) + np.arange(len(block))).ravel())
            start += found[-1].size
        return np.concatenate(found)

    def corners(self, chosen: Ints) -> Ints:
        """Return the corners (k, 4) of faces; the last one of a triangle stands there twice."""
        found, start = np.empty((len(chosen), 4), dtype=np.int64), 0
        for block, _ in with_rows(self.mesh.blocks):
            table = [corners(columns) for columns in faces_of(block)]
            end = start + len(table) * len(block)
            at = np.flatnonzero((chosen >= start) & (chosen < end))
            if len(at):
                face, cells = np.divmod(chosen[at] - start, len(block))
                columns = np.array([picked + picked[2:3] * (4 - len(picked)) for picked in table])
                found[at] = block.nodes[cells[:, None], columns[face]]
            start = end
        return found

    def centers(self, chosen: Ints) -> Array:
        """Return the means (k, 3) of the corners of faces."""
        X = self.mesh.points[(nodes := self.corners(chosen))]
        triangles = nodes[:, 2] == nodes[:, 3]
        return np.where(triangles[:, None], X[:, :3].mean(axis=1), X.mean(axis=1))

    def nodes(self, chosen: Ints) -> list[Ints]:
        """Return all nodes of each face."""
        found: list[Ints] = [np.zeros(0, dtype=np.int64)] * len(chosen)
        for at, block, columns, cells in self._by_kind(chosen):
            for i, row in zip(at.tolist(), block.nodes[cells][:, list(columns)], strict=True):
                found[i] = row
        return found

    def _by_kind(self, chosen: Ints) -> list[tuple[Ints, Block, tuple[int, ...], Ints]]:
        """Return places in `chosen`, block, columns of the face and cells, for each face of each block."""
        found, start = [], 0
        for block, _ in with_rows(self.mesh.blocks):
            for columns in faces_of(block):
                at = np.flatnonzero((chosen >= start) & (chosen < start + len(block)))
                if len(at):
                    found.append((at, block, columns, chosen[at] - start))
                start += len(block)
        return found

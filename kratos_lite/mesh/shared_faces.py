"""Faces and elements that several ranks hold: how they find them in one another, and what lies across."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.mesh.blocks import with_rows
from kratos_lite.mesh.cells import Cells
from kratos_lite.mesh.topology import corners, faces_of, mixed
from kratos_lite.typing import Ints, Mask, Numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray


class SharedFaces:
    """All faces of the elements of a mesh that ranks share, numbered as its ``all_faces``.

    The keeper of a face, or of an element, is the rank that owns its node with the lowest number: all that
    touches it is there.

    Parameters
    ----------
    mesh : with a subdomain.
    """

    def __init__(self, mesh: Cells) -> None:
        assert mesh.subdomain is not None
        self.mesh, self.ranks = mesh, mesh.subdomain.ranks
        self.numbers, self.offsets = mesh.subdomain.numbers, mesh.subdomain.offsets
        self.faces = mesh.all_faces

    # ---- elements ----------------------------------------------------------------------------------

    @cached_property
    def element_keys(self) -> NDArray[np.uint64]:
        """(m,) a number of each element that follows from its nodes."""
        return _joined([cell_keys(self.numbers[block.nodes]) for block in self.mesh.blocks], np.uint64)

    @cached_property
    def element_keepers(self) -> Ints:
        """(m,) rank that keeps each element."""
        lowest = [self.numbers[block.nodes].min(axis=1) for block in self.mesh.blocks if len(block)]
        return self._owners(_joined(lowest, np.int64))

    # ---- faces -------------------------------------------------------------------------------------

    @cached_property
    def keepers(self) -> Ints:
        """(f,) rank that keeps each face."""
        return self._owners(self._of_corners("lowest", np.int64))

    @cached_property
    def kept(self) -> Mask:
        """(f,) whether this rank keeps a face: each is kept on one rank, with the elements on both sides."""
        return np.asarray(self.keepers == self.ranks.rank)

    @cached_property
    def keys(self) -> NDArray[np.uint64]:
        """(f,) a number of each face as one of its element."""
        return mixed(self._of_corners("keys", np.uint64)) + self.element_keys[self.faces.element]

    def ask_keepers(self, asked: Ints, values: Numbers) -> Any:
        """Return what their keepers have in `values` (f, ...) of some faces (k,)."""

        def answer(keys: Any) -> Numbers:
            return values[places_of(keys, self.keys)]

        return self.ranks.ask(self.keepers[asked], self.keys[asked], answer)

    def _owners(self, numbers: Ints) -> Ints:
        return np.searchsorted(self.offsets, numbers, side="right") - 1

    def _of_corners(self, what: str, dtype: type) -> Any:
        """Return the lowest number, or the key, of the corners of each face."""
        found = []
        for block, _ in with_rows(self.mesh.blocks):
            numbers = self.numbers[block.nodes]
            for face in faces_of(block):
                picked = numbers[:, list(corners(face))]
                found.append(picked.min(axis=1) if what == "lowest" else cell_keys(picked))
        return _joined(found, dtype)


def places_of(wanted: NDArray[np.uint64], keys: NDArray[np.uint64]) -> Ints:
    """Return where each wanted key, of few, stands among many keys; -1 where it does not."""
    order = np.argsort(wanted, kind="stable")
    ordered, found = wanted[order], np.full(len(wanted), -1)
    first = np.searchsorted(ordered, keys)
    here = np.flatnonzero(ordered[np.minimum(first, len(ordered) - 1)] == keys) if len(wanted) else order
    place = np.full(len(wanted) + 1, -1)
    place[first[here]] = here
    start = np.searchsorted(ordered, ordered)  # equal ones are asked for by several ranks
    found[order] = place[start]
    return found


def cell_keys(numbers: Ints) -> NDArray[np.uint64]:
    """Return a number of each set of node numbers (m, k)."""
    total = np.zeros(len(numbers), dtype=np.uint64)
    for column in numbers.T:
        total += mixed(column.astype(np.uint64))
    return total


def _joined(parts: Sequence[Numbers], dtype: type) -> Any:
    return np.concatenate([np.zeros(0, dtype=dtype), *parts])

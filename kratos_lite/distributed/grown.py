"""A subdomain grown by layers of elements that other ranks hold, for what reaches beyond its halo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, Kind, Kinds
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.shared_faces import cell_keys
from kratos_lite.typing import Array, Ints, Mask


class Grown:
    """What a rank holds of a mesh, with some layers of elements around the nodes of its own elements.

    All ranks make it together.

    Parameters
    ----------
    mesh : with a subdomain.
    groups : its elements.
    kinds : of the elements of all ranks, the same on all.
    layers : of elements.

    Attributes
    ----------
    mesh : the grown one, as a whole mesh: its nodes begin with those of the subdomain.
    groups : its elements; those of each kind begin with those of the subdomain.
    rows : for each of the given groups, the rows of its elements in the grown mesh.
    """

    def __init__(self, mesh: Mesh, groups: Sequence[ElementGroup], kinds: Kinds, layers: int) -> None:
        assert mesh.subdomain is not None
        self.share, self.n = mesh.subdomain, mesh.n_nodes
        self.ranks = self.share.ranks
        kinds = [kind for i, kind in enumerate(kinds) if not any(_is_of(kind, one) for one in kinds[:i])]
        self._cells = [_cells_of(groups, kind, self.share.numbers) for kind in kinds]
        stressed = [any(g.prestress is not None for g in groups if _is_of(g, kind)) for kind in kinds]
        self._stressed = self.ranks.any(np.array(stressed, dtype=bool))
        mine = [b.nodes[own].ravel() for b, own in zip(mesh.blocks, _by_block(mesh), strict=True)]
        wanted = np.unique(self.share.numbers[np.concatenate([self.share.own_nodes, *mine])])
        asked = self.share.numbers[self.share.own_nodes]
        for _ in range(layers):
            asked, wanted = self._grow(np.setdiff1d(wanted, asked), asked)
        further = np.setdiff1d(wanted, self.share.numbers)
        self._owners, self._further = self._owner(further), further
        row = np.argsort(np.concatenate([self.share.numbers, further]), kind="stable")
        every = np.concatenate([self.share.numbers, further])[row]
        points = np.concatenate([mesh.points, self._fetched(mesh.points)])
        blocks, self.groups, self.rows, start = [], [], [], 0
        for kind, cells in zip(kinds, self._cells, strict=True):
            nodes = row[np.searchsorted(every, cells.numbers)].astype(np.int32)
            blocks.append(Block(kind.element.__name__, nodes, shape=kind.element.shape))
            rows = np.arange(start, start + len(nodes))
            stress = cells.prestress if self._stressed[len(blocks) - 1] else None
            self.rows.append((cells.rows, rows[: len(cells.rows)]))
            if len(nodes):
                self.groups.append(ElementGroup(kind.element, kind.rule, kind.material, nodes, rows, stress))
            start += len(nodes)
        self.mesh = Mesh(points, blocks)

    def values(self, nodal: Array) -> Array:
        """Return nodal values (N, ...) of the grown mesh from those (n, ...) here; all ranks call it."""
        return np.concatenate([nodal, self._fetched(nodal)])

    def _fetched(self, nodal: Array) -> Array:
        """Return values at the further nodes from those (n, ...) at the nodes of each rank."""
        first, own = self.share.offsets[self.ranks.rank], self.share.own_nodes
        found: Array = self.ranks.ask(
            self._owners, self._further, lambda numbers: nodal[own[numbers - first]]
        )
        return found

    def _owner(self, numbers: Ints) -> Ints:
        return np.searchsorted(self.share.offsets, numbers, side="right") - 1

    def _grow(self, around: Ints, asked: Ints) -> tuple[Ints, Ints]:
        """Take in the elements around some nodes; return all nodes that have theirs, and all nodes."""
        came = self.ranks.send(self._owner(around), around)
        for i, cells in enumerate(self._cells):
            chosen = [cells.touching(numbers) for numbers in came]
            numbers = np.concatenate(self.ranks.exchange([cells.numbers[some] for some in chosen]))
            stress = np.concatenate(self.ranks.exchange([cells.prestress[some] for some in chosen]))
            self._cells[i] = cells.joined(numbers, stress)
        every = [cells.numbers.ravel() for cells in self._cells]
        return np.union1d(asked, around), np.unique(np.concatenate([around, *every]))


@dataclass(frozen=True, eq=False)
class _Cells:
    """Elements of one kind, those here first: numbers (m, k) of their nodes over ranks, prestress (m, 6)."""

    rows: Ints
    numbers: Ints
    prestress: Array

    def touching(self, numbers: Ints) -> Mask:
        """Return which elements of those here have one of some nodes."""
        found = np.zeros(len(self.numbers), dtype=bool)
        if len(numbers):
            found[: len(self.rows)] = np.isin(self.numbers[: len(self.rows)], numbers).any(axis=1)
        return found

    def joined(self, numbers: Ints, prestress: Array) -> _Cells:
        """Return these elements and others, each once."""
        keys = cell_keys(numbers)
        _, first = np.unique(keys, return_index=True)
        new = first[~np.isin(keys[first], cell_keys(self.numbers))]
        return replace(
            self,
            numbers=np.concatenate([self.numbers, numbers[new]]),
            prestress=np.concatenate([self.prestress, prestress[new]]),
        )


def _is_of(group: ElementGroup | Kind, kind: ElementGroup | Kind) -> bool:
    """Return whether the elements of a group are of a kind."""
    same = group.element is kind.element and group.material is kind.material
    return same and (group.rule is kind.rule or np.array_equal(group.rule.points, kind.rule.points))


def _cells_of(groups: Sequence[ElementGroup], kind: ElementGroup | Kind, numbers: Ints) -> _Cells:
    """Return the elements of a kind that are here."""
    mine = [group for group in groups if _is_of(group, kind)]
    none = np.zeros((0, len(kind.element.nodes)), dtype=np.int64)
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *(group.rows for group in mine)])
    stress = [np.zeros((len(g), 6)) if g.prestress is None else g.prestress for g in mine]
    nodes = np.concatenate([none, *(numbers[group.nodes] for group in mine)])
    return _Cells(rows, nodes, np.concatenate([np.zeros((0, 6)), *stress]))


def _by_block(mesh: Mesh) -> list[Mask]:
    ends = np.cumsum([len(block) for block in mesh.blocks])[:-1]
    return np.split(mesh.own_elements, ends)

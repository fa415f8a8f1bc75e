"""Cut: the elements of a mesh in one part for each rank, of equal work and with few neighbors."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.mesh import Block, Faces
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.typing import Array, Ints, Mask

Dependents: TypeAlias = "tuple[Ints, Ints, Array]"
"""Degrees of freedom, others on which they depend, and the weights of these, entry by entry."""
NO_DEPENDENTS: Dependents = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
FEW = 10
"""Elements a part below which METIS leaves some parts empty."""
TILT = 1e-3
"""By how much a cut leans, so that it passes between elements that lie in one plane across the side."""


@dataclass(eq=False)
class Part:
    """The equations of one rank: all elements at its own nodes, and the nodes of these."""

    points: Array  # (n, 3) m
    groups: list[ElementGroup]  # by indices of the points, without initial stress
    own: Ints  # (m,), the nodes whose rows of K this rank has, ascending in `number`
    number: Ints  # (n,) among the nodes with equations of all ranks, ascending by rank; -1 for the others
    free: Mask  # (n, 3); what is neither free nor held depends on free ones
    held: Mask  # (n, 3)
    dependents: Dependents  # of own nodes: 3 · number + axis, others on which they depend, and weights


class Cut:
    """A system of equations cut in parts, one for each rank, by the process that has all of it."""

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], constraints: ConstraintMap, size: int
    ) -> None:
        self.points, self.groups = points, groups
        self.free = np.zeros((len(points), 3), dtype=bool)
        self.free.flat[constraints.free] = True
        self._dependents = dependents_of(constraints)
        self.held = ~self.free
        self.held.flat[self._dependents[0]] = False
        equations = ~self.held.all(axis=1)
        owner = np.where(equations, self._owners(size), size)
        order = np.argsort(owner, kind="stable")
        ends = np.searchsorted(owner[order], np.arange(size + 1))
        self.own = [order[a:b] for a, b in itertools.pairwise(ends)]
        self.is_constrained = len(self._dependents[0]) > 0
        self.number = np.full(len(points), -1, dtype=np.int64)
        self.number[order[: ends[-1]]] = np.arange(ends[-1])

    def _owners(self, size: int) -> Ints:
        """Return the lowest rank with an element at each node."""
        if size == 1:
            return np.zeros(len(self.points), dtype=np.int64)
        parts = parts_of(self.points, self.groups, size)
        owner = np.full(len(self.points), size)
        ends = np.cumsum([len(group) for group in self.groups])[:-1]
        for group, part in zip(self.groups, np.split(parts, ends), strict=True):
            np.minimum.at(owner, group.nodes, part[:, None])
        return owner

    def part(self, rank: int) -> Part:
        """Return the part of one rank."""
        own, here = np.zeros((2, len(self.points)), dtype=bool)
        own[self.own[rank]] = here[self.own[rank]] = True
        touching = [np.asarray(own[group.nodes].any(axis=1)) for group in self.groups]
        groups = [group.take(mask) for group, mask in zip(self.groups, touching, strict=True) if mask.any()]
        for group in groups:
            here[group.nodes] = True
        nodes = np.flatnonzero(here)
        place = np.cumsum(here) - 1
        local = [replace(group, nodes=place[group.nodes].astype(np.int32)) for group in groups]
        dofs, independents, weights = self._dependents
        at = np.flatnonzero(own[dofs // 3])
        dependents = self._equations(dofs[at]), self._equations(independents[at]), weights[at]
        masks = self.free[nodes], self.held[nodes]
        return Part(self.points[nodes], local, place[self.own[rank]], self.number[nodes], *masks, dependents)

    def _equations(self, dofs: Ints) -> Ints:
        return 3 * self.number[dofs // 3] + dofs % 3


def dependents_of(constraints: ConstraintMap) -> Dependents:
    """Return dependent degrees of freedom, each as often as there are free ones on which it depends."""
    if constraints.T is None:
        return NO_DEPENDENTS
    entries, is_free = constraints.T.tocoo(), np.zeros(len(constraints.c), dtype=bool)
    is_free[constraints.free] = True
    chosen = ~is_free[entries.row]
    return entries.row[chosen].astype(np.int64), constraints.free[entries.col[chosen]], entries.data[chosen]


def parts_of(points: Array, groups: Sequence[ElementGroup], size: int) -> Ints:
    """Return the part, 0 … size - 1, of each element: by METIS if `pymetis` is installed, else by halves."""
    # The work of an element is taken as the square of its number of nodes.
    work = np.concatenate([np.full(len(group), group.nodes.shape[1] ** 2) for group in groups])
    if len(work) >= FEW * size and find_spec("pymetis") is not None:
        return metis(groups, work, size)
    centers = np.concatenate([points[group.nodes].mean(axis=1) for group in groups])
    parts = np.zeros(len(work), dtype=np.int64)
    _halve(centers, work, np.arange(len(work)), 0, size, parts)
    return parts


def _halve(centers: Array, work: Ints, cells: Ints, first: int, size: int, parts: Ints) -> None:
    """Give some elements the parts `first` … `first` + `size` - 1, across their longest side."""
    parts[cells] = first
    if size == 1 or not len(cells):
        return
    X = centers[cells]
    sides = np.ptp(X, axis=0)
    axis = int(np.argmax(sides))
    order = np.argsort(X[:, axis] + TILT * (X[:, axis - 1] + TILT * X[:, axis - 2]), kind="stable")
    done = np.cumsum(work[cells[order]])
    lower = size // 2
    at = int(np.searchsorted(done, done[-1] * lower / size, side="right"))
    _halve(centers, work, cells[order[:at]], first, lower, parts)
    _halve(centers, work, cells[order[at:]], first + lower, size - lower, parts)


def metis(groups: Sequence[ElementGroup], work: Ints, size: int) -> Ints:
    """Return the part of each element, by METIS; elements that share a face are neighbors."""
    # Source: Karypis & Kumar, SIAM J. Sci. Comput. 20 (1998) 359-392.
    import pymetis

    blocks = [
        Block("", np.asarray(group.nodes, dtype=np.int32), shape=group.element.shape) for group in groups
    ]
    faces: Any = Faces(blocks)
    one, other = faces.element[faces.one], faces.element[faces.other]
    cells, neighbors = np.concatenate([one, other]), np.concatenate([other, one])
    order = np.argsort(cells, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(cells, minlength=len(work)))])
    graph = pymetis.CSRAdjacency(starts, neighbors[order])
    return np.array(pymetis.part_graph(size, graph, vweights=work).vertex_part, dtype=np.int64)

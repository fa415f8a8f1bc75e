"""Multi-point constraints u[dependent] = Σ weight · u[independent] + constant, and their elimination."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kratos_lite.errors import ModelError
from kratos_lite.typing import Array, Ints, Mask


@dataclass(frozen=True, eq=False)
class Constraints:
    """Linear constraints of degrees of freedom, 3·node + axis.

    The independents of constraint i stand at ``start[i]`` to ``start[i + 1]``.
    """

    dependents: Ints  # (c,)
    start: Ints  # (c + 1,)
    independents: Ints  # (k,)
    weights: Array  # (k,)
    constants: Array  # (c,) m
    symmetric: Mask  # (c,), of one to one: where supports hold the dependent, the independent follows

    @classmethod
    def of(
        cls, dependents: Ints, independents: Ints, weights: Array, constants: Array, symmetric: bool = False
    ) -> Constraints:
        """Return constraints (c,) with as many independents (c, k) each."""
        c, k = independents.shape
        start = np.arange(c + 1) * k
        return cls(dependents, start, independents.ravel(), weights.ravel(), constants, np.full(c, symmetric))

    @classmethod
    def none(cls) -> Constraints:
        """Return no constraints."""
        empty = np.zeros(0, dtype=np.int64)
        return cls.of(empty, empty.reshape(0, 1), np.zeros(0), np.zeros(0))

    def __len__(self) -> int:
        return len(self.dependents)

    def __iter__(self) -> Iterator[tuple[int, Ints, Array, float]]:
        for i, (first, last) in enumerate(pairwise(self.start.tolist())):
            entries = self.independents[first:last], self.weights[first:last]
            yield int(self.dependents[i]), *entries, float(self.constants[i])

    @property
    def owner(self) -> Ints:
        """The constraint of each independent, (k,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    def __add__(self, other: Constraints) -> Constraints:
        start = np.concatenate([self.start, self.start[-1] + other.start[1:]])
        names = ("independents", "weights", "constants", "symmetric")
        both = [np.concatenate([getattr(self, name), getattr(other, name)]) for name in names]
        return Constraints(np.concatenate([self.dependents, other.dependents]), start, *both)

    def take(self, keep: Mask) -> Constraints:
        """Return those of a mask (c,)."""
        entries = keep[self.owner]
        start = np.concatenate([[0], np.cumsum(np.diff(self.start)[keep])])
        return Constraints(
            self.dependents[keep],
            start,
            self.independents[entries],
            self.weights[entries],
            self.constants[keep],
            self.symmetric[keep],
        )

    def renumbered(self, dof_of: Ints) -> Constraints:
        """Return those whose dependents have a new number, by the new numbers of all dofs, or -1."""
        kept = self.take(dof_of[self.dependents] >= 0)
        dofs = dof_of[kept.dependents], kept.start, dof_of[kept.independents]
        return Constraints(*dofs, kept.weights, kept.constants, kept.symmetric)


def eliminate(
    constraints: Constraints, fixed: Mask, values: Array, name: Callable[[int], str]
) -> Constraints:
    """Express every dependent dof by free ones; ModelError for circles and dofs constrained twice."""
    dependents, count = constraints.dependents, len(constraints)
    _check(dependents, fixed.ravel(), name)
    place = np.full(fixed.size, -1)
    place[dependents] = np.arange(count)
    owner, dof, weight = constraints.owner, constraints.independents, constraints.weights
    constants, held = constraints.constants.copy(), fixed.flat[dof]
    np.add.at(constants, owner[held], weight[held] * values.flat[dof[held]])
    owner, dof, weight = _summed(owner[~held], dof[~held], weight[~held])
    for _ in range(count.bit_length() + 1):  # each pass halves the chains of dependents
        chained = place[dof] >= 0
        if not chained.any():
            break
        start = np.searchsorted(owner, np.arange(count + 1))
        inner = place[dof[chained]]
        sizes = np.diff(start)[inner]
        entries = np.repeat(start[inner] - np.cumsum(sizes) + sizes, sizes) + np.arange(sizes.sum())
        change = np.zeros(count)
        np.add.at(change, owner[chained], weight[chained] * constants[inner])
        constants += change
        owner, dof, weight = _summed(
            np.concatenate([owner[~chained], np.repeat(owner[chained], sizes)]),
            np.concatenate([dof[~chained], dof[entries]]),
            np.concatenate([weight[~chained], np.repeat(weight[chained], sizes) * weight[entries]]),
        )
    else:
        at = _on_circle(constraints, place)
        raise ModelError(f"the constraints of {name(at)} form a cycle; remove one of them")
    start = np.searchsorted(owner, np.arange(count + 1))
    return Constraints(dependents, start, dof, weight, constants, np.zeros(count, dtype=bool))


def _check(dependents: Ints, fixed: Mask, name: Callable[[int], str]) -> None:
    """Raise ModelError for dofs that depend twice, or are fixed as well."""
    first = np.unique(dependents, return_index=True)[1]
    if len(first) < len(dependents):
        twice = int(np.delete(dependents, first)[0])
        raise ModelError(f"{name(twice)} depends on others by two constraints; remove one of them")
    if fixed[dependents].any():
        both = int(dependents[fixed[dependents].argmax()])
        raise ModelError(f"{name(both)} is both fixed and dependent by a constraint; do one of the two")


def _summed(owner: Ints, dof: Ints, weight: Array) -> tuple[Ints, Ints, Array]:
    """Return entries in order, those of the same constraint and dof as one."""
    if not len(owner):
        return owner, dof, weight
    order = np.lexsort((dof, owner))
    owner, dof = owner[order], dof[order]
    first = np.flatnonzero(np.append(True, (np.diff(owner) != 0) | (np.diff(dof) != 0)))
    return owner[first], dof[first], np.add.reduceat(weight[order], first)


def _on_circle(constraints: Constraints, place: Ints) -> int:
    """Return a dof that depends on itself: follow those that never end at free ones."""
    ahead: dict[int, list[int]] = {}
    for owner, at in zip(constraints.owner.tolist(), place[constraints.independents].tolist(), strict=True):
        if at >= 0:
            ahead.setdefault(owner, []).append(at)
    while any(set(after) - set(ahead) for after in ahead.values()):
        ahead = {one: kept for one, after in ahead.items() if (kept := [a for a in after if a in ahead])}
    at = next(iter(ahead))
    for _ in ahead:
        at = ahead[at][0]
    return int(constraints.dependents[at])

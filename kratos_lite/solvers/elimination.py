"""Elimination: linear equations of degrees of freedom as dependents of free ones.

All that is prescribed together is a set of linear equations.  Where each has a dependent of its own, not
fixed, and none leads back to itself, chains of dependents are followed to their ends.  Others, and those that
share free degrees of freedom with them, are solved by Gauss's elimination with pivoting: each row takes its
dependent as pivot, or its largest weight if that of the dependent is small, and rows that come first in the
column of their pivot, which may be many, are eliminated at once.  A row of which no free degree of freedom is
left is redundant, or contradicts the others.

Degrees of freedom that carry no equations, as those of reference nodes, are eliminated before all others.

Source: Davis, Rajamanickam & Sid-Lakhdar, Acta Numerica 25 (2016) 383-566 (threshold pivoting, orderings);
Luby, SIAM J. Comput. 15 (1986) 1036-1053 (independent sets by random order).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kratos_lite.errors import ModelError
from kratos_lite.solvers.constraints import Constraints
from kratos_lite.typing import Array, Csr, Ints, Mask

STATED = 0.1
"""Fraction of the largest weight of a row from which the dependent that was stated is its pivot."""
ROUNDING, NOTHING, REDUNDANT = 1e-13, 1e-12, 1e-6
"""Weights that are 0, rows that are, and what is left of a redundant row of its terms that canceled."""
SHOWN, MOST = 4, 1000
"""Equations, and terms of an equation, that an error shows; iterations to find which follow from others."""


def eliminate(constraints: Constraints, fixed: Mask, values: Array) -> Constraints:
    """Express every dependent by free degrees of freedom, where each is one once, not fixed, and no cycle."""
    if not len(constraints):
        return constraints
    from scipy.sparse import diags_array

    W, is_fixed = constraints.matrix(fixed.size), fixed.ravel()
    constants = constraints.constants + W @ np.where(is_fixed, values.ravel(), 0.0)
    W, constants = _followed(W, constants, constraints.dependents)
    W = W @ diags_array(1.0 * ~is_fixed)
    W.eliminate_zeros()
    return Constraints.of_rows(constraints.dependents, W, constants)


def _followed(W: Any, constants: Array, dependents: Ints) -> tuple[Any, Array]:
    """Return W and k of u_d = W u + k without the dependents in u, along all chains of these."""
    from scipy.sparse import diags_array

    # With u_d = W u + P u_d + k, each pass doubles the length of the chains that W and k hold.
    others = np.ones(W.shape[1])
    others[dependents] = 0.0
    if others[W.indices].all():
        return W, constants
    P, W = W[:, dependents], W @ diags_array(others)
    W.eliminate_zeros()
    while P.nnz:
        constants, W, P = constants + P @ constants, W + P @ W, P @ P
    return W, constants


@dataclass(frozen=True, eq=False)
class Redundant:
    """What is left of equations that follow from others: sums of fixed degrees of freedom that must be 0."""

    equations: Constraints  # (c,), the others among them
    dofs: Ints  # (n,), the numbers of the degrees of freedom of these
    free: Mask  # (n,)
    rows: Ints  # (k,), which of these
    weights: Csr  # (k, n + 1), of degrees of freedom and of 1

    def check(self, values: Array, one: float, name: Callable[[int], str], said: str, cure: str) -> None:
        """Raise ModelError where prescribed values, and constants times one, contradict them."""

        def name_of(dof: int) -> str:
            return name(int(self.dofs[dof]))

        every = np.append(values[self.dofs], one)
        limit = REDUNDANT * max(np.abs(values).max(), one * np.abs(self.equations.constants).max())
        for i in np.flatnonzero(np.abs(self.weights @ every) > limit)[:1]:
            rows = self._from_which(int(self.rows[i]))
            equations = list(self.equations)
            texts = [_text(equations[row], name_of) for row in rows[:SHOWN]]
            texts += [f"and {len(rows) - SHOWN} more"] * (len(rows) > SHOWN)
            held = self.weights.indices[slice(*self.weights.indptr[i : i + 2])]
            held = np.sort(held[~np.append(self.free, True)[held]])
            texts += [said.format(name_of(dof), every[dof]) for dof in held[:SHOWN]]
            raise ModelError(f"what is prescribed contradicts itself: {'; '.join(texts)}: {cure}")

    def _from_which(self, row: int) -> Ints:
        """Return an equation and those from which it follows, the weightiest first."""
        from scipy.sparse.linalg import lsqr

        A = _rows(self.equations, len(self.free))[:, np.flatnonzero(self.free)]
        others = np.delete(np.arange(A.shape[0]), row)
        y = np.abs(lsqr(A[others].T, A[[row]].toarray().ravel(), iter_lim=MOST)[0])
        some = np.argsort(-y, kind="stable")[: np.count_nonzero(y > 1e-3 * y.max(initial=0.0))]
        return np.append(row, others[some])


def _text(equation: tuple[int, Ints, Array, float], name: Callable[[int], str]) -> str:
    """Return an equation in words."""
    dependent, others, weights, constant = equation
    terms = [f"{w:g} · " * int(w != 1) + name(dof) for dof, w in zip(others, weights, strict=True)]
    more = [f"{constant:g} m"] * int(constant != 0 or not terms)
    return f"{name(dependent)} = {' + '.join(terms[:SHOWN] + ['…'] * (len(terms) > SHOWN) + more)}"


def independent(constraints: Constraints, fixed: Mask) -> tuple[Constraints, Redundant | None]:
    """Return equal constraints whose dependents are one once, not fixed, without cycles, and the rest.

    Where they are so already, they are returned as they are.
    """
    wrong = _wrong(constraints, fixed.ravel())
    if not wrong.any():
        return constraints, None
    dofs, local = _renumbered(constraints)
    free = ~fixed.ravel()[dofs]
    hard = _together(local, free, wrong)
    solved, rest = _solved(local.take(hard), dofs, free)
    return constraints.take(~hard) + solved, rest


def without(constraints: Constraints, gone: Mask, order: Ints) -> tuple[Constraints, Constraints]:
    """Return constraints in which some degrees of freedom (N,) are replaced, and what these depend on.

    That is said by constraints whose dependents come first in an order (N,).
    """
    some = gone[constraints.dependents]
    some |= np.bincount(constraints.owner, gone[constraints.independents], len(constraints)) > 0
    if not some.any():
        return constraints, Constraints.none()
    from scipy.sparse import csr_array, diags_array

    dofs, local = _renumbered(constraints.take(some))
    solved, rest = _solved(local, dofs, gone[dofs], order[dofs])
    A = csr_array(rest.weights @ diags_array(1.0 * np.append(~gone[dofs], True)))
    kept = abs(A).max(axis=1).toarray().ravel() > NOTHING
    stated = local.dependents[rest.rows[kept]]
    pivot, weight, _ = _pivots(A[kept], np.ones(len(dofs), dtype=bool), stated, 0.0 * stated, 0.0 * stated)
    if not weight.all():
        raise ModelError("equations of nodes that no element uses contradict each other; remove one of them")
    return constraints.take(~some) + _constraints(pivot, _for(pivot, weight, A[kept]), dofs), solved


def _renumbered(constraints: Constraints) -> tuple[Ints, Constraints]:
    """Return the degrees of freedom (n,) that occur, and the constraints by their numbers among these."""
    used = np.bincount(np.concatenate([constraints.dependents, constraints.independents])) > 0
    return np.flatnonzero(used), constraints.renumbered(np.where(used, np.cumsum(used) - 1, -1))


def _wrong(constraints: Constraints, fixed: Mask) -> Mask:
    """Return which constraints (c,) have a dependent that is fixed, or one twice, or form a cycle."""
    dependents, wrong = constraints.dependents, fixed[constraints.dependents]
    times = np.bincount(dependents, minlength=len(fixed))
    wrong |= times[dependents] > 1
    if times[constraints.independents].any():
        from scipy.sparse.csgraph import connected_components

        P = constraints.matrix(len(fixed))[:, dependents]
        P.sum_duplicates()
        label = connected_components(P, connection="strong")[1]
        wrong |= (np.bincount(label)[label] > 1) | (P.diagonal() != 0)
    return wrong


def _together(constraints: Constraints, free: Mask, some: Mask) -> Mask:
    """Return which constraints (c,) share free degrees of freedom with some, or with others that do."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    count, size = len(constraints), len(constraints) + len(free)
    row = np.concatenate([np.arange(count), constraints.owner])
    dof = np.concatenate([constraints.dependents, constraints.independents])
    row, dof = row[free[dof]], dof[free[dof]]
    graph = csr_array((np.ones(len(row)), (row, count + dof)), shape=(size, size))
    label = connected_components(graph, directed=False)[1][:count]
    return np.asarray(np.isin(label, label[some]))


def _rows(constraints: Constraints, n: int) -> Any:
    """Return A (c, n + 1) of A u = 0 with u = 1 at last, the largest weight of a row 1."""
    from scipy.sparse import csr_array, diags_array

    each, terms = np.arange(len(constraints)), (constraints.weights, constraints.constants)
    row = np.concatenate([each, constraints.owner, each])
    dof = np.concatenate([constraints.dependents, constraints.independents, np.full(len(each), n)])
    A = csr_array((np.concatenate([np.ones(len(each)), *map(np.negative, terms)]), (row, dof)))
    size = abs(A[:, :n]).max(axis=1).toarray()
    return csr_array(diags_array(1 / np.where(size > 0, size, 1.0)) @ A)


def _for(pivot: Ints, weight: Array, A: Any) -> Any:
    """Return W (k, n + 1) of u_pivot = W u that rows A u = 0 mean, in which pivots have some weights."""
    from scipy.sparse import csr_array, diags_array

    one = csr_array((np.ones(len(pivot)), pivot, np.arange(len(pivot) + 1)), shape=A.shape)
    return rounded(csr_array(diags_array(-1 / weight) @ A + one))


def _constraints(dependents: Ints, W: Any, dofs: Ints) -> Constraints:
    """Return u[dependents] = W u with u = 1 at last, of some dofs (n,)."""
    n = len(dofs)
    made = Constraints.of_rows(dependents, W[:, :n], W[:, [n]].toarray().ravel())
    return replace(made, dependents=dofs[dependents], independents=dofs[made.independents])


def _solved(
    constraints: Constraints, dofs: Ints, free: Mask, order: Ints | int = 0
) -> tuple[Constraints, Redundant]:
    """Return constraints of some dofs (n,) by elimination with pivoting, and what is redundant.

    Of rows that are as good, those whose dependents come first in an order (n,) give pivots first.
    """
    from scipy.sparse import csr_array, diags_array, vstack

    n, rows, columns = len(free), np.arange(len(constraints)), np.flatnonzero(free)
    chance, lost = np.random.default_rng(0).random(len(rows)), np.zeros(len(rows))
    chance += np.broadcast_to(order, n)[constraints.dependents]
    A, found, left, pivots, redundant = _rows(constraints, n), [], [], [rows[:0]], [rows[:0]]
    while len(rows):
        pivot, weight, first = _pivots(A, free, constraints.dependents[rows], chance[rows], REDUNDANT * lost)
        rest, p = ~first & (weight != 0), pivot[first]
        left.append(A[weight == 0])
        redundant.append(rows[weight == 0])
        pivots.append(p)
        found.append(_for(p, weight[first], A[first]))
        others = np.ones(n + 1)
        others[p] = 0.0
        K, W = A[rest][:, p], _followed(found[-1], np.zeros(len(p)), p)[0]
        before, along = A[rest] @ diags_array(others), K @ W
        A, rows = rounded(csr_array(before + along)), rows[rest]
        # What cancels out of a row says how small the rest of it may be.
        gone = (abs(before) + abs(K) @ abs(W) - abs(A))[:, columns]
        lost = np.maximum(lost[rest], gone.max(axis=1).toarray()) if len(rows) else lost[rest]
    dependents = np.concatenate(pivots)
    W = rounded(_followed(csr_array(vstack(found)), np.zeros(len(dependents)), dependents)[0])
    return _constraints(dependents, W, dofs), Redundant(
        constraints, dofs, free, np.concatenate(redundant), csr_array(vstack(left))
    )


def _pivots(A: Any, free: Mask, stated: Ints, chance: Array, rest: Array) -> tuple[Ints, Array, Mask]:
    """Return pivots of rows and their weights, 0 where only a `rest` is left; and which rows come first."""
    row, entry = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr)), np.append(free, False)[A.indices]
    row, dof, value = row[entry], A.indices[entry], A.data[entry]
    wanted = np.abs(value) * np.where(dof == stated[row], 1 / STATED, 1.0)
    best, size = np.zeros((2, A.shape[0]))
    np.maximum.at(best, row, wanted)
    np.maximum.at(size, row, np.abs(value))
    at, pivot, weight = np.flatnonzero(wanted == best[row])[::-1], 0 * stated, 0.0 * size
    pivot[row[at]], weight[row[at]] = dof[at], value[at]
    weight[size <= rest] = 0.0
    # Large rows come first, then short ones, then any: chains are cut at random, and soon at an end.
    large, long = np.frexp(size)[1], np.frexp(np.bincount(row, minlength=A.shape[0]))[1]
    place, earliest = np.zeros_like(stated), np.full(len(free), A.shape[0])
    place[np.lexsort([chance, long, -large])] = np.arange(A.shape[0])
    some = weight[row] != 0
    np.minimum.at(earliest, dof[some], place[row[some]])
    return pivot, weight, (weight != 0) & (place == earliest[pivot])


def rounded(A: Any) -> Any:
    """Return sparse rows without weights that are 0 but for rounding."""
    A.data[np.abs(A.data) < ROUNDING] = 0.0
    A.eliminate_zeros()
    return A

"""Multi-point constraints over ranks: every rank eliminates all of them, as chains may cross ranks.

They are few, and the result is the same on all ranks.  Degrees of freedom are counted over all ranks here:
3·number + axis, by the numbers of a subdomain.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from kratos_lite.mesh.subdomain import Subdomain
from kratos_lite.solvers.constraint_map import MultiPointConstraint, Slaves, eliminate
from kratos_lite.typing import Array, Ints, Mask


def slaves_over_ranks(
    subdomain: Subdomain,
    constraints: Sequence[MultiPointConstraint],
    fixed: Mask,
    values: Array,
    name: Callable[[int], str],
) -> Slaves:
    """Return the slaves of all ranks by free degrees of freedom; all ranks call it.

    Parameters
    ----------
    subdomain : of this rank.
    constraints : that this rank knows, by its own degrees of freedom; several ranks may give the same one.
    fixed, values : (n, 3) what is prescribed at its nodes; that of their owners counts.
    name : gives the name of a degree of freedom of this rank for messages.

    Raises
    ------
    ModelError
        If a slave is fixed or has two constraints, or constraints form a cycle.
    """
    ranks = subdomain.ranks
    number = numbers_of_dofs(subdomain)
    with ranks.together():
        shared = _shared(ranks.gather([_renumbered(one, number) for one in constraints]))
        named = {dof: name(local) for dof, local in _used(constraints, number).items()}
        names = {dof: text for one in ranks.gather(named) for dof, text in one.items()}
        used = np.array(sorted(names), dtype=np.int64)
        held, at = prescribed_at(subdomain, used, fixed, values)
        place = {int(dof): row for row, dof in enumerate(used)}
        by_place = [_renumbered(one, place) for one in shared]
        found = eliminate(by_place, held, at, lambda row: names[int(used[row])])
    return {
        int(used[slave]): ({int(used[row]): weight for row, weight in terms.items()}, constant)
        for slave, (terms, constant) in found.items()
    }


def local_slaves(subdomain: Subdomain, slaves: Slaves) -> Slaves:
    """Return the slaves on nodes of this rank, by its own degrees of freedom, without masters elsewhere."""
    wanted = [dof for slave, (terms, _) in slaves.items() for dof in (slave, *terms)]
    numbers = numbers_of_dofs(subdomain)
    rows = np.flatnonzero(np.isin(numbers, wanted))
    local = dict(zip(numbers[rows].tolist(), rows.tolist(), strict=True))
    return {
        local[slave]: ({local[dof]: w for dof, w in terms.items() if dof in local}, constant)
        for slave, (terms, constant) in slaves.items()
        if slave in local
    }


def numbers_of_dofs(subdomain: Subdomain) -> Ints:
    """Return the number of each degree of freedom of this rank, (3n,)."""
    return (3 * subdomain.numbers[:, None] + np.arange(3)).ravel()


def prescribed_at(subdomain: Subdomain, dofs: Ints, fixed: Mask, values: Array) -> tuple[Mask, Array]:
    """Return whether and what is prescribed at some degrees of freedom, the same ones on all ranks."""
    first, last = 3 * subdomain.offsets[subdomain.ranks.rank : subdomain.ranks.rank + 2]
    held, at = np.zeros(len(dofs), dtype=bool), np.zeros(len(dofs))
    own = (dofs >= first) & (dofs < last)
    rows = subdomain.own_nodes[(dofs[own] - first) // 3], dofs[own] % 3
    held[own], at[own] = fixed[rows], values[rows]
    return subdomain.ranks.any(held), subdomain.ranks.sum(at)


def _renumbered(constraint: MultiPointConstraint, number: Ints | dict[int, int]) -> MultiPointConstraint:
    masters = tuple(int(number[dof]) for dof in constraint.masters)
    return replace(constraint, slave=int(number[constraint.slave]), masters=masters)


def _used(constraints: Sequence[MultiPointConstraint], number: Ints) -> dict[int, int]:
    """Return the degrees of freedom of constraints: those over all ranks, and those of this rank."""
    return {int(number[dof]): dof for one in constraints for dof in (one.slave, *one.masters)}


def _shared(given: Sequence[Sequence[MultiPointConstraint]]) -> list[MultiPointConstraint]:
    """Return the constraints of all ranks; what several ranks give alike is taken from the first."""
    found: list[MultiPointConstraint] = []
    known: set[MultiPointConstraint] = set()
    for constraints in given:
        found += [one for one in constraints if one not in known]
        known.update(constraints)
    return found

"""Supports: prescribed displacements, prescribed motion in time, and multi-point constraints of a mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.model.fixing import AXES, Fixing, PrescribedMotion, Selected, axis_numbers
from kratos_lite.solvers.constraint_map import (
    ConstraintMap,
    Dependents,
    MultiPointConstraint,
    constraint_map,
    eliminate,
)
from kratos_lite.time_series import function_of
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.validation import finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

UNUSED = "a constraint uses {}, which belongs to no element; remove it"
PRESCRIBED_TWICE = "by a function of time and otherwise; fix it once, or with override=True"


class Supports:
    """What holds a structure: prescribed displacements, prescribed motion and multi-point constraints.

    Attributes
    ----------
    fixed : (n, 3) bool, read-only, which degrees of freedom are prescribed.
    values : (n, 3) float, read-only, their displacements in m, at the time 0 where they move.
    hanging : the constraints of hanging nodes, the first of all.
    motions : the prescribed motion.
    fixings : the calls of `Structure.fix` that all this came from, in order.
    version : counts the changes of what is prescribed, but for values and functions of time.
    value_version : counts all changes.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._fixed: Mask = np.zeros(mesh.points.shape, dtype=bool)
        self._values: Array = np.zeros(mesh.points.shape)
        self.fixed, self.values = self._fixed.view(), self._values.view()
        self.fixed.flags.writeable = self.values.flags.writeable = False
        self.hanging = self._constraints = hanging_constraints(mesh)
        self._hangs = np.zeros(mesh.n_nodes, dtype=bool)
        if mesh.hanging is not None:
            self._hangs[mesh.hanging.nodes] = True
        self.fixings: list[Fixing] = []
        self.motions: tuple[PrescribedMotion, ...] = ()
        self.version = self.value_version = 0
        self._dependents: tuple[int, Dependents] = (-1, {})

    def name(self, dof: int) -> str:
        """Return the readable name of a degree of freedom, 3·node + axis."""
        return f"node {self.mesh.node_ids[dof // 3]} along {AXES[dof % 3]}"

    # ---- prescribed displacements ------------------------------------------------------------------------

    def apply(self, fixing: Fixing) -> None:
        """Prescribe or release what a call of `Structure` asks for; hanging nodes follow others."""
        rows, value = fixing.rows, fixing.value
        if fixing.released:
            self._free(rows, fixing.axes)
            self.fixings.append(fixing)
            return
        stays = ~self._hangs[rows]
        if len(rows) and not stays.any():
            raise ModelError(
                f"cannot fix {fixing.axes}: the nodes, such as {self.mesh.node_ids[rows[0]]}, hang on an "
                "edge or face of a larger element and follow its nodes; fix these"
            )
        if callable(value):
            self.prescribe_motion(rows[stays], fixing.axes, value, fixing.override)
        else:
            if fixing.field is not None:
                value = fixing.field(self.mesh.points[rows])
            value = finite(value, "a prescribed displacement")
            if value.ndim == 2 and len(value) == len(rows):
                value = value[stays]
            self.fix(rows[stays], fixing.axes, value, fixing.override)
        self.fixings.append(fixing)

    @property
    def named(self) -> dict[str, Fixing]:
        """The calls of `Structure.fix` that have a name, by their names."""
        return {fixing.name: fixing for fixing in self.fixings if fixing.name is not None}

    def drop(self, gone: Fixing) -> None:
        """Take back one call of `Structure.fix`; what others prescribe stays."""
        kept = [fixing for fixing in self.fixings if fixing is not gone]
        self.motions = ()
        self._fixed[:], self._values[:] = False, 0.0
        self.version += 1
        self.value_version += 1
        for fixing in kept:
            self.apply(replace(fixing, override=True))
        self.fixings = kept

    def release(self, where: Selected, rows: Ints, axes: str) -> None:
        """Release nodes along axes, whatever has prescribed them; ModelError if nothing has."""
        held = self.fixed[np.ix_(rows, np.array(axis_numbers(axes)))].any()
        if self.mesh.whole and not held:
            raise ModelError(f"nothing is prescribed along {axes} there, so that nothing is released")
        self.apply(Fixing(where, rows, axes, 0.0, None, True, released=True))

    def _free(self, rows: Ints, axes: str) -> None:
        numbers = axis_numbers(axes)
        at = np.ix_(rows, np.array(numbers))
        self._end_motion(rows, numbers, None, override=True)
        self._fixed[at], self._values[at] = False, 0.0
        self.version += 1
        self.value_version += 1

    def __str__(self) -> str:
        tied = [f"{len(self.constraints)} constraints"] if self.constraints else []
        return "\n".join([*map(str, self.fixings), *tied]) or "none"

    def fix(self, rows: Ints, axes: str, value: ArrayLike = 0.0, override: bool = False) -> None:
        """Prescribe the displacement of nodes along axes."""
        numbers = axis_numbers(axes)
        new = finite(value, "a prescribed displacement")
        try:
            new = np.broadcast_to(new, (len(rows), len(numbers)))
        except ValueError:
            raise InputError(
                f"value must be one number, {len(numbers)} numbers (one per axis of {axes!r}) "
                f"or have shape ({len(rows)}, {len(numbers)}); got shape {new.shape}"
            ) from None
        at = np.ix_(rows, np.array(numbers))
        clash = self.fixed[at] & (self.values[at] != new)
        if clash.any() and not override:
            i, j = np.argwhere(clash)[0]
            dof = int(3 * rows[i] + numbers[j])
            raise ModelError(
                f"{self.name(dof)} is prescribed twice: {self.values.flat[dof]:g} m and {new[i, j]:g} m; "
                "fix it once, or with override=True"
            )
        self._end_motion(rows, numbers, None, override)
        self._prescribe(at, new)

    def prescribe_motion(
        self, rows: Ints, axes: str, function: Callable[[float], float], override: bool = False
    ) -> None:
        """Prescribe the displacement of nodes along axes as a function of time; see `fix`."""
        numbers, checked = axis_numbers(axes), function_of(function, "a prescribed displacement")
        start = checked(0.0)
        resting = self.fixed.copy()
        for motion in self.motions:
            resting[motion.rows, motion.axis] = False
        at = np.ix_(rows, np.array(numbers))
        i, j = np.nonzero(resting[at])
        if len(i) and not override:
            dof = 3 * int(rows[i[0]]) + numbers[j[0]]
            raise ModelError(f"{self.name(dof)} is prescribed twice: {PRESCRIBED_TWICE}")
        self._end_motion(rows, numbers, function, override)
        self._prescribe(at, start)
        self.motions += tuple(PrescribedMotion(rows, axis, checked, function) for axis in numbers)

    def _prescribe(self, at: tuple[Ints, ...], value: ArrayLike) -> None:
        """Set values, and count the change."""
        self.version += not self.fixed[at].all()
        self.value_version += 1
        self._fixed[at] = True
        self._values[at] = value

    def _end_motion(self, rows: Ints, axes: list[int], given: object, override: bool) -> None:
        """Take nodes out of the motion that they have along axes, unless the same function is given again."""
        kept = []
        for old in self.motions:
            again = np.isin(old.rows, rows) & (old.axis in axes)
            if again.any() and not override and old.given is not given:
                dof = 3 * int(old.rows[again][0]) + old.axis
                raise ModelError(f"{self.name(dof)} is prescribed twice: {PRESCRIBED_TWICE}")
            kept.append(replace(old, rows=old.rows[~again]))
        self.motions = tuple(old for old in kept if len(old.rows))

    def _function(self, dof: int) -> object:
        """Return the function of time of a degree of freedom, as the caller gave it, or None."""
        node, axis = divmod(dof, 3)
        mine = (m.given for m in self.motions if m.axis == axis and (m.rows == node).any())
        return next(mine, None)

    # ---- multi-point constraints ------------------------------------------------------------------------

    @property
    def constraints(self) -> tuple[MultiPointConstraint, ...]:
        """The multi-point constraints."""
        return self._constraints

    @constraints.setter
    def constraints(self, constraints: Iterable[MultiPointConstraint]) -> None:
        self._constraints = tuple(constraints)
        self.version += 1
        self.value_version += 1

    def dependents(self) -> Dependents:
        """Return the dependents of all constraints by free degrees of freedom."""
        if self._dependents[0] != self.value_version:
            self._dependents = self.value_version, self._eliminated(self.values, agree=True)
        return self._dependents[1]

    def _eliminated(self, values: Array, agree: bool) -> Dependents:
        """Return the dependents for prescribed values; those of symmetric ties must agree if requested."""
        return eliminate(self._ties(agree), self.fixed, values, self.name)

    def _ties(self, agree: bool) -> list[MultiPointConstraint]:
        """Return the constraints, symmetric ties with a node that supports hold as independent.

        With `agree`, ModelError where supports move both nodes of a tie, and not alike.
        """
        turned = [self._turned(c, agree) if c.symmetric else c for c in self.constraints]
        return [c for c in turned if c]

    def _turned(self, tie: MultiPointConstraint, agree: bool) -> MultiPointConstraint | None:
        """Return a symmetric tie, what supports hold as independent; None if they hold both alike."""
        dependent, (independent,) = tie.dependent, tie.independents
        if not self.fixed.flat[dependent]:
            return tie
        if not self.fixed.flat[independent]:
            return MultiPointConstraint(independent, (dependent,), (1.0,))
        one, other = self.values.flat[dependent], self.values.flat[independent]
        both = f"{self.name(dependent)} and {self.name(independent)} are tied, but"
        if agree and self._function(dependent) is not self._function(independent):
            raise ModelError(f"{both} move differently: give both the same function, or fix only one of them")
        if agree and one != other:
            raise ModelError(
                f"{both} prescribed as {one:g} m and {other:g} m: give both the same value, or fix one only"
            )
        return None

    def check_used(self, used: Mask) -> list[str]:
        """Raise ModelError for constraints of nodes that no element uses, by the mask (n,) of those used."""
        dofs = np.array(
            [dof for dependent, (terms, _) in self.dependents().items() for dof in (dependent, *terms)], int
        )
        unused = dofs[~used[dofs // 3]]
        if len(unused):
            raise ModelError(UNUSED.format(self.name(int(unused[0]))))
        return []

    # ---- for the equations ------------------------------------------------------------------------------

    def constraint_map(self, nodes: Ints, values: Array | None = None) -> ConstraintMap:
        """Return the constraint map of the degrees of freedom of some nodes, renumbered in order."""
        fixed, u = self.fixed, self.values if values is None else values
        dependents = None
        if self.constraints:
            found = self.dependents() if values is None else self._eliminated(values, agree=False)
            dependents = self._renumbered(found, nodes)
        if len(nodes) < len(fixed):
            fixed, u = fixed[nodes], u[nodes]
        return constraint_map(fixed, u, dependents)

    def _renumbered(self, dependents: Dependents, nodes: Ints) -> Dependents:
        """Return the dependents on some nodes by the degrees of freedom of these."""
        row = np.full(self.mesh.n_nodes, -1)
        row[nodes] = np.arange(len(nodes))

        def dof(old: int) -> int:
            new = int(row[old // 3])
            if new < 0:
                raise ModelError(
                    f"a constraint uses {self.name(old)}, which belongs to no element; remove it"
                )
            return 3 * new + old % 3

        return {
            dof(dependent): ({dof(independent): weight for independent, weight in terms.items()}, constant)
            for dependent, (terms, constant) in dependents.items()
            if row[dependent // 3] >= 0
        }

    def supported(self, residual: Array) -> Array:
        """Return a residual (n, 3) where supports or constraints act, and 0 elsewhere."""
        acts = self.fixed.copy()
        acts.flat[[dof for c in self.constraints for dof in (c.dependent, *c.independents)]] = True
        return np.where(acts, self.on_independents(residual), 0.0)

    def on_independents(self, forces: Array) -> Array:
        """Return nodal forces (n, 3) with those on hanging nodes passed on to their independents."""
        return forces if self.mesh.hanging is None else self.mesh.hanging.gather(forces)

    def constraint_rows(self) -> tuple[Ints, Ints, Array]:
        """Return all that is prescribed, but its values, as sparse rows of equations: (row, dof, weight)."""
        fixed = np.flatnonzero(self.fixed)
        row, dof, weight = [np.arange(len(fixed))], [fixed], [np.ones(len(fixed))]
        for r, constraint in enumerate(self.constraints, start=len(fixed)):
            row.append(np.full(1 + len(constraint.independents), r))
            dof.append(np.array([constraint.dependent, *constraint.independents], dtype=np.int64))
            weight.append(np.array([1.0, *(-w for w in constraint.weights)]))
        return np.concatenate(row), np.concatenate(dof), np.concatenate(weight)


def hanging_constraints(mesh: Mesh) -> tuple[MultiPointConstraint, ...]:
    """Return the constraints that keep the displacement continuous at the hanging nodes of a mesh."""
    return tuple(
        MultiPointConstraint(
            3 * node + axis, tuple((3 * independents + axis).tolist()), tuple(weights.tolist())
        )
        for node, independents, weights in mesh.hanging or ()
        for axis in range(3)
    )

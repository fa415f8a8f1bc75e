"""Supports: prescribed displacements, also as functions of time, and multi-point constraints of a mesh."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh, Where
from kratos_lite.model.equal import key_of
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

AXES = "xyz"
CONSTANT = -1
"""In place of the number of a function of time."""


def axis_numbers(axes: str) -> list[int]:
    """Return the axis numbers of a word such as ``"xz"``.

    >>> axis_numbers("xz")
    [0, 2]
    """
    known = isinstance(axes, str) and axes and set(axes) <= set(AXES)
    if not known or len(set(axes)) != len(axes):
        raise InputError(f"axes must be some of x, y, z, each once, such as 'xz'; got {axes!r}")
    return [AXES.index(a) for a in axes]


@dataclass(frozen=True, eq=False)
class DirichletCondition:
    """One call of `Structure.fix` or `Structure.release`, from which a refined mesh is supported alike.

    Attributes
    ----------
    where, nodes : the nodes as the caller chose them, and their indices.
    axes : such as ``"xz"``.
    value : m; as the caller gave it, or a function of time in s.
    field : function of places, or None.
    override : whether it replaces earlier ones.
    name : of the support, or None.
    released : whether the nodes are released along the axes instead.
    """

    where: Where
    nodes: Ints
    axes: str
    value: ArrayLike | Callable[[float], float] = 0.0
    field: Callable[[Array], ArrayLike] | None = None
    override: bool = False
    name: str | None = None
    released: bool = False

    def __str__(self) -> str:
        where = self.where if isinstance(self.where, str) else f"{len(self.nodes)} nodes"
        if self.released:
            return f"{where}: {self.axes} released"
        value = "by a field" if self.field is not None else "as a function of time"
        if not callable(self.value) and self.field is None:
            value = f"= {self.value:g} m" if isinstance(self.value, (int, float)) else "by values"
        return f"{self.name + ': ' if self.name else ''}{where}, {self.axes} {value}"

    @property
    def key(self) -> Hashable:
        """What equal calls share."""
        return key_of([self.nodes, self.axes, self.value, self.field])


class Supports:
    """What supports a structure: Dirichlet conditions, constant or functions of time, and constraints.

    Attributes
    ----------
    fixed : (n, 3) bool, read-only, which degrees of freedom are prescribed.
    values : (n, 3) float, read-only, their displacements in m, at the time 0 where they move.
    conditions : the Dirichlet conditions that these came from, in order.
    hanging : the constraints of hanging nodes, the first of all.
    version : counts the changes of what is prescribed, but for values and functions of time.
    value_version : counts all changes.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._fixed: Mask = np.zeros(mesh.points.shape, dtype=bool)
        self._values: Array = np.zeros(mesh.points.shape)
        self._function = np.full(mesh.points.shape, CONSTANT, dtype=np.int32)
        self._functions: list[tuple[object, Callable[[float], float]]] = []
        self.fixed, self.values = self._fixed.view(), self._values.view()
        self.fixed.flags.writeable = self.values.flags.writeable = False
        self.hanging = self._constraints = hanging_constraints(mesh)
        self._hangs = np.zeros(mesh.n_nodes, dtype=bool)
        if mesh.hanging is not None:
            self._hangs[mesh.hanging.nodes] = True
        self.conditions: list[DirichletCondition] = []
        self.version = self.value_version = 0
        self._dependents: tuple[int, Dependents] = (-1, {})

    def __str__(self) -> str:
        tied = [f"{len(self.constraints)} constraints"] if self.constraints else []
        return "\n".join([*map(str, self.conditions), *tied]) or "none"

    def name(self, dof: int) -> str:
        """Return the readable name of a degree of freedom, 3·node + axis."""
        return f"node {self.mesh.node_ids[dof // 3]} along {AXES[dof % 3]}"

    def dof(self, where: tuple[int, str]) -> int:
        """Return the number of a degree of freedom (node index, axis letter)."""
        node, axis = where if isinstance(where, tuple) and len(where) == 2 else (None, None)
        known = isinstance(node, (int, np.integer)) and 0 <= node < self.mesh.n_nodes
        if not known or axis not in tuple(AXES):
            raise InputError(f"a degree of freedom is (node index, axis letter); got {where!r}")
        return 3 * int(where[0]) + AXES.index(where[1])

    # ---- Dirichlet conditions ----------------------------------------------------------------------------

    @property
    def named(self) -> dict[str, DirichletCondition]:
        """The conditions that have a name, by their names."""
        return {condition.name: condition for condition in self.conditions if condition.name is not None}

    def add(self, condition: DirichletCondition) -> None:
        """Add a condition: one with the name of another replaces this, if it is to override."""
        old = self.named.get(condition.name or "")
        if old and old.key == condition.key:
            return
        if old and not condition.override:
            raise ModelError(
                f"there is another support {old.name!r} already, {old}; replace it by override=True, or take "
                f"it away by model.release({old.name!r})"
            )
        self._apply(condition)
        self.conditions.append(condition)
        if old:
            self.drop(old)

    def drop(self, condition: DirichletCondition) -> None:
        """Take a condition away; what others prescribe stays."""
        self.conditions = [other for other in self.conditions if other is not condition]
        self._fixed[:], self._values[:], self._function[:] = False, 0.0, CONSTANT
        self.version += 1
        self.value_version += 1
        for other in self.conditions:
            self._apply(replace(other, override=True))

    def _apply(self, condition: DirichletCondition) -> None:
        """Prescribe or release what a condition says; hanging nodes follow others."""
        nodes, axes, value, function = condition.nodes, condition.axes, condition.value, CONSTANT
        numbers = axis_numbers(axes)
        if condition.released:
            at = np.ix_(nodes, np.array(numbers))
            self._fixed[at], self._values[at], self._function[at] = False, 0.0, CONSTANT
            self.version += 1
            self.value_version += 1
            return
        follows = self._hangs[nodes]
        if len(nodes) and follows.all():
            raise ModelError(
                f"cannot fix {axes}: the nodes, such as {self.mesh.node_ids[nodes[0]]}, hang on an "
                "edge or face of a larger element and follow its nodes; fix these"
            )
        if callable(value):
            function, value = self._number(value)
        elif condition.field is not None:
            value = condition.field(self.mesh.points[nodes])
        new = finite(value, "a prescribed displacement")
        try:
            new = np.broadcast_to(new, (len(nodes), len(numbers)))[~follows]
        except ValueError:
            raise InputError(
                f"value must be one number, {len(numbers)} numbers (one per axis of {axes!r}) "
                f"or have shape ({len(nodes)}, {len(numbers)}); got shape {new.shape}"
            ) from None
        at = np.ix_(nodes[~follows], np.array(numbers))
        if not condition.override:
            self._check_prescribed_once(at, new, function)
        self.version += not self.fixed[at].all()
        self.value_version += 1
        self._fixed[at], self._values[at], self._function[at] = True, new, function

    def _number(self, function: Callable[[float], float]) -> tuple[int, float]:
        """Return the number of a function of time, and its value at the time 0."""
        checked = function_of(function, "a prescribed displacement")
        start = checked(0.0)
        for number, (known, _) in enumerate(self._functions):
            if known is function:
                return number, start
        self._functions.append((function, checked))
        return len(self._functions) - 1, start

    def _check_prescribed_once(self, at: tuple[Ints, ...], new: Array, function: int) -> None:
        """Raise ModelError if degrees of freedom have another value, or another function of time."""
        differs = (self._function[at] != function) | ((self.values[at] != new) & (function == CONSTANT))
        clash = np.argwhere(self.fixed[at] & differs)
        for i, j in clash[:1]:
            dof = int(3 * at[0][i, 0] + at[1][0, j])
            how = f"{self.values.flat[dof]:g} m and {new[i, j]:g} m"
            if function != CONSTANT or self._function.flat[dof] != CONSTANT:
                how = "by a function of time and otherwise"
            raise ModelError(
                f"{self.name(dof)} is prescribed twice: {how}; fix it once, or with override=True"
            )

    @property
    def motions(self) -> list[tuple[Callable[[float], float], Mask]]:
        """Functions of the time in s that return m, each with the degrees of freedom (n, 3) that it moves."""
        moved = [(function, self._function == number) for number, (_, function) in enumerate(self._functions)]
        return [(function, mask) for function, mask in moved if mask.any()]

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

    def constrain(
        self, dependent: tuple[int, str], independents: Mapping[tuple[int, str], float], constant: float
    ) -> None:
        """Add the constraint u[dependent] = Σ weight · u[independent] + constant; see `Structure`."""
        if not isinstance(independents, Mapping):
            raise InputError(
                f"independents must map (node index, axis letter) to a weight; got {independents!r}"
            )
        weights = finite(list(independents.values()), "weights of a constraint").tolist()
        offset = float(finite(constant, "the constant of a constraint"))
        constraint = MultiPointConstraint(
            self.dof(dependent), tuple(map(self.dof, independents)), tuple(weights), offset
        )
        self.constraints = (*self.constraints, constraint)

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
        if agree and self._function.flat[dependent] != self._function.flat[independent]:
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
            name = self.name(int(unused[0]))
            raise ModelError(f"a constraint uses {name}, which belongs to no element; remove it")
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
            return 3 * int(row[old // 3]) + old % 3

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

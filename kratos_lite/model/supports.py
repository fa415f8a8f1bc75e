"""Supports: prescribed displacements, also as functions of time, and multi-point constraints of a mesh."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import NO_ROWS, Mesh, Where
from kratos_lite.model.loads.base import key_of
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.model.ties import Coupling, PartTie
from kratos_lite.solvers.constraints import ConstraintMap, Constraints, constraint_map
from kratos_lite.solvers.elimination import Redundant, eliminate, independent, without
from kratos_lite.time_series import function_of
from kratos_lite.typing import Array, ArrayLike, Csr, Ints, Mask
from kratos_lite.validation import finite, number, short, whole_numbers

AXES = "xyz"
CONSTANT = -1
"""In place of the number of a function of time."""
AXIAL = 1e-12
"""Weight below which a component along a local axis is one along x, y or z."""


def axis_numbers(axes: str, letters: str = AXES) -> list[int]:
    """Return the axis numbers of a word such as ``"xz"``."""
    known = isinstance(axes, str) and axes and set(axes) <= set(letters)
    if not known or len(set(axes)) != len(axes):
        some = f"some of {', '.join(letters)}, each once, such as '{letters[0]}{letters[2]}'"
        raise InputError(f"axes must be {some}; got {axes!r}")
    return [letters.index(a) for a in axes]


@dataclass(frozen=True, eq=False)
class DirichletCondition:
    """One call of `Structure.fix` or `Structure.release`, from which a refined mesh is supported alike."""

    where: Where  # the nodes as the caller chose them, and their indices
    nodes: Ints
    axes: str  # such as ``"xz"``
    value: ArrayLike | Callable[[float], Any] = 0.0  # m; as the caller gave it, or a function of time in s
    field: Callable[[Array], ArrayLike] | None = None  # function of places, or None
    override: bool = False  # whether it replaces earlier ones
    name: str | None = None  # of the support, or None
    released: bool = False  # whether the nodes are released along the axes instead
    local: LocalAxes | None = None  # whose letters the axes are, or None

    def __str__(self) -> str:
        where = self.where if isinstance(self.where, str) else f"{len(self.nodes)} nodes"
        if self.released:
            return f"{where}: {self.axes} released"
        value = "by a field" if self.field is not None else "as a function of time"
        if not callable(self.value) and self.field is None:
            value = f"= {self.value:g} m" if isinstance(self.value, (int, float)) else "by values"
        axes = self.axes if self.local is None else f"{self.axes} of {self.local}"
        return f"{self.name + ': ' if self.name else ''}{where}, {axes} {value}"

    @property
    def key(self) -> Hashable:
        """What equal calls share."""
        return key_of([self.nodes, self.axes, self.value, self.field, repr(self.local)])


class Supports:
    """What supports a structure: Dirichlet conditions, constant or functions of time, and constraints."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._fixed: Mask = np.zeros(mesh.points.shape, dtype=bool)
        self._values: Array = np.zeros(mesh.points.shape)
        self._function = np.full(mesh.points.shape, CONSTANT, dtype=np.int32)
        self._functions: list[tuple[object, Callable[[float], Any]]] = []
        self.fixed, self.values = self._fixed.view(), self._values.view()  # values at the time 0, in m
        self.fixed.flags.writeable = self.values.flags.writeable = False
        self.hanging = self._constraints = hanging_constraints(mesh)
        self._inclined = Constraints.none()  # of conditions in local axes
        self._hangs = np.zeros(mesh.n_nodes, dtype=bool)
        if mesh.hanging is not None:
            self._hangs[mesh.hanging.nodes] = True
        self.conditions: list[DirichletCondition] = []
        self.ties: list[Coupling] = []
        self.version = self.value_version = 0  # changes but for values and functions of time; all changes
        self.springs: Csr | None = None  # (3n, 3n) N/m

    def __str__(self) -> str:
        tied = [f"{len(self.constraints)} constraints"] if len(self.constraints) else []
        return "\n".join([*map(str, self.conditions), *map(str, self.ties), *tied]) or "none"

    def name(self, dof: int) -> str:
        """Return the readable name of a degree of freedom, 3·node + axis."""
        return f"node {self.mesh.node_ids[dof // 3]} along {AXES[dof % 3]}"

    def dof(self, where: Any) -> int:
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
        self._inclined = Constraints.none()
        self.changed()
        for other in self.conditions:
            self._apply(replace(other, override=True))

    def _apply(self, condition: DirichletCondition) -> None:
        """Prescribe or release what a condition says; hanging nodes follow others."""
        nodes, axes, value, function = condition.nodes, condition.axes, condition.value, CONSTANT
        numbers = axis_numbers(axes, condition.local.letters if condition.local else AXES)
        if condition.released:
            at = np.ix_(nodes, np.array(numbers))
            self._fixed[at], self._values[at], self._function[at] = False, 0.0, CONSTANT
            self.changed()
            return
        follows = self._hangs[nodes]
        if len(nodes) and follows.all():
            raise ModelError(
                f"cannot fix {axes}: the nodes, such as {self.mesh.node_ids[nodes[0]]}, hang on an "
                "edge or face of a larger element and follow its nodes; fix these"
            )
        if callable(value):
            if condition.local is not None:
                raise InputError("a support in local axes has a constant value; got a function of time")
            function, value = self._number(value)
            value = value[nodes, None] if np.ndim(value) else value
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
        each = np.repeat(nodes[~follows], len(numbers))
        if condition.local is None:
            self._prescribe(each, np.tile(numbers, len(new)), new.ravel(), function, condition.override)
            return
        a = condition.local.directions(self.mesh.points[nodes[~follows]])[:, numbers]
        if len(numbers) == 3:
            new = (a * new[..., None]).sum(axis=1)
            self._prescribe(each, np.tile(range(3), len(new)), new.ravel(), function, condition.override)
        else:
            self._incline(each, a.reshape(-1, 3), new.ravel(), condition.override)

    def _prescribe(self, nodes: Ints, axes: Ints, new: Array, function: int, override: bool) -> None:
        """Prescribe components (k,) of displacements, with a function of time or without."""
        at = nodes, axes
        if not override:
            self._check_prescribed_once(at, new, function)
        self.changed(values_only=bool(self.fixed[at].all()))
        self._fixed[at], self._values[at], self._function[at] = True, new, function

    def _incline(self, nodes: Ints, a: Array, values: Array, override: bool) -> None:
        """Prescribe a·u = value at nodes, for directions a (k, 3)."""
        axis = np.abs(a).round(9).argmax(axis=1)  # nodes of a plane take the same axis
        others = (axis[:, None] + [1, 2]) % 3
        size = np.take_along_axis(a, axis[:, None], axis=1)
        weights, constants = -np.take_along_axis(a, others, axis=1) / size, values / size[:, 0]
        some = (np.abs(weights) > AXIAL).any(axis=1)
        self._prescribe(nodes[~some], axis[~some], constants[~some], CONSTANT, override)
        dependents, others = 3 * nodes + axis, 3 * nodes[:, None] + others
        self._inclined += Constraints.of(dependents[some], others[some], weights[some], constants[some])
        self.changed()

    def _number(self, function: Callable[[float], Any]) -> tuple[int, Any]:
        """Return the number of a function of time, and its value at the time 0."""
        checked = function_of(function, "a prescribed displacement", self._displacement)
        start = checked(0.0)
        if np.isnan(start).any():
            raise InputError("a prescribed displacement at t = 0 s must be a number; got None")
        for i, (known, _) in enumerate(self._functions):
            if known is function:
                return i, start
        self._functions.append((function, checked))
        return len(self._functions) - 1, start

    def _displacement(self, found: Any, what: str) -> Any:
        """Return a displacement in m, or those of all nodes (n,); nan for None."""
        if found is None:
            return np.nan
        return finite(found, what, (self.mesh.n_nodes,)) if np.ndim(found) else number(found, what)

    def _check_prescribed_once(self, at: tuple[Ints, ...], new: Array, function: int) -> None:
        """Raise ModelError if degrees of freedom have another value, or another function of time."""
        apart = np.abs(self.values[at] - new) > 1e-12 * np.abs(new).max(initial=0.0)
        differs = (self._function[at] != function) | (apart & (function == CONSTANT))
        for i in np.flatnonzero(self.fixed[at] & differs)[:1]:
            dof = int(3 * at[0][i] + at[1][i])
            how = f"{self.values.flat[dof]:g} m and {new[i]:g} m"
            if function != CONSTANT or self._function.flat[dof] != CONSTANT:
                how = "by a function of time and otherwise"
            raise ModelError(
                f"{self.name(dof)} is prescribed twice: {how}; fix it once, or with override=True"
            )

    @property
    def motions(self) -> list[tuple[Callable[[float], Any], Mask]]:
        """Functions of the time in s that return m, for all nodes (n,) or one; and what each moves (n, 3)."""
        moved = [(function, self._function == number) for number, (_, function) in enumerate(self._functions)]
        return [(function, mask) for function, mask in moved if mask.any()]

    def acting(self, time: float) -> Supports:
        """Return the supports at a time in s: these, without what has a function that returns None then."""
        idle = [moved for function, moved in self.motions if np.isnan(function(time)).any()]
        if not idle:
            return self
        other, kept = copy(self), ~np.any(idle, axis=0)
        other._fixed, other._values = self._fixed & kept, self._values * kept
        other._function = np.where(kept, self._function, CONSTANT)
        other.fixed, other.values = other._fixed, other._values
        other.changed()
        return other

    def at(self, time: float) -> Supports:
        """Return what is prescribed at a time in s as constant supports."""
        other, values = copy(self.acting(time)), self.values.copy()
        for function, moved in other.motions:
            size = np.asarray(function(time))
            values[moved] = np.broadcast_to(size[..., None], values.shape)[moved]
        other._values = np.where(other._fixed, values, 0.0)
        other._function = np.full_like(self._function, CONSTANT)
        other.values = other._values
        other.changed()
        return other

    # ---- multi-point constraints ------------------------------------------------------------------------

    @property
    def constraints(self) -> Constraints:
        """All constraints: of hanging nodes, those added, of local axes, of ties and remote points."""
        return self._every[0]

    @constraints.setter
    def constraints(self, constraints: Constraints) -> None:
        self._constraints = Constraints.none()
        self._inclined, self.ties = Constraints.none(), []
        self.add_constraints(constraints)

    @cached_property
    def _every(self) -> tuple[Constraints, Constraints, Constraints]:
        """All constraints, those of ties of parts among them, and those that reference nodes follow."""
        (every, followers), of_parts, known = self._of_elements(), Constraints.none(), self.fixed.copy()
        if self.ties:
            known.flat[independent(every, known)[0].dependents] = True
        # What moves all nodes of a part comes first, then ties, which leave out what others hold.
        for tie in sorted(self.ties, key=lambda tie: (not tie.moves_all, not isinstance(tie, PartTie))):
            new = tie.constraints(self.fixed, known)
            every += new
            known.flat[new.dependents] = True
            if isinstance(tie, PartTie):
                of_parts += new
            for nodes in tie.moves_all:
                known[nodes] = True
        return every, of_parts, followers

    def _of_elements(self) -> tuple[Constraints, Constraints]:
        """Return the constraints of nodes that elements use, and those that others, of no element, follow."""
        every, mesh, followers = self._constraints + self._inclined, self.mesh, Constraints.none()
        if len(every) and mesh.whole and not mesh.used_nodes().all():
            from kratos_lite.mesh.hanging import is_corner  # a quick start without reference nodes

            gone = ~np.repeat(mesh.used_nodes(), 3) & ~self.fixed.ravel()
            # They follow supported nodes first, then corners: the coarse level of multigrid has these alone.
            order = np.where(self.fixed.ravel(), 0, np.repeat(2 - is_corner(mesh.blocks, mesh.n_nodes), 3))
            every, followers = without(every, gone, order)
        return every, followers

    @property
    def followers(self) -> Constraints:
        """The constraints that reference nodes follow."""
        return self._every[2]

    @property
    def added(self) -> Constraints:
        """The constraints that are neither of hanging nodes nor of supports."""
        return self._constraints.take(np.arange(len(self._constraints)) >= len(self.hanging))

    def add_constraints(self, constraints: Constraints) -> None:
        """Add constraints."""
        self._constraints += constraints
        self.changed()

    def changed(self, values_only: bool = False) -> None:
        """Count a change of what is prescribed, or of its values alone; what follows is found anew."""
        self.version += not values_only
        self.value_version += 1
        for name in ("_every", "_independent", "_dependents"):
            vars(self).pop(name, None)

    def add_tie(self, tie: Coupling) -> None:
        """Add a tie, or replace the one between the same parts."""
        old = [other for other in self.ties if other.place == tie.place]
        self.ties = [tie if other in old else other for other in self.ties] + [tie] * (not old)
        self.changed(values_only=bool(old) and old[0].equations == tie.equations)

    def independent(self) -> Constraints:
        """Return equal constraints whose dependents are one once, not fixed, without cycles."""
        return self._independent[0]

    @cached_property
    def _independent(self) -> tuple[Constraints, Redundant | None]:
        return independent(self.constraints, self.fixed)

    def dependents(self) -> Constraints:
        """Return all constraints by free degrees of freedom alone; ModelError where they contradict."""
        return self._dependents

    @cached_property
    def _dependents(self) -> Constraints:
        eliminated = self._eliminated(self.values)
        if self._independent[1] is not None:
            self._check_redundant(self._independent[1])
        return eliminated

    def _check_redundant(self, redundant: Redundant) -> None:
        """Raise ModelError where what is redundant contradicts, at rest or for a function of time."""
        rest = np.where(self.fixed & (self._function == CONSTANT), self.values, 0.0).ravel()
        cure = "change or remove one of them"
        redundant.check(rest, 1.0, self.name, "{} = {:g} m is prescribed", cure)
        for _, moved in self.motions:
            cure = "give all that moves the same function of time, or remove one of them"
            redundant.check(moved.ravel().astype(float), 0.0, self.name, "{} is prescribed", cure)

    @property
    def displaced(self) -> float:
        """The sum of the sizes of all prescribed displacements, in m."""
        return float(np.abs(self.values).sum() + np.abs(self.dependents().constants).sum())

    def constrain(
        self,
        dependents: tuple[int, str] | ArrayLike,
        independents: Mapping[tuple[int, str], float] | ArrayLike,
        weights: ArrayLike,
        constant: ArrayLike,
    ) -> None:
        """Add constraints; see `Structure.constrain`."""
        if isinstance(independents, Mapping):
            weights = finite(list(independents.values()), "weights of a constraint")[None]
            dependents, independents = [self.dof(dependents)], np.array([list(map(self.dof, independents))])
        c = self._dofs(dependents, "dependents")
        each = self._dofs(independents, "independents")
        each = each[:, None] if each.ndim == 1 else each
        w = finite(weights, "weights of a constraint")
        offsets = finite(constant, "the constant of a constraint")
        try:
            each = np.broadcast_to(each, (*c.shape, each.shape[-1]))
            w, offsets = np.broadcast_to(w, each.shape), np.broadcast_to(offsets, c.shape)
        except ValueError:
            raise InputError(
                f"of {len(c)} dependents, independents must be ({len(c)},) or ({len(c)}, k), weights one or "
                f"as many, constants one or ({len(c)},); got {each.shape}, {w.shape} and {offsets.shape}"
            ) from None
        self.add_constraints(Constraints.of(c, each, w, offsets))

    def _dofs(self, values: ArrayLike, what: str) -> Ints:
        """Return degrees of freedom of this mesh, (c,) or (c, k)."""
        dofs = whole_numbers(values, f"{what}, 3·node + axis,")
        shaped = dofs.ndim == 1 or (dofs.ndim == 2 and what == "independents")
        if not shaped or ((dofs < 0) | (dofs >= self.fixed.size)).any():
            raise InputError(
                f"{what} must be a row of degrees of freedom 3·node + axis, each below {self.fixed.size}; "
                f"got {short(values)}"
            )
        return dofs

    def _eliminated(self, values: Array) -> Constraints:
        """Return the dependents for prescribed values."""
        return eliminate(self.independent(), self.fixed, values)

    def check_used(self) -> list[str]:
        """Raise ModelError where constraints leave a node free that no element uses."""
        dofs = np.append(self.dependents().independents, self.followers.independents)
        for dof in dofs[~self.mesh.used_nodes()[dofs // 3] & ~self.fixed.flat[dofs]][:1]:
            raise ModelError(
                f"equations leave {self.name(int(dof))} free, which no element uses; fix it and, if it is a "
                "reference node, its rotations"
            )
        return []

    # ---- for the equations ------------------------------------------------------------------------------

    def constraint_map(self, nodes: Ints, values: Array | None = None) -> ConstraintMap:
        """Return the constraint map of the degrees of freedom of some nodes, renumbered in order."""
        fixed, u = self.fixed, self.values if values is None else values
        dependents = None
        if len(self.constraints):
            known = self.dependents() if values is None else self._eliminated(values)
            dof_of = np.full(fixed.shape, -1)
            dof_of[nodes] = np.arange(3 * len(nodes)).reshape(-1, 3)
            dependents = known.renumbered(dof_of.ravel())
        return constraint_map(fixed[nodes], u[nodes], dependents)

    def supported(self, residual: Array) -> Array:
        """Return a residual (n, 3) where supports or constraints act, and 0 elsewhere."""
        acts = self.fixed.copy()
        acts.flat[np.concatenate([self.constraints.dependents, self.constraints.independents])] = True
        return np.where(acts, self.on_independents(residual), 0.0)

    def past_ties(self, reactions: Array) -> Array:
        """Return reactions (n, 3) with the forces in ties of parts passed on to what tied nodes follow."""
        ties = self._every[1]
        if not len(ties):
            return reactions
        none = np.zeros_like(self.fixed)
        ties = eliminate(independent(ties, self.fixed)[0], none, np.zeros_like(self.values))
        return np.asarray(ties.following(none.size).T @ reactions.ravel()).reshape(-1, 3)

    def on_independents(self, forces: Array) -> Array:
        """Return nodal forces (n, 3) with those on hanging nodes passed on to their independents."""
        return forces if self.mesh.hanging is None else self.mesh.hanging.gather(forces)

    def constraint_rows(self) -> tuple[Ints, Ints, Array]:
        """Return all that is prescribed, and what springs resist, as sparse rows: (row, dof, weight)."""
        fixed, every = np.flatnonzero(self.fixed), self.constraints
        rows = len(fixed) + np.arange(len(every))
        row, dof, weight = self._spring_rows()
        return (
            np.concatenate([np.arange(len(fixed)), rows, rows[every.owner], len(fixed) + len(every) + row]),
            np.concatenate([fixed, every.dependents, every.independents, dof]),
            np.concatenate([np.ones(len(fixed) + len(every)), -every.weights, weight]),
        )

    def _spring_rows(self) -> tuple[Ints, Ints, Array]:
        """Return likewise K of springs, whose forces are 0 in what they leave free, but for rounding."""
        if self.springs is None:
            return NO_ROWS, NO_ROWS, np.zeros(0)
        K = self.springs.tocoo()
        size = np.zeros(K.shape[0])
        np.maximum.at(size, K.row, np.abs(K.data))
        kept = (size > 1e-9 * np.repeat(size.reshape(-1, 3).max(axis=1), 3))[K.row]
        return K.row[kept].astype(np.int64), K.col[kept].astype(np.int64), K.data[kept]


def hanging_constraints(mesh: Mesh) -> Constraints:
    """Return the constraints that keep the displacement continuous at the hanging nodes of a mesh."""
    every, h = Constraints.none(), mesh.hanging
    if h is not None:
        rest = h.weights, np.zeros(len(h))
        for axis in range(3):
            every += Constraints(3 * h.nodes + axis, h.start, 3 * h.independents + axis, *rest)
    return every

"""Supports: prescribed displacements and linear multi-point constraints, by elimination.

The displacement of all degrees of freedom is u = T q + c with q the free ones; the equations
T^T K T q = T^T (f - K c) keep symmetry and hold the constraints exactly (no penalty).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.time_series import function_of
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import finite

if TYPE_CHECKING:
    from scipy.sparse import csr_array

AXES = "xyz"
PRESCRIBED_TWICE = "by a function of the time and otherwise; fix it once, or with override=True"


def axis_numbers(axes: str) -> list[int]:
    """Return the axis numbers of a word such as ``"xz"``.

    >>> axis_numbers("xz")
    [0, 2]
    """
    known = isinstance(axes, str) and axes and set(axes) <= set(AXES)
    if not known or len(set(axes)) != len(axes):
        raise InputError(f"axes must be some of x, y, z, each once, such as 'xz'; got {axes!r}")
    return [AXES.index(a) for a in axes]


@dataclass(frozen=True)
class MultiPointConstraint:
    """One linear multi-point constraint: u[slave] = Σ weights · u[masters] + constant.

    Degrees of freedom count 3·node + axis.  A `mutual` one joins two that are alike, u[slave] = u[master]:
    where supports hold the slave, the master follows.
    """

    slave: int
    masters: tuple[int, ...]
    weights: tuple[float, ...]
    constant: float = 0.0
    mutual: bool = False


@dataclass(frozen=True, eq=False)
class Movement:
    """Node rows whose displacement along an axis is a function of the time; `given` is that of the caller."""

    rows: Ints
    axis: int
    course: Callable[[float], float]
    given: object


Links: TypeAlias = "dict[int, tuple[dict[int, float], float]]"
"""Constraints that are resolved: for each slave the weights of free degrees of freedom, and a constant."""


class Supports:
    """Fixed degrees of freedom with their values, and links between degrees of freedom."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.fixed: NDArray[np.bool_] = np.zeros(mesh.points.shape, dtype=bool)
        self.values: Array = np.zeros(mesh.points.shape)
        self.links: list[MultiPointConstraint] = []
        self.movements: list[Movement] = []

    def name(self, dof: int) -> str:
        """Return the readable name of a degree of freedom."""
        return f"node {self.mesh.node_ids[dof // 3]} along {AXES[dof % 3]}"

    def fix(self, rows: Ints, axes: str, value: ArrayLike = 0.0, override: bool = False) -> None:
        """Prescribe the displacement of nodes along axes.

        `value` in m is one number, one per axis, or (rows, axes).  A degree of freedom that is
        prescribed twice must be given the same value, unless `override` lets the later one win.
        """
        numbers = axis_numbers(axes)
        given = finite(value, "a prescribed displacement")
        try:
            given = np.broadcast_to(given, (len(rows), len(numbers)))
        except ValueError:
            raise InputError(
                f"value must be one number, {len(numbers)} numbers (one per axis of {axes!r}) "
                f"or have shape ({len(rows)}, {len(numbers)}); got shape {given.shape}"
            ) from None
        at = np.ix_(rows, np.array(numbers))
        clash = self.fixed[at] & (self.values[at] != given)
        if clash.any() and not override:
            i, j = np.argwhere(clash)[0]
            dof = int(3 * rows[i] + numbers[j])
            raise ModelError(
                f"{self.name(dof)} is prescribed twice: {self.values.flat[dof]:g} m and {given[i, j]:g} m"
            )
        self._stop(rows, numbers, None, override)
        self.fixed[at] = True
        self.values[at] = given

    def move(self, rows: Ints, axes: str, course: Callable[[float], float], override: bool = False) -> None:
        """Prescribe the displacement of nodes along axes as a function of the time; see `fix`."""
        numbers, checked = axis_numbers(axes), function_of(course, "a prescribed displacement")
        start = checked(0.0)
        resting = self.fixed.copy()
        for movement in self.movements:
            resting[movement.rows, movement.axis] = False
        i, j = np.nonzero(resting[np.ix_(rows, np.array(numbers))])
        if len(i) and not override:
            dof = 3 * int(rows[i[0]]) + numbers[j[0]]
            raise ModelError(f"{self.name(dof)} is prescribed twice: {PRESCRIBED_TWICE}")
        self._stop(rows, numbers, course, override)
        for axis in numbers:
            self.fixed[rows, axis], self.values[rows, axis] = True, start
            self.movements.append(Movement(rows, axis, checked, course))

    def course(self, dof: int) -> object:
        """Return the function that moves a degree of freedom, as the caller gave it, or None."""
        node, axis = divmod(dof, 3)
        mine = (m.given for m in self.movements if m.axis == axis and (m.rows == node).any())
        return next(mine, None)

    def _stop(self, rows: Ints, axes: list[int], given: object, override: bool) -> None:
        """Take nodes out of the movements that they have along axes, all but those given alike."""
        kept = []
        for old in self.movements:
            again = np.isin(old.rows, rows) & (old.axis in axes)
            if again.any() and not override and old.given is not given:
                dof = 3 * int(old.rows[again][0]) + old.axis
                raise ModelError(f"{self.name(dof)} is prescribed twice: {PRESCRIBED_TWICE}")
            kept.append(replace(old, rows=old.rows[~again]))
        self.movements = [old for old in kept if len(old.rows)]

    def link(self, links: Iterable[MultiPointConstraint]) -> None:
        """Add multi-point constraints."""
        self.links += links

    def carried(self, residual: Array) -> Array:
        """Return a residual (n, 3) where supports or constraints act, and 0 elsewhere."""
        acts = self.fixed.copy()
        acts.flat[[dof for link in self.links for dof in (link.slave, *link.masters)]] = True
        return np.where(acts, residual, 0.0)

    def rows_of_constraints(self) -> tuple[Ints, Ints, Array]:
        """Return all constraints but their values as sparse rows: (row, dof, weight)."""
        fixed = np.flatnonzero(self.fixed.ravel())
        row, dof, weight = [np.arange(len(fixed))], [fixed], [np.ones(len(fixed))]
        for r, link in enumerate(self.links, start=len(fixed)):
            row.append(np.full(1 + len(link.masters), r))
            dof.append(np.array([link.slave, *link.masters], dtype=np.int64))
            weight.append(np.array([1.0, *(-w for w in link.weights)]))
        return np.concatenate(row), np.concatenate(dof), np.concatenate(weight)


@dataclass(eq=False)
class ConstraintMap:
    """The map u = T q + c from the free degrees of freedom q to all.

    Attributes
    ----------
    free : (q,) int, the free degrees of freedom.
    c : (N,) float, the displacement at q = 0.
    T : (N, q) sparse, or None where q is added to the free ones of c and no more (no links).
    """

    free: Ints
    c: Array
    T: csr_array[Any, Any] | None = None

    def follow(self, q: NDArray[Any]) -> NDArray[Any]:
        """Return T q, (N, ...): what the free ones q (q, ...) move, without what is prescribed."""
        if self.T is not None:
            return np.asarray(self.T @ q)
        u = np.zeros((len(self.c), *q.shape[1:]), dtype=q.dtype)
        u[self.free] = q
        return u

    def expand(self, q: Array) -> Array:
        """Return all displacements (N,) of the free ones."""
        u = self.follow(q)
        u += self.c
        return u

    def restrict(self, A: Any) -> Any:
        """Return T^T A T of a sparse matrix (N, N) as CSR."""
        if self.T is not None:
            return (self.T.T @ A @ self.T).tocsr()
        return A if len(self.free) == A.shape[0] else A[self.free][:, self.free]

    def reduce(self, r: Array) -> Array:
        """Return T^T r."""
        return np.asarray(self.T.T @ r) if self.T is not None else r[self.free]


def reduction(supports: Supports, active: Ints, links: Links | None = None) -> ConstraintMap:
    """Return the reduction for the degrees of freedom of the `active` node rows, renumbered in order.

    Constraints of slaves on other nodes are left out.  `links` are the resolved ones, if they are known.
    Where all supports move alike along an axis, c carries the free degrees of freedom along: what is
    left to solve for is the strain alone, and its error does not grow with the motion.
    """
    fixed, c = supports.fixed, supports.values
    if len(active) < len(fixed):
        fixed, c = fixed[active], c[active]
    fixed, c = fixed.ravel(), c.ravel() * fixed.ravel()
    if not supports.links:
        for axis in range(3):
            held, along = fixed[axis::3], c[axis::3]
            if held.any() and np.ptp(along[held]) == 0 and along[held][0] != 0:
                along[:] = along[held][0]
        return ConstraintMap(np.flatnonzero(~fixed), c)
    local = np.full(supports.mesh.n_nodes, -1)
    local[active] = np.arange(len(active))
    links = resolve(supports, local >= 0) if links is None else links
    mine = {_renumbered(slave, local): link for slave, link in links.items() if local[slave // 3] >= 0}
    is_free = ~fixed
    is_free[list(mine)] = False
    free = np.flatnonzero(is_free)
    column = np.full(len(fixed), -1)
    column[free] = np.arange(len(free))
    rows, columns, weights = [free], [column[free]], [np.ones(len(free))]
    for slave, (terms, constant) in sorted(mine.items()):
        c[slave] = constant
        dofs = _renumbered(np.array(list(terms), dtype=np.int64), local)
        rows.append(np.full(len(dofs), slave))
        columns.append(column[dofs])
        weights.append(np.array(list(terms.values()), dtype=float))
    from scipy.sparse import csr_array

    entries = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
    return ConstraintMap(free, c, csr_array(entries, shape=(len(fixed), len(free))))


def _renumbered(dof: Any, local: Ints) -> Any:
    """Return degrees of freedom by the new rows of their nodes."""
    return 3 * local[dof // 3] + dof % 3


def resolve(supports: Supports, used: NDArray[np.bool_], agree: bool = True) -> Links:
    """Express every slave by free degrees of freedom alone; prescribed values must `agree` with them.

    Raises ModelError for constraints that contradict, or that use nodes which no element uses.
    """
    by_slave: dict[int, MultiPointConstraint] = {}
    for given in supports.links:
        link = _mutual(given, supports, agree) if given.mutual else given
        if link is None:
            continue
        if link.slave in by_slave:
            raise ModelError(f"{supports.name(link.slave)} is the slave of two constraints")
        if supports.fixed.flat[link.slave]:
            raise ModelError(f"{supports.name(link.slave)} is both fixed and the slave of a constraint")
        by_slave[link.slave] = link
    done: Links = {}
    for start in by_slave:
        _resolve_one(start, by_slave, done, supports)
    lost = [dof for slave, (terms, _) in done.items() for dof in (slave, *terms) if not used[dof // 3]]
    if lost:
        raise ModelError(f"a constraint uses {supports.name(lost[0])}, which belongs to no element")
    return done


def _mutual(link: MultiPointConstraint, supports: Supports, agree: bool) -> MultiPointConstraint | None:
    """Return u[slave] = u[master] with the one that supports hold as master; None if they hold both alike."""
    slave, (master,) = link.slave, link.masters
    if not supports.fixed.flat[slave]:
        return link
    if not supports.fixed.flat[master]:
        return MultiPointConstraint(master, (slave,), (1.0,))
    one, other = supports.values.flat[slave], supports.values.flat[master]
    if agree and supports.course(slave) is not supports.course(master):
        raise ModelError(
            f"{supports.name(slave)} and {supports.name(master)} are joined, but moved otherwise: let one "
            "function move both, or hold one of them only"
        )
    if agree and one != other:
        raise ModelError(
            f"{supports.name(slave)} and {supports.name(master)} are joined, but prescribed as "
            f"{one:g} m and {other:g} m"
        )
    return None


def _resolve_one(
    start: int,
    by_slave: dict[int, MultiPointConstraint],
    done: Links,
    supports: Supports,
) -> None:
    """Fill `done[start]`, first resolving the masters that are slaves themselves (a stack, no recursion)."""
    stack: list[int] = [start]
    open_: set[int] = set()
    while stack:
        slave = stack[-1]
        waiting = [m for m in by_slave[slave].masters if m in by_slave and m not in done]
        if slave in done or not waiting:
            stack.pop()
            open_.discard(slave)
            done.setdefault(slave, _substitute(by_slave[slave], done, supports))
        elif slave in open_:
            raise ModelError(f"the constraints of {supports.name(slave)} go round in a circle")
        else:
            open_.add(slave)
            stack += waiting


def _substitute(
    link: MultiPointConstraint, done: Links, supports: Supports
) -> tuple[dict[int, float], float]:
    """Return the terms of free masters and the constant of one link."""
    terms: dict[int, float] = {}
    constant = link.constant
    for master, weight in zip(link.masters, link.weights, strict=True):
        if supports.fixed.flat[master]:
            constant += weight * supports.values.flat[master]
            continue
        inner, offset = done.get(master, ({master: 1.0}, 0.0))
        constant += weight * offset
        for dof, factor in inner.items():
            terms[dof] = terms.get(dof, 0.0) + weight * factor
    return terms, constant


def rigid_modes(points: Array, center: ArrayLike | None = None) -> Array:
    """Return the six rigid modes (3n, 6): translations x y z, rotations about x y z through `center`.

    >>> rigid_modes(np.eye(3)).shape
    (9, 6)
    """
    X = points - (points.mean(axis=0) if center is None else np.asarray(center))
    R = np.zeros((len(points), 3, 6))
    R[:, range(3), range(3)] = 1
    x, y, z = X.T
    R[:, 1, 3], R[:, 2, 3] = -z, y
    R[:, 0, 4], R[:, 2, 4] = z, -x
    R[:, 0, 5], R[:, 1, 5] = -y, x
    return R.reshape(-1, 6)

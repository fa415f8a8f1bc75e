"""Load: what pushes a structure, as nodal forces; alone, with an amplitude, or as a function of time."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from types import FunctionType
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeAlias, TypeVar

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.time_series import Factor, TimeSeries, function_of
from kratos_lite.typing import Array, ArrayLike, Ints, Rows
from kratos_lite.validation import finite, flag, instance, of_places, reals, short, takes

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh

T = TypeVar("T")
OfPlace: TypeAlias = "Callable[[Array], ArrayLike]"
"""A function of places (m, 3) in m."""

Drawn: TypeAlias = "tuple[Array, Array, str]"
"""Places, vectors, and their arrows: ``on`` the surface, ``from`` or ``to`` a place, ``about`` an axis."""

MOST_CHANGE = 0.01
"""Of the forces of a function, by the next quadrature rule; more is a warning."""
DEEPEST = 8
"""Levels of values inside values that are compared; what lies deeper is compared as an object."""


class Load(ABC):
    """Something that pushes a structure.  A load of your own needs `forces` alone."""

    unit: str = ""
    """Of its values, in brackets, as summaries show it."""
    local: LocalAxes | None = None
    """Axes of its vectors, if these are not x y z."""

    def _along(self, local: LocalAxes | None) -> None:
        """Take the axes of its vectors."""
        if local is None:
            return
        self.local = instance(local, "local", LocalAxes, "kl.Cylindrical()")
        for name, value in vars(self).items():
            if np.ndim(value) == 2:
                raise InputError(f"a {name} along local axes is (3,) or a function; got shape {value.shape}")

    def __repr__(self) -> str:
        values = {name: value for name, value in vars(self).items() if not name.startswith("_")}
        return f"{type(self).__name__}({', '.join(f'{k}={_shown(v)}' for k, v in values.items())})"

    def __str__(self) -> str:
        kind = re.sub("(?<=[a-z])(?=[A-Z])", " ", type(self).__name__).lower()
        values = {k: v for k, v in vars(self).items() if not k.startswith("_") and v is not None}
        where = values.pop("where", None)
        own = (kind, "values")
        said = [
            _shown(v) if k in own else f"{k} {_shown(v)}" for k, v in values.items() if k in own or np.any(v)
        ]
        return f"{kind} {', '.join(said)}" + ("" if where is None else f" on {_shown(where)}")

    @abstractmethod
    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces of the load.

        Parameters
        ----------
        mesh : points (n, 3), elements, conditions and named parts.
        groups : the elements with their materials.

        Returns
        -------
        (n, 3) in N.

        Raises
        ------
        InputError, ModelError
            The load does not fit the mesh.
        """

    def on_nodes(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> tuple[Ints, Array]:
        """Return nodes (k,), and forces (k, 3) in N there that add up to those of `forces`."""
        forces = self.forces(mesh, groups)
        nodes = np.flatnonzero(np.abs(forces) @ np.ones(3))  # faster than any(axis=1)
        return nodes, forces[nodes]

    def __init_subclass__(cls) -> None:  # a class that gives its forces alone has them on all nodes
        if "forces" in vars(cls) and "on_nodes" not in vars(cls):
            cls.on_nodes = Load.on_nodes  # type: ignore[method-assign]

    def acting(self, time: float) -> Sequence[tuple[float, Load]]:
        """Return the loads that this one is at a time in s, each with a factor."""
        return [(1.0, self)]

    def drawn(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Drawn]:
        """Return places (k, 3) in m, vectors (k, 3) there, and how arrows show these."""
        nodes, forces = self.on_nodes(mesh, groups)
        return [(mesh.points[nodes], forces, "on")]

    def follow(self, mesh: Mesh, x: Array) -> Iterator[tuple[Rows, Array, Array]]:
        """Yield what the load changes on a body that is deformed, and no small displacements are assumed.

        Parameters
        ----------
        mesh : undeformed.
        x : (n, 3) m, where its nodes are.

        Yields
        ------
        nodes : (m, k).
        forces : (m, k, 3) in N, what they have beyond those of `forces`.
        tangent : (m, k, 3, k, 3) in N/m, the derivative of these by x.
        """
        yield from ()

    def by_coordinates(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return the derivative (n, 3) in N of the work v·f of the forces, v (n, 3) in m, by the nodes."""
        raise self.without_derivative("its class defines no by_coordinates(mesh, groups, v)")

    def without_derivative(self, why: str) -> ModelError:
        """Return the error for a load that has no derivative by coordinates."""
        cure = "take constant or nodal tractions, pressures, body forces and forces"
        return ModelError(f"{self!r} has no derivative by coordinates: {why}; {cure}")

    def by_density(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return the derivative (m,) of the work v·f, v (n, 3) in m, by the density of each element."""
        return np.zeros(mesh.n_elements)

    def check(self, mesh: Mesh) -> None:
        """Raise MeshError if `where` of the load names no part or node; `Structure.add` asks for it."""
        where = getattr(self, "where", None)
        if isinstance(where, str):
            mesh.part(where)
        elif where is not None and not callable(where):
            mesh.nodes(where)

    def warnings(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[str]:
        """Return what may be wrong with the load on a mesh, though it acts."""
        return []

    def refined(self, finer: RefinedMesh) -> Load:
        """Return the same load on a finer mesh; ModelError if it cannot be carried over."""
        raise ModelError(
            f"{type(self).__name__} cannot be carried over to a finer mesh: its class defines no "
            "refined(finer); add the load to a model of the finer mesh instead"
        )


class DistributedLoad(Load):
    """A load over faces, lines or volumes `where`, which may be a function of places."""

    factors: ClassVar[int]
    nodal: ClassVar[tuple[str, int]] = "", 0
    """The value that may be a function or interpolated from nodes, and how many axes it then has."""
    where: Any

    @abstractmethod
    def integral(self, mesh: Mesh, groups: Sequence[ElementGroup], factors: int) -> tuple[Ints, Array]:
        """Return what `on_nodes` does; a function is taken at the points of a rule of `factors`."""

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N."""
        return nodal(mesh, *self.integral(mesh, groups, self.factors))

    def warnings(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[str]:
        """Return a warning if the load is a function that jumps inside elements."""
        if not callable(getattr(self, self.nodal[0], None)):
            return []
        forces = nodal(
            mesh, *self.integral(mesh, groups, self.factors + 2)
        )  # one more point a direction, or two
        change = float(np.abs(self.forces(mesh, groups) - forces).sum())
        if change <= MOST_CHANGE * float(np.abs(forces).sum()):
            return []
        return [
            f"{self!r} jumps or peaks inside elements: its forces change by "
            f"{100 * change / np.abs(forces).sum():.2g} % with the next quadrature rule; "
            "put edges of elements where it does, or refine there"
        ]

    def refined(self, finer: RefinedMesh) -> Load:
        """Return the load where its faces, lines or elements are cut; nodal values are interpolated."""
        new, (name, axes) = copy(self), self.nodal
        new.where = self._refined_where(finer)
        value: Any = getattr(self, name, None)
        if axes and not callable(value) and np.ndim(value) == axes:
            setattr(new, name, finer.interpolate(value))
        return new

    def _refined_where(self, finer: RefinedMesh) -> Any:
        return finer.where(self.where)


class TimeDependentLoad(Load):
    """A load that a function of time gives, such as one that moves.

    Statics take it at the time 0.  A load that only grows and shrinks is better added with an amplitude:
    ``model.add(load, amplitude=...)``.

    Parameters
    ----------
    function : takes the time in s, returns a load, or None where nothing acts.  As long as it returns the
        same object, the nodal forces of that are kept.
    follower : whether some of these loads follow the body, which makes any model a nonlinear one.

    Raises
    ------
    InputError
        It is not a function.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> def wheel_load(t):
    ...     return kl.PointLoad((3.0 * t, 0.0, 1.0), (0.0, 0.0, -1e3))
    >>> wheel = TimeDependentLoad(wheel_load)
    >>> wheel.at(0.5).force
    array([    0.,     0., -1000.])
    """

    def __init__(self, function: Callable[[float], Load | None], follower: bool = False) -> None:
        if isinstance(function, (Load, type)) or not takes(function, 1):
            raise InputError(f"a function of time that returns a load is needed; got {function!r}")
        self.function, self.follower = function, flag(follower, "follower")

    def at(self, time: float) -> Load | None:
        """Return the load at a time.

        Parameters
        ----------
        time : s.

        Returns
        -------
        A load, or None where nothing acts.

        Raises
        ------
        InputError
            The function returns anything else, or a load that follows the body though `follower` is False.
        """
        load = self.function(time)
        if load is not None and (not isinstance(load, Load) or isinstance(load, TimeDependentLoad)):
            raise InputError(
                f"the load at t = {time:g} s must be a PointLoad or another, or None; got {load!r}"
            )
        if getattr(load, "follower", False) and not self.follower:
            raise InputError("a load that follows the body: take TimeDependentLoad(function, follower=True)")
        return load

    def drawn(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Drawn]:
        """Return what shows the load at the time 0, without its amplitude."""
        return [some for _, load in self.acting(0.0) for some in load.drawn(mesh, groups)]

    def acting(self, time: float) -> Sequence[tuple[float, Load]]:
        """Return the load at a time in s with the factor 1; nothing where nothing acts."""
        load = self.at(time)
        return [] if load is None else [(1.0, load)]

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N at the time 0."""
        found = (factor * load.forces(mesh, groups) for factor, load in self.acting(0.0))
        return sum(found, np.zeros_like(mesh.points))

    def refined(self, finer: RefinedMesh) -> Load:
        """Return a load whose function gives those of this one on a finer mesh."""

        def function(time: float) -> Load | None:
            load = self.at(time)
            return None if load is None else load.refined(finer)

        return TimeDependentLoad(function, self.follower)


class ScaledLoad(TimeDependentLoad):
    """A load times an amplitude, as ``model.add(load, amplitude=...)`` makes it."""

    def __init__(self, load: Load, amplitude: Factor) -> None:
        if not isinstance(load, Load) or isinstance(load, TimeDependentLoad):
            name = type(load).__name__
            raise InputError(
                f"an amplitude multiplies a constant load such as Gravity or Traction; got {name}"
            )
        self.load, self.amplitude = load, function_of(amplitude, "the amplitude of a load")

    def __str__(self) -> str:
        return f"{self.load}, times an amplitude"

    def check(self, mesh: Mesh) -> None:
        """Check that what the load acts on exists."""
        self.load.check(mesh)

    def warnings(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[str]:
        """Return what may be wrong with the load."""
        return self.load.warnings(mesh, groups)

    def refined(self, finer: RefinedMesh) -> Load:
        """Return the load on a finer mesh, with the same amplitude."""
        return ScaledLoad(self.load.refined(finer), self.amplitude)

    def acting(self, time: float) -> Sequence[tuple[float, Load]]:
        """Return the load with its amplitude at a time in s."""
        return [(self.amplitude(time), self.load)]


class InTime(Generic[T]):
    """What loads put on nodes at a time in s: factors, and what `forces_of` gives of loads for each.

    Those with the same amplitude have one factor; while the loads are the same, so is what it gives of them.
    """

    def __init__(self, loads: Iterable[TimeDependentLoad], forces_of: Callable[[list[Load]], T]) -> None:
        groups: dict[int, list[TimeDependentLoad]] = {}
        for load in loads:
            groups.setdefault(id(getattr(load, "amplitude", load)), []).append(load)
        self._groups, self._forces_of = list(groups.values()), forces_of
        self._kept: dict[int, tuple[list[Load], T]] = {}
        self._last: dict[float, list[tuple[float, T]]] = {}  # of the last two times

    def __call__(self, time: float) -> list[tuple[float, T]]:
        """Return pairs of a factor and what the loads with it give."""
        if time not in self._last:
            self._last = {**dict([*self._last.items()][-1:]), time: self._at(time)}
        return self._last[time]

    def _at(self, time: float) -> list[tuple[float, T]]:
        found = []
        for key, same in enumerate(self._groups):
            acting = [one for load in same for one in load.acting(time)]
            ones = [load for _, load in acting]
            if ones and (key not in self._kept or self._kept[key][0] != ones):
                self._kept[key] = ones, self._forces_of(ones)
            found += [(acting[0][0], self._kept[key][1])] if ones else []
        return found


def _shown(value: Any) -> str:
    """Return a value of a load in a few words."""
    if isinstance(value, np.ndarray):
        if not value.ndim:
            return f"{value:g}"
        return f"({', '.join(f'{x:g}' for x in value)})" if value.shape == (3,) else f"array {value.shape}"
    return getattr(value, "__name__", "a function") if callable(value) else short(value)


def nodal(mesh: Mesh, nodes: Ints, forces: Array) -> Array:
    """Return forces (k, 3) on some nodes (k,) as those of all nodes (n, 3)."""
    total = np.zeros_like(mesh.points)
    add_nodal(total, nodes, forces)
    return total


def vectors(values: Any, what: str, shapes: str, dimensions: tuple[int, ...] = (1,)) -> Array:
    """Return vectors of the right shape."""
    array = finite(values, what)
    if array.ndim not in dimensions or array.shape[-1] != 3:
        got = f"shape {array.shape}" if array.ndim else f"the number {array}"
        raise InputError(f"{what} must be {shapes}; got {got}")
    return array


def is_of_places(value: Any, what: str) -> bool:
    """Return whether a value is a function; InputError for one that takes more than places (m, 3)."""
    if callable(value) and not takes(value, 1):
        cure = "lambda X: …; time goes by model.add(load, amplitude=lambda t: …) or kl.TimeDependentLoad"
        raise InputError(f"{what} as a function takes places X (m, 3) alone: {cure}; got {value!r}")
    return callable(value)


def at_places(function: OfPlace, what: str, width: tuple[int, ...]) -> Callable[[Array], Array]:
    """Return a function of places (..., 3) that checks what the given one of (m, 3) returns."""

    def checked(X: Array) -> Array:
        given, m = of_places(function, X.reshape(-1, 3), what), X[..., 0].size
        cure = "np.column_stack((fx, fy, fz)) joins components (m,)" if width else ""
        values = finite(reals(given, what, cure=cure), what)
        if values.shape not in ((m, *width), width):
            shape, cure = ("(m, 3)", f"; {cure}") if width else ("(m,)", "")
            raise InputError(f"{what} at places (m, 3) must have shape {shape}; got {values.shape}{cure}")
        return np.broadcast_to(values, (m, *width)).reshape(*X.shape[:-1], *width)

    return checked


def placed(value: Any, local: LocalAxes | None, what: str) -> Any:
    """Return vectors along x y z as they are, those of places or along local axes as a function of places."""
    if local is None and not callable(value):
        return value
    function = at_places(value if callable(value) else lambda X: value, what, (3,))
    return function if local is None else lambda X: local.globally(function(X), X)


# ---- what is equal, as a cell of a notebook makes it that is run twice ------------------------------------


def key_of(value: Any, depth: int = 0) -> Hashable:
    """Return a key that equal things share: loads by class and all values, functions by their code."""
    deeper = depth + 1
    if isinstance(value, np.ndarray):
        return "array", value.shape, value.dtype.kind, hash(value.tobytes())
    if isinstance(value, Mapping):
        value = [*value, *value.values()]
    if isinstance(value, (list, tuple)):
        return tuple(key_of(item, deeper) for item in value)
    if isinstance(value, FunctionType) and depth <= DEEPEST:
        closed = [cell.cell_contents for cell in value.__closure__ or ()]
        return value.__code__, key_of(value.__defaults__, deeper), key_of(closed, deeper)
    if isinstance(value, (Load, TimeSeries, LocalAxes)):
        return type(value), key_of(vars(value), deeper)
    return value if isinstance(value, Hashable) and depth <= DEEPEST else id(value)


def equal_loads(loads: Sequence[Load], named: Mapping[str, Load]) -> list[str]:
    """Return a warning of loads that act more than once without a name that tells it is meant."""
    meant = {id(load) for load in named.values()}
    alike: dict[Hashable, list[Load]] = {}
    for load in loads:
        alike.setdefault(key_of(load), []).append(load)
    found = [
        f"{len(same)} equal loads {same[0]!r}, which add up; if one alone is meant, give it a name, "
        "model.add(load, name=...), so that it is not added twice"
        for same in alike.values()
        if len(same) > 1 and any(id(load) not in meant for load in same)
    ]
    return reported_once((text, text) for text in found)


def reported_once(warnings: Iterable[tuple[Hashable, str]]) -> list[str]:
    """Return the first of all warnings with the same key, and the number of the others."""
    texts: dict[Hashable, list[str]] = {}
    for key, text in warnings:
        texts.setdefault(key, []).append(text)
    counted = ((same[0], len(same) - 1) for same in texts.values())
    return [text + f" (and {n} more load{'s' * (n > 1)})" * (n > 0) for text, n in counted]


def warnings_of(loads: Sequence[Load], mesh: Mesh, groups: Sequence[ElementGroup]) -> list[str]:
    """Return the warnings of loads; those that differ in the load and in numbers alone are one."""
    found = ((load, text) for load in loads for text in load.warnings(mesh, groups))
    return reported_once((re.sub(r"[\d.]+", "", text.replace(repr(load), "")), text) for load, text in found)

"""Loads: gravity, body force, traction, pressure and point load as nodal forces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.assembly import gauss_point_fields
from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.elements import surface_load, surface_pressure
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Block, Mesh, Where, WhereElements, outward_signs, with_rows
from kratos_lite.solvers.supports import Supports
from kratos_lite.time_series import Factor, function_of
from kratos_lite.typing import Array
from kratos_lite.validation import finite, number


def _vectors(values: ArrayLike, what: str, shapes: str, dimensions: tuple[int, ...] = (1,)) -> Array:
    array = finite(values, what)
    if array.ndim not in dimensions or array.shape[-1] != 3:
        raise InputError(f"{what} must be {shapes}; got shape {array.shape}")
    return array


class Load(ABC):
    """Something that pushes: it turns into nodal forces."""

    @abstractmethod
    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N."""


class BodyForce(Load):
    """Force per volume.

    Parameters
    ----------
    force : (3,) float, or (n, 3) interpolated from the nodes; N/m³.
    where : elements that carry it: part name, property id or rows; all if not given.
    """

    def __init__(self, force: ArrayLike, where: WhereElements = None) -> None:
        self.force = _vectors(force, "a body force", "(3,) or (n, 3) in N/m³", (1, 2))
        self.where = where

    def per_volume(self, group: ElementGroup) -> Array:
        """Return the force per volume on the elements of a group, (3,) or nodal (n, 3)."""
        return self.force

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return ∫ N b dV as nodal forces (n, 3) in N."""
        if self.force.ndim == 2 and len(self.force) != mesh.n_nodes:
            name = type(self).__name__
            raise InputError(f"a nodal {name} needs shape ({mesh.n_nodes}, 3); got {self.force.shape}")
        total = np.zeros_like(mesh.points)
        chosen = np.zeros(mesh.n_elements, dtype=bool)
        chosen[slice(None) if self.where is None else mesh.elements(self.where)] = True
        for group in groups:
            b, part = self.per_volume(group), group.take(chosen[group.rows])
            if b.any() and len(part):
                total += gauss_point_fields.body_force(mesh.points, part, b)
        return total


class Gravity(BodyForce):
    """Weight: density times an acceleration.

    Parameters
    ----------
    acceleration : (3,) float, or (n, 3) interpolated from the nodes; m/s².
    where : elements that carry it: part name, property id or rows; all if not given.

    Examples
    --------
    >>> Gravity((0.0, 0.0, -9.81)).force
    array([ 0.  ,  0.  , -9.81])
    """

    def __init__(self, acceleration: ArrayLike, where: WhereElements = None) -> None:
        self.force = _vectors(acceleration, "gravity", "(3,) or (n, 3) in m/s²", (1, 2))
        self.where = where

    def per_volume(self, group: ElementGroup) -> Array:
        """Return density × acceleration."""
        return group.material.density * self.force


SURFACES = ("triangle", "quadrilateral")


def _faces(mesh: Mesh, where: Where, what: str, cells: Sequence[str] = SURFACES) -> list[Block]:
    faces = mesh.faces(where)
    wanted = "faces" if cells == SURFACES else "lines"
    for block in faces:
        if block.shape is None or block.shape.cell not in cells:
            kind = "conditions of the unknown kind" if block.shape is None else "other conditions,"
            raise ModelError(
                f"{what} acts on {wanted}; it meets {kind} {block.name} (the first is {block.ids[0]})"
            )
    if not faces:
        name = f"part {where!r}" if isinstance(where, str) else "the chosen nodes"
        raise ModelError(
            f"{what} finds no {wanted[:-1]} on {name}: it has no conditions and no element face "
            "on the boundary has all its nodes in it"
        )
    return faces


OfPlace: TypeAlias = Callable[[Array], ArrayLike]
"""A function of places (m, 3) in m."""


def _at_nodes(function: OfPlace, X: Array, what: str, width: tuple[int, ...]) -> Array:
    """Return what a function gives at the nodes (m, k, 3) of faces, (m, k, *width)."""
    given = finite(function(X.reshape(-1, 3).copy()), what)
    wanted = (X.shape[0] * X.shape[1], *width)
    if given.shape not in (wanted, width):
        raise InputError(f"{what} at places (m, 3) must have shape {('m', *width)}; got {given.shape}")
    return np.broadcast_to(given, wanted).reshape(*X.shape[:2], *width)


class Traction(Load):
    """Force per area on the faces of a part.

    Parameters
    ----------
    where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
    traction : (3,) float, Pa; or a function of places (m, 3) that returns (m, 3), interpolated from nodes.
    """

    cells: ClassVar[tuple[str, ...]] = SURFACES

    def __init__(self, where: Where, traction: ArrayLike | OfPlace) -> None:
        self.where, self.traction = where, traction
        if not callable(traction):
            self.traction = _vectors(traction, "a traction", "(3,) in Pa")

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return ∫ N t dA as nodal forces (n, 3) in N."""
        total = np.zeros_like(mesh.points)
        what = "a traction" if self.cells == SURFACES else "a line load"
        for block in _faces(mesh, self.where, what, self.cells):
            assert block.shape is not None
            X, t = mesh.points[block.nodes], self.traction
            at = _at_nodes(t, X, what, (3,)) if callable(t) else t
            add_nodal(total, block.nodes, surface_load(block.shape, X, at))
        return total


class Varying(Load):
    """A load that changes with the time; where nothing moves it is what it is at the time 0.

    Parameters
    ----------
    load : any load.
    factor : `TimeSeries`, or function of the time in s, by which it is multiplied.

    Examples
    --------
    >>> from kratos_lite.time_series import TimeSeries
    >>> ramp = Varying(Gravity((0, 0, -9.81)), TimeSeries([0.0, 1.0], [0.0, 2.0]))
    >>> ramp.factor(0.5)
    1.0
    """

    def __init__(self, load: Load, factor: Factor) -> None:
        if not isinstance(load, Load) or isinstance(load, (Varying, Timed)):
            raise InputError(f"a load such as Gravity or Traction is needed; got {type(load).__name__}")
        self.load, self.factor = load, function_of(factor, "the factor of a load")

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N at the time 0."""
        return self.factor(0.0) * self.load.forces(mesh, groups)


class Timed(Load):
    """A load that a function of the time gives, such as one that moves.

    Where nothing moves it is what it is at the time 0.

    Parameters
    ----------
    load : function of the time in s that returns a load, or None where nothing acts.  As long as it returns
        the same object, the nodal forces of that are kept; a factor alone is better told by `Varying`.

    Examples
    --------
    >>> moving = Timed(lambda t: PointLoad(lambda X: abs(X[:, 0] - 3.0 * t) < 0.01, (0.0, 0.0, -1e3)))
    >>> moving.at(0.5).force
    array([    0.,     0., -1000.])
    """

    def __init__(self, load: Callable[[float], Load | None]) -> None:
        if not callable(load) or isinstance(load, Load):
            raise InputError(f"a function of the time that returns a load is needed; got {load!r}")
        self.load = load

    def at(self, time: float) -> Load | None:
        """Return the load at a time in s, or None; InputError if the function returns anything else."""
        found = self.load(time)
        if found is not None and (not isinstance(found, Load) or isinstance(found, (Varying, Timed))):
            raise InputError(
                f"the load at t = {time:g} s must be a PointLoad or another, or None; got {found!r}"
            )
        return found

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N at the time 0."""
        found = self.at(0.0)
        return np.zeros_like(mesh.points) if found is None else found.forces(mesh, groups)


class LineLoad(Traction):
    """Force per length on the line conditions of a part.

    Parameters
    ----------
    where : part with line conditions.
    traction : (3,) float, N/m.
    """

    cells: ClassVar[tuple[str, ...]] = ("line",)


class Pressure(Load):
    """Pressure on the faces of a part; a positive one pushes into the body.

    Parameters
    ----------
    where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
    pressure : float, Pa; or a function of places (m, 3) that returns (m,), interpolated from nodes.
    normal : ``"outward"`` takes the outward normal of the body; ``"nodes"`` the normal about which
        the nodes of each condition run counter-clockwise, as Kratos does.
    """

    def __init__(self, where: Where, pressure: float | OfPlace, normal: str = "outward") -> None:
        if normal not in ("outward", "nodes"):
            raise InputError(f"normal must be 'outward' or 'nodes'; got {normal!r}")
        if not callable(pressure):
            pressure = number(pressure, "a pressure")
        self.where, self.pressure, self.normal = where, pressure, normal

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return -∫ N p n dA as nodal forces (n, 3) in N."""
        total = np.zeros_like(mesh.points)
        for block in _faces(mesh, self.where, "a pressure"):
            assert block.shape is not None
            X, p = mesh.points[block.nodes], self.pressure
            at = _at_nodes(p, X, "a pressure", ()) if callable(p) else np.full(block.nodes.shape, p)
            if self.normal == "outward":
                at = at * outward(mesh, block)[:, None]
            add_nodal(total, block.nodes, surface_pressure(block.shape, X, at))
        return total


class PointLoad(Load):
    """The same force on each node of a part.

    Parameters
    ----------
    where : nodes.
    force : (3,) float, N, on each node.
    """

    def __init__(self, where: Where, force: ArrayLike) -> None:
        self.where = where
        self.force = _vectors(force, "a point load", "(3,) in N")

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N."""
        total = np.zeros_like(mesh.points)
        rows = mesh.nodes(self.where)
        if not len(rows):
            raise ModelError(f"a point load finds no node in {self.where!r}")
        total[rows] += self.force
        return total


class NodalForces(Load):
    """Given nodal forces.

    Parameters
    ----------
    values : (n, 3) float, N.
    """

    def __init__(self, values: ArrayLike) -> None:
        self.values = _vectors(values, "nodal forces", "(n, 3) in N", (2,))

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return a copy of the values."""
        if self.values.shape != mesh.points.shape:
            raise InputError(f"nodal forces need shape {mesh.points.shape}; got {self.values.shape}")
        return self.values.copy()


class ConditionLoads(Load):
    """Loads on the conditions of the mesh, as a file states them.

    The load on a condition is its own value plus the one interpolated from its nodes.

    Parameters
    ----------
    force : (c, 3) per condition; Pa on faces, N/m on lines, N on points.
    nodal_force : (n, 3) per node, by the cell of the conditions that carry it.
    pressure : (c,) per condition, Pa, positive against the normal about which the nodes of the
        condition run counter-clockwise.
    nodal_pressure : (n,) per node, Pa.
    """

    def __init__(
        self, force: Array, nodal_force: dict[str, Array], pressure: Array, nodal_pressure: Array
    ) -> None:
        self.force, self.nodal_force = force, nodal_force
        self.pressure, self.nodal_pressure = pressure, nodal_pressure

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N."""
        total = np.zeros_like(mesh.points)
        for block, rows in with_rows(mesh.conditions):
            _check_loadable(block, bool(self.force[rows].any()), bool(self.pressure[rows].any()))
            if block.shape is None or not len(block):
                continue
            X = mesh.points[block.nodes]
            force = self.force[rows, None, :] + self.nodal_force[block.shape.cell][block.nodes]
            if force.any():
                add_nodal(total, block.nodes, surface_load(block.shape, X, force))
            pressure = self.pressure[rows, None] + self.nodal_pressure[block.nodes]
            if pressure.any() and block.shape.cell in SURFACES:
                add_nodal(total, block.nodes, surface_pressure(block.shape, X, pressure))
        return total


def _check_loadable(block: Block, force: bool, pressure: bool) -> None:
    """Raise ModelError for a load stated on conditions that cannot carry it."""
    if block.shape is None and (force or pressure):
        raise ModelError(f"a load is given on conditions of the unknown kind {block.name}")
    if block.shape is not None and pressure and block.shape.cell not in SURFACES:
        raise ModelError(f"a pressure acts on faces; {block.name} is not one")


def check_loads(
    loads: Sequence[Load], groups: Sequence[ElementGroup], forces: Array, supports: Supports
) -> list[str]:
    """Warn of loads that cannot do anything: gravity without mass, or forces on fixed components alone."""
    moved = supports.values.any() or any(link.constant for link in supports.links)
    if any(isinstance(load, Gravity) for load in loads) and all(b.material.density == 0 for b in groups):
        return ["gravity acts on no mass: every material has density 0; give density in kg/m³"]
    if not forces.any() and not moved:
        return ["no load acts and no displacement is prescribed, so nothing moves"]
    if not forces[~supports.fixed].any() and not moved:
        return ["all loads act on fixed components, so nothing moves"]
    return []


def outward(mesh: Mesh, block: Block) -> Array:
    """Return +1 for faces whose nodes run counter-clockwise from outside the body, else -1."""
    signs = outward_signs(mesh.boundary, block)
    if (signs == 0).any():
        lost = block.ids[int(np.argmax(signs == 0))]
        raise ModelError(
            f"face {lost} ({block.name}) is not on the boundary of the body, so it has no outward normal"
        )
    return signs

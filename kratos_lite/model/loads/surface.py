"""Surface loads: traction and pressure on faces, force per length on lines."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.elements.surface import (
    FUNCTION,
    area_vectors,
    face_rule,
    surface_load,
    surface_load_tangent,
    surface_pressure,
    surface_pressure_tangent,
)
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Block, Mesh, Where, with_rows
from kratos_lite.mesh.blocks import NO_ROWS, select, without_repeats
from kratos_lite.mesh.refined_mesh import RefinedMesh
from kratos_lite.model.loads.base import (
    DistributedLoad,
    Drawn,
    Load,
    OfPlace,
    at_places,
    is_of_places,
    placed,
    vectors,
)
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.typing import Array, ArrayLike, Ints, Rows
from kratos_lite.validation import finite, flag, number

SURFACES = ("triangle", "quadrilateral")


class FaceLoad(DistributedLoad):
    """A load on faces or lines."""

    what: ClassVar[str]
    each_face: ClassVar[bool]  # of a class whose constant loads on several parts may be one load
    cells: ClassVar[tuple[str, ...]] = SURFACES
    factors = FUNCTION

    @abstractmethod
    def on_faces(self, mesh: Mesh, faces: list[Block], factors: int) -> Iterable[Array]:
        """Return the forces (m, k, 3) in N on the nodes of the m faces of each block."""

    def integral(self, mesh: Mesh, groups: Sequence[ElementGroup], factors: int) -> tuple[Ints, Array]:
        """Return nodes (k,), face by face, and the forces (k, 3) in N there."""
        faces = loaded_faces(mesh, self.where, self.what, self.cells)
        forces = [f.reshape(-1, 3) for f in self.on_faces(mesh, faces, factors)]
        nodes = [block.nodes.ravel() for block in faces]
        return np.concatenate([NO_ROWS, *nodes]), np.concatenate([np.zeros((0, 3)), *forces])

    def on_nodes(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> tuple[Ints, Array]:
        """Return nodes (k,), face by face, and the forces (k, 3) in N there."""
        return self.integral(mesh, groups, self.factors)

    def drawn(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Drawn]:
        """Return the mean traction of each face."""
        faces = loaded_faces(mesh, self.where, self.what, self.cells)
        return _means(mesh, zip(faces, self.on_faces(mesh, faces, self.factors), strict=True))

    def by_coordinates(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return the derivative (n, 3) in N of v·f by the nodes; ModelError of a function of places."""
        if callable(getattr(self, self.nodal[0], None)) or self.local is not None:
            raise self.without_derivative("it is a function of places, or along local axes")
        total, faces = np.zeros_like(v), loaded_faces(mesh, self.where, self.what, self.cells)
        for block, tangent in zip(faces, self.tangents(mesh, faces), strict=True):
            add_nodal(total, block.nodes, np.einsum("mac,macbi->mbi", v[block.nodes], tangent))
        return total

    def tangents(self, mesh: Mesh, faces: list[Block]) -> Iterable[Array]:
        """Return the derivatives (m, k, 3, k, 3) in N/m of the forces by the nodes of each face."""
        raise self.without_derivative("all of its faces share it")


class Traction(FaceLoad):
    """Force per area on the faces of a part.

    Parameters
    ----------
    where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
    traction : (3,) float, or (n, 3) interpolated from the nodes of the mesh; Pa; or a function of places
        (m, 3) that returns (m, 3), taken at quadrature points.
    local : axes of the traction, one vector or a function: `Cylindrical`, …; x y z if not given.
    """

    unit = " [Pa]"
    what, each_face = "a traction", True
    nodal = "traction", 2

    def __init__(
        self, where: Where, traction: ArrayLike | OfPlace, *, local: LocalAxes | None = None
    ) -> None:
        self.where, self.traction = where, traction
        if not is_of_places(traction, self.what):
            self.traction = vectors(traction, "a traction", "(3,) or (n, 3) in Pa", (1, 2))
        self._along(local)

    def on_faces(self, mesh: Mesh, faces: list[Block], factors: int) -> Iterable[Array]:
        """Return ∫ N t dA (m, k, 3) in N of each face."""
        traction = placed(self.traction, self.local, self.what)
        for block in faces:
            t = _on(block, traction, mesh, self.what, (3,))
            yield surface_load(block.known_shape, mesh.points[block.nodes], t, factors)

    def tangents(self, mesh: Mesh, faces: list[Block]) -> Iterable[Array]:
        """Return the derivatives (m, k, 3, k, 3) in N/m of ∫ N t dA."""
        for block in faces:
            X, t = mesh.points[block.nodes], _on(block, self.traction, mesh, self.what, (3,))
            yield surface_load_tangent(block.known_shape, X, np.broadcast_to(t, X.shape))


class LineLoad(Traction):
    """Force per length on the line conditions of a part.

    Parameters
    ----------
    where : part with line conditions.
    traction : (3,) float, N/m.
    local : as of `Traction`.
    """

    unit = " [N/m]"
    what, cells, each_face = "a line load", ("line",), True


class Pressure(FaceLoad):
    """Pressure on the faces of a part; a positive one pushes into the body.

    Parameters
    ----------
    where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
    pressure : float, or (n,) interpolated from the nodes of the mesh; Pa; or a function of places (m, 3) that
        returns (m,), taken at quadrature points.
    normal : ``"outward"`` takes the outward normal of the body; ``"nodes"`` the normal about which
        the nodes of each condition run counter-clockwise, as Kratos does.
    follower : whether it acts on the deformed faces, which makes any model a nonlinear one.

    Raises
    ------
    InputError
        The normal is neither, the pressure no number, or a follower is a function of places.
    """

    unit = " [Pa]"
    what, each_face = "a pressure", True
    nodal = "pressure", 1

    def __init__(
        self, where: Where, pressure: ArrayLike | OfPlace, normal: str = "outward", follower: bool = False
    ) -> None:
        if normal not in ("outward", "nodes"):
            raise InputError(f"normal must be 'outward' or 'nodes'; got {normal!r}")
        self.follower = flag(follower, "follower")
        if is_of_places(pressure, self.what):
            if follower:
                raise InputError("a follower pressure is a number or (n,) in Pa; got a function of places")
        else:
            pressure = finite(pressure, "a pressure")
            if pressure.ndim > 1:
                raise InputError(f"a pressure must be one number or (n,) in Pa; got shape {pressure.shape}")
            pressure = pressure if pressure.ndim else number(pressure.item(), "a pressure")
        self.where, self.pressure, self.normal = where, pressure, normal

    def on_faces(self, mesh: Mesh, faces: list[Block], factors: int) -> Iterable[Array]:
        """Return -∫ N p n dA (m, k, 3) in N of each face."""
        for block in faces:
            p = _on(block, self.pressure, mesh, self.what, ())
            forces = surface_pressure(block.known_shape, mesh.points[block.nodes], p, factors)
            if self.normal == "outward":
                forces *= outward(mesh, block)[:, None, None]
            yield forces

    def tangents(self, mesh: Mesh, faces: list[Block]) -> Iterable[Array]:
        """Return the derivatives (m, k, 3, k, 3) in N/m of -∫ N p n dA."""
        for block in faces:
            X, p = mesh.points[block.nodes], _on(block, self.pressure, mesh, self.what, ())
            sign = outward(mesh, block)[:, None, None, None, None] if self.normal == "outward" else 1.0
            yield sign * surface_pressure_tangent(block.known_shape, X, p)

    def follow(self, mesh: Mesh, x: Array) -> Iterator[tuple[Rows, Array, Array]]:
        """Yield what deformed faces change, if the pressure follows them."""
        for block in loaded_faces(mesh, self.where, self.what) if self.follower else ():
            p = np.asarray(_on(block, self.pressure, mesh, self.what, ())) + np.zeros(block.nodes.shape)
            if self.normal == "outward":
                p = p * outward(mesh, block)[:, None]
            yield _pressed(block, mesh, x, p)


class Resultant(FaceLoad):
    """A force and a moment in all, spread over the faces of a part.

    The traction is F / A + ω × (x - c), as a rigid plate on a soft bed would pass it on: c is the centroid of
    the faces, and ω gives the moment.

    Parameters
    ----------
    where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
    force : (3,) float, N.
    moment : (3,) float, N m.
    about : (3,) float, m; the point on which the force acts and about which the moment is.  The centroid if
        not given.
    local : axes of force and moment, those at the point on which the force acts; x y z if not given.
    nodes : whether the nodes of the part take it, alike in place of areas; as on a rigid part.

    Raises
    ------
    InputError
        An argument is no vector.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> model = kl.Model(kl.box((2.0, 1.0, 1.0)), kl.Isotropic3D(E=1e9, nu=0.3))
    >>> forces = kl.Resultant("x+", (0, 0, -100.0), moment=(5.0, 0, 0)).forces(model.mesh, [])
    >>> forces.sum(axis=0)[2].round(9).item()
    -100.0
    """

    what = "a resultant"

    @property
    def unit(self) -> str:  # type: ignore[override]
        """Of the force, and of a moment that is there."""
        return " [N] [N m]" if self.moment.any() else " [N]"

    def __init__(
        self,
        where: Where,
        force: ArrayLike,
        moment: ArrayLike = (0.0, 0.0, 0.0),
        about: ArrayLike | None = None,
        nodes: bool = False,
        *,
        local: LocalAxes | None = None,
    ) -> None:
        self.where, self._nodes = where, flag(nodes, "nodes")
        self._along(local)
        self.force = vectors(force, "a resultant force", "(3,) in N")
        self.moment = vectors(moment, "a resultant moment", "(3,) in N m")
        self.about = None if about is None else vectors(about, "the point of a resultant", "(3,) in m")

    def integral(self, mesh: Mesh, groups: Sequence[ElementGroup], factors: int) -> tuple[Ints, Array]:
        """Return nodes (k,) and forces (k, 3) in N there, of all faces or of the nodes.

        Raises
        ------
        ModelError
            The mesh is a part of a larger one, or the nodes take no moment.
        """
        if not self._nodes:
            return super().integral(mesh, groups, factors)
        nodes = without_repeats(mesh.nodes(self.where))
        return nodes, self._traction(mesh, mesh.points[nodes], np.ones(len(nodes)))(mesh.points[nodes])

    def on_faces(self, mesh: Mesh, faces: list[Block], factors: int) -> Iterable[Array]:
        """Return ∫ N t dA (m, k, 3) in N of each face."""
        X, dA = (np.concatenate(values) for values in zip(*_points_of(mesh, faces, factors), strict=True))
        traction = self._traction(mesh, X, dA)
        return [surface_load(b.known_shape, mesh.points[b.nodes], traction, factors) for b in faces]

    def drawn(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Drawn]:
        """Return the force on its point, and the moment about it."""
        if self.about is not None:
            point, way = self.about, "from"
        elif self._nodes:
            point, way = mesh.points[without_repeats(mesh.nodes(self.where))].mean(axis=0), "on"
        else:
            faces = loaded_faces(mesh, self.where, self.what)
            X, dA = (np.concatenate(v) for v in zip(*_points_of(mesh, faces, self.factors), strict=True))
            point, way = dA @ X / dA.sum(), "on"
        force, moment = self._at(point)[:, None]
        return [(point[None], force, way), (point[None], moment, "about")]

    def _at(self, point: Array) -> Array:
        """Return force and moment (2, 3) along x y z on a point."""
        both = np.array([self.force, self.moment])
        return both if self.local is None else self.local.globally(both, [point] * 2)

    def _traction(self, mesh: Mesh, X: Array, dA: Array) -> Callable[[Array], Array]:
        """Return the traction at places (..., 3), from points (k, 3) that stand for areas (k,)."""
        if not mesh.whole:
            raise ModelError("a resultant needs all faces of its part in one mesh; give a traction instead")
        center = dA @ X / dA.sum()
        arms = X - center
        inertia = (dA * (arms**2).sum(axis=1)).sum() * np.eye(3) - (dA * arms.T) @ arms
        arm = np.zeros(3) if self.about is None else self.about - center
        force, moment = self._at(center + arm)
        moment = moment + np.cross(arm, force)
        turn = np.linalg.pinv(inertia, rcond=1e-12, hermitian=True) @ moment
        if np.abs(inertia @ turn - moment).max() > 1e-9 * np.abs(moment).max():
            text = "its nodes lie on a line or at one place, and take no moment about it"
            raise ModelError(f"{self!r}: {text}")

        def traction(x: Array) -> Array:
            return np.asarray(force / dA.sum() + np.cross(turn, x - center))

        return traction


class ConditionLoads(Load):
    """Loads on the conditions of the mesh, as a file states them: own values and those of nodes."""

    following: ClassVar[tuple[str, ...]] = ("SurfaceLoadCondition", "LineLoadCondition")
    """Starts of the names of conditions whose loads act on deformed faces and lines, as in Kratos."""

    def __init__(
        self,
        force: Array,
        nodal_force: dict[str, Array],
        pressure: Array,
        nodal_pressure: Array,
        follower: bool = True,
        idle: Sequence[str] = (),
    ) -> None:
        self.force = force  # (c, 3) of conditions; Pa on faces, N/m on lines, N on points
        self.nodal_force = nodal_force  # (n, 3) by the cell of the conditions that carry it
        self.pressure = pressure  # (c,) Pa, against the normal by the right hand about the nodes
        self.nodal_pressure = nodal_pressure  # (n,) Pa
        self.follower = follower  # whether they act on deformed faces
        self.idle = idle  # names of conditions that carry nothing

    def __repr__(self) -> str:
        loaded = self.force.any(axis=1) | (self.pressure != 0)
        return f"forces and pressures of {int(loaded.sum())} conditions"

    __str__ = __repr__

    def follow(self, mesh: Mesh, x: Array) -> Iterator[tuple[Rows, Array, Array]]:
        """Yield what deformed faces and lines change; a force per area keeps its direction."""
        yield from self._deformed(mesh, x, self.following)

    def by_coordinates(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return the derivative (n, 3) in N of v·f by the nodes."""
        total = np.zeros_like(v)
        for nodes, _, tangent in self._deformed(mesh, mesh.points, ""):
            add_nodal(total, nodes, np.einsum("mac,macbi->mbi", v[nodes], tangent))
        return total

    def _deformed(
        self, mesh: Mesh, x: Array, names: str | tuple[str, ...]
    ) -> Iterator[tuple[Rows, Array, Array]]:
        """Yield what `follow` does, of conditions whose names begin so."""
        for block, at in self._carriers(mesh):
            shape = block.shape
            if not len(block) or not block.name.startswith(names) or shape is None or shape.cell == "point":
                continue
            X, deformed = mesh.points[block.nodes], x[block.nodes]
            t = self.force[at, None, :] + self.nodal_force[shape.cell][block.nodes]
            if t.any():
                more = surface_load(shape, deformed, t) - surface_load(shape, X, t)
                yield block.nodes, more, surface_load_tangent(shape, deformed, t)
            pressure = self.pressure[at, None] + self.nodal_pressure[block.nodes]
            if shape.cell in SURFACES and pressure.any():
                yield _pressed(block, mesh, x, pressure)

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N."""
        total = np.zeros_like(mesh.points)
        for block, forces in self._on_conditions(mesh):
            add_nodal(total, block.nodes, forces)
        return total

    def drawn(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Drawn]:
        """Return the mean traction of each condition."""
        return _means(mesh, self._on_conditions(mesh))

    def _carriers(self, mesh: Mesh) -> list[tuple[Block, slice]]:
        return [(b, at) for b, at in with_rows(mesh.conditions) if b.name not in self.idle]

    def _on_conditions(self, mesh: Mesh) -> Iterator[tuple[Block, Array]]:
        """Yield conditions and the forces (m, k, 3) in N on their nodes."""
        for block, at in self._carriers(mesh):
            on_face = block.shape is not None and block.shape.cell in SURFACES
            if block.shape is None and (self.force[at].any() or self.pressure[at].any()):
                raise ModelError(f"a load is given on conditions of the unknown type {block.name}")
            if not on_face and self.pressure[at].any():
                raise ModelError(f"a pressure acts on faces; {block.name} is not one")
            if block.shape is None or not len(block):
                continue
            X = mesh.points[block.nodes]
            force = self.force[at, None, :] + self.nodal_force[block.shape.cell][block.nodes]
            if force.any():
                yield block, surface_load(block.shape, X, force)
            pressure = self.pressure[at, None] + self.nodal_pressure[block.nodes]
            if on_face and pressure.any():
                yield block, surface_pressure(block.shape, X, pressure)

    def refined(self, finer: RefinedMesh) -> Load:
        """Return the loads on a finer mesh: conditions keep those of their parents, nodes interpolate."""
        return ConditionLoads(
            self.force[finer.conditions],
            {cell: finer.interpolate(force) for cell, force in self.nodal_force.items()},
            self.pressure[finer.conditions],
            finer.interpolate(self.nodal_pressure),
            self.follower,
            self.idle,
        )


def _pressed(block: Block, mesh: Mesh, x: Array, p: Array) -> tuple[Rows, Array, Array]:
    """Return what pressures (m, k) on deformed faces have beyond those on undeformed ones."""
    shape, nodes = block.known_shape, block.nodes
    more = surface_pressure(shape, x[nodes], p) - surface_pressure(shape, mesh.points[nodes], p)
    return nodes, more, surface_pressure_tangent(shape, x[nodes], p)


def _means(mesh: Mesh, loaded: Iterable[tuple[Block, Array]]) -> list[Drawn]:
    """Return the middles of faces, and the forces (m, k, 3) on their nodes per area; of lines, per length."""
    drawn: list[Drawn] = []
    for block, forces in loaded:
        X = mesh.points[block.nodes]
        size = surface_load(block.known_shape, X, np.eye(3)[0]).sum(axis=(1, 2))
        drawn.append((X.mean(axis=1), forces.sum(axis=1) / size[:, None], "on"))
    return drawn


def _points_of(mesh: Mesh, faces: Sequence[Block], factors: int) -> Iterator[tuple[Array, Array]]:
    """Yield for blocks of faces the points (k, 3) of their rules and the areas (k,) that these stand for."""
    for block in faces:
        rule, X = face_rule(block.known_shape, factors), mesh.points[block.nodes]
        dA = np.linalg.norm(area_vectors(block.known_shape, X, rule), axis=-1)
        yield (tabulate(block.known_shape, rule)[0] @ X).reshape(-1, 3), dA.ravel()


def _on(block: Block, value: Any, mesh: Mesh, what: str, width: tuple[int, ...]) -> Any:
    """Return a load on faces: constant, at their nodes, or a function of places (..., 3)."""
    if isinstance(value, list):
        return np.repeat(np.asarray(value)[block.properties, None], block.nodes.shape[1], axis=1)
    if callable(value):
        return at_places(value, what, width)
    if np.ndim(value) == len(width):
        return value
    if len(value) != mesh.n_nodes:
        cure = "" if width else ", whereas a vector is a Traction"
        raise InputError(f"{what} at nodes needs {mesh.n_nodes} of them; got {len(value)}{cure}")
    return value[block.nodes]


def outward(mesh: Mesh, block: Block) -> Array:
    """Return +1 for faces whose nodes run counter-clockwise from outside the body, else -1."""
    signs = mesh.all_faces.outward_signs(block)
    if (signs == 0).any():
        lost = block.ids[int(np.argmax(signs == 0))]
        raise ModelError(
            f"face {lost} ({block.name}) is not on the boundary of the body, so it has no outward normal"
        )
    return signs


def loaded_faces(mesh: Mesh, where: Where, what: str, cells: Sequence[str] = SURFACES) -> list[Block]:
    """Return the faces of a part, or lines; ModelError, which names what needs them, for none."""
    if isinstance(where, list) and where and isinstance(where[0], Block):
        return where
    return faces_of_rows(mesh, [loaded_rows(mesh, where, what, cells)], what, cells)


def faces_of_rows(mesh: Mesh, parts: Sequence[Ints], what: str, cells: Sequence[str]) -> list[Block]:
    """Return the faces of some parts by their rows, whose `properties` are the numbers of the parts."""
    rows, part = np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(some) for some in parts])
    faces = select(mesh.face_blocks(rows), rows, part)
    for block in faces:
        if block.shape is None or block.shape.cell not in cells:
            wanted = "faces" if cells == SURFACES else "lines"
            other = "conditions of the unknown type" if block.shape is None else "other conditions,"
            raise ModelError(
                f"{what} acts on {wanted}; it meets {other} {block.name} (the first is {block.ids[0]})"
            )
    return faces


def loaded_rows(mesh: Mesh, where: Where, what: str, cells: Sequence[str]) -> Ints:
    """Return the rows of the faces or lines of a part, as `Mesh.face_rows` does; ModelError for none."""
    rows = mesh.face_rows(where)
    if mesh.whole and not len(rows):
        wanted = "faces" if cells == SURFACES else "lines"
        name = f"part {where!r}" if isinstance(where, str) else "the chosen nodes"
        raise ModelError(
            f"{what} finds no {wanted[:-1]} on {name}: it has no conditions and no element face "
            "on the boundary has all its nodes in it"
        )
    return rows

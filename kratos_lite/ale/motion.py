"""Motions in which the mesh takes no part: a body of revolution rotates, a frame moves along a long body.

The mesh stands in space while the material moves through it with the velocity rate · c(X): c = A (X - X0) for
a rotation with A v = v × e, and c = -e for a frame that moves with +e along its body.  The material time
derivative of a displacement is u' + rate (c · grad) u, which adds to M u'' + K u = f

    2 rate G u' + (acceleration G - rate² H) u,
    G_ij = ∫ ρ N_i c·grad N_j,    H_ij = ∫ ρ (c·grad N_i)(c·grad N_j)

Source: GetFEM user documentation, ALE support for objects having a large rigid body motion, with the signs of
its loads and a factor 2 corrected; Nackenhorst, Comput. Methods Appl. Mech. Eng. 193 (2004) 4299-4322.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.ale.boundaries import cut_nodes, dashpots, leak, periodic_pairs
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.tables import lame_constants
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.model.structure import Attachment, Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.constraint_map import MultiPointConstraint
from kratos_lite.time_series import Factor, TimeSeries, function_of, slope_of
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import choice, finite, flag, number

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
BOUNDARIES = ("absorbing", "periodic", "fixed", "natural")
"""What the two cut faces of a moving frame do."""
LEAK = 1e-2
"""Share of the velocity that may pass through the boundary before a warning is given."""
TOO_LEAKY = 0.2
"""Share from which a body is not one of revolution, or not straight, at all."""
FREE_BOUNDARIES = 0.7
"""Share of the speed of Rayleigh waves at which frames with free or absorbing boundaries become critical."""


class Motion(Attachment):
    """The rigid motion of the material through a mesh that does not take part in it.

    Attributes
    ----------
    direction : (3,) unit vector, the axis of a rotation or the direction of a translation.
    rate, acceleration : functions of time in s.
    steady : whether they never change.
    is_accelerated : whether the acceleration was given, and not taken from the rate.
    damping : α in 1/s, mass-proportional damping relative to the rigid motion.
    A, center : the velocity is A (X - center) for the rate 1, but for a constant one; (3, 3) and (3,).
    skew : whether the skew part of G stands for G in the damping.
    stiffening : whether the centrifugal stress stiffens.
    kind, unit : the word for the motion, and the unit of its rate.
    is_open : whether material passes through faces of the mesh.
    """

    kind: ClassVar[str]
    unit: ClassVar[str]
    is_open: ClassVar[bool]
    alike: ClassVar[tuple[str, str]]
    """Words for a body that may move so, and for the place where it must be even."""
    cure: ClassVar[str]
    leak_cure: ClassVar[str]
    A: Array
    center: Array
    skew = True
    stiffening = False

    def __init__(
        self, direction: ArrayLike | str, rate: Factor, acceleration: Factor | None, damping: float
    ) -> None:
        self.direction = _unit(direction)
        self.is_accelerated = acceleration is not None
        self.rate = function_of(rate, "a rate")
        self.acceleration = slope_of(rate, "a rate")
        if acceleration is not None:
            self.acceleration = function_of(acceleration, "an acceleration")
        self.steady = not (callable(rate) or callable(acceleration) or acceleration)
        if not callable(rate) and (isinstance(acceleration, TimeSeries) or not callable(acceleration)):
            self.rate = _accelerated(self.rate(0.0), acceleration)
        self.damping = number(damping, "a damping", least=0, unit="1/s")

    def __str__(self) -> str:
        when = "" if self.steady else " at the time 0"
        return f"{type(self).__name__} {self.direction.tolist()}, rate {self.rate(0.0):g}{when}"

    @abstractmethod
    def field(self, X: Array) -> Array:
        """Return the velocity c of the material through the mesh for the rate 1.

        Parameters
        ----------
        X : (..., 3) points in m.

        Returns
        -------
        (..., 3), m for a rotation, without unit for a translation.
        """

    def body_velocity(self, X: Array) -> Array:
        """Return the velocity of the undeformed body in space for the rate 1.

        Parameters
        ----------
        X : (..., 3) points in m.

        Returns
        -------
        (..., 3), as `field`.
        """
        return np.asarray((X - self.center) @ self.A.T)

    @abstractmethod
    def wave_directions(self) -> Array:
        """Return the directions of the waves that matter.

        Returns
        -------
        (k, 3) unit vectors.
        """

    @abstractmethod
    def critical_rate(self, wave_speed: float, points: Array) -> float:
        """Return the rate at which the material of a thick body is as fast as its waves.

        Parameters
        ----------
        wave_speed : m/s.
        points : (n, 3) of the body in m.

        Returns
        -------
        In the unit of the rate.
        """

    @abstractmethod
    def phase(self, X: Array, points: Array) -> tuple[Array, NDArray[np.complex128]]:
        """Return the distance and the phase of points around the body, or along it.

        Parameters
        ----------
        X : (..., 3) points in m.
        points : (n, 3) of the whole body in m.

        Returns
        -------
        r (...) and e^{i φ} (...): φ is the angle about the axis, or goes once along the body.
        """

    def open_faces(self, mesh: Mesh) -> tuple[Ints, ...]:
        """Return the nodes of each face through which material passes.

        Parameters
        ----------
        mesh : that of the body.

        Returns
        -------
        Node rows of each face; none where no face is open.
        """
        return ()

    def boundary_damping(self, mesh: Mesh, system: ConstrainedSystem) -> BlockMatrix | None:
        """Return the damping of the open faces.

        Parameters
        ----------
        mesh : that of the body.
        system : its equations, whose nodes the matrix has.

        Returns
        -------
        (3a, 3a) in N s/m, or None.
        """
        return None

    def leak(self, mesh: Mesh) -> float:
        """Return how much of the velocity passes through the boundary, but for open faces.

        Parameters
        ----------
        mesh : that of the body.

        Returns
        -------
        The largest share, 0 … 1.
        """
        return leak(mesh, self.field, self.open_faces(mesh))

    def attach(self, structure: Structure) -> None:
        """Become the motion of a structure.

        Raises
        ------
        ModelError
            It has a motion already, or is not a body that may move so.
        """
        if structure.motion is not None:
            raise ModelError("the model has a motion already; there is one")
        share = self.leak(structure.mesh)
        if share > TOO_LEAKY:
            raise ModelError(
                f"the body is not {self.alike[0]} the axis {self.direction.tolist()}: {share:.0%} of the "
                f"velocity passes through its boundary; {self.cure}"
            )
        structure.motion = self

    def warnings(self, structure: Structure, groups: Sequence[ElementGroup]) -> list[str]:
        """Return what is doubtful about the motion of a structure, but for its rate.

        Parameters
        ----------
        structure : what moves.
        groups : its elements.

        Returns
        -------
        One sentence each.
        """
        share = self.leak(structure.mesh)
        return [f"{share:.1%} of the velocity passes {self.leak_cure}"] if share > LEAK else []


class Rotation(Motion):
    """A body of revolution that rotates about its axis while its mesh stands still.

    Geometry, density and material must be axisymmetric.  A positive rate turns clockwise about the axis, as
    seen from its tip: c = (X - X0) × e.

    Parameters
    ----------
    axis : ``"x"``, ``"y"``, ``"z"`` or (3,).
    rate : rad/s; number, `TimeSeries` or function of time.
    acceleration : rad/s², likewise; if not given the derivative of the rate, and 0 in a steady state.  A
        number or `TimeSeries` changes a rate that is a number as time goes on.
    center : (3,) m, a point of the axis.
    skew : take the skew part of G, which keeps the energy on every mesh.
    stiffening : add the stiffness that the centrifugal stress gives; a rotor that may rotate freely needs it.
    damping : α in 1/s.

    Raises
    ------
    InputError
        An argument is not what it must be.

    Examples
    --------
    >>> Rotation("z", rate=30.0).field(np.array([1.0, 0.0, 5.0]))
    array([ 0., -1.,  0.])
    """

    kind, unit, is_open = "rotation", "rad/s", False
    alike = "one of revolution about", "about its axis"
    cure = "give the axis of the body and a point of it, center=…"
    leak_cure = "through the polygonal rim; take more cells around the axis, or quadratic ones"

    def __init__(
        self,
        axis: ArrayLike | str = "z",
        rate: Factor = 0.0,
        acceleration: Factor | None = None,
        *,
        center: ArrayLike = (0.0, 0.0, 0.0),
        skew: bool = True,
        stiffening: bool = False,
        damping: float = 0.0,
    ) -> None:
        super().__init__(axis, rate, acceleration, damping)
        self.center = finite(center, "the center of a rotation", (3,))
        self.skew, self.stiffening = flag(skew, "skew"), flag(stiffening, "stiffening")
        self.A = np.cross(np.eye(3), self.direction).T

    def field(self, X: Array) -> Array:
        """Return A (X - X0) = (X - X0) × e."""
        return np.asarray((X - self.center) @ self.A.T)

    def wave_directions(self) -> Array:
        """Return the directions x, y and z (3, 3)."""
        return np.eye(3)

    def critical_rate(self, wave_speed: float, points: Array) -> float:
        """Return the rate in rad/s at which the rim is as fast as waves of a speed in m/s."""
        return wave_speed / float(np.linalg.norm(self.field(points), axis=1).max())

    def phase(self, X: Array, points: Array) -> tuple[Array, NDArray[np.complex128]]:
        """Return the distance r from the axis and e^{i φ} of the angle about it."""
        c, all_c = self.field(X), self.field(points)
        first = all_c[int(np.argmax((all_c * all_c).sum(axis=1)))]
        first = first / np.linalg.norm(first)
        r = np.linalg.norm(c, axis=-1)
        wave = (c @ first + 1j * (c @ np.cross(self.direction, first))) / np.where(r > 0, r, 1.0)
        return r, wave

    def warnings(self, structure: Structure, groups: Sequence[ElementGroup]) -> list[str]:
        """Return what is doubtful about the motion of a structure, but for its rate."""
        found = super().warnings(structure, groups)
        if any(lame_constants(group.material.C) is None for group in groups):
            found.append("an anisotropic material is not axisymmetric unless its axes turn with the angle")
        c = self.field(structure.mesh.points)
        is_held = np.abs(c[structure.supports.fixed]).max(initial=0.0) > 1e-9 * np.abs(c).max()
        if not self.stiffening and not is_held:
            found.append(
                "nothing holds the rotation about the axis: in the linear theory a free rotor is unstable at "
                "any rate; fix the hub, or take stiffening=True"
            )
        return found


class Translation(Motion):
    """A frame that moves along a long body, whose material passes through its mesh.

    Parameters
    ----------
    direction : ``"x"``, ``"y"``, ``"z"`` or (3,): where the frame moves at a positive rate.
    rate : m/s; number, `TimeSeries` or function of time.
    acceleration : m/s², likewise; if not given the derivative of the rate, and 0 in a steady state.  A number
        or `TimeSeries` changes a rate that is a number as time goes on.
    boundaries : what the two cut faces across the direction do: ``absorbing`` lets waves out (Lysmer's
        dashpots), ``periodic`` ties them, ``fixed`` holds them, ``natural`` leaves them to the supports.
    damping : α in 1/s.

    Raises
    ------
    InputError
        An argument is not what it must be.

    Examples
    --------
    >>> Translation("x", rate=20.0, boundaries="periodic").field(np.zeros(3)).tolist()
    [-1.0, -0.0, -0.0]
    """

    kind, unit, is_open = "translation", "m/s", True
    alike = "straight along", "along the moving frame"
    cure = "give the direction of the body, and cut its two ends across it"
    leak_cure = "through the sides of the body; its sections must be alike"

    def __init__(
        self,
        direction: ArrayLike | str = "x",
        rate: Factor = 0.0,
        acceleration: Factor | None = None,
        *,
        boundaries: str = "absorbing",
        damping: float = 0.0,
    ) -> None:
        super().__init__(direction, rate, acceleration, damping)
        self.boundaries = choice(boundaries, "boundaries", BOUNDARIES)
        self.A, self.center = np.zeros((3, 3)), np.zeros(3)

    def field(self, X: Array) -> Array:
        """Return -e."""
        return np.broadcast_to(-self.direction, X.shape)

    def wave_directions(self) -> Array:
        """Return the direction of the frame, (1, 3)."""
        return self.direction[None]

    def critical_rate(self, wave_speed: float, points: Array) -> float:
        """Return the rate in m/s at which the frame is as fast as waves of a speed in m/s."""
        return wave_speed * (FREE_BOUNDARIES if self.boundaries in ("absorbing", "natural") else 1.0)

    def phase(self, X: Array, points: Array) -> tuple[Array, NDArray[np.complex128]]:
        """Return 1 and e^{i φ} of points X (..., 3), φ from 0 to 2 π along the frame."""
        x, along = X @ self.direction, points @ self.direction
        return np.ones_like(x), np.exp(2j * np.pi * (x - along.min()) / np.ptp(along))

    def open_faces(self, mesh: Mesh) -> tuple[Ints, ...]:
        """Return the nodes of the two cut faces."""
        return cut_nodes(mesh, self.direction)

    def boundary_damping(self, mesh: Mesh, system: ConstrainedSystem) -> BlockMatrix | None:
        """Return the damping of absorbing boundaries, (3a, 3a) in N s/m, or None."""
        return dashpots(mesh, self.direction, system) if self.boundaries == "absorbing" else None

    def attach(self, structure: Structure) -> None:
        """Become the motion of a structure, and tie or fix its boundaries.

        Raises
        ------
        ModelError
            It has a motion already, is not straight, or its boundaries cannot be tied.
        """
        super().attach(structure)
        if self.boundaries == "fixed":
            for nodes in self.open_faces(structure.mesh):
                structure.supports.fix(nodes, "xyz")
        elif self.boundaries == "periodic":
            slaves, masters = periodic_pairs(structure.mesh, self.direction)
            structure.supports.constraints += tuple(
                MultiPointConstraint(3 * a + axis, (3 * b + axis,), (1.0,), symmetric=True)
                for a, b in zip(slaves.tolist(), masters.tolist(), strict=True)
                for axis in range(3)
            )


def _accelerated(start: float, acceleration: float | TimeSeries | None) -> Callable[[float], float]:
    """Return the rate in time from its start."""
    if isinstance(acceleration, TimeSeries):
        return lambda time: start + acceleration.integral(0.0, time)
    return lambda time: start + (acceleration or 0.0) * time


def _unit(direction: ArrayLike | str) -> Array:
    """Return a direction of any length as a unit vector."""
    if isinstance(direction, str):
        if direction not in AXES:
            raise InputError(f"an axis is 'x', 'y', 'z' or a vector; got {direction!r}")
        return np.array(AXES[direction])
    v = finite(direction, "an axis")
    largest = float(np.abs(v).max(initial=0.0))
    if v.shape != (3,) or largest == 0:
        raise InputError(f"an axis needs three components, not all 0; got {direction!r}")
    v = v / largest
    return np.asarray(v / np.linalg.norm(v))

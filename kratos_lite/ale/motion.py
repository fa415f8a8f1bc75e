"""Motions in which the mesh takes no part: a body of revolution rotates, a frame moves along a long body.

The mesh stands in space while the material moves through it with the velocity rate · c(X): c = A (X - X0) for
a rotation with A v = v × e, and c = -e for a frame that moves with +e along its body.  The material time
derivative of a displacement is u' + rate (c · grad) u, which adds to M u'' + K u = f

    2 rate G u' + (acceleration G - rate² H) u,
    G_ij = ∫ ρ N_i c·grad N_j,    H_ij = ∫ ρ (c·grad N_i)(c·grad N_j)

A motion belongs to a whole model, or to a part of it; then only the elements of that part add to G and H, and
boundaries are those of the part.

Source: GetFEM user documentation, ALE support for objects having a large rigid body motion, with the signs of
its loads and a factor 2 corrected; Nackenhorst, Comput. Methods Appl. Mech. Eng. 193 (2004) 4299-4322.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.ale.boundaries import check_ties, leak, moving_nodes
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh, WhereElements
from kratos_lite.model.attachments import Attachment
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.time_series import Factor, TimeSeries, function_of, slope_of
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.validation import finite, number

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
LEAK = 1e-2
"""Fraction of the velocity that may pass through the boundary before a warning is given."""
TOO_LEAKY = 0.2
"""That from which a body is not one of revolution, or not straight, at all."""


class Motion(Attachment):
    """The rigid motion of the material through a mesh that does not take part in it.

    Parameters
    ----------
    direction : ``"x"``, ``"y"``, ``"z"`` or (3,): the axis of a rotation or the direction of a translation.
    rate : number, `TimeSeries` or function of time, in the unit of the motion.
    acceleration : likewise; the derivative of the rate if not given, and 0 in a steady state.  A number or
        `TimeSeries` changes a rate that is a number as time goes on.
    damping : α in 1/s, mass-proportional damping relative to the rigid motion.
    part : the elements that move, by part name, property id or indices; all if not given.

    Attributes
    ----------
    direction : (3,) unit vector.
    rate, acceleration : functions of time in s.
    steady : whether they never change.
    A, center, drift : the velocity of the material through the mesh is A (X - center) + drift for the rate 1;
        (3, 3), (3,) and (3,).
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
    skew = True
    stiffening = False

    def __init__(
        self,
        direction: ArrayLike | str,
        rate: Factor,
        acceleration: Factor | None,
        *,
        damping: float = 0.0,
        part: WhereElements = None,
    ) -> None:
        self.direction = _unit(direction)
        self._rate = Rate(rate, acceleration)
        self.rate, self.acceleration = self._rate.value, self._rate.slope
        self.steady = self._rate.steady
        self.damping = number(damping, "a damping", least=0, unit="1/s")
        self.part = part
        self._center = vector_rates((0.0, 0.0, 0.0), None, "a center")
        self.A, self.center, self.drift = np.zeros((3, 3)), np.zeros(3), np.zeros(3)

    def __str__(self) -> str:
        when = "" if self.steady else " at the time 0"
        where = f", part {self.part!r}" if isinstance(self.part, (str, int)) else ""
        name = type(self).__name__
        return f"{name} {self.direction.tolist()}, rate {self.rate(0.0):g}{when}{where}"

    def rates(self, time: float, step: float = 0.0, steady: bool = False) -> tuple[float, float]:
        """Return rate and acceleration at a time.

        Parameters
        ----------
        time : s.
        step : s, over which an acceleration that was not given is the mean; its slope for 0.
        steady : take a rate that changes as one that stays, unless an acceleration was given.

        Returns
        -------
        In the unit of the motion, and that per second.
        """
        return self._rate.at(time, step, steady)

    def center_rates(self, time: float, step: float = 0.0, steady: bool = False) -> tuple[Array, Array]:
        """Return Ż and Z̈ of the whole body; 0 but for a rotation whose center moves.

        Parameters
        ----------
        time, step, steady : as for `rates`.

        Returns
        -------
        (3,) m/s and (3,) m/s².
        """
        velocity, acceleration = np.transpose([one.at(time, step, steady) for one in self._center])
        return velocity, acceleration

    @property
    def travels(self) -> bool:
        """Whether the body as a whole moves in space with its center."""
        return any(not one.steady or one.value(0.0) for one in self._center)

    @property
    def uniformly_accelerated(self) -> bool:
        """Whether Z̈ never changes."""
        return not any(one.is_changing for one in self._center)

    def moving(self, mesh: Mesh) -> Mask:
        """Return the nodes of the elements that move.

        Parameters
        ----------
        mesh : that of the model.

        Returns
        -------
        (n,) bool.
        """
        return moving_nodes(mesh, self.part)

    def field(self, X: Array) -> Array:
        """Return the velocity c of the material through the mesh for the rate 1.

        Parameters
        ----------
        X : (..., 3) points in m.

        Returns
        -------
        (..., 3), m for a rotation, without unit for a translation.
        """
        return self.body_velocity(X) + self.drift

    def body_velocity(self, X: Array) -> Array:
        """Return the velocity of the undeformed body in space, but for Ż, for the rate 1.

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
        """Return the directions (k, 3) of the waves that matter."""

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
        The largest fraction, 0 … 1.
        """
        return leak(mesh, self.field, self.moving(mesh), self.open_faces(mesh))

    def attach(self, structure: Structure) -> None:
        """Become the motion of a structure, and tie or fix its boundaries if requested.

        Raises
        ------
        ModelError
            It has a motion already, is not a body that may move so, or its boundaries cannot be tied.
        """
        if structure.motion is not None:
            raise ModelError("the model has a motion already; there is one")
        fraction = self.leak(structure.mesh)
        if fraction > TOO_LEAKY:
            raise ModelError(
                f"the body is not {self.alike[0]} the axis {self.direction.tolist()}: {fraction:.0%} of the "
                f"velocity passes through its boundary; {self.cure}"
            )
        self._bind(structure)
        structure._motion = self

    def _bind(self, structure: Structure) -> None:
        """Tie or fix boundaries."""

    def warnings(self, structure: Structure, groups: Sequence[ElementGroup]) -> list[str]:
        """Return the warnings about the motion of a structure, except those about its rate.

        Parameters
        ----------
        structure : what moves.
        groups : the elements that move.

        Returns
        -------
        One sentence each.
        """
        fraction = self.leak(structure.mesh)
        warnings = [f"{fraction:.1%} of the velocity passes {self.leak_cure}"] if fraction > LEAK else []
        return warnings + check_ties(structure, self.moving(structure.mesh), self.field, self.travels)


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


# ---- rates in time ------------------------------------------------------------------------------------


class Rate:
    """A rate in time and its acceleration, of numbers, `TimeSeries` or functions of time in s."""

    def __init__(self, rate: Factor, acceleration: Factor | None, what: str = "a rate") -> None:
        self.is_accelerated = acceleration is not None
        self.value = function_of(rate, what)
        self.slope = slope_of(rate, what)
        if acceleration is not None:
            self.slope = function_of(acceleration, "an acceleration")
        self.steady = not (callable(rate) or callable(acceleration) or acceleration)
        self.is_changing = callable(rate if acceleration is None else acceleration)
        if not callable(rate):
            start = self.value(0.0)
            if isinstance(acceleration, TimeSeries):
                self.value = lambda time: start + acceleration.integral(0.0, time)
            elif acceleration is not None and not callable(acceleration):
                self.value = lambda time: start + self.slope(time) * time

    def at(self, time: float, step: float = 0.0, steady: bool = False) -> tuple[float, float]:
        """Return rate and acceleration at a time in s, the mean over a step in s if not given."""
        if self.is_accelerated or not (steady or step):
            return self.value(time), self.slope(time)
        if steady:
            return self.value(time), 0.0
        start, end = max(time - step / 2, 0.0), time + step / 2
        return self.value(time), (self.value(end) - self.value(start)) / (end - start)


def vector_rates(velocity: Sequence[Factor], acceleration: Sequence[Factor] | None, what: str) -> list[Rate]:
    """Return the rates of three components, each a number, `TimeSeries` or function of time."""
    name, none = f"{what} velocity", (None,) * 3
    accelerations = none if acceleration is None else _components(acceleration, f"{what} acceleration")
    return [Rate(*pair, name) for pair in zip(_components(velocity, name), accelerations, strict=True)]


def _components(values: Sequence[Factor], what: str) -> tuple[Factor, Factor, Factor]:
    try:
        x, y, z = values
    except (TypeError, ValueError):
        raise InputError(
            f"{what} has three components, each a number, TimeSeries or function of time; got {values!r:.80}"
        ) from None
    return x, y, z

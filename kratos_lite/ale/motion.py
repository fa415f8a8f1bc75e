"""Motions in which the mesh takes no part: a body of revolution that turns, a long body that passes.

The mesh stands in space while the material moves through it with the velocity rate · c(X): c = A (X - X0) for
a rotation with A v = v × e, and c = -e for a window that moves with +e along its body.  The material time
derivative of a displacement is u' + rate (c · grad) u, which adds to M u'' + K u = f

    2 rate G u' + (acceleration G - rate² H) u,
    G_ij = ∫ ρ N_i c·grad N_j,    H_ij = ∫ ρ (c·grad N_i)(c·grad N_j)

Source: GetFEM user documentation, ALE support for objects having a large rigid body motion, with the signs of
its loads and a factor 2 put right; Nackenhorst, Comput. Methods Appl. Mech. Eng. 193 (2004) 4299-4322.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.errors import InputError
from kratos_lite.time_series import Factor, TimeSeries, function_of, slope_of
from kratos_lite.typing import Array
from kratos_lite.validation import finite, flag, number

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
ENDS = ("absorbing", "periodic", "fixed", "natural")
"""What the two cut faces of a window do."""


class Motion(ABC):
    """The rigid motion of the material through a mesh that does not take part in it.

    Attributes
    ----------
    direction : (3,) unit vector, the axis of a rotation or the way of a window.
    rate, acceleration : functions of the time in s.
    steady : whether they never change.
    is_accelerated : whether the acceleration was given, and not taken from the rate.
    damping : α in 1/s, mass-proportional damping relative to the rigid motion.
    """

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
        self.damping = number(damping, "a damping")
        if self.damping < 0:
            raise InputError(f"a damping must be one number in 1/s, ≥ 0; got {damping}")

    def __str__(self) -> str:
        when = "" if self.steady else " at the time 0"
        return f"{type(self).__name__} {self.direction.tolist()}, rate {self.rate(0.0):g}{when}"

    @abstractmethod
    def field(self, X: Array) -> Array:
        """Return the velocity c of the material through the mesh for the rate 1 at points X (..., 3)."""


class Rotation(Motion):
    """A body of revolution that turns about its axis while its mesh stands still.

    Geometry, density and material must be axisymmetric.  A positive rate turns clockwise about the axis, as
    seen from its tip: c = (X - X0) × e.

    Parameters
    ----------
    axis : ``"x"``, ``"y"``, ``"z"`` or (3,).
    rate : rad/s; number, `TimeSeries` or function of the time.
    acceleration : rad/s², likewise; if not given the derivative of the rate, and 0 in a steady state.  A
        number or `TimeSeries` changes a rate that is a number as the time goes on.
    center : (3,) m, a point of the axis.
    skew : take the skew part of G, which keeps the energy on every mesh.
    stiffening : add the stiffness that the centrifugal stress gives; a rotor that may turn freely needs it.
    damping : α in 1/s.

    Examples
    --------
    >>> Rotation("z", rate=30.0).field(np.array([1.0, 0.0, 5.0]))
    array([ 0., -1.,  0.])
    """

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
        self.center = finite(center, "the center of a rotation")
        if self.center.shape != (3,):
            raise InputError(f"the center of a rotation must have shape (3,); got {self.center.shape}")
        self.skew, self.stiffening = flag(skew, "skew"), flag(stiffening, "stiffening")
        self.A = np.cross(np.eye(3), self.direction).T

    def field(self, X: Array) -> Array:
        """Return A (X - X0) = (X - X0) × e."""
        return np.asarray((X - self.center) @ self.A.T)


class Translation(Motion):
    """A window that moves along a long body, whose material passes through its mesh.

    Parameters
    ----------
    direction : ``"x"``, ``"y"``, ``"z"`` or (3,): the way of the window for a positive rate.
    rate : m/s; number, `TimeSeries` or function of the time.
    acceleration : m/s², likewise; if not given the derivative of the rate, and 0 in a steady state.  A number
        or `TimeSeries` changes a rate that is a number as the time goes on.
    ends : what the two faces across the direction do: ``absorbing`` lets waves out (Lysmer's dashpots),
        ``periodic`` joins them, ``fixed`` holds them, ``natural`` leaves them to what the model says.
    damping : α in 1/s.
    """

    def __init__(
        self,
        direction: ArrayLike | str = "x",
        rate: Factor = 0.0,
        acceleration: Factor | None = None,
        *,
        ends: str = "absorbing",
        damping: float = 0.0,
    ) -> None:
        super().__init__(direction, rate, acceleration, damping)
        if ends not in ENDS:
            raise InputError(f"ends must be one of {', '.join(ENDS)}; got {ends!r}")
        self.ends = ends

    def field(self, X: Array) -> Array:
        """Return -e."""
        return np.broadcast_to(-self.direction, X.shape)


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

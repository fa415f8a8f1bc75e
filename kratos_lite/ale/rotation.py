"""Rotation: a body of revolution that rotates about its axis while its mesh stands still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.ale.motion import Motion
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.tables import lame_constants
from kratos_lite.model.structure import Structure
from kratos_lite.time_series import Factor
from kratos_lite.typing import Array
from kratos_lite.validation import finite, flag


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
        """Return the warnings about the motion of a structure, except those about its rate."""
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

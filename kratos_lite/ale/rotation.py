"""Rotation: a body of revolution that rotates about its axis while its mesh stands still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.ale.motion import Motion, vector_rates
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.tables import lame_constants
from kratos_lite.mesh import WhereElements
from kratos_lite.model.structure import Structure
from kratos_lite.time_series import Factor
from kratos_lite.typing import Array
from kratos_lite.validation import finite, flag


class Rotation(Motion):
    """A body of revolution that rotates about its axis while its mesh stands still, or travels along.

    Geometry, density and material must be axisymmetric.  A positive rate turns clockwise about the axis, as
    seen from its tip: c = (X - X0) × e.

    The center may travel by Z(t).  A material point that starts at Y in the undeformed body has turned to
    X = R(t) Y, measured from the center, and is at x(t) = X + u(t, X) + Z(t).  So u and the mesh are given in
    axes that travel with the center, but keep their directions, those of x, y and z in space.  With
    X' = rate A X along the way of the material point::

        x'  = u'  + rate (c·grad) u + rate A X + Ż
        x'' = u'' + 2 rate (c·grad) u' + acceleration (c·grad) u + rate² (c·grad)² u
            + rate² A² X + acceleration A X + Z̈

    In these axes Ż and Z̈ stand as they are; they would be Rᵀ Ż and Rᵀ Z̈ in axes that turn with the body.
    Neither depends on X: Ż has no effect on u, and Z̈ adds the load -∫ ρ N Z̈, that of a gravity -Z̈.
    Supports and loads travel with the center.

    Parameters
    ----------
    axis : ``"x"``, ``"y"``, ``"z"`` or (3,).
    rate, acceleration : rad/s and rad/s², numbers, `TimeSeries` or functions of time; see `Motion`.
    center : (3,) m, a point of the axis.
    center_velocity : Ż, three components in m/s, each a number, `TimeSeries` or function of time.
    center_acceleration : Z̈ in m/s², likewise; if not given the derivative of Ż, and 0 in a steady state.
    skew : take the skew part of G, which keeps the energy on every mesh.
    stiffening : add the stiffness that the centrifugal stress gives; a rotor that may rotate freely needs it.
    damping, part : α in 1/s, and the elements that move; see `Motion`.

    Raises
    ------
    InputError
        An argument is not what it must be.

    Examples
    --------
    >>> rotor = Rotation("z", rate=30.0, center_acceleration=(0.0, 0.0, 2.0))
    >>> rotor.field(np.array([1.0, 0.0, 5.0]))
    array([ 0., -1.,  0.])
    >>> velocity, acceleration = rotor.center_rates(3.0)
    >>> velocity.tolist(), acceleration.tolist()
    ([0.0, 0.0, 6.0], [0.0, 0.0, 2.0])
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
        center_velocity: Sequence[Factor] = (0.0, 0.0, 0.0),
        center_acceleration: Sequence[Factor] | None = None,
        skew: bool = True,
        stiffening: bool = False,
        damping: float = 0.0,
        part: WhereElements = None,
    ) -> None:
        super().__init__(axis, rate, acceleration, damping=damping, part=part)
        self.center = finite(center, "the center of a rotation", (3,))
        self._center = vector_rates(center_velocity, center_acceleration, "a center")
        self.skew, self.stiffening = flag(skew, "skew"), flag(stiffening, "stiffening")
        self.A = np.cross(np.eye(3), self.direction).T

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
        warnings = super().warnings(structure, groups)
        if any(lame_constants(group.material.C) is None for group in groups):
            warnings.append("an anisotropic material is not axisymmetric unless its axes turn with the angle")
        c = self.field(structure.mesh.points) * self.moving(structure.mesh)[:, None]
        held, springs = np.abs(c * structure.supports.fixed).max(), structure.supports.springs
        if springs is not None:
            held += np.abs(springs @ c.ravel()).max() / float(abs(springs).max())
        if not self.stiffening and not held > 1e-9 * np.abs(c).max():
            warnings.append(
                "nothing holds the rotation about the axis: in the linear theory a free rotor is unstable at "
                "any rate; fix the hub, or take stiffening=True"
            )
        return warnings

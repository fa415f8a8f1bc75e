"""Translation: a frame that moves along a long body, whose material passes through its mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.ale.boundaries import cut_nodes, dashpots
from kratos_lite.ale.motion import Motion
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.mesh import Mesh, WhereElements
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.time_series import Factor
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import choice

BOUNDARIES = ("absorbing", "periodic", "fixed", "natural")
"""What the two cut faces of a moving frame do."""
FREE_BOUNDARIES = 0.7
"""Fraction of the Rayleigh speed from which frames with free or absorbing boundaries are critical."""


class Translation(Motion):
    """A frame that moves along a long body, whose material passes through its mesh.

    Parameters
    ----------
    direction : ``"x"``, ``"y"``, ``"z"`` or (3,): where the frame moves at a positive rate.
    rate, acceleration : m/s and m/s², numbers, `TimeSeries` or functions of time; see `Motion`.
    boundaries : what the two cut faces across the direction do: ``absorbing`` lets waves out (Lysmer's
        dashpots), ``periodic`` ties them, ``fixed`` holds them, ``natural`` leaves them to the supports.
    damping, part : α in 1/s, and the elements that move; see `Motion`.

    Raises
    ------
    InputError
        An argument is not what it must be.

    Examples
    --------
    >>> Translation("x", rate=20.0, boundaries="periodic").field(np.zeros(3)).tolist()
    [-1.0, 0.0, 0.0]
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
        part: WhereElements = None,
    ) -> None:
        super().__init__(direction, rate, acceleration, damping=damping, part=part)
        self.boundaries = choice(boundaries, "boundaries", BOUNDARIES)
        self.drift = -self.direction

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
        return cut_nodes(mesh, self.direction, self.moving(mesh))

    def boundary_damping(self, mesh: Mesh, system: ConstrainedSystem) -> BlockMatrix | None:
        """Return the damping of absorbing boundaries, (3a, 3a) in N s/m, or None."""
        if self.boundaries != "absorbing":
            return None
        return dashpots(mesh, self.direction, system, self.moving(mesh))

    def _bind(self, structure: Structure) -> None:
        """Tie or fix the boundaries."""
        if self.boundaries == "fixed":
            for nodes in self.open_faces(structure.mesh):
                structure.fix(nodes)
        elif self.boundaries == "periodic":
            structure.periodic(*self.open_faces(structure.mesh))

"""What a constraint on a single body is.

A constraint has a Jacobian H, along whose rows its reactions push, and a gap, which a step closes.  The gap
is taken at the end of the step: a point that is fixed stays where it is, and a link keeps its length, to
round-off.

Source: Solfec-1.0 user manual, constraints; its velocity-level laws are replaced by those of positions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.linear_algebra import Entries, block_entries
from kratos_lite.bodies.validation import points_of
from kratos_lite.errors import InputError, ModelError
from kratos_lite.typing import Array

Points: TypeAlias = "str | Callable[[Array], ArrayLike] | ArrayLike"
"""Points (3,) or (m, 3) in m of the undeformed body; or nodes by a part of the mesh or a predicate."""


class Constraint(ABC):
    """Something that holds material points of a body, along r directions at each point.

    Parameters
    ----------
    points : (3,) or (m, 3) m, in the undeformed body; or a part or side of the mesh (``"x-"``), or a
        predicate on its points (n, 3), for the nodes there.

    Attributes
    ----------
    points : (m, 3) m, in the undeformed body.
    positional : whether it is about positions, so that it also constrains a body at rest.
    turning : whether its directions change as the body moves.
    reactions : (m, 3) N, mean force on the points over the last step.

    Raises
    ------
    InputError
        There is no point, or points have not three finite coordinates.
    """

    positional: ClassVar[bool] = True
    turning: ClassVar[bool] = False

    def __init__(self, points: Points) -> None:
        self._where = points if isinstance(points, str) or callable(points) else None
        self._hold(np.zeros((1, 3)) if isinstance(points, str) or callable(points) else points_of(points))
        self._body: FreeBody | None = None
        self._jacobian: Array | None = None

    def _hold(self, points: Array) -> None:
        """Take note of the points."""
        self.points = np.atleast_2d(points)
        if not len(self.points):
            raise InputError(f"a {type(self).__name__} needs one point at least; got none")
        self.reactions = np.zeros_like(self.points)

    # ---- what a kind of constraint defines -------------------------------------------------------

    @abstractmethod
    def directions(self, x: Array) -> Array:
        """Return the directions (m, r, 3) along which points at x (m, 3) are constrained."""

    @abstractmethod
    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return by how much points x (m, 3) miss the constraint, a length over h/2, (m, r) in m/s."""
        # In h/2 the velocity at the end of a step closes the gap.

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the velocities (m, r) in m/s along the directions with which the points start, v now."""
        return np.zeros_like(v)

    def begin(self, body: FreeBody, h: float) -> None:  # noqa: B027 - most have nothing to prepare
        """Prepare a step of h s of a body in its state before it."""

    # ---- what is the same for all ----------------------------------------------------------------

    def bind(self, body: FreeBody) -> None:
        """Take hold of a single body where it is now; ModelError for a batch, or if it holds another body."""
        if body.q.ndim > 1:
            raise ModelError("a constraint holds a single body; integrate bodies with constraints one by one")
        if self._body is not None and self._body is not body:
            raise ModelError("this constraint holds another body already; make one for each body")
        if self._where is not None:
            if body.mesh is None:
                raise ModelError("nodes are chosen from a mesh, and this body has none; give points (m, 3)")
            self._hold(body.mesh.points[body.mesh.nodes(self._where)])
        body.locate(self.points)
        self._body, self._start = body, body.position(self.points)

    @property
    def count(self) -> int:
        """Number of rows m r."""
        return len(self.points)

    def jacobian_entries(self, body: FreeBody, q: Array) -> Entries:
        """Return rows, dofs and values (k,) of H (m r, dofs): points move along their directions with H u."""
        directions = self.directions(body.position(self.points, q))
        row, dof, value = [], [], []
        for i, X in enumerate(self.points):
            dofs, matrix = body.jacobian(X, q)
            block = directions[i] @ matrix
            r, k = np.nonzero(np.abs(block) > 1e-14 * np.abs(matrix).max())
            row.append(r + i * len(block))
            dof.append(dofs[k])
            value.append(block[r, k])
        return np.concatenate(row), np.concatenate(dof), np.concatenate(value)

    def jacobian(self, body: FreeBody, q: Array) -> Array:
        """Return H (m r, dofs) as a full matrix; it is kept where it is always the same."""
        if self._jacobian is not None:
            return self._jacobian
        row, dof, value = self.jacobian_entries(body, q)
        H = np.zeros((self.count, body.dofs))
        H[row, dof] = value
        if body.jacobian_is_constant and not self.turning:
            self._jacobian = H
        return H

    def turning_stiffness(self, x: Array, multipliers: Array) -> Array:
        """Return the derivative (m, 3, 3) in N/m of the reactions by places, which turn directions."""
        return np.zeros((len(x), 3, 3))

    def tangent_entries(self, body: FreeBody, q: Array, multipliers: Array) -> list[Entries]:
        """Return rows, columns and values (k,) of the derivative of the reactions by q; [] if none."""
        if not self.turning:
            return []
        x = body.position(self.points, q)
        changes = self.turning_stiffness(x, multipliers.reshape(self.directions(x).shape[:2]))
        entries = []
        for X, change in zip(self.points, changes, strict=True):
            dofs, H = body.jacobian(X, q)
            entries.append(block_entries(dofs, dofs, H.T @ change @ H))
        return entries

    def gaps(self, body: FreeBody, q: Array, u: Array, time: float, h: float) -> Array:
        """Return the gaps (m r,) in m/s of a body; see `gap`."""
        x, v = body.position(self.points, q), body.velocity(self.points, q, u)
        return self.gap(x, v, time, h).ravel()

    def set_reactions(self, body: FreeBody, q: Array, multipliers: Array) -> None:
        """Take note of the reactions of multipliers (m r,) in N along the directions."""
        directions = self.directions(body.position(self.points, q))
        self.reactions = np.einsum("mr,mri->mi", multipliers.reshape(directions.shape[:2]), directions)


def with_slices(constraints: Iterable[Constraint]) -> Iterator[tuple[Constraint, slice]]:
    """Yield each constraint with the slice of its multipliers among those of all."""
    start = 0
    for constraint in constraints:
        yield constraint, slice(start, start := start + constraint.count)

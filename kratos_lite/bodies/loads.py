"""Loads on bodies: forces and torques fixed in space or in the body, following pressure, springs, callbacks.

A load is bound to a body when it is added; what is bound gives the generalized force at any configuration.
Loads of models (gravity, tractions, dead pressure, …) act through their nodal forces, on every kind of body.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.assembly.element_groups import add_nodal
from kratos_lite.bodies.applied_load import AppliedLoad, BodyLoad, no_potential
from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.linear_algebra import Entries, block_entries, sum_of
from kratos_lite.bodies.validation import fitting, one_point
from kratos_lite.elements.surface import surface_pressure, surface_pressure_tangent
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Where
from kratos_lite.model.loads.surface import outward
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import choice, finite, number

FRAMES = ("spatial", "follower")


class Force(BodyLoad):
    """A force on a material point.

    Parameters
    ----------
    point : (3,) m, in the undeformed body.
    force : (3,) N.
    frame : ``spatial`` keeps its direction in space, ``follower`` moves with the body (times Λ or F).
    """

    def __init__(self, point: ArrayLike, force: ArrayLike, frame: str = "spatial") -> None:
        self.point, self.force = one_point(point), finite(force, "a force", ("...", 3))
        self.frame = choice(frame, "frame", FRAMES)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body; MeshError if the point lies outside."""
        X, f = self.point, fitting(self.force, body.q.shape[:-1], 1, "a force")
        body.locate(X)
        if self.frame == "follower":
            moment, f = np.broadcast_arrays(np.cross(X - body.center, f), f)
            return AppliedLoad(
                lambda q, u, t: body.generalized_force(X, body.push_forward(f, X, q), q),
                follower=np.concatenate([moment, f], axis=-1) if body.takes_torques else None,
                tangent=lambda q, u, t: _follower_tangent(body, X, f, q),
            )
        central = body.jacobian_is_constant or bool((np.abs(X - body.center) == 0).all())
        return AppliedLoad(
            lambda q, u, t: body.generalized_force(X, f, q),
            spatial=body.generalized_force(X, f, body.q) if central else None,
            potential_energy=lambda q: np.asarray(-(f * body.position(X, q)).sum(axis=-1)),
        )


def _follower_tangent(body: FreeBody, X: Array, force: Array, q: Array) -> Entries:
    """Return the derivative of a force that moves with a body, whose F is linear in q."""
    dofs, H = body.jacobian(X, q)
    start = body.push_forward(force, X, np.zeros_like(q))
    units = (dofs[:, None] == np.arange(len(q))).astype(float)
    columns = [body.push_forward(force, X, unit) - start for unit in units]
    return block_entries(dofs, dofs, H.T @ np.transpose(columns))


class Torque(BodyLoad):
    """A torque on a rigid body.

    Parameters
    ----------
    torque : (3,) N m.
    frame : ``spatial`` keeps its direction in space, ``follower`` turns with the body.
    """

    def __init__(self, torque: ArrayLike, frame: str = "spatial") -> None:
        self.torque, self.frame = finite(torque, "a torque", ("...", 3)), choice(frame, "frame", FRAMES)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body; ModelError unless it is rigid."""
        t = fitting(self.torque, body.q.shape[:-1], 1, "a torque")
        body.generalized_torque(t, body.q)  # an error where bodies of the kind take none
        fixed = np.broadcast_to(np.concatenate([t, np.zeros_like(t)], axis=-1), body.u.shape)
        if self.frame == "follower":
            return AppliedLoad(lambda q, u, time: fixed, follower=fixed)
        return AppliedLoad(lambda q, u, time: body.generalized_torque(t, q), spatial=fixed)


class Spring(BodyLoad):
    """A spring, with a damper if wanted, from a material point to a fixed point in space.

    Parameters
    ----------
    point : (3,) m, in the undeformed body.
    anchor : (3,) m, in space.
    stiffness : N/m, or a function (elongation in m, its rate in m/s) that gives the pull in N.
    damping : N s/m.
    length : natural length in m; that at the start if not given.
    """

    def __init__(
        self,
        point: ArrayLike,
        anchor: ArrayLike,
        stiffness: float | Callable[[float, float], float],
        damping: float = 0.0,
        length: float | None = None,
    ) -> None:
        self.point, self.anchor = one_point(point), one_point(anchor)
        what = "the stiffness of a spring"
        self.stiffness = stiffness if callable(stiffness) else number(stiffness, what, least=0, unit="N/m")
        self.damping = number(damping, "the damping of a spring", least=0, unit="N s/m")
        self.length = None if length is None else number(length, "the length of a spring", least=0, unit="m")

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body; MeshError if the point lies outside.

        Raises
        ------
        ModelError
            The body is a batch.
        """
        if body.q.ndim > 1:
            raise ModelError("a spring acts on single bodies; integrate them one by one")
        X, anchor = self.point, self.anchor
        body.locate(X)
        L = float(np.linalg.norm(body.position(X) - anchor)) if self.length is None else self.length

        def stretched(q: Array, u: Array) -> tuple[Ints, Array, Array, float, float]:
            """Return dofs and Jacobian of the point, direction and distance from the anchor, and its rate."""
            y = body.position(X, q) - anchor
            distance = float(np.linalg.norm(y))
            n = y / distance if distance > 0 else np.zeros(3)
            dofs, H = body.jacobian(X, q)
            return dofs, H, n, distance, float(n @ (H @ u[dofs]))

        def generalized(q: Array, u: Array, time: float) -> Array:
            _, _, n, distance, rate = stretched(q, u)
            return body.generalized_force(X, -self._pull(distance - L, rate) * n, q)

        def tangent(q: Array, u: Array, time: float) -> Entries:
            dofs, H, n, distance, rate = stretched(q, u)
            along, across = self._stiffness(distance - L, rate, distance)
            push = -across * np.eye(3) - (along - across) * np.outer(n, n)
            return block_entries(dofs, dofs, H.T @ push @ H)

        def potential(q: Array) -> Array:
            assert not callable(self.stiffness)
            stretch = np.linalg.norm(body.position(X, q) - anchor) - L
            return np.asarray(self.stiffness * stretch**2 / 2)

        damped, ends = callable(self.stiffness) or self.damping > 0, (X, anchor)
        applied = AppliedLoad(generalized, tangent=tangent, follows_velocity=damped, ends=ends)
        applied.potential_energy = no_potential if callable(self.stiffness) else potential
        return applied

    def _stiffness(self, elongation: float, rate: float, distance: float) -> tuple[float, float]:
        """Return the derivative of the pull along the spring, and across it, at rest, in N/m."""
        if callable(self.stiffness):
            h = 1e-6 * max(distance, abs(elongation), 1e-12)
            along = (self._pull(elongation + h, rate) - self._pull(elongation - h, rate)) / (2 * h)
        else:
            along = self.stiffness
        return along, self._pull(elongation, rate) / distance if distance > 0 else along

    def _pull(self, elongation: float, rate: float) -> float:
        if callable(self.stiffness):
            return float(self.stiffness(elongation, rate))
        return self.stiffness * elongation + self.damping * rate


class FollowerPressure(BodyLoad):
    """Pressure on faces of the deformed body: it follows their normals and areas.

    A positive pressure pushes into the body.  `kratos_lite.Pressure` is the dead one: normals and areas are
    those of the undeformed body (as in Solfec-1.0, whose sign is the other way round).

    Parameters
    ----------
    where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
    pressure : Pa.

    Raises
    ------
    InputError
        The pressure is not one number.
    """

    def __init__(self, where: Where, pressure: float) -> None:
        self.where, self.pressure = where, number(pressure, "a pressure", unit="Pa")

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body.

        Raises
        ------
        ModelError
            The body is a batch of bodies or has no mesh, or there are no such faces.
        """
        mesh = body.mesh
        if mesh is None:
            raise ModelError("a pressure acts on the faces of a mesh; this body has none")
        if body.q.ndim > 1:
            raise ModelError("a following pressure acts on single bodies; integrate them one by one")
        blocks = [(block, self.pressure * outward(mesh, block)) for block in mesh.faces(self.where)]
        if not blocks:
            raise ModelError(f"a pressure finds no face on {self.where!r}")

        def generalized(q: Array, u: Array, time: float) -> Array:
            x = body.position(mesh.points, q)
            nodal = np.zeros_like(x)
            for block, p in blocks:
                assert block.shape is not None
                add_nodal(nodal, block.nodes, surface_pressure(block.shape, x[block.nodes], p))
            return body.generalized_nodal_force(nodal, q)

        def tangent(q: Array, u: Array, time: float) -> Entries:
            x, changes = body.position(mesh.points, q), []
            for block, p in blocks:
                assert block.shape is not None
                dofs = (3 * block.nodes[..., None] + np.arange(3)).reshape(len(block.nodes), -1)
                change = surface_pressure_tangent(block.shape, x[block.nodes], p)
                changes.append(block_entries(dofs, dofs, change))
            return body.generalized_nodal_tangent(sum_of(changes))

        return AppliedLoad(generalized, tangent=tangent)


class Callback(BodyLoad):
    """A load of your own.

    Parameters
    ----------
    function : takes configuration q, velocity u and time t in s, and returns the generalized force
        (..., dofs); for a rigid body also nine numbers: spatial force, spatial and referential torque.
    of_velocity : whether it depends on u; then each step is taken twice, with the old velocity and with the
        mean of old and new.

    Raises
    ------
    InputError
        It is not a function.

    Examples
    --------
    >>> import numpy as np
    >>> top = Callback(lambda q, u, t: np.r_[0, 0, 0, -20 * np.cross(q[6:9], [0, 0, 1]), 0, 0, 0])
    """

    def __init__(
        self, function: Callable[[Array, Array, float], ArrayLike], *, of_velocity: bool = True
    ) -> None:
        if not callable(function):
            raise InputError(f"a callback is a function of q, u and t; got {function!r}")
        self.function, self.of_velocity = function, bool(of_velocity)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body."""

        def generalized(q: Array, u: Array, time: float) -> Array:
            out = finite(self.function(q, u, time), f"what a callback returns at t = {time:g} s")
            if body.takes_torques and out.shape == (*q.shape[:-1], 9):
                total = body.generalized_torque(out[..., 3:6], q)
                total[..., :3] += out[..., 6:]
                total[..., 3:] = out[..., :3]
                return total
            if out.shape != u.shape:
                nine = " (or 9 numbers a body)" if body.takes_torques else ""
                raise InputError(
                    f"a callback must return a generalized force of shape {u.shape}{nine}; got {out.shape}"
                )
            return out

        return AppliedLoad(generalized, follows_velocity=self.of_velocity)

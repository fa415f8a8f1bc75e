"""Integrators of rigid bodies, one or many through leading axes.

Each step is drift–kick–drift: half a step with the old velocity, loads at the middle, the new velocity, and
half a step with that.  They differ in the new angular velocity.  Arrays are advanced in place, compiled where
the kernel was built and arrays are C-contiguous float64; what is written here in NumPy is the reference.

q (..., 12): rotation R column by column, then the mass center x in m.
u (..., 6): referential angular velocity W in rad/s, then v in m/s.
A load (..., 6) is a referential torque and a force.

Source: Koziara & Bicanic, Int. J. Numer. Meth. Eng. 81 (2010) 1073-1092.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.analysis.integrators.base import BodyIntegrator
from kratos_lite.analysis.integrators.kernels import StepKernel, compiled
from kratos_lite.bodies.constraint_projection import Step, constrained_step
from kratos_lite.bodies.linear_algebra import apply, first, length, solve, transposed
from kratos_lite.bodies.rigid import FixedBody, RigidBody
from kratos_lite.bodies.rotations import exp, hat, right_jacobian, rotation_of, set_rotation
from kratos_lite.typing import Array, Mask

METHODS = ("explicit", "momentum_conserving", "implicit")
TOLERANCE = 1e-14  # residual of the implicit method beside the momentum
NEWTON_MAX = 50
ROUND_OFF = 4e-16  # change of a velocity beside it that is none


class _Rigid(BodyIntegrator[RigidBody]):
    bodies = RigidBody

    def free_steps(self, body: RigidBody, h: float, count: int) -> bool:
        """Take steps in the kernel."""
        KERNEL.advance(body, *body.constant_loads(), h=h, count=count)
        return True

    def step(self, body: RigidBody, h: float, v: Array) -> Array:
        """Take a step; see `BodyIntegrator.step`."""
        qh = half_step(body.q, body.u, h)
        load = body.external_force(qh, body.time + h / 2, v)

        def advance(extra: Array) -> Step:
            q, u = body.q.copy(), body.u.copy()
            arrays = q, u, qh, load + extra, *body.step_constants()
            KERNEL.finish(*arrays, h=h, method=self.name, tolerance=body.tolerance)
            return Step(q, u, load)

        return constrained_step(body, h, qh, advance, body.mass_solver)


class RigidExplicit(_Rigid):
    """Explicit midpoint rule (Solfec's RIG_POS): the energy grows slowly."""

    name = "explicit"


class RigidMomentumConserving(_Rigid):
    """Explicit, with the spatial angular momentum exact (Solfec's RIG_NEG): the energy decays slowly."""

    name = "momentum_conserving"


class RigidImplicit(_Rigid):
    """Implicit and symmetric in time (Solfec's RIG_IMP): momentum exact, energy bounded."""

    name = "implicit"


class Uniform(BodyIntegrator[FixedBody]):
    """Motion with the velocity as it is, of fixed bodies."""

    name = "uniform"
    bodies = FixedBody

    def free_steps(self, body: FixedBody, h: float, count: int) -> bool:
        """Take steps."""
        for _ in range(count):
            self.step(body, h, body.u)
        return True

    def step(self, body: FixedBody, h: float, v: Array) -> Array:
        """Take a step."""
        body.q[...] = half_step(body.q, body.u, 2 * h)
        return np.zeros_like(body.u)


def half_step(q: Array, u: Array, h: float) -> Array:
    """Return q (..., 12) at mid-step: R exp(h/2 W), x + h/2 v.

    >>> q = np.array([1.0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0])
    >>> half_step(q, np.array([0.0, 0, 0, 2, 0, 0]), 0.5)[9:]
    array([0.5, 0. , 0. ])
    """
    out = np.empty(q.shape)
    if compiled("rigid_half", q, u, h, out) is NotImplemented:
        R, x = rotation_of(q) @ exp(h / 2 * u[..., :3]), q[..., 9:] + h / 2 * u[..., 3:]
        set_rotation(out, R)
        out[..., 9:] = x
    return out


def _step(q: Array, u: Array, *arguments: Any) -> tuple[Array, int]:
    """Take a step under constant loads; return the load, and the first body that failed or -1."""
    *inertia, mass, acceleration, spatial, follower, h, method, tolerance = arguments
    qh, load = half_step(q, u, h), np.empty(u.shape)
    R = rotation_of(qh)
    load[..., :3] = transposed(R, spatial[..., :3]) + follower[..., :3]
    load[..., 3:] = mass[..., None] * acceleration + spatial[..., 3:] + apply(R, follower[..., 3:])
    return load, _finish(q, u, qh, load, *inertia, mass, h, method, tolerance)


def _finish(q: Array, u: Array, qh: Array, load: Array, *arguments: Any) -> int:
    """Complete a step from q, u in place, with the load at qh; return the first body that failed, or -1."""
    J, inverse, mass, h, method, tolerance = arguments
    W, T, Rh = u[..., :3], load[..., :3], rotation_of(qh)
    with np.errstate(all="ignore"):
        p = transposed(exp(h / 2 * W), apply(J, W))
        Wh = apply(inverse, p + h / 2 * T)
        W1 = W + h * apply(inverse, T - np.cross(Wh, apply(J, Wh)))
        v1 = u[..., 3:] + h * load[..., 3:] / mass[..., None]
        A = p + h * T
        going = np.zeros(q.shape[:-1], dtype=bool)
        if method == "implicit":
            W1, going = _implicit_velocity(J, A, W1, h, tolerance)
        E2 = exp(h / 2 * W1)
        if method == "momentum_conserving":
            W1 = apply(inverse, transposed(E2, A))
        set_rotation(q, Rh @ E2)
    q[..., 9:] = qh[..., 9:] + h / 2 * v1
    u[..., :3], u[..., 3:] = W1, v1
    return first(going | ~np.isfinite(u).all(axis=-1))


def _implicit_velocity(J: Array, A: Array, W: Array, h: float, tolerance: float) -> tuple[Array, Mask]:
    """Return W with J W = exp(-h/2 W) A by Newton's method from W, and where it was not found."""
    size = np.abs(A).max(axis=-1)
    going = np.ones(size.shape, dtype=bool)
    for _ in range(NEWTON_MAX):
        psi, JW = h / 2 * W, apply(J, W)
        r = transposed(exp(psi), A) - JW
        going = going & ~(length(r) <= tolerance * size)
        if not going.any():
            break
        d = solve(J - h / 2 * hat(JW) @ right_jacobian(psi), r)
        W = np.where(going[..., None], W + d, W)
        going = going & ~(length(d) <= ROUND_OFF * length(W))
    return W, going


KERNEL = StepKernel("rigid", METHODS, "implicit", TOLERANCE, _finish, _step)

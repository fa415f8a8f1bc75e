"""Integrators of pseudo-rigid bodies, one or many through leading axes.

Arrays are advanced in place, compiled where the kernel was built and arrays are C-contiguous float64; what is
written here in NumPy is the reference.

q (..., 12): deformation gradient F row by row, then the mass center x in m; u (..., 12): their rates.
A load is f_i A_j of a force f at A row by row, and the force.

Sources: Zhang & Skeel, Appl. Numer. Math. 25 (1997) 297-302 (linearly implicit); Simo & Tarnow, ZAMP 43
(1992) 757-792 (energy-momentum); Magisano, Leonetti & Garcea, Comput. Methods Appl. Mech. Eng. 313 (2017)
986-1005 (its Newton method).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.analysis.integrators.base import BodyIntegrator
from kratos_lite.analysis.integrators.finite_element import warn_of_stiffness
from kratos_lite.analysis.integrators.kernels import StepKernel
from kratos_lite.bodies.constraint_projection import Step, constrained_step
from kratos_lite.bodies.linear_algebra import apply, first, length, solve, transposed
from kratos_lite.bodies.pseudo_rigid import PseudoRigidBody, by_rows, green_strain, strain_operator
from kratos_lite.typing import Array, Mask
from kratos_lite.voigt import tensor

METHODS = ("explicit", "linearly_implicit", "energy_momentum")
TOLERANCE = 1e-12  # last change of the rate of F beside that rate in the energy-momentum method
NEWTON_MAX = 50


class _PseudoRigid(BodyIntegrator[PseudoRigidBody]):
    bodies = PseudoRigidBody

    def stiffness_share(self, body: PseudoRigidBody, h: float) -> float:
        """Return the c of M + c K with which velocities answer to forces."""
        return body.damping * h / 2 + h * h / 4

    def free_steps(self, body: PseudoRigidBody, h: float, count: int) -> bool:
        """Take steps in the kernel."""
        KERNEL.advance(body, *body.constant_loads()[:2], h=h, count=count)
        return True

    def step(self, body: PseudoRigidBody, h: float, v: Array) -> Array:
        """Take a step; see `BodyIntegrator.step`."""
        qh = body.q + h / 2 * body.u
        load = body.external_force(qh, body.time + h / 2, v)

        def advance(extra: Array) -> Step:
            q, u = body.q.copy(), body.u.copy()
            arrays = q, u, load + extra, *body.step_constants()
            KERNEL.finish(*arrays, h=h, method=self.name, tolerance=body.tolerance)
            return Step(q, u, load)

        return constrained_step(body, h, qh, advance, lambda: body.solver(qh, self.stiffness_share(body, h)))


class PseudoRigidExplicit(_PseudoRigid):
    """Explicit (Solfec's DEF_EXP): momenta exact, energy bounded, steps up to the critical one."""

    name = "explicit"

    def critical_step(self, body: PseudoRigidBody) -> float:
        """Return `Deformable.critical_step`."""
        return body.critical_step()

    def stiffness_share(self, body: PseudoRigidBody, h: float) -> float:
        """Return 0."""
        return 0.0


class PseudoRigidLinearlyImplicit(_PseudoRigid):
    """Linearly implicit (Solfec's DEF_LIM); see `finite_element.LinearlyImplicit`."""

    name = "linearly_implicit"

    def check(self, body: PseudoRigidBody, h: float) -> None:
        """Warn of stiff bodies."""
        warn_of_stiffness(body, h)


class PseudoRigidEnergyMomentum(_PseudoRigid):
    """Implicit: energy and both momenta exact whatever the step."""

    name = "energy_momentum"


def _step(q: Array, u: Array, *arguments: Any) -> tuple[Array, int]:
    """Take a step under constant loads; return the load, and the first body that failed or -1."""
    euler, mass, *elastic, acceleration, spatial, h, method, tolerance = arguments
    load = np.broadcast_to(spatial, u.shape).copy()
    load[..., 9:] += mass[..., None] * acceleration
    return load, _finish(q, u, load, euler, mass, *elastic, h, method, tolerance)


def _finish(q: Array, u: Array, load: Array, *arguments: Any) -> int:
    """Take a step in place, with the load at mid-step; return the first body that failed, or -1."""
    euler, mass, volume, C, damping, h, method, tolerance = arguments
    F, U, f = q[..., :9], u[..., :9], load[..., :9]
    V, eta = volume[..., None, None], damping[..., None, None]
    going = np.zeros(q.shape[:-1], dtype=bool)
    change = np.empty(u.shape)
    with np.errstate(all="ignore"):
        if method == "energy_momentum":
            change[..., :9], going = _energy_momentum(F, U, f, euler, V, C, eta, h, tolerance)
        else:
            change[..., :9] = _linear_step(F, U, f, euler, V, C, eta, h, method == "linearly_implicit")
        change[..., 9:] = h * load[..., 9:] / mass[..., None]
        q += h * (u + change / 2)
        u += change
    return first(going | ~np.isfinite(u).all(axis=-1))


def _linear_step(
    F: Array, U: Array, f: Array, euler: Array, V: Array, C: Array, eta: Array, h: float, implicit: bool
) -> Array:
    """Return the change (..., 9) of the rate of F by the forces at mid-step, if `implicit` linearized."""
    B = strain_operator(F + h / 2 * U)
    S = apply(C, green_strain(F + h / 2 * U))
    K = V * (by_rows(tensor(S)) + np.swapaxes(B, -1, -2) @ C @ B)
    A = by_rows(euler)
    if implicit:
        A = A + (eta * (h / 2) + h * h / 4) * K
    return solve(A, h * (f - V[..., 0] * transposed(B, S) - eta[..., 0] * apply(K, U)))


def _energy_momentum(
    F: Array, U: Array, f: Array, euler: Array, V: Array, C: Array, eta: Array, h: float, tolerance: float
) -> tuple[Array, Mask]:
    """Return the change (..., 9) of F's rate that conserves energy and momentum; where none was found."""
    # The strain of the end is that of the start and an increment, so that stiff bodies do not lose digits.
    # Newton's method has the stress S as a second unknown, eliminated: its matrix takes S as linearized in
    # the former iteration.
    E, M = green_strain(F), by_rows(euler)
    S, share = apply(C, E), 0.5 + eta / h
    change = np.zeros(U.shape)
    going = np.ones(U.shape[:-1], dtype=bool)
    for _ in range(NEWTON_MAX):
        dF = h * (U + change / 2)
        middle, end = strain_operator(F + dF / 2), strain_operator(F + dF)
        A = M + h * h / 2 * V * (by_rows(tensor(S)) / 2 + np.swapaxes(middle, -1, -2) @ C @ (share * end))
        e = E + share[..., 0] * apply(middle, dF)
        d = solve(A, h * (f - V[..., 0] * transposed(middle, apply(C, e))) - apply(M, change))
        S = apply(C, e + h / 2 * share[..., 0] * apply(end, d))
        change = np.where(going[..., None], change + d, change)
        going = going & ~(length(d) <= tolerance * np.hypot(length(U), length(U + change)))
        if not going.any():
            break
    return change, going


KERNEL = StepKernel("pseudo", METHODS, "energy_momentum", TOLERANCE, _finish, _step)

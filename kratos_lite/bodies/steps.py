"""One step, or many, of rigid and pseudo-rigid bodies.

All functions take one body or many through leading axes, advance q and u in place, and run compiled
(`native/motion.cpp`) where the kernel was built and the arrays are C-contiguous float64; then results do
not depend on the number of threads.  What is written here in NumPy is the reference.

Rigid:        q (..., 12) = rotation R column-wise, center x;  u (..., 6) = referential angular velocity W, v.
Pseudo-rigid: q (..., 12) = deformation gradient F row-wise, center x;  u (..., 12) = their rates.

A load is conjugate to u: referential torque and force, or f_i A_j of a force f at A row-wise and the force.
What a body is made of (inertia, mass, …) and constant loads are given for each body, or once for all.
Units are SI.

The formulas and their sources are in `rigid_step` and `pseudo_step`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.bodies import pseudo_step, rigid_step
from kratos_lite.bodies.linear_algebra import apply, transposed
from kratos_lite.bodies.rotations import exp, rotation_of, set_rotation
from kratos_lite.errors import SolveError
from kratos_lite.native import kernels
from kratos_lite.typing import Array

RIGID_SCHEMES = ("RIG_POS", "RIG_NEG", "RIG_IMP")
PSEUDO_SCHEMES = ("DEF_EXP", "DEF_LIM", "ENERGY_MOMENTUM")
RIGID_TOLERANCE = 1e-14
"""Residual of RIG_IMP beside the momentum."""
PSEUDO_TOLERANCE = 1e-12
"""Last change of the rate of F beside that rate in ENERGY_MOMENTUM."""


def rigid_half(q: Array, u: Array, h: float) -> Array:
    """Return q (..., 12) at mid-step: Rh = R exp(h/2 W), xh = x + h/2 v.

    >>> q = np.array([1.0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0])
    >>> rigid_half(q, np.array([0.0, 0, 0, 2, 0, 0]), 0.5)[9:]
    array([0.5, 0. , 0. ])
    """
    out = np.empty(q.shape)
    if _compiled("rigid_half", q, u, h, out) is NotImplemented:
        R, x = rotation_of(q) @ exp(h / 2 * u[..., :3]), q[..., 9:] + h / 2 * u[..., 3:]
        set_rotation(out, R)
        out[..., 9:] = x
    return out


def rigid_finish(
    q: Array,
    u: Array,
    qh: Array,
    load: Array,
    inertia: Array,
    inverse: Array,
    mass: float | Array,
    h: float,
    scheme: str = "RIG_NEG",
    tolerance: float = RIGID_TOLERANCE,
) -> None:
    """Complete a step h from q (..., 12), u (..., 6) in place, with the load (..., 6) at qh (..., 12).

    `inertia` (..., 3, 3) is referential, with its `inverse`; `mass` is (...).

    Raises
    ------
    SolveError
        RIG_IMP found no velocity, or a velocity grew without bound.  q and u are then of no use.
    """
    number = RIGID_SCHEMES.index(scheme)
    constant = (inertia, inverse, np.asarray(mass))
    failed = _compiled("rigid_finish", q, u, qh, load, *constant, h, number, tolerance)
    if failed is NotImplemented:
        failed = rigid_step.rigid_finish(q, u, qh, load, *constant, h, scheme, tolerance)
    if failed >= 0:
        raise _failure(scheme, q, failed, h)


def rigid_steps(
    q: Array,
    u: Array,
    inertia: Array,
    inverse: Array,
    mass: float | Array,
    acceleration: Array,
    spatial: Array,
    convected: Array,
    h: float,
    steps: int,
    scheme: str = "RIG_NEG",
    tolerance: float = RIGID_TOLERANCE,
    work: Array | None = None,
) -> None:
    """Take steps h of bodies q (..., 12), u (..., 6) in place, under loads that stay constant.

    `acceleration` (..., 3) is that of gravity; `spatial` (..., 6) a spatial torque and force; `convected`
    (..., 6) a referential torque and a force that turns with the body.  `work` (...) grows by their work.

    Raises
    ------
    SolveError
        As `rigid_finish`.
    """
    number = RIGID_SCHEMES.index(scheme)
    constant = (inertia, inverse, np.asarray(mass), acceleration, spatial, convected)
    failed = _compiled("rigid_steps", q, u, *constant, h, steps, number, tolerance, work)
    if failed is not NotImplemented:
        if failed[0] >= 0:
            raise _failure(scheme, q, failed[0], h, failed[1])
        return
    gravity = np.asarray(mass)[..., None] * acceleration
    for step in range(steps):
        qh, before = rigid_half(q, u, h), u.copy()
        R, load = rotation_of(qh), np.empty(u.shape)
        load[..., :3] = transposed(R, spatial[..., :3]) + convected[..., :3]
        load[..., 3:] = gravity + spatial[..., 3:] + apply(R, convected[..., 3:])
        body = rigid_step.rigid_finish(q, u, qh, load, *constant[:3], h, scheme, tolerance)
        if body >= 0:
            raise _failure(scheme, q, body, h, step)
        if work is not None:
            work += h / 2 * ((before + u) * load).sum(axis=-1)


def pseudo_finish(
    q: Array,
    u: Array,
    load: Array,
    euler: Array,
    mass: float | Array,
    volume: float | Array,
    C: Array,
    damping: float | Array,
    h: float,
    scheme: str = "DEF_EXP",
    tolerance: float = PSEUDO_TOLERANCE,
) -> None:
    """Take a step h of bodies q (..., 12), u (..., 12) in place, with the load (..., 12) at mid-step.

    `euler` (..., 3, 3) is the Euler tensor E0 of the kinetic energy 1/2 tr(F' E0 F'^T); C (..., 6, 6) is
    S = C E of the St. Venant-Kirchhoff material; `mass`, `volume` and `damping` (in seconds, times the
    stiffness) are (...).

    Raises
    ------
    SolveError
        ENERGY_MOMENTUM found no velocity, or a velocity grew without bound.  q and u are then of no use.
    """
    number = PSEUDO_SCHEMES.index(scheme)
    constant = (euler, np.asarray(mass), np.asarray(volume), C, np.asarray(damping))
    failed = _compiled("pseudo_finish", q, u, load, *constant, h, number, tolerance)
    if failed is NotImplemented:
        failed = pseudo_step.pseudo_finish(q, u, load, *constant, h, scheme, tolerance)
    if failed >= 0:
        raise _failure(scheme, q, failed, h)


def pseudo_steps(
    q: Array,
    u: Array,
    euler: Array,
    mass: float | Array,
    volume: float | Array,
    C: Array,
    damping: float | Array,
    acceleration: Array,
    spatial: Array,
    h: float,
    steps: int,
    scheme: str = "DEF_EXP",
    tolerance: float = PSEUDO_TOLERANCE,
    work: Array | None = None,
) -> None:
    """Take steps h of bodies q (..., 12), u (..., 12) in place, under loads that stay constant.

    `acceleration` (..., 3) is that of gravity, `spatial` (..., 12) a load.  `work` (...) grows by their work.

    Raises
    ------
    SolveError
        As `pseudo_finish`.
    """
    number = PSEUDO_SCHEMES.index(scheme)
    constant = (euler, np.asarray(mass), np.asarray(volume), C, np.asarray(damping))
    failed = _compiled(
        "pseudo_steps", q, u, *constant, acceleration, spatial, h, steps, number, tolerance, work
    )
    if failed is not NotImplemented:
        if failed[0] >= 0:
            raise _failure(scheme, q, failed[0], h, failed[1])
        return
    load = np.broadcast_to(spatial, u.shape).copy()
    load[..., 9:] += np.asarray(mass)[..., None] * acceleration
    for step in range(steps):
        before = u.copy()
        body = pseudo_step.pseudo_finish(q, u, load, *constant, h, scheme, tolerance)
        if body >= 0:
            raise _failure(scheme, q, body, h, step)
        if work is not None:
            work += h / 2 * ((before + u) * load).sum(axis=-1)


def _compiled(name: str, *arguments: Any) -> Any:
    """Return what a compiled function returns, NotImplemented without it or where arrays do not fit."""
    motion = kernels("motion")
    if motion is None:
        return NotImplemented
    try:
        return getattr(motion, name)(*arguments)
    except TypeError:
        return NotImplemented


def _failure(scheme: str, q: Array, body: int, h: float, step: int | None = None) -> SolveError:
    """Return the error of a body, counted through all leading axes, whose step failed."""
    place = tuple(int(i) for i in np.unravel_index(body, q.shape[:-1]))
    whose = f" of body {place[0] if len(place) == 1 else place}" if place else ""
    when = "" if step is None else f" number {step + 1}"
    newton = scheme in ("RIG_IMP", "ENERGY_MOMENTUM")
    why = "Newton's method found no velocity at its end" if newton else "its velocity grew beyond all numbers"
    return SolveError(f"{scheme}: step{when}{whose}, h = {h:g} s, failed: {why}; use a shorter step")

"""Steps: one step of each scheme, from displacement, velocity and acceleration to those at its end."""

from __future__ import annotations

from dataclasses import replace

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.prescribed_motion import Course, at_end, beyond_newmark, prescribed_part
from kratos_lite.analysis.schemes import CentralDifference, Implicit


def is_trapezoidal(scheme: Implicit | CentralDifference) -> bool:
    """Return whether a scheme is the trapezoidal rule."""
    return isinstance(scheme, Implicit) and replace(scheme, name="") == Implicit("", 0.25, 0.5)


def implicit_step(e: EquationsOfMotion, s: Implicit, now: Course, start: float, h: float) -> Course:
    """Take a step of the generalized-α method, for the increment of the displacement."""
    (u, v, a), end, f = now, start + h, 1 - s.alpha_f
    a_old = v / (s.beta * h) + (1 / (2 * s.beta) - 1) * a  # minus a⁺ for Δu = 0
    v_new = (1 - s.gamma / s.beta) * v + h * (1 - s.gamma / (2 * s.beta)) * a
    held, more_a = prescribed_part(e, u), 0.0 * a
    if e.model.supports.motions:
        given = held, prescribed_part(e, v), prescribed_part(e, a)
        more_v, more_a = beyond_newmark(s, h, given, at_end(e, end, h))
        v_new, a_old = v_new + more_v, a_old - more_a
    middle = start + f * h
    force = e.load(middle) - e.times_stiffness(u, middle)
    force -= e.times_damping(f * v_new + s.alpha_f * v, middle)
    if is_trapezoidal(s):  # M a is known from the balance at the start, so no rounding is handed on
        force += e.times_mass(4 / h * v - more_a) + e.load(start)
        force -= e.times_stiffness(u, start) + e.times_damping(v, start)
    else:
        force += e.times_mass((1 - s.alpha_m) * a_old - s.alpha_m * a)
    solve = e.solver(middle, (1 - s.alpha_m) / (s.beta * h * h), f * s.gamma / (s.beta * h), f)
    du = solve(force, e.prescribed(end) - held)
    return u + du, s.gamma / (s.beta * h) * du + v_new, du / (s.beta * h * h) - a_old


def explicit_step(e: EquationsOfMotion, now: Course, start: float, h: float) -> Course:
    """Take a step of central differences; damping sees the velocity half a step before the end."""
    (u, v, a), held = now, e.held
    half = v + h / 2 * a
    u = u + h * half
    given = at_end(e, start + h, h)
    u[held] = given[0][held]
    force = e.load(start + h) - e.times_damping(half, start) - e.times_stiffness(u, start)
    a = e.mass.solve(force)
    a[held] = given[2][held]
    v = half + h / 2 * a
    v[held] = given[1][held]
    return u, v, a

"""Bodies in motion: seconds per step, beside the figures of Solfec-1.0.

Solfec-1.0 (C, gcc 12 -O3, serial) was timed apart on a machine like that of the results kept; it needs
Python 2.7 and a build of its own, so it does not take turns with us.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

MANY = 10_000


class Motion(NamedTuple):
    """A body, or many, and how it moves.

    Attributes
    ----------
    what : in words.
    make : what makes the body from the library, and its further arguments.
    dt, steps, every : as `integrate` takes them.
    bodies : number of bodies alike, by which the time is divided.
    """

    what: str
    make: tuple[Any, ...]
    dt: float
    steps: int
    every: int = 1
    bodies: int = 1


def top(kl: Any) -> Any:
    """Return the free asymmetric top."""
    body = kl.RigidBody(mass_properties=kl.MassProperties(mass=1.0, inertia=np.diag([5.0, 10.0, 1.0])))
    body.u[:3] = 8.0, 0.02, 0.0
    return body


def heavy_top(kl: Any, integrator: str) -> Any:
    """Return the heavy top, its torque a Python function."""
    top = kl.MassProperties(mass=1.0, inertia=np.diag([5.0, 5.0, 1.0]))
    body = kl.RigidBody(mass_properties=top, integrator=integrator)
    body.u[:3] = 0.0, 0.0, 50.0
    body.rotate([[1, 0, 0], [0, np.cos(0.05), -np.sin(0.05)], [0, np.sin(0.05), np.cos(0.05)]])

    def torque(q: Any, u: Any, t: float) -> Any:
        return np.array([0, 0, 0, -20 * q[7], 20 * q[6], 0, 0, 0, 0.0])

    body.add(kl.Callback(torque, of_velocity=False))
    return body


def soft_box(kl: Any, integrator: str) -> Any:
    """Return the spinning pseudo-rigid box."""
    box = kl.MassProperties.box((0.4, 0.6, 1.0), 1000.0)
    soft = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
    body = kl.PseudoRigidBody(mass_properties=box, material=soft, integrator=integrator)
    body.set_velocity(angular=(0.05, 10.0, 0.05))
    return body


def bar(kl: Any, integrator: str, formulation: str = "total_lagrangian", lumped: bool = True) -> Any:
    """Return the rotating bar of 2 x 2 x 20 hexahedra, 567 degrees of freedom."""
    rubber = kl.Isotropic3D(E=2e6, nu=0.26, density=7800.0)
    mesh = kl.box((0.1, 0.1, 1.0), (2, 2, 20), "KinematicLinear3D8N")
    options = {"formulation": formulation, "integrator": integrator, "lumped": lumped}
    body = kl.FiniteElementBody(mesh, rubber, **options)
    body.set_velocity(angular=(1.0, 0.0, 0.0))
    return body


LONG = 200_000
PYTHON, CHUNK = "torque by a Python function", "a state every 1000 steps"
MOTIONS = {
    "rigid": Motion("rigid body, free, a state every step", (top,), 1e-3, 5000),
    "rigid_chunk": Motion(f"the same, {CHUNK}", (top,), 1e-3, LONG, 1000),
    "rigid_callback": Motion(f"rigid heavy top, RIG_NEG, {PYTHON}", (heavy_top, "RIG_NEG"), 1e-3, 5000),
    "rigid_implicit": Motion(f"rigid heavy top, RIG_IMP, {PYTHON}", (heavy_top, "RIG_IMP"), 1e-3, 5000),
    "pseudo_lim": Motion("pseudo-rigid box, DEF_LIM, a state every step", (soft_box, "DEF_LIM"), 1e-3, 5000),
    "pseudo_lim_chunk": Motion(f"the same, {CHUNK}", (soft_box, "DEF_LIM"), 1e-3, LONG, 1000),
    "pseudo_exp_chunk": Motion(
        f"pseudo-rigid box, DEF_EXP, {CHUNK}", (soft_box, "DEF_EXP"), 1e-3, LONG, 1000
    ),
    "pseudo_em_chunk": Motion(
        f"pseudo-rigid box, ENERGY_MOMENTUM, {CHUNK}", (soft_box, "ENERGY_MOMENTUM"), 1e-3, LONG // 2, 1000
    ),
    "bar_tl": Motion("bar of 567 dofs, TL, DEF_LIM", (bar, "DEF_LIM"), 1 / 256, 256),
    "bar_bc": Motion("bar of 567 dofs, BC, DEF_LIM", (bar, "DEF_LIM", "corotational"), 1 / 256, 512),
    "bar_exp": Motion("bar of 567 dofs, TL, DEF_EXP", (bar, "DEF_EXP"), 1e-3, 512),
    "bar_em": Motion("bar of 567 dofs, TL, ENERGY_MOMENTUM", (bar, "ENERGY_MOMENTUM"), 1 / 256, 256),
    "bar_consistent": Motion(
        "bar of 567 dofs, TL, DEF_LIM, consistent mass",
        (bar, "DEF_LIM", "total_lagrangian", False),
        1 / 256,
        256,
    ),
    "many_rigid": Motion("10,000 rigid bodies, RIG_NEG, a state every step", (top,), 1e-3, 100, 1, MANY),
    "many_rigid_chunk": Motion("10,000 rigid bodies, a state every 100 steps", (top,), 1e-3, 500, 100, MANY),
    "many_pseudo": Motion(
        "10,000 pseudo-rigid boxes, DEF_LIM, a state every 100 steps",
        (soft_box, "DEF_LIM"),
        1e-3,
        200,
        100,
        MANY,
    ),
}
"""Every motion that is timed, by its name."""
SOLFEC = {
    **dict.fromkeys(("rigid", "rigid_chunk", "rigid_callback"), (7e-6, 9e-6)),
    "rigid_implicit": (12e-6, 12e-6),
    **dict.fromkeys(("pseudo_lim", "pseudo_lim_chunk"), (4.8e-6, 4.8e-6)),
    "pseudo_exp_chunk": (57e-6, 57e-6),
    "bar_tl": (2.0e-3, 2.2e-3),
    "bar_bc": (0.31e-3, 0.45e-3),
    "bar_exp": (0.99e-3, 0.99e-3),
}
"""Seconds per step of Solfec-1.0, from and to."""
SLOW = 50
"""Of the steps, those that NumPy alone is given."""


def measured(kl: Any, name: str, divisor: int = 1) -> dict[str, float]:
    """Integrate a motion; return seconds per step and body, and the relative drift of energy and momentum."""
    motion = MOTIONS[name]
    make, *words = motion.make
    bodies = [make(kl, *words) for _ in range(motion.bodies)]
    one, body = bodies[0], bodies if motion.bodies > 1 else bodies[0]
    steps = max(motion.every if divisor == 1 else 2, motion.steps // divisor)
    for _ in kl.integrate(body, motion.dt, 2):  # whatever is made once is made here
        pass
    energy, momentum = own_energy(one), one.angular_momentum()
    start = perf_counter()
    for _ in kl.integrate(body, motion.dt, steps, every=min(motion.every, steps)):
        pass
    seconds = (perf_counter() - start) / steps / motion.bodies
    turned = np.linalg.norm(one.angular_momentum() - momentum) / np.linalg.norm(momentum)
    return {
        "step": seconds,
        "energy": abs(own_energy(one) / energy - 1),
        "momentum": float(turned) if not one.loads else float("nan"),
    }


def own_energy(body: Any) -> float:
    """Return kinetic and strain energy without what loads have put in."""
    return float(body.kinetic_energy() + body.internal_energy() - body.external_work)

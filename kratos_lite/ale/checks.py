"""Guards: what a motion of the material asks of a model, and how near it is to its critical rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.ale.boundaries import end_nodes, periodic_pairs
from kratos_lite.ale.matrices import MotionMatrices
from kratos_lite.ale.motion import Motion, Rotation, Translation
from kratos_lite.ale.symmetry import leak
from kratos_lite.elements.tables import lame_constants
from kratos_lite.errors import ModelError
from kratos_lite.solvers.supports import MultiPointConstraint
from kratos_lite.voigt import acoustic_tensor

if TYPE_CHECKING:
    from kratos_lite.analysis.model import Model


NEAR_CRITICAL = 0.9
"""Share of the critical rate from which a warning is given."""
FREE_ENDS = 0.7
"""Share of the speed of Rayleigh's waves at which windows with free or absorbing ends become critical."""
LEAK = 1e-2
"""Share of the velocity that may pass through the boundary before a warning is given."""
FAR_OFF = 0.2
"""Share from which a body is not one of revolution, or not straight, at all."""


def attach(motion: Motion, model: Model) -> None:
    """Check a model against a motion and add the constraints of its ends.

    Raises
    ------
    ModelError
        The body is not one of revolution about the axis, or the ends cannot be joined.
    """
    if isinstance(motion, Translation):
        _join(motion, model)
    share = leak(motion, model.mesh)
    if share > FAR_OFF:
        what = "one of revolution about" if isinstance(motion, Rotation) else "straight along"
        cure = "give the axis of the body and a point of it, center=…"
        if isinstance(motion, Translation):
            cure = "give the direction of the body, and cut its ends across it"
        raise ModelError(
            f"the body is not {what} the axis {motion.direction.tolist()}: {share:.0%} of the velocity "
            f"passes through its boundary; {cure}"
        )


def _join(motion: Translation, model: Model) -> None:
    """Give a model the constraints of the ends of its window."""
    if motion.ends == "periodic":
        slaves, masters = periodic_pairs(model.mesh, motion)
        model.supports.link(
            [
                MultiPointConstraint(3 * int(a) + axis, (3 * int(b) + axis,), (1.0,), mutual=True)
                for a, b in zip(slaves, masters, strict=True)
                for axis in range(3)
            ]
        )
    elif motion.ends == "fixed":
        for nodes in end_nodes(model.mesh, motion):
            model.supports.fix(nodes, "xyz", 0.0, False)


def wave_speeds(terms: MotionMatrices) -> tuple[float, float, float]:
    """Return the lowest speeds c_p, c_s and c_R (Rayleigh) of the materials in m/s.

    They are those along a window, and otherwise the lowest along x, y and z.
    """
    p, s = np.inf, np.inf
    for group in terms.groups:
        along = [terms.motion.direction] if isinstance(terms.motion, Translation) else np.eye(3)
        squares = np.array([np.linalg.eigvalsh(acoustic_tensor(group.material.C, n)) for n in along])
        speeds = np.sqrt(squares / group.material.density)
        p, s = min(p, float(speeds[:, 2].min())), min(s, float(speeds[:, 0].min()))
    return p, s, rayleigh_speed(p, s)


def rayleigh_speed(p: float, s: float) -> float:
    """Return the speed of Rayleigh's surface wave for those of pressure and shear waves, in m/s.

    It is the root of (2 - x)² = 4 sqrt(1 - x) sqrt(1 - x s²/p²) with x = (c_R / c_s)².

    >>> round(rayleigh_speed(192.610300980, 102.954536490), 6)
    95.481346
    """
    low, high, k = 1e-6, 1.0 - 1e-12, (s / p) ** 2
    for _ in range(200):
        x = (low + high) / 2
        f = (2 - x) ** 2 - 4 * np.sqrt(1 - x) * np.sqrt(1 - k * x)
        low, high = (x, high) if f < 0 else (low, x)
    return float(s * np.sqrt((low + high) / 2))


def critical_rate_estimate(terms: MotionMatrices) -> float:
    """Return the rate at which material is as fast as the waves of free surfaces, in rad/s or m/s.

    It is for thick bodies: bending of thin ones is slower.  Free ends of a window take less, too.
    """
    motion, speed = terms.motion, wave_speeds(terms)[2]
    if isinstance(motion, Translation):
        return speed * (FREE_ENDS if motion.ends in ("absorbing", "natural") else 1.0)
    return speed / float(np.linalg.norm(motion.field(terms.points), axis=1).max())


def near_critical(motion: Motion, time: float, limit: float, of_mesh: bool) -> list[str]:
    """Return a warning if the rate at a time is near a critical one, that of the mesh or that of waves."""
    rate, unit = abs(motion.rate(time)), unit_of(motion)
    if rate < NEAR_CRITICAL * limit:
        return []
    where = "above" if rate >= limit else "near"
    whose = f"{limit:.4g} {unit} on this mesh" if of_mesh else f"about {limit:.4g} {unit} by wave speeds"
    return [
        f"the rate {rate:g} {unit} is {where} the critical one, {whose}: a steady state resonates there, and "
        "motion may grow without bound"
    ]


def unit_of(motion: Motion) -> str:
    """Return the unit of the rate of a motion."""
    return "m/s" if isinstance(motion, Translation) else "rad/s"


def warnings_of(terms: MotionMatrices | None, model: Model) -> list[str]:
    """Return what is doubtful about a motion but its rate, with figures."""
    if terms is None:
        return []
    motion, said = terms.motion, []
    share = leak(motion, model.mesh)
    if share > LEAK:
        where = "through the polygonal rim; take more cells around the axis, or quadratic ones"
        if isinstance(motion, Translation):
            where = "through the sides of the window; its sections must be alike"
        said.append(f"{share:.1%} of the velocity passes {where}")
    if isinstance(motion, Rotation):
        if any(lame_constants(group.material.C) is None for group in terms.groups):
            said.append("an anisotropic material is not axisymmetric unless its axes turn with the angle")
        if not motion.stiffening and not _rotation_held(motion, model):
            said.append(
                "nothing holds the rotation about the axis: the linear theory makes a free rotor unstable at "
                "any rate; hold the hub or take stiffening=True"
            )
    return said


def _rotation_held(motion: Rotation, model: Model) -> bool:
    """Return whether a support works against the rotation about the axis."""
    c = motion.field(model.mesh.points)
    return bool(np.abs(c[model.supports.fixed]).max(initial=0.0) > 1e-9 * np.abs(c).max())

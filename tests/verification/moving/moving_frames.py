"""Frames that move along a bar (ALE): a moving load, waves in a frame, a frame that speeds up."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.ale import Translation
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.modal import reduced
from kratos_lite.analysis.stepping import integrate
from kratos_lite.typing import Array
from kratos_lite.verification.meshes import is_quadratic, on_plane
from kratos_lite.verification.problem import Problem
from kratos_lite.verification.scenes import SOIL
from tests.verification.moving.moving_material import BRICKS, WAVE, bar, problem

LENGTH, FORCE, BED = 40.0, 1e5, 2e6
"""m, N and N/m⁴, of the bar on an elastic bed under a moving load."""


def moving_load(share: float) -> Callable[[str], float]:
    """Return a function: u under a load that moves at a share of c_p along a bar on an elastic bed / exact.

    D u'' = k u with D = M - ρ v², a jump of -F in D u' under the load, and u = 0 at both ends.
    """
    D = SOIL.C[0, 0] * (1 - share**2)
    root = np.sqrt(BED / D)
    exact = FORCE * np.tanh(root * LENGTH / 2) / (2 * D * root)

    def of(kind: str) -> float:
        model = bar(kind, 40, LENGTH, tied=True)
        for end in (-LENGTH / 2, LENGTH / 2):
            model.fix(np.flatnonzero(on_plane(model.mesh, 0, end))[:1], "x")
        model.add(Translation("x", rate=share * WAVE, boundaries="natural"))
        middle = np.flatnonzero(np.abs(model.mesh.points[:, 0]) < 1e-9)
        e = EquationsOfMotion(model)
        K = reduced(e, e.matrix(0.0, BED / SOIL.density, 0.0, 1.0)).toarray()
        force = np.zeros(e.size)
        force[3 * middle] = FORCE / len(middle)
        constraints = e.system.constraint_map
        u = constraints.expand(np.linalg.solve(K, constraints.reduce(force)))
        return float(u[3 * middle[0]] / exact)

    return of


def wave_in_frame(sign: int) -> Callable[[str], float]:
    """Return a function: the frequency of the longest wave in a periodic frame / k (c_p ± speed)."""
    length, share = 6.0, 0.5

    def of(kind: str) -> float:
        model = bar(kind, 12, length)
        x = np.round(model.mesh.points[:, 0], 9)
        for section in np.unique(x)[:-1]:  # the last one is tied to the first by the frame
            first, *others = np.flatnonzero(x == section).tolist()
            for node in others:
                model.constrain((node, "x"), {(first, "x"): 1.0})
        model.add(Translation("x", rate=share * WAVE, boundaries="periodic"))
        found = np.abs(model.complex_modes(8)[0].imag)
        exact = 2 * np.pi / length * WAVE * (1 + sign * share)
        return float(found[np.argmin(np.abs(found - exact))] / exact)

    return of


def speeding_up(kind: str) -> float:
    """Return the largest error of the two halves of a pulse in a frame that speeds up / height."""
    start, growth, width, end = 0.2 * WAVE, 1000.0, 0.8, 0.02
    model = bar(kind, 40, 12.0)
    x = model.mesh.points[:, 0]

    def pulse(x: Array) -> Array:
        return np.asarray(np.exp(-(x**2) / (2 * width**2)))

    model.add(Translation("x", rate=start, acceleration=growth, boundaries="absorbing"))
    u, v = np.zeros_like(model.mesh.points), np.zeros_like(model.mesh.points)
    u[:, 0], v[:, 0] = pulse(x), -start * x / width**2 * pulse(x)
    *_, state = integrate(model.transient(displacement=u, velocity=v), end / 50, 50, every=50)
    z = start * end + growth * end**2 / 2
    exact = (pulse(x + z - WAVE * end) + pulse(x + z + WAVE * end)) / 2
    return float(np.abs(state.u[:, 0] - exact).max())


PROBLEMS: list[Problem] = [
    *(
        problem(f"moving_load_{share}", f"u under a load that moves at {share} c_p along a bar on an elastic "
                    "bed, 40 bricks / exact", "Newton: (M - ρ v²) u'' = k u", moving_load(share),
                    tolerance=1e-5, exact=is_quadratic)
        for share in (0.6, 0.9)
    ),
    *(
        problem(f"wave_{word}", f"frequency of the longest wave that runs {word} in a periodic frame at 0.5 "
                    "c_p, 12 bricks / k (c_p ± speed)", "Dalembert", wave_in_frame(sign), tolerance=1e-3,
                    exact=is_quadratic)
        for word, sign in (("along", -1), ("against", 1))
    ),
    problem("speeding_up", "largest error of two pulses in a frame that speeds up by 1000 m/s² / height",
                "Dalembert", speeding_up, BRICKS, 0.0, 2e-2, is_quadratic),
]  # fmt: skip
"""The rows of this family."""

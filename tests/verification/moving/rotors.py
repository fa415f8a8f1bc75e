"""Rotors in their own plane (ALE), against the same rotors in axes that turn with the material."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from kratos_lite.ale import Rotation
from kratos_lite.analysis.modal import critical_rate
from kratos_lite.analysis.stepping import integrate
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.typing import Array
from kratos_lite.verification.meshes import face_forces, is_quadratic
from kratos_lite.verification.problem import Problem
from kratos_lite.verification.scenes import SOIL
from tests.verification.moving.moving_material import BRICKS, RATE, problem, rotor
from tests.verification.moving.rotating_axes import INNER, OUTER, Waves, ramp, waves

CELLS = 3, 24
"""Bricks along the radius and around."""
PRESSURE, FAST, DAMPING = 1e5, 60.0, 20.0
"""Pa, rad/s and 1/s, of the load that rests in space."""
SPIN, END, STEPS = 1000.0, 0.05, 60
"""rad/s² and s, of a rotor that starts at rest, and the steps for it."""
WAVES: Callable[[int], Waves] = lru_cache(maxsize=4)(waves)


# ---- waves -----------------------------------------------------------------------------------------------


@lru_cache(maxsize=16)
def _frequencies(kind: str) -> Array:
    """Return the lowest frequencies of the rotor; several rows share them."""
    values, _ = rotor(kind, True, *CELLS).complex_modes(12)
    return np.asarray(values.imag)


def shifted_in_plane(n: int, number: int) -> Callable[[str], float]:
    """Return a function: the frequency nearest to one of n waves / that; `number` counts from 0 rad/s."""

    def of(kind: str) -> float:
        known, found = WAVES(n).frequencies(RATE), _frequencies(kind)
        exact = known[np.argsort(np.abs(known))[number]]
        return float(found[np.argmin(np.abs(found - exact))] / exact)

    return of


def torsion() -> float:
    """Return the first ω of torsion: u = J1(k a) Y1(k r) - Y1(k a) J1(k r), u' = u / r on the rim."""
    from scipy.optimize import brentq
    from scipy.special import jv, yv

    def shear(k: float) -> float:
        x, a = k * OUTER, k * INNER
        return float(jv(1, a) * yv(2, x) - yv(1, a) * jv(2, x))

    return float(brentq(shear, 0.3, 1.5) * np.sqrt(SOIL.C[3, 3] / SOIL.density))


def critical_torsion(kind: str) -> float:
    """Return the rate at which the rotor loses its stiffness / the frequency of its torsion."""
    return float(critical_rate(rotor(kind, True, *CELLS), 1)[0] / torsion())


# ---- a load that rests in space --------------------------------------------------------------------------


def under_pressure(mesh: Mesh) -> NodalForces:
    """Return a pressure of two waves around the rim, cos 2 φ, that pushes inward."""
    rim = np.isin(np.arange(mesh.n_nodes), mesh.nodes("outer"))

    def traction(X: Array, _: Array) -> Array:
        x, y = X[..., 0], X[..., 1]
        r = np.hypot(x, y)
        inward = np.stack([-x / r, -y / r, 0 * r], axis=-1)
        return PRESSURE * ((x * x - y * y) / r**2)[..., None] * inward

    return NodalForces(face_forces(mesh, rim, traction))


def on_rim(mesh: Mesh, u: Array, n: int) -> tuple[complex, complex]:
    """Return the radial and tangential amplitude of e^{i n φ} on the rim."""
    rim = mesh.nodes("outer")
    rim = rim[np.abs(mesh.points[rim, 2]) < 1e-9]
    e = mesh.points[rim, :2] @ (1, 1j)
    e /= np.abs(e)
    polar = (u[rim, 0] + 1j * u[rim, 1]) / e
    wave = e**-n * (2 if n else 1) / len(rim)
    return complex(polar.real @ wave), complex(polar.imag @ wave)


@lru_cache(maxsize=32)
def _fixed(kind: str, damping: float = DAMPING) -> tuple[complex, complex]:
    """Return the answer to the pressure at 60 rad/s; several rows share it."""
    model = rotor(kind, True, *CELLS, Rotation("z", rate=FAST, damping=damping))
    model.add(under_pressure(model.mesh))
    return on_rim(model.mesh, model.solve().u, 2)


@lru_cache(maxsize=1)
def _fixed_known() -> tuple[complex, complex]:
    return WAVES(2).steady(FAST, PRESSURE, DAMPING)


def radial_answer(kind: str) -> float:
    """Return |u_r| on the rim under a pressure that rests / that in axes that turn."""
    return abs(_fixed(kind)[0]) / abs(_fixed_known()[0])


def tangential_answer(kind: str) -> float:
    """Return |u_φ| on the rim under a pressure that rests / that in axes that turn."""
    return abs(_fixed(kind)[1]) / abs(_fixed_known()[1])


def lag(kind: str) -> float:
    """Return the angle by which damping turns u_r / that in axes that turn."""
    found = np.angle(_fixed(kind)[0] / _fixed(kind, 0.0)[0])
    return float(found / np.angle(-_fixed_known()[0]))


# ---- from rest -------------------------------------------------------------------------------------------


@lru_cache(maxsize=16)
def _spun_up(kind: str) -> tuple[Mesh, Array]:
    """Return the displacements that 50 ms from rest leave, under the pressure; several rows share them."""
    cells = (2, 16) if is_quadratic(kind) else CELLS
    model = rotor(kind, True, *cells, Rotation("z", rate=0.0, acceleration=SPIN))
    model.add(under_pressure(model.mesh), amplitude=lambda t: ramp(t, END))
    *_, end = integrate(model.transient(), END / STEPS, STEPS, every=STEPS)
    return model.mesh, end.u


@lru_cache(maxsize=16)
def _spun_up_known(n: int) -> tuple[complex, complex]:
    return WAVES(n).spun_up(SPIN, PRESSURE, END)


def spun_up(n: int, way: int) -> Callable[[str], float]:
    """Return a function: the error of n waves on the rim, along the radius or the tangent, relative."""

    def of(kind: str) -> float:
        found, known = on_rim(*_spun_up(kind), n)[way], _spun_up_known(n)[way]
        return abs(found - known) / abs(known)

    return of


SOURCE, MESH = "Coriolis, axes that turn with the rotor", "3 × 24 bricks"
SHIFTS = {  # name: the waves, the number of the frequency counted from 0 rad/s, and words
    "torsion": (0, 1, "torsion"),
    "1_back": (1, 0, "one wave that runs back"),
    "1_ahead": (1, 1, "one wave that runs ahead"),
    "2_back": (2, 0, "two waves that run back"),
    "2_ahead": (2, 1, "two waves that run ahead"),
}
ANSWERS = {
    "radial": ("|u_r| on the rim", radial_answer),
    "tangential": ("|u_φ| on the rim", tangential_answer),
    "lag": ("angle by which damping turns u_r", lag),
}
STARTS = {  # name: the waves, the component, and words
    "growth": (0, 0, "the mean u_r"),
    "twist": (0, 1, "the mean u_φ"),
    "load": (2, 0, "u_r under a pressure cos 2 φ that rests in space"),
}
PROBLEMS: list[Problem] = [
    *(
        problem(f"in_plane_{name}", f"frequency of {words} of a rotor at 30 rad/s, {MESH} / known", SOURCE,
                    shifted_in_plane(n, number), tolerance=5e-3, exact=is_quadratic)
        for name, (n, number, words) in SHIFTS.items()
    ),
    problem("critical_torsion", f"rate that takes the stiffness of a rotor, {MESH} / ω of its torsion",
                "Bessel", critical_torsion, tolerance=2e-3, exact=is_quadratic),
    *(
        problem(f"fixed_load_{name}", f"{words} under a pressure cos 2 φ that rests in space, rotor at 60 "
                    f"rad/s with damping, {MESH} / known", SOURCE, of, tolerance=0.02, exact=is_quadratic)
        for name, (words, of) in ANSWERS.items()
    ),
    *(
        problem(f"start_{name}", f"error of {words} on the rim of a rotor 50 ms from rest, by 1000 rad/s², "
                    f"{MESH}, 2 × 16 quadratic ones", SOURCE, spun_up(n, way), BRICKS, 0.0, 0.03,
                    is_quadratic)
        for name, (n, way, words) in STARTS.items()
    ),
]  # fmt: skip
"""The rows of this family."""

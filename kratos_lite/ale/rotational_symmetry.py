"""Symmetry: density and stiffness must be the same wherever material that moves through a mesh comes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kratos_lite.ale.matrices import MotionMatrices
from kratos_lite.errors import ModelError

HARMONICS = 12
"""Waves around the axis, or along the frame, that are looked for."""
UNEVEN = 1e-2
"""Fraction of a harmonic that is too much."""


def check_materials(terms: MotionMatrices) -> None:
    """Raise ModelError if density or stiffness is not spread evenly about the axis, or along the frame."""
    if len({id(group.material) for group in terms.groups}) < 2:
        return
    volume, *integrals = _harmonics(terms)
    for what, values in zip(("density", *["stiffness"] * 3), integrals, strict=True):
        deviation = np.abs(values[1:] / values[0] - volume[1:] / volume[0])
        n = int(np.argmax(deviation))
        if deviation[n] > UNEVEN:
            raise ModelError(
                f"the {what} of the body is not spread evenly {terms.motion.alike[1]} (harmonic {n + 1} is "
                f"{deviation[n]:.1%}): shape, density and stiffness must be alike wherever material moves to"
            )


def _harmonics(terms: MotionMatrices) -> NDArray[np.complex128]:
    """Return the integrals (5, 13) of 1, density and measures of C times r² e^{i n φ}, n = 0 … 12."""
    integrals = np.zeros((5, HARMONICS + 1), dtype=complex)
    for group in terms.groups:
        C = group.material.C
        bulk, trace = C[:3, :3].sum(), np.trace(C)
        every = trace if terms.motion.A.any() else (C * np.arange(36, 72).reshape(6, 6)).sum()
        measures = np.array([1.0, group.material.density, bulk, trace, every])
        for chunk in group.chunks():
            element = group.at(terms.points, chunk)
            r, wave = terms.motion.phase(element.gauss_points(), terms.moving_points)
            powers = [((element.dV * r * r) * wave**n).sum() for n in range(HARMONICS + 1)]
            integrals += measures[:, None] * powers
    return integrals

"""Checks of a material: C against theory, and a law that is not linear by `laws`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite import voigt
from kratos_lite.materials import LinearMaterial, Material
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.model.checks import HARD, HEAVY, SOFTEST, STIFFEST, young_moduli
from kratos_lite.testing import laws
from kratos_lite.testing.report import (
    ConformanceError,
    Finding,
    Measured,
    difference,
    largest,
    run,
    run_after,
)
from kratos_lite.typing import Array
from kratos_lite.validation import instance

STRAIN = 1e-3 * np.array([1.0, -0.7, 0.4, 0.9, -0.3, 0.6])
"""A strain whose components are told apart by size and sign."""


def check_material(material: Material) -> list[Finding]:
    """Check a material: stability, isotropy where claimed, magnitude, density; of a linear one symmetry.

    A law that is not linear is driven along random paths: shapes, states, tangent, elastic limit, steps,
    rate and dissipation.

    Parameters
    ----------
    material : an instance.  It claims isotropy if it is an Isotropic3D or if its class says
        ``isotropic = True``, about one axis if it says ``transversely_isotropic = (0, 0, 1)``.  Of a law
        ``symmetric_tangent`` and ``rate_dependent`` are claims, too.

    Returns
    -------
    list of Finding

    Examples
    --------
    >>> from kratos_lite import Isotropic3D
    >>> all(finding.passed for finding in check_material(Isotropic3D(E=210e9, nu=0.3)))
    True
    """
    instance(material, "a law", Material, "MyLaw(E=1e6) with its constants")
    if isinstance(material, LinearMaterial):
        return run(CHECKS, material)
    first = run([laws.contract], material)
    return first + run_after(first, (*laws.CHECKS, positive_definite, magnitude, density), material)


def _C(material: Material) -> Array:
    C = np.asarray(material.C, dtype=float)
    if C.shape != (6, 6) or not np.isfinite(C).all():
        raise ConformanceError(f"C must be (6, 6) and finite; its shape is {C.shape}")
    return C


def symmetry(material: LinearMaterial) -> Measured:
    """Check C = C^T: the stress has an energy."""
    C = _C(material)
    i, j = np.unravel_index(int(np.argmax(np.abs(C - C.T))), C.shape)
    return Measured(difference(C, C.T), 1e-14, f"C[{i}, {j}] = {C[i, j]:.10g}, C[{j}, {i}] = {C[j, i]:.10g}")


def positive_definite(material: Material) -> Measured:
    """Check that every strain costs energy."""
    C = _C(material)
    scale = np.sqrt(np.abs(np.diag(C)).clip(min=1e-300))
    values, vectors = np.linalg.eigh((C + C.T) / 2 / np.outer(scale, scale))
    strain = vectors[:, 0] / scale
    strain = strain / np.abs(strain).max()
    parts = ", ".join(f"{name} {e:.3g}" for name, e in zip(voigt.NAMES, strain, strict=True))
    text = f"strains without energy (eigenvalues ≤ 0 of scaled C); the softest is {parts}"
    return Measured(int((~(values > 0)).sum()), 0, text)


def isotropy(material: LinearMaterial) -> Measured | str:
    """Check that a turned strain gives the turned stress: also about a skew axis, or the one claimed."""
    kind = type(material)
    axis = getattr(kind, "transversely_isotropic", None)
    if axis is not None:
        return _turned(material, {f"{angle}° about {tuple(axis)}": _about(axis, angle) for angle in (90, 37)})
    if not getattr(kind, "isotropic", isinstance(material, Isotropic3D)):
        return (
            f"{kind.__name__} claims no isotropy; isotropic = True in the class would, or "
            "transversely_isotropic = (0, 0, 1), its axis"
        )
    turns = {f"90° about {name}": _about(unit, 90) for name, unit in zip("xyz", np.eye(3), strict=True)}
    found, C = _turned(material, {**turns, "37° about a skew axis": _about((1, 2, -3), 37)}), material.C
    twice = abs(C[3, 3] - C[0, 0] + C[0, 1]) < 1e-9 * C[3, 3]
    text = f"{found.detail}: C[3, 3] = C[0, 0] - C[0, 1] is 2 μ, of engineering shear it is μ"
    return found._replace(detail=text) if twice else found


def _about(axis: ArrayLike, degrees: float) -> Array:
    """Return the rotation (3, 3) about an axis."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    W, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.radians(degrees)
    return np.eye(3) + np.sin(angle) * W + (1 - np.cos(angle)) * W @ W


def _turned(material: LinearMaterial, turns: Mapping[str, Array]) -> Measured:
    """Compare the stress of a turned strain with the turned stress."""
    errors = {}
    for name, R in turns.items():
        turned = voigt.turned_strain(STRAIN, R)
        expected = voigt.vector(R @ voigt.tensor(material.stress(STRAIN)) @ R.T)
        text = f"stress of a strain turned by {name} against the turned stress"
        errors[text] = difference(material.stress(turned), expected)
    return largest(errors, 1e-13)


def magnitude(material: Material) -> Measured | str:
    """Check that Young's moduli along the axes are those of a body in Pa, not a compliance or in MPa."""
    if not positive_definite(material).value == 0:
        return "C is not positive definite"
    low, high = young_moduli(material)
    text = f"Young's moduli along the axes are {low:.3g} … {high:.3g} Pa; "
    if not SOFTEST * (1 - 1e-9) <= low <= high <= STIFFEST * (1 + 1e-9):
        return Measured(1, 0, f"{text}bodies have {SOFTEST:g} … {STIFFEST:g}: is C a compliance?")
    is_soft = material.density > HEAVY and high < HARD
    return Measured(float(is_soft), 0, f"{text}too soft for {material.density:g} kg/m³: are they in MPa?")


def density(material: Material) -> Measured:
    """Check that the density is a finite number ≥ 0."""
    rho = float(material.density)
    return Measured(
        float(not (np.isfinite(rho) and rho >= 0)), 0, f"density is {rho:g} kg/m³; it must be ≥ 0"
    )


CHECKS = (symmetry, positive_definite, isotropy, magnitude, density)

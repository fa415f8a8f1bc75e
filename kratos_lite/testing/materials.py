"""Checks of a linear elastic material: C against theory."""

from __future__ import annotations

import numpy as np

from kratos_lite import voigt
from kratos_lite.materials import LinearMaterial
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.testing.report import ConformanceError, Finding, Measured, difference, largest, run
from kratos_lite.typing import Array

STRAIN = 1e-3 * np.array([1.0, -0.7, 0.4, 0.9, -0.3, 0.6])
"""A strain whose components are told apart by size and sign."""


def check_material(material: LinearMaterial) -> list[Finding]:
    """Check a material: symmetry, stability, isotropy where claimed, density.

    Parameters
    ----------
    material : an instance.  It claims isotropy if it is an Isotropic3D or if its class says
        ``isotropic = True``.

    Returns
    -------
    list of Finding

    Examples
    --------
    >>> from kratos_lite import Isotropic3D
    >>> all(finding.passed for finding in check_material(Isotropic3D(E=210e9, nu=0.3)))
    True
    """
    return run(CHECKS, material)


def _C(material: LinearMaterial) -> Array:
    C = np.asarray(material.C, dtype=float)
    if C.shape != (6, 6) or not np.isfinite(C).all():
        raise ConformanceError(f"C must be (6, 6) and finite; its shape is {C.shape}")
    return C


def symmetry(material: LinearMaterial) -> Measured:
    """Check C = C^T: the stress has an energy."""
    C = _C(material)
    i, j = np.unravel_index(int(np.argmax(np.abs(C - C.T))), C.shape)
    return Measured(difference(C, C.T), 1e-14, f"C[{i}, {j}] = {C[i, j]:.10g}, C[{j}, {i}] = {C[j, i]:.10g}")


def positive_definite(material: LinearMaterial) -> Measured:
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
    """Check that a turned strain gives the turned stress: by 90° and about a skew axis."""
    kind = type(material)
    if not getattr(kind, "isotropic", isinstance(material, Isotropic3D)):
        return f"{kind.__name__} does not claim to be isotropic (isotropic = True in the class would)"
    Q, _ = np.linalg.qr(np.random.default_rng(29).uniform(-1, 1, (3, 3)))
    quarter = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    turns = {f"90° about {axis}": np.roll(quarter, k, axis=(0, 1)) for k, axis in enumerate("xyz")}
    turns["an angle about a skew axis"] = Q
    errors = {}
    doubled = np.array([1, 1, 1, 2, 2, 2])  # engineering shear is twice the tensor component
    for name, R in turns.items():
        turned = voigt.vector(R @ voigt.tensor(STRAIN / doubled) @ R.T) * doubled
        expected = voigt.vector(R @ voigt.tensor(material.stress(STRAIN)) @ R.T)
        text = f"stress of a strain turned by {name} against the turned stress"
        errors[text] = difference(material.stress(turned), expected)
    return largest(errors, 1e-13)


def density(material: LinearMaterial) -> Measured:
    """Check that the density is a finite number ≥ 0."""
    rho = float(material.density)
    return Measured(
        float(not (np.isfinite(rho) and rho >= 0)), 0, f"density is {rho:g} kg/m³; it must be ≥ 0"
    )


CHECKS = (symmetry, positive_definite, isotropy, density)

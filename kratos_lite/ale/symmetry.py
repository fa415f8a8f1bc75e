"""Symmetry: what flows through a mesh at rest must be alike all along its way, in shape and material."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kratos_lite.ale.boundaries import end_nodes
from kratos_lite.ale.matrices import MotionMatrices
from kratos_lite.ale.motion import Motion, Rotation, Translation
from kratos_lite.elements.surface import area_vectors, face_rule
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array

HARMONICS = 12
"""Waves around the axis, or along the window, that are looked for."""
UNEVEN = 1e-2
"""Share of a harmonic that is too much."""


def leak(motion: Motion, mesh: Mesh) -> float:
    """Return the largest share of the velocity of the material that passes through the boundary.

    The two ends of a window do not count.
    """
    normal, largest, open_ = 0.0, 0.0, np.zeros((2, mesh.n_nodes), dtype=bool)
    if isinstance(motion, Translation):
        for end, nodes in zip(open_, end_nodes(mesh, motion), strict=True):
            end[nodes] = True
    for block in mesh.boundary:
        if block.shape is None or not len(block):
            continue
        rule = face_rule(block.shape)
        X = mesh.points[block.nodes[~open_[:, block.nodes].all(axis=2).any(axis=0)]]
        n = area_vectors(block.shape, X, rule)
        n = n / np.linalg.norm(n, axis=-1, keepdims=True)
        N = np.array([block.shape.N(xi) for xi in rule.points])
        c = motion.field(N @ X)
        normal = max(normal, float(np.abs((c * n).sum(axis=-1)).max(initial=0.0)))
        largest = max(largest, float(np.linalg.norm(c, axis=-1).max(initial=0.0)))
    return normal / largest if largest else 0.0


def check_materials(terms: MotionMatrices) -> None:
    """Raise ModelError if density or stiffness is not spread evenly about the axis, or along the window.

    For n = 1 … 12 the integrals of ρ r² e^{i n φ} must be those of the mean density, which are 0 but for the
    quadrature of the mesh, and so those of measures of C.  Along a window φ goes once around, and r = 1.  One
    material alone is even where the boundary is.
    """
    materials = {id(group.material): group.material for group in terms.groups}
    if len(materials) < 2:
        return
    turns = isinstance(terms.motion, Rotation)
    found = _harmonics(terms)
    one = found[0] / found[0][0]
    for what, values in zip(("density", *["stiffness"] * 3), found[1:], strict=True):
        share = np.abs(values[1:] / values[0] - one[1:])
        n = int(np.argmax(share)) + 1
        if share[n - 1] > UNEVEN:
            where, alike = ("about its axis", "one of revolution") if turns else ("along the window", "alike")
            raise ModelError(
                f"the {what} of the body is not spread evenly {where} (harmonic {n} is {share[n - 1]:.1%}): "
                f"a body that runs through a mesh at rest must be {alike} in shape, density and stiffness"
            )


def _harmonics(terms: MotionMatrices) -> NDArray[np.complex128]:
    """Return the integrals (5, 13) of 1, density and measures of C times r² e^{i n φ}, n = 0 … 12.

    C is measured by two invariants, and in a window, whose axes do not turn, by all of its components.
    """
    found = np.zeros((5, HARMONICS + 1), dtype=complex)
    for group in terms.groups:
        C = group.material.C
        bulk, trace = C[:3, :3].sum(), np.trace(C)
        every = trace if isinstance(terms.motion, Rotation) else (C * np.arange(36, 72).reshape(6, 6)).sum()
        values = np.array([1.0, group.material.density, bulk, trace, every])
        for chunk in group.chunks():
            element = group.at(terms.points, chunk)
            r, wave = _polar(terms, element.gauss_points())
            power = (element.dV * r * r).astype(complex)
            for n in range(HARMONICS + 1):
                found[:, n] += values * power.sum()
                power *= wave
    return found


def _polar(terms: MotionMatrices, X: Array) -> tuple[Array, NDArray[np.complex128]]:
    """Return r and e^{i φ} of points; 1 and the phase along it for a window."""
    motion = terms.motion
    if isinstance(motion, Translation):
        x, ends = X @ motion.direction, terms.points @ motion.direction
        return np.ones_like(x), np.exp(2j * np.pi * (x - ends.min()) / np.ptp(ends))
    c, all_c = motion.field(X), motion.field(terms.points)
    first = all_c[int(np.argmax((all_c * all_c).sum(axis=1)))]
    first = first / np.linalg.norm(first)
    r = np.linalg.norm(c, axis=-1)
    wave = (c @ first + 1j * (c @ np.cross(motion.direction, first))) / np.where(r > 0, r, 1.0)
    return r, wave

"""Layers: a direction along which neither the cells nor the stress of a result change, as in plane strain."""

from __future__ import annotations

import numpy as np

from kratos_lite.analysis.result import Result
from kratos_lite.assembly.gauss_point_fields import volumes
from kratos_lite.mesh.refinement import axes_along
from kratos_lite.quadrature import Rule
from kratos_lite.typing import Array, Ints


def layer_direction(result: Result, allowed: float) -> Array | None:
    """Return the first of x, y and z along which all elements have straight edges and constant stress."""
    for direction in np.eye(3):
        axes = [axes_along(result.mesh, block, direction) for block in result.mesh.blocks if len(block)]
        along = np.concatenate(axes)
        if len(along) and (along >= 0).all() and _variation(result, along) <= allowed**2:
            return direction
    return None


def _variation(result: Result, along: Ints) -> float:
    """Return ∫ Δσ : C⁻¹ : Δσ dV of the stress less its mean along an axis of each cell, in J."""
    total = 0.0
    stress = result.stress("gauss")
    for group in result.groups:
        mine = (
            np.asarray([stress[row] for row in group.rows])
            if isinstance(stress, list)
            else stress[group.rows]
        )
        density = np.zeros(mine.shape[:2])
        for axis in range(3):
            cells = along[group.rows] == axis
            off = _off_mean(group.rule, axis) @ mine[cells]
            density[cells] = ((off @ np.linalg.inv(group.material.C)) * off).sum(axis=-1)
        total += float((density * volumes(result.mesh.points, group)).sum())
    return total


def _off_mean(rule: Rule, axis: int) -> Array:
    """Return the matrix (g, g) from values at the points of a rule to their differences from means."""
    others = np.delete(rule.points, axis, axis=1)
    same = np.abs(others[:, None] - others[None]).max(axis=2) < 1e-9
    weights = same * rule.weights
    return np.eye(len(others)) - weights / weights.sum(axis=1, keepdims=True)

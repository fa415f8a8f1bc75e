"""Loads on faces and edges of elements: tractions and pressures as nodal forces."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.elements.tables import tabulate
from kratos_lite.quadrature import Rule, rule_for
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


FUNCTION = 5
"""Factors of the rule for a load by a function: N, and a polynomial of degree p + 2 on curved faces."""


def face_rule(shape: type[Shape], factors: int = 2) -> Rule:
    """Return the rule for loads on a face or line, exact for so many N times area (plane) or normal."""
    p = shape.degree
    return rule_for(shape.cell, max((factors + 2) * p - (2 if shape.cell == "triangle" else 1), 0))


def area_vectors(shape: type[Shape], X: ArrayLike, rule: Rule | None = None) -> Array:
    """Return normal × area (..., g, 3) in m² of faces X (..., k, 3); nodes run counter-clockwise about it."""
    rule = rule or face_rule(shape)
    tangents = _tangents(shape, np.asarray(X, dtype=float), rule)
    return np.cross(tangents[..., 0, :], tangents[..., 1, :]) * rule.weights[:, None]


def _tangents(shape: type[Shape], X: Array, rule: Rule) -> Array:
    """Return dX/dxi (..., g, 1 or 2, 3) in m of lines or faces at the points of a rule."""
    return np.einsum("...ai,gaj->...gji", X, tabulate(shape, rule)[1])


def _measure(shape: type[Shape], X: Array, rule: Rule) -> Array:
    """Return area, length or 1 (..., g) that the points of a rule stand for on faces, lines or points."""
    if shape.cell == "point":
        return np.ones((*X.shape[:-2], 1))
    if shape.cell == "line":
        return np.linalg.norm(_tangents(shape, X, rule)[..., 0, :], axis=-1) * rule.weights
    return np.linalg.norm(area_vectors(shape, X, rule), axis=-1)


def surface_load(
    shape: type[Shape], X: ArrayLike, traction: ArrayLike | Callable[[Array], Array], factors: int = FUNCTION
) -> Array:
    """Return ∫ N t dA, ∫ N t ds or t (..., k, 3) in N of faces, lines or points.

    t is constant, nodal, or a function of places (..., g, 3), taken at the points of the rule of `factors`.
    """
    X = np.asarray(X, dtype=float)
    rule = face_rule(shape, factors if callable(traction) else 2)
    N, measure = tabulate(shape, rule)[0], _measure(shape, X, rule)
    if callable(traction):
        return N.T @ (measure[..., None] * traction(N @ X))
    t = np.asarray(traction, dtype=float)
    if t.ndim == X.ndim and t.shape[-2:] == (len(shape.nodes), 3):
        return (N.T * measure[..., None, :]) @ (N @ t)
    return (measure @ N)[..., :, None] * t[..., None, :]


def surface_mass(shape: type[Shape], X: ArrayLike) -> Array:
    """Return ∫ N N^T dA of faces X (..., k, 3) as (..., k, k) in m²."""
    rule = face_rule(shape)
    N, measure = tabulate(shape, rule)[0], _measure(shape, np.asarray(X, dtype=float), rule)
    return (N.T * measure[..., None, :]) @ N


def surface_pressure_tangent(shape: type[Shape], X: ArrayLike, pressure: ArrayLike) -> Array:
    """Return the derivative (..., k, 3, k, 3) in N/m of `surface_pressure` by the nodes."""
    # With tangents t1, t2: d(t1 × t2) = t1 × dt2 - t2 × dt1.
    X, p = np.asarray(X, dtype=float), np.asarray(pressure, dtype=float)
    rule = face_rule(shape)
    N, dN = tabulate(shape, rule)
    tangents = _tangents(shape, X, rule)
    across = np.cross(tangents[..., None, :], np.eye(3))  # (t × e_i) in row i
    change = np.einsum("...gic,gb->...gbic", across[..., 0, :, :], dN[..., 1])
    change -= np.einsum("...gic,gb->...gbic", across[..., 1, :, :], dN[..., 0])
    return -p[..., None, None, None, None] * np.einsum("g,ga,...gbic->...acbi", rule.weights, N, change)


def surface_pressure(
    shape: type[Shape], X: ArrayLike, pressure: ArrayLike | Callable[[Array], Array], factors: int = FUNCTION
) -> Array:
    """Return -∫ N p n dA (..., k, 3) in N of faces.

    p in Pa: one, (...) per face, (..., k) nodal, or a function of places (..., g, 3) as for `surface_load`.
    """
    X = np.asarray(X, dtype=float)
    rule = face_rule(shape, factors if callable(pressure) else 2)
    N, _ = tabulate(shape, rule)
    if callable(pressure):
        at_points = pressure(N @ X)[..., None]
    elif (p := np.asarray(pressure, dtype=float)).ndim and p.shape == X.shape[:-1]:
        at_points = (p @ N.T)[..., None]
    else:
        at_points = p[..., None, None]
    return -N.T @ (area_vectors(shape, X, rule) * at_points)

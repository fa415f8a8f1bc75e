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


def _area_vectors_tangent(shape: type[Shape], X: Array, rule: Rule) -> Array:
    """Return the derivative (..., g, b, i, c) of the area vectors by axis i of node b."""
    # With tangents t1, t2: d(t1 × t2) = t1 × dt2 - t2 × dt1.
    dN, tangents = tabulate(shape, rule)[1] * rule.weights[:, None, None], _tangents(shape, X, rule)
    across = np.cross(tangents[..., None, :], np.eye(3))  # (t × e_i) in row i
    change = np.einsum("...gic,gb->...gbic", across[..., 0, :, :], dN[..., 1])
    return change - np.einsum("...gic,gb->...gbic", across[..., 1, :, :], dN[..., 0])


def surface_pressure_tangent(shape: type[Shape], X: ArrayLike, pressure: ArrayLike) -> Array:
    """Return the derivative (..., k, 3, k, 3) in N/m of `surface_pressure` by the nodes."""
    X, rule = np.asarray(X, dtype=float), face_rule(shape)
    N = tabulate(shape, rule)[0]
    change = _area_vectors_tangent(shape, X, rule)
    return -np.einsum("...ga,...gbic->...acbi", _at_points(pressure, X, N)[..., None] * N, change)


def surface_load_tangent(shape: type[Shape], X: ArrayLike, traction: ArrayLike) -> Array:
    """Return the derivative (..., k, 3, k, 3) in N/m of `surface_load` of a nodal traction by the nodes."""
    X, rule = np.asarray(X, dtype=float), face_rule(shape)
    N, dN = tabulate(shape, rule)
    if shape.cell == "line":
        along = _tangents(shape, X, rule)[..., 0, :]
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
        change = np.einsum("g,...gi,gb->...gbi", rule.weights, along, dN[..., 0])
    else:
        normal = area_vectors(shape, X, rule)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        change = np.einsum("...gbic,...gc->...gbi", _area_vectors_tangent(shape, X, rule), normal)
    return np.einsum("ga,...gc,...gbi->...acbi", N, N @ np.asarray(traction, dtype=float), change)


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
        at_points = pressure(N @ X)
    else:
        at_points = _at_points(pressure, X, N)
    return -N.T @ (area_vectors(shape, X, rule) * at_points[..., None])


def _at_points(pressure: ArrayLike, X: Array, N: Array) -> Array:
    """Return a pressure, one, (...) per face or (..., k) nodal, at Gauss points, (..., g) or (..., 1)."""
    p = np.asarray(pressure, dtype=float)
    return p @ N.T if p.ndim and p.shape == X.shape[:-1] else p[..., None]

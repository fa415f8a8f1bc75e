"""Exact displacement fields of the scenes, u(X) for points X (..., 3) in m.

Sources: method of manufactured solutions (Roache, J. Fluids Eng. 124 (2002) 4-10); Timoshenko & Goodier,
Theory of Elasticity, sections 102 (pure bending) and 142 (Lamé sphere); Goodier, J. Appl. Mech. 1 (1933)
39-44 (spherical cavity); Kirsch, Zeitschrift des VDI 42 (1898) 797-807
(hole); Carstensen, Dolzmann, Funken & Helm, CMAME 190 (2001) 1885-1900 (L-domain).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.typing import Array

Field = Callable[[Array], Array]
STEP = 1e-5
"""Step of the central differences below in m: their relative error is about 1e-10."""


def lame(E: float, nu: float) -> tuple[float, float]:
    """Return λ and μ in Pa."""
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def gradient(field: Field, X: Array) -> Array:
    """Return ∂u_i/∂x_j (..., 3, 3) by central differences."""
    columns = [(field(X + STEP * axis) - field(X - STEP * axis)) / (2 * STEP) for axis in np.eye(3)]
    return np.stack(columns, axis=-1)


# ---- S2, manufactured ------------------------------------------------------------------------------


def manufactured(X: Array) -> Array:
    """Return (s s s, s s z(1-z), e^x y(1-y) s) with s = sin πt."""
    x, y, z = np.moveaxis(X, -1, 0)
    sx, sy, sz = (np.sin(np.pi * t) for t in (x, y, z))
    return np.stack([sx * sy * sz, sx * sy * z * (1 - z), np.exp(x) * y * (1 - y) * sz], axis=-1)


def manufactured_force(X: Array, E: float, nu: float) -> Array:
    """Return the body force -(λ + μ) ∇ div u - μ Δu in N/m³ that makes `manufactured` exact."""
    (lam, mu), pi = lame(E, nu), np.pi
    x, y, z = np.moveaxis(X, -1, 0)
    (sx, sy, sz), (cx, cy, cz) = ([of(pi * t) for t in (x, y, z)] for of in (np.sin, np.cos))
    u, v, w = np.moveaxis(manufactured(X), -1, 0)
    e, q = np.exp(x), z * (1 - z)
    # div u = π cx sy sz + π sx cy q + π e y (1 - y) cz
    grad_div = [
        pi**2 * (cx * cy * q - u) + pi * e * y * (1 - y) * cz,
        pi**2 * (cx * cy * sz - v) + pi * e * (1 - 2 * y) * cz,
        pi**2 * (cx * sy * cz - w) + pi * sx * cy * (1 - 2 * z),
    ]
    laplacian = [-3 * pi**2 * u, -2 * pi**2 * v - 2 * sx * sy, (1 - pi**2) * w - 2 * e * sz]
    return np.asarray(-(lam + mu) * np.stack(grad_div, axis=-1) - mu * np.stack(laplacian, axis=-1))


# ---- S3, S5, S7, S8 ---------------------------------------------------------------------------------


def hollow_sphere(E: float, nu: float, a: float, b: float, p: float) -> Field:
    """Return the field of a hollow sphere, radii a < b, under inner pressure p."""
    scale = p * a**3 / (b**3 - a**3) / E

    def field(X: Array) -> Array:
        r = np.linalg.norm(X, axis=-1, keepdims=True)
        return X / r * scale * ((1 - 2 * nu) * r + (1 + nu) * b**3 / (2 * r**2))

    return field


def bending(curvature: float, nu: float) -> Field:
    """Return the field of a bar along x bent in the plane x y: quadratic, with σ_xx = E · curvature · y."""

    def field(X: Array) -> Array:
        x, y, z = np.moveaxis(X, -1, 0)
        return curvature * np.stack([x * y, -(x**2 + nu * (y**2 - z**2)) / 2, -nu * y * z], axis=-1)

    return field


EXPONENT = 0.54448373678246392914
"""Of the singularity at a corner of 270°, plane strain."""


def l_domain(E: float, nu: float) -> Field:
    """Return the field (plane strain) around the corner of an L whose missing quadrant is x < 0, y < 0."""
    lam, mu = lame(E, nu)
    power, half = EXPONENT, 3 * np.pi / 4
    c1 = -np.cos((power + 1) * half) / np.cos((power - 1) * half)
    c2 = 2 * (lam + 2 * mu) / (lam + mu)

    def field(X: Array) -> Array:
        x, y, _ = np.moveaxis(X, -1, 0)
        r, direction = np.hypot(x, y), np.arctan2(x + y, x - y)
        # `direction` is the angle of (x - y, x + y), that is 45° more than that of (x, y)
        f = direction - np.pi / 2
        f += 2 * np.pi * (f < -np.pi)
        k = r**power / (2 * mu)
        radial = k * (
            -(power + 1) * np.cos((power + 1) * f) + (c2 - power - 1) * c1 * np.cos((power - 1) * f)
        )
        around = k * ((power + 1) * np.sin((power + 1) * f) + (c2 + power - 1) * c1 * np.sin((power - 1) * f))
        angle = f + np.pi / 4
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([radial * c - around * s, radial * s + around * c, np.zeros_like(r)], axis=-1)

    return field


def cavity(E: float, nu: float, a: float, tension: float) -> Field:
    """Return the field around a spherical cavity of radius a under tension along z far away."""
    G = E / (2 * (1 + nu))
    K = tension / (8 * G * (7 - 5 * nu))
    A, B, C = -K * (13 - 10 * nu) * a**3, K * a**5, 5 * K * (1 - 2 * nu) * a**3

    def field(X: Array) -> Array:
        rho = np.hypot(X[..., 0], X[..., 1])
        r = np.hypot(rho, X[..., 2])
        s, c = rho / r, X[..., 2] / r
        cos2, sin2 = c * c - s * s, 2 * s * c
        far = tension * r / (2 * E)
        radial = -A / r**2 - 3 * B / r**4 + far * ((1 - nu) + (1 + nu) * cos2)
        radial += ((5 - 4 * nu) / (1 - 2 * nu) * C / r**2 - 9 * B / r**4) * cos2
        polar = -(2 * C / r**2 + 6 * B / r**4) * sin2 - far * (1 + nu) * sin2
        outward = radial * s + polar * c
        unit = X[..., :2] / np.where(rho > 0, rho, 1.0)[..., None]
        return np.concatenate([outward[..., None] * unit, (radial * c - polar * s)[..., None]], axis=-1)

    return field


def hole(E: float, nu: float, a: float, tension: float) -> Field:
    """Return the field (plane strain) around a hole of radius a under tension along x far away."""
    k, scale = 3 - 4 * nu, tension * a * (1 + nu) / (4 * E)

    def field(X: Array) -> Array:
        x, y, _ = np.moveaxis(X, -1, 0)
        r = np.hypot(x, y) / a
        c, s = x / (r * a), y / (r * a)
        c3, s3 = c * (4 * c * c - 3), s * (3 - 4 * s * s)  # of three times the angle
        u = r * (k + 1) * c + 2 / r * ((1 + k) * c + c3) - 2 / r**3 * c3
        v = r * (k - 3) * s + 2 / r * ((1 - k) * s + s3) - 2 / r**3 * s3
        return scale * np.stack([u, v, np.zeros_like(r)], axis=-1)

    return field

"""Cylinders and spheres under inner pressure; the thick cylinder near ν = ½ shows volumetric locking."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import annulus
from kratos_lite.model.loads.surface import Pressure
from kratos_lite.typing import Array, Mask
from kratos_lite.verification import scenes
from kratos_lite.verification.meshes import element, is_quadratic, shaped
from kratos_lite.verification.problem import Models, Problem, models_of, stress_at
from kratos_lite.verification.scenes import in_plane_strain, on_symmetry_planes

RADII = (3.0, 3.5, 4.2, 5.2, 6.75, 9.0)
RATIOS = (0.3, 0.49, 0.499, 0.4999)


def lame_cylinder(nu: float, E: float, a: float, b: float, r: float) -> float:
    """Return u_r of a cylinder under unit inner pressure in plane strain."""
    return (1 + nu) * a**2 / (E * (b**2 - a**2)) * ((1 - 2 * nu) * r + b**2 / r)


def thick_cylinder(nu: float) -> Models:
    """Return a function: a quarter of a cylinder, radii 3 and 9, in nine segments of five bricks."""

    def place(X: Array) -> Array:
        r, angle = np.interp(5 * X[:, 0], range(6), RADII), np.pi / 2 * X[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), X[:, 2]])

    def models(kind: str) -> Model:
        mesh = shaped(kind, (5, 9, 1), place)
        model = Model(mesh, Isotropic3D(E=1000.0, nu=nu))
        in_plane_strain(model)
        on_symmetry_planes(model, "xy")
        model.add(Pressure(_on_radius(mesh.points, 3.0), 1.0))
        return model

    return models


def _on_radius(points: Array, radius: float) -> Mask:
    """Return a mask of the points on a radius."""
    return np.abs(np.hypot(points[:, 0], points[:, 1]) - radius) < 1e-6


def _inner(radius: float) -> Callable[[Result], float]:
    """Return a function: mean u_r of the nodes on a radius."""

    def measure(result: Result) -> float:
        X = result.mesh.points
        chosen = _on_radius(X, radius)
        return float(((result.u[chosen] * X[chosen])[:, :2].sum(axis=1) / radius).mean())

    return measure


def cylinder(kind: str) -> Model:
    """Return a whole cylinder, radii 1 and 2, in plane strain, 4 × 24 × 1 bricks."""
    mesh = annulus(1.0, 2.0, 0.25, (4, 24, 1), element(kind))
    model = Model(mesh, scenes.UNIT)
    in_plane_strain(model)
    for axis, letter in enumerate("xy"):
        model.fix(np.abs(mesh.points[:, axis]) < 1e-9, letter)
    model.add(Pressure("inner", 1.0))
    return model


def _sphere_radial(result: Result) -> float:
    X = result.mesh.points
    inner = np.abs(np.linalg.norm(X, axis=1) - 1) < 1e-9
    return float(np.linalg.norm(result.u[inner], axis=1).mean())


PROBLEMS: list[Problem] = [
    *(
        Problem(f"pressure/thick_cylinder_{nu:g}",
                f"u_r at the inner radius 3, segments of 10°, five bricks along the radius, ν = {nu:g}",
                "MacNeal, thick-walled cylinder; closed form of Lamé",
                lame_cylinder(nu, 1000.0, 3.0, 9.0, 3.0), thick_cylinder(nu), _inner(3.0))
        for nu in RATIOS
    ),
    Problem("pressure/lame_cylinder", "u_r at the inner radius 1, cylinder of 4 × 24 × 1 bricks",
            "Lame, section 28", lame_cylinder(0.3, 1.0, 1.0, 2.0, 1.0), cylinder, _inner(1.0), 2e-3,
            is_quadratic),
    Problem("pressure/lame_cylinder_hoop", "σ_φφ at the node (1, 0, 0), the same",
            "Lame, section 28", 5 / 3, cylinder, stress_at((1, 0, 0), 1)),
    Problem("pressure/lame_sphere",
            "mean |u| at the inner radius 1, an eighth of a hollow sphere, 3 blocks of 3 × 3 × 3 bricks",
            "Lame, section 142", 0.8, models_of(scenes.sphere, 3), _sphere_radial, 1.3e-2,
            is_quadratic),
]  # fmt: skip
"""The rows of this family."""

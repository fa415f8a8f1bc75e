"""Cylinders and spheres under inner pressure; the thick cylinder near ν = ½ shows volumetric locking."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import annulus
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.model.loads.surface import Pressure
from kratos_lite.typing import Array
from kratos_lite.verification import scenes
from kratos_lite.verification.meshes import element, face_forces, is_quadratic, nearest, on_plane, shaped
from kratos_lite.verification.problem import Problem, StaticProblem

RADII = (3.0, 3.5, 4.2, 5.2, 6.75, 9.0)
RATIOS = (0.3, 0.49, 0.499, 0.4999)


def lame_cylinder(nu: float, E: float, a: float, b: float, r: float) -> float:
    """Return u_r of a cylinder under unit inner pressure in plane strain."""
    return (1 + nu) * a**2 / (E * (b**2 - a**2)) * ((1 - 2 * nu) * r + b**2 / r)


def thick_cylinder(nu: float) -> Callable[[str], tuple[Model, ...]]:
    """Return a function: a quarter of a cylinder, radii 3 and 9, in nine segments of five bricks."""

    def place(X: Array) -> Array:
        r, angle = np.interp(5 * X[:, 0], range(6), RADII), np.pi / 2 * X[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), X[:, 2]])

    def models(kind: str) -> tuple[Model, ...]:
        mesh = shaped(kind, (5, 9, 1), place)
        model = Model(mesh, Isotropic3D(E=1000.0, nu=nu))
        model.fix(on_plane(mesh, 2, 0.0) | on_plane(mesh, 2, 1.0), "z")
        model.fix(on_plane(mesh, 1, 0.0), "y")
        model.fix(on_plane(mesh, 0, 0.0), "x")
        inner = np.abs(_radius(mesh.points) - 3.0) < 1e-6
        model.add(NodalForces(face_forces(mesh, inner, lambda X, n: -n)))
        return (model,)

    return models


def _radius(points: Array) -> Array:
    return np.hypot(points[:, 0], points[:, 1])


def _inner(radius: float) -> Callable[[Result], float]:
    """Return a function: mean u_r of the nodes on a radius."""

    def measure(result: Result) -> float:
        X = result.mesh.points
        rows = np.abs(_radius(X) - radius) < 1e-6
        return float(((result.u[rows] * X[rows])[:, :2].sum(axis=1) / radius).mean())

    return measure


def cylinder(kind: str) -> tuple[Model, ...]:
    """Return a whole cylinder, radii 1 and 2, in plane strain, 4 × 24 × 1 bricks."""
    mesh = annulus(1.0, 2.0, 0.25, (4, 24, 1), element(kind))
    model = Model(mesh, scenes.UNIT)
    model.fix(on_plane(mesh, 2, 0.0) | on_plane(mesh, 2, 0.25), "z")
    model.fix(on_plane(mesh, 1, 0.0), "y")
    model.fix(on_plane(mesh, 0, 0.0), "x")
    model.add(Pressure("inner", 1.0))
    return (model,)


def sphere(kind: str) -> tuple[Model, ...]:
    """Return an eighth of a hollow sphere, three blocks of 3 × 3 × 3 bricks."""
    return (scenes.sphere(kind, 3).model,)


def _hoop(result: Result) -> float:
    """Return the hoop stress at (1, 0, 0), a mean over the elements around the node."""
    return float(result.stress("averaged")[nearest(result.mesh, (1, 0, 0)), 1])


def _sphere_radial(result: Result) -> float:
    X = result.mesh.points
    rows = np.abs(np.linalg.norm(X, axis=1) - 1) < 1e-9
    return float(np.linalg.norm(result.u[rows], axis=1).mean())


def _thick() -> list[Problem]:
    return [
        StaticProblem(
            name=f"pressure/thick_cylinder_{nu:g}",
            quantity=f"u_r at the inner radius 3, segments of 10°, five bricks along the radius, ν = {nu:g}",
            source="MacNeal, thick-walled cylinder; closed form of Lamé",
            reference=lame_cylinder(nu, 1000.0, 3.0, 9.0, 3.0),
            models=thick_cylinder(nu),
            measure=_inner(3.0),
        )
        for nu in RATIOS
    ]


PROBLEMS: list[Problem] = [
    *_thick(),
    StaticProblem(
        name="pressure/lame_cylinder",
        quantity="u_r at the inner radius 1, cylinder of 4 × 24 × 1 bricks",
        source="Lame, section 28",
        reference=lame_cylinder(0.3, 1.0, 1.0, 2.0, 1.0),
        models=cylinder,
        measure=_inner(1.0),
        tolerance=2e-3,
        exact=is_quadratic,
    ),
    StaticProblem(
        name="pressure/lame_cylinder_hoop",
        quantity="σ_φφ at the node (1, 0, 0), the same",
        source="Lame, section 28",
        reference=5 / 3,
        models=cylinder,
        measure=_hoop,
    ),
    StaticProblem(
        name="pressure/lame_sphere",
        quantity="mean |u| at the inner radius 1, an eighth of a hollow sphere, 3 blocks of 3 × 3 × 3 bricks",
        source="Lame, section 142",
        reference=0.8,
        models=sphere,
        measure=_sphere_radial,
        tolerance=1.3e-2,
        exact=is_quadratic,
    ),
]
"""The rows of this family."""

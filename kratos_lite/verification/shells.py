"""Plates and shells of solid elements: MacNeal & Harder's plates and the roof of Scordelis and Lo."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.model.loads.body import BodyForce
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.typing import Array
from kratos_lite.verification.meshes import face_forces, nearest, on_plane, shaped
from kratos_lite.verification.problem import Problem, StaticProblem

PLATE = Isotropic3D(E=1.7472e7, nu=0.3)
THICKNESS, LOAD = 0.01, 1e-4
ROOF = Isotropic3D(E=4.32e8, nu=0.0)


def plate(length: float, clamped: bool, n: int = 8) -> Callable[[str], tuple[Model, ...]]:
    """Return a function: a quarter of a plate 2 × length × 0.01 under uniform load, n × n × 1 bricks."""
    size = (1.0, length / 2, THICKNESS)

    def models(kind: str) -> tuple[Model, ...]:
        mesh = shaped(kind, (n, n, 1), lambda X: X * size)
        model = Model(mesh, PLATE)
        for axis, letter in enumerate("xy"):
            model.fix(on_plane(mesh, axis, 0.0), letter)
            model.fix(on_plane(mesh, axis, size[axis]), "xyz" if clamped else "z", override=True)
        top = on_plane(mesh, 2, THICKNESS)
        model.add(NodalForces(face_forces(mesh, top, lambda X, n: -LOAD * n)))
        return (model,)

    return models


def middle(result: Result) -> float:
    """Return the deflection of the middle."""
    return float(-result.u[nearest(result.mesh, (0, 0, 0)), 2])


def roof(kind: str, n: int = 8) -> tuple[Model, ...]:
    """Return a quarter of the roof: radius 25, length 50, 80° of arc, thickness 0.25, weight 90 per area."""

    def place(X: Array) -> Array:
        angle, r = np.radians(40) * X[:, 0], 25 + 0.25 * (X[:, 2] - 0.5)
        return np.column_stack([r * np.sin(angle), 25 * X[:, 1], r * np.cos(angle)])

    mesh = shaped(kind, (n, n, 1), place)
    model = Model(mesh, ROOF)
    model.fix(on_plane(mesh, 0, 0.0), "x")
    model.fix(on_plane(mesh, 1, 25.0), "y")
    model.fix(on_plane(mesh, 1, 0.0), "xz", override=True)  # the diaphragm at the end
    model.add(BodyForce((0.0, 0.0, -90 / 0.25)))
    return (model,)


def edge(result: Result) -> float:
    """Return how far the free edge sinks at the middle of the roof."""
    angle = np.radians(40)
    return float(-result.u[nearest(result.mesh, (25 * np.sin(angle), 25, 25 * np.cos(angle))), 2])


def _plates() -> list[Problem]:
    cases = (
        ("supported_square", 2.0, False, 4.062e-6), ("clamped_square", 2.0, True, 1.26e-6),
        ("supported_1_to_5", 10.0, False, 12.97e-6), ("clamped_1_to_5", 10.0, True, 2.56e-6),
    )  # fmt: skip
    return [
        StaticProblem(
            name=f"shells/plate_{name}",
            quantity=f"deflection of the middle of a thin plate, {name.replace('_', ' ')}, 8 × 8 × 1 bricks",
            source="MacNeal, rectangular plates",
            reference=value,
            models=plate(length, clamped),
            measure=middle,
        )
        for name, length, clamped, value in cases
    ]


PROBLEMS: list[Problem] = [
    *_plates(),
    StaticProblem(
        name="shells/scordelis_lo",
        quantity="deflection of the free edge of the roof of Scordelis and Lo, 8 × 8 × 1 bricks",
        source="MacNeal, Scordelis-Lo roof",
        reference=0.3024,
        models=roof,
        measure=edge,
    ),
]
"""The rows of this family."""

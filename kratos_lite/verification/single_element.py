"""One brick: uniform states, bending, own weight; rank and inertia of an element."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.bodies import FiniteElementBody
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import box
from kratos_lite.model.loads.surface import Traction
from kratos_lite.typing import Array
from kratos_lite.verification import scenes
from kratos_lite.verification.meshes import (
    COMPLETE,
    element,
    is_quadratic,
    is_stable,
    keeps_linear_strains,
    kind_of,
    warped,
)
from kratos_lite.verification.problem import Problem, displacement_at, models_of

STEEL = Isotropic3D(E=1e6, nu=0.25)
E, NU = STEEL.E, STEEL.nu
ROUND_OFF = 1e-11
"""Relative error of what has to be exact but for rounding."""
STRESSES = {
    "uniaxial": (np.diag([1.0, 0, 0]), 1 / E),
    "shear": (np.array([[0, 1.0, 0], [1, 0, 0], [0, 0, 0]]), (1 + NU) / E),
    "hydrostatic": (np.eye(3), (1 - 2 * NU) / E),
}
"""Unit stresses in Pa, and u_x of the corner (1, 1, 1) of a unit cube in m."""


def under(stress: Array, model: Model) -> Model:
    """Load all faces of a box by a uniform stress, and fix its rigid motions at the corner 0."""
    for axis, normal in zip("xyz", stress, strict=True):
        model.add(Traction(f"{axis}+", normal))
        model.add(Traction(f"{axis}-", -normal))
    for place, axes in (((0.0, 0.0, 0.0), "xyz"), ((1.0, 0.0, 0.0), "yz"), ((0.0, 1.0, 0.0), "z")):
        model.fix(place, axes, uniform(stress)(np.array(place))[["xyz".index(axis) for axis in axes]])
    return model


def uniform(stress: Array) -> Callable[[Array], Array]:
    """Return the field u = ε X of a uniform stress."""
    strain = ((1 + NU) * stress - NU * np.trace(stress) * np.eye(3)) / E
    return lambda X: np.asarray(X @ strain)


def _loaded(stress: Array) -> Callable[[str], Model]:
    return lambda kind: under(stress, Model(box(element=element(kind)), STEEL))


def rank(kind: str) -> float:
    """Return the number of zero-energy modes of one element with all its nodes a little moved."""
    cls = kind_of(kind)
    nodes = cls.shape.nodes
    moved = nodes + 0.03 * np.random.default_rng(11).uniform(-1, 1, nodes.shape)
    values = np.linalg.eigvalsh(cls(moved).stiffness(STEEL.C))
    return float((values < 1e-9 * values[-1]).sum())


def inertia(kind: str) -> float:
    """Return twice the kinetic energy of a turning cube of distorted cells / its exact moment of inertia."""
    body = FiniteElementBody(warped(kind, 2), scenes.SOIL, formulation="corotational")
    body.set_velocity(angular=(0.0, 0.0, 1.0))
    return 2 * float(body.kinetic_energy()) / (scenes.SOIL.density / 6)


def _tip(result: Result) -> float:
    """Return u_y of the end of the bent bar, at its axis, / exact."""
    mesh = result.mesh
    end = np.flatnonzero(np.abs(mesh.points[:, 0] - 4) < 1e-9)
    exact = scenes.bending("8N", 1).exact
    assert exact is not None
    return float(result.u[end, 1].sum() / exact(mesh.points[end])[:, 1].sum())


def _top(result: Result) -> float:
    """Return u_z of that node of the top which is farthest from the exact value."""
    top = result.displacement("z+")[:, 2]
    return float(top[np.argmax(np.abs(top - TOP))])


TOP = -scenes.SOIL.density * 9.81 / (2 * scenes.SOIL.C[0, 0])
PROBLEMS: list[Problem] = [
    Problem("element/rank", "zero-energy modes of one element: its rigid motions and no others",
            "Hughes, chapter 4", 6, None, rank, 0.0, is_stable),
    Problem("element/inertia", "moment of inertia of a cube of distorted cells / (m L²/6), consistent mass",
            "Timoshenko, closed form m (L² + L²)/12", 1, None, inertia, 1e-11),
    *(
        Problem(f"element/{name}",
                f"u_x of the corner (1, 1, 1) of a unit cube, one brick, under unit stress, {name}, m",
                "Hooke", moved, _loaded(stress), displacement_at((1, 1, 1), 0), ROUND_OFF, takes=is_stable)
        for name, (stress, moved) in STRESSES.items()
    ),
    Problem("element/bending",
            "mean deflection of the end / exact, bar 4 × 1 × 1 of four bricks in pure bending",
            "Timoshenko, section 102", 1, models_of(scenes.bending, 1), _tip, ROUND_OFF,
            is_quadratic),
    Problem("element/weight", "u_z of the top of the gravity cube, one brick, at the worst node, m",
            "Timoshenko, closed form -ρ g L²/(2 M)", TOP, models_of(scenes.cube, 1), _top,
            ROUND_OFF, lambda kind: len(kind_of(kind).shape.nodes) > 4 and keeps_linear_strains(kind)),
    Problem("element/weight_warped",
            "u_z of the top of the gravity cube, 2 × 2 × 2 distorted bricks, at the worst node, m",
            "Timoshenko, closed form -ρ g L²/(2 M)", TOP,
            lambda kind: scenes.on_rollers(Model(warped(kind, 2, seed=0), scenes.SOIL)).model,
            _top, ROUND_OFF,
            lambda kind: len(kind_of(kind).shape.nodes) in COMPLETE and keeps_linear_strains(kind)),
]  # fmt: skip
"""The rows of this family."""

"""Patch tests: polynomial fields that a mesh of distorted cells has to reproduce."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.assembly.gauss_point_fields import at_gauss
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.generators import box
from kratos_lite.model.loads.body import BodyForce
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.typing import Array
from kratos_lite.verification.fields import Field, bending
from kratos_lite.verification.meshes import (
    COMPLETE,
    is_quadratic,
    kind_of,
    on_boundary,
    split,
    straight,
    warped,
)
from kratos_lite.verification.problem import Models, Problem
from kratos_lite.verification.single_element import ROUND_OFF, STEEL, under, uniform

STRESS = np.array([[2000.0, 400, 400], [400, 2000, 400], [400, 400, 2000]])
"""Of MacNeal & Harder's field u = 1e-3 (2 x + y + z, x + 2 y + z, x + y + 2 z) / 2, in Pa."""
INNER = [
    (0.249, 0.342, 0.192), (0.826, 0.288, 0.288), (0.850, 0.649, 0.263), (0.273, 0.750, 0.230),
    (0.320, 0.186, 0.643), (0.677, 0.305, 0.683), (0.788, 0.693, 0.644), (0.165, 0.745, 0.702),
]  # fmt: skip
"""Corners of their inner brick."""
linear = uniform(STRESS)
"""Their field."""


class Quadratic:
    """A quadratic field u_i = A_ijk x_j x_k + G_ij x_j, the same at every run."""

    def __init__(self) -> None:
        rng = np.random.default_rng(7)
        A = rng.uniform(-1, 1, (3, 3, 3))
        self.A, self.G = 1e-3 * (A + A.swapaxes(1, 2)) / 2, 1e-3 * rng.uniform(-1, 1, (3, 3))

    def __call__(self, X: Array) -> Array:
        """Return u at places (..., 3)."""
        return np.asarray(np.einsum("ijk,...j,...k->...i", self.A, X, X) + X @ self.G.T)

    def stress(self, X: Array) -> Array:
        """Return the stress (..., 6) in Pa."""
        gradient = 2 * np.einsum("ijk,...k->...ij", self.A, X) + self.G
        return np.asarray(voigt.symmetric_gradient(gradient) @ STEEL.C)

    def body_force(self) -> Array:
        """Return what holds the field in equilibrium, N/m³."""
        lam, mu = STEEL.lame
        laplacian, grad_div = 2 * np.einsum("ijj->i", self.A), 2 * np.einsum("jjk->k", self.A)
        return np.asarray(-(mu * laplacian + (lam + mu) * grad_div))


quadratic = Quadratic()


def seven_bricks(kind: str) -> Mesh:
    """Return the unit cube of MacNeal & Harder: one brick inside six."""
    corners = (Hexahedron8.nodes + 1) / 2
    inner = np.arange(8, 16)
    # a face of the inner brick, seen from outside, is the floor of a brick that grows outward
    outer = [np.concatenate([inner[list(face)], np.array(face)]) for face in Hexahedron8.faces]
    return split(np.vstack([corners, INNER]), np.array([inner, *outer]), kind)


def parallelepipeds(kind: str) -> Mesh:
    """Return 2 × 2 × 2 slanted bricks."""
    A = np.array([[1.0, 0.1, 0.05], [0.2, 0.9, -0.1], [0.1, 0.15, 1.1]])
    return straight(kind, (2, 2, 2), lambda X: X @ A)


def held(mesh: Mesh, field: Field, body_force: Array | None = None, material: Isotropic3D = STEEL) -> Model:
    """Return a model with a field prescribed on its whole boundary."""
    model = Model(mesh, material)
    model.fix(on_boundary(mesh), field=field)
    if body_force is not None:
        model.add(BodyForce(body_force))
    return model


def off(field: Field) -> Callable[[Result], float]:
    """Return a function: the largest error of nodal displacements / the largest displacement."""

    def measure(result: Result) -> float:
        exact = field(result.mesh.points)
        return float(np.abs(result.u - exact).max() / np.abs(exact).max())

    return measure


def stress_off(stress: Callable[[Array], Array]) -> Callable[[Result], float]:
    """Return a function: the largest error of stress at Gauss points / the largest stress."""

    def measure(result: Result) -> float:
        worst, largest = 0.0, 0.0
        for group in result.groups:
            exact = stress(group.at(result.mesh.points).gauss_points())
            computed = at_gauss(result.mesh.points, group, result.u, stress=True)
            worst = max(worst, float(np.abs(computed - exact).max()))
            largest = max(largest, float(np.abs(exact).max()))
        return worst / largest

    return measure


def constant(X: Array) -> Array:
    """Return the stress vector of the linear field everywhere."""
    return np.broadcast_to([2000.0, 2000, 2000, 400, 400, 400], (*X.shape[:-1], 6))


def _linear(mesh: Callable[[str], Mesh]) -> Models:
    return lambda kind: held(mesh(kind), linear)


def _pulled(kind: str) -> Model:
    return under(STRESS, Model(warped(kind, 2, amount=0.24), STEEL))


def _quadratic(mesh: Callable[[str], Mesh]) -> Models:
    return lambda kind: held(mesh(kind), quadratic, quadratic.body_force())


def bent(kind: str) -> Model:
    """Return a bar whose ends are prescribed in pure bending."""
    mesh = box((6, 1, 0.5), (3, 2, 1), kind, origin=(0, -0.5, -0.25))
    model = Model(mesh, STEEL)
    for side in ("x-", "x+"):
        model.fix(side, field=BENT)
    return model


BENT = bending(1e-3, STEEL.nu)
"""The field of the bar."""
U, SIGMA = "largest error of u / largest u", "largest error of σ at Gauss points / largest σ"

_ON_WARPED = _linear(lambda kind: warped(kind, 3, amount=0.24))
_ON_SLANTED = _quadratic(parallelepipeds)


PROBLEMS: list[Problem] = [
    Problem("patch/linear", f"{U}: linear field held on 3 × 3 × 3 distorted bricks", "Irons", 0,
            _ON_WARPED, off(linear), ROUND_OFF),
    Problem("patch/linear_stress", f"{SIGMA}: the same", "Irons", 0,
            _ON_WARPED, stress_off(constant), ROUND_OFF),
    Problem("patch/seven_bricks", f"{U}: linear field held on seven bricks",
            "MacNeal, patch test for solids", 0, _linear(seven_bricks), off(linear), ROUND_OFF,
            takes=lambda kind: kind_of(kind).shape.cell in ("hexahedron", "pyramid")),
    Problem("patch/traction", f"{U}: constant stress by tractions on 2 × 2 × 2 distorted bricks", "Irons", 0,
            _pulled, off(linear), ROUND_OFF),
    Problem("patch/traction_stress", f"{SIGMA}: the same", "Irons", 0,
            _pulled, stress_off(constant), ROUND_OFF),
    Problem("patch/quadratic", f"{U}: quadratic field and body force held on slanted bricks", "Irons", 0,
            _ON_SLANTED, off(quadratic), ROUND_OFF, takes=is_quadratic),
    Problem("patch/quadratic_stress", f"{SIGMA}: the same", "Irons", 0,
            _ON_SLANTED, stress_off(quadratic.stress), ROUND_OFF, takes=is_quadratic),
    Problem("patch/quadratic_moved", f"{U}: quadratic field on 2 × 2 × 2 distorted bricks", "Irons", 0,
            _quadratic(lambda kind: warped(kind, 2)), off(quadratic), ROUND_OFF,
            lambda kind: len(kind_of(kind).shape.nodes) in COMPLETE, is_quadratic),
    Problem("patch/bending", f"{U}: bar with its ends held in pure bending", "Timoshenko, section 102", 0,
            bent, off(BENT), ROUND_OFF, takes=is_quadratic),
]  # fmt: skip
"""The rows of this family."""

"""Concentrations of stress: hole, cavity and corner; and Cook's membrane."""

from __future__ import annotations

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.typing import Array
from kratos_lite.verification import fields, scenes
from kratos_lite.verification.errors import energy_norm
from kratos_lite.verification.meshes import is_quadratic, shaped
from kratos_lite.verification.orders import error_of, order_of
from kratos_lite.verification.problem import Problem, displacement_at, models_of, stress_at
from kratos_lite.verification.scenes import Scene, in_plane_strain, on_symmetry_planes


def hole(kind: str, n: int = 6, nu: float = scenes.UNIT.nu) -> Scene:
    """Return a quarter of a plate 8 × 8 with a hole of radius 1 under tension along x, in plane strain."""

    def place(X: Array) -> Array:
        angle = np.pi / 2 * X[:, 1]
        c, s = np.cos(angle), np.sin(angle)
        far = 4 / np.maximum(c, s)
        r = 1 + (far - 1) * (np.exp(1.2 * X[:, 0]) - 1) / (np.exp(1.2) - 1)
        return np.column_stack([r * c, r * s, 0.5 * X[:, 2]])

    mesh = shaped(kind, (n, 2 * n, 1), place)
    model = Model(mesh, Isotropic3D(E=scenes.UNIT.E, nu=nu))
    exact = fields.hole(scenes.UNIT.E, nu, 1.0, 1.0)
    model.fix(
        lambda X: (np.abs(X[:, :2] - 4) < 1e-9).any(axis=1),
        "xy",
        field=lambda X: np.where(np.abs(X) < 1e-9, 0.0, exact(X))[:, :2],
    )
    on_symmetry_planes(model, "xy")
    in_plane_strain(model)
    return Scene("hole", kind, n, model, exact)


COOK = Isotropic3D(E=1.0, nu=1 / 3)
SOFT = Isotropic3D(E=240.565, nu=0.4999)


_hole, _soft_hole = models_of(hole), models_of(hole, nu=SOFT.nu)
_cavity = models_of(scenes.cavity, 4)
_cook_middle = displacement_at((48, 52, 0), 1, 1 / 100)  # of a unit load: the scene has 100
NU = scenes.UNIT.nu
PROBLEMS: list[Problem] = [
    Problem("concentration/kirsch",
            "σ_xx at the edge (0, 1) of a hole under unit tension, plane strain, 6 × 12 × 1 bricks",
            "Kirsch, closed form", 3.0, _hole, stress_at((0, 1, 0), 0)),
    Problem("concentration/kirsch_field", "relative error of u over the plate with a hole (L2)",
            "Kirsch, closed form", 0.0, _hole, error_of(fields.hole(1.0, NU, 1.0, 1.0)), 1e-3, is_quadratic),
    Problem("concentration/kirsch_incompressible", "σ_xx at the edge of the hole, ν = 0.4999",
            "Kirsch, closed form", 3.0, _soft_hole, stress_at((0, 1, 0), 0)),
    Problem("concentration/kirsch_incompressible_field",
            "relative error of u over the plate with a hole (L2), ν = 0.4999",
            "Kirsch, closed form", 0.0, _soft_hole, error_of(fields.hole(1.0, SOFT.nu, 1.0, 1.0))),
    Problem("concentration/goodier",
            "σ_zz at the equator of a spherical cavity under unit tension, 3 blocks of 4 × 4 × 4 bricks",
            "Goodier, closed form (27 - 15 ν) / (2 (7 - 5 ν))", (27 - 15 * NU) / (2 * (7 - 5 * NU)),
            _cavity, stress_at((1, 0, 0), 2)),
    Problem("concentration/goodier_field", "relative error of u around the cavity (L2)",
            "Goodier, closed form", 0.0, _cavity, error_of(fields.cavity(1.0, NU, 1.0, 1.0)), 2e-3,
            is_quadratic),
    Problem("concentration/corner_order",
            "order of the error in the energy norm at a corner of 270°, from 4 to 8 cells",
            "Williams, λ = 0.544484", fields.EXPONENT,
            lambda kind: tuple(scenes.l_domain(kind, n).model for n in (4, 8)),
            order_of(fields.l_domain(1.0, NU), energy_norm), 0.08),
    Problem("concentration/cook",
            "u_y amid the loaded edge of Cook's membrane, plane stress, 8 × 8 × 1 bricks, unit load",
            "Cook, limit 23.96", 23.96,
            models_of(scenes.cook, 8, COOK, plane_stress=True), _cook_middle),
    Problem("concentration/cook_incompressible",
            "the same in plane strain, E = 240.565, ν = 0.4999, load 100",
            "Cook, with E and ν of Simo and Rifai; limit 7.695 of refined meshes of 20N and 27N", 0.07695,
            models_of(scenes.cook, 8, SOFT), _cook_middle),
]  # fmt: skip
"""The rows of this family."""

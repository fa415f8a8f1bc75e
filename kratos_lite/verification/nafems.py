"""NAFEMS' thick plates: LE10 under pressure, FV52 in vibration."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.elements import KinematicLinear
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import box
from kratos_lite.model.loads.surface import Pressure
from kratos_lite.registry import remembered
from kratos_lite.typing import Array
from kratos_lite.verification.meshes import element, is_quadratic, kind_of, shaped
from kratos_lite.verification.problem import Problem, stress_at
from kratos_lite.verification.scenes import on_symmetry_planes

STEEL = Isotropic3D(E=210e9, nu=0.3)
PLATE = Isotropic3D(E=200e9, nu=0.3, density=8000.0)
FREQUENCIES = (45.897, 109.44, 109.44, 167.89, 193.59, 206.19, 206.19)
"""Hz, of FV52: modes 4 to 10, after three rigid motions in the plane."""


def le10(kind: str) -> Model:
    """Return a quarter of an elliptic plate with an elliptic hole, 0.6 thick, under 1 MPa."""

    def place(X: Array) -> Array:
        angle = np.pi / 2 * X[:, 1]
        c, s = np.cos(angle), np.sin(angle)
        return np.column_stack([(2 + 1.25 * X[:, 0]) * c, (1 + 1.75 * X[:, 0]) * s, 0.6 * X[:, 2]])

    mesh = shaped(kind, (4, 6, 4), place)
    model = Model(mesh, STEEL)
    x, y, z = mesh.points.T
    rim = np.abs((x / 3.25) ** 2 + (y / 2.75) ** 2 - 1) < 1e-6
    on_symmetry_planes(model, "xy")
    model.fix(rim, "xy")
    model.fix(rim & (np.abs(z - 0.3) < 1e-9), "z")
    model.add(Pressure("z+", 1e6))
    return model


def fv52(kind: str) -> Model:
    """Return a plate 10 × 10 × 1 with its lower edges on rollers; 4 × 4 × 1 bricks, 8 × 8 × 3 linear ones."""
    cells = (4, 4, 1) if is_quadratic(kind) else (8, 8, 3)
    mesh = box((10, 10, 1), cells, element(kind))
    model = Model(mesh, PLATE)
    X = mesh.points
    edge = (np.abs(X[:, :2] - 5) > 5 - 1e-9).any(axis=1) & (X[:, 2] < 1e-9)
    model.fix(edge, "z")
    return model


@remembered
def _modes(element_type: type[KinematicLinear]) -> Array:
    """Return ten frequencies of FV52 in Hz; several rows share them."""
    return fv52(element_type.__name__).modes(10)[0] / (2 * np.pi)


def _frequency(number: int) -> Callable[[str], float]:
    return lambda kind: float(_modes(kind_of(kind))[number - 1])


PROBLEMS: list[Problem] = [
    Problem("nafems/le10", "σ_yy at the point D of the thick plate LE10, 6 × 4 × 4 bricks, MPa",
            "NAFEMS, test LE10", -5.38, le10, stress_at((2, 0, 0.6), 1, 1e-6)),
    *(
        Problem(f"nafems/fv52_mode_{number}", f"frequency {number} of FV52, {shape}, Hz",
                "NAFEMS-FV, test FV52", FREQUENCIES[number - 4], None, _frequency(number))
        for number, shape in ((4, "bending"), (5, "bending"), (7, "bending"), (8, "in its plane"))
    ),
]  # fmt: skip
"""The rows of this family."""

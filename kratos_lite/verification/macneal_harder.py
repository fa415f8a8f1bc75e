"""The beams of MacNeal & Harder 1985: straight, curved and twisted, one layer of bricks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.typing import Array, Mask
from kratos_lite.verification.fields import Field
from kratos_lite.verification.meshes import face_forces, on_plane, shaped, straight
from kratos_lite.verification.problem import Problem, StaticProblem

LENGTH, DEPTH, WIDTH = 6.0, 0.2, 0.1
STRAIGHT = Isotropic3D(E=1e7, nu=0.3)
FORMS = ("rectangular", "trapezoidal", "parallelogram")
UNIT_LOADS = {"extension": (1.0, 0, 0), "in_plane": (0, 1.0, 0), "out_of_plane": (0, 0, 1.0)}
TIPS = {"extension": 3.0e-5, "in_plane": 0.1081, "out_of_plane": 0.4321}


def clamped(mesh: Mesh, material: Isotropic3D, root: Mask, tip: Mask, traction: Field) -> Model:
    """Return a clamped beam under a traction on its end."""
    model = Model(mesh, material)
    model.fix(root, "xyz")
    model.add(NodalForces(face_forces(mesh, tip, lambda X, _: traction(X))))
    return model


def work(result: Result) -> float:
    """Return ∫ t · u dA: of a unit load, the mean displacement of the end along it."""
    return float((result.loads * result.u).sum())


def evenly(vector: tuple[float, float, float], area: float) -> Field:
    """Return a traction with a resultant, the same everywhere on a face."""
    return lambda X: np.broadcast_to(np.array(vector) / area, X.shape)


# ---- straight ----------------------------------------------------------------------------------------


def straight_beam(form: str, kind: str) -> Mesh:
    """Return the beam of six bricks whose inner stations are slanted by 45°."""

    def place(X: Array) -> Array:
        station = np.rint(6 * X[:, 0]).astype(int)
        slant = np.where(station % 2 == 1, 1, -1) if form == "trapezoidal" else np.ones(len(X))
        inner = (station > 0) & (station < 6) & (form != "rectangular")
        x = station + inner * slant * np.where(X[:, 1] > 0.5, -0.1, 0.1)
        return np.column_stack([x, DEPTH * X[:, 1], WIDTH * X[:, 2]])

    return straight(kind, (6, 1, 1), place)


def _loaded(form: str, traction: Field) -> Callable[[str], tuple[Model, ...]]:
    def models(kind: str) -> tuple[Model, ...]:
        mesh = straight_beam(form, kind)
        ends = on_plane(mesh, 0, 0.0), on_plane(mesh, 0, LENGTH)
        return (clamped(mesh, STRAIGHT, *ends, traction),)

    return models


def couple(X: Array) -> Array:
    """Return the traction of a unit torque about x on the end: it grows from the axis."""
    polar = DEPTH * WIDTH * (DEPTH**2 + WIDTH**2) / 12
    y, z = X[..., 1] - DEPTH / 2, X[..., 2] - WIDTH / 2
    return np.stack([0 * y, -z, y], axis=-1) / polar


def torsion_constant(a: float, b: float) -> float:
    """Return J of a rectangle a ≥ b; the 0.03208 of MacNeal & Harder is 6 % less."""
    n = np.arange(1, 60, 2)
    return float(
        a * b**3 / 3 * (1 - 192 * b / (np.pi**5 * a) * (np.tanh(n * np.pi * a / (2 * b)) / n**5).sum())
    )


# ---- curved and twisted ------------------------------------------------------------------------------

CURVED = Isotropic3D(E=1e7, nu=0.25)
TWISTED = Isotropic3D(E=29e6, nu=0.22)


def curved_beam(vector: tuple[float, float, float]) -> Callable[[str], tuple[Model, ...]]:
    """Return a function: a quarter of a ring, radii 4.12 and 4.32, width 0.1, of six bricks."""

    def place(X: Array) -> Array:
        angle, r = np.pi / 2 * (1 - X[:, 0]), 4.12 + 0.2 * X[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.1 * X[:, 2]])

    def models(kind: str) -> tuple[Model, ...]:
        mesh = shaped(kind, (6, 1, 1), place)
        ends = on_plane(mesh, 0, 0.0), on_plane(mesh, 1, 0.0)
        return (clamped(mesh, CURVED, *ends, evenly(vector, 0.02)),)

    return models


def twisted_beam(vector: tuple[float, float, float]) -> Callable[[str], tuple[Model, ...]]:
    """Return a function: a beam 12 × 1.1 × 0.32 that turns by 90°, of 12 × 2 × 1 bricks."""

    def place(X: Array) -> Array:
        angle, y, z = np.pi / 2 * X[:, 0], 1.1 * (X[:, 1] - 0.5), 0.32 * (X[:, 2] - 0.5)
        c, s = np.cos(angle), np.sin(angle)
        return np.column_stack([12 * X[:, 0], c * y - s * z, s * y + c * z])

    def models(kind: str) -> tuple[Model, ...]:
        mesh = shaped(kind, (12, 2, 1), place)
        ends = on_plane(mesh, 0, 0.0), on_plane(mesh, 0, 12.0)
        return (clamped(mesh, TWISTED, *ends, evenly(vector, 1.1 * 0.32)),)

    return models


def problem(name: str, quantity: str, source: str, reference: float,
            models: Callable[[str], tuple[Model, ...]]) -> Problem:  # fmt: skip
    """Return a problem that is graded."""
    return StaticProblem(
        name=f"macneal_harder/{name}", quantity=quantity, source=source, reference=reference, models=models,
        measure=work,
    )  # fmt: skip


G = STRAIGHT.E / (2 * (1 + STRAIGHT.nu))
PROBLEMS: list[Problem] = [
    *(
        problem(f"straight_{form}_{load}", f"displacement of the end, {form} cells, {load.replace('_', ' ')}",
                "MacNeal, straight beam", TIPS[load], _loaded(form, evenly(vector, DEPTH * WIDTH)))
        for form in FORMS
        for load, vector in UNIT_LOADS.items()
    ),
    *(
        problem(f"straight_{form}_twist", f"angle of the end under a unit torque, {form} cells, rad",
                "Timoshenko, section 109: L / (G J)", LENGTH / (G * torsion_constant(DEPTH, WIDTH)),
                _loaded(form, couple))
        for form in FORMS
    ),
    problem("curved_in_plane", "displacement of the end, in plane", "MacNeal, curved beam", 0.08734,
            curved_beam((1.0, 0.0, 0.0))),
    problem("curved_out_of_plane", "displacement of the end, out of plane", "MacNeal, curved beam", 0.5022,
            curved_beam((0.0, 0.0, 1.0))),
    problem("twisted_in_plane", "displacement of the end, in plane", "MacNeal, twisted beam", 0.005424,
            twisted_beam((0.0, 0.0, 1.0))),
    problem("twisted_out_of_plane", "displacement of the end, out of plane", "MacNeal, twisted beam",
            0.001754, twisted_beam((0.0, 1.0, 0.0))),
]  # fmt: skip
"""The rows of this family."""

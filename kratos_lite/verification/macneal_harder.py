"""MacNeal & Harder 1985, of solid elements: beams, thin plates, and the roof of Scordelis and Lo."""

from __future__ import annotations

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads.body import BodyForce
from kratos_lite.model.loads.surface import Pressure, Traction
from kratos_lite.typing import Array
from kratos_lite.verification.fields import Field
from kratos_lite.verification.meshes import shaped, straight
from kratos_lite.verification.problem import Models, Problem, displacement_at
from kratos_lite.verification.scenes import on_symmetry_planes

LENGTH, DEPTH, WIDTH = 6.0, 0.2, 0.1
STRAIGHT = Isotropic3D(E=1e7, nu=0.3)
FORMS = ("rectangular", "trapezoidal", "parallelogram")
UNIT_LOADS = {"extension": (1.0, 0, 0), "in_plane": (0, 1.0, 0), "out_of_plane": (0, 0, 1.0)}
TIPS = {"extension": 3.0e-5, "in_plane": 0.1081, "out_of_plane": 0.4321}


def clamped(mesh: Mesh, material: Isotropic3D, tip: str, traction: Field) -> Model:
    """Return a beam clamped at x = 0 under a traction on its end."""
    model = Model(mesh, material)
    model.fix("x-")
    model.add(Traction(tip, traction))
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


def _loaded(form: str, traction: Field) -> Models:
    return lambda kind: clamped(straight_beam(form, kind), STRAIGHT, "x+", traction)


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


def curved_beam(vector: tuple[float, float, float]) -> Models:
    """Return a function: a quarter of a ring, radii 4.12 and 4.32, width 0.1, of six bricks."""

    def place(X: Array) -> Array:
        angle, r = np.pi / 2 * (1 - X[:, 0]), 4.12 + 0.2 * X[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.1 * X[:, 2]])

    return lambda kind: clamped(shaped(kind, (6, 1, 1), place), CURVED, "y-", evenly(vector, 0.02))


def twisted_beam(vector: tuple[float, float, float]) -> Models:
    """Return a function: a beam 12 × 1.1 × 0.32 that turns by 90°, of 12 × 2 × 1 bricks."""

    def place(X: Array) -> Array:
        angle, y, z = np.pi / 2 * X[:, 0], 1.1 * (X[:, 1] - 0.5), 0.32 * (X[:, 2] - 0.5)
        c, s = np.cos(angle), np.sin(angle)
        return np.column_stack([12 * X[:, 0], c * y - s * z, s * y + c * z])

    traction = evenly(vector, 1.1 * 0.32)
    return lambda kind: clamped(shaped(kind, (12, 2, 1), place), TWISTED, "x+", traction)


# ---- plates and shells -------------------------------------------------------------------------------

PLATE = Isotropic3D(E=1.7472e7, nu=0.3)
THICKNESS, LOAD = 0.01, 1e-4
ROOF = Isotropic3D(E=4.32e8, nu=0.0)


def plate(length: float, clamped: bool, n: int = 8) -> Models:
    """Return a function: a quarter of a plate 2 × length × 0.01 under uniform load, n × n × 1 bricks."""
    size = (1.0, length / 2, THICKNESS)

    def models(kind: str) -> Model:
        mesh = shaped(kind, (n, n, 1), lambda X: X * size)
        model = Model(mesh, PLATE)
        on_symmetry_planes(model, "xy")
        for side in ("x+", "y+"):
            model.fix(side, "xyz" if clamped else "z", override=True)
        model.add(Pressure("z+", LOAD))
        return model

    return models


def roof(kind: str, n: int = 8) -> Model:
    """Return a quarter of the roof: radius 25, length 50, 80° of arc, thickness 0.25, weight 90 per area."""

    def place(X: Array) -> Array:
        angle, r = np.radians(40) * X[:, 0], 25 + 0.25 * (X[:, 2] - 0.5)
        return np.column_stack([r * np.sin(angle), 25 * X[:, 1], r * np.cos(angle)])

    mesh = shaped(kind, (n, n, 1), place)
    model = Model(mesh, ROOF)
    model.fix("x-", "x")
    model.fix("y+", "y")
    model.fix("y-", "xz", override=True)  # the diaphragm at the end
    model.add(BodyForce((0.0, 0.0, -90 / 0.25)))
    return model


middle = displacement_at((0, 0, 0), 2, -1.0)
free_edge = displacement_at((25 * np.sin(np.radians(40)), 25, 25 * np.cos(np.radians(40))), 2, -1.0)
G = STRAIGHT.E / (2 * (1 + STRAIGHT.nu))
FAMILY, END = "macneal_harder", "displacement of the end"
PROBLEMS: list[Problem] = [
    *(
        Problem(f"{FAMILY}/straight_{form}_{load}", f"{END}, {form} cells, {load.replace('_', ' ')}",
                "MacNeal, straight beam", TIPS[load], _loaded(form, evenly(vector, DEPTH * WIDTH)), work)
        for form in FORMS
        for load, vector in UNIT_LOADS.items()
    ),
    *(
        Problem(f"{FAMILY}/straight_{form}_twist", f"angle of the end under a unit torque, {form} cells, rad",
                "Timoshenko, section 109: L / (G J)", LENGTH / (G * torsion_constant(DEPTH, WIDTH)),
                _loaded(form, couple), work)
        for form in FORMS
    ),
    *(
        Problem(f"{FAMILY}/{name}_{plane}", f"{END}, {plane.replace('_', ' ')}", f"MacNeal, {name} beam",
                reference, models, work)
        for name, plane, reference, models in (
            ("curved", "in_plane", 0.08734, curved_beam((1.0, 0.0, 0.0))),
            ("curved", "out_of_plane", 0.5022, curved_beam((0.0, 0.0, 1.0))),
            ("twisted", "in_plane", 0.005424, twisted_beam((0.0, 0.0, 1.0))),
            ("twisted", "out_of_plane", 0.001754, twisted_beam((0.0, 1.0, 0.0))),
        )
    ),
    *(
        Problem(f"shells/plate_{name}",
                f"deflection of the middle of a thin plate, {name.replace('_', ' ')}, 8 × 8 × 1 bricks",
                "MacNeal, rectangular plates", reference, plate(length, clamped), middle)
        for name, length, clamped, reference in (
            ("supported_square", 2.0, False, 4.062e-6),
            ("clamped_square", 2.0, True, 1.26e-6),
            ("supported_1_to_5", 10.0, False, 12.97e-6),
            ("clamped_1_to_5", 10.0, True, 2.56e-6),
        )
    ),
    Problem("shells/scordelis_lo",
            "deflection of the free edge of the roof of Scordelis and Lo, 8 × 8 × 1 bricks",
            "MacNeal, Scordelis-Lo roof", 0.3024, roof, free_edge),
]  # fmt: skip
"""The rows of both families."""

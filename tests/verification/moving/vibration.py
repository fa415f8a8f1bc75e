"""Natural frequencies of bodies whose modes are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import box
from kratos_lite.typing import Array
from kratos_lite.verification import scenes
from kratos_lite.verification.meshes import element, is_quadratic, on_plane
from kratos_lite.verification.problem import Problem

SOLID = Isotropic3D(E=1.0, nu=0.3, density=1.0)
BEAM = Isotropic3D(E=1e6, nu=0.0, density=1000.0)
LENGTH, DEPTH = 10.0, 0.2


def column(kind: str, cells: int = 4) -> Model:
    """Return a column 0.25 × 0.25 × 1 on rollers, its top free: it strains along z alone."""
    model = Model(box((0.25, 0.25, 1), (1, 1, cells), element(kind)), scenes.SOIL)
    for axis, letter in enumerate("xy"):
        model.fix(on_plane(model.mesh, axis, 0.0) | on_plane(model.mesh, axis, 0.25), letter)
    model.fix("z-", "z")
    return model


def axial(number: int) -> Callable[[str], float]:
    """Return a function: an axial frequency of the column / (2 n - 1) π/2 √(M / ρ)."""

    def of(kind: str) -> float:
        model = column(kind)
        omega, shapes = model.modes(12 if is_quadratic(kind) else 4)
        exact = (number - 0.5) * np.pi
        wanted = np.zeros(shapes.shape[1:])
        wanted[:, 2] = np.sin(exact * model.mesh.points[:, 2])
        speed = np.sqrt(scenes.SOIL.C[0, 0] / scenes.SOIL.density)
        return float(omega[_nearest(shapes, [wanted])] / (exact * speed))

    return of


def _nearest(shapes: Array, wanted: list[Array]) -> int:
    """Return the lowest of the modes that lie in the space of some shapes (n, 3) rather than beside it."""
    basis, _ = np.linalg.qr(np.stack([w.ravel() for w in wanted], axis=1))
    flat = shapes.reshape(len(shapes), -1)
    share = ((flat @ basis) ** 2).sum(axis=1) / (flat**2).sum(axis=1)
    return int(np.flatnonzero(share > 0.5 * share.max())[0])


def equivoluminal(kind: str) -> float:
    """Return the frequency of Lamé's mode of a free cube / π √(2 μ / ρ) / L, 3 × 3 × 3 bricks."""
    model = Model(box(cells=(3, 3, 3), element=element(kind)), SOLID)
    omega, shapes = model.modes(30)
    X = np.pi * model.mesh.points
    wanted = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        u = np.zeros_like(X)
        u[:, i], u[:, j] = np.cos(X[:, i]) * np.sin(X[:, j]), -np.sin(X[:, i]) * np.cos(X[:, j])
        wanted.append(u)
    return float(omega[_nearest(shapes, wanted)] / (np.pi * np.sqrt(2 * SOLID.lame[1])))


def rigid_motions(kind: str) -> float:
    """Return the number of frequencies of a free cube that are zero beside the first that is not."""
    omega, _ = Model(box(cells=(2, 2, 2), element=element(kind)), SOLID).modes(10)
    return float((omega < 1e-4 * omega[-1]).sum())


def cantilever(kind: str) -> float:
    """Return the first frequency of a slender cantilever of ten bricks / that of Bernoulli's beam."""
    model = Model(box((LENGTH, DEPTH, DEPTH), (10, 1, 1), element(kind)), BEAM)
    model.fix("x-")
    beam = 1.8751040687**2 * np.sqrt(BEAM.E * DEPTH**2 / 12 / BEAM.density) / LENGTH**2
    return float(model.modes(1)[0][0] / beam)


PROBLEMS: list[Problem] = [
    Problem(
        name="vibration/rigid_motions",
        quantity="zero frequencies of a free cube of 2 × 2 × 2 bricks",
        source="Hughes, chapter 7: six rigid motions",
        reference=6,
        of=rigid_motions,
        tolerance=0.0,
    ),
    *(
        Problem(
            name=f"vibration/column_{number}",
            quantity=f"axial frequency {number} of a column of four bricks / exact",
            source=f"Rayleigh, closed form {2 * number - 1} π/2 √(M/ρ)/L",
            reference=1,
            of=axial(number),
        )
        for number in (1, 2)
    ),
    Problem(
        name="vibration/lame_mode",
        quantity="frequency of the mode without change of volume of a free cube, 3 × 3 × 3 bricks / exact",
        source="Lame: π √(2 μ/ρ)/L",
        reference=1,
        of=equivoluminal,
    ),
    Problem(
        name="vibration/cantilever",
        quantity="first frequency of a slender cantilever of ten bricks, L / h = 50 / that of the beam",
        source="Rayleigh, 1.8751² √(E I / (ρ A)) / L²",
        reference=1,
        of=cantilever,
    ),
]
"""The rows of this family."""

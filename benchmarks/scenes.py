"""The scenes: a mesh, supports, loads and what is exact, for any element kind and size.

Every program gets the same discrete problem: nodes, elements, fixed components and nodal forces.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

import kratos_lite as kl
from benchmarks.cases import write_for_kratos
from benchmarks.hard_scenes import MAKERS, system, weighty
from benchmarks.programs import ALL, FORMULATIONS
from kratos_lite.typing import Array
from kratos_lite.verification import scenes as shared
from kratos_lite.verification.concentrations import hole
from kratos_lite.verification.meshes import element, joined, shaped
from kratos_lite.verification.pressure import lame_cylinder
from kratos_lite.verification.scenes import UNIT, Scene

KINDS = (*ALL, *FORMULATIONS)
SOLID = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)


def stem(name: str, kind: str, n: int) -> str:
    """Return the name of the files of a scene.

    >>> stem("cook", "8N enhanced", 4)
    'cook_8N_enhanced_4'
    """
    return f"{name}_{kind}_{n}".replace(" ", "_")


def write(scene: Scene, folder: Path) -> Path:
    """Write a problem as `.mdpa` and as `.npz`; return the path without ending."""
    path = folder / stem(scene.name, scene.kind, scene.n)
    (block,) = scene.model.mesh.blocks
    supports, material = scene.model.supports, scene.model.element_groups()[0].material
    scaled = scene.model.stiffness_factors is not None
    np.savez(
        f"{path}.npz",
        points=scene.model.mesh.points,
        nodes=block.nodes,
        element=block.name,
        vtk_order=np.array(block.shape.to_vtk),
        fixed=supports.fixed,
        values=supports.values,
        forces=scene.forces(),
        elasticity=np.array([material.E, material.nu]),
        factors=scene.model.stiffness_factors if scaled else [],
    )
    if not scaled:
        write_for_kratos(Path(f"{path}.mdpa"), scene.model)
    return path


def write_system(scene: Scene, folder: Path) -> Path:
    """Write the linear system of a scene as `.npz`; return the path without ending."""
    path = folder / stem(scene.name, scene.kind, scene.n)
    np.savez(f"{path}.npz", **system(scene))
    return path


def cylinder(kind: str, n: int) -> Scene:
    """Return a quarter of a thick cylinder, radii 1 and 3, under inner pressure in plane strain."""

    def place(X: Array) -> Array:
        r, angle = 1 + 2 * X[:, 0], np.pi / 2 * X[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.5 * X[:, 2]])

    def exact(X: Array) -> Array:
        r = np.linalg.norm(X[..., :2], axis=-1, keepdims=True)
        flat = lame_cylinder(UNIT.nu, UNIT.E, 1.0, 3.0, r) * X[..., :2] / r
        return np.concatenate([flat, 0.0 * r], axis=-1)

    mesh = shaped(kind, (n, n, 1), place)
    model = kl.Model(mesh, UNIT)
    shared.on_symmetry_planes(model, "xy")
    shared.in_plane_strain(model)
    model.add(kl.Pressure(np.abs(np.linalg.norm(mesh.points[:, :2], axis=1) - 1) < 1e-9, 1.0))
    return Scene("cylinder", kind, n, model, exact)


def block(kind: str, n: int) -> kl.Model:
    """Return the unit block of n³ cells, clamped at its bottom, under gravity in three directions."""
    return weighty(kl.box(cells=(n, n, n), element=element(kind)), material=SOLID)


def simp(kind: str, n: int) -> kl.Model:
    """Return a cantilever whose cells have random densities ρ and the stiffness 1e-3 + (1 - 1e-3) ρ³.

    It is the structural mesh of mosaic (Pasteur Labs) as torch-fem's benchmarks have it: 2n × n × n cells in
    rows along z, then y, then x; the softest is 762 times softer than the stiffest.
    """
    mesh = kl.box((2, 1, 1), cells=(2 * n, n, n), element=element(kind))
    model = kl.Model(mesh, kl.Isotropic3D(E=70e3, nu=0.3))
    density = np.zeros(mesh.n_elements)
    centers = mesh.points[mesh.blocks[0].nodes].mean(axis=1).round(9)
    random = np.random.default_rng(0).standard_normal(len(centers))
    density[np.lexsort(centers.T[::-1])] = np.clip(0.5 + 0.3 * random, 0.05, 0.95)
    model.scale_stiffness(1e-3 + (1 - 1e-3) * density**3)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1)))
    return model


# ---- scenes for what can be skipped ------------------------------------------------------------------


def two_bodies(kind: str, n: int, loaded: int = 2) -> kl.Model:
    """Return two clamped blocks apart from each other, of which the first or both carry a load."""
    mesh = joined([kl.box(cells=(n, n, n), element=element(kind), origin=(2.0 * i, 0, 0)) for i in range(2)])
    model = kl.Model(mesh, SOLID)
    model.fix("z-")
    model.add(kl.Traction(lambda X: (X[:, 2] == 1) & (X[:, 0] < 1.5 * loaded), (1e3, 0.0, -1e3)))
    return model


def unloaded(kind: str, n: int) -> kl.Model:
    """Return the clamped block without any load."""
    model = block(kind, n)
    model.loads.clear()
    return model


def unreferenced(kind: str, n: int) -> kl.Model:
    """Return the clamped block with as many nodes again that belong to no element."""
    mesh = kl.box(cells=(n, n, n), element=element(kind))
    return weighty(kl.Mesh(np.vstack([mesh.points, mesh.points + 5.0]), mesh.blocks), material=SOLID)


def warped(kind: str, n: int) -> kl.Model:
    """Return the clamped block with its inner nodes moved, so that no Jacobian is constant."""
    mesh = kl.box(cells=(n, n, n), element=element(kind))
    X = mesh.points
    points = X + 0.1 / n * (np.sin(7 * np.pi * X) * np.sin(5 * np.pi * X[:, [1, 2, 0]]))
    return weighty(kl.Mesh(points, mesh.blocks), material=SOLID)


def held(kind: str, n: int) -> kl.Model:
    """Return the block with all nodes of its lower half constrained."""
    model = block(kind, n)
    model.fix(model.mesh.points[:, 2] < 0.5 + 1e-9)
    return model


ENERGIES = {"cook": 457.481, "cantilever": 0.215581, "block": 6.8668}
"""J, of the exact solutions, good to 1e-4: from ``python -m benchmarks references`` (27N, extrapolated)."""
SCENES: dict[str, Callable[[str, int], Scene | kl.Model]] = {
    made.__name__: made
    for made in (
        shared.manufactured, shared.sphere, shared.bending, shared.cook, shared.l_domain, shared.cavity,
        shared.cantilever, shared.cube,
        hole, cylinder, block, simp, two_bodies, unloaded, unreferenced, warped, held,
    )
} | {
    "hole_incompressible": partial(hole, nu=0.4999),
    "half_unloaded": partial(two_bodies, loaded=1),  # one of the two need not be solved
    **MAKERS,
}  # fmt: skip
"""Every scene by name."""


def make(name: str, kind: str, n: int) -> Scene:
    """Return a scene by name, element kind and size."""
    made = SCENES[name](FORMULATIONS.get(kind, kind), n)
    model, exact = (made.model, made.exact) if isinstance(made, Scene) else (made, None)
    return Scene(name, kind, n, model, exact, ENERGIES.get(name))

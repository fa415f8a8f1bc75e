"""The scenes: a mesh, supports, loads and what is exact, for any element kind and size.

Every program gets the same discrete problem: nodes, elements, fixed components and nodal forces.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import kratos_lite as kl
from benchmarks.cases import write_for_kratos
from benchmarks.hard_scenes import HARD, write_system
from benchmarks.programs import ALL, FORMULATIONS
from kratos_lite.verification import concentrations
from kratos_lite.verification import scenes as shared
from kratos_lite.verification.meshes import element, joined, on_plane
from kratos_lite.verification.scenes import Scene, bending, cavity, cube, l_domain, manufactured, sphere

KINDS = (*ALL, *FORMULATIONS)


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
    )
    write_for_kratos(Path(f"{path}.mdpa"), scene.model)
    return path


def cook(kind: str, n: int) -> Scene:
    """Return Cook's membrane in plane strain, with its energy."""
    return replace(shared.cook(kind, n), energy=ENERGIES["cook"])


def cantilever(kind: str, n: int) -> Scene:
    """Return the cantilever of MacNeal & Harder, with its energy."""
    return replace(shared.cantilever(kind, n), energy=ENERGIES["cantilever"])


def hole_incompressible(kind: str, n: int) -> Scene:
    """Return the plate with a hole, nearly incompressible."""
    return replace(concentrations.hole(kind, n, nu=0.4999), name="hole_incompressible")


def block(kind: str, n: int) -> Scene:
    """Return the unit block of n³ cells, clamped at its bottom, under gravity in three directions."""
    model = kl.Model(
        kl.box(cells=(n, n, n), element=element(kind)), kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
    )
    model.fix("z-")
    model.add(kl.Gravity((3.0, 2.0, -9.81)))
    return Scene("block", kind, n, model, energy=ENERGIES["block"])


# ---- scenes for what can be skipped ------------------------------------------------------------------


def _two(name: str, kind: str, n: int, loaded: int) -> Scene:
    """Return two clamped blocks apart from each other, of which the first or both carry a load."""
    mesh = joined([kl.box(cells=(n, n, n), element=element(kind), origin=(2.0 * i, 0, 0)) for i in range(2)])
    model = kl.Model(mesh, kl.Isotropic3D(E=210e6, nu=0.3))
    model.fix("z-")
    model.add(kl.Traction(on_plane(mesh, 2, 1.0) & (mesh.points[:, 0] < 1.5 * loaded), (1e3, 0.0, -1e3)))
    return Scene(name, kind, n, model)


def two_bodies(kind: str, n: int) -> Scene:
    """Return two clamped blocks apart from each other, both loaded."""
    return _two("two_bodies", kind, n, 2)


def half_unloaded(kind: str, n: int) -> Scene:
    """Return the same with one of them unloaded: it need not be solved."""
    return _two("half_unloaded", kind, n, 1)


def unloaded(kind: str, n: int) -> Scene:
    """Return the clamped block without any load."""
    loaded = block(kind, n)
    loaded.model.loads.clear()
    return Scene("unloaded", kind, n, loaded.model)


def unreferenced(kind: str, n: int) -> Scene:
    """Return the clamped block with as many nodes again that belong to no element."""
    mesh = kl.box(cells=(n, n, n), element=element(kind))
    more = kl.Mesh(np.vstack([mesh.points, mesh.points + 5.0]), mesh.blocks)
    model = kl.Model(more, kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0))
    model.fix(on_plane(more, 2, 0.0))
    model.add(kl.Gravity((3.0, 2.0, -9.81)))
    return Scene("unreferenced", kind, n, model)


def warped(kind: str, n: int) -> Scene:
    """Return the clamped block with its inner nodes moved, so that no Jacobian is constant."""
    plain = block(kind, n).model
    X = plain.mesh.points
    points = X + 0.1 / n * (np.sin(7 * np.pi * X) * np.sin(5 * np.pi * X[:, [1, 2, 0]]))
    model = kl.Model(kl.Mesh(points, plain.mesh.blocks), kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0))
    model.fix(on_plane(model.mesh, 2, 0.0))
    model.add(kl.Gravity((3.0, 2.0, -9.81)))
    return Scene("warped", kind, n, model)


def held(kind: str, n: int) -> Scene:
    """Return the block with all nodes of its lower half held."""
    model = block(kind, n).model
    model.fix(model.mesh.points[:, 2] < 0.5 + 1e-9)
    return Scene("held", kind, n, model)


ENERGIES: dict[str, float | None] = {"cook": 457.481, "cantilever": 0.215581, "block": 6.8668}
"""J, of the exact solutions, good to 1e-4: from ``python -m benchmarks references`` (27N, extrapolated)."""
SCENES: dict[str, Callable[[str, int], Scene]] = {
    made.__name__: made
    for made in (
        manufactured, sphere, bending, cook, l_domain, cavity, hole_incompressible, cantilever, block, cube,
        two_bodies, half_unloaded, unloaded, unreferenced, warped, held,
    )
} | HARD  # fmt: skip
"""Every scene by name."""


def make(name: str, kind: str, n: int) -> Scene:
    """Return a scene by name, element kind and size."""
    return replace(SCENES[name](FORMULATIONS.get(kind, kind), n), kind=kind)


if __name__ == "__main__":  # a process of its own, so that large scenes leave no memory behind
    name, kind, n, folder, task = sys.argv[1:]
    scene = make(name, kind, int(n))
    if task == "linear":
        write_system(scene, Path(folder) / f"{stem(name, kind, int(n))}.npz")
    else:
        write(scene, Path(folder))

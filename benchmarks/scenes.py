"""The scenes: a mesh, supports, loads and what is exact, for any element kind and size.

Every program gets the same discrete problem: nodes, elements, fixed components and nodal forces.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import kratos_lite as kl
from benchmarks import fields
from benchmarks.meshes import body_forces, element, face_forces, merged, octant, on_plane, split
from kratos_lite.analysis.static import external_loads

Array = NDArray[np.float64]
KINDS = ("4N", "8N", "10N", "20N", "27N")


@dataclass
class Scene:
    """One discrete problem and what is known about its solution.

    Attributes
    ----------
    name, kind, n : which scene, element kind such as ``8N``, and cells along an edge.
    model : mesh, material, supports and loads.
    exact : the exact field, or None.
    energy : J, the energy of the exact solution, or None; stands in where no field is known.
    straight : every edge is straight, with its middle node in the middle.
    """

    name: str
    kind: str
    n: int
    model: kl.Model
    exact: fields.Field | None = None
    energy: float | None = None
    straight: bool = True

    def forces(self) -> Array:
        """Return the nodal forces (n, 3) in N of all loads."""
        return external_loads(self.model.mesh, self.model.element_groups(), self.model.loads)

    def write(self, folder: Path) -> Path:
        """Write the problem as `.mdpa` and as `.npz`; return the path without ending."""
        stem = folder / f"{self.name}_{self.kind}_{self.n}"
        (block,) = self.model.mesh.blocks
        supports, material = self.model.supports, self.model.element_groups()[0].material
        np.savez(
            f"{stem}.npz",
            points=self.model.mesh.points,
            nodes=block.nodes,
            vtk_order=np.array(block.shape.to_vtk),
            fixed=supports.fixed,
            values=supports.values,
            forces=self.forces(),
            elasticity=np.array([material.E, material.nu]),
        )
        block.name = f"SmallDisplacementElement3D{self.kind}"
        kl.write(f"{stem}.mdpa", self.model)
        return stem


def manufactured(kind: str, n: int) -> Scene:
    """S2: manufactured solution on the unit cube, all sides held at their exact displacement."""
    E, nu = 1.0, 0.3
    mesh = kl.box(cells=(n, n, n), element=element(kind))
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=nu))
    side = (np.abs(mesh.points - 0.5) > 0.5 - 1e-9).any(axis=1)
    model.fix(side, "xyz", fields.manufactured(mesh.points[side]))
    model.add(kl.NodalForces(body_forces(mesh, lambda X: fields.manufactured_force(X, E, nu))))
    return Scene("manufactured", kind, n, model, fields.manufactured)


def sphere(kind: str, n: int) -> Scene:
    """S3: an eighth of a hollow sphere, radii 1 and 2, under inner pressure."""
    E, nu = 1.0, 0.3
    linear = kind in ("4N", "8N")
    mesh = octant(n, kind, lambda X: 2 * X / np.linalg.norm(X, axis=1, keepdims=True), linear)
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=nu))
    for axis, letter in enumerate("xyz"):
        model.fix(on_plane(mesh, axis, 0.0), letter)
    model.add(kl.Pressure(np.abs(np.linalg.norm(mesh.points, axis=1) - 1) < 1e-9, 1.0))
    exact = fields.hollow_sphere(E, nu, 1.0, 2.0, 1.0)
    return Scene("sphere", kind, n, model, exact, straight=linear)


def bending(kind: str, n: int) -> Scene:
    """S5: a bar 4 × 1 × 1 in pure bending: its root held exactly, σ_xx = E k y on its end."""
    E, nu, k = 1.0, 0.3, 0.01
    mesh = kl.box((4, 1, 1), (4 * n, n, n), element(kind), origin=(0, -0.5, -0.5))
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=nu))
    exact, root, end = fields.bending(k, nu), on_plane(mesh, 0, 0.0), on_plane(mesh, 0, 4.0)
    model.fix(root, "xyz", exact(mesh.points[root]))
    model.add(kl.NodalForces(face_forces(mesh, end, lambda X: E * k * X[..., 1:2] * np.eye(3)[0])))
    return Scene("bending", kind, n, model, exact)


def cook(kind: str, n: int) -> Scene:
    """S6: Cook's membrane in plane strain, 100 N in shear on its right edge; one layer of thickness 1."""
    grid = kl.box(cells=(n, n, 1))
    s, t, z = grid.points.T
    low, high = 44 * s, 44 + 16 * s
    mesh = split(np.column_stack([48 * s, low + (high - low) * t, z]), grid.blocks[0].nodes, kind)
    model = kl.Model(mesh, kl.Isotropic3D(E=240.565, nu=0.3))
    model.fix(on_plane(mesh, 0, 0.0), "xy")
    model.fix(on_plane(mesh, 2, 0.0) | on_plane(mesh, 2, 1.0), "z")
    model.add(kl.Traction(on_plane(mesh, 0, 48.0), (0.0, 100 / 16, 0.0)))
    return Scene("cook", kind, n, model, energy=ENERGIES["cook"])


def l_domain(kind: str, n: int) -> Scene:
    """S7: an L in plane strain; its outer sides held at the exact displacement, singular at its corner."""
    E, nu = 1.0, 0.3
    quarters = [kl.box((1, 1, 0.5), (n, n, 1), origin=at) for at in ((0, 0, 0), (-1, 0, 0), (0, -1, 0))]
    mesh = split(*merged([(q.points, q.blocks[0].nodes) for q in quarters]), kind)
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=nu))
    exact = fields.l_domain(E, nu)
    outer = (np.abs(np.abs(mesh.points[:, :2]) - 1) < 1e-9).any(axis=1)
    model.fix(outer, "xy", exact(mesh.points[outer])[:, :2])
    model.fix(on_plane(mesh, 2, 0.0) | on_plane(mesh, 2, 0.5), "z")
    return Scene("l_domain", kind, n, model, exact)


def cavity(kind: str, n: int) -> Scene:
    """S8: a spherical cavity of radius 1 in a cube of half edge 3 under tension; an eighth of it."""
    E, nu = 1.0, 0.3
    linear = kind in ("4N", "8N")
    mesh = octant(n, kind, lambda X: 3 * X / np.abs(X).max(axis=1, keepdims=True), linear)
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=nu))
    exact = fields.cavity(E, nu, 1.0, 1.0)
    outer = (np.abs(mesh.points - 3) < 1e-9).any(axis=1)
    model.fix(outer, "xyz", np.where(np.abs(mesh.points[outer]) < 1e-9, 0.0, exact(mesh.points[outer])))
    for axis, letter in enumerate("xyz"):
        model.fix(on_plane(mesh, axis, 0.0), letter)
    return Scene("cavity", kind, n, model, exact, straight=linear)


def cantilever(kind: str, n: int) -> Scene:
    """S10: the straight cantilever of MacNeal & Harder, 6 × 0.2 × 0.1, unit force along z on its end."""
    mesh = kl.box((6, 0.2, 0.1), (6 * n, n, n), element(kind))
    model = kl.Model(mesh, kl.Isotropic3D(E=1e7, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (0.0, 0.0, 50.0)))
    return Scene("cantilever", kind, n, model, energy=ENERGIES["cantilever"])


def block(kind: str, n: int) -> Scene:
    """Return the unit block of n³ cells, clamped at its bottom, under gravity in three directions."""
    model = kl.Model(
        kl.box(cells=(n, n, n), element=element(kind)), kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
    )
    model.fix("z-")
    model.add(kl.Gravity((3.0, 2.0, -9.81)))
    return Scene("block", kind, n, model, energy=ENERGIES["block"])


def cube(kind: str, n: int) -> Scene:
    """S1: the gravity cube on rollers; its load is one-dimensional, so it cannot rank solvers."""
    E, nu, density, g = 210e6, 0.3, 7620.0, 9.81
    mesh = kl.box(cells=(n, n, n), element=element(kind))
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=nu, density=density))
    for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Gravity((0.0, 0.0, -g)))
    modulus = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))

    def exact(X: Array) -> Array:
        z = X[..., 2:]
        return np.eye(3)[2] * (-density * g * (z - z**2 / 2) / modulus)

    return Scene("cube", kind, n, model, exact)


# ---- scenes for what can be skipped ------------------------------------------------------------------


def _two(name: str, kind: str, n: int, loaded: int) -> Scene:
    """Return two clamped blocks apart from each other, of which the first or both carry a load."""
    halves = [kl.box(cells=(n, n, n), origin=(2.0 * i, 0, 0)) for i in range(2)]
    mesh = split(*merged([(half.points, half.blocks[0].nodes) for half in halves]), kind)
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
        manufactured, sphere, bending, cook, l_domain, cavity, cantilever, block, cube,
        two_bodies, half_unloaded, unloaded, unreferenced, warped, held,
    )
}  # fmt: skip
"""Every scene by name."""


def make(name: str, kind: str, n: int) -> Scene:
    """Return a scene by name, element kind and size."""
    return SCENES[name](kind, n)


if __name__ == "__main__":  # a process of its own, so that large scenes leave no memory behind
    make(sys.argv[1], sys.argv[2], int(sys.argv[3])).write(Path(sys.argv[4]))

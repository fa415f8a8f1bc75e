"""Models with a known solution, for any element and size; tests, benchmarks and `verify` share them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.nodal_loads import external_loads
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import box
from kratos_lite.model.loads.body import BodyForce, Gravity
from kratos_lite.model.loads.surface import Pressure, Traction
from kratos_lite.typing import Array
from kratos_lite.verification import fields
from kratos_lite.verification.meshes import element, joined, octant, on_boundary, straight

UNIT = Isotropic3D(E=1.0, nu=0.3)
"""Of the scenes whose solution does not depend on E."""
SOIL = Isotropic3D(E=210e6, nu=0.3, density=7620.0)


def on_symmetry_planes(model: Model, axes: str) -> None:
    """Fix the lower side along each of some axes in the direction of that axis."""
    for axis in axes:
        model.fix(f"{axis}-", axis)


def in_plane_strain(model: Model) -> None:
    """Fix both sides normal to z in that direction."""
    model.fix("z-", "z")
    model.fix("z+", "z")


@dataclass
class Scene:
    """One discrete problem and what is known about its solution."""

    name: str
    kind: str  # of elements, such as 8N
    n: int  # cells along an edge
    model: Model
    exact: fields.Field | None = None
    energy: float | None = None  # J of the exact solution, where no field is known

    def forces(self) -> Array:
        """Return the nodal forces (n, 3) in N of all loads."""
        return external_loads(self.model, self.model.element_groups(), self.model.loads)


def manufactured(kind: str, n: int, distortion: float = 0.0) -> Scene:
    """Return the manufactured solution on the unit cube, all sides prescribed; inner corners moved."""

    def place(X: Array) -> Array:
        return X + distortion * np.prod(np.sin(np.pi * X), axis=1)[:, None] * (1, -0.7, 0.5)

    mesh = straight(kind, (n, n, n), place)
    model = Model(mesh, UNIT)
    model.fix(on_boundary(mesh), field=fields.manufactured)
    model.add(BodyForce(lambda X: fields.manufactured_force(X, UNIT.E, UNIT.nu)))
    return Scene("manufactured", kind, n, model, fields.manufactured)


def sphere(kind: str, n: int) -> Scene:
    """Return an eighth of a hollow sphere, radii 1 and 2, under inner pressure."""
    mesh = octant(n, kind, lambda X: 2 * X / np.linalg.norm(X, axis=1, keepdims=True))
    model = Model(mesh, UNIT)
    on_symmetry_planes(model, "xyz")
    model.add(Pressure(np.abs(np.linalg.norm(mesh.points, axis=1) - 1) < 1e-9, 1.0))
    return Scene("sphere", kind, n, model, fields.hollow_sphere(UNIT.E, UNIT.nu, 1.0, 2.0, 1.0))


def bending(kind: str, n: int) -> Scene:
    """Return a bar 4 × 1 × 1 in pure bending: its root as in the exact field, σ_xx = E k y on its end."""
    k = 0.01
    mesh = box((4, 1, 1), (4 * n, n, n), element(kind), origin=(0, -0.5, -0.5))
    model = Model(mesh, UNIT)
    exact = fields.bending(k, UNIT.nu)
    model.fix("x-", field=exact)
    model.add(Traction("x+", lambda X: UNIT.E * k * X[:, 1:2] * np.eye(3)[0]))
    return Scene("bending", kind, n, model, exact)


def cook(kind: str, n: int, material: Isotropic3D | None = None, plane_stress: bool = False) -> Scene:
    """Return Cook's membrane, 100 N in shear on its right edge; one layer of thickness 1."""

    def place(X: Array) -> Array:
        s, t, z = X.T
        low, high = 44 * s, 44 + 16 * s
        return np.column_stack([48 * s, low + (high - low) * t, z])

    mesh = straight(kind, (n, n, 1), place)
    model = Model(mesh, material or Isotropic3D(E=240.565, nu=0.3))
    model.fix("x-", "xy")
    for side in ("z-",) if plane_stress else ("z-", "z+"):
        model.fix(side, "z")
    model.add(Traction("x+", (0.0, 100 / 16, 0.0)))
    return Scene("cook", kind, n, model)


def l_domain(kind: str, n: int) -> Scene:
    """Return an L in plane strain, the exact displacement prescribed on its outer sides."""
    corners = ((0, 0, 0), (-1, 0, 0), (0, -1, 0))
    mesh = joined([box((1, 1, 0.5), (n, n, 1), element(kind), origin=at) for at in corners])
    model = Model(mesh, UNIT)
    exact = fields.l_domain(UNIT.E, UNIT.nu)
    model.fix(
        lambda X: (np.abs(np.abs(X[:, :2]) - 1) < 1e-9).any(axis=1), "xy", field=lambda X: exact(X)[:, :2]
    )
    in_plane_strain(model)
    return Scene("l_domain", kind, n, model, exact)


def cavity(kind: str, n: int) -> Scene:
    """Return a spherical cavity of radius 1 in a cube of half edge 3 under tension; an eighth of it."""
    mesh = octant(n, kind, lambda X: 3 * X / np.abs(X).max(axis=1, keepdims=True))
    model = Model(mesh, UNIT)
    exact = fields.cavity(UNIT.E, UNIT.nu, 1.0, 1.0)
    model.fix(
        lambda X: (np.abs(X - 3) < 1e-9).any(axis=1),
        field=lambda X: np.where(np.abs(X) < 1e-9, 0.0, exact(X)),
    )
    on_symmetry_planes(model, "xyz")
    return Scene("cavity", kind, n, model, exact)


def cantilever(kind: str, n: int) -> Scene:
    """Return the straight cantilever of MacNeal & Harder, 6 × 0.2 × 0.1, unit force along z on its end."""
    mesh = box((6, 0.2, 0.1), (6 * n, n, n), element(kind))
    model = Model(mesh, Isotropic3D(E=1e7, nu=0.3))
    model.fix("x-")
    model.add(Traction("x+", (0.0, 0.0, 50.0)))
    return Scene("cantilever", kind, n, model)


def cube(kind: str, n: int) -> Scene:
    """Return the gravity cube on rollers: u_z = -ρ g (L z - z²/2) / M."""
    return on_rollers(Model(box(cells=(n, n, n), element=element(kind)), SOIL), kind, n)


def on_rollers(model: Model, kind: str = "", n: int = 0) -> Scene:
    """Return a box on rollers under its own weight, with its exact field."""
    g, material = 9.81, SOIL
    for side in ("x-", "x+", "y-", "y+", "z-"):
        model.fix(side, side[0])
    model.add(Gravity((0.0, 0.0, -g)))
    height = float(np.ptp(model.mesh.points[:, 2]))

    def exact(X: Array) -> Array:
        z = X[..., 2:]
        return np.eye(3)[2] * (-material.density * g * (height * z - z**2 / 2) / material.C[0, 0])

    return Scene("cube", kind, n, model, exact)

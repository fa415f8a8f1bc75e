"""What users give to bodies, checked: mesh and material, points, vectors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.formulations import NON_LOCKING
from kratos_lite.errors import InputError, ModelError
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Mesh
from kratos_lite.model.checks import checked_linear_material
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.model.spurious_modes import check_rules, check_spurious_modes
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array
from kratos_lite.validation import finite, reals

Material: TypeAlias = "LinearMaterial | Mapping[Any, LinearMaterial]"


def elements_of(mesh: Mesh, material: Material, unnamed: str = NON_LOCKING) -> list[ElementGroup]:
    """Return the elements of a mesh with their material; MeshError or ModelError if they are broken."""
    for law in material.values() if isinstance(material, Mapping) else [material]:
        checked_linear_material(law)
    structure = Structure(mesh, material)
    if mesh.units != "SI":
        raise ModelError(f"bodies in motion are in SI, and this mesh is in {mesh.units}; convert its points")
    structure.check_geometry()
    groups = structure.element_groups(unnamed)
    check_rules(mesh, groups)
    check_spurious_modes(mesh, groups, structure.supports)
    return groups


def mass_properties_of(mesh: Mesh, material: Material) -> MassProperties:
    """Return the mass properties of a mesh, checked as by `elements_of`."""
    groups = elements_of(mesh, material)
    return MassProperties.of(mesh.points, groups)


def points_of(X: ArrayLike) -> Array:
    """Return material points as floats (3,) or (m, 3)."""
    points = finite(X, "material points")
    if points.ndim not in (1, 2) or points.shape[-1] != 3:
        raise InputError(f"material points must have shape (3,) or (m, 3); got {points.shape}")
    return points


def one_point(X: ArrayLike) -> Array:
    """Return one point (3,) as floats."""
    return finite(reals(X, "a point", cure="a force on a part of a model is kl.Resultant"), "a point", (3,))


def vector_of(value: ArrayLike, lead: tuple[int, ...], what: str) -> Array:
    """Return a vector (3,), or one for each body of leading axes, as floats."""
    return fitting(finite(value, what, ("...", 3)), lead, 1, what)


def fitting(value: Array, lead: tuple[int, ...], tail: int, what: str) -> Array:
    """Return a value with `tail` axes of its own if its other axes broadcast to those of the bodies."""
    own = value.shape[: value.ndim - tail]
    try:
        fits = np.broadcast_shapes(own, lead) == lead
    except ValueError:
        fits = False
    if not fits:
        bodies = f"bodies of shape {lead}" if lead else "a single body"
        raise InputError(f"{what} of shape {value.shape} does not fit {bodies}")
    return value

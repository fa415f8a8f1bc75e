"""What users give to bodies, checked: mesh and material, points, vectors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite import checks
from kratos_lite.arguments import finite
from kratos_lite.batches import Batch
from kratos_lite.errors import InputError
from kratos_lite.grouping import batches_of, element_class
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Mesh

Array = NDArray[np.float64]
Material: TypeAlias = "LinearMaterial | Mapping[Any, LinearMaterial]"


def elements_of(mesh: Mesh, material: Material) -> list[Batch]:
    """Return the elements of a mesh with their material, after checks of its geometry.

    Raises
    ------
    MeshError, ModelError, InputError
        If the mesh is broken or inverted, or elements have no material.
    """
    if not isinstance(mesh, Mesh):
        raise InputError(f"a Mesh is needed, such as kratos_lite.box() gives; got {type(mesh).__name__}")
    kinds = [element_class(mesh, block) for block in mesh.blocks]
    checks.check_blocks(mesh, kinds)
    checks.check_points(mesh)
    checks.check_repeated_nodes(mesh)
    checks.check_jacobians(mesh, kinds)
    given = material if isinstance(material, Mapping) else {None: material}
    material_of = np.full(mesh.n_elements, -1)
    for number, (where, one) in enumerate(given.items()):
        if not isinstance(one, LinearMaterial):
            raise InputError(f"a material such as Isotropic3D is needed; got {type(one).__name__}")
        material_of[mesh.elements(where)] = number
    return batches_of(mesh, list(given.values()), material_of)


def points_of(X: ArrayLike) -> Array:
    """Return material points as floats (3,) or (m, 3)."""
    points = finite(X, "material points")
    if points.ndim not in (1, 2) or points.shape[-1] != 3:
        raise InputError(f"material points must have shape (3,) or (m, 3); got {points.shape}")
    return points


def vector_of(value: ArrayLike, what: str, lead: tuple[int, ...] | None = None) -> Array:
    """Return a vector (..., 3) as floats; if leading axes are given, one that fits them."""
    vector = finite(value, what)
    if vector.shape[-1:] != (3,):
        raise InputError(f"{what} must have three components; got shape {vector.shape}")
    if lead is not None and vector.shape[:-1] not in ((), lead):
        raise InputError(f"{what} must have shape {(*lead, 3)} or (3,); got {vector.shape}")
    return vector

"""K of nearly incompressible elements, split into their dilatations and a stiffness without them.

K = A + Dᵀ κ D, where D u are the dilatations that elements have, by orthonormal polynomials, κ is the bulk
modulus that is taken off the material, and A is the stiffness with what is left of it: λ = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import add_in_parts
from kratos_lite.elements.formulations import bulk_over_shear
from kratos_lite.elements.geometry import GEOMETRY
from kratos_lite.elements.overridden_steps import MECHANICS
from kratos_lite.materials import LinearMaterial
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from scipy.sparse import csr_array

NEAR_HALF = 40.0
"""Bulk over shear modulus (ν = 0.488) from which the split pays: fewer iterations, but dearer ones."""
KEPT = 2 / 3
"""Bulk over shear modulus that A keeps: λ = 0."""


@dataclass(eq=False)
class SplitMatrix:
    """K = A + Dᵀ κ D, (3n, 3n) in N/m, which is only multiplied.

    Attributes
    ----------
    A : the stiffness without most of the bulk modulus.
    D : (p, 3n) sparse, orthonormal dilatations of the elements in √m³ / m.
    bulk : (p,) Pa, κ.
    modulus : (p,) Pa, λ + 2μ in A.
    means : (n, p) sparse, the means at corner nodes of a pressure of each element, scaled by 1 / √modulus.
    groups : the elements, with materials as in A.
    """

    A: BlockMatrix
    D: csr_array
    bulk: Array
    modulus: Array
    means: csr_array
    groups: list[ElementGroup]

    @property
    def shape(self) -> tuple[int, int]:
        """The number of rows and columns."""
        return self.A.shape

    def __matmul__(self, x: Array) -> Array:
        """Return K x of a vector (3n,)."""
        return self.A @ x + self.D.T @ (self.bulk * (self.D @ x))

    def norm(self) -> float:
        """Return the largest row sum of |A| and |D|ᵀ κ |D|: no less than that of |K|."""
        size = abs(self.D)
        return self.A.norm() + float((size.T @ (self.bulk * size.sum(axis=1))).max(initial=0.0))

    def scipy(self) -> csr_array:
        """Return K as a scipy.sparse.csr_array."""
        from scipy.sparse import diags_array

        return (self.A.scipy().tocsr() + self.D.T @ diags_array(self.bulk) @ self.D).tocsr()


def split(K: BlockMatrix, points: Array, groups: Sequence[ElementGroup], pattern: Pattern) -> Any:
    """Return K as a SplitMatrix, which takes its memory, or K itself where no group is to be split.

    Parameters
    ----------
    K : the stiffness matrix of the groups; where it is split, A takes its place.
    points : (n, 3) m.
    groups : the elements, in the order of the pattern.
    pattern : of K.
    """
    if not any(map(is_split, groups)):
        return K
    parts, left = [], []
    for number, group in enumerate(groups):
        if not is_split(group):
            left.append(group)
            continue
        bulk, shear = _moduli(group.material.C)
        taken = bulk - KEPT * shear
        D = np.concatenate([dilatations(points, group, chunk) for chunk in group.chunks()])
        for _ in add_in_parts(K.data, group, pattern, number, lambda chunk, D=D, k=taken: _products(D[chunk], -k)):
            pass
        parts.append((group, D, taken, (KEPT + 4 / 3) * shear))
        left.append(_softened(group, taken))
    D = _assembled(len(points), parts)
    bulk, modulus = (
        np.concatenate([np.full(D.shape[0] * D.shape[1], part[i]) for part in parts for D in part[1:2]])
        for i in (2, 3)
    )
    return SplitMatrix(K, D, bulk, modulus, _means(points, parts), left)


def is_split(group: ElementGroup) -> bool:
    """Return whether the dilatations of a group are known and its material is nearly incompressible.

    Those of the library's B-bar elements are their projected ones, those of enhanced elements their means: the
    modes take up the others.
    """
    known = group.element.has_kernels(*GEOMETRY, *MECHANICS) and group.strain_tables() is not None
    return known and bulk_over_shear(group.material.C) > NEAR_HALF


def dilatations(points: Array, group: ElementGroup, chunk: slice = slice(None)) -> Array:
    """Return the dilatations of elements, (m, r, 3k): their integrals with r orthonormal polynomials."""
    elements, tables = group.at(points, chunk), group.strain_tables()
    assert tables is not None
    dV, gradients = elements._gauss
    rows = np.swapaxes(gradients, -1, -2).reshape(*dV.shape, -1)
    weighted = dV[..., None]
    if tables.C is not None or not tables.functions.shape[1]:
        return np.swapaxes(weighted, -1, -2) @ rows / np.sqrt(weighted.sum(axis=-2))[..., None]
    volume = weighted.sum(axis=-2)[..., None]
    P = np.concatenate([np.ones_like(weighted), tables.functions @ elements.X / np.cbrt(volume)], axis=-1)
    moments = np.swapaxes(P * weighted, -1, -2)
    return np.linalg.solve(np.linalg.cholesky(moments @ P), moments @ rows)


def _moduli(C: Array) -> tuple[float, float]:
    """Return bulk and mean shear modulus of a C (6, 6)."""
    shear = float(C.diagonal()[3:].mean())
    return bulk_over_shear(C) * shear, shear


def _softened(group: ElementGroup, taken: float) -> ElementGroup:
    """Return a group whose material has a smaller bulk modulus."""
    C = group.material.C.copy()
    C[:3, :3] -= taken
    return replace(group, material=cast("LinearMaterial", SimpleNamespace(C=C)))


def _products(D: Array, factor: float) -> Array:
    """Return factor Dᵀ D of dilatations (m, r, 3k) by axis, then node: (m, 3, k, 3, k)."""
    m, _, size = D.shape
    k = size // 3
    by_axis = D.reshape(m, -1, k, 3).swapaxes(-1, -2).reshape(m, -1, size)
    return (factor * by_axis.swapaxes(-1, -2) @ by_axis).reshape(m, 3, k, 3, k)


def _assembled(n_nodes: int, parts: Sequence[tuple[ElementGroup, Array, float, float]]) -> csr_array:
    """Return D (p, 3n) of the dilatations of each group."""
    from scipy.sparse import csr_array, vstack

    rows = []
    for group, D, *_ in parts:
        m, r, size = D.shape
        dofs = (3 * group.nodes[:, :, None] + np.arange(3, dtype=np.int32)).reshape(m, 1, size)
        columns = np.repeat(dofs, r, axis=1).ravel()
        starts = np.arange(0, D.size + 1, size, dtype=np.int32)
        rows.append(csr_array((D.ravel(), columns, starts), shape=(m * r, 3 * n_nodes)))
    return rows[0] if len(rows) == 1 else vstack(rows, format="csr")


def _means(points: Array, parts: Sequence[tuple[ElementGroup, Array, float, float]]) -> csr_array:
    """Return the means (n, p) at corner nodes; see `SplitMatrix`.

    The first polynomial of an element is 1 / √volume, and a corner has its share of the volume.
    """
    from scipy.sparse import csr_array, hstack

    columns, mass = [], np.zeros(len(points))
    for group, D, _, modulus in parts:
        corners = group.nodes[:, : group.element.shape.corners]
        volume = np.concatenate([group.at(points, chunk).dV.sum(axis=-1) for chunk in group.chunks()])
        share = np.repeat(volume / corners.shape[1], corners.shape[1])
        mass += np.bincount(corners.ravel(), share, len(points))
        m, r, _ = D.shape
        first = np.repeat(r * np.arange(m), corners.shape[1])
        value = np.repeat(np.sqrt(volume / modulus) / corners.shape[1], corners.shape[1])
        columns.append(csr_array((value, (corners.ravel(), first)), shape=(len(points), m * r)))
    means = hstack(columns, format="csr")
    means.data /= np.repeat(np.sqrt(np.where(mass > 0, mass, 1.0)), np.diff(means.indptr))
    return means

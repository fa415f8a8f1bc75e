"""K of nearly incompressible elements, split into their dilatations and a stiffness without most of them.

K = A + Dᵀ κ D, where D u are the dilatations that elements have, by orthonormal polynomials, κ is the bulk
modulus that is taken off the material, and A is the stiffness with the rest of it: λ = μ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import add_in_parts, assemble_stiffness
from kratos_lite.elements.formulations import NEAR_HALF, bulk_over_shear
from kratos_lite.elements.tables import cofactors, tabulate
from kratos_lite.materials import LinearMaterial
from kratos_lite.solvers.pressure_means import PressureMeans, pressure_means
from kratos_lite.typing import Array, Progress

if TYPE_CHECKING:
    from scipy.sparse import bsr_array, csr_array

KEPT = 1.0
"""λ / μ that A keeps: pressures are better known the more it is, and multigrid is still as good."""


@dataclass(eq=False)
class SplitMatrix:
    """K = A + Dᵀ κ D, (3n, 3n) in N/m, which is only multiplied."""

    A: BlockMatrix  # the stiffness without most of the bulk modulus
    D: bsr_array  # (p, 3n) orthonormal dilatations of elements, √m³ / m; R x 3 blocks, R = 1 or 4
    bulk: Array  # (p,) Pa, κ
    kept: Array  # (p,) Pa, λ in A
    modulus: Array  # (p,) Pa, λ + 2μ in A
    means: PressureMeans  # with λ + 2μ of the stiffest element at a node; λ = 0 where it is split
    groups: list[ElementGroup]  # the elements, with materials as in A

    @property
    def shape(self) -> tuple[int, int]:
        """The number of rows and columns."""
        return self.A.shape

    def __matmul__(self, x: Array) -> Array:
        """Return K x of a vector (3n,)."""
        return self.A @ x + self.D.T @ (self.bulk * (self.D @ x))

    def norm(self) -> float:
        """Return the largest row sum of |A| and |D|ᵀ κ |D|: no less than that of |K|."""
        size = abs(self.D.tocsr())
        return self.A.norm() + float((size.T @ (self.bulk * size.sum(axis=1))).max(initial=0.0))

    def scipy(self) -> csr_array:
        """Return K as a scipy.sparse.csr_array."""
        from scipy.sparse import diags_array

        D = self.D.tocsr()
        return (self.A.scipy().tocsr() + D.T @ diags_array(self.bulk) @ D).tocsr()


def assemble(
    points: Array,
    groups: Sequence[ElementGroup],
    pattern: Pattern,
    progress: Progress | None = None,
) -> SplitMatrix:
    """Return the stiffness matrix of elements some of which are nearly incompressible."""
    elastic, soft, at_once, parts = list(groups), list(groups), list(groups), {}
    for number, group in enumerate(groups):
        if not is_split(group):
            continue
        bulk, shear = _moduli(group.material.C)
        part = _SplitGroup(group, bulk - (KEPT + 2 / 3) * shear, shear, *_dilatations(points, group))
        parts[number] = part
        elastic[number] = _softened(group, part.bulk)
        soft[number] = _softened(elastic[number], KEPT * shear)
        at_once[number] = elastic[number] if part.is_all() else group
    K = assemble_stiffness(points, at_once, pattern, progress)
    for number, part in parts.items():
        if not part.is_all():
            part.take_off(K, pattern, number)
    split = list(parts.values())
    bulks, shears = (
        np.concatenate([np.full(part.count, getattr(part, name)) for part in split])
        for name in ("bulk", "shear")
    )
    means = pressure_means(points, split, _stiffest(len(points), soft))
    D = _assembled(len(points), split)
    return SplitMatrix(K, D, bulks, KEPT * shears, (KEPT + 2) * shears, means, elastic)


def is_split(group: ElementGroup) -> bool:
    """Return whether the dilatations of a group are known and its material is nearly incompressible."""
    return has_dilatations(group) and bulk_over_shear(group.material.C) > NEAR_HALF


def has_dilatations(group: ElementGroup) -> bool:
    """Return whether the dilatations of a group are known.

    Those of the library's B-bar elements are their projected ones, those of enhanced elements their means:
    the modes take up the others.
    """
    return not group.element.custom and group.strain_tables() is not None


@dataclass(eq=False)
class _SplitGroup:
    """A group, the bulk modulus taken off it, its shear modulus; its dilatations and their polynomials."""

    group: ElementGroup
    bulk: float
    shear: float
    D: Array
    polynomials: Array

    @property
    def count(self) -> int:
        return self.D.shape[0] * self.D.shape[1]

    def is_all(self) -> bool:
        """Return whether there are no other dilatations: without κ the stiffness is of a softer material."""
        tables = self.group.strain_tables()
        return tables is not None and tables.C is None and tables.fraction == 1.0

    def take_off(self, K: BlockMatrix, pattern: Pattern, number: int) -> None:
        """Subtract Dᵀ κ D from the matrix."""
        m, r, size = self.D.shape
        by_axis = self.D.reshape(m, r, size // 3, 3).swapaxes(-1, -2).reshape(m, r, size)

        def products(chunk: slice) -> Array:
            D = by_axis[chunk]
            return (-self.bulk * D.swapaxes(-1, -2) @ D).reshape(len(D), 3, size // 3, 3, size // 3)

        for _ in add_in_parts(K.data, self.group, pattern, number, products):
            pass


def _dilatations(points: Array, group: ElementGroup) -> tuple[Array, Array]:
    """Return integrals of dilatations with r orthonormal polynomials (m, r, 3k), and these (m, r, r)."""
    tables, (_, dN) = group.strain_tables(), tabulate(group.element.shape, group.rule)
    assert tables is not None
    linear = tables.C is None and tables.functions.shape[1] > 0
    derivatives, weights = np.swapaxes(dN, 1, 2).reshape(-1, dN.shape[1]), group.rule.weights
    dilatations, polynomials = [], []
    for chunk in group.chunks():
        elements = group.at(points, chunk)
        J = elements._jacobian(dN)
        normals = cofactors(J)
        dV = (J[..., 0] * normals[..., 0, :]).sum(axis=-1) * weights
        P = np.ones((*dV.shape, 1))
        if linear:
            length = np.cbrt(dV.sum(axis=1))[:, None, None]
            P = np.concatenate([P, tables.functions @ elements.X / length], axis=-1)
        polynomials.append(np.linalg.inv(np.linalg.cholesky(np.swapaxes(P * dV[..., None], 1, 2) @ P)))
        m, r = polynomials[-1].shape[:2]
        rows = np.einsum("mgr,mgji->mrigj", P, normals * weights[:, None, None]).reshape(m, 3 * r, -1)
        integrals = np.swapaxes((rows @ derivatives).reshape(m, r, 3, -1), 2, 3).reshape(m, r, -1)
        dilatations.append(polynomials[-1] @ integrals)
    return np.concatenate(dilatations), np.concatenate(polynomials)


def _moduli(C: Array) -> tuple[float, float]:
    """Return bulk and mean shear modulus of a C (6, 6)."""
    shear = float(C.diagonal()[3:].mean())
    return bulk_over_shear(C) * shear, shear


def _longitudinal(group: ElementGroup) -> float:
    """Return λ + 2μ of a group."""
    bulk, shear = _moduli(group.material.C)
    return bulk + 4 / 3 * shear


def _stiffest(n_nodes: int, groups: Sequence[ElementGroup]) -> Array:
    """Return the largest λ + 2μ of the elements at each node, (n,)."""
    modulus = np.ones(n_nodes)
    for group in sorted(groups, key=_longitudinal):
        modulus[group.nodes] = _longitudinal(group)
    return modulus


def _softened(group: ElementGroup, bulk: float) -> ElementGroup:
    """Return a group whose material has a smaller bulk modulus."""
    C = group.material.C.copy()
    C[:3, :3] -= bulk
    return replace(group, material=cast("LinearMaterial", SimpleNamespace(C=C)))


def _assembled(n_nodes: int, parts: Sequence[_SplitGroup]) -> bsr_array:
    """Return D (p, 3n) of the dilatations of each group, a row of blocks for each element if they allow."""
    from scipy.sparse import bsr_array

    sizes = {part.D.shape[1] for part in parts}
    R = sizes.pop() if len(sizes) == 1 else 1
    blocks, columns, counts = [], [], []
    for part in parts:
        m, r, size = part.D.shape
        k = size // 3
        blocks.append(part.D.reshape(m, r // R, R, k, 3).swapaxes(2, 3).reshape(-1, R, 3))
        columns.append(np.repeat(part.group.nodes[:, None], r // R, axis=1).ravel())
        counts.append(np.full(m * r // R, k))
    starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))]).astype(np.int32)
    data = np.concatenate(blocks), np.concatenate(columns).astype(np.int32), starts
    return bsr_array(data, shape=(R * (len(starts) - 1), 3 * n_nodes))

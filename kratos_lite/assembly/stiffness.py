"""Stiffness: element matrices added to one sparse matrix of node blocks.

Compiled, elements are computed and added a few at a time by several threads; in NumPy, in cache-sized
chunks.  Neither all element matrices nor a triplet list of the whole model ever exists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup, as_double, compiled
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.typing import Array, Progress
from kratos_lite.voigt import tensor

SCATTER_BYTES = 64_000_000
"""Memory of the element matrices that are added to the global matrix at once."""


def assemble_stiffness(
    points: Array, groups: Sequence[ElementGroup], pattern: Pattern, progress: Progress | None = None
) -> BlockMatrix:
    """Return the stiffness matrix as 3x3 blocks, (3n, 3n) in N/m."""
    data = np.zeros((len(pattern.indices), 3, 3))
    points = as_double(points)
    done, total = 0, sum(len(group) for group in groups)
    for number, group in enumerate(groups):
        if module := compiled("stiffness", group.element):
            nodes, _, dN, weights = group.tables()
            law = group.kernel_arguments()[0], group.strain_tables()
            rows, factors = (pattern.indptr, pattern.indices), group.factors
            scale = None if factors is None else as_double(factors[:, None])
            module.add_stiffness(points, nodes, dN, weights, *law, *rows, data, factors=scale)
            counts: Iterable[int] = (len(group),)
        else:

            def stiffness(chunk: slice, group: ElementGroup = group) -> Array:
                return group.scaled(group.at(points, chunk).stiffness_by_axis(group.material.C), chunk)

            counts = add_in_parts(data, group, pattern, number, stiffness)
        for count in counts:
            done += count
            if progress:
                progress("assemble", done / total)
    return BlockMatrix(data, pattern.indices, pattern.indptr)


def add_in_parts(
    data: Array, group: ElementGroup, pattern: Pattern, number: int, matrices: Callable[[slice], Array]
) -> Iterator[int]:
    """Add the element matrices (m, 3, k, 3, k) of each chunk of a group; yield how many are added."""
    k = group.nodes.shape[1]
    for window in group.chunks(SCATTER_BYTES):
        blocks = np.empty((window.stop - window.start, k, k, 3, 3))
        for chunk in group.chunks(within=window):
            place = slice(chunk.start - window.start, chunk.stop - window.start)
            blocks[place] = matrices(chunk).transpose(0, 2, 4, 1, 3)
        pattern.add(data, number, window, blocks)
        yield len(blocks)


def stress_stiffness(
    points: Array, groups: Sequence[ElementGroup], pattern: Pattern, stress: Callable[[ElementGroup], Array]
) -> Array:
    """Return ∫ grad N_i·σ grad N_j dV, data (nnz,) in N/m, of the stresses (m, g, 6) in Pa of each group."""
    data = np.zeros(len(pattern.indices))
    for number, group in enumerate(groups):
        sigma = tensor(stress(group))
        for chunk in group.chunks():
            dV, D = group.at(points, chunk)._gauss
            weighted = sigma[chunk] * dV[..., None, None]
            pattern.add(data, number, chunk, (np.swapaxes(D, -1, -2) @ weighted @ D).sum(axis=-3))
    return data


def assemble_dense(points: Array, groups: Sequence[ElementGroup]) -> Array:
    """Return the stiffness matrix of a small model as a full (3n, 3n) array in N/m."""
    n = 3 * len(points)
    K = np.zeros(n * n)
    for group in groups:
        for chunk in group.chunks():
            dofs = 3 * group.nodes[chunk].astype(np.int64)[:, None, :] + np.arange(3)[:, None]
            dofs = dofs.reshape(len(dofs), -1)
            places = (dofs[:, :, None] * n + dofs[:, None, :]).ravel()
            matrices = group.scaled(group.at(points, chunk).stiffness_by_axis(group.material.C), chunk)
            K += np.bincount(places, weights=matrices.ravel(), minlength=n * n)
    return K.reshape(n, n)

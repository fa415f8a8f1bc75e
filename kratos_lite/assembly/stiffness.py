"""Assembly: element matrices into one sparse matrix of node blocks.

The sparsity pattern is made from the node graph, once for each connectivity.  Compiled, elements are
computed and added a few at a time by several threads; in NumPy, element matrices are computed in
cache-sized chunks and added at known positions.  Neither all element matrices nor a triplet list of
the whole model ever exists.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.kinematic_linear import lame_constants, tabulate
from kratos_lite.native import kernels
from kratos_lite.typing import Array, Progress

if TYPE_CHECKING:
    pass

Ints = NDArray[np.int32]
SCATTER_BYTES = 64_000_000
"""Memory of the element matrices that are added to the global matrix at once."""
CONSTANT_JACOBIANS = "all Jacobians but the first of elements where they are constant"


class Pattern:
    """Sparsity of the node graph in rows of node blocks.

    Parameters
    ----------
    n_nodes : number of nodes.
    connectivity : (m, k) node rows of each number of elements.

    Attributes
    ----------
    indptr : (n + 1,) int32, where the row of each node starts; nodes without elements have empty rows.
    indices : (nnz,) int32, sorted within a row: the nodes that share an element with it.
    """

    def __init__(self, n_nodes: int, connectivity: Sequence[Ints]) -> None:
        self.n_nodes = n_nodes
        self.connectivity = [np.ascontiguousarray(nodes, dtype=np.int32) for nodes in connectivity]
        module = kernels("stiffness")
        make = module.pattern if module else _pattern
        self.indptr: Ints
        self.indices: Ints
        self.indptr, self.indices = make(n_nodes, self.connectivity)

    @cached_property
    def positions(self) -> list[Ints]:
        """Position of each node pair of each element, (m, k, k) of each number."""
        rows = np.repeat(np.arange(self.n_nodes, dtype=np.int64), np.diff(self.indptr))
        keys = rows * self.n_nodes + self.indices
        return [self._find(keys, nodes) for nodes in self.connectivity]

    def _find(self, keys: NDArray[np.int64], nodes: Ints) -> Ints:
        m, k = nodes.shape
        found = np.zeros((m, k, k), dtype=np.int32)
        step = max(1, 1_000_000 // (k * k))
        for start in range(0, m, step):
            n = nodes[start : start + step].astype(np.int64)
            wanted = n[:, :, None] * self.n_nodes + n[:, None, :]
            place = np.searchsorted(keys, wanted)
            if (keys[np.minimum(place, len(keys) - 1)] != wanted).any():
                raise AssertionError("the sparsity pattern misses a pair of nodes that share an element")
            found[start : start + step] = place
        return found

    def add(self, data: Array, number: int, window: slice, matrices: Array) -> None:
        """Add matrices of some elements of a number: (m, k, k, 3, 3) to (nnz, 3, 3), (m, k, k) to (nnz,)."""
        if module := kernels("stiffness"):
            matrices = np.ascontiguousarray(matrices)
            module.add_matrices(self.connectivity[number][window], matrices, self.indptr, self.indices, data)
        else:
            _add_blocks(data, self.positions[number][window], matrices)


def _pattern(n_nodes: int, connectivity: Sequence[Ints]) -> tuple[Ints, Ints]:
    """Return rows (indptr, indices) of the nodes that share an element."""
    from scipy.sparse import csr_array, hstack

    incident = []
    for nodes in connectivity:
        m, k = nodes.shape
        pointer = np.arange(0, m * k + 1, k)
        # booleans, as the product only asks whether two nodes share an element, however many
        ones = np.ones(m * k, dtype=bool)
        incident.append(csr_array((ones, nodes.ravel(), pointer), shape=(m, n_nodes)).T)
    incidence = hstack(incident, format="csr", dtype=bool)
    graph = (incidence @ incidence.T).tocsr()
    graph.sort_indices()
    return graph.indptr.astype(np.int32), graph.indices.astype(np.int32)


class PatternCache:
    """The last pattern made, for as long as the connectivity stays the same."""

    def __init__(self) -> None:
        self._key: tuple[int, ...] = ()
        self._pattern: Pattern | None = None

    def get(self, n_nodes: int, connectivity: Sequence[Ints]) -> Pattern:
        """Return the pattern of this connectivity, made anew only if it differs from the last."""
        key = (n_nodes, *(hash((nodes.shape, nodes.tobytes())) for nodes in connectivity))
        if self._pattern is None or key != self._key:
            self._key, self._pattern = key, Pattern(n_nodes, connectivity)
        return self._pattern


def _add_blocks(data: Array, positions: Ints, matrices: Array) -> None:
    """Add element matrices to node blocks `data`; see `Pattern.add`."""
    from scipy.sparse import csc_array

    low, high = int(positions.min()), int(positions.max()) + 1
    flat = positions.ravel() - low
    # the matrix that takes each block to its place, by columns: a product adds one block after the other
    selection = csc_array((np.ones(len(flat)), flat, np.arange(len(flat) + 1)), shape=(high - low, len(flat)))
    total = np.asarray(selection @ matrices.reshape(len(flat), -1))
    data[low:high] += total.reshape(data[low:high].shape)


def assemble_stiffness(
    points: Array,
    groups: Sequence[ElementGroup],
    pattern: Pattern,
    progress: Progress | None = None,
    skipped: set[str] | None = None,
) -> BlockMatrix:
    """Return the stiffness matrix as 3x3 blocks, (3n, 3n) in N/m.

    `skipped` collects what made a part of the work unnecessary, in words for the report.
    """
    data = np.zeros((len(pattern.indices), 3, 3))
    points = np.ascontiguousarray(points, dtype=float)
    done, total = 0, sum(len(group) for group in groups)
    for number, group in enumerate(groups):
        compiled = kernels("stiffness") and group.element.stiffness_from_tables()
        add = _add_compiled if compiled else _add_computed
        for count, constant in add(data, points, group, pattern, number):
            done += count
            if progress:
                progress("assemble", done / total)
            if constant and skipped is not None:
                skipped.add(CONSTANT_JACOBIANS)
    return BlockMatrix(data, pattern.indices, pattern.indptr)


def _add_compiled(
    data: Array, points: Array, group: ElementGroup, pattern: Pattern, number: int
) -> Iterator[tuple[int, bool]]:
    """Add the stiffness of a group; yield the number of elements and whether J was constant in some."""
    dN = np.ascontiguousarray(tabulate(group.element.shape, group.rule)[1])
    weights = np.ascontiguousarray(group.rule.weights)
    C = np.ascontiguousarray(lame_constants(group.material.C) or group.material.C, dtype=float)
    nodes, indptr, indices = pattern.connectivity[number], pattern.indptr, pattern.indices
    constant = kernels("stiffness").add_stiffness(points, nodes, dN, weights, C, indptr, indices, data)
    yield len(group), constant > 0


def _add_computed(
    data: Array, points: Array, group: ElementGroup, pattern: Pattern, number: int
) -> Iterator[tuple[int, bool]]:
    """Do the same in NumPy, in parts."""
    k, standard = group.nodes.shape[1], group.element.stiffness_from_tables()
    for window in group.chunks(SCATTER_BYTES):
        blocks = np.empty((window.stop - window.start, k, k, 3, 3))
        constant = False
        for chunk in group.chunks(within=window):
            place = slice(chunk.start - window.start, chunk.stop - window.start)
            elements = group.at(points, chunk)
            blocks[place] = elements.stiffness_by_axis(group.material.C).transpose(0, 2, 4, 1, 3)
            constant |= standard and elements.constant_jacobian
        pattern.add(data, number, window, blocks)
        yield len(blocks), constant


def assemble_dense(points: Array, groups: Sequence[ElementGroup]) -> Array:
    """Return the stiffness matrix of a small model as a full (3n, 3n) array in N/m."""
    n = 3 * len(points)
    K = np.zeros(n * n)
    for group in groups:
        for chunk in group.chunks():
            dofs = 3 * group.nodes[chunk].astype(np.int64)[:, None, :] + np.arange(3)[:, None]
            dofs = dofs.reshape(len(dofs), -1)
            places = (dofs[:, :, None] * n + dofs[:, None, :]).ravel()
            matrices = group.at(points, chunk).stiffness_by_axis(group.material.C)
            K += np.bincount(places, weights=matrices.ravel(), minlength=n * n)
    return K.reshape(n, n)

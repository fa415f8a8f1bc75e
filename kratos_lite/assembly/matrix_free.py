"""The stiffness of elements as a product with vectors, element by element: the matrix is never made.

Reading a matrix of quadratic elements takes three to ten times as long as computing its product anew.
Source: Kronbichler & Kormann, Computers & Fluids 63 (2012) 135-147.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix, dependent_rows
from kratos_lite.assembly.element_groups import ElementGroup, as_double, compiled
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.elements.tables import tabulate
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Bsr, Csr, Ints


class MatrixFree:
    """The stiffness K (3n, 3n) in N/m of elements that the kernels know, which is only multiplied.

    With m and M, one number for each pair of nodes, it is K + m M; multigrid smooths K alone.
    """

    added: tuple[float, Any, Any, Array] | None = None  # m, and M as indptr, indices and data

    def __init__(
        self,
        points: Array,
        groups: Sequence[ElementGroup],
        assembled: Callable[[], BlockMatrix] | None = None,
    ) -> None:
        self.points, self.groups = as_double(points), list(groups)
        self.assembled = self._assembled if assembled is None else assembled
        self.tied = False

    @cached_property
    def product(self) -> Any:
        """What the kernels multiply with."""
        module = compiled("multigrid", self.groups[0].element)
        return module.Product(self.points, list(map(_tables, self.groups)))

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: what kernels hold is made anew."""
        return {name: value for name, value in vars(self).items() if name != "product"}

    def tie(self, T: Any) -> MatrixFree:
        """Return T^T K T (3n, 3n), with T in the numbering of all components; what it assembles is K."""
        tied = copy(self)
        tied.product, tied.tied = self.product, True
        self.product.tie(*dependent_rows(T))
        return tied

    def with_mass(self, m: float, M: Csr, assembled: Callable[[], BlockMatrix]) -> MatrixFree:
        """Return K + m M of M (n, n) in kg, the same for x, y and z; `assembled` makes it."""
        both = copy(self)
        both.product, both.assembled = self.product, assembled
        both.added = m, M.indptr.astype(np.int32, copy=False), M.indices.astype(np.int32, copy=False), M.data
        return both

    @staticmethod
    def takes(group: ElementGroup) -> bool:
        """Return whether the kernels know the stiffness of a group, and their product pays."""
        known = compiled("multigrid", group.element) is not None and group.factors is None
        if not known or group.strain_tables() is not None:
            return False
        shape = group.element.shape
        return len(shape.nodes) > shape.corners or factors(shape, group.rule) is not None

    @property
    def shape(self) -> tuple[int, int]:
        """The number of rows and columns."""
        return 3 * len(self.points), 3 * len(self.points)

    def times(self, x: Array) -> Array:
        """Return K x of a vector (3n,), or of several (k, 3n)."""
        product: Array = self.product.times(np.ascontiguousarray(x, dtype=float), self.tied, self.added)
        return product

    __matmul__ = times

    @cached_property
    def _norm(self) -> float:
        return float(self.product.norm())

    def norm(self) -> float:
        """Return the largest row sum of |K| over the nodes of an element at the stiffest node."""
        return self._norm

    def scipy(self) -> Bsr:
        """Return the matrix itself, made now."""
        return self.assembled().scipy()

    def _assembled(self) -> BlockMatrix:
        pattern = Pattern(len(self.points), [group.nodes for group in self.groups])
        return assemble_stiffness(self.points, self.groups, pattern)


def _tables(group: ElementGroup) -> tuple[Any, ...]:
    """Return nodes, dN, weights, C and factors of a group, as kernels take them."""
    nodes, _, dN, weights = group.tables()
    nodes = nodes[np.argsort(nodes.min(axis=1), kind="stable")]  # so that each node is read once
    C, tables = group.kernel_arguments()[0], factors(group.element.shape, group.rule)
    if tables is None:
        return nodes, dN, weights, C, None
    order, *by_axis = tables
    return nodes, as_double(dN[order]), as_double(weights[order]), C, tuple(by_axis)


@remembered
def factors(shape: type[Shape], rule: Rule) -> tuple[Ints, Array, Array, Array] | None:
    """Return how the gradients of a shape at the points of a rule fall apart into factors, if they do."""
    # They do where the points are a grid of n along each axis, n = 2 or 3, and the shape functions have no
    # higher degree than n - 1 in any coordinate.
    n = round(len(rule.weights) ** (1 / 3))
    order: Ints = np.lexsort(np.round(rule.points, 12).T).astype(np.int64)
    axis = rule.points[order[:n], 0]
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    if n not in (2, 3) or len(grid) != len(order) or np.abs(grid - rule.points[order]).max() > 1e-12:
        return None
    even = np.linspace(-1.0, 1.0, n)
    values, slopes = _lagrange(even, axis)[0], _lagrange(axis, axis)[1]
    at = np.stack(np.meshgrid(even, even, even, indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    places = np.array([shape.N(xi) for xi in at])
    places = np.where(np.abs(places - np.round(places)) < 1e-14, np.round(places), places)
    one, all_values = np.eye(n), np.kron(np.kron(values, values), values) @ places
    along = [
        np.kron(one, np.kron(one, slopes)),
        np.kron(one, np.kron(slopes, one)),
        np.kron(slopes, np.kron(one, one)),
    ]
    gradients = np.stack([D @ all_values for D in along], axis=-1)
    exact = np.abs(gradients - tabulate(shape, rule)[1][order]).max() < 1e-12
    return (order, as_double(values), as_double(slopes), as_double(places)) if exact else None


def _lagrange(nodes: Array, x: Array) -> tuple[Array, Array]:
    """Return the Lagrange polynomials of `nodes` and their derivatives at x, each (x, nodes)."""
    powers = np.vander(nodes, increasing=True)
    degree = np.arange(len(nodes))
    slopes = degree * x[:, None] ** np.maximum(degree - 1, 0)
    inverse = np.linalg.inv(powers)
    return x[:, None] ** degree @ inverse, slopes @ inverse

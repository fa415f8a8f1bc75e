"""ConstrainedSystem: K u = f of elements under constraints, made once and solved for many forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.attached import Attached
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.matrix_free import MatrixFree
from kratos_lite.assembly.sparsity_pattern import Pattern, PatternCache
from kratos_lite.assembly.stiffness import assemble_dense, assemble_stiffness
from kratos_lite.elements.formulations import bulk_over_shear
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.direct import cuthill_mckee, nodal_width
from kratos_lite.solvers.linear_solver import LinearSolver, Solution
from kratos_lite.solvers.plan import Facts, Plan, choose
from kratos_lite.typing import Array, Ints, Mask, Progress

if TYPE_CHECKING:
    from kratos_lite.mesh.hanging import HangingNodes

FAR, SLAB = 5.0, 3.0
"""From the first to the last node of an element in layers of nodes, above which on average nodes get an
order; the slabs of that in spacings."""
NO_MATRIX = "the stiffness matrix, as its products are computed element by element"
"""What is skipped with linear elements inside the quadratic ones."""


class ConstrainedSystem:
    """K u = f + reactions on the nodes of some elements, with u = T q + c.

    Pattern, matrix and whatever the solver prepares (factors, multigrid) are made when they are first
    needed and kept.  Nodes that no element uses carry no equations.
    """

    def __init__(
        self,
        points: Array,
        groups: Sequence[ElementGroup],
        constraints: Callable[[Ints], ConstraintMap],
        *,
        solver: str = "auto",
        use: str = "once",
        tolerance: float = 1e-10,
        patterns: PatternCache | None = None,
        progress: Progress | None = None,
        hanging: HangingNodes | None = None,
        attached: Attached | None = None,
        ordered: bool = False,
    ) -> None:
        self.n_nodes = len(points)
        ordered = ordered and len(groups) > 0 and all(map(MatrixFree.takes, groups))
        self.nodes, self.groups = renumber(points, groups, ordered)
        self._are_all = np.array_equal(self.nodes, np.arange(self.n_nodes))
        self.points = points[self.nodes]
        self.constraint_map = constraints(self.nodes)
        self.tolerance, self.progress = tolerance, progress
        self.attached = None if attached is None else attached.on(self.nodes)
        self._hanging = hanging if hanging is None else hanging.select(self.nodes, self.n_nodes)
        self.skipped: list[str] = []
        self.warnings: list[str] = []
        self._patterns = patterns or PatternCache()
        self.plan = self._planned(solver, use)

    def _planned(self, solver: str, use: str) -> Plan:
        facts = Facts(
            len(self.constraint_map.free),
            3 * len(self.nodes),
            use=use,
            bulk_over_shear=lambda: largest_bulk_over_shear(self.groups),
            bandwidth=self._bandwidth,
            has_product=lambda: not self.attached and all(map(MatrixFree.takes, self.groups)),
            contrast=lambda: stiffness_contrast(self.groups),
            is_stretched=self._is_stretched,
            is_plate=self._is_plate,
            nodes=lambda: min(len(group.element.shape.nodes) for group in self.groups),
        )
        return choose(solver, facts)

    def _bandwidth(self) -> float:
        width = nodal_width(self.pattern, self.pattern.rows(), cuthill_mckee(self.pattern)[1])
        return width * len(self.constraint_map.free) / len(self.nodes)

    def _is_stretched(self) -> bool:
        from kratos_lite.solvers.coarse_level import is_stretched  # a quick start for small models

        return is_stretched(self.points, self.groups)

    def _is_plate(self) -> bool:
        from kratos_lite.solvers.plate_level import plate_axes  # a quick start for small models

        return plate_axes(self.points, self.constraint_map.is_free) is not None

    @cached_property
    def pattern(self) -> Pattern:
        """The sparsity of matrices on these nodes."""
        pairs = [self.attached.pairs] if self.attached else []
        return self._patterns.get(len(self.nodes), [group.nodes for group in self.groups] + pairs)

    @cached_property
    def K(self) -> Any:
        """The stiffness matrix (3a, 3a) in N/m: a BlockMatrix, or a full array for the method ``dense``."""
        if self.plan.method == "dense":
            K = assemble_dense(self.points, self.groups)
            return K + self.attached.K.toarray() if self.attached else K
        if self.plan.method == "displacement-pressure":
            from kratos_lite.solvers.dilatation import assemble  # a quick start for small models

            split = assemble(self.points, self.groups, self.pattern, self.progress)
            self._add_springs(split.A)
            return split
        if not self.plan.matrix_free:
            return self.assembled()
        if any(len(group.element.shape.nodes) > group.element.shape.corners for group in self.groups):
            self.skipped.append(NO_MATRIX)
        return MatrixFree(self.points, self.groups, self.assembled)

    def assembled(self) -> BlockMatrix:
        """Return the stiffness of elements and springs as a matrix."""
        K = assemble_stiffness(self.points, self.groups, self.pattern, self.progress)
        self._add_springs(K)
        return K

    def _add_springs(self, K: BlockMatrix) -> None:
        if self.attached:
            self.pattern.add_matrix(K.data, self.attached.K)

    @cached_property
    def norm(self) -> float:
        """The largest row sum of |K|."""
        return self.equations.norm

    @cached_property
    def equations(self) -> LinearSolver:
        """What solves them."""
        groups = getattr(self.K, "groups", self.groups)  # those of a split matrix have other materials
        what = self.K, self.constraint_map, self.points, self.plan
        springs = self.attached and self.attached.K
        return LinearSolver(*what, groups=groups, hanging=self._hanging, springs=springs)

    def solve(
        self,
        forces: Array,
        prescribed: Array | None = None,
        tolerance: float | None = None,
        start: Array | None = None,
    ) -> tuple[Array, Solution]:
        """Return the displacements (n, 3) under nodal forces (n, 3), and the Solution."""
        tolerance = self.tolerance if tolerance is None else tolerance
        near = None if start is None else self.gather(start)
        solution = self.equations.solve(self.gather(forces), tolerance, self.progress, prescribed, near)
        return self.scatter(solution.x), solution

    def residual(self, u: Array, forces: Array) -> Array:
        """Return K u - f as nodal forces (n, 3) in N: reactions where something is prescribed."""
        out = 0.0 - forces
        out[self.nodes] = (self.K @ self.gather(u) - self.gather(forces)).reshape(-1, 3)
        return out

    def destroy(self) -> None:
        """Release what is kept outside of Python."""

    def gather(self, values: Array) -> Array:
        """Return nodal values (n, 3) as those of the equations, (3a,)."""
        return values.ravel() if self._are_all else values[self.nodes].ravel()

    def scatter(self, values: Array) -> Array:
        """Return values of the equations (3a,) as nodal values (n, 3), 0 on nodes without equations."""
        if self._are_all:
            return values.reshape(-1, 3)
        out = np.zeros((self.n_nodes, 3))
        out[self.nodes] = values.reshape(-1, 3)
        return out


def largest_bulk_over_shear(groups: Sequence[ElementGroup]) -> tuple[float, float]:
    """Return the largest ratio of moduli of elements with known dilatations, and of the others."""
    largest = [0.0, 0.0]
    for group in groups:
        i = 0 if group.has_dilatations else 1
        largest[i] = max(largest[i], bulk_over_shear(group.material.C))
    return largest[0], largest[1]


def stiffness_contrast(groups: Sequence[ElementGroup]) -> float:
    """Return the largest modulus of the stiffest material to that of the softest."""
    moduli = [float(np.abs(group.material.C).max()) for group in groups]
    return max(moduli) / min(moduli)


def renumber(
    points: Array, groups: Sequence[ElementGroup], ordered: bool = False
) -> tuple[Ints, list[ElementGroup]]:
    """Return the rows of the nodes that elements use, and the groups numbered by them, perhaps in slabs."""
    used, number = np.zeros(len(points), dtype=bool), np.zeros(len(points), dtype=np.int32)
    for group in groups:
        used[group.nodes] = True
    nodes = np.flatnonzero(used)
    if ordered and _mean_span(groups) > FAR * len(nodes) ** (2 / 3):
        nodes = nodes[in_slabs(points[nodes])]
    elif len(nodes) == len(points):
        return nodes, list(groups)
    number[nodes] = np.arange(len(nodes))
    return nodes, [replace(group, nodes=number[group.nodes]) for group in groups]


def _mean_span(groups: Sequence[ElementGroup]) -> float:
    """Return how far the nodes of an element are apart in their order, on average."""
    return sum(float(np.ptp(group.nodes, axis=1).sum()) for group in groups) / sum(map(len, groups))


def in_slabs(points: Array) -> Ints:
    """Return an order of points (n, 3) by slabs across the longest axis and rows in these."""
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    spacing = (np.prod(size) / len(points)) ** (1 / 3)
    short, *others = np.argsort(size)
    slabs = (points[:, others] - low[others]) // (SLAB * spacing)
    return np.lexsort((points[:, short], *slabs.T))


def select(groups: Sequence[ElementGroup], moving: Mask) -> list[ElementGroup]:
    """Return the elements that have a node in `moving` (n,), group by group."""
    moves = [np.asarray(moving[group.nodes].any(axis=1)) for group in groups]
    return [group.take(chosen) for group, chosen in zip(groups, moves, strict=True) if chosen.any()]

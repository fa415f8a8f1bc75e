"""Element groups: elements of one type, rule and material, computed together, compiled or in NumPy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.custom import is_builtin
from kratos_lite.elements.exact_rules import (
    AFFINE,
    CURVED,
    ROUNDING,
    STRAIGHT,
    Geometries,
    geometries,
    interpolations,
)
from kratos_lite.elements.formulations import (
    NON_LOCKING,
    element_of,
    formulations_of,
    is_nearly_incompressible,
)
from kratos_lite.elements.tables import tabulate
from kratos_lite.elements.total_lagrangian import strain_change
from kratos_lite.errors import InputError, MeshError, ModelError
from kratos_lite.materials import Material
from kratos_lite.mesh import Block, Mesh, with_rows
from kratos_lite.native import kernels
from kratos_lite.quadrature import Rule, by_order, rule_for
from kratos_lite.typing import Array, Ints, Mask, Numbers, Rows
from kratos_lite.validation import whole_number

if TYPE_CHECKING:
    from kratos_lite.elements.tables import StrainTables

FEW = 16
"""Nodes that get something are few if they are so many times fewer than all."""
CHUNK_BYTES = 4_000_000
"""Memory of the element matrices computed at once: small enough for the cache."""


def compiled(name: str, element: type[KinematicLinear] | None = None) -> Any:
    """Return the kernels of a name, or None if a method of a user does their part for an element class."""
    return kernels(name) if element is None or not element.custom else None


def as_double(values: Any) -> Array:
    """Return numbers as kernels take them."""
    return np.ascontiguousarray(values, dtype=float)


@dataclass(eq=False)
class PointStates:
    """What a nonlinear law has at the Gauss points (m, g) of a group, at the end of a step."""

    stress: Array  # (m, g, 6) Pa; the second Piola–Kirchhoff stress of finite strains
    variables: dict[str, Array]  # internal variables (m, g, size)
    modes: Array | None = None  # (m, 21), amplitudes of enhanced strains

    def take(self, chosen: Any) -> PointStates:
        """Return those of some elements, a mask (m,) or a slice."""
        variables = {name: values[chosen] for name, values in self.variables.items()}
        modes = None if self.modes is None else self.modes[chosen]
        return PointStates(self.stress[chosen], variables, modes)


@dataclass(eq=False)
class ElementGroup:
    """Elements that share class, rule and material."""

    element: type[KinematicLinear]
    rule: Rule
    material: Material
    nodes: Rows  # (m, k) int, indices of the points
    rows: Ints  # (m,) int, indices of the elements in the mesh
    prestress: Array | None = None  # (m, 6) float in Pa, or None
    states: PointStates | None = None  # of a result, where the law is not linear
    heating: Array | None = None  # (m, k) float in K, temperatures of the nodes beyond those without strain
    factors: Array | None = None  # (m,) float, of the stiffness of each element, or None

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def is_linear(self) -> bool:
        """Whether stresses and forces are linear in the displacements."""
        return self.material.is_linear and not self.element.finite

    @property
    def is_proven(self) -> bool:
        """Whether class and rule are those of the library, which leave no hourglass modes in a mesh."""
        return self.rule is self.element.rule and is_builtin(self.element)

    @property
    def has_dilatations(self) -> bool:
        """Whether the dilatations of the elements are known."""
        # Those of the library's B-bar elements are their projected ones, those of enhanced elements their
        # means: the modes take up the others. Factors of the stiffness are not split into pressures.
        return self.factors is None and not self.element.custom and self.strain_tables() is not None

    def tables(self, rule: Rule | None = None) -> tuple[Rows, Array, Array, Array]:
        """Return nodes, N (g, k), dN (g, k, 3) and weights (g,) of a rule, or the own one, for kernels."""
        rule = self.rule if rule is None else rule
        N, dN = tabulate(self.element.shape, rule)
        nodes = np.ascontiguousarray(self.nodes, dtype=np.int32)
        return nodes, as_double(N), as_double(dN), as_double(rule.weights)

    def kernel_arguments(self) -> tuple[Array, Array | None]:
        """Return C (6, 6) and the initial stress of elements (m, 6), or (m, 7) with factors of C."""
        C, stress = as_double(self.material.C), self.prestress
        if self.heating is not None and self.is_evenly_heated:
            thermal = self.elastic(self._swollen(self.heating.mean(axis=1)))
            stress = -thermal if stress is None else stress - thermal
        if self.factors is not None:
            stress = np.zeros((len(self), 6)) if stress is None else stress
            stress = np.column_stack([stress, self.factors])
        return C, None if stress is None else as_double(stress)

    def elastic(self, strain: Array, chunk: Any = slice(None)) -> Array:
        """Return C ε in Pa of strains (m, …, 6) of a chunk, with the factors of its elements."""
        stress = strain @ self.material.C.T
        if self.factors is None:
            return stress
        factors = self.factors[chunk]
        return np.asarray(factors.reshape(factors.shape + (1,) * (stress.ndim - 1)) * stress)

    def scaled(self, matrices: Array, chunk: slice = slice(None)) -> Array:
        """Return stiffnesses or internal forces (m, …) of a chunk times the factors of its elements."""
        if self.factors is None:
            return matrices
        return np.asarray(self.factors[chunk].reshape((-1,) + (1,) * (matrices.ndim - 1)) * matrices)

    def strain_tables(self) -> StrainTables | None:
        """Return what the element adds to the strain of the displacements, as kernels take it."""
        return self.element.strain_tables(self.rule, as_double(self.material.C))

    def at(self, points: Array, chunk: slice = slice(None)) -> KinematicLinear:
        """Return the elements of a chunk, placed at `points` (n, 3)."""
        return self.element(points[self.nodes[chunk]], self.rule)

    def take(self, chosen: Mask) -> ElementGroup:
        """Return the group of the chosen elements, a mask (m,)."""
        if chosen.all():
            return self
        names = ("nodes", "rows", "prestress", "heating", "factors")
        arrays = {name: getattr(self, name) for name in names}
        some: dict[str, Any] = {n: None if a is None else a[chosen] for n, a in arrays.items()}
        return replace(self, states=self.states and self.states.take(chosen), **some)

    def chunks(self, memory: int = CHUNK_BYTES, within: slice | None = None) -> Iterator[slice]:
        """Cut the group, or a slice of it, into slices whose matrices take about `memory` bytes each."""
        first, last = (within.start, within.stop) if within else (0, len(self))
        k = self.nodes.shape[1]
        per_element = 8 * (9 * k * k + 2 * len(self.rule) * 3 * k)
        step = max(1, memory // per_element)
        for start in range(first, last, step):
            yield slice(start, min(start + step, last))

    @property
    def is_evenly_heated(self) -> bool:
        """Whether an element has one thermal strain, as kernels take it, or none."""
        known = self.heating is None or self.element.shape.degree == 1
        return known or not np.ptp(self.heating, axis=1).any()  # type: ignore[arg-type]

    @property
    def without_initial(self) -> ElementGroup:
        """The group without prestress and thermal strain."""
        return replace(self, prestress=None, heating=None)

    def thermal_strain(self, chunk: slice = slice(None)) -> Any:
        """Return α ΔT at the Gauss points of a chunk, (m, g, 6), or 0; linear elements have their mean."""
        if self.heating is None:
            return 0.0
        N = tabulate(self.element.shape, self.rule)[0]
        N = np.full_like(N, 1 / N.shape[1]) if self.is_evenly_heated else N
        return self._swollen(self.heating[chunk] @ N.T)

    def _swollen(self, temperatures: Array) -> Array:
        """Return the strain (..., 6) of temperatures, of large displacements that of Green by α ΔT."""
        strain = temperatures[..., None] * self.material.expansion
        if not self.element.finite:
            return strain
        return strain_change(np.eye(3), voigt.tensor(strain * voigt.HALF_SHEAR))

    def initial_stress(self, chunk: slice) -> Array | float:
        """Return the stress of a chunk where nothing is displaced, (m, 1 or g, 6), or 0."""
        prestress = 0.0 if self.prestress is None else self.prestress[chunk, None, :]
        if self.heating is None:
            return prestress
        return prestress - self.elastic(self.thermal_strain(chunk), chunk)


def by_mass_rule(points: Array, group: ElementGroup, factors: int, flow: bool = False) -> list[ElementGroup]:
    """Cut a group into parts whose rule is exact for a product of shape functions over their cells."""
    parts = group.element.mass_rules(geometries_of(points, group), factors, flow)
    return [replace(group.take(mask), rule=rule) for mask, rule in parts]


def geometries_of(points: Array, group: ElementGroup) -> Geometries:
    """Return AFFINE, STRAIGHT or CURVED of the elements of a group, (m,); see `geometries`."""
    shape, nodes = group.element.shape, group.tables()[0]
    if interpolated := getattr(kernels("gauss"), "interpolated", None):
        geometry_of, points = np.full(len(nodes), CURVED, dtype=np.int8), as_double(points)
        for geometry in (AFFINE, STRAIGHT):
            spanned, curved = interpolations(shape)[geometry], geometry_of == CURVED
            if spanned and curved.any():
                cells = nodes if curved.all() else nodes[curved]
                geometry_of[curved] = np.where(
                    interpolated(points, cells, *spanned, ROUNDING) > 0, geometry, CURVED
                )
        return geometry_of
    parts = [geometries(shape, points[nodes[chunk]]) for chunk in group.chunks()]
    return np.concatenate([np.zeros(0, dtype=np.int8), *parts])


def add_nodal(total: Array, nodes: Numbers, values: Array) -> None:
    """Add element vectors (m, k, 3) to nodal vectors `total` (n, 3)."""
    flat: Any = nodes.ravel()
    rows: Any = slice(None)
    if FEW * len(flat) < len(total):  # most rows get nothing
        rows, flat = np.unique(flat, return_inverse=True)
    size = len(total[rows])
    for axis in range(total.shape[1]):
        total[rows, axis] += np.bincount(flat, weights=values[..., axis].ravel(), minlength=size)


# ---- grouping --------------------------------------------------------------------------------------


def element_groups_of(
    mesh: Mesh,
    materials: Sequence[Material],
    material_of: Ints,
    rules: Mapping[int, Rule | int],
    rule_of: Ints,
    prestress: Array | None,
    factors: Array | None,
    formulation: str | None,
    unnamed: str,
) -> list[ElementGroup]:
    """Return the elements of a mesh grouped by type, rule and material.

    `material_of` and `rule_of` (m,) are numbers, -1 for no material and for the element's own rule.
    """
    groups = []
    for block, at in with_rows(mesh.blocks):
        if not len(block):
            continue
        element_class(mesh, block)
        for material, rule, cells in _alike(mesh, block, material_of[at], rule_of[at]):
            element = _element_for(mesh, block, materials[material], formulation, unnamed)
            rows = at.start + cells
            other = rules.get(rule)
            proven = other is None and is_builtin(element)
            chosen = element.rule if proven else _fitting(element, element.rule if other is None else other)
            nodes = block.nodes if len(cells) == len(block) else block.nodes[cells]
            stress = None if prestress is None else prestress[rows]
            if stress is not None and stress.any() and element.finite and not materials[material].is_linear:
                raise ModelError(
                    f"{mesh.place(block, 0)}: a prestress is not for {type(materials[material]).__name__}, "
                    "whose stress is not linear in the strain; strain the body by supports or loads instead"
                )
            scale = None if factors is None or (factors[rows] == 1).all() else factors[rows]
            group = ElementGroup(element, chosen, materials[material], nodes, rows, stress, factors=scale)
            if scale is not None and not group.is_linear:
                raise ModelError(
                    f"{mesh.place(block, 0)}: factors of the stiffness take linear laws and small strains; "
                    f"got {type(materials[material]).__name__}, {element.__name__}"
                )
            groups.append(group)
    if mesh.whole and not groups:
        raise ModelError("the model has no elements; nothing can be solved")
    return groups


def _element_for(
    mesh: Mesh, block: Block, material: Material, formulation: str | None, unnamed: str
) -> type[KinematicLinear]:
    """Return the element class of a block with a material; plastic flow and large strains choose theirs."""
    finite = material.strain_measure == "finite"
    if finite or not material.is_linear:
        words = ("f_bar", "total_lagrangian") if finite else ("b_bar", "standard")
        locks = not material.is_linear and (not finite or is_nearly_incompressible(material.C))
        word = words[not locks or words[0] not in formulations_of(element_class(mesh, block).shape)]
        formulation = word if formulation == NON_LOCKING else formulation
        unnamed = word if unnamed == NON_LOCKING else unnamed
    element = element_of(block.name, formulation, material.C, unnamed)
    if finite and not element.finite:
        raise ModelError(
            f"{mesh.place(block, 0)}: {type(material).__name__} is a law of finite strains, and "
            f"{element.__name__} has small ones; take Model(…, formulation='total_lagrangian')"
        )
    if material.is_linear and element.formulation == "f_bar":
        raise ModelError(
            f"{mesh.place(block, 0)}: {type(material).__name__}, linear in Green's strain, has no "
            "pressure of det F for f_bar; take total_lagrangian, or a law such as NeoHookean3D"
        )
    if not material.is_linear and "local_system" in element.custom:
        raise ModelError(
            f"{mesh.place(block, 0)}: {element.__name__} has a local system of its own, which is linear; "
            f"{type(material).__name__} needs an element with a B"
        )
    return element


def group_of_element(mesh: Mesh, groups: Sequence[ElementGroup], id: int) -> ElementGroup:
    """Return the one element of an id as a group of its own."""
    number = whole_number(id, "the id of an element", least=0, error=MeshError)
    rows = np.flatnonzero(mesh.element_ids == number)
    if len(rows) != 1:
        count = f"{len(rows)} elements have" if len(rows) else "no element has"
        ids = mesh.element_ids
        raise MeshError(f"{count} the id {number}; ids run from {ids.min()} to {ids.max()}")
    return next(group.take(group.rows == rows[0]) for group in groups if (group.rows == rows[0]).any())


def _alike(mesh: Mesh, block: Block, material: Ints, rule: Ints) -> list[tuple[int, int, Ints]]:
    """Return number of material, number of rule and cells of each group in a block."""
    if material.min() < 0:
        raise _without_material(mesh, block, int(np.argmax(material < 0)))
    if material.min() == material.max() and rule.min() == rule.max():
        return [(int(material[0]), int(rule[0]), np.arange(len(block)))]
    code = material * (int(rule.max()) + 2) + rule
    order = np.argsort(code, kind="stable")
    alike = np.split(order, np.flatnonzero(np.diff(code[order])) + 1)
    return [(int(material[cells[0]]), int(rule[cells[0]]), cells) for cells in alike]


def _without_material(mesh: Mesh, block: Block, cell: int) -> ModelError:
    run_file = ", or solve the run file that names its materials" if mesh.source.endswith(".mdpa") else ""
    return ModelError(
        f"{mesh.place(block, cell)} has no material (property {block.properties[cell]}); "
        f"give one with Model(mesh, material), model.assign or --material{run_file}"
    )


def _fitting(element: type[KinematicLinear], chosen: Rule | int) -> Rule:
    """Return a rule or an order of integration as a rule that fits an element."""
    cell = element.shape.cell
    rule = by_order(cell, chosen) if isinstance(chosen, int) else chosen
    total, volume = float(rule.weights.sum()), float(rule_for(cell, 1).weights.sum())
    if not abs(total / volume - 1) <= 1e-9:
        raise InputError(
            f"{rule} does not fit {element.__name__}: its weights miss the volume of the cell, a {cell}: "
            f"they sum to {total:g}, expected {volume:g}; take kratos_lite.quadrature.{cell}(degree=…)"
        )
    return rule


def element_class(mesh: Mesh, block: Block, formulation: str | None = None) -> type[KinematicLinear]:
    """Return the element class of a block, whatever its material; raise InputError for unknown types."""
    try:
        return element_of(block.name, formulation, None)
    except InputError as error:
        raise InputError(f"{mesh.place(block, 0)}: {error}") from None

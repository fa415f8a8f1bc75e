"""Fields: what elements give at their Gauss points, and the nodal vectors that follow from it.

Every function takes the compiled kernels where the element class and the material leave the methods
that they stand for as they are; a class that overrides one of them is computed by its own methods, in
cache-sized chunks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.kinematic_linear import has_positive_row_sums, tabulate
from kratos_lite.materials import LinearMaterial
from kratos_lite.native import kernels
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes import Hexahedron8, Pyramid5, Shape, Tetrahedron4, Wedge6
from kratos_lite.typing import Array

GEOMETRY = ("__init__", "_jacobian", "_gauss", "dV")
CORNER_SHAPES: dict[str, type[Shape]] = {
    "tetrahedron": Tetrahedron4,
    "hexahedron": Hexahedron8,
    "wedge": Wedge6,
    "pyramid": Pyramid5,
}


def _compiled(element: type[KinematicLinear], *methods: str) -> Any:
    """Return the kernels if they stand for these methods of an element class, else None."""
    if all(getattr(element, name) is getattr(KinematicLinear, name) for name in methods):
        return kernels("gauss")
    return None


def _compiled_law(group: ElementGroup, *methods: str, stress: bool = True) -> Any:
    """Return the kernels if they stand for the strains, or the stresses, of a group, else None."""
    if stress and type(group.material).stress is not LinearMaterial.stress:
        return None
    return _compiled(group.element, *GEOMETRY, "strain", *methods)


def _floats(values: Any) -> Array:
    return np.ascontiguousarray(values, dtype=float)


def _rows(nodes: NDArray[Any]) -> NDArray[np.int32]:
    return np.ascontiguousarray(nodes, dtype=np.int32)


def _placed(points: Array, group: ElementGroup) -> tuple[Any, ...]:
    """Return points, nodes, dN and weights of a group, as kernels take them."""
    _, dN = tabulate(group.element.shape, group.rule)
    return _floats(points), _rows(group.nodes), _floats(dN), _floats(group.rule.weights)


def _weighed(points: Array, group: ElementGroup, rule: Rule) -> tuple[Any, ...]:
    """Return points, nodes, N, dN and weights of a group with a rule, as kernels take them."""
    N, dN = tabulate(group.element.shape, rule)
    return _floats(points), _rows(group.nodes), _floats(N), _floats(dN), _floats(rule.weights)


def _strained(points: Array, group: ElementGroup, u: Array, stress: bool = True) -> tuple[Any, ...]:
    """Return what kernels take to compute strains, or stresses, of displacements u (n, 3)."""
    if not stress:  # a strain is the stress of C = 1
        return *_placed(points, group), _floats(u), np.eye(6), None
    prestress = None if group.prestress is None else _floats(group.prestress)
    return *_placed(points, group), _floats(u), _floats(group.material.C), prestress


# ---- geometry ------------------------------------------------------------------------------------


def clearly_positive(
    points: Array, nodes: NDArray[Any], element: type[KinematicLinear], dN: Array, g: int
) -> NDArray[np.bool_]:
    """Return a mask (m,) of the elements whose det J is so clearly > 0 that none needs a closer look.

    At every point of `dN` (g', k, 3) it is above 1e-9 of its mean at the first `g`, and above a thousand
    times what rounding of the coordinates makes of it.  Without kernels every element needs the closer look.
    """
    module = _compiled(element, "__init__", "_jacobian", "determinants")
    if module is None:
        return np.zeros(len(nodes), dtype=bool)
    weights = np.where(np.arange(len(dN)) < g, 1 / g, 0.0)
    return np.asarray(module.clearly_positive(_floats(points), _rows(nodes), _floats(dN), weights) > 0)


def volumes(points: Array, group: ElementGroup) -> Array:
    """Return the volume of each Gauss point, γ det J, as (m, g) in m³.

    >>> from kratos_lite import Isotropic3D, Model, box
    >>> model = Model(box(cells=(2, 1, 1)), Isotropic3D(E=1.0, nu=0.3))
    >>> volumes(model.mesh.points, model.element_groups()[0]).sum(axis=1).round(12).tolist()
    [0.5, 0.5]
    """
    if module := _compiled(group.element, *GEOMETRY):
        return np.asarray(module.volumes(*_placed(points, group)))
    return np.concatenate([group.at(points, chunk).dV for chunk in group.chunks()])


# ---- loads and masses ------------------------------------------------------------------------------


def body_force(points: Array, group: ElementGroup, b: Array) -> Array:
    """Return ∫ N b dV of a group as nodal forces (n, 3) in N; b (3,), or nodal (n, 3), in N/m³."""
    nodal = b.ndim == 2
    if nodal and (module := _compiled(group.element, "__init__", "_jacobian", "body_force", "scalar_mass")):
        rule = group.element.mass_rule
        return np.asarray(module.body_force(*_weighed(points, group, rule), _floats(b)))
    if not nodal and (module := _compiled(group.element, *GEOMETRY, "body_force")):
        return np.asarray(module.shares(*_weighed(points, group, group.rule)) * b)
    total = np.zeros_like(points)
    for chunk in group.chunks():
        nodes = group.nodes[chunk]
        add_nodal(total, nodes, group.at(points, chunk).body_force(b[nodes] if nodal else b))
    return total


def lumped_mass(points: Array, groups: Sequence[ElementGroup]) -> Array:
    """Return the mass of each node, (n,) in kg: `KinematicLinear.lumped_mass` of all elements."""
    total = np.zeros((len(points), 1))
    for group in groups:
        for chunk in group.chunks():
            part = replace(group, nodes=group.nodes[chunk], rows=group.rows[chunk], prestress=None)
            add_nodal(total, part.nodes, _element_masses(points, part)[..., None])
    return total[:, 0]


def _element_masses(points: Array, group: ElementGroup) -> Array:
    """Return the lumped masses (m, k) of the elements of a group in kg."""
    density, rule = group.material.density, group.element.mass_rule
    module = _compiled(group.element, "__init__", "_jacobian", "scalar_mass", "lumped_mass")
    if module is None:
        return group.at(points).lumped_mass(density)
    sums, diagonal = module.mass_sums(*_weighed(points, group, rule))
    scaled = diagonal * (sums.sum(axis=1) / diagonal.sum(axis=1))[:, None]
    if has_positive_row_sums(group.element.shape, rule):
        scaled = np.where((sums > 0).all(axis=1)[:, None], sums, scaled)
    return np.asarray(density * scaled)


# ---- strains and stresses --------------------------------------------------------------------------


def at_gauss(points: Array, group: ElementGroup, u: Array, *, stress: bool = True) -> Array:
    """Return stresses in Pa with prestress, or strains, (m, g, 6) of displacements u (n, 3) in m."""
    if module := _compiled_law(group, stress=stress):
        return np.asarray(module.stress(*_strained(points, group, u, stress)))
    parts = [_value(group.at(points, chunk), group, u, chunk, stress) for chunk in group.chunks()]
    return np.concatenate(parts)


def _value(
    element: KinematicLinear, group: ElementGroup, u: Array, chunk: slice, stress: bool = True
) -> Array:
    """Return stresses, or strains, (m, g, 6) of the placed elements of a chunk by their own methods."""
    strain = element.strain(u[group.nodes[chunk]])
    return group.material.stress(strain) + group.initial_stress(chunk) if stress else strain


def internal_load(points: Array, groups: Sequence[ElementGroup], u: Array) -> Array:
    """Return ∫ B^T σ dV of displacements u (n, 3) as nodal forces (n, 3) in N."""
    total = np.zeros_like(points)
    for group in groups:
        if module := _compiled_law(group, "internal_load"):
            total += module.internal_load(*_strained(points, group, u))
            continue
        for chunk in group.chunks():
            element = group.at(points, chunk)
            add_nodal(total, group.nodes[chunk], element.internal_load(_value(element, group, u, chunk)))
    return total


def totals(points: Array, groups: Sequence[ElementGroup], u: Array) -> tuple[float, float, int]:
    """Return strain energy in J, largest von Mises stress at a Gauss point in Pa, row of its element."""
    energy, largest, row = 0.0, 0.0, 0
    for group in groups:
        module = _compiled_law(group)
        parts = (
            [module.totals(*_strained(points, group, u))]
            if module
            else [_totals(points, group, u, chunk) for chunk in group.chunks()]
        )
        for share, mises, at in parts:
            energy += share
            if mises > largest:
                largest, row = mises, int(group.rows[at])
    return energy, largest, row


def _totals(points: Array, group: ElementGroup, u: Array, chunk: slice) -> tuple[float, float, int]:
    element = group.at(points, chunk)
    value = element.strain(u[group.nodes[chunk]])
    elastic = group.material.stress(value)
    energy = float(((value * elastic).sum(axis=-1) * element.dV).sum()) / 2
    mises = voigt.von_mises(elastic + group.initial_stress(chunk)).max(axis=1)
    return energy, float(mises.max()), chunk.start + int(mises.argmax())


# ---- nodal values ----------------------------------------------------------------------------------


@remembered
def extrapolation(element: type[KinematicLinear], rule: Rule) -> Array:
    """Return the matrix (n, g) from values at Gauss points to values at nodes.

    The values are fitted by least squares with the functions of the corner cell (trilinear in a
    hexahedron), where stresses of displacement elements are most accurate, and read off at the nodes.
    """
    corner = CORNER_SHAPES.get(element.shape.cell)
    if corner is None:
        return np.full((len(element.nodes), len(rule)), 1 / len(rule))
    at_points = np.array([corner.N(xi) for xi in rule.points])
    at_nodes = np.array([corner.N(xi) for xi in element.nodes])
    mean = np.full((len(rule), len(rule)), 1 / len(rule))  # apart, so that few points still give constants
    return np.asarray(at_nodes @ np.linalg.pinv(at_points) @ (np.eye(len(rule)) - mean) + mean[:1])


def averages(
    points: Array, groups: Sequence[ElementGroup], u: Array, n_elements: int, *, stress: bool = True
) -> tuple[Array, Array]:
    """Return stresses, or strains: means over the volume of each element (m, 6) and nodal (n, 6).

    Nodal values are extrapolated in each element and averaged over the elements around each node.
    One pass over the elements gives both.
    """
    total, count = np.zeros((len(points), 6)), np.zeros(len(points))
    means = np.zeros((n_elements, 6))
    for group in groups:
        nodal, mean = _averages(points, group, u, stress)
        total += nodal
        means[group.rows] = mean
        count += np.bincount(group.nodes.ravel(), minlength=len(total))
    return means, total / np.maximum(count, 1)[:, None]


def _averages(points: Array, group: ElementGroup, u: Array, stress: bool) -> tuple[Array, Array]:
    """Return the sums of the nodal values (n, 6) of a group and the means of its elements (m, 6)."""
    to_nodes = _floats(extrapolation(group.element, group.rule))
    if module := _compiled_law(group, stress=stress):
        nodal, mean = module.averages(*_strained(points, group, u, stress), to_nodes)
        return nodal, mean
    total, means = np.zeros((len(points), 6)), np.zeros((len(group), 6))
    for chunk in group.chunks():
        element = group.at(points, chunk)
        value, volume = _value(element, group, u, chunk, stress), element.dV[..., None]
        means[chunk] = (value * (volume / volume.sum(axis=1, keepdims=True))).sum(axis=1)
        add_nodal(total, group.nodes[chunk], to_nodes @ value)
    return total, means

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
from kratos_lite.batches import Batch, add_nodal
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.kinematic_linear import has_positive_row_sums, tabulate
from kratos_lite.materials import LinearMaterial
from kratos_lite.native import kernels
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes import Hexahedron8, Pyramid5, Shape, Tetrahedron4, Wedge6

Array = NDArray[np.float64]
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


def _compiled_law(batch: Batch, *methods: str, stress: bool = True) -> Any:
    """Return the kernels if they stand for the strains, or the stresses, of a batch, else None."""
    if stress and type(batch.material).stress is not LinearMaterial.stress:
        return None
    return _compiled(batch.element, *GEOMETRY, "strain", *methods)


def _floats(values: Any) -> Array:
    return np.ascontiguousarray(values, dtype=float)


def _rows(nodes: NDArray[Any]) -> NDArray[np.int32]:
    return np.ascontiguousarray(nodes, dtype=np.int32)


def _placed(points: Array, batch: Batch) -> tuple[Any, ...]:
    """Return points, nodes, dN and weights of a batch, as kernels take them."""
    _, dN = tabulate(batch.element.shape, batch.rule)
    return _floats(points), _rows(batch.nodes), _floats(dN), _floats(batch.rule.weights)


def _weighed(points: Array, batch: Batch, rule: Rule) -> tuple[Any, ...]:
    """Return points, nodes, N, dN and weights of a batch with a rule, as kernels take them."""
    N, dN = tabulate(batch.element.shape, rule)
    return _floats(points), _rows(batch.nodes), _floats(N), _floats(dN), _floats(rule.weights)


def _strained(points: Array, batch: Batch, u: Array, stress: bool = True) -> tuple[Any, ...]:
    """Return what kernels take to compute strains, or stresses, of displacements u (n, 3)."""
    if not stress:  # a strain is the stress of C = 1
        return *_placed(points, batch), _floats(u), np.eye(6), None
    prestress = None if batch.prestress is None else _floats(batch.prestress)
    return *_placed(points, batch), _floats(u), _floats(batch.material.C), prestress


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


def volumes(points: Array, batch: Batch) -> Array:
    """Return the volume of each Gauss point, γ det J, as (m, g) in m³.

    >>> from kratos_lite import Isotropic3D, Model, box
    >>> model = Model(box(cells=(2, 1, 1)), Isotropic3D(E=1.0, nu=0.3))
    >>> volumes(model.mesh.points, model.batches()[0]).sum(axis=1).round(12).tolist()
    [0.5, 0.5]
    """
    if module := _compiled(batch.element, *GEOMETRY):
        return np.asarray(module.volumes(*_placed(points, batch)))
    return np.concatenate([batch.at(points, chunk).dV for chunk in batch.chunks()])


# ---- loads and masses ------------------------------------------------------------------------------


def body_force(points: Array, batch: Batch, b: Array) -> Array:
    """Return ∫ N b dV of a batch as nodal forces (n, 3) in N; b (3,), or nodal (n, 3), in N/m³."""
    nodal = b.ndim == 2
    if nodal and (module := _compiled(batch.element, "__init__", "_jacobian", "body_force", "scalar_mass")):
        rule = batch.element.mass_rule
        return np.asarray(module.body_force(*_weighed(points, batch, rule), _floats(b)))
    if not nodal and (module := _compiled(batch.element, *GEOMETRY, "body_force")):
        return np.asarray(module.shares(*_weighed(points, batch, batch.rule)) * b)
    total = np.zeros_like(points)
    for chunk in batch.chunks():
        nodes = batch.nodes[chunk]
        add_nodal(total, nodes, batch.at(points, chunk).body_force(b[nodes] if nodal else b))
    return total


def lumped_mass(points: Array, batches: Sequence[Batch]) -> Array:
    """Return the mass of each node, (n,) in kg: `KinematicLinear.lumped_mass` of all elements."""
    total = np.zeros((len(points), 1))
    for batch in batches:
        for chunk in batch.chunks():
            part = replace(batch, nodes=batch.nodes[chunk], rows=batch.rows[chunk], prestress=None)
            add_nodal(total, part.nodes, _element_masses(points, part)[..., None])
    return total[:, 0]


def _element_masses(points: Array, batch: Batch) -> Array:
    """Return the lumped masses (m, k) of the elements of a batch in kg."""
    density, rule = batch.material.density, batch.element.mass_rule
    module = _compiled(batch.element, "__init__", "_jacobian", "scalar_mass", "lumped_mass")
    if module is None:
        return batch.at(points).lumped_mass(density)
    sums, diagonal = module.mass_sums(*_weighed(points, batch, rule))
    scaled = diagonal * (sums.sum(axis=1) / diagonal.sum(axis=1))[:, None]
    if has_positive_row_sums(batch.element.shape, rule):
        scaled = np.where((sums > 0).all(axis=1)[:, None], sums, scaled)
    return np.asarray(density * scaled)


# ---- strains and stresses --------------------------------------------------------------------------


def at_gauss(points: Array, batch: Batch, u: Array, *, stress: bool = True) -> Array:
    """Return stresses in Pa with prestress, or strains, (m, g, 6) of displacements u (n, 3) in m."""
    if module := _compiled_law(batch, stress=stress):
        return np.asarray(module.stress(*_strained(points, batch, u, stress)))
    parts = [_value(batch.at(points, chunk), batch, u, chunk, stress) for chunk in batch.chunks()]
    return np.concatenate(parts)


def _value(element: KinematicLinear, batch: Batch, u: Array, chunk: slice, stress: bool = True) -> Array:
    """Return stresses, or strains, (m, g, 6) of the placed elements of a chunk by their own methods."""
    strain = element.strain(u[batch.nodes[chunk]])
    return batch.material.stress(strain) + batch.initial_stress(chunk) if stress else strain


def internal_load(points: Array, batches: Sequence[Batch], u: Array) -> Array:
    """Return ∫ B^T σ dV of displacements u (n, 3) as nodal forces (n, 3) in N."""
    total = np.zeros_like(points)
    for batch in batches:
        if module := _compiled_law(batch, "internal_load"):
            total += module.internal_load(*_strained(points, batch, u))
            continue
        for chunk in batch.chunks():
            element = batch.at(points, chunk)
            add_nodal(total, batch.nodes[chunk], element.internal_load(_value(element, batch, u, chunk)))
    return total


def totals(points: Array, batches: Sequence[Batch], u: Array) -> tuple[float, float, int]:
    """Return strain energy in J, largest von Mises stress at a Gauss point in Pa, row of its element."""
    energy, largest, row = 0.0, 0.0, 0
    for batch in batches:
        module = _compiled_law(batch)
        parts = (
            [module.totals(*_strained(points, batch, u))]
            if module
            else [_totals(points, batch, u, chunk) for chunk in batch.chunks()]
        )
        for share, mises, at in parts:
            energy += share
            if mises > largest:
                largest, row = mises, int(batch.rows[at])
    return energy, largest, row


def _totals(points: Array, batch: Batch, u: Array, chunk: slice) -> tuple[float, float, int]:
    element = batch.at(points, chunk)
    value = element.strain(u[batch.nodes[chunk]])
    elastic = batch.material.stress(value)
    energy = float(((value * elastic).sum(axis=-1) * element.dV).sum()) / 2
    mises = voigt.von_mises(elastic + batch.initial_stress(chunk)).max(axis=1)
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
    points: Array, batches: Sequence[Batch], u: Array, n_elements: int, *, stress: bool = True
) -> tuple[Array, Array]:
    """Return stresses, or strains: means over the volume of each element (m, 6) and nodal (n, 6).

    Nodal values are extrapolated in each element and averaged over the elements around each node.
    One pass over the elements gives both.
    """
    total, count = np.zeros((len(points), 6)), np.zeros(len(points))
    means = np.zeros((n_elements, 6))
    for batch in batches:
        nodal, mean = _averages(points, batch, u, stress)
        total += nodal
        means[batch.rows] = mean
        count += np.bincount(batch.nodes.ravel(), minlength=len(total))
    return means, total / np.maximum(count, 1)[:, None]


def _averages(points: Array, batch: Batch, u: Array, stress: bool) -> tuple[Array, Array]:
    """Return the sums of the nodal values (n, 6) of a batch and the means of its elements (m, 6)."""
    to_nodes = _floats(extrapolation(batch.element, batch.rule))
    if module := _compiled_law(batch, stress=stress):
        nodal, mean = module.averages(*_strained(points, batch, u, stress), to_nodes)
        return nodal, mean
    total, means = np.zeros((len(points), 6)), np.zeros((len(batch), 6))
    for chunk in batch.chunks():
        element = batch.at(points, chunk)
        value, volume = _value(element, batch, u, chunk, stress), element.dV[..., None]
        means[chunk] = (value * (volume / volume.sum(axis=1, keepdims=True))).sum(axis=1)
        add_nodal(total, batch.nodes[chunk], to_nodes @ value)
    return total, means

"""What CalculiX 2.20 shows of a result: its order of Gauss points, and its values at nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.analysis.fields import GaussPoints, known
from kratos_lite.assembly import nodal_extrapolation
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.elements import KinematicLinear
from kratos_lite.model import reference_nodes
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes.base import at_points
from kratos_lite.typing import Array, Ints

DIGITS = {
    **dict.fromkeys((("Hexahedron8", 8), ("Hexahedron20", 8)), "%.3e"),
    **dict.fromkeys((("Tetrahedron10", 4), ("Wedge15", 9)), "%.5f"),
}
"""Those of the extrapolation in CalculiX, by cell and number of Gauss points."""
ERRORS = {
    ("Tetrahedron4", 1): (0.0, 0.0, 0.0), ("Wedge6", 2): (0.0, 0.0, 0.0), ("Wedge15", 9): (46.189, 0.0, 0.0),
    ("Tetrahedron10", 4): (30.0, 0.0, 0.0), ("Hexahedron8", 8): (31.8469, 85.3240, 8.3960),
    ("Hexahedron20", 8): (20.2780, 74.3179, 9.7269), ("Hexahedron20", 27): (5.1150, 27.7919, 5.8949),
    ("enhanced", 8): (30.3030, 139.5346, 18.0227),
}  # fmt: skip
"""Constants a, b and c of `error` by cell, or formulation, and number of Gauss points."""


def order(rule: Rule) -> Ints:
    """Return the Gauss points of a rule in the order of CalculiX, the first coordinate the quickest."""
    return np.lexsort(rule.points.round(12).T)


@remembered
def extrapolation(element: type[KinematicLinear], rule: Rule) -> Array:
    """Return the matrix (n, g) of CalculiX from values at Gauss points to nodes; ours of rules it has not.

    Corners have a fit of the functions of the corner cell, with the digits that CalculiX keeps, and mid-edge
    nodes the mean of two corners; with 27 points all nodes have a fit of their own functions.
    """
    shape, matrix = element.shape, nodal_extrapolation.extrapolation(element, rule)
    kind = shape.__name__, len(rule)
    if kind == ("Hexahedron20", 27):
        return np.asarray(np.linalg.pinv(at_points(shape.N, rule.points)).round(5))
    if kind == ("Wedge6", 2):  # by turns, whichever face the node is on
        return np.tile([[1.1455, -0.1455], [-0.1455, 1.1455]], (3, 1))
    if kind not in DIGITS:
        return matrix
    matrix = np.array([float(DIGITS[kind] % value) for value in matrix.flat]).reshape(matrix.shape)
    edges = np.array(shape.edges)
    corners = matrix[: edges.max() + 1]
    return np.vstack([corners, corners[edges].mean(axis=1)])[: len(matrix)]


OF_POINTS: dict[str, Callable[[GaussPoints], Array]] = {
    "strain": lambda at: at.strain * voigt.HALF_SHEAR,
    "mechanical_strain": lambda at: (at.strain - at.group.thermal_strain()) * voigt.HALF_SHEAR,
    "place": lambda at: at.element.gauss_points(),
    "volume": lambda at: at.element.dV,
    "energy": lambda at: at.element.dV * known([at.group])["strain_energy_density"].at(at),
}
"""Fields that are not in our table, or whose strains are the components of tensors there."""


def at_gauss(result: ElementFields, name: str) -> list[Array]:
    """Return a field (m, g, c) at the Gauss points of each group; none if the result has none."""
    field = known(result.groups).get(name)
    function = OF_POINTS.get(name, field.at if field else None)
    values = [function(result.gauss_points(group)) for group in result.groups] if function else []
    return [value.reshape(*value.shape[:2], -1) for value in values]


def averaged(result: ElementFields, name: str) -> Array | None:
    """Return a field (n, c), extrapolated and averaged at nodes."""
    if name in ("stress", "strain"):  # by a kernel, without those at Gauss points
        nodal = result._averages(name == "stress", extrapolation)[1]
        return nodal if name == "stress" else nodal * voigt.HALF_SHEAR
    values, how = at_gauss(result, name), (result.mesh.n_nodes, extrapolation)
    return nodal_extrapolation.averaged(result.groups, values, *how) if values else None


def forces(result: Any) -> Array:
    """Return the internal forces (n, 3), also of springs, which at rest are those of supports and loads."""
    if not all(group.is_linear for group in result.groups):
        return np.asarray(result.reactions + result.loads)
    total = internal_load(result.mesh.points, result.groups, result._strained)
    return total if result._springs is None else total + (result._springs @ result.u.ravel()).reshape(-1, 3)


def temperatures(result: Any) -> Array | None:
    """Return the temperatures (n,) that act in a static result, or None."""
    acting = [one for load in result._acting for one in load.acting(0.0)]
    hot = [(factor, load) for factor, load in acting if isinstance(load, Temperature)]
    differences = [factor * load.difference(result.mesh) for factor, load in hot]
    return hot[0][1].reference + np.sum(differences, axis=0) if hot else None


def error(result: ElementFields) -> Array | None:
    """Return the error (n,) that CalculiX tells of stresses, in %; None for cells that it has not.

    Where the principal stress, first or third, that is largest in an element varies there by r of its size,
    the error is max(a r, b r - c); nodes have that of the worst element, and mid-edge nodes means of corners.
    Source: ccx USER'S MANUAL, "Gradient error estimator"; a, b and c fit what ccx 2.20 writes.
    """
    worst = np.zeros(result.mesh.n_nodes)
    for group in result.groups:
        formulation = group.element.formulation
        kind = formulation if formulation == "enhanced" else group.element.shape.__name__
        if (kind, len(group.rule)) not in ERRORS:
            return None
        a, b, c = ERRORS[kind, len(group.rule)]
        principal = extremes(result.stress_in(group))
        sizes = np.abs(principal).max(axis=1)
        largest = sizes.argmax(axis=1)
        chosen = principal[np.arange(len(group)), :, largest]
        r = np.ptp(chosen, axis=1) / np.maximum(sizes.max(axis=1), np.finfo(float).tiny)
        value = np.maximum(a * r, b * r - c)
        np.maximum.at(worst, group.nodes, value[:, None])
    for group in result.groups:
        edges = np.array(group.element.shape.edges)
        between = group.nodes[:, edges.max() + 1 :]
        worst[between] = worst[group.nodes[:, edges]].mean(axis=2)[:, : between.shape[1]]
    return worst


def extremes(stress: Array) -> Array:
    """Return the first and the third principal value (..., 2) of (..., 6), of equal ones half of the digits.

    >>> extremes(np.array([30.0, 0.0, 0.0, 20.0, 0.0, 0.0])).round(12).tolist()
    [40.0, -10.0]
    """
    # The roots of a cubic by cosines: a tenth of the time of eigenvalues by LAPACK.
    radius = voigt.von_mises(stress)[..., None] * (2 / 3)
    unit = voigt.deviator(stress) / np.maximum(radius, np.finfo(float).tiny)
    angle = np.arccos(np.clip(4 * voigt.determinant(unit), -1.0, 1.0)) / 3
    mean = stress[..., :3].mean(axis=-1, keepdims=True)
    return np.asarray(mean + radius * np.cos(angle[..., None] + [0.0, 2 * np.pi / 3]))


def displacements(model: Any, u: Array, time: float = 0.0) -> Array:
    """Return displacements (n, 3) with those of reference nodes, if it is a model with supports."""
    supports = getattr(model, "supports", None)
    return u if supports is None else reference_nodes.displacements(supports, u, time)


AT_NODES: dict[str, Callable[[Any], Array | None]] = {
    "DISP": lambda result: displacements(getattr(result._analysis, "model", None), result.u),
    "NDTEMP": temperatures,
    "STRESS": partial(averaged, name="stress"),
    "TOSTRAIN": partial(averaged, name="strain"),
    "MESTRAIN": partial(averaged, name="mechanical_strain"),
    "FORC": forces,
    "PE": partial(averaged, name="accumulated_plastic_strain"),
    "ENER": partial(averaged, name="strain_energy_density"),
    "ERROR": error,
}
ALL = tuple(name for name in AT_NODES if name != "MESTRAIN")


def at_nodes(result: ElementFields, names: Iterable[str] = ALL) -> dict[str, Array]:
    """Return those fields of the nodes that a result has, (n,) or (n, c), by CalculiX's names of them."""
    made = ((name, AT_NODES[name](result)) for name in names if name in AT_NODES)
    return {name: values for name, values in made if values is not None}

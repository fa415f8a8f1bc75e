"""What CalculiX 2.20 shows of a result: its order of Gauss points, and its values at nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.analysis.fields import GaussPoints, known
from kratos_lite.analysis.result import Result
from kratos_lite.assembly import nodal_values
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.elements import KinematicLinear
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


def order(rule: Rule) -> Ints:
    """Return the Gauss points of a rule in the order of CalculiX, the first coordinate the quickest."""
    return np.lexsort(rule.points.round(12).T)


@remembered
def extrapolation(element: type[KinematicLinear], rule: Rule) -> Array:
    """Return the matrix (n, g) of CalculiX from values at Gauss points to nodes; ours of rules it has not.

    Corners have a fit of the functions of the corner cell, with the digits that CalculiX keeps, and mid-edge
    nodes the mean of two corners; with 27 points all nodes have a fit of their own functions.
    """
    shape, matrix = element.shape, nodal_values.extrapolation(element, rule)
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
    values, how = at_gauss(result, name), (result.mesh.n_nodes, extrapolation)
    return nodal_values.averaged(result.groups, values, *how) if values else None


def forces(result: Result) -> Array:
    """Return the internal forces (n, 3), which at rest are those of supports and loads."""
    if not result.is_linear:
        return result.reactions + result.loads
    return internal_load(result.mesh.points, result.groups, result._strained)


def temperatures(result: Result) -> Array | None:
    """Return the temperatures (n,) that act in a static result, or None."""
    acting = [one for load in result._acting for one in load.acting(0.0)]
    hot = [(factor, load) for factor, load in acting if isinstance(load, Temperature)]
    differences = [factor * load.difference(result.mesh) for factor, load in hot]
    return hot[0][1].reference + np.sum(differences, axis=0) if hot else None


def error(result: Result) -> Array | None:
    """Return errors of elements over the root mean square of their energy norms, means at nodes, in %.

    Source: Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 24 (1987) 337-357.
    """
    if not result.is_linear:
        return None
    error = result.error()
    scaled = 100 * np.sqrt(result.mesh.n_elements) * error.per_element
    scaled *= error.relative / error.absolute if error.absolute else 1.0
    values = [np.repeat(scaled[g.rows, None, None], len(g.rule), axis=1) for g in result.groups]
    return nodal_values.averaged(result.groups, values, result.mesh.n_nodes)


def displacements(model: Any, u: Array, time: float = 0.0) -> Array:
    """Return displacements (n, 3) with those of reference nodes, if it is a model with supports."""
    supports = getattr(model, "supports", None)
    return u if supports is None else np.asarray(supports.displacements(u, time))


AT_NODES: dict[str, Callable[[Result], Array | None]] = {
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


def at_nodes(result: Result, names: Iterable[str] = ALL) -> dict[str, Array]:
    """Return those fields of the nodes that a result has, (n,) or (n, c), by CalculiX's names of them."""
    return {name: values for name in names if (values := AT_NODES[name](result)) is not None}

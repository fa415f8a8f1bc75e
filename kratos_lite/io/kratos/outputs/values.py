"""Values of results as Kratos has them: by its names, and at its Gauss points in its order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.fields import FIELDS, STATES, GaussPoints, known
from kratos_lite.analysis.result import Result
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import volumes
from kratos_lite.errors import InputError
from kratos_lite.io.case import Case
from kratos_lite.mesh import Mesh, Part
from kratos_lite.mesh.blocks import select
from kratos_lite.typing import Array, Ints

NODAL = {
    field.kratos: name
    for name, field in FIELDS.items()
    if field.kind == "vector" and {"node", "state"} & {*field.where}
}
"""Our names of its nodal variables."""
ORDER_OF_POINTS = {
    6: [1, 0, 2, 4, 3, 5],
    4: [0],
    8: [0, 4, 6, 2, 1, 5, 7, 3],
    10: [2, 1, 0, 3],
    **dict.fromkeys((20, 27), np.arange(27).reshape(3, 3, 3).transpose().ravel().tolist()),
}
"""Gauss points of elements by their nodes, in the order of Kratos; measured against Kratos 10.4.4."""


def nodal_variables(case: Case) -> list[str]:
    """Return the names of the nodal variables that results of a case have, and of their components."""
    moves = case.analysis == "transient"
    names = [variable for variable, name in NODAL.items() if moves or FIELDS[name].where != STATES]
    return [*names, *(f"{name}_{axis}" for name in names for axis in "XYZ")]


def gauss_variables(groups: Sequence[ElementGroup]) -> dict[str, Callable[[GaussPoints], Array]]:
    """Return what is written at the Gauss points of groups by its name: scalars and tensors."""
    fields = [field for field in known(groups).values() if field.kratos and "gauss" in field.where]
    found = {field.kratos: field.at for field in fields if field.kind not in ("axes", "vector")}
    # that of TotalLagrangianElement, measured against Kratos 10.4.4; at small strains the stresses are one
    return found | {"VON_MISES_STRESS": lambda at: voigt.von_mises(at.pk2)}


def at_nodes(variable: str, result: Result, state: Any = None) -> Array:
    """Return a variable (n, 3) or a component (n,) at all nodes; velocities are those of a state."""
    if variable not in NODAL:
        name, _, axis = variable.rpartition("_")
        return np.asarray(at_nodes(name, result, state)[:, "XYZ".index(axis)])
    field = FIELDS[NODAL[variable]]
    return np.asarray(field.at(state) if field.where == STATES else result.field(NODAL[variable], "node"))


def order_of_points(group: ElementGroup) -> list[int]:
    """Return the Gauss points of elements in the order of Kratos; InputError if they are not its."""
    count, own = group.nodes.shape[1], group.rule is group.element.rule
    if not own or count not in ORDER_OF_POINTS:
        raise InputError(f"Gauss points of elements with {count} nodes are not those of Kratos")
    return ORDER_OF_POINTS[count]


def values_of_elements(result: Result, variable: str, rows: Ints) -> Iterator[tuple[int, Array]]:
    """Yield rows of elements with a variable (g, …) at their Gauss points; InputError if they have none."""
    variables = gauss_variables(result.groups)
    if variable not in variables:
        raise InputError(f"kratos_lite has no {variable} at Gauss points here")
    for group in result.groups:
        inside = np.isin(group.rows, rows)
        if inside.any():
            values = variables[variable](result.gauss_points(group))[inside][:, order_of_points(group)]
            yield from zip(group.rows[inside].tolist(), values, strict=True)


def means(result: Result, variable: str) -> Array:
    """Return the means of a variable over the Gauss points of each element, (m, …), as Kratos takes them."""
    of_groups = [
        gauss_variables(result.groups)[variable](result.gauss_points(g)).mean(axis=1) for g in result.groups
    ]
    out = np.zeros((result.mesh.n_elements, *of_groups[0].shape[1:]))
    for group, values in zip(result.groups, of_groups, strict=True):
        out[group.rows] = values
    return out


def nodal_means(result: Result, variable: str, rows: Ints, points: Array) -> Array:
    """Return Σ |N| V v / Σ |N| V over the Gauss points of some elements at nodes, (n, …).

    Volumes V are those of elements between the points (n, 3).

    Source: IntegrationValuesExtrapolationToNodesProcess of Kratos.
    """
    total, weight = np.zeros(()), np.zeros(result.mesh.n_nodes)
    for group in result.groups:
        at, inside = result.gauss_points(group), np.isin(group.rows, rows)
        values, nodes = gauss_variables(result.groups)[variable](at)[inside], group.nodes[inside]
        N, V = np.abs(at.element._N(group.rule)), volumes(points, group)[inside]
        total = total if total.ndim else np.zeros((len(weight), *values.shape[2:]))
        np.add.at(weight, nodes, V @ N)
        np.add.at(total, nodes, np.einsum("ga,mg,mg...->ma...", N, V, values))
    weight[weight == 0] = 1.0
    return np.asarray((total.T / weight).T)


def split(variable: str, values: Array) -> dict[str, Array]:
    """Return values (k,) or (k, c) as Kratos writes them: those of three components one by one."""
    if values.shape[1:] != (3,):
        return {variable: values}
    return {f"{variable}_{axis}": values[:, i] for i, axis in enumerate("XYZ")}


def names_of_nodes(mesh: Mesh, rows: Ints, by_place: bool) -> Sequence[str]:
    """Return the names of nodes in files of json_output_process, by ids or places."""
    if by_place:
        return ["NODE_X_{:.6f}_Y_{:.6f}_Z_{:.6f}".format(*x) for x in mesh.points[rows].tolist()]
    return [f"NODE_{i}" for i in mesh.node_ids[rows].tolist()]


def cells_of(mesh: Mesh, part: Part, *, faces: bool = False) -> tuple[Mesh, Ints]:
    """Return the elements of a part, or its conditions, as a mesh, and the rows of its nodes (n,)."""
    rows, blocks = (part.conditions, mesh.conditions) if faces else (part.elements, mesh.blocks)
    cells = [block for block in select(blocks, rows) if block.shape is not None]
    nodes = np.unique(np.concatenate([part.nodes, *(block.nodes.ravel() for block in cells)]))
    nodes = nodes[np.argsort(mesh.node_ids[nodes])]
    own = np.zeros(mesh.n_nodes, dtype=np.int32)
    own[nodes] = np.arange(len(nodes))
    cells = [replace(block, nodes=own[block.nodes]) for block in cells]
    return Mesh(
        mesh.points[nodes], cells, node_ids=mesh.node_ids[nodes], source=mesh.source, units=mesh.units
    ), nodes

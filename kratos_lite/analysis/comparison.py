"""Comparison: how far two results of one body differ, on one mesh or on two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.fields import FIELDS
from kratos_lite.analysis.report import vector
from kratos_lite.analysis.result import Result
from kratos_lite.assembly.gauss_point_fields import volumes
from kratos_lite.errors import MeshError
from kratos_lite.mesh import Mesh
from kratos_lite.tabular import Tabular
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import instance


@dataclass(frozen=True, eq=False)
class Difference:
    """Difference of a field at the nodes of the first result."""

    values: Array  # (k, 3) or (k, 6), second minus first, at the nodes that are compared
    maximum: float  # length of a vector, √(σ:σ) of a stress
    l2: float  # root of the mean square over the volume
    relative_maximum: float  # beside the same of the field itself; nan where that is 0
    relative_l2: float
    node: int  # id of the node where it is largest
    point: Array  # (3,) m, its place

    def row(self, unit: str) -> str:
        """Return its line of the table."""
        parts = (
            f"{name} {value:.6e} {unit}" + (f" ({ratio:.3g} of the first)" if np.isfinite(ratio) else "")
            for name, value, ratio in (
                ("largest", self.maximum, self.relative_maximum),
                ("L2", self.l2, self.relative_l2),
            )
        )
        return f"{', '.join(parts)}, largest at node {self.node}, {vector(self.point)} m"


@dataclass(frozen=True, eq=False)
class Comparison(Tabular):
    """How far two results differ; it prints as a table.

    Attributes
    ----------
    displacement : difference of displacements in m.
    stress : difference of the stresses recovered at nodes, in Pa.
    energies : strain energies of both in J.
    nodes : (k,) rows of the nodes of the first mesh that are compared.
    outside : number of its nodes outside the mesh of the second, which are not.
    same_mesh : whether both have the same nodes, so that nothing is interpolated.
    units : set of units of both.
    """

    displacement: Difference
    stress: Difference
    energies: tuple[float, float]
    nodes: Ints
    outside: int
    same_mesh: bool
    units: str = "SI"

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary, labels and values."""
        first, second = self.energies
        change = f", {second / first - 1:+.3e} of the first" if first else ""
        how = "the same nodes" if self.same_mesh else "the second interpolated at the nodes of the first"
        left = f", {self.outside} of them outside the second mesh and left out" if self.outside else ""
        return [
            ("compared", f"{len(self.nodes) + self.outside} nodes{left}; {how}"),
            ("displacement", self.displacement.row(FIELDS["displacement"].unit)),
            ("stress", self.stress.row(FIELDS["stress"].unit)),
            ("strain energy", f"{first:.6e} J and {second:.6e} J{change}"),
        ]


def compare(first: Result, second: Result) -> Comparison:
    """Compare two results of one body, on the same mesh or on two meshes.

    On two meshes, displacements N u and recovered stresses of the second are taken at the nodes of the first.
    Mean squares weight each node with an equal part of the volume of each of its elements.

    Parameters
    ----------
    first, second : results; relative differences are those beside the first.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        One of them is no result.
    MeshError
        No node of the first lies in the mesh of the second, or they are in other units.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> def tip(cells):
    ...     beam = kl.Model(kl.box((4, 1, 1), cells), kl.Isotropic3D(E=1e6, nu=0.0))
    ...     beam.fix("x-")
    ...     beam.add(kl.Traction("x+", (5.0, 0.0, 0.0)))
    ...     return beam.solve()
    >>> found = kl.compare(tip((4, 1, 1)), tip((8, 2, 2)))
    >>> found.displacement.relative_l2 < 1e-9, found.stress.relative_maximum < 1e-9
    (True, True)
    """
    for result, name in ((first, "first"), (second, "second")):
        instance(result, name, Result, "model.solve()")
    mesh, used = first.mesh, first.mesh.used_nodes()
    if mesh.units != second.mesh.units:
        both = f"one result is in {mesh.units}, the other in {second.mesh.units}"
        raise MeshError(f"{both}; compare like with like")
    same = mesh is second.mesh or np.array_equal(mesh.points, second.mesh.points)
    if same:
        nodes = np.flatnonzero(used)
        u, stress = second.u[nodes], second.stress("node")[nodes]
    else:
        located = second.mesh.locate(mesh.points)
        nodes = np.flatnonzero(located.inside & used)
        if not len(nodes):
            raise MeshError(
                "no node of the first result lies in the mesh of the second; compare results of one body, in "
                "one place and unit of length"
            )
        values = second.at(located[nodes], recovered=True)
        u, stress = values.displacement, values.stress
    weight = _volumes(first)
    return Comparison(
        _difference(mesh, nodes, u, first.u, weight),
        _difference(mesh, nodes, stress, first.stress("node"), weight),
        (first.energy(), second.energy()),
        nodes,
        int(used.sum()) - len(nodes),
        same,
        mesh.units,
    )


def _difference(mesh: Mesh, nodes: Ints, second: Array, first: Array, weight: Array) -> Difference:
    """Return the difference of values (k, c) at some nodes from those (n, c) of the first result."""
    own, weight = first[nodes], weight[nodes]
    values = second - own
    (size, l2), (own_size, own_l2) = (_sizes(field, weight) for field in (values, own))
    at, own_largest = int(size.argmax()), float(own_size.max())
    largest, row = float(size[at]), nodes[at]
    return Difference(
        values,
        maximum=largest,
        l2=l2,
        relative_maximum=largest / own_largest if own_largest else np.nan,
        relative_l2=l2 / own_l2 if own_l2 else np.nan,
        node=int(mesh.node_ids[row]),
        point=mesh.points[row],
    )


def _sizes(values: Array, weight: Array) -> tuple[Array, float]:
    """Return the sizes (k,) of vectors or stresses, and the root of their mean square."""
    parts = voigt.tensor(values).reshape(len(values), 9) if values.shape[1] == 6 else values
    size = np.linalg.norm(parts, axis=1)
    return size, float(np.sqrt((weight * size**2).sum() / weight.sum()))


def _volumes(result: Result) -> Array:
    """Return the volume (n,) in m³ of each node: equal parts of those of its elements."""
    total = np.zeros(result.mesh.n_nodes)
    for group in result.groups:
        k = group.nodes.shape[1]
        share = volumes(result.mesh.points, group).sum(axis=1) / k
        total += np.bincount(group.nodes.ravel(), np.repeat(share, k), len(total))
    return total

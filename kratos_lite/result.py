"""Result: displacements, reactions, strains, stresses and the report of a solution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite import voigt
from kratos_lite.batches import Batch
from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh, Where
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes import Hexahedron8, Pyramid5, Shape, Tetrahedron4, Wedge6

Array = NDArray[np.float64]
PLACES = ("gauss", "element", "node")
CORNER_SHAPES: dict[str, type[Shape]] = {
    "tetrahedron": Tetrahedron4,
    "hexahedron": Hexahedron8,
    "wedge": Wedge6,
    "pyramid": Pyramid5,
}


def peak_memory() -> int:
    """Return the largest memory of this process so far, in bytes (0 where the system does not tell)."""
    try:
        import resource
        import sys
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else peak * 1024)


@dataclass
class Report:
    """What was solved, how, and how well.

    Attributes
    ----------
    unknowns : free degrees of freedom.
    total_load, total_reaction : (3,) N.
    solver, reason, iterations : how it was solved and why that way.
    backward_error : |b - A x| / (|A| |x| + |b|).
    force_error, moment_error : what loads and reactions miss to equilibrium, relative.
    seconds : per phase.
    peak_memory : bytes.
    warnings, notes : what the checks and the reader found.
    """

    unknowns: int
    total_load: Array
    total_reaction: Array
    solver: str
    reason: str
    iterations: int
    backward_error: float
    force_error: float
    moment_error: float
    seconds: dict[str, float]
    peak_memory: int
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


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


class Result:
    """Displacements and all that follows from them; strains and stresses are made when asked for."""

    def __init__(
        self,
        mesh: Mesh,
        batches: Sequence[Batch],
        u: Array,
        reactions: Array,
        loads: Array,
        report: Report,
        u0: Array | None = None,
    ) -> None:
        self.mesh = mesh
        self.batches = list(batches)
        self.u = u
        self.reactions = reactions
        self.loads = loads
        for array in (u, reactions, loads):
            array.setflags(write=False)  # strains and stresses are made of them later
        self.report = report
        self._strained = u if u0 is None else u - u0

    # ---- nodal values --------------------------------------------------------------------------

    def displacement(self, where: Where | None = None) -> Array:
        """Return displacements (n, 3) in m, of all nodes or of some."""
        return self.u if where is None else self.u[self.mesh.nodes(where)]

    def reaction(self, where: Where | None = None) -> Array:
        """Return reactions (n, 3) in N: forces of the supports on the body; 0 where nothing is fixed."""
        return self.reactions if where is None else self.reactions[self.mesh.nodes(where)]

    # ---- element values ------------------------------------------------------------------------

    def _at_gauss(self, stress: bool) -> Iterator[tuple[Batch, Array, Array]]:
        """Yield batch, strain or stress (m, g, 6), and volumes (m, g)."""
        for batch in self.batches:
            values, volumes = [], []
            for chunk in batch.chunks():
                element = batch.at(self.mesh.points, chunk)
                value = element.strain(self._strained[batch.nodes[chunk]])
                if stress:
                    value = batch.material.stress(value) + batch.initial_stress(chunk)
                values.append(value)
                volumes.append(element.dV)
            yield batch, np.concatenate(values), np.concatenate(volumes)

    def _field(self, at: str, stress: bool) -> Any:
        if at not in PLACES:
            raise InputError(f"at must be one of {', '.join(PLACES)}; got {at!r}")
        parts = list(self._at_gauss(stress))
        if at == "gauss":
            return self._by_element(parts)
        return self._means(parts) if at == "element" else self._average(parts)

    def _by_element(self, parts: list[tuple[Batch, Array, Array]]) -> Any:
        """Return (m, g, 6), or a list of (g, 6) where elements have different numbers of points."""
        if len({len(batch.rule) for batch, _, _ in parts}) > 1:
            rows: list[Any] = [None] * self.mesh.n_elements
            for batch, values, _ in parts:
                for row, value in zip(batch.rows.tolist(), values, strict=True):
                    rows[row] = value
            return rows
        out = np.zeros((self.mesh.n_elements, *parts[0][1].shape[1:]))
        for batch, values, _ in parts:
            out[batch.rows] = values
        return out

    def _means(self, parts: list[tuple[Batch, Array, Array]]) -> Array:
        """Return the mean over the volume of each element, (m, 6)."""
        out = np.zeros((self.mesh.n_elements, 6))
        for batch, values, volumes in parts:
            share = volumes / volumes.sum(axis=1, keepdims=True)
            out[batch.rows] = (values * share[..., None]).sum(axis=1)
        return out

    def stress_at_nodes_and_elements(self) -> tuple[Array, Array]:
        """Return nodal stresses (n, 6) and element means (m, 6) in Pa from one pass over the elements."""
        parts = list(self._at_gauss(stress=True))
        return self._average(parts), self._means(parts)

    def _average(self, parts: list[tuple[Batch, Array, Array]]) -> Array:
        """Return nodal values (n, 6): the mean over the elements around each node."""
        total = np.zeros((self.mesh.n_nodes, 6))
        count = np.zeros(self.mesh.n_nodes)
        for batch, values, _ in parts:
            nodal = extrapolation(batch.element, batch.rule) @ values
            flat = batch.nodes.ravel()
            for c in range(6):
                total[:, c] += np.bincount(flat, weights=nodal[..., c].ravel(), minlength=len(total))
            count += np.bincount(flat, minlength=len(total))
        return total / np.maximum(count, 1)[:, None]

    def strain(self, at: str = "gauss") -> Any:
        """Return strains, Voigt order with engineering shear.

        ``at="gauss"``: (m, g, 6), or a list of (g, 6) where elements have different rules;
        ``"element"``: (m, 6) mean over the volume; ``"node"``: (n, 6) extrapolated and averaged.
        """
        return self._field(at, stress=False)

    def stress(self, at: str = "gauss") -> Any:
        """Return stresses in Pa, shaped as `strain`."""
        if at == "node":
            return self._nodal_stress
        return self._field(at, stress=True)

    @cached_property
    def _nodal_stress(self) -> Array:
        return np.asarray(self._field("node", stress=True))

    def von_mises(self, at: str = "gauss") -> Any:
        """Return von Mises stresses in Pa: (m, g), (m,) or (n,)."""
        stress = self.stress(at)
        if isinstance(stress, list):
            return [voigt.von_mises(s) for s in stress]
        return voigt.von_mises(stress)

    # ---- totals --------------------------------------------------------------------------------

    @cached_property
    def _totals(self) -> tuple[float, float, int]:
        """Strain energy in J, largest von Mises stress at a Gauss point in Pa, row of its element."""
        energy, largest, row = 0.0, 0.0, 0
        for batch in self.batches:
            for chunk in batch.chunks():
                element = batch.at(self.mesh.points, chunk)
                strain = element.strain(self._strained[batch.nodes[chunk]])
                elastic = batch.material.stress(strain)
                energy += float(((strain * elastic).sum(axis=-1) * element.dV).sum()) / 2
                mises = voigt.von_mises(elastic + batch.initial_stress(chunk)).max(axis=1)
                if mises.max() > largest:
                    largest, row = float(mises.max()), int(batch.rows[chunk][int(mises.argmax())])
        return energy, largest, row

    def totals(self) -> tuple[float, float, int]:
        """Return strain energy in J, largest von Mises stress at a Gauss point in Pa, its element row."""
        return self._totals

    def energy(self) -> float:
        """Return the strain energy ½ ∫ ε:C:ε dV in J."""
        return self._totals[0]

    # ---- out -----------------------------------------------------------------------------------

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary: label and value."""
        mesh, report = self.mesh, self.report
        length = np.linalg.norm(self.u, axis=1)
        top = int(length.argmax())
        energy, mises, row = self._totals
        kinds = ", ".join(f"{len(block)} {block.name}" for block in mesh.blocks if len(block))

        def vector(v: Array, size: float = 0.0) -> str:
            # What is left of forces that cancel is rounding, and is shown as the 0 that it stands for.
            small = np.where(np.abs(v) < 1e-12 * max(float(np.abs(v).max()), size, 1e-300), 0.0, v)
            return "(" + ", ".join(f"{c:.6g}" for c in small) + ")"

        forces = float(np.abs(self.loads).sum() + np.abs(self.reactions).sum())
        rows = [
            ("nodes", f"{mesh.n_nodes}"),
            ("elements", kinds),
            ("unknowns", f"{report.unknowns}"),
            ("total load", f"{vector(report.total_load, forces)} N"),
            ("total reaction", f"{vector(report.total_reaction, forces)} N"),
            (
                "largest displacement",
                f"{length[top]:.6e} m at node {mesh.node_ids[top]}, {vector(self.u[top])} m",
            ),
            ("strain energy", f"{energy:.6e} J"),
            ("largest von Mises", f"{mises:.6e} Pa (at a Gauss point) in element {mesh.element_ids[row]}"),
            ("solver", f"{report.solver}: {report.reason}"),
        ]
        if report.iterations:
            rows.append(("iterations", str(report.iterations)))
        rows += [
            ("backward error", f"{report.backward_error:.1e}"),
            ("equilibrium", f"forces {report.force_error:.1e}, moments {report.moment_error:.1e}"),
            ("seconds", ", ".join(f"{name} {s:.3f}" for name, s in report.seconds.items())),
            ("peak memory", f"{report.peak_memory / 1e6:.0f} MB"),
        ]
        rows += [("warning", text) for text in report.warnings]
        return rows + [("note", text) for text in report.notes]

    def __str__(self) -> str:
        rows = self.table()
        width = max(len(label) for label, _ in rows)
        return "\n".join(f"{label:<{width}}  {value}" for label, value in rows)

    def save(self, path: str | Path, mode: str | None = None) -> None:
        """Write the result to a file by its ending: .vtu (ParaView), .vtk or .json.

        The mode of a .vtu file is ``binary`` (the default), ``compressed`` or ``ascii``.
        """
        from kratos_lite.io.results import write_result

        write_result(path, self, mode)

    def plot(self, path: str | Path, values: str = "VON_MISES_STRESS") -> None:
        """Write a picture (.png) of the deformed body coloured by a nodal field."""
        from kratos_lite.io.results import plot_result

        plot_result(path, self, values)

"""Result: displacements, reactions, strains, stresses and the report of a solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import at_gauss, totals
from kratos_lite.assembly.nodal_values import averages
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh, Where
from kratos_lite.native import described
from kratos_lite.typing import Array

PLACES = ("gauss", "element", "node")


def peak_memory() -> int:
    """Return the largest memory of this process so far, in bytes (0 where the system does not say)."""
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
    backward_error : |b - A x| / (|A| |x| + |b|), or None.
    force_error, moment_error : what loads and reactions miss to equilibrium, relative; None where material
        that moves through the mesh carries momentum, so that they need not balance.
    seconds : per phase.
    peak_memory : bytes.
    warnings, notes : what the checks and the reader found.
    skipped : what this solution did without, as it would have changed nothing.
    kernels : what computed, compiled kernels and their threads or NumPy.
    motion : of a model whose material moves through its mesh: rate, critical rate, resultant of the supports.
    """

    unknowns: int
    total_load: Array
    total_reaction: Array
    solver: str
    reason: str
    iterations: int
    backward_error: float | None
    force_error: float | None
    moment_error: float | None
    seconds: dict[str, float]
    peak_memory: int = field(default_factory=peak_memory)
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    kernels: str = field(default_factory=described)
    motion: dict[str, Any] = field(default_factory=dict)

    def motion_rows(self) -> list[tuple[str, str]]:
        """Return the rows of the summary about the motion of the material; none without one."""
        m = self.motion
        if not m:
            return []
        unit, size = m["unit"], max(map(abs, m["support_force"] + m["support_moment"]))
        force, moment = (vector(np.array(m[f"support_{k}"]), size) for k in ("force", "moment"))
        spin = f", {m['acceleration']:g} {unit[:-2]}/s²" if m["acceleration"] else ""
        return [
            (m["kind"], f"{m['rate']:g} {unit}{spin} {vector(np.array(m['direction']))}"),
            (
                "critical rate",
                (f"{m['critical_rate']:.4g} {unit} on this mesh, " if m["critical_rate"] else "")
                + f"about {m['critical_rate_of_waves']:.4g} {unit} by wave speeds, margin {m['margin']:.1%}",
            ),
            ("force of supports", f"{force} N"),
            ("moment of supports", f"{moment} N m"),
        ]


def vector(v: Array, size: float = 0.0) -> str:
    """Return a vector for a summary; components that are rounding beside `size` are shown as 0."""
    small = np.where(np.abs(v) < 1e-12 * max(float(np.abs(v).max()), size, 1e-300), 0.0, v)
    return "(" + ", ".join(f"{c:.6g}" for c in small) + ")"


class Result:
    """Displacements and all that follows from them; strains and stresses are made when asked for.

    Analyses make results.

    Parameters
    ----------
    mesh : of n nodes and m elements.
    groups : the elements with their materials.
    u : (n, 3) displacements in m.
    reactions, loads : (n, 3) nodal forces in N.
    report : what was solved, how, and how well.
    u0 : (n, 3) displacements in m without stress; none if not given.
    """

    def __init__(
        self,
        mesh: Mesh,
        groups: Sequence[ElementGroup],
        u: Array,
        reactions: Array,
        loads: Array,
        report: Report,
        u0: Array | None = None,
    ) -> None:
        self.mesh = mesh
        self.groups = list(groups)
        self.u = u
        self.reactions = reactions
        self.loads = loads
        for array in (u, reactions, loads):
            array.setflags(write=False)  # strains and stresses are made of them later
        self.report = report
        self._strained = u if u0 is None else u - u0

    # ---- nodal values --------------------------------------------------------------------------

    def displacement(self, where: Where | None = None) -> Array:
        """Return the displacements of nodes.

        Parameters
        ----------
        where : nodes by part, predicate, mask or rows; all if not given.

        Returns
        -------
        (n, 3) in m, or (k, 3) of some.
        """
        return self.u if where is None else self.u[self.mesh.nodes(where)]

    def reaction(self, where: Where | None = None) -> Array:
        """Return the reactions of nodes: forces of the supports on the body, 0 where nothing is fixed.

        Parameters
        ----------
        where : nodes by part, predicate, mask or rows; all if not given.

        Returns
        -------
        (n, 3) in N, or (k, 3) of some.
        """
        return self.reactions if where is None else self.reactions[self.mesh.nodes(where)]

    # ---- element values ------------------------------------------------------------------------

    def _field(self, at: str, stress: bool) -> Any:
        if at not in PLACES:
            raise InputError(f"at must be one of {', '.join(PLACES)}; got {at!r}")
        if at == "gauss":
            return self._by_element(stress)
        return self._averages(stress)[PLACES.index(at) - 1]

    def _by_element(self, stress: bool) -> Any:
        """Return (m, g, 6), or a list of (g, 6) where elements have different numbers of points."""
        points, m = self.mesh.points, self.mesh.n_elements
        parts = [at_gauss(points, group, self._strained, stress=stress) for group in self.groups]
        if len(parts) == 1 and (self.groups[0].rows == np.arange(m)).all():
            return parts[0]
        if len({part.shape[1] for part in parts}) > 1:
            rows: list[Any] = [None] * m
            for group, part in zip(self.groups, parts, strict=True):
                for row, value in zip(group.rows.tolist(), part, strict=True):
                    rows[row] = value
            return rows
        out = np.zeros((m, *parts[0].shape[1:]))
        for group, part in zip(self.groups, parts, strict=True):
            out[group.rows] = part
        return out

    def _averages(self, stress: bool) -> tuple[Array, Array]:
        """Return the mean over the volume of each element (m, 6) and nodal values (n, 6)."""
        m = self.mesh.n_elements
        return averages(self.mesh.points, self.groups, self._strained, m, stress=stress)

    def stress_at_nodes_and_elements(self) -> tuple[Array, Array]:
        """Return both from one pass over the elements.

        Returns
        -------
        Nodal stresses (n, 6) and element means (m, 6) in Pa.
        """
        means, nodal = self._averages(stress=True)
        return nodal, means

    def strain(self, at: str = "gauss") -> Any:
        """Return strains in Voigt order xx yy zz xy yz zx, with engineering shear.

        Parameters
        ----------
        at : ``"gauss"`` for Gauss points; ``"element"`` for means over the volume; ``"node"`` for
            extrapolated and averaged values.

        Returns
        -------
        (m, g, 6) at Gauss points, or a list of (g, 6) where elements have different rules; (m, 6); or (n, 6).

        Raises
        ------
        InputError
            There is no such place.
        """
        return self._field(at, stress=False)

    def stress(self, at: str = "gauss") -> Any:
        """Return stresses in Voigt order xx yy zz xy yz zx.

        Parameters
        ----------
        at : as for `strain`.

        Returns
        -------
        In Pa, shaped as by `strain`.

        Raises
        ------
        InputError
            There is no such place.
        """
        if at == "node":
            return self._nodal_stress
        return self._field(at, stress=True)

    @cached_property
    def _nodal_stress(self) -> Array:
        return np.asarray(self._field("node", stress=True))

    def von_mises(self, at: str = "gauss") -> Any:
        """Return von Mises stresses.

        Parameters
        ----------
        at : as for `strain`.

        Returns
        -------
        (m, g), (m,) or (n,) in Pa.

        Raises
        ------
        InputError
            There is no such place.
        """
        stress = self.stress(at)
        if isinstance(stress, list):
            return [voigt.von_mises(s) for s in stress]
        return voigt.von_mises(stress)

    # ---- totals --------------------------------------------------------------------------------

    @cached_property
    def _totals(self) -> tuple[float, float, int]:
        """Strain energy in J, largest von Mises stress at a Gauss point in Pa, row of its element."""
        return totals(self.mesh.points, self.groups, self._strained)

    def totals(self) -> tuple[float, float, int]:
        """Return what one pass over the elements gives.

        Returns
        -------
        Strain energy in J, largest von Mises stress at a Gauss point in Pa, and the row of its element.
        """
        return self._totals

    def energy(self) -> float:
        """Return the strain energy ½ ∫ ε:C:ε dV.

        Returns
        -------
        In J.
        """
        return self._totals[0]

    # ---- out -----------------------------------------------------------------------------------

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary.

        Returns
        -------
        Labels and values.
        """
        mesh, report = self.mesh, self.report
        length = np.linalg.norm(self.u, axis=1)
        top = int(length.argmax())
        energy, mises, row = self._totals
        kinds = ", ".join(f"{len(block)} {block.name}" for block in mesh.blocks if len(block))

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
        if report.backward_error is not None:
            rows.append(("backward error", f"{report.backward_error:.1e}"))
        if report.force_error is not None:
            balance = f"forces {report.force_error:.1e}, moments {report.moment_error:.1e}"
            rows.append(("equilibrium", balance))
        if report.seconds:
            rows.append(("seconds", ", ".join(f"{name} {s:.3f}" for name, s in report.seconds.items())))
        rows += [
            ("peak memory", f"{report.peak_memory / 1e6:.0f} MB"),
            ("kernels", report.kernels),
        ]
        rows += report.motion_rows()
        if report.skipped:
            rows.append(("skipped", "; ".join(report.skipped)))
        rows += [("warning", text) for text in report.warnings]
        return rows + [("note", text) for text in report.notes]

    def __str__(self) -> str:
        rows = self.table()
        width = max(len(label) for label, _ in rows)
        return "\n".join(f"{label:<{width}}  {value}" for label, value in rows)

"""Report: what was solved, how, and how well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import volumes
from kratos_lite.mesh import Mesh
from kratos_lite.native import described
from kratos_lite.tabular import Tabular
from kratos_lite.typing import Array

SHOWN = 10
"""Steps in a summary."""


def peak_memory() -> int:
    """Return the largest memory of this process so far, in bytes (0 where the system does not say)."""
    try:
        import resource
        import sys
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else peak * 1024)


@dataclass(frozen=True)
class RefinementStep:
    """One mesh on the way to the requested accuracy."""

    elements: int
    kinds: str  # classes of the elements
    unknowns: int  # free degrees of freedom
    error: float  # relative, of the energy norm or of the quantity, as it was known then
    seconds: float  # for solution and estimate

    def __str__(self) -> str:
        return f"{self.error:.2%} with {self.unknowns} unknowns, {self.elements} {self.kinds}"


@dataclass(frozen=True)
class StepReport:
    """How a step, or a part of one, has converged."""

    time: float  # s, at its end
    residuals: tuple[float, ...]  # relative, before each correction and at the end
    part: float = 1.0  # fraction of the step; below 1 where it was cut

    @property
    def iterations(self) -> int:
        """Number of corrections."""
        return len(self.residuals) - 1

    def __str__(self) -> str:
        last = self.residuals[-1]
        cut = f", {self.part:g} of a step" if self.part < 1 else ""
        return f"t = {self.time:g} s: {self.iterations} iterations, relative residual {last:.1e}{cut}"


@dataclass
class Report(Tabular):
    """What was solved, how, and how well."""

    unknowns: int  # free degrees of freedom
    total_load: Array  # (3,) N
    total_reaction: Array  # (3,) N
    solver: str  # how it was solved, and why that way
    reason: str
    iterations: int
    backward_error: float | None  # |b - A x| / (|A| |x| + |b|)
    # what loads, reactions and the internal forces of the stresses miss to equilibrium, relative; None where
    # material that moves through the mesh carries momentum, so that they need not balance
    force_error: float | None
    moment_error: float | None
    seconds: dict[str, float]  # by phase
    peak_memory: int = field(default_factory=peak_memory)  # bytes
    warnings: list[str] = field(default_factory=list)  # what the checks and the reader found
    notes: list[str] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)  # what this solution did without: it changes nothing
    kernels: str = field(default_factory=described)  # what computed: compiled kernels and threads, or NumPy
    formulation: str = ""  # which one of the elements was chosen, and why; "" where their names say it
    motion: dict[str, Any] = field(default_factory=dict)  # of the material: rate, critical rate, resultant
    error: float | None = None  # relative, estimated on the safe side, of a solution to a requested accuracy
    error_of: str = "the energy norm"  # what has that error
    error_asked: float | None = None  # that was requested
    history: list[RefinementStep] = field(default_factory=list)  # the meshes, the last one of the result
    steps: list[StepReport] = field(default_factory=list)  # of a quasi-static analysis
    work: float | None = None  # J, of its loads and supports
    units: str = "SI"  # of all numbers, whose comments say those of SI

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary, labels and values."""
        return self.load_rows() + self.solution_rows()

    def load_rows(self, size: float = 0.0) -> list[tuple[str, str]]:
        """Return the rows of the summary about formulation, unknowns and loads, forces of `size` N in all."""
        formulation = [("formulation", self.formulation)] if self.formulation else []
        return [
            *formulation,
            ("unknowns", f"{self.unknowns}"),
            ("total load", f"{vector(self.total_load, size)} N"),
            ("total reaction", f"{vector(self.total_reaction, size)} N"),
        ]

    def solution_rows(self) -> list[tuple[str, str]]:
        """Return the rows of the summary about how it was solved, and all that was noticed."""
        rows = [("solver", f"{self.solver}: {self.reason}")]
        if self.iterations:
            rows.append(("iterations", str(self.iterations)))
        if len(self.steps) > SHOWN:
            rows.append(("steps", f"{len(self.steps)}, the last {SHOWN} of which are"))
        rows += [("step", str(step)) for step in self.steps[-SHOWN:]]
        if self.work is not None:
            rule = f", by the trapezoidal rule over {len(self.steps)} steps" if self.steps else ""
            rows.append(("work of loads", f"{self.work:.6e} J{rule}"))
        if self.backward_error is not None:
            rows.append(("backward error", f"{self.backward_error:.1e}"))
        if self.force_error is not None:
            rows.append(("equilibrium", f"forces {self.force_error:.1e}, moments {self.moment_error:.1e}"))
        if self.seconds:
            rows.append(("seconds", ", ".join(f"{name} {s:.3f}" for name, s in self.seconds.items())))
        rows += [("peak memory", f"{self.peak_memory / 1e6:.0f} MB"), ("kernels", self.kernels)]
        rows += self.motion_rows()
        rows += [("refinement", str(step)) for step in self.history if len(self.history) > 1]
        if self.skipped:
            rows.append(("skipped", "; ".join(self.skipped)))
        rows += [("warning", text) for text in self.warnings]
        return rows + [("note", text) for text in self.notes]

    def motion_rows(self) -> list[tuple[str, str]]:
        """Return the rows of the summary about the motion of the material; none without one."""
        m = self.motion
        if not m:
            return []
        unit, size = m["unit"], max(map(abs, m["support_force"] + m["support_moment"]))
        force, moment = (vector(m[f"support_{k}"], size) for k in ("force", "moment"))
        spin = f", {m['acceleration']:g} {unit[:-2]}/s²" if m["acceleration"] else ""
        rows = [(m["kind"], f"{m['rate']:g} {unit}{spin} {vector(m['direction'])}")]
        if "center_velocity" in m:
            velocity, gained = (vector(m[f"center_{k}"]) for k in ("velocity", "acceleration"))
            rows.append(("center", f"velocity {velocity} m/s, acceleration {gained} m/s²"))
        mesh = f"{m['critical_rate']:.4g} {unit} on this mesh, " if m["critical_rate"] else ""
        waves = f"about {m['critical_rate_of_waves']:.4g} {unit} by wave speeds"
        return [
            *rows,
            ("critical rate", f"{mesh}{waves}, margin {m['margin']:.1%}"),
            ("force of supports", f"{force} N"),
            ("moment of supports", f"{moment} N m"),
        ]


def element_counts(mesh: Mesh, groups: Sequence[ElementGroup], formulation: str) -> dict[str, int]:
    """Return the number of elements by names in the mesh, or by class where a formulation was chosen."""
    counts: dict[str, int] = {}
    named = [(group.element.__name__, len(group)) for group in groups]
    for name, count in named if formulation else [(block.name, len(block)) for block in mesh.blocks]:
        counts[name] = counts.get(name, 0) + count
    return {name: count for name, count in counts.items() if count}


def sizes(points: Array, groups: Sequence[ElementGroup]) -> list[tuple[str, str]]:
    """Return the rows of a summary about volume and mass."""
    parts = [float(volumes(points, group).sum()) for group in groups]
    mass = sum(group.material.density * part for group, part in zip(groups, parts, strict=True))
    return [("volume", f"{sum(parts):.6g} m³"), ("mass", f"{mass:.6g} kg")]


def vector(v: Array | Sequence[float], size: float = 0.0) -> str:
    """Return a vector for a summary; components that are rounding beside `size` are shown as 0."""
    small = np.where(np.abs(v) < 1e-12 * max(float(np.abs(v).max()), size, 1e-300), 0.0, v)
    return "(" + ", ".join(f"{c:.6g}" for c in small) + ")"

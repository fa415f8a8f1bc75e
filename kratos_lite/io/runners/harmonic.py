"""Harmonic response of models: the steady motion under loads that swing."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.fields import labelled
from kratos_lite.analysis.harmonic import HarmonicResponse, amplitudes
from kratos_lite.io.case import Case
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.io.writers.results import write_table
from kratos_lite.typing import Progress


def check(case: Case) -> list[str]:
    """Return the warnings of the model; no mode is looked for."""
    case.model.require_linear("harmonic response")
    return EquationsOfMotion(case.model).warnings


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Find the response at each frequency, and write amplitudes and phases of all nodes."""
    options = dict(case.harmonic or {})
    if callable(options["frequencies"]):
        options["frequencies"] = options["frequencies"](case.model)
    response = case.model.harmonic(**options, progress=progress)
    rows = [f"{'frequency Hz':>14}  {'rad/s':>14}  {'amplitude m':>14}  {'at node':>9}"]
    for i, omega in enumerate(response.frequencies.tolist()):
        size = np.linalg.norm(response.displacement(i), axis=1)
        at = int(size.argmax())
        node = case.model.mesh.node_ids[at]
        rows.append(f"{omega / (2 * pi):>14.8g}  {omega:>14.8g}  {size[at]:>14.6e}  {node:>9}")
    for path in case.outputs.results:
        write_table(path, _columns(response))
    notes = [("note", text) for text in case.model.notes]
    return Outcome(case, notes, lines=rows, response=response)


def _columns(response: HarmonicResponse) -> dict[str, Any]:
    """Return amplitudes and phases by headers, of all nodes at the first frequency and so on."""
    mesh, omega = response.mesh, response.frequencies
    u = np.concatenate([response.displacement(i) for i in range(len(omega))])
    nodes = {"frequency [rad/s]": omega.repeat(mesh.n_nodes), "node": np.tile(mesh.node_ids, len(omega))}
    return labelled({**nodes, **amplitudes(u)}, response.units)

"""Natural frequencies of models, factors of their loads at which they buckle, and harmonic responses."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.fields import labelled
from kratos_lite.analysis.harmonic import HarmonicResponse, amplitudes
from kratos_lite.errors import SolveError
from kratos_lite.io.case import Case
from kratos_lite.io.outputs import write_picture
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.io.writers.modes import names_of_modes, write_modes, write_modes_json
from kratos_lite.io.writers.results import write_table
from kratos_lite.typing import Array, Progress

DRAWN = 6
"""Modes in a picture."""


def check(case: Case) -> list[str]:
    """Return the warnings of the model, checked as the search for its modes does."""
    if case.harmonic is not None:
        case.model.require_linear("harmonic response")
    if case.buckling:
        return EquationsOfMotion(case.model, free=False, massless=True).warnings
    return EquationsOfMotion(case.model, steady=case.model.motion is not None).warnings


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Find the lowest natural frequencies, or factors, and write their modes; with a motion eigenvalues λ.

    Frequency is Im λ, of conjugate pairs once, and growth Re λ, which is not positive where motion is stable.
    """
    if case.harmonic is not None:
        return _harmonic(case, progress)
    model, count = case.model, case.modes
    head = f"{'mode':>4}  {'frequency Hz':>14}  {'rad/s':>14}"
    values: Any
    shapes: Any
    if case.buckling:
        head = f"{'mode':>4}  {'factor':>14}"
        values, shapes = model.buckling(count, progress=progress)
        rows = [f"{i:>4}  {factor:>14.8g}" for i, factor in enumerate(values.tolist(), 1)]
    elif model.motion is None:
        values, shapes = _real_modes(case, progress)
        rows = [f"{i:>4}  {w / (2 * pi):>14.8g}  {w:>14.8g}" for i, w in enumerate(values.tolist(), 1)]
    else:
        head += f"  {'growth 1/s':>14}"
        pairs, both = model.complex_modes(2 * count, progress=progress)
        chosen = np.flatnonzero(pairs.imag >= 0)[:count]
        values, shapes = pairs[chosen], both[chosen]
        rows = [
            f"{i:>4}  {z.imag / (2 * pi):>14.8g}  {z.imag:>14.8g}  {z.real:>14.3g}"
            for i, z in enumerate(values.tolist(), 1)
        ]
    _write(case, values, shapes)
    notes = [("note", text) for text in model.remarks()]
    return Outcome(case, notes, lines=[head, *rows], modes=(values, shapes))


def _real_modes(case: Case, progress: Progress | None) -> tuple[Array, Array]:
    """Return the lowest frequencies in rad/s, or those from one on, and their shapes."""
    model, count, above = case.model, case.modes, case.above
    if above is None:
        preload = case.preload or None if case.after is None else case.after.end
        return model.modes(count, preload=preload, progress=progress)
    for tried in (count, 2 * count, 4 * count, 8 * count):
        values, shapes = model.modes(tried, near=above, progress=progress)
        chosen = np.flatnonzero(values >= above)[:count]
        if len(chosen) == count:
            return values[chosen], shapes[chosen]
    raise SolveError(f"{count} modes above {above:g} rad/s are not among the {tried} nearest; ask for more")


def _write(case: Case, values: Any, shapes: Any) -> None:
    """Write the modes and their picture, which shows the first ones side by side."""
    outputs, mesh = case.outputs, case.model.mesh
    if outputs.json is not None:
        write_modes_json(outputs.json, values, buckling=case.buckling)
    for path in outputs.results:
        write_modes(path, mesh, values, shapes, mode=outputs.mode or "binary", buckling=case.buckling)
    if outputs.picture is not None:
        names = names_of_modes(values[:DRAWN].tolist(), case.buckling)
        write_picture(outputs.picture, case.model, modes=shapes[:DRAWN], titles=names)


def _harmonic(case: Case, progress: Progress | None) -> Outcome:
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
    notes = [("note", text) for text in case.model.remarks()]
    return Outcome(case, notes, lines=rows, response=response)


def _columns(response: HarmonicResponse) -> dict[str, Any]:
    """Return amplitudes and phases by headers, of all nodes at the first frequency and so on."""
    mesh, omega = response.mesh, response.frequencies
    u = np.concatenate([response.displacement(i) for i in range(len(omega))])
    nodes = {"frequency [rad/s]": omega.repeat(mesh.n_nodes), "node": np.tile(mesh.node_ids, len(omega))}
    return labelled({**nodes, **amplitudes(u)}, response.units)

"""Pages for the browser: one file that shows results in three dimensions, without a network."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.analysis.fields import FIELDS, PARTS, Field, listed, variable
from kratos_lite.analysis.subjects import evenly
from kratos_lite.atomic import refuse_nan, write_whole
from kratos_lite.errors import InputError, SolveError
from kratos_lite.io.writers.page.content import Content, Frame
from kratos_lite.typing import Array, Complexes

if TYPE_CHECKING:
    from kratos_lite.analysis.result import Result
    from kratos_lite.io.writers.recorded import Recorded
    from kratos_lite.mesh import Mesh

BROWSER = Path(__file__).with_name("browser")
"""Our style and scripts, and three.js with its license."""
LARGEST = 1e38
"""Largest number in a page, which has single precision."""
SCRIPTS = ("data.js", "fields.js", "body.js", "stage.js", "legend.js", "app.js")
MOST_FRAMES = 120
"""States in a page."""
MOST_VALUES = 1_000_000
"""Nodes of all states together, about 10 MB."""
OF_STATES = [
    *(FIELDS[name] for name in ("displacement", "von_mises", "velocity")),
    *(variable(name, 1) for name in ("accumulated_plastic_strain", "damage")),
]
"""Fields of states, those that there are."""


def write_page(path: str | Path, content: Content) -> None:
    """Write a page, as a whole or not at all; InputError for a mesh without a surface."""
    if not content.mesh.boundary:
        raise InputError(f"{path}: there is nothing to show: the mesh has no element of a known shape")
    _refuse_large(path, "coordinates", content.mesh.points)
    for frame in content.frames:
        for field, values in zip(content.fields, frame.values, strict=True):
            refuse_nan(path, field.name, values)
            _refuse_large(path, field.name, values)
    parts = {
        "title": html.escape(content.title),
        "style": _text("page.css"),
        "library": _text("three.js"),
        "data": content.packed(),
        "script": "\n".join(map(_text, SCRIPTS)),
    }
    pieces = re.split(r"\{(\w+)\}", _text("page.html"))
    pieces[1::2] = [parts[name] for name in pieces[1::2]]
    write_whole(path, "".join(pieces).encode())


def _text(name: str) -> str:
    return (BROWSER / name).read_text(encoding="utf-8")


def _refuse_large(path: str | Path, name: str, values: Array) -> None:
    """Raise SolveError for numbers that single precision does not hold."""
    largest = float(np.abs(values).max(initial=0.0))
    if largest > LARGEST:
        raise SolveError(
            f"{path}: not written: {name} reaches {largest:.3g}, and a page holds numbers up to "
            f"{LARGEST:.0e}; look for loads, supports or constants in wrong units, or write .vtu"
        )


def write_result_page(path: str | Path, result: Result) -> None:
    """Write the page of a result: its fields but for invariants, which the page makes of their tensors."""
    places = (listed(place, result.groups) for place in ("node", "element"))
    shown = {name: field for fields in places for name, field in fields.items()}
    fields = {name: field for name, field in shown.items() if not field.of and field.kind in PARTS}
    values = [result.field(name, field.nodal_place) for name, field in fields.items()]
    frame, start = Frame("", values), f"{list(fields).index('stress')}:von Mises"
    write_page(
        path,
        Content(Path(path).stem, "result", result.mesh, [*fields.values()], [frame], start, result.table()),
    )


def write_modes_page(path: str | Path, mesh: Mesh, names: Sequence[str], shapes: Array | Complexes) -> None:
    """Write the page of modes: their names and shapes (k, n, 3); the real part of φ exp(iωt) is shown."""
    largest = np.linalg.norm(shapes, axis=2).max(axis=1)
    scaled = shapes / np.where(largest > 0, largest, 1.0)[:, None, None]
    parts = [scaled.real] if not scaled.imag.any() else [scaled.real, -scaled.imag]
    shape = replace(FIELDS["displacement"], unit="")
    fields = [shape, replace(shape, name=f"{shape.name} a quarter period later")]
    frames = [Frame(name, values) for name, *values in zip(names, *parts, strict=True)]
    write_page(path, Content(Path(path).stem, "modes", mesh, fields[: len(parts)], frames))


def write_states_page(path: str | Path, subject: Recorded, states: list[Any]) -> None:
    """Write the page of states of a body or a transient: displacements, von Mises stresses, velocities."""
    mesh, all_of_them = subject.mesh(), len(states)
    most = max(2, min(MOST_FRAMES, MOST_VALUES // mesh.n_nodes))
    states = [states[row] for row in evenly(len(states), most)]
    kept, frames = list[Field](), []
    for state in states:
        points, _ = subject.fields(state)
        kept = [field for field in OF_STATES if field.kratos in points]
        frames.append(Frame(f"t = {state.time:.5g} s", [points[field.kratos] for field in kept]))
    about = [("states", f"{len(states)} of {all_of_them}")]
    write_page(path, Content(Path(path).stem, "states", mesh, kept, frames, about=about))

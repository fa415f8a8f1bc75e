"""Pages of states in time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from kratos_lite.analysis.fields import FIELDS, Field, variable
from kratos_lite.analysis.subjects import evenly
from kratos_lite.io.writers.page.content import Content, Frame
from kratos_lite.io.writers.page.write import write_page
from kratos_lite.io.writers.recorded import Recorded

MOST_FRAMES = 120
"""States in a page."""
MOST_VALUES = 1_000_000
"""Nodes of all states together, about 10 MB."""
OF_STATES = [
    *(FIELDS[name] for name in ("displacement", "von_mises", "velocity")),
    *(variable(name, 1) for name in ("accumulated_plastic_strain", "damage")),
]
"""Fields of states, those that there are."""


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

"""Endings of outputs: which formats hold a result, states in time, or modes."""

from __future__ import annotations

from pathlib import Path

from kratos_lite.errors import InputError

RESULTS = (".vtu", ".vtk", ".json", ".html", ".csv", ".pvtu", ".frd")
"""Formats that keep fields on nodes; most others of meshio drop them unsaid."""
SERIES = (".pvd", ".html", ".csv", ".npz", ".frd")
"""Formats of states in time: for ParaView, a page for the browser, a table, arrays, CalculiX's."""
MODES = (".pvd", ".html", ".frd")
"""Formats of modes: for ParaView, a page for the browser that lets them swing, CalculiX's."""


def check_result(path: str | Path, mode: str | None = None) -> None:
    """Raise InputError for a format that cannot hold a result, or that has no such mode of .vtu files."""
    ending = Path(path).suffix.lower()
    text = f"results cannot be written as {ending!r}; {' '.join(RESULTS)} hold all fields"
    if not ending:
        text = "give the file an ending that says its format, such as .vtu"
    elif ending in SERIES:
        text = f"{ending} holds states in time; add --time STEP:STEPS, or write .vtu"
    _check(path, RESULTS, text)
    if mode is not None:
        from kratos_lite.io.formats.vtu import check_mode  # rarely needed

        check_mode(mode)
        _check(path, (".vtu", ".pvtu"), f"only .vtu files are written as {mode}; leave the mode out")


def check_series(path: str | Path) -> None:
    """Raise InputError for a format that cannot hold states in time."""
    _check(path, SERIES, "states in time are written as .pvd (for ParaView), .html, .csv, .npz or .frd")


def check_modes(path: str | Path) -> None:
    """Raise InputError for a format that cannot hold modes."""
    _check(path, MODES, "modes are written as .pvd (for ParaView), .html or .frd")


def check_ending(path: str | Path, wanted: str) -> None:
    """Raise InputError for a path with another ending."""
    _check(path, (wanted,), f"the ending must be {wanted}")


def _check(path: str | Path, endings: tuple[str, ...], text: str) -> None:
    """Raise InputError for another ending."""
    if Path(path).suffix.lower() not in endings:
        raise InputError(f"{path}: {text}")

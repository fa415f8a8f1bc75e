"""Endings of outputs: which formats hold a result, and which hold states in time."""

from __future__ import annotations

from pathlib import Path

from kratos_lite.errors import InputError

RESULTS = (".vtu", ".vtk", ".json", ".html", ".csv", ".pvtu")
"""Formats that keep fields on nodes; most others of meshio drop them unsaid."""
SERIES = (".pvd", ".html", ".csv", ".npz")
"""Formats of states in time: for ParaView, a page for the browser, a table, arrays."""

MODES = (".pvd", ".html")
"""Formats of modes: for ParaView, a page for the browser that lets them swing."""


def check_result(path: str | Path, mode: str | None = None) -> None:
    """Raise InputError for a format that cannot hold a result, or that has no such mode of .vtu files."""
    ending = Path(path).suffix.lower()
    if not ending:
        raise InputError(f"{path}: give the file an ending that says its format, such as .vtu")
    if ending in SERIES and ending not in RESULTS:
        raise InputError(f"{path}: {ending} holds states in time; add --time STEP:STEPS, or write .vtu")
    if ending not in RESULTS:
        raise InputError(
            f"{path}: results cannot be written as {ending!r}; {' '.join(RESULTS)} hold all fields"
        )
    _check_page(ending)
    if mode is not None:
        from kratos_lite.io.formats.vtu import check_mode  # rarely needed

        check_mode(mode)
        if ending not in (".vtu", ".pvtu"):
            raise InputError(
                f"{path}: only .vtu files are written as {mode}; leave the mode out, or write .vtu"
            )


def piece_of(path: str | Path, number: int) -> Path:
    """Return the `.vtu` file of one part of a `.pvtu` file.

    >>> piece_of("out/beam.pvtu", 3).name
    'beam_3.vtu'
    """
    return Path(path).with_name(f"{Path(path).stem}_{number}.vtu")


def check_series(path: str | Path) -> None:
    """Raise InputError for a format that cannot hold states in time."""
    ending = Path(path).suffix.lower()
    if ending not in SERIES:
        raise InputError(f"{path}: states in time are written as .pvd (for ParaView), .html, .csv or .npz")
    _check_page(ending)


def check_modes(path: str | Path) -> None:
    """Raise InputError for a format that cannot hold modes."""
    ending = Path(path).suffix.lower()
    if ending not in MODES:
        raise InputError(f"{path}: modes are written as .pvd (for ParaView) or .html")
    _check_page(ending)


def _check_page(ending: str) -> None:
    """Raise KratosLiteError, before any work is done, where a page lacks its library."""
    if ending == ".html":
        from kratos_lite.io.writers.page.library import library  # rarely needed

        library()


def check_ending(path: str | Path, wanted: str) -> None:
    """Raise InputError for a path with another ending."""
    if Path(path).suffix.lower() != wanted:
        raise InputError(f"{path}: the ending must be {wanted}")

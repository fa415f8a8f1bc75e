"""meshio, which reads files of other programs: what it finds, prints and raises, in our words."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.errors import InputError

OURS = {".mdpa", ".svg", ".ele", ".node", ".xml"}
"""Endings left to others: read by ourselves, pictures, or spread over several files."""

Numbers = NDArray[Any]


@dataclass
class Cells:
    """Cells of one type of meshio: rows (m, k) of the points; (m, 0) where their number of nodes differs."""

    type: str
    dim: int
    data: Numbers


@dataclass
class Found:
    """What meshio finds in a file; non-numeric data are None.  `output` is what meshio says."""

    points: Numbers
    cells: list[Cells]
    point_data: dict[str, Any] = field(default_factory=dict)
    cell_data: dict[str, Any] = field(default_factory=dict)
    field_data: dict[str, Any] = field(default_factory=dict)
    point_sets: dict[str, Any] = field(default_factory=dict)
    cell_sets: dict[str, Any] = field(default_factory=dict)
    output: str = ""


FIELDS = ("point_data", "cell_data", "field_data", "point_sets", "cell_sets")


def read_foreign(path: Path) -> Found:
    """Return what meshio finds in a file; InputError if it cannot be read."""
    try:
        with guarded(path, "read") as (meshio, output):
            check_ending(path)
            _check_end(path)
            mesh = meshio.read(path)
            cells = [Cells(one.type, int(one.dim), _rows(one.data)) for one in mesh.cells]
            sets = {name: _numbers(getattr(mesh, name)) for name in FIELDS}
            points = _numbers(mesh.points)
    except MemoryError:
        cure = "is it complete, and are its counts right? Else convert it on a machine with more memory"
        raise InputError(f"{path}: meshio needs more memory than there is; {cure}") from None
    counts = [len(one.data) for one in cells]
    for name, values in sets["cell_data"].items():
        if not isinstance(values, list) or [-1 if v is None else len(v) for v in values] != counts:
            sets["cell_data"][name] = []  # not numeric: its name is all that is of use
    return Found(points, cells, **sets, output=output.getvalue())


def _check_end(path: Path) -> None:
    """Refuse Nastran files without ENDDATA, which meshio 5.3.5 would read for ever if they are cut early."""
    if path.suffix.lower() not in {".bdf", ".fem", ".nas"}:
        return
    if not re.search(rb"BEGIN BULK.*[\r\n]ENDDATA", path.read_bytes(), re.DOTALL):
        raise InputError(f"{path}: there is no ENDDATA behind a BEGIN BULK; is the file complete?")


def _rows(data: Any) -> Numbers:
    """Return the nodes of cells; only their number where they are no table of whole numbers."""
    try:
        rows = np.asarray(data)
    except ValueError:
        rows = np.zeros(0)
    return rows if rows.dtype.kind in "iu" and rows.ndim == 2 else np.zeros((len(data), 0), dtype=np.int64)


def _numbers(value: Any) -> Any:
    """Return a value with its arrays in the byte order of this machine; None where it is not numeric."""
    if isinstance(value, dict):
        return {str(name): _numbers(one) for name, one in value.items()}
    if isinstance(value, list) and any(one is None or isinstance(one, np.ndarray) for one in value):
        return [_numbers(one) for one in value]
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    if value is None or array.dtype.kind not in "biuf":
        return None
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def check_ending(path: Path, own: str = ".mdpa .elem") -> None:
    """Refuse an ending that meshio does not know, where meshio would end the program."""
    import meshio

    endings = sorted(set(meshio.extension_to_filetypes) - OURS)
    if not path.name.lower().endswith(tuple(endings)):
        raise InputError(f"{path}: unknown ending {path.suffix!r}; known are {own} {' '.join(endings)}")


@contextmanager
def guarded(path: Path, done: str) -> Iterator[tuple[Any, io.StringIO]]:
    """Give meshio and what it says; meshio prints and ends the program where others raise."""
    output, listing = io.StringIO(), io.StringIO()
    try:
        import meshio
        from meshio import _mesh

        for missing in ("wedge15", "pyramid13"):  # meshio 5.3.5 knows both but fails on their dimension
            _mesh.topological_dimension.setdefault(missing, 3)
        with redirect_stderr(output), redirect_stdout(listing), np.errstate(all="ignore"):
            yield meshio, output
    except ImportError as error:
        raise InputError(f"{path}: {error}; this format needs it: pip install {error.name}") from error
    except (InputError, MemoryError):
        raise
    except OSError as error:
        if done == "written":
            raise  # the disk, not the format
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (Exception, SystemExit) as error:
        last = "" if isinstance(error, SystemExit) else repr(error)
        reason = " ".join(f"{output.getvalue()} {listing.getvalue()} {last}".split())
        cure = "is the file complete?" if done == "read" else ".vtu and .vtk hold every mesh"
        raise InputError(f"{path}: cannot be {done} by meshio: {reason[:400]}; {cure}") from error

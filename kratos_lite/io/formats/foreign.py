"""Files of other programs: what meshio finds in them, prints and raises, in our words, and its cures."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.typing import Numbers

NOT_BY_MESHIO = {".mdpa", ".svg", ".ele", ".node", ".xml"}
"""Endings left to others: read by ourselves, pictures, or spread over several files."""
GEOMETRY = (".geo", ".step", ".stp", ".brep", ".iges", ".igs")
"""Endings of geometries, which Gmsh meshes."""
COMPLETE = ("wedge18", "pyramid14")
"""Quadratic cells with nodes amid their faces, which no element has."""


def read_foreign(path: Path) -> tuple[Any, str]:
    """Return the mesh that meshio finds in a file, and what meshio says; data that are not numeric are None.

    Cells are tables of rows of points (m, k), or (m, 0) where their number of nodes differs.
    """
    with guarded(path, "read") as (meshio, output):
        check_ending(path)
        _check_end(path)
        mesh = meshio.read(path)
        mesh.points = _numbers(mesh.points)
        for cells in mesh.cells:
            cells.data = _rows(cells.data)
        for name in ("point_data", "cell_data", "field_data", "point_sets", "cell_sets"):
            setattr(mesh, name, _numbers(getattr(mesh, name)))
        counts = [len(cells.data) for cells in mesh.cells]
        for name, values in mesh.cell_data.items():
            if not isinstance(values, list) or [-1 if v is None else len(v) for v in values] != counts:
                mesh.cell_data[name] = []  # not numeric: its name is all that is of use
    return mesh, output.getvalue()


def _check_end(path: Path) -> None:
    """Refuse Nastran files without ENDDATA, which meshio 5.3.5 would read for ever if they are cut early."""
    if path.suffix.lower() not in {".bdf", ".fem", ".nas"}:
        return
    if not re.search(rb"BEGIN BULK.*[\r\n]ENDDATA", path.read_bytes(), re.DOTALL):
        raise InputError(f"{path}: there is no ENDDATA behind a BEGIN BULK; is the file complete?")


def _rows(data: Any) -> Numbers:
    """Return the nodes of cells; only their number where they are no table of whole numbers."""
    rows = _numbers(data)
    is_table = isinstance(rows, np.ndarray) and rows.dtype.kind in "iu" and rows.ndim == 2
    return rows if is_table else np.zeros((len(data), 0), dtype=np.int64)


def _numbers(value: Any) -> Any:
    """Return numbers as arrays, also in dictionaries and lists; None for what is not numeric."""
    if isinstance(value, dict):
        return {str(name): _numbers(one) for name, one in value.items()}
    if isinstance(value, list) and any(one is None or isinstance(one, np.ndarray) for one in value):
        return [_numbers(one) for one in value]
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    return array if array.dtype.kind in "biuf" else None


def check_ending(path: Path, own: str = ".mdpa .elem") -> None:
    """Refuse an ending that meshio does not know, where meshio would end the program."""
    import meshio

    endings = sorted(set(meshio.extension_to_filetypes) - NOT_BY_MESHIO)
    if not path.name.lower().endswith(tuple(endings)):
        raise InputError(f"{path}: unknown ending {path.suffix!r}; known are {own} {' '.join(endings)}")


def cell_counts(mesh: Any) -> Counter[str]:
    """Return the number of cells of each type."""
    counts: Counter[str] = Counter()
    for cells in mesh.cells:
        counts[cells.type] += len(cells.data)
    return counts


def listed(counts: Counter[str]) -> str:
    """Return numbers of cells as text."""
    return ", ".join(f"{count} {kind}" for kind, count in counts.items() if count) or "no cells"


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
    except InputError:
        raise
    except (OSError, MemoryError) as error:
        if done == "written":
            raise  # the disk or the machine, not the format
        if isinstance(error, OSError):
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
        cure = "is it complete, and are its counts right? Else convert it on a machine with more memory"
        raise InputError(f"{path}: meshio needs more memory than there is; {cure}") from None
    except (Exception, SystemExit) as error:
        last = "" if isinstance(error, SystemExit) else repr(error)
        reason = " ".join(f"{output.getvalue()} {listing.getvalue()} {last}".split())
        cure = "is the file complete?" if done == "read" else ".vtu and .vtk hold every mesh"
        raise InputError(f"{path}: cannot be {done} by meshio: {reason[:400]}; {cure}") from error


# ---- what Gmsh is to do for a mesh that can be computed --------------------------------------------------


def meshing(path: Path, *more: str) -> str:
    """Return the command that meshes the geometry of a file.

    >>> meshing(Path("a/part.geo"))
    "'gmsh -3 -order 2 a/part.geo -o a/part.msh'"
    """
    geometry = path if path.suffix.lower() in GEOMETRY else path.with_suffix(".geo")
    words = ["gmsh -3 -order 2", *more, str(geometry), "-o", str(geometry.with_suffix(".msh"))]
    return f"'{' '.join(words)}'"


def check_solids(path: Path, found: Any, known: Collection[str]) -> None:
    """Raise InputError, with the cure, for a mesh without solids, or with solids that no element has."""
    counts, of_gmsh = cell_counts(found), path.suffix.lower() == ".msh"
    solids = {cells.type for cells in found.cells if cells.dim == 3 and len(cells.data)}
    for kind in sorted(solids - set(known)):
        cure = _of_known_order(path, kind) if of_gmsh else "save linear or quadratic ones"
        raise InputError(f"{path}: there are no elements for {counts[kind]} cells {kind!r}; {cure}")
    if not solids:
        text = "there are no solid cells (tetrahedra, pyramids, wedges, hexahedra)"
        cure = _of_volumes(path, found) if of_gmsh else "mesh the volume, too, such as with Gmsh"
        raise InputError(f"{path}: {text}, but {listed(counts)}; {cure}")


def _of_known_order(path: Path, kind: str) -> str:
    """Return how to have Gmsh save cells of the second order at most, without nodes amid faces."""
    if kind in COMPLETE:
        option = "-setnumber Mesh.SecondOrderIncomplete 1"
        line = "Mesh.SecondOrderIncomplete = 1;"
        return f"add the line {line} to the .geo file, or mesh with {meshing(path, option)}"
    return f"set Mesh.ElementOrder = 2; in the .geo file, or mesh with {meshing(path)}"


def _of_volumes(path: Path, found: Any) -> str:
    """Return how to have Gmsh save volumes; once there are physical groups, it saves nothing else."""
    dims = [np.ravel(named)[-1] for named in found.field_data.values() if np.size(named) == 2]
    grouped = dims or any(np.any(tags) for tags in found.cell_data.get("gmsh:physical", []))
    if not grouped or 3 in dims:
        return f"mesh volumes, not surfaces alone, with {meshing(path)}"
    line = 'Physical Volume("body") = {1};'
    return (
        f"Gmsh saves physical groups alone, and none is a volume: add the line {line} (with the numbers of "
        f"your volumes) to the .geo file, and mesh with {meshing(path)}"
    )

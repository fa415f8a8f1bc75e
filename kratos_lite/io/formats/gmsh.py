"""Gmsh: which command, or which line of a .geo file, gives a mesh that can be computed."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.io.formats.foreign import cell_counts, listed

GEOMETRY = (".geo", ".step", ".stp", ".brep", ".iges", ".igs")
"""Endings of geometries, which Gmsh meshes."""
COMPLETE = ("wedge18", "pyramid14")
"""Quadratic cells with nodes amid their faces, which no element has."""


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

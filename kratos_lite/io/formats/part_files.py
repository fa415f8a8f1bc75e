"""Part files of Kratos: an `.mdpa` file of its own for each rank, ``name_partitioned/name_0.mdpa`` and so on.

Source: MetisDivideHeterogeneousInputProcess of Kratos. Each element and each condition stands in one file;
NodalData PARTITION_INDEX names the rank that owns a node.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import Data, Document
from kratos_lite.io.formats.mdpa.reader import read_mdpa
from kratos_lite.io.formats.pieces import joined, piece_of
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Ints

OWNER = "PARTITION_INDEX"
FOLDER = "_partitioned"


def part_files(path: Path) -> dict[int, Path]:
    """Return the part files that an input stands for, by rank; none if it is an ordinary file.

    Parameters
    ----------
    path : ``name.mdpa``, where there is no such file but its parts, beside it or in ``name_partitioned``; or
        that folder.
    """
    if path.is_file():
        return {}
    stem = path.name.removesuffix(FOLDER) if path.is_dir() else path.name.removesuffix(".mdpa")
    for folder in [path] if path.is_dir() else [path.with_name(stem + FOLDER), path.parent]:
        number = re.compile(re.escape(stem) + r"_(\d+)\.mdpa")
        found = {}
        for file in folder.glob("*.mdpa") if folder.is_dir() else ():
            if match := number.fullmatch(file.name):
                found[int(match[1])] = file
        if found:
            return dict(sorted(found.items()))
    return {}


def check_part_files(path: Path, files: dict[int, Path], size: int) -> None:
    """Raise InputError unless there is one file for each rank."""
    missing = [rank for rank in range(max(files) + 1) if rank not in files]
    name = re.sub(r"_\d+\.mdpa$", "", next(iter(files.values())).name)
    if missing:
        raise InputError(
            f"{path}: the part file {name}_{missing[0]}.mdpa is missing; there are {_listed(files)}. "
            "Make the parts anew"
        )
    if len(files) != size:
        raise InputError(
            f"{path}: there are {len(files)} part files, {_listed(files)}, and {size} rank"
            f"{'s' if size > 1 else ''}; start `mpirun -n {len(files)}` with --engine petsc, or make "
            f"{size} parts"
        )


def _listed(files: dict[int, Path]) -> str:
    names = [file.name for file in files.values()]
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} … {names[-1]}"


def read_part_files(files: dict[int, Path], path: Path, ranks: Alone, strict: bool) -> Document:
    """Return what this rank holds of a model in part files, of which it reads its own.

    Raises
    ------
    InputError
        A file is missing, or has problems of its own.
    MeshError
        Ranks disagree on the place of a node, or two files have the same element.
    """
    with ranks.together():
        check_part_files(path, files, ranks.size)
        mine = files[ranks.rank]
        document = read_mdpa(mine, strict=strict)
        mesh = document.mesh
        owners = _owners(document, mine, ranks)
        nodal = [one for one in document.nodal_data if one.variable != OWNER]
        notes = [note for note in document.notes if not re.search(f"CommunicatorData|{OWNER}", note.text)]
        piece = piece_of(mesh, owners, merge=True)
    return joined(ranks, replace(document, nodal_data=nodal, notes=notes), piece, str(mine))


def _owners(document: Document, file: Path, ranks: Alone) -> Ints | None:
    """Return the owner of each node that the file names; InputError for a rank that does not exist."""
    found = next((one for one in document.nodal_data if one.variable == OWNER), None)
    if not ranks.any(found is not None):
        return None
    mesh = document.mesh
    owners = np.full(mesh.n_nodes, -1, dtype=np.int64)
    if found is not None:
        _check_owners(found, file, ranks.size)
        rows = mesh.node_rows(found.ids)
        owners[rows[rows >= 0]] = found.values[rows >= 0].astype(np.int64)
    return owners


def _check_owners(found: Data, file: Path, size: int) -> None:
    wrong = (found.values != np.round(found.values)) | (found.values < 0) | (found.values >= size)
    if wrong.any():
        at = int(np.argmax(wrong))
        raise InputError(
            f"{file}:{found.line}: {OWNER} of node {found.ids[at]} is {found.values[at]:g}; "
            f"with {size} part files it is 0 … {size - 1}. Make the parts anew"
        )

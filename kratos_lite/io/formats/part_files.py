"""Part files of Kratos: an `.mdpa` file of its own for each rank, ``name_partitioned/name_0.mdpa`` and so on.

Source: MetisDivideHeterogeneousInputProcess of Kratos. Each element and each condition stands in one file,
each node in every file that uses it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import Document
from kratos_lite.io.formats.mdpa.reader import read_mdpa

OWNER = "PARTITION_INDEX"
FOLDER = "_partitioned"


def part_files(path: Path) -> dict[int, Path]:
    """Return the part files that an input, their common name or folder, stands for; none for a file."""
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
            f"{'s' if size > 1 else ''}; start `mpirun -n {len(files)}` with --backend petsc, or make "
            f"{size} parts"
        )


def _listed(files: dict[int, Path]) -> str:
    names = [file.name for file in files.values()]
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} … {names[-1]}"


def read_part(file: Path, strict: bool = True) -> Document:
    """Return what one part file says; its named parts may be empty, as other files hold the rest of them."""
    document = read_mdpa(file, strict=strict)
    nodal = [data for data in document.nodal_data if data.variable != OWNER]
    notes = [note for note in document.notes if not re.search(f"CommunicatorData|{OWNER}", note.text)]
    return replace(document, mesh=document.mesh.replace(whole=False), nodal_data=nodal, notes=notes)

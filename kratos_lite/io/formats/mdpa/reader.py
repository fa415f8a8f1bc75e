"""Read Kratos model files, `.mdpa`, and the part files of many processes."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from kratos_lite.errors import InputError, nearest
from kratos_lite.io.formats.document import Document, Properties, already
from kratos_lite.io.formats.mdpa.data import read_constraints, read_data
from kratos_lite.io.formats.mdpa.mesh import PartReader, member_ids, read_blocks, read_mesh
from kratos_lite.io.formats.mdpa.scan import TOP, Frame, Source, scan
from kratos_lite.io.formats.mdpa.values import Table, read_table, read_values
from kratos_lite.io.text import blank_comments, integer, read_bytes


def read_mdpa(path: str | Path, *, strict: bool = True) -> Document:
    r"""Return all that an `.mdpa` file says; `strict` wants rows on lines of their own, unlike Kratos.

    >>> path = getfixture("tmp_path") / "one.mdpa"
    >>> _ = path.write_text("Begin Nodes\n 7 0.0 0.5 1.0D+00 // top\nEnd Nodes\n")
    >>> document = read_mdpa(path)
    >>> document.mesh.node_ids, document.mesh.points
    (array([7]), array([[0. , 0.5, 1. ]]))
    """
    source = Source(str(path), blank_comments(read_bytes(path), str(path)), strict)
    frames: dict[str, list[Frame]] = {name: [] for name in TOP}
    for frame in scan(source).children:
        if frame.name in frames and frame.name != "Mesh":
            frames[frame.name].append(frame)
        else:
            hint = "" if frame.name in TOP else nearest(frame.name, TOP)
            source.note(f"block {frame.name} is skipped.{hint}", frame.offset)
    document = _read(source, frames)
    source.problems.raise_if_any()
    document.notes = sorted(dict.fromkeys(source.notes), key=lambda note: note.line)
    return document


def _read(source: Source, frames: dict[str, list[Frame]]) -> Document:
    """Return the document; first what others refer to, whatever the order in the file."""
    properties = _by_id(source, frames["Properties"], _properties)
    tables = _by_id(source, frames["Table"], _table)
    mesh = read_mesh(source, frames, list(properties))
    # References to what is broken already would only be reported as missing.
    source.problems.raise_if_any()
    document = Document(mesh, properties, tables=tables)
    document.geometries = read_blocks(source, frames["Geometries"], mesh)
    document.model_data, _ = read_values(source, [span for f in frames["ModelPartData"] for span in f.spans])
    document.constraints = read_constraints(source, frames["Constraints"], mesh.node_ids)
    ids = member_ids(document)
    document.nodal_data = [read_data(source, f, ids["nodes"]) for f in frames["NodalData"]]
    document.element_data = [read_data(source, f, ids["elements"]) for f in frames["ElementalData"]]
    document.condition_data = [read_data(source, f, ids["conditions"]) for f in frames["ConditionalData"]]
    document.mesh = mesh.replace(parts=PartReader(source, ids).read(frames["SubModelPart"]))
    return document


def _by_id(source: Source, frames: list[Frame], read: Callable[[Source, Frame, int], Any]) -> dict[int, Any]:
    """Return what `read` makes of blocks, by the ids in their headers, which may be 0."""
    by_id: dict[int, Any] = {}
    for frame in frames:
        word, number = frame.arguments[0], -1
        try:
            number = 0 if word == "0" else integer(word.encode())
        except ValueError as error:
            source.problem(f"{frame.name}: {error}", frame.offset)
        if number in by_id and number >= 0:
            text = already(f"{frame.name} {number}", by_id[number].line, "; give each its own id")
            source.problem(text, frame.offset)
        by_id[number] = read(source, frame, number)
    return by_id


def _properties(source: Source, frame: Frame, number: int) -> Properties:
    values, lines = read_values(source, frame.spans)
    for child in frame.children:
        key = " ".join(["Table", *child.arguments])
        values[key], lines[key] = read_table(source, child), source.line(child.offset)
        source.note(f"{key} of {frame.title[6:]} is kept, but not used", child.offset)
    return Properties(number, values, lines, source.line(frame.offset))


def _table(source: Source, frame: Frame, number: int) -> Table:
    source.note(f"{frame.title[6:]} is kept, but not used", frame.offset)
    return read_table(source, frame)


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

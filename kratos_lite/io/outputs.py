"""Outputs: what a case writes, pictures too, is checked here before any work, and written after it."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from kratos_lite.analysis.result import Result
from kratos_lite.atomic import all_or_none
from kratos_lite.errors import InputError
from kratos_lite.io.case import Case, Outputs
from kratos_lite.io.formats import ELEM_SET, check_ending, check_modes, check_result, check_series, ending
from kratos_lite.io.writers.results import write_json, write_result


def check_outputs(case: Case) -> None:
    """Raise, before any work is done, for an output of a case that cannot be written.

    Folders may be missing for states in time; they are made then.
    """
    outputs, restart = case.outputs, case.time.restart if case.time else None
    read = [*case.files, *([Path(restart)] if restart else [])]
    check_targets(read, outputs.paths(), new_folders=case.time is not None)
    in_steps = [path for each in outputs.in_steps for path in each.paths()]
    check_targets([*read, *map(Path, outputs.paths())], in_steps, new_folders=True)
    for each in outputs.in_steps:
        each.check(case)
    _check_results(case)
    of_many = bool(case.time or case.modes)
    if outputs.mode and not any(not of_many or ending(path) == ".pvd" for path in outputs.results):
        kind = "OUT.pvd" if of_many else "OUT.vtu"
        raise InputError(f"--vtu {outputs.mode}: there is no output to write so; add -o {kind}")
    for single, wanted in ((outputs.json, ".json"), (outputs.state, ".npz")):
        if single is not None:
            check_ending(single, wanted)
    if outputs.picture is not None:
        check_picture(outputs.picture)
    if outputs.sections:
        from kratos_lite.analysis.section import cut_of  # a quick start without

        if case.modes or case.harmonic is not None or not case.is_of_model:
            raise InputError("a section is that of a result of a model; leave it out")
        for where, part in outputs.sections:
            cut_of(case.model.mesh, where, part, case.model.supports.ties)
    if not case.is_of_model and outputs.json is not None:
        raise InputError(f"{outputs.json}: a body has no summary in .json; write .csv or .npz")


def _check_results(case: Case) -> None:
    """Raise InputError for results that the analysis of a case does not have."""
    outputs = case.outputs
    if case.harmonic is not None and outputs.paths() != outputs.results:
        raise InputError("a harmonic response is written as .csv alone; leave json, picture and state out")
    for path in outputs.results:
        if case.modes:
            check_modes(path)
        elif case.harmonic is not None:
            check_ending(path, ".csv")
        elif case.time is None:
            check_result(path, outputs.mode)
        else:
            check_series(path)


def write_at_end(outputs: Outputs, result: Result, *, in_time: bool) -> None:
    """Write what the end of a model gives, all or nothing: its summary and, at rest, results and picture."""
    with all_or_none():
        if outputs.json is not None:
            write_json(outputs.json, result, outputs.sections)
        if in_time:
            return
        for output in outputs.in_steps:
            if output.is_due(output.end):
                output.add(result, output.end)
            output.close()
        for path in outputs.results:
            write_result(path, result, outputs.mode)
        if outputs.picture is not None:
            write_picture(outputs.picture, result)


def check_targets(read: Iterable[Path], targets: Iterable[str], *, new_folders: bool = False) -> None:
    """Raise InputError for a target that is read, given twice, or cannot be written.

    Where `new_folders` are made for the targets, a folder may be missing.
    """
    taken = {os.path.realpath(path) for source in read for path in _on_disk(source)}
    for target in targets:
        if not target:
            raise InputError("an output has an empty name; give a file name such as out.vtu")
        folder = Path(target).parent
        if not folder.is_dir() and not (new_folders and not folder.exists()):
            raise InputError(f"{target}: the folder {folder} does not exist")
        for path in _set_of(Path(target)):
            real, name = os.path.realpath(path), target if path == Path(target) else str(path)
            if path.exists() and not path.is_file():
                raise InputError(f"{name}: cannot be written: it is a folder or a device, not a file")
            if real in taken:
                raise InputError(f"{name}: is an input or another output; choose another name")
        taken |= {os.path.realpath(path) for path in _set_of(Path(target))}


def _on_disk(path: Path) -> list[Path]:
    """Return a path, and those files of its five-file set or of the stem of one that are there."""
    members = _set_of(path)
    if not path.is_file() and path.name:
        members += [path.with_name(path.name + suffix) for suffix in ELEM_SET]
    zipped = [file.with_name(file.name + ".gz") for file in members if file.name]
    return [path, *(file for file in (*members, *zipped) if file.is_file())]


def _set_of(path: Path) -> list[Path]:
    """Return all five files of a set, or the one file."""
    if ending(path) not in ELEM_SET:
        return [path]
    gz = ".gz" if path.suffix.lower() == ".gz" else ""
    stem = path.with_suffix("") if gz else path
    return [stem.with_suffix(suffix + gz) for suffix in ELEM_SET]


def is_film(path: str | Path | None) -> bool:
    """Return whether a path is that of a film, and no picture."""
    if path is None:
        return False
    from kratos_lite.view.animation import ENDINGS  # rarely needed

    return Path(path).suffix.lower() in ENDINGS


def check_picture(path: str | Path) -> None:
    """Raise, before any work is done, for a picture or film that cannot be written.

    Raises InputError for another ending, KratosLiteError where matplotlib or ffmpeg is missing.
    """
    if is_film(path):
        from kratos_lite.view.animation import check_animation

        check_animation(path)
        return
    from kratos_lite.view import canvas

    canvas.check_picture(path)


def write_picture(path: str | Path, thing: Any, **options: Any) -> None:
    """Write a picture or a film of a thing, with options that both have."""
    from kratos_lite.analysis.plot import animate, plot  # rarely needed

    if is_film(path):
        animate(path, thing, **options)
    else:
        plot(thing, path, **options)

"""Files that a command writes: none of them may be one that it reads, and each must be writable as asked."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from kratos_lite.errors import InputError

KEYS_READ = ("model", "input_filename", "materials_filename", "input_file_name", "restart")
"""Keys of run files that name files to be read."""


def check_targets(read: Iterable[Path], targets: Iterable[str | None], *, new_folders: bool = False) -> None:
    """Refuse, before any work is done, a target that is read, given twice, or cannot be written.

    Where `new_folders` are made for the targets, a folder may be missing.
    """
    taken = {os.path.realpath(path) for path in read}
    for target in targets:
        if target is None:
            continue
        if not target:
            raise InputError("an output has an empty name; give a file name such as out.vtu")
        folder = Path(target).parent
        if not folder.is_dir() and not (new_folders and not folder.exists()):
            raise InputError(f"{target}: the folder {folder} does not exist")
        for path in _set_of(Path(target)):
            real, name = os.path.realpath(path), target if path == Path(target) else str(path)
            if path.exists() and not path.is_file():
                raise InputError(f"{name}: cannot be written: it is a folder or a device, not a file")
            if os.path.islink(real):
                raise InputError(f"{name}: cannot be written: its symbolic links lead in a circle")
            if real in taken:
                raise InputError(f"{name}: is the input or another output already; choose another name")
        taken |= {os.path.realpath(path) for path in _set_of(Path(target))}


def check_json(path: str | None) -> None:
    """Refuse a target of --json with another ending."""
    if path is not None and Path(path).suffix.lower() != ".json":
        raise InputError(f"{path}: the ending must be .json; other results go to --output")


def files_read(source: str) -> list[Path]:
    """Return the files that an input stands for: itself, its whole set, and what a run file names."""
    from kratos_lite.io.documents import ending

    path = Path(source)
    found = [path, *_on_disk(path)]
    if ending(path) == ".json":
        from kratos_lite.io.settings import read_settings

        for name in _named(read_settings(path).values):
            for file in (path.parent / name, path.parent / Path(name.replace("\\", "/")).name):
                found += [*_on_disk(file), *_on_disk(file.with_name(file.name + ".mdpa"))]
    return found


def _on_disk(path: Path) -> list[Path]:
    """Return those files of a path, of its five-file set or of the stem of one, that are there."""
    from kratos_lite.io.documents import ELEM_SET

    members = _set_of(path)
    if not path.is_file() and path.name:
        members += [path.with_name(path.name + suffix) for suffix in ELEM_SET]
    zipped = [file.with_name(file.name + ".gz") for file in members if file.name]
    return [file for file in (*members, *zipped) if file.is_file()]


def _set_of(path: Path) -> list[Path]:
    """Return all five files of a set, or the one file."""
    from kratos_lite.io.documents import ELEM_SET, ending

    if ending(path) not in ELEM_SET:
        return [path]
    gz = ".gz" if path.suffix.lower() == ".gz" else ""
    stem = path.with_suffix("") if gz else path
    return [stem.with_suffix(suffix + gz) for suffix in ELEM_SET]


def _named(value: Any) -> Iterator[str]:
    """Yield the file names in a run file under the keys that are read."""
    if isinstance(value, dict):
        yield from (v for k, v in value.items() if k in KEYS_READ and isinstance(v, str) and v)
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _named(inner)

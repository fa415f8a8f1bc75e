"""Documents from files: the reader for each ending."""

from __future__ import annotations

from pathlib import Path

from kratos_lite.errors import InputError
from kratos_lite.io.document import Document

ELEM_SET = (".node", ".elem", ".cond", ".prop", ".init")


def ending(path: str | Path) -> str:
    """Return the ending of a path in lower case, without ``.gz``.

    >>> ending("beam.MDPA.gz")
    '.mdpa'
    """
    suffixes = [s.lower() for s in Path(path).suffixes]
    if suffixes and suffixes[-1] == ".gz":
        suffixes.pop()
    return suffixes[-1] if suffixes else ""


def read_document(path: str | Path, *, strict: bool = True) -> Document:
    """Return what a model file says: .mdpa, any file of an .elem set or its stem, or what meshio reads.

    `strict` refuses `.mdpa` rows that do not stand on lines of their own.
    """
    path = Path(path)
    kind = ending(path)
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: is a pipe or a device; name an ordinary file")
    if kind == ".mdpa":
        from kratos_lite.io.formats.mdpa.reader import read_mdpa

        return read_mdpa(path, strict=strict)
    stem = "" if path.is_file() else path.name  # "." has no name to put an ending to
    is_stem = stem and any(path.with_name(stem + s).is_file() for s in (".elem", ".node"))
    if kind in ELEM_SET or is_stem:
        from kratos_lite.io.formats.elem import read_elem

        return read_elem(path)
    if not path.exists():
        raise InputError(f"{path}: there is no such file")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file in it")
    from kratos_lite.io.formats.meshio import read_meshio

    return read_meshio(path)

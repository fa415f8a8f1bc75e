"""File formats, one module or folder each; here the reader and the writer are chosen by the ending.

A new format is one module, and one branch in `read_document`, in `write_document`, or in both.
"""

from __future__ import annotations

from pathlib import Path

from kratos_lite.errors import InputError, naming, no_such_file
from kratos_lite.io.formats.document import Document

PROJECT = "ProjectParameters.json"
"""The run file of Kratos, which stands for its folder."""
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


def describes_case(path: str | Path) -> bool:
    """Return whether a file says more than a mesh or model: a run file, a script, or a deck of a model."""
    kind = ending(path)
    if kind == ".inp" and Path(path).is_file():
        from kratos_lite.io.text import read_bytes

        text = read_bytes(path)
        return b"*STEP" in text or any(word in text.upper() for word in (b"*STEP", b"*SOLID"))
    return kind in (".json", ".py")


def input_file(path: str | Path) -> Path:
    """Return the file that an input means: of a folder that is no stem of a set, its run file of Kratos."""
    path = Path(path)
    try:
        path.stat()
    except FileNotFoundError:
        pass
    except OSError as reason:  # a name too long, or a folder that may not be entered
        raise InputError(f"{str(path)[:100]}: {reason.strerror}") from None
    run_file = path / PROJECT
    return run_file if path.is_dir() and not _is_stem(path) and run_file.is_file() else path


def _is_stem(path: Path) -> bool:
    """Return whether a path is the common stem of an .elem set."""
    name = path.name  # "." has no name to put an ending to
    return bool(name) and any(path.with_name(name + ending).is_file() for ending in (".elem", ".node"))


def read_document(path: str | Path, *, strict: bool = True) -> Document:
    """Return what a model file says: .mdpa, any file of an .elem set or its stem, or what meshio reads.

    `strict` refuses `.mdpa` rows that do not stand on lines of their own.
    """
    path = Path(path)
    kind = ending(path)
    with naming(str(path)):
        if path.exists() and not path.is_file() and not path.is_dir():
            raise InputError(f"{path}: is a pipe or a device; name an ordinary file")
        if not path.is_file() and (kind == ".mdpa" or path.is_dir()):
            _refuse_part_files(path)
        if kind == ".mdpa":
            from kratos_lite.io.formats.mdpa.reader import read_mdpa

            return read_mdpa(path, strict=strict)
        if kind in ELEM_SET or (not path.is_file() and _is_stem(path)):
            from kratos_lite.io.formats.elem.reader import read_elem

            return read_elem(path)
        if not path.exists():
            raise no_such_file(path)
        if path.is_dir():
            such = "".join(f", such as {file.name}" for file in sorted(path.glob("*arameters*.json"))[:1])
            raise InputError(f"{path}: is a folder without {PROJECT}; name a file in it{such}")
        from kratos_lite.io.formats.foreign import GEOMETRY, meshing

        if kind in GEOMETRY:
            raise InputError(
                f"{path}: is a geometry, not a mesh; mesh it with {meshing(path)} and give the .msh"
            )
        from kratos_lite.io.formats.meshio import read_meshio

        return read_meshio(path)


def _refuse_part_files(path: Path) -> None:
    """Raise InputError where a path stands for part files, which one process does not read."""
    from kratos_lite.io.formats.mdpa.reader import part_files  # rarely needed

    if files := part_files(path):
        raise InputError(
            f"{path}: there are {len(files)} part files; solve them by "
            f"`mpirun -n {len(files)} kratos-lite solve {path} --backend petsc`"
        )


def write_document(path: str | Path, document: Document) -> list[str]:
    """Write a document by the ending of `path`; return notes on what the format cannot hold."""
    kind = ending(path)
    with naming(str(path)):
        if kind == ".mdpa":
            from kratos_lite.io.formats.mdpa.writer import write_mdpa

            return [*map(str, write_mdpa(path, document)), *_mixed(document)]
        if kind in ELEM_SET:
            from kratos_lite.io.formats.elem.writer import write_elem

            return write_elem(path, document)
        if kind in ("", ".json"):
            raise InputError(
                f"{path}: a model cannot be written as {kind or 'a file without ending'}; try .mdpa"
            )
        from kratos_lite.mesh.vtk import mesh_fields

        points, cells = mesh_fields(document.mesh)
        if kind == ".vtu":
            from kratos_lite.io.formats.vtu import write_vtu

            write_vtu(path, document.mesh, points, cells)
        else:
            from kratos_lite.io.formats.meshio import write_meshio

            write_meshio(path, document.mesh, points, cells)
        return _left_out(kind, document)


def _mixed(document: Document) -> list[str]:
    """Note constraints between different directions, which Kratos 10 shifts by one when it reads them."""
    mixed = [c.id for c in document.constraints if {name for _, name in c.independents} - {c.dependent[1]}]
    shown = ", ".join(map(str, mixed[:5])) + (" …" if len(mixed) > 5 else "")
    text = f"constraints {shown} mix directions; kratos_lite reads them as meant, Kratos does not"
    return [text] if mixed else []


def _left_out(kind: str, document: Document) -> list[str]:
    """Note what a format of meshes does not hold."""
    data = {
        "properties": "properties (materials)", "nodal_data": "nodal data (supports, loads)",
        "element_data": "element data", "condition_data": "condition data", "constraints": "constraints",
        "tables": "tables",
    }  # fmt: skip
    lost = [what for name, what in data.items() if getattr(document, name)]
    lost += ["parts and conditions (loads)"] if document.mesh.parts or document.mesh.conditions else []
    notes = [f"{kind} files hold meshes only; left out: {', '.join(lost)}"] if lost else []
    unknown = [f"{len(b)} {b.name}" for b in document.mesh.blocks if b.shape is None and len(b)]
    return [*notes, f"left out, for their shape is unknown: {', '.join(unknown)}"] if unknown else notes


# ---- endings of outputs: which formats hold a result, states in time, or modes -----------------------------

RESULTS = (".vtu", ".vtk", ".json", ".html", ".csv", ".pvtu", ".frd")
"""Formats that keep fields on nodes; most others of meshio drop them unsaid."""
SERIES = (".pvd", ".html", ".csv", ".npz", ".frd")
"""Formats of states in time: for ParaView, a page for the browser, a table, arrays, CalculiX's."""
MODES = (".pvd", ".html", ".frd")
"""Formats of modes: for ParaView, a page for the browser that lets them swing, CalculiX's."""


def check_result(path: str | Path, mode: str | None = None) -> None:
    """Raise InputError for a format that cannot hold a result, or that has no such mode of .vtu files."""
    ending = Path(path).suffix.lower()
    text = f"results cannot be written as {ending!r}; {' '.join(RESULTS)} hold all fields"
    if not ending:
        text = "give the file an ending that says its format, such as .vtu"
    elif ending in SERIES:
        text = f"{ending} holds states in time; add --time STEP:STEPS, or write .vtu"
    _check(path, RESULTS, text)
    if mode is not None:
        from kratos_lite.io.formats.vtu import check_mode  # rarely needed

        check_mode(mode)
        _check(path, (".vtu", ".pvtu"), f"only .vtu files are written as {mode}; leave the mode out")


def check_series(path: str | Path) -> None:
    """Raise InputError for a format that cannot hold states in time."""
    _check(path, SERIES, "states in time are written as .pvd (for ParaView), .html, .csv, .npz or .frd")


def check_modes(path: str | Path) -> None:
    """Raise InputError for a format that cannot hold modes."""
    _check(path, MODES, "modes are written as .pvd (for ParaView), .html or .frd")


def check_ending(path: str | Path, wanted: str) -> None:
    """Raise InputError for a path with another ending."""
    _check(path, (wanted,), f"the ending must be {wanted}")


def _check(path: str | Path, endings: tuple[str, ...], text: str) -> None:
    """Raise InputError for another ending."""
    if Path(path).suffix.lower() not in endings:
        raise InputError(f"{path}: {text}")

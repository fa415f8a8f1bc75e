"""Files: read a model and write models, meshes and results, by the ending of the file name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from kratos_lite.errors import InputError
from kratos_lite.io.documents import ELEM_SET, ending, read_document
from kratos_lite.io.kratos import model_from
from kratos_lite.io.scene import Scene

if TYPE_CHECKING:
    from kratos_lite.io.document import Document
    from kratos_lite.model import Model


def read(path: str | Path, *, materials: bool = True, strict: bool = True) -> Model:
    """Return the model that a file describes.

    Parameters
    ----------
    path : .mdpa or any file of an .elem set or its stem (both also gzipped), a .json run file, or
        any format of meshio.
    materials : take the materials from the file; False leaves them to the caller (but for run files).
    strict : refuse `.mdpa` rows that do not stand on lines of their own (but in run files).

    Raises
    ------
    InputError
        With file, line and cure of everything that is wrong.
    """
    return load(path, materials=materials, strict=strict).model


def load(path: str | Path, *, materials: bool = True, strict: bool = True) -> Scene:
    """Return the model that a file describes, and what a run file says beyond it; see `read`."""
    if ending(path) == ".json":
        from kratos_lite.io.project import read_project

        return read_project(path)
    return Scene(model_from(read_document(path, strict=strict), materials=materials))


def write(path: str | Path, thing: Any) -> None:
    """Write a result, a model or a mesh by the ending of `path`.

    A result goes to .vtu, .json or a format of meshio; a model or a mesh to .mdpa, an .elem set,
    .vtu or a format of meshio.
    """
    from kratos_lite.io.document import Document
    from kratos_lite.mesh import Mesh
    from kratos_lite.model import Model
    from kratos_lite.result import Result

    if isinstance(thing, Result):
        thing.save(path)
    elif isinstance(thing, Model):
        from kratos_lite.io.kratos import document_from

        write_document(path, document_from(thing))
    elif isinstance(thing, Mesh):
        write_document(path, Document(thing))
    elif isinstance(thing, Document):
        write_document(path, thing)
    else:
        raise InputError(f"a Result, Model or Mesh can be written; got {type(thing).__name__}")


def write_document(path: str | Path, document: Document) -> list[str]:
    """Write a document by the ending of `path`; return notes on what the format cannot hold."""
    kind = ending(path)
    if kind == ".mdpa":
        from kratos_lite.io.mdpa import write_mdpa

        write_mdpa(path, document)
        return []
    if kind in ELEM_SET:
        from kratos_lite.io.elem import write_elem

        return [str(note) for note in write_elem(path, document)]
    if kind in ("", ".json"):
        raise InputError(f"{path}: a model cannot be written as {kind or 'a file without ending'}; try .mdpa")
    from kratos_lite.io.results import mesh_fields

    points, cells = mesh_fields(document.mesh)
    if kind == ".vtu":
        from kratos_lite.io.vtu import write_vtu

        write_vtu(path, document.mesh, points, cells)
    else:
        from kratos_lite.io.bridge import write_meshio

        write_meshio(path, document.mesh, points, cells)
    lost = [
        "properties",
        "nodal_data",
        "element_data",
        "condition_data",
        "constraints",
        "tables",
        "model_data",
    ]
    kept = [name for name in lost if getattr(document, name)]
    notes = [f"{kind} files hold meshes only; left out: {', '.join(kept)}"] if kept else []
    unknown = [
        f"{len(block)} {block.name}" for block in document.mesh.blocks if block.shape is None and len(block)
    ]
    return [*notes, f"left out, for their shape is unknown: {', '.join(unknown)}"] if unknown else notes

"""Files: read a model and write models, meshes and results, by the extension of the file name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError
from kratos_lite.io.case import Case
from kratos_lite.io.formats import describes_case, ending, input_file, read_document, write_document
from kratos_lite.io.formats.document import Document
from kratos_lite.io.formats.mdpa.reader import part_files, read_part
from kratos_lite.io.kratos.to_model import model_from
from kratos_lite.mesh import SIDES, Mesh
from kratos_lite.model.supports import hanging_constraints
from kratos_lite.validation import number, path_of
from kratos_lite.view.progress import watched


def read(
    path: str | Path,
    *,
    materials: bool = True,
    strict: bool = True,
    initial_displacement: bool = True,
    scale: float = 1.0,
) -> Model:
    """Return the model that a file describes.

    Parameters
    ----------
    path : .mdpa or any file of an .elem set or its stem (both also gzipped), a .json run file of Kratos, a
        folder with a ``ProjectParameters.json``, a deck of CalculiX (.inp) with steps, of which the first
        counts, a Python script with a case, or any format of meshio.
    materials : take the materials from the file; False leaves them to the caller (but for run files).
    strict : refuse `.mdpa` rows that do not stand on lines of their own (but in run files).
    initial_displacement : take the DISPLACEMENT of nodes that are not fixed for the state without stress,
        as KinematicLinear does in Kratos; False ignores it.
    scale : factor on coordinates, such as 1e-3 for a mesh in mm; nothing else in a file is scaled.

    Returns
    -------
    The model, with its loads and supports.

    Raises
    ------
    InputError
        With file, line and cure of everything that is wrong.
    """
    case = read_case(
        path, materials=materials, strict=strict, initial_displacement=initial_displacement, scale=scale
    )
    if not case.is_of_model:
        raise InputError(f"{path}: describes a body; read it with kl.read_case")
    return case.model


def read_case(
    path: str | Path,
    *,
    materials: bool = True,
    strict: bool = True,
    allow_outside: bool = False,
    initial_displacement: bool = True,
    linear: bool = False,
    scale: float = 1.0,
    part: int | None = None,
) -> Case:
    """Return what an input means: model or body, analysis, outputs and expected values.

    Parameters
    ----------
    path : a model file, as for `read`; a .json run file of Kratos; a folder with a
        ``ProjectParameters.json``; a deck of CalculiX (.inp), whose further steps are ``then``; or a Python
        script that defines a `case`, or `body`, `dt` and `steps`.
    materials : take the materials from a model file; False leaves them to the caller.
    strict : refuse `.mdpa` rows that do not stand on lines of their own.
    allow_outside : let a .json file name files outside its folder.
    initial_displacement : take the DISPLACEMENT of nodes that are not fixed for the state without stress;
        False ignores it.
    linear : take small displacements and linear laws where a run file asks for others.
    scale : factor on the coordinates of a mesh file, such as 1e-3 for mm; nothing else is scaled.
    part : number of the part to read, of a mesh that Kratos has divided into part files.

    Returns
    -------
    Case
        To be changed, or run by `kratos_lite.run`.

    Raises
    ------
    InputError, MeshError, ModelError, MaterialError
        With file, line and cure of everything that is wrong.
    """
    path, scale = input_file(path_of(path)), number(scale, "scale", above=0)
    if scale != 1 and describes_case(path):
        raise InputError(f"{path}: scale is that of a mesh file; write {ending(path)} files in SI units")
    with watched(None, "read"):
        if ending(path) == ".json":
            from kratos_lite.io.kratos.run_file import read_kratos_project

            case = read_kratos_project(
                path, allow_outside, initial_displacement=initial_displacement, linear=linear, part=part
            )
        elif ending(path) == ".py":
            from kratos_lite.io.script import read_script

            case = read_script(path)
        elif describes_case(path):
            from kratos_lite.io.abaqus.steps import read_deck

            case = read_deck(path)
        else:
            document = (
                read_document(path, strict=strict)
                if part is None
                else read_part(part_files(path)[part], strict)
            )
            if scale != 1:
                document.mesh = document.mesh.replace(points=scale * document.mesh.points)
            model = model_from(document, materials=materials, initial_displacement=initial_displacement)
            case = Case(model, files=[path])
        return case


def write(path: str | Path, thing: Any, mode: str | None = None) -> list[str]:
    """Write a result, a state, a model or a mesh by the extension of `path`.

    Parameters
    ----------
    path : a result goes to .vtu, .vtk, .json, .html, a page for the browser, .frd of CalculiX or, values of
        nodes alone, .csv; to .pvtu and .vtu pieces of a result of many processes; values at points and
        sections to .csv; a state to .npz, from which `read_state` reads; a model or a mesh to .mdpa, an .elem
        set, .vtu or a format of meshio.
    thing : a `Result`, what its `at`, `along` or `section` returns, a `State`, `Model` or `Mesh`.
    mode : of the .vtu file of a result: ``binary`` (if not given), ``compressed`` or ``ascii``.

    Returns
    -------
    list of str
        What the format cannot hold and was left out.

    Raises
    ------
    InputError
        The thing is not one of these, or the format cannot hold it.
    """
    from kratos_lite.analysis.point_values import PointValues
    from kratos_lite.analysis.result import Result
    from kratos_lite.analysis.section import Section
    from kratos_lite.analysis.state import State
    from kratos_lite.io.writers.results import write_result, write_table
    from kratos_lite.io.writers.state import write_state

    path = path_of(path)
    if isinstance(thing, Result):
        write_result(path, thing, mode)
        return []
    if mode is not None:
        raise InputError(f"{path}: only .vtu files of results have a mode; leave the mode out")
    if isinstance(thing, (PointValues, Section)):
        write_table(path, thing.columns())
        return []
    if isinstance(thing, State):
        write_state(path, thing)
        return []
    if isinstance(thing, Model):
        from kratos_lite.io.kratos.to_document import document_from

        document = document_from(thing)
        return [str(note) for note in document.notes] + write_document(path, document)
    if isinstance(thing, (Mesh, Document)):
        return write_document(path, _document_of(thing) if isinstance(thing, Mesh) else thing)
    known = "a Result, PointValues, State, Model or Mesh"
    raise InputError(f"{known} can be written; got {type(thing).__name__}")


def _document_of(mesh: Mesh) -> Document:
    """Return a mesh with names for files of sides, such as ``z+`` of a box, and hanging nodes tied."""
    from kratos_lite.io.kratos.to_document import constraints_of, name_of_part

    ends = (*SIDES, "cut-", "cut+")
    parts = {
        name_of_part(name) if name.rpartition(".")[2] in ends else name: part
        for name, part in mesh.parts.items()
    }
    return Document(mesh.replace(parts=parts), constraints=constraints_of(mesh, hanging_constraints(mesh)))

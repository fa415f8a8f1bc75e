"""Pictures: meshes, results and reference cells, drawn and written to files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite import view, voigt
from kratos_lite.analysis.fields import fields
from kratos_lite.analysis.result import Result
from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import InputError
from kratos_lite.io.atomic import write_whole
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.blocks import with_rows
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array
from kratos_lite.validation import short

NAMES = {
    "VON_MISES_STRESS": "von Mises stress",
    "ENERGY_NORM_ERROR": "estimated error of each element in the energy norm",
}
"""Titles where the words of the variable do not do."""


def draw(
    path: str | Path,
    thing: Mesh | Result,
    displacement: ArrayLike | None = None,
    values: ArrayLike | str | None = None,
    *,
    title: str = "",
    unit: str | None = None,
    scale: float | None = None,
    size: tuple[float, float] = (8, 6),
) -> None:
    """Draw the surface of a mesh or a result, deformed and colored, in isometric view.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    thing : a mesh; or a result, whose displacement is drawn if no other is given.
    displacement : (n, 3) m; the undeformed edges are drawn thin.
    values : (n,) numbers on the nodes that color the surface; of a result also the name of a nodal field,
        ``VON_MISES_STRESS`` if nothing is given.  ``CAUCHY_STRESS_VECTOR`` is drawn as that, too; of other
        vectors the length; ``ENERGY_NORM_ERROR`` is the estimated error.
    title : first line above the picture.
    unit : of `values`, at the color bar; found from the title if it names a variable that we know.
    scale : factor on the displacement; by default at least 1, the largest being a tenth of the body.
    size : largest width and height in inches, at 150 dots per inch.

    Raises
    ------
    InputError
        The mesh has no surface, an array has the wrong shape or gaps, the field is unknown, or the file
        cannot be written.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> mesh = kl.box()
    >>> kl.draw(getfixture("tmp_path") / "cube.png", mesh, values=mesh.points[:, 0], title="x", unit="m")
    """
    mesh = thing
    if isinstance(thing, Result):
        mesh, displacement = thing.mesh, thing.u if displacement is None else displacement
        if values is None or isinstance(values, str):
            values, named = _field(thing, values or "VON_MISES_STRESS")
            title = title or named
    if not isinstance(mesh, Mesh) or isinstance(values, str):
        raise InputError(f"{path}: a Mesh with arrays or a Result can be drawn; got {type(thing).__name__}")
    save_figure(
        path,
        view.surface_figure(mesh, displacement, values, title=title, unit=unit, scale=scale, size=size),
    )


def _field(result: Result, name: str) -> tuple[Array, str]:
    """Return a nodal field as one number a node, and the title for it."""
    if name == "ENERGY_NORM_ERROR":
        return _around_nodes(result.mesh, result.error().per_element), NAMES[name]
    points, _ = fields(result)
    if name not in points:
        raise InputError(f"there is no nodal field {name!r}; have {', '.join(points)}, ENERGY_NORM_ERROR")
    field = points[name]
    if name == "CAUCHY_STRESS_VECTOR":
        field, name = voigt.von_mises(field), "VON_MISES_STRESS"
    elif field.ndim == 2:
        field = np.linalg.norm(field, axis=1)
    return field, NAMES.get(name, name.replace("_", " ").lower())


def _around_nodes(mesh: Mesh, values: Array) -> Array:
    """Return the means (n,) of values of elements (m,) around each node."""
    total, count = np.zeros(mesh.n_nodes), np.zeros(mesh.n_nodes)
    for block, at in with_rows(mesh.blocks):
        nodes = block.nodes.ravel()
        total += np.bincount(nodes, np.repeat(values[at], block.nodes.shape[1]), mesh.n_nodes)
        count += np.bincount(nodes, minlength=mesh.n_nodes)
    return total / np.maximum(count, 1)


def draw_element(
    path: str | Path, shape: type[Shape] | type[KinematicLinear], points: ArrayLike | None = None
) -> None:
    """Draw a reference cell with its node numbers (from 0), and Gauss points as crosses.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    shape : the cell, or an element class, whose Gauss points are marked.
    points : (g, d) reference coordinates to mark.

    Raises
    ------
    InputError
        `shape` is neither a shape nor an element class, `points` has the wrong shape, or the file cannot be
        written.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> from kratos_lite.shapes.wedges import Wedge15
    >>> draw_element(getfixture("tmp_path") / "wedge.png", Wedge15)
    """
    if isinstance(shape, type) and issubclass(shape, KinematicLinear) and hasattr(shape, "shape"):
        points = shape.rule.points if points is None else points
        shape = shape.shape
    if not (isinstance(shape, type) and issubclass(shape, Shape) and hasattr(shape, "nodes")):
        raise InputError(
            "draw_element takes a shape or an element class, such as Hexahedron8 or KinematicLinear3D8N; "
            f"got {short(shape)}"
        )
    save_figure(path, view.element_figure(shape, points))


def draw_history(
    path: str | Path, result: Result, *, title: str = "", size: tuple[float, float] = (6, 4)
) -> None:
    """Draw the reported error of each mesh of an adaptive solution against its unknowns.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    result : of ``model.solve(error=…)``.
    title : above the picture.
    size : width and height in inches, at 150 dots per inch.

    Raises
    ------
    InputError
        It is no such result, or the file cannot be written.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> model = kl.Model(kl.box(cells=(2, 1, 1)), kl.Isotropic3D(E=1e9, nu=0.3))
    >>> model.fix("x-")
    >>> model.add(kl.Traction("x+", (0.0, 0.0, 1e3)))
    >>> draw_history(getfixture("tmp_path") / "history.png", model.solve(error=0.2))
    """
    if not isinstance(result, Result) or not result.report.history:
        raise InputError(f"{path}: a result of model.solve(error=...) has a history; got {short(result)}")
    report, steps = result.report, result.report.history
    unknowns, errors = (np.array([getattr(s, name) for s in steps]) for name in ("unknowns", "error"))
    goal, of = report.error_asked, report.error_of
    save_figure(path, view.history_figure(unknowns, errors, goal=goal, of=of, title=title, size=size))


def check_picture(path: str | Path) -> str:
    """Return the type of a picture, before any work is done.

    Raises InputError for a type that cannot be written, KratosLiteError where matplotlib is missing.
    """
    kind, known = Path(path).suffix[1:].lower() or "png", view.file_types()
    if kind not in known:
        raise InputError(f"{path}: pictures cannot be written as .{kind}; known are {' '.join(known)}")
    return kind


def save_figure(path: str | Path, figure: Any) -> None:
    """Write a figure, as a whole or not at all."""
    kind = check_picture(path)
    write_whole(path, lambda file: figure.savefig(file, format=kind, bbox_inches="tight", pad_inches=0.1))

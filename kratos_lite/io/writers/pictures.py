"""Pictures: meshes and results, reference cells and trajectories, drawn and written to files."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite import view, voigt
from kratos_lite.analysis.result import Result
from kratos_lite.bodies import Body, State
from kratos_lite.errors import InputError, ModelError
from kratos_lite.io.atomic import write_whole
from kratos_lite.io.writers.results import fields
from kratos_lite.io.writers.series import check_single, row_of
from kratos_lite.mesh import Mesh
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array

NAMES = {"VON_MISES_STRESS": "von Mises stress"}
"""Titles where the words of the variable do not do."""
SHOWN = 6
"""Positions in a picture."""
CANDIDATES = 400
"""States, evenly spread, among which they are chosen."""
ALIKE = 0.02
"""Share of its size that a body moves between positions that are worth drawing."""


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
        ``VON_MISES_STRESS`` if nothing is given.
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
    points, _ = fields(result)
    if name not in points:
        raise InputError(f"there is no nodal field {name!r}; have {', '.join(points)}")
    field = points[name]
    if name == "CAUCHY_STRESS_VECTOR":
        field, name = voigt.von_mises(field), "VON_MISES_STRESS"
    elif field.ndim == 2:
        field = np.linalg.norm(field, axis=1)
    return field, NAMES.get(name, name.replace("_", " ").lower())


def draw_element(path: str | Path, shape: type[Shape], points: ArrayLike | None = None) -> None:
    """Draw a reference cell with its node numbers (from 0), and Gauss points as crosses.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    shape : the cell.
    points : (g, d) reference coordinates to mark.

    Raises
    ------
    InputError
        `points` has the wrong shape, or the file cannot be written.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> from kratos_lite.shapes import Wedge15
    >>> draw_element(getfixture("tmp_path") / "wedge.png", Wedge15)
    """
    save_figure(path, view.element_figure(shape, points))


def draw_trajectory(
    path: str | Path,
    body: Body,
    states: Iterable[State],
    *,
    shown: int = SHOWN,
    title: str = "",
    size: tuple[float, float] = (8, 8),
) -> None:
    """Draw a body along its path, and its energies against time beneath if there is more than one state.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    body : a single body with a mesh.
    states : in the order of time.
    shown : how many positions are drawn at most: the first, the last, and those that differ most from each
        other, such as turning points; the later the stronger.
    title : above the picture.
    size : largest width and height in inches, at 150 dots per inch.

    Raises
    ------
    InputError
        There are no states, or the file cannot be written.
    ModelError
        The body has no mesh, or is many bodies.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.PseudoRigidBody(kl.box(), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    >>> body.set_velocity(linear=(1, 0, 0), angular=(0, 0, 1))
    >>> draw_trajectory(getfixture("tmp_path") / "spin.png", body, kl.march(body, 0.01, 100, every=10))
    """
    check_single(body, Path(path))
    if body.mesh is None:
        raise ModelError(f"{path}: this body has no mesh to be drawn")
    rows, kept = [], []
    for state in states:
        rows.append(row_of(body, state))
        kept.append(state.q)
    if not kept:
        raise InputError(f"{path}: there is no state to draw")
    table = np.array(rows)
    positions = [body.position(body.mesh.points, kept[i]) for i in _telling(body, kept, shown)]
    names = ("kinetic", "internal", "potential", "sum")
    curves = {name: table[:, 1 + i] for i, name in enumerate(names) if table[:, 1 + i].any()}
    figure = view.motion_figure(
        body.mesh,
        positions,
        table[:, 6:9],
        table[:, 0],
        curves,
        title=title,
        unit="energy in J",
        size=size,
    )
    save_figure(path, figure)


def _telling(body: Body, kept: list[Array], shown: int) -> list[int]:
    """Return the states to draw: first and last, then again and again the one farthest from those chosen."""
    assert body.mesh is not None
    X = body.mesh.points
    corners = np.unique([np.argmax(X @ side) for side in product((-1, 1), repeat=3)])
    rows = np.unique(np.linspace(0, len(kept) - 1, CANDIDATES).round().astype(int))
    places = np.array([body.position(X, kept[row])[corners] for row in rows])

    def away(i: int) -> Array:
        return np.asarray(((places - places[i]) ** 2).sum(axis=(1, 2)))

    chosen = [len(rows) - 1, 0][: max(shown, 1)]
    distance = np.min([away(i) for i in chosen], axis=0)
    alike = (ALIKE * np.ptp(X, axis=0).max()) ** 2 * len(corners)
    while len(chosen) < shown and distance.max() > alike:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, away(chosen[-1]))
    return sorted({int(rows[i]) for i in chosen})


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

"""Pictures of whatever there is to see: meshes, models, results, bodies along their paths, elements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.analysis.named_values import Fields, named_values
from kratos_lite.analysis.path_picture import path_figure
from kratos_lite.analysis.report import Report
from kratos_lite.analysis.state import State
from kratos_lite.bodies import Body
from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh
from kratos_lite.model.structure import Structure
from kratos_lite.records import replace
from kratos_lite.shapes import Shape
from kratos_lite.validation import finite, number, short
from kratos_lite.view import canvas
from kratos_lite.view.camera import View
from kratos_lite.view.figure import Options, Subject, Values, factor_of, figure_of
from kratos_lite.view.history import history_figure
from kratos_lite.view.reference_cell import element_figure

DEFAULT = "von_mises"
"""What colors a result."""
KINDS = (
    "a mesh, a model, a result, several of them, a body with states, a transient with states, the report of "
    "an adaptive solution, or the class of an element"
)


@runtime_checkable
class Transient(Protocol):
    """A model in time."""

    def state(self) -> State:
        """Return the state of now."""

    def result(self, state: State | None = None) -> Fields:
        """Return the result of a state."""


def plot(
    thing: Any,
    path: str | Path | None = None,
    *,
    values: ArrayLike | str | None = None,
    displacement: ArrayLike | None = None,
    states: Iterable[State] | State | None = None,
    view: View | None = None,
    clim: Sequence[float] | None = None,
    scale: float | str = "auto",
    zoom: Any = None,
    clip: Sequence[Any] | None = None,
    title: str | None = None,
    titles: Sequence[str] | None = None,
    unit: str | None = None,
    points: ArrayLike | None = None,
    shown: int | None = None,
    size: tuple[float, float] | None = None,
) -> Any:
    """Draw a thing; return the figure, which a notebook shows, and write it if a path is given.

    Parameters
    ----------
    thing : a mesh; a model; a result, deformed and colored by its von Mises stress; a list of these, or a
        dict by their titles, side by side with one camera and one scale of colors; a body or a transient with
        `states`; the ``report`` of a solution to a requested error, error against unknowns; or the class of
        an element or a shape, with its node numbers (from 0) and Gauss points.
    path : picture to write; .png, .pdf or .svg.
    values : what colors the surface: (n,) numbers of nodes, (m,) of elements; of a result also a name:
        ``displacement``, ``ux``, ``uy``, ``uz``, ``reaction``, ``von_mises``, ``tresca``, principal stresses
        ``s1``, ``s2``, ``s3``, components ``sxx``, ``syy``, ``szz``, ``sxy``, ``syz``, ``szx``, the same of
        the strain as ``e1`` … ``ezx``, or ``error``, the estimate of each element.
    displacement : (n, 3) m, in place of that of a result, such as the shape of a mode; the undeformed edges
        are drawn thin.
    states : of a body or a transient, in the order of time, or one.
    view : ``iso``, ``x-``, ``x+``, ``y-``, ``y+``, ``z-``, ``z+``, the side that is looked at; azimuth and
        elevation of the viewer in degrees; or the direction towards the viewer, (3,).  If not given, ``iso``,
        and more from the side for long and thin bodies.
    clim : lowest and highest value of the colors; those of the body if not given.
    scale : factor on the displacement, 0 for the undeformed body; ``auto``: at least 1, the largest being a
        tenth of the body.
    zoom : factor, a part or a box ((x, y, z), (x, y, z)) that fills the picture.
    clip : plane that cuts the body open, ``("x", 0.5)`` or (normal, offset), in m, of the undeformed body;
        what lies between it and the viewer is taken away.
    title, titles : above the picture; above each of several.
    unit : of own values, at the color bar.
    points : (g, d) reference coordinates to mark in an element, in place of its Gauss points.
    shown : how many positions along a path are drawn at most (6): the first, the last, and those that differ
        most from each other, such as turning points; the later the stronger.
    size : largest width and height in inches, at 150 dots per inch.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        There is nothing to draw, an option does not fit, an array has the wrong shape or gaps, or the file
        cannot be written.
    MeshError
        There is no such part to zoom to.
    ModelError
        A body has no mesh, or is a batch of bodies.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> model = kl.Model(kl.box((4, 1, 1), (8, 2, 2)), kl.Isotropic3D(E=210e9, nu=0.3))
    >>> model.fix("x-")
    >>> model.add(kl.Traction("x+", (0, 0, -1e6)))
    >>> result, folder = model.solve(), getfixture("tmp_path")
    >>> figure = kl.plot(result, folder / "bar.png", values="sxx", view="y-")
    >>> figure = kl.plot({"coarse": result, "cut": result}, clip=("y", 0.5), clim=(0, 3e7))
    >>> figure = kl.plot(kl.KinematicLinear3D20N)
    """
    if path is not None:
        canvas.check_picture(path)
    given = {name: value for name, value in locals().items() if name not in ("thing", "path")}
    figure = _figure(thing, given)
    if path is not None:
        canvas.save(figure, path)
    return figure


def _figure(thing: Any, given: dict[str, Any]) -> Any:
    """Return the figure of a thing with the options that were given."""
    if isinstance(thing, Report):
        _only(given, "a report", ("title", "size"))
        return _history(thing, given)
    if isinstance(thing, type):
        _only(given, "an element", ("points",))
        return _element(thing, given["points"])
    if isinstance(thing, Body):
        _only(given, "a body", ("states", "shown", "title", "size", "view"))
        return path_figure(thing, given)
    for name in ("points", "shown"):
        if given[name] is not None:
            raise InputError(
                f"{name} belongs to {'an element' if name == 'points' else 'a body'}; leave it out"
            )
    return figure_of(*_subjects(thing, given))


def _only(given: dict[str, Any], what: str, known: Sequence[str]) -> None:
    """Raise InputError for an option that does not belong to what is drawn."""
    for name, value in given.items():
        if name not in known and value is not None and not (name == "scale" and isinstance(value, str)):
            raise InputError(f"{name} does not belong to the picture of {what}; it takes {', '.join(known)}")


def _history(report: Report, given: dict[str, Any]) -> Any:
    if not report.history:
        raise InputError(
            "this report has no history to draw: that of model.solve(error=...) has the error of each mesh"
        )
    unknowns, errors = (
        np.array([getattr(s, name) for s in report.history]) for name in ("unknowns", "error")
    )
    title, size = given["title"] or "", given["size"] or (6, 4)
    return history_figure(
        unknowns, errors, goal=report.error_asked, of=report.error_of, title=title, size=size
    )


def _element(kind: type, points: ArrayLike | None) -> Any:
    if issubclass(kind, KinematicLinear) and hasattr(kind, "shape"):
        points = kind.rule.points if points is None else points
        kind = kind.shape
    if not (issubclass(kind, Shape) and hasattr(kind, "nodes")):
        raise InputError(
            "the class of an element or a shape can be drawn, such as kl.KinematicLinear3D8N; "
            f"got {short(kind)}"
        )
    return element_figure(kind, points)


# ---- models and results ----------------------------------------------------------------------------


def _subjects(thing: Any, given: dict[str, Any]) -> tuple[list[Subject], Options]:
    """Return what is drawn side by side, and how."""
    things, titles = _several(thing, given)
    single = len(things) == 1
    subjects = [_subject(one, given) for one in things]
    scale = None if given["scale"] == "auto" else number(given["scale"], "scale")
    options = Options(
        given["view"],
        _clim(given["clim"]),
        scale,
        _zoom(given["zoom"]),
        given["clip"],
        given["size"] or (8, 6),
    )
    factor = factor_of(subjects, scale)
    heads = [_head(subject, given["title"], factor) for subject in subjects]
    if single and not titles:
        return [replace(subjects[0], title=heads[0])], options
    options.title = given["title"] if given["title"] is not None else heads[0]
    return [replace(s, title=t) for s, t in zip(subjects, titles or [""] * len(things), strict=True)], options


def _several(thing: Any, given: dict[str, Any]) -> tuple[list[Any], list[str]]:
    """Return things to draw side by side and their titles, if any."""
    titles = given["titles"]
    if isinstance(thing, Transient):
        states = thing.state() if given["states"] is None else given["states"]
        states = [states] if isinstance(states, State) else list(states)
        if not states:
            raise InputError("there is no state to draw")
        return [thing.result(state) for state in states], [f"t = {state.time:.4g} s" for state in states]
    if given["states"] is not None:
        raise InputError("states belong to a body or to a transient, model.transient(); leave them out")
    if isinstance(thing, Mapping):
        thing, titles = list(thing.values()), list(thing) if titles is None else titles
    things = list(thing) if isinstance(thing, (list, tuple)) else [thing]
    if not things:
        raise InputError(f"there is nothing to draw in an empty list; give {KINDS}")
    if titles is not None and (isinstance(titles, str) or len(titles) != len(things)):
        raise InputError(f"titles: one for each of {len(things)} pictures is needed; got {short(titles)}")
    return things, [str(title) for title in titles or []]


def _subject(thing: Any, given: dict[str, Any]) -> Subject:
    """Return what is drawn of a mesh, a model or a result."""
    is_result = isinstance(thing, Fields)
    mesh = thing if isinstance(thing, Mesh) else getattr(thing, "mesh", None)
    if not isinstance(mesh, Mesh) or not (mesh is thing or is_result or isinstance(thing, Structure)):
        raise InputError(f"{KINDS} can be drawn; got {short(thing)}")
    u = thing.u if is_result else None
    if given["displacement"] is not None:
        u = finite(given["displacement"], "displacement", (mesh.n_nodes, 3))
    return Subject(mesh, u, _values(thing if is_result else None, mesh, given))


def _values(result: Fields | None, mesh: Mesh, given: dict[str, Any]) -> Values | None:
    """Return what colors a mesh or a result."""
    values, unit = given["values"], given["unit"]
    if isinstance(values, str) or (values is None and result is not None):
        if result is None:
            raise InputError(f"a mesh or a model has no values {values!r}; solve it, or give an array")
        named = named_values(result, DEFAULT if values is None else values)
        return named if unit is None else replace(named, unit=unit)
    if values is None:
        return None
    numbers = finite(values, "values")
    if numbers.shape not in ((mesh.n_nodes,), (mesh.n_elements,)):
        raise InputError(
            f"values must have shape ({mesh.n_nodes},), a number for each node, or ({mesh.n_elements},), for "
            f"each element; got {numbers.shape}"
        )
    return Values(numbers, unit=unit or "")


def _head(subject: Subject, title: str | None, factor: float) -> str:
    """Return the title, and beneath it the factor on the displacement."""
    values = subject.values
    first = title if title is not None else values.title if values else ""
    return first if subject.u is None else f"{first}\ndeformation × {factor:g}".strip()


def _clim(clim: Any) -> tuple[float, float] | None:
    if clim is None:
        return None
    low, high = finite(clim, "clim, lowest and highest value of the colors,", (2,)).tolist()
    if low >= high:
        raise InputError(f"clim: the lowest value must be below the highest; got {short(clim)}")
    return low, high


def _zoom(zoom: Any) -> Any:
    if zoom is None or isinstance(zoom, str):
        return zoom
    if np.ndim(zoom) == 0:
        return number(zoom, "zoom, a factor, a part or a box,", above=0)
    low, high = finite(zoom, "zoom, a factor, a part or a box ((x, y, z), (x, y, z)) in m,", (2, 3))
    return np.minimum(low, high), np.maximum(low, high)

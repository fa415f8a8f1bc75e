"""Pictures and films of whatever there is to see: meshes, models, results, bodies, elements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.analysis.path_picture import moving_subjects, path_figure
from kratos_lite.analysis.report import Report
from kratos_lite.analysis.state import State
from kratos_lite.analysis.subjects import options_of, panels_of, series_of
from kratos_lite.bodies import Body
from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import InputError
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.shapes import Shape
from kratos_lite.typing import ArrayLike
from kratos_lite.validation import number, short, whole_number
from kratos_lite.view import canvas
from kratos_lite.view.camera import View
from kratos_lite.view.curves import convergence_figure
from kratos_lite.view.figure import figure_of
from kratos_lite.view.reference_cell import element_figure

OF_STATES = 120  # frames of a film of many states


def plot(
    thing: Any,
    path: str | Path | None = None,
    *,
    values: ArrayLike | str | None = None,
    displacement: ArrayLike | None = None,
    modes: ArrayLike | None = None,
    states: Iterable[State] | State | None = None,
    view: View | None = None,
    clim: Sequence[float] | None = None,
    scale: float | str = "auto",
    zoom: Any = None,
    clip: Sequence[Any] | None = None,
    title: str | None = None,
    titles: Sequence[str] | None = None,
    unit: str | None = None,
    local: LocalAxes | None = None,
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
    values : what colors the surface: (n,) numbers of nodes, (m,) of elements; of a result also the name of a
        field, such as ``displacement``, ``reaction``, ``von_mises``, ``tresca`` or ``error``, or of a part of
        one: ``ux``, stresses ``sxx`` … ``szx``, principal ones ``s1`` … ``s3``, strains ``exx``, ``e1``, …
    displacement : (n, 3) m, in place of that of a result; the undeformed edges are drawn thin.
    modes : (n, 3) or (k, n, 3), shapes of modes of a mesh or model, side by side; the largest displacement of
        each is shown as a tenth of the body.
    states : of a body or a transient, in the order of time, or one.
    view : ``iso``, ``x-``, ``x+``, ``y-``, ``y+``, ``z-``, ``z+``, the side that is looked at; azimuth and
        elevation of the viewer in degrees; or the direction towards the viewer, (3,).  If not given, ``iso``,
        and more from the side for long and thin bodies.
    clim : lowest and highest value of the colors, in the unit of the values without a prefix (Pa, not MPa);
        if not given, those of the body but for half a percent at each end that takes much of the range.
    scale : factor on the displacement, 0 for the undeformed body; ``auto``: at least 1, the largest being a
        tenth of the body.
    zoom : factor, a part, which is outlined, or a box ((x, y, z), (x, y, z)) that fills the picture.
    clip : plane that cuts the body open, ``("x", 0.5)`` or (normal, offset), in m, of the undeformed body;
        what lies between it and the viewer is taken away.
    title, titles : above the picture; above each of several.
    unit : of an array of values, at the color bar; fields have theirs.
    local : axes of the parts of fields: ``srr``, ``stt``, ``ur``, … of `Cylindrical`; x y z if not given.
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
    figure = _figure(thing, {**given, "size": canvas.checked_size(size)})
    return canvas.saved(figure, path)


def animate(
    path: str | Path,
    thing: Any,
    *,
    values: ArrayLike | str | None = None,
    modes: ArrayLike | None = None,
    states: Iterable[State] | None = None,
    view: View | None = None,
    clim: Sequence[float] | None = None,
    scale: float | str = "auto",
    zoom: Any = None,
    clip: Sequence[Any] | None = None,
    title: str | None = None,
    titles: Sequence[str] | None = None,
    unit: str | None = None,
    frames: int | None = None,
    fps: float = 20.0,
    size: tuple[float, float] = (6, 4.5),
) -> None:
    """Write a film of a thing in motion: all frames have one size, camera and scale of colors.

    Parameters
    ----------
    path : film to write; .gif, or .mp4, which needs the program ffmpeg.
    thing : a body or a transient with `states`; a mesh or model with `modes`, over one period; a list of
        results, one after the other; or a result, which grows from the undeformed body and back.
    values : what colors the surface, as for `plot`; the displacement of modes and transients if not given.
    modes : (n, 3) or (k, n, 3), real or complex, shapes of modes, side by side.
    states : of the body or the transient, in the order of time.
    view, clim, scale, zoom, clip, title, unit : as for `plot`.
    titles : of each of several modes, or above each of several results.
    frames : how many; by default 24 of a period, and all of states, evenly chosen from more than 120.
    fps : frames per second.
    size : largest width and height in inches, at 150 dots per inch.

    Raises
    ------
    InputError
        There is nothing that moves, an option does not fit, or the file cannot be written.
    ModelError
        A body has no mesh, or is a batch of bodies.
    KratosLiteError
        matplotlib or ffmpeg is missing.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> body.set_velocity(linear=(1, 0, 0), angular=(0, 0, 1))
    >>> spin = getfixture("tmp_path") / "spin.gif"
    >>> kl.animate(spin, body, states=kl.integrate(body, 0.1, 4))
    >>> spin.read_bytes()[:6]
    b'GIF89a'
    """
    given = {name: value for name, value in locals().items() if name not in ("path", "thing")}
    from kratos_lite.view.animation import check_animation, write_animation  # still pictures need none

    check_animation(path)
    given["size"] = canvas.checked_size(size)
    number(fps, "fps", above=0, unit="1/s")
    most = whole_number(OF_STATES if frames is None else frames, "frames", least=2)
    if isinstance(thing, Body):
        _only({**given, "frames": None, "fps": None}, "a body", ("states", "title", "size", "view", "zoom"))
        series = [[subject] for subject in moving_subjects(thing, states, most, title)]
        options = options_of({**given, "view": view or "iso"}, 1.0)
    else:
        series, options = series_of(thing, given, most)
    write_animation(path, series, options, fps)


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
    for name, owner in (("points", "an element"), ("shown", "a body")):
        if given[name] is not None:
            raise InputError(f"{name} belongs to {owner}; leave it out")
    return figure_of(*panels_of(thing, given))


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
    unknowns, errors = np.array([(step.unknowns, step.error) for step in report.history]).T
    title, size = given["title"] or "", given["size"] or (6, 4)
    return convergence_figure(unknowns, errors, report.error_asked, report.error_of, title, size)


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

"""Subjects of pictures: what is drawn of meshes, models, results, modes and transients, and how."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.analysis.fields import FIELDS, Field, Fields, known
from kratos_lite.analysis.model_picture import legend_of, marks_of_model, materials_of
from kratos_lite.analysis.peak import place_of_node
from kratos_lite.analysis.state import ModelInTime, State
from kratos_lite.errors import InputError, nearest
from kratos_lite.mesh import Mesh
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.model.structure import Structure
from kratos_lite.tabular import unit_name
from kratos_lite.typing import Array, Numbers
from kratos_lite.validation import finite, number, short
from kratos_lite.view.scene import Options, Subject, Values, factor_of

DEFAULT = "von_mises"  # what colors a result
PERIOD = 24  # frames of a period
NORMALIZED = "(normalized)"  # unit of modes
AMPLITUDE = 0.1  # largest displacement of a mode as it is drawn, of the size of the body
KINDS = (
    "a mesh, a model, a result, several of them, a body with states, a transient with states, the report of "
    "an adaptive solution, or the class of an element"
)


def panels_of(thing: Any, given: dict[str, Any]) -> tuple[list[Subject], Options]:
    """Return what is drawn side by side, and how."""
    if given["modes"] is not None:
        modes, options = _phase(thing, given, *_modes(thing, given), 1.0), options_of(given, 1.0)
        options.title = given["title"] or "" if len(modes) > 1 else ""
        return modes, options
    things, titles = _several(thing, given)
    subjects, options = [_subject(one, given) for one in things], options_of(given)
    heads = _heads(subjects, given, factor_of(subjects, options.scale))
    if len(things) == 1 and not titles:
        return [replace(subjects[0], title=heads)], options
    options.title = heads
    return [replace(s, title=t) for s, t in zip(subjects, titles or [""] * len(things), strict=True)], options


def series_of(thing: Any, given: dict[str, Any], most: int) -> tuple[list[list[Subject]], Options]:
    """Return the frames of a film, each of some subjects side by side, and how they are drawn."""
    given["displacement"] = None
    phases = np.arange(given["frames"] or PERIOD) / (given["frames"] or PERIOD)
    if given["modes"] is not None:
        modes, turns = _modes(thing, given), np.exp(2j * np.pi * phases)
        return [_phase(thing, given, *modes, turn) for turn in turns], options_of(given, 1.0)
    if isinstance(thing, ModelInTime) and given["values"] is None:
        given["values"] = "displacement"
    things, titles = _several(thing, given)
    if len(things) > 1:
        rows = evenly(len(things), most)
        subjects = [_subject(things[row], given) for row in rows]
        titles = [titles[row] for row in rows] if titles else [""] * len(rows)
    elif not isinstance(things[0], Fields) or not things[0].u.any():
        raise InputError("nothing moves here: give modes, states, or a result with displacements")
    else:
        fractions = (1 - np.cos(2 * np.pi * phases)) / 2
        subjects = [_scaled(_subject(things[0], given), fraction) for fraction in fractions]
        titles = [""] * len(subjects)
    options = options_of(given)
    options.scale = factor_of(subjects, options.scale)
    heads = _heads(subjects, given, options.scale)
    titled = zip(subjects, titles, strict=True)
    return [[replace(subject, title=f"{heads}\n{title}".strip())] for subject, title in titled], options


def options_of(given: dict[str, Any], scale: float | None = None) -> Options:
    """Return how subjects are drawn, with a factor on displacements if none is given."""
    scale = scale if given["scale"] == "auto" else number(given["scale"], "scale")
    size = given["size"] or (8, 6)
    return Options(given["view"], _clim(given["clim"]), scale, _zoom(given["zoom"]), given["clip"], size)


def evenly(count: int, most: int) -> list[int]:
    """Return at most so many of 0 … count - 1, evenly spread, the first and the last among them."""
    return [int(row) for row in np.unique(np.linspace(0, count - 1, min(count, most)).round())]


def _several(thing: Any, given: dict[str, Any]) -> tuple[list[Any], list[str]]:
    """Return things to draw and their titles, if any."""
    titles = given["titles"]
    if isinstance(thing, ModelInTime):
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
    return things, _titles(titles, len(things))


def _titles(titles: Any, count: int) -> list[str]:
    if titles is not None and (isinstance(titles, str) or len(titles) != count):
        raise InputError(f"titles: one for each of {count} pictures is needed; got {short(titles)}")
    return [str(title) for title in titles or []]


# ---- one subject -----------------------------------------------------------------------------------


def _mesh(thing: Any) -> Mesh:
    """Return the mesh of a mesh, a model or a result; InputError for anything else."""
    if isinstance(thing, Mesh):
        return thing
    if not isinstance(thing, (Structure, Fields)):
        raise InputError(f"{KINDS} can be drawn; got {short(thing)}")
    return thing.mesh


def _subject(thing: Any, given: dict[str, Any]) -> Subject:
    """Return what is drawn of a mesh, a model or a result."""
    mesh, result = _mesh(thing), thing if isinstance(thing, Fields) else None
    u = None if result is None else result.u
    if given["displacement"] is not None:
        u = finite(given["displacement"], "displacement", (mesh.n_nodes, 3))
    values = _values(result, mesh, u, given)
    if not isinstance(thing, Structure):
        return Subject(mesh, u, values)
    values = materials_of(thing) if values is None else values
    return Subject(mesh, u, values, marks=marks_of_model(thing), legend=legend_of(thing))


def _values(result: Fields | None, mesh: Mesh, u: Array | None, given: dict[str, Any]) -> Values | None:
    """Return what colors a mesh or a result."""
    values, unit = given["values"], given["unit"]
    if isinstance(values, str) or (values is None and result is not None):
        name = DEFAULT if values is None else values
        local = given.get("local")
        motion = FIELDS["displacement"].along(local)
        motions = names_of_parts({"displacement": motion})
        if u is not None and name in motions:
            shape = motion.turned(u, mesh.points)
            named = named_values(motions[name], lambda _: shape)
            named = replace(named, unit=unit_name(named.unit, mesh.units))
        elif result is None:
            raise InputError(f"a mesh or a model has no field {name!r}; solve it, or give an array")
        else:
            named = nodal_values(result, name, local)
        if unit not in (None, named.unit):
            raise InputError(
                f"unit: the field {name!r} is shown in {named.unit or 'no unit'}, with a prefix; for another "
                f"give an array in {short(unit)}, and its unit"
            )
        if name == DEFAULT and result is not None:
            if place := place_of_node(result, int(named.numbers.argmax())):
                return replace(named, title=f"{named.title}, largest {place}")
        return named
    if values is None:
        return None
    numbers, counts = finite(values, "values"), (mesh.n_nodes, mesh.n_elements)
    if numbers.ndim != 1 or len(numbers) not in counts:
        raise InputError(
            f"values must have shape ({counts[0]},), a number for each node, or ({counts[1]},), for each "
            f"element; got {numbers.shape}"
        )
    return Values(numbers, unit=unit or "")


def _scaled(subject: Subject, fraction: float) -> Subject:
    """Return a fraction of a linear response."""
    values = subject.values
    if values is not None and not values.log:
        values = replace(values, numbers=fraction * values.numbers)
    assert subject.u is not None
    return replace(subject, u=fraction * subject.u, values=values)


def _heads(subjects: Sequence[Subject], given: dict[str, Any], factor: float) -> str:
    """Return the title, and beneath it the factor on the displacement."""
    values = subjects[0].values
    first = given["title"] if given["title"] is not None else values.title if values else ""
    return first if subjects[0].u is None else f"{first}\ndeformation × {factor:g}".strip()


# ---- modes -----------------------------------------------------------------------------------------


def _modes(thing: Any, given: dict[str, Any]) -> tuple[Numbers, list[str]]:
    """Return shapes (k, n, 3) with the amplitude with which they are drawn, and their titles."""
    mesh, shapes = _mesh(thing), np.asarray(given["modes"])
    for part in (shapes.real, shapes.imag):
        finite(part, "modes")
    if shapes.shape[-2:] != (mesh.n_nodes, 3) or shapes.ndim not in (2, 3) or not len(shapes):
        raise InputError(
            f"modes must have shape ({mesh.n_nodes}, 3) or (k, {mesh.n_nodes}, 3); got {shapes.shape}"
        )
    titles = given["titles"]
    if shapes.ndim == 2:
        shapes, titles = shapes[None], [given["title"] or "mode"] if titles is None else titles
    elif titles is None:
        titles = [f"mode {i}" for i in range(1, len(shapes) + 1)]
    largest = np.linalg.norm(shapes, axis=2).max(axis=1)
    size = AMPLITUDE * np.linalg.norm(np.ptp(mesh.points, axis=0))
    return shapes * (size / np.where(largest > 0, largest, 1.0))[:, None, None], _titles(titles, len(shapes))


def _phase(
    thing: Any, given: dict[str, Any], shapes: Numbers, titles: list[str], turn: complex
) -> list[Subject]:
    """Return modes side by side in a phase, colored by displacement as a fraction of the largest."""
    mesh = _mesh(thing)
    subjects = []
    for shape, title in zip(shapes, titles, strict=True):
        u, largest = (shape * turn).real, np.linalg.norm(shape, axis=1).max() or 1.0
        if given["values"] is None:
            values: Values | None = Values(np.linalg.norm(u, axis=1) / largest, unit=NORMALIZED)
        else:
            values = _values(None, mesh, u / largest, given)
            if values is not None and isinstance(given["values"], str):
                values = replace(values, unit=NORMALIZED)
        subjects.append(Subject(mesh, u, values, title))
    return subjects


# ---- options ---------------------------------------------------------------------------------------


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


Part: TypeAlias = "tuple[str, Field, int | None]"
"""A field, its name, and the number of its part; a vector itself is shown by its length."""


def names_of_parts(fields: Mapping[str, Field]) -> dict[str, Part]:
    """Return what pictures show of fields, by the names of these and of their parts."""
    names = dict[str, Part]()
    for key, field in fields.items():
        if field.kind in ("scalar", "vector") and "state" not in field.where:
            names[key] = key, field, None
        if field.symbol:
            names |= {field.symbol + part: (key, field, i) for i, part in enumerate(field.parts)}
    return names


def nodal_values(result: Fields, name: str, local: LocalAxes | None = None) -> Values:
    """Return the values of nodes, or else of elements, by the name of a part; InputError for another."""
    names = names_of_parts({key: field.along(local) for key, field in known(result.groups).items()})
    if name not in names:
        raise InputError(f"unknown field {name!r}; there are {', '.join(names)}.{nearest(name, names, 1)}")
    field = names[name][1]
    values = named_values(names[name], lambda key: result.field(key, field.nodal_place, local))
    kind = "" if "averaged" not in field.where else "averaged" if field.sampled else "recovered"
    return replace(values, unit=unit_name(values.unit, result.mesh.units), kind=kind)


def named_values(shown: Part, values: Callable[[str], Array]) -> Values:
    """Return what is shown of the values of a field by its name."""
    key, field, part = shown
    numbers = values(key)
    if part is not None:
        numbers = numbers[:, part]
    elif field.kind == "vector":
        numbers = np.linalg.norm(numbers, axis=1)
    title = field.name if part is None else f"{field.name} {field.parts[part]}"
    return Values(numbers, title, field.unit, field.log)

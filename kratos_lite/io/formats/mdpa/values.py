"""Values of Kratos variables as `.mdpa` files write them: numbers, vectors, matrices, truth and words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from kratos_lite.io.formats.document import already
from kratos_lite.io.formats.mdpa.rows import TRUTH, Layout, read_rows
from kratos_lite.io.formats.mdpa.scan import NAME, WORD, Frame, Source, Span
from kratos_lite.io.names import nearest_variable
from kratos_lite.io.text import real, shown
from kratos_lite.materials import MATERIALS
from kratos_lite.typing import Array

BRACKET = re.compile(rb"(?:\[([^\]()]*)\]\s*)?\(([^()]*(?:\([^()]*\)[^()]*)*)\)")
INNER = re.compile(rb"\(([^()]*)\)")
INTEGER = re.compile(rb"[+-]?[0-9]{1,18}")
SAMPLES = {"vector": "[3] (x, y, z)", "matrix": "[2,2] ((a, b), (c, d))"}
NUMBERLIKE = re.compile(rb"[+\-.]*[0-9][0-9+\-.eEdDxX_,]*")

VECTORS = (
    "DISPLACEMENT VELOCITY ACCELERATION VOLUME_ACCELERATION BODY_FORCE GRAVITY SURFACE_LOAD LINE_LOAD "
    "POINT_LOAD POINT_MOMENT FORCE ROTATION REACTION NORMAL LOCAL_AXIS_1 LOCAL_AXIS_2 LOCAL_AXIS_3 "
    "FACE_LOAD ANGULAR_VELOCITY ANGULAR_ACCELERATION EXTERNAL_FORCE INTERNAL_FORCE MESH_VELOCITY "
    "MESH_DISPLACEMENT TORQUE INSITU_STRESS PRESTRESS "
    "NODAL_DISPLACEMENT_STIFFNESS NODAL_ROTATIONAL_STIFFNESS NODAL_INERTIA NODAL_DAMPING_RATIO "
    "NODAL_ROTATIONAL_DAMPING_RATIO NODAL_INITIAL_DISPLACEMENT NODAL_INITIAL_ROTATION"
).split()
REALS = (
    "DENSITY YOUNG_MODULUS POISSON_RATIO THICKNESS RAYLEIGH_ALPHA RAYLEIGH_BETA TEMPERATURE PRESSURE "
    "AREA VISCOSITY POSITIVE_FACE_PRESSURE NEGATIVE_FACE_PRESSURE AMBIENT_TEMPERATURE CROSS_AREA "
    "NODAL_MASS DYNAMIC_VISCOSITY PRESTRESS_FACTOR THERMAL_EXPANSION_COEFFICIENT REFERENCE_TEMPERATURE "
    "CONDUCTIVITY SPECIFIC_HEAT WATER_PRESSURE SHEAR_MODULUS BULK_MODULUS YIELD_STRESS "
    "FRICTION_COEFFICIENT DISTANCE HEAT_FLUX FACE_HEAT_FLUX"
).split()
BOOLS = "IS_RESTARTED COMPUTE_LUMPED_MASS_MATRIX COMPUTE_DYNAMIC_TANGENT CONSIDER_RAYLEIGH_DAMPING".split()
FLAGS = (
    "SLIP BOUNDARY ACTIVE RIGID STRUCTURE FLUID SOLID INTERFACE CONTACT MASTER SLAVE VISITED INLET "
    "OUTLET TO_ERASE SELECTED BLOCKED MARKER INSIDE ISOLATED FREE_SURFACE MODIFIED"
).split()
KINDS: dict[str, str] = {
    **dict.fromkeys(VECTORS, "vector"),
    **dict.fromkeys((f"{name}_{axis}" for name in VECTORS for axis in "XYZ"), "number"),
    **dict.fromkeys(REALS, "number"),
    **dict.fromkeys(BOOLS, "truth"),
    **dict.fromkeys(FLAGS, "flag"),
    "INTEGRATION_ORDER": "integer",
    "CONSTITUTIVE_LAW": "word",
    **dict.fromkeys(("LOCAL_INERTIA_TENSOR", "ELASTICITY_TENSOR"), "matrix"),
}
"""What the value of a known variable is."""


@dataclass(eq=False)
class Table:
    """Pairs (m, 2) of a variable `x` and a variable `y` that depends on it."""

    x: str
    y: str
    rows: Array
    line: int = 0


def kind_of(name: str) -> str | None:
    """Return what the value of a variable is, or None for an unknown variable.

    >>> kind_of("YOUNG_MODULUS"), kind_of("YOUNGS_MODULUS")
    ('number', None)
    """
    constants = {variable for law in MATERIALS.values() for variable in law.variables.values()}
    return KINDS.get(name, "number" if name in constants else None)


def note_unknown(source: Source, name: str, offset: int) -> None:
    """Note a variable that is kept though nobody here knows it."""
    source.note(f"unknown variable {name} is kept, but not used.{nearest_variable(name, KINDS)}", offset)


def read_values(source: Source, spans: list[Span]) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the variables in some spans, and the line of each."""
    values: dict[str, Any] = {}
    lines: dict[str, int] = {}
    for name, value, offset in (item for span in spans for item in _items(source, span)):
        if name in values:
            same = np.array_equal(values[name], value)
            how = ", the same" if same else " with another value"
            (source.note if same else source.problem)(already(name, lines[name], how), offset)
            continue
        if kind_of(name) is None:
            note_unknown(source, name, offset)
        values[name], lines[name] = value, source.line(offset)
    return values, lines


def _items(source: Source, span: Span) -> Iterator[tuple[str, Any, int]]:
    """Yield name, value and offset of each variable in a span."""
    at, end = span
    last = at
    while word := WORD.search(source.data, at, end):
        name = word.group().decode("ascii", "backslashreplace")
        is_first = not source.strict or last == span[0] or b"\n" in source.data[last : word.start()]
        if not NAME.fullmatch(word.group()) or not (is_first or kind_of(name)):
            text = f"{shown(word.group())} is not a variable; write one variable and its value on a line"
            source.problem(text, word.start())
            at = last = source.line_end(word.start(), end)
            continue
        first = WORD.search(source.data, word.end(), end)
        try:
            value, at = value_at(source, first.start() if first else end, end, kind_of(name))
            yield name, value, word.start()
        except ValueError as error:
            source.problem(f"{name}: {error}", (first or word).start())
            at = source.line_end(first.start() if first else end - 1, end)
        last = at


def value_at(source: Source, at: int, end: int, kind: str | None) -> tuple[Any, int]:
    """Return the value of this kind at an offset, and where it ends; ValueError says what is wrong."""
    data = source.data
    if data[at : at + 1] in (b"[", b"("):
        match = BRACKET.match(data, at, end)
        if match is None:
            raise ValueError(f"write {' or '.join(SAMPLES.values())}; is a ')' missing?")
        array = _array(match)
        if kind not in (None, ["vector", "matrix"][array.ndim - 1]):
            raise ValueError(f"expected a {kind}, found {shown(match.group())}")
        return array, match.end()
    word = WORD.search(data, at, end)
    if word is None:
        raise ValueError("has no value")
    return _plain(word.group(), kind), word.end()


def _array(match: re.Match[bytes]) -> Array:
    """Return the vector or matrix of a match; its size must be as stated."""
    size, body = match.groups()
    rows = [_numbers(row) for row in INNER.findall(body)] if b"(" in body else None
    if rows is not None and INNER.sub(b"", body).translate(None, b" ,\t\n\v\f"):
        raise ValueError(f"{shown(match.group())} mixes rows and numbers; write [2,2] ((a, b), (c, d))")
    if rows is not None and len({len(row) for row in rows}) > 1:
        raise ValueError(f"the rows of {shown(match.group())} have different lengths")
    array = np.array(_numbers(body) if rows is None else rows, dtype=float)
    if size is not None:
        stated, actual = b"".join(size.split()), ",".join(map(str, array.shape))
        if stated != actual.encode():
            raise ValueError(f"{shown(match.group())} has size [{actual}], not [{shown(stated)[1:-1]}]")
    return array


def _numbers(text: bytes) -> list[float]:
    return [real(part.strip()) for part in text.split(b",")] if text.strip() else []


def _plain(token: bytes, kind: str | None) -> Any:
    """Return the value of a single word."""
    if kind in SAMPLES:
        raise ValueError(f"{shown(token)} is not a {kind}; write {SAMPLES[kind]}")
    is_integer = INTEGER.fullmatch(token) is not None
    is_word = kind is None and not is_integer
    if kind in ("truth", "flag") or (is_word and token in TRUTH):
        if token not in TRUTH:
            raise ValueError(f"{shown(token)} is neither true nor false; write 1 or 0")
        return bool(TRUTH[token])
    if kind == "number" or (is_word and (NUMBERLIKE.fullmatch(token) or token.endswith(b","))):
        return real(token)
    if is_integer:
        return int(token)
    if kind == "integer":
        raise ValueError(f"{shown(token)} is not a whole number")
    if not token.isascii():
        raise ValueError(f"{shown(token)} is no word; use plain letters")
    return token.decode()


def read_table(source: Source, frame: Frame) -> Table:
    """Return the pairs of a ``Table`` block."""
    rows = read_rows(source, frame.spans[0], Layout("row", "rr", head=0, needs="expected x and y"))
    *_, x, y = frame.arguments
    return Table(x, y, rows.reals, source.line(frame.offset))

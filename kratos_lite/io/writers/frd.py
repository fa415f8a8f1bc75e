"""Results as `.frd` files of CalculiX, which cgx, FreeCAD and others read.

Source of the format: Wittig, CalculiX USER'S MANUAL - CalculiX GraphiX, "Result Format".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import floor, log10, pi
from pathlib import Path

import numpy as np

from kratos_lite.atomic import refuse_nan, replacing
from kratos_lite.errors import InputError
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.blocks import mask_of
from kratos_lite.typing import Array, Ints, Numbers
from kratos_lite.validation import choice

KINDS = {"static": 0, "time": 1, "frequency": 2, "buckling": 4}
CELLS = {
    "Hexahedron8": 1, "Wedge6": 2, "Tetrahedron4": 3, "Hexahedron20": 4, "Wedge15": 5, "Tetrahedron10": 6,
    "Hexahedron27": 4, "Pyramid5": 1, "Pyramid13": 4,
}  # fmt: skip
PLACES = {
    "Hexahedron27": [*range(20)],
    "Pyramid5": [0, 1, 2, 3, 4, 4, 4, 4],  # a hexahedron with a face in the apex
    "Pyramid13": [0, 1, 2, 3, 4, 4, 4, 4, *range(5, 13), 4, 4, 4, 4],
}
TENSOR = (("XX", 1, 1), ("YY", 2, 2), ("ZZ", 3, 3), ("XY", 1, 2), ("YZ", 2, 3), ("ZX", 3, 1))
FIELDS = {
    "DISP": (2, "D"), "VELO": (2, "V"), "FORC": (2, "F"), "STRESS": (4, "S"), "TOSTRAIN": (4, "E"),
    "MESTRAIN": (4, "ME"), "NDTEMP": (1, "T"), "PE": (1, "PE"), "ENER": (1, "ENER"), "ERROR": (1, "STR(%)"),
    "PDISP": (12, "MAG PHA"), "PSTRESS": (14, "MAG PHA"),
}  # fmt: skip
"""Fields: scalars (1), vectors (2), tensors (4) or sizes and phases (12, 14), and symbols of their parts."""
HEAD = ("USER", "DATE", "TIME", "HOST", "PGM               kratos_lite", "VERSION", "DIR", "DBN")
POWERS = 10.0 ** np.arange(-40, 60)


@dataclass(frozen=True, eq=False)
class FrdStep:
    """Fields of the nodes after a step, an increment, or of a mode."""

    fields: Mapping[str, Numbers]  # (n,) or (n, c) by names of `FIELDS`; complex ones as two parts
    value: float = 1.0  # time in s, frequency in Hz, or buckling factor
    kind: str = "static"  # of `KINDS`
    step: int = 1
    increment: int = 1
    mode: int = 0  # number of a mode that vibrates
    number: int = 0  # of the set of fields in the file; one more than the last if not given
    rows: Mapping[str, Ints] = field(default_factory=dict)  # nodes of fields that not all nodes have


def write_frd(
    path: str | Path, mesh: Mesh, steps: Iterable[FrdStep], materials: Mapping[int, str] | None = None
) -> None:
    """Write a mesh and its fields, as a whole or not at all; `materials` are names by property id."""
    cells = [_cells(path, block) for block in mesh.blocks]
    used = mask_of(np.concatenate([nodes.ravel() for _, nodes in cells]), mesh.n_nodes)
    every, names = np.flatnonzero(used), materials or {}
    properties = np.unique(np.concatenate([block.properties for block in mesh.blocks]))
    text = "    1C\n" + "".join(f"    1U{line:<66}\n" for line in HEAD)
    for i, key in enumerate(properties.tolist(), 1):
        text += f"    1UMAT{i:5d}{names.get(key, f'MATERIAL{key}'):<58}\n"
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(f"{text}    2C{len(every):30d}{1:38d}\n".encode())
        file.write(_rows(mesh.node_ids[every], mesh.points[every]))
        file.write(f"    3C{mesh.n_elements:30d}{1:38d}\n".encode())
        for block, (number, nodes) in zip(mesh.blocks, cells, strict=True):
            material = np.searchsorted(properties, block.properties) + 1
            file.write(_cell_lines(number, block.ids, material, mesh.node_ids[nodes]))
        file.write(b" -3\n")
        count = last = 0
        for step in steps:
            last = step.number or last + 1
            for name, suffix, values in _parts(path, step.fields):
                count += 1
                rows = step.rows.get(name, every)
                rows = rows[used[rows]]
                file.write((_head(step, count, last, len(rows)) + _described(name, suffix)).encode())
                file.write(_rows(mesh.node_ids[rows], values.reshape(len(values), -1)[rows]))
        file.write(b" 9999\n")


def steps_of_modes(values: Numbers, shapes: Numbers, buckling: bool = False) -> list[FrdStep]:
    """Return steps of modes of ω in rad/s, complex λ in 1/s, or factors of buckling, (k,)."""
    turns = np.abs(values.imag if np.iscomplexobj(values) else values) / (2 * pi)
    kind, numbers = ("buckling", values) if buckling else ("frequency", turns)
    pairs = enumerate(zip(numbers.tolist(), shapes, strict=True), 1)
    return [FrdStep({"DISP": u}, value, kind, mode=0 if buckling else i) for i, (value, u) in pairs]


def _cells(path: str | Path, block: Block) -> tuple[int, Numbers]:
    """Return the type and nodes of cells; InputError for those that the format has not."""
    name = block.shape.__name__ if block.shape else ""
    if name not in CELLS:
        raise InputError(f"{path}: .frd has no cells such as those of {block.name}; write .vtu")
    return CELLS[name], block.nodes[:, PLACES.get(name, slice(None))]


def _cell_lines(number: int, ids: Numbers, material: Numbers, nodes: Numbers) -> bytes:
    """Return cells, ten nodes a line."""
    m = len(ids)
    parts = [_words(" -1", m), _integers(ids), _words(f"{number:5d}    0", m), _integers(material, 5)]
    for start in range(0, nodes.shape[1], 10):
        parts += [_words("\n -2", m), _integers(nodes[:, start : start + 10])]
    return np.hstack([*parts, _words("\n", m)]).tobytes()


def _rows(ids: Numbers, values: Numbers) -> bytes:
    """Return a block of values (n, c) of nodes, six a line, and its end."""
    n = len(ids)
    parts = [_words(" -1", n), _integers(ids)]
    values = values.astype(np.float32).astype(float)  # as CalculiX rounds them
    for start in range(0, values.shape[1], 6):
        parts += [_words(f"\n{' -2':13}", n)] * (start > 0) + [_text(values[:, start : start + 6])]
    return np.hstack([*parts, _words("\n", n)]).tobytes() + b" -3\n"


def _words(word: str, n: int) -> Numbers:
    """Return a word as bytes, n times."""
    return np.broadcast_to(np.frombuffer(word.encode(), np.uint8), (n, len(word)))


def _integers(values: Numbers, width: int = 10) -> Numbers:
    """Return whole numbers (n, ...) as bytes (n, ...), those that ``%10d`` makes of each.

    >>> _integers(np.array([[120, 7]]), 4).tobytes()
    b' 120   7'
    """
    text, rest = np.full((*values.shape, width), ord(" "), np.uint8), values
    for place in range(width - 1, -1, -1):
        above = rest // 10
        digits = (rest - 10 * above + ord("0")).astype(np.uint8)
        text[..., place] = digits if place == width - 1 else np.where(rest > 0, digits, ord(" "))
        if not (rest := above).any():
            break
    return text.reshape(len(values), width * int(np.prod(values.shape[1:])))


def _text(values: Array) -> Numbers:
    """Return values (n, c) of single precision as bytes (n, 12 c), those that ``%12.5E`` makes.

    >>> _text(np.array([[-0.1234567, 20.0]])).tobytes()
    b'-1.23457E-01 2.00000E+01'
    """
    size = np.abs(values)
    power = np.floor(np.log10(np.where(size > 0, size, 1.0))).astype(np.int32)
    scaled = size * POWERS[45 - power]
    digits = np.rint(scaled).astype(np.int32)
    power += digits == 10**6
    digits[digits == 10**6] = 10**5
    text = np.empty((*values.shape, 12), np.uint8)
    text[:] = np.frombuffer(b" 0.00000E+00", np.uint8)
    text[..., 0] += (values < 0) * np.uint8(ord("-") - ord(" "))
    text[..., 9] += (power < 0) * np.uint8(ord("-") - ord("+"))
    for number, places in ((digits, (7, 6, 5, 4, 3, 1)), (np.abs(power), (11, 10))):
        rest = number
        for place in places:
            above = rest // 10
            text[..., place] += (rest - 10 * above).astype(np.uint8)
            rest = above
    near = np.abs(scaled - np.floor(scaled) - 0.5) < 1e-6  # where rounding takes all digits of a number
    for at in zip(*np.nonzero(near), strict=True):
        text[at] = np.frombuffer(b"%12.5E" % values[at], np.uint8)
    return text.reshape(len(values), 12 * values.shape[1])


def _parts(path: str | Path, fields: Mapping[str, Numbers]) -> Iterator[tuple[str, str, Array]]:
    """Yield fields by name: real parts, then imaginary ones, with an I; an error for too large numbers."""
    parts = [(name, "", np.real(values)) for name, values in fields.items()]
    parts += [(name, "I", np.imag(values)) for name, values in fields.items() if np.iscomplexobj(values)]
    for name, suffix, values in parts:
        refuse_nan(path, name, values)
        if (largest := np.abs(values).max(initial=0)) > np.finfo(np.float32).max:
            raise InputError(f"{path}: {name} is up to {largest:.1e}, beyond the 3.4e38 of .frd; write .vtu")
        yield choice(name, "a field of .frd", FIELDS), suffix, values


def _head(step: FrdStep, count: int, number: int, n: int) -> str:
    """Return the lines that say of what a block is: the step, and its value."""
    text = f"    1PSTEP{count:26d}{step.increment:12d}{step.step:12d}{'':10}\n"
    if step.mode:
        stiffness = f"{(2 * pi * step.value) ** 2:.6E}"
        entries = {"GM": f"{1:.6E}", "GK": stiffness, "HID": -1, "SUBC": 0, "MODE": step.mode}
        text += "".join(f"    1P{name:<4}{entry:>26}{'':34}\n" for name, entry in entries.items())
    kind, mode = KINDS[choice(step.kind, "the kind of a step", KINDS)], "MODAL" if step.mode else ""
    return f"{text}  100CL{100 + number:5d}{_value(step.value):>12}{n:12d}{kind:22d}{number:5d}{mode:<10} 1\n"


def _value(value: float) -> str:
    """Return a number with ten digits, or where that is too long or too short as a power.

    >>> _value(1.0), _value(21869359.4312), _value(0.5)
    ('1.000000000', '21869359.43', '5.00000E-01')
    """
    digits = floor(log10(value) + 1e-10) if value > 0 else -1
    return f"{value:.{9 - digits}f}" if 0 <= digits < 10 else f"{value:.5E}"


def _described(name: str, suffix: str) -> str:
    """Return the lines that name a field and its components."""
    kind, symbols = FIELDS[name]
    parts = {1: (("", 0, 0),), 4: TENSOR, 14: TENSOR}.get(kind, (("1", 1, 0), ("2", 2, 0), ("3", 3, 0)))
    rows = [(symbol + part, *at) for symbol in symbols.split() for part, *at in parts]
    if kind == 12:
        rows = [(symbol, i, 0) for i, (symbol, *_) in enumerate(rows, 1)]
    text = f" -4  {name[: 8 - len(suffix)] + suffix:<8}{len(rows) + (kind == 2):5d}    1\n"
    text += "".join(f" -5  {symbol:<8}    1{kind:5d}{a:5d}{b:5d}\n" for symbol, a, b in rows)
    return text + (" -5  ALL         1    2    0    0    1ALL\n" if kind == 2 else "")

"""Damage of inputs: bytes, lines, numbers, words, nesting and the values of JSON."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np

from tests.fuzz.seeds import pack

NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
NUMBERS = (
    "0 -0 1 -1 2 3 7 9 10 255 1000 65536 2147483647 2147483648 4294967296 9223372036854775807 "
    "9223372036854775808 99999999999999999999 1e-320 1e-30 1e-9 0.5 1.5 1e9 1e30 1e154 1e200 1e308 1e309 "
    "-1e308 nan inf -inf NaN 0x10 1_0 1,5 1.0D+00 .5 5. 1e 12345678901234567890123456789"
).split()
WORDS = (
    'Begin End Nodes Elements Properties // /* */ [ ] ( ) { } " , ; : = \\ \0 \t \r \ufeff é 3 [3] '
    "KinematicLinear3D8N KinematicLinear3D27N DISPLACEMENT_X YOUNG_MODULUS null true NaN -Infinity z+ x- "
    "../a *STEP *STATIC *NSET, TYPE=C3D8 NLGEOM ELSET=BAR"
).split(" ")
VALUES: list[Any] = [
    *(None, True, False, 0, 1, -1, 2, 0.5, 1e-300, 1e9, 1e30, 1e200, 1e308, -1e308, 2**31, 2**63, 10**18),
    *("", "x", "z+", "xyz", "auto", "1e400", "t", "x/0", "sqrt(-1)", "exp(1e9)", "2**9999", "((((((1))))))"),
    *("a" * 300, "..", "/dev/zero", "mesh.mdpa", [], {}, [[]], [1] * 50, {"value": 1}, [None, "t", 1]),
    *([1, 2, 3], [0, 0, 0], [1e308, 1e308, 1e308]),
    *({"times": [0, 1], "values": [0, 1e300]}, {"times": [0, 0], "values": [1, 2]}),
]


def _bytes(data: bytes, rng: Random) -> bytes:
    """Change, drop, repeat or insert some bytes."""
    at, size = rng.randrange(len(data) + 1), rng.choice((1, 1, 2, 4, 8, 30))
    new = rng.choice((b"", rng.randbytes(size), b"\0" * size, b"\xff" * size, data[at : at + size] * 2))
    return data[:at] + new + data[at + rng.choice((0, len(new), size)) :]


def _lines(data: bytes, rng: Random) -> bytes:
    """Drop, repeat, exchange or move lines."""
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            del lines[i]
        case 1:
            lines.insert(j, lines[i])
        case 2:
            lines[i], lines[j] = lines[j], lines[i]
        case 3:
            del lines[min(i, j) : max(i, j)]
        case _:
            lines[j:j] = lines[min(i, j) : max(i, j)]
    return b"\n".join(lines)


def _number(data: bytes, rng: Random) -> bytes:
    """Exchange a number."""
    found = list(NUMBER.finditer(data))
    if not found:
        return _bytes(data, rng)
    match, new = rng.choice(found), rng.choice(NUMBERS).encode()
    if rng.random() < 0.3:
        new = rng.choice(found).group()
    return data[: match.start()] + new + data[match.end() :]


def _word(data: bytes, rng: Random) -> bytes:
    """Put a word between or in place of others."""
    words = re.split(rb"(\s+)", data)
    i = rng.randrange(len(words))
    word = rng.choice(WORDS).encode()
    words[i] = word if rng.random() < 0.5 else words[i] + b" " + word
    return b"".join(words)


def _nesting(data: bytes, rng: Random) -> bytes:
    """Nest or repeat what stands between brackets, or a block."""
    depth = rng.choice((1, 2, 30, 100, 3000))
    pair = rng.choice(((b"[", b"]"), (b"{", b"}"), (b"(", b")"), (b'{"a":', b"}"), (b"/*", b"*/")))
    if b"Begin " in data and rng.random() < 0.5:
        pair = (b"\nBegin SubModelPart a\n", b"\nEnd SubModelPart\n")
    at = rng.randrange(len(data) + 1)
    end = rng.randrange(at, len(data) + 1)
    return data[:at] + pair[0] * depth + data[at:end] + pair[1] * depth + data[end:]


def _cut(data: bytes, rng: Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Return all containers and keys of a JSON value."""
    found: list[tuple[Any, Any]] = []
    keys = value.keys() if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        found += [(value, key), *_places(value[key])]
    return found


def _json(data: bytes, rng: Random) -> bytes:
    """Change values, drop keys or exchange subtrees of a JSON text."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return _bytes(data, rng)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        places = _places(value)
        if not places:
            break
        (owner, key), (other, source) = rng.choice(places), rng.choice(places)
        match rng.randrange(6):
            case 0:
                del owner[key]
            case 1 if isinstance(owner, dict):
                owner[rng.choice(["x", key[:-1], key.upper(), str(source)])] = owner.pop(key)
            case 2:
                owner[key] = json.loads(json.dumps(other[source]))
            case 3 if isinstance(owner[key], (int, float)) and not isinstance(owner[key], bool):
                owner[key] *= rng.choice((-1, 0, 2, 1e-9, 1e6, 1e30, 1e200))
            case _:
                owner[key] = json.loads(json.dumps(rng.choice(VALUES)))
    return json.dumps(value, indent=1).encode()


def _arrays(data: bytes, rng: Random) -> bytes:
    """Change the arrays of an .npz file."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except Exception:  # an earlier mutation has broken it
        return _bytes(data, rng)
    name = rng.choice(sorted(arrays))
    value = arrays[name]
    changes: list[Callable[[], Any]] = [
        lambda: None,
        lambda: np.zeros(rng.choice(((), (0,), (3,), (2, 3), (1, 1, 1)))),
        lambda: value.astype("U9"),
        lambda: (
            np.array(value, dtype=rng.choice(("f4", "i2", "c16", "?"))) if value.dtype.kind in "if" else value
        ),
        lambda: np.full(value.shape, rng.choice((np.nan, np.inf, 1e308, -1.0, 1e-320))),
        lambda: np.atleast_1d(value).repeat(2),
    ]
    with np.errstate(all="ignore"):
        new = rng.choice(changes)()
    if new is None:
        del arrays[name]
    else:
        arrays[name] = new
    return pack(arrays)


TEXT: tuple[Callable[[bytes, Random], bytes], ...] = (_bytes, _lines, _number, _number, _word, _nesting, _cut)


def mutated(name: str, data: bytes, rng: Random) -> bytes:
    """Return a damaged file."""
    own = {".json": (_json,) * 8, ".npz": (_arrays,) * 8}.get("." + name.rsplit(".", 1)[-1], ())
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        data = rng.choice((*TEXT, *own))(data, rng)
    return data

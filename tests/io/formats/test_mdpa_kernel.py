"""The compiled reader of `.mdpa` text gives what the reader in Python gives, or leaves it to that one."""

import numpy as np
import pytest
from computing import compiled, set_threads

from kratos_lite.errors import InputError
from kratos_lite.io.formats.mdpa import scan
from kratos_lite.io.formats.mdpa.reader import read_mdpa
from kratos_lite.io.formats.mdpa.rows import Layout, _compiled, _exact
from kratos_lite.io.formats.mdpa.scan import Source
from kratos_lite.native import kernels

TEXT = kernels("text")
pytestmark = compiled
LAYOUTS = [Layout("node", "irr"), Layout("id", "i"), Layout("node", "ibr"), Layout("element", "ip")]
EDGES = (
    "0.1 -0 -0.0 +1.5 .5 5. 1e22 1e23 8.5D-3 1d+2 123456789012345678 0.30000000000000004 9007199254740993 "
    "1.7976931348623157e308 2.2250738585072014e-308 7.2057594037927933e16"
)
ODD = (
    "7 nan|7 inf|7 1e999|7 +-1|7 1.0f|7 0x1|7 1e|7 .|7 -|7|7 1 2|0 1|-7 1|7.0 1|1234567890123456789 1|7 1_0"
    "|+7 1|7 1d|7 1d2d3|7 1d2e3|7 " + "1" * 70 + "d1"
)


def same(one, other):
    assert one.ints.tolist() == other.ints.tolist()
    assert one.reals.shape == other.reals.shape
    assert one.reals.tobytes() == other.reals.tobytes()
    assert one.lines.tolist() == other.lines.tolist()


def test_random_tokens():
    rng = np.random.default_rng(8)
    letters = np.array([*b"0 1 1 2 9 . - + e D".split(), b" ", b" ", b" ", b" ", b"\n"])
    taken = 0
    for round_ in range(20000):
        layout = LAYOUTS[round_ % 4]
        data = b"".join(rng.choice(letters, 3 + round_ % 12)) + b"\n"
        source = Source("a", data)
        found = _compiled(source, (0, len(data)), layout)
        if found is not None:
            taken += 1
            exact = _exact(source, (0, len(data)), layout)
            assert not source.problems, data
            same(found, exact)
    assert taken > 300


@pytest.mark.parametrize("token", EDGES.split())
def test_numbers_are_those_of_python(token):
    data = f"\n 7\t{token}\v\n".encode()
    found = _compiled(Source("a", data), (0, len(data)), Layout("node", "ir"))
    assert (found.ints.tolist(), found.lines.tolist()) == ([[7]], [2])
    assert found.reals.tobytes() == np.array(float(token.replace("D", "e").replace("d", "e"))).tobytes()


@pytest.mark.parametrize("row", ODD.split("|"))
def test_anything_unusual_is_left_to_python(row):
    data = f"1 1.0\n{row}\n".encode()
    assert _compiled(Source("a", data), (0, len(data)), Layout("node", "ir")) is None


@pytest.mark.parametrize("word", ["0", "1", "00", "01", "001"])
def test_truth_may_have_leading_zeros_for_every_reader(word):
    data = f"7 {word} 1.5\n".encode()
    for reader in (_compiled, _exact):
        source = Source("a", data)
        rows = reader(source, (0, len(data)), Layout("node", "ibr"))
        assert (rows.ints.tolist(), rows.reals.tolist()) == ([[7, int(word)]], [[1.5]])
        assert not source.problems


def big():
    """Return rows that fill several pieces of work, with empty lines between."""
    rng = np.random.default_rng(1)
    rows = [f"{i} {x!r} {-x!r} {x * 1e-7:.4e}" for i, x in enumerate(rng.random(12000).tolist(), start=1)]
    return ("\n\n".join("\n".join(rows[at : at + 7]) for at in range(0, len(rows), 7))).encode()


def test_pieces_and_threads():
    data = b"Begin Nodes\n" + big()
    span, layout = (11, len(data)), Layout("node", "irrr")
    expected = _exact(Source("a", data), span, layout)
    try:
        for count in (1, 2, 3, 5):
            set_threads(count)
            same(_compiled(Source("a", data), span, layout), expected)
            assert _compiled(Source("a", data + b" x"), (11, len(data) + 2), layout) is None
    finally:
        set_threads()


def test_words_are_found_as_python_finds_them(monkeypatch):
    data = b"Begin A\nBegin\tB Beginning xBegin EEnd End\n End B\fEnd A End"
    expected = scan.statements(data)
    monkeypatch.setattr(scan, "SMALL", 0)
    assert scan.statements(data) == expected == [0, 8, 38, 43, 49, 55]


def test_a_mistake_deep_in_a_large_file_is_located(tmp_path):
    path = tmp_path / "big.mdpa"
    path.write_bytes(b"Begin Nodes\n" + big() + b"\n\n12001 0.5 1,5 2\nEnd Nodes\n")
    with pytest.raises(InputError, match=r"big.mdpa:13717:11: node 12001: '1,5' is not a number"):
        read_mdpa(path)

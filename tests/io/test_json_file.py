"""Strict JSON: values as Python's own reader gives them, mistakes with line and column."""

import json
import random
import string

import pytest

from kratos_lite.errors import InputError
from kratos_lite.io.json_file import Object, parse_json, read_json


@pytest.mark.parametrize(
    "text",
    [
        "null",
        "true",
        '"a"',
        "-0",
        "1.5e-3",
        "9223372036854775807",
        '{"a": [1, 2.0, {"b": null}], "c": {}, "d": []}',
        r'"q\" \\ \/ \b \n é 😀"',
        ' [ "/* no comment */" , "// none" ] ',
    ],
)
def test_strict_json_reads_as_the_standard_reader_does(text):
    value = parse_json(text)
    assert value == json.loads(text)
    assert type(value) is type(json.loads(text)) or isinstance(value, Object)


def test_comments_are_skipped_as_kratos_does():
    assert parse_json('// head\n{"a": /* here */ 1, // tail\n "b": 2}') == {"a": 1, "b": 2}


def test_keys_know_their_places():
    value = parse_json('{"a": 1,\n  "b": {"c": 2}}')
    assert value.places == {"a": (1, 2), "b": (2, 3)}
    assert value["b"].places == {"c": (2, 9)}


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ('{"a": 1,}', 1, 9, "trailing comma before '}'"),
        ("[1,\n2,\n]", 3, 1, "trailing comma before ']'"),
        ('{"a": NaN}', 1, 7, "NaN is not a number in JSON"),
        ("[-Infinity]", 1, 2, "-Infinity is not a number in JSON"),
        ("[1e999]", 1, 2, "1e999 is too large"),
        ('{"E": 1.0,\n "E": 2.0}', 2, 2, "duplicate key 'E', first given in line 1"),
        ("12345678901234567890", 1, 1, "integer of 20 digits is too long"),
        ("01", 1, 1, "'01' is not a number in JSON"),
        ("1_000", 1, 1, "'1_000' is not a number"),
        ("0x10", 1, 1, "'0x10' is not a number"),
        ("1.", 1, 1, "'1.' is not a number"),
        ("[.5]", 1, 2, "'.5' where a value is expected"),
        ("[True]", 1, 2, "'True' where a value is expected"),
        ("{'a': 1}", 1, 2, "a key in double quotes"),
        ('{"a" 1}', 1, 6, "':' after the key 'a'"),
        ("[1 2]", 1, 4, "'2' where ',' or ']' is expected (opened in line 1)"),
        ("[1, 2", 1, 6, "end of file where ',' or ']'"),
        ("", 1, 1, "end of file where a value is expected"),
        ("{} x", 1, 4, "'x' after the end of the JSON value"),
        ('"open', 1, 1, "string without its closing quote"),
        ('"two\nlines"', 1, 1, "string without its closing quote"),
        (r'"\x"', 1, 1, "invalid escape"),
        (r'"\ud800"', 1, 1, "invalid escape"),
        ("[1, /* open", 1, 5, "never closed"),
    ],
)
def test_a_mistake_is_named_with_line_and_column(text, line, column, words):
    with pytest.raises(InputError) as caught:
        parse_json(text, "run.json")
    assert str(caught.value).startswith(f"run.json:{line}:{column}: ")
    assert words in str(caught.value)


def test_nesting_of_64_is_read_and_of_65_refused():
    assert parse_json("[" * 64 + "]" * 64) == json.loads("[" * 64 + "]" * 64)
    with pytest.raises(InputError, match=r"^deep:1:65: nesting deeper than 64"):
        parse_json("[" * 65 + "]" * 65, "deep")


@pytest.mark.parametrize("opening", ["[", '{"a":'])
def test_nesting_of_100000_is_an_error_and_no_crash(opening):
    with pytest.raises(InputError, match="nesting deeper than 64"):
        parse_json(opening * 100_000)


def test_byte_order_mark_is_skipped_and_other_encodings_are_refused(tmp_path):
    path = tmp_path / "run.json"
    path.write_bytes(b"\xef\xbb\xbf" + '{"é": 1}'.encode())
    assert read_json(path) == {"é": 1}
    path.write_bytes('{\n"é": 1}'.encode("latin-1"))
    with pytest.raises(InputError, match=r"run\.json:2:2: byte 0xe9 is not UTF-8"):
        read_json(path)


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_json(tmp_path / "none.json")
    with pytest.raises(InputError, match="folder"):
        read_json(tmp_path)


def test_damaged_text_is_read_as_the_standard_reader_does_or_refused():
    text = '{"model": "a.mdpa", "fix": {"P": "xyz", "Q": {"x": -1.5e-3}}, "g": [0, null, true]}'
    random_ = random.Random(5)
    read = refused = 0
    for _ in range(2000):
        at = random_.randrange(len(text))
        damaged = text[:at] + random_.choice(string.printable) + text[at + 1 :]
        try:
            value = parse_json(damaged)
        except InputError:
            refused += 1
            continue
        read += 1
        assert value == json.loads(damaged)
    assert read > 100
    assert refused > 100


@pytest.mark.parametrize("name", ["61", "62", "63", "67", "70"])
def test_malformed_real_files_are_refused_at_their_place(malformed, name):
    (path,) = malformed.glob(f"{name}_*.json")
    with pytest.raises(InputError, match=rf"{path.name}:1:\d+: "):
        read_json(path)

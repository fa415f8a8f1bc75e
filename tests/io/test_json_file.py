"""Strict JSON: values as Python's own reader gives them; wrong syntax with line and column."""

import json

import pytest

from kratos_lite.errors import InputError
from kratos_lite.io.settings import parse_json, read_json


@pytest.mark.parametrize(
    "text",
    [
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
    assert type(value) is type(json.loads(text))


def test_comments_are_skipped_as_kratos_does():
    assert parse_json('// head\n{"a": /* here */ 1, // tail\n "b": 2}') == {"a": 1, "b": 2}


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ('{"a": 1,}', ":1:9", "'}'"),
        ("[1,\n2,\n]", ":3:1", "found ']'"),
        ('{"a": NaN}', "", "NaN is not a number in JSON"),
        ("[1e999]", "", "1e999 is too large"),
        ('{"E": 1.0,\n "E": 2.0}', "", "duplicate key 'E'"),
        ("12345678901234567890", "", "of 20 digits is too long"),
        ("01", ":1:2", "Extra data; found '1'"),
        ("1_000", ":1:2", "Extra data; found '_000'"),
        ("[.5]", ":1:2", "Expecting value; found '.5]'"),
        ("[True]", ":1:2", "Expecting value"),
        ("{'a': 1}", ":1:2", "Expecting property name enclosed in double quotes"),
        ('{"a" 1}', ":1:6", "Expecting ':' delimiter"),
        ("[1 2]", ":1:4", "Expecting ',' delimiter; found '2]'"),
        ("[1, 2", ":1:6", "Expecting ',' delimiter; found the end of the file"),
        ("", ":1:1", "found the end of the file"),
        ("{} x", ":1:4", "Extra data; found 'x'"),
        ('"open', ":1:1", "Unterminated string"),
        ('"two\nlines"', ":1:5", "Invalid control character"),
        (r'"\x"', ":1:2", "Invalid \\escape"),
        ("[1, /* open", ":1:5", "Comment '/*' without '*/'"),
    ],
)
def test_a_mistake_is_named_and_wrong_syntax_has_its_place(text, place, words):
    with pytest.raises(InputError) as caught:
        parse_json(text, "run.json")
    assert str(caught.value).startswith(f"run.json{place}: ")
    assert words in str(caught.value)


def test_nesting_of_64_is_read_and_of_65_refused():
    assert parse_json("[" * 64 + "]" * 64) == json.loads("[" * 64 + "]" * 64)
    with pytest.raises(InputError, match=r"^deep: nesting deeper than 64"):
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


def test_a_line_of_megabytes_is_read_as_kratos_writes_it(tmp_path):
    (tmp_path / "results.json").write_text('{"TIME": [' + "0.5, " * 250_000 + "1.0]}")
    assert len(read_json(tmp_path / "results.json")["TIME"]) == 250_001


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_json(tmp_path / "none.json")
    with pytest.raises(InputError, match="folder"):
        read_json(tmp_path)

"""The mutations of `mutations.txt`: a file | the tests that must notice, then `- old` and `+ new`.

The old text occurs in its file once. A text of several lines has several such lines.
"""

import re
from pathlib import Path
from typing import NamedTuple


class Mutation(NamedTuple):
    """A change of one formula, and the tests that fail with it, as arguments of pytest."""

    file: str
    old: str
    new: str
    tests: str


def read(text: str) -> list[Mutation]:
    """Return the mutations of a text.

    >>> read("a.py | tests/test_a.py -k one\\n  - x\\n  - y\\n  + z\\n")
    [Mutation(file='a.py', old='x\\ny', new='z', tests='tests/test_a.py -k one')]
    """
    found, file, tests = [], "", ""
    for head, old, new in re.findall(r"(?m)^(\S+ \| .*\n)?((?:  -.*\n)+)((?:  \+.*\n)+)", text):
        if head:
            file, tests = head.strip().split(" | ")
        found.append(
            Mutation(file, *("\n".join(re.findall("(?m)^  . ?(.*)$", t)) for t in (old, new)), tests)
        )
    return found


MUTATIONS = read(Path(__file__).with_suffix(".txt").read_text(encoding="utf-8"))

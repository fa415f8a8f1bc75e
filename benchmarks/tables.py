"""Markdown tables and numbers in them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

Row = dict[str, Any]
Place = tuple[str, str, int]
"""Scene, element kind and size."""
OURS, ADAPTIVE, NUMPY, THEIRS = "kratos_lite", "kratos_lite adaptive", "kratos_lite NumPy", "Kratos"


def table(head: str | Sequence[str], body: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table, or "" without rows.

    >>> print(table("a | b", [["1", "2"]]))
    | a | b |
    | --- | --- |
    | 1 | 2 |
    <BLANKLINE>
    """
    names = head.split(" | ") if isinstance(head, str) else head
    lines = ["| " + " | ".join(row) + " |" for row in body]
    if not lines:
        return ""
    return "\n".join(["| " + " | ".join(names) + " |", "|" + " --- |" * len(names), *lines]) + "\n"


def ratio(ours: float | None, theirs: float | None) -> str:
    """Return ours / theirs in two digits."""
    return f"{ours / theirs:.2g}" if ours and theirs else ""


def seconds(value: float | None) -> str:
    """Return a time in three digits; three decimals are enough below a second."""
    if value is None:
        return ""
    return f"{value:.3f}" if value < 1 else f"{value:.3g}"


def megabytes(value: float | None) -> str:
    """Return a memory in bytes as whole MB."""
    return f"{value / 1e6:.0f}" if value else ""


def error(value: float | None) -> str:
    """Return a relative error in one digit."""
    return "" if value is None else f"{value:.0e}"


def by_place(rows: Iterable[Row]) -> dict[Place, dict[str, Row]]:
    """Return the rows of each scene, kind and size by program."""
    found: dict[Place, dict[str, Row]] = defaultdict(dict)
    for row in rows:
        found[place_of(row)][row["program"]] = row
    return dict(found)


def place_of(row: Row) -> Place:
    """Return scene, kind and size of a row."""
    return row["scene"], row["kind"], row["n"]


def label(place: Place) -> str:
    """Return the name of a scene, kind and size."""
    scene, kind, n = place
    return " ".join(word for word in (scene, kind, f"n = {n}" if n else "") if word)

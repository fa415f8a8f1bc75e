"""Markdown tables and numbers in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

Row = dict[str, Any]
OURS, ADAPTIVE, THEIRS = "kratos_lite", "kratos_lite adaptive", "Kratos"


def table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table, or "" without rows.

    >>> print(table(["a", "b"], [["1", "2"]]))
    | a | b |
    | --- | --- |
    | 1 | 2 |
    <BLANKLINE>
    """
    lines = ["| " + " | ".join(row) + " |" for row in body]
    if not lines:
        return ""
    return "\n".join(["| " + " | ".join(head) + " |", "|" + " --- |" * len(head), *lines]) + "\n"


def ratio(ours: float | None, theirs: float | None) -> str:
    """Return ours / theirs in two digits."""
    return f"{ours / theirs:.2g}" if ours and theirs else ""


def seconds(value: float | None) -> str:
    """Return a time in three digits; three decimals are enough below a second."""
    if value is None:
        return ""
    return f"{value:.3f}" if value < 1 else f"{value:.3g}"

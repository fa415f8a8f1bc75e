"""Sections of docstrings as field lists: numpydoc, but what follows ``name :`` is a text, not a type."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import kratos_lite

LISTS = ("Parameters", "Attributes", "Raises")
TEXTS = ("Returns", "Yields", "Notes", "See Also")


def setup(app: Any) -> dict[str, bool]:
    """Let autodoc show docstrings through `convert`."""
    app.connect("autodoc-process-docstring", lambda app, what, name, obj, options, lines: convert(lines))
    return {"parallel_read_safe": True}


def convert(lines: list[str]) -> None:
    """Turn the sections of a docstring into reStructuredText, in place.

    >>> lines = ["Sum.", "", "Parameters", "----------", "a, b : m; lengths,", "    > 0."]
    >>> convert(lines)
    >>> lines
    ['Sum.', '', ':Parameters:', '    **a, b**', '        m; lengths, > 0.', '']
    """
    head, *parts = _parts(lines)
    found = list(head[1])
    for title, body in parts:
        if title in LISTS:
            found += [f":{title}:", *_entries(body, title), ""]
        elif title in TEXTS:
            found += [f":{title}:", *(f"    {line}".rstrip() for line in _trimmed(body)), ""]
        else:
            found += [f".. rubric:: {title}", "", *_trimmed(body), ""]
    lines[:] = found


def _parts(lines: list[str]) -> list[tuple[str, list[str]]]:
    """Return the titles of the sections, the first of which has none, and their lines."""
    parts: list[tuple[str, list[str]]] = [("", [])]
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if re.fullmatch(r"-{3,}", below) and re.fullmatch(r"[A-Z][A-Za-z ]+", line):
            parts.append((line, []))
        elif not re.fullmatch(r"-{3,}", line):
            parts[-1][1].append(line)
    return parts


def _trimmed(body: list[str]) -> list[str]:
    return "\n".join(body).strip("\n").splitlines()


def _entries(body: list[str], title: str) -> Iterator[str]:
    """Yield a definition list of names or errors with their texts."""
    for line in _trimmed(body):
        if not line.strip():
            continue
        if not line.startswith(" "):
            names, _, text = line.partition(" : ")
            names = names.rstrip(".").replace("*", r"\*")
            entry = ["    " + (_errors(names) if title == "Raises" else f"**{names}**")]
            entry += [f"        {text}"] if text else []
            yield from entry
        else:
            yield f"        {line.strip()}"


def _errors(names: str) -> str:
    """Return links to the classes of errors."""
    words = [name.strip() for name in names.split(",")]
    return ", ".join(f":exc:`~kratos_lite.{w}`" if hasattr(kratos_lite, w) else f":exc:`{w}`" for w in words)

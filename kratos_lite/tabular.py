"""What is shown as a table of labels and values, printed or in a notebook."""

from __future__ import annotations

from dataclasses import fields, is_dataclass


def names_of(kind: type) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass; none of another class."""
    return tuple(item.name for item in fields(kind)) if is_dataclass(kind) else ()


def aligned(rows: list[tuple[str, str]]) -> str:
    """Return labels and values as lines of two columns."""
    width = max((len(label) for label, _ in rows), default=0)
    return "\n".join(f"{label:<{width}}  {value}" for label, value in rows)


class Tabular:
    """What is shown as a table of labels and values, printed or in a notebook."""

    def table(self) -> list[tuple[str, str]]:
        """Return labels and values of a summary."""
        return []

    def __str__(self) -> str:
        return aligned(self.table())

    def _repr_html_(self) -> str:
        from html import escape  # notebooks alone need it

        cell = '<td style="text-align: left">'
        rows = "".join(
            f"<tr>{cell}{escape(label)}</td>{cell}{escape(text)}</td></tr>\n" for label, text in self.table()
        )
        return f"<table>\n<caption>{escape(type(self).__name__)}</caption>\n{rows}</table>"

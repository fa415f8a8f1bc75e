"""What is shown as a table of labels and values, printed or in a notebook, and the units in it."""

from __future__ import annotations

import re
from dataclasses import fields, is_dataclass

IN, LBF = 0.0254, 4.4482216152605
"""An inch in m, and a pound-force in N."""
UNITS: dict[str, dict[str, tuple[str, float]]] = {
    "SI": {},
    "mm N MPa t": {"m": ("mm", 1e-3), "Pa": ("MPa", 1e6), "J": ("mJ", 1e-3), "kg": ("t", 1e3)},
    "m kN kPa t": {"N": ("kN", 1e3), "Pa": ("kPa", 1e3), "J": ("kJ", 1e3), "kg": ("t", 1e3)},
    "mm kN GPa kg ms": {
        **{"m": ("mm", 1e-3), "N": ("kN", 1e3), "Pa": ("GPa", 1e9)},
        **{"s": ("ms", 1e-3), "Hz": ("kHz", 1e3)},
    },
    "in lbf psi slinch": {
        **{"m": ("in", IN), "N": ("lbf", LBF), "Pa": ("psi", LBF / IN**2)},
        **{"J": ("in·lbf", LBF * IN), "kg": ("slinch", LBF / IN)},
    },
}
"""Consistent sets of units, with K: what takes the place of each unit of SI, and its size in SI.

A slinch is 1 lbf s²/in.
"""
_UNIT = re.compile("kg|Pa|Hz|rad|[mNJs]")
_AFTER_NUMBER = re.compile(
    r"(?:(?<=[\d)\]] )|(?<=\[))√?(?:kg|Pa|Hz|rad|[mNJs])[²³23]?(?:[ /](?:kg|Pa|[mNJs])[²³23]?)*(?!\w)"
)


def in_units(text: str, units: str) -> str:
    """Return a text with the units of a set in place of those of SI after its numbers and in brackets.

    >>> in_units("2.5 kg/m³ at (0, 0, 1) m, 3 N m", "mm N MPa t")
    '2.5 t/mm³ at (0, 0, 1) mm, 3 N mm'
    """
    names = UNITS[units]
    return _AFTER_NUMBER.sub(
        lambda found: _UNIT.sub(lambda unit: names.get(unit[0], (unit[0],))[0], found[0]), text
    )


def unit_name(unit: str, units: str) -> str:
    """Return the name of a unit of SI in a set of units; other texts are not changed."""
    return in_units(f"[{unit}]", units)[1:-1]


def size_in_si(unit: str, units: str) -> float:
    """Return the size in SI of a unit, said as in SI, of a set.

    >>> print(f"{size_in_si('kg/m³', 'mm N MPa t'):g}")
    1e+12
    """
    size = 1.0
    for per, name, power in re.findall("(/?)(kg|Pa|[mNJs])([²³]?)", unit):
        size *= UNITS[units].get(name, ("", 1.0))[1] ** ({"²": 2, "³": 3}.get(power, 1) * (-1 if per else 1))
    return size


def names_of(kind: type) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass; none of another class."""
    return tuple(item.name for item in fields(kind)) if is_dataclass(kind) else ()


def aligned(rows: list[tuple[str, str]]) -> str:
    """Return labels and values as lines of two columns."""
    width = max((len(label) for label, _ in rows), default=0)
    return "\n".join(f"{label:<{width}}  {value}" for label, value in rows)


class Tabular:
    """What is shown as a table of labels and values, printed or in a notebook."""

    units = "SI"

    def table(self) -> list[tuple[str, str]]:
        """Return labels and values of a summary."""
        return []

    def __str__(self) -> str:
        return in_units(aligned(self.table()), self.units)

    def _repr_html_(self) -> str:
        from html import escape  # notebooks alone need it

        cell = '<td style="text-align: left">'
        rows = "".join(
            f"<tr>{cell}{escape(label)}</td>{cell}{escape(in_units(text, self.units))}</td></tr>\n"
            for label, text in self.table()
        )
        return f"<table>\n<caption>{escape(type(self).__name__)}</caption>\n{rows}</table>"

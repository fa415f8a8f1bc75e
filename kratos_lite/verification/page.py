"""The table as text, Markdown and JSON."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import isfinite
from typing import Any

from kratos_lite.verification.problem import FAIL, GRADES, PASS, REFUSED, Row

TITLES = {
    "element": "One element",
    "patch": "Patch tests",
    "macneal_harder": "Beams of MacNeal and Harder",
    "shells": "Plates and shells",
    "pressure": "Pressure vessels",
    "concentration": "Concentrations of stress",
    "nafems": "NAFEMS",
    "order": "Orders of convergence",
}
"""Headings of the families."""
SOURCES = {
    "Hooke": (
        "Hooke's law for an isotropic body in a uniform state of stress: S. P. Timoshenko and "
        "J. N. Goodier, Theory of Elasticity, 3rd ed., McGraw-Hill 1970, chapter 1"
    ),
    "Timoshenko": "S. P. Timoshenko and J. N. Goodier, Theory of Elasticity, 3rd ed., McGraw-Hill 1970",
    "Irons": (
        "B. M. Irons and A. Razzaque, Experience with the patch test for convergence of finite "
        "elements, in: A. K. Aziz (ed.), The Mathematical Foundations of the Finite Element "
        "Method, Academic Press 1972"
    ),
    "MacNeal": (
        "R. H. MacNeal and R. L. Harder, A proposed standard set of problems to test finite "
        "element accuracy, Finite Elements in Analysis and Design 1 (1985) 3-20"
    ),
    "Hughes": "T. J. R. Hughes, The Finite Element Method, Dover 2000",
    "Roache": (
        "P. J. Roache, Code verification by the method of manufactured solutions, Journal of "
        "Fluids Engineering 124 (2002) 4-10; orders p + 1 and p: P. G. Ciarlet, The Finite "
        "Element Method for Elliptic Problems, North-Holland 1978"
    ),
    "Lame": (
        "G. Lamé, Leçons sur la théorie mathématique de l'élasticité, Paris 1852; also in S. P. Timoshenko "
        "and J. N. Goodier, Theory of Elasticity (cylinder and sphere under uniform pressure)"
    ),
    "Kirsch": (
        "E. G. Kirsch, Die Theorie der Elastizität und die Bedürfnisse der Festigkeitslehre, "
        "Zeitschrift des VDI 42 (1898) 797-807"
    ),
    "Goodier": (
        "J. N. Goodier, Concentration of stress around spherical and cylindrical inclusions and "
        "flaws, Journal of Applied Mechanics 1 (1933) 39-44"
    ),
    "Williams": (
        "M. L. Williams, Stress singularities resulting from various boundary conditions in "
        "angular corners of plates in extension, Journal of Applied Mechanics 19 (1952) 526-528; "
        "field of C. Carstensen, G. Dolzmann, S. Funken and D. Helm, CMAME 190 (2001) 1885-1900"
    ),
    "Cook": (
        "R. D. Cook, Improved two-dimensional finite element, Journal of the Structural Division "
        "ASCE 100 (1974) 1851-1863; value of the limit: J. C. Simo and M. S. Rifai, IJNME 29 "
        "(1990) 1595-1638"
    ),
    "NAFEMS": "NAFEMS, The Standard NAFEMS Benchmarks, Rev. 3, 1990",
    "NAFEMS-FV": "NAFEMS, Selected Benchmarks for Natural Frequency Analysis, 1987",
}
"""Citations by the word that problems use for them."""
SMALL = 1e-9
"""Errors below are rounding, which differs from machine to machine."""


def number(value: float) -> str:
    """Return a value to the four digits that matter."""
    if not isfinite(value):
        return "–"
    text = f"{value:.4g}"
    return f"{value:.3e}" if "e" in text else text


def shown(row: Row, value: float) -> str:
    """Return the value shown; where it has to be 0, a bound stands for what is rounding."""
    if row.problem.reference == 0 and abs(value) <= (row.problem.tolerance or 0.0) <= SMALL:
        return f"< {row.problem.tolerance:.0e}"
    return number(value)


def limit(row: Row) -> str:
    """Return what a row has to meet."""
    tolerance = row.problem.tolerance
    if tolerance is None or not row.problem.exact(row.element):
        return "graded"
    return "exact" if tolerance <= SMALL else f"{tolerance:.2g}"


def by_family(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Return rows by the first word of their problem."""
    families: dict[str, list[Row]] = {}
    for row in rows:
        families.setdefault(row.problem.name.partition("/")[0], []).append(row)
    return families


# ---- terminal ----------------------------------------------------------------------------------------


def header(width: int = 9) -> str:
    """Return the line above the rows in a terminal; names of elements take a width."""
    return f"{'problem':<51} {'element':<{width}}{'value':>12}{'reference':>12}{'error':>11}  grade"


def line(row: Row, width: int = 9, reported: bool = False) -> str:
    """Return a row for a terminal; a note that was reported is not repeated."""
    error = "" if row.note else f"{row.error:9.1e}"
    value, reference = shown(row, row.value), number(row.problem.reference)
    text = f"{row.problem.name:<51} {row.kind:<{width}}{value:>12}{reference:>12}{error:>11}  {row.grade:<8}"
    note = row.note.splitlines()[0] if row.note else ""
    return f"{text}{'as above' if reported and note else note}".rstrip()


def summary(rows: Sequence[Row]) -> str:
    """Return how many rows there are of each grade."""
    grades = [PASS, FAIL, REFUSED, *(letter for _, letter in GRADES), "F"]
    counts = {grade: sum(row.grade == grade for row in rows) for grade in grades}
    reported = [f"{count} {grade}" for grade, count in counts.items() if count]
    return f"{len(rows)} rows" + (": " + ", ".join(reported) if reported else "")


# ---- Markdown ----------------------------------------------------------------------------------------

INTRO = (
    "How well each element finds what is known. `kratos-lite verify` computes the table, of the elements of "
    "the library or of [your own](../howto/own-element.md): "
    "`kratos-lite verify my_element.py --element My8N`.",
    "Every row has a value that is known: from a closed form, or from a publication that the last column "
    "names. `pass`: the error is at most that of the column *limit* (*exact*: rounding alone). Where an "
    "element need not be exact it has a grade instead, by the relative error, after MacNeal and Harder: "
    "A ≤ 2 %, B ≤ 10 %, C ≤ 20 %, D ≤ 50 %, F beyond. Errors are relative to the reference, or absolute "
    "where it is 0. `refused`: the element has spurious modes that may spoil the answer there.",
    "Meshes are coarse on purpose, so that locking shows: an F is a property of the element, in every "
    "program that has it, and the reason to take another one. Linear elements (4N, 5N, 6N, 8N) lock in "
    "bending and near ν = ½; quadratic ones (10N, 15N, 20N, 27N) are the ones to take.",
)
PEERS = (
    "Other programs solve the same discrete problems, with the same nodes, supports and nodal forces: {}. "
    "Their columns hold the same quantity, from their nodal displacements, which CalculiX prints to seven "
    "digits; they are empty where a program has no such element or analysis. Kratos' wedge of 15 nodes is "
    "left out: it has other shape functions, so that the nodal forces are not consistent for it. Its "
    "pyramid of 13 nodes has other functions, too, and fails the patch tests; that of 5 nodes has another "
    "rule."
)


def markdown(rows: Sequence[Row], programs: dict[str, str] | None = None, command: str = "") -> str:
    """Return the page; `programs` are other programs with their versions, each a column."""
    programs = programs or {}
    reported = ", ".join(f"{name} {version}" for name, version in programs.items())
    parts = ["# Verification\n", *(f"{text}\n" for text in INTRO)]
    parts += [PEERS.format(reported) + "\n"] if programs else []
    parts.append(f"Made by `{command or 'kratos-lite verify'}`; {summary(rows)}.\n")
    if len({row.kind for row in rows}) > 1:
        parts.append(_overview(rows))
    for family, some in by_family(rows).items():
        parts.append(f"## {TITLES.get(family, family)}\n\n{_table(some, programs)}")
    parts.append(_citations(rows))
    return "\n".join(parts)


def _cells(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |\n"


def _overview(rows: Sequence[Row]) -> str:
    """Return the grades of all elements, one line for each problem."""
    kinds = list(dict.fromkeys(row.kind for row in rows))
    lines: dict[str, dict[str, str]] = {}
    for row in rows:
        name = row.problem.name.removesuffix("_linear").removesuffix("_quadratic")
        lines.setdefault(name, {})[row.kind] = row.grade
    text = "## Overview\n\n" + _cells(["problem", *kinds]) + _cells(["---"] * (len(kinds) + 1))
    return text + "".join(
        _cells([name, *(grades.get(kind, "") for kind in kinds)]) for name, grades in lines.items()
    )


def _table(rows: Sequence[Row], programs: Iterable[str]) -> str:
    named = [program for program in programs if any(program in row.others for row in rows)]
    head = ["problem", "element", "value", *named, "reference", "limit", "grade", "source"]
    text = _cells(head) + _cells(["---"] * len(head))
    for row in rows:
        others = [shown(row, row.others[name]) if name in row.others else "" for name in named]
        problem = row.problem
        first = [problem.name.partition("/")[2], row.kind, shown(row, row.value)]
        last = [number(problem.reference), limit(row), row.grade, problem.source]
        text += _cells([*first, *others, *last])
    quantities = dict.fromkeys((row.problem.name, row.problem.quantity) for row in rows)
    reported = "".join(f"- {name.partition('/')[2]}: {quantity}\n" for name, quantity in quantities)
    return f"{reported}\n{text}"


def _citations(rows: Sequence[Row]) -> str:
    used = {row.problem.cited for row in rows}
    lines = (f"- **{word}**: {SOURCES[word]}." for word in SOURCES if word in used)
    return "## Sources\n\n" + "\n".join(lines) + "\n"


# ---- JSON --------------------------------------------------------------------------------------------


def record(row: Row) -> dict[str, Any]:
    """Return a row as JSON holds it."""
    problem = row.problem
    return {
        "problem": problem.name,
        "element": row.element,
        "quantity": problem.quantity,
        "value": row.value if isfinite(row.value) else None,
        "reference": problem.reference,
        "source": problem.source,
        "tolerance": problem.tolerance,
        "grade": row.grade,
        **({"note": row.note} if row.note else {}),
        **({"others": row.others} if row.others else {}),
    }

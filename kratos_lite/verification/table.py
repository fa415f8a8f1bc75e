"""The table: which problems there are, and the rows of some of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatchcase
from itertools import groupby

from kratos_lite.errors import InputError, nearest
from kratos_lite.verification import (
    concentrations,
    macneal_harder,
    nafems,
    orders,
    patch,
    pressure,
    single_element,
)
from kratos_lite.verification.meshes import element, kind_of
from kratos_lite.verification.problem import ELEMENTS, Problem, Row, solved

FAMILIES = (single_element, patch, macneal_harder, pressure, concentrations, nafems, orders)
"""Modules with problems, in the order of the table; a new one is a module with a list PROBLEMS."""
PROBLEMS: dict[str, Problem] = {problem.name: problem for family in FAMILIES for problem in family.PROBLEMS}
"""Every problem by its name."""


def chosen(names: Sequence[str] = ()) -> list[Problem]:
    """Return the problems of names, families or patterns such as ``*cylinder*``; all without names."""
    if not names:
        return list(PROBLEMS.values())
    for name in names:
        if not any(_fits(problem, name) for problem in PROBLEMS):
            families = dict.fromkeys(problem.partition("/")[0] for problem in PROBLEMS)
            words = (f"*{word}*" for problem in PROBLEMS for word in re.split("[/_]", problem))
            hint = nearest(name, [*families, *PROBLEMS, *words])
            raise InputError(f"no problem fits {name!r}; the families are {', '.join(families)}.{hint}")
    return [problem for problem in PROBLEMS.values() if any(_fits(problem.name, name) for name in names)]


def _fits(problem: str, name: str) -> bool:
    both = (name, f"{name}_linear", f"{name}_quadratic")  # one line of the overview
    return problem in both or problem.startswith(f"{name}/") or fnmatchcase(problem, name)


def verify(
    names: Sequence[str] = (),
    elements: Sequence[str] = (),
    progress: Callable[[str, float], None] | None = None,
) -> Iterator[Row]:
    """Yield the rows of problems for elements, by default all for those of the library."""
    problems = chosen(names)
    solved.cache_clear()  # an element of this name may have been another one
    wanted = tuple(kind_of(name).__name__ for name in elements) or ELEMENTS
    kinds = {problem.name: problem.elements(tuple(map(element, wanted))) for problem in problems}
    done = 0
    for _, group in groupby(problems, key=lambda problem: problem.models or problem.name):
        same = list(group)  # of these an element solves its models once
        if progress is not None:
            progress(same[0].name, done / len(problems))
        done += len(same)
        every = dict.fromkeys(kind for problem in same for kind in kinds[problem.name])
        rows = {(p.name, kind): p.row(kind) for kind in every for p in same if kind in kinds[p.name]}
        yield from (rows[p.name, kind] for p in same for kind in kinds[p.name])

"""The command ``verify``: compute the table of known values, print it and write it."""

from __future__ import annotations

import json
from argparse import Namespace
from contextlib import ExitStack, nullcontext
from pathlib import Path

from kratos_lite.atomic import write_whole
from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import InputError
from kratos_lite.testing.files import MODULE, REGISTRIES, beside, run_module
from kratos_lite.verification import page
from kratos_lite.verification.meshes import short
from kratos_lite.verification.problem import ELEMENTS, Row
from kratos_lite.verification.table import chosen, verify
from kratos_lite.view.progress import in_terminal

EXIT_FAILED = 1


def run(options: Namespace) -> int:
    """Print the rows wanted, those first that fail; return 1 if one fails that has to pass."""
    files = [Path(name) for name in options.names if name.endswith(".py")]
    names = [name for name in options.names if not name.endswith(".py")]
    target = Path(options.output) if options.output else None
    if target is not None and target.suffix not in (".md", ".json"):
        raise InputError(f"{target}: the table is written as .md or .json")
    if options.list:
        for problem in chosen(names):
            print(f"{problem.name:<51} {problem.quantity} [{problem.source}]")
        return 0
    with ExitStack() as stack:  # elements of a file are forgotten afterwards
        for registry in REGISTRIES:
            stack.enter_context(registry.temporary())
        for file in files:
            stack.enter_context(beside(file))
        own = [name for file in files for name in _elements_of(file)]
        rows = _printed(names, options.element or own)
        print(page.summary(rows))
        if target is not None:
            write_whole(target, _text(rows, target.suffix, options).encode())
        return EXIT_FAILED if any(row.failed for row in rows) else 0


def _elements_of(path: Path) -> list[str]:
    """Run a file; return the names of the elements that it defines."""
    defined = vars(run_module(path)).values()
    kinds = [v for v in defined if isinstance(v, type) and v.__module__ == MODULE]
    names = [kind.__name__ for kind in kinds if issubclass(kind, KinematicLinear)]
    if not names:
        raise InputError(f"{path}: defines no element; an element is a subclass of KinematicLinear")
    return names


def _printed(names: list[str], elements: list[str]) -> list[Row]:
    """Print failures as they come and the other rows at the end, also after Ctrl-C."""
    chosen(names)  # no table where one is unknown
    rows: list[Row] = []
    reported: set[str] = set()
    width = max([9, *(len(short(name)) + 1 for name in elements or ELEMENTS)])
    print(page.header(width))
    try:
        with in_terminal() as progress:
            for row in verify(names, elements, progress):
                rows.append(row)
                if row.failed:
                    with progress.hidden() if progress else nullcontext():
                        print(page.line(row, width, row.note in reported), flush=True)
                    reported.add(row.note)
    finally:
        for row in rows:
            if not row.failed:
                print(page.line(row, width, row.note in reported))
                reported.add(row.note)
    return rows


def _text(rows: list[Row], ending: str, options: Namespace) -> str:
    if ending == ".json":
        return json.dumps({"rows": [page.record(row) for row in rows]}, indent=1) + "\n"
    words = [*options.names, *(f"--element {name}" for name in options.element)]
    return page.markdown(rows, command=" ".join(["kratos-lite verify", *words]))

"""What each command does."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from kratos_lite.cli.options import apply, material
from kratos_lite.errors import InputError, ModelError

EXIT_CHECK_FAILED = 3

if TYPE_CHECKING:
    from kratos_lite.io.document import Document
    from kratos_lite.model import Model
    from kratos_lite.result import Result


class TerminalProgress:
    """Show the phase on a terminal once the work has taken more than two seconds."""

    def __init__(self) -> None:
        self.start = self.last = perf_counter()
        self.shown = False
        self.wanted = sys.stderr.isatty()

    def __call__(self, phase: str, share: float) -> None:
        """Show a phase and the share of it that is done, at most five times a second."""
        now = perf_counter()
        if self.wanted and now - self.start > 2 and now - self.last > 0.2:
            self.last, self.shown = now, True
            print(
                f"\r{phase:<10} {share:5.0%}  {now - self.start:6.1f} s", end="", file=sys.stderr, flush=True
            )

    def close(self) -> None:
        """Wipe the line."""
        if self.shown:
            print("\r" + " " * 40 + "\r", end="", file=sys.stderr, flush=True)


def solve(options: Namespace) -> int:
    """Solve a file, write what was asked for, print the summary."""
    clock = perf_counter()
    from kratos_lite.io.files import load
    from kratos_lite.io.results import check_picture, check_result_ending

    seconds = {"import": perf_counter() - clock}
    clock = perf_counter()
    _check_targets(options.input, options.output, options.json, options.picture)
    if options.output:
        check_result_ending(options.output)
    if options.picture:
        check_picture(options.picture)
    everywhere = any(material(text)[0] is None for text in options.material)
    scene = load(options.input, materials=not everywhere, strict=not options.lenient)
    apply(scene.model, options)
    seconds["read"] = perf_counter() - clock
    solver, tolerance = options.solver or scene.solver, scene.tolerance
    if options.tolerance is not None:
        tolerance = options.tolerance
    progress = TerminalProgress()
    try:
        result = scene.model.solve(solver, tolerance, progress)
    finally:
        progress.close()
    result.report.seconds = {**seconds, **result.report.seconds}
    outputs = _write(result, options, scene.output)
    if not options.quiet:
        print(result)
        for path in outputs:
            print(f"{'written':<22}{path}")
    lines = scene.evaluate(result)
    for line in lines:
        print(line)
    return EXIT_CHECK_FAILED if any(" failed " in line for line in lines) else 0


def _check_targets(source: str, *targets: str | None) -> None:
    """Refuse, before any work is done, a target without a folder, given twice, or that is the input."""
    taken = {Path(source).resolve()}
    for target in filter(None, targets):
        path = Path(target)
        if not path.parent.is_dir():
            raise InputError(f"{target}: the folder {path.parent} does not exist")
        if path.resolve() in taken:
            raise InputError(f"{target}: is the input or another output already; choose another name")
        taken.add(path.resolve())


def _write(result: Result, options: Namespace, given: dict[str, str]) -> list[str]:
    """Write the files asked for on the command line or in the run file; return their names."""
    start = perf_counter()
    written = []
    for key, writer in (("output", result.save), ("json", result.save), ("picture", result.plot)):
        path = getattr(options, key) or given.get(key)
        if path:
            if key == "json" and not str(path).endswith(".json"):
                from kratos_lite.io.results import write_json

                write_json(path, result)
            else:
                writer(path)
            written.append(str(path))
    if written:
        result.report.seconds["write"] = perf_counter() - start
    return written


def info(options: Namespace) -> int:
    """Describe a file."""
    from kratos_lite.io.describe import describe

    print(describe(_document(options)))
    return 0


def _document(options: Namespace) -> Document:
    """Return what a file says; of a run file, what the model says that it means."""
    from kratos_lite.io.document import Note
    from kratos_lite.io.documents import read_document

    if Path(options.input).suffix.lower() == ".json":
        from kratos_lite.io.kratos import document_from
        from kratos_lite.io.project import read_project

        model = read_project(options.input).model
        document = document_from(model)
        document.notes += [Note(0, text) for text in model.notes]
        return document
    return read_document(options.input, strict=not options.lenient)


def check(options: Namespace) -> int:
    """Report every problem of a file."""
    path = Path(options.input)
    if path.suffix == ".py":
        return _check_python(path)
    from kratos_lite.io.files import read

    model = read(path, strict=not options.lenient)
    needs, warnings = _needs(model)
    print(f"{path}: {model.mesh.n_nodes} nodes, {model.mesh.n_elements} elements, no errors")
    for text in (*warnings, *model.notes):
        print(f"note     {text}")
    for text in needs:
        print(f"to solve {text}")
    return 0


def _needs(model: Model) -> tuple[list[str], list[str]]:
    """Return what a model lacks for a solution, and its warnings; the model gets all it lacks on the way."""
    from kratos_lite.materials import Isotropic3D

    needs: list[str] = []
    warnings = model.check_geometry()
    cures: tuple[Callable[[], None], ...] = (
        lambda: model.assign(Isotropic3D(E=1.0, nu=0.0)),
        lambda: model.fix(range(model.mesh.n_nodes), override=True),
        lambda: None,
    )
    for cure in cures:
        try:
            return needs, model.check()
        except ModelError as error:
            needs += [str(error)] if str(error) not in needs else []
            cure()
    return needs, warnings


def _check_python(path: Path) -> int:
    from kratos_lite.testing import failures, run_file

    broken = 0
    for name, findings in run_file(path):
        failed = failures(findings)
        broken += len(failed)
        skipped = sum(finding.skipped for finding in findings)
        passed = len(findings) - len(failed) - skipped
        print(f"{name}: {passed} checks passed, {len(failed)} failed, {skipped} not run")
        for finding in findings:
            word = "ok" if finding.passed else "not run" if finding.skipped else "FAILED"
            print(f"  {word:<8}{finding}")
    return 2 if broken else 0


def convert(options: Namespace) -> int:
    """Convert a file."""
    from kratos_lite.io.files import write_document

    _check_targets(options.input, options.output)
    document = _document(options)
    lost = write_document(options.output, document)
    mesh = document.mesh
    print(f"{options.output}: {mesh.n_nodes} nodes, {mesh.n_elements} elements, {len(mesh.parts)} parts")
    for text in (*lost, *document.notes):
        print(f"note     {text}")
    return 0

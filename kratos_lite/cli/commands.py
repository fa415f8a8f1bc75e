"""What each command does."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from kratos_lite.cli.progress import shown
from kratos_lite.errors import InputError, ModelError, SolveError

if TYPE_CHECKING:
    from kratos_lite.io.case import Case
    from kratos_lite.io.formats.document import Document
    from kratos_lite.io.runners.outcome import Outcome
    from kratos_lite.mesh import Mesh

EXIT_UNSOLVABLE, EXIT_VALUE_MISSED = 2, 3
ROOT = Path(__file__).resolve().parents[2]
"""The source checkout, if the package is used from one."""


def solve(options: Namespace) -> int:
    """Run what an input and the options describe, print the summary, write the requested files."""
    use_threads(options.threads)
    return _within_numbers(_solve, options, perf_counter())


def _within_numbers(action: Callable[..., int], options: Namespace, *more: Any) -> int:
    """Do something with an input; an overflow or NaN becomes a readable error."""
    import numpy as np

    from kratos_lite.io.formats import input_file

    options.input = str(input_file(options.input))
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            return action(options, *more)
    except (FloatingPointError, OverflowError):
        raise SolveError(
            f"{options.input}: numbers exceed what a computer holds (1.8e308); "
            "look for coordinates, constants, supports or loads in wrong units"
        ) from None


def use_threads(count: int | None) -> None:
    """Tell the kernels, which are loaded later, how many threads to use."""
    if count is not None:
        if count < 1:
            raise InputError(f"--threads {count}: a number of threads, 1 or more, is needed")
        os.environ["KRATOS_LITE_THREADS"] = str(count)


def _solve(options: Namespace, clock: float) -> int:
    from kratos_lite.cli.apply_options import case_of
    from kratos_lite.cli.ranks import part_files_of, solve_parts
    from kratos_lite.io.run import run
    from kratos_lite.solvers.direct import reserve_buffers

    reserve_buffers()
    seconds = {"import": perf_counter() - clock}
    clock = perf_counter()
    if part_files_of(options):
        summary, written = solve_parts(options)
        _print([] if options.quiet else [*summary, *(f"{'written':<22}{path}" for path in written)])
        return 0
    with shown("read", options.progress) as progress:
        case = case_of(options)
        seconds["read"] = perf_counter() - clock
        outcome = run(case, progress)
    if outcome.result is not None:
        outcome.result.report.seconds = {**seconds, **outcome.result.report.seconds}
    try:  # a file that fails loses no summary, and a terminal that fails loses no file
        with shown("evaluate", options.progress):
            summary = [] if options.quiet else outcome.summary(verbose=options.verbose)
        _print(summary)
    except OSError:
        _write(outcome, options)
        raise
    return _write(outcome, options)


def _write(outcome: Outcome, options: Namespace) -> int:
    """Write what the end gives, compare it with expected values, and say both; return the exit code."""
    with shown("write", options.progress):
        written, expected = outcome.write(), outcome.compare()
    _print([] if options.quiet else [f"{'written':<22}{path}" for path in written])
    _print(expected)
    missed = any(" failed " in line for line in expected)
    report = None if outcome.result is None else outcome.result.report
    if report is not None and report.error is not None and report.error_asked is not None:
        missed |= report.error > report.error_asked
    return EXIT_VALUE_MISSED if missed else 0


def _print(lines: list[str]) -> None:
    if lines:
        print("\n".join(lines))
        if sys.stdout:
            sys.stdout.flush()


def info(options: Namespace) -> int:
    """Describe a model file; of a run file or script, its case."""
    return _within_numbers(_info, options)


def _info(options: Namespace) -> int:
    from kratos_lite.io.formats import ending

    if ending(options.input) in (".json", ".py"):
        from kratos_lite.io.files import read_case
        from kratos_lite.io.run import describe_case

        print(describe_case(read_case(options.input, strict=not options.lenient)))
    else:
        from kratos_lite.io.describe import describe

        print(describe(_document(options)))
    return 0


def _document(options: Namespace) -> Document:
    """Return what a model file says; of a run file or script, a document of its model."""
    from kratos_lite.io.formats import ending, read_document

    if ending(options.input) not in (".json", ".py"):
        return read_document(options.input, strict=not options.lenient)
    from kratos_lite.io.files import read_case
    from kratos_lite.io.formats.document import Note
    from kratos_lite.io.kratos.to_document import document_from

    case = read_case(options.input)
    if not case.is_of_model:
        raise InputError(f"{options.input}: describes a body; only meshes and models are converted")
    try:
        document = document_from(case.model)
    except InputError as error:
        raise InputError(f"{options.input}: {error}") from None
    document.notes += [Note(0, text) for text in case.model.notes]
    return document


def check(options: Namespace) -> int:
    """Report what keeps a file from being solved with these options, and what is doubtful."""
    use_threads(options.threads)
    return _within_numbers(_check, options)


def _check(options: Namespace) -> int:
    from kratos_lite.cli.apply_options import OF_MODELS, case_of, refuse

    path = Path(options.input)
    if path.suffix == ".py":
        from kratos_lite.io.script import is_script

        if not is_script(path):
            refuse(options, OF_MODELS, f"is for models; {path} defines elements and materials")
            return _check_python(path)

    case = case_of(options)
    needs, warnings = _needs(case)
    what = f"{path}: {_what(case)}{f', {case.time}' if case.time else ''}"
    lines = [f"{what}, {'cannot be solved' if needs else 'no errors'}"]
    if case.is_of_model and (extent := dict(case.model.mesh.table()).get("extent")):
        lines.append(f"extent   {extent}")
    lines += [f"error    {text}" for text in needs]
    lines += [f"note     {text}" for text in warnings]
    _print([] if options.quiet else lines)
    return EXIT_UNSOLVABLE if needs else 0


def _what(case: Case) -> str:
    if not case.is_of_model:
        return f"{case.body.kind} body"
    mesh = case.model.mesh
    return f"{mesh.n_nodes} nodes, {mesh.n_elements} elements"


def _needs(case: Case) -> tuple[list[str], list[str]]:
    """Return what a case lacks to be solved, and its warnings; a model gets all it lacks on the way."""
    from kratos_lite.io.run import check as checked

    if not case.is_of_model:
        return [], checked(case)
    from kratos_lite.materials.isotropic3d import Isotropic3D
    from kratos_lite.model.checks import LOADS_ON_SUPPORTS

    model, needs = case.model, list[str]()
    warnings = model.check_geometry()
    cures: tuple[Callable[[], None], ...] = (
        lambda: model.assign(Isotropic3D(E=1.0, nu=0.0, density=1.0)),
        lambda: model.fix(range(model.mesh.n_nodes), override=True),
        lambda: None,
    )
    for cure in cures:
        try:
            warnings = checked(case)
            break
        except ModelError as error:
            needs += [str(error)] if str(error) not in needs else []
            cure()
    if needs:  # the supports may be those that keep the checks going
        warnings = [text for text in warnings if text != LOADS_ON_SUPPORTS]
    return needs, [*warnings, *model.remarks()]


def _check_python(path: Path) -> int:
    from kratos_lite.testing import failures, report, run_file

    checked = run_file(path)
    _print([report(name, findings, whole=True) for name, findings in checked])
    return EXIT_UNSOLVABLE if any(failures(findings) for _, findings in checked) else 0


def convert(options: Namespace) -> int:
    """Convert a file."""
    return _within_numbers(_convert, options)


def _convert(options: Namespace) -> int:
    from kratos_lite.io.formats import write_document
    from kratos_lite.io.outputs import check_targets

    document = _document(options)
    check_targets([Path(options.input), Path(document.mesh.source)], [options.output])
    lost = write_document(options.output, document)
    print(f"{options.output}: {_counts(options.output, document.mesh)}")
    for text in (*lost, *document.notes):
        print(f"note     {text}")
    return 0


def _counts(path: str, mesh: Mesh) -> str:
    """Return the numbers of what a format holds of a mesh."""
    from kratos_lite.io.formats import ELEM_SET, ending

    kind = ending(path)
    whole = kind == ".mdpa" or kind in ELEM_SET  # others hold no elements of unknown shape
    elements = sum(len(block) for block in mesh.blocks if whole or block.shape is not None)
    parts = f", {len(mesh.parts)} parts" if kind == ".mdpa" else ""
    return f"{mesh.n_nodes} nodes, {elements} elements{parts}"


def verify(options: Namespace) -> int:
    """Compare elements with what is known."""
    from kratos_lite.cli.verification import run

    return run(options)


def bench(options: Namespace) -> int:
    """Run the benchmarks of a source checkout, in its folder, with all further words."""
    import subprocess

    if not (ROOT / "benchmarks" / "__main__.py").is_file():
        raise InputError(
            f"there are no benchmarks in {ROOT}; they come with the source only: "
            "clone the repository and install it with 'pip install -e .'"
        )
    return subprocess.run(
        [sys.executable, "-m", "benchmarks", *options.rest], cwd=ROOT, check=False
    ).returncode

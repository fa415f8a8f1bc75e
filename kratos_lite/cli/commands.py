"""What each command does; the help shows the docstrings, a line and examples."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from kratos_lite.cli.options import only, read_values
from kratos_lite.errors import InputError, KratosLiteError, ModelError, within_numbers
from kratos_lite.tabular import UNITS, in_units

if TYPE_CHECKING:
    from kratos_lite.io.case import Case
    from kratos_lite.io.formats.document import Document
    from kratos_lite.io.runners.outcome import Outcome
    from kratos_lite.mesh import Mesh

EXIT_UNSOLVABLE, EXIT_OMITTED, EXIT_NOT_REACHED = 2, 2, 3
ROOT = Path(__file__).resolve().parents[2]
"""The source checkout, if the package is used from one."""


@contextmanager
def _within_numbers(options: Namespace) -> Iterator[None]:
    """Find the input and do something with it; an overflow or NaN becomes a readable error."""
    from kratos_lite.io.formats import input_file

    options.input = str(input_file(options.input))
    with within_numbers(options.input):
        yield


def solve(options: Namespace) -> int:
    """Solve what a file describes, at rest or in time, and print a summary.

    kratos-lite solve examples/cantilever --json result.json
    kratos-lite solve wheel.mdpa --fix hub:xyz --rotation z:30 --picture wheel.png
    kratos-lite solve bridge.mdpa --modes 10 -o modes.pvd --picture modes.png
    kratos-lite solve tower.mdpa --fix z-:xyz --traction z+:1e4,0,0 --time 1e-3:500:10 -o swing.pvd
    kratos-lite solve examples/bodies/thrown_box.py -o out/box.pvd -o out/box.csv --picture out/box.png
    kratos-lite solve box.py --steps 500 -o second.csv --restart half.npz
    mpirun -n 4 kratos-lite solve bridge.mdpa --backend petsc -o bridge.pvtu
    kratos-lite solve part.msh --material E=2e11,nu=0.3 --fix base:xyz --traction top:0,0,-1e5 -o part.vtu
    """
    clock = perf_counter()
    _read_options(options)
    with _within_numbers(options):
        from kratos_lite.cli.apply_options import case_of, omitted_of
        from kratos_lite.cli.ranks import part_files_of, solve_parts
        from kratos_lite.io.outputs import check_outputs
        from kratos_lite.io.run import run
        from kratos_lite.solvers.direct import reserve_buffers
        from kratos_lite.view.progress import in_terminal

        reserve_buffers()
        seconds = {"import": perf_counter() - clock}
        clock = perf_counter()
        if part_files_of(options):
            summary, written = solve_parts(options)
            _print([] if options.quiet else [*summary, *map(_written, written)])
            return 0
        with in_terminal("read", options.progress):
            case = case_of(options)
            seconds["read"] = perf_counter() - clock
        cases, codes = [case, *case.then], list[int]()
        for each in case.then:
            check_outputs(each)
        for number, each in enumerate(cases, 1):
            _print([f"{'step':<22}{number} of {len(cases)}"] if case.then and not options.quiet else [])
            try:
                with in_terminal("check", options.progress) as progress:
                    outcome = run(each, progress)
            except ModelError as error:  # a key that is not used may be why
                raise ModelError(
                    "\n".join([str(error), *(f"note: {n}" for n in omitted_of(each))])
                ) from error
            if outcome.result is not None:
                outcome.result.report.seconds = {**seconds, **outcome.result.report.seconds}
            codes.append(_show(outcome, options))
        return max(codes)


def _show(outcome: Outcome, options: Namespace) -> int:
    """Print the summary of an outcome and write its files; return the exit code."""
    from kratos_lite.view.progress import in_terminal

    try:  # a file that fails loses no summary, and a terminal that fails loses no file
        with in_terminal("evaluate", options.progress):
            summary = [] if options.quiet else outcome.summary(verbose=options.verbose)
        _print(summary)
    except OSError:
        _write(outcome, options)
        raise
    return _write(outcome, options)


def _read_options(options: Namespace) -> None:
    """Read the values of options, and tell the kernels, which are loaded later, how many threads to use."""
    if options.backend == "petsc":
        from kratos_lite.cli.apply_options import refuse_serial_options

        refuse_serial_options(options)
    read_values(options)
    if options.threads is not None:
        os.environ["KRATOS_LITE_THREADS"] = str(options.threads)


def _write(outcome: Outcome, options: Namespace) -> int:
    """Write what the end gives, compare it with expected values, and say both; return the exit code."""
    from kratos_lite.view.progress import in_terminal

    with in_terminal("write", options.progress):
        written, expected = outcome.write(), outcome.compare()
    _print([] if options.quiet else list(map(_written, written)))
    _print(expected)
    not_reached = any(" failed " in line for line in expected)
    if options.strict and any(" not evaluated" in line for line in expected):
        return EXIT_OMITTED
    report = None if outcome.result is None else outcome.result.report
    if report is not None and report.error is not None and report.error_asked is not None:
        not_reached |= report.error > report.error_asked
    return EXIT_NOT_REACHED if not_reached else 0


def _written(path: str) -> str:
    return f"{'written':<22}{path}"


def _print(lines: list[str]) -> None:
    if lines:
        print("\n".join(lines), flush=True)


def info(options: Namespace) -> int:
    """Describe a file without solving it.

    kratos-lite info beam.mdpa
    kratos-lite info part.msh --units "mm N MPa t"
    kratos-lite info examples/bodies/pendulum.py
    """
    with _within_numbers(options):
        from kratos_lite.io.formats import describes_case, read_document
        from kratos_lite.validation import choice

        units = choice(options.units or "SI", "--units", UNITS)
        if describes_case(options.input):
            from kratos_lite.io.files import read_case
            from kratos_lite.io.run import describe_case

            text = describe_case(read_case(options.input))
        else:
            from kratos_lite.io.describe import amounts, describe
            from kratos_lite.io.kratos.to_model import model_from

            document = read_document(options.input, strict=not options.lenient)
            text = describe(document)
            with suppress(KratosLiteError):
                text = "\n".join([text, *(f"{name:<12}{row}" for name, row in amounts(model_from(document)))])
        print(in_units(text, units))
        return 0


def _document(options: Namespace) -> Document:
    """Return what a model file says; of a run file or script, a document of its model."""
    from kratos_lite.io.formats import describes_case, read_document

    if not describes_case(options.input):
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
    """Report what keeps a file from being solved with these options; or all problems of elements in a .py.

    kratos-lite check beam.mdpa
    kratos-lite check examples/bodies/thrown_box.py
    kratos-lite check part.msh --material E=210e9,nu=0.3 --fix bottom:xyz --pressure top:1e5
    mpirun -n 4 kratos-lite check bridge.mdpa --backend petsc
    kratos-lite check my_element.py
    """
    _read_options(options)
    with _within_numbers(options):
        from kratos_lite.cli.apply_options import case_of, refuse

        path = Path(options.input)
        if path.suffix == ".py":
            from kratos_lite.io.script import is_script

            if not is_script(path):
                refuse(options, only("models"), f"is for models; {path} defines elements and materials")
                return _check_python(path)
        case = case_of(options)
        needs, warnings = _needs(case)
        what = f"{path}: {_what(case)}{f', {case.time}' if case.time else ''}"
        lines = [f"{what}, {'cannot be solved' if needs else 'no errors'}"]
        if case.is_of_model and (extent := dict(case.model.mesh.table()).get("extent")):
            lines.append(f"extent   {extent}")
        lines += [f"error    {text}" for text in needs]
        lines += [f"note     {text}" for text in warnings]
        units = case.model.units if case.is_of_model else "SI"
        _print([] if options.quiet else [in_units(line, units) for line in lines])
        return EXIT_UNSOLVABLE if needs else 0


def _what(case: Case) -> str:
    if not case.is_of_model:
        return f"{case.body.kind} body"
    return f"{case.model.mesh.n_nodes} nodes, {case.model.mesh.n_elements} elements"


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
    """Convert a model file to another format.

    kratos-lite convert beam.elem beam.mdpa
    kratos-lite convert beam.mdpa beam.vtu
    """
    with _within_numbers(options):
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
    """Compare elements with closed forms and published values.

    kratos-lite verify
    kratos-lite verify patch macneal_harder --element 3D8N --element 3D20N
    kratos-lite verify my_element.py -o my_element.md
    """
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
    words = [sys.executable, "-m", "benchmarks", *options.rest]
    return subprocess.run(words, cwd=ROOT, check=False).returncode


def ccx(options: Namespace) -> int:
    """Solve a deck in place of CalculiX, with all further words."""
    from kratos_lite.cli.ccx import main

    return main(options.rest)

"""What each command does."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from kratos_lite.cli.options import apply, marches, material
from kratos_lite.cli.targets import check_json, check_targets, files_read
from kratos_lite.errors import InputError, ModelError, SolveError

EXIT_CHECK_FAILED = 3
ROOT = Path(__file__).resolve().parents[2]
"""The source checkout, if the package is used from one."""

if TYPE_CHECKING:
    from kratos_lite.analysis.model import Model
    from kratos_lite.analysis.result import Result
    from kratos_lite.io.document import Document
    from kratos_lite.mesh import Mesh


class TerminalProgress:
    """Show the phase on a terminal once the work has taken more than two seconds."""

    def __init__(self, always: bool = False) -> None:
        self.start = perf_counter()
        self.last = 0.0 if always else self.start
        self.shown, self.patience = False, 0.0 if always else 2.0
        self.wanted = always or sys.stderr.isatty()

    def __call__(self, phase: str, share: float) -> None:
        """Show a phase and the share of it that is done, at most five times a second."""
        now = perf_counter()
        if self.wanted and now - self.start > self.patience and now - self.last > 0.2:
            self.last, self.shown = now, True
            print(
                f"\r{phase:<10} {share:5.0%}  {now - self.start:6.1f} s", end="", file=sys.stderr, flush=True
            )

    def __enter__(self) -> TerminalProgress:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Wipe the line."""
        if self.shown:
            print("\r" + " " * 40 + "\r", end="", file=sys.stderr, flush=True)


def solve(options: Namespace) -> int:
    """Solve a file, print the summary, write what was asked for."""
    use_threads(options.threads)
    clock = perf_counter()
    import numpy as np

    try:
        with np.errstate(over="raise"):
            return _solve(options, clock)
    except FloatingPointError:
        raise SolveError(
            "numbers exceed what a computer holds (1.8e308); "
            "look for coordinates, constants, supports or loads in wrong units"
        ) from None


def march(options: Namespace) -> int:
    """March the body of a scene, print the summary, write what was asked for."""
    use_threads(options.threads)
    from kratos_lite.cli.marching import march_scene

    with TerminalProgress(options.progress) as progress:
        return march_scene(options, progress)


def use_threads(count: int | None) -> None:
    """Tell the kernels, which are loaded later, how many threads to use."""
    if count is not None:
        if count < 1:
            raise InputError(f"--threads {count}: a number of threads, 1 or more, is needed")
        os.environ["KRATOS_LITE_THREADS"] = str(count)


def _solve(options: Namespace, clock: float) -> int:
    from kratos_lite.io.files import load

    _refuse_scene(options.input, "solve")
    seconds = {"import": perf_counter() - clock}
    clock = perf_counter()
    read = files_read(options.input)
    if options.modes is not None:
        return _print_modes(options)
    if marches(options):
        return _solve_in_time(options, read)
    _targets(options, {}, read)
    everywhere = any(material(text)[0] is None for text in options.material)
    scene = load(options.input, materials=not everywhere, strict=not options.lenient)
    targets = _targets(options, scene.output, read)
    if options.vtu and "output" not in targets:
        raise InputError(f"--vtu {options.vtu}: there is no output to write so; add -o OUT.vtu")
    apply(scene.model, options)
    seconds["read"] = perf_counter() - clock
    solver, tolerance = options.solver or scene.solver, scene.tolerance
    if options.tolerance is not None:
        tolerance = options.tolerance
    with TerminalProgress() as progress:
        result = scene.model.solve(solver, tolerance, progress)
    result.report.seconds = {**seconds, **result.report.seconds}
    lines: list[str] = []
    try:  # a file that fails loses no summary, and a terminal that fails loses no file
        lines = scene.evaluate(result)
        if not options.quiet:
            print(result)
            if sys.stdout:
                sys.stdout.flush()
    finally:
        _write(result, targets, options)
        for line in lines:
            print(line)
    return EXIT_CHECK_FAILED if any(map(_is_failed, lines)) else 0


def _print_modes(options: Namespace) -> int:
    """Print natural frequencies of a model; what its file says of time and output does not matter."""
    from kratos_lite.cli.modes import modes_table
    from kratos_lite.io.files import load

    if options.output or options.json or options.picture:
        raise InputError("--modes prints a table; it writes no files")
    if options.march is not None:
        raise InputError("--modes and --march: give one of them")
    everywhere = any(material(text)[0] is None for text in options.material)
    model = load(options.input, materials=not everywhere, strict=not options.lenient).model
    apply(model, options)
    print(modes_table(model, options.modes))
    return 0


def _solve_in_time(options: Namespace, read: list[Path]) -> int:
    """March the model of a file, print the summary and the checks."""
    from kratos_lite.cli.transients import march_file

    with TerminalProgress() as progress:
        lines = march_file(options, read, progress)
    print("\n".join(lines), end="\n" if lines else "")
    return EXIT_CHECK_FAILED if any(map(_is_failed, lines)) else 0


def _is_failed(line: str) -> bool:
    return line.startswith("check ") and " failed " in line


def _targets(options: Namespace, given: dict[str, str], read: list[Path]) -> dict[str, str]:
    """Return the files to write by key, those of the command line before those of the run file.

    All are checked, before any work is done.
    """
    from kratos_lite.io.writers.results import check_result_ending

    if Path(options.output or given.get("output", "")).suffix.lower() in (".pvd", ".csv", ".npz"):
        path = options.output or given["output"]
        raise InputError(f"{path}: that is for a march; add --march STEP:STEPS, or write .vtu")
    asked = {key: getattr(options, key) for key in ("output", "json", "picture")}
    targets = {key: given.get(key) if path is None else path for key, path in asked.items()}
    found = {key: path for key, path in targets.items() if path is not None}
    check_targets(read, found.values())
    if "output" in found:
        check_result_ending(found["output"], options.vtu)
    check_json(found.get("json"))
    if "picture" in found:
        from kratos_lite.io.writers.pictures import check_picture

        check_picture(found["picture"])
    return found


def _write(result: Result, targets: dict[str, str], options: Namespace) -> None:
    """Write the files and say so."""
    from kratos_lite.io.writers.results import write_result

    for key, path in targets.items():
        if key == "picture":
            from kratos_lite.io.writers.pictures import draw

            draw(path, result)
        else:
            write_result(path, result, options.vtu if key == "output" else None)
        if not options.quiet:
            print(f"{'written':<22}{path}")


def info(options: Namespace) -> int:
    """Describe a file; of a run file, the model that it means."""
    from kratos_lite.io.describe import describe
    from kratos_lite.io.documents import ending
    from kratos_lite.io.files import load
    from kratos_lite.io.scenes.kinds import is_scene

    if is_scene(options.input):
        from kratos_lite.io.scenes.describe import describe_scene
        from kratos_lite.io.scenes.scene import read_scene

        scene = read_scene(options.input, strict=not options.lenient)
        print(f"{'file':<22}{Path(options.input).name}\n{describe_scene(scene)}")
    elif ending(options.input) == ".json":
        found = load(options.input)
        print(f"{'file':<12}{Path(options.input).name}\n{found.model}")
        if found.march is not None:
            print(f"{'time':<12}{found.march}")
    else:
        print(describe(_document(options)))
    return 0


def _refuse_scene(path: str, command: str) -> None:
    """Raise InputError for a scene of a body, which is marched."""
    from kratos_lite.io.scenes.kinds import is_scene

    if is_scene(path):
        raise InputError(f"{path}: a scene of a body is not for {command}; use: kratos-lite march {path}")


def _document(options: Namespace) -> Document:
    """Return what a file says; of a run file, what the model says that it means."""
    from kratos_lite.io.document import Note
    from kratos_lite.io.documents import read_document

    if Path(options.input).suffix.lower() == ".json":
        from kratos_lite.io.kratos.to_document import document_from
        from kratos_lite.io.project import read_project

        model = read_project(options.input).model
        document = document_from(model)
        document.notes += [Note(0, text) for text in model.notes]
        return document
    return read_document(options.input, strict=not options.lenient)


def check(options: Namespace) -> int:
    """Report every problem of a file."""
    path = Path(options.input)
    from kratos_lite.io.scenes.kinds import is_scene

    if is_scene(path):
        from kratos_lite.cli.marching import check_scene

        return check_scene(path, strict=not options.lenient)
    if path.suffix == ".py":
        return _check_python(path)
    from kratos_lite.io.files import load

    scene = load(path, strict=not options.lenient)
    model, march = scene.model, scene.march
    if march is None:
        needs, warnings = _needs(model)
    else:
        from kratos_lite.cli.transients import needs_of_march

        needs, warnings = needs_of_march(scene)
    size = f"{model.mesh.n_nodes} nodes, {model.mesh.n_elements} elements"
    print(f"{path}: {size}{'' if march is None else f', {march}'}, no errors")
    for text in (*warnings, *model.notes):
        print(f"note     {text}")
    for text in needs:
        print(f"to {'solve' if march is None else 'march'} {text}")
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

    _refuse_scene(options.input, "convert")
    check_targets(files_read(options.input), [options.output])
    document = _document(options)
    lost = write_document(options.output, document)
    print(f"{options.output}: {_counts(options.output, document.mesh)}")
    for text in (*lost, *document.notes):
        print(f"note     {text}")
    return 0


def _counts(path: str, mesh: Mesh) -> str:
    """Return the numbers of what a format holds of a mesh."""
    from kratos_lite.io.documents import ELEM_SET, ending

    kind = ending(path)
    whole = kind == ".mdpa" or kind in ELEM_SET  # others hold no elements of unknown shape
    elements = sum(len(block) for block in mesh.blocks if whole or block.shape is not None)
    parts = f", {len(mesh.parts)} parts" if kind == ".mdpa" else ""
    return f"{mesh.n_nodes} nodes, {elements} elements{parts}"


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

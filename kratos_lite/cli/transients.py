"""Transients of models on the command line: options, outputs and summary."""

from __future__ import annotations

from argparse import Namespace
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.analysis.result import vector
from kratos_lite.cli.options import apply, material, number
from kratos_lite.cli.targets import check_json, check_targets
from kratos_lite.errors import InputError, ModelError
from kratos_lite.io.files import load
from kratos_lite.io.project.march import NO_RESULT, SERIES, scheme_of
from kratos_lite.io.scene import March, Scene
from kratos_lite.io.writers.pictures import check_picture
from kratos_lite.io.writers.series import SeriesWriter, make_folder
from kratos_lite.typing import Progress

if TYPE_CHECKING:
    from kratos_lite.analysis import Moment, Transient

WIDTH = 22


def march_of(options: Namespace, given: March | None) -> March:
    """Return the march that the options and a file ask for; options win."""
    if options.solver or options.tolerance is not None:
        raise InputError("--solver and --tolerance are for statics; a march chooses its own solver")
    march = given
    if options.march is not None:
        dt, steps, every = _steps(options.march)
        march = replace(given, dt=dt, steps=steps, every=every) if given else March(dt, steps, every)
    assert march is not None
    changes: dict[str, Any] = {}
    if options.scheme:
        name, _, words = options.scheme.partition(":")
        changes["scheme"] = scheme_of(name, _numbers(words, "--scheme"))
    if options.rayleigh:
        changes["rayleigh"] = _rayleigh(options.rayleigh)
    if options.lumped:
        changes["lumped"] = True
    if options.restart:
        changes["restart"] = options.restart
    return replace(march, **changes)


def _steps(text: str) -> tuple[float, int, int]:
    """Return step, number of steps and every how many a moment is kept of ``STEP:STEPS[:EVERY]``.

    >>> _steps("1e-3:200:10")
    (0.001, 200, 10)
    """
    step, *counts = text.split(":")
    if len(counts) not in (1, 2) or not all(count.isdecimal() for count in counts):
        raise InputError(f"--march: expected STEP:STEPS[:EVERY] such as 1e-3:200:10; got {text!r}")
    steps, every = (int(count) for count in (*counts, "1")[:2])
    return number(step, "--march"), steps, every


def _numbers(text: str, option: str) -> list[float]:
    return [number(word, option) for word in text.split(",")] if text else []


def _rayleigh(text: str) -> tuple[float, float]:
    values = _numbers(text, "--rayleigh")
    if len(values) != 2 or min(values) < 0:
        raise InputError(f"--rayleigh: ALPHA,BETA, both ≥ 0, in 1/s and s are needed; got {text!r}")
    return values[0], values[1]


def march_targets(options: Namespace, given: dict[str, str], read: list[Path]) -> dict[str, str]:
    """Return the files of a march to write by key, those of the options first; all are checked."""
    targets = {key: getattr(options, key) or given.get(key) for key in ("output", "json", "picture")}
    targets["state"] = options.state
    found = {key: path for key, path in targets.items() if path}
    if options.restart:
        read = [*read, Path(options.restart)]
    check_targets(read, found.values(), new_folders=True)
    check_json(found.get("json"))
    ending = Path(found.get("output", "")).suffix.lower()
    if "output" in found and ending not in SERIES:
        raise InputError(f"{NO_RESULT.format(found['output'])}; use -o OUT.pvd")
    if options.vtu and "output" in found and ending != ".pvd":
        raise InputError(f"--vtu {options.vtu}: there is no output to write so; add -o OUT.pvd")
    if "state" in found and Path(found["state"]).suffix.lower() != ".npz":
        raise InputError(f"{found['state']}: the ending of --state must be .npz")
    if "picture" in found:
        check_picture(found["picture"])
    return found


def march_file(options: Namespace, read: list[Path], progress: Progress) -> list[str]:
    """March the model of a file, write what was asked for, and return the lines to print, checks last."""
    march_targets(options, {}, read)
    everywhere = any(material(text)[0] is None for text in options.material)
    scene = load(options.input, materials=not everywhere, strict=not options.lenient)
    scene.march = march_of(options, scene.march)
    targets = march_targets(options, scene.output, read)
    if options.vtu and "output" not in targets:
        raise InputError(f"--vtu {options.vtu}: there is no output to write so; add -o OUT.pvd")
    apply(scene.model, options)
    return run_march(scene, targets, options, progress)


def needs_of_march(scene: Scene) -> tuple[list[str], list[str]]:
    """Return what a model lacks for its march, and its warnings; no step is taken."""
    warnings = scene.model.check_geometry()
    try:
        transient = scene.transient()
        scene.moments(transient)
    except ModelError as error:
        return [str(error)], warnings
    return [], transient.equations.warnings


def run_march(scene: Scene, targets: dict[str, str], options: Namespace, progress: Progress) -> list[str]:
    """March a scene, write its files, and return the lines of the summary, the checks last."""
    transient = scene.transient(progress)
    for path in targets.values():
        make_folder(Path(path))
    with np.errstate(over="ignore", invalid="ignore"):
        moments = scene.moments(transient)
        start, clock = transient.moment(), perf_counter()
        course = _Course(transient, start)
        with ExitStack() as stack:  # even after Ctrl-C: the series as far as they came, and the last state
            stack.callback(course.save, targets.get("state"))
            series = None
            if "output" in targets:
                writer = SeriesWriter(targets["output"], transient, mode=options.vtu or "binary")
                series = stack.enter_context(writer)
                series.add(start)
            for moment in moments:
                course.add(moment)
                if series:
                    series.add(moment)
    seconds = perf_counter() - clock
    if "picture" in targets:
        _draw(targets["picture"], scene, course.last)
    end = transient.result(course.last)
    if "json" in targets:
        from kratos_lite.io.writers.results import write_result

        write_result(targets["json"], end)
    lines = [] if options.quiet else [*course.summary(scene, seconds), *_written(targets)]
    return lines + scene.evaluate(end)


def _written(targets: dict[str, str]) -> list[str]:
    return [f"{'written':<{WIDTH}}{path}" for path in targets.values()]


def _draw(path: str, scene: Scene, moment: Moment) -> None:
    from kratos_lite.io.writers.pictures import draw

    length = np.linalg.norm(moment.u, axis=1)
    title = f"displacement at t = {moment.time:g} s"
    draw(path, scene.model.mesh, moment.u, length, title=title, unit="m")


class _Course:
    """What a summary tells of a march: its start, its last moment and the one that moved farthest."""

    def __init__(self, transient: Transient, start: Moment) -> None:
        self.transient, self.start, self.last = transient, start, start
        self.energy, self.farthest, self.count = transient.energy(), (0.0, start, 0), 0
        self._compare(start)

    def add(self, moment: Moment) -> None:
        """Take a moment."""
        self.last = moment
        self._compare(moment)

    def _compare(self, moment: Moment) -> None:
        self.count += 1
        length = np.linalg.norm(moment.u, axis=1)
        row = int(length.argmax())
        if length[row] > self.farthest[0]:
            self.farthest = (float(length[row]), moment, row)

    def save(self, path: str | None) -> None:
        """Write the last moment, from which a restart goes on."""
        if path is not None:
            self.last.save(path)

    def summary(self, scene: Scene, seconds: float) -> list[str]:
        """Return the lines of the table."""
        e, mesh, march = self.transient.equations, scene.model.mesh, scene.march
        assert march is not None
        kinds = ", ".join(f"{len(block)} {block.name}" for block in mesh.blocks if len(block))
        size, moment, row = self.farthest
        steps = self.last.step - self.start.step
        span = f"{self.start.time:.6g} … {self.last.time:.6g} s, {steps} steps of {march.dt:g} s"
        force, scale = self.last.reactions.sum(axis=0), float(np.abs(self.last.reactions).sum())
        rows = [
            ("nodes", str(mesh.n_nodes)),
            ("elements", kinds),
            ("unknowns", str(len(e.system.reduced.free))),
            ("scheme", self.transient.scheme.name + (", lumped mass" if e.mass.lumped else "")),
            ("time", span),
            (
                "largest displacement",
                f"{size:.6e} m at node {mesh.node_ids[row]}, t = {moment.time:.6g} s, of {self.count} kept",
            ),
            ("energy", f"{self.energy:.6e} J at the start, {self.transient.energy():.6e} J at the end"),
            ("total reaction", f"{vector(force, scale)} N at the end"),
            ("time per step", f"{seconds / max(steps, 1):.3g} s, {seconds:.3g} s in all"),
        ]
        if any(march.rayleigh):
            rows.insert(4, ("damping", "{:g} 1/s × M + {:g} s × K".format(*e.rayleigh)))
        rows += self.transient.result(self.last).report.motion_rows()
        still = [] if size else ["no load, no support that moves and no velocity: nothing moves"]
        still += [f"rigid motions are held by inertia alone: {e.free_motions}"] if e.free_motions else []
        rows += [("warning", text) for text in (*e.warnings, *still)] + [
            ("note", text) for text in scene.model.notes
        ]
        return [f"{name:<{WIDTH}}{text}" for name, text in rows]

"""The command that marches a scene, and the one that checks it."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter

import numpy as np

from kratos_lite.bodies import Body, State
from kratos_lite.cli.targets import check_targets
from kratos_lite.errors import InputError
from kratos_lite.io.scenes.describe import body_lines, line, vector
from kratos_lite.io.scenes.scene import OUTPUTS, BodyScene, read_scene
from kratos_lite.io.writers.pictures import check_picture, draw_trajectory
from kratos_lite.io.writers.series import SeriesWriter, make_folder

SERIES = ("pvd", "csv", "npz")


def march_scene(options: Namespace, progress: Callable[[str, float], None]) -> int:
    """March the scene of the options; return the exit code."""
    scene = read_scene(options.input, strict=not options.lenient)
    _apply(scene, options)
    body, start, clock = scene.body, _Totals(scene.body), perf_counter()
    kept = [State.of(body)]
    last, largest = kept[:], start.kinetic + start.internal
    with ExitStack() as stack:
        # even after Ctrl-C: the series as far as they came, and the state from which to go on
        stack.callback(_save_state, last, scene.output.get("state"))
        series = [
            stack.enter_context(SeriesWriter(scene.output[key], body))
            for key in SERIES
            if key in scene.output
        ]
        stack.enter_context(np.errstate(over="ignore", invalid="ignore"))
        states = scene.march(progress)
        for one in series:
            one.add(kept[0])
        for last[0] in states:
            largest = max(largest, float(np.sum(body.kinetic_energy() + body.internal_energy())))
            for one in series:
                one.add(last[0])
            if "picture" in scene.output:
                kept.append(last[0])
    seconds = perf_counter() - clock
    if "picture" in scene.output:
        draw_trajectory(scene.output["picture"], body, kept, title=Path(options.input).stem.replace("_", " "))
    if not options.quiet:
        print(
            "\n".join(
                [*body_lines(scene), *_summary(start, _Totals(body), largest, seconds, body.damping > 0)]
            )
        )
        for path in scene.output.values():
            print(line("written", path))
    return 0


def check_scene(path: Path, strict: bool) -> int:
    """Report every problem of a scene, without a step."""
    scene = read_scene(path, strict=strict)
    _check_outputs(scene, scene.output, scene.files)
    scene.march()
    print(f"{path}: {scene.body.kind} body, {scene.steps} steps of {scene.dt:g} s, no errors")
    return 0


def _apply(scene: BodyScene, options: Namespace) -> None:
    """Let the options win over the scene, and check what is to be written before any work."""
    given = {key: getattr(options, key) for key in OUTPUTS if getattr(options, key) is not None}
    scene.output = {**scene.output, **given}
    files = list(scene.files)
    if options.restart:
        State.load(options.restart).put_into(scene.body)
        files.append(Path(options.restart))
    if options.steps is not None:
        if options.steps < 1:
            raise InputError(f"--steps {options.steps}: a number of steps, 1 or more, is needed")
        scene.steps = options.steps
    _check_outputs(scene, scene.output, files)
    for path in scene.output.values():
        make_folder(Path(path))


def _check_outputs(scene: BodyScene, output: dict[str, str], read: list[Path]) -> None:
    """Raise KratosLiteError for an output that cannot be written."""
    check_targets(read, output.values(), new_folders=True)
    for key, path in output.items():
        ending = Path(path).suffix.lower()
        wanted = ".npz" if key == "state" else f".{key}"
        if key != "picture" and ending != wanted:
            raise InputError(f"{path}: the ending of {key} must be {wanted}")
        if key == "picture":
            check_picture(path)
        if key in SERIES:
            SeriesWriter(path, scene.body)


def _save_state(last: list[State], path: str | None) -> None:
    if path is not None:
        last[0].save(path)


class _Totals:
    """Energies and momenta of a body, or of many together."""

    def __init__(self, body: Body) -> None:
        self.time, self.step = body.time, body.step
        self.kinetic, self.internal, self.potential, self.work = (
            float(np.sum(value))
            for value in (
                body.kinetic_energy(),
                body.internal_energy(),
                body.potential_energy(),
                body.external_work,
            )
        )
        self.center = body.mass_center() if body.q.ndim == 1 else None
        self.linear, self.angular = (
            momentum.reshape(-1, 3).sum(axis=0)
            for momentum in (body.linear_momentum(), body.angular_momentum())
        )


def _summary(start: _Totals, end: _Totals, largest: float, seconds: float, damped: bool) -> list[str]:
    """Return the lines of the table that say how the march went.

    What kinetic and internal energy gain beyond the external work is an error of the scheme, unless damping
    takes it; potential energy stays out of this, as its loss is external work already.
    """
    steps = end.step - start.step
    gained = end.kinetic - start.kinetic + end.internal - start.internal - (end.work - start.work)
    share = gained / largest if largest else 0.0
    balance = ("energy drift", f"{share:+.1e} of the largest energy: kinetic + internal less external work")
    if damped:
        balance = ("dissipated", f"{-gained:.7g} J, by damping and the scheme")
    rows: list[tuple[str, str]] = [
        ("time", f"{start.time:.6g} … {end.time:.6g} s, {steps} steps"),
        ("kinetic energy", f"{end.kinetic:.7g} J"),
        ("internal energy", f"{end.internal:.7g} J"),
        ("potential energy", f"{end.potential:.7g} J"),
        ("sum of energies", f"{end.kinetic + end.internal + end.potential:.7g} J"),
        ("external work", f"{end.work - start.work:.7g} J, of all loads, gravity too, and of reactions"),
        balance,
        ("linear momentum", f"{vector(end.linear)} kg m/s"),
        ("angular momentum", f"{vector(end.angular)} kg m²/s about the mass center"),
    ]
    if end.center is not None:
        rows.append(("mass center", f"{vector(end.center)} m"))
    rows.append(("time per step", f"{seconds / max(steps, 1):.3g} s, {seconds:.3g} s in all"))
    return [line(name, text) for name, text in rows]

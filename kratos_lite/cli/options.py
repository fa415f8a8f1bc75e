"""The options of each command: a new one is an `add_argument`, and its meaning in `cli.apply_options`."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import Any

from kratos_lite import __version__
from kratos_lite.cli.parser import Formatter, Parser

EXIT_CODES = """exit codes:
  0    done
  1    a defect of kratos-lite, or a row of verify that fails
  2    bad input, or an output that cannot be written
  3    solved, but an expected value of the run file, or the requested error, is not reached
  130  interrupted with Ctrl-C; 143 by SIGTERM"""
MODEL = (
    ".mdpa, any file of an .elem set or its stem, ProjectParameters.json or its folder, or any mesh that "
    "meshio reads"
)
SCRIPT = "a .py script with a case, or with body, dt and steps"
EXAMPLES = {
    "solve": """kratos-lite solve cube.mdpa -o cube.vtu
  kratos-lite solve examples/cantilever --json result.json
  kratos-lite solve wheel.mdpa --fix hub:xyz --rotation z:30 --picture wheel.png
  kratos-lite solve bridge.mdpa --modes 10 -o modes.pvd --picture modes.png
  kratos-lite solve tower.mdpa --fix z-:xyz --traction z+:1e4,0,0 --time 1e-3:500:10 -o swing.pvd
  kratos-lite solve examples/bodies/thrown_box.py -o out/box.pvd -o out/box.csv --picture out/box.png
  kratos-lite solve box.py --steps 500 -o second.csv --restart half.npz
  mpirun -n 4 kratos-lite solve bridge.mdpa --backend petsc -o bridge.pvtu
  kratos-lite solve part.msh --material E=210e9,nu=0.3,density=7850 \\
      --fix bottom:xyz --gravity 0,0,-9.81 --traction top:0,0,-1e5 --picture part.png""",
    "info": "kratos-lite info beam.mdpa\n  kratos-lite info examples/bodies/pendulum.py",
    "check": "kratos-lite check beam.mdpa\n  kratos-lite check examples/bodies/thrown_box.py\n"
    "  kratos-lite check part.msh --material E=210e9,nu=0.3 --fix bottom:xyz --pressure top:1e5\n"
    "  mpirun -n 4 kratos-lite check bridge.mdpa --backend petsc\n"
    "  kratos-lite check my_element.py",
    "verify": "kratos-lite verify\n  kratos-lite verify patch macneal_harder --element 3D8N --element 3D20N\n"
    "  kratos-lite verify my_element.py -o my_element.md",
    "convert": "kratos-lite convert beam.elem beam.mdpa\n  kratos-lite convert beam.mdpa beam.vtu",
}
INTEGRATORS = (
    "newmark, newmark:BETA,GAMMA, hht[:ALPHA], bossak[:ALPHA], generalized_alpha[:RHO] or "
    "central_difference (newmark, the trapezoidal rule)"
)
MODES = (
    "find the N lowest natural frequencies instead; their modes go to -o OUT.pvd or OUT.html, the first of "
    "them to --picture"
)
BACKEND = "petsc: statics, by PETSc over all processes that mpirun or srun has started (own, on one)"
ERROR = "relative error of the energy norm, such as 1%% or 0.01: statics, the mesh made finer"
FORMULATION = (
    "of the elements, in place of what their names in the file say: standard, enhanced, b_bar, reduced, or "
    "non_locking, that of each shape which does not lock"
)
OUTPUT = (
    "static: .vtu for ParaView, .html for the browser, .vtk, .json or .csv (nodes), over many processes "
    ".pvtu with a piece of each, or .json; in time: .pvd for ParaView, .html, .csv or .npz; of modes: .pvd "
    "or .html; may be given several times"
)
PROBLEMS = (
    "problems, their families or patterns such as '*cylinder*' (all); a .py file defines elements of your "
    "own, which are then those that are verified"
)
RESTART = (
    "go on from a state that --state wrote; series and picture then hold the rest of the run only, and "
    "replace those of the same name, so give them new names"
)


def with_values(words: Sequence[str]) -> list[str]:
    """Return the words with options of PETSc, which begin with a dash, joined to ``--petsc``.

    >>> with_values(["solve", "a.mdpa", "--petsc", "-ksp_view"])
    ['solve', 'a.mdpa', '--petsc=-ksp_view']
    """
    joined: list[str] = []
    for word in words:
        if joined[-1:] == ["--petsc"]:
            joined[-1] = f"--petsc={word}"
        else:
            joined.append(word)
    return joined


def build_parser() -> Parser:
    """Return the parser of all commands."""
    parser = Parser(
        prog="kratos-lite",
        description="Finite elements for solids: from an input file to displacements and stresses.",
        epilog=EXIT_CODES,
        formatter_class=Formatter,
    )
    parser.add_argument("--version", action="version", version=f"kratos-lite {__version__}")
    commands = parser.add_subparsers(prog="kratos-lite", dest="command", required=True, metavar="COMMAND")
    _add_solve(commands)
    info = _add(commands, "info", "describe a file without solving it")
    info.add_argument("input", help=f"{MODEL}; or {SCRIPT}")
    check = _add(
        commands,
        "check",
        "report what keeps a file from being solved, by the words of solve, without solving it; or every "
        "problem of the elements and materials in a Python file",
    )
    check.add_argument("input", help=f"{MODEL}; {SCRIPT}; or a .py file that defines elements or materials")
    _add_case(check)
    convert = _add(commands, "convert", "convert a model file to another format")
    convert.add_argument("input", help=MODEL)
    convert.add_argument("output", help=".mdpa, .elem, .vtu or any format of meshio, chosen by the extension")
    _add_verify(commands)
    # All its words, also --help, are for the program that it runs.
    bench = commands.add_parser("bench", help="run the benchmarks of a source checkout", add_help=False)
    bench.set_defaults(debug=False)
    return parser


def _add(commands: Any, name: str, text: str) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(
        name,
        help=text,
        description=text[0].upper() + text[1:] + ".",
        epilog=f"examples:\n  {EXAMPLES[name]}",
        formatter_class=Formatter,
    )
    # "-1,0,0" and "-z:30" are values, not options
    command._negative_number_matcher = re.compile(r"-([\d.]|[xyz]:)")
    if name != "verify":
        command.add_argument(
            "--lenient", action="store_true", help="accept .mdpa rows that are broken over lines"
        )
    command.add_argument("--debug", action="store_true", help="show the traceback of an error")
    return command


def _add_solve(commands: Any) -> None:
    solve = _add(commands, "solve", "solve what a file describes, at rest or in time, and print a summary")
    solve.add_argument("input", help=f"{MODEL}; or {SCRIPT}")
    _add_case(solve)


def _add_options(group: Any, *options: tuple[str, str | None, str], **settings: Any) -> None:
    """Add options: their names, what stands for the value (None without one), and the help."""
    for names, value, text in options:
        if value is None:
            group.add_argument(*names.split(), action="store_true", help=text)
        else:
            group.add_argument(*names.split(), metavar=value or None, help=text, **settings)


def _add_case(command: argparse.ArgumentParser) -> None:
    """Add what changes the case of an input; `check` takes the same words as `solve`."""
    _add_outputs(command)
    _add_model(command)
    _add_motion(command)
    _add_time(command)
    how = command.add_argument_group("solver")
    _add_options(how, ("--modes", "N", MODES), type=int)
    _add_options(how, ("--solver", "", "auto chooses by size"), choices=("auto", "dense", "direct", "amg"))
    _add_options(how, ("--error", "FRACTION", ERROR))
    _add_options(how, ("--backend", "", BACKEND), choices=("own", "petsc"))
    _add_options(how, ("--petsc", "OPTIONS", "options of PETSc, such as '-pc_type hypre'"))
    _add_options(how, ("--tolerance", "", "relative residual of the iterative solver (1e-10)"), type=float)
    _add_options(how, ("--threads", "N", "threads of the compiled kernels (all cores)"), type=int)
    _add_options(
        how,
        ("--progress", None, "show progress, even if not on a terminal"),
        ("-v --verbose", None, "also list what the solution skipped"),
        ("-q --quiet", None, "print no summary"),
    )


def _add_verify(commands: Any) -> None:
    verify = _add(commands, "verify", "compare elements with closed forms and published values")
    verify.add_argument("names", nargs="*", metavar="NAME", help=PROBLEMS)
    only = "only this one, such as 3D8N; may be given several times (all of the library)"
    _add_options(verify, ("--element", "NAME", only), action="append", default=[])
    _add_options(
        verify,
        ("-o --output", "OUT", "write the table as .md or .json"),
        ("--list", None, "list the problems and their sources instead"),
    )


def _add_outputs(command: argparse.ArgumentParser) -> None:
    out = command.add_argument_group("output (instead of the files that the input names)")
    _add_options(out, ("-o --output", "OUT", OUTPUT), action="append", default=[])
    _add_options(
        out,
        ("--json", "OUT.json", "summary, displacements and reactions by node id"),
        (
            "--picture",
            "OUT.png",
            "picture of the deformed model, of its modes, or of a body along its path; .gif, .mp4: film",
        ),
        ("--state", "OUT.npz", "the last state in time, for --restart; written after Ctrl-C too"),
    )
    text = "how .vtu files store their numbers: quickest, smallest, or to be read by eye (binary)"
    _add_options(out, ("--vtu", "", text), choices=("binary", "compressed", "ascii"))


def _add_model(command: argparse.ArgumentParser) -> None:
    model = command.add_argument_group(
        "model (adds to what the file says; PART is a part of the mesh or a side x- x+ y- y+ z- z+)"
    )
    fix = "prescribe displacements in m along the axes named, 0 if no value is given"
    _add_options(
        model,
        ("--material", "[PART:][LAW:]E=…,nu=…", "constants in SI units; replaces the materials of the file"),
        ("--fix", "PART:xyz[=VALUE]", fix),
        ("--gravity", "X,Y,Z", "acceleration in m/s²"),
        ("--traction", "PART:X,Y,Z", "force per area in Pa"),
        ("--pressure", "PART:P", "pressure in Pa, positive into the body"),
        ("--point-load", "PART:X,Y,Z", "force in N on a part of one node"),
        ("--resultant", "PART:X,Y,Z", "force in N in all, spread over the faces of the part"),
        action="append",
        default=[],
    )
    _add_options(
        model,
        ("--formulation", "WORD", FORMULATION),
        ("--scale", "FACTOR", "on the coordinates of a mesh file: a number, or mm, cm, in, ft (1)"),
        ("--linear", None, "small deformations, also where a run file asks for large ones"),
        (
            "--ignore-initial-displacement",
            None,
            "do not take the DISPLACEMENT of free nodes in the file for the state without stress",
        ),
    )


def _add_motion(command: argparse.ArgumentParser) -> None:
    ale = command.add_argument_group("motion of the material through the mesh (one at most)")
    _add_options(
        ale,
        ("--rotation", "AXIS:RATE[:ACCELERATION]", "about x, y, z or X,Y,Z, in rad/s and rad/s²"),
        ("--center", "X,Y,Z", "a point of the axis in m (0,0,0)"),
        ("--center-velocity", "X,Y,Z", "of the center of the rotation, in m/s"),
        ("--center-acceleration", "X,Y,Z", "likewise, in m/s²"),
        ("--translation", "AXIS:RATE[:ACCELERATION]", "of the moving frame, in m/s and m/s²"),
        ("--damping", "ALPHA", "by mass, relative to the motion, in 1/s (0)"),
        ("--moving-part", "PART", "the part that moves; the others rest (all)"),
        ("--stiffening", None, "add the geometric stiffness of the centrifugal stress"),
    )
    text = "condition on the cut faces of the moving frame (absorbing)"
    _add_options(ale, ("--boundaries", "", text), choices=("absorbing", "periodic", "fixed", "natural"))


def _add_time(command: argparse.ArgumentParser) -> None:
    time = command.add_argument_group("time integration")
    _add_options(
        time,
        ("--time", "STEP:STEPS[:EVERY]", "step in s, their number, and every how many is kept"),
        ("--restart", "STATE.npz", RESTART),
        ("--integrator", "NAME[:NUMBERS]", f"of models: {INTEGRATORS}"),
        ("--rayleigh", "ALPHA,BETA", "damping ALPHA·M + BETA·K of models, in 1/s and s"),
    )
    _add_options(time, ("--steps", "N", "number of steps, overrides the file"), type=int)
    _add_options(time, ("--lumped", None, "lumped mass (models)"))

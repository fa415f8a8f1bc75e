"""The command line: ``kratos-lite solve | march | info | check | convert | bench``."""

from __future__ import annotations

import argparse
import atexit
import gc
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress

from kratos_lite import __version__

EXIT_BAD_INPUT, EXIT_INTERNAL, EXIT_INTERRUPTED = 2, 1, 130
EXIT_CODES = """exit codes:
  0    done
  1    a defect of kratos-lite
  2    bad input, or an output that cannot be written
  3    solved, but a check of the run file failed
  130  interrupted with Ctrl-C"""


def _help(prog: str) -> argparse.HelpFormatter:
    """Return a formatter as wide as the terminal; argparse would import shutil to find the width."""
    width = os.environ.get("COLUMNS", "")
    try:
        columns = int(width) if width.isdigit() else os.get_terminal_size().columns
    except (OSError, ValueError):
        columns = 0
    return argparse.RawDescriptionHelpFormatter(prog, width=(columns or 80) - 2)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="kratos-lite",
        description="Finite elements for solids: from an input file to displacements and stresses.",
        epilog=EXIT_CODES,
        formatter_class=_help,
    )
    parser.add_argument("--version", action="version", version=f"kratos-lite {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_solve(commands)
    _add_march(commands)
    _add(
        commands,
        "info",
        "describe a file without solving it, or a scene of a body without marching it",
        "kratos-lite info beam.mdpa\n  kratos-lite info examples/bodies/pendulum.json",
    ).add_argument("input", help=f"{INPUT}; or {SCENE}")
    _add(
        commands,
        "check",
        "report every problem of a file or scene, or of the elements and materials in a Python file",
        "kratos-lite check beam.mdpa\n  kratos-lite check examples/bodies/tumbling_box.json\n"
        "  kratos-lite check my_element.py",
    ).add_argument("input", help=f"an input file; {SCENE}; or a .py file that defines elements or materials")
    convert = _add(
        commands,
        "convert",
        "convert a model file to another format",
        "kratos-lite convert beam.elem beam.mdpa\n  kratos-lite convert beam.mdpa beam.vtu",
    )
    convert.add_argument("input", help=INPUT)
    convert.add_argument("output", help=".mdpa, .elem, .vtu or any format of meshio, by its ending")
    # All its words, also --help, are for the program that it runs.
    bench = commands.add_parser("bench", help="run the benchmarks of a source checkout", add_help=False)
    bench.set_defaults(debug=False)
    return parser


INPUT = ".mdpa, any file of an .elem set or its stem, ProjectParameters.json, or any mesh that meshio reads"
SCENE = "a scene: a .json file with a body, or a .py script with body, dt and steps"
SOLVE_EXAMPLES = """kratos-lite solve cube.mdpa -o cube.vtu
  kratos-lite solve ProjectParameters.json --json result.json
  kratos-lite solve wheel.mdpa --fix hub:xyz --rotation z:30 --picture wheel.png
  kratos-lite solve bridge.mdpa --modes 10
  kratos-lite solve tower.mdpa --fix z-:xyz --traction z+:1e4,0,0 --march 1e-3:500:10 -o swing.pvd
  kratos-lite solve part.msh --material E=210e9,nu=0.3,density=7850 \\
      --fix bottom:xyz --gravity 0,0,-9.81 --traction top:0,0,-1e5 --picture part.png"""


SCHEMES = (
    "newmark, newmark:BETA,GAMMA, hht[:ALPHA], bossak[:ALPHA], generalized_alpha[:RHO] or "
    "central_difference (newmark, the trapezoidal rule)"
)
RESTART = (
    "go on from a state that --state wrote; series and picture then hold the rest of the march only, and "
    "replace those of the same name, so give them new names"
)
MARCH_EXAMPLES = """kratos-lite march examples/bodies/tumbling_box.json
  kratos-lite march box.json --pvd out/box.pvd --csv out/box.csv --picture out/box.png
  kratos-lite march box.json --steps 500 --csv first.csv --state half.npz
  kratos-lite march box.json --steps 500 --csv second.csv --restart half.npz"""


def _add(commands: object, name: str, text: str, example: str) -> argparse.ArgumentParser:
    add = commands.add_parser  # type: ignore[attr-defined]
    command: argparse.ArgumentParser = add(
        name,
        help=text,
        description=text[0].upper() + text[1:] + ".",
        epilog=f"examples:\n  {example}",
        formatter_class=_help,
    )
    command.add_argument(
        "--lenient", action="store_true", help="accept .mdpa rows that are broken over lines"
    )
    command.add_argument("--debug", action="store_true", help="show the traceback of an error")
    return command


def _add_solve(commands: object) -> None:
    solve = _add(
        commands, "solve", "solve a linear model, at rest or in time, and print a summary", SOLVE_EXAMPLES
    )
    solve.add_argument("input", help=INPUT)
    out = solve.add_argument_group("output")
    out.add_argument(
        "-o",
        "--output",
        metavar="OUT.vtu",
        help="results for ParaView (or .vtk, .json); of a march .pvd, .csv or .npz",
    )
    out.add_argument("--json", metavar="OUT.json", help="summary, displacements and reactions by node id")
    out.add_argument(
        "--vtu",
        choices=("binary", "compressed", "ascii"),
        help="how a .vtu output stores its numbers: quickest, smallest, or to be read by eye (binary)",
    )
    out.add_argument("--picture", metavar="OUT.png", help="picture of the deformed body")
    given = solve.add_argument_group(
        "model (adds to what the file says; PART is a part of the mesh or a side x- x+ y- y+ z- z+)"
    )
    repeat = {"action": "append", "default": []}
    given.add_argument(
        "--material",
        metavar="[PART:][LAW:]E=…,nu=…",
        help="constants in SI units; replaces the materials of the file",
        **repeat,  # type: ignore[arg-type]
    )
    for option, meta, text in (
        (
            "--fix",
            "PART:xyz[=VALUE]",
            "prescribe displacements in m along the axes named, 0 if no value is given",
        ),
        ("--gravity", "X,Y,Z", "acceleration in m/s²"),
        ("--traction", "PART:X,Y,Z", "force per area in Pa"),
        ("--pressure", "PART:P", "pressure in Pa, positive into the body"),
        ("--point-load", "PART:X,Y,Z", "force in N on each node of the part"),
    ):
        given.add_argument(option, metavar=meta, help=text, **repeat)  # type: ignore[arg-type]
    _add_motion(solve)
    _add_time(solve)
    how = solve.add_argument_group("solver")
    how.add_argument("--modes", type=int, metavar="N", help="print the N lowest natural frequencies instead")
    how.add_argument("--solver", choices=("auto", "dense", "direct", "amg"), help="auto chooses by size")
    how.add_argument("--tolerance", type=float, help="relative residual of the iterative solver (1e-10)")
    how.add_argument("--threads", type=int, metavar="N", help="threads of the compiled kernels (all cores)")
    how.add_argument("-q", "--quiet", action="store_true", help="print no summary")


def _add_motion(solve: argparse.ArgumentParser) -> None:
    ale = solve.add_argument_group("motion of the material through the mesh (one at most; docs/ale.md)")
    ale.add_argument(
        "--rotation", metavar="AXIS:RATE[:ACCELERATION]", help="about x, y, z or X,Y,Z, in rad/s and rad/s²"
    )
    ale.add_argument("--center", "--center", metavar="X,Y,Z", help="a point of the axis in m (0,0,0)")
    ale.add_argument(
        "--stiffening", action="store_true", help="add the stiffness that the centrifugal stress gives"
    )
    ale.add_argument(
        "--translation", metavar="AXIS:RATE[:ACCELERATION]", help="of the window, in m/s and m/s²"
    )
    ale.add_argument(
        "--boundaries",
        choices=("absorbing", "periodic", "fixed", "natural"),
        help="what the cut faces of the window do (absorbing)",
    )
    ale.add_argument("--damping", metavar="ALPHA", help="by mass, relative to the motion, in 1/s (0)")


def _add_time(solve: argparse.ArgumentParser) -> None:
    time = solve.add_argument_group("motion in time, instead of rest (docs/dynamics.md)")
    time.add_argument(
        "--march", metavar="STEP:STEPS[:EVERY]", help="step in s, their number, and every how many is kept"
    )
    for option, meta, text in (
        ("--scheme", "NAME[:NUMBERS]", SCHEMES),
        ("--rayleigh", "ALPHA,BETA", "damping ALPHA·M + BETA·K, in 1/s and s"),
        ("--restart", "MOMENT.npz", "go on from a moment that --state wrote"),
        ("--state", "OUT.npz", "the last moment, for --restart; written after Ctrl-C too"),
    ):
        time.add_argument(option, metavar=meta, help=text)
    time.add_argument("--lumped", action="store_true", help="mass in the nodes")


def _add_march(commands: object) -> None:
    march = _add(commands, "march", "let a body move through time and print a summary", MARCH_EXAMPLES)
    march.add_argument("input", metavar="SCENE", help=SCENE)
    out = march.add_argument_group("output (instead of the files that the scene names)")
    for key, text in (
        ("pvd", "states for ParaView: an index, and OUT_00000.vtu … beside it"),
        ("csv", "a table of energies, momenta and the mass center"),
        ("npz", "configurations and velocities of all states as arrays"),
        ("picture", "the body along its path, and its energies"),
        ("state", "the last state, for --restart; written after Ctrl-C too"),
    ):
        ending = {"picture": "png", "state": "npz"}.get(key, key)
        out.add_argument(f"--{key}", metavar=f"OUT.{ending}", help=text)
    how = march.add_argument_group("march")
    how.add_argument("--steps", type=int, metavar="N", help="number of steps, instead of that of the scene")
    how.add_argument("--restart", metavar="STATE.npz", help=RESTART)
    how.add_argument(
        "--progress", action="store_true", help="show the share done, also where not on a terminal"
    )
    how.add_argument("--threads", type=int, metavar="N", help="threads of the compiled kernels (all cores)")
    how.add_argument("-q", "--quiet", action="store_true", help="print no summary")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code, one of `EXIT_CODES`."""
    atexit.register(gc.freeze)  # at its end Python would look through all objects for garbage, for 15 ms
    _escape_unknown_characters()
    words = _join_negative(sys.argv[1:] if arguments is None else arguments)
    try:
        return _run(words)
    except KeyboardInterrupt:
        print("interrupted; nothing half-written is left", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        _discard_output()
        return 0
    except OSError as error:
        if "--debug" in words:
            raise
        _discard_output()
        print(f"error: {error.filename or 'the output'}: {error.strerror or error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except MemoryError:
        if "--debug" in words:
            raise
        print("error: not enough memory; use a coarser mesh or --solver amg", file=sys.stderr)
        return EXIT_BAD_INPUT
    except Exception as error:
        if "--debug" in words:
            raise
        print(
            f"internal error: {type(error).__name__}: {error}\n"
            "This is a defect of kratos-lite; please report it with the output of --debug.",
            file=sys.stderr,
        )
        return EXIT_INTERNAL


def _run(words: Sequence[str]) -> int:
    """Run one command; errors of the user's end in one line."""
    from kratos_lite.errors import KratosLiteError

    parser = build_parser()
    options, rest = parser.parse_known_args(words)
    options.rest = rest
    if rest and options.command != "bench":
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    try:
        from kratos_lite.cli import commands

        code = int(getattr(commands, options.command)(options))
    except KratosLiteError as error:
        if options.debug:
            raise
        # The texts are written for Python; here the same choice is an option.
        print(f"error: {str(error).replace('strict=False', '--lenient')}", file=sys.stderr)
        return EXIT_BAD_INPUT
    if sys.stdout:
        sys.stdout.flush()  # a full disk shows here rather than after the end of the program
    return code


def _escape_unknown_characters() -> None:
    """Let a terminal without ≤ and × show their codes instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _discard_output() -> None:
    """Send what is still to be printed nowhere, so that Python does not fail on it at its end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _join_negative(arguments: Sequence[str]) -> list[str]:
    """Join ``--gravity -9.81,0,0`` and the like to one word, which argparse would take for another option."""
    numeric = ("--gravity", "--center", "--center", "--rotation", "--translation", "--rayleigh", "--march")
    joined: list[str] = []
    for word in arguments:
        if joined and joined[-1] in numeric and word[:1] == "-":
            joined[-1] += "=" + word
        else:
            joined.append(word)
    return joined

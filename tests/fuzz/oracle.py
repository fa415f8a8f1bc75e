"""What must hold for every input: an exit code, one error in words, finite numbers, whole files."""

from __future__ import annotations

import io
import re
import shutil
import signal
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from random import Random

import numpy as np

from kratos_lite.cli import main
from tests.fuzz.seeds import Seed

SECONDS = 20.0
"""Computing time of one command."""
NO_NUMBER = re.compile(r"(?<![\w.\"'/-])[-+]?(nan|inf|infinity)(?![\w.])", re.IGNORECASE)
PLACES = "node element part constraint load ropert support step motion mode tolerance out/ --".split()
ENDINGS = (".mdpa", ".elem", ".vtu", ".vtk", ".msh", ".inp")


class TooLong(BaseException):
    """A command takes more computing time than it may."""


VALUES = (
    "0 1 -1 2.5 1e-3 1e308 nan x z:1 y:1e200:5 x:0 1e-3:5 1e-3:5:2 1:0 1e-9:99999999999 z+:1,2,3 "
    "Top:1 z-:xyz x-:x=1e308 E=1e9,nu=0.3 E=1e9,nu=0.5 Top:E=1,nu=0 0,0,-9.81 1e308,1e308,1e308 1,2 hht:-0.1 "
    "newmark:0.1,0.1 auto amg fixed , : ="
).split(" ")
FLAGS = ("--stiffening", "--lumped", "--ignore-initial-displacement", "--lenient", "--linear", "-v")
OPTIONS = (
    "--material --fix --gravity --traction --pressure --point-load --resultant --rotation "
    "--translation --center --damping --boundaries --time "
    "--restart --integrator --rayleigh --steps --modes --solver --tolerance --json --state"
).split()


def with_options(words: list[str], rng: Random) -> list[str]:
    """Return a command with some options, of which most make no sense."""
    for _ in range(rng.choice((0, 0, 0, 1, 2))):
        option = rng.choice((*FLAGS, *OPTIONS))
        value = f"out/{rng.choice('abc')}.json" if option == "--json" else rng.choice(VALUES)
        words = [*words, option] if option in FLAGS else [*words, f"{option}={value}"]
    return words


def command_of(seed: Seed, rng: Random) -> list[str]:
    """Return a command for an input."""
    words = _command_of(seed, rng)
    return with_options(words, rng) if words[0] in ("solve", "check") else words


def _command_of(seed: Seed, rng: Random) -> list[str]:
    kinds = ["check", "info", "solve", "solve", "solve"] + (["convert"] * 2 if seed.convertible else [])
    kind = rng.choice(kinds)
    if kind in ("check", "info"):
        return [kind, seed.main]
    if kind == "convert":
        return [kind, seed.main, f"out/a{rng.choice(ENDINGS)}"]
    outputs = (
        ("out/a.csv", "out/a.npz", "out/a.pvd") if seed.in_time else ("out/a.vtu", "out/a.json", "out/a.vtk")
    )
    words = [kind, seed.main, *seed.options, "-o", rng.choice(outputs)]
    if words[-1].endswith((".vtu", ".pvd")):
        words += ["--vtu", "ascii"]
    if seed.in_time and rng.random() < 0.5:
        words += ["--state", "out/state.npz"]
    if not seed.in_time and rng.random() < 0.15:
        words = [kind, seed.main, *seed.options, "--modes", str(rng.choice((1, 3, 100)))]
    return words


def findings(words: list[str], files: list[str]) -> list[str]:
    """Run a command in the present folder, which holds the input; return all that must not be."""
    out = Path("out")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    said, told = io.StringIO(), io.StringIO()
    code, why = None, ""
    signal.signal(signal.SIGPROF, _stop)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        with redirect_stdout(told), redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("error")
            code = main(words)
    except SystemExit as end:  # of the parser of options, which says how they are used
        code = end.code
    except TooLong:
        why = f"takes more than {SECONDS:g} s"
    except BaseException as error:
        why = f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    found = [why] if why else [*_of_words(code, told.getvalue(), said.getvalue(), files, words)]
    return found + _of_files(out, code)


def _stop(*_: object) -> None:
    raise TooLong


def _of_words(code: int | None, told: str, said: str, files: list[str], words: list[str]) -> list[str]:
    """Return what is wrong with the exit code and the words of a command."""
    found = []
    if code not in (0, 2) and not (code == 3 and " failed " in told):
        found.append(f"exit code {code}: {said[-300:]}")
    if "Traceback" in said or re.search(r"\w+Warning\b", said):
        found.append(f"says {said[-300:]}")
    refused = ", cannot be solved\n" in told and re.search(r"^error {4}", told, re.MULTILINE)
    if code == 2 and words[0] == "check" and refused and not said:
        return found
    if code == 2 and said.count("error: ") != 1:
        found.append(f"exit code 2 with {said!r}")
    if said.endswith("--help lists what there is\n"):
        return found
    values = tuple(f"{word.partition('=')[2]}:" for word in words)
    is_of_option = said.removeprefix("error: ").startswith(values)
    if code == 2 and not is_of_option and not any(word in said for word in (*files, *PLACES)):
        found.append(f"an error without a place: {said}")
    if "not enough memory" in said:
        found.append(said)
    if code == 0 and "error" in said:
        found.append(f"exit code 0, but says {said!r}")
    if code == 0 and (match := NO_NUMBER.search(told)):
        found.append(f"prints {told[max(0, match.start() - 60) : match.end() + 20]!r}")
    return found


def _of_files(out: Path, code: int | None) -> list[str]:
    """Return what is wrong with the files of a command."""
    found = [f"leaves {path.name}" for path in out.iterdir() if path.name.startswith(".")]
    for path in out.iterdir():
        if code == 2 and path.suffix in (".mdpa", ".elem", ".vtk", ".msh", ".inp", ".json"):
            found.append(f"exit code 2, but writes {path.name}")
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as file:
                arrays = [file[name] for name in file.files]
            if not all(np.isfinite(array).all() for array in arrays if array.dtype.kind in "fc"):
                found.append(f"{path.name} is not finite")
        elif path.suffix != ".msh" and (match := NO_NUMBER.search(path.read_text("latin-1"))):
            found.append(f"{path.name} holds {match.group()}")
    return found

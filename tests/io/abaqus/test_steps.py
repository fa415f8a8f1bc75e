"""Procedures of steps, beside a live ccx and closed forms."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import pi
from pathlib import Path

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.cli import main
from kratos_lite.io.run import prepare
from kratos_lite.typing import Array
from tests.io.abaqus.conftest import CUBE

PRINT = "*NODE PRINT, NSET=ALL\nU\n*END STEP\n"
EXACT = "*CONTROLS, PARAMETERS=FIELD\n1e-9,1e-9\n"
LARGE = "*STEP, NLGEOM\n*STATIC\n"
FINE = "*STEP, NLGEOM\n*STATIC, DIRECT\n"
IN_TIME = "*STEP\n*DYNAMIC, DIRECT\n.01,.1\n"
AMPLITUDES = "*AMPLITUDE, NAME=A\n0,0,.5,2,1,1\n*AMPLITUDE, NAME=T, TIME=TOTAL TIME\n0,0,1,1,2,3\n"
QUICK = "*AMPLITUDE, NAME=A\n0,0,.05,2,.1,1\n"
STRESS = "*INITIAL CONDITIONS, TYPE=STRESS\n" + "".join(f"1,{i},1.,2.,3.,.4,.5,.6\n" for i in range(1, 9))
RUBBER = CUBE.replace("*ELASTIC\n1000, .25", "*HYPERELASTIC, NEO HOOKE\n100., 1e-3")
PLASTIC = CUBE.replace("*DENSITY", "*PLASTIC\n10.,0.\n110.,1.\n*DENSITY")
DAMPED = CUBE.replace("*DENSITY", "*DAMPING, ALPHA=10., BETA=1e-3\n*DENSITY")


def column() -> str:
    """Return the deck of a column of eight times 2 x 2 elements, which has enough modes for ccx."""
    nodes = np.arange(81).reshape(9, 3, 3)  # by z, y, x
    corners = [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)]
    corners += [(1, *rest) for _, *rest in corners]
    cells = np.stack([nodes[z : z + 8, y : y + 2, x : x + 2] for z, y, x in corners], axis=-1).reshape(-1, 8)
    points = [f"{n + 1},{x / 2},{y / 2},{z}" for (z, y, x), n in np.ndenumerate(nodes)]
    elements = [",".join(map(str, [e + 1, *(cell + 1)])) for e, cell in enumerate(cells)]
    rows = ["*NODE, NSET=ALL", *points, "*ELEMENT, TYPE=C3D8, ELSET=EALL", *elements]
    rows += [
        "*NSET, NSET=BOTTOM, GENERATE",
        "1,9",
        "*NSET, NSET=TOP, GENERATE",
        "73,99",
    ]  # 82 … are not there
    return "\n".join([*rows, CUBE[CUBE.index("*MATERIAL") :]])


Read = Callable[..., kl.Case]


def every(case: kl.Case) -> Array:
    """Return the displacements of all steps and states, one below the other."""
    found: list[Array] = []
    for each in (case, *case.then):
        found += [kl.run(each).result.u] if each.time is None else [s.u for s in prepare(each)[1]]
    return np.array(found)


def printed(text: str) -> Array:
    """Return the displacements in a `.dat` file."""
    rows = re.findall(r"^ +\d+ +(\S+) +(\S+) +(\S+)$", text, re.MULTILINE)
    return np.array(rows, dtype=float).reshape(-1, 8, 3)


STEPS: dict[str, tuple[str, str]] = {
    "pressure follows, and increments grow": (
        CUBE, f"{LARGE}.3,1.\n{EXACT}*DLOAD\nEALL,P4,60.\nEALL,P2,20.\n{PRINT}",
    ),
    "steps in turn": (
        CUBE,
        f"{FINE}.3,1.\n{EXACT}*CLOAD\nTOP,1,30.\n{PRINT}"
        f"{FINE}.5,2.\n{EXACT}*CLOAD\nTOP,3,10.\n*BOUNDARY\nBOTTOM,3,3,.2\n{PRINT}",
    ),
    "loads at once": (
        CUBE,
        f"*STEP, NLGEOM, AMPLITUDE=STEP\n*STATIC, DIRECT\n.5,1.\n{EXACT}*CLOAD\nTOP,1,30.\n"
        f"*BOUNDARY\nBOTTOM,3,3,.2\n{PRINT}{FINE}.5,1.\n{EXACT}*CLOAD\nTOP,1,10.\n{PRINT}",
    ),
    "an amplitude ends with its step": (
        CUBE + AMPLITUDES,
        f"{FINE}.25,1.\n{EXACT}*CLOAD, AMPLITUDE=A\nTOP,1,20.\n{PRINT}{FINE}.5,1.\n{EXACT}{PRINT}",
    ),
    "amplitudes of linear steps": (
        CUBE + AMPLITUDES,
        f"*STEP\n*STATIC\n*CLOAD, AMPLITUDE=A\nTOP,1,20.\n*DLOAD, AMPLITUDE=T\nEALL,P2,2.\n{PRINT}"
        f"*STEP\n*STATIC\n.5,.5\n*CLOAD\n5,3,1.\n*BOUNDARY, AMPLITUDE=A\nBOTTOM,3,3,.1\n{PRINT}",
    ),
    "a support with an amplitude": (
        CUBE + AMPLITUDES, f"{FINE}.25,1.\n{EXACT}*BOUNDARY, AMPLITUDE=A\nTOP,1,1,.1\n{PRINT}",
    ),
    "supports with amplitudes in steps in turn": (
        CUBE + AMPLITUDES,
        f"{FINE}.5,1.\n{EXACT}*BOUNDARY\nTOP,1,1,.1\n{PRINT}"
        f"{FINE}.25,1.\n{EXACT}*BOUNDARY, OP=NEW, AMPLITUDE=A\nBOTTOM,1,3\nTOP,1,1,.2\n{PRINT}",
    ),
    "an amplitude after a step without": (
        CUBE + AMPLITUDES,
        f"{FINE}.5,1.\n{EXACT}*CLOAD\nTOP,1,20.\n{PRINT}"
        f"{FINE}.25,1.\n{EXACT}*CLOAD, AMPLITUDE=A\n7,1,30.\n*DLOAD, AMPLITUDE=T\nEALL,P2,5.\n{PRINT}",
    ),
    "rubber turns NLGEOM on": (RUBBER, f"*STEP\n*STATIC\n.5,1.\n{EXACT}*DLOAD\nEALL,P2,-50.\n{PRINT}"),
    "plastic flow and back": (
        PLASTIC,
        f"*STEP\n*STATIC, DIRECT\n.1,1.\n{EXACT}*BOUNDARY\nTOP,3,3,.12\n{PRINT}"
        f"*STEP\n*STATIC, DIRECT\n.1,1.\n{EXACT}*BOUNDARY\nTOP,3,3,.02\n{PRINT}",
    ),
    "initial stress": (CUBE + STRESS, f"*STEP\n*STATIC\n*CLOAD\nTOP,1,1.\n{PRINT}"),
    "initial stress with NLGEOM": (CUBE + STRESS, f"{LARGE}1.,1.\n{EXACT}*CLOAD\nTOP,1,1.\n{PRINT}"),
    "motion": (CUBE + QUICK, f"{IN_TIME}*CLOAD, AMPLITUDE=A\nTOP,1,10.\n{PRINT}"),
    "a load that grows over the step": (
        CUBE, f"{IN_TIME.replace('STEP', 'STEP, AMPLITUDE=RAMP')}*CLOAD\nTOP,1,10.\n{PRINT}",
    ),
    "motion with ALPHA": (
        CUBE + QUICK,
        f"{IN_TIME.replace('DIRECT', 'DIRECT, ALPHA=-.2')}*CLOAD, AMPLITUDE=A\nTOP,1,10.\n{PRINT}",
    ),
    "damping of the material": (DAMPED + QUICK, f"{IN_TIME}*CLOAD, AMPLITUDE=A\nTOP,1,10.\n{PRINT}"),
    "large motion": (
        CUBE + QUICK, f"{IN_TIME.replace('STEP', 'STEP, NLGEOM')}*CLOAD, AMPLITUDE=A\nTOP,1,30.\n{PRINT}",
    ),
    "supports that come and go": (
        CUBE,
        f"{FINE}1.,1.\n{EXACT}*CLOAD\nTOP,1,20.\n{PRINT}"
        f"{FINE}1.,1.\n{EXACT}*BOUNDARY\nTOP,1,1,.1\n{PRINT}"
        f"{FINE}1.,1.\n{EXACT}*BOUNDARY, OP=NEW\nBOTTOM,1,3\n5,2,2,.05\n{PRINT}",
    ),
    "plastic flow at large strains": (
        PLASTIC,
        f"{FINE}.2,1.\n{EXACT}*BOUNDARY\nTOP,3,3,.4\nTOP,1,1,.3\n{PRINT}"
        f"{FINE}.5,1.\n{EXACT}*BOUNDARY\nTOP,3,3,.2\n{PRINT}",
    ),
    "heat with NLGEOM": (
        CUBE.replace("*DENSITY", "*EXPANSION\n1e-6\n*DENSITY")
        + "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL,0.\n",
        f"{FINE}.5,1.\n{EXACT}*TEMPERATURE\nTOP,20.\n*CLOAD\nTOP,1,1.\n{PRINT}",
    ),
    "CENTRIF follows displacements": (
        CUBE, f"{FINE}.5,1.\n{EXACT}*DLOAD\nEALL,CENTRIF,2.,0,.3,-.5,0,1.,0.\n{PRINT}",
    ),
    "motion from a state at rest": (
        CUBE + "*AMPLITUDE, NAME=A\n0,1,.05,0.,.1,0\n",
        f"{FINE}1.,1.\n{EXACT}*CLOAD\nTOP,1,30.\n*EL FILE\nENER\n{PRINT}"
        f"{IN_TIME}{EXACT}*CLOAD, AMPLITUDE=A\nTOP,1,30.\n{PRINT}",
    ),
    "initial velocity": (CUBE + "*INITIAL CONDITIONS, TYPE=VELOCITY\nTOP,1,2.\n", f"{IN_TIME}{PRINT}"),
}  # fmt: skip


@pytest.mark.parametrize(("model", "steps"), STEPS.values(), ids=STEPS)
def test_states_are_those_of_ccx(model: str, steps: str, read: Read, ccx: Callable[..., str]) -> None:
    ours, theirs = every(read(steps, model)), printed(ccx(steps, model))
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max() < 2e-5 * np.abs(theirs).max()


def values_of(text: str) -> Array:
    """Return eigenvalues, or factors of buckling, in a `.dat` file."""
    rows = re.findall(r"^ +\d+ +(\S+)(?: +\S+ +\S+ +\S+)?$", text, re.MULTILINE)
    return np.array(rows, dtype=float)


MODES = {  # steps, of which the last has modes; how near ccx is: its preload changes the geometry, too
    "frequencies": ("*STEP\n*FREQUENCY\n4\n*END STEP\n", 1e-6),
    "of a body under tension": (
        "*STEP\n*STATIC\n*CLOAD\nTOP,3,.05\n*END STEP\n"
        "*STEP, PERTURBATION\n*FREQUENCY\n4\n*END STEP\n", 0.005,
    ),
    "about a nonlinear state, with loads that follow": (
        f"{FINE}1.,1.\n{EXACT}*DLOAD\nEALL,P4,.5\nEALL,CENTRIF,.02,0,0,0,1.,0,0\n*END STEP\n"
        "*STEP, PERTURBATION\n*FREQUENCY\n4\n*END STEP\n", 2e-5,
    ),
    "buckling by loads of the step alone": (
        "*STEP\n*STATIC\n*CLOAD\n80,1,.01\n*END STEP\n"
        "*STEP\n*BUCKLE\n4,1e-3\n*CLOAD\nTOP,3,-.01\n*END STEP\n", 1e-6,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("steps", "tolerance"), MODES.values(), ids=MODES)
def test_modes_are_those_of_ccx(steps: str, tolerance: float, read: Read, ccx: Callable[..., str]) -> None:
    case, theirs = read(steps, column()), values_of(ccx(steps, column()))
    last = case.then[-1] if case.then else case
    values = kl.run(last).modes[0]
    ours = values if last.buckling else values**2
    assert np.abs(ours / theirs[: len(ours)] - 1).max() < tolerance
    if last.preload:  # the tension is not little
        assert last.model.modes(1)[0][0] ** 2 < 0.95 * theirs[0]


# A cube whose top moves along z alone: its stiffness EA/L, and a third of its mass.
ONE = CUBE.replace("1000, .25", "1000., 0.").replace("Bottom,1,3", "BOTTOM,1,3\nTOP,1,2")
K, M = 1000.0, 2.0 / 3
OMEGA = (K / M) ** 0.5
MODES_STEP = "*STEP\n*FREQUENCY, STORAGE=YES\n4\n*END STEP\n"


@pytest.mark.parametrize("damping", ["RAYLEIGH\n,,2.,1e-3", "\n1,4,.05"])
def test_harmonic_response_of_one_mass(damping: str, read: Read, tmp_path: Path) -> None:
    text = f"{MODES_STEP}*STEP\n*STEADY STATE DYNAMICS\n2.,10.,5,2.\n*MODAL DAMPING, {damping}\n"
    text = text.replace(", \n", "\n")
    case = read(text + "*CLOAD\nTOP,3,3.\n*CLOAD, LOAD CASE=2\nTOP,3,4.\n*END STEP\n", ONE).then[0]
    case.outputs.results = [str(tmp_path / "out.csv")]
    outcome = kl.run(case)
    table = np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)
    omega, node = table[:, 0], table[:, 1]
    c = 2.0 * M + 1e-3 * K if "RAYLEIGH" in damping else 2 * 0.05 * OMEGA * M
    u = 4 * (3 + 4j) / (K - M * omega**2 + 1j * omega * c)
    top = node == 7
    assert np.abs(table[top, 6] * np.exp(1j * table[top, 7]) - u[top]).max() < 1e-9 * np.abs(u).max()
    assert len(outcome.lines) == 1 + 9  # 5 up to the natural frequency, and 5 from there
    hertz = omega[top] / (2 * pi)
    middle, half = (2 + OMEGA / (2 * pi)) / 2, (OMEGA / (2 * pi) - 2) / 2
    assert np.abs(hertz[:5] - middle - half * np.array([-1, -(0.5**0.5), 0, 0.5**0.5, 1])).max() < 1e-9
    assert np.abs(hertz[[0, -1]] - [2.0, 10.0]).max() < 1e-9


@pytest.mark.parametrize("alpha", [0.0, 8.0])
def test_a_sudden_load_in_modal_dynamics(alpha: float, read: Read) -> None:
    damping = f"*MODAL DAMPING, RAYLEIGH\n,,{alpha},0.\n" if alpha else ""
    steps = f"{MODES_STEP}*STEP\n*MODAL DYNAMIC\n.01,.2\n{damping}*CLOAD\nTOP,3,1.\n*END STEP\n"
    case = read(steps, ONE).then[0]
    states = list(prepare(case)[1])
    t, d = np.array([s.time for s in states]), alpha / 2
    w = (OMEGA**2 - d**2) ** 0.5
    exact = 4 / K * (1 - np.exp(-d * t) * (np.cos(w * t) + d / w * np.sin(w * t)))
    assert len(t) == 20
    assert np.abs(np.array([s.u[6, 2] for s in states]) - exact).max() < 2e-3 * exact.max()


def test_a_deck_without_steps_is_a_model(read: Read) -> None:
    case = read("", CUBE.replace("Bottom,1,3", "Bottom,1,3\nTOP,3,3,.1"))
    assert (case.analysis, case.then) == ("static", [])
    u = kl.run(case).result.u
    assert np.abs(u[4:, 2] - 0.1).max() < 1e-12
    assert np.abs(u[:4]).max() == 0


def test_a_preload_without_loads_leaves_the_frequencies(read: Read) -> None:
    ask = "*FREQUENCY\n3\n*END STEP\n"
    after_rest = read(f"*STEP\n*STATIC\n*END STEP\n*STEP, PERTURBATION\n{ask}").then[0]
    found, expected = (kl.run(case).modes for case in (after_rest, read(f"*STEP\n{ask}")))
    assert found is not None
    assert expected is not None
    assert np.abs(found[0] - expected[0]).max() == 0


KINEMATIC = PLASTIC.replace("*PLASTIC", "*PLASTIC, HARDENING=KINEMATIC")
REDUCED = CUBE.replace("C3D8,", "C3D8I,")
NEXT = "*STEP\n*STATIC\n*CLOAD\nTOP,3,1.\n*END STEP\n"
HOT = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nTOP,20.\n" + AMPLITUDES + IN_TIME
WRONG = {
    f"{HOT}*TEMPERATURE, AMPLITUDE=A\nTOP,50.\n*END STEP\n": "amplitudes of temperatures need initial",
    "*STEP, PERTURBATION\n*STATIC\n*END STEP\n": "PERTURBATION is supported with *FREQUENCY; got *STATIC",
    "*STEP\n*CLOAD\nTOP,1,1.\n*STATIC\n*END STEP\n": "it belongs after the procedure of the step",
    "*STEP\n*DYNAMIC, EXPLICIT\n1.,1.\n*END STEP\n": "option EXPLICIT is not supported",
    "*STEP\n*MODAL DYNAMIC\n1.,1.\n*END STEP\n": "needs a step with *FREQUENCY before it",
    "*STEP\n*STATIC\n*CLOAD, LOAD CASE=2\nTOP,1,1.\n*END STEP\n": "LOAD CASE=2 belongs to *STEADY STATE",
    f"{IN_TIME}*END STEP\n{LARGE}*END STEP\n": "to go on from the state of another kind of step",
    f"{IN_TIME}*END STEP\n{IN_TIME}*BOUNDARY\nTOP,1,1\n*END STEP\n": "supports that change between",
    f"{NEXT}{IN_TIME.replace('STEP', 'STEP, AMPLITUDE=RAMP')}*END STEP\n": "AMPLITUDE=RAMP after a static",
    f"{NEXT}*STEP, PERTURBATION\n*FREQUENCY\n3\n*BOUNDARY\nTOP,1,1\n*END STEP\n": "with other supports than",
    f"{MODES_STEP}*STEP\n*MODAL DYNAMIC\n.1,.1\n*MODAL DAMPING\n1,4,.1\n*END STEP\n": "RAYLEIGH with α and β",
    f"{MODES_STEP}*STEP\n*STEADY STATE DYNAMICS, HARMONIC=NO\n1.,2.\n*END STEP\n": "HARMONIC=NO is not",
    f"{MODES_STEP}*STEP\n*STEADY STATE DYNAMICS\n1.,2.\n*BOUNDARY\nTOP,3,3,1.\n*END STEP\n": "supports that",
    "*INITIAL CONDITIONS, TYPE=STRESS\n1,1,1.,0,0,0,0,0\n1,2,2.,0,0,0,0,0\n"
    + NEXT: "between the points of an",
    "*INITIAL CONDITIONS, TYPE=VELOCITY\nTOP,4,1.\n" + NEXT: "directions are 1, 2 and 3; got 4",
    "*INITIAL CONDITIONS, TYPE=PLASTIC STRAIN\n1,1,0\n" + NEXT: "TYPE=PLASTIC STRAIN is not supported",
}


@pytest.mark.parametrize("text", WRONG)
def test_steps_that_are_not_supported_say_so(text: str, read: Read) -> None:
    with pytest.raises(kl.InputError, match=re.escape(WRONG[text])):
        read(text)


@pytest.mark.parametrize(
    ("cube", "why"),
    [
        (REDUCED, "NLGEOM with C3D8I"),
        (KINEMATIC, "kinematic hardening with"),
    ],
)
def test_models_of_large_displacements_that_are_not_supported(cube: str, why: str, read: Read) -> None:
    with pytest.raises(kl.InputError, match=why):
        read(f"{LARGE}*END STEP\n", cube)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"harmonic": {}, "modes": 3}, "goes with no modes"),
        ({"preload": True}, "a preload is that of natural frequencies"),
    ],
)
def test_analyses_that_exclude_each_other(change: dict[str, object], why: str, read: Read) -> None:
    case = read(NEXT)
    for name, value in change.items():
        setattr(case, name, value)
    with pytest.raises(kl.InputError, match=why):
        kl.run(case)


def test_a_harmonic_response_is_written_as_a_table_alone(read: Read, tmp_path: Path) -> None:
    case = read(NEXT)
    case.harmonic, case.outputs.json = {"frequencies": [1.0]}, str(tmp_path / "out.json")
    with pytest.raises(kl.InputError, match=r"written as \.csv alone"):
        kl.run(case)


def test_the_command_line_writes_a_file_for_each_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    sweep = "*STEP\n*STEADY STATE DYNAMICS\n2.,10.,3\n*MODAL DAMPING\n1,4,.1\n*CLOAD\nTOP,3,3.\n*END STEP\n"
    Path("job.inp").write_text(ONE + MODES_STEP + sweep)
    assert main(["solve", "job.inp", "-o", "out.vtu", "-q"]) == 0
    assert Path("out-1.pvd").is_file()
    assert len(Path("out-2.csv").read_text().splitlines()) == 1 + 8 * 5

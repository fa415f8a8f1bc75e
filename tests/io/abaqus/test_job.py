"""What the stand-in of ccx writes beside a live ccx, by closed forms, and its exit codes."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calculix_files import blocks

from kratos_lite.cli.ccx import main
from tests.io.abaqus.conftest import CUBE

OUTPUT = "*NODE FILE\nU\n*NODE PRINT, NSET=TOP\nU\n*END STEP\n"
IN_TURN = (
    f"*STEP,NLGEOM\n*STATIC,DIRECT\n.5,1.\n*CLOAD\nTOP,3,1.\n{OUTPUT}"
    f"*STEP,NLGEOM\n*STATIC,DIRECT\n1.,2.\n*CLOAD\nTOP,3,2.\n{OUTPUT}"
)
AND_MODES = f"*STEP\n*STATIC\n.5,2.\n*CLOAD\nTOP,3,1.\n{OUTPUT}*STEP\n*FREQUENCY\n2\n{OUTPUT}"
# step, increment, total time, time of the step, increment of time
STATUS = {
    IN_TURN: [(1, 1, 0.5, 0.5, 0.5), (1, 2, 1, 1, 0.5), (2, 1, 2, 1, 1), (2, 2, 3, 2, 1)],
    AND_MODES: [(1, 1, 2, 2, 2)],
}
SHEAR = np.array([[1.0, 0.2, 0.0], [0.1, 1.0, 0.0], [0.2, 0.1, 1.1]])
SHEARED = re.sub(
    r"(?m)^(\d),([01]),([01]),([01])$",
    lambda found: "{},{:g},{:g},{:g}".format(found[1], *np.array(found.groups()[1:], float) @ SHEAR),
    CUBE,
)
"""Without equal frequencies; its mass is exact in CalculiX."""
EVERYTHING = (
    "*NODE FILE\nU,RF\n*EL FILE\nS,E,ENER\n*NODE PRINT,NSET=ALL,TOTALS=YES\nU,RF\n"
    "*EL PRINT,ELSET=EALL\nS,E,ENER\n*END STEP\n"
)
PULLED = "*CLOAD\nTOP,3,1.\nTOP,1,.3\n"
INCREMENTS = f"*STEP,NLGEOM\n*STATIC,DIRECT\n.25,1.\n{PULLED}"
SPRINGS = "*ELEMENT,TYPE=SPRING1,ELSET=SP\n9,7\n*SPRING,ELSET=SP\n1\n200.\n"
AXES = "*ORIENTATION,NAME=TILTED{}\n*TRANSFORM,NSET=TOP\n1.,1.,0.,-1.,1.,0.\n"
TILTED = CUBE.replace("MATERIAL=STEEL\n", "MATERIAL=STEEL,ORIENTATION=TILTED\n")
LOCAL = (
    f"*STEP\n*STATIC\n{PULLED}*EL PRINT,ELSET=EALL,TOTALS=YES\nS,E,ENER,COORD,EVOL\n"
    "*NODE PRINT,NSET=TOP,TOTALS=YES\nU,RF\n*END STEP\n"
)
RIGID = (
    "*NODE,NSET=REF\n11,.5,.5,1.\n*NODE,NSET=ROT\n12,.5,.5,1.\n*RIGID BODY,NSET=TOP,REF NODE=11,ROT NODE=12\n"
)
OF_REF = "*NODE FILE\nU,RF\n*NODE PRINT,NSET=REF,TOTALS=YES\nU,RF\n*NODE PRINT,NSET=ROT\nU,RF\n*END STEP\n"
BESIDE = {
    "modes": (SHEARED, f"*STEP\n*FREQUENCY\n2\n{EVERYTHING}"),
    "springs": (SHEARED, f"{SPRINGS}*STEP\n*STATIC\n{PULLED}{EVERYTHING}"),
    "modes with springs": (SHEARED, f"{SPRINGS}*STEP\n*FREQUENCY\n2\n*NODE PRINT,NSET=ALL\nRF\n*END STEP\n"),
    "buckling": (SHEARED, f"*STEP\n*BUCKLE\n2\n*CLOAD\nTOP,3,-1.\nTOP,1,-.3\n{EVERYTHING}"),
    "sets": (CUBE, f"*NSET,NSET=ENDS\n5,8\n*STEP\n*STATIC\n{PULLED}*NODE FILE,NSET=ENDS\nU\n"
             "*NODE FILE,NSET=BOTTOM\nRF\n*EL FILE\nS\n*END STEP\n"
             "*STEP\n*STATIC\n*NODE FILE,FREQUENCY=0\nU\n*EL FILE,NSET=ENDS\nE\n*END STEP\n"),
    "empty sets": (CUBE, f"*NSET,NSET=NO\n*ELSET,ELSET=NO\n*STEP\n*STATIC\n{PULLED}*NODE FILE,NSET=NO\nU,NT\n"
                   "*EL FILE,POSITION=AVERAGED AT NODES\nS\n*NODE PRINT,NSET=NO\nU\n"
                   "*EL PRINT,ELSET=NO,TOTALS=YES\nS,EVOL\n*END STEP\n"),
    "some increments": (CUBE, f"{INCREMENTS}*NODE FILE,FREQUENCY=3\nU\n*NODE PRINT,NSET=TOP\nU\n*END STEP\n"
                        f"{INCREMENTS}*EL FILE\nS\n*END STEP\n"),
    "*OUTPUT": (CUBE, f"{INCREMENTS}*OUTPUT,FREQUENCY=2\n*NODE FILE\nU\n*END STEP\n"),
    "words of other cards": (CUBE, f"*STEP\n*STATIC\n{PULLED}*NODE PRINT,NSET=TOP\nS,U\n*END STEP\n"),
    "nothing": (CUBE, f"*STEP\n*STATIC\n{PULLED}*END STEP\n"),
    "rectangular": (TILTED, AXES.format("\n1.,2.,0.,-1.,1.,.5") + LOCAL),
    "cylindrical": (TILTED, AXES.format(",SYSTEM=CYLINDRICAL\n-1.,.3,0.,-1.,.3,1.") + LOCAL),
    "global": (TILTED, AXES.format("\n1.,2.,0.,-1.,1.,.5") + LOCAL.replace("TOTALS", "GLOBAL")),
    "rigid": (CUBE + RIGID, f"*STEP\n*STATIC\n*CLOAD\nREF,1,100.\n12,3,7.\n5,1,11.\n{OF_REF}"),
    "rigid, moved": (CUBE + RIGID, f"*STEP\n*STATIC\n*BOUNDARY\n11,1,1,.01\n11,2,3\n12,3,3,.001\n{OF_REF}"),
    "forces in time": (CUBE, "*STEP\n*DYNAMIC,DIRECT,ALPHA=0.\n.001,.003\n*CLOAD\nTOP,1,1.\n"
                       "*NODE FILE\nU,V,RF\n*NODE PRINT,NSET=ALL\nU,V\n*END STEP\n"),
}  # fmt: skip
"""Decks, and their steps."""
NUMBER = re.compile(r"-?\d\.\d+E[+-]\d\d")


def solved(folder: Path, text: str) -> Path:
    """Run a deck in the stand-in; return the path of its job."""
    job = folder / "job"
    job.with_suffix(".inp").write_text(text)
    assert main(["-i ", str(job)]) == 0
    return job


def apart(line: str) -> tuple[str, Any]:
    """Return a line without its numbers, and these; those of modes may have the other sign."""
    return NUMBER.sub("#", line).replace(" ", ""), np.abs([float(text) for text in NUMBER.findall(line)])


@pytest.mark.parametrize("name", BESIDE)
@pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx is not installed")
def test_files_are_those_of_ccx(name: str, tmp_path: Path) -> None:
    job = solved(tmp_path, "".join(BESIDE[name]))
    ours, tables = (job.with_suffix(ending).read_text() for ending in (".frd", ".dat"))
    subprocess.run(["ccx", "job"], cwd=tmp_path, capture_output=True, check=True, timeout=60)
    theirs = blocks(job.with_suffix(".frd").read_text())
    assert [block[1:4] for block in blocks(ours)] == [block[1:4] for block in theirs]
    for (head, field, *_, values), (other, *_, expected) in zip(blocks(ours), theirs, strict=True):
        assert (head[:12], head[24:]) == (other[:12], other[24:])
        assert abs(float(head[12:24]) - float(other[12:24])) <= 1e-8 * float(other[12:24])
        least = 2e-5 if field == "ERROR" or "time" in name else 2e-6  # in time ccx iterates
        off = min(np.abs(values - sign * expected).max(initial=0.0) for sign in (1, -1))
        assert off <= least * np.abs(expected).max(initial=0.0), (field, head)
    lines, size = job.with_suffix(".dat").read_text().splitlines(), 0.0
    assert len(tables.splitlines()) == len(lines)
    for line, other in zip(tables.splitlines(), lines, strict=True):
        (words, numbers), (text, expected) = apart(line), apart(other)
        assert words == text
        size = max(size, expected.max(initial=0.0)) if len(expected) else 0.0  # of a table so far
        assert np.abs(numbers - expected).max(initial=0.0) <= 4e-6 * size + 1e-12, other


def fields_of(job: Path) -> dict[tuple[int, str], Any]:
    """Return fields of a file by the number of their step or mode and their name."""
    return {(int(head[58:63]), name): v for head, name, *_, v in blocks(job.with_suffix(".frd").read_text())}


@pytest.mark.parametrize(("kind", "first"), [("FREQUENCY", 1), ("BUCKLE", 2)])
def test_modes_have_the_forces_that_their_stresses_make(kind: str, first: int, tmp_path: Path) -> None:
    """φ M φ = 1, so that φ K φ is ω²; shapes of buckling, which follow the state at rest, have φ K φ = 1."""
    load = "*CLOAD\nTOP,3,-1.\n" if kind == "BUCKLE" else ""
    job = solved(tmp_path, f"{SHEARED}{SPRINGS}*STEP\n*{kind}\n2\n{load}{EVERYTHING}")
    found, table = fields_of(job), job.with_suffix(".dat").read_text()
    values = [float(line.split()[1]) for line in re.findall(r"(?m)^ +\d +0\.\d+E.*", table)]
    for i in (0, 1):
        work = (found[first + i, "FORC"] * found[first + i, "DISP"]).sum()
        assert abs(work / (1.0 if kind == "BUCKLE" else values[i]) - 1) < 1e-5
        assert np.abs(found[first + i, "STRESS"]).max() > 0
    if kind == "BUCKLE":
        assert abs(found[1, "FORC"][4:, 2].sum() + 4) < 1e-5
    assert table.count("E I G E N V A L U E    N U M B E R") == 2


def test_rotated_tables_have_the_stress_along_the_axes_of_their_elements(tmp_path: Path) -> None:
    """Uniform tension σ along z, of an element whose x' is at 30° to z: σ cos², σ sin² and -σ sin cos."""
    c, s = 0.75**0.5, 0.5
    axes = f"*ORIENTATION,NAME=TILTED\n{s},0.,{c},{c},0.,{-s}\n*TRANSFORM,NSET=TOP\n{s},0.,{c},{c},0.,{-s}\n"
    deck = TILTED.replace("1000, .25", "1000, 0.")
    asked = "*EL PRINT,ELSET=EALL\nS\n*NODE PRINT,NSET=TOP\nU\n*END STEP\n"
    job = solved(tmp_path, f"{deck}{axes}*STEP\n*STATIC\n*DLOAD\nEALL,P2,-8.\n{asked}")
    lines = job.with_suffix(".dat").read_text().splitlines()
    rows = [line for line in lines if line.endswith(f" {'TILTED':20}")]
    assert len(rows) == 8
    for row in rows:
        found = np.array([float(word) for word in row.split()[2:8]])
        assert np.abs(found - [8 * c * c, 8 * s * s, 0, -8 * s * c, 0, 0]).max() < 1e-6
    moved = [line for line in lines if line.endswith(" L")]
    for row in moved:
        assert np.abs(np.array(row.split()[1:4], float) - [0.008 * c, -0.008 * s, 0]).max() < 1e-8
    assert len(moved) == 4


@pytest.mark.parametrize("kind", ["*STATIC\n", "*DYNAMIC,DIRECT\n.001,.002\n"])
def test_reference_nodes_have_displacements_and_forces(kind: str, tmp_path: Path) -> None:
    """That node moves by what is prescribed at any time, and the force on it is that of its rigid body."""
    held = "*AMPLITUDE,NAME=A\n0.,0.,1.,1.\n"
    step = f"*STEP\n{kind}*BOUNDARY{',AMPLITUDE=A' if 'DYN' in kind else ''}\n11,3,3,.01\n11,1,2\n12,1,3\n"
    job = solved(tmp_path, f"{CUBE}{RIGID}{held}{step}{OF_REF}")
    text = job.with_suffix(".dat").read_text()
    moved = [float(line.split()[3]) for line in re.findall(r"(?m)^ +11 .*", text)]
    time = np.array([0.001, 0.002] if "DYN" in kind else [1.0])
    assert np.abs(np.array(moved[::2]) - 0.01 * time).max() < 1e-9
    total = [values[4:, 2].sum() for (_, name), values in fields_of(job).items() if name == "FORC"]
    assert np.abs(np.array(moved[1::2]) / total - 1).max() < 1e-5


REFUSED = {
    "*NODE FILE,GLOBAL=NO\nU\n": "GLOBAL=NO is not supported",
    "*EL FILE,POSITION=CENTROIDAL\nS\n": "POSITION=CENTROIDAL is not supported",
    "*NODE PRINT,NSET=TOP,TIME POINTS=T\nU\n": "option TIMEPOINTS is not supported",
    "*NODE FILE,NSET=NONE\nU\n": "NONE",
    "*NODE FILE,FREQUENCY=often\nU\n": "often",
}


@pytest.mark.parametrize("cards", REFUSED)
def test_what_cards_of_output_ask_for_in_vain_is_refused_by_name(cards: str, tmp_path: Path, capsys) -> None:
    (tmp_path / "job.inp").write_text(f"{CUBE}*STEP\n*STATIC\n{cards}*END STEP\n")
    assert main(["-i", str(tmp_path / "job")]) == 201
    told = capsys.readouterr()[0]
    assert REFUSED[cards] in told
    assert "job.inp:" in told


@pytest.mark.parametrize("text", STATUS, ids=["nonlinear", "modes"])
def test_steps_increments_and_times_are_those_of_ccx(text: str, tmp_path: Path) -> None:
    job = solved(tmp_path, CUBE + text)

    def heads() -> list[str]:
        return re.findall(r"(?m)^ +1PSTEP.*|^ +100CL.*", job.with_suffix(".frd").read_text())

    told = job.with_suffix(".sta").read_text().splitlines()
    rows = [line.split() for line in told[2:]]
    assert [tuple(map(float, (*row[:2], *row[4:]))) for row in rows] == STATUS[text]
    ours = heads()
    assert [int(line.split()[3]) for line in ours[::2]] == ([1, 1, 2, 2] if text == IN_TURN else [1, 2, 2])
    if shutil.which("ccx"):
        subprocess.run(["ccx", "job"], cwd=tmp_path, capture_output=True, check=True, timeout=60)
        assert [line[:36] + line[48:] for line in ours] == [line[:36] + line[48:] for line in heads()]
        others = job.with_suffix(".sta").read_text().splitlines()
        # all but the number of iterations
        assert [line[:23] + line[29:] for line in told] == [line[:23] + line[29:] for line in others]


PULL = "*STEP\n*STATIC\n*CLOAD\nTOP,1,1.\n*EL FILE\nS,ENER\n*END STEP\n"
LINES = CUBE.count("\n")
TROUBLE = {
    "in no section": (CUBE.replace("*MATERIAL", "*ELSET,ELSET=NO\n*MATERIAL").replace("=EALL, M", "=NO, M"),
                      "job.inp:13: element 1 is in no *SOLID SECTION"),
    "free": (CUBE.replace("Bottom,1,3", "Bottom,1,2"), f"job.inp:{LINES + 1}: *STEP: the supports leave"),
    "contradiction": (CUBE + "*EQUATION\n2\n5,1,1.,6,1,-1.\n*BOUNDARY\n5,1,1,.1\n6,1,1,.2\n",
                      f"job.inp:{LINES + 7}: *STEP: what is prescribed contradicts itself"),
    "overflow": (CUBE.replace("1000, .25", "1e-290, .25"), "numbers exceed what a computer holds"),
}  # fmt: skip
"""Models that are wrong, and the words of their errors."""


@pytest.mark.parametrize("name", TROUBLE)
def test_errors_of_models_name_a_line_and_leave_the_other_stream_alone(name, tmp_path, capfd) -> None:
    (tmp_path / "job.inp").write_text(TROUBLE[name][0] + PULL)
    assert main(["-i", str(tmp_path / "job")]) == 201
    told, said = capfd.readouterr()
    assert TROUBLE[name][1] in told
    assert not said


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("*STEP\n*STATIC\n*CLOAD\n99,1,1.\n*END STEP\n", "there is no node 99"),
        ("", "job.inp: there is no *STEP"),
    ],
)
def test_an_error_is_one_line_with_the_exit_code_of_ccx_and_leaves_no_file(text, words, tmp_path, capsys):
    (tmp_path / "job.inp").write_text(CUBE + text)
    assert main(["-i", str(tmp_path / "job")]) == 201
    told, said = capsys.readouterr()
    assert "*ERROR: " in told
    assert words in told
    assert not said
    assert [path.name for path in tmp_path.iterdir()] == ["job.inp"]

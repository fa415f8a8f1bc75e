"""Tables of a deck that is run in place of ccx, line by line, and what is said of its cards."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from kratos_lite.cli.ccx import ERROR, main
from kratos_lite.io.abaqus.job import Job
from tests.io.abaqus.conftest import CUBE

SETS = "*NSET, NSET=MIXED\n8,1,6,1\n*ELSET, ELSET=TWICE\n1,1\n"
AXES = "*TRANSFORM, NSET=TOP, TYPE=C\n0.,-1.,0.,0.,-1.,1.\n"
LOADED = "*STEP\n*STATIC\n*CLOAD\nTOP,1,3.\n7,3,2.\n"
TABLES = {
    "in the order of cards and sets": SETS
    + LOADED
    + "*EL PRINT, ELSET=TWICE, TOTALS=YES\nS, EVOL\n*NODE PRINT, NSET=MIXED, TOTALS=YES\nU, RF\n*END STEP\n",
    "temperatures": "*MATERIAL, NAME=M\n*ELASTIC\n1e3,.25\n*EXPANSION\n1e-5\n"
    "*SOLID SECTION, ELSET=EALL, MATERIAL=M\n*AMPLITUDE, NAME=A\n0.,0.,1.,.5\n"
    "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL,20.\n"
    "*STEP\n*STATIC\n*TEMPERATURE, AMPLITUDE=A\nTOP,100.\n*NODE PRINT, NSET=ALL\nU, NT\n*END STEP\n",
    "along local axes": SETS
    + AXES
    + LOADED
    + "*NODE PRINT, NSET=MIXED, TOTALS=YES\nU, RF\n*NODE PRINT, NSET=ALL, GLOBAL=YES\nU\n*END STEP\n",
}


def lines(dat: str) -> list[tuple[str, np.ndarray]]:
    """Return the words and the numbers of each line."""
    number = re.compile(r"-?\d\.\d+E[+-]\d+")
    found = [line for line in dat.splitlines() if line.strip()]
    return [(number.sub("", line).strip(), np.array(number.findall(line), dtype=float)) for line in found]


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_tables_are_those_of_ccx(text: str, ccx: Callable[[str], str], tmp_path: Path) -> None:
    (tmp_path / "job.inp").write_text(CUBE + text)
    Job(tmp_path / "job.inp", print).run()
    ours, theirs = lines((tmp_path / "job.dat").read_text()), lines(ccx(text))
    assert [words.split() for words, _ in ours] == [words.split() for words, _ in theirs]
    assert all(np.allclose(a, b, rtol=2e-6, atol=1e-10) for (_, a), (_, b) in zip(ours, theirs, strict=True))


def test_words_that_are_not_written_are_named(tmp_path: Path) -> None:
    told: list[str] = []
    modes = "*STEP\n*FREQUENCY\n3\n*EL FILE\nS\n*END STEP\n"
    axes = "*ORIENTATION, NAME=O\n1.,1.,0.,-1.,1.,0.\n"
    cube = CUBE.replace("MATERIAL=STEEL", "MATERIAL=STEEL, ORIENTATION=O").replace(
        "*MATERIAL", f"{axes}*MATERIAL"
    )
    words = "*EL PRINT, ELSET=EALL\nS\n*NODE FILE, GLOBAL=NO\nU\n*EL FILE\nS, HFL\n"
    words += "*NODE PRINT, NSET=ALL\nQQ\n*END STEP\n"
    (tmp_path / "job.inp").write_text(cube + LOADED + words + modes)
    Job(tmp_path / "job.inp", told.append).run()
    assert any("*NODEFILE: GLOBAL=NO is ignored" in line for line in told)
    assert any("*ELFILE: not written: HFL" in line for line in told)
    assert any("*NODEPRINT: not written: QQ" in line for line in told)
    assert any("*ELPRINT: tables have global axes" in line for line in told)
    assert "step 2: not written of modes: STRESS" in told


@pytest.mark.parametrize(
    "card", ["*SECTION PRINT, SURFACE=A, NAME=B\nSOF\n", "*EL PRINT, ELSET=A\nS\n", "*NODE PRINT\nU\n"]
)
def test_what_is_printed_of_nothing_is_refused(
    card: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "job.inp").write_text(CUBE + LOADED + card + "*END STEP\n")
    assert main(["-i", str(tmp_path / "job")]) == ERROR
    out, err = capsys.readouterr()
    assert "job.inp:34: *" in out
    assert not err
    assert [path.name for path in tmp_path.iterdir()] == ["job.inp"]

"""What the stand-in of ccx writes: steps, increments and times, and its exit codes."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("text", STATUS, ids=["nonlinear", "modes"])
def test_steps_increments_and_times_are_those_of_ccx(text: str, tmp_path: Path) -> None:
    job = tmp_path / "job"
    job.with_suffix(".inp").write_text(CUBE + text)

    def heads() -> list[str]:
        return re.findall(r"(?m)^ +1PSTEP.*|^ +100CL.*", job.with_suffix(".frd").read_text())

    assert main(["-i ", str(job)]) == 0
    rows = [line.split() for line in job.with_suffix(".sta").read_text().splitlines()[2:]]
    assert [tuple(map(float, (*row[:2], *row[4:]))) for row in rows] == STATUS[text]
    ours = heads()
    assert [int(line.split()[3]) for line in ours[::2]] == ([1, 1, 2, 2] if text == IN_TURN else [1, 2, 2])
    if shutil.which("ccx"):
        subprocess.run(["ccx", "job"], cwd=tmp_path, capture_output=True, check=True, timeout=60)
        assert [line[:36] + line[48:] for line in ours] == [line[:36] + line[48:] for line in heads()]


def test_an_error_is_one_line_with_the_exit_code_of_ccx_and_leaves_no_file(tmp_path: Path, capsys) -> None:
    (tmp_path / "job.inp").write_text(CUBE + "*STEP\n*STATIC\n*CLOAD\n99,1,1.\n*END STEP\n")
    assert main(["-i", str(tmp_path / "job")]) == 201
    told, said = capsys.readouterr()
    assert "*ERROR: " in told
    assert "there is no node 99" in told
    assert not said
    assert [path.name for path in tmp_path.iterdir()] == ["job.inp"]

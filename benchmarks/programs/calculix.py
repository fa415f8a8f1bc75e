"""CalculiX: an input deck for ccx, one process, displacements from its `.dat` file (7 digits)."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from benchmarks.programs.common import Array, Job

ELEMENTS = {"4N": "C3D4", "6N": "C3D6", "8N": "C3D8", "10N": "C3D10", "15N": "C3D15", "20N": "C3D20"}
ELEMENTS["20N reduced"] = "C3D20R"
DIRECT_LIMIT = 30_000
"""Unknowns up to which SPOOLES is faster than its conjugate gradients with incomplete Cholesky."""


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        program = shutil.which("ccx")
    if program is None:
        raise ModuleNotFoundError("the program ccx is not there")
    job.answer["version"] = version(program)
    if job.task != "solve":
        raise ModuleNotFoundError("ccx does not tell its phases apart")
    job.read()
    stem = Path(job.given["folder"]) / "calculix"
    with job.phase("input"):
        deck(job, stem.with_suffix(".inp"))
    with job.phase("solve"):
        subprocess.run([program, stem.name], cwd=stem.parent, check=True, stdout=subprocess.DEVNULL,
                       env=os.environ | {"OMP_NUM_THREADS": str(os.cpu_count() or 1)})  # fmt: skip
    with job.phase("output"):
        return displacements(job, stem.with_suffix(".dat"))


def version(program: str) -> str:
    """Return the version that ccx tells."""
    told = subprocess.run([program, "-v"], capture_output=True, text=True, check=False).stdout
    return told.split()[-1] if told.split() else ""


def deck(job: Job, path: Path) -> None:
    """Write the input deck; ccx reads 20 characters of a number, which is 13 digits."""
    E, nu = job.elasticity.tolist()
    numbers = np.arange(1, len(job.points) + 1)
    free = int((~job.fixed).sum())
    solver = "SPOOLES" if free <= DIRECT_LIMIT else "ITERATIVE CHOLESKY"
    with path.open("w") as out:
        out.write("*NODE, NSET=ALL\n")
        np.savetxt(out, np.column_stack([numbers, job.points]), "%d,%.12E,%.12E,%.12E")
        out.write(f"*ELEMENT, TYPE={ELEMENTS[job.kind]}, ELSET=EALL\n")
        out.writelines(element_lines((job.cells + 1).tolist()))
        out.write(f"*MATERIAL, NAME=M\n*ELASTIC\n{E!r},{nu!r}\n*SOLID SECTION, ELSET=EALL, MATERIAL=M\n")
        out.write(f"*STEP\n*STATIC, SOLVER={solver}\n*BOUNDARY\n")
        nodes, axes = np.nonzero(job.fixed)
        values = job.values[nodes, axes]
        np.savetxt(out, np.column_stack([nodes + 1, axes + 1, axes + 1, values]), "%d,%d,%d,%.12E")
        nodes, axes = np.nonzero((job.forces != 0) & ~job.fixed)
        out.write("*CLOAD\n")
        np.savetxt(out, np.column_stack([nodes + 1, axes + 1, job.forces[nodes, axes]]), "%d,%d,%.12E")
        out.write("*NODE PRINT, NSET=ALL\nU\n*END STEP\n")


def element_lines(cells: list[list[int]]) -> Iterable[str]:
    """Yield the lines of the elements: at most 16 numbers each."""
    for number, cell in enumerate(cells, 1):
        words = [str(number), *map(str, cell)]
        yield ",\n".join(",".join(words[i : i + 15]) for i in range(0, len(words), 15)) + "\n"


def displacements(job: Job, path: Path) -> Array:
    """Return the displacements (n, 3) of the `.dat` file."""
    rows = [line.split() for line in path.read_text().splitlines() if line.startswith(" ")]
    table = np.array([row for row in rows if len(row) == 4 and row[0].isdigit()], dtype=float)
    u = np.zeros_like(job.points)
    u[table[:, 0].astype(int) - 1] = table[:, 1:]
    return u

"""Solving over ranks: strong and weak scaling beside the own engine and beside PETSc fed by a plain assembly.

``python -m benchmarks distributed --python MPI_PYTHON`` solves the clamped block, of which each rank makes
its share, in processes of their own (`programs.ranks`).  It writes benchmarks/results/distributed.json and
docs/about/scaling.md.  All rows of one element take turns; medians count; ratios are those of one run.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from statistics import median

import numpy as np

import kratos_lite as kl
from benchmarks.driver import ROOT, machine
from benchmarks.programs.ranks import LAW, model_of
from benchmarks.scaling import MOST_RANKS, TOLERANCE, Row, chosen, name_of, page

RESULTS = Path(__file__).with_name("results") / "distributed.json"
PAGE = ROOT / "docs" / "about" / "scaling.md"
KINDS = ("8N", "27N")
CELLS = {"8N": (32, 64), "27N": (16, 32)}
"""Cells along an edge of the block of one rank."""
PLAIN_LIMIT = 40**3
"""Cells of 8N above which the plain assembly is left out: it holds all triplets, 20 kB for each unknown."""
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
}
LEAVE = ("PYTHONPATH", "VIRTUAL_ENV", "PETSC_DIR", "PETSC_ARCH")


# ---- runs ------------------------------------------------------------------------------------------


def mpirun_of(python: str) -> str | None:
    """Return the mpirun beside an interpreter, else that of the system, else the first in PATH."""
    near = (Path(python).with_name("mpirun"), Path("/usr/bin/mpirun"))
    return next((str(path) for path in near if path.exists()), shutil.which("mpirun"))


def jobs(kind: str, n: int) -> list[Row]:
    """Return the rows of one element and size: the cube of n³ cells, and of 2 ranks twice as much."""
    cube, twice = [n, n, n], [MOST_RANKS * n, n, n]
    rows: list[Row] = [
        {"engine": "own", "ranks": 1, "cells": cube, "threads": 1},
        {"engine": "own", "ranks": 1, "cells": cube, "threads": MOST_RANKS},
        *({"engine": "petsc", "ranks": ranks, "cells": cube} for ranks in range(1, MOST_RANKS + 1)),
        {"engine": "whole", "ranks": MOST_RANKS, "cells": cube},
        {"engine": "petsc", "ranks": MOST_RANKS, "cells": twice},
    ]
    if n**3 * (8 if kind == "27N" else 1) <= PLAIN_LIMIT:
        rows += [{"engine": "plain", "ranks": ranks, "cells": cube} for ranks in range(1, MOST_RANKS + 1)]
    return [{"kind": kind, "n": n, "threads": 1} | row for row in rows]


def once(python: str, row: Row, folder: Path, limit: float) -> Row:
    """Return the answer of one run, or what it says where it fails."""
    answer, job = folder / "answer.json", folder / "job.json"
    answer.unlink(missing_ok=True)
    words = {name: row[name] for name in ("engine", "kind", "cells")} | {"tolerance": TOLERANCE}
    if row["engine"] == "petsc":
        words["write"] = str(folder / "block.pvtu")
    job.write_text(json.dumps(words | {"answer": str(answer)}))
    launch = [] if row["engine"] == "own" else [str(mpirun_of(python)), "-n", str(row["ranks"])]
    kept = {name: value for name, value in os.environ.items() if name not in LEAVE}
    more = {"PYTHONPATH": str(ROOT), "KRATOS_LITE_THREADS": str(row["threads"])}
    run = subprocess.run(
        [*launch, python, "-m", "benchmarks.programs.ranks", str(job)],
        env=kept | ENVIRONMENT | more,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=limit,
        check=False,
    )
    if not answer.exists():
        words_ = [line for line in run.stderr.splitlines() if "Error" in line] or ["stopped without a word"]
        return {"failed": words_[-1][-300:]}
    pieces = [path.stat().st_size for path in folder.glob("**/*.vtu")]
    return json.loads(answer.read_text()) | ({"bytes written": sum(pieces)} if pieces else {})


def measured(python: str, rows: Sequence[Row], repeats: int, limit: float) -> list[Row]:
    """Return the rows with the medians of their runs, which take turns."""
    answers: list[list[Row]] = [[] for _ in rows]
    for turn in range(repeats):
        for row, found in zip(rows, answers, strict=True):
            if found and "failed" in found[-1]:
                continue
            with tempfile.TemporaryDirectory(prefix="kratos_lite_bench_") as name:
                found.append(once(python, row, Path(name), limit))
            last = found[-1]
            said = last.get("failed") or f"{last['seconds']:.2f} s, {last['iterations']} iterations"
            print(f"  {name_of(row)} ({turn + 1}/{repeats}): {said}", flush=True)
    return [row | summary(found) for row, found in zip(rows, answers, strict=True)]


def summary(answers: Sequence[Row]) -> Row:
    """Return medians of times and memory."""
    if "failed" in answers[-1]:
        return {"failed": answers[-1]["failed"]}
    last = answers[-1]
    found = {name: last[name] for name in ("unknowns", "iterations", "solver", "work", "largest", "versions")}
    found["seconds"] = median(one["seconds"] for one in answers)
    found["spread"] = [pick(one["seconds"] for one in answers) for pick in (min, max)]
    found["mesh"] = median(one["mesh"] for one in answers)
    phases = dict.fromkeys(name for one in answers for name in one["phases"])
    found["phases"] = {name: median(one["phases"].get(name, 0.0) for one in answers) for name in phases}
    found["memory"] = median(max(one["memory"]) for one in answers)
    found["imports"] = median(max(one["imports"]) for one in answers)
    if "bytes written" in last:
        found |= {name: median(one[name] for one in answers) for name in ("bytes written", "write")}
    return found


def text_file(kind: str, n: int) -> Row:
    """Return the size of an .mdpa file of the block, its places with all digits, and the unknowns."""
    model, _ = model_of({"engine": "own", "kind": kind, "cells": [n, n, n]})
    shift = np.random.default_rng(0).uniform(0.0, 1e-6, model.mesh.points.shape)
    model = kl.Model(model.mesh.replace(points=model.mesh.points + shift), LAW)
    with tempfile.TemporaryDirectory(prefix="kratos_lite_bench_") as name:
        path = Path(name) / "block.mdpa"
        kl.write(path, model)
        return {"kind": kind, "bytes": path.stat().st_size, "unknowns": 3 * model.mesh.n_nodes}


def run(
    python: str | None, kinds: Iterable[str] | None, cells: Sequence[int] | None, repeats: int, limit: float
) -> Row:
    """Measure, and return what is kept.

    Parameters
    ----------
    python : interpreter that has mpi4py and petsc4py; else KRATOS_LITE_MPI_PYTHON, else this one.
    kinds, cells : elements, and cells along an edge in place of `CELLS`.
    repeats : runs of each row.
    limit : s that one run may take.
    """
    python = python or os.environ.get("KRATOS_LITE_MPI_PYTHON") or sys.executable
    if mpirun_of(python) is None:
        raise SystemExit("there is no mpirun; docs/howto/cluster.md says how it is installed")
    kinds = [kind for kind in kinds or KINDS if kind in KINDS]
    rows: list[Row] = []
    for kind in kinds:
        for n in cells or CELLS[kind]:
            rows += compared(measured(python, jobs(kind, n), repeats, limit))
    if not any("failed" not in row for row in rows):
        raise SystemExit("nothing could be measured")
    versions: dict[str, str] = {}
    for row in rows:
        versions |= {name: one for name, one in row.pop("versions", {}).items() if name != "kernels"}
    head = {"set": "distributed", "date": date.today().isoformat(), "machine": machine()}
    files = [text_file(kind, min(cells or CELLS[kind], key=lambda n: abs(n - 16))) for kind in kinds]
    return head | {"versions": versions, "repeats": repeats, "rows": rows, "files": files}


def compared(rows: list[Row]) -> list[Row]:
    """Return rows with the relative difference of the work of the loads to that of the own engine."""
    for row in rows:
        alike = [one for one in chosen(rows, engine="own") if one["cells"] == row["cells"]]
        if "work" in row and alike and alike[0] is not row:
            row["difference"] = abs(row["work"] / alike[0]["work"] - 1)
    return rows


def write(found: Row) -> None:
    """Write the results and the page."""
    lists = [
        f'"{key}": [\n' + ",\n".join("  " + json.dumps(row) for row in found[key]) + "\n]"
        for key in ("rows", "files")
    ]
    head = json.dumps({key: value for key, value in found.items() if key not in ("rows", "files")})
    RESULTS.write_text(head[:-1] + ", " + ",\n".join(lists) + "}\n", encoding="utf-8")
    PAGE.write_text(page(found), encoding="utf-8")

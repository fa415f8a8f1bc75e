"""One job, or a list of jobs in one process: ``python -m benchmarks.programs MODULE job.json``.

A job of a list that fails, or that a program cannot take, leaves no displacements behind.
"""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.programs.common import Job, Work, run


def batch(work: Work, jobs: list[dict[str, Any]]) -> dict[str, Any]:
    """Do many jobs; return the version of the program and what failed."""
    told: dict[str, Any] = {"version": "", "failed": []}
    for given in jobs:
        job = Job(given)
        try:
            u = work(job)
        except ModuleNotFoundError as error:
            return told | {"absent": str(error)}
        except Exception as error:  # whatever another program raises
            told["failed"].append(f"{given['stem']}: {type(error).__name__}: {error}")
            continue
        told["version"] = job.answer["version"] or told["version"]
        np.save(given["displacement"], u)
    return told


if __name__ == "__main__":
    module, _, function = sys.argv[1].partition(".")
    work = getattr(importlib.import_module(f"benchmarks.programs.{module}"), function or "work")
    path = Path(sys.argv[2])
    given = json.loads(path.read_text())
    if isinstance(given, list):
        path.with_suffix(".answer.json").write_text(json.dumps(batch(work, given)))
    else:
        run(work, given)

"""Many jobs in one process: ``python -m benchmarks.programs.batch PROGRAM jobs.json``.

A job that fails, or that a program cannot take, leaves no displacements behind.
"""

from __future__ import annotations

import importlib
import json
import sys
import traceback
from pathlib import Path

import numpy as np

from benchmarks.programs.common import Job


def main() -> None:
    """Do the jobs of a file; write the version of the program beside it."""
    work = importlib.import_module(f"benchmarks.programs.{sys.argv[1]}").work
    jobs = Path(sys.argv[2])
    told: dict[str, object] = {"version": "", "failed": []}
    for given in json.loads(jobs.read_text()):
        job = Job(given)
        try:
            u = work(job)
        except ModuleNotFoundError as error:
            told["absent"] = str(error)
            break
        except Exception as error:  # whatever another program raises
            traceback.print_exc()
            told["failed"] = [*told["failed"], f"{given['stem']}: {error}"]
            continue
        told["version"] = job.answer["version"] or told["version"]
        np.save(given["displacement"], u)
    jobs.with_suffix(".answer.json").write_text(json.dumps(told))


if __name__ == "__main__":
    main()

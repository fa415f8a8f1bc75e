"""One linear system for many solvers: the same matrix and load, the same residual, one way to measure.

kratos_lite solves the model, whose matrix the others read from a file.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job

MAX_ITERATIONS = 1000


class Memory:
    """What this process takes at most from now on, above what it takes now; None where nothing says it."""

    def __init__(self) -> None:
        try:
            ctypes.CDLL(None).malloc_trim(0)  # what was set free would be taken again unseen
        except (AttributeError, OSError):
            pass
        self._before = _status("VmRSS")
        try:
            Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
        except OSError:
            self._before = None

    def peak(self) -> int | None:
        """Return bytes."""
        return None if self._before is None else max(0, (_status("VmHWM") or 0) - self._before)


def _status(word: str) -> int | None:
    """Return bytes of a line in what the system says of this process."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return None
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith(word)), None)


def read(job: Job) -> tuple[Any, Array, Array]:
    """Return the matrix in 3 × 3 blocks (BSR), the load and the places of the nodes."""
    import scipy.sparse as sp

    with job.phase("read"), np.load(f"{job.stem}.npz") as file:
        A = sp.bsr_matrix((file["data"], file["indices"], file["indptr"]))
        A.has_sorted_indices = True
        return A, file["load"], file["points"]


@contextmanager
def measured(job: Job) -> Iterator[None]:
    """Keep the memory that set-up and solution in the body of a ``with`` statement take."""
    memory = Memory()
    yield
    job.answer["memory"] = memory.peak()


def check_solution(job: Job, A: Any, b: Array, x: Array, iterations: int = 0) -> None:
    """Keep the true relative residual, and the one that rounding alone makes likely."""
    size = float(np.linalg.norm(b))
    norm = float(np.asarray(abs(A).sum(axis=1)).max())
    job.answer |= {
        "unknowns": len(b),
        "iterations": iterations,
        "residual": float(np.linalg.norm(b - A @ x)) / size,
        "rounding": float(np.finfo(float).eps * norm * np.linalg.norm(x)) / size,
    }


class Clock:
    """Progress of a solution: when the matrix was complete, its solver ready, and all done."""

    def __init__(self) -> None:
        self.at: dict[tuple[str, float], float] = {}
        self.memory: Memory | None = None
        self.peak: int | None = None

    def __call__(self, phase: str, fraction: float) -> None:
        """Note the first time of each phase and fraction."""
        if self.memory is None and (phase, fraction) == ("assemble", 1.0):
            self.memory = Memory()
        self.at.setdefault((phase, fraction), perf_counter())
        if (phase, fraction) == ("verify", 0.0) and self.memory:
            self.peak = self.memory.peak()

    def phases(self) -> dict[str, float]:
        """Return seconds of set-up, with whatever is done to the complete matrix, and of the solution."""
        start, end = self.at["assemble", 1.0], self.at["verify", 0.0]
        ready = self.at.get(("set up", 1.0)) or self.at.get(("factorize", 1.0)) or start
        return {"setup": ready - start, "solve": end - ready}


def ours(job: Job, kl: Any) -> None:
    """Solve the model of the scene by kratos_lite."""
    from benchmarks.scenes import make

    with job.phase("import"):
        import scipy.sparse  # noqa: F401 (the others have it, too)
    with job.phase("read"):
        model = make(job.given["scene"], job.kind, job.given["n"]).model
    clock = Clock()
    analysis = model.static(progress=clock)
    result = analysis.solve(tolerance=job.tolerance)
    report = result.report
    job.answer["phases"] |= clock.phases()
    job.answer |= {"solver": report.solver, "memory": clock.peak}
    u, constraints = result.displacement(), model.supports.constraint_map(np.arange(model.mesh.n_nodes))
    del analysis, result
    A, b, _ = read(job)
    check_solution(job, A, b, (u.ravel() - constraints.c)[constraints.free], report.iterations)

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

from benchmarks.programs.common import Array, Job, rigid_modes, solve

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


def factorized(job: Job) -> None:
    """Factorize the matrix of kratos_lite: MKL's PARDISO and SuiteSparse's CHOLMOD."""
    program = job.given["program"]
    with job.phase("import"):
        import scipy.sparse as sp

        if program == "PARDISO":
            import pypardiso as library
        else:
            import sksparse.cholmod as library
    A, b, _ = read(job)
    with job.phase("matrix"):
        rows = sp.triu(A, format="csr") if program == "PARDISO" else A.tocsc()
    with measured(job):
        x = (pardiso if program == "PARDISO" else cholmod)(job, library, rows, b)
    check_solution(job, A, b, x)


def pardiso(job: Job, pypardiso: Any, rows: Any, b: Array) -> Array:
    """Factorize the upper triangle of a positive definite matrix."""
    job.answer["version"] = getattr(pypardiso, "__version__", "")
    solver = pypardiso.PyPardisoSolver(mtype=2)
    with job.phase("setup"):
        solver.factorize(rows)
    with job.phase("solve"):
        return solver.solve(rows, b)


def cholmod(job: Job, library: Any, rows: Any, b: Array) -> Array:
    """Factorize by supernodes in the order of METIS."""
    from importlib.metadata import version

    job.answer["version"] = version("scikit-sparse")
    with job.phase("setup"):
        factor = library.cholesky(rows, mode="supernodal", ordering_method="metis")
    with job.phase("solve"):
        return factor(b)


def pyamg(job: Job) -> Array | None:
    """Take pyamg as it comes: smoothed aggregation with the rigid modes on the matrix of kratos_lite."""
    with job.phase("import"):
        import pyamg
        import scipy.sparse  # noqa: F401

        import kratos_lite as kl
        from kratos_lite.assembly.sparsity_pattern import PatternCache
        from kratos_lite.assembly.stiffness import assemble_stiffness
    job.answer["version"] = pyamg.__version__
    if job.task == "linear":
        return pyamg_alone(job, pyamg)
    job.read()
    with job.phase("matrix"):
        model = kl.read(f"{job.stem}.mdpa")
        groups = model.element_groups()
        pattern = PatternCache().get(model.mesh.n_nodes, [group.nodes for group in groups])
        K = assemble_stiffness(model.mesh.points, groups, pattern).scipy()
    return solve(job, K, np.arange(3 * model.mesh.n_nodes).reshape(-1, 3), {})


def pyamg_alone(job: Job, pyamg: Any) -> None:
    """Solve the system of a file."""
    A, b, points = read(job)
    modes, residuals = rigid_modes(points), []
    with measured(job):
        with job.phase("setup"):
            hierarchy = pyamg.smoothed_aggregation_solver(A, B=modes)
        with job.phase("solve"):
            words = {"accel": "cg", "maxiter": MAX_ITERATIONS, "residuals": residuals}
            x = hierarchy.solve(b, tol=job.tolerance, **words)
    check_solution(job, A, b, x, len(residuals) - 1)


PETSC_OPTIONS = {
    "PETSc GAMG": {"pc_type": "gamg", "pc_gamg_threshold": "0.01"},
    "PETSc BoomerAMG": {
        "pc_type": "hypre",
        "pc_hypre_boomeramg_strong_threshold": "0.5",
        "pc_hypre_boomeramg_coarsen_type": "HMIS",
        "pc_hypre_boomeramg_interp_type": "ext+i",
        "pc_hypre_boomeramg_P_max": "4",
    },
}
"""The fastest of those tried on the clamped block; all else is default."""


def petsc(job: Job) -> None:
    """Take PETSc's multigrids, its own and hypre's, with conjugate gradients on the matrix of kratos_lite.

    Run by ``mpiexec -n 2`` each of two processes has half of the rows; without it one process has all.
    """
    with job.phase("import"):
        import petsc4py

        petsc4py.init()
        import scipy.sparse  # noqa: F401
        from petsc4py import PETSc
    comm = PETSc.COMM_WORLD
    options = {"ksp_norm_type": "unpreconditioned"} | PETSC_OPTIONS[job.given["program"]]
    for name, value in options.items():
        PETSc.Options().setValue(name, value)
    A, b, points = read(job)
    with job.phase("matrix"):
        start, stop = (3 * (len(points) * (comm.rank + k) // comm.size) for k in (0, 1))
        mine = A.tocsr()[start:stop]
        size = (stop - start, len(b))
        K = PETSc.Mat().createAIJ(size=(size, size), bsize=3, csr=(mine.indptr, mine.indices, mine.data))
        K.setOption(PETSc.Mat.Option.SPD, True)
        modes = [vector(PETSc, mode, start, stop) for mode in np.linalg.qr(rigid_modes(points))[0].T]
        K.setNearNullSpace(PETSc.NullSpace().create(vectors=modes))
        rhs, x = vector(PETSc, b, start, stop), vector(PETSc, 0 * b, start, stop)
        whole = A if comm.rank == 0 else None
        del A, mine
    ksp = PETSc.KSP().create()
    ksp.setType("cg")
    ksp.setTolerances(rtol=job.tolerance, max_it=MAX_ITERATIONS)
    ksp.setFromOptions()
    memory = Memory()
    with job.phase("setup"):
        ksp.setOperators(K)
        ksp.setUp()
        comm.barrier()
    with job.phase("solve"):
        ksp.solve(rhs, x)
        comm.barrier()
    taken = memory.peak()
    total = PETSc.Vec().createMPI((1, comm.size))
    total.setValue(comm.rank, float(taken or 0))
    total.assemble()
    job.answer["memory"] = None if taken is None else int(total.sum())
    scatter, everything = PETSc.Scatter.toZero(x)
    scatter.scatter(x, everything)
    if comm.rank:
        raise SystemExit  # the first process answers for all
    job.answer["version"] = ".".join(map(str, PETSc.Sys.getVersion()))
    check_solution(job, whole, b, everything.getArray(), ksp.getIterationNumber())


def vector(PETSc: Any, values: Array, start: int, stop: int) -> Any:
    """Return a vector of PETSc."""
    made = PETSc.Vec().createMPI((stop - start, len(values)), bsize=3)
    made.setArray(values[start:stop])
    return made

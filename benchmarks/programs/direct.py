"""Factorizations of the matrix of kratos_lite: MKL's PARDISO and SuiteSparse's CHOLMOD."""

from __future__ import annotations

from typing import Any

from benchmarks.programs import linear
from benchmarks.programs.common import Array, Job


def work(job: Job) -> None:
    """Do the job."""
    program = job.given["program"]
    with job.phase("import"):
        import scipy.sparse as sp

        if program == "PARDISO":
            import pypardiso as library
        else:
            import sksparse.cholmod as library
    A, b, _ = linear.read(job)
    with job.phase("matrix"):
        rows = sp.triu(A, format="csr") if program == "PARDISO" else A.tocsc()
    with linear.measured(job):
        x = (pardiso if program == "PARDISO" else cholmod)(job, library, rows, b)
    linear.check_solution(job, A, b, x)


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

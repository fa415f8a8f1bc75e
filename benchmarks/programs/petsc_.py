"""PETSc's multigrids, its own and hypre's, with conjugate gradients on the matrix of kratos_lite.

Run by ``mpiexec -n 2`` each of two processes has half of the rows; without it one process has all.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs import linear
from benchmarks.programs.common import Array, Job, rigid_modes

OPTIONS = {
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


def work(job: Job) -> None:
    """Do the job."""
    with job.phase("import"):
        import petsc4py

        petsc4py.init()
        import scipy.sparse  # noqa: F401
        from petsc4py import PETSc
    comm = PETSc.COMM_WORLD
    options = {"ksp_norm_type": "unpreconditioned"} | OPTIONS[job.given["program"]]
    for name, value in options.items():
        PETSc.Options().setValue(name, value)
    A, b, points = linear.read(job)
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
    ksp.setTolerances(rtol=job.tolerance, max_it=linear.MAX_ITERATIONS)
    ksp.setFromOptions()
    memory = linear.Memory()
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
    linear.check_solution(job, whole, b, everything.getArray(), ksp.getIterationNumber())


def vector(PETSc: Any, values: Array, start: int, stop: int) -> Any:
    """Return a vector of PETSc."""
    made = PETSc.Vec().createMPI((stop - start, len(values)), bsize=3)
    made.setArray(values[start:stop])
    return made

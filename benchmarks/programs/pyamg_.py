"""pyamg as it comes: smoothed aggregation with the rigid modes on the matrix of kratos_lite."""

from __future__ import annotations

import numpy as np

from benchmarks.programs import linear
from benchmarks.programs.common import Array, Job, rigid_modes, run, uncoupled


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import pyamg
        import scipy.sparse as sp

        import kratos_lite as kl
        from kratos_lite.assembly.sparsity_pattern import PatternCache
        from kratos_lite.assembly.stiffness import assemble_stiffness
    job.answer["version"] = pyamg.__version__
    if job.task == "linear":
        solve(job)
        return None
    job.read()
    with job.phase("matrix"):
        model = kl.read(f"{job.stem}.mdpa")
        groups = model.element_groups()
        pattern = PatternCache().get(model.mesh.n_nodes, [group.nodes for group in groups])
        K = sp.csr_matrix(assemble_stiffness(model.mesh.points, groups, pattern).scipy())
    with job.phase("constrain"):
        fixed = job.fixed.ravel()
        u = np.where(fixed, job.values.ravel(), 0.0)
        b = (job.forces.ravel() - K @ u) * ~fixed
        A = sp.bsr_matrix(uncoupled(K, ~fixed), blocksize=(3, 3))
    residuals: list[float] = []
    with job.phase("solve"):
        hierarchy = pyamg.smoothed_aggregation_solver(A, B=rigid_modes(job.points) * ~fixed[:, None])
        x = hierarchy.solve(b, tol=job.tolerance, accel="cg", maxiter=500, residuals=residuals)
    job.answer |= {"iterations": len(residuals) - 1, "unknowns": int((~fixed).sum())}
    return np.asarray(np.where(fixed, u, x)).reshape(-1, 3)


def solve(job: Job) -> None:
    """Solve the system of a file."""
    import pyamg

    A, b, points = linear.read(job)
    modes, residuals = rigid_modes(points), []
    with linear.measured(job):
        with job.phase("setup"):
            hierarchy = pyamg.smoothed_aggregation_solver(A, B=modes)
        with job.phase("solve"):
            words = {"accel": "cg", "maxiter": linear.MAX_ITERATIONS, "residuals": residuals}
            x = hierarchy.solve(b, tol=job.tolerance, **words)
    linear.judge(job, A, b, x, len(residuals) - 1)


if __name__ == "__main__":
    run(work)

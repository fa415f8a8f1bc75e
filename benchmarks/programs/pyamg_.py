"""pyamg as it comes: smoothed aggregation with the rigid modes on the matrix of kratos_lite."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs import linear
from benchmarks.programs.common import Array, Job, rigid_modes, solve


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import pyamg
        import scipy.sparse  # noqa: F401

        import kratos_lite as kl
        from kratos_lite.assembly.sparsity_pattern import PatternCache
        from kratos_lite.assembly.stiffness import assemble_stiffness
    job.answer["version"] = pyamg.__version__
    if job.task == "linear":
        return system(job, pyamg)
    job.read()
    with job.phase("matrix"):
        model = kl.read(f"{job.stem}.mdpa")
        groups = model.element_groups()
        pattern = PatternCache().get(model.mesh.n_nodes, [group.nodes for group in groups])
        K = assemble_stiffness(model.mesh.points, groups, pattern).scipy()
    return solve(job, K, np.arange(3 * model.mesh.n_nodes).reshape(-1, 3), {})


def system(job: Job, pyamg: Any) -> None:
    """Solve the system of a file."""
    A, b, points = linear.read(job)
    modes, residuals = rigid_modes(points), []
    with linear.measured(job):
        with job.phase("setup"):
            hierarchy = pyamg.smoothed_aggregation_solver(A, B=modes)
        with job.phase("solve"):
            words = {"accel": "cg", "maxiter": linear.MAX_ITERATIONS, "residuals": residuals}
            x = hierarchy.solve(b, tol=job.tolerance, **words)
    linear.check_solution(job, A, b, x, len(residuals) - 1)

"""kratos_lite: read the `.mdpa` file, solve, write a `.vtu` file; its phases are those of its report."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job

WORDS = {"tolerance", "solver"}


def work(job: Job) -> Array | None:
    """Do the job."""
    if "threads" in job.given:
        os.environ["KRATOS_LITE_THREADS"] = str(job.given["threads"])
    with job.phase("import"):
        import kratos_lite as kl
    job.answer["version"] = kl.__version__
    if job.task == "motion":
        from benchmarks.motion import SLOW, measured
        from kratos_lite.native import kernels

        found = measured(kl, job.given["scene"], 1 if kernels("motion") else SLOW)
        job.answer["phases"]["step"] = found.pop("step")
        job.answer["drift"] = found
        return None
    if job.task == "ale":
        from benchmarks import ale

        return ale.work(job, kl)
    if job.task == "linear":
        from benchmarks.programs import linear

        linear.ours(job, kl)
        return None
    if job.given.get("arrays"):
        job.read()
    with job.phase("read"):
        model = from_arrays(job, kl) if job.given.get("arrays") else kl.read(f"{job.stem}.mdpa")
    if job.task == "parse":
        return None
    if job.task == "assembly":
        return assembly(job, model)
    if job.task == "gradient":
        model.scale_stiffness(job.factors)
        with job.phase("forward"):
            result = model.solve(tolerance=job.tolerance)
        with job.phase("gradient"):
            return np.asarray(result.gradient(kl.Compliance()))
    system = model.static(**{word: job.given[word] for word in WORDS if word in job.given})
    for _ in range(job.given.get("cases", 1)):
        result = system.solve()
    for _ in range(1, job.given.get("again", 1)):
        result = model.solve()
    report = result.report
    job.answer["phases"] |= report.seconds
    job.answer |= {
        "iterations": report.iterations,
        "residual": report.backward_error,
        "unknowns": report.unknowns,
        "solver": report.solver,
    }
    if job.given.get("stress"):
        with job.phase("stress"):
            result.stress(job.given["stress"])
    if job.given.get("write"):
        with job.phase("write"):
            ending = ".vtu" if job.given["write"] is True else job.given["write"]
            kl.write(f"{job.given['folder']}/result{ending}", result, job.given.get("mode"))
    return np.asarray(result.displacement())


def from_arrays(job: Job, kl: Any) -> Any:
    """Return the model made of the arrays that the other Python libraries read, too."""
    E, nu = job.elasticity.tolist()
    model = kl.Model(kl.Mesh(job.points, [kl.Block(str(job.element), job.nodes)]), kl.Isotropic3D(E=E, nu=nu))
    for axis, constrained in enumerate(job.fixed.T):
        model.fix(constrained, "xyz"[axis], job.values[constrained, axis, None])
    model.add(kl.NodalForces(job.forces))
    return model


def assembly(job: Job, model: Any) -> None:
    """Time the pattern and the matrix alone."""
    from kratos_lite.assembly.stiffness import assemble_stiffness

    groups = model.element_groups()
    points, connectivity = model.mesh.points, [group.nodes for group in groups]

    def pattern() -> Any:
        from kratos_lite.assembly.sparsity_pattern import PatternCache

        return PatternCache().get(len(points), connectivity)

    made = job.fastest("pattern", pattern)
    job.fastest("matrix", lambda: assemble_stiffness(points, groups, made))

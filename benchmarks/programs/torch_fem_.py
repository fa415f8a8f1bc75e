"""torch-fem: its solid model, its assembly and its solver (PARDISO or multigrid, as it chooses)."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import importlib.metadata

        import torch
        import torchfem
        import torchfem.materials
        import torchfem.sparse
    torch.set_default_dtype(torch.float64)
    job.answer["version"] = importlib.metadata.version("torch-fem")
    job.read()
    with job.phase("mesh"):
        E, nu = job.elasticity.tolist()
        material = torchfem.materials.IsotropicElasticity3D(E=E, nu=nu)
        cells = torch.from_numpy(job.cells.astype(np.int64))
        model = torchfem.Solid(torch.from_numpy(job.points), cells, material)
    k = job.fastest("matrix", model.k0)
    return None if job.task == "assembly" else solve(job, torch, torchfem.sparse, model, k)


def solve(job: Job, torch: Any, sparse: Any, model: Any, k: Any) -> Array:
    """Return the displacements (n, 3)."""
    with job.phase("constrain"):
        fixed = torch.from_numpy(job.fixed.ravel())
        held = torch.nonzero(fixed).ravel()
        u = torch.where(fixed, torch.from_numpy(job.values.ravel()), 0.0)
        b = torch.from_numpy(job.forces.ravel()) - model.assemble_matrix(k, held[:0]) @ u
        b[held] = u[held]
        K = model.assemble_matrix(k, held)
    with job.phase("solve"):
        found, *_, iterations = sparse.sparse_solve(K, b, model.near_null_space(), stol=job.tolerance)
    job.answer |= {"unknowns": int((~fixed).sum()), "iterations": iterations}
    return np.asarray(found).reshape(-1, 3)

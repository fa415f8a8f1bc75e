"""The clamped block over several ranks, each of which runs ``python -m benchmarks.programs ranks job.json``.

The job names the backend: ``own`` (one process), ``petsc`` (each rank makes its part of the mesh), ``whole``
(rank 0 has the mesh, all ranks assemble and solve), or ``plain``: PETSc's GAMG with what its manual advises
for elasticity, fed by an assembly in NumPy of all own rows, one batch of all elements and one sort.
"""

from __future__ import annotations

import resource
import sys
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import kratos_lite as kl
from benchmarks.programs.common import Job
from kratos_lite.distributed.communicator import ALONE, world
from kratos_lite.distributed.communicator import start as start_ranks
from kratos_lite.typing import Array

OPTIONS = {
    "ksp_type": "cg",
    "ksp_norm_type": "unpreconditioned",
    "pc_type": "gamg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
}
GRAVITY = (3.0, 2.0, -9.81)
MATERIAL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
NEEDED = ("scipy.sparse", "kratos_lite.analysis.static", "kratos_lite.solvers.constrained_system")
NEEDED_OVER_RANKS = ("kratos_lite.distributed.petsc_system", "kratos_lite.distributed.multigrid")


def peak() -> int:
    """Return the most memory in bytes that this process has held."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def model_of(backend: str, kind: str, cells: list[int]) -> tuple[kl.Model, Any]:
    """Return the block, or the part of it that this rank makes, and the partition."""
    partition = None
    words = tuple(here / cells[-1] for here in cells), tuple(cells), f"KinematicLinear3D{kind}"
    if backend in ("own", "whole"):
        mesh = kl.box(*words)
    else:
        from kratos_lite.distributed.box import box

        mesh, partition = box(*words)
    model = kl.Model(mesh, MATERIAL)
    model.fix("z-")
    model.add(kl.Gravity(GRAVITY))
    return model, partition


def solved(model: kl.Model, partition: Any, job: Job) -> tuple[Array, Array]:
    """Return displacements and loads (n, 3) by kratos_lite."""
    if partition is None:
        result = model.solve(
            backend="own" if job.given["backend"] == "own" else "petsc", tolerance=job.tolerance
        )
    else:
        result = kl.solve_part(model, partition, tolerance=job.tolerance)
    report = result.report
    job.answer |= {"phases": dict(report.seconds), "iterations": report.iterations, "solver": report.solver}
    if job.given["backend"] == "petsc":
        with job.phase("write"):
            kl.write(Path(job.given["folder"]) / "block.pvtu", result)
    return result.u, result.loads


# ---- PETSc fed by a plain assembly -----------------------------------------------------------------


def plain(model: kl.Model, partition: Any, job: Job) -> tuple[Array, Array]:
    """Return displacements and loads (n, 3) of own nodes by PETSc's GAMG."""
    from petsc4py import PETSc

    mesh = model.mesh
    with job.phase("assemble"):
        part = partition.equations(
            mesh.points, model.element_groups(), np.zeros(mesh.points.shape, dtype=bool)
        )
        n, n_all = len(part.own), int(partition.offsets[-1])
        own = np.zeros(len(part.points), dtype=bool)
        own[part.own] = True
        K, f = assembled(part, own, n_all)
        size = (3 * n, 3 * n_all)
        A = PETSc.Mat().createAIJ(size=(size, size), bsize=3, csr=(K.indptr, K.indices, K.data))
        del K
        b, x, X = A.createVecLeft(), A.createVecLeft(), A.createVecLeft()
        b.setArray(f[own].ravel())
        X.setArray(part.points[own].ravel())
        X.setBlockSize(3)
        constrained = part.number[own][part.points[own][:, 2] == 0.0]
        dofs = (3 * constrained[:, None] + np.arange(3)).ravel().astype(PETSc.IntType)
        A.zeroRowsColumns(dofs, diag=1.0, x=x, b=b)
        A.setNearNullSpace(PETSc.NullSpace().createRigidBody(X))
        A.setOption(PETSc.Mat.Option.SPD, True)
    for name, value in OPTIONS.items():
        PETSc.Options("plain_").setValue(name, value)
    ksp = PETSc.KSP().create(A.getComm())
    ksp.setOptionsPrefix("plain_")
    ksp.setTolerances(rtol=job.tolerance)
    ksp.setFromOptions()
    ksp.setOperators(A)
    with job.phase("solve"):
        ksp.solve(b, x)
    u = np.zeros(mesh.points.shape)
    u[part.own] = x.getArray().reshape(-1, 3)
    job.answer |= {"iterations": ksp.getIterationNumber(), "solver": "cg + gamg"}
    return u, f[: mesh.n_nodes]


def assembled(part: Any, own: Array, n_all: int) -> tuple[Any, Array]:
    """Return the rows of K of own nodes with columns by global numbers, and the loads (n, 3)."""
    from scipy.sparse import coo_matrix

    (group,) = part.groups
    element, nodes, X = group.element, group.nodes, part.points[group.nodes]
    k = nodes.shape[1]
    K, volumes = np.zeros((len(nodes), 3 * k, 3 * k)), np.zeros((len(nodes), k))
    for point, weight in zip(element.rule.points, element.rule.weights, strict=True):
        dN = element.shape.dN(point)
        J = np.einsum("pa,epi->eia", dN, X)
        G = np.einsum("pa,eai->epi", dN, np.linalg.inv(J))
        B = np.zeros((len(nodes), 6, k, 3))
        for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))):
            B[:, row, :, i] = G[..., j]
            B[:, row, :, j] = G[..., i]
        B = B.reshape(len(nodes), 6, 3 * k)
        dV = weight * np.linalg.det(J)
        K += np.swapaxes(B, 1, 2) @ (MATERIAL.C @ B * dV[:, None, None])
        volumes += dV[:, None] * element.shape.N(point)
    local = np.where(own, np.cumsum(own) - 1, -1)
    rows, columns = (
        (3 * n[nodes][..., None] + np.arange(3)).reshape(len(nodes), -1) for n in (local, part.number)
    )
    i = np.broadcast_to(rows[:, :, None], K.shape).ravel()
    j = np.broadcast_to(columns[:, None, :], K.shape).ravel()
    here = i >= 0
    shape = 3 * int(own.sum()), 3 * n_all
    f = np.zeros(part.points.shape)
    np.add.at(f, nodes, MATERIAL.density * volumes[..., None] * np.array(GRAVITY))
    return coo_matrix((K.ravel()[here], (i[here], j[here])), shape=shape).tocsr(), f


# ---- one run ---------------------------------------------------------------------------------------


def work(job: Job) -> None:
    """Do the job; rank 0 answers."""
    backend = job.given["backend"]
    import_all(backend)
    ranks = {"own": lambda: ALONE, "whole": start_ranks}.get(backend, world)()
    every = backend != "whole"  # what rank 0 alone runs asks the others by a task
    before = _peaks(ranks) if every else ranks.run(_peaks)
    start = perf_counter()
    model, partition = model_of(backend, job.kind, job.given["cells"])
    mesh, start = perf_counter() - start, perf_counter()
    u, loads = (plain if backend == "plain" else solved)(model, partition, job)
    seconds = perf_counter() - start - job.answer["phases"].get("write", 0.0)
    after = _peaks(ranks) if every else ranks.run(_peaks)
    own = np.ones(model.mesh.n_nodes, dtype=bool) if partition is None else partition.own
    total = ranks.sum if every else float
    unknowns = int(total(3.0 * (own & (model.mesh.points[:, 2] > 0)).sum()))
    job.answer |= {"load work": total(float((loads * u)[own].sum())), "unknowns": unknowns}
    if ranks.rank:
        raise SystemExit
    job.answer |= {"mesh": mesh, "seconds": seconds, "imports": max(before), "versions": versions()}
    job.answer["memory"] = max(b - a for a, b in zip(before, after, strict=True))
    if pieces := [path.stat().st_size for path in Path(job.given["folder"]).glob("**/*.vtu")]:
        job.answer["bytes written"] = sum(pieces)


def _peaks(ranks: Any) -> list[int]:
    found: list[int] = ranks.gather(peak())
    return found


def import_all(backend: str) -> None:
    """Import before the clock starts and memory counts, as every program does at its start."""
    for name in (*NEEDED, *(NEEDED_OVER_RANKS if backend != "own" else ())):
        import_module(name)
    if backend != "own":
        from kratos_lite.distributed.petsc import petsc

        petsc()


def versions() -> dict[str, str]:
    """Return the versions of what computes."""
    names = {"NumPy": "numpy", "mpi4py": "mpi4py", "PETSc": "petsc4py", "kratos_lite": "kratos_lite"}
    return {name: sys.modules[m].__version__ for name, m in names.items() if m in sys.modules}

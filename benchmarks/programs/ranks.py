"""The clamped block over several ranks: ``mpirun -n P python -m benchmarks.programs.ranks job.json``.

The job names the engine: ``own`` (one process), ``petsc`` (each rank makes its part of the mesh), ``whole``
(rank 0 has the mesh, all ranks assemble and solve), or ``plain``: PETSc's GAMG with what its manual advises
for elasticity, fed by an assembly in NumPy of all own rows, one batch of all elements and one sort.
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import kratos_lite as kl
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
LAW = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)


def peak() -> int:
    """Return the most memory in bytes that this process has held."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def model_of(job: dict[str, Any]) -> tuple[kl.Model, Any]:
    """Return the block, or the part of it that this rank makes, and how the parts hang together."""
    cells, partition = tuple(job["cells"]), None
    given = tuple(here / cells[-1] for here in cells), cells, f"KinematicLinear3D{job['kind']}"
    if job["engine"] in ("own", "whole"):
        mesh = kl.box(*given)
    else:
        from kratos_lite.distributed.box import box

        mesh, partition = box(*given)
    model = kl.Model(mesh, LAW)
    model.fix("z-")
    model.add(kl.Gravity(GRAVITY))
    return model, partition


# ---- our engines -----------------------------------------------------------------------------------


def solved(model: kl.Model, partition: Any, job: dict[str, Any]) -> tuple[Array, Array, dict[str, Any]]:
    """Return displacements and loads (n, 3), and what the report of our engine says."""
    how = {"tolerance": job["tolerance"], "petsc": job.get("petsc")}
    if partition is None:
        result = model.solve(engine="own" if job["engine"] == "own" else "petsc", **how)
    else:
        result = kl.solve_part(model, partition, **how)
    said = result.report
    found = {"phases": dict(said.seconds), "iterations": said.iterations, "solver": said.solver}
    if job.get("write"):
        start = perf_counter()
        kl.write(Path(job["write"]), result)
        found["write"] = perf_counter() - start
    return result.u, result.loads, found


# ---- PETSc fed by a plain assembly -----------------------------------------------------------------


def plain(model: kl.Model, partition: Any, job: dict[str, Any]) -> tuple[Array, Array, dict[str, Any]]:
    """Return displacements and loads (n, 3) of own nodes, and phases."""
    from petsc4py import PETSc

    mesh, start = model.mesh, perf_counter()
    part = partition.equations(mesh.points, model.element_groups(), np.zeros(mesh.points.shape, dtype=bool))
    numbers, mine = part.number, np.zeros(len(part.points), dtype=bool)
    mine[part.own] = True
    n, n_all = len(part.own), int(partition.offsets[-1])
    K, f = assembled(part, mine, numbers, n_all)
    fixed = np.repeat(part.points[:, 2] == 0.0, 3).reshape(-1, 3)
    A = PETSc.Mat().createAIJ(
        size=((3 * n, 3 * n_all), (3 * n, 3 * n_all)), bsize=3, csr=(K.indptr, K.indices, K.data)
    )
    del K
    b, x = A.createVecLeft(), A.createVecLeft()
    b.setArray(f[mine].ravel())
    place = A.createVecLeft()
    place.setArray(part.points[mine].ravel())
    place.setBlockSize(3)
    held = (3 * numbers[mine][:, None] + np.arange(3))[fixed[mine]].astype(PETSc.IntType)
    A.zeroRowsColumns(held, diag=1.0, x=x, b=b)
    A.setNearNullSpace(PETSc.NullSpace().createRigidBody(place))
    A.setOption(PETSc.Mat.Option.SPD, True)
    assemble = perf_counter() - start
    for name, value in OPTIONS.items():
        PETSc.Options("plain_").setValue(name, value)
    ksp = PETSc.KSP().create(A.getComm())
    ksp.setOptionsPrefix("plain_")
    ksp.setTolerances(rtol=job["tolerance"])
    ksp.setFromOptions()
    ksp.setOperators(A)
    start = perf_counter()
    ksp.setUp()
    set_up = perf_counter() - start
    ksp.solve(b, x)
    u = np.zeros(mesh.points.shape)
    u[part.own] = x.getArray().reshape(-1, 3)
    found = {"phases": {"assemble": assemble, "solve": perf_counter() - start}, "set_up": set_up}
    return u, f[: mesh.n_nodes], found | {"iterations": ksp.getIterationNumber(), "solver": "cg + gamg"}


def assembled(part: Any, mine: Array, numbers: Array, n_all: int) -> tuple[Any, Array]:
    """Return the rows of K of own nodes with columns by global numbers, and the loads (n, 3)."""
    from scipy.sparse import coo_matrix

    (group,) = part.groups
    element, nodes, X = group.element, group.nodes, part.points[group.nodes]
    k = nodes.shape[1]
    K, volumes = np.zeros((len(nodes), 3 * k, 3 * k)), np.zeros((len(nodes), k))
    for place, weight in zip(element.rule.points, element.rule.weights, strict=True):
        dN = element.shape.dN(place)
        J = np.einsum("pa,epi->eia", dN, X)
        G = np.einsum("pa,eai->epi", dN, np.linalg.inv(J))
        B = np.zeros((len(nodes), 6, k, 3))
        for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))):
            B[:, row, :, i] = G[..., j]
            B[:, row, :, j] = G[..., i]
        B = B.reshape(len(nodes), 6, 3 * k)
        dV = weight * np.linalg.det(J)
        K += np.swapaxes(B, 1, 2) @ (LAW.C @ B * dV[:, None, None])
        volumes += dV[:, None] * element.shape.N(place)
    local = np.cumsum(mine) - 1
    dofs = (3 * numbers[nodes][..., None] + np.arange(3)).reshape(len(nodes), -1)
    rows = np.where(mine[nodes][..., None], 3 * local[nodes][..., None] + np.arange(3), -1)
    rows = rows.reshape(len(nodes), -1)
    at = np.broadcast_to(rows[:, :, None], K.shape).ravel()
    own = at >= 0
    columns = np.broadcast_to(dofs[:, None, :], K.shape).ravel()
    shape = 3 * int(mine.sum()), 3 * n_all
    whole = coo_matrix((K.ravel()[own], (at[own], columns[own])), shape=shape).tocsr()
    f = np.zeros(part.points.shape)
    np.add.at(f, nodes, LAW.density * volumes[..., None] * np.array(GRAVITY))
    return whole, f


# ---- one run ---------------------------------------------------------------------------------------


def work(job: dict[str, Any]) -> None:
    """Do the job and write its answer from rank 0."""
    if job["engine"] == "own":
        _answer(job, ALONE)
        return
    if job["engine"] == "whole":
        import_what_is_needed(job)
        _answer(job, start_ranks())
    else:
        _answer(job, world())


def _answer(job: dict[str, Any], ranks: Any) -> None:
    import_what_is_needed(job)
    all_ranks = job["engine"] != "whole"  # what rank 0 alone runs asks the others by a task
    before = _peaks(ranks) if all_ranks else ranks.run(_peaks)
    start = perf_counter()
    model, partition = model_of(job)
    mesh, start = perf_counter() - start, perf_counter()
    u, loads, found = (plain if job["engine"] == "plain" else solved)(model, partition, job)
    seconds = perf_counter() - start - found.get("write", 0.0)
    after = _peaks(ranks) if all_ranks else ranks.run(_peaks)
    own = np.ones(model.mesh.n_nodes, dtype=bool) if partition is None else partition.own
    values = {
        "work": float((loads * u)[own].sum()),
        "largest": float(np.abs(u[own]).max(initial=0.0)),
        "unknowns": 3 * int((own & (model.mesh.points[:, 2] > 0)).sum()),
        "mesh": mesh,
        "seconds": seconds,
    }
    if all_ranks:
        for name, total in (("work", ranks.sum), ("largest", ranks.max), ("unknowns", ranks.sum)):
            values[name] = total(values[name])
    if ranks.rank == 0:
        memory = [int(b - a) for a, b in zip(before, after, strict=True)]
        values |= {"memory": memory, "imports": before, "ranks": ranks.size, "versions": versions()}
        Path(job["answer"]).write_text(json.dumps(found | values))


def _peaks(ranks: Any) -> list[int]:
    found: list[int] = ranks.gather(peak())
    return found


def import_what_is_needed(job: dict[str, Any]) -> None:
    """Import before the clock starts and memory counts, as every program does at its start."""
    names = ["scipy.sparse", "kratos_lite.analysis.static", "kratos_lite.solvers.constrained_system"]
    if job["engine"] != "own":
        names += ["kratos_lite.distributed.petsc_system", "kratos_lite.distributed.multigrid"]
    for name in names:
        import_module(name)
    if job["engine"] != "own":
        from kratos_lite.distributed.petsc import petsc

        petsc()


def versions() -> dict[str, str]:
    """Return the versions of what computes, and whether kernels are compiled for this Python."""
    import mpi4py

    from kratos_lite.native import described

    found = {"kratos_lite": kl.__version__, "NumPy": np.__version__, "mpi4py": mpi4py.__version__}
    if "petsc4py" in sys.modules:
        found["PETSc"] = sys.modules["petsc4py"].__version__
    return found | {"kernels": described()}


if __name__ == "__main__":
    work(json.loads(Path(sys.argv[1]).read_text()))

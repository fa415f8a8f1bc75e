"""scikit-fem: vector elements on its meshes; K through its own assembly, solved by the common routine."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job, assembled, rows_of


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import skfem
    job.answer["version"] = skfem.__version__
    job.read()
    with job.phase("mesh"):
        basis = make_basis(job, skfem)
        nodes = rows_of(basis.doflocs[:, ::3].T, job.points)
    return assembled(job, lambda: stiffness(job, basis), 3 * nodes[:, None] + np.arange(3))


def make_basis(job: Job, skfem: Any) -> Any:
    """Return the basis of the element kind on the mesh."""
    from skfem.io.meshio import INV_HEX_MAPPING

    t, points = job.cells.T, job.points
    if job.kind in ("4N", "10N"):
        mesh = skfem.MeshTet2(points.T, t) if job.kind == "10N" else skfem.MeshTet1(points.T, t)
        element = skfem.ElementTetP2() if job.kind == "10N" else skfem.ElementTetP1()
        return skfem.Basis(mesh, skfem.ElementVector(element), intorder=2 if job.kind == "10N" else 1)
    element = {"8N": skfem.ElementHex1, "20N": skfem.ElementHexS2, "27N": skfem.ElementHex2}[job.kind]()
    if job.kind == "27N":
        mesh = skfem.MeshHex2(points.T, t[INV_HEX_MAPPING])
    else:  # corners alone carry the geometry: straight edges
        corners, first = np.unique(t[:8], return_inverse=True)
        mesh = skfem.MeshHex1(points[corners].T, first.reshape(8, -1)[INV_HEX_MAPPING[:8]])
    return skfem.Basis(mesh, skfem.ElementVector(element), intorder=3 if job.kind == "8N" else 5)


def stiffness(job: Job, basis: Any) -> Any:
    """Return the stiffness matrix."""
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    return linear_elasticity(*lame_parameters(*job.elasticity)).assemble(basis)

"""GetFEM: its elasticity matrix and its MUMPS."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job, rows_of

METHODS = {
    "4N": ("GT_PK(3,1)", "FEM_PK(3,1)", "IM_TETRAHEDRON(1)"),
    "8N": ("GT_QK(3,1)", "FEM_QK(3,1)", "IM_GAUSS_PARALLELEPIPED(3,3)"),
    "10N": ("GT_PK(3,1)", "FEM_PK(3,2)", "IM_TETRAHEDRON(3)"),
    "20N": ("GT_QK(3,1)", "FEM_Q2_INCOMPLETE(3)", "IM_GAUSS_PARALLELEPIPED(3,5)"),
    "27N": ("GT_QK(3,1)", "FEM_QK(3,2)", "IM_GAUSS_PARALLELEPIPED(3,5)"),
}
"""Geometry (straight), element, and rule; the rule of degree 2 on tetrahedra gives errors of 1e-5."""
CORNERS = {"GT_PK(3,1)": [0, 1, 2, 3], "GT_QK(3,1)": [0, 1, 3, 2, 4, 5, 7, 6]}


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import getfem
        import scipy.spatial  # noqa: F401
    job.answer["version"] = getattr(getfem, "__version__", "")
    if job.task == "ale":
        from benchmarks.programs import getfem_ale

        return getfem_ale.work(job, getfem)
    job.read()
    with job.phase("mesh"):
        _mesh, field, rule, coefficients = make_mesh(job, getfem)
        places = rows_of(field.basic_dof_nodes()[:, ::3].T, job.points)

    def stiffness() -> Any:
        ones = np.ones(coefficients.nbdof())
        lam, mu = job.lame
        return getfem.asm_linear_elasticity(rule, field, coefficients, lam * ones, mu * ones)

    K = job.fastest("matrix", stiffness)
    if job.task == "assembly":
        return None
    return solve(job, getfem, K, (3 * places[:, None] + np.arange(3)).ravel())


def solve(job: Job, getfem: Any, K: Any, dofs: Any) -> Array:
    """Return the displacements (n, 3); `dofs` (3n,) are the rows of K of our components."""
    with job.phase("constrain"):
        fixed = np.zeros(len(dofs), dtype=bool)
        u, f = np.zeros(len(dofs)), np.zeros(len(dofs))
        fixed[dofs], f[dofs] = job.fixed.ravel(), job.forces.ravel()
        u[dofs] = np.where(job.fixed, job.values, 0.0).ravel()
        free = np.flatnonzero(~fixed)
        b = (f - np.ravel(K.mult(u)))[free]
        reduced = getfem.Spmat("copy", K, free, free)
    with job.phase("solve"):
        u[free] = np.ravel(getfem.linsolve_mumps(reduced, b))
    job.answer["unknowns"] = len(free)
    return u[dofs].reshape(-1, 3)


def make_mesh(job: Job, getfem: Any) -> tuple[Any, Any, Any, Any]:
    """Return mesh, vector field, integration and the field of the coefficients."""
    geometry, element, rule = METHODS[job.kind]
    corners = job.points[job.nodes[:, CORNERS[geometry]]]
    mesh = getfem.Mesh("empty", 3)
    mesh.add_convex(getfem.GeoTrans(geometry), np.ascontiguousarray(corners.transpose(2, 1, 0)))
    field = getfem.MeshFem(mesh, 3)
    field.set_fem(getfem.Fem(element))
    coefficients = getfem.MeshFem(mesh, 1)
    coefficients.set_classical_fem(0)
    return mesh, field, getfem.MeshIm(mesh, getfem.Integ(rule)), coefficients

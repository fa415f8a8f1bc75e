"""GetFEM: its elasticity matrix; K solved by the common routine."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job, rows_of, run, solve

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
        import scipy.sparse
    job.answer["version"] = getattr(getfem, "__version__", "")
    job.read()
    with job.phase("mesh"):
        _mesh, field, rule, coefficients = make_mesh(job, getfem)
        places = rows_of(field.basic_dof_nodes()[:, ::3].T, job.points)

    def stiffness() -> Any:
        E, nu = job.elasticity.tolist()
        ones = np.ones(coefficients.nbdof())
        lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
        K = getfem.asm_linear_elasticity(rule, field, coefficients, lam * ones, mu * ones)
        pointer, rows = K.csc_ind()
        return scipy.sparse.csc_matrix((K.csc_val(), rows, pointer), shape=K.size())

    K = job.fastest("matrix", stiffness)
    if job.task == "assembly":
        return None
    return solve(job, K, 3 * places[:, None] + np.arange(3))


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


if __name__ == "__main__":
    run(work)

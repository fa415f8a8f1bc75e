"""NGSolve: VectorH1 of order 1, whose unknowns are nodal; K solved by the common routine."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job, assembled


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import netgen.meshing
        import ngsolve
        import scipy.sparse
    job.answer["version"] = ngsolve.__version__
    job.read()
    with job.phase("mesh"):
        mesh = make_mesh(job, netgen.meshing, ngsolve)
        space = ngsolve.VectorH1(mesh, order=1)
        form = bilinear_form(job, ngsolve, space)

    def stiffness() -> Any:
        with ngsolve.TaskManager():
            form.Assemble()
        values, columns, pointer = (np.asarray(part) for part in form.mat.CSR())
        return scipy.sparse.csr_matrix((values, columns, pointer), shape=(space.ndof, space.ndof))

    n = len(job.points)
    return assembled(job, stiffness, np.arange(n)[:, None] + n * np.arange(3))


def make_mesh(job: Job, netgen: Any, ngsolve: Any) -> Any:
    """Return the mesh."""
    mesh = netgen.Mesh()
    mesh.dim = 3
    ids = [mesh.Add(netgen.MeshPoint(netgen.Pnt(*point))) for point in job.points.tolist()]
    mesh.Add(netgen.FaceDescriptor(bc=1, domin=1, domout=0, surfnr=1))
    # netgen numbers the corners of a tetrahedron the other way round
    nodes = job.nodes[:, [0, 2, 1, 3]] if job.kind == "4N" else job.nodes
    for cell in nodes.tolist():
        mesh.Add(netgen.Element3D(1, [ids[node] for node in cell]))
    return ngsolve.Mesh(mesh)


def bilinear_form(job: Job, ngsolve: Any, space: Any) -> Any:
    """Return the bilinear form of linear elasticity."""
    E, nu = job.elasticity.tolist()
    lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    u, v = space.TnT()
    strain_u, strain_v = ngsolve.Sym(ngsolve.Grad(u)), ngsolve.Sym(ngsolve.Grad(v))
    form = ngsolve.BilinearForm(space)
    energy = 2 * mu * ngsolve.InnerProduct(strain_u, strain_v) + lam * ngsolve.div(u) * ngsolve.div(v)
    form += energy * ngsolve.dx
    return form

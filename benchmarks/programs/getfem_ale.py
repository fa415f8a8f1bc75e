"""GetFEM: matrices and loads of a body in flow, from formulas in its language, in our node order.

``python -m benchmarks.programs.getfem_ale given.npz found.npz`` assembles what a test asks for.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from benchmarks import ale
from benchmarks.programs.common import Array, Job, rows_of

METHODS = {
    8: ("GT_QK(3,1)", "FEM_QK(3,1)"),
    20: ("GT_Q2_INCOMPLETE(3)", "FEM_Q2_INCOMPLETE(3)"),
    27: ("GT_QK(3,2)", "FEM_QK(3,2)"),
}
"""Geometry and element by the number of nodes."""
C = "([0,1,0;-1,0,0;0,0,0]*X)"
"""The velocity of a rotation about z, by rows."""
TERMS = {
    "M": "rho*Test_u*Test2_u",
    "G": f"rho*Test_u*({C}.Grad_Test2_u)",
    "H": f"rho*({C}.Grad_Test_u)*({C}.Grad_Test2_u)",
    "K": "lam*Trace(Grad_Test2_u)*Trace(Grad_Test_u) + mu*((Grad_Test2_u + Grad_Test2_u'):Grad_Test_u)",
    "centrifugal": "rho*([1,0,0;0,1,0;0,0,0]*X).Test_u",
    "euler": f"-rho*{C}.Test_u",
}
"""Formulas: GetFEM writes matrices by rows within [ ; ]."""
VECTORS = ("K", "centrifugal", "euler")
"""Those of three components."""
LOADS = ("centrifugal", "euler")


class Wheel:
    """Elements of one kind and what is assembled on them, in the order of given nodes.

    Parameters
    ----------
    points, nodes : (n, 3) and (m, k).
    reference : (k, 3) the nodes of the reference cell on [-1, 1]³, which tell their order.
    material : density, λ and μ.
    """

    def __init__(self, getfem: Any, points: Array, nodes: Any, reference: Array, material: Any) -> None:
        self.getfem, self.nodes, self.material = getfem, nodes, material
        geometry, element = METHODS[nodes.shape[1]]
        transformation = getfem.GeoTrans(geometry)
        theirs = 2 * np.array(transformation.pts()).T - 1
        order = np.abs(theirs[:, None] - reference).max(axis=2).argmin(axis=1)
        self.mesh = getfem.Mesh("empty", 3)
        cells = points[nodes[:, order]].transpose(2, 1, 0)
        self.mesh.add_convex(transformation, np.ascontiguousarray(cells))
        self.fields = {}
        for components in (1, 3):
            self.fields[components] = getfem.MeshFem(self.mesh, components)
            self.fields[components].set_fem(getfem.Fem(element))
        self.rows = rows_of(self.fields[1].basic_dof_nodes().T, points)
        self.integrals: dict[int, Any] = {}

    def rule(self, gauss: int) -> Any:
        """Return the product of Gauss rules of so many points."""
        if gauss not in self.integrals:
            line = f"IM_GAUSS1D({2 * gauss - 1})"
            product = self.getfem.Integ(f"IM_PRODUCT(IM_PRODUCT({line},{line}),{line})")
            self.integrals[gauss] = self.getfem.MeshIm(self.mesh, product)
        return self.integrals[gauss]

    def assemble(self, name: str, gauss: int) -> Any:
        """Return what GetFEM assembles of a term, a matrix or a vector of its own."""
        field = self.fields[3 if name in VECTORS else 1]
        words: list[Any] = ["u", 1, field, np.zeros(field.nbdof())]
        for constant, value in zip(("rho", "lam", "mu"), self.material, strict=True):
            words += [constant, 0, np.array([value])]
        return self.getfem.asm_generic(self.rule(gauss), 1 if name in LOADS else 2, TERMS[name], -1, *words)

    def entries(self, matrix: Any) -> Array:
        """Return a matrix (n, n) or (3n, 3n) as its blocks (nnz, b, b) on the sorted graph of our nodes."""
        from scipy.sparse import csc_matrix, csr_matrix

        starts, rows = matrix.csc_ind()
        A = csc_matrix((matrix.csc_val(), rows, starts)).tocsr()
        n, (m, k) = len(self.rows), self.nodes.shape
        b = A.shape[0] // n
        dofs = (b * self.rows[:, None] + np.arange(b)).ravel()
        blocks = A[dofs][:, dofs].tobsr((b, b))
        node = csr_matrix((np.ones(m * k, dtype=bool), self.nodes.ravel(), np.arange(0, m * k + 1, k)))
        graph = (node.T @ node).tocsr()
        graph.sort_indices()
        found = np.zeros((graph.nnz, b, b))
        found[np.searchsorted(keys(graph), keys(blocks))] = blocks.data
        return found

    def nodal(self, load: Any) -> Array:
        """Return a load as (n, 3)."""
        return np.asarray(load).reshape(-1, 3)[self.rows]


def keys(rows: Any) -> Any:
    """Return row · n + column of each entry of a matrix of rows."""
    n = len(rows.indptr) - 1
    return np.repeat(np.arange(n, dtype=np.int64), np.diff(rows.indptr)) * n + rows.indices


def work(job: Job, getfem: Any) -> Array:
    """Time M, G, H and K; return their entries."""
    job.read()
    E, nu, gauss = ale.YOUNG, ale.POISSON, ale.GAUSS[job.kind]
    material = ale.DENSITY, E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    with job.phase("mesh"):
        body = Wheel(getfem, job.points, job.nodes, job.reference, material)
        body.rule(gauss)
    return ale.timed(
        job,
        lambda names: {name: body.assemble(name, gauss) for name in names},
        lambda: body.assemble("K", gauss),
        body.entries,
    )


def answer(given: str, found: str) -> None:
    """Assemble the terms of one `.npz` file, each by its rule, into another."""
    import getfem

    with np.load(given) as job:
        body = Wheel(getfem, *(job[word] for word in ("points", "nodes", "reference", "material")))
        terms = dict(zip(job["terms"].tolist(), job["gauss"].tolist(), strict=True))
    made = {name: body.assemble(name, gauss) for name, gauss in terms.items()}
    np.savez(
        found,
        **{name: (body.nodal if name in LOADS else body.entries)(value) for name, value in made.items()},
    )


if __name__ == "__main__":
    answer(*sys.argv[1:])

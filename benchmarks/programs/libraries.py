"""Python libraries: each assembles K by itself; the common routine solves, where it brings no solver.

A library is imported when it is run; its function is named in the table of `benchmarks.programs`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job, assembled, rows_of

FEDOO = {"4N": "tet4", "8N": "hex8", "10N": "tet10", "20N": "hex20"}


def fedoo(job: Job) -> Array | None:
    """Take fedoo: its stress-equilibrium weak form."""
    with job.phase("import"):
        import fedoo
    job.answer["version"] = getattr(fedoo, "__version__", "")
    job.read()
    with job.phase("mesh"):
        fedoo.ModelingSpace("3D")
        mesh = fedoo.Mesh(job.points, job.cells, FEDOO[job.kind])
        E, nu = job.elasticity
        weak = fedoo.weakform.StressEquilibrium(fedoo.constitutivelaw.ElasticIsotrop(E, nu))

        assembly = fedoo.Assembly.create(weak, mesh)
        fedoo.problem.Linear(assembly)

    def stiffness() -> Any:
        assembly.assemble_global_mat("matrix")
        return assembly.get_global_matrix()

    n = len(job.points)
    return assembled(job, stiffness, np.arange(n)[:, None] + n * np.arange(3))


FELUPE = {
    "4N": ("tetra", "RegionTetra"),
    "8N": ("hexahedron", "RegionHexahedron"),
    "10N": ("tetra10", "RegionQuadraticTetra"),
    "20N": ("hexahedron20", "RegionQuadraticHexahedron"),
    "27N": ("hexahedron27", "RegionTriQuadraticHexahedron"),
}


def felupe(job: Job) -> Array | None:
    """FElupe: its linear-elastic material and solid body."""
    with job.phase("import"):
        import felupe
    job.answer["version"] = felupe.__version__
    job.read()
    cell, region = FELUPE[job.kind]
    with job.phase("mesh"):
        mesh = felupe.Mesh(job.points, job.cells, cell)
        field = felupe.FieldContainer([felupe.Field(getattr(felupe, region)(mesh), dim=3)])
        E, nu = job.elasticity
        material = felupe.LinearElastic(E=E, nu=nu)
    return assembled(job, felupe.SolidBody(material, field).assemble.matrix)


def scikit_fem(job: Job) -> Array | None:
    """Take scikit-fem: vector elements on its meshes; its own assembly."""
    with job.phase("import"):
        import skfem
    job.answer["version"] = skfem.__version__
    job.read()
    with job.phase("mesh"):
        basis = skfem_basis(job, skfem)
        nodes = rows_of(basis.doflocs[:, ::3].T, job.points)
    return assembled(job, lambda: skfem_stiffness(job, basis), 3 * nodes[:, None] + np.arange(3))


def skfem_basis(job: Job, skfem: Any) -> Any:
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


def skfem_stiffness(job: Job, basis: Any) -> Any:
    """Return the stiffness matrix."""
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    return linear_elasticity(*lame_parameters(*job.elasticity)).assemble(basis)


SFEPY = {"4N": ("3_4", 4, 1), "8N": ("3_8", 8, 1), "10N": ("3_4", 4, 2), "27N": ("3_8", 8, 2)}
"""Cell, its corners, and the order of the field."""


def sfepy(job: Job) -> Array | None:
    """SfePy: its linear-elastic term on Lagrange fields."""
    with job.phase("import"):
        import sfepy
        import sfepy.discrete.fem
        import sfepy.mechanics.matcoefs
        import sfepy.terms
    sfepy.base.base.output.set_output(quiet=True)
    job.answer["version"] = sfepy.__version__
    job.read()
    with job.phase("mesh"):
        problem, field = sfepy_problem(job)
        places = rows_of(field.get_coor(), job.points)
        evaluator, start = problem.get_evaluator(), problem.get_initial_state()()
    dofs = 3 * places[:, None] + np.arange(3)
    return assembled(job, lambda: evaluator.eval_tangent_matrix(start), dofs)


def sfepy_problem(job: Job) -> tuple[Any, Any]:
    """Return the problem without any support, and its field."""
    from sfepy.discrete import Equation, Equations, FieldVariable, Integral, Material, Problem
    from sfepy.discrete.conditions import Conditions
    from sfepy.discrete.fem import FEDomain, Field, Mesh
    from sfepy.mechanics.matcoefs import stiffness_from_youngpoisson
    from sfepy.terms import Term

    cell, corners, order = SFEPY[job.kind]
    used, nodes = np.unique(job.nodes[:, :corners], return_inverse=True)
    nodes = nodes.reshape(-1, corners).astype(np.int32)
    groups, ids = np.zeros(len(used), dtype=np.int32), np.zeros(len(nodes), dtype=np.int32)
    mesh = Mesh.from_data("mesh", job.points[used], groups, [nodes], [ids], [cell])
    omega = FEDomain("domain", mesh).create_region("Omega", "all")
    field = Field.from_args("u", np.float64, "vector", omega, approx_order=order)
    u = FieldVariable("u", "unknown", field)
    v = FieldVariable("v", "test", field, primary_var_name="u")
    material = Material("m", D=stiffness_from_youngpoisson(3, *job.elasticity))
    integral = Integral("i", order={"4N": 1, "8N": 3, "10N": 2, "27N": 5}[job.kind])
    term = Term.new("dw_lin_elastic(m.D, v, u)", integral, omega, m=material, v=v, u=u)
    problem = Problem("elasticity", equations=Equations([Equation("balance", term)]))
    problem.set_bcs(ebcs=Conditions([]))
    problem.time_update()
    problem.update_materials()
    return problem, field


def ngsolve(job: Job) -> Array | None:
    """NGSolve: VectorH1 of order 1, whose unknowns are nodal."""
    with job.phase("import"):
        import netgen.meshing
        import ngsolve
        import scipy.sparse
    job.answer["version"] = ngsolve.__version__
    job.read()
    with job.phase("mesh"):
        mesh = ngsolve_mesh(job, netgen.meshing, ngsolve)
        space = ngsolve.VectorH1(mesh, order=1)
        form = ngsolve_form(job, ngsolve, space)

    def stiffness() -> Any:
        with ngsolve.TaskManager():
            form.Assemble()
        values, columns, pointer = (np.asarray(part) for part in form.mat.CSR())
        return scipy.sparse.csr_matrix((values, columns, pointer), shape=(space.ndof, space.ndof))

    n = len(job.points)
    return assembled(job, stiffness, np.arange(n)[:, None] + n * np.arange(3))


def ngsolve_mesh(job: Job, netgen: Any, ngsolve: Any) -> Any:
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


def ngsolve_form(job: Job, ngsolve: Any, space: Any) -> Any:
    """Return the bilinear form of linear elasticity."""
    lam, mu = job.lame
    u, v = space.TnT()
    strain_u, strain_v = ngsolve.Sym(ngsolve.Grad(u)), ngsolve.Sym(ngsolve.Grad(v))
    form = ngsolve.BilinearForm(space)
    energy = 2 * mu * ngsolve.InnerProduct(strain_u, strain_v) + lam * ngsolve.div(u) * ngsolve.div(v)
    form += energy * ngsolve.dx
    return form


JAX_FEM = {"4N": "TET4", "8N": "HEX8", "10N": "TET10", "27N": "HEX27"}
JAX_DEGREES = {"4N": 1, "8N": 3, "10N": 2, "27N": 5}
"""Of the rules of integration; its own choice for 27N takes 6³ points."""


def jax_fem(job: Job) -> Array | None:
    """JAX-FEM: element matrices by its compiled derivative of the weak form."""
    with job.phase("import"):
        import importlib.metadata

        import jax

        jax.config.update("jax_enable_x64", True)
        import jax_fem.problem
        import scipy.sparse
    jax_fem.logger.setLevel("ERROR")
    job.answer["version"] = importlib.metadata.version("jax-fem")
    job.read()
    with job.phase("mesh"):
        problem = jax_problem(job, jax, jax_fem)

    def stiffness() -> Any:
        zero = jax.numpy.zeros(job.points.shape)
        problem.newton_update([zero])
        return scipy.sparse.csr_matrix((problem.V, (problem.I, problem.J)), shape=(zero.size, zero.size))

    return assembled(job, stiffness)


def jax_problem(job: Job, jax: Any, jax_fem: Any) -> Any:
    """Return the problem without supports and loads."""
    lam, mu = job.lame

    class Elasticity(jax_fem.problem.Problem):  # type: ignore[misc]
        def get_tensor_map(self) -> Any:
            def stress(gradient: Any) -> Any:
                strain = (gradient + gradient.T) / 2
                return lam * jax.numpy.trace(strain) * jax.numpy.eye(3) + 2 * mu * strain

            return stress

    kind = JAX_FEM[job.kind]
    mesh = jax_fem.problem.Mesh(job.points, job.cells, ele_type=kind)
    return Elasticity(mesh, vec=3, dim=3, ele_type=kind, gauss_order=JAX_DEGREES[job.kind])


def torch_fem(job: Job) -> Array | None:
    """Take torch-fem: its solid model, its assembly and its solver (PARDISO or multigrid, as it chooses)."""
    with job.phase("import"):
        import importlib.metadata

        import torch
        import torchfem
        import torchfem.materials
        import torchfem.sparse
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(job.given.get("threads", torch.get_num_threads()))
    job.answer["version"] = importlib.metadata.version("torch-fem")
    job.read()
    with job.phase("mesh"):
        E, nu = job.elasticity.tolist()
        material = torchfem.materials.IsotropicElasticity3D(E=E, nu=nu)
        cells = torch.from_numpy(job.cells.astype(np.int64))
        factors = torch.tensor(job.factors, requires_grad=True)
        if job.task == "gradient":
            material = material.vectorize(len(cells))
            material.C = factors[:, None, None, None, None] * material.C
        model = torchfem.Solid(torch.from_numpy(job.points), cells, material)
    if job.task == "gradient":
        return torch_gradient(job, torch, model, factors)
    k = job.fastest("matrix", model.k0)
    return None if job.task == "assembly" else torch_solve(job, torch, torchfem.sparse, model, k)


def torch_gradient(job: Job, torch: Any, model: Any, factors: Any) -> Array:
    """Return the derivative (m,) of the work of the loads by a factor of the stiffness of each element."""
    model.constraints[torch.from_numpy(job.fixed)] = True
    model.forces[:] = torch.from_numpy(job.forces)
    with job.phase("forward"):
        u, *_ = model.solve(stol=job.tolerance, differentiable_parameters=factors)
    with job.phase("gradient"):
        torch.inner(model.forces.ravel(), u.ravel()).backward()
    return np.asarray(factors.grad)


def torch_solve(job: Job, torch: Any, sparse: Any, model: Any, k: Any) -> Array:
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


def meshio(job: Job) -> Array | None:
    """Take meshio: it reads nodes and cells of the `.mdpa` file, elements as a wrong cell type."""
    with job.phase("import"):
        import meshio
    job.answer["version"] = meshio.__version__
    with job.phase("read"):
        meshio.read(f"{job.stem}.mdpa")

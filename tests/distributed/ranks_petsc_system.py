"""Equations over ranks in PETSc: the same displacements as those of one process."""

import numpy as np

import kratos_lite as kl
from kratos_lite.distributed.petsc_system import PetscSystem, Prescribed
from kratos_lite.distributed.subdomains import scattered
from kratos_lite.solvers.constrained_system import ConstrainedSystem

EXACT = -1.3221477551020406e-4


def cube(cells=4):
    model = kl.Model(kl.box(cells=(cells,) * 3), kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0))
    for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    return model


def slabs(mesh, ranks):
    """Cut along z."""
    z = np.array([mesh.points[nodes].mean(axis=0)[2] for block in mesh.blocks for nodes in block.nodes])
    part = np.minimum((z / np.ptp(mesh.points[:, 2]) * ranks.size).astype(int), ranks.size - 1)
    return scattered(mesh, ranks, part)


def at_random(mesh, ranks):
    return scattered(mesh, ranks, np.random.default_rng(1).integers(0, ranks.size, mesh.n_elements))


def forces_of(model, groups):
    from kratos_lite.analysis.nodal_loads import external_loads

    return external_loads(model.mesh, groups, model.loads)


def solve_here(model, mesh, **options):
    """Return the displacements and reactions of this rank, and the solution."""
    rows = np.searchsorted(model.mesh.node_ids, mesh.node_ids)
    share = kl.Model(mesh, kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0))
    groups = share.element_groups()
    f = np.asarray(forces_of(model, model.element_groups()))[rows]
    supports = model.supports
    held = Prescribed(supports.fixed[rows], supports.values[rows], (), str)
    system = PetscSystem(mesh, groups, held, **options)
    u, solution = system.solve(f)
    residual = system.residual(u, f)
    system.destroy()
    return rows, u, residual, solution


def test_gravity_cube(ranks, cut, solver):
    model = cube()
    mesh = cut(model.mesh, ranks)
    rows, u, residual, solution = solve_here(model, mesh, solver=solver)
    f = forces_of(model, model.element_groups())
    serial = ConstrainedSystem(model.mesh.points, model.element_groups(), model.supports.constraint_map)
    expected, _ = serial.solve(f)
    assert np.abs(u - expected[rows]).max() < 1e-8 * np.abs(expected).max()
    top = u[np.isclose(mesh.points[:, 2], 1.0), 2]
    assert ranks.sum(len(top)) > 0
    assert np.allclose(top, EXACT, rtol=1e-8, atol=0)
    reactions = serial.residual(expected, f)[rows]
    assert np.abs(residual - reactions).max() < 1e-8 * np.abs(reactions).max(initial=1.0)
    assert solution.backward_error < 1e-10


test_gravity_cube.cases = [(cut, solver) for cut in (slabs, at_random) for solver in ("direct", "amg")]

"""Equations over ranks in PETSc: the same displacements and reactions as those of one process."""

from dataclasses import replace

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.nodal_loads import external_loads, initial_loads
from kratos_lite.distributed.petsc_system import PetscSystem, Prescribed
from kratos_lite.distributed.scatter import scattered
from kratos_lite.errors import InputError, SolveError
from kratos_lite.mesh import Block
from kratos_lite.solvers.constrained_system import ConstrainedSystem

EXACT = -1.3221477551020406e-4
STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
GRAVITY = kl.Gravity((0.0, 0.0, -9.81))
SIDEWAYS = kl.Gravity((3.0, 5.0, -9.81))


# ---- ways to cut a mesh ------------------------------------------------------------------------


def slabs(mesh, ranks):
    """Cut across z."""
    z = np.concatenate([mesh.points[block.nodes].mean(axis=1)[:, 2] for block in mesh.blocks])
    return np.minimum((z / np.ptp(mesh.points[:, 2]) * ranks.size).astype(int), ranks.size - 1)


def at_random(mesh, ranks):
    return np.random.default_rng(1).integers(0, ranks.size, mesh.n_elements)


def one_empty(mesh, ranks):
    """Leave the first rank without elements, if there are several."""
    return at_random(mesh, ranks) % max(ranks.size - 1, 1) + (ranks.size > 1)


# ---- models, whole on each rank ----------------------------------------------------------------


def cube(element="8N", cells=4):
    model = kl.Model(kl.box(cells=(cells,) * 3, element=element), STEEL)
    for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(GRAVITY)
    return model


def clamped(element="8N", cells=4):
    model = kl.Model(kl.box(cells=(cells,) * 3, element=element), STEEL)
    model.fix("z-")
    model.add(SIDEWAYS)
    return model


def quadratic():
    return clamped("27N", 3)


def tetrahedra():
    return clamped("10N", 2)


def mixed_cells():
    """Bricks, of which one is cut into pyramids, one into wedges and one into tetrahedra."""
    mesh = kl.box(cells=(3, 3, 3))
    cells, center = mesh.blocks[0].nodes, mesh.n_nodes
    faces = ([0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7])
    pyramids = [[*cells[-1][face][::-1], center] for face in faces]
    wedges = cells[-2][[[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]]
    corners = ([0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7])
    blocks, first = [], 1
    kinds = (("8N", cells[:-3]), ("5N", pyramids), ("6N", wedges), ("4N", cells[-3][list(corners)]))
    for name, nodes in kinds:
        rows = np.asarray(nodes, dtype=np.int32)
        blocks.append(
            Block(f"Element3D{name}", rows, np.arange(first, first + len(rows)), np.zeros(len(rows), int))
        )
        first += len(rows)
    points = np.vstack([mesh.points, mesh.points[cells[-1]].mean(axis=0)])
    model = kl.Model(kl.Mesh(points, blocks), STEEL)
    model.fix(lambda x: x[:, 2] < 1e-9)
    model.add(SIDEWAYS)
    return model


def materials():
    model = clamped()
    right = np.flatnonzero(model.mesh.points[model.mesh.blocks[0].nodes].mean(axis=1)[:, 0] > 0.5)
    model.assign(kl.Isotropic3D(E=2e4, nu=0.45, density=900.0), right)
    return model


def displaced():
    """Displaced at two sides, unlike."""
    model = clamped()
    model.fix("z+", "xz", (1e-3, -2e-3))
    model.fix(lambda x: (x[:, 0] == 1) & (x[:, 2] > 0), "y", 5e-4)
    return model


def carried():
    """All supports displace alike: the whole body moves along."""
    model = clamped()
    model.fix("z-", "x", 3.0, override=True)
    return model


def nearly_incompressible():
    model = clamped()
    model.assign(kl.Isotropic3D(E=1e6, nu=0.4999, density=1000.0))
    return model


def prestressed():
    model = clamped()
    rng = np.random.default_rng(0)
    model.add_prestress(1e3 * rng.normal(size=(model.mesh.n_elements, 6)))
    model.stress_free_at(1e-4 * rng.normal(size=(model.mesh.n_nodes, 3)))
    return model


def tied():
    """A chain of constraints through the whole body, over several ranks, and one with weights."""
    model = clamped()
    top = model.mesh.nodes("z+")
    low = model.mesh.nodes(lambda x: np.isclose(x[:, 2], 0.25))
    model.constrain((top[0], "z"), {(low[3], "z"): 1.0})
    model.constrain((low[3], "z"), {(top[7], "z"): 0.5, (low[8], "z"): 0.5}, 1e-4)
    model.constrain((top[7], "z"), {(top[12], "z"): 1.0})
    model.constrain((top[20], "x"), {(low[1], "y"): -2.0, (low[2], "z"): 1.0}, -2e-4)
    return model


def tied_to_supports():
    """Masters that are prescribed, of which one moves."""
    model = clamped()
    model.fix(lambda x: (x[:, 0] == 1) & (x[:, 2] > 0), "y", 1e-3)
    top, side = model.mesh.nodes("z+"), model.mesh.nodes("x+")
    model.constrain((top[0], "y"), {(side[-1], "y"): 0.5, (top[1], "x"): 0.25})
    return model


MODELS = (cube, clamped, quadratic, tetrahedra, mixed_cells, materials, displaced, carried)
MODELS += (nearly_incompressible, prestressed, tied, tied_to_supports)


# ---- the same, cut -----------------------------------------------------------------------------


class Share:
    """What a rank holds of a model that all know whole."""

    def __init__(self, ranks, model, cut=slabs, **options):
        supports, whole = model.supports, model.mesh
        dofs = [np.array([one.slave, *one.masters]) for one in supports.constraints]
        self.mesh = scattered(whole, ranks, cut(whole, ranks), together=[np.unique(one // 3) for one in dofs])
        self.rows = np.searchsorted(whole.node_ids, self.mesh.node_ids)
        place = np.full(whole.n_nodes, -1)
        place[self.rows] = np.arange(len(self.rows))
        here = np.isin(whole.element_ids, self.mesh.element_ids)
        whole_groups = model.element_groups()
        groups = [one.take(here[one.rows]) for one in whole_groups]
        groups = [replace(one, nodes=place[one.nodes].astype(np.int32)) for one in groups if len(one)]
        constraints = [
            replace(
                one,
                slave=int(3 * place[one.slave // 3] + one.slave % 3),
                masters=tuple(int(3 * place[dof // 3] + dof % 3) for dof in one.masters),
            )
            for one, used in zip(supports.constraints, dofs, strict=True)
            if (place[used // 3] >= 0).all()
        ]
        fixed, values = supports.fixed[self.rows], supports.values[self.rows]
        held = Prescribed(fixed, values, constraints, lambda dof: f"dof {dof}")
        self.system = PetscSystem(self.mesh, groups, held, **options)
        self.whole = ConstrainedSystem(whole.points, whole_groups, supports.constraint_map)
        loads, initial = external_loads(whole, whole_groups, model.loads), initial_loads(model, whole_groups)
        self.forces = loads if initial is None else loads - initial

    def check(self, **options):
        """Compare displacements and reactions with those of one process; return the solution."""
        expected, _ = self.whole.solve(self.forces, tolerance=1e-12)
        u, solution = self.system.solve(self.forces[self.rows], **options)
        size = np.abs(expected).max()
        assert np.abs(u - expected[self.rows]).max(initial=0.0) < 1e-8 * size
        left = self.whole.residual(expected, self.forces)
        found = self.system.residual(u, self.forces[self.rows])
        assert np.abs(found - left[self.rows]).max(initial=0.0) < 1e-8 * np.abs(left).max()
        assert solution.backward_error < 1e-12
        return u, solution


def test_same_as_one_process(ranks, model, cut, solver):
    share = Share(ranks, model(), cut, solver=solver, tolerance=1e-12)
    share.check()
    share.system.destroy()


test_same_as_one_process.cases = [
    (model, cut, solver) for model in MODELS for cut in (slabs, at_random) for solver in ("direct", "amg")
] + [(model, one_empty, solver) for model in (clamped, tied, quadratic) for solver in ("direct", "amg")]


def test_gravity_cube(ranks):
    share = Share(ranks, cube())
    u, solution = share.check()
    top = np.isclose(share.mesh.points[:, 2], 1.0)
    assert np.allclose(u[top, 2], EXACT, rtol=1e-12, atol=0)
    assert (solution.method, solution.iterations) == ("mumps (PETSc)", 0)
    share.system.destroy()


def test_prescribed_values_change_without_a_new_matrix(ranks):
    model = tied_to_supports()
    share = Share(ranks, model, at_random)
    share.check()
    matrix = share.system._A
    values = 3.0 * model.supports.values + 1e-4 * model.supports.fixed
    expected, _ = share.whole.solve(
        share.forces, model.supports.constraint_map(share.whole.nodes, values).c, tolerance=1e-12
    )
    given = share.system.displacements(values[share.rows])
    u, _ = share.system.solve(share.forces[share.rows], given)
    assert share.system._A is matrix
    assert np.abs(u - expected[share.rows]).max() < 1e-8 * np.abs(expected).max()
    share.system.destroy()


def test_an_iteration_begins_near_the_solution(ranks):
    share = Share(ranks, clamped(cells=6), solver="amg", options="-pc_type gamg")
    u, first = share.check()
    _, again = share.check(start=u)
    assert first.iterations > 5 > again.iterations
    share.system.destroy()


def test_options_win_and_unused_ones_are_told(ranks):
    share = Share(ranks, clamped(), options="-ksp_type gmres -pc_type jacobi -ksp_max_it 5000 -pc_gamg_x 3")
    _, solution = share.check()
    assert solution.method == "gmres + jacobi (PETSc)"
    assert share.system.warnings == ["PETSc has not used these options: -pc_gamg_x; they may be misspelt"]
    share.system.destroy()


def test_an_iteration_that_fails_is_told_where_options_ask_for_it(ranks):
    share = Share(ranks, clamped(), options="-pc_type jacobi -ksp_max_it 3")
    with pytest.raises(SolveError, match="not converged after 3 iterations"):
        share.check()
    share.system.destroy()


def test_a_body_that_nothing_holds(ranks, solver):
    share = Share(ranks, clamped(), solver=solver)
    groups, held = share.system.groups, share.system._prescribed
    held.fixed[:] = False
    free = PetscSystem(share.mesh, groups, held, solver=solver)
    with pytest.raises(SolveError, match="singular"):
        free.solve(share.forces[share.rows])
    free.destroy()


test_a_body_that_nothing_holds.cases = ["direct", "amg"]


def test_a_type_that_does_not_exist_is_an_input_error(ranks):
    share = Share(ranks, clamped(), options="-pc_type gamgg")
    with pytest.raises(InputError, match="gamgg"):
        share.check()
    share.system.destroy()

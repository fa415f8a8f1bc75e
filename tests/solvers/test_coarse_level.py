"""The linear level of a mesh of quadratic elements: its interpolation and its stiffness."""

import numpy as np
import pytest
from computing import most
from scipy.sparse import csr_array

import kratos_lite as kl
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_dense, assemble_stiffness
from kratos_lite.elements import ELEMENTS
from kratos_lite.mesh.refinement import refine
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.solvers.coarse_level import apply_ties, p_coarse_level
from kratos_lite.solvers.constrained_system import ConstrainedSystem

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
LINEAR_OF = {"3D10N": "3D4N", "3D13N": "3D5N", "3D15N": "3D6N", "3D20N": "3D8N", "3D27N": "3D8N"}


def scene(suffix, cells=(3, 2, 2)):
    """Return points and groups of a skewed box."""
    mesh = kl.box((1.0, 1.5, 0.8), cells=cells, element=f"KinematicLinear{suffix}")
    points = mesh.points @ np.array([[1.0, 0.2, 0.0], [0.0, 1.1, 0.3], [0.1, 0.0, 0.9]])
    return points, kl.Model(mesh, STEEL).element_groups()


def interpolation(level, n):
    return csr_array((level.weights, level.indices, level.indptr), shape=(n, len(level.nodes)))


@pytest.mark.parametrize("suffix", LINEAR_OF)
def test_interpolation_reproduces_a_linear_field_on_straight_cells(suffix):
    points, groups = scene(suffix)
    level = p_coarse_level(points, groups)
    P = interpolation(level, len(points))
    np.testing.assert_allclose(P @ points[level.nodes], points, rtol=0, atol=1e-14)
    np.testing.assert_allclose(P.sum(axis=1), 1.0, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(P[level.nodes].toarray(), np.eye(len(level.nodes)))
    assert (level.weights != 0).all()
    assert all((np.diff(row) > 0).all() for row in np.split(level.indices, level.indptr[1:-1]))


@pytest.mark.parametrize(("suffix", "linear"), LINEAR_OF.items())
def test_stiffness_is_that_of_the_linear_mesh(suffix, linear):
    points, groups = scene(suffix)
    level = p_coarse_level(points, groups)
    coarse_points, coarse = scene(linear)
    K = assemble_stiffness(coarse_points, coarse, Pattern(len(coarse_points), [b.nodes for b in coarse]))
    same = np.array([np.abs(coarse_points - x).max(axis=1).argmin() for x in points[level.nodes]])
    dofs = (3 * same[:, None] + np.arange(3)).ravel()
    want = K.scipy().toarray()[np.ix_(dofs, dofs)]
    np.testing.assert_allclose(level.K.scipy().toarray(), want, rtol=0, atol=1e-14 * np.abs(want).max())


@pytest.mark.parametrize("suffix", ["3D15N", "3D20N", "3D27N"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_long_cells_are_halved(suffix, axis):
    if suffix == "3D15N" and axis < 2:
        pytest.skip("wedges are halved between their triangles")
    size, cells = np.ones(3), np.array([2, 2, 2])
    size[axis] = 20.0
    mesh = kl.box(size, cells, f"KinematicLinear{suffix}")
    level = p_coarse_level(mesh.points, kl.Model(mesh, STEEL).element_groups())
    P = interpolation(level, mesh.n_nodes)
    np.testing.assert_allclose(P @ mesh.points[level.nodes], mesh.points, rtol=0, atol=1e-13)
    cells[axis] *= 2
    halves = kl.box(size, cells, f"KinematicLinear{LINEAR_OF[suffix]}")
    groups = kl.Model(halves, STEEL).element_groups()
    K = assemble_stiffness(halves.points, groups, Pattern(halves.n_nodes, [b.nodes for b in groups]))
    same = np.array([np.abs(halves.points - x).max(axis=1).argmin() for x in mesh.points[level.nodes]])
    assert len(np.unique(same)) == halves.n_nodes
    dofs = (3 * same[:, None] + np.arange(3)).ravel()
    want = K.scipy().toarray()[np.ix_(dofs, dofs)]
    np.testing.assert_allclose(level.K.scipy().toarray(), want, rtol=0, atol=1e-13 * np.abs(want).max())


def test_long_cells_are_halved_beside_others():
    mesh = kl.box((2.0, 1.0, 1.0), (2, 1, 1), "KinematicLinear3D20N")
    points = mesh.points.copy()
    points[:, 0] = np.where(points[:, 0] > 1.0, 1.0 + 9.0 * (points[:, 0] - 1.0), points[:, 0])
    level = p_coarse_level(points, kl.Model(kl.Mesh(points, mesh.blocks), STEEL).element_groups())
    assert len(level.nodes) == 12 + 4
    P = interpolation(level, len(points))
    np.testing.assert_allclose(P @ points[level.nodes], points, rtol=0, atol=1e-13)


def test_a_few_long_cells_are_left_whole():
    mesh = kl.box((3.0, 1.0, 1.0), (3, 1, 1), "KinematicLinear3D20N")
    points = mesh.points.copy()
    points[:, 0] = np.where(points[:, 0] > 2.0, 2.0 + 9.0 * (points[:, 0] - 2.0), points[:, 0])
    level = p_coarse_level(points, kl.Model(kl.Mesh(points, mesh.blocks), STEEL).element_groups())
    assert len(level.nodes) == 16
    assert not level.halved


def test_linear_meshes_have_no_level():
    for suffix in LINEAR_OF.values():
        assert p_coarse_level(*scene(suffix)) is None


def test_linear_elements_take_part_as_they_are():
    points, (quadratic,) = scene("3D20N", (2, 1, 1))
    first = ElementGroup(quadratic.element, quadratic.rule, STEEL, quadratic.nodes[:1], np.array([0]))
    brick = ELEMENTS["KinematicLinear3D8N"]
    rule = kl.quadrature.hexahedron(degree=1)  # a choice of its own, to be kept
    second = ElementGroup(brick, rule, STEEL, quadratic.nodes[1:, :8], np.array([1]))
    level = p_coarse_level(points, [first, second])
    used = np.unique(np.concatenate([first.nodes.ravel(), second.nodes.ravel()]))
    P = interpolation(level, len(points))
    np.testing.assert_allclose((P @ points[level.nodes])[used], points[used], rtol=0, atol=1e-14)
    unused = np.setdiff1d(np.arange(len(points)), used)
    assert len(unused) > 0
    assert not np.diff(level.indptr)[unused].any()
    coarse = [
        ElementGroup(brick, rule_, STEEL, np.searchsorted(level.nodes, b.nodes[:, :8]), b.rows)
        for rule_, b in ((brick.rule, first), (rule, second))
    ]
    want = assemble_dense(points[level.nodes], coarse)
    np.testing.assert_allclose(level.K.scipy().toarray(), want, rtol=0, atol=1e-14 * np.abs(want).max())


def test_shapes_without_corners_have_no_level():
    points, (group,) = scene("3D8N")
    with kl.shapes.SHAPES.temporary(), ELEMENTS.temporary():

        class Shifted(Hexahedron8):
            nodes = 0.5 * Hexahedron8.nodes

        class KinematicLinearShifted(kl.KinematicLinear):
            shape = Shifted
            rule = kl.quadrature.hexahedron(degree=3)

        other = ElementGroup(
            KinematicLinearShifted, KinematicLinearShifted.rule, STEEL, group.nodes, group.rows
        )
        assert p_coarse_level(points, [other]) is None


# ---- ties -------------------------------------------------------------------------------------------


def periodic(axes="xyz", cells=(4, 3, 3)):
    """Return a box of 20-node bricks on its lower side, whose faces y+ follow y- along some axes."""
    mesh = kl.box((4.0, 3.0, 3.0), cells, "KinematicLinear3D20N")
    model = kl.Model(mesh, kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0))
    model.fix("z-")
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    X = mesh.points
    low, high = (np.flatnonzero((X[:, 1] == y) & (X[:, 2] > 0)) for y in (0.0, 3.0))
    for dependent in high:
        independent = low[np.abs(X[low] - X[dependent] * [1, 0, 1]).max(axis=1).argmin()]
        for axis in axes:
            model.constrain((int(dependent), axis), {(int(independent), axis): 1.0})
    return model


def test_tied_faces_of_quadratic_elements_take_few_iterations():
    model = periodic()
    found, expected = model.solve("amg"), model.solve("direct")
    assert found.report.solver == "amg"
    assert found.report.iterations <= most(25, 35)  # 77 where both sides come apart
    np.testing.assert_allclose(found.u, expected.u, rtol=0, atol=1e-10 * np.abs(expected.u).max())


def test_ties_along_one_axis_leave_the_level_as_it_is():
    model = periodic("y", (2, 2, 2))
    constraints = model.supports.constraint_map
    system = ConstrainedSystem(model.mesh.points, model.element_groups(), constraints, solver="amg")
    level = p_coarse_level(system.points, system.groups)
    assert apply_ties(level, system.constraint_map.T, system.constraint_map.free) is level
    assert model.solve("amg").report.backward_error < 1e-14


def test_hanging_nodes_need_no_ties():
    mesh = kl.box(cells=(2, 2, 2), element="KinematicLinear3D20N")
    mesh = refine(mesh, [0]).mesh
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    system = ConstrainedSystem(
        mesh.points, model.element_groups(), model.supports.constraint_map, hanging=mesh.hanging
    )
    level = p_coarse_level(system.points, system.groups, mesh.hanging)
    assert system.constraint_map.T is not None
    assert apply_ties(level, system.constraint_map.T, system.constraint_map.free) is level


def test_a_level_under_ties_moves_rigidly():
    model = periodic(cells=(2, 2, 2))
    constraints = model.supports.constraint_map
    system = ConstrainedSystem(model.mesh.points, model.element_groups(), constraints, solver="amg")
    level = p_coarse_level(system.points, system.groups)
    kept = apply_ties(level, system.constraint_map.T, system.constraint_map.free)
    shape = (model.mesh.n_nodes, len(level.nodes))
    P = csr_array((kept.weights, kept.indices, kept.indptr), shape=shape)
    ones = np.ones(P.shape[1])
    dependents = np.flatnonzero(model.mesh.points[level.nodes][:, 1] == 3.0)
    np.testing.assert_allclose(P @ ones, 1.0, rtol=0, atol=1e-14)
    assert abs(kept.K @ np.tile([1.0, 0.0, 0.0], len(ones))).max() < 1e-9 * kept.K.norm()
    held = dependents[model.mesh.points[level.nodes][dependents][:, 2] > 0]
    assert np.abs(P[:, held]).sum() == 0  # their unknowns are those of those they depend on

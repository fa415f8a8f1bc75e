"""Coarse levels: linear elements inside quadratic ones, with hanging and tied nodes; lines across plates."""

from itertools import product

import numpy as np
import pytest
from computing import most
from rounding import close
from scipy.sparse import bsr_array
from systems import assert_linear, interpolation, parts_of, stiffness_of, system_of

import kratos_lite as kl
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import totals
from kratos_lite.assembly.stiffness import assemble_dense
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.solvers.coarse_level import apply_ties, p_coarse_level
from kratos_lite.solvers.plate_level import _shell_modes, plate_axes, plate_level
from kratos_lite.verification.meshes import warped

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
LINEAR_OF = {"10N": "4N", "13N": "5N", "15N": "6N", "20N": "8N", "27N": "8N"}


def scene(kind, cells=(3, 2, 2), size=(1.0, 1.5, 0.8)):
    """Return points and groups of a skewed box."""
    mesh = kl.box(size, tuple(cells), f"KinematicLinear3D{kind}")
    points = mesh.points @ np.array([[1.0, 0.2, 0.0], [0.0, 1.1, 0.3], [0.1, 0.0, 0.9]])
    return points, kl.Model(mesh, STEEL).element_groups()


@pytest.mark.parametrize(
    ("kind", "axis"),
    [*((kind, None) for kind in LINEAR_OF), ("15N", 2), *product(("20N", "27N"), range(3))],
)
def test_the_level_is_the_mesh_of_linear_elements_with_long_cells_halved(kind, axis):
    size, cells = np.array([1.0, 1.5, 0.8]), np.array([3, 2, 2])
    if axis is not None:
        size[axis] = 40.0
    points, groups = scene(kind, cells, size)
    level = p_coarse_level(points, groups)
    P = assert_linear(level, points)
    np.testing.assert_allclose(P.sum(axis=1), 1.0, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(P[level.nodes].toarray(), np.eye(len(level.nodes)))
    assert (level.weights != 0).all()
    assert all((np.diff(row) > 0).all() for row in np.split(level.indices, level.indptr[1:-1]))
    if axis is not None:
        cells[axis] *= 2
    coarse_points, coarse = scene(LINEAR_OF[kind], cells, size)
    same = np.array([np.abs(coarse_points - x).max(axis=1).argmin() for x in points[level.nodes]])
    assert len(np.unique(same)) == len(coarse_points)
    dofs = (3 * same[:, None] + np.arange(3)).ravel()
    want = stiffness_of(coarse_points, coarse).scipy().toarray()[np.ix_(dofs, dofs)]
    close(level.K.scipy().toarray(), want, 1e-13)


@pytest.mark.parametrize(("cells", "nodes"), [(2, 12 + 4), (3, 16)], ids=["half of them", "a few are left"])
def test_long_cells_beside_others(cells, nodes):
    mesh = kl.box((cells, 1.0, 1.0), (cells, 1, 1), "KinematicLinear3D20N")
    points, last = mesh.points.copy(), cells - 1.0
    points[:, 0] = np.where(points[:, 0] > last, last + 9.0 * (points[:, 0] - last), points[:, 0])
    level = p_coarse_level(points, kl.Model(kl.Mesh(points, mesh.blocks), STEEL).element_groups())
    assert (len(level.nodes), level.halved) == (nodes, cells == 2)
    assert_linear(level, points)


def test_linear_elements_take_part_as_they_are():
    points, (quadratic,) = scene("20N", (2, 1, 1))
    first = ElementGroup(quadratic.element, quadratic.rule, STEEL, quadratic.nodes[:1], np.array([0]))
    brick = kl.ELEMENTS["KinematicLinear3D8N"]
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
    close(level.K.scipy().toarray(), assemble_dense(points[level.nodes], coarse), 1e-14)


def test_linear_meshes_and_shapes_without_corners_have_no_level():
    for kind in LINEAR_OF.values():
        assert p_coarse_level(*scene(kind)) is None
    points, (group,) = scene("8N")
    with kl.shapes.SHAPES.temporary(), kl.ELEMENTS.temporary():

        class Shifted(Hexahedron8):
            nodes = 0.5 * Hexahedron8.nodes

        class KinematicLinearShifted(kl.KinematicLinear):
            shape = Shifted
            rule = kl.quadrature.hexahedron(degree=3)

        rule = KinematicLinearShifted.rule
        other = ElementGroup(KinematicLinearShifted, rule, STEEL, group.nodes, group.rows)
        assert p_coarse_level(points, [other]) is None


# ---- hanging nodes ----------------------------------------------------------------------------------


def corner_model(element, times=3):
    """A block whose cells at one corner are cut again and again."""
    model = kl.Model(kl.box(cells=(3, 3, 3), element=element), STEEL)
    model.fix("z-")
    model.add(kl.Traction("z+", (1.0, 2.0, 3.0)))
    for _ in range(times):
        X = model.mesh.points
        near = [np.abs(X[nodes]).sum(axis=2).min() < 1e-9 for nodes in model.mesh.blocks[0].nodes[:, None]]
        model = refined(model, refine(model.mesh, np.array(near)))
    return model


@pytest.mark.parametrize("kind", ["20N", "27N", "10N"])
def test_fields_between_hanging_nodes_are_linear_continuous_and_have_their_energy(kind):
    if kind == "10N":
        model = kl.Model(refine(warped("10N", 2, amount=0.0), [0, 7]).mesh, STEEL)
    else:
        model = corner_model(f"KinematicLinear3D{kind}", 2)
    points, groups = parts_of(model)
    level, hanging = p_coarse_level(points, groups, model.mesh.hanging), model.mesh.hanging
    P = assert_linear(level, points)
    np.testing.assert_array_equal(P[level.nodes].toarray(), np.eye(len(level.nodes)))
    v = np.random.default_rng(0).normal(size=(len(level.nodes), 3))
    fine = P @ v
    assert np.abs(hanging.interpolate(fine) - fine).max() < 1e-12
    energy = 2 * totals(points, groups, fine)[0]
    assert abs(v.ravel() @ (level.K @ v.ravel()) / energy - 1) < 1e-12


def test_multigrid_needs_few_iterations_with_hanging_nodes():
    result = corner_model("KinematicLinear3D20N").solve(solver="amg")
    assert result.report.solver == "amg"
    assert result.report.iterations < 40  # to rounding; 56 where the linear level comes apart


# ---- ties -------------------------------------------------------------------------------------------


def periodic(axes="xyz", cells=(4, 3, 3)):
    """Return a box of 20-node bricks on its lower side, whose faces y+ follow y- along some axes."""
    mesh = kl.box((4.0, 3.0, 3.0), cells, "KinematicLinear3D20N")
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    X = mesh.points
    low, high = (np.flatnonzero((X[:, 1] == y) & (X[:, 2] > 0)) for y in (0.0, 3.0))
    for dependent in high:
        independent = low[np.abs(X[low] - X[dependent] * [1, 0, 1]).max(axis=1).argmin()]
        for axis in axes:
            model.constrain((int(dependent), axis), {(int(independent), axis): 1.0})
    return model


def levels_of(model):
    """Return the linear level of a model, and that under its ties."""
    system = system_of(model, solver="amg", hanging=model.mesh.hanging)
    level = p_coarse_level(system.points, system.groups, model.mesh.hanging)
    return level, apply_ties(level, system.constraint_map.T, system.constraint_map.free)


def test_tied_faces_of_quadratic_elements_take_few_iterations():
    model = periodic()
    found, expected = model.solve("amg"), model.solve("direct")
    assert found.report.solver == "amg"
    assert found.report.iterations <= most(25, 35)  # 77 where both sides come apart
    close(found.u, expected.u, 1e-10)


def test_hanging_nodes_leave_the_level_as_it_is():
    hanging = kl.Model(refine(kl.box(cells=(2, 2, 2), element="KinematicLinear3D20N"), [0]).mesh, STEEL)
    hanging.fix("z-")
    level, under_ties = levels_of(hanging)
    assert under_ties is level


def test_fields_of_a_level_keep_ties_along_an_axis():
    model = periodic("y", (2, 2, 2))
    level, tied = levels_of(model)
    map, m = system_of(model, solver="amg").constraint_map, len(level.nodes)
    P = bsr_array((tied.weights, tied.indices, tied.indptr), shape=(len(map.c), 3 * m)).tocsr()
    q = np.random.default_rng(5).standard_normal(3 * m) * map.is_free.reshape(-1, 3)[level.nodes].ravel()
    u = P @ q
    corners = (3 * level.nodes[:, None] + np.arange(3)).ravel()
    np.testing.assert_allclose(u[corners], map.transform(u[map.free])[corners], rtol=0, atol=1e-14)
    assert model.solve("amg").report.backward_error < 1e-14


def test_a_level_under_ties_moves_rigidly():
    model = periodic(cells=(2, 2, 2))
    level, tied = levels_of(model)
    P, ones = interpolation(tied, model.mesh.n_nodes), np.ones(len(level.nodes))
    np.testing.assert_allclose(P @ ones, 1.0, rtol=0, atol=1e-14)
    assert abs(tied.K @ np.tile([1.0, 0.0, 0.0], len(ones))).max() < 1e-9 * tied.K.norm()
    y, z = model.mesh.points[level.nodes, 1:].T
    assert np.abs(P[:, (y == 3.0) & (z > 0)]).sum() == 0  # their unknowns are those of the independents


def test_a_rigid_part_of_quadratic_elements_takes_few_iterations():
    model = kl.Model(kl.box((2.0, 1.0, 1.0), (8, 4, 4), "KinematicLinear3D20N"), STEEL)
    model.fix("x-")
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    model.rigid("x+", (3.0, 0.5, 0.5))
    found, expected = model.solve("amg"), model.solve("direct")
    assert found.report.iterations <= most(25, 40)  # 46 where the level does not turn with the part
    close(found.u, expected.u, 1e-9)


# ---- lines across plates and shells -----------------------------------------------------------------


@pytest.mark.parametrize(("fraction", "bends"), [(0.45, True), (0.55, False), (0.85, False)])
def test_a_plate_most_of_whose_normal_displacements_are_constrained_does_not_bend(fraction, bends):
    points = kl.box((1, 1, 0.02), (20, 20, 1)).points
    free = np.ones((len(points), 3), dtype=bool)
    free[: int(fraction * len(points)), 2] = False
    assert (plate_axes(points, free.ravel()) is not None) == bends


@pytest.mark.parametrize(("fraction", "bends"), [(0.4, True), (0.6, False), (0.85, False)])
def test_a_shell_most_of_whose_normal_displacements_are_constrained_does_not_bend(fraction, bends):
    mesh = kl.annulus(1.0, 1.02, 2.0, (1, 24, 12))
    points, groups = parts_of(kl.Model(mesh, STEEL))
    angle = np.round(np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi), 6)
    _, labels = np.unique(np.column_stack([angle, np.round(points[:, 2], 6)]), axis=0, return_inverse=True)
    free = np.ones((len(points), 3), dtype=bool)
    free[labels.ravel() < fraction * labels.max()] = False
    level = plate_level(points, free.ravel(), None, labels.ravel(), p_coarse_level(points, groups))
    assert (level is not None) == bends


def test_shell_modes_bend_without_shear_across_the_thickness():
    """Kirchhoff: u = w n - z ∇w, with w = x_i x_j, so that ∂w/∂x + ∂u_x/∂z = 0."""
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-0.5, 0.5, 7), indexing="ij"))
    centers, height = np.column_stack([x, y, 0 * x]), 0.01
    frames = np.broadcast_to(np.eye(3)[:, [2, 0, 1]], (len(x), 3, 3))
    low, high = _shell_modes(centers, frames, height)[:, :, :, 6:]
    w = ((low + high) / 2)[:, 2].reshape(7, 7, 6)
    turned = ((high - low) / (2 * height))[:, :2].reshape(7, 7, 2, 6)
    for axis, spacing in ((0, 1 / 3), (1, 1 / 6)):
        slope = np.gradient(w, spacing, axis=axis, edge_order=2)  # exact for quadratic functions
        np.testing.assert_allclose(turned[:, :, axis], -slope, atol=1e-12)
    assert np.ptp(w, axis=(0, 1)) @ [1, 1, 0, 1, 0, 0] > 0.5

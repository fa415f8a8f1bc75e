"""Loads become nodal forces that are consistent with their integrals."""

import numpy as np
import pytest
from meshes import joined, named, with_block

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0)
KINDS = [4, 5, 6, 8, 10, 13, 15, 20, 27]


def nodal(mesh, *loads, material=STEEL):
    model = kl.Model(mesh, material)
    groups = model.element_groups()
    return sum(load.forces(mesh, groups) for load in loads)


def moment(mesh, forces):
    return np.cross(mesh.points, forces).sum(axis=0)


@pytest.mark.parametrize("nodes", KINDS)
def test_traction_has_the_resultant_and_moment_of_its_integral(nodes):
    mesh = kl.box((2, 3, 1), (2, 2, 1), named(nodes))
    forces = nodal(mesh, kl.Traction("z+", (5, 7, -11)))
    np.testing.assert_allclose(forces.sum(axis=0), 6 * np.array([5, 7, -11]), rtol=1e-13)
    np.testing.assert_allclose(moment(mesh, forces), 6 * np.cross((1, 1.5, 1), (5, 7, -11)), rtol=1e-12)
    assert (forces[mesh.points[:, 2] < 1] == 0).all()


def test_traction_on_one_quadratic_face_is_the_classic_share():
    for nodes, corner, edge, middle in ((20, -1 / 12, 1 / 3, None), (27, 1 / 36, 1 / 9, 4 / 9)):
        mesh = kl.box(element=named(nodes))
        force = nodal(mesh, kl.Traction("z+", (0, 0, 1)))[:, 2]
        off = np.abs(mesh.points[:, :2] - 0.5).sum(axis=1)
        top = mesh.points[:, 2] == 1
        np.testing.assert_allclose(force[top & (off == 1)], corner, atol=1e-15)
        np.testing.assert_allclose(force[top & (off == 0.5)], edge, atol=1e-15)
        if middle:
            np.testing.assert_allclose(force[top & (off == 0)], middle, atol=1e-15)


@pytest.mark.parametrize("nodes", KINDS)
def test_pressure_pushes_inward_on_flat_faces(nodes):
    mesh = kl.box((1, 2, 3), (1, 2, 1), named(nodes))
    for side, axis, sign, area in (("x-", 0, 1, 6), ("x+", 0, -1, 6), ("y+", 1, -1, 3), ("z-", 2, 1, 2)):
        total = nodal(mesh, kl.Pressure(side, 4.0)).sum(axis=0)
        expected = np.zeros(3)
        expected[axis] = sign * 4 * area
        np.testing.assert_allclose(total, expected, atol=1e-12)


@pytest.mark.parametrize("nodes", KINDS)
def test_pressure_all_around_a_curved_body_has_no_resultant(nodes):
    mesh = kl.annulus(1.0, 2.0, 0.5, (2, 7, 1), named(nodes))
    mesh = mesh.replace(points=mesh.points + 0.05 * np.sin(3 * mesh.points[:, [1, 2, 0]]))
    forces = nodal(mesh, kl.Pressure(np.ones(mesh.n_nodes, dtype=bool), 1e3))
    size = np.abs(forces).sum()
    assert size > 1e3
    assert np.abs(forces.sum(axis=0)).max() < 1e-13 * size
    assert np.abs(moment(mesh, forces)).max() < 1e-13 * size


def test_pressure_all_around_squeezes_a_body_evenly():
    mesh = kl.annulus(1.0, 2.0, 0.5, (2, 8, 1), named(27))
    model = kl.Model(mesh, STEEL)
    model.add(kl.Pressure(np.ones(mesh.n_nodes, dtype=bool), 1e6))
    shrink = -1e6 * (1 - 2 * STEEL.nu) / STEEL.E
    rows = [
        int(np.argmin(np.linalg.norm(mesh.points - p, axis=1))) for p in ((1, 0, 0), (-1, 0, 0), (0, 1, 0))
    ]
    model.fix([rows[0]], "xyz", shrink * mesh.points[rows[0]])
    model.fix([rows[1]], "yz", 0.0)
    model.fix([rows[2]], "z", 0.0)
    result = model.solve()
    np.testing.assert_allclose(result.u, shrink * mesh.points, atol=1e-10 * abs(shrink))
    np.testing.assert_allclose(result.stress()[..., :3], -1e6, rtol=1e-9)
    np.testing.assert_allclose(result.reactions, 0, atol=1e-6)


def faces_as_conditions(mesh, side, flip):
    block = mesh.faces(side)[0]
    nodes = block.nodes[:, ::-1] if flip else block.nodes
    m = len(nodes)
    skin = kl.Block("Surface", nodes, np.arange(1, m + 1), np.zeros(m, dtype=np.int64), block.shape)
    part = kl.Part(nodes=np.unique(nodes), conditions=np.arange(m))
    return kl.Mesh(mesh.points, mesh.blocks, conditions=[skin], parts={"skin": part})


@pytest.mark.parametrize("flip", [False, True])
def test_pressure_follows_the_node_order_of_conditions_only_if_told_so(flip):
    mesh = faces_as_conditions(kl.box(cells=(2, 2, 2)), "z+", flip)
    outward = nodal(mesh, kl.Pressure("skin", 3.0)).sum(axis=0)
    by_nodes = nodal(mesh, kl.Pressure("skin", 3.0, normal="nodes")).sum(axis=0)
    np.testing.assert_allclose(outward, (0, 0, -3), atol=1e-14)
    np.testing.assert_allclose(by_nodes, (0, 0, 3 if flip else -3), atol=1e-14)


def test_pressure_on_a_face_inside_the_body_is_refused():
    mesh = kl.box(cells=(1, 1, 2))
    inside = np.flatnonzero(mesh.points[:, 2] == 0.5)[[0, 1, 3, 2]]
    quad = mesh.boundary[0].shape
    skin = kl.Block("Surface", inside[None].astype(np.int32), np.array([9]), np.array([0]), quad)
    part = kl.Part(nodes=inside, conditions=np.array([0]))
    mesh = kl.Mesh(mesh.points, mesh.blocks, conditions=[skin], parts={"cut": part})
    with pytest.raises(kl.ModelError, match=r"face 9 \(Surface\) is not on the boundary"):
        nodal(mesh, kl.Pressure("cut", 1.0))


def test_line_load_is_a_force_per_length():
    from kratos_lite.shapes.faces import Line3

    mesh = kl.box((1, 1, 2), element=named(20))
    ends = [int(np.argmin(np.linalg.norm(mesh.points - (1, 1, z), axis=1))) for z in (0, 2, 1)]
    line = kl.Block("Line", np.array([ends], dtype=np.int32), np.array([1]), np.array([0]), Line3)
    edge = kl.Part(nodes=np.array(ends), conditions=np.array([0]))
    mesh = kl.Mesh(mesh.points, mesh.blocks, conditions=[line], parts={"edge": edge})
    forces = nodal(mesh, kl.LineLoad("edge", (0, 6, 0)))
    np.testing.assert_allclose(forces[ends, 1], (2, 2, 8), rtol=1e-14)
    with pytest.raises(kl.ModelError, match=r"a pressure acts on faces; .*Line"):
        nodal(mesh, kl.Pressure("edge", 1.0))


@pytest.mark.parametrize("nodes", KINDS)
def test_body_force_and_gravity_have_the_weight_and_its_moment(nodes):
    mesh = kl.box((1, 2, 3), (1, 2, 2), named(nodes), origin=(1, 0, -1))
    gravity = nodal(mesh, kl.Gravity((1, 2, -9.81)))
    weight = 6 * 7850 * np.array([1, 2, -9.81])
    np.testing.assert_allclose(gravity.sum(axis=0), weight, rtol=1e-12)
    np.testing.assert_allclose(moment(mesh, gravity), np.cross((1.5, 1, 0.5), weight), rtol=1e-11)
    np.testing.assert_allclose(gravity, nodal(mesh, kl.BodyForce(7850 * np.array([1, 2, -9.81]))), rtol=1e-12)


@pytest.mark.parametrize("nodes", KINDS)
def test_nodal_gravity_is_interpolated(nodes):
    mesh = kl.box((1, 1, 2), (1, 1, 2), named(nodes))
    z = mesh.points[:, 2]
    field = np.column_stack([0 * z, 0 * z, -9.81 * (1 + z)])
    forces = nodal(mesh, kl.Gravity(field))
    assert forces[:, 2].sum() == pytest.approx(-9.81 * 7850 * (2 + 2), rel=1e-12)
    constant = nodal(mesh, kl.Gravity(np.tile((0, 0, -9.81), (mesh.n_nodes, 1))))
    np.testing.assert_allclose(constant, nodal(mesh, kl.Gravity((0, 0, -9.81))), atol=1e-8)


def test_volume_loads_can_act_on_a_part_or_a_property():
    mesh = with_block(kl.box(cells=(1, 1, 4)), properties=[1, 1, 1, 7])
    mesh = mesh.replace(parts={"low": kl.Part(elements=[0, 1])})
    assert nodal(mesh, kl.Gravity((0, 0, -2), "low"))[:, 2].sum() == pytest.approx(-7850, rel=1e-13)
    assert nodal(mesh, kl.BodyForce((0, 0, -8), 7))[:, 2].sum() == pytest.approx(-2, rel=1e-13)
    assert nodal(mesh, kl.BodyForce((0, 0, -8), [0, 3]))[:, 2].sum() == pytest.approx(-4, rel=1e-13)


def test_a_point_load_acts_on_each_node_once_and_loads_add_up():
    mesh = kl.box()
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    model.add(kl.PointLoad(np.array([7, 7, 3]), (0, 0, 10), each=True))
    model.add(kl.NodalForces(np.full((8, 3), 0.5)))
    result = model.solve()
    np.testing.assert_allclose(result.report.total_load, (4, 4, 24), rtol=1e-14)
    np.testing.assert_allclose(result.loads[[3, 7], 2], 10.5)
    np.testing.assert_allclose(result.report.total_reaction, (-4, -4, -24), rtol=1e-12)


def test_faces_of_mixed_cells_carry_the_whole_load():
    """Two wedges and a brick share a square; the traction covers the squares and triangles of a side."""
    brick, wedge = kl.box(), kl.box(element=named(6), origin=(0, 1, 0))
    forces = nodal(joined(brick, wedge, welded=True), kl.Pressure("z+", 1.0), kl.Traction("x+", (1, 0, 0)))
    np.testing.assert_allclose(forces.sum(axis=0), (2, 0, -2), atol=1e-14)


def test_one_value_per_element_is_not_taken_for_nodal_values():
    """Eight bricks with eight body forces, and four squares with four tractions."""
    from kratos_lite.elements.surface import surface_load

    mesh = kl.box(cells=(2, 2, 2))
    element = kl.KinematicLinear3D8N(mesh.points[mesh.blocks[0].nodes])
    b = np.arange(24.0).reshape(8, 3)
    np.testing.assert_allclose(element.body_force(b).sum(axis=1), b / 8, rtol=1e-13)
    (top,) = mesh.faces("z+")
    t = np.arange(12.0).reshape(4, 3)
    forces = surface_load(top.shape, mesh.points[top.nodes], t)
    np.testing.assert_allclose(forces.sum(axis=1), t / 4, atol=1e-14)


def test_loads_on_conditions_of_unknown_kind_are_refused():
    mesh = kl.box()
    (top,) = mesh.faces("z+")
    odd = kl.Block("Odd4N", top.nodes, np.array([5]), np.array([0]), None)
    part = kl.Part(nodes=top.nodes[0], conditions=np.array([0]))
    mesh = kl.Mesh(mesh.points, mesh.blocks, conditions=[odd], parts={"lid": part})
    for load in (kl.Traction("lid", (0, 0, 1)), kl.Pressure("lid", 1.0)):
        with pytest.raises(
            kl.ModelError, match=r"meets conditions of the unknown type Odd4N \(the first is 5\)"
        ):
            nodal(mesh, load)


def test_loads_of_conditions_are_their_own_plus_the_nodal_ones():
    from kratos_lite.model.loads.surface import ConditionLoads

    mesh = faces_as_conditions(kl.box(), "z+", flip=False)
    own, at_nodes = np.array([[1.0, 0, 0]]), np.zeros((8, 3))
    at_nodes[:, 1] = 2 * mesh.points[:, 0]
    load = ConditionLoads(own, {"quadrilateral": at_nodes}, np.array([3.0]), np.zeros(8))
    forces = nodal(mesh, load)
    np.testing.assert_allclose(forces.sum(axis=0), (1, 1, -3), atol=1e-14)
    assert (mesh.points * forces[:, 1:2]).sum(axis=0)[0] == pytest.approx(2 / 3, rel=1e-13)


def test_a_pressure_of_its_own_on_a_line_condition_is_refused():
    from kratos_lite.model.loads.surface import ConditionLoads
    from kratos_lite.shapes.faces import Line2

    box = kl.box()
    line = kl.Block("Line", np.array([[1, 3]], dtype=np.int32), np.array([1]), np.array([0]), Line2)
    mesh = kl.Mesh(box.points, box.blocks, conditions=[line])
    load = ConditionLoads(np.zeros((1, 3)), {"line": np.zeros((8, 3))}, np.ones(1), np.zeros(8))
    with pytest.raises(kl.ModelError, match=r"a pressure acts on faces; .*Line"):
        nodal(mesh, load)


# ---- loads that vary over a surface -----------------------------------------------------------------


@pytest.mark.parametrize("element", ["KinematicLinear3D8N", "KinematicLinear3D20N", "KinematicLinear3D10N"])
def test_a_hydrostatic_pressure_has_its_force_and_moment(element):
    """ρ g depth on a wall of 2 m x 3 m: ∫ p dA = 27 kN · g/9, a third above the ground."""
    mesh = kl.box((1.0, 2.0, 3.0), (1, 2, 3), element)
    forces = nodal(mesh, kl.Pressure("x+", lambda X: 1e4 * (3.0 - X[:, 2])))
    np.testing.assert_allclose(forces.sum(axis=0), [-9e4, 0, 0], atol=1e-9)
    assert forces[:, 0] @ mesh.points[:, 2] == pytest.approx(-9e4, rel=1e-12)
    traction = nodal(mesh, kl.Traction("x+", lambda X: np.outer(3.0 - X[:, 2], (-1e4, 0, 0))))
    np.testing.assert_allclose(traction, forces, atol=1e-9)


def test_the_same_everywhere_by_a_function_or_a_number():
    mesh = kl.annulus(0.3, 1.0, 0.25, (1, 12, 1))
    given = nodal(mesh, kl.Pressure("outer", lambda X: 2.0))
    np.testing.assert_allclose(given, nodal(mesh, kl.Pressure("outer", 2.0)), atol=1e-15)
    given = nodal(mesh, kl.Traction("outer", lambda X: (1.0, 2.0, 3.0)))
    constant = nodal(mesh, kl.Traction("outer", (1.0, 2.0, 3.0)))  # curved areas are no polynomials
    np.testing.assert_allclose(given, constant, rtol=0, atol=1e-6 * np.abs(constant).max())


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (
            kl.Pressure("x+", lambda X: X),
            r"a pressure at places \(m, 3\) must have shape \(m,\)",
        ),
        (kl.Pressure("x+", lambda X: "deep"), "a pressure must be made of real numbers"),
        (kl.Pressure("x+", lambda X: X[:, 0] * np.nan), "a pressure must be finite"),
        (kl.Traction("x+", lambda X: X[:, 0]), r"a traction at places \(m, 3\) must have shape \(m, 3\)"),
        (kl.Traction("x+", lambda X: tuple(X.T)), r"got \(3, \d+\); np.column_stack\(\(fx, fy, fz\)\) joins"),
        (kl.Traction("x+", lambda X: (0, 0, X[:, 2])), r"real numbers; .* np.column_stack"),
    ],
)
def test_functions_of_places_that_return_nonsense(load, words):
    with pytest.raises(kl.InputError, match=words):
        nodal(kl.box(), load)

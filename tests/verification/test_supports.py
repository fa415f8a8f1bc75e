"""Prescribed displacements, multi-point constraints, and materials that differ."""

import numpy as np
import pytest
from meshes import joined, named, with_block
from rounding import round_off

import kratos_lite as kl
from kratos_lite.elements import surface

STEEL = kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0)


def stretched(mesh=None, amount=1e-3):
    """Return a bar pulled by a prescribed displacement of its end, free to contract."""
    model = kl.Model(mesh or kl.box((2, 1, 1), (2, 2, 2)), STEEL)
    for side in ("x-", "y-", "z-"):
        model.fix(side, side[0])
    model.fix("x+", "x", amount)
    return model


def test_a_prescribed_end_gives_uniaxial_stress_in_every_place_and_its_reactions():
    result = stretched().solve()
    stress = STEEL.E * 1e-3 / 2
    np.testing.assert_allclose(result.stress()[..., 0], stress, rtol=1e-12)
    np.testing.assert_allclose(result.stress()[..., 1:], 0, atol=1e-6)
    assert result.reaction("x+")[:, 0].sum() == pytest.approx(stress, rel=1e-12)
    assert result.reaction("x-")[:, 0].sum() == pytest.approx(-stress, rel=1e-12)
    np.testing.assert_allclose(result.displacement("y+")[:, 1], -0.3 * 5e-4, rtol=1e-12)
    for at, shape in (("gauss", (8, 8)), ("element", (8,)), ("node", (27,))):
        assert result.strain(at).shape == result.stress(at).shape == (*shape, 6)
        np.testing.assert_allclose(result.strain(at)[..., :2] / 5e-4, np.ones((*shape, 2)) * (1, -0.3), 1e-12)
        np.testing.assert_allclose(result.stress(at)[..., 0], stress, rtol=1e-12)
        np.testing.assert_allclose(result.von_mises(at), np.full(shape, stress), rtol=1e-12)
    assert result.energy() == pytest.approx(stress * 1e-3 / 2, rel=1e-12)
    assert result.energy() == pytest.approx((result.reactions * result.u).sum() / 2, rel=1e-12)


def test_values_can_be_given_per_axis_and_per_node():
    mesh = kl.box()
    model = kl.Model(mesh, STEEL)
    model.fix("z-", "xyz", (1e-3, 2e-3, 3e-3))
    top = mesh.nodes("z+")
    model.fix("z+", "zx", np.column_stack([1e-3 * np.arange(4), np.full(4, 5e-3)]))
    u = model.solve().u
    np.testing.assert_array_equal(u[mesh.nodes("z-")], np.tile((1e-3, 2e-3, 3e-3), (4, 1)))
    np.testing.assert_array_equal(u[top, 2], 1e-3 * np.arange(4))
    np.testing.assert_array_equal(u[top, 0], 5e-3)


def test_a_component_prescribed_twice_is_an_error_unless_it_is_overridden():
    model = stretched()
    model.fix("x+", "x", 1e-3)
    with pytest.raises(kl.ModelError, match=r"node \d+ along x is prescribed twice: 0\.001 m and 0\.002 m"):
        model.fix("x+", "x", 2e-3)
    model.fix("x+", "x", 2e-3, override=True)
    np.testing.assert_allclose(model.solve().stress()[..., 0], 2e8, rtol=1e-12)


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_skew_rollers_let_a_turned_bar_behave_as_the_straight_one(solver):
    angle = np.deg2rad(25)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    straight = stretched().solve()
    mesh = kl.box((2, 1, 1), (2, 2, 2))
    sides = {side: mesh.nodes(side) for side in ("x-", "x+", "y-", "z-")}
    mesh = mesh.replace(points=mesh.points @ turn.T)
    model = kl.Model(mesh, STEEL)
    model.fix(sides["z-"], "z")
    corner = set(sides["x-"]) & set(sides["y-"])
    model.fix(sorted(corner), "xy")
    for node in set(sides["x-"]) - corner:  # u · (c, s) = 0
        model.constrain((int(node), "x"), {(int(node), "y"): -s / c})
    for node in set(sides["y-"]) - corner - set(sides["x+"]):  # u · (-s, c) = 0
        model.constrain((int(node), "y"), {(int(node), "x"): s / c})
    for node in sides["x+"]:
        if node in sides["y-"]:
            model.fix([int(node)], "xy", 1e-3 * np.array([c, s]))
        else:
            model.constrain((int(node), "x"), {(int(node), "y"): -s / c}, 1e-3 / c)
    result = model.solve(solver, tolerance=1e-12)
    np.testing.assert_allclose(result.u, straight.u @ turn.T, rtol=0, atol=1e-9 * 1e-3)


def test_periodic_constraints_make_a_layered_cell_as_stiff_as_its_layers():
    """Layers in parallel: E = mean; the cell is stretched by a periodic jump along x."""
    mesh = kl.box(cells=(2, 1, 2))
    model = kl.Model(mesh)
    model.assign(kl.Isotropic3D(E=1.0, nu=0.0), np.flatnonzero(centers(mesh)[:, 2] < 0.5))
    model.assign(kl.Isotropic3D(E=3.0, nu=0.0), np.flatnonzero(centers(mesh)[:, 2] > 0.5))
    left, right = mesh.nodes("x-"), mesh.nodes("x+")
    for a, b in zip(left, right, strict=True):
        for axis in "xyz":
            model.constrain((int(b), axis), {(int(a), axis): 1.0}, 0.01 if axis == "x" else 0.0)
    model.fix([0], "xyz")
    model.fix(mesh.nodes(lambda X: (X[:, 0] == 0) & (X[:, 2] == 0) & (X[:, 1] > 0)), "xz")
    model.fix(mesh.nodes(lambda X: (X[:, 0] == 0) & (X[:, 2] == 1) & (X[:, 1] == 0)), "xy")
    result = model.solve()
    np.testing.assert_allclose(result.u[:, 0], 0.01 * mesh.points[:, 0], atol=1e-14)
    assert result.energy() == pytest.approx(0.5 * 2.0 * 0.01**2, rel=1e-12)


def centers(mesh):
    return mesh.points[mesh.blocks[0].nodes].mean(axis=1)


def test_a_rigid_plate_by_constraints_keeps_its_shape_and_carries_the_moment():
    mesh = kl.box((4, 1, 1), (4, 1, 1), named(20), origin=(0, -0.5, -0.5))
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    end = mesh.nodes("x+")
    center = mesh.points[end] - (4, 0, 0)
    a, b = (int(end[np.argmin(np.linalg.norm(center - p, axis=1))]) for p in ((0, 0.5, 0.5), (0, 0.5, -0.5)))
    for node, (_, _, z) in zip(end, center, strict=True):
        if node not in (a, b):  # u_x is linear in z and does not depend on y
            model.constrain((int(node), "x"), {(a, "x"): 0.5 + z, (b, "x"): 0.5 - z})
    model.add(kl.PointLoad([a], (1e3, 0, 0)))
    model.add(kl.PointLoad([b], (-1e3, 0, 0)))
    result = model.solve()
    u = result.u[end, 0]
    slope = result.u[a, 0] - result.u[b, 0]
    allowed = round_off(model) * np.abs(u).max()  # u of a is - u of b but for rounding
    np.testing.assert_allclose(u, slope * center[:, 2], rtol=0, atol=allowed)
    assert slope == pytest.approx(1e3 * 4 / (STEEL.E / 12), rel=0.03)


def test_chains_of_constraints_with_constants_and_fixed_masters_are_followed_to_the_end():
    mesh = kl.box((1, 1, 1), (1, 1, 1))
    model = kl.Model(mesh, STEEL)
    model.fix("z-", "xyz", (0.0, 0.0, 1e-4))
    top = [int(n) for n in mesh.nodes("z+")]
    low = int(mesh.nodes("z-")[0])
    model.constrain((top[1], "z"), {(top[2], "z"): 2.0}, 1e-5)
    model.constrain((top[2], "z"), {(top[3], "z"): 0.5, (low, "z"): 1.0}, -3e-5)
    model.add(kl.PointLoad([top[3]], (0, 0, 1e5)))
    u = model.solve().u[:, 2]
    assert u[top[2]] == pytest.approx(0.5 * u[top[3]] + 1e-4 - 3e-5, rel=1e-12)
    assert u[top[1]] == pytest.approx(2 * u[top[2]] + 1e-5, rel=1e-12)


@pytest.mark.parametrize(
    ("constraints", "equal"),
    [  # node, the node that it depends on, and the factor; even nodes are fixed
        ([(1, 3, 1.0), (3, 5, 1.0), (5, 1, 0.5)], [(1, 0, 1.0), (3, 0, 1.0), (5, 0, 1.0)]),
        ([(1, 3, 1.0), (3, 5, 1.0), (5, 1, 1.0)], [(1, 3, 1.0), (5, 3, 1.0)]),
        ([(1, 1, 0.5)], [(1, 0, 1.0)]),
        ([(1, 1, 1.0)], []),
        ([(0, 1, 1.0)], [(1, 0, 1.0)]),
        ([(0, 2, 1.0)], []),
        ([(1, 3, 1.0), (1, 5, 2.0)], [(3, 1, 1.0), (5, 1, 0.5)]),
        ([(1, 3, 1e-7), (1, 5, 2e-7)], [(1, 3, 1e-7), (5, 3, 0.5)]),
    ],
)
def test_rings_and_dofs_constrained_twice_are_solved(constraints, equal):
    found = []
    for given in (constraints, equal):
        model = kl.Model(kl.box(), STEEL)
        model.fix("z-")
        model.add(kl.Traction("z+", (1e6, 2e6, 3e6)))
        for dependent, independent, factor in given:
            model.constrain((dependent, "x"), {(independent, "x"): factor})
        found.append(model.solve())
    size = np.abs(found[1].u).max()
    np.testing.assert_allclose(found[0].u, found[1].u, rtol=0, atol=1e-12 * size)
    assert found[0].report.unknowns == found[1].report.unknowns


@pytest.mark.parametrize(
    ("constraints", "words"),
    [  # node, the node that it depends on, and the constant; even nodes are fixed
        (
            [(1, 3, 0), (3, 5, 0), (5, 1, 1e-3)],
            r"node 2 along x = node 4 along x; .*node 2 along x \+ 0.001 m",
        ),
        ([(1, 1, 1e-3)], r"node 2 along x = node 2 along x \+ 0.001 m: change or remove one of them"),
        ([(0, 2, 1e-3)], "node 1 along x = 0 m is prescribed; node 3 along x = 0 m is prescribed"),
        ([(1, 0, 1e-3), (1, 2, 0)], "node 2 along x = node 3 along x"),
    ],
)
def test_constraints_that_contradict_are_errors(constraints, words):
    model = kl.Model(kl.box(), STEEL)
    model.fix("z-")
    model.constrain((7, "x"), {(5, "x"): 0.5})
    for dependent, independent, constant in constraints:
        model.constrain((dependent, "x"), {(independent, "x"): 1.0}, constant)
    with pytest.raises(kl.ModelError, match="what is prescribed contradicts itself: .*" + words):
        model.solve()


def test_tied_coincident_nodes_join_two_bodies():
    low, high = kl.box((1, 1, 1)), kl.box((1, 1, 1), origin=(0, 0, 1))
    model = kl.Model(joined(low, high), STEEL)
    whole = kl.Model(kl.box((1, 1, 2), (1, 1, 2)), STEEL)
    for one in (model, whole):
        one.fix("z-")
        one.add(kl.Gravity((1, 0, -9.81)))
    for a, b in zip(low.nodes("z+"), high.nodes("z-"), strict=True):
        for axis in "xyz":
            model.constrain((int(b) + 8, axis), {(int(a), axis): 1.0})
    result = model.solve()
    np.testing.assert_allclose(result.displacement("z+"), whole.solve().displacement("z+"), rtol=1e-11)
    assert result.report.warnings == []  # nodes that coincide, but are tied


def test_two_materials_in_series_share_the_stress():
    mesh = with_block(kl.box((1, 1, 2), (1, 1, 2)), properties=[3, 8])
    soft, hard = kl.Isotropic3D(E=1.0, nu=0.0), kl.Isotropic3D(E=4.0, nu=0.0)
    model = kl.Model(mesh, {3: soft, 8: hard})
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1.0)))
    result = model.solve()
    np.testing.assert_allclose(result.displacement("z+")[:, 2], 1.25, rtol=1e-13)
    np.testing.assert_allclose(result.stress()[..., 2], 1.0, rtol=1e-12)
    np.testing.assert_allclose(result.strain("element")[:, 2], (1.0, 0.25), rtol=1e-12)


@pytest.mark.parametrize("order", [(8, 6), (8, 5, 4)])
def test_cells_of_several_kinds_in_one_mesh_pass_the_patch_test(order):
    """A brick beside two wedges; a brick under a pyramid with tetrahedra around it."""
    corners = (kl.KinematicLinear3D8N.nodes + 1) / 2
    if order == (8, 6):
        points = np.vstack([corners, corners[[1, 2, 5, 6]] + (1, 0.2, 0)])
        cells = {8: [range(8)], 6: [(1, 8, 9, 5, 10, 11), (1, 9, 2, 5, 11, 6)]}
    else:
        points = np.vstack([corners, [(0.5, 0.4, 1.6), (1.7, 0.5, 1.4)]])
        cells = {8: [range(8)], 5: [(4, 5, 6, 7, 8)], 4: [(5, 9, 6, 8)]}
    blocks = []
    for n, nodes in cells.items():
        rows = np.array([list(c) for c in nodes], dtype=np.int32)
        m = len(rows)
        shape = kl.ELEMENTS[named(n)].shape
        blocks.append(kl.Block(named(n), rows, np.arange(m) + 10 * n, np.ones(m, dtype=np.int64), shape))
    mesh = kl.Mesh(points, blocks)
    F = 1e-3 * np.array([[1, 2, 3], [0, -1, 2], [1, 1, 1]])
    model = kl.Model(mesh, STEEL)
    held = np.array([0, 1, 2, 3])
    model.fix(held, "xyz", points[held] @ F.T)
    strain = (F + F.T) / 2
    sigma = STEEL.lame[0] * np.trace(strain) * np.eye(3) + 2 * STEEL.lame[1] * strain
    outside = np.zeros_like(points)
    for face in mesh.boundary:  # the traction σ n on every boundary face
        n_dA = surface.area_vectors(face.shape, points[face.nodes])
        N = face.shape.N(surface.face_rule(face.shape).points)
        np.add.at(outside, face.nodes, np.einsum("gn,fgi->fni", N, n_dA @ sigma))
    model.add(kl.NodalForces(outside))
    result = model.solve()
    np.testing.assert_allclose(result.u, points @ F.T, atol=1e-14)
    for row in result.stress():
        np.testing.assert_allclose(row[:, 0], sigma[0, 0], rtol=1e-10)
    assert not [text for text in result.report.warnings if "bending" not in text]


def test_prestress_that_balances_gravity_leaves_the_body_unmoved():
    rho, g = 2000.0, 9.81
    mesh = kl.box(cells=(2, 2, 4))
    model = kl.Model(mesh, kl.Isotropic3D(E=1e8, nu=0.3, density=rho))
    for side in ("x-", "x+", "y-", "y+", "z-"):
        model.fix(side, side[0])
    model.add(kl.Gravity((0, 0, -g)))
    depth = 1 - centers(mesh)[:, 2]
    stress = -rho * g * depth[:, None] * np.array([0.4, 0.4, 1, 0, 0, 0])
    model.add_prestress(stress)
    result = model.solve()
    np.testing.assert_allclose(result.u, 0, atol=1e-12 * rho * g / 1e8)
    assert result.reaction("z-")[:, 2].sum() == pytest.approx(rho * g, rel=1e-12)
    np.testing.assert_allclose(result.stress("element"), stress, rtol=1e-9, atol=1e-9 * rho * g)


def test_uniform_prestress_released_gives_the_elastic_strain_back():
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), STEEL)
    for side in ("x-", "y-", "z-"):
        model.fix(side, side[0])
    model.add_prestress((2e8, 0, 0, 0, 0, 0))
    result = model.solve()
    np.testing.assert_allclose(result.displacement("x+")[:, 0], -1e-3, rtol=1e-12)
    np.testing.assert_allclose(result.stress(), 0, atol=1e-4)


def test_a_body_activated_in_a_displaced_state_has_no_stress_there():
    mesh = kl.box((2, 1, 1), (2, 2, 2))
    u0 = 1e-3 * np.column_stack([mesh.points[:, 0], 0 * mesh.points[:, 0], mesh.points[:, 1]])
    model = stretched(mesh)
    for side in ("x-", "y-", "z-"):
        model.fix(side, "xyz", u0[mesh.nodes(side)], override=True)
    model.fix("x+", "xyz", u0[mesh.nodes("x+")], override=True)
    model.set_stress_free_state(u0)
    result = model.solve()
    np.testing.assert_allclose(result.u, u0, atol=1e-16)
    np.testing.assert_allclose(result.stress(), 0, atol=1e-3)
    assert result.energy() == pytest.approx(0, abs=1e-10)


def test_an_isotropic_body_written_as_orthotropic_is_the_same():
    E, nu = 2e11, 0.3
    G = E / (2 * (1 + nu))
    same = kl.Orthotropic3D(E, E, E, nu, nu, nu, G, G, G, 7850.0)
    results = []
    for material in (STEEL, same):
        model = kl.Model(kl.box((3, 1, 1), (3, 1, 1), named(20)), material)
        model.fix("x-")
        model.add(kl.Gravity((0, 0, -9.81)))
        results.append(model.solve())
    np.testing.assert_allclose(results[1].u, results[0].u, rtol=0, atol=1e-11 * np.abs(results[0].u).max())


def test_nodes_without_elements_are_reported_and_change_nothing():
    mesh = kl.box((2, 1, 1), (2, 2, 2))
    more = kl.Mesh(np.vstack([mesh.points, [(9.0, 9, 9)]]), mesh.blocks, parts=mesh.parts)
    result = stretched(more).solve()
    np.testing.assert_array_equal(result.u[:-1], stretched().solve().u)
    np.testing.assert_array_equal(result.u[-1], 0)
    assert "1 nodes belong to no element and carry no equations: 28" in result.report.warnings


def test_reaction_moments_balance_the_load():
    mesh = kl.box((3, 1, 1), (3, 1, 1), named(20))
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (10, 20, -30)))
    result = model.solve()
    np.testing.assert_allclose(result.reaction("x-").sum(axis=0), (-10, -20, 30), rtol=1e-10)
    moment = np.cross(mesh.points, result.reactions).sum(axis=0)
    np.testing.assert_allclose(moment, -np.cross((3, 0.5, 0.5), (10, 20, -30)), rtol=1e-10)


@pytest.mark.parametrize("held", [True, False])
def test_one_equation_among_very_many_decides(held):
    model = kl.Model(kl.box((6, 6, 1), (14, 14, 1)), STEEL)
    model.fix("z-", "z")  # 225 equations that all hold the same three motions
    model.fix([0], "xy")
    if held:
        model.fix(model.mesh.nodes("x+")[-1:], "y")
        assert model.check() == []
    else:
        with pytest.raises(kl.ModelError, match=r"can still move: rotation about z\. Fix more"):
            model.check()


@pytest.mark.parametrize("kind", ["KinematicLinear3D6N", "KinematicLinear3D27N", "BBar3D20N", "Reduced3D20N"])
@pytest.mark.parametrize("cells", [(3, 2, 2), (10, 2, 2)])
def test_a_free_expansion_that_the_supports_allow_is_in_equilibrium(kind, cells):
    mesh = kl.box((3, 1, 1), cells, kind)
    model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.3))
    for part, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(part, axis)
    expansion = mesh.points * [0.01, 0.02, 0.03]
    model.set_stress_free_state(expansion)
    result = model.solve()
    assert np.abs(result.u - expansion).max() < 1e-11
    assert np.abs(result.stress()).max() < 1e-5  # of stresses of 1e4 Pa, if it were held

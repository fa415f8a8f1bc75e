"""Numbers at the edge: contrast, size, repeatability, solvers, zero and full supports."""

import numpy as np
import pytest

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)


def clamped(mesh, load=None):
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    model.add(load or kl.Traction("x+", (0, 0, 1.0)))
    return model


@pytest.mark.parametrize("solver", ["dense", "direct"])
@pytest.mark.parametrize(("contrast", "bound"), [(1e3, 1e-11), (1e9, 1e-5), (1e12, 1e-2)])
def test_stiffness_contrast_costs_its_digits_and_no_more(solver, contrast, bound):
    model = kl.Model(kl.box(cells=(1, 1, 2)))
    model.assign(kl.Isotropic3D(E=1.0, nu=0.0), [0])
    model.assign(kl.Isotropic3D(E=contrast, nu=0.0), [1])
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1.0)))
    result = model.solve(solver)
    np.testing.assert_allclose(result.displacement("z+")[:, 2], 0.5 + 0.5 / contrast, rtol=bound)
    warned = [
        text for text in result.report.warnings if "stiffnesses differ" in text or "rounding errors" in text
    ]
    assert len(warned) == (2 if contrast > 1e10 else 0)


def test_a_slender_beam_converges_with_multigrid():
    model = clamped(kl.box((40, 1, 1), (40, 1, 1)))
    direct, multigrid = model.solve("direct"), model.solve("amg")
    assert multigrid.report.solver == "amg"
    assert multigrid.report.iterations < 60
    np.testing.assert_allclose(multigrid.u, direct.u, rtol=0, atol=1e-8 * np.abs(direct.u).max())


def test_multigrid_that_stalls_falls_back_to_a_factorization_and_says_so(monkeypatch):
    from kratos_lite.solvers import multigrid, plan

    class Stalls:
        def solve(self, b, *args):
            return np.zeros_like(b), 500, False

    monkeypatch.setattr(multigrid, "multigrid", lambda *args: Stalls())
    model = clamped(kl.box((4, 1, 1), (4, 1, 1)))
    result = model.solve("amg")
    assert result.report.solver == "direct"
    assert result.report.reason == "multigrid stopped after 500 iterations short of 1e-10"
    np.testing.assert_allclose(result.u, model.solve("dense").u, atol=1e-12 * np.abs(result.u).max())
    monkeypatch.setattr(plan, "FALLBACK_LIMIT", 10)
    with pytest.raises(kl.SolveError, match="too many to factorize instead"):
        model.solve("amg")


def test_conjugate_gradients_give_up_on_an_indefinite_matrix():
    from kratos_lite.solvers.iteration import conjugate_gradients

    A = np.diag([1.0, -1.0, 2.0])
    _, iterations, ok = conjugate_gradients(lambda p: A @ p, np.ones(3), lambda r: r, 1e-10, norm_A=2.0)
    assert not ok
    assert iterations <= 3


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_a_solution_is_bitwise_repeatable(solver):
    first, second = (clamped(kl.box((3, 1, 1), (6, 2, 2))).solve(solver) for _ in range(2))
    np.testing.assert_array_equal(first.u, second.u)
    np.testing.assert_array_equal(first.stress("node"), second.stress("node"))


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_no_load_gives_exact_zeros(solver):
    model = kl.Model(kl.box(cells=(3, 3, 3)), STEEL)
    model.fix("z-")
    result = model.solve(solver)
    assert (result.u == 0).all()
    assert (result.reactions == 0).all()
    assert result.energy() == 0
    assert result.report.force_error == 0
    assert "largest displacement" in str(result)


@pytest.mark.parametrize("solver", ["auto", "dense", "direct", "amg"])
def test_a_fully_prescribed_model_has_no_unknowns_but_reactions_and_stress(solver):
    mesh = kl.box(cells=(2, 2, 2))
    model = kl.Model(mesh, STEEL)
    model.fix(np.arange(mesh.n_nodes), "xyz", 1e-3 * mesh.points)
    result = model.solve(solver)
    assert result.report.unknowns == 0
    np.testing.assert_allclose(result.stress()[..., :3], 525e3, rtol=1e-12)
    assert result.reaction("x+")[:, 0].sum() == pytest.approx(525e3, rel=1e-12)


def test_a_prescribed_rigid_motion_strains_nothing_and_stays_in_balance():
    model = kl.Model(kl.box(cells=(2, 2, 2)), STEEL)
    model.fix("z-", "xyz", (1e-3, 2e-3, -3e-3))
    result = model.solve()
    np.testing.assert_allclose(result.u, np.tile((1e-3, 2e-3, -3e-3), (27, 1)), rtol=1e-12)
    assert np.abs(result.stress()).max() < 1e-6
    assert result.report.force_error == 0


def test_renumbering_nodes_and_elements_changes_the_last_bits_only():
    mesh = kl.box((3, 1, 1), (3, 2, 2), "KinematicLinear3D10N")
    random = np.random.default_rng(5)
    order = random.permutation(mesh.n_nodes)
    place = np.argsort(order)
    old = mesh.blocks[0]
    shuffle = random.permutation(len(old))
    block = kl.Block(old.name, place[old.nodes[shuffle]].astype(np.int32), old.ids, old.properties, old.shape)
    other = kl.Mesh(mesh.points[order], [block])
    u, v = clamped(mesh).solve("direct").u, clamped(other).solve("direct").u
    np.testing.assert_allclose(v, u[order], rtol=0, atol=1e-11 * np.abs(u).max())


def test_a_mesh_whose_nodes_are_scattered_is_solved_as_one_in_order():
    """Its equations have another order than its nodes."""
    mesh = kl.box((1, 1, 2), (5, 5, 10), "KinematicLinear3D10N")
    order = np.random.default_rng(5).permutation(mesh.n_nodes)
    old = mesh.blocks[0]
    other = kl.Mesh(mesh.points[order], [kl.Block(old.name, np.argsort(order)[old.nodes].astype(np.int32))])
    pushed, found = (np.isclose(mesh.points[:, 2], 2.0), np.isclose(other.points[:, 2], 2.0)), []
    for one, ends in zip((mesh, other), pushed, strict=True):
        model = kl.Model(one, STEEL)
        model.fix(np.flatnonzero(one.points[:, 2] == 0))
        model.fix(np.flatnonzero(ends), "x", 1e-3)
        model.add(kl.Gravity((0, 5.0, -9.81)))
        a, b = (int(np.abs(one.points - (x, 1, 2)).sum(axis=1).argmin()) for x in (0, 1))
        model.constrain((a, "y"), {(b, "y"): 1.0})
        analysis = model.static()
        result, mean = analysis.solve(), kl.MeanDisplacement(np.flatnonzero(ends), "z")
        found.append((result.u, result.reactions, result.gradient(mean, wrt="coordinates")))
    assert (np.diff(analysis.system.nodes) < 0).any()
    for values, same in zip(*found, strict=True):
        np.testing.assert_allclose(same, values[order], rtol=0, atol=1e-9 * np.abs(values).max())


def test_a_turned_body_gives_the_turned_answer():
    angle = 0.7
    R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    R = R @ np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    mesh, turned = (kl.box((3, 1, 1), (3, 1, 1), "KinematicLinear3D20N") for _ in range(2))
    turned = turned.replace(points=turned.points @ R.T)
    one, two = kl.Model(mesh, STEEL), kl.Model(turned, STEEL)
    load = np.array([1.0, 2.0, 3.0])
    for model, force in ((one, load), (two, R @ load)):
        model.fix(mesh.nodes("x-"))
        model.add(kl.Traction(mesh.nodes("x+"), force))
        model.add(kl.Pressure(mesh.nodes("z+"), 5.0))
    u, v = one.solve().u, two.solve().u
    np.testing.assert_allclose(v, u @ R.T, rtol=0, atol=1e-11 * np.abs(u).max())
    np.testing.assert_allclose(two.solve().von_mises(), one.solve().von_mises(), rtol=1e-8)


def test_solutions_superpose():
    mesh = kl.box((2, 1, 1), (4, 2, 2))
    loads = kl.Gravity((0, 3, -9.81)), kl.Pressure("z+", 1e4)
    total = clamped(mesh, loads[0])
    total.add(loads[1])
    parts = [clamped(mesh, load).solve().u for load in loads]
    both = total.solve().u
    np.testing.assert_allclose(both, parts[0] + parts[1], rtol=0, atol=1e-12 * np.abs(both).max())


def test_displacements_respect_maxwell_and_betti():
    mesh = kl.box((3, 1, 1), (3, 1, 1), "KinematicLinear3D15N")
    a, b = mesh.nodes(lambda X: (X[:, 0] > 2) & (X[:, 1] > 0.4))[[3, 8]].tolist()
    first = clamped(mesh, kl.PointLoad([a], (0, 1.0, 0))).solve().u
    second = clamped(mesh, kl.PointLoad([b], (0, 0, 1.0))).solve().u
    assert first[b, 2] == pytest.approx(second[a, 1], rel=1e-9)
    assert abs(first[b, 2]) > 0


def test_a_tolerance_that_is_far_too_loose_is_refused(monkeypatch):
    from kratos_lite.solvers import plan

    monkeypatch.setattr(plan, "DIRECT_LIMIT", 0)  # below it the tolerance is round-off
    model = kl.Model(kl.box(cells=(6, 6, 6)), STEEL)
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -9.81)))
    with pytest.raises(kl.SolveError, match=r"backward error of .* only; ask for a smaller tolerance"):
        model.solve("amg", tolerance=0.9)


def test_nearly_incompressible_bodies_are_solved_in_spite_of_multigrid():
    model = kl.Model(kl.box((4, 1, 1), (8, 2, 2)), kl.Isotropic3D(E=1e6, nu=0.4999, density=1.0))
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    multigrid, direct = model.solve("amg"), model.solve("direct")
    np.testing.assert_allclose(multigrid.u, direct.u, rtol=0, atol=1e-7 * np.abs(direct.u).max())


@pytest.mark.parametrize("distance", [1e-3, 1.0, 1e3])
def test_a_rigid_displacement_without_stress_leaves_a_held_body_without_stress(distance):
    model = kl.Model(kl.box(cells=(2, 2, 2)), kl.Isotropic3D(E=1e9, nu=0.3))
    model.fix("z-")
    model.set_stress_free_state(np.full((27, 3), distance))
    result = model.solve()
    assert np.abs(result.u).max() < 1e-14 * distance
    assert np.abs(result.stress()).max() < 1e-5 * distance  # rounding of 1e9 Pa times the distance

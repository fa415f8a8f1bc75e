"""Remote points: rigid parts and mean motions, what they carry, and what is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kratos_lite as kl
from kratos_lite.errors import KratosLiteError
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined

STEEL = kl.Isotropic3D(200e9, 0.3, density=7800.0)
POINT = np.array([2.5, 0.3, -0.4])
FORCE, MOMENT = np.array([10.0, -20.0, 30.0]), np.array([4.0, 5.0, -6.0])


def bar(kind="Element3D8N", cells=(4, 2, 2), **options):
    model = kl.Model(kl.box((2, 1, 1), cells, kind), STEEL, **options)
    model.fix("x-")
    return model


def rigid_part(result, point, part="x+"):
    """Return how far the displacements of a part are from the motion of its point."""
    X = result.mesh.points[result.mesh.nodes(part)]
    turned = np.cross(point.rotation(result), X - point.point)
    return np.abs(result.displacement(part) - point.displacement(result) - turned).max()


@pytest.mark.parametrize("kind", ["Element3D8N", "Element3D20N", "Element3D10N"])
def test_a_rigid_part_is_a_very_stiff_block(kind):
    """A block of 10⁷ times the stiffness on the same face takes the same load as a rigid face."""
    model, long = bar(kind), kl.Model(kl.box((3, 1, 1), (6, 2, 2), kind), STEEL)
    long.fix("x-")
    stiff = long.mesh.points[long.mesh.blocks[0].nodes].mean(axis=1)[:, 0] > 2
    long.assign(kl.Isotropic3D(200e16, 0.3), np.flatnonzero(stiff))
    point = model.rigid("x+", (2.5, 0.5, 0.5))
    model.add(point.load(FORCE, MOMENT))
    long.add(kl.Resultant("x+", FORCE, MOMENT, about=(2.5, 0.5, 0.5)))
    one, other = model.solve(), long.solve(solver="direct")
    assert np.abs(one.u - other.at(one.mesh.points).displacement).max() < 1e-5 * np.abs(one.u).max()
    assert rigid_part(one, point) < 1e-12 * np.abs(one.u).max()


@pytest.mark.parametrize("rigid", [True, False], ids=["rigid", "mean"])
def test_force_and_moment_at_the_point_are_those_in_all(rigid):
    model = bar("Element3D20N", (2, 1, 1))
    point = (model.rigid if rigid else model.distribute)("x+", POINT)
    forces = point.load(FORCE, MOMENT).forces(model.mesh, [])
    arms = model.mesh.points - POINT
    assert np.abs(forces.sum(axis=0) - FORCE).max() < 1e-12 * 30
    assert np.abs(np.cross(arms, forces).sum(axis=0) - MOMENT).max() < 1e-12 * 30
    model.add(point.load(FORCE, MOMENT))
    free = model.solve()
    work = FORCE @ point.displacement(free) + MOMENT @ point.rotation(free)
    assert abs(work - 2 * free.energy()) < 1e-9 * work  # the motion is conjugate to the load
    # the same motion, prescribed: the reaction at the point is the load
    point.fix("xyz", point.displacement(free))
    point.fix_rotation("xyz", point.rotation(free))
    model.loads.clear()
    held = model.solve()
    force, moment = point.reaction(held)
    assert np.abs(held.u - free.u).max() < 1e-8 * np.abs(free.u).max()
    assert np.abs([*(force - FORCE), *(moment - MOMENT)]).max() < 1e-6 * 30


def test_a_moment_alone():
    model = bar()
    model.fix("x-")
    point = model.rigid("x+", POINT)
    model.add(point.load(moment=(0, 50.0, 0)))
    _, moment = kl.reaction_resultant(model, model.solve(), "x-", center=(0, 0, 0))
    assert np.abs(moment - [0, -50.0, 0]).max() < 1e-6


def test_far_away_rigid_and_spread_are_alike():
    """St. Venant: what differs decays over the depth of the bar; the tip turns alike."""
    stress = []
    for rigid in (True, False):
        model = kl.Model(kl.box((4, 1, 1), (16, 4, 4)), STEEL)
        model.fix("x-")
        point = (model.rigid if rigid else model.distribute)("x+", (4, 0.5, 0.5))
        model.add(point.load((0, 0, -1e3), (500.0, 0, 0)))
        stress.append(model.solve().stress("node"))
    X, size = model.mesh.points[:, 0], np.abs(stress[0]).max()
    off = np.abs(stress[0] - stress[1]).max(axis=1)
    assert off[X == 2].max() < 2e-3 * size < 0.05 * size < off[X == 4].max()


def test_a_prescribed_mean_takes_few_iterations():
    """A row that joins all nodes of a face adds some; they were four times as many where cycles knew it."""
    model, held = bar("Element3D8N", (10, 10, 10)), bar("Element3D8N", (10, 10, 10))
    model.distribute("x+", POINT).fix("z", 1e-3)
    held.fix("x+", "z", 1e-3)
    result, exact = model.solve("amg"), model.solve("direct").u
    assert result.report.solver == "amg"
    assert result.report.iterations < 2 * held.solve("amg").report.iterations
    assert np.abs(result.u - exact).max() < 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("rigid", [True, False], ids=["rigid", "mean"])
def test_a_rigid_motion_of_the_point_moves_a_free_body_without_stress(rigid):
    model = kl.Model(kl.box((2, 1, 1), (2, 2, 2), "Element3D20N"), STEEL)
    point = (model.rigid if rigid else model.distribute)("x+", POINT)
    u0, w = np.array([1e-3, 2e-3, -1e-3]), np.array([1e-3, -2e-3, 3e-3])
    point.fix("xyz", u0)
    point.fix_rotation("xyz", w)
    result = model.solve()
    exact = u0 + np.cross(w, model.mesh.points - POINT)
    assert np.abs(result.u - exact).max() < 1e-11
    assert np.abs(point.displacement(result) - u0).max() < 1e-14
    assert np.abs(point.rotation(result) - w).max() < 1e-14


def test_a_hinge_turns_freely_and_carries_no_moment():
    """A bar on a hinge and a roller: statics gives the reactions, and the modes have no rotation left."""
    model = kl.Model(kl.box((2, 1, 1), (4, 2, 2), "Element3D20N"), STEEL)
    hinge = model.rigid("x-", (0, 0.5, 0.5))
    hinge.fix()
    hinge.fix_rotation("xz")
    roller = model.distribute("x+", (2, 0.5, 0.5))
    roller.fix("z")
    model.add(kl.Gravity((0, 0, -10.0)))
    result, weight = model.solve(), 7800.0 * 2 * 10
    for point in (hinge, roller):
        force, moment = point.reaction(result)
        assert np.abs(force - (0, 0, weight / 2)).max() < 1e-6 * weight
        assert np.abs(moment).max() < 1e-6 * weight
    assert hinge.rotation(result)[1] > 1e-7 > 1e-20 > np.abs(hinge.rotation(result)[[0, 2]]).max()
    # w L³ / 24 E I of a beam on two supports
    assert abs(hinge.rotation(result)[1] / (weight * 4 / (24 * 200e9 / 12)) - 1) < 0.02
    model.remove(model.loads[0])
    assert model.modes(1)[0][0] > 100


def test_half_a_model_with_a_hole_in_its_plane_of_symmetry():
    """Nodes that supports hold count in the rigid motion: the half bends as the whole."""
    results = []
    for width, half in ((1.0, False), (0.5, True)):
        model = kl.Model(kl.box((2, width, 1), (4, 2 - half, 2)), STEEL)
        model.fix("x-")
        point = model.rigid("x+", (2, 0.5, 0.5))
        if half:
            model.fix("y+", "y")
        model.add(point.load((0, 0, -100.0 * width), (0, 20.0 * width, 0)))
        result = model.solve()
        results.append([*point.displacement(result), *point.rotation(result)])
    assert np.abs(np.subtract(*results)).max() < 1e-9 * np.abs(results).max()


def test_a_support_that_moves_in_time_carries_a_rigid_part_along():
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1)), STEEL)
    nodes = model.mesh.nodes("x+")
    point = model.rigid("x+", (2, 0.5, 0.5))
    model.fix(nodes[:3], "xyz", lambda t: 1e-3 * t)
    analysis = model.transient()
    for _ in kl.integrate(analysis, dt=1.0, steps=2):
        assert np.abs(point.displacement(analysis.state()) - 1e-3 * analysis.time).max() < 1e-14
        assert np.abs(point.rotation(analysis.state())).max() < 1e-14


def test_modes_of_a_bar_with_a_rigid_end_and_weight():
    """A rod with one end rigid against all else: the other end moves as in the model without."""
    model = bar(cells=(8, 1, 1))
    model.rigid("x+", (2, 0.5, 0.5))
    model.add(kl.Gravity((0, 0, -9.81)))
    omega, shapes = model.modes(6)
    wave = np.pi / 4 * np.sqrt(200e9 / 7800.0)  # of the rod in length, ν → its ends hardly matter
    longitudinal = omega[np.abs(shapes).max(axis=1).argmax(axis=1) == 0][0]
    assert abs(longitudinal / wave - 1) < 0.05
    X = model.mesh.points[model.mesh.nodes("x+")]
    moved = model.remote_points[0].displacement(shapes)
    turned = np.cross(model.remote_points[0].rotation(shapes)[:, None], X - (2, 0.5, 0.5))
    off = shapes[:, model.mesh.nodes("x+")] - moved[:, None] - turned
    assert np.abs(off).max() < 1e-9 * np.abs(shapes).max()


def test_a_finer_mesh_has_the_same_point():
    model = bar(cells=(2, 1, 1))
    point = model.rigid("x+", POINT)
    point.fix("y", 1e-4)
    model.add(point.load((0, 0, 5e3)))
    finer = refined(model, refine(model.mesh, np.array([1])))
    result = finer.solve()
    assert finer.mesh.hanging is not None
    assert rigid_part(result, point) < 1e-9 * np.abs(result.u).max()
    force, moment = point.reaction(result)
    assert abs(point.displacement(result)[1] - 1e-4) < 1e-15
    assert abs(force[1] + result.reaction("x-")[:, 1].sum()) < 1e-6 * abs(force[1])
    assert np.abs([force[0], force[2], *moment]).max() < 1e-6 * abs(force[1])
    adapted = model.solve(error=0.3)
    assert np.abs(point.displacement(adapted) - point.displacement(result)).max() < 2e-6


def test_load_cases_amplitudes_and_the_summary():
    model = bar()
    point = model.rigid("x+", POINT)
    cases = model.solve_cases({"pull": point.load((1e3, 0, 0)), "turn": [point.load((0, 0, 0), (0, 1e3, 0))]})
    pull, turn = (point.displacement(case) for case in cases.values())
    # Maxwell and Betti: the rotation by the force is the displacement by the moment
    assert abs(point.rotation(cases["pull"])[1] - turn[0]) < 1e-9 * np.abs(pull).max()
    point.fix("z", 0.002)
    point.fix_rotation("x")
    model.add(point.load(FORCE), amplitude=2.0)
    assert "rigid x+ at (2.5, 0.3, -0.4) m: u z = 0.002 m, w x = 0 rad" in str(model)
    assert np.abs(point.load(FORCE).forces(model.mesh, []).sum(axis=0) - FORCE).max() < 1e-12 * 30
    twice = model.solve()
    point.release()
    model.loads[:] = [point.load(2 * FORCE)]
    assert np.abs(twice.loads.sum(axis=0) - 2 * FORCE).max() < 1e-10
    assert np.abs(model.solve().reactions.sum(axis=0) + 2 * FORCE).max() < 1e-6


def test_a_new_value_is_used_with_the_same_matrix():
    model = bar()
    point = model.rigid("x+", POINT)
    point.fix("xyz", 1e-3)
    analysis = model.static()
    first, system = analysis.solve(), analysis.system
    point.fix("xyz", (1e-3, 3e-3, 2e-3))
    second = analysis.solve()
    assert analysis.system is system
    assert np.abs(second.u - model.solve().u).max() < 1e-9 * 3e-3
    assert np.abs(first.u - second.u).max() > 1e-3


def test_rigid_parts_that_share_three_nodes_are_one():
    """Faces x+ and y+ of a turned block, held in local axes elsewhere: as the rigid union of both."""
    turn, force = Rotation.from_rotvec((0.3, -0.5, 0.9)).as_matrix(), np.array([1e5, 2e5, -3e5])
    found = []
    for parts in (("x+", "y+"), (lambda X: (X[:, 0] == 2) | (X[:, 1] == 1),)):
        box = kl.box((2, 1, 1), (2, 2, 2))
        sides = [box.nodes(part) for part in ("x-", *parts)]
        X = box.points.copy()
        X[(X[:, 0] == 2) & (X[:, 1] == 1) & (X[:, 2] == 0.5), 0] += 0.1  # the common edge is no line
        model = kl.Model(box.replace(points=X @ turn.T), STEEL)
        axes = kl.Cartesian(turn[:, 0], turn[:, 1])
        model.fix(sides[0], "xz", local=axes)
        model.fix(sides[0][:1], "y", local=axes)
        points = [model.rigid(nodes, POINT) for nodes in sides[1:]]
        points[0].fix("z", 1e-4)
        model.add(points[-1].load(force))
        found.append(model.solve())
    assert np.abs(found[0].u - found[1].u).max() < 1e-9 * np.abs(found[1].u).max()
    assert np.abs(found[0].reactions.sum(axis=0) + force).max() < 1e-6 * 3e5


def test_rigid_parts_that_share_an_edge_are_a_hinge():
    """The parts of a free block turn about the edge without stress elsewhere: they share its motion alone."""
    model = bar(cells=(2, 1, 1))
    one, other = model.rigid("x+", (2, 0, 0)), model.rigid("y+", (2, 1, 0))
    model.supports.drop(model.supports.conditions[0])
    for point in (one, other):
        point.fix()
    one.fix_rotation()
    other.fix_rotation("xyz", (0, 0, 1e-3))
    other.point = np.array([2.0, 1.0, 0.0])
    other.fix("x", 1e-3)
    with pytest.raises(KratosLiteError, match="contradicts itself"):
        model.solve()
    other.fix("x", 0.0)
    result = model.solve()
    assert np.abs(result.displacement("x+")).max() < 1e-15
    assert rigid_part(result, other, "y+") < 1e-15
    assert np.abs(other.rotation(result) - (0, 0, 1e-3)).max() < 1e-15


def test_nodes_on_a_line_follow_a_point_that_holds_the_rotation_about_it():
    """The others turn the line, which moves as its point does."""
    model = bar(cells=(2, 1, 2))
    hub = model.rigid(lambda X: (X[:, 0] == 2) & (X[:, 1] == 1), (2, 0, 0))
    u0, w = np.array([1e-3, 0, 2e-3]), np.array([1e-3, 2e-3, -3e-3])
    hub.fix("xyz", u0)
    hub.fix_rotation("xyz", w)
    result = model.solve()
    X = model.mesh.points[model.mesh.nodes(hub.where)]
    assert np.abs(result.displacement(hub.where) - u0 - np.cross(w, X - hub.point)).max() < 1e-15


def test_a_mean_motion_of_a_held_part_is_that_of_the_supports():
    model = bar()
    model.distribute("x-", POINT).fix()
    model.add(kl.Traction("x+", (1e6, 0, 0)))
    plain = bar()
    plain.add(kl.Traction("x+", (1e6, 0, 0)))
    np.testing.assert_array_equal(model.solve().u, plain.solve().u)


def large(model):
    model.formulation = "total_lagrangian"
    model.rigid("x+", POINT)
    model.solve()


def moving(model):
    model.rigid("x+", POINT)
    model.add(kl.ale.Translation("x", 5.0))
    model.solve()


def held_twice(model):
    model.fix(model.mesh.nodes("x+")[:1], "x", 1e-3)
    model.rigid("x+", POINT).fix("xyz")
    model.remote_points[0].fix_rotation()
    model.solve()


def written(model, path):
    model.rigid("x+", POINT)
    kl.write(path / "model.mdpa", model)


def line(model):
    model.rigid(lambda X: (X[:, 0] == 2) & (X[:, 1] == 0), POINT)
    model.solve()


def on_other_mesh(model):
    point = model.rigid(model.mesh.nodes("x+"), POINT)
    point.displacement(bar().solve())


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda m, p: m.rigid("hole", POINT), "no part 'hole'"),
        (lambda m, p: m.rigid(lambda X: X[:, 0] > 9, POINT), "there is none"),
        (lambda m, p: m.rigid("x+", (0, 0)), "a remote point"),
        (lambda m, p: m.distribute(m.mesh.nodes("x+")[:2], POINT), "finds no face"),
        (lambda m, p: m.rigid("x+", POINT).fix("r"), "axes must be"),
        (lambda m, p: m.rigid("x+", POINT).fix("xy", (1, 2, 3)), "one number, or 2"),
        (lambda m, p: m.rigid("x+", POINT).fix("x", lambda t: t), "is constant; got a function"),
        (lambda m, p: m.rigid("x+", POINT).fix_rotation("x", np.nan), "rotation of a remote point"),
        (lambda m, p: (m.distribute("x-", POINT).fix("x", 1e-3), m.solve()), "contradicts itself"),
        (lambda m, p: line(m), "lie on a line"),
        (lambda m, p: large(m), "small rotations alone"),
        (lambda m, p: moving(m), "moves through the mesh"),
        (lambda m, p: held_twice(m), "node 37 along x = 0 m; node 37 along x = 0.001 m is prescribed"),
        (written, "a remote point cannot be written"),
        (lambda m, p: on_other_mesh(m), "a part with a name"),
        (lambda m, p: m.rigid("x+", POINT).reaction(np.zeros((3, 3))), "from a result or state"),
        (lambda m, p: m.rigid("x+", POINT).displacement(np.zeros((3, 3))), "displacements"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_in_words(act, words, tmp_path):
    with pytest.raises(KratosLiteError, match=words):
        act(bar(), tmp_path)


def test_large_displacements_with_a_part_that_does_not_turn():
    """A face that only slides keeps its shape exactly, however far it goes."""
    model = bar(formulation="total_lagrangian")
    point = model.rigid("x+", POINT)
    point.fix_rotation()
    point.fix("x", 0.4)
    result = model.solve()
    assert np.abs(result.displacement("x+") - point.displacement(result)).max() < 1e-12

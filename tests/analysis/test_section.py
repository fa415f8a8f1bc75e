"""Sections: force and moment through a cut beside loads, closed forms and the integral of the stress."""

import json
from pathlib import Path

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.assembly.nonlinear_assembly import internal_forces
from kratos_lite.errors import KratosLiteError
from kratos_lite.mesh.refinement import refine

LAW = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0, alpha=1e-5)
LENGTH, FORCE = 4.0, np.array([7.0, 2.0, 5.0])
ALL = [f"KinematicLinear3D{n}N" for n in (4, 6, 8, 10, 15, 20, 27)] + ["EnhancedStrain3D8N", "BBar3D8N"]


def cantilever(element="KinematicLinear3D8N", cells=(4, 1, 1), law=LAW):
    model = kl.Model(kl.box((LENGTH, 1.0, 1.0), cells, element), law)
    model.fix("x-")
    model.add(kl.Traction("x+", FORCE))
    return model


def beyond(result, x, of):
    """Return force and moment about a point of nodal forces beyond a plane, those on it half."""
    weight = np.heaviside(np.round(result.mesh.points[:, 0] - x, 9), 0.5)
    forces = result.loads + result.reactions
    return weight @ forces, weight @ np.cross(result.mesh.points - of, forces)


@pytest.mark.parametrize("element", ALL)
@pytest.mark.parametrize("x", [1.3, 2.0, 0.0])
def test_a_cantilever_has_constant_forces_and_a_linear_bending_moment(element, x):
    cut = cantilever(element).solve(tolerance=1e-13).section(("x", x))
    lever = LENGTH - x
    assert np.abs(cut.force - FORCE).max() < 1e-10 * FORCE.max()
    assert np.abs(cut.moment - [0.0, -FORCE[2] * lever, FORCE[1] * lever]).max() < 1e-10 * FORCE[2] * LENGTH
    assert abs(cut.area - 1) < 1e-12
    assert np.abs(cut.centroid - [x, 0.5, 0.5]).max() < 1e-12
    at_end = cut.moment_about((LENGTH, 0.5, 0.5))
    assert np.abs(at_end).max() < 1e-10 * FORCE[2] * LENGTH


def test_a_plane_along_faces_of_curved_cells_cuts_them_once():
    model = kl.Model(kl.box((100.0, 20.0, 10.0), (10, 4, 2), "KinematicLinear3D10N"), LAW)
    model.fix("x-")
    cut = model.solve().section(("x", 50.0))
    assert abs(cut.area - 200) < 1e-9
    assert np.abs(cut.centroid - [50, 10, 5]).max() < 1e-9


def test_a_shaft_carries_its_torque_through_every_cut():
    model = kl.Model(kl.box((LENGTH, 1.0, 1.0), (3, 2, 2), "KinematicLinear3D20N"), LAW)
    model.fix("x-")
    model.add(kl.Traction("x+", lambda X: np.column_stack([0 * X[:, 0], 0.5 - X[:, 2], X[:, 1] - 0.5])))
    cut = model.solve().section(("x", 1.7))
    torque = 1 / 6  # ∫ (y² + z²) dA of a unit square
    assert np.abs(cut.force).max() < 1e-11
    assert np.abs(cut.moment - [torque, 0, 0]).max() < 1e-10 * torque
    assert np.abs(cut.stress_moment - cut.moment).max() < 0.02 * torque


@pytest.mark.parametrize("x", [0.0, 1.0, 1.5, 2.0, 4.0])
def test_a_hanging_bar_carries_the_weight_below_the_cut(x):
    model = kl.Model(kl.box((LENGTH, 1.0, 1.0), (4, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
    model.fix("x-")
    model.add(kl.Gravity((10.0, 0, 0)))
    result, weight = model.solve(), 1e4
    cut = result.section(("x", x))
    inside = np.clip(x, 0.5, LENGTH - 0.5)  # the cut beside the end of a bar leaves out half of an element
    assert abs(cut.force[0] - weight * (LENGTH - inside)) < 1e-10 * weight * LENGTH
    assert abs(result.section([2, 3]).force[0] - 2 * weight) < 1e-10 * weight * LENGTH


def test_the_stress_on_an_oblique_cut_of_a_bar():
    model = kl.Model(kl.box((LENGTH, 1.0, 1.0), (4, 2, 2)), kl.Isotropic3D(E=1e6, nu=0.0))
    model.fix("x-")
    model.add(kl.Traction("x+", (7.0, 0, 0)))
    n = np.array([2.0, 1.0, 0.0]) / 5**0.5
    cut = model.solve().section((n * 3, 3 * n[0] * 2.1))
    assert np.abs(cut.normal - n).max() < 1e-15
    assert abs(cut.area - 1 / n[0]) < 1e-12
    assert np.abs(cut.traction - [7.0 * n[0], 0, 0]).max() < 1e-10
    assert np.abs(cut.stress - [7.0, 0, 0, 0, 0, 0]).max() < 1e-10
    assert np.abs(cut.stress_force - cut.force).max() < 1e-10
    assert np.abs(cut.stress_moment - cut.moment).max() < 1e-10
    assert abs(cut.weights.sum() - cut.area) < 1e-13


def test_the_integral_of_the_stress_comes_to_the_force_on_finer_meshes():
    def off(cells, recovered):
        cut = cantilever("KinematicLinear3D20N", cells).solve().section(("x", 1.9), recovered=recovered)
        return np.abs(cut.stress_moment - cut.moment).max() / np.abs(cut.moment).max()

    for recovered in (True, False):
        assert off((8, 2, 2), recovered) < min(0.01, off((4, 1, 1), recovered))


def test_a_curved_cut_has_its_area():
    mesh = kl.annulus(1.0, 2.0, 0.5, cells=(1, 16, 1), element="KinematicLinear3D20N")
    model = kl.Model(mesh, LAW)
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 3.0)))
    cut = model.solve().section(("z", 0.2))
    assert abs(cut.area / (3 * np.pi) - 1) < 2e-3
    assert np.abs(cut.centroid - [0, 0, 0.2]).max() < 1e-3
    assert abs(cut.force[2] / (9 * np.pi) - 1) < 1e-4  # as exact as the faces of the mesh are


# ---- parts ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["KinematicLinear3D8N", "KinematicLinear3D10N", "KinematicLinear3D15N"])
def test_around_a_part_passes_what_passes_through_the_plane_between(element):
    result = cantilever(element, (4, 2, 2)).solve(tolerance=1e-13)
    m = result.mesh
    m.add_part("end", np.flatnonzero(m.points[:, 0] > 1.999))
    part, plane = result.section("end"), result.section(("x", 2.0))
    assert np.abs(part.normal - [1, 0, 0]).max() < 1e-12
    assert abs(part.area - 1) < 1e-12
    assert np.abs(part.force - FORCE).max() < 1e-10 * 7
    assert np.abs(part.moment - plane.moment).max() < 1e-9
    assert np.abs(part.stress_moment - plane.stress_moment).max() < 0.3  # recovered on the other side
    other = np.setdiff1d(np.arange(m.n_elements), m.elements("end"))
    assert np.abs(result.section(other).force + FORCE).max() < 1e-10 * 7
    assert np.abs(result.section(other).normal - [-1, 0, 0]).max() < 1e-12


def test_around_an_inner_part_without_loads_nothing_passes():
    result = cantilever("KinematicLinear3D8N", (6, 3, 3)).solve(tolerance=1e-13)
    inner = np.flatnonzero((np.abs(centers(result.mesh) - [2, 0.5, 0.5]) < [0.4, 0.2, 0.2]).all(axis=1))
    cut = result.section(inner)
    assert len(inner) == 2
    assert abs(cut.area - (2 / 9 + 8 * 2 / 9)) < 1e-12
    assert np.abs(cut.normal).max() == 0
    assert np.abs([cut.force, cut.moment]).max() < 1e-10
    assert "normal" not in str(cut)


def centers(mesh):
    return np.concatenate([mesh.points[block.nodes].mean(axis=1) for block in mesh.blocks])


# ---- whatever the analysis ---------------------------------------------------------------------------------


def test_hanging_nodes():
    mesh = kl.box((LENGTH, 1.0, 1.0), (4, 2, 2))
    mesh = refine(mesh, np.flatnonzero(centers(mesh)[:, 0] > 2)).mesh
    assert mesh.hanging is not None
    model = kl.Model(mesh, LAW)
    model.fix("x-")
    model.add(kl.Traction("x+", FORCE))
    result = model.solve(tolerance=1e-13)
    for x in (1.7, 2.0, 2.2):
        cut = result.section(("x", x))
        assert np.abs(cut.force - FORCE).max() < 1e-10 * 7
        assert abs(cut.moment[1] + FORCE[2] * (LENGTH - x)) < 1e-9
    part = result.section(np.flatnonzero(centers(mesh)[:, 0] > 2))
    assert abs(part.area - 1) < 1e-12
    assert np.abs(part.force - FORCE).max() < 1e-10 * 7


def test_a_cut_along_tied_faces():
    one = kl.box((2, 1, 1), (2, 2, 2))
    n = one.n_nodes
    points = np.vstack([one.points, one.points + np.array([2, 0, 0])])
    nodes = one.blocks[0].nodes
    model = kl.Model(kl.Mesh(points, {"KinematicLinear3D8N": np.vstack([nodes, nodes + n])}), LAW)
    left, right = (np.flatnonzero(np.abs(one.points[:, 0] - x) < 1e-9) for x in (0, 2))
    tied, to = ((3 * rows[:, None] + np.arange(3)).ravel() for rows in (left + n, right))
    model.constrain(tied, to)
    model.fix("x-")
    model.add(kl.Traction("x+", FORCE))
    result = model.solve(tolerance=1e-13)
    for x in (1.5, 2.0, 2.5):
        assert np.abs(result.section(("x", x)).force - FORCE).max() < 1e-9
    with pytest.raises(KratosLiteError, match="meets no face between two elements"):
        result.section(np.arange(8))


def tied():
    left, right = (kl.box((2, 1, 1), n, "20N", origin=(x, 0, 0)) for x, n in ((0, (2, 2, 2)), (2, (2, 3, 3))))
    model = kl.Model(kl.join({"left": left, "right": right}), LAW)
    model.tie("left.x+", "right.x-")
    model.fix("left.x-")
    model.add(kl.Traction("right.x+", FORCE))
    return model


@pytest.mark.parametrize(
    ("where", "part", "x", "sign"),
    [
        ("right", None, 2.0, 1),  # around the part: through the tie
        ("left", None, 2.0, -1),
        (("x", 2.0), "left", 2.0, 1),
        (("x", 2.0), "right", 2.0, 1),
        (("x", 2.6), "right", 2.6, 1),
    ],
)
def test_one_part_of_a_tied_body(where, part, x, sign):
    cut = tied().solve(tolerance=1e-13).section(where, part=part)
    assert abs(cut.area - 1) < 1e-12
    assert np.abs(cut.normal - [sign, 0, 0]).max() < 1e-12
    assert np.abs(cut.centroid - [x, 0.5, 0.5]).max() < 1e-12
    assert np.abs(sign * cut.force - FORCE).max() < 1e-9 * 7
    assert np.abs(cut.moment_about((4, 0.5, 0.5))).max() < 1e-8
    assert np.abs(cut.stress_force - cut.force).max() < 0.05


def test_a_plane_cuts_one_of_two_bars_that_share_their_ends():
    """Two bars side by side, one twice as stiff: each carries its share."""
    mesh = kl.box((4.0, 3.0, 1.0), (4, 3, 1))
    y = centers(mesh)[:, 1]
    inner = np.flatnonzero((np.abs(y - 1.5) > 0.5) | (np.abs(centers(mesh)[:, 0] - 2) > 1))
    mesh = kl.Mesh(mesh.points, {"KinematicLinear3D8N": mesh.blocks[0].nodes[inner]})
    model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.0))
    y = centers(mesh)[:, 1]
    mesh.add_part("stiff", lambda X: X[:, 1] > 1.999)
    model.assign(kl.Isotropic3D(E=2e6, nu=0.0), "stiff")
    model.fix("x-")
    model.fix("x+", "xyz", [1e-3, 0, 0])
    result = model.solve(tolerance=1e-13)
    whole = result.section(("x", 2.0))
    stiff, soft = (result.section(("x", 2.0), part=part) for part in ("stiff", np.flatnonzero(y < 1)))
    assert np.abs(stiff.force + soft.force - whole.force).max() < 1e-9 * whole.force[0]
    assert abs(stiff.area - 1) < 1e-12
    assert abs(whole.area - 2) < 1e-12
    assert stiff.force[0] > 1.5 * soft.force[0] > 0
    assert "of 'stiff'" in str(stiff)


@pytest.mark.parametrize("element", ["KinematicLinear3D8N", "EnhancedStrain3D8N", "BBar3D8N"])
def test_laws_that_are_not_linear(element):
    law = kl.J2Plasticity3D(E=1e6, nu=0.3, yield_stress=40.0, hardening=1e5)
    steps = cantilever(element, (2, 1, 1), law).quasi_static(tolerance=1e-12)
    list(kl.integrate(steps, 1.0, 1))
    cut = steps.result().section(("x", 1.3))
    assert np.abs(cut.force - FORCE).max() < 1e-9 * 7
    assert abs(cut.moment[1] + FORCE[2] * (LENGTH - 1.3)) < 1e-8


@pytest.mark.parametrize(
    ("formulation", "law"),
    [
        ("total_lagrangian", LAW),
        ("f_bar", kl.NeoHookean3D(E=1e6, nu=0.45)),
        ("total_lagrangian", kl.NeoHookean3D(E=1e6, nu=0.3)),
    ],
)
def test_large_displacements_have_the_arms_of_the_deformed_body(formulation, law):
    model = kl.Model(kl.box((LENGTH, 1.0, 1.0), (4, 1, 1)), law, formulation)
    model.fix("x-")
    load = 4000.0
    model.add(kl.Traction("x+", (0, 0, load)))
    steps = model.quasi_static(tolerance=1e-12)
    list(kl.integrate(steps, 0.5, 2))
    result = steps.result()
    tip = result.mesh.nodes("x+")
    cut = result.section(("x", 2.0))
    lever = (result.mesh.points + result.u)[tip, 0].mean() - cut.centroid[0]
    assert abs(lever - 2) > 0.01
    assert np.abs(cut.force - [0, 0, load]).max() < 1e-8 * load
    assert abs(cut.moment[1] + load * lever) < 1e-8 * load * LENGTH


def test_the_traction_of_a_stretched_bar_is_the_force_on_its_undeformed_area():
    model = kl.Model(kl.box((LENGTH, 1.0, 1.0), (2, 1, 1)), LAW, "total_lagrangian")
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Traction("x+", (1e5, 0, 0)))
    result = model.solve()
    cut = result.section(((1.0, 1.0, 0.0), 1.7))
    assert result.u[:, 0].max() > 0.1
    assert np.abs(cut.traction - [1e5 / 2**0.5, 0, 0]).max() < 1e-3
    assert np.abs(cut.stress_force - cut.force).max() < 1e-3


def test_prestress_and_temperature():
    model = cantilever()
    model.fix("x+", "x")
    model.add_prestress((100.0, 50, 0, 10, 0, 0))
    model.add(kl.Temperature(30.0))
    result = model.solve(tolerance=1e-13)
    cut = result.section(("x", 1.0))
    force, moment = beyond(result, 1.0, cut.centroid)
    assert abs(cut.force[0]) > 100
    assert np.abs(cut.force - force).max() < 1e-10 * np.abs(force).max()
    assert np.abs(cut.moment - moment).max() < 1e-10 * np.abs(force).max()
    assert abs(cut.stress_force[0] / cut.force[0] - 1) < 1e-2


def test_load_cases_are_in_equilibrium_each():
    model = cantilever()
    cases = {"pull": [kl.Traction("x+", (3.0, 0, 0))], "bend": [kl.Traction("x+", (0, 0, 2.0))]}
    found = {name: result.section(("x", 1.5)) for name, result in model.solve_cases(cases).items()}
    assert np.abs(found["pull"].force - [3, 0, 0]).max() < 1e-10
    assert np.abs(found["bend"].moment - [0, -2.0 * 2.5, 0]).max() < 1e-9


def test_a_transient_adds_the_inertia_beyond_the_cut():
    model = cantilever()
    analysis = model.transient()
    (state,) = kl.integrate(analysis, 1e-3, 5, every=5)
    result, a = analysis.result(state), state.a
    weight = np.heaviside(np.round(result.mesh.points[:, 0] - 1.5, 9), 0.5)
    inertia = weight @ (model.matrices().M @ a.ravel()).reshape(-1, 3)
    force = beyond(result, 1.5, np.zeros(3))[0] - inertia
    assert np.abs(inertia).max() > 0.1
    assert np.abs(result.section(("x", 1.5)).force - force).max() < 1e-9 * np.abs(FORCE).max()


@pytest.mark.parametrize("element", ALL)
def test_internal_forces_are_those_of_the_stiffness(element):
    model = cantilever(element, (2, 1, 1))
    u = np.random.default_rng(3).standard_normal(model.mesh.points.shape)
    expected = (model.matrices().K @ u.ravel()).reshape(-1, 3)
    forces = internal_forces(model.mesh.points, model.element_groups(), u)
    assert np.abs(forces - expected).max() < 1e-11 * np.abs(expected).max()


# ---- bad input, files and the command line ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("where", "words"),
    [
        (("x", 4.5), ["x = 4.5 m misses the body", "0 … 4 m"]),
        (("q", 1.0), ["a section: an axis is x, y or z", "'q'"]),
        (((0, 0, 0), 1.0), ["the normal of a section must not be zero"]),
        (("x", np.nan), ["the offset of a section"]),
        ("hub", ["no part 'hub'"]),
        ("x+", ["part 'x+' has no elements", "not of its surface"]),
        ("x=1", ["a section by a plane is a pair such as ('x', 0.5); got 'x=1'"]),
        (None, ["meets no face between two elements", "the force in a tie"]),
        ([0, 99], ["element indices must lie in 0 … 3"]),
        (((1, 1, 1), 0.0), ["cuts no element"]),
    ],
)
def test_cuts_that_are_none(where, words):
    result = cantilever().solve()
    with pytest.raises(KratosLiteError) as error:
        result.section(where)
    assert all(word in str(error.value) for word in words), error.value


@pytest.mark.parametrize(
    ("where", "part", "words"),
    [
        (("x", 1.5), "x-", "part 'x-' has no elements"),
        (("x", 1.5), [], "the part of a section has no elements"),
        (("x", 1.5), [3], "the section x = 1.5 m misses the part, which spans 3 … 4 m there"),
        ([0], [3], "part belongs to a section by a plane"),
    ],
)
def test_parts_that_no_plane_cuts(where, part, words):
    with pytest.raises(KratosLiteError, match=words):
        cantilever().solve().section(where, part=part)


def test_a_part_of_a_mesh_on_another_process_is_refused():
    result = cantilever().solve()
    result.mesh = result.mesh.replace(whole=False)
    with pytest.raises(KratosLiteError, match="a section needs the whole mesh on one process"):
        result.section(("x", 1.0))


def test_the_table_and_the_file_of_a_section(tmp_path):
    cut = cantilever().solve().section(("x", 1.5))
    table = dict(cut.table())
    assert table["section"] == "x = 1.5 m, area 1 m², centroid (1.5, 0.5, 0.5) m"
    assert table["section force"] == "(7, 2, 5) N (normal 7, shear 5.38516)"
    assert table["section moment"] == "(0, -12.5, 5) N m (torsion 0, bending 13.4629)"
    fine = cantilever("KinematicLinear3D20N", (8, 2, 2)).solve().section(("x", 1.9))
    for each in (cut, fine):
        off = np.linalg.norm(each.stress_moment - each.moment) / np.linalg.norm(each.moment)
        assert (
            ("off: a finer mesh" in dict(each.table())["moment of stress"]) == (off > 0.05) == (each is cut)
        )
    kl.write(tmp_path / "cut.csv", cut)
    head, *rows = (tmp_path / "cut.csv").read_text().splitlines()
    assert head.startswith("x [m],y [m],z [m],area [m2],stress xx [Pa]")
    assert len(rows) == len(cut.points)


def test_sections_on_the_command_line(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = cantilever()
    model.mesh.add_part("end", lambda X: X[:, 0] > 1.9)
    kl.write("beam.mdpa", model)
    words = ["--section", "x=1.5", "--section", "end", "--section", "end:x=2.5", "--json", "beam.json"]
    done = run("solve", "beam.mdpa", *words)
    assert done.code == 0
    assert "section force         (7, 2, 5) N" in done.out
    first, second, third = json.loads(Path("beam.json").read_text())["sections"]
    assert abs(third["moment"][1] + 7.5) < 1e-9
    assert third["where"] == "x = 2.5 m of 'end'"
    assert np.abs(np.array(first["moment"]) - [0, -12.5, 5]).max() < 1e-9
    assert second["where"] == "around 'end'"
    assert abs(second["force"][2] - 5) < 1e-9
    assert run("solve", "beam.mdpa", "--section", "x=9").refuses("x = 9 m misses the body")
    assert run("solve", "beam.mdpa", "--section", "end:x=1").refuses("x = 1 m misses the part")
    assert run("solve", "beam.mdpa", "--section", "x=1", "--modes", "2").refuses("of a result of a model")

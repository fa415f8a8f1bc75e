"""Loads and results in local axes: turned bodies, closed forms of tubes, components by name; refusals."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kratos_lite as kl
from kratos_lite.errors import InputError
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined

STEEL = kl.Isotropic3D(200e9, 0.3, density=7800.0)
R = Rotation.from_rotvec((0.4, -0.7, 1.1)).as_matrix()
TURNED = kl.Cartesian(R[:, 0], R[:, 1])
AROUND = kl.Cylindrical()
V = (3.0, -5.0, 7.0)


@pytest.fixture(scope="module")
def boxes():
    """Return a block and the same turned by R, with their elements."""
    box = kl.box((1, 1, 2), (2, 2, 3), "KinematicLinear3D20N")
    meshes = box, box.replace(points=box.points @ R.T)
    return [(mesh, kl.Model(mesh, STEEL).element_groups()) for mesh in meshes]


def tube(*cells, element="KinematicLinear3D20N", turn=np.pi / 6):
    """Return a sector of a tube of radii 1 and 2 and height 0.2, and its r."""
    box = kl.box((1.0, 1.0, 0.2), cells, element)
    r, t = 1 + box.points[:, 0], turn * box.points[:, 1]
    points = np.stack([r * np.cos(t), r * np.sin(t), box.points[:, 2]], axis=1)
    return box.replace(points=points), r


@pytest.mark.parametrize(
    "load",
    [
        lambda local: kl.Traction("z+", V, local=local),
        lambda local: kl.BodyForce(V, local=local),
        lambda local: kl.Gravity(V, local=local),
        lambda local: kl.PointLoad("z+", V, each=True, local=local),
        lambda local: kl.Resultant("z+", V, (1.0, 2.0, 4.0), local=local),
    ],
)
def test_a_load_turns_with_its_axes(boxes, load):
    (mesh, groups), (turned, turned_groups) = boxes
    expected = load(None).forces(mesh, groups) @ R.T
    one = load(TURNED)
    assert np.abs(one.forces(turned, turned_groups) - expected).max() < 1e-11 * np.abs(expected).max()
    assert repr(TURNED) in repr(one)
    assert "local" not in repr(load(None))


def test_a_force_on_a_point_of_a_cylinder_points_away_from_its_axis():
    mesh, _ = tube(2, 3, 1)
    point = (1.5 * np.cos(0.3), 1.5 * np.sin(0.3), 0.1)
    forces = kl.PointLoad(point, (2.0, 0, 0), local=AROUND).forces(mesh, [])
    assert np.abs(forces.sum(axis=0) - 2 * np.array([np.cos(0.3), np.sin(0.3), 0])).max() < 1e-12


def test_tractions_around_an_axis_twist_by_the_moment_of_the_closed_form():
    """Traction c r around the axis on an annulus of radii 1 and 2: M = c 2π (2⁴ - 1) / 4."""
    mesh, _ = tube(2, 16, 1, turn=2 * np.pi * (1 - 1e-12))
    shear = kl.Traction("z+", lambda X: 3.0 * np.hypot(X[:, :1], X[:, 1:2]) * [0, 1, 0], local=AROUND)
    forces, M = shear.forces(mesh, []), 3 * 2 * np.pi * 15 / 4
    assert np.abs(forces.sum(axis=0)).max() < 1e-6 * M
    assert abs(np.cross(mesh.points, forces).sum(axis=0)[2] / M - 1) < 1e-4


def test_lames_tube_by_a_sector_on_inclined_rollers_with_its_components_by_name():
    """σ_r = p (1 - 4 / r²) / 3, σ_t = p (1 + 4 / r²) / 3 of radii 1 and 2, plane strain."""
    mesh, r = tube(6, 4, 1)
    p, model = 3e6, kl.Model(mesh, STEEL)
    angle = np.arctan2(mesh.points[:, 1], mesh.points[:, 0])
    model.fix(np.flatnonzero(np.isclose(angle, 0) | np.isclose(angle, np.pi / 6)), "t", local=AROUND)
    model.fix(np.arange(mesh.n_nodes), "z")
    inner = np.flatnonzero(np.isclose(r, 1, atol=1e-9))
    model.add(kl.Traction(inner, (p, 0, 0), local=AROUND))
    result = model.solve()
    columns = result.columns(AROUND)
    radial, around = columns["stress rr [Pa]"], columns["stress tt [Pa]"]
    assert np.abs(radial / p - (1 - 4 / r**2) / 3).max() < 0.02
    assert np.abs(around / p - (1 + 4 / r**2) / 3).max() < 0.02
    assert np.abs(columns["displacement t [m]"]).max() < 1e-3 * np.abs(columns["displacement r [m]"]).max()
    u = p / 200e9 * 1.3 / 3 * (0.4 * r + 4 / r)
    assert np.abs(columns["displacement r [m]"] / u - 1).max() < 2e-3
    finer = refined(model, refine(mesh))
    force = finer.loads[0].forces(finer.mesh, []).sum(axis=0)
    assert np.abs(force - model.loads[0].forces(mesh, []).sum(axis=0)).max() < 1e-3 * np.abs(force).max()
    axes = result.plot(values="srr", local=AROUND, scale=0).axes
    assert any("stress rr" in text for one in axes for text in (one.get_title(), one.get_ylabel()))


@pytest.mark.parametrize("axes", [kl.Cylindrical, kl.Spherical])
def test_results_on_the_axis_have_the_components_beside_it(axes):
    """A solid bar under a uniform stress: at its axis r is along x."""
    mesh = kl.box((1, 1, 1), (2, 2, 2), origin=(-0.5, -0.5, 0))
    model, around = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.0)), axes()
    model.symmetry("x-")
    model.symmetry("y-")
    model.symmetry("z-")
    model.add(kl.Traction("x+", (1e6, 0, 0)))
    result = model.solve()
    stress = result.stress("node", around)
    at = np.flatnonzero(np.isclose(mesh.points[:, :2], 0).all(axis=1))
    i = 0 if axes is kl.Cylindrical else 1
    top = at[mesh.points[at, 2] > 0]
    assert np.abs(stress[top, i] - 1e6).max() < 1
    assert np.abs(np.delete(stress[top], i, axis=1)).max() < 1
    assert np.isfinite(result.field("displacement", "node", around)).all()
    assert {"stress rr [Pa]", "displacement r [m]"} <= set(result.columns(around))


@pytest.mark.parametrize("at", ["node", "averaged", "element"])
def test_components_are_those_of_turned_tensors(at):
    mesh, _ = tube(2, 2, 1)
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    model.add(kl.Traction("z+", V))
    result = model.solve()
    X = mesh.points if at != "element" else mesh.points[mesh.blocks[0].nodes].mean(axis=1)
    D = AROUND.directions(X)
    stress = result.stress(at, AROUND)
    assert np.array_equal(stress, AROUND.stresses(result.stress(at), X))
    strain, turned = result.strain(at), result.strain(at, local=AROUND)
    for i, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))):
        tensor = np.zeros((len(X), 3, 3))
        for k, (c, d) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))):
            tensor[:, c, d] = tensor[:, d, c] = strain[:, k] / (1 if c == d else 2)
        expected = np.einsum("mi,mij,mj->m", D[:, a], tensor, D[:, b]) * (1 if a == b else 2)
        assert np.abs(turned[:, i] - expected).max() < 1e-12 * np.abs(strain).max()
    mises = result.field("von_mises", at, AROUND)
    assert np.array_equal(mises, result.von_mises(at))


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda m, r: kl.Traction("z+", V, local="polar"), "local must be a LocalAxes, such as kl.Cylind"),
        (lambda m, r: kl.Traction("z+", np.ones((8, 3)), local=AROUND), "a traction along local axes is"),
        (lambda m, r: kl.BodyForce(np.ones((8, 3)), local=AROUND), "a force along local axes is"),
        (lambda m, r: kl.PointLoad((0.0, 0.0, 0.0), V, local=AROUND).forces(m.mesh, []), "lies on the axis"),
        (lambda m, r: r.stress("gauss", AROUND), "components along local axes are of nodes and elements"),
        (lambda m, r: r.stress("node", "polar"), "local must be a LocalAxes"),
        (lambda m, r: r.field("principal_directions", "node", AROUND), "has no components along local axes"),
        (lambda m, r: r.plot(values="sxx", local=AROUND), "unknown field 'sxx'"),
    ],
)
def test_what_has_no_local_axes_is_refused(act, words):
    model = kl.Model(kl.box(), STEEL)
    model.fix("z-")
    model.add(kl.Traction("z+", V))
    with pytest.raises(InputError, match=words):
        act(model, model.solve())

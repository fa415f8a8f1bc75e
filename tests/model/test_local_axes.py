"""Supports and results in local axes: turned bodies, sectors, planes of symmetry; what is refused."""

from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kratos_lite as kl
from kratos_lite.errors import InputError, KratosLiteError, ModelError
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined

STEEL = kl.Isotropic3D(200e9, 0.3, density=7800.0)
R = Rotation.from_rotvec((0.4, -0.7, 1.1)).as_matrix()
SIDES = ("x-", "y-", "z-")


def turned(axes_of):
    """Return a block held on three sides along some of its axes, and the same turned by R."""
    models, box = [], kl.box((1, 1, 2), (2, 2, 3), "Element3D8N")
    for Q in (np.eye(3), R):
        model = kl.Model(box.replace(points=box.points @ Q.T), STEEL)
        for side, (axes, value) in axes_of.items():
            local = kl.Cartesian(Q[:, 0], Q[:, 1])
            model.fix(box.nodes(side), axes, value, local=None if Q is not R else local)
        model.add(kl.Gravity(Q @ (10.0, 20.0, -30.0)))
        models.append(model)
    return models


@pytest.mark.parametrize(
    "axes_of",
    [
        {"z-": ("xyz", 0.0)},
        {"z-": ("z", 0.0), "x-": ("xy", 0.0)},
        {"z-": ("xyz", 0.0), "z+": ("yz", 1e-3)},
        {"z-": ("xyz", 0.0), "z+": ("x", [[1e-4]])},
        {"x-": ("x", 0.0), "y-": ("y", 0.0), "z-": ("z", 0.0)},
    ],
    ids=["clamp", "rollers and rails", "values of two", "value of one", "edges of two and three rollers"],
)
def test_a_turned_body_moves_as_the_one_that_is_not(axes_of):
    straight, inclined = (model.solve() for model in turned(axes_of))
    size = np.abs(straight.u).max()
    assert np.abs(inclined.u - straight.u @ R.T).max() < 1e-9 * size
    forces = np.abs(straight.reactions).max()
    assert np.abs(inclined.reactions - straight.reactions @ R.T).max() < 1e-7 * forces
    axes = kl.Cartesian(R[:, 0], R[:, 1])
    X = inclined.mesh.points
    assert np.abs(axes.vectors(inclined.u, X) - straight.u).max() < 1e-9 * size
    stress = straight.stress("node")
    assert np.abs(axes.stresses(inclined.stress("node"), X) - stress).max() < 1e-7 * np.abs(stress).max()


def test_planes_of_symmetry_and_antisymmetry():
    straight = kl.Model(kl.box((1, 1, 2), (2, 2, 3), "Element3D8N"), STEEL)
    half = kl.Model(straight.mesh.replace(points=straight.mesh.points @ R.T), STEEL)
    straight.fix("z-", "z")
    straight.fix("y-", "y")
    straight.fix("x-", "yz")
    half.symmetry(straight.mesh.nodes("z-"))
    half.symmetry(straight.mesh.nodes("y-"))
    half.symmetry(straight.mesh.nodes("x-"), anti=True)
    for model, Q in ((straight, np.eye(3)), (half, R)):
        model.add(kl.Gravity(Q @ (0.0, 2.0, 3.0)))
    one, other = straight.solve().u, half.solve().u
    assert np.abs(other - one @ R.T).max() < 1e-9 * np.abs(one).max()
    plain = kl.Model(straight.mesh, STEEL)
    plain.symmetry("x-")
    assert str(plain.supports) == "x-, x = 0 m"
    assert len(plain.supports.constraints) == 0
    assert plain.supports.fixed[:, 0].sum() == len(plain.mesh.nodes("x-"))


def test_a_sector_of_a_sphere_and_a_finer_one():
    """Lamé's hollow sphere of radii 1 and 2: σ_t(a) = p (2 a³ + b³) / 2 (b³ - a³)."""
    box = kl.box((1, 1, 1), (4, 3, 3), "KinematicLinear3D20N")
    s, a, b = box.points.T
    place = np.stack([np.ones_like(a), np.tan((a - 0.5) * 0.5), np.tan((b - 0.5) * 0.5)], axis=1)
    place *= ((1 + s) / np.linalg.norm(place, axis=1))[:, None]
    model = kl.Model(box.replace(points=place), STEEL)
    sphere = kl.Spherical(axis=(1.0, 0.1, 0.2))
    rim = np.flatnonzero(np.isclose(a, 0) | np.isclose(a, 1) | np.isclose(b, 0) | np.isclose(b, 1))
    model.fix(rim, "tp", local=sphere, name="cut")
    model.add(kl.Pressure(np.flatnonzero(s == 0), 1e6))
    exact = 1e6 * (2 + 8) / (2 * 7)
    for one in (model, refined(model, refine(model.mesh))):
        result, X = one.solve(), one.mesh.points
        inside = np.abs(np.linalg.norm(X, axis=1) - 1) < 1e-3
        stress = sphere.stresses(result.stress("node"), X)[inside]
        assert np.abs(stress[:, 1:3] / exact - 1).max() < 0.05
        assert np.abs(stress[:, 0] / -1e6 - 1).max() < 0.12
        u = sphere.vectors(result.u, X)[inside]
        assert np.abs(u[:, 0] / (exact * 0.7 / 200e9 + 0.3 * 1e6 / 200e9) - 1).max() < 0.01
        assert np.abs(u[:, 1:]).max() < 1e-3 * np.abs(u).max()
    model.release("cut")
    assert len(model.supports.constraints) == 0


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_supports_that_meet_in_a_node_act_together_in_any_order(order):
    """A wedge that swells freely between planes; one corner is held, too."""
    box = kl.box((1, 1, 1), (2, 2, 2), "Element3D8N")
    points = box.points + np.outer(box.points[:, 1], (0, 0, 1.0))
    model = kl.Model(box.replace(points=points), kl.Isotropic3D(200e9, 0.3, alpha=1e-5))
    bottom = np.flatnonzero(box.points[:, 2] == 0)
    supports = (
        lambda: model.symmetry("x-"),
        lambda: model.symmetry(bottom),
        lambda: model.fix((0.0, 0.0, 0.0), "xyz"),
        lambda: model.fix(box.nodes("y-"), "y", local=kl.Cartesian((1, 0, 0), (0, 1, 0))),
    )
    for number in order:
        supports[number]()
    model.add(kl.Temperature(100.0))
    result = model.solve()
    assert np.abs(result.u - 1e-3 * points).max() < 1e-12
    assert np.abs(result.stress()).max() < 1.0


def test_contradicting_supports_are_named_by_their_node():
    model = kl.Model(kl.box(), STEEL)
    model.fix("x-", "x", 1e-3)
    model.fix("x-", "x", 1e-3, local=kl.Cartesian((1, 0, 0)))
    with pytest.raises(ModelError, match=r"node 1 along x is prescribed twice: 0\.001 m and 0 m"):
        model.fix("x-", "x", local=kl.Cartesian((1, 0, 0)))
    model.fix("x+", "xy", local=kl.Cartesian((1, 2, 3)))
    model.fix("x+", "x", 1e-3, local=kl.Cartesian((1, 1, 0), (0, 0, 1)))
    model.fix("x+", "z", 1e-3)
    with pytest.raises(
        ModelError, match=r"contradicts itself: node . along . = .*node . along z = 0\.001 m is"
    ):
        model.solve()


@pytest.mark.parametrize(
    "axes", [kl.Cartesian((1, 2, 3)), kl.Cylindrical((1, 0, 0), (1, 2, 3)), kl.Spherical()]
)
def test_directions_are_orthogonal_and_right_handed(axes):
    D = axes.directions(np.random.default_rng(1).normal(size=(4, 5, 3)) + 5)
    assert np.abs(D @ np.swapaxes(D, -1, -2) - np.eye(3)).max() < 1e-14
    assert np.abs(np.linalg.det(D) - 1).max() < 1e-14


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda m: m.fix("z-", "x", local=kl.Cylindrical()), "some of r, t, z"),
        (lambda m: m.fix("z-", "r", local="polar"), "local"),
        (lambda m: m.fix("z-", "r", lambda t: t, local=kl.Cylindrical()), "constant value"),
        (lambda m: m.fix("z-", "r", local=kl.Cylindrical()), "lies on the axis"),
        (lambda m: m.symmetry(np.array([0, 1])), "three or more nodes"),
        (lambda m: m.symmetry(np.arange(8)), "in one plane"),
        (lambda m: kl.Cartesian((0, 0, 0)), "a vector is 0"),
        (lambda m: kl.Cartesian((1, 0, 0), (2, 0, 0)), "a vector is 0"),
        (lambda m: kl.Cylindrical(axis=(1, 2)), "axis"),
    ],
)
def test_what_has_no_directions_is_refused(act, words):
    model = kl.Model(kl.box(), STEEL)
    with pytest.raises((InputError, ModelError, KratosLiteError), match=words):
        act(model)
    assert len(model.supports.constraints) == 0

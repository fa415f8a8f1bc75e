"""A force and a moment in all, spread over faces; areas; forces that would be put on each node."""

import numpy as np
import pytest
from meshes import KINDS

import kratos_lite as kl

LAW = kl.Isotropic3D(E=210e9, nu=0.3)
FORCE, MOMENT = np.array([10.0, -20.0, 30.0]), np.array([1.0, 2.0, -3.0])


def totals(mesh, load, about):
    """Return force and moment about a point, (6,)."""
    forces = load.forces(mesh, [])
    return np.concatenate([forces.sum(axis=0), np.cross(mesh.points - about, forces).sum(axis=0)])


def curved(kind):
    mesh = kl.box((1.0, 1.2, 0.8), (2, 2, 2), element=kind)
    x, y, z = mesh.points.T
    return mesh.replace(points=np.stack([x + 0.1 * y * y, y, z + 0.1 * x * x + 0.05 * x * y], axis=1))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("part", ["z+", "x+"])
def test_force_and_moment_are_those_in_all(kind, part):
    mesh, about = curved(kind), np.array([0.3, -0.2, 0.9])
    load = kl.Resultant(mesh.nodes(part), FORCE, MOMENT, about)
    np.testing.assert_allclose(totals(mesh, load, about), [*FORCE, *MOMENT], rtol=0, atol=1e-12 * 40)


def test_without_moment_it_is_a_traction_through_the_centroid():
    mesh = kl.box((2.0, 3.0, 1.0), (2, 2, 1), element="20N")
    even = kl.Traction("z+", FORCE / 6.0).forces(mesh, [])
    np.testing.assert_allclose(kl.Resultant("z+", FORCE).forces(mesh, []), even, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("mesh", "part", "area"),
    [
        (kl.box((2.0, 3.0, 1.0), (2, 1, 1), element="10N"), "z+", 6.0),
        (kl.box((2.0, 3.0, 1.0)), lambda X: np.ones(len(X), bool), 22.0),
        (kl.annulus(0.5, 1.0, 0.25, (1, 24, 1)), "outer", 0.5 * np.pi),
    ],
)
def test_areas(mesh, part, area):
    assert mesh.area(part) == pytest.approx(area, rel=2e-5)


def test_a_cantilever_bends_by_a_moment():
    """σ = M z / I of a square bar, u = M L² / 2 E I."""
    model = kl.Model(kl.box((10.0, 1.0, 1.0), (20, 2, 2), element="20N"), kl.Isotropic3D(E=1e6, nu=0.0))
    model.fix("x-")
    model.add(kl.Resultant("x+", (0, 0, 0), moment=(0, -5.0, 0)))
    end = model.solve().at((10.0, 0.5, 0.5)).displacement
    np.testing.assert_allclose(end, [0, 0, 5.0 * 100 / (2 * 1e6 / 12)], rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    "where", ["x+", lambda X: X[:, 0] == 1, np.array([4, 5, 4, *range(7)]), np.arange(27) < 9]
)
def test_a_force_on_many_nodes_is_refused_unless_it_is_said_to_be_on_each(where):
    mesh = kl.box(cells=(2, 2, 2))
    model, load = kl.Model(mesh, LAW), kl.PointLoad(where, (0, 0, -1.0))
    several = r"on each of its [79] nodes: if so, give each=True.*kl.Resultant"
    with pytest.raises(kl.ModelError, match=several):
        model.add(load)
    moving = kl.TimeDependentLoad(lambda t: load)
    with pytest.raises(kl.ModelError, match=several):
        moving.forces(mesh, [])
    each = kl.PointLoad(where, (0, 0, -1.0), each=True)
    model.add(each)
    assert each.forces(mesh, []).sum(axis=0)[2] == -len(mesh.nodes(where))
    model.add(kl.PointLoad([3], (0, 0, -1.0)))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("x+", 3.0), "a resultant force must be"),
        (("x+", FORCE, [1.0]), "a resultant moment must be"),
        (("x+", FORCE, MOMENT, "a"), "the point of a resultant"),
    ],
)
def test_wrong_resultants(given, words):
    with pytest.raises(kl.InputError, match=words):
        kl.Resultant(*given)
    with pytest.raises(kl.ModelError, match="a resultant finds no face"):
        kl.Resultant([0, 1], FORCE).forces(kl.box(), [])

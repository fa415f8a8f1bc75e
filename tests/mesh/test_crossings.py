"""Where lines pass from one element to the next."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.mesh.crossings import crossings


def passed(mesh, a, b):
    return crossings(mesh, np.array(a, dtype=float), np.array(b, dtype=float))


def test_oblique_line_crosses_the_planes_of_a_box():
    mesh = kl.box((1, 1, 1), cells=(3, 4, 5))
    a, b = np.array([0.05, 0.1, 0.02]), np.array([0.95, 0.8, 0.97])
    planes = [np.arange(1, n) / n for n in (3, 4, 5)]
    expected = np.sort(np.concatenate([(p - x) / (y - x) for p, x, y in zip(planes, a, b, strict=True)]))
    expected = expected[(expected > 0) & (expected < 1)]
    assert np.abs(passed(mesh, a, b)[1:-1] - expected).max() < 1e-9


def test_layers_much_thinner_than_their_neighbors_are_found():
    x = np.array([0.0, 0.4, 0.4 + 1e-5, 0.4 + 1.1e-5, 1.0])
    mesh = kl.box((4, 1, 1), cells=(4, 1, 1))
    points = mesh.points.copy()
    points[:, 0] = x[points[:, 0].round().astype(int)]
    t = passed(mesh.replace(points=points), (0, 0.3, 0.3), (1, 0.3, 0.3))
    assert t.shape == (5,)
    assert np.abs(t - x).max() < 1e-9


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.5, 0.5)])
def test_line_on_edges_and_faces_of_elements(start):
    t = passed(kl.box((1, 1, 1), cells=(4, 2, 2)), start, (1.0, *start[1:]))
    assert np.abs(t - np.arange(5) / 4).max() < 1e-9


def test_line_within_one_element_has_no_crossing():
    assert passed(kl.box(), (0.1, 0.1, 0.1), (0.1, 0.1, 0.9)).tolist() == [0.0, 1.0]


def test_tetrahedra_and_distorted_cells_lie_at_both_sides_of_each_crossing():
    for kind in ("4N", "13N", "27N"):
        mesh = kl.box(cells=(2, 1, 1), element=f"KinematicLinear3D{kind}")
        shift = 0.01 * np.random.default_rng(0).uniform(-1, 1, mesh.points.shape)
        mesh = mesh.replace(points=mesh.points + shift)
        a, b = np.array([0.1, 0.15, 0.2]), np.array([0.9, 0.8, 0.7])
        t = passed(mesh, a, b)
        inner = t[:-1, None] + np.diff(t)[:, None] * np.linspace(1e-6, 1 - 1e-6, 9)
        rows = mesh.locate(a + inner[..., None] * (b - a)).rows
        assert (rows == rows[:, :1]).all()
        assert (np.diff(rows[:, 0]) != 0).all()


def test_line_through_a_hole_is_an_error():
    with pytest.raises(kl.MeshError, match="lies outside the mesh"):
        passed(kl.annulus(0.3, 1.0, 0.2, cells=(2, 16, 1)), (-0.9, 0, 0.1), (0.9, 0, 0.1))
    with pytest.raises(kl.MeshError, match="lies outside the mesh"):
        passed(kl.box(), (5, 5, 5), (6, 5, 5))

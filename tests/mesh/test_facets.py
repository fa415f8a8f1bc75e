"""Boundary faces of straight cells that stand for a curved surface."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.mesh.facets import facets
from kratos_lite.mesh.refinement import raised
from kratos_lite.verification.meshes import shaped, warped


def cylinder(kind, n=3):
    def place(X):
        angle = np.pi / 2 * X[:, 1]
        return np.column_stack([(1 + X[:, 0]) * np.cos(angle), (1 + X[:, 0]) * np.sin(angle), X[:, 2]])

    return shaped(kind, (2, n, 2), place)


def test_a_cylinder_of_straight_cells_turns_from_face_to_face():
    count, angle = facets(cylinder("8N"))
    assert count == 4  # of three faces around each of two surfaces, two high, the middle ones
    assert abs(angle - 30) < 1e-6


def test_raised_straight_cells_still_stand_for_a_cylinder():
    assert facets(raised(cylinder("8N")).mesh) == facets(cylinder("8N"))


@pytest.mark.parametrize("kind", ["20N", "27N"])
def test_curved_cells_follow_it(kind):
    assert facets(cylinder(kind)) == (0, 0.0)


def folded(X):
    return np.column_stack([X[:, 0], X[:, 1], X[:, 2] + 0.4 * np.abs(X[:, 0] - 0.5)])


@pytest.mark.parametrize("kind", ["8N", "20N"])
def test_flat_surfaces_and_a_fold_between_them_do_not(kind):
    assert facets(kl.box(cells=(3, 2, 1))) == (0, 0.0)
    assert facets(shaped(kind, (4, 3, 2), folded)) == (0, 0.0)
    assert facets(warped("4N", 2)) == (0, 0.0)


def test_a_requested_error_warns_of_a_surface_that_is_not_followed():
    def solved(mesh, **options):
        model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.3))
        model.fix(lambda X: X[:, 2] < 1e-9)
        model.add(kl.Traction(lambda X: X[:, 2] > 1 - 1e-9, (0, 0, 1.0)))
        return model.solve(error=0.9, **options).report.warnings

    def onto(X):
        r = np.linalg.norm(X[:, :2], axis=1, keepdims=True)
        return np.column_stack([X[:, :2] / r, X[:, 2:]])

    told = [text for text in solved(cylinder("8N")) if "geometry=" in text]
    assert len(told) == 1
    assert "4 boundary faces of straight cells turn by about 30°" in told[0]
    mesh = cylinder("8N")
    mesh.add_part("bore", np.abs(np.linalg.norm(mesh.points[:, :2], axis=1) - 1) < 1e-9)
    assert not any("geometry=" in text for text in solved(mesh, geometry={"bore": onto}))
    assert not any("geometry=" in text for text in solved(cylinder("20N")))

"""A load is what its function says: resultants against closed forms and the divergence theorem."""

import math

import numpy as np
import pytest
from meshes import KINDS

import kratos_lite as kl

DEGREES = [(kind, d) for kind in KINDS for d in range(1, 4 + (int(kind[:-1]) > 8))]
"""Up to two above that of the shape functions."""
LAW = kl.Isotropic3D(E=210e9, nu=0.3, density=7620.0)


def totals(model, *loads):
    """Return the resultant force and moment about the origin, (6,), of loads on a model."""
    groups = model.element_groups()
    forces = sum(load.forces(model.mesh, groups) for load in loads)
    return np.concatenate([forces.sum(axis=0), np.cross(model.mesh.points, forces).sum(axis=0)])


def bent(kind, curved=True):
    """Return a box whose nodes are moved by a linear map, or one cell by a quadratic map."""
    mesh = kl.box((1.0, 1.2, 0.8), (1, 1, 1) if curved else (2, 2, 2), element=kind)
    x, y, z = mesh.points.T
    square = 0.3 * curved
    moved = [x + 0.2 * y + square * y * y, y - 0.1 * z + square * z * x, z + 0.1 * x - square * x * x]
    return kl.Model(mesh.replace(points=np.stack(moved, axis=1)), LAW)


@pytest.mark.parametrize(("kind", "degree"), DEGREES)
@pytest.mark.parametrize("curved", [False, True])
def test_pressure_on_all_faces_is_the_force_of_its_gradient(kind, curved, degree):
    """∮ -p n dA = -∫ ∇p dV, ∮ x × (-p n) dA = -∫ x × ∇p dV: faces beside volumes, by other rules."""
    model, a = bent(kind, curved), np.array([0.7, -0.4, 1.1])
    gradient = kl.BodyForce(lambda X: -degree * (1.3 + X @ a)[:, None] ** (degree - 1) * a)
    found = totals(model, kl.Pressure(lambda X: np.ones(len(X), bool), lambda X: (1.3 + X @ a) ** degree))
    wanted = totals(model, gradient)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("load", [lambda f: kl.Traction("z+", f), kl.BodyForce], ids=["face", "volume"])
@pytest.mark.parametrize(("kind", "degree"), DEGREES)
def test_a_polynomial_over_a_flat_face_and_over_straight_cells(kind, degree, load):
    """∫ x^d and ∫ y x^d over 2 × 3 × 1, and its upper face; up to d = p + 2."""
    model = kl.Model(kl.box((2.0, 3.0, 1.0), (2, 2, 1), element=kind), LAW)
    found = totals(model, load(lambda X: X[:, :1] ** degree * [0.0, 0.0, 1.0]))
    powers = 2.0 ** (np.arange(degree + 1, degree + 3)) / np.arange(degree + 1, degree + 3)
    wanted = [0, 0, 3 * powers[0], 4.5 * powers[0], -3 * powers[1], 0]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "load",
    [
        lambda on: kl.Traction("z+", lambda X: on(X)[:, None] * [0.0, 0.0, -1000.0]),
        lambda on: kl.Pressure("z+", lambda X: 1000.0 * on(X)),
    ],
)
def test_a_patch_whose_edges_are_edges_of_elements(kind, load):
    """-1000 N/m² on a quarter of a face: -250 N at its middle, and no warning."""
    model = kl.Model(kl.box((1, 1, 1), (8, 8, 1), element=kind), LAW)
    patch = load(lambda X: (X[:, 0] < 0.5) & (X[:, 1] < 0.5))
    wanted = [0, 0, -250, -62.5, 62.5, 0]
    np.testing.assert_allclose(totals(model, patch), wanted, rtol=0, atol=1e-10)
    model.fix("z-")
    model.add(patch)
    assert not any("jumps" in warning for warning in model.check())


@pytest.mark.parametrize("kind", KINDS)
def test_a_body_force_that_jumps_between_elements(kind):
    """f = (3, -1, 2) N/m³ where x < 1 of a block 2 × 1 × 1, and the weight of half of it."""
    model = kl.Model(kl.box((2, 1, 1), (4, 2, 2), element=kind), LAW)
    f, middle = np.array([3.0, -1.0, 2.0]), np.array([0.5, 0.5, 0.5])
    found = totals(model, kl.BodyForce(lambda X: (X[:, :1] < 1) * f))
    np.testing.assert_allclose(found, [*f, *np.cross(middle, f)], rtol=0, atol=1e-12)
    found = totals(model, kl.Gravity(lambda X: (X[:, :1] < 1) * f))
    np.testing.assert_allclose(found[:3], 7620.0 * f, rtol=1e-12)


@pytest.mark.parametrize(
    ("load", "part"),
    [
        (kl.Traction("z+", lambda X: (X[:, :1] < 0.3) * [0.0, 0.0, -1e3]), "z+"),
        (kl.Pressure("y-", lambda X: 1e3 * (X[:, 0] < 0.3)), "y-"),
        (kl.BodyForce(lambda X: (X[:, :1] < 0.3) * [0.0, 0.0, -1e3]), "BodyForce"),
    ],
)
def test_a_jump_inside_elements_is_a_warning_that_names_the_part(load, part):
    model = kl.Model(kl.box((1, 1, 1), (4, 4, 4)), LAW)
    model.fix("z-")
    model.add(load)
    (warning,) = model.solve().report.warnings
    assert part in warning
    assert "jumps or peaks inside elements" in warning
    for result in (model.solve_cases({"a": load})["a"], model.solve(error=0.9)):
        assert sum("jumps or peaks" in text for text in result.report.warnings) == 1
    model.loads.clear()
    model.add(kl.Pressure("z+", lambda X: 1e3 * np.sin(3 * X[:, 0])), amplitude=lambda t: 2.0 + t)
    assert model.solve().report.warnings == []


@pytest.mark.parametrize(
    "wrong", [lambda X: X[:, 3], lambda X: math.sin(X[:, 0]), lambda X: 1.0 if X[:, 0] > 0 else 0.0]
)
def test_a_function_that_fails_is_told_what_places_are(wrong):
    model = kl.Model(kl.box(), LAW)
    model.fix("z-")
    model.add(kl.Pressure("z+", wrong))
    with pytest.raises(
        kl.InputError, match=r"pressure: the function fails .* X is \(m, 3\), all places at once"
    ):
        model.solve()

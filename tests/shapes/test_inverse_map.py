"""The inverse map: from a point in space back to the reference coordinates of its cell."""

import numpy as np
import pytest

from kratos_lite.shapes import SHAPES
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.shapes.inverse import inverse_map, outside_by
from kratos_lite.shapes.pyramids import Pyramid5
from kratos_lite.shapes.tetrahedra import Tetrahedron4, Tetrahedron10

SOLIDS = [shape for shape in SHAPES.values() if shape.nodes.shape[1] == 3]
A = np.array([[1.2, 0.3, -0.1], [-0.2, 0.9, 0.25], [0.15, -0.1, 1.1]])
SHIFT = np.array([0.3, -2.0, 1.0])

each_shape = pytest.mark.parametrize("shape", SOLIDS, ids=lambda shape: shape.__name__)


def points_in(shape, count, seed=0):
    """Return random points well inside the reference cell."""
    corners = shape.nodes[: shape.corners]
    share = np.random.default_rng(seed).dirichlet(np.ones(len(corners)), count)
    return share @ corners


def affine(shape):
    return shape.nodes @ A.T + SHIFT


def distorted(shape, seed=1):
    """Return the nodes moved at random by up to 5 % of the smallest edge of the cell."""
    edge = 1.0 if shape.cell in ("tetrahedron", "wedge", "pyramid") else 2.0
    return shape.nodes + 0.05 * edge * np.random.default_rng(seed).uniform(-1, 1, shape.nodes.shape)


@each_shape
def test_affine_cells_take_one_step(shape):
    xi = points_in(shape, 200)
    found = inverse_map(shape, affine(shape), xi @ A.T + SHIFT)
    assert found.iterations == 1
    assert found.converged.all()
    assert found.inside.all()
    np.testing.assert_allclose(found.xi, xi, rtol=0, atol=2e-14)


@each_shape
def test_distorted_cells_come_back_to_twelve_digits(shape):
    for seed in range(5):
        X, xi = distorted(shape, seed), points_in(shape, 100, seed)
        found = inverse_map(shape, X, shape.N(xi) @ X)
        assert found.converged.all()
        assert found.inside.all()
        assert found.iterations <= 8
        np.testing.assert_allclose(found.xi, xi, rtol=0, atol=1e-12)


@each_shape
def test_all_nodes_come_back_the_apex_included(shape):
    for X in (affine(shape), distorted(shape)):
        found = inverse_map(shape, X, X)
        assert found.converged.all()
        assert found.inside.all()
        np.testing.assert_allclose(found.xi, shape.nodes, rtol=0, atol=1e-11)


@each_shape
def test_points_outside_are_reported_with_where_they_are(shape):
    center = shape.nodes[: shape.corners].mean(axis=0)
    corners = shape.nodes[: shape.corners]
    outside = corners + 0.05 * (corners - center)
    found = inverse_map(shape, affine(shape), outside @ A.T + SHIFT)
    assert not found.inside.any()
    assert found.converged.all()
    np.testing.assert_allclose(found.xi, outside, rtol=0, atol=1e-12)


@each_shape
def test_points_just_outside_a_face_are_outside_and_just_inside_are_inside(shape):
    for face in shape.faces:
        ring = shape.nodes[[a for a in face if a < shape.corners]]
        center, middle = shape.nodes[: shape.corners].mean(axis=0), ring.mean(axis=0)
        for factor, expected in ((1e-6, False), (-1e-6, True), (1e-11, True)):
            xi = middle + factor * (middle - center)
            assert bool(inverse_map(shape, affine(shape), xi @ A.T + SHIFT).inside) is expected


@each_shape
def test_a_batch_gives_the_same_as_single_points(shape):
    X = np.stack([distorted(shape, seed) for seed in range(6)]).reshape(2, 3, -1, 3)
    xi = points_in(shape, 6).reshape(2, 3, 3)
    p = (shape.N(xi)[..., None, :] @ X)[..., 0, :]
    p[0, 1] += 10.0
    found = inverse_map(shape, X, p)
    assert found.xi.shape == (2, 3, 3)
    assert found.inside.shape == found.converged.shape == (2, 3)
    for i, j in np.ndindex(2, 3):
        single = inverse_map(shape, X[i, j], p[i, j])
        assert single.xi.shape == (3,)
        assert single.inside == found.inside[i, j]
        assert single.converged == found.converged[i, j]
        np.testing.assert_allclose(found.xi[i, j], single.xi, rtol=0, atol=1e-12)


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e6, 1e9])
@each_shape
def test_the_size_of_the_cell_does_not_matter(shape, scale):
    X, xi = distorted(shape), points_in(shape, 20)
    found = inverse_map(shape, scale * X, scale * (shape.N(xi) @ X))
    assert found.converged.all()
    assert found.inside.all()
    np.testing.assert_allclose(found.xi, xi, rtol=0, atol=1e-12)


def test_a_degenerate_cell_is_not_converged_and_not_inside():
    flat = Tetrahedron4.nodes * [1, 1, 0]
    found = inverse_map(Tetrahedron4, flat, [0.2, 0.2, 0.5])
    assert not found.converged
    assert not found.inside


def test_a_point_that_a_curved_cell_never_reaches_is_not_converged():
    X = Tetrahedron10.nodes.copy()
    X[4:, 2] += 0.1  # x and y are linear, z is a paraboloid: far below it there is no xi
    found = inverse_map(Tetrahedron10, X, [[0.2, 0.2, 0.3], [0.2, 0.2, -50.0], [0.2, 0.2, 60.0]])
    np.testing.assert_allclose(Tetrahedron10.N(found.xi[0]) @ X, [0.2, 0.2, 0.3], rtol=0, atol=1e-14)
    assert bool(found.converged[0])
    assert not found.inside[1:].any()
    for xi, target, done in zip(found.xi, [0.3, -50.0, 60.0], found.converged, strict=True):
        reached = bool(np.abs(Tetrahedron10.N(xi) @ X - [0.2, 0.2, target]).max() < 1e-9)
        assert reached == bool(done)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_point_that_is_not_finite_is_not_converged_and_spoils_no_other(bad):
    found = inverse_map(Hexahedron8, Hexahedron8.nodes, [[bad, 0, 0], [0.5, 0.25, -0.5]])
    assert found.converged.tolist() == [False, True]
    assert found.inside.tolist() == [False, True]
    assert found.xi[1].tolist() == [0.5, 0.25, -0.5]


@pytest.mark.parametrize(
    ("cell", "xi", "expected"),
    [
        ("tetrahedron", [0.25, 0.25, 0.25], -0.25),
        ("tetrahedron", [0.5, 0.5, 0.5], 0.5),
        ("tetrahedron", [-0.125, 0.2, 0.2], 0.125),
        ("wedge", [0.25, 0.25, 1.5], 0.5),
        ("wedge", [0.25, 0.25, 0.0], -0.25),
        ("wedge", [0.75, 0.75, 0.0], 0.5),
        ("pyramid", [0.0, 0.0, 1.0], 0.0),
        ("pyramid", [0.0, 0.0, -0.5], 0.5),
        ("pyramid", [0.75, 0.0, 0.5], 0.25),
        ("pyramid", [0.0, -0.75, 0.5], 0.25),
        ("hexahedron", [0.0, 0.0, 0.0], -1.0),
        ("hexahedron", [0.0, -1.25, 0.0], 0.25),
    ],
)
def test_the_distance_outside_a_reference_cell(cell, xi, expected):
    assert float(outside_by(cell, np.array(xi))) == expected


def test_points_beside_the_apex_of_a_pyramid_come_back():
    xi = np.array([[0, 0, 1 - h] for h in (1e-3, 1e-6, 1e-9)] + [[5e-4, -3e-4, 0.999]])
    X = distorted(Pyramid5)
    found = inverse_map(Pyramid5, X, Pyramid5.N(xi) @ X)
    assert found.converged.all()
    np.testing.assert_allclose(found.xi, xi, rtol=0, atol=1e-12)

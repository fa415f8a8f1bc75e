"""Shape functions at many points, at once where they broadcast, and the node orders of VTK."""

import numpy as np
import pytest

from kratos_lite.shapes import SHAPES
from kratos_lite.shapes.base import at_points
from kratos_lite.shapes.tetrahedra import Tetrahedron4


@pytest.mark.parametrize("name", list(SHAPES))
@pytest.mark.parametrize("function", ["N", "dN"])
def test_many_points_at_once_give_the_same_bits_as_one_by_one(name, function):
    shape = SHAPES[name]
    points = np.random.default_rng(1).random((30, shape.nodes.shape[1]))
    of = getattr(shape, function)
    np.testing.assert_array_equal(at_points(of, points), np.array([of(xi) for xi in points]))


def test_functions_of_a_user_need_not_broadcast():
    def gradients(xi):
        return Tetrahedron4.dN(np.zeros(3))  # constant, (4, 3) whatever xi is

    assert at_points(gradients, np.zeros((5, 3))).shape == (5, 4, 3)


@pytest.mark.parametrize(
    ("name", "edges"),
    [
        ("Hexahedron20", "01 12 23 30 45 56 67 74 04 15 26 37"),
        ("Hexahedron27", "01 12 23 30 45 56 67 74 04 15 26 37"),
        ("Wedge15", "01 12 20 34 45 53 03 14 25"),
        ("Pyramid13", "01 12 23 30 04 14 24 34"),
        ("Tetrahedron10", "01 12 20 03 13 23"),
    ],
)
def test_mid_edge_nodes_stand_in_the_order_of_vtk(name, edges):
    """Source: VTK User's Guide, file formats."""
    shape = SHAPES[name]
    ends = np.array([[int(end) for end in edge] for edge in edges.split()])
    middles = shape.nodes[list(shape.to_vtk)][shape.corners : shape.corners + len(ends)]
    np.testing.assert_array_equal(middles, shape.nodes[ends].mean(axis=1))

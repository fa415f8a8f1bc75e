"""Shape functions at many points: at once where they broadcast, else one by one."""

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

"""Pressure on faces: pushes against the normal, and its tangent is its derivative."""

import numpy as np
import pytest

from kratos_lite.elements.surface import surface_pressure, surface_pressure_tangent
from kratos_lite.shapes.faces import FACE_SHAPES

FACES = [shape for shape in FACE_SHAPES.values() if shape.nodes.shape[1] == 2]


@pytest.mark.parametrize("shape", FACES, ids=lambda shape: shape.__name__)
def test_the_tangent_of_a_pressure_is_its_derivative(shape):
    rng, k = np.random.default_rng(3), len(shape.nodes)
    flat = np.column_stack([shape.nodes, np.zeros(k)])
    X = flat + 0.1 * rng.standard_normal((k, 3))
    tangent = surface_pressure_tangent(shape, X, 7.0)
    h = 1e-6
    for node, axis in np.ndindex(k, 3):
        step = np.zeros((k, 3))
        step[node, axis] = h
        ends = [surface_pressure(shape, X + sign * step, 7.0) for sign in (1, -1)]
        difference = (ends[0] - ends[1]) / (2 * h)
        np.testing.assert_allclose(tangent[..., node, axis], difference, rtol=0, atol=1e-7)
    pushed = surface_pressure(shape, flat, 7.0).sum(axis=0)  # counter-clockwise from above: the normal is z
    area = 4.0 if shape.cell == "quadrilateral" else 0.5
    np.testing.assert_allclose(pushed, (0, 0, -7.0 * area), rtol=0, atol=1e-12)

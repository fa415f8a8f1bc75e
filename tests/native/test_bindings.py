"""Bindings take arrays of exactly the right type, name an argument that is wrong, and leak nothing."""

import gc
import re
import sys

import numpy as np
import pytest
from computing import compiled

from kratos_lite.native import kernels

pytestmark = compiled


def diagonal(n=4):
    """Return the arrays of a diagonal matrix of blocks, and a vector."""
    data = np.arange(1.0, n + 1)[:, None, None] * np.eye(3)
    return np.arange(n + 1, dtype=np.int32), np.arange(n, dtype=np.int32), data, np.ones(3 * n)


@pytest.mark.parametrize(
    ("at", "wrong", "said"),
    [
        (0, np.arange(5), "indptr must be a C-contiguous, aligned array of int32, not numpy.ndarray"),
        (1, [0, 1, 2, 3], "indices must be a C-contiguous, aligned array of int32, not list"),
        (2, np.zeros((3, 3, 8)).T[::2], "data must be a C-contiguous, aligned array of float64"),
        (3, np.ones(12, np.float32), "x must be a C-contiguous, aligned array of float64"),
        (3, np.zeros(97, np.uint8)[1:].view(float), "x must be a C-contiguous, aligned array of float64"),
        (3, np.ones(12, ">f8"), "x must be a C-contiguous, aligned array of float64"),
        (3, None, "x must be a C-contiguous, aligned array of float64, not NoneType"),
    ],
)
def test_an_array_of_another_type_is_refused_by_name(at, wrong, said):
    arguments = list(diagonal())
    arguments[at] = wrong
    with pytest.raises(TypeError, match=re.escape(f"multiply(): {said}")):
        kernels("sparse").multiply(*arguments)


def test_arguments_have_names_and_defaults():
    indptr, indices, data, x = diagonal()
    y = kernels("sparse").multiply(indptr, indices, x=x, data=data)
    np.testing.assert_array_equal(y, np.repeat(np.arange(1.0, 5), 3))
    with pytest.raises(TypeError, match="too many arguments"):
        kernels("sparse").multiply(indptr, indices, data, x, x)
    with pytest.raises(TypeError, match=r"multiply\(\): x is missing"):
        kernels("sparse").multiply(indptr, indices, data)
    for name in ("b", "indices"):
        with pytest.raises(TypeError, match="unknown or repeated name of an argument"):
            kernels("sparse").multiply(indptr, indices, data, **{name: x})


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((1.5, np.zeros((0, 2), np.int64)), "n must be an integer, not float"),
        ((2**70, np.zeros((0, 2), np.int64)), "n must be an integer, not int"),
        (("two", np.zeros((0, 2), np.int64)), "n must be an integer, not str"),
    ],
)
def test_a_number_of_another_kind_is_refused(arguments, said):
    with pytest.raises(TypeError, match=re.escape(f"components(): {said}")):
        kernels("mesh").components(*arguments)


def test_objects_of_kernels_are_told_apart():
    module, (indptr, indices, data, x) = kernels("multigrid"), diagonal()
    matrix = module.Matrix(indptr, indices, data)
    fixed, points = np.zeros(12, np.uint8), np.random.default_rng(1).random((4, 3))
    with pytest.raises(TypeError, match=r"A must be a Matrix or a Product, not numpy.ndarray"):
        module.Multigrid(data, fixed, points, 2, 12.0, 0.0)
    solver = module.Multigrid(matrix, fixed, points, 2, 12.0, 0.0)
    with pytest.raises(TypeError, match=r"aggregate\(\): matrix must be a .*Matrix, not numpy.ndarray"):
        solver.aggregate(np.zeros((12, 6)), data)
    with pytest.raises(TypeError, match="cannot create"):
        type(matrix)()
    solver.aggregate(np.ones((12, 6)))
    del matrix  # the arrays live as long as the solver
    gc.collect()
    assert np.isfinite(solver.cycle(x)).all()


def test_references_are_given_back():
    module, (indptr, indices, data, x), modes = kernels("multigrid"), diagonal(), np.ones((12, 6))

    def once():
        solver = module.Multigrid(
            module.Matrix(indptr, indices, data), np.zeros(12, np.uint8), np.eye(4, 3), 2, 12.0, 0.0
        )
        solver.aggregate(modes)
        solver.cycle(x)
        kernels("sparse").multiply(indptr, indices, data, x)
        with pytest.raises(TypeError):
            kernels("sparse").multiply(indptr, indices, data, indices)

    once()
    before = [sys.getrefcount(array) for array in (indptr, indices, data, x)]
    for _ in range(10):
        once()
    gc.collect()
    assert [sys.getrefcount(array) for array in (indptr, indices, data, x)] == before

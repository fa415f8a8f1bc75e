"""A new element in one file: a six-node wedge, N and dN written by hand.

Check it with ``kratos-lite check examples/my_wedge.py``.
"""

import sys

import numpy as np

import kratos_lite as kl
from kratos_lite.elements import KinematicLinear
from kratos_lite.quadrature import wedge
from kratos_lite.shapes import Shape


class MyWedge(Shape):
    """Triangle at t = -1, then triangle at t = +1."""

    cell, corners, degree = "wedge", 6, 1
    nodes = np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1]])
    edges = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3))
    faces = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
    vtk = 13

    @staticmethod
    def N(xi):
        r, s, t = np.moveaxis(np.asarray(xi), -1, 0)
        L = np.stack([1 - r - s, r, s], axis=-1)
        return np.concatenate([L * (1 - t)[..., None], L * (1 + t)[..., None]], axis=-1) / 2

    @staticmethod
    def dN(xi):
        r, s, t = np.moveaxis(np.asarray(xi), -1, 0)
        L = np.stack([1 - r - s, r, s], axis=-1)
        dL = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
        low = np.concatenate([dL * (1 - t)[..., None, None], -L[..., None]], axis=-1)
        high = np.concatenate([dL * (1 + t)[..., None, None], L[..., None]], axis=-1)
        return np.concatenate([low, high], axis=-2) / 2


class MyWedge3D6N(KinematicLinear):
    """The element: shape × rule."""

    shape = MyWedge
    rule = wedge(degree=2)


if __name__ == "__main__" and len(sys.argv) > 1:
    kl.plot(MyWedge3D6N, sys.argv[1])

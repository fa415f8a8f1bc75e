"""Cells to measure on: sheared, distorted, turned; and an elasticity matrix without symmetry."""

from __future__ import annotations

from itertools import combinations, permutations

import numpy as np

from kratos_lite import voigt
from kratos_lite.elements import KinematicLinear
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.shapes import Shape
from kratos_lite.testing.rules import VOLUME
from kratos_lite.typing import Array

Element = type[KinematicLinear]

C_ISOTROPIC = Isotropic3D(E=2.0, nu=0.3).C


def anisotropic() -> Array:
    """Return a C without any symmetry but its own, positive definite: it tells all components apart."""
    L = np.random.default_rng(5).uniform(-1, 1, (6, 6))
    return C_ISOTROPIC + 0.2 * L @ L.T


def affine(element: Element) -> tuple[Array, float]:
    """Return the nodes of a sheared, shifted cell with plane faces, and its exact volume."""
    A = np.eye(3) + np.random.default_rng(11).uniform(-0.3, 0.3, (3, 3))
    X = element.shape.nodes @ A.T + [0.3, -0.2, 0.1]
    return X, float(np.linalg.det(A)) * VOLUME[element.shape.cell]


def distorted(element: Element) -> Array:
    """Return the nodes of the reference cell, each moved by up to 5 % of the shortest edge."""
    X = element.shape.nodes
    corners = X[: element.shape.corners]
    edge = min(float(np.abs(a - b).max()) for a, b in combinations(corners, 2))
    return X + 0.05 * edge * np.random.default_rng(3).uniform(-1, 1, X.shape)


def linear_field(X: Array) -> tuple[Array, Array]:
    """Return u of a translation and a displacement gradient without symmetry, and the strain (6,)."""
    G = np.random.default_rng(13).uniform(-1, 1, (3, 3))
    return X @ G.T + [0.5, -0.7, 0.3], voigt.symmetric_gradient(G)


def rotations(shape: type[Shape]) -> Array:
    """Return the node permutations (k, n) that turn the reference cell into itself."""
    H = np.column_stack([shape.nodes, np.ones(len(shape.nodes))])
    c = shape.corners
    base = next(list(b) for b in combinations(range(c), 4) if abs(np.linalg.det(H[list(b)])) > 1e-9)
    maps = np.linalg.inv(H[base]) @ H[np.array(list(permutations(range(c), 4)))]
    maps = maps[np.abs(np.linalg.det(maps) - 1) < 1e-9]
    distance = np.abs((H @ maps)[:, :, None, :] - H).max(axis=3)
    kept = distance[(distance.min(axis=2) < 1e-9).all(axis=1)]
    return kept.argmin(axis=2)

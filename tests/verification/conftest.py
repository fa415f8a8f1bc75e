"""Meshes that several verification tests share."""

from collections.abc import Callable

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.mesh.generators import SPLITS, raise_order


def split_hexes(points: np.ndarray, hexes: np.ndarray, kind: str, order: int | None = None) -> kl.Mesh:
    """Return the bricks (m, 8) split into elements of one kind, with straight edges."""
    element = kl.ELEMENTS[kind]
    if element.shape.cell == "pyramid":
        hexes = np.column_stack([hexes, len(points) + np.arange(len(hexes))])
        points = np.vstack([points, points[hexes[:, :8]].mean(axis=1)])
    split = np.array(SPLITS[element.shape.cell])
    corners = hexes[:, split].reshape(-1, split.shape[1])
    points, nodes = raise_order(points, corners, element.shape)
    m = len(nodes)
    block = kl.Block(
        kind, nodes.astype(np.int32), np.arange(1, m + 1), np.ones(m, dtype=np.int64), element.shape
    )
    return kl.Mesh(points, [block])


def warped_lattice(n: int, amount: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points and bricks of a unit cube whose interior nodes are moved by up to amount · h."""
    brick = kl.box(cells=(n, n, n))
    points = brick.points.copy()
    inside = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    move = np.random.default_rng(seed).uniform(-1, 1, (int(inside.sum()), 3))
    points[inside] += amount / n * move
    return points, brick.blocks[0].nodes


@pytest.fixture(scope="session")
def split() -> Callable[..., kl.Mesh]:
    return split_hexes


@pytest.fixture(scope="session")
def warped() -> Callable[..., kl.Mesh]:
    """Return a function: warped unit cube of n³ bricks split into one kind."""

    def make(kind: str, n: int, amount: float = 0.2, seed: int = 3) -> kl.Mesh:
        return split_hexes(*warped_lattice(n, amount, seed), kind)

    return make

"""Meshes of the problems, of any element."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kratos_lite.elements import ELEMENTS, KinematicLinear
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.generators import box, cut_bricks
from kratos_lite.typing import Array, Ints, Rows

COMPLETE = (10, 27)
"""Nodes of the elements that hold every quadratic field on cells with straight edges."""
Place = Callable[[Array], Array]
"""Takes places (n, 3) of the unit cube to places in space."""


def element(kind: str) -> str:
    """Return the name of an element such as ``8N`` or ``3D8N``."""
    names = (f"KinematicLinear3D{kind}", f"KinematicLinear{kind}")
    return next((name for name in names if name in ELEMENTS), kind)


def kind_of(name: str) -> type[KinematicLinear]:
    """Return the class of an element by its name."""
    return ELEMENTS[element(name)]


def is_quadratic(kind: str) -> bool:
    """Return whether an element spans all quadratic polynomials, and leaves their strain as it is."""
    return kind_of(kind).shape.degree >= 2 and keeps_linear_strains(kind)


def keeps_linear_strains(kind: str) -> bool:
    """Return False for quadratic elements with the mean dilatation of each cell alone."""
    return kind_of(kind).shape.degree < 2 or getattr(kind_of(kind), "dilatation", 1) > 0


def is_stable(kind: str) -> bool:
    """Return whether one element alone has no spurious modes."""
    return kind_of(kind).spurious_modes == 0


def short(name: str) -> str:
    """Return a short name of an element for tables, such as ``8N enhanced``."""
    if (
        name.startswith("KinematicLinear3D")
        or name not in ELEMENTS
        or ELEMENTS[name].formulation == "standard"
    ):
        return name.removeprefix("KinematicLinear3D")
    return f"{len(ELEMENTS[name].nodes)}N {ELEMENTS[name].formulation}"


def split(points: Array, bricks: Ints | Rows, kind: str) -> Mesh:
    """Return bricks (m, 8) split into elements of one kind with straight edges."""
    points, nodes = cut_bricks(points, np.asarray(bricks, dtype=np.int64), kind_of(kind).shape)
    return Mesh(points, [Block(element(kind), nodes)])


def warped(kind: str, n: int, amount: float = 0.2, seed: int = 3) -> Mesh:
    """Return a unit cube of n³ bricks, split; its inner corners are moved by up to amount / n."""
    grid = box(cells=(n, n, n))
    inside = (np.abs(grid.points - 0.5) < 0.5 - 1e-9).all(axis=1)
    points = grid.points.copy()
    move = np.random.default_rng(seed).uniform(-1, 1, (int(inside.sum()), 3))
    points[inside] += amount / n * move
    return split(points, grid.blocks[0].nodes, kind)


def shaped(kind: str, cells: Sequence[int], place: Place) -> Mesh:
    """Return bricks along the axes of the unit cube, split, with every node taken to its place."""
    grid = box(cells=cells, element=element(kind))
    return Mesh(place(grid.points), grid.blocks)


def straight(kind: str, cells: Sequence[int], place: Place) -> Mesh:
    """Return the same with the corners alone taken to their places: edges are straight."""
    grid = box(cells=cells)
    return split(place(grid.points), grid.blocks[0].nodes, kind)


def joined(blocks: Sequence[Mesh]) -> Mesh:
    """Return meshes of one kind as one: nodes at one place become one node."""
    starts = np.cumsum([0, *(block.n_nodes for block in blocks)])
    points = np.vstack([block.points for block in blocks])
    nodes = np.vstack([block.blocks[0].nodes + start for block, start in zip(blocks, starts, strict=False)])
    _, first, same = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    return Mesh(points[first], [Block(blocks[0].blocks[0].name, same.ravel()[nodes])])


def octant(n: int, kind: str, outer: Place) -> Mesh:
    """Return the space between unit sphere and outer surface, x y z ≥ 0, in three blocks of n³ bricks."""
    center, edges = np.ones(3), np.array([[1, 1, 0], [0, 1, 1], [1, 0, 1]])

    def block(k: int) -> Mesh:
        pole, a, b = np.roll([1.0, 0, 0], k), edges[k], edges[(k + 2) % 3]

        def place(X: Array) -> Array:
            s, t, r = X.T
            flat = np.outer((1 - s) * (1 - t), pole) + np.outer(s * (1 - t), a)
            flat += np.outer((1 - s) * t, b) + np.outer(s * t, center)
            inner = flat / np.linalg.norm(flat, axis=1, keepdims=True)
            return inner + r[:, None] * (outer(flat) - inner)

        return shaped(kind, (n, n, n), place)

    return joined([block(k) for k in range(3)])


def on_boundary(mesh: Mesh) -> Ints:
    """Return the nodes on the surface of the body."""
    return np.unique(np.concatenate([block.nodes.ravel() for block in mesh.boundary]))


def nearest(mesh: Mesh, place: tuple[float, float, float]) -> int:
    """Return the node nearest to a place."""
    return int(np.argmin(np.linalg.norm(mesh.points - np.asarray(place), axis=1)))

"""Nearest: the element of a mesh that is nearest to a point outside it, in words."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh.boxes import cell_boxes, is_solid
from kratos_lite.mesh.cells import Cells
from kratos_lite.shapes import Shape
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.typing import Array

CANDIDATES = 32
"""Elements whose boxes are nearest and whose faces are looked at."""


def nearest_element(mesh: Cells, point: Array) -> str:
    """Return how far from a point (3,) the nearest element is: ``0.5 m from element 1 (…3D8N)``."""
    found = []
    for block in mesh.blocks:
        if block.shape is None or not is_solid(block):
            continue
        low, high = cell_boxes(mesh.points, block)
        gap = np.maximum(0, np.maximum(low - point, point - high))
        for cell in np.argsort((gap**2).sum(axis=1), kind="stable")[:CANDIDATES].tolist():
            X = mesh.points[block.nodes[cell]]
            found.append((distance_to_cell(block.shape, X, point), mesh.place(block, cell)))
    if not found:
        return "which has no elements"
    distance, place = min(found, key=lambda pair: pair[0])
    return f"{distance:.3g} m from {place}"


def distance_to_cell(shape: type[Shape], X: Array, point: Array) -> float:
    """Return the distance of a point (3,) from the boundary of a cell X (n, 3), to about six digits.

    A grid of points on the face is refined around the nearest of them.
    """
    return min(_distance_to_face(FACE_SHAPES[len(face)], X[list(face)], point) for face in shape.faces)


def _distance_to_face(face: type[Shape], X: Array, point: Array) -> float:
    middle, half, nearest = np.full(2, 0.5), 0.5, np.inf
    steps = np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)), axis=-1).reshape(-1, 2)
    while half > 1e-7:
        ab = np.clip(middle + half * steps, 0, 1)
        xi = 2 * ab - 1
        if face.corners == 3:  # the square collapsed on the triangle
            xi = np.column_stack([ab[:, 0], ab[:, 1] * (1 - ab[:, 0])])
        distance = np.linalg.norm(face.N(xi) @ X - point, axis=1)
        best = int(distance.argmin())
        middle, half, nearest = ab[best], half / 2, float(distance[best])
    return nearest

"""The linear elements inside a mesh of quadratic ones: the coarse level of a p-multigrid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kratos_lite.assembly import Pattern, assemble_stiffness
from kratos_lite.batches import Batch
from kratos_lite.blockmatrix import LinearLevel
from kratos_lite.elements import (
    KinematicLinear,
    KinematicLinear3D4N,
    KinematicLinear3D5N,
    KinematicLinear3D6N,
    KinematicLinear3D8N,
)
from kratos_lite.shapes import Shape

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
LINEAR: dict[str, type[KinematicLinear]] = {
    element.shape.cell: element
    for element in (KinematicLinear3D4N, KinematicLinear3D5N, KinematicLinear3D6N, KinematicLinear3D8N)
}
"""The linear element of each cell."""


def linear_level(points: Array, batches: Sequence[Batch]) -> LinearLevel | None:
    """Return stiffness and interpolation of the linear elements on the corners of `batches`.

    Elements that are linear already take part as they are.  Each other node takes the shape
    functions of the corners, at its reference place, in the first element that has it; what they
    interpolate is a linear field wherever cells are straight-sided.

    Parameters
    ----------
    points : (n, 3) float, m.
    batches : elements with these points.

    Returns
    -------
    The level, or None if all elements are linear or some have no linear element on their corners.
    """
    corners = [_corners(batch.element.shape) for batch in batches]
    if any(c is None for c in corners) or all(_is_linear(batch.element.shape) for batch in batches):
        return None
    number = np.full(len(points), -1, dtype=np.int32)
    for batch, c in zip(batches, corners, strict=True):
        number[batch.nodes[:, c]] = 0
    nodes = np.flatnonzero(number == 0)
    number[nodes] = np.arange(len(nodes))
    linear = [_linear(batch, number[batch.nodes[:, c]]) for batch, c in zip(batches, corners, strict=True)]
    pattern = Pattern(len(nodes), [batch.nodes for batch in linear])
    K = assemble_stiffness(points[nodes], linear, pattern)
    return LinearLevel(K, nodes, *_interpolation(batches, linear, number))


def _corners(shape: type[Shape]) -> Ints | None:
    """Return the rows among the nodes of a shape that are the nodes of its linear element."""
    if shape.cell not in LINEAR:
        return None
    corners = LINEAR[shape.cell].shape.nodes
    same = np.abs(shape.nodes[None] - corners[:, None]).max(axis=2) < 1e-12
    return same.argmax(axis=1) if same.any(axis=1).all() else None


def _is_linear(shape: type[Shape]) -> bool:
    return len(shape.nodes) == len(LINEAR[shape.cell].shape.nodes)


def _linear(batch: Batch, nodes: NDArray[np.int32]) -> Batch:
    """Return the linear elements of a batch on their corner nodes."""
    if _is_linear(batch.element.shape):
        return Batch(batch.element, batch.rule, batch.material, nodes, batch.rows)
    element = LINEAR[batch.element.shape.cell]
    return Batch(element, element.rule, batch.material, nodes, batch.rows)


def _interpolation(
    batches: Sequence[Batch], linear: Sequence[Batch], number: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
    """Return rows (indptr, indices, weights) from corners to all nodes; `number` is that of each corner."""
    corners = np.flatnonzero(number >= 0)
    entries = [(corners, number[corners], np.ones(len(corners)))]
    missing = number < 0
    for batch, inner in zip(batches, linear, strict=True):
        k = batch.nodes.shape[1]
        first = np.full(len(number), -1)
        flat = batch.nodes.ravel()
        first[flat[::-1]] = np.arange(len(flat))[::-1]  # the first element with a node is written last
        rows = np.flatnonzero((first >= 0) & missing)
        missing[rows] = False
        element, local = np.divmod(first[rows], k)
        N = LINEAR[batch.element.shape.cell].shape.N(batch.element.shape.nodes)
        N = np.where(np.abs(N) < 1e-14, 0.0, N)[local]
        at, corner = np.nonzero(N)
        entries.append((rows[at], inner.nodes[element[at], corner], N[at, corner]))
    rows, columns, weights = (np.concatenate(part) for part in zip(*entries, strict=True))
    order = np.lexsort((columns, rows))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=len(number)))])
    return indptr.astype(np.int32), columns[order].astype(np.int32), weights[order]

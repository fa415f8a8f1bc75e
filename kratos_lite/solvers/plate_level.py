"""The coarse level of a thin flat body: six unknowns of each line of nodes across its thickness."""

from __future__ import annotations

import numpy as np

from kratos_lite.records import record
from kratos_lite.solvers.coarse_level import LinearLevel
from kratos_lite.solvers.constraint_map import rigid_modes
from kratos_lite.typing import Array, Mask, Rows

FLAT = 0.1
"""Thickness of a body to its width, up to which it bends like a plate."""

VERY_THIN = 0.004
"""The same from which single precision no longer holds energies of bending beside those of shear."""


@record(eq=False)
class PlateLevel:
    """Lines of nodes as the coarse level of a thin flat body.

    A line has the displacement of its center, two slopes and a stretch, which give the displacements
    u - z s1 e1 - z s2 e2 + z e n of its nodes at heights z.  A node between lines takes the mean of theirs
    and, along n, half of what their slopes say at its place: what bends without shear at the lines then
    bends so between them (Hermite interpolation, Kirchhoff's hypothesis).

    Attributes
    ----------
    indptr, indices, blocks : interpolation from m lines to n nodes in rows, blocks (k, 3, 6).
    modes : (6m, 12) rigid modes, those of constant curvature, and zeros.
    """

    indptr: Rows
    indices: Rows
    blocks: Array
    modes: Array


def plate_level(points: Array, free: Mask, axes: Array, labels: Rows, linear: LinearLevel) -> PlateLevel:
    """Return the lines of the corner nodes of a thin flat body, with the interpolation from them.

    Parameters
    ----------
    points : (n, 3) m.
    free : (3n,) the components that are unknown.
    axes : (3, 3) of the body in columns, its normal first.
    labels : (n,) the line of each node.
    linear : gives the corner nodes and their interpolation to all nodes.
    """
    n = len(points)
    _, line = np.unique(labels[linear.nodes], return_inverse=True)
    ends = points[linear.nodes]
    centers = np.column_stack([np.bincount(line, x) for x in ends.T]) / np.bincount(line)[:, None]
    height = float(np.abs((ends - centers[line]) @ axes[:, 0]).max())
    m, rows = len(centers), np.repeat(np.arange(n), np.diff(linear.indptr))
    pairs, where = np.unique(rows * m + line[linear.indices], return_inverse=True)
    node, at = np.divmod(pairs, m)
    blocks = _shapes((points[node] - centers[at]) @ axes / height, axes)
    blocks *= np.bincount(where, linear.weights)[:, None, None] * free.reshape(-1, 3)[node][:, :, None]
    moved = np.zeros((m, 6), dtype=bool)
    np.logical_or.at(moved, at, blocks.any(axis=1))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(node, minlength=n))]).astype(np.int32)
    modes = _modes(centers, axes, height).reshape(-1, 12) * moved.reshape(-1, 1)
    return PlateLevel(indptr, at.astype(np.int32), blocks.astype(np.float32), modes)


def _shapes(places: Array, axes: Array) -> Array:
    """Return the displacements (k, 3, 6) at places (k, 3) beside their lines, along the axes in heights."""
    z, x, y = places.T
    normal, first, second = axes.T
    blocks = np.zeros((len(places), 3, 6))
    blocks[:, :, :3] = np.eye(3)
    blocks[:, :, 3] = np.outer(x / 2, normal) - np.outer(z, first)
    blocks[:, :, 4] = np.outer(y / 2, normal) - np.outer(z, second)
    blocks[:, :, 5] = np.outer(z, normal)
    return blocks


def _modes(centers: Array, axes: Array, height: float) -> Array:
    """Return the modes (m, 6, 12) of lines."""
    up = height * axes[:, 0]
    low, high = bending_modes(np.vstack([centers - up, centers + up]), axes).reshape(2, -1, 3, 12)
    z, x, y = np.moveaxis((high - low).transpose(0, 2, 1) @ axes / 2, 2, 0)
    return np.concatenate([(low + high) / 2, np.stack([-x, -y, z], axis=1)], axis=1)


def plate_axes(points: Array, free: Mask) -> Array | None:
    """Return the axes (3, 3) of a thin flat body in columns, its normal first; None for other bodies.

    Parameters
    ----------
    points : (n, 3) m.
    free : (3n,) the components that are unknown; a body whose normal displacements are held does not bend.
    """
    X = points - points.mean(axis=0)
    moments, axes = np.linalg.eigh(X.T @ X)
    held = (~free.reshape(-1, 3) @ axes[:, 0] ** 2).mean()
    return None if moments[0] > FLAT**2 * moments[1] or held > 0.5 else axes


def is_very_thin(points: Array, axes: Array) -> bool:
    """Return whether bending takes so little energy that multigrid has to work with the matrix as it is."""
    thickness, width, length = np.ptp(points @ axes, axis=0)
    return bool(thickness < VERY_THIN * min(width, length))


def bending_modes(points: Array, axes: Array) -> Array:
    """Return the rigid modes of a thin flat body, those of constant curvature, and zeros: (3n, 12)."""
    z, x, y = ((points - points.mean(axis=0)) @ axes).T / np.ptp(points, axis=0).max()
    modes = np.zeros((len(points), 3, 12))
    modes[:, :, :6] = rigid_modes(points).reshape(-1, 3, 6)
    for mode, (w, slope_x, slope_y) in enumerate(
        ((x * x, 2 * x, 0 * x), (y * y, 0 * y, 2 * y), (x * y, y, x)), 6
    ):
        modes[:, :, mode] = np.column_stack([w, -z * slope_x, -z * slope_y]) @ axes.T
    return modes.reshape(-1, 12)

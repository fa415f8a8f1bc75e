"""The coarse level of a thin body: six unknowns of each line of nodes across its thickness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.solvers.coarse_level import PCoarseLevel
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.solvers.plan import FLAT
from kratos_lite.typing import Array, Ints, Mask, Rows

VERY_THIN = 0.004
"""The same from which single precision no longer holds energies of bending beside those of shear."""


@dataclass(eq=False)
class PlateLevel:
    """Lines of nodes as the coarse level of a thin body, flat or curved."""

    # A line has the displacement of its center, two slopes and a stretch, which give the displacements u - z
    # s1 e1 - z s2 e2 + z e n of its nodes at heights z. A node between lines takes the mean of theirs and,
    # along n, half of what their slopes say at its place: what bends without shear at the lines then bends so
    # between them (Hermite interpolation, Kirchhoff's hypothesis).

    indptr: Rows  # interpolation from m lines to n nodes in rows, blocks (k, 3, 6)
    indices: Rows
    blocks: Array
    modes: Array  # (6m, 12) rigid modes, and those of constant curvature or quadratic along the normals


def plate_level(
    points: Array, free: Mask, axes: Array | None, labels: Rows, linear: PCoarseLevel
) -> PlateLevel | None:
    """Return the lines of the corner nodes of a thin body, with the interpolation from them."""
    n = len(points)
    _, line = np.unique(labels[linear.nodes], return_inverse=True)
    ends = points[linear.nodes]
    centers = np.column_stack([np.bincount(line, x) for x in ends.T]) / np.bincount(line)[:, None]
    m, offsets = len(centers), ends - centers[line]
    frames = np.broadcast_to(axes, (m, 3, 3)) if axes is not None else _frames(offsets, line)
    if axes is None and not _is_shell(points, free, offsets, frames, line, linear):
        return None
    height = float(np.abs(np.einsum("ki,ki->k", offsets, frames[line, :, 0])).max())
    rows = np.repeat(np.arange(n), np.diff(linear.indptr))
    pairs, where = np.unique(rows * m + line[linear.indices], return_inverse=True)
    node, at = np.divmod(pairs, m)
    blocks = _shapes((points[node] - centers[at]) / height, frames[at])
    blocks *= np.bincount(where, linear.weights)[:, None, None] * free.reshape(-1, 3)[node][:, :, None]
    moved = np.zeros((m, 6), dtype=bool)
    np.logical_or.at(moved, at, blocks.any(axis=1))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(node, minlength=n))]).astype(np.int32)
    modes = _modes(centers, frames, height, axes).reshape(-1, 12) * moved.reshape(-1, 1)
    return PlateLevel(indptr, at.astype(np.int32), blocks.astype(np.float32), modes)


def _frames(offsets: Array, line: Ints) -> Array:
    """Return the axes (m, 3, 3) of lines in columns, their directions first; NaN for lines of one node."""
    squares = (offsets**2).sum(axis=1)  # both ends are as far: the last one counts, whatever the rounding
    order = np.argsort(np.round(squares / (squares.max() or 1.0), 6), kind="stable")
    far = np.zeros((line.max() + 1, 3))
    far[line[order]] = offsets[order]
    with np.errstate(invalid="ignore"):
        normal = far / np.linalg.norm(far, axis=1)[:, None]
    first = np.cross(normal, np.eye(3)[np.abs(far).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([normal, first, np.cross(normal, first)], axis=2)


def _is_shell(
    points: Array, free: Mask, offsets: Array, frames: Array, line: Ints, linear: PCoarseLevel
) -> bool:
    """Return whether lines are short beside the body, of several nodes each, and free along themselves."""
    if not np.isfinite(frames).all():
        return False
    X = points - points.mean(axis=0)
    width = np.sqrt(12 * np.linalg.eigvalsh(X.T @ X)[1] / len(X))
    constrained = ~free.reshape(-1, 3)[linear.nodes]
    along = (constrained * frames[line, :, 0] ** 2).sum(axis=1).mean()
    return bool(2 * np.linalg.norm(offsets, axis=1).max() < FLAT * width and along <= 0.5)


def _shapes(places: Array, frames: Array) -> Array:
    """Return the displacements (k, 3, 6) at places (k, 3) beside lines, in heights."""
    z, x, y = np.einsum("ki,kij->jk", places, frames)[:, :, None]
    normal, first, second = np.moveaxis(frames, 2, 0)
    blocks = np.empty((len(places), 3, 6))
    blocks[:, :, :3] = np.eye(3)
    blocks[:, :, 3] = x / 2 * normal - z * first
    blocks[:, :, 4] = y / 2 * normal - z * second
    blocks[:, :, 5] = z * normal
    return blocks


def _modes(centers: Array, frames: Array, height: float, axes: Array | None) -> Array:
    """Return the modes (m, 6, 12) of lines."""
    up = height * frames[:, :, 0]
    if axes is None:
        low, high = _shell_modes(centers, frames, height)
    else:
        low, high = bending_modes(np.vstack([centers - up, centers + up]), axes).reshape(2, -1, 3, 12)
    z, x, y = np.moveaxis(np.einsum("mic,mij->mcj", high - low, frames) / 2, 2, 0)
    return np.concatenate([(low + high) / 2, np.stack([-x, -y, z], axis=1)], axis=1)


def _shell_modes(centers: Array, frames: Array, height: float) -> Array:
    """Return rigid modes and quadratic functions along the normals, at the ends of lines: (2, m, 3, 12)."""
    normal = frames[:, :, 0]
    X = (centers - centers.mean(axis=0)) / (scale := np.ptp(centers, axis=0).max())
    ends = np.zeros((2, len(X), 3, 12))
    both = np.vstack([centers - height * normal, centers + height * normal])
    ends[:, :, :, :6] = rigid_modes(both).reshape(2, -1, 3, 6)
    for mode, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)), 6):
        slope = np.zeros_like(X)
        slope[:, i] += X[:, j] / scale
        slope[:, j] += X[:, i] / scale
        slope -= normal * np.einsum("mi,mi->m", normal, slope)[:, None]
        w = (X[:, i] * X[:, j])[:, None] * normal
        ends[0, :, :, mode], ends[1, :, :, mode] = w + height * slope, w - height * slope
    return ends


def plate_axes(points: Array, free: Mask) -> Array | None:
    """Return the axes (3, 3) of a thin flat body in columns, its normal first; None for other bodies."""
    X = points - points.mean(axis=0)
    moments, axes = np.linalg.eigh(X.T @ X)
    constrained = (~free.reshape(-1, 3) @ axes[:, 0] ** 2).mean()
    return None if moments[0] > FLAT**2 * moments[1] or constrained > 0.5 else axes


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

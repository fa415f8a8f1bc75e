"""Scenes: what is drawn side by side, with one camera, one window and one scale of colors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh, mask_of
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.view import canvas
from kratos_lite.view.camera import View, box_corners, rows_of, window_of
from kratos_lite.view.marks import Entry, Marks
from kratos_lite.view.plane import Plane, plane_of
from kratos_lite.view.rulers import rounded

DECADES = 4
"""Powers of ten that a logarithmic scale of colors shows."""
FEW, OWNED, SAME = 0.5, 0.1, 1e-6
"""Percent of the body, at each end of the values, that colors leave out if it takes more than a part of the
range of all others; and that range, beside the whole, up to which these are one value."""


@dataclass(frozen=True, eq=False)
class Values:
    """Numbers that color a body."""

    numbers: Array  # (n,) of nodes or (m,) of elements
    title: str = ""  # what they are
    unit: str = ""  # at the color bar
    log: bool = False  # whether their powers of ten matter
    kind: str = ""  # how they are known at nodes, such as "recovered"
    names: Sequence[str] = ()  # of what the numbers 0, 1, … stand for, if for things such as materials


@dataclass(frozen=True, eq=False)
class Subject:
    """What is drawn of a body."""

    mesh: Mesh  # the undeformed body
    u: Array | None = None  # (n, 3) m, displacement; None of what has none
    values: Values | None = None  # what colors it
    title: str = ""  # above the picture
    marks: Marks | None = None  # what holds and pushes it
    legend: Sequence[Entry] = ()  # what the marks stand for
    moving: bool = False  # whether it moves through space, so that its first place is none to show

    @property
    def is_nodal(self) -> bool:
        """Whether the values are of nodes, not of elements."""
        return self.values is None or len(self.values.numbers) == self.mesh.n_nodes

    def rows(self) -> Ints:
        """Return the rows of the values that are of elements, or of nodes of elements."""
        return np.flatnonzero(self.mesh.used_nodes()) if self.is_nodal else np.arange(self.mesh.n_elements)


@dataclass(eq=False)
class Options:
    """How it is drawn; see `kratos_lite.plot`."""

    view: View | None = None
    clim: tuple[float, float] | None = None
    scale: float | None = None
    zoom: Any = None
    clip: Any = None
    size: tuple[float, float] = (8, 6)
    title: str = ""


@dataclass(eq=False)
class Scene:
    """Subjects with what they share."""

    subjects: Sequence[Subject]  # side by side
    rows: Array  # of the camera
    scale: float  # factor on displacements
    window: tuple[Array, Array]  # lower left and upper right of what is shown, in m in the picture
    colors: Any  # scale of colors, or None
    plane: Plane | None  # that cuts the bodies, or None
    zoom: Any = None  # factor, part or box that the window shows; then it cuts them off

    def place(self, subject: Subject) -> Array:
        """Return where the nodes of a subject are drawn, (n, 3) m."""
        return subject.mesh.points if subject.u is None else subject.mesh.points + self.scale * subject.u

    def part(self, subject: Subject) -> Mask | None:
        """Return the nodes (n,) of the part that the window shows, if it shows one."""
        mesh = subject.mesh
        return mask_of(mesh.nodes(self.zoom), mesh.n_nodes) if isinstance(self.zoom, str) else None


def scene_of(subjects: Sequence[Subject], options: Options) -> Scene:
    """Return subjects with one camera, one factor on displacements, one window and one scale of colors."""
    for subject in subjects:
        if not subject.mesh.boundary:
            raise InputError("there is nothing to draw: the mesh has no element of a known shape")
    points = np.concatenate([subject.mesh.points for subject in subjects])
    rows = rows_of(options.view, points)
    plane = None if options.clip is None else plane_of(options.clip, rows[2])
    scale = factor_of(subjects, options.scale)
    scene = Scene(
        subjects,
        rows,
        scale,
        window_of(points[:, :2]),
        colors_of(subjects, options.clim),
        plane,
        options.zoom,
    )
    scene.window = window_of(np.concatenate([drawn_points(scene, subject) for subject in subjects]))
    if options.zoom is not None:
        whole, scene.window = scene.window, _zoomed(scene, options.zoom)
        if ((scene.window[0] > whole[1]) | (scene.window[1] < whole[0])).any():
            low, high = points.min(axis=0), points.max(axis=0)
            raise InputError(
                "zoom leaves nothing to draw: seen from there, it lies beside the body, which spans "
                f"{place_text(low)} … {place_text(high)} m"
            )
    if plane is not None:
        plane.check(points)
    return scene


def drawn_points(scene: Scene, subject: Subject) -> Array:
    """Return the outer nodes of a subject in the picture, (k, 2), deformed and not."""
    nodes = np.unique(np.concatenate([block.nodes.ravel() for block in subject.mesh.boundary]))
    undeformed, deformed = subject.mesh.points[nodes], scene.place(subject)[nodes]
    points = [deformed] if subject.moving else [undeformed, deformed]
    if subject.marks is not None:
        points.append(subject.marks.points())
    return np.concatenate(points) @ scene.rows[:2].T


def factor_of(subjects: Sequence[Subject], wanted: float | None) -> float:
    """Return the factor on displacements: by default 1, 2 or 5 times a power of ten, at least 1."""
    # With it the largest displacement is at most a tenth of the body.
    if wanted is not None:
        return wanted
    moved = [(s.mesh.points, s.u) for s in subjects if s.u is not None and s.u.any()]
    tenths = [0.1 * np.linalg.norm(np.ptp(X, axis=0)) / np.linalg.norm(u, axis=1).max() for X, u in moved]
    return min((max(1.0, rounded(float(tenth))) for tenth in tenths), default=1.0)


def colors_of(subjects: Sequence[Subject], clim: tuple[float, float] | None) -> Any:
    """Return the scale of colors of all subjects, or None."""
    values = [(subject.values, subject.rows()) for subject in subjects if subject.values is not None]
    if not values:
        return None
    if any(v.names for v, _ in values):
        return canvas.categories(max(len(v.names) for v, _ in values))
    log = all(v.log for v, _ in values)
    if clim is None:
        numbers = np.concatenate([v.numbers[rows] for v, rows in values])
        low, high = (float(numbers.min()), float(numbers.max())) if log else _range(numbers, subjects)
        if log:
            low = max(low, high * 10.0**-DECADES)
            log = high > 0
    else:
        low, high = clim
        log = log and low > 0
    return canvas.color_scale(low, high, log=log)


def _range(numbers: Array, subjects: Sequence[Subject]) -> tuple[float, float]:
    """Return the least and the largest number, but for a few at an end where these take much of the range."""
    sizes, order = cache(_sizes), np.argsort(numbers)  # frames have one mesh
    each = [sizes(s.mesh, s.is_nodal)[s.rows()] for s in subjects if s.values is not None]
    shares = np.concatenate(each)[order].cumsum()
    ends = np.searchsorted(shares, shares[-1] * np.array([FEW, 100 - FEW]) / 100)
    low, first, last, high = numbers[order[[0, *ends, -1]]].tolist()
    if last - first <= SAME * (high - low):  # only few differ from all others
        return low, high
    owned = OWNED * (last - first)
    return first if first - low > owned else low, last if high - last > owned else high


def _sizes(mesh: Mesh, is_nodal: bool) -> Array:
    """Return about the volume of each element (m,), or the mean one around each node (n,)."""
    # The spread of the nodes is, for each shape, in proportion to it; refinement gathers nodes at peaks.
    sizes, sums, counts = list[Array](), np.zeros(mesh.n_nodes), np.zeros(mesh.n_nodes)
    for block in mesh.blocks:
        X = mesh.points[block.nodes]
        X = X - X.mean(axis=1, keepdims=True)
        sizes.append(np.sqrt(np.abs(np.linalg.det(X.swapaxes(1, 2) @ X / X.shape[1]))))
        nodes, each = block.nodes.ravel(), np.repeat(sizes[-1], X.shape[1])
        sums += np.bincount(nodes, each, len(sums))
        counts += np.bincount(nodes, None, len(sums))
    return sums / np.maximum(counts, 1) if is_nodal else np.concatenate(sizes)


def place_text(point: Array) -> str:
    """Return coordinates in brackets; what rounding leaves is 0."""
    exact = np.where(np.abs(point) > 1e-12 * np.abs(point).max(), point, 0.0)
    return f"({', '.join(f'{x:.5g}' for x in exact)})"


def _zoomed(scene: Scene, zoom: Any) -> tuple[Array, Array]:
    """Return the window around the middle for a factor, or that of a part or a box."""
    low, high = scene.window
    if isinstance(zoom, (float, int)):
        middle, half = (low + high) / 2, (high - low) / 2 / zoom
        return middle - half, middle + half
    chosen_points = []
    for subject in scene.subjects:
        if isinstance(zoom, str):
            chosen = scene.place(subject)[subject.mesh.nodes(zoom)]
        else:
            chosen = box_corners(*np.asarray(zoom, dtype=float))
        chosen_points.append(chosen @ scene.rows[:2].T)
    low, high = window_of(np.concatenate(chosen_points))
    margin = 0.05 * (high - low).max()
    return low - margin, high + margin

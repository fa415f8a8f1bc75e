"""What a page for the browser shows, as numbers: mesh, fields and frames, packed into one text."""

from __future__ import annotations

import base64
import json
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.analysis.fields import Field
from kratos_lite.mesh import Block
from kratos_lite.mesh.blocks import with_rows
from kratos_lite.mesh.subdivision import Child, child_cells, unchanged
from kratos_lite.shapes import LINEAR, Shape
from kratos_lite.tabular import in_units, unit_name
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.view import facets
from kratos_lite.view.facets import grid, rim, sharp_edges
from kratos_lite.view.rulers import rounded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kratos_lite.mesh import Mesh


MOST_CELLS = 250_000
"""Elements up to which the page knows the inside, for cuts."""
MOST_EDGED = 5_000
"""Faces up to which their edges are shown at the start."""
QUANTUM = 30_000
"""Whole numbers for the largest value of a series: 16 bits, an error below 2e-5 of it."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One state or mode of a page."""

    name: str  # such as ``t = 0.1 s``
    values: Sequence[Array]  # of each field, displacements first: (n,), (n, 3), (n, 6), or those of elements


@dataclass(frozen=True, eq=False)
class Content:
    """All that a page shows."""

    title: str  # heading
    # ``result``, ``modes`` or ``states``; animated are the deformation, its oscillation, the states
    kind: str
    mesh: Mesh  # with a surface
    fields: Sequence[Field]  # the first is the displacement
    frames: Sequence[Frame]  # states or modes; one of a result
    shown: str = "0:magnitude"  # number of the field and component at the start, as ``1:von Mises``
    about: Sequence[tuple[str, str]] = ()  # labels and texts of the summary

    def packed(self) -> str:
        """Return all of it as one text."""
        data = _Packer(is_short=len(self.frames) > 1)
        kept = self._kept()
        units, size = self.mesh.units, " × ".join(f"{side:.5g}" for side in self._size())
        about = [("size", f"{size} m"), *self.about]
        head = {
            "title": self.title,
            "kind": self.kind,
            "shown": self.shown,
            "about": [(name, in_units(text, units)) for name, text in about],
            "prefixed": units == "SI",
            "fields": [_described(field, units) for field in self.fields],
            **self._frame(),
            **_mesh(data, self.mesh, kept, self._center()),
            "frames": [self._packed_frame(data, frame, kept) for frame in self.frames],
        }
        return data.text(head)

    def _kept(self) -> Ints:
        """Return the rows of the nodes that the page knows: of a large mesh those of the surface."""
        if self.mesh.n_elements <= MOST_CELLS:
            return np.arange(self.mesh.n_nodes)
        return np.unique(np.concatenate([block.nodes.ravel() for block in self.mesh.boundary]))

    def _packed_frame(self, data: _Packer, frame: Frame, kept: Ints) -> dict[str, Any]:
        both = zip(self.fields, frame.values, strict=True)
        values = [data.field(v if field.nodal_place == "element" else v[kept]) for field, v in both]
        return {"name": in_units(frame.name, self.mesh.units), "values": values}

    def scale(self) -> float:
        """Return the factor on displacements at the start."""
        largest = max(float(np.linalg.norm(frame.values[0], axis=1).max()) for frame in self.frames)
        if not largest:
            return 1.0
        wanted = rounded(0.1 * float(np.linalg.norm(self._size())) / max(largest, 1e-100))
        return wanted if self.kind == "modes" else max(1.0, wanted)

    def _size(self) -> Array:
        return np.asarray(np.ptp(self.mesh.points, axis=0))

    def _ends(self) -> tuple[Array, Array]:
        """Return the corners of the box that holds the body in all frames."""
        X, scale = self.mesh.points, self.scale()
        sides = (0.0, 1.0, -1.0) if self.kind == "modes" else (0.0, 1.0)
        moved = [X + side * scale * frame.values[0] for frame in self.frames for side in sides]
        return np.min([x.min(axis=0) for x in moved], axis=0), np.max([x.max(axis=0) for x in moved], axis=0)

    def _center(self) -> Array:
        return np.asarray(sum(self._ends()) / 2)

    def _frame(self) -> dict[str, Any]:
        """Return where the camera looks, and how far the body reaches there."""
        low, high = self._ends()
        return {
            "center": ((low + high) / 2).tolist(),
            "radius": float(np.linalg.norm(high - low) / 2) or 1.0,
            "reach": ((high - low) / 2).tolist(),
            "scale": self.scale(),
        }


def _described(field: Field, units: str) -> dict[str, str]:
    unit = unit_name(field.unit, units)
    return {"name": field.name, "unit": unit, "kind": field.kind, "at": field.nodal_place}


def _mesh(data: _Packer, mesh: Mesh, kept: Ints, center: Array) -> dict[str, Any]:
    """Return the nodes that are kept, the surface, and the cells unless only the surface is kept."""
    row = np.zeros(mesh.n_nodes, dtype=np.int32)
    row[kept] = np.arange(len(kept))
    faces, cells, n = [], [], fineness(mesh.boundary)
    for block in mesh.boundary:
        assert block.shape is not None
        nodes, element = data.whole(row[block.nodes]), data.whole(block.ids)
        faces.append({**lattice_of_face(block.shape, n), "nodes": nodes, "element": element})
    for block, at in with_rows(mesh.blocks if len(kept) == mesh.n_nodes else []):
        if block.shape is not None and block.shape.faces:
            lattice = lattice_of_cell(block.shape)
            cells.append({**lattice, "nodes": data.whole(block.nodes), "first": at.start})
    return {
        "points": data.real(mesh.points[kept] - center),
        "node_ids": data.whole(mesh.node_ids[kept]),
        "element_ids": data.whole(mesh.element_ids),
        "faces": faces,
        "cells": cells,
        "outline": data.whole(row[sharp_edges(mesh)]),
        "edged": sum(map(len, mesh.boundary)) < MOST_EDGED,
    }


class _Packer:
    """Arrays of a page, one after the other: bytes sorted by significance, which compress better."""

    def __init__(self, *, is_short: bool) -> None:
        self.parts: list[bytes] = []
        self.size, self.is_short = 0, is_short

    def whole(self, array: NDArray[Any]) -> dict[str, Any]:
        """Take whole numbers, as differences from row to row; large ids keep all their digits."""
        is_large = array.size > 0 and array.max() >= 2**31
        return self._take("i8" if is_large else "i4", array.astype(np.int64 if is_large else np.int32))

    def real(self, array: Array) -> dict[str, Any]:
        """Take real numbers in single precision."""
        return self._take("f4", array.astype(np.float32))

    def field(self, array: Array) -> dict[str, Any]:
        """Take values of a field; those of many frames as whole numbers of 16 bits."""
        if not self.is_short:
            return self.real(array)
        step = float(np.abs(array).max(initial=0.0)) / QUANTUM or 1.0
        return {**self._take("i2", np.round(array / step).astype(np.int16)), "step": step}

    def _take(self, kind: str, array: NDArray[Any]) -> dict[str, Any]:
        flat = np.ascontiguousarray(array).reshape(len(array), -1)
        if kind != "f4":
            flat = np.diff(flat, axis=0, prepend=np.zeros_like(flat[:1]))
        raw = flat.astype(flat.dtype.newbyteorder("<")).view(np.uint8).reshape(-1, flat.itemsize)
        described = {"type": kind, "start": self.size, "count": flat.size, "width": flat.shape[1]}
        self.parts.append(np.ascontiguousarray(raw.T).tobytes())
        self.size += len(self.parts[-1])
        return described

    def text(self, head: dict[str, Any]) -> str:
        """Return the length of the head, the head and all arrays, compressed, as text."""
        first = json.dumps(head, separators=(",", ":"), allow_nan=False).encode()
        whole = b"".join([struct.pack("<I", len(first)), first, *self.parts])
        return base64.b64encode(zlib.compress(whole, 9)).decode()


TETRAHEDRA = {
    "tetrahedron": ((0, 1, 2, 3),),
    "pyramid": ((0, 1, 2, 4), (0, 2, 3, 4)),
    "wedge": ((0, 1, 2, 5), (0, 1, 5, 4), (0, 4, 5, 3)),
    "hexahedron": ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),
}
"""Corners of tetrahedra that fill a cell."""


def fineness(faces: list[Block]) -> int:
    """Return into how many parts an edge of each face is cut: curved ones into two or more."""
    curved = any(block.shape is not None and block.shape.degree > 1 for block in faces)
    most = min(facets.fineness(sum(map(len, faces))), 6 if curved else 4)
    return max(most, 2) if curved else most


def lattice_of_face(shape: type[Shape], n: int) -> dict[str, Any]:
    """Return N at the points of a lattice on a face, its triangles, and the parts of the edges."""
    places, quadrilaterals = grid(shape.cell, n)
    triangles = quadrilaterals[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    triangles = triangles[triangles[:, 1] != triangles[:, 2]]
    used, rows = np.unique(triangles, return_inverse=True)
    edges = [[_nearest(places[used], point) for point in pair] for pair in rim(shape, n)]
    return {"N": _rounded(shape.N(places[used])), "triangles": rows.reshape(-1, 3).tolist(), "edges": edges}


def _nearest(places: Array, point: Array) -> int:
    return int(((places - point) ** 2).sum(axis=1).argmin())


def _rounded(N: Array) -> list[list[float]]:
    """Return weights without the rounding errors of zeros."""
    rounded: list[list[float]] = (np.round(N, 12) + 0.0).tolist()
    return rounded


def lattice_of_cell(shape: type[Shape]) -> dict[str, Any]:
    """Return N at the points of a lattice in a cell, and the tetrahedra between them.

    A tetrahedron is its four points and, for each of them, whether the face opposite lies on the cell's own
    faces or inside.
    """
    parts: tuple[Child, ...] = (unchanged(shape.cell),) if shape.degree == 1 else child_cells(shape.cell)
    corners = [part.corners[list(four)] for part in parts for four in TETRAHEDRA[part.cell]]
    places, rows = np.unique(np.concatenate(corners).round(12), axis=0, return_inverse=True)
    on = _on_faces(shape, places)
    tetrahedra = []
    for four in rows.reshape(-1, 4):
        outer = [bool(on[np.delete(four, i)].all(axis=0).any()) for i in range(4)]
        tetrahedra.append([four.tolist(), outer])
    return {"N": _rounded(shape.N(places)), "tetrahedra": tetrahedra}


def _on_faces(shape: type[Shape], places: Array) -> Mask:
    """Return which reference places (p, 3) lie on which faces of a cell, (p, f)."""
    X = LINEAR[shape.cell].nodes
    planes = [X[list(face[:3])] for face in LINEAR[shape.cell].faces]
    away = [(places - a) @ np.cross(b - a, c - a) for a, b, c in planes]
    return np.asarray(np.abs(away).T < 1e-9)

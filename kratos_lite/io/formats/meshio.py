"""Bridge to meshio: Gmsh, Abaqus, Nastran, MED, VTK and other mesh formats.

meshio keeps cells in the node order of VTK, except that its linear wedge is that of Gmsh and Kratos.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.atomic import refuse_nan, replacing
from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import Document, Note, Properties
from kratos_lite.io.formats.foreign import (
    cell_counts,
    check_ending,
    check_solids,
    guarded,
    listed,
    read_foreign,
)
from kratos_lite.mesh import NO_ROWS, Block, Mesh, Part, with_rows
from kratos_lite.shapes import SHAPES
from kratos_lite.typing import Ints, Numbers

CELLS = {
    "vertex": "Point1", "line": "Line2", "line3": "Line3",
    "triangle": "Triangle3", "triangle6": "Triangle6",
    "quad": "Quadrilateral4", "quad8": "Quadrilateral8", "quad9": "Quadrilateral9",
    "tetra": "Tetrahedron4", "tetra10": "Tetrahedron10", "pyramid": "Pyramid5", "pyramid13": "Pyramid13",
    "wedge": "Wedge6", "wedge15": "Wedge15",
    "hexahedron": "Hexahedron8", "hexahedron20": "Hexahedron20", "hexahedron27": "Hexahedron27",
}  # fmt: skip
"""Our shape of each cell type of meshio."""
_NAMES = ("PointCondition3D{}N", "LineCondition3D{}N", "SurfaceCondition3D{}N", "Element3D{}N")
_PROPERTY_KEYS = ("gmsh:physical", "nastran:ref", "medit:ref", "PROPERTIES_ID")
_INT32 = 2**31 - 1
_OPTIONS = {
    ".msh": {"file_format": "gmsh22"},
    ".xdmf": {"data_format": "XML"},
    ".xmf": {"data_format": "XML"},
}
"""How to write mixed cells to one file where that is not the default of meshio."""


def read_meshio(path: str | Path) -> Document:
    """Return the mesh of any format that meshio knows, in m; groups, cell sets and node sets become parts.

    Solid cells become elements ``Element3D…N``, which say no formulation, faces conditions
    ``SurfaceCondition3D…N``.  Lines and points are kept when a named group holds them.  The number of the
    physical group (or material) of a solid cell is its property id, or 1.
    """
    path = Path(path)
    found, said = read_foreign(path)
    _check(path, found)
    check_solids(path, found, CELLS)
    return _Reading(path, found, said).document()


def write_meshio(
    path: str | Path, mesh: Mesh, point_data: Mapping[str, Numbers], cell_data: Mapping[str, Numbers]
) -> None:
    """Write a mesh and numbers on nodes and elements in the format of the ending; all or nothing."""
    path = Path(path)
    check_ending(path)
    for name, values in (("a coordinate", mesh.points), *point_data.items(), *cell_data.items()):
        refuse_nan(path, name, values)
    if path.suffix.lower() == ".msh":
        cell_data = _gmsh_tags(path, cell_data)
    types = {shape: name for name, shape in CELLS.items()}
    cells, slices = [], []
    for block, at in with_rows(mesh.blocks):
        if block.shape is not None and block.shape.__name__ in types:
            cells.append((types[block.shape.__name__], block.nodes[:, list(block.shape.to_vtk)]))
            slices.append(at)
    cell_values = {name: [values[rows] for rows in slices] for name, values in cell_data.items()}
    with replacing(path) as temporary, guarded(path, "written") as (meshio, _):
        whole = meshio.Mesh(mesh.points, cells, dict(point_data), cell_values)
        meshio.write(temporary, whole, **_OPTIONS.get(path.suffix.lower(), {}))
        # Several writers of meshio leave out what their format cannot hold, and say nothing.
        kept, wanted = cell_counts(meshio.read(temporary)), cell_counts(whole)
        if kept != wanted:
            numbers = f"{listed(kept)} of {listed(wanted)}"
            raise InputError(f"{path}: this format keeps {numbers}; .vtu and .vtk keep all cells")


def _gmsh_tags(path: Path, cell_data: Mapping[str, Numbers]) -> dict[str, Numbers]:
    """Return the property ids as the two tags of Gmsh, which takes no stresses on elements."""
    if results := set(cell_data) - {"PROPERTIES_ID", "ELEMENT_ID"}:
        raise InputError(f"{path}: .msh cannot hold {', '.join(sorted(results))} on elements; write .vtu")
    properties = np.asarray(cell_data.get("PROPERTIES_ID", []))
    if len(properties) and properties.max() > _INT32:
        text = f".msh holds property ids up to {_INT32}; got {properties.max()}; write .vtu"
        raise InputError(f"{path}: {text}")
    tags = properties.astype(np.int32)
    return {"gmsh:physical": tags, "gmsh:geometrical": tags} if len(tags) else {}


def _check(path: Path, found: Any) -> None:
    """Refuse points that are no points in space, and cells that name points that are not there."""
    points = found.points
    if points is None:
        raise InputError(f"{path}: the points are no numbers; is the file complete?")
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{path}: the points form {points.shape}; expected (n, 3); save a mesh in space")
    if len(bad := np.flatnonzero(~np.isfinite(points).all(axis=1))):
        raise InputError(f"{path}: point {bad[0] + 1} has coordinates {points[bad[0]]}; expected numbers")
    for cells in found.cells:
        if cells.type in CELLS and len(cells.data):
            width, needs = cells.data.shape[1], len(SHAPES[CELLS[cells.type]].nodes)
            if width != needs:
                raise InputError(f"{path}: a {cells.type} has {width} nodes; expected {needs}")
            low, high = int(cells.data.min()) + 1, int(cells.data.max()) + 1
            if low < 1 or high > len(points):
                text = f"a {cells.type} names point {high if low >= 1 else low}; the points are 1 … "
                raise InputError(f"{path}: {text}{len(points)}; is the file complete?")


def _union(rows: Iterable[Numbers]) -> Ints:
    """Return rows in ascending order, each once."""
    return np.unique(np.concatenate([NO_ROWS, *rows])).astype(np.int64)


class _Reading:
    """One mesh of meshio on its way to a Document."""

    def __init__(self, path: Path, found: Any, said: str) -> None:
        self.path, self.found = path, found
        self.notes = [Note(0, " ".join(said.split()))] if said.strip() else []
        self.used = set(_PROPERTY_KEYS)
        self.sets = self._sets()
        self.kinds = [SHAPES[CELLS[c.type]] if c.type in CELLS else None for c in found.cells]
        self.dims = [-1 if kind is None else kind.nodes.shape[1] for kind in self.kinds]
        self.rows: list[Ints] = [np.full(len(cells.data), -1) for cells in found.cells]

    def document(self) -> Document:
        """Return the mesh with its parts, empty properties and notes."""
        stated = self.found.cell_data.get("ELEMENT_ID")
        solids = [b for b, dim in enumerate(self.dims) if dim == 3]
        of_solids = [stated[b] for b in solids] if stated else []
        has_ids = self._are_ids("ELEMENT_ID", of_solids, sum(len(self.rows[b]) for b in solids))
        elements, conditions = self._blocks((3,), stated if has_ids else None), self._blocks((2, 1, 0), None)
        for block in elements if self.path.suffix.lower() == ".msh" else []:
            if len(np.unique(np.sort(block.nodes, axis=1), axis=0)) < len(block):
                # Gmsh 2 files repeat an element for every group it is in: it would be stiff twice.
                raise InputError(f"{self.path}: {block.name} listed twice; save it from Gmsh as version 4.1")
        used = sorted({int(i) for block in elements for i in np.unique(block.properties)} or {1})
        conditions = [replace(block, properties=np.full(len(block), used[0])) for block in conditions]
        points = self.found.points
        node_ids = self.found.point_data.get("NODE_ID")
        if node_ids is None or not self._are_ids("NODE_ID", [node_ids], len(points)):
            node_ids = np.arange(1, len(points) + 1)
            self.notes.append(Note(0, f"nodes are numbered 1 … {len(points)} in the order of the file"))
        self._note_lost()
        mesh = Mesh(
            points,
            elements,
            node_ids=node_ids.astype(np.int64),
            conditions=conditions,
            parts=self._parts(),
            source=self.path.name,
        )
        return Document(mesh, {i: Properties(i) for i in used}, notes=self.notes)

    def _are_ids(self, name: str, values: list[Numbers], count: int) -> bool:
        """Return whether values are `count` ids, all whole, positive and different; these are used."""
        ids = np.concatenate([NO_ROWS, *map(np.ravel, values)])
        fits = len(ids) == count > 0 and 1 <= ids.min() <= ids.max() < 2**62
        if fits and np.array_equal(ids, np.round(ids)) and len(np.unique(ids)) == count:
            self.used.add(name)
        return name in self.used

    def _sets(self) -> dict[str, list[Ints]]:
        """Return the named groups of cells: rows in each block of meshio."""
        found = self.found
        sets = {
            name: [NO_ROWS if rows is None else np.asarray(rows, dtype=np.int64) for rows in members]
            for name, members in found.cell_sets.items()
            if not name.startswith("gmsh:")
        }
        tags = found.cell_data.get("gmsh:physical")
        for name, tag_and_dim in found.field_data.items():  # Gmsh 2 files
            if tags and name not in sets and len(np.ravel(tag_and_dim)) == 2:
                tag, dim = tag_and_dim
                sets[name] = [
                    np.flatnonzero((values == tag) & (cells.dim == dim))
                    for values, cells in zip(tags, found.cells, strict=True)
                ]
        return sets

    def _blocks(self, dims: tuple[int, ...], stated: list[Numbers] | None) -> list[Block]:
        """Return one block per cell type of these dimensions, and remember the row of each cell."""
        blocks, start = [], 0
        for kind in dict.fromkeys(k for k, d in zip(self.kinds, self.dims, strict=True) if d in dims):
            assert kind is not None
            nodes, ids, properties = [], [], []
            for b in (b for b, other in enumerate(self.kinds) if other is kind):
                keep = self._kept(b)
                rows = self.rows[b][keep] = np.arange(start, start := start + len(keep))
                nodes.append(self.found.cells[b].data[keep][:, np.argsort(kind.to_vtk)])
                ids.append(stated[b] if stated else rows + 1)
                properties.append(self._properties(b)[keep])
            name, all_ids = _NAMES[kind.nodes.shape[1]].format(len(kind.nodes)), np.concatenate(ids)
            block = Block(name, np.vstack(nodes), all_ids.astype(np.int64), np.concatenate(properties), kind)
            if len(block):
                blocks.append(self._with_oriented_wedges(block))
        return blocks

    def _kept(self, b: int) -> Ints:
        """Return the cells of block b to keep: all solids and faces, lines and points of named groups."""
        if self.dims[b] >= 2:
            return np.arange(len(self.rows[b]))
        return _union(members[b] for members in self.sets.values())

    def _properties(self, b: int) -> Ints:
        """Return the property ids of block b; 1 where the file gives none to any solid."""
        for key in _PROPERTY_KEYS:
            values = self.found.cell_data.get(key) or []
            if any(np.any(v != 0) for v, dim in zip(values, self.dims, strict=False) if dim == 3):
                numbers = values[b]
                whole = (numbers >= 0) & (numbers < 2.0**62) & (numbers == np.round(numbers))
                if numbers.ndim != 1 or not whole.all():
                    text = f"must be one whole number ≥ 0 for each cell; got {numbers[:3].tolist()}"
                    raise InputError(f"{self.path}: {key} {text}")
                return numbers.astype(np.int64)
        return np.ones(len(self.rows[b]), dtype=np.int64)

    def _with_oriented_wedges(self, block: Block) -> Block:
        """Undo the exchange of wedge nodes where a VTK file did not follow the order meshio expects."""
        # VTK's text inverts its linear wedge, VTK's formulas (and most writers) do not; the sign of the
        # volume tells which was meant.
        if block.name != "Element3D6N" or self.path.suffix.lower() not in {".vtk", ".vtu"}:
            return block
        X = self.found.points[block.nodes]
        upward = X[:, 3:].sum(axis=1) - X[:, :3].sum(axis=1)
        normal = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
        inverted = np.einsum("ij,ij->i", normal, upward) < 0
        exchanged = block.nodes[:, [0, 2, 1, 3, 5, 4]]
        return replace(block, nodes=np.where(inverted[:, None], exchanged, block.nodes))

    def _note_lost(self) -> None:
        """Note cells and data that are not used."""
        lost: Counter[str] = Counter()
        for cells, rows in zip(self.found.cells, self.rows, strict=True):
            lost[cells.type] += int((rows < 0).sum())
        for name, count in (+lost).items():
            why = "are in no named group" if name in CELLS else "are of no known type"
            self.notes.append(Note(0, f"{count} cells {name!r} {why} and are not used"))
        data = dict.fromkeys([*self.found.point_data, *self.found.cell_data])
        unused = [name for name in data if not name.startswith("gmsh:") and name not in self.used]
        if unused:
            self.notes.append(Note(0, f"data not used: {', '.join(unused)}"))

    def _parts(self) -> dict[str, Part]:
        """Return the named groups with the nodes of their cells, and the node sets."""
        parts: dict[str, Part] = {}
        for name, members in self.sets.items():
            known = [(b, chosen) for b, chosen in enumerate(members) if self.dims[b] >= 0]
            parts[name] = Part(
                _union(self.found.cells[b].data[chosen].ravel() for b, chosen in known),
                _union(self.rows[b][chosen] for b, chosen in known if self.dims[b] == 3),
                _union(self.rows[b][chosen] for b, chosen in known if self.dims[b] < 3),
            )
        for name, chosen in self.found.point_sets.items():
            if chosen is not None:
                part = parts.get(name, Part())
                parts[name] = replace(part, nodes=_union([part.nodes, chosen]))
        return parts

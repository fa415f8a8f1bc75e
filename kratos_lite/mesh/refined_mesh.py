"""RefinedMesh: a mesh made from another one, and what becomes of nodes, elements, conditions and parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from kratos_lite.mesh.blocks import Block, Part, mask_of
from kratos_lite.mesh.centers import Keys, are_among, corners_around, keys_of, sorted_keys
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.selection import Where, WhereElements, elements_among
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.validation import finite


@dataclass(frozen=True, eq=False)
class RefinedMesh:
    """A mesh made from a coarser one, whose nodes are the first of its own."""

    coarse: Mesh  # the two
    mesh: Mesh
    elements: Ints  # (m',) int, row of the coarse element that each element has come from
    conditions: Ints  # (c',) int, likewise of the conditions
    start: Ints  # new nodes from old ones, in compressed rows
    nodes: Ints
    weights: Array
    inside: Keys  # (k,) key of the corners of the edge, face or cell in which each new node lies

    def interpolate(self, values: Array) -> Array:
        """Return nodal values (n, ...) of the coarse mesh on all nodes of the finer one."""
        if len(self.start) == 1:
            return values.copy()
        weighted = self.weights.reshape(-1, *[1] * (values.ndim - 1)) * values[self.nodes]
        return np.concatenate([values, np.add.reduceat(weighted, self.start[:-1])])

    def onto(self, geometry: Mapping[str, Callable[[Array], Array]]) -> RefinedMesh:
        """Return the same with the new nodes of parts moved onto the true surfaces."""
        points, old = self.mesh.points.copy(), self.coarse.n_nodes
        for part, function in geometry.items():
            rows = self.mesh.nodes(part)
            rows = rows[rows >= old]
            points[rows] = finite(function(points[rows]), f"the places on {part!r}", (len(rows), 3))
        if self.mesh.hanging is not None:
            points = self.mesh.hanging.interpolate(points)
        return replace(self, mesh=self.mesh.replace(points=points))

    def refined_nodes(self, rows: Ints) -> Ints:
        """Return the nodes of the finer mesh that belong to a set of nodes of the coarse one.

        On the surface these are those of boundary faces with all nodes in the set; where nodes of the set are
        on no such face, also those of edges, faces and elements with all nodes in it and one of these.
        """
        if not len(self.inside) or not len(rows):
            return rows
        keys = _keys_among(self.coarse, rows)
        new = np.flatnonzero(are_among(self.inside, keys)) + self.coarse.n_nodes
        return np.concatenate([rows, new])

    def children(self, rows: Ints) -> Ints:
        """Return the elements of the finer mesh that have come from elements of the coarse one."""
        return np.flatnonzero(np.isin(self.elements, rows))

    def where(self, where: Where) -> Where:
        """Return what nodes of the coarse mesh are chosen by, as a choice of nodes of the finer one."""
        if isinstance(where, str) or callable(where):
            return where
        return self.refined_nodes(self.coarse.nodes(where))

    def where_elements(self, where: WhereElements) -> WhereElements:
        """Return likewise a choice of elements."""
        if where is None or isinstance(where, (str, int)):
            return where
        return self.children(self.coarse.elements(where))

    def part(self, part: Part) -> Part:
        """Return a part of the coarse mesh as one of the finer mesh."""
        conditions = np.flatnonzero(np.isin(self.conditions, part.conditions))
        elements = part.elements if len(part.elements) else elements_among(part.nodes, self.coarse)
        return replace(
            part,
            nodes=self.refined_nodes(part.nodes),
            elements=self.children(elements),
            conditions=conditions,
        )


# ---- sets of nodes -----------------------------------------------------------------------------------


def _keys_among(mesh: Mesh, rows: Ints) -> Keys:
    """Return the keys of the edges, faces and cells of a set of nodes; see `RefinedMesh.refined_nodes`."""
    inside = mask_of(rows, mesh.n_nodes)
    keys: list[Keys] = []
    alone = inside.copy()
    for faces in mesh.boundary:
        chosen = faces.nodes[inside[faces.nodes].all(axis=1)]
        alone[chosen] = False
        shape = FACE_SHAPES[faces.nodes.shape[1]]
        keys += [keys_of(chosen[:, list(columns)]) for columns in (range(shape.corners), *shape.edges)]
    if alone.any():
        for block in mesh.blocks:
            keys += _with_lone_nodes(block, inside, alone)
    return sorted_keys(*keys)


def _with_lone_nodes(block: Block, inside: Mask, alone: Mask) -> list[Keys]:
    """Return the keys of edges, faces and cells with all nodes inside and one of them on no chosen face."""
    shape = block.shape
    if shape is None or not len(block):
        return []
    faces = [face[: FACE_SHAPES[len(face)].corners] for face in shape.faces]
    around = [tuple(sorted(corners)) for corners in (*shape.edges, *faces, range(shape.corners))]
    inside_of = list(map(set, corners_around(shape.cell, shape.nodes)))
    keys = []
    for corners in around:
        nodes = block.nodes[:, [node for node, among in enumerate(inside_of) if among <= set(corners)]]
        chosen = block.nodes[inside[nodes].all(axis=1) & alone[nodes].any(axis=1)]
        parts = [part for part in around if set(part) <= set(corners)]
        keys += [keys_of(chosen[:, list(part)]) for part in parts]
    return keys

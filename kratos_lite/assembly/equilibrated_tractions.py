"""Equilibrated tractions: forces between elements that balance the loads of each element.

The stresses of displacement elements balance the loads of the whole mesh, not of each element.  For each
node i of an element K, forces b on the sides of K around i are sought with

    Σ b(i) = ∫_K σ ∇N_i - f N_i dV,

opposite on both sides of a face.  The right sides of the elements around a node add up to nothing, as the
displacements solve the equations, so that there are such forces; those nearest to the mean of both elements
are taken, node by node.  Tractions with these moments ∫ t N_i dA = b(i) balance the loads of each element.

Source: Ladevèze & Pelle, Mastering Calculations in Linear and Nonlinear Mechanics (2005), chapter 2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import value_at
from kratos_lite.elements.overridden_steps import internal_load_of
from kratos_lite.elements.surface import area_vectors, face_rule
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.topology import corners, equal_sets, faces_of
from kratos_lite.records import record
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.typing import Array, Ints, Mask, Rows

BALANCED = 1e-6
"""Relative force that may be left over around a node, from the solution of the equations."""


@record(eq=False)
class Sides:
    """Both sides of all faces: block after block, face after face of the cell, cell after cell.

    Arrays have one row for each node of each side.
    """

    mesh: Mesh

    def cells_of(self, group: ElementGroup) -> tuple[int, Ints]:
        """Return the number of the block of a group, and its cells (m,) there."""
        starts = np.cumsum([0, *map(len, self.mesh.blocks)])
        number = int(np.searchsorted(starts, group.rows[0], side="right")) - 1
        return number, group.rows - starts[number]

    def of_group(self, group: ElementGroup) -> Iterator[tuple[tuple[int, ...], Ints]]:
        """Yield the faces of the cells of a group, and the rows (m, k) of the nodes of their sides."""
        number, cells = self.cells_of(group)
        start = sum(len(b) * sum(map(len, faces_of(b))) for b in self.mesh.blocks[:number])
        for face in faces_of(block := self.mesh.blocks[number]):
            yield face, start + cells[:, None] * len(face) + np.arange(len(face))
            start += len(block) * len(face)

    @cached_property
    def row(self) -> Ints:
        """The node of the element, counted through the nodes of all elements."""
        rows, first = [], 0
        for block in self.mesh.blocks:
            m, k = block.nodes.shape
            each = first + np.arange(m)[:, None] * k
            rows += [(each + np.array(face)).ravel() for face in faces_of(block)]
            first += m * k
        return np.concatenate(rows)

    @cached_property
    def node(self) -> Ints:
        """The row of the point."""
        return np.concatenate([b.nodes[:, list(f)].ravel() for b in self.mesh.blocks for f in faces_of(b)])

    @cached_property
    def first(self) -> Ints:
        """The same node on the first side of the face."""
        first = np.arange(len(self.node))
        one, other = self.paired(self.mesh.all_faces.one, self.mesh.all_faces.other, self.node, self._start)
        first[other] = one
        return first

    @cached_property
    def inner(self) -> Mask:
        """Whether another element is behind."""
        return np.bincount(self.first, minlength=len(self.node))[self.first] > 1

    @cached_property
    def _start(self) -> Ints:
        """Where each side starts, and the end."""
        counts = [np.full(len(b), len(f)) for b in self.mesh.blocks for f in faces_of(b)]
        return np.cumsum(np.concatenate([np.zeros(1, dtype=np.int64), *counts]))

    def paired(self, one: Ints, other: Ints, nodes: Ints | Rows, start: Ints) -> tuple[Ints, Ints]:
        """Return the rows of the nodes of sides, and of those of other faces with the same nodes."""
        found = [np.zeros((2, 0), dtype=np.int64)]
        sizes = np.diff(self._start)[one]
        for k in np.unique(sizes):
            mine, theirs = self._start[one[sizes == k], None], start[other[sizes == k], None]
            a, b = mine + np.arange(k), theirs + np.arange(k)
            a = np.take_along_axis(a, self.node[a].argsort(axis=1), axis=1)
            b = np.take_along_axis(b, nodes[b].argsort(axis=1), axis=1)
            if (self.node[a] != nodes[b]).any():
                raise ModelError(
                    "faces with the same corners have other nodes between them; use elements of one degree"
                )
            found.append(np.stack([a.ravel(), b.ravel()]))
        rows = np.concatenate(found, axis=1)
        return rows[0], rows[1]

    def add(self, total: Array, block: Block, forces: Array) -> None:
        """Add forces (m, k, 3) on the faces of a block, each a face on the boundary, to `total` (h, 3)."""
        sets = [(b.nodes, [corners(face) for face in faces_of(b)]) for b in self.mesh.blocks]
        size = len(self._start) - 1
        one, other = equal_sets([*sets, (block.nodes, [corners(tuple(range(block.nodes.shape[1])))])])
        one, other = one[other >= size], other[other >= size] - size
        if len(one) < len(block) or (one >= size).any():
            raise ModelError("a load acts on a face that is none of an element, or twice on one")
        k = block.nodes.shape[1]
        if (np.diff(self._start)[one] != k).any():
            raise ModelError("a load acts on faces of another degree than those of the elements")
        start = np.arange(len(block) + 1) * k
        mine, theirs = self.paired(one, other, block.nodes.ravel(), start)
        if self.inner[mine].any():
            raise ModelError("a load acts on a face between two elements; the tractions there are not known")
        total[mine] += forces.reshape(-1, 3)[theirs]


def needed_forces(sides: Sides, groups: Sequence[ElementGroup], u: Array, body: Sequence[Array]) -> Array:
    """Return ∫ σ ∇N - f N dV (e, 3) in N on the nodes of each element; `body` is f (m, k, 3) of groups."""
    points, blocks = sides.mesh.points, sides.mesh.blocks
    first = np.cumsum([0, *(block.nodes.size for block in blocks)])
    needed = np.zeros((first[-1], 3))
    for group, f in zip(groups, body, strict=True):
        number, cells = sides.cells_of(group)
        k = group.nodes.shape[1]
        rows = first[number] + cells[:, None] * k + np.arange(k)
        for chunk in group.chunks():
            element = group.at(points, chunk)
            inner = internal_load_of(element, value_at(element, group, u, chunk), group.material.C)
            needed[rows[chunk]] = inner - element.body_force(f[chunk])
    return needed


def own_tractions(sides: Sides, groups: Sequence[ElementGroup], u: Array) -> tuple[Array, Array]:
    """Return ∫ N σ n dA of the stresses of each element (h, 3) in N, and the areas (h,) of the sides."""
    points = sides.mesh.points
    forces, area = np.zeros((len(sides.node), 3)), np.zeros(len(sides.node))
    for group in groups:
        for face, where in sides.of_group(group):
            form = FACE_SHAPES[len(face)]
            N, _ = tabulate(form, face_rule(form))
            xi = N @ group.element.shape.nodes[list(face)]
            for chunk in group.chunks():
                nodes = group.nodes[chunk]
                gradient = np.einsum("mai,mgaj->mgij", u[nodes], group.at(points, chunk).dNdX(xi))
                strain = voigt.symmetric_gradient(gradient)
                stress = group.stress(strain) + group.initial_stress(chunk)
                vectors = area_vectors(form, points[nodes[:, list(face)]])
                t = np.einsum("mgij,mgj->mgi", voigt.tensor(stress), vectors)
                forces[where[chunk]] = N.T @ t
                area[where[chunk]] = np.linalg.norm(vectors, axis=-1).sum(axis=1)[:, None]
    return forces, area


def equilibrated(sides: Sides, needed: Array, guess: Array, area: Array, free: Mask) -> Array:
    """Return the outward forces (h, 3) in N on the nodes of each side that balance each element.

    Parameters
    ----------
    sides : the sides of the elements.
    needed : (e, 3) N, what the nodes of each element need.
    guess : (h, 3) N, the tractions of each side; where neither an element is behind nor `free`, the loads.
    area : (h,) m², of each side.
    free : (h, 3), where a support gives whatever force is needed.

    Raises
    ------
    ModelError
        What acts on a node is no traction or body force.
    """
    from scipy.sparse import coo_array

    h = len(sides.node)
    is_first = sides.first == np.arange(h)
    sign, half = np.where(is_first, 1.0, -1.0), np.where(sides.inner, 0.5, 1.0)
    forces = np.zeros_like(guess)
    np.add.at(forces, sides.first, (sign * half)[:, None] * guess)
    A = coo_array((sign, (sides.row, sides.first)), shape=(len(needed), h)).tocsr()
    scale = np.abs(needed).max(initial=0.0)
    for axis in range(3):
        give = np.where(is_first & (sides.inner | free[:, axis]), area, 0.0)
        left = needed[:, axis] - A @ forces[:, axis]
        forces[:, axis] += give * (A.T @ _multipliers(sides, A, give, left, scale))
    return np.asarray(sign[:, None] * forces[sides.first])


def _multipliers(sides: Sides, A: Any, give: Array, left: Array, scale: float) -> Array:
    """Return λ (e,) of A G A^T λ = left, whose blocks are the elements around one node each."""
    from scipy.sparse import diags_array
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import splu

    L = (A @ diags_array(give) @ A.T).tocsc()
    count, label = connected_components(L, directed=False)

    def summed(values: Array) -> Array:
        return np.asarray(np.bincount(label, weights=values, minlength=count), dtype=float)

    floating = summed(np.asarray(L.sum(axis=1)).ravel()) <= 1e-9 * summed(L.diagonal())
    lost = floating & (np.abs(summed(left)) > BALANCED * scale)
    if lost.any():
        row = int(np.argmax(lost[label]))
        at = np.concatenate([block.nodes.ravel() for block in sides.mesh.blocks])[row]
        raise ModelError(
            f"a force acts on node {sides.mesh.node_ids[at]} that is neither a traction nor a body force: a "
            "support of points or lines, or a load on them; fix and load whole faces of elements"
        )
    pins = np.zeros(len(left))
    pins[np.unique(label, return_index=True)[1][floating]] = give.max(initial=1.0)
    return np.asarray(splu((L + diags_array(pins)).tocsc()).solve(left))

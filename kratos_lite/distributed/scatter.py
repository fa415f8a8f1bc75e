"""Subdomains of a mesh: which nodes, elements and conditions each rank holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh import Block, Mesh, Part, with_rows
from kratos_lite.mesh.subdomain import Alone, Subdomain
from kratos_lite.typing import Ints, Mask
from kratos_lite.validation import whole_numbers

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def scattered(
    mesh: Mesh, ranks: Alone, part_of_element: ArrayLike, layers: int = 1, together: Sequence[Ints] = ()
) -> Mesh:
    """Return what this rank holds of a mesh that every rank knows whole.

    Parameters
    ----------
    mesh : the same on all ranks.
    ranks : that share it.
    part_of_element : (m,) int, the rank of each element.
    layers : of elements around the own nodes that are here, too.
    together : rows of nodes, such as those of each constraint, that are all here if one of them is own.

    Returns
    -------
    Mesh
        With the ids of the whole one; a node is own on the lowest rank that has an element at it.

    Raises
    ------
    MeshError
        There is no such rank, or the mesh has hanging nodes.

    Examples
    --------
    >>> from kratos_lite import box
    >>> from kratos_lite.mesh.subdomain import ALONE
    >>> scattered(box(), ALONE, [0]).subdomain.numbers.tolist()
    [0, 1, 2, 3, 4, 5, 6, 7]
    """
    parts = whole_numbers(part_of_element, "ranks of elements", (mesh.n_elements,), error=MeshError)
    if len(parts) and not 0 <= parts.min() <= parts.max() < ranks.size:
        raise MeshError(f"elements go to the ranks 0 … {ranks.size - 1}; got {parts.min()} … {parts.max()}")
    if mesh.hanging is not None:
        raise MeshError("a mesh with hanging nodes cannot be shared by several ranks; solve it on one")
    owner = _owners(mesh, parts, ranks.size)
    numbers = np.empty(mesh.n_nodes, dtype=np.int64)
    numbers[np.argsort(owner, kind="stable")] = np.arange(mesh.n_nodes)
    own = owner == ranks.rank
    here, elements = own, parts == ranks.rank
    for _ in range(layers):
        elements = elements | _touching(mesh.blocks, here)
        here = _nodes_of(mesh.blocks, elements, here)
    conditions = _touching(mesh.conditions, own)
    here = _nodes_of(mesh.conditions, conditions, here)
    for rows in together:
        here[rows] |= own[rows].any()
    first = np.concatenate(
        [np.zeros(0, dtype=np.int64), *(_lowest(block, owner) for block in mesh.conditions)]
    )
    share = Subdomain(
        ranks,
        owner[here],
        numbers[here],
        (parts == ranks.rank)[elements],
        (first == ranks.rank)[conditions],
    )
    return _cut(mesh, here, elements, conditions, share)


def _owners(mesh: Mesh, parts: Ints, size: int) -> Ints:
    """Return the lowest rank with an element at each node; 0 for nodes without elements."""
    owner = np.full(mesh.n_nodes, size)
    for block, at in with_rows(mesh.blocks):
        np.minimum.at(owner, block.nodes, parts[at, None])
    owner[owner == size] = 0
    return owner


def _lowest(block: Block, owner: Ints) -> Ints:
    return owner[block.nodes].min(axis=1) if len(block) else np.zeros(0, dtype=np.int64)


def _touching(blocks: tuple[Block, ...], nodes: Mask) -> Mask:
    """Return which cells have one of some nodes, through all blocks."""
    return np.concatenate([np.zeros(0, dtype=bool), *(nodes[block.nodes].any(axis=1) for block in blocks)])


def _nodes_of(blocks: tuple[Block, ...], cells: Mask, nodes: Mask) -> Mask:
    """Return some nodes and those of some cells."""
    found = nodes.copy()
    for block, at in with_rows(blocks):
        found[block.nodes[cells[at]]] = True
    return found


def _cut(mesh: Mesh, nodes: Mask, elements: Mask, conditions: Mask, share: Subdomain) -> Mesh:
    """Return the mesh of some nodes and cells; all names of blocks and parts stay."""
    kept = {"nodes": nodes, "elements": elements, "conditions": conditions}
    row = {what: np.cumsum(mask) - 1 for what, mask in kept.items()}

    def cells(blocks: tuple[Block, ...], mask: Mask) -> list[Block]:
        found = [(block.take(mask[at]), block) for block, at in with_rows(blocks)]
        return [replace(one, nodes=row["nodes"][one.nodes].astype(np.int32)) for one, _ in found]

    def part(whole: Part) -> Part:
        rows = {what: getattr(whole, what) for what in kept}
        return replace(whole, **{what: row[what][some[kept[what][some]]] for what, some in rows.items()})

    return Mesh(
        mesh.points[nodes],
        cells(mesh.blocks, elements),
        node_ids=mesh.node_ids[nodes],
        conditions=cells(mesh.conditions, conditions),
        parts={name: part(whole) for name, whole in mesh.parts.items()},
        source=mesh.source,
        subdomain=share,
    )

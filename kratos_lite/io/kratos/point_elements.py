"""Elements of one node: springs to ground and masses, from data of elements and to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kratos_lite.assembly.attached import Attached
from kratos_lite.errors import InputError, Problems
from kratos_lite.io.formats.document import Data, Document
from kratos_lite.io.names import POINT_ELEMENT
from kratos_lite.mesh import Block, ids_of, rows_of_ids
from kratos_lite.model.attachments import OnNodes

STIFFNESS, MASS = "NODAL_DISPLACEMENT_STIFFNESS", "NODAL_MASS"


def set_apart(document: Document) -> Document:
    """Return a document whose elements of one node are attached; InputError for what they cannot have."""
    mesh, points = document.mesh, [block for block in document.mesh.blocks if block.name == POINT_ELEMENT]
    if not points:
        return document
    ids, nodes = ids_of(points), np.concatenate([block.nodes[:, 0] for block in points])
    values, data = {STIFFNESS: np.zeros((len(ids), 3)), MASS: np.zeros((len(ids), 3))}, []
    problems, known = Problems(mesh.source), f"it takes {STIFFNESS} and {MASS} of ElementalData alone"
    for number in {*np.concatenate([block.properties for block in points])} & document.properties.keys():
        block = document.properties[number]
        if wrong := [name for name in block.values if name.startswith("NODAL_")]:
            text = f"{wrong[0]} of Properties {number} is unknown to {POINT_ELEMENT}: {known}"
            problems.add(text, block.line)
    for given in document.element_data:
        at = rows_of_ids(ids, given.ids)
        is_point = at >= 0
        if given.variable in values:
            values[given.variable][at[is_point]] = given.values[is_point].reshape(is_point.sum(), -1)
        elif is_point.any():
            problems.add(f"{given.variable} of {POINT_ELEMENT} is not supported: {known}", given.line)
        else:
            data.append(given)
    problems.raise_if_any()
    from scipy.sparse import csr_array, diags_array  # a quick start without such elements

    solid = ~np.isin(mesh.element_ids, ids)
    row, solids = np.cumsum(solid) - 1, [b for b in mesh.blocks if b.name != POINT_ELEMENT]
    parts = {n: replace(p, elements=row[p.elements[solid[p.elements]]]) for n, p in mesh.parts.items()}
    attached = []
    for name, value in values.items():
        if (value < 0).any():
            raise InputError(f"{POINT_ELEMENT} has {name} ≥ 0; got {value.min():g}")
        diagonal = np.zeros_like(mesh.points)
        np.add.at(diagonal, nodes, value)
        if value.any():
            attached.append(OnNodes(nodes, csr_array(diags_array(diagonal.ravel())), name == MASS))
    made = mesh.replace(blocks=solids, parts=parts)
    return replace(document, mesh=made, element_data=data, attached=attached)


def is_on_nodes(attached: Attached | None) -> bool:
    """Return whether springs and masses are on nodes alone, with nothing beside their diagonals."""
    both = () if attached is None else (attached.K, attached.M)
    return all(A.count_nonzero() == np.count_nonzero(A.diagonal()) for A in both)


def written(attached: Attached | None, blocks: list[Block], number: int) -> tuple[list[Block], list[Data]]:
    """Return elements of one node for what is on nodes, and their data."""
    if attached is None:
        return [], []
    k, m = (A.diagonal().reshape(-1, 3) for A in (attached.K, attached.M))
    nodes = np.flatnonzero((k + m).any(axis=1))
    ids, free = ids_of(blocks).max() + 1 + np.arange(len(nodes)), np.zeros(len(nodes), dtype=bool)
    data = [Data(STIFFNESS, ids, free, k[nodes]), Data(MASS, ids, free, m[nodes, 0])]
    return [Block(POINT_ELEMENT, nodes[:, None], ids, number)], data

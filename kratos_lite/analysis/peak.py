"""The largest stress: whether it lies where stresses have no limit, and the largest one away from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.analysis.fields import Fields
from kratos_lite.mesh import Mesh, mask_of
from kratos_lite.mesh.facets import reentrant_nodes
from kratos_lite.typing import Array, Mask

ACTS = 1e-6  # reaction, of the largest one, that is more than rounding


@dataclass(frozen=True)
class Peak:
    """Where stresses may have no limit, and the largest one two elements away from all such places."""

    place: str
    elsewhere: float | None = None  # in Pa; None where all elements are near

    def __str__(self) -> str:
        away = "" if self.elsewhere is None else f"; at most {self.elsewhere:.6e} Pa two of its elements away"
        return f" {self.place}, where it may grow with each refinement{away}"


def peak(result: Fields) -> Peak | None:
    """Return where the largest von Mises stress of Gauss points lies if it may have no limit there."""
    mesh, element = result.mesh, result.totals()[2]
    places = _places(result)
    place = _named(mesh, places, mask_of(element, mesh.n_elements))
    if place is None:
        return None
    near = np.logical_or.reduce([*places.values()])
    for block in mesh.blocks:
        near[block.nodes[near[block.nodes].any(axis=1)]] = True
    away = ~_touching(mesh, near)
    if not away.any():
        return Peak(place)
    points = result.field("von_mises", "gauss")
    alike = isinstance(points, np.ndarray)  # else elements have different numbers of Gauss points
    stresses = points.max(axis=1) if alike else np.array([np.max(some) for some in points])
    return Peak(place, float(stresses[away].max()))


def place_of_node(result: Fields, node: int) -> str | None:
    """Return at what a node lies, or an element beside it, if stresses may have no limit there."""
    mesh = result.mesh
    return _named(mesh, _places(result), _touching(mesh, mask_of(node, mesh.n_nodes)))


def _places(result: Fields) -> dict[str, Mask]:
    """Return the nodes (n,) at which stresses may have no limit, by what is there."""
    return {
        "at a clamped or concentrated support": clamped_nodes(result.mesh, result.reactions),
        "at a re-entrant edge": reentrant_nodes(result.mesh),
    }


def _named(mesh: Mesh, places: dict[str, Mask], elements: Mask) -> str | None:
    """Return the first of some places that elements touch."""
    return next((name for name, nodes in places.items() if (_touching(mesh, nodes) & elements).any()), None)


def clamped_nodes(mesh: Mesh, reactions: Array) -> Mask:
    """Return the nodes (n,) of faces that are held along two axes or more, and those held without a face."""
    held = np.abs(reactions) > ACTS * np.abs(reactions).max(initial=0.0)
    on_faces, clamped = np.zeros_like(held), np.zeros(mesh.n_nodes, dtype=bool)
    for block in mesh.boundary:
        axes = held[block.nodes].all(axis=1)
        for nodes in block.nodes.T:
            np.logical_or.at(on_faces, nodes, axes)
        clamped[block.nodes[axes.sum(axis=1) > 1]] = True
    return clamped | (held & ~on_faces).any(axis=1)


def _touching(mesh: Mesh, nodes: Mask) -> Mask:
    """Return the elements (m,) with any of some nodes."""
    return np.concatenate([nodes[block.nodes].any(axis=1) for block in mesh.blocks])

"""Meshes joined to one, and meshes cut along a plane."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import Block, Part
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.selection import Where
from kratos_lite.validation import instance, short

FLAT = 1e-6
"""Fraction of the size of a cut by which its nodes may be off the plane."""
COUNTED = ("nodes", "elements", "conditions")


def join(meshes: Mapping[str, Mesh]) -> Mesh:
    """Return several meshes as one, each with nodes of its own: `Structure.tie` ties them.

    Nodes, elements and conditions get new ids; each mesh is a part by its name, its parts are children.

    Parameters
    ----------
    meshes : by name.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        There is no mesh, one has hanging nodes, or they are in different units.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> mesh = kl.join({"lower": kl.box(), "upper": kl.box(origin=(0, 0, 1))})
    >>> mesh.n_nodes, sorted(mesh.parts)[:3], mesh.nodes("upper.z-").tolist()
    (16, ['lower', 'lower.x+', 'lower.x-'], [8, 10, 12, 14])
    """
    if not isinstance(meshes, Mapping) or not meshes:
        raise MeshError("meshes are joined by name, as in kl.join({'lower': mesh, 'upper': other})")
    blocks: dict[str, list[Block]] = {"blocks": [], "conditions": []}
    parts: dict[str, Part] = {}
    first = dict.fromkeys(COUNTED, 0)
    for name, mesh in meshes.items():
        instance(mesh, f"the mesh {name!r}", Mesh, "kl.box()", error=MeshError)
        if mesh.hanging is not None:
            raise MeshError(f"the mesh {name!r} has hanging nodes; join meshes before they are refined")
        counts = {what: getattr(mesh, f"n_{what}") for what in COUNTED}
        every = Part(np.arange(counts["nodes"]), np.arange(counts["elements"]))
        for child, part in {"": every, **mesh.parts}.items():
            moved = {what: getattr(part, what) + first[what] for what in COUNTED}
            parts[f"{name}.{child}" if child else name] = replace(part, **moved)
        for kind, what in (("blocks", "elements"), ("conditions", "conditions")):
            start = first[what] + 1
            for block in getattr(mesh, kind):
                ids, nodes = start + np.arange(len(block)), block.nodes + first["nodes"]
                blocks[kind].append(replace(block, nodes=nodes, ids=ids, lines=None))
                start += len(block)
        first = {what: first[what] + counts[what] for what in COUNTED}
    points = np.vstack([mesh.points for mesh in meshes.values()])
    units = {mesh.units for mesh in meshes.values()} - {"SI"} or {"SI"}  # which others replace
    if len(units) > 1:
        raise MeshError(f"meshes are joined in one set of units; got {' and '.join(sorted(units))}")
    return Mesh(points, blocks["blocks"], conditions=blocks["conditions"], parts=parts, units=units.pop())


def split(mesh: Mesh, where: Where, names: tuple[str, str] = ("cut-", "cut+")) -> Mesh:
    """Return a mesh that is cut along a plane of nodes: each side has nodes of its own, at the same places.

    Parameters
    ----------
    mesh : whose elements have faces in the plane.
    where : the nodes of the cut, as for `Mesh.nodes`; all of one component, or of some of its elements.
    names : of the parts below and above, seen along the normal whose largest component is positive; other
        parts have the nodes of both.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        The nodes are not in one plane, or elements cross it or are on one side alone.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bolt = kl.split(kl.box(cells=(1, 1, 4)), lambda X: X[:, 2] == 0.5)
    >>> bolt.n_nodes, bolt.nodes("cut+").tolist()
    (24, [20, 21, 22, 23])
    """
    instance(mesh, "a mesh", Mesh, "kl.box()", error=MeshError)
    if not isinstance(names, (tuple, list)) or len(names) != 2 or not all(isinstance(n, str) for n in names):
        raise MeshError(f"names of both sides are needed, such as ('cut-', 'cut+'); got {short(names)}")
    rows, X = mesh.nodes(where), mesh.points
    center = X[rows].sum(axis=0) / max(len(rows), 1)
    _, sizes, axes = np.linalg.svd(X[rows] - center, full_matrices=False)
    if len(rows) < 3 or sizes[1] <= FLAT * sizes[0] or sizes[2] > FLAT * sizes[0] or mesh.hanging is not None:
        raise MeshError(f"a cut needs three or more nodes in one plane, and none that hang; got {len(rows)}")
    normal = axes[2] * np.sign(axes[2, np.abs(axes[2]).argmax()])
    height, copy = (X - X[rows[0]]) @ normal, np.arange(mesh.n_nodes)
    inside, copy[rows] = np.isin(copy, rows), mesh.n_nodes + np.arange(len(rows))
    sides: set[bool] = set()
    cells: dict[str, list[Block]] = {}
    for kind in ("blocks", "conditions"):
        cells[kind] = []
        for block in getattr(mesh, kind):
            touches, d = inside[block.nodes].any(axis=1), height[block.nodes]
            if (touches & (d.min(axis=1) < -FLAT * sizes[0]) & (d.max(axis=1) > FLAT * sizes[0])).any():
                raise MeshError("elements cross the plane of the cut; it needs faces of elements on it")
            above = touches & (d.mean(axis=1) > 0)
            sides |= {*above[touches].tolist()} if kind == "blocks" else set()
            cells[kind].append(replace(block, nodes=np.where(above[:, None], copy[block.nodes], block.nodes)))
    if len(sides) < 2:
        raise MeshError("elements are on one side of the cut alone; a cut goes through a body")
    both = {
        name: replace(part, nodes=np.append(part.nodes, copy[part.nodes[inside[part.nodes]]]))
        for name, part in mesh.parts.items()
    }
    parts = {**both, names[0]: Part(rows), names[1]: Part(copy[rows])}
    ids = np.append(mesh.node_ids, mesh.node_ids.max() + 1 + np.arange(len(rows)))
    points = np.vstack([X, X[rows]])
    more: dict[str, Any] = {"conditions": cells["conditions"], "source": mesh.source, "units": mesh.units}
    return Mesh(points, cells["blocks"], node_ids=ids, parts=parts, **more)

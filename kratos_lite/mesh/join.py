"""Meshes joined to one, and meshes cut along a plane."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import Block, Part
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.validation import instance

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
        There is no mesh, or one has hanging nodes.

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
    return Mesh(points, blocks["blocks"], conditions=blocks["conditions"], parts=parts)

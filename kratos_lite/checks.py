"""Checks of a model before it is solved: geometry, names of free rigid modes, numbers.

Each check either raises one clear error or returns warnings for the report.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kratos_lite.batches import Batch
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.kinematic_linear import tabulate
from kratos_lite.errors import MAX_PROBLEMS, MeshError, ModelError
from kratos_lite.mesh import Block, Mesh
from kratos_lite.quadrature import Rule
from kratos_lite.supports import Supports, rigid_modes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
FOLD = 0.2
"""Share of the mean det J by which it may be negative at a node; two swapped nodes give 0.7 and more."""


def check_points(mesh: Mesh) -> None:
    """Raise MeshError if a coordinate is not finite."""
    bad = np.flatnonzero(~np.isfinite(mesh.points).all(axis=1))
    if len(bad):
        raise MeshError(
            f"node {mesh.node_ids[bad[0]]} has coordinates {mesh.points[bad[0]]}; they must be finite"
        )


def check_repeated_nodes(mesh: Mesh) -> None:
    """Raise MeshError if an element uses a node twice."""
    for block in mesh.blocks:
        ordered = np.sort(block.nodes, axis=1)
        bad = np.flatnonzero((np.diff(ordered, axis=1) == 0).any(axis=1))
        if len(bad):
            cell = int(bad[0])
            row = ordered[cell]
            node = mesh.node_ids[row[1:][np.diff(row) == 0][0]]
            raise MeshError(
                f"{mesh.place(block, cell)} uses node {node} more than once; "
                f"give it {block.nodes.shape[1]} different nodes or use an element with fewer"
            )


def check_jacobians(mesh: Mesh, kinds: Sequence[type[KinematicLinear]]) -> list[str]:
    """Raise MeshError for elements with det J ≤ 0 at a Gauss point or clearly < 0 at a node.

    `kinds` holds the element class of each block.  det J = 0 at a corner node alone (quarter-point
    elements) is allowed and noted; so is a slight fold at a node, at most FOLD of the mean det J,
    which badly shaped but useful elements have.
    """
    problems: list[str] = []
    count, flat, folded = 0, 0, 0
    for block, kind in zip(mesh.blocks, kinds, strict=True):
        shape, g = kind.shape, len(kind.rule)
        _, dN = tabulate(shape, kind.rule)
        dN = np.concatenate([dN, [shape.dN(xi) for xi in shape.nodes]])
        limit = np.where(np.arange(len(dN)) < g, 0.0, -FOLD)
        step = max(1, 4_000_000 // (72 * len(dN)))
        for start in range(0, len(block), step):
            det = kind(mesh.points[block.nodes[start : start + step]]).determinants(dN)
            scale = np.abs(det[:, :g]).mean(axis=1, keepdims=True)
            bad = np.where(np.arange(len(dN)) < g, det <= limit * scale, det < limit * scale)
            flat += int((np.abs(det[:, g:]) <= 1e-10 * scale).any(axis=1).sum())
            folded += int((det[:, g:] < -1e-10 * scale).any(axis=1).sum())
            for e in np.flatnonzero(bad.any(axis=1)):
                count += 1
                if len(problems) < MAX_PROBLEMS:
                    problems.append(_describe_inverted(mesh, block, start + int(e), det[e], g))
    if problems:
        more = f"\n… and {count - len(problems)} more" if count > len(problems) else ""
        raise MeshError("\n".join(problems) + more)
    notes = [f"{flat} elements have det J = 0 at a corner node (singular corner)"] if flat else []
    fold = f"{folded} elements have det J slightly < 0 at a node: they are badly shaped there and less accurate"
    return [*notes, fold] if folded else notes


def _describe_inverted(mesh: Mesh, block: Block, cell: int, det: Array, g: int) -> str:
    worst = int(np.argmin(det))
    where = f"Gauss point {worst + 1}" if worst < g else f"its node {worst - g + 1}"
    nodes = " ".join(str(i) for i in mesh.node_ids[block.nodes[cell]])
    if (det < 0).all():
        cure = "the element is turned inside out; mesh.reoriented() mends the node order"
    elif (det == 0).all():
        cure = "the element has no volume; two of its nodes may coincide"
    else:
        cure = "two of its nodes look swapped or one lies too far off"
    return f"{mesh.place(block, cell)}: det J = {det[worst]:.3g} at {where} must be > 0; nodes {nodes}; {cure}"


@lru_cache(maxsize=64)
def spurious_modes(element: type[KinematicLinear], rule: Rule) -> int:
    """Return how many zero-energy modes beyond the six rigid ones a rule leaves to the reference cell."""
    cell = element(element.nodes, rule)
    B = np.vstack([cell.B(xi) for xi in rule.points])
    values = np.linalg.svd(B, compute_uv=False)
    rank = int((values > 1e-9 * values[0]).sum())
    return 3 * len(element.nodes) - 6 - rank


def check_rules(batches: Sequence[Batch]) -> list[str]:
    """Warn of rules that leave spurious zero-energy modes."""
    found = {(b.element, b.rule) for b in batches if b.rule is not b.element.rule}
    return [
        f"{element.__name__} with {len(rule)} Gauss points has {n} spurious zero-energy modes; "
        f"its own rule has {len(element.rule)} points and none"
        for element, rule in found
        if (n := spurious_modes(element, rule)) > 0
    ]


def components(n_nodes: int, connectivity: Sequence[NDArray[np.int32]]) -> Ints:
    """Return for each node the smallest node row of its connected part (itself where unconnected)."""
    labels = np.arange(n_nodes)
    while True:
        before = labels.copy()
        for nodes in connectivity:
            smallest = labels[nodes].min(axis=1)
            np.minimum.at(labels, nodes.ravel(), np.repeat(smallest, nodes.shape[1]))
        labels = labels[labels]
        if (labels == before).all():
            return labels


def check_supports(mesh: Mesh, supports: Supports) -> None:
    """Raise ModelError that names the rigid modes which the supports leave free, part by part."""
    labels = components(mesh.n_nodes, [block.nodes for block in mesh.blocks if len(block)])
    used = mesh.used_nodes()
    roots = np.unique(labels[used])
    index = np.full(mesh.n_nodes, -1)
    index[roots] = np.arange(len(roots))
    part = np.where(used, index[labels], -1)
    row, dof, weight = supports.rows_of_constraints()
    known = part[dof // 3] >= 0
    row, dof, weight = row[known], dof[known], weight[known]
    problems = []
    for group in _linked_groups(len(roots), part, supports):
        modes = _free_modes(mesh, part, group, row, dof, weight)
        problems += _name_modes(mesh, part, group, modes)
    if problems:
        shown = "; ".join(problems[:MAX_PROBLEMS])
        raise ModelError(f"the supports leave rigid motions free: {shown}. Fix more nodes or components")


def _linked_groups(n_parts: int, part: Ints, supports: Supports) -> list[list[int]]:
    """Return the parts in groups that multi-point constraints tie together."""
    group = list(range(n_parts))
    for link in supports.links:
        ends = {int(part[d // 3]) for d in (link.slave, *link.masters)} - {-1}
        names = {group[p] for p in ends}
        if len(names) > 1:
            group = [min(names) if g in names else g for g in group]
    return [[p for p in range(n_parts) if group[p] == g] for g in sorted(set(group))]


def _free_modes(
    mesh: Mesh, part: Ints, group: list[int], row: Ints, dof: Ints, weight: Array
) -> list[tuple[Array, Array, float]]:
    """Return centre, free modes (6, k) and size of each part of a group.

    A rotation is scaled with the size of its part, so that all modes move points about as far.
    """
    columns, frames = [], []
    rows = np.unique(row[np.isin(part[dof // 3], group)])
    local = np.searchsorted(rows, row).clip(max=max(len(rows) - 1, 0))
    for p in group:
        nodes = np.flatnonzero(part == p)
        X = mesh.points[nodes]
        centre, size = X.mean(axis=0), max(float(np.ptp(X, axis=0).max()), np.finfo(float).tiny)
        mine = part[dof // 3] == p
        R = rigid_modes(mesh.points[dof[mine] // 3], centre).reshape(-1, 3, 6)
        R = R[np.arange(len(R)), dof[mine] % 3] / np.array([1, 1, 1, size, size, size])
        gram = np.zeros((len(rows), 6))
        np.add.at(gram, local[mine], R * weight[mine, None])
        columns.append(gram)
        frames.append((centre, size))
    C = np.hstack(columns)
    values, vectors = np.linalg.eigh(C.T @ C)
    free = vectors[:, values <= 1e-10 * max(float(values.max()), 1e-300)]
    if not len(rows):
        free = np.eye(C.shape[1])
    return [(centre, free[6 * i : 6 * i + 6], size) for i, (centre, size) in enumerate(frames)]


def _name_modes(
    mesh: Mesh, part: Ints, group: list[int], modes: list[tuple[Array, Array, float]]
) -> list[str]:
    """Return one sentence for each part that can still move."""
    named = []
    for p, (_, free, _) in zip(group, modes, strict=True):
        words = _motions(free)
        if words:
            nodes = np.flatnonzero(part == p)
            if len(modes) == 1 and len(np.unique(part[part >= 0])) == 1:
                who = f"the body ({len(nodes)} nodes)"
            else:
                who = f"the part of node {mesh.node_ids[nodes[0]]} ({len(nodes)} nodes)"
            named.append(f"{who} can still move: {words}")
    return named


def _motions(free: Array) -> str:
    """Name the span of free modes (6, k): translations and rotations, by axis where they are along one."""
    if not free.size or np.abs(free).max() < 1e-9:
        return ""
    U, values, _ = np.linalg.svd(free, full_matrices=False)
    span = U[:, values > 1e-6]
    rotation = np.linalg.svd(span[3:])
    turning = rotation[1] > 1e-6 if span.shape[1] else np.zeros(0, dtype=bool)
    n_turn = int(turning.sum())
    still = span @ rotation[2].T[:, n_turn:]
    words = []
    if still.shape[1]:
        words.append("translation " + _axes(still[:3]))
    if n_turn:
        words.append("rotation about " + _axes(rotation[0][:, :n_turn]))
    return "; ".join(words)


def _axes(directions: Array) -> str:
    """Name a span of directions (3, k): by letters if it is spanned by axes, else by vectors."""
    Q, _ = np.linalg.qr(directions)
    inside = (Q**2).sum(axis=1) > 1 - 1e-6
    if inside.sum() == Q.shape[1]:
        return ", ".join(letter for letter, yes in zip("xyz", inside, strict=True) if yes)
    return ", ".join("(" + " ".join(f"{c:.3g}" for c in q / np.abs(q).max()) + ")" for q in Q.T)


def check_coincident(mesh: Mesh, used: NDArray[np.bool_]) -> list[str]:
    """Warn of different nodes at the same place (1e-8 of the mean spacing apart or less)."""
    rows = np.flatnonzero(used)
    if len(rows) < 2:
        return []
    X = mesh.points[rows]
    extent = np.ptp(X, axis=0)
    spacing = float(extent.max()) / len(rows) ** (1 / 3)
    along = X @ np.array([0.5257311, 0.6180340, 0.5844215])  # no plane of a usual mesh is normal to it
    order = np.argsort(along, kind="stable")
    X, along, rows = X[order], along[order], rows[order]
    pairs: list[tuple[int, int]] = []
    tolerance = 1e-8 * spacing
    for step in range(1, min(len(rows), 64)):
        close = np.flatnonzero(along[step:] - along[:-step] <= 2 * tolerance)
        if not len(close):
            break
        near = close[(np.abs(X[close + step] - X[close]) <= tolerance).all(axis=1)]
        pairs += [(int(rows[i]), int(rows[i + step])) for i in near]
    if not pairs:
        return []
    ids = mesh.node_ids
    shown = ", ".join(f"{min(ids[a], ids[b])} and {max(ids[a], ids[b])}" for a, b in pairs[:3])
    return [f"{len(pairs)} pairs of nodes coincide ({shown}{' …' if len(pairs) > 3 else ''}); they are not joined"]


def check_scales(mesh: Mesh, batches: Sequence[Batch]) -> list[str]:
    """Warn where the numbers themselves cost accuracy: far from the origin, or very unlike stiffnesses."""
    warnings = []
    extent = float(np.ptp(mesh.points, axis=0).max())
    spacing = extent / max(1.0, mesh.n_elements ** (1 / 3))
    loss = float(np.finfo(float).eps * np.abs(mesh.points).max() / spacing) if spacing > 0 else 0.0
    if loss > 1e-9:
        warnings.append(
            f"the body lies so far from the origin that coordinates carry an error of {loss:.1e} of an "
            "element; move it to the origin"
        )
    stiff = [float(np.abs(batch.material.C).max()) for batch in batches]
    if stiff and max(stiff) > 1e10 * min(stiff):
        warnings.append(f"stiffnesses differ by a factor of {max(stiff) / min(stiff):.1e}; expect fewer digits")
    return warnings


def equilibrium(points: Array, loads: Array, reactions: Array) -> tuple[float, float]:
    """Return |sum of forces| and |sum of moments| of loads and reactions, relative to their sizes."""
    total = loads + reactions
    X = points - points.mean(axis=0)
    size = np.abs(loads).sum() + np.abs(reactions).sum()
    arm = float(np.abs(X).max(initial=0.0))
    if size == 0:
        return 0.0, 0.0
    force = float(np.abs(total.sum(axis=0)).max() / size)
    moment = float(np.abs(np.cross(X, total).sum(axis=0)).max() / (size * arm)) if arm > 0 else 0.0
    return force, moment


__all__ = [
    "check_coincident",
    "check_jacobians",
    "check_points",
    "check_repeated_nodes",
    "check_rules",
    "check_scales",
    "check_supports",
    "components",
    "equilibrium",
    "spurious_modes",
]

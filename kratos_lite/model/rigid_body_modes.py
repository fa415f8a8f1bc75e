"""Rigid-body modes: which of them the supports leave free, component by component, hinges included.

Elements that share faces move as one rigid block.  Blocks that share single nodes or an edge only are joined
there, and can turn about the joint: each is given its six rigid-body modes, and supports, constraints
and joints are the equations that these must meet.  Blocks that equations tie together are a component.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kratos_lite.assembly.sparsity_pattern import dofs_of
from kratos_lite.mesh import Mesh, components, distinct, with_rows
from kratos_lite.model.supports import Supports
from kratos_lite.solvers import direct
from kratos_lite.typing import Array, Ints

FEW = 40
"""Up to this many blocks of a component are looked at with full matrices."""
FREE = 1e-7
"""Singular value, as a fraction of the largest and of 1, the size of an equation, of a free mode at most."""
ROWS = 256
"""Equations that are orthogonalized at once, more than 6 FEW."""
SOFT = 1e-13
"""Fraction of the largest squared singular value that is added to those of many blocks."""
PASSES, PROBES = 12, 12
"""Passes that leave of a motion nothing but what is free, and motions at random that make them."""
REST = 1e-6
"""What these passes leave at most of a motion of size 1 that is not free."""


@dataclass(frozen=True, eq=False)
class RigidBlocks:
    """Sets of elements joined by faces: a node has one pair (node, block) for each block around it."""

    mesh: Mesh
    of_node: Ints  # (n,) int, the first block of each node, -1 for nodes without elements
    node: Ints  # all pairs, sorted by node
    block: Ints
    count: int

    @cached_property
    def joints(self) -> tuple[Ints, Ints, Ints]:
        """Nodes that belong to a further block, their first block, and that further one."""
        further = self.block != self.of_node[self.node]
        node = self.node[further]
        return node, self.of_node[node], self.block[further]

    @cached_property
    def frames(self) -> tuple[Array, Array]:
        """The center (b, 3) and the size (b,) of each block."""
        order = np.argsort(self.block, kind="stable")
        X, start = self.mesh.points[self.node[order]], np.flatnonzero(np.diff(self.block[order], prepend=-1))
        low, high = np.minimum.reduceat(X, start), np.maximum.reduceat(X, start)
        return (low + high) / 2, np.maximum((high - low).max(axis=1), np.finfo(float).tiny)


def rigid_blocks(mesh: Mesh) -> RigidBlocks:
    """Return the sets of elements of a mesh that are joined by faces."""
    faces = mesh.all_faces
    pairs = np.stack([faces.element[faces.one], faces.element[faces.other]], axis=1)
    block, count = np.arange(mesh.n_elements), mesh.n_elements
    while True:
        label = components(count, pairs)
        known = distinct(label)
        block, count = np.searchsorted(known, label)[block], len(known)
        blocks = _of_elements(mesh, block, count)
        if not len(pairs := _locked(blocks)):
            return blocks


def _of_elements(mesh: Mesh, of_element: Ints, count: int) -> RigidBlocks:
    """Return the blocks of the nodes from those of the elements."""
    of_node, pairs = np.full(mesh.n_nodes, -1), []
    for cells, at in with_rows(mesh.blocks):
        of_node[cells.nodes] = of_element[at, None]
    for cells, at in with_rows(mesh.blocks):
        owner = np.broadcast_to(of_element[at, None], cells.nodes.shape)
        further = of_node[cells.nodes] != owner
        pairs.append(cells.nodes[further] * np.int64(count) + owner[further])
    node = np.flatnonzero(of_node >= 0)
    node, block = np.divmod(distinct(np.concatenate([node * count + of_node[node], *pairs])), max(count, 1))
    of_node[node[::-1]] = block[::-1]
    return RigidBlocks(mesh, of_node, node, block, count)


def _locked(blocks: RigidBlocks) -> Ints:
    """Return pairs (k, 2), among many blocks, that share three nodes not in a line: neither can turn."""
    node, one, other = blocks.joints
    if blocks.count <= FEW or len(one) < 3:
        return np.zeros((0, 2), dtype=np.int64)
    key = one * blocks.count + other
    order = np.argsort(key, kind="stable")
    X, start = blocks.mesh.points[node[order]], np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(np.append(start, len(order)))
    arms = X - np.repeat(np.add.reduceat(X, start) / count[:, None], count, axis=0)
    spread = np.linalg.svd(np.add.reduceat(arms[:, :, None] * arms[:, None, :], start), compute_uv=False)
    flat = spread[:, 1] > 1e-8 * spread[:, 0]
    return np.stack([one, other], axis=1)[order[start[flat]]]


# ---- the modes that equations leave free ----------------------------------------------------------------


def free_modes(mesh: Mesh, supports: Supports) -> tuple[RigidBlocks, Ints, Ints, Array]:
    """Return the rigid blocks of a mesh, and as of `FreeMotions` components and the modes left free."""
    blocks = rigid_blocks(mesh)
    row, block, value = _equations(blocks, supports)
    order = np.argsort(row, kind="stable")
    tied = np.stack([block[order[1:]], block[order[:-1]]], axis=1)[np.diff(row[order]) == 0]
    label = components(blocks.count, tied)
    component = (np.cumsum(label == np.arange(blocks.count)) - 1)[label]
    numbers, owner = np.arange(1, int(component.max()) + 1), component[block]
    members, entries = (np.argsort(of, kind="stable") for of in (component, owner))
    split = zip(
        np.split(members, np.searchsorted(component[members], numbers)),
        np.split(entries, np.searchsorted(owner[entries], numbers)),
        strict=True,
    )
    free = [(some, _free_modes(some, row[at], block[at], value[at])) for some, at in split]
    counts = np.array([modes.shape[2] for _, modes in free], dtype=np.int64)
    modes = np.zeros((blocks.count, 6, int(counts.max(initial=0))))
    for some, own in free:
        modes[some, :, : own.shape[2]] = own
    return blocks, component, counts, modes


def _equations(blocks: RigidBlocks, supports: Supports) -> tuple[Ints, Ints, Array]:
    """Return fixed components, constraints, and the equal motion of blocks where they are joined."""
    # They are entries: the equation, the block, and what its six modes are in it, 1 at most in each equation.
    # A rotation is scaled with the size of its block, so that all modes move points about as far.
    row, dof, weight = supports.constraint_rows()
    block, first = blocks.of_node[dof // 3], int(row.max(initial=-1)) + 1
    joins = np.ones(first, dtype=bool)  # hanging nodes that hang within a block hold in each of its motions
    fixed = int(supports.fixed.sum())
    joins[fixed : fixed + len(supports.hanging)] = False
    of_row = np.zeros(first, dtype=np.int64)
    of_row[row[::-1]] = block[::-1]
    joins[row[block != of_row[row]]] = True
    kept = joins[row] & (block >= 0)
    node, *ends = blocks.joints
    joint = dofs_of(node)
    row = np.concatenate([row[kept], *[first + np.arange(len(joint))] * 2])
    dof = np.concatenate([dof[kept], joint, joint])
    weight = np.concatenate([weight[kept], np.ones(len(joint)), -np.ones(len(joint))])
    block = np.concatenate([block[kept], *(np.repeat(end, 3) for end in ends)])
    return _summed(blocks, row, block, dof, weight)


def _summed(
    blocks: RigidBlocks, row: Ints, block: Ints, dof: Ints, weight: Array
) -> tuple[Ints, Ints, Array]:
    """Return one entry of each equation and block, from terms (k,) of degrees of freedom of blocks."""
    order = np.argsort(row * np.int64(blocks.count) + block, kind="stable")
    row, dof, block, weight = row[order], dof[order], block[order], weight[order]
    (center, size), (node, axis) = blocks.frames, np.divmod(dof, 3)
    begins = np.diff(row, prepend=-1) != 0
    starts = begins | (np.diff(block, prepend=-1) != 0)
    at, largest = 6 * (np.cumsum(starts) - 1), np.abs(weight)
    value = np.bincount(at + axis, weight, 6 * int(starts.sum()))
    for further, sign in ((1, 1.0), (2, -1.0)):
        arm, turn = (axis + 3 - further) % 3, (axis + further) % 3  # e_turn × e_arm = sign · e_axis
        r = (blocks.mesh.points[node, arm] - center[block, arm]) / size[block]
        moved = weight * r
        value += np.bincount(at + 3 + turn, sign * moved, len(value))
        largest = np.maximum(largest, np.abs(moved))
    # before they are summed up, which leaves less rounding
    most = np.maximum.reduceat(largest, np.flatnonzero(begins)) if len(row) else largest
    most = np.maximum(most, np.finfo(float).tiny)[np.cumsum(begins)[starts] - 1]
    return row[starts], block[starts], value.reshape(-1, 6) / most[:, None]


def _free_modes(members: Ints, row: Ints, block: Ints, value: Array) -> Array:
    """Return the free modes (b, 6, k) of the blocks of a component under its equations."""
    row = np.searchsorted(distinct(row), row)
    column = 6 * np.searchsorted(members, block)[:, None] + np.arange(6)
    count, n = int(row.max(initial=-1)) + 1, 6 * len(members)
    if len(members) > FEW:
        free = _free_modes_of_many((value.ravel(), (np.repeat(row, 6), column.ravel())), (count, n))
    else:
        C = np.zeros((count // ROWS + 1, ROWS, n))
        np.add.at(C.reshape(-1, n), (row[:, None], column), value)
        R = np.asarray(np.linalg.qr(C, mode="r")).reshape(-1, n)  # all rows at once take fifty times as long
        _, values, directions = np.linalg.svd(np.linalg.qr(R, mode="r"))
        free = directions[values <= FREE * values.max(initial=1.0)].T
    return free.reshape(len(members), 6, -1)


def _free_modes_of_many(entries: tuple[Array, tuple[Ints, Ints]], shape: tuple[int, int]) -> Array:
    """Return motions (n, k) that span the free ones under equations (c, n), in sparse entries."""
    # Motions at random lose what the equations C resist by (C^T C + s)^-1 s, s small, again and again.
    from scipy.sparse import csr_array, eye_array

    C, n = csr_array(entries, shape=shape), shape[1]
    gram = csr_array(C.T @ C)
    small = SOFT * max(float(abs(gram).sum(axis=0).max()), 1.0)
    factors = direct.factorize(csr_array(gram + small * eye_array(n)))
    motions = np.random.default_rng(0).standard_normal((n, PROBES))
    for _ in range(PASSES):
        motions = small * np.column_stack([factors.solve(motion) for motion in motions.T])
    span, size, _ = np.linalg.svd(motions, full_matrices=False)
    return np.asarray(span[:, size > REST])

"""Rigid-body modes: which of them the supports leave free, part by part, hinges included.

Elements that share faces form a body.  Bodies that share single nodes or an edge only are joined
there, and can turn about the joint: each is given its six rigid-body modes, and supports, constraints
and joints are the equations that these must meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.mesh import Mesh, components, distinct
from kratos_lite.model.connected_bodies import FEW, Bodies, bodies
from kratos_lite.model.free_motions import FreeMotions
from kratos_lite.model.supports import Supports
from kratos_lite.solvers import direct
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.typing import Array, Ints

FREE = 1e-7
"""Singular value, as a fraction of the largest and of 1, the size of an equation, of a free mode at most."""
SOFT = 1e-13
"""Fraction of the largest squared singular value that is added to those of many bodies."""
PASSES, PROBES = 12, 12
"""Passes that leave of a motion nothing but what is free, and motions at random that make them."""
REST = 1e-6
"""What these passes leave at most of a motion of size 1 that is not free."""


def free_motions(mesh: Mesh, supports: Supports, groups: Sequence[ElementGroup]) -> FreeMotions:
    """Return the rigid motions that the supports leave free, part by part."""
    connected = bodies(mesh)
    frames = connected.frames(mesh)
    equations = _equations(mesh, connected, supports)
    group_of = _groups(len(frames[0]), equations)
    members, their_equations = _by_group(group_of, equations)
    free = [
        (_free_modes if len(group) <= FEW else _free_modes_of_many)(mesh, frames, group, some)
        for group, some in zip(members, their_equations, strict=True)
    ]
    counts = np.array([free_modes.shape[2] for free_modes in free], dtype=np.int64)
    modes = np.zeros((len(group_of), 6, int(counts.max(initial=0))))
    for group, free_modes in zip(members, free, strict=True):
        modes[group, :, : free_modes.shape[2]] = free_modes
    return FreeMotions(mesh, supports, groups, connected, frames, group_of, counts, modes)


@dataclass(frozen=True)
class _Constraints:
    """What rigid-body modes must meet, entry by entry: equation, degree of freedom, body, weight."""

    row: Ints
    dof: Ints
    body: Ints
    weight: Array

    @cached_property
    def number(self) -> Ints:
        """The equation of each entry, counted from 0 without gaps."""
        return np.searchsorted(distinct(self.row), self.row)

    def take(self, chosen: Ints) -> _Constraints:
        """Return some of the entries."""
        return _Constraints(self.row[chosen], self.dof[chosen], self.body[chosen], self.weight[chosen])


def _equations(mesh: Mesh, connected: Bodies, supports: Supports) -> _Constraints:
    """Return fixed components, constraints, and the equal motion of bodies where they are joined."""
    part, (node, second) = connected.part, connected.joints
    row, dof, weight = supports.constraint_rows()
    body = part[dof // 3]
    first = int(row.max(initial=-1)) + 1
    joins = np.ones(first, dtype=bool)  # hanging nodes that hang within a body hold in each of its motions
    fixed = int(supports.fixed.sum())
    joins[fixed : fixed + len(supports.hanging)] = False
    joins[row[body != body[row]]] = True
    kept = joins[row]
    row, dof, body, weight = row[kept], dof[kept], body[kept], weight[kept]
    joint = (3 * node[:, None] + np.arange(3)).ravel()
    rows = first + np.arange(len(joint))
    ones = np.ones(len(joint))
    row, dof = np.concatenate([row, rows, rows]), np.concatenate([dof, joint, joint])
    body = np.concatenate([body, part[joint // 3], np.repeat(second, 3)])
    weight = np.concatenate([weight, ones, -ones])
    known = body >= 0
    return _Constraints(row[known], dof[known], body[known], weight[known])


def _groups(n_bodies: int, equations: _Constraints) -> Ints:
    """Return for each body (b,) the number of its group: bodies that equations tie together."""
    order = np.argsort(equations.row, kind="stable")
    row, body = equations.row[order], equations.body[order]
    tied = (row[1:] == row[:-1]) & (body[1:] != body[:-1])
    label = components(n_bodies, np.stack([body[1:][tied], body[:-1][tied]], axis=1))
    return (np.cumsum(label == np.arange(n_bodies)) - 1)[label]


def _by_group(group_of: Ints, equations: _Constraints) -> tuple[list[Ints], list[_Constraints]]:
    """Return the bodies of each group, and its equations."""
    numbers = np.arange(1, int(group_of.max()) + 1)
    members = np.argsort(group_of, kind="stable")
    groups = np.split(members, np.searchsorted(group_of[members], numbers))
    owner = group_of[equations.body]
    order = np.argsort(owner, kind="stable")
    taken = np.split(order, np.searchsorted(owner[order], numbers))
    return groups, [equations.take(chosen) for chosen in taken]


def _free_modes(mesh: Mesh, frames: tuple[Array, Array], group: Ints, equations: _Constraints) -> Array:
    """Return the free modes (b, 6, k) of the bodies of a group under its equations.

    A rotation is scaled with the size of its body, so that all modes move points about as far.
    """
    row = equations.number
    C = np.zeros((int(row.max(initial=-1)) + 1, 6 * len(group)))
    np.add.at(C, (row[:, None], _columns(group, equations)), _on_modes(mesh, frames, equations))
    triangle = np.linalg.qr(np.vstack([C, np.zeros((C.shape[1], C.shape[1]))]), mode="r")
    _, values, directions = np.linalg.svd(triangle)
    free = directions[values <= FREE * values.max(initial=1.0)].T
    return free.reshape(len(group), 6, -1)


def _columns(group: Ints, equations: _Constraints) -> Ints:
    """Return the numbers (k, 6) of the modes of the body of each entry, in a group in ascending order."""
    return 6 * np.searchsorted(group, equations.body)[:, None] + np.arange(6)


def _on_modes(mesh: Mesh, frames: tuple[Array, Array], equations: _Constraints) -> Array:
    """Return what the six modes of its body are in each entry (k, 6), 1 at most in each equation.

    Entries are scaled before they are summed up, so that rounding, which hanging nodes leave, stays small.
    """
    node, axis = np.divmod(equations.dof, 3)
    R = rigid_modes(mesh.points[node], frames[0][equations.body]).reshape(-1, 3, 6)
    R = R[np.arange(len(R)), axis]
    R[:, 3:] /= frames[1][equations.body, None]
    R *= equations.weight[:, None]
    row = equations.number
    largest = np.zeros(int(row.max(initial=-1)) + 1)
    np.maximum.at(largest, row, np.abs(R).max(axis=1))
    return np.asarray(R / np.maximum(largest, np.finfo(float).tiny)[row, None])


def _free_modes_of_many(
    mesh: Mesh, frames: tuple[Array, Array], group: Ints, equations: _Constraints
) -> Array:
    """Return as `_free_modes` motions (b, 6, k) of the bodies of a group that span its free ones.

    Motions at random lose what the equations C resist by (C^T C + s)^-1 s, s small, again and again.
    """
    from scipy.sparse import csr_array, eye_array

    row = equations.number
    count, n = int(row.max()) + 1, 6 * len(group)
    value = _on_modes(mesh, frames, equations)
    places = np.repeat(row, 6), _columns(group, equations).ravel()
    C = csr_array((value.ravel(), places), shape=(count, n))
    gram = csr_array(C.T @ C)
    small = SOFT * max(float(abs(gram).sum(axis=0).max()), 1.0)
    factors = direct.factorize(csr_array(gram + small * eye_array(n)))
    motions = np.random.default_rng(0).standard_normal((n, PROBES))
    for _ in range(PASSES):
        motions = small * np.column_stack([factors.solve(motion) for motion in motions.T])
    span, size, _ = np.linalg.svd(motions, full_matrices=False)
    return np.asarray(span[:, size > REST].reshape(len(group), 6, -1))

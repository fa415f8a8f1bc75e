"""Ties of parts: constraints that are made anew when supports or the mesh change."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import dofs_of
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Block, Mesh, Where
from kratos_lite.model.mortar import NEAR, Cells, Mortar, mortar
from kratos_lite.solvers.constraints import Constraints
from kratos_lite.solvers.elimination import rounded
from kratos_lite.tabular import in_units
from kratos_lite.typing import Array, Csr, Ints, Mask
from kratos_lite.validation import number

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh

COVERED = 0.5
"""Least fraction of each dependent face that the other part must cover."""
HOPS = 3
"""Cells from a dependent node that is known to one that is free, at most."""
MOSTLY = 0.5
"""Fraction of the dependent nodes that are known from which all multipliers stay."""
WHOLE, SAME = 1 - 1e-6, 1e-6
"""Fraction that counts as all of a part; difference of sizes of faces that counts as none."""


class Coupling(ABC):
    """Constraints of parts, made anew when supports or the mesh change; one with its `place` replaces it."""

    title = "tie"  # for the summary
    place: Hashable  # type and nodes, or the coupling itself
    nodes_of: Sequence[Ints] = ()  # of parts that are tied to one another
    equations: Hashable = None  # what K depends on beside `place`, without constants of constraints
    moves_all: Sequence[Ints] = ()  # parts whose nodes it moves alone, which other ties leave to it

    @abstractmethod
    def constraints(self, fixed: Mask, known: Mask) -> Constraints:
        """Return the constraints; others hold those `known` (n, 3), which are fixed or dependent."""

    def _check(self, groups: Sequence[ElementGroup], motion: object) -> list[str]:
        """Return warnings of what elements and a motion of their material mean for it; raise ModelError."""
        return []

    @abstractmethod
    def refined(self, finer: RefinedMesh, supports: Any) -> Coupling:
        """Return the same on a finer mesh with supports of its own."""


class PartTie(Coupling):
    """What ties part b to part a."""

    def __init__(self, mesh: Mesh, a: Where, b: Where) -> None:
        self.mesh, self.a, self.b = mesh, a, b
        self.nodes_of = [mesh.nodes(where) for where in (a, b)]
        self.place = type(self), frozenset(nodes.tobytes() for nodes in self.nodes_of)
        both = np.intersect1d(self.nodes_of[0], self.nodes_of[1])
        if len(both):
            raise ModelError(
                f"cannot tie {PartTie.__str__(self)}: both have node {mesh.node_ids[both[0]]}, and "
                f"{len(both) - 1} more; each side needs nodes and a part of its own"
            )

    def __str__(self) -> str:
        return f"{name_of(self.a, self.nodes_of[0])} to {name_of(self.b, self.nodes_of[1])}"


def name_of(where: Where, nodes: Ints) -> str:
    """Return a part by its name, or how many nodes it has."""
    return where if isinstance(where, str) else f"{len(nodes)} nodes"


class Tie(PartTie):
    """Faces that share no nodes move alike, in the mean by mortar integrals."""

    def __init__(self, mesh: Mesh, a: Where, b: Where, tolerance: float | None = None) -> None:
        super().__init__(mesh, a, b)
        self.tolerance = None if tolerance is None else number(tolerance, "the tolerance of a tie", least=0.0)
        self.integrals = _checked(self)
        self.W = _without_gaps(self.integrals, mesh.points)

    def __str__(self) -> str:
        return f"{super().__str__()}: {len(self.integrals.nodes)} nodes depend on the others"

    def refined(self, finer: RefinedMesh, supports: Any) -> Tie:
        """Return the tie on a finer mesh."""
        return Tie(finer.mesh, finer.where(self.a), finer.where(self.b), self.tolerance)

    def constraints(self, fixed: Mask, known: Mask) -> Constraints:
        """Return them; multipliers of what is known go to neighbors, so that they still add up to 1."""
        # With R these sums it is R D (S u_a - W u) = 0, S the inverse of T, in which all that is free besides
        # S u_a of its own nodes goes to the right side.
        from scipy.sparse import csr_array, diags_array, kron

        x, one, size = self.integrals, np.eye(3), self.mesh.points.size
        dofs = dofs_of(x.nodes)
        if known.flat[dofs].mean() > MOSTLY:  # of a rigid part: few neighbors would take too many multipliers
            known = np.zeros_like(known)
        free, held = (np.flatnonzero(mask) for mask in (~known.flat[dofs], known.flat[dofs]))
        T, S, near = (csr_array(kron(A, one)) for A in (x.T, x.inverse, x.neighbors))
        step = taken = near[:, held]
        for _ in range(HOPS):
            step = near @ step @ diags_array(1.0 * (taken[free].sum(axis=0) == 0))
            taken = taken + step
        taken = taken[free]
        far = held[taken.sum(axis=0) == 0]
        far = far[abs(self.W[far]) @ ~fixed.ravel() > 0]
        if len(far):  # no neighbor takes these multipliers, so that they stay
            known = known.copy()
            known.flat[dofs[far]] = False
            return self.constraints(fixed, known)
        taken = csr_array(taken @ diags_array(1 / np.maximum(taken.sum(axis=0), 1.0)))
        own = csr_array((np.ones(len(free)), (np.arange(len(free)), free)), shape=(len(free), len(dofs)))
        gives = csr_array((np.ones(len(held)), (np.arange(len(held)), held)), shape=(len(held), len(dofs)))
        D = np.repeat(x.D, 3)
        R = csr_array((own + taken @ gives) @ diags_array(D))
        rest = R @ S - diags_array(D[free]) @ own @ S @ own.T @ own
        on_all = csr_array((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), shape=(len(dofs), size))
        rows = T[free][:, free] @ diags_array(1 / D[free]) @ (R @ self.W - rest @ on_all)
        return Constraints.of_rows(dofs[free], rounded(csr_array(rows)), np.zeros(len(free)))


def _checked(tie: Tie) -> Mortar:
    """Return the integrals over the finer part, or the other if only that is covered; ModelError if none."""
    mesh, names = tie.mesh, str(PartTie.__str__(tie))
    faces = [faces_of(mesh, where, nodes) for where, nodes in zip((tie.a, tie.b), tie.nodes_of, strict=True)]
    if mesh.hanging is not None and np.isin(mesh.hanging.nodes, np.concatenate(tie.nodes_of)).any():
        raise ModelError(f"cannot tie {names}: nodes hang there; tie them on a mesh without, and no error=")
    radius = [np.mean([Cells(block, mesh.points).radius.mean() for block in some]) for some in faces]
    order = [0, 1] if radius[0] <= (1 + SAME) * radius[1] else [1, 0]
    found: list[Mortar] = []
    for one in order:
        found.append(mortar(mesh.points, faces[one], faces[1 - one], tie.tolerance))
        if found[-1].covered >= WHOLE:
            return found[-1]
    best = max(found, key=lambda x: x.covered)
    if best.covered >= COVERED:
        return best
    gap = min(x.gap for x in found)
    limit = f"{NEAR:g} of the size of a face" if tie.tolerance is None else f"{tie.tolerance:g} m"
    why = f": some are {gap:.3g} m apart, farther than {limit}" * bool(np.isfinite(gap))
    why = in_units(why, mesh.units)
    raise ModelError(
        f"cannot tie {names}: neither covers the other{why}; tie parts of which one lies on the other, or "
        "give the distance that is to be closed, as in tolerance=1e-3"
    )


def faces_of(mesh: Mesh, where: Where, nodes: Ints) -> list[Block]:
    """Return the faces of a part; ModelError if there are none."""
    faces = [block for block in mesh.faces(where) if block.shape and block.shape.nodes.shape[1] == 2]
    if not faces:
        raise ModelError(f"cannot tie {name_of(where, nodes)}: no face has all its nodes there")
    return faces


def _without_gaps(x: Mortar, points: Array) -> Csr:
    """Return W (3d, 3n): where surfaces are apart, a rotation of the nodes of b, by least squares, adds."""
    # Then rigid motions of both leave no force behind.
    from scipy.sparse import bsr_array, csr_array, kron

    W, X = x.W, points - points.mean(axis=0)
    full, gap = csr_array(kron(W, np.eye(3))), x.inverse @ X[x.nodes] - W @ X
    if np.abs(gap).max() > 1e-9 * np.abs(X).max():
        near = csr_array(abs(W) + x.neighbors @ abs(W))  # a node opposite another alone knows no rotation
        count = np.maximum(np.diff(near.indptr), 1)
        owner = np.repeat(np.arange(len(count)), np.diff(near.indptr))
        center = np.zeros_like(gap)
        np.add.at(center, owner, X[near.indices] / count[owner, None])
        r = _cross(X[near.indices] - center[owner])
        A = np.zeros((len(count), 3, 3))
        np.add.at(A, owner, np.swapaxes(r, 1, 2) @ r)
        blocks = -(_cross(gap) @ np.linalg.pinv(A, hermitian=True))[owner] @ r
        full = csr_array(full + bsr_array((blocks, near.indices, near.indptr), shape=full.shape))
    full.eliminate_zeros()
    return full


def _cross(v: Array) -> Array:
    """Return the matrices (m, 3, 3) of v × (m, 3)."""
    return np.cross(np.eye(3), v[:, None])

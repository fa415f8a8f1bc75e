"""Ties of nodes that lie opposite one another: periodic cells, and cuts of bolts."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import dofs_of
from kratos_lite.elements.surface import area_vectors
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Mesh, Where, components
from kratos_lite.model.loads.base import Drawn, Load
from kratos_lite.model.ties import PartTie, faces_of, name_of
from kratos_lite.solvers.constraints import Constraints
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.validation import number

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh

TWICE = "cells and cuts need one node at each place; nodes {} are at one: mesh all bodies with common nodes"
FLAT = 1e-6
"""Fraction of the size of the mesh by which nodes may be off the places opposite."""


def opposite(mesh: Mesh, a: Ints, b: Ints, shift: Array | None = None) -> Ints:
    """Return the nodes (k,) of a that lie opposite those of b; ModelError if there are none.

    `shift` (3,) in m is the way from a to b, that of their lowest coordinates if not given.
    """
    from scipy.spatial import cKDTree

    X, Y = mesh.points[a], mesh.points[b]
    if len(a) and len(a) == len(b):
        way = Y.min(axis=0) - X.min(axis=0) if shift is None else shift
        apart, at = map(np.asarray, cKDTree(X + way).query(Y))
        count, near = np.bincount(at), apart.max() <= FLAT * np.ptp(mesh.extent, axis=0).max()
        if near and count.max() == 1:
            return np.asarray(a[at])
        if near:
            raise ModelError(TWICE.format(", ".join(map(str, mesh.node_ids[b[at == count.argmax()]]))))
    raise ModelError(
        "periodic boundaries and cuts need nodes that lie opposite one another; "
        f"there are {len(a)} and {len(b)}, not in the same places: mesh both faces alike, in Gmsh by "
        "Periodic Surface, in a box with bricks, as its tetrahedra may differ from face to face, and leave "
        "error= out, which may refine one face alone"
    )


class Periodic(PartTie):
    """Opposite nodes differ by a mean strain: u_b - u_a = E (x_b - x_a), for all pairs of parts together."""

    # Nodes of edges and corners are in several pairs: one node of each class stands for all.

    def __init__(self, mesh: Mesh, parts: Sequence[tuple[Where, Where]], strain: Array) -> None:
        self.mesh, self.parts, self.strain = mesh, list(parts), strain
        nodes = [[mesh.nodes(one) for one in where] for where in parts]
        self.nodes_of = [one for both in nodes for one in both]
        self.names = [" and ".join(map(name_of, *both)) for both in zip(parts, nodes, strict=True)]
        pairs = [np.stack([opposite(mesh, a, b), b], axis=1) for a, b in nodes]
        self.ways = np.array([np.subtract(*mesh.points[pair[0, ::-1]]) for pair in pairs])
        every = np.concatenate(pairs)
        if (every[:, 0] == every[:, 1]).any():
            raise ModelError("a periodic pair has one part twice; give the two opposite parts")
        self.label = components(mesh.n_nodes, every)
        self.members = np.unique(every)
        self.place, self.equations = Periodic, every.tobytes()

    def __str__(self) -> str:
        E = ", ".join(f"{value:g}" for value in self.strain.ravel())
        return f"{', '.join(self.names)} periodic, mean gradient ({E})"

    def has(self, a: Where, b: Where) -> bool:
        """Return whether two parts are a pair already."""
        new = [self.mesh.nodes(where) for where in (a, b)]
        known = zip(self.nodes_of[::2], self.nodes_of[1::2], strict=True)
        return any(all(map(np.array_equal, pair, new)) for pair in known)

    def strained(self, strain: Array) -> Periodic:
        """Return the same pairs with another mean strain (3, 3)."""
        new = copy(self)
        new.strain = strain
        return new

    def refined(self, finer: RefinedMesh, supports: Any) -> Periodic:
        """Return the pairs on a finer mesh; ModelError where its nodes are not opposite one another."""
        return Periodic(finer.mesh, [(finer.where(a), finer.where(b)) for a, b in self.parts], self.strain)

    def constraints(self, fixed: Mask, known: Mask) -> Constraints:
        """Return what ties members to the node that stands for them."""
        nodes = self.members[self.label[self.members] != self.members]
        others = self.label[nodes]
        constants = (self.mesh.points[nodes] - self.mesh.points[others]) @ self.strain.T
        return Constraints.of(
            dofs_of(nodes), dofs_of(others)[:, None], np.ones(3 * len(nodes)), constants.ravel()
        )


class Cut(PartTie):
    """Two sides of a cut move alike but for one way along its normal n, u_b - u_a = δ n: free, or -length."""

    def __init__(self, mesh: Mesh, a: Where, b: Where, length: float | None = None) -> None:
        super().__init__(mesh, a, b)
        below, self.above = self.nodes_of
        self.below = opposite(mesh, below, self.above, np.zeros(3))
        self.length, self.equations = length, (length is None, self.below.tobytes())
        areas = [area_vectors(f.known_shape, mesh.points[f.nodes]) for f in faces_of(mesh, a, self.below)]
        normal = np.sum([area.sum(axis=(0, 1)) for area in areas], axis=0)
        self.normal = normal / np.linalg.norm(normal)
        self.axis = int(np.abs(self.normal).argmax())
        self.carriers = 3 * self.below[0] + self.axis, 3 * self.above[0] + self.axis

    def __str__(self) -> str:
        how = "free along its normal" if self.length is None else f"{self.length:g} m shorter"
        return f"cut from {super().__str__()}, {how}"

    def is_pulled_by(self, load: object) -> bool:
        """Return whether a load is the force of this cut, whichever side it names first."""
        if not isinstance(load, BoltForce):
            return False
        sides = [self.mesh.nodes(where) for where in (load.a, load.b)]
        return any(all(map(np.array_equal, sides, both)) for both in (self.nodes_of, self.nodes_of[::-1]))

    def _check(self, groups: Sequence[ElementGroup], motion: object) -> list[str]:
        """Warn where displacements are large, with which the normal does not turn."""
        if self.length == 0.0 or not any(group.element.finite for group in groups):
            return []
        return [f"the {self}, keeps its normal however far the body turns: it must hardly turn there"]

    def refined(self, finer: RefinedMesh, supports: Any) -> Cut:
        """Return the cut on a finer mesh."""
        return Cut(finer.mesh, finer.where(self.a), finer.where(self.b), self.length)

    def constraints(self, fixed: Mask, known: Mask) -> Constraints:
        """Return them; δ is that of the carriers, two degrees of freedom that stay free if it is."""
        one, other = map(dofs_of, (self.above, self.below))
        n, (a, b), is_free = np.tile(self.normal, len(self.above)), self.carriers, self.length is None
        along = np.abs(n) > FLAT
        if is_free and ((fixed.flat[one] & fixed.flat[other] & along).any() or known.flat[[a, b]].any()):
            raise ModelError(f"supports or constraints hold the {self}, along it; release them")
        still, also, weight = ~(along & is_free), along & is_free & (one != b), n / self.normal[self.axis]
        constants = -(self.length or 0.0) * n[still]
        every = Constraints.of(one[still], other[still, None], np.ones(len(constants)), constants)
        independents = np.stack([other, np.full_like(other, b), np.full_like(other, a)], axis=1)[also]
        weights = np.stack([np.ones(len(weight)), weight, -weight], axis=1)[also]
        return every + Constraints.of(one[also], independents, weights, np.zeros(len(weights)))


class BoltForce(Load):
    """A force in N that pulls the two sides of a cut together."""

    unit = " [N]"

    def __init__(self, a: Where, b: Where, force: float) -> None:
        self.a, self.b, self.force = a, b, number(force, "the force of a bolt", least=-np.inf)

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N: the work of the force, on the carriers of the cut."""
        cut, total = Cut(mesh, self.a, self.b), np.zeros_like(mesh.points)
        total.flat[list(cut.carriers)] = np.array([self.force, -self.force]) / cut.normal[cut.axis]
        return total

    def drawn(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Drawn]:
        """Return what pulls each side, from both to the middle of the cut."""
        cut = Cut(mesh, self.a, self.b)
        pull = self.force * np.stack([cut.normal, -cut.normal])
        return [(np.tile(mesh.points[cut.above].mean(axis=0), (2, 1)), pull, "to")]

    def refined(self, finer: RefinedMesh) -> BoltForce:
        """Return the same force on a finer mesh."""
        return BoltForce(finer.where(self.a), finer.where(self.b), self.force)

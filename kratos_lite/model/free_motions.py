"""Free motions: the rigid ones that supports leave to components of a model, and solutions without them.

K alone resists no rigid motion R of a component that is free: K u = f has a solution where the load f does
no work on any, R^T f = 0, and then one for each rigid motion that is added.  As many displacements as there
are free motions are held, at which nothing reacts as the load balances; then the free motions are taken out
of u, which is the one with ∫ R^T u dV = 0.

Source: Farhat & Géradin, Int. J. Numer. Meth. Eng. 41 (1998) 675-696.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.errors import MAX_PROBLEMS, ModelError
from kratos_lite.mesh import Mesh, mask_of
from kratos_lite.model.rigid_body_modes import RigidBlocks, free_modes
from kratos_lite.model.supports import Supports
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.tabular import in_units
from kratos_lite.typing import Array, Ints, Mask

ROUND_OFF, OF_PLACES = 1e4, 10.0
"""Roundings that the work of a balanced load on a motion R may be, beside the sum of |f| times the largest
|R|: some for the sums over Gauss points, elements and nodes, and some for each spacing of nodes that the
component lies away from the origin, where rounded coordinates change areas and volumes."""
TOGETHER = 1e-5
"""Difference of the rotations of blocks up to which they turn as one, where modes have the size 1."""


MIDDLE = 0.01
"""What the way of a middle node counts beside that of a corner where free motions are held."""


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """Rigid motions that supports and constraints leave free, by components of a model."""

    supports: Supports
    groups: Sequence[ElementGroup]
    blocks: RigidBlocks
    of_block: Ints  # (b,) int, the component of each block: blocks that nodes or constraints tie together
    counts: Ints  # (p,) int, how many free motions each component has
    modes: Array  # (b, 6, k), what they are of the six modes of each block, 0 beyond their number

    @property
    def any(self) -> bool:
        """Whether anything is free to move."""
        return bool(self.counts.any())

    @cached_property
    def component(self) -> Ints:
        """The component of each node (n,), -1 for nodes without elements."""
        of_node = self.blocks.of_node
        return np.where(of_node >= 0, self.of_block[of_node], -1)

    @cached_property
    def _pair(self) -> tuple[Array, Array]:
        """The motions R of nodes with their components and ∫ N R dV, both (n, 3, k)."""
        # They are orthonormal over the volume of each component.
        from kratos_lite.model.loads.body import BodyForce  # rarely needed

        mesh, block, (center, size) = self.blocks.mesh, self.blocks.of_node, self.blocks.frames
        R = rigid_modes(mesh.points, center[block]).reshape(-1, 3, 6)
        R[block < 0] = 0.0
        R[..., 3:] /= size[block, None, None]
        R = R @ self.modes[block]
        numbers = np.arange(R.shape[2])
        forces = [BodyForce(R[..., i]).forces(mesh, self.groups) for i in numbers]
        over_volume = np.stack(forces, axis=2)
        gram = self._by_component(np.swapaxes(R, 1, 2) @ over_volume)
        gram[:, numbers, numbers] += numbers >= self.counts[:, None]
        normal = np.swapaxes(np.linalg.inv(np.linalg.cholesky(gram)), 1, 2)[self.component]
        return R @ normal, over_volume @ normal

    def _by_component(self, values: Array, largest: bool = False) -> Array:
        """Return sum or largest (p, ...) of values ≥ 0 at nodes (n, ...) in each component."""
        totals, used = np.zeros((len(self.counts), *values.shape[1:])), self.component >= 0
        (np.maximum if largest else np.add).at(totals, self.component[used], values[used])
        return totals

    # ---- solutions without them ----------------------------------------------------------------------

    def balanced(self, forces: Array) -> Array:
        """Return forces (n, 3) less what does work on free motions, spread as these over the volume."""
        return self._less(forces, *self._pair) if self.any else forces

    def without(self, u: Array) -> Array:
        """Return displacements (n, 3) without free motions: ∫ R^T u dV = 0 over each component."""
        return self._less(u, *self._pair[::-1]) if self.any else u

    def _less(self, values: Array, tested: Array, taken: Array) -> Array:
        factors = self._by_component(_products(tested, values))[self.component]
        return values - (taken @ factors[..., None])[..., 0]

    def basis(self) -> Array:
        """Return the free motions of all components (n, 3, k), those of each 0 elsewhere."""
        if not self.any:
            return np.zeros((*self.supports.fixed.shape, 0))
        components, numbers = np.nonzero(np.arange(self.counts.max()) < self.counts[:, None])
        return self._pair[0][..., numbers] * (self.component[:, None] == components)[:, None]

    @cached_property
    def constrained(self) -> Mask:
        """Components (n, 3), one for each free motion, that hold these firmly."""
        # Gram-Schmidt on the rows of R: each is that along which what remains of the motions goes farthest.
        # Corner nodes come first, as the coarse level of multigrid has these alone.
        chosen, component = np.zeros_like(self.supports.fixed), self.component
        if not self.any:
            return chosen
        from kratos_lite.mesh.hanging import is_corner  # a quick start where nothing is free

        mesh = self.blocks.mesh
        corner = np.where(is_corner(mesh.blocks, mesh.n_nodes), 1.0, MIDDLE)
        remaining = self._pair[0] * ~self.supports.fixed[..., None] * corner[:, None, None]
        remaining.reshape(-1, remaining.shape[2])[self.supports.dependents().dependents] = 0.0
        for step in range(remaining.shape[2]):
            size = (remaining**2).sum(axis=2)
            best = self._by_component(size.max(axis=1), largest=True)
            here = np.flatnonzero(
                (size.max(axis=1) == best[component]) & (self.counts[component] > step) & (component >= 0)
            )
            node = here[np.unique(component[here], return_index=True)[1]]
            axis = size[node].argmax(axis=1)
            chosen[node, axis] = True
            row = np.zeros((len(best), remaining.shape[2]))
            row[component[node]] = remaining[node, axis]
            along = (row / np.sqrt(np.maximum(best, np.finfo(float).tiny))[:, None])[component, None]
            remaining -= (remaining * along).sum(axis=2, keepdims=True) * along
        return chosen

    # ---- what is refused -----------------------------------------------------------------------------

    def check(
        self,
        loads: Iterable[tuple[Ints, Array]],
        moving: Mask | bool,
        cure: str = "add loads that balance them",
    ) -> None:
        """Raise ModelError where a component can still move, unless loads act on it that balance."""
        if not self.any:
            return
        points, R = self.blocks.mesh.points, self._pair[0]
        total, size = np.zeros_like(points), np.zeros((len(points), 1))
        for nodes, forces in loads:
            add_nodal(total, nodes, forces)
            add_nodal(size, nodes, np.linalg.norm(forces, axis=1, keepdims=True))
        roundoff = self._rounding * self._by_component(size[:, 0])
        limit = roundoff[:, None] * self._by_component(np.linalg.norm(R, axis=1), largest=True)
        off = (np.abs(self._by_component(_products(R, total))) > limit).any(axis=1)
        wrong = (self.counts > 0) & (off | self._is_hinged | ~np.asarray(moving))
        if not wrong.any():
            return
        text = f"the supports leave rigid-body modes free: {self.described(wrong)}"
        fix = f"Fix more nodes or components{', or tie the parts' * (self.blocks.count > 1)}"
        if not off.any():
            raise ModelError(f"{text}. {fix}")
        p = int(off.argmax())
        center, arm = (values[self.of_block == p][0] for values in self.blocks.frames)
        moment = self._by_component(np.cross(points - center, total))[p]
        force, turn = _text(self._by_component(total)[p], roundoff[p]), _text(moment, roundoff[p] * arm)
        sums = in_units(f"{force} N and {turn} N m", self.blocks.mesh.units)
        raise ModelError(
            f"{text}, and its loads do not balance: together they are {sums} about {_text(center)}. {fix}, "
            f"or {cure}"
        )

    @cached_property
    def _rounding(self) -> Array:
        """What rounding may be, as a fraction of all loads on a component, (p,)."""
        far = self._by_component(np.abs(self.blocks.mesh.points), largest=True).max(axis=1)
        size = np.zeros(len(far))
        np.maximum.at(size, self.of_block, self.blocks.frames[1])
        spacings = far / size * np.cbrt(self._by_component(np.ones(len(self.component))))
        return np.asarray(np.finfo(float).eps * (ROUND_OFF + OF_PLACES * spacings))

    @cached_property
    def _hangs(self) -> Mask:
        """Which blocks (b,) hang on nodes or edges of others."""
        return np.isin(np.arange(self.blocks.count), self.blocks.joints[1:])

    @cached_property
    def _is_hinged(self) -> Mask:
        """In which components (p,) blocks turn about joints: more likely a hole in the mesh."""
        first, size = np.unique(self.of_block, return_index=True)[1][self.of_block], self.blocks.frames[1]
        turn = self.modes[:, 3:] / size[:, None, None]
        apart = np.abs(turn - turn[first]).max(axis=(1, 2), initial=0.0) * size
        hinged = mask_of(self.of_block[self._hangs & (apart > TOGETHER)], len(self.counts))
        return hinged

    def described(self, components: Mask | bool = True) -> str:
        """Return which blocks, of some components (p,) or all, can still move, and how; the first of many."""
        chosen = np.flatnonzero(((self.counts > 0) & components)[self.of_block])
        several = np.bincount(self.of_block)[self.of_block] > 1
        _, first, count = np.unique(self.blocks.block, return_index=True, return_counts=True)
        ids = self.blocks.mesh.node_ids[self.blocks.node[first]]
        moving = ((b, words) for b in chosen.tolist() if (words := _motions(self.modes[b])))
        return "; ".join(
            f"{self._in_part(int(self.blocks.node[first[b]])) * (len(ids) > 1)}"
            f"the {'body' if len(ids) == 1 else f'component of node {ids[b]}'} ({count[b]} nodes) can still "
            f"move: {words}{' (it hangs on a node or an edge only)' * bool(several[b] & self._hangs[b])}"
            for b, words in islice(moving, MAX_PROBLEMS)
        )

    def _in_part(self, node: int) -> str:
        """Return the smallest named part with elements that a node is in, in words; "" without one."""
        mesh = self.blocks.mesh
        sizes = {
            name: len(part.nodes)
            for name, part in mesh.parts.items()
            if len(part.elements) and node in part.nodes
        }
        return f"in part {min(sizes, key=sizes.__getitem__)!r} " if sizes else ""

    def notes(self, strained: Mask) -> list[str]:
        """Return a note of the components (p,) among those strained that are free."""
        text = self.described(strained)
        return [f"{text}; its loads balance, and the displacement is without these motions"] if text else []


def free_motions(mesh: Mesh, supports: Supports, groups: Sequence[ElementGroup]) -> FreeMotions:
    """Return the rigid motions that the supports leave free, component by component."""
    return FreeMotions(supports, groups, *free_modes(mesh, supports))


def _products(R: Array, values: Array) -> Array:
    """Return R^T f (n, k) at each node."""
    return np.asarray((values[:, None] @ R)[:, 0])


def _text(values: Array, roundoff: float = 0.0) -> str:
    """Return a vector in words, without what is rounding."""
    return "(" + " ".join(f"{v:.6g}" if abs(v) > roundoff else "0" for v in values.tolist()) + ")"


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
    named = [np.round(q / np.abs(q).max(), 9) + 0.0 for q in Q.T]
    return ", ".join("(" + " ".join(f"{c:.3g}" for c in q) + ")" for q in named)

"""What connects the nodes of a deck: rigid bodies, couplings, cuts, equations, ties, springs and masses.

All but ties are equations E u = 0, also of nodes that no element uses: reference nodes, and nodes whose
displacements are the rotations of these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.assembly.sparsity_pattern import dofs_of
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.io.abaqus.materials import Axes
from kratos_lite.io.abaqus.mesh import FINITE, Cells, Geometry
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.join import split
from kratos_lite.model.attachments import OnNodes
from kratos_lite.model.loads.surface import Pressure, Traction
from kratos_lite.model.reference_nodes import followed
from kratos_lite.solvers.constraints import Constraints, rigid_modes
from kratos_lite.typing import Array, Ints


class Connections:
    """Reads the cards that connect nodes."""

    def __init__(self, geometry: Geometry, cuts: Sequence[Card]) -> None:
        self.geometry = geometry
        self.rows = list[tuple[Ints, Array]]()  # dofs (m, k) and weights of equations Σ weights u[dofs] = 0
        self.ties = list[tuple[Ints, Ints, float | None]]()
        self.springs = list[tuple[Card, Ints, Array, float]]()  # dofs (m, k), directions (m, k), N/m
        self.turning = list[tuple[Ints, Card]]()  # rotations (3,) of rigid parts
        # dofs (m,) and (k,) of reference nodes, which u = R u_k follow
        self.passed = list[tuple[Ints, Ints, Array]]()
        self.axes: Axes  # of nodes
        self._coupling: tuple[int, Card] | None = None
        for card in cuts:
            self._cut(card)

    # ---- cards -------------------------------------------------------------------------------------------

    def rigidbody(self, card: Card) -> None:
        """Read *RIGID BODY."""
        card.check_options(("NSET", "ELSET", "REFNODE", "ROTNODE"))
        if "NSET" in card.options:
            nodes = self.geometry.nodes(card.option("NSET"), card)
        else:
            elements = self.geometry.elements_of(card.option("ELSET"), card)
            nodes = self.mesh.node_rows(self.geometry.nodes_of_elements(elements))
        self._rigid(np.unique(nodes), self._node(card, "REFNODE"), [0, 1, 2], card)

    def coupling(self, card: Card) -> None:
        """Read *COUPLING; the card that follows says its kind."""
        card.check_options(("REFNODE", "SURFACE", "CONSTRAINTNAME"))
        self._coupling = self._node(card, "REFNODE"), card

    def kinematic(self, card: Card) -> None:
        """Read *KINEMATIC: nodes follow their reference node along some axes."""
        ref, of, axes = self._coupled(card)
        self._rigid(
            self.geometry.surface_nodes(of.option("SURFACE"), of),
            ref,
            [axis for axis in axes if axis < 3],
            of,
        )

    def distributing(self, card: Card) -> None:
        """Read *DISTRIBUTING: a reference node moves as the nodes of faces do in the mean, by their areas."""
        # Σ w |u - u_ref - θ × (x - x_ref)|² is least, so that forces and moments go to nodes as in CalculiX.
        ref, of, axes = self._coupled(card)
        named = [node for node, _ in self.geometry.references.values()]
        if named.count(self.mesh.node_ids[ref]) > 1:
            of.wrong("its reference node has another card, too; with *DISTRIBUTING give each one of its own")
        faces: Any = self.geometry.surface_blocks(of.option("SURFACE"), of)
        X = self.mesh.points
        w = Traction(faces, (1.0, 0.0, 0.0)).forces(self.mesh, [])[:, 0]
        nodes, some = np.flatnonzero(w), np.unique([0, 1, 2, *axes])
        R = rigid_modes(X[nodes], X[ref])
        B = R.T * np.repeat(w[nodes], 3)
        self._follow(
            self._six(of)[some], np.tile(dofs_of(nodes), (len(some), 1)), (np.linalg.pinv(B @ R) @ B)[some]
        )

    def distributingcoupling(self, card: Card) -> None:
        """Read *DISTRIBUTING COUPLING: a reference node follows nodes in the mean, by their weights."""
        card.check_options(("ELSET",))
        each = [(self.geometry.nodes(r.text(0), r), r.number(1, 1.0)) for r in card.rows()]
        nodes = np.concatenate([rows for rows, _ in each])
        w = np.concatenate([np.full(len(rows), weight) for rows, weight in each])
        for cells in self._others(card, ("DCOUP3D",)):
            for ref in dofs_of(self.mesh.node_rows(cells.nodes[:, 0])).reshape(-1, 3):
                self._follow(ref, 3 * nodes + np.arange(3)[:, None], np.tile(w / w.sum(), (3, 1)))

    def tie(self, card: Card) -> None:
        """Read *TIE."""
        card.check_options(("NAME", "POSITIONTOLERANCE", "ADJUST"))
        word = card.options.get("POSITIONTOLERANCE", "")
        tolerance = Row(card.place, (word,)).number(0) if word else None
        for row in card.rows():
            slave, master = (self.geometry.surface_nodes(row.text(i), row) for i in (0, 1))
            self.ties.append((slave, master, tolerance))  # of faces alike in size the slave depends

    def spring(self, card: Card) -> None:
        """Read *SPRING: a line of directions, which SPRINGA lacks, and a stiffness."""
        card.check_options(("ELSET",))
        rows = [row for row in card.rows() if any(row.fields)]
        for cells in self._others(card, ("SPRINGA", "SPRING1", "SPRING2")):
            nodes = self.mesh.node_rows(cells.nodes.ravel()).reshape(cells.nodes.shape)
            if len(rows) != 1 + (cells.kind != "SPRINGA"):
                card.wrong(
                    "a spring has a line of directions, which SPRINGA lacks, and a line with one stiffness"
                )
            if cells.kind == "SPRINGA":
                way = self.mesh.points[nodes[:, 1]] - self.mesh.points[nodes[:, 0]]
                way /= np.linalg.norm(way, axis=1)[:, None]
                dofs, b = dofs_of(nodes.ravel()).reshape(-1, 6), np.hstack([way, -way])
            else:
                axes = [rows[0].integer(i) - 1 for i in range(1 + (cells.kind == "SPRING2"))]
                if not set(axes) <= {0, 1, 2}:
                    rows[0].wrong("a spring has directions 1, 2, 3 of solids")
                dofs, b = 3 * nodes + axes, np.tile([1.0, -1.0][: len(axes)], (len(nodes), 1))
            self.springs.append((card, np.asarray(dofs), b, rows[-1].number(0)))

    def mass(self, card: Card) -> None:
        """Read *MASS."""
        card.check_options(("ELSET",))
        line = next(card.rows(), None) or card.wrong("a mass is needed on its data line")
        for cells in self._others(card, ("MASS",)):
            self.geometry.masses.append((cells.ids, self.mesh.node_rows(cells.nodes[:, 0]), line.number(0)))

    def equation(self, card: Card) -> None:
        """Read *EQUATION, along local axes."""
        card.check_options(())
        rows = card.rows()
        for row in rows:
            if (count := row.integer(0)) < 1:
                row.wrong(f"an equation has 1 term at least; got {count}")
            values = list[float]()
            while len(values) < 3 * count:
                line = next(rows, None) or row.wrong(f"an equation of {count} terms has {3 * count} values")
                values += [line.number(i) for i in range(len(line.fields))]
            table = np.array(values[: 3 * count]).reshape(-1, 3)
            nodes, directions = self.mesh.node_rows(table[:, 0].astype(np.int64)), table[:, 1]
            if (lost := (nodes < 0) | (table[:, 0] % 1 != 0)).any():
                row.wrong(f"there is no node {table[lost, 0][0]:g}")
            if table[0, 2] == 0:
                row.wrong("the first term has the factor 0")
            if not np.isin(directions, (1, 2, 3)).all():
                row.wrong("an equation has directions 1, 2, 3 of solids alone")
            along = self.axes.directions(self.mesh, nodes)[range(len(nodes)), directions.astype(int) - 1]
            w = table[:, 2:] * along
            order = np.argsort(-np.abs(w[0]), kind="stable")  # the first has the largest weight of its node
            dofs = 3 * nodes[:, None] + np.arange(3)
            dofs[0], w[0] = dofs[0, order], w[0, order]
            self.rows.append((dofs.reshape(1, -1), w.reshape(1, -1)))

    # ---- what they say -----------------------------------------------------------------------------------

    @property
    def mesh(self) -> Mesh:
        """The mesh of the deck."""
        return self.geometry.mesh

    def _node(self, card: Card, option: str) -> int:
        return int(self.geometry.nodes(card.option(option), card)[0])

    def _six(self, card: Card) -> Ints:
        """Return the degrees of freedom (6,) of the reference node of a card, those of its rotation last."""
        return dofs_of(self.mesh.node_rows(np.array(self.geometry.references[card.place])))

    def _coupled(self, card: Card) -> tuple[int, Card, list[int]]:
        """Return the reference node of the coupling that a card belongs to, its card, and its axes from 0."""
        if self._coupling is None:
            card.wrong("it belongs after *COUPLING")
        card.check_options(())
        axes = [
            i - 1 for row in card.rows() for i in range(row.integer(0), row.integer(1, row.integer(0)) + 1)
        ]
        if not axes or not set(axes) <= set(range(6)):
            card.wrong("its lines have the first and the last degree of freedom, of 1 … 6")
        return *self._coupling, axes

    def _others(self, card: Card, kinds: Sequence[str]) -> list[Cells]:
        """Return the elements of a card, which are no solids."""
        ids = self.geometry.elements_of(card.option("ELSET"), card)
        found = [(c, np.isin(c.ids, ids)) for c in self.geometry.others if c.kind in kinds]
        if sum(some.sum() for _, some in found) < len(ids):
            card.wrong(f"{card.option('ELSET')} has other elements than {', '.join(kinds)}")
        return [replace(c, ids=c.ids[some], nodes=c.nodes[some]) for c, some in found if some.any()]

    def _follow(self, dofs: Ints, others: Ints, weights: Array) -> None:
        """Let u[dofs] = Σ weights u[others]."""
        self.rows.append((np.column_stack([dofs, others]), np.column_stack([np.ones(len(dofs)), -weights])))

    def _rigid(self, nodes: Ints, ref: int, axes: list[int], card: Card) -> None:
        """Let nodes follow a reference node along some axes, u = u_ref + θ × (x - x_ref)."""
        six = self._six(card)
        nodes = nodes[~np.isin(nodes, six // 3)]
        some = np.isin(np.tile(range(3), len(nodes)), axes)
        R = rigid_modes(self.mesh.points[nodes], self.mesh.points[ref])[some]
        self._follow(dofs_of(nodes)[some], np.tile(six, (len(R), 1)), R)
        self.passed.append((dofs_of(nodes)[some], six, R))
        self.turning.append((six[3:], card))

    def _cut(self, card: Card) -> None:
        """Cut the mesh for *PRE-TENSION SECTION: the way between both sides is the displacement of a node."""
        card.check_options(("SURFACE", "NODE", "NAME"))
        mesh, rows = self.mesh, self.geometry.surface_nodes(card.option("SURFACE"), card)
        faces: Any = self.geometry.surface_blocks(card.option("SURFACE"), card)
        n = Pressure(faces, -1.0, normal="nodes").forces(mesh, []).sum(axis=0)
        new, copies = split(mesh, rows), mesh.n_nodes + np.arange(len(rows))
        order = np.arange(new.n_nodes)
        if n[np.abs(n).argmax()] > 0:  # as in CalculiX the elements of the surface get the copies
            order[rows], order[copies] = copies, rows
        cells = [replace(block, nodes=order[block.nodes].astype(np.int32)) for block in new.blocks]
        parts = {name: part for name, part in new.parts.items() if name not in ("cut-", "cut+")}
        self.geometry.mesh = new.replace(blocks=cells, parts=parts)
        self.geometry.twin = np.append(self.geometry.twin, rows)
        line = next(card.rows(), None)
        n = n if line is None else np.array(line.numbers(3))
        others = np.column_stack([dofs_of(rows), np.full(3 * len(rows), 3 * self._node(card, "NODE"))])
        along = np.tile(n / np.linalg.norm(n), len(rows))
        self._follow(dofs_of(copies), others, np.column_stack([np.ones(len(others)), along]))
        self.passed.append((dofs_of(copies), others[:1, 1], along[:, None]))

    def at_references(self, forces: Array) -> Array:
        """Return forces (n, 3), at reference nodes of rigid parts and cuts those of what follows these."""
        out = forces.flatten()
        for dofs, ref, R in self.passed:
            out[ref] += R.T @ forces.flat[dofs]
        return out.reshape(-1, 3)

    # ---- a model -----------------------------------------------------------------------------------------

    def connect(self, model: Model) -> None:
        """Connect the nodes of a model that has its supports."""
        if not (self.rows or self.ties or self.springs or self.geometry.masses):
            return
        from scipy.sparse import csr_array, diags_array  # half the time of a small deck

        fixed, size = model.supports.fixed.ravel(), model.mesh.points.size
        large = any(block.name in FINITE.values() for block in model.mesh.blocks)
        moves = model.supports.values.ravel() != 0
        moves = np.any([moves, *(mask.ravel() for _, mask in model.supports.motions)], axis=0)
        for rotations, card in self.turning if large else ():
            if not fixed[rotations].all() or moves[rotations].any():
                card.wrong("with NLGEOM its rotation must be held at 0, as large rotations are not supported")
        if self.rows:
            model.supports.add_constraints(self._equations())
        for slave, master, tolerance in self.ties:
            model.tie(slave, master, tolerance=tolerance)
        if self.ties:
            model.notes.append("*TIE holds in the mean over faces (mortar), in CalculiX node by node")
        model.supports.check_used()
        if not (self.springs or self.geometry.masses):
            return
        P, moved = followed(model.supports, moves.reshape(-1, 3))
        K, loose = csr_array((size, size)), np.flatnonzero(~np.repeat(self.mesh.used_nodes(), 3) & ~fixed)
        for card, dofs, b, k in self.springs:
            if large and (~fixed[dofs] & (np.abs(b) < 1 - 1e-9)).any():
                card.wrong("with NLGEOM ends of a spring must move along its line alone")
            start = np.arange(len(b) + 1) * b.shape[1]
            A = csr_array((b.ravel(), dofs.ravel(), start), shape=(len(b), size))
            some = A @ moved
            A = A @ P
            if some.any() or abs(A[:, loose]).sum() > 0:
                card.wrong("a spring ends at a node of no element that nothing holds, or that is moved")
            K = K + k * (A.T @ A)
        M = P.T @ diags_array(np.repeat(self.geometry.masses_of(), 3)) @ P
        for A, is_mass in ((K, False), (M, True)):
            if len(nodes := np.unique(A.diagonal().nonzero()[0] // 3)):
                model.add(OnNodes(nodes, csr_array(A), is_mass))

    def _equations(self) -> Constraints:
        """Return the equations: the first of each depends on the others."""
        from scipy.sparse import csr_array

        first = np.concatenate([dofs[:, 0] for dofs, _ in self.rows])
        others = np.concatenate([dofs[:, 1:].ravel() for dofs, _ in self.rows])
        weights = np.concatenate([(-w[:, 1:] / w[:, :1]).ravel() for _, w in self.rows])
        counts = np.concatenate([[0], *(np.full(len(c), c.shape[1] - 1) for c, _ in self.rows)])
        W: Any = csr_array((weights, others, np.cumsum(counts)), shape=(len(first), self.mesh.points.size))
        W.sum_duplicates()
        W.eliminate_zeros()
        return Constraints.of_rows(first, W, np.zeros(len(first)))

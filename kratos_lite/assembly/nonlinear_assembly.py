"""Constitutive laws in elements: internal forces, tangent and new states of groups whose law is not linear.

With the strain ε = B u of small displacements, or Green's strain, the law gives σ and its tangent D, and

    r_int = Σ B^T σ γ det J,    K = Σ B^T D B γ det J (+ what the stress adds to K at large displacements).

Groups whose law and strain are linear keep one stiffness matrix.  Kernels know stresses and tangents at Gauss
points alone, so that they serve every law.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup, PointStates, add_nodal, as_double, compiled
from kratos_lite.assembly.gauss_point_fields import displaced, initial_strain, internal_load, volumes
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.elements import KinematicLinear, tables
from kratos_lite.elements import total_lagrangian as lagrange
from kratos_lite.errors import MaterialError, SolveError
from kratos_lite.shapes.inverse import determinant
from kratos_lite.typing import Array, Csr

Heating: TypeAlias = "Sequence[Array | None]"
"""Temperatures (m, k) in K of the nodes of each group beyond those without strain, or None."""
States: TypeAlias = "list[PointStates | None]"
"""States of each group of elements; None where the law is linear."""
POINTS = 4000
"""Gauss points at which a law is evaluated at once: few enough for the cache."""
WINDOW_BYTES = 256_000_000
"""Memory of the tangents that are known at once."""
MODES_MAX, MODES_CONVERGED = 30, 1e-10
"""Iterations for the amplitudes of enhanced strains, and the fraction of the forces that they may miss."""


class NonlinearAssembly:
    """Internal forces, tangent and states of all elements of a model, stress-free at a displacement u0."""

    def __init__(
        self,
        points: Array,
        groups: Sequence[ElementGroup],
        pattern: Pattern,
        place: Callable[[int], str],
        u0: Array | None = None,
        springs: Csr | None = None,
    ) -> None:
        self.points, self.groups, self.pattern = as_double(points), list(groups), pattern
        self.place = place  # the words for an element in messages, of its index
        self.springs = springs
        self._u0 = np.zeros(3 * len(points)) if u0 is None else u0
        self.symmetric = all(group.material.symmetric_tangent for group in groups)
        self._linear, self._lagrange = _apart(groups)
        self._dilatations = [None if g.material.is_linear else dilatation(self.points, g) for g in groups]

    def start(self) -> States:
        """Return the states of an undeformed body; None of groups with a linear law."""
        return [None if g.material.is_linear else initial_states(self.points, g) for g in self.groups]

    @cached_property
    def _linear_part(self) -> tuple[BlockMatrix, Array]:
        """Stiffness of the linear groups, and their forces (n, 3) at rest, those of a prestress."""
        at_rest = internal_load(self.points, self._linear, np.zeros_like(self.points))
        return assemble_stiffness(self.points, self._linear, self.pattern), at_rest

    @cached_property
    def constant(self) -> BlockMatrix | None:
        """The tangent of elements that are all linear, which is always the same; None of others."""
        if not all(group.is_linear for group in self.groups):
            return None
        K = self._linear_part[0]
        if self.springs is None:
            return K
        data = K.data.copy()
        self.pattern.add_matrix(data, self.springs)
        return BlockMatrix(data, K.indices, K.indptr)

    def evaluate(
        self, u: Array, states: States, dt: float, heating: Heating = (), *, tangent: bool = True
    ) -> tuple[Array, BlockMatrix | None, States]:
        """Return internal forces (3n,) in N, tangent stiffness and new states at displacements u (3n,).

        `states` are those at the start of a step of `dt` s, `heating` is that at its end.  SolveError names
        an element that is turned inside out; MaterialError says where a law fails.
        """
        displacement, u = u, self.strained(u)
        K, at_rest = self._linear_part
        groups, large = self.groups, self._lagrange
        if any(values is not None for values in heating):
            groups = [replace(g, heating=values) for g, values in zip(groups, heating, strict=True)]
            linear, large = _apart(groups)
            at_rest = internal_load(self.points, linear, np.zeros_like(self.points))
        forces = at_rest + (K @ u.ravel()).reshape(-1, 3)
        data = K.data.copy() if tangent and self.constant is None else None
        if any(map(len, large)):
            for number, group in enumerate(large):
                if len(group):  # it looks for inverted elements
                    ElementRange(self, group, number, slice(None), u, None).strain()
            forces += finite_strain.internal_load(self.points, large, u)
            if data is not None:
                data += finite_strain.stiffness(self.points, large, self.pattern, u).data
        new: States = []
        for number, (group, state) in enumerate(zip(groups, states, strict=True)):
            parts = []
            for elements in group.chunks(WINDOW_BYTES) if state is not None else ():
                part = ElementRange(self, group, number, elements, u, data)
                before = state.take(elements)  # type: ignore[union-attr]
                add = part.add if before.modes is None else part.add_enhanced
                parts.append(add(forces, before, dt))
            new.append(_joined(parts) if parts else None)
        if self.springs is not None:
            forces += (self.springs @ displacement).reshape(-1, 3)
            if data is not None:
                self.pattern.add_matrix(data, self.springs)
        found = self.constant if data is None else BlockMatrix(data, K.indices, K.indptr)
        return forces.ravel(), found, new

    def strained(self, u: Array) -> Array:
        """Return the displacements (n, 3) that strain the body, those beyond the stress-free ones."""
        return (u - self._u0).reshape(-1, 3)


def _apart(groups: Sequence[ElementGroup]) -> tuple[list[ElementGroup], list[ElementGroup]]:
    """Return groups that are linear, and of linear laws those of large displacements; others are empty."""

    def only(wanted: Iterable[bool]) -> list[ElementGroup]:
        return [g.take(np.full(len(g), keep)) for g, keep in zip(groups, wanted, strict=True)]

    finite = (g.element.finite and g.material.is_linear for g in groups)
    return only(group.is_linear for group in groups), only(finite)


def initial_states(points: Array, group: ElementGroup) -> PointStates:
    """Return the states of a group at the beginning; a law that asks for it knows the size of elements."""
    shape = len(group), len(group.rule)
    variables = group.material.initial_state(*shape)
    if "element_length" in variables:
        variables["element_length"][...] = np.cbrt(volumes(points, group).sum(axis=1))[:, None, None]
    if "element_radius" in variables:
        X = points[group.nodes]
        radii = np.linalg.norm(X - X.mean(axis=1, keepdims=True), axis=-1).max(axis=1)
        variables["element_radius"][...] = radii[:, None, None]
    modes = np.zeros((len(group), 21)) if group.element.formulation == "enhanced" else None
    return PointStates(np.zeros((*shape, 6)), variables, modes)


def dilatation(points: Array, group: ElementGroup) -> Array | None:
    """Return what B has beyond that of gradients in each normal strain, (m, g, k, 3), or None for nothing."""
    if group.element.custom or group.element.formulation != "b_bar":
        return None
    parts = []
    for chunk in group.chunks():
        element = group.at(points, chunk)
        change = element._operator(group.material.C) - tables.strain_rows(element._gauss[1])
        parts.append(change[..., 0, :].reshape(*change.shape[:2], -1, 3))
    return np.concatenate(parts)


class ElementRange:
    """Some elements of a group at displacements u (n, 3), whose forces and stiffness are added to totals."""

    def __init__(
        self,
        assembly: NonlinearAssembly,
        group: ElementGroup,
        number: int,
        elements: slice,
        u: Array,
        data: Array | None,
    ) -> None:
        chosen = np.zeros(len(group), dtype=bool)
        chosen[elements] = True
        self.group, self.u, self.points = group.take(chosen), as_double(u), assembly.points
        self.pattern, self.number, self.elements, self.data = assembly.pattern, number, elements, data
        self.place = assembly.place
        extra = assembly._dilatations[number]
        self.dilatation = None if extra is None else np.ascontiguousarray(extra[elements])
        f_bar = self.group.element.formulation == "f_bar"
        self.kernels = None if f_bar else compiled("constitutive", self.group.element)

    def add(self, forces: Array, state: PointStates, dt: float) -> PointStates:
        """Add internal forces (n, 3) and stiffness; return the new states."""
        stress, D, variables = self._respond(state, dt)
        group = self.group
        if self.kernels:
            finite = group.element.finite
            nodes, _, dN, weights = group.tables()
            placed = self.points, nodes, dN, weights, self.u, stress
            forces += self.kernels.internal_load(*placed, self.dilatation, finite)
            if self.data is not None:
                rows = self.pattern.indptr, self.pattern.indices
                symmetric = bool(group.material.symmetric_tangent)
                self.kernels.add_stiffness(*placed, D, self.dilatation, finite, symmetric, *rows, self.data)
            return PointStates(stress, variables)
        for chunk in group.chunks():
            element, q = group.at(self.points, chunk), self.u[group.nodes[chunk]]
            tangent = None if self.data is None else D[chunk]
            nodal, K = element_system(element, group, q, stress[chunk], tangent)
            add_nodal(forces, group.nodes[chunk], nodal)
            if K is not None:
                self._scatter(chunk, K)
        return PointStates(stress, variables)

    def _scatter(self, chunk: slice, K: Array) -> None:
        """Add the matrices (m, 3, k, 3, k) of some elements."""
        assert self.data is not None
        first = self.elements.start
        place = slice(first + chunk.start, first + chunk.stop)
        self.pattern.add(self.data, self.number, place, K.transpose(0, 2, 4, 1, 3))

    def _respond(self, state: PointStates, dt: float) -> tuple[Array, Array, dict[str, Array]]:
        """Return stresses (m, g, 6), tangents and internal variables, a few elements at a time."""
        strain, tangent = self.strain() + initial_strain(self.group), self.data is not None
        m, g = strain.shape[:2]
        stress, D = np.empty_like(strain), np.empty((m, g, 6, 6) if tangent else 0)
        variables = {name: np.empty_like(values) for name, values in state.variables.items()}
        for first in range(0, m, max(1, POINTS // g)):
            some = slice(first, first + max(1, POINTS // g))
            stress[some], found, new = self._evaluate(some, strain[some], state, dt, tangent)
            if tangent:
                D[some] = found
            for name, values in new.items():
                variables[name][some] = values
        return stress, D, variables

    def _evaluate(
        self, some: slice, strain: Array, state: PointStates, dt: float, tangent: bool = True
    ) -> tuple[Array, Array, dict[str, Array]]:
        """Return the response of the law for some elements; an error of it names one that has it alone."""
        variables, rows = state.take(some).variables, self.group.rows[some]

        def evaluate(at: Any) -> tuple[Array, Array, dict[str, Array]]:
            now = {name: values[at] for name, values in variables.items()}
            return self.group.material.evaluate(strain[at], now, dt, tangent=tangent)

        try:
            return evaluate(...)
        except (MaterialError, SolveError):
            for i, j in np.ndindex(strain.shape[:2]):
                try:
                    evaluate(np.s_[i : i + 1, j : j + 1])
                except (MaterialError, SolveError) as error:
                    raise type(error)(f"{self.place(int(rows[i]))}, Gauss point {j + 1}: {error}") from None
            raise

    def strain(self) -> Array:
        """Return ε = B u, or Green's strain, (m, g, 6); SolveError for elements turned inside out."""
        group = self.group
        if not group.element.finite:
            if module := compiled("gauss", group.element):
                return module.stress(*displaced(self.points, group, self.u, stress=False))
            C = group.material.C
            parts = [group.at(self.points, c).strain(self.u[group.nodes[c]], C) for c in group.chunks()]
            return np.concatenate(parts)
        if self.kernels:
            nodes, _, dN, weights = group.tables()
            green = self.kernels.green(self.points, nodes, dN, weights, self.u)
            strain, det = green[..., :6], green[..., 6]
        else:
            found = []
            for c in group.chunks():
                element, q = group.at(self.points, c), self.u[group.nodes[c]]
                F = np.eye(3) + lagrange.displacement_gradient(element, q)
                found.append((lagrange.green_strain(element, q), determinant(F)))
            strain, det = (np.concatenate(values) for values in zip(*found, strict=True))
        if not (det > 0).all():
            at, point = np.argwhere(~(det > 0))[0]
            where = f"{self.place(int(group.rows[at]))}, Gauss point {point + 1}"
            raise SolveError(f"{where}: the element is turned inside out, det F ≤ 0")
        return strain

    def add_enhanced(self, forces: Array, state: PointStates, dt: float) -> PointStates:
        """Do the same with enhanced strains G α, whose amplitudes α satisfy ∫ G^T σ dV = 0."""
        parts, initial = [], initial_strain(self.group)
        for chunk in self.group.chunks():
            element, q = self.group.at(self.points, chunk), self.u[self.group.nodes[chunk]]
            B, G = tables.strain_rows(element._gauss[1]), element._modes(element.rule.points)  # type: ignore[attr-defined]
            strain = (B @ q.reshape(len(q), 1, -1, 1))[..., 0]
            strain += initial[chunk] if isinstance(initial, np.ndarray) else initial
            part, D = self._relaxed(chunk, strain, G, element.dV, state, dt)
            parts.append(part)
            nodal = tables.summed(B, part.stress[..., None], element.dV)
            add_nodal(forces, self.group.nodes[chunk], nodal.reshape(len(q), -1, 3))
            if self.data is not None:
                n, both = B.shape[-1], np.concatenate([B, G], axis=-1)
                K = tables.summed(both, D @ both, element.dV)
                K = K[:, :n, :n] - K[:, :n, n:] @ _of_modes(K[:, n:, n:], K[:, n:, :n])
                self._scatter(chunk, tables.by_axis(K))
        return _joined(parts)

    def _relaxed(
        self, chunk: slice, strain: Array, G: Array, dV: Array, state: PointStates, dt: float
    ) -> tuple[PointStates, Array]:
        """Return states and tangents of a chunk at strains (m, g, 6) and the α that Newton's method finds."""
        before, left = state.take(chunk), np.arange(len(strain))
        variables = {name: np.empty_like(values) for name, values in before.variables.items()}
        alpha, D = before.modes.copy(), np.empty((*strain.shape, 6))  # type: ignore[union-attr]
        found = PointStates(np.empty_like(strain), variables, alpha)
        for _ in range(MODES_MAX):
            stress, tangent, new = self._evaluate(
                chunk.start + left, strain + (G @ alpha[left][:, None, :, None])[..., 0], state, dt
            )
            found.stress[left], D[left] = stress, tangent
            for name, values in new.items():
                variables[name][left] = values
            h, size = (
                tables.summed(g, s[..., None], dV) for g, s in ((G, stress), (np.abs(G), np.abs(stress)))
            )
            off = (np.abs(h) > MODES_CONVERGED * size.max(axis=1, keepdims=True)).any(axis=(1, 2))
            if not off.any():
                return found, D
            left, strain, G, dV = left[off], strain[off], G[off], dV[off]
            alpha[left] -= _of_modes(tables.summed(G, tangent[off] @ G, dV), h[off])[..., 0]
        raise SolveError(f"enhanced strains do not converge in {MODES_MAX} iterations; take smaller steps")


def _of_modes(A: Array, b: Array) -> Array:
    """Return A⁻¹ b of the stiffness A of enhanced modes; SolveError if it is singular."""
    try:
        return np.asarray(np.linalg.solve(A, b), dtype=float)
    except np.linalg.LinAlgError:
        raise SolveError("the law does not resist enhanced strains; take b_bar") from None


def element_system(
    element: KinematicLinear, group: ElementGroup, q: Array, s: Array, D: Array | None = None
) -> tuple[Array, Array | None]:
    """Return forces (m, k, 3) of stresses and, of a tangent, matrices (m, 3, k, 3, k) of some elements."""
    if element.formulation == "f_bar":
        return lagrange.f_bar(element, q, s, D)
    if element.finite:
        F = np.eye(3) + lagrange.displacement_gradient(element, q)
        at = lagrange.Deformation(F, s, F, 1.0, 1.0)
        K = None if D is None else lagrange.stiffness_by_axis(element, D, at)
        return lagrange.internal_force(element, at), K
    C, B = group.material.C, element._operator(group.material.C)
    K = None if D is None else tables.by_axis(tables.summed(B, D @ B, element.dV))
    return element.internal_force(s, C), K


def internal_forces(points: Array, groups: Sequence[ElementGroup], u: Array) -> Array:
    """Return ∫ B^T σ dV (n, 3) in N of the stresses that groups show at displacements u (n, 3)."""
    total = internal_load(points, [g for g in groups if g.is_linear], u)
    total += finite_strain.internal_load(points, [g for g in groups if not g.is_linear and not g.states], u)
    for group in groups:
        for chunk in group.chunks() if group.states else ():
            element, q, s = group.at(points, chunk), u[group.nodes[chunk]], group.states.stress[chunk]  # type: ignore[union-attr]
            add_nodal(total, group.nodes[chunk], element_system(element, group, q, s)[0])
    return total


def _joined(parts: Sequence[PointStates]) -> PointStates:
    """Return the states of parts of a group as one."""
    if len(parts) == 1:
        return parts[0]
    names = parts[0].variables
    variables = {name: np.concatenate([part.variables[name] for part in parts]) for name in names}
    modes: Any = None if parts[0].modes is None else np.concatenate([part.modes for part in parts])
    return PointStates(np.concatenate([part.stress for part in parts]), variables, modes)


def named(states: States) -> dict[str, Array]:
    """Return copies of states by names with the numbers of their groups."""
    values: dict[str, Array] = {}
    for i, state in enumerate(states):
        if state is not None:
            values[f"stress_{i}"] = state.stress.copy()
            values |= {f"{name}_of_{i}": value.copy() for name, value in state.variables.items()}
            if state.modes is not None:
                values[f"modes_{i}"] = state.modes.copy()
    return values


def unnamed(values: Mapping[str, Array], like: States) -> States:
    """Return the states that `named` gave, of groups as those of other states."""
    return [
        state
        and PointStates(
            values[f"stress_{i}"].copy(),
            {name: values[f"{name}_of_{i}"].copy() for name in state.variables},
            None if state.modes is None else values[f"modes_{i}"].copy(),
        )
        for i, state in enumerate(like)
    ]

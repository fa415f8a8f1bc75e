"""Energy of the difference between stresses in equilibrium and those of the elements, element by element.

In each element under its loads and equilibrated tractions, the displacement e whose stress is lacking solves

    a(e, v) = ∫ t v dA + ∫ f v dV - ∫ σ : ∇v dV        for all v.

σ + C ∇e is in equilibrium, so that the sum of the energies of e is an upper bound of the error.  Complete
polynomials of the reference coordinates take the place of all v.

Sources: Prager & Synge, Quart. Appl. Math. 5 (1947) 241-269; Ladevèze & Pelle, Mastering Calculations in
Linear and Nonlinear Mechanics (2005), chapter 2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.tables import tabulate
from kratos_lite.quadrature import rule_for
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.typing import Array

RAISED = 3
"""Degrees of the polynomials above that of the element."""
RIGID = 1e-10
"""Share of the diagonal that holds rigid-body motions, which loads in equilibrium do not excite."""
BYTES = 2e7
"""Memory of the matrices computed at once."""
PAIRS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Voigt component of each component of a tensor."""


class Polynomials:
    """All monomials of the reference coordinates up to a degree, but for the constant.

    >>> Polynomials(2, np.zeros(3)).values(np.ones((1, 3))).shape
    (1, 9)
    """

    def __init__(self, degree: int, center: Array) -> None:
        every = range(degree + 1)
        powers = [(i, j, k) for i in every for j in every for k in every if 0 < i + j + k <= degree]
        self.powers, self.center = np.array(powers), center

    def values(self, xi: Array) -> Array:
        """Return the values (g, q) at points (g, 3)."""
        return np.prod((xi - self.center)[:, None] ** self.powers, axis=-1)

    def derivatives(self, xi: Array) -> Array:
        """Return the derivatives (g, q, 3) at points (g, 3)."""
        x = (xi - self.center)[:, None]
        lower = [np.maximum(self.powers - axis, 0) for axis in np.eye(3, dtype=int)]
        each = [self.powers[:, axis] * np.prod(x ** lower[axis], axis=-1) for axis in range(3)]
        return np.stack(each, axis=-1)


def lacking_energies(
    points: Array,
    group: ElementGroup,
    u: Array,
    body: Array,
    sides: Sequence[tuple[tuple[int, ...], Array]],
) -> Array:
    """Return twice the energy of e (m,) in J of the elements of a group.

    Parameters
    ----------
    points, u : (n, 3) m.
    group : the elements.
    body : (m, k, 3) N/m³, nodal forces per volume.
    sides : each face of the cell, with the equilibrated forces (m, k, 3) in N on its nodes.
    """
    degree = group.element.shape.degree + RAISED
    center = group.element.shape.nodes[: group.element.shape.corners].mean(axis=0)
    basis = Polynomials(degree, center)
    q = 3 * len(basis.powers)
    parts = [
        _energies(
            points, group, u, body[chunk], [(face, f[chunk]) for face, f in sides], chunk, basis, degree
        )
        for chunk in _chunks(len(group), max(1, int(BYTES / (8 * q * q))))
    ]
    return np.concatenate(parts)


def _chunks(count: int, step: int) -> Iterator[slice]:
    return (slice(start, min(start + step, count)) for start in range(0, count, step))


def _energies(
    points: Array,
    group: ElementGroup,
    u: Array,
    body: Array,
    sides: Sequence[tuple[tuple[int, ...], Array]],
    chunk: slice,
    basis: Polynomials,
    degree: int,
) -> Array:
    shape, X = group.element.shape, points[group.nodes[chunk]]
    rule = rule_for(shape.cell, 2 * degree - 1)
    N, dN = tabulate(shape, rule)
    J = np.einsum("mai,gaj->mgij", X, dN)
    inverse, dV = np.linalg.inv(J), np.linalg.det(J) * rule.weights
    gradients = basis.derivatives(rule.points) @ inverse
    moved = np.einsum("mai,mgaj->mgij", u[group.nodes[chunk]], dN @ inverse)
    stress = group.stress(voigt.symmetric_gradient(moved)) + group.initial_stress(chunk)
    load = basis.values(rule.points).T @ ((N @ body) * dV[..., None])
    load -= (gradients @ (voigt.tensor(stress) * dV[..., None, None])).sum(axis=1)
    for face, forces in sides:
        load += _side_load(shape.nodes[list(face)], forces, basis, degree)
    m, g, q, _ = gradients.shape
    G = (gradients * np.sqrt(dV)[..., None, None]).transpose(0, 3, 2, 1).reshape(m, 3 * q, g)
    H = (G @ np.swapaxes(G, 1, 2)).reshape(m, 3, q, 3, q)
    C = group.material.C[PAIRS[:, :, None, None], PAIRS]
    K = np.einsum("ikjl,mkalb->maibj", C, H, optimize=True).reshape(m, 3 * q, 3 * q)
    K[:, np.arange(3 * q), np.arange(3 * q)] *= 1 + RIGID
    r = load.reshape(m, 3 * q, 1)
    return np.asarray((r * np.linalg.solve(K, r)).sum(axis=(1, 2)))


def _side_load(xi: Array, forces: Array, basis: Polynomials, degree: int) -> Array:
    """Return ∫ t v dA (m, q, 3) of t dA = Σ N c dξ dη with the moments `forces` (m, k, 3), on the face at xi.

    On a bilinear face that is not plane n dA is such a polynomial: tractions of constant stresses are exact.
    """
    shape = FACE_SHAPES[len(xi)]
    rule = rule_for(shape.cell, 2 * degree)
    N, _ = tabulate(shape, rule)
    weighted = N * rule.weights[:, None]
    return (basis.values(N @ xi).T @ weighted @ np.linalg.inv(N.T @ weighted)) @ forces

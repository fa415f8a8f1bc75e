"""Quadrature: for each cell a rule that has at least a given degree."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from math import sqrt

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.quadrature import gauss
from kratos_lite.typing import Array
from kratos_lite.validation import whole_number

MAX_DEGREE = 40
"""Of the rules that there are."""


@dataclass(frozen=True, eq=False)
class Rule:
    """A quadrature rule: sum of weights · f(points) is exact for polynomials up to `degree`.

    Attributes
    ----------
    points : (g, d) float, Gauss points xi in the reference cell.
    weights : (g,) float, weights gamma; they sum to the volume of the reference cell.
    degree : total degree of the polynomials that are integrated exactly.
    name : where the rule comes from.

    Examples
    --------
    >>> from kratos_lite.quadrature import hexahedron
    >>> sum(gamma for xi, gamma in hexahedron(degree=3))
    8.0
    >>> hexahedron(degree=1)[0]
    (array([0., 0., 0.]), 8.0)
    """

    points: Array
    weights: Array
    degree: int
    name: str = "own"

    def __post_init__(self) -> None:
        for array in (self.points, self.weights):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.weights)

    def __iter__(self) -> Iterator[tuple[Array, float]]:
        return iter(zip(self.points, self.weights.tolist(), strict=True))

    def __getitem__(self, g: int) -> tuple[Array, float]:
        """Return point (d,) and weight of number g; raise InputError for a number without a point."""
        g = whole_number(g, "the number of a Gauss point", least=0, most=len(self) - 1)
        return self.points[g], float(self.weights[g])

    def __repr__(self) -> str:
        return f"Rule({self.name}: {len(self)} points, degree {self.degree})"


def _points_for(degree: int) -> int:
    """Return how many Gauss points one direction needs for `degree`."""
    return _checked(degree) // 2 + 1


def _checked(degree: int) -> int:
    """Return a degree; raise InputError unless it is a whole number from 0 to 40."""
    return whole_number(degree, "the degree of a rule", least=0, most=MAX_DEGREE)


def _orbits(d: int, orbits: Sequence[tuple[float, tuple[float, ...]]]) -> tuple[Array, Array]:
    """Return all permutations of barycentric points with their weights (fraction of the volume)."""
    points, weights = [], []
    for weight, barycentric in orbits:
        orbit = sorted(set(permutations(barycentric)))
        points += [p[1:] for p in orbit]
        weights += [weight] * len(orbit)
    return np.array(points), np.array(weights) / (6 if d == 3 else 2)


def _gauss_product(degree: int, d: int) -> Rule:
    """Return the Gauss-Legendre product on [-1, 1]^d."""
    n = _points_for(degree)
    return Rule(*gauss.tensor_product(n, d), 2 * n - 1, f"Gauss-Legendre {'x'.join([str(n)] * d)}")


@lru_cache
def point(degree: int = 0) -> Rule:
    """Return the one-point rule of a point."""
    return Rule(np.zeros((1, 0)), np.ones(1), 99, "point")


@lru_cache
def line(degree: int) -> Rule:
    """Return the Gauss-Legendre rule on [-1, 1].

    Parameters
    ----------
    degree : 0 … 40; n points have 2 n - 1.

    Returns
    -------
    Rule
    """
    return _gauss_product(degree, 1)


@lru_cache
def quadrilateral(degree: int) -> Rule:
    """Return the Gauss-Legendre product on [-1, 1]^2.

    Parameters
    ----------
    degree : 0 … 40; n² points have 2 n - 1 in each direction.

    Returns
    -------
    Rule
    """
    return _gauss_product(degree, 2)


@lru_cache
def hexahedron(degree: int) -> Rule:
    """Return the Gauss-Legendre product on [-1, 1]^3.

    Parameters
    ----------
    degree : 0 … 40; n³ points have 2 n - 1 in each direction.

    Returns
    -------
    Rule

    Examples
    --------
    >>> [len(hexahedron(degree)) for degree in (1, 3, 5)]
    [1, 8, 27]
    """
    return _gauss_product(degree, 3)


@lru_cache
def triangle(degree: int) -> Rule:
    """Return a symmetric rule on the unit triangle (1, 3, 6 or 7 points), conical above degree 5.

    Source: Dunavant, Int. J. Numer. Meth. Eng. 21 (1985) 1129-1148; closed forms after Radon
    (degree 5) and Lyness & Jespersen (degree 4).

    Parameters
    ----------
    degree : 0 … 40; total, of r and s together.

    Returns
    -------
    Rule
    """
    if _checked(degree) <= 1:
        return Rule(*_orbits(2, [(1.0, (1 / 3,) * 3)]), 1, "centroid")
    if degree <= 2:
        return Rule(*_orbits(2, [(1 / 3, (2 / 3, 1 / 6, 1 / 6))]), 2, "Strang-Fix 3")
    if degree <= 4:
        pairs: list[tuple[float, tuple[float, ...]]] = []
        for s in (1, -1):
            a = (8 - sqrt(10) + s * sqrt(38 - 44 * sqrt(2 / 5))) / 18
            w = (620 + s * sqrt(213125 - 53320 * sqrt(10))) / 3720
            pairs.append((w, (1 - 2 * a, a, a)))
        return Rule(*_orbits(2, pairs), 4, "Dunavant 6")
    if degree <= 5:
        orbits: list[tuple[float, tuple[float, ...]]] = [(9 / 40, (1 / 3,) * 3)]
        for s in (1, -1):
            a = (6 + s * sqrt(15)) / 21
            orbits.append(((155 + s * sqrt(15)) / 1200, (1 - 2 * a, a, a)))
        return Rule(*_orbits(2, orbits), 5, "Radon 7")
    n = _points_for(degree)
    return Rule(*gauss.conical_simplex(n, 2), 2 * n - 1, f"conical {n}x{n}")


@lru_cache
def tetrahedron(degree: int) -> Rule:
    """Return a rule on the unit tetrahedron: 1, 4, 8, 15 points, conical above degree 5.

    All weights are positive.  Source: Stroud, Approximate Calculation of Multiple Integrals
    (1971): T3:2-1, conical product, T3:5-1.

    Parameters
    ----------
    degree : 0 … 40; total, of r, s and t together.

    Returns
    -------
    Rule
    """
    if _checked(degree) <= 1:
        return Rule(*_orbits(3, [(1.0, (1 / 4,) * 4)]), 1, "centroid")
    if degree <= 2:
        a = (5 - sqrt(5)) / 20
        return Rule(*_orbits(3, [(1 / 4, (1 - 3 * a, a, a, a))]), 2, "Stroud T3:2-1")
    if degree in (4, 5):
        c = (10 - 2 * sqrt(15)) / 40
        orbits: list[tuple[float, tuple[float, ...]]] = [
            (16 / 135, (1 / 4,) * 4),
            (10 / 189, (c, c, 1 / 2 - c, 1 / 2 - c)),
        ]
        for s in (1, -1):
            a = (7 - s * sqrt(15)) / 34
            orbits.append(((2665 + s * 14 * sqrt(15)) / 37800, (1 - 3 * a, a, a, a)))
        return Rule(*_orbits(3, orbits), 5, "Stroud T3:5-1")
    n = _points_for(degree)
    return Rule(*gauss.conical_simplex(n, 3), 2 * n - 1, f"conical {n}x{n}x{n}")


@lru_cache
def wedge(degree: int) -> Rule:
    """Return the product of a triangle rule and a Gauss-Legendre rule on t in [-1, 1].

    Parameters
    ----------
    degree : 0 … 40; of the triangle, and along t.

    Returns
    -------
    Rule
    """
    return _prism(triangle(degree), line(degree))


def _prism(base: Rule, height: Rule) -> Rule:
    """Return the product of a rule on the triangle and one on the line."""
    points = [(*rs, t) for t in height.points[:, 0] for rs in base.points]
    weights = np.outer(height.weights, base.weights).ravel()
    return Rule(np.array(points), weights, min(base.degree, height.degree), f"{base.name} x {height.name}")


@lru_cache
def pyramid(degree: int) -> Rule:
    """Return the conical product on the pyramid with base [-1, 1]^2 at z = 0 and apex at z = 1.

    Parameters
    ----------
    degree : 0 … 40; n³ points have 2 n - 1.

    Returns
    -------
    Rule
    """
    n = _points_for(degree)
    ab, w = gauss.tensor_product(n, 2)
    z, v = gauss.jacobi(n, 2)
    points = [(a * (1 - h), b * (1 - h), h) for h in z for a, b in ab]
    return Rule(np.array(points), np.outer(v, w).ravel(), 2 * n - 1, f"conical {n}x{n}x{n}")


CELLS: dict[str, Callable[[int], Rule]] = {
    "point": point,
    "line": line,
    "triangle": triangle,
    "quadrilateral": quadrilateral,
    "tetrahedron": tetrahedron,
    "hexahedron": hexahedron,
    "wedge": wedge,
    "pyramid": pyramid,
}
"""Rules by the name of the reference cell."""


def rule_for(cell: str, degree: int) -> Rule:
    """Return the rule of a cell with at least this degree.

    Parameters
    ----------
    cell : its name, such as ``"tetrahedron"``.
    degree : 0 … 40.

    Returns
    -------
    Rule

    Raises
    ------
    InputError
        There is no such cell or degree.

    Examples
    --------
    >>> len(rule_for("tetrahedron", 2))
    4
    """
    if cell not in CELLS:
        raise InputError(f"there are no rules for cell {cell!r}; cells are {', '.join(CELLS)}")
    return CELLS[cell](_checked(degree))


def by_order(cell: str, order: int) -> Rule:
    """Return the rule that INTEGRATION_ORDER 1 … 5 asks for.

    Tetrahedra: degree = order.  Wedges: three points in each of `order` layers.  Hexahedra and
    pyramids: `order` points in each direction, degree 2·order - 1.

    Parameters
    ----------
    cell : its name, such as ``"wedge"``.
    order : 1 … 5.

    Returns
    -------
    Rule

    Raises
    ------
    InputError
        There is no such cell or order.
    """
    if order not in (1, 2, 3, 4, 5):
        raise InputError(f"INTEGRATION_ORDER must be 1 … 5; got {order}")
    if cell == "wedge":
        return _prism(triangle(2), line(2 * order - 1))
    return rule_for(cell, order if cell == "tetrahedron" else 2 * order - 1)

"""Checks of quadrature rules: volume of the cell, degree by monomials, points inside."""

from __future__ import annotations

from itertools import product
from math import factorial

import numpy as np

from kratos_lite.quadrature import CELLS, Rule
from kratos_lite.shapes.inverse import outside_by
from kratos_lite.testing.report import ConformanceError, Finding, Measured, run, run_after, worst
from kratos_lite.typing import Array

VOLUME = {
    "point": 1.0, "line": 2.0, "triangle": 1 / 2, "quadrilateral": 4.0,
    "tetrahedron": 1 / 6, "hexahedron": 8.0, "wedge": 1.0, "pyramid": 4 / 3,
}  # fmt: skip
"""Volume of each reference cell (length of the line, area of the faces)."""

DIMENSION = {"point": 0, "line": 1, "triangle": 2, "quadrilateral": 2}
"""Dimension of the cells that are not solids."""

SOLID_OVER = {"point": "hexahedron", "line": "hexahedron", "quadrilateral": "hexahedron", "triangle": "wedge"}
"""Solid whose section through 0 is the flat cell."""

MAX_POINTS, MAX_DEGREE = 1000, 20
"""Most points and highest degree of a rule that the kit checks: far more than any element needs."""

CellRule = tuple[str, Rule]


def check_rule(cell: str, rule: Rule) -> list[Finding]:
    """Check a quadrature rule of a reference cell.

    Parameters
    ----------
    cell : name of the cell, such as ``tetrahedron``.
    rule : the rule; all monomials up to ``rule.degree`` are integrated.

    Returns
    -------
    list of Finding, one for each of the checks ``sizes weights monomials points inside``.

    Examples
    --------
    >>> from kratos_lite.quadrature import tetrahedron
    >>> [finding.passed for finding in check_rule("tetrahedron", tetrahedron(degree=2))]
    [True, True, True, True]
    """
    first = run((sizes,), (cell, rule))
    return first + run_after(first, (weights, monomials, points_inside), (cell, rule))


def exponents(d: int, degree: int) -> list[tuple[int, ...]]:
    """Return the exponents of all monomials in d variables up to a total degree."""
    return [e for e in product(range(degree + 1), repeat=d) if sum(e) <= degree]


def monomial(e: tuple[int, ...]) -> str:
    """Return a monomial as text."""
    letters = [f"{x}^{n}" if n > 1 else x for x, n in zip("rst", e, strict=False) if n]
    return " ".join(letters) or "1"


def integral(cell: str, e: tuple[int, ...]) -> float:
    """Return the integral of a monomial over a reference cell, in closed form."""
    # Simplex: Dirichlet, a! b! c! / (a + b + c + 3)!; pyramid: sections are squares of half side 1 - z.
    if cell == "wedge":
        return integral("triangle", e[:2]) * integral("line", e[2:])
    if cell in ("triangle", "tetrahedron"):
        return float(np.prod([float(factorial(n)) for n in e])) / factorial(sum(e) + len(e))
    if cell == "pyramid":
        m = e[0] + e[1] + 2
        return integral("quadrilateral", e[:2]) * factorial(m) * factorial(e[2]) / factorial(m + e[2] + 1)
    return float(np.prod([(1 + (-1) ** n) / (n + 1) for n in e]))


def sizes(subject: CellRule) -> Measured:
    """Check for points (g, d) and weights (g,), all finite, on a cell that is known, not too many."""
    cell, rule = subject
    if cell not in CELLS:
        raise ConformanceError(f"cell {cell!r} is not known; cells are {', '.join(CELLS)}")
    d, g = DIMENSION.get(cell, 3), len(rule.weights)
    if g > MAX_POINTS or (d and rule.degree not in range(MAX_DEGREE + 1)):
        text = f"the rule has {g} points and the degree {rule.degree}; rules are checked up to {MAX_POINTS} "
        text += f"points and degree {MAX_DEGREE}: an element needs a few dozen points, as {cell}(degree=4)"
        return Measured(1, 0, text)
    good = rule.points.shape == (g, d) and rule.weights.shape == (g,) and g > 0
    finite = bool(np.isfinite(rule.points).all() and np.isfinite(rule.weights).all())
    found = f"points {rule.points.shape}, weights {rule.weights.shape}"
    return Measured(float(not (good and finite)), 0, f"{found}; expected (g, {d}) and (g,), finite")


def weights(subject: CellRule) -> Measured:
    """Check that the weights sum to the volume of the cell."""
    cell, rule = subject
    total, volume = float(rule.weights.sum()), VOLUME[cell]
    text = f"the weights sum to {total:.17g}; the volume is {volume:.17g}"
    return Measured(abs(total / volume - 1), 1e-13, text)


def monomials(subject: CellRule) -> Measured:
    """Check all monomials up to the degree that the rule claims, relative to ∫ |monomial|."""
    cell, rule = subject
    powers = exponents(rule.points.shape[1], rule.degree)
    values = np.ones((len(powers), len(rule.points)))  # of each monomial at each point
    for x, n in zip(rule.points.T, np.array(powers, dtype=int).T, strict=True):
        values *= (x ** np.arange(rule.degree + 1)[:, None])[n]
    found, exact = values @ rule.weights, np.array([integral(cell, e) for e in powers])
    size = np.maximum(np.abs(values) @ np.abs(rule.weights), np.abs(exact)).clip(min=1e-300)
    error, i = worst(dict(enumerate(np.abs(found - exact) / size)))
    text = f"∫ {monomial(powers[i])} gives {found[i]:.17g}; exact is {exact[i]:.17g}"
    return Measured(error, 1e-13, f"{text} (degree claimed: {rule.degree})")


def points_inside(subject: CellRule) -> Measured:
    """Check that no point lies outside the cell."""
    cell, rule = subject
    solid = np.zeros((len(rule.points), 3))
    solid[:, : rule.points.shape[1]] = rule.points
    outside = outside_by(SOLID_OVER.get(cell, cell), solid)
    g = int(np.argmax(outside))
    return Measured(
        max(0.0, float(outside[g])), 0, f"point {g} at {at_point(rule.points[g])} lies furthest out"
    )


def at_point(xi: Array) -> str:
    """Return a point with all its digits, for a point may lie outside by the last one."""
    return "(" + ", ".join(f"{x:.17g}" for x in xi.tolist()) + ")"

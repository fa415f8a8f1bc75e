"""Quadrature: products of Gauss-Legendre points, collapsed ones for triangles, tetrahedra and pyramids.

The stiffness of a distorted cell is a rational function, so that its value belongs to a rule.  These are the
rules that the elements state; mass and body forces take a product of a degree at which they are exact.
"""

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import leggauss


def jacobi(n, alpha):
    """Return n points and weights for ∫_0^1 f(x) (1 - x)^alpha dx: the roots of its orthogonal polynomial."""
    x, w = leggauss(n + alpha + 2)
    x, w = (1 + x) / 2, w / 2 * ((1 - x) / 2) ** alpha
    previous, p = Polynomial([0.0]), Polynomial([1.0])
    before = 1.0
    for _ in range(n):
        size = (w * p(x) ** 2).sum()
        previous, p = p, Polynomial([-(w * x * p(x) ** 2).sum() / size, 1.0]) * p - size / before * previous
        before = size
    points = p.roots().real
    points = points - p(points) / p.deriv()(points)
    moments = np.array([(w * x**k).sum() for k in range(n)])
    return points, np.linalg.solve(np.vander(points, n, increasing=True).T, moments)


def product(*lines):
    """Return the product of rules on lines: points (g, d) and weights (g,)."""
    points = np.stack(np.meshgrid(*[x for x, _ in lines], indexing="ij"), axis=-1).reshape(-1, len(lines))
    weights = np.prod(np.meshgrid(*[w for _, w in lines], indexing="ij"), axis=0).ravel()
    return points, weights


def square(n):
    return product(leggauss(n), leggauss(n))


def cube(n):
    return product(leggauss(n), leggauss(n), leggauss(n))


def triangle(n):
    (p, w) = product(jacobi(n, 1), jacobi(n, 0))
    return np.column_stack([p[:, 0], p[:, 1] * (1 - p[:, 0])]), w


def tetrahedron(n):
    (p, w) = product(jacobi(n, 2), jacobi(n, 1), jacobi(n, 0))
    x, y = p[:, 0], p[:, 1] * (1 - p[:, 0])
    return np.column_stack([x, y, p[:, 2] * (1 - p[:, 0]) * (1 - p[:, 1])]), w


def pyramid(n):
    (p, w) = product(jacobi(n, 2), leggauss(n), leggauss(n))
    return np.column_stack([p[:, 1:] * (1 - p[:, :1]), p[:, 0]]), w


def prism(base, n):
    (p, v), (t, w) = base, leggauss(n)
    return np.array([(*xy, z) for z in t for xy in p]), np.array([a * b for b in w for a in v])


THREE = np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.full(3, 1 / 6)
"""Degree 2 on the triangle; Strang & Fix."""


def six():
    """Return degree 4 on the triangle: two orbits of three points, weights from the moments; Dunavant."""
    a, b = 0.445948490915964886318, 0.091576213509770743460
    points = np.array([p for c in (a, b) for p in ((c, c), (1 - 2 * c, c), (c, 1 - 2 * c))])
    u, v = 0.223381589678011465944, 0.109951743655321867723
    return points, np.repeat([u, v], 3) / 2


def four():
    """Return degree 2 on the tetrahedron."""
    a = (5 - 5**0.5) / 20
    return np.array([[a, a, a], [1 - 3 * a, a, a], [a, 1 - 3 * a, a], [a, a, 1 - 3 * a]]), np.full(4, 1 / 24)


STIFFNESS = {
    4: (np.full((1, 3), 0.25), np.array([1 / 6])),
    10: four(),
    8: cube(2),
    20: cube(3),
    27: cube(3),
    6: prism(THREE, 2),
    15: prism(six(), 3),
    5: pyramid(2),
    13: pyramid(3),
}
"""The rule of each element for stiffness and stress."""
MASS = {n: cube(5) for n in (8, 20, 27)} | {n: pyramid(5) for n in (5, 13)}
MASS |= {n: tetrahedron(5) for n in (4, 10)} | {n: prism(triangle(5), 5) for n in (6, 15)}
"""Exact for N N det J of every geometry."""
FACE = {3: THREE, 6: triangle(4), 4: square(2), 8: square(4), 9: square(4)}
"""The rule of each face; the area of a face that is not plane is a root, whose value belongs to a rule."""

"""Shape functions as combinations of monomials that are 1 at one node and 0 at the others.

A monomial is x^a y^b z^c (1 - z)^d with d = 0, or -1 in pyramids, whose apex lies at z = 1.
"""

from itertools import product

import numpy as np

TET = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
PYRAMID = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)]
WEDGE = [(0, 0, -1), (1, 0, -1), (0, 1, -1), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
BRICK = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
TRIANGLE = [(0, 0), (1, 0), (0, 1)]
SQUARE = [(-1, -1), (1, -1), (1, 1), (-1, 1)]

TET_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
PYRAMID_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)]
WEDGE_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3)]
BRICK_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)]

TET_FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
PYRAMID_FACES = [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
WEDGE_FACES = [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
BRICK_FACES = [(0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)]

EDGES = {
    4: [],
    5: [],
    6: [],
    8: [],
    10: TET_EDGES,
    13: PYRAMID_EDGES,
    15: WEDGE_EDGES,
    20: BRICK_EDGES,
    27: BRICK_EDGES,
}
FACES = {4: TET_FACES, 5: PYRAMID_FACES, 6: WEDGE_FACES, 8: BRICK_FACES}
FACES |= {10: TET_FACES, 13: PYRAMID_FACES, 15: WEDGE_FACES, 20: BRICK_FACES, 27: BRICK_FACES}
CORNERS = {4: TET, 5: PYRAMID, 6: WEDGE, 8: BRICK, 10: TET, 13: PYRAMID, 15: WEDGE, 20: BRICK, 27: BRICK}


def middles(points, groups):
    """Return points followed by the middle of each group of them."""
    points = np.array(points, dtype=float)
    return np.array([*points, *(points[list(group)].mean(axis=0) for group in groups)])


def nodes_of(kind):
    """Return the nodes of the reference cell of a solid with `kind` nodes, in the order of Kratos."""
    nodes = middles(CORNERS[kind], EDGES[kind])
    return middles(nodes, [*BRICK_FACES, range(8)]) if kind == 27 else nodes


def powers(most, dimensions=3):
    return [p for p in product(range(3), repeat=dimensions) if max(p) <= most]


def total(most, dimensions=3):
    return [p for p in product(range(3), repeat=dimensions) if sum(p) <= most]


MONOMIALS = {
    4: total(1),
    10: total(2),
    8: powers(1),
    20: [p for p in powers(2) if p.count(2) <= 1],
    27: powers(2),
    6: [(*p, c) for p in total(1, 2) for c in (0, 1)],
    15: [(*p, c) for p in total(2, 2) for c in (0, 1)] + [(*p, 2) for p in total(1, 2)],
    5: [*total(1), (1, 1, 0, -1)],
    13: [*total(2), (1, 1, 0, -1), (2, 1, 0, -1), (1, 2, 0, -1)],
}
PLANE = {
    3: (TRIANGLE, total(1, 2)),
    6: (middles(TRIANGLE, [(0, 1), (1, 2), (2, 0)]), total(2, 2)),
    4: (SQUARE, powers(1, 2)),
    8: (middles(SQUARE, [(0, 1), (1, 2), (2, 3), (3, 0)]), [p for p in powers(2, 2) if p != (2, 2)]),
    9: (middles(SQUARE, [(0, 1), (1, 2), (2, 3), (3, 0), range(4)]), powers(2, 2)),
}
"""Faces by their number of nodes: nodes and monomials."""


def factors(monomials, xi):
    """Return exponents (m, 4) and x, y, z, 1 - z at points (g, 4)."""
    x = np.column_stack([xi, np.zeros((len(xi), 3 - xi.shape[1]))])
    return [(*m, *(0,) * (4 - len(m))) for m in monomials], np.column_stack([x, 1 - x[:, 2]])


def values(monomials, xi):
    """Return each monomial at points (g, d) as (g, m).

    At an apex 1/(1 - z) counts as 0: x y / (1 - z) tends to 0 within a pyramid.
    """
    full, x = factors(monomials, xi)
    inverse = np.divide(1.0, x[:, 3], out=np.zeros(len(x)), where=x[:, 3] != 0)
    return np.array([np.prod(x[:, :3] ** np.array(m[:3]), axis=1) * (inverse if m[3] else 1) for m in full]).T


def slopes(monomials, xi):
    """Return the derivatives of each monomial at points (g, d) as (g, m, d); not at an apex."""
    full, x = factors(monomials, xi)
    df = np.zeros((len(x), len(full), 3))
    for j, m in enumerate(full):
        for i in range(4):
            if m[i]:
                lower = np.array([float(n - (k == i)) for k, n in enumerate(m)])
                df[:, j, min(i, 2)] += (1 if i < 3 else -1) * m[i] * np.prod(x**lower, axis=1)
    return df[:, :, : xi.shape[1]]


def functions(nodes, monomials, xi):
    """Return N (g, n) and dN (g, n, d) at points (g, d)."""
    to_nodal = np.linalg.inv(values(monomials, np.array(nodes, dtype=float)))
    return values(monomials, xi) @ to_nodal, np.einsum("gmd,mn->gnd", slopes(monomials, xi), to_nodal)


def solid(kind, xi):
    """Return N and dN of a solid with `kind` nodes."""
    return functions(nodes_of(kind), MONOMIALS[kind], xi)


def plane(kind, xi):
    """Return N and dN of a face with `kind` nodes."""
    return functions(*PLANE[kind], xi)


def faces_of(kind, cell):
    """Return the faces of a cell, corners first, counter-clockwise from outside, as tuples of node rows."""
    found = []
    for number, corners in enumerate(FACES[kind]):
        face = [cell[c] for c in corners]
        pairs = zip(corners, (*corners[1:], corners[0]), strict=True)
        if EDGES[kind]:
            at = {frozenset(edge): len(CORNERS[kind]) + e for e, edge in enumerate(EDGES[kind])}
            face += [cell[at[frozenset(pair)]] for pair in pairs]
        if kind == 27:
            face.append(cell[20 + number])
        found.append(tuple(int(node) for node in face))
    return found

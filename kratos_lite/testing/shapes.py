"""Checks of shapes: N and dN against each other and against theory, edges, faces and node orders."""

from __future__ import annotations

import numpy as np

from kratos_lite.shapes import LINEAR, Shape
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.testing.report import ConformanceError, Finding, Measured, at, run, run_after, worst
from kratos_lite.testing.rules import exponents, monomial
from kratos_lite.typing import Array

VTK = {
    "tetrahedron": {4: 10, 10: 24},
    "pyramid": {5: 14, 13: 27, 19: 37},
    "wedge": {6: 13, 12: 31, 15: 26, 18: 32},
    "hexahedron": {8: 12, 20: 25, 24: 33, 27: 29},
}
"""VTK cell type number by cell and number of nodes.  Source: vtkCellType.h."""

MAX_NODES, MAX_DEGREE = 200, 9
"""Largest shape that the kit checks."""


def check_shape(shape: type[Shape]) -> list[Finding]:
    """Check a shape: its functions, their derivatives, its edges, faces and node orders.

    Parameters
    ----------
    shape : the class; it is evaluated point by point, so that only the check ``broadcasting``
        fails if N or dN take one point at a time.

    Returns
    -------
    list of Finding

    Examples
    --------
    >>> from kratos_lite.shapes.wedges import Wedge15
    >>> all(finding.passed for finding in check_shape(Wedge15))
    True
    """
    first = run((definition,), shape)
    return first if problems(shape) else first + check_functions(shape)


def check_functions(shape: type[Shape]) -> list[Finding]:
    """Check a shape whose definition is sound; what follows from wrong functions is not run."""
    first = run(BASIC, shape)
    return first + run_after(first, DEPENDENT, shape) + run(DATA, shape)


def definition(shape: type[Shape]) -> Measured:
    """Check that the class states its cell, nodes, corners, degree and VTK number as they must be."""
    wrong = problems(shape) or unsaved(shape)
    text = f"{shape.__name__} {'; '.join(wrong) or 'is stated well'}"
    return Measured(np.inf if wrong else 0, 0, text)


def problems(shape: type[Shape]) -> list[str]:
    """Return what is wrong with the data of a shape that stands in its class; stop at what hides the rest."""
    missing = [name for name in ("cell", "nodes", "corners", "degree") if not hasattr(shape, name)]
    if missing:
        return [f"states no {', '.join(missing)}: see docs/howto/own-element.md"]
    if shape.cell not in LINEAR:
        return [f"has the cell {shape.cell!r}; cells are {', '.join(LINEAR)}"]
    ideal, n = LINEAR[shape.cell].nodes, len(shape.nodes)
    d, c = ideal.shape[1], len(ideal)
    if shape.nodes.ndim != 2 or shape.nodes.shape[1] != d or not c <= n <= MAX_NODES:
        return [f"has nodes {shape.nodes.shape}; a {shape.cell} has ({c} to {MAX_NODES}, {d})"]
    wrong = []
    if shape.corners != c:
        wrong.append(f"says corners = {shape.corners}; a {shape.cell} has {c}")
    elif not (np.sort(distances(shape.nodes[:c], ideal), axis=1)[:, :1] == 0).all():
        wrong.append(f"has first nodes that are not the corners {ideal.tolist()} of the {shape.cell}")
    if shape.degree not in range(MAX_DEGREE + 1):
        wrong.append(f"says degree = {shape.degree}; an integer from 0 to {MAX_DEGREE} is needed")
    lists = [*shape.edges, *shape.faces]
    if any(a not in range(n) for nodes in lists for a in nodes):
        wrong.append(f"lists nodes in edges or faces that are not 0 to {n - 1}")
    return wrong


def unsaved(shape: type[Shape]) -> list[str]:
    """Return what keeps results of a solid shape from being saved, though the shape itself is sound."""
    known = VTK.get(shape.cell, {}).get(len(shape.nodes))
    if known in (None, shape.vtk):
        return []
    return [f"says vtk = {shape.vtk}: results cannot be saved with it; write vtk = {known} in the shape"]


def distances(X: Array, Y: Array) -> Array:
    """Return the largest coordinate difference of each point of X (n, d) to each of Y (m, d), as (n, m)."""
    return np.abs(X[:, None] - Y).max(axis=2, initial=0.0)


def inside(shape: type[Shape], count: int) -> Array:
    """Return seeded points at no symmetric place of a cell, of two digits, as messages show them."""
    corners = shape.nodes[: shape.corners]
    weights = np.random.default_rng(7).dirichlet(np.ones(len(corners)), count)
    return (weights @ corners).round(2)


def values(shape: type[Shape], points: Array) -> Array:
    """Return N at points (p, d) as (p, n), evaluated one by one."""
    return _one_by_one(shape, "N", points, shape.nodes.shape[:1])


def gradients(shape: type[Shape], points: Array) -> Array:
    """Return dN at points (p, d) as (p, n, d), evaluated one by one."""
    return _one_by_one(shape, "dN", points, shape.nodes.shape)


def _one_by_one(shape: type[Shape], function: str, points: Array, expected: tuple[int, ...]) -> Array:
    rows = [np.asarray(getattr(shape, function)(xi), dtype=float) for xi in points]
    for row, xi in zip(rows, points, strict=True):
        if row.shape != expected:
            raise ConformanceError(f"{function} at xi = {at(xi)} has shape {row.shape}; expected {expected}")
    return np.array(rows)


def at_once(shape: type[Shape], points: Array) -> tuple[Array, Array]:
    """Return N (p, n) and dN (p, n, d) at points (p, d), for checks that follow `broadcasting`."""
    return np.asarray(shape.N(points), dtype=float), np.asarray(shape.dN(points), dtype=float)


def derivatives(shape: type[Shape]) -> Measured | str:
    """Check that dN equals the differences of N, sixth order, at unsymmetric points."""
    points, d, h = inside(shape, 12), shape.nodes.shape[1], 1e-3
    if d == 0:
        return "a point has no direction to differentiate in"
    given, numeric = gradients(shape, points), np.zeros((len(points), *shape.nodes.shape))
    for j in range(d):
        for k, factor in ((1, 45), (2, -9), (3, 1)):
            step = k * h * np.eye(d)[j]
            change = values(shape, points + step) - values(shape, points - step)
            numeric[..., j] += factor * change / (60 * h)
    miss, limit = np.abs(given - numeric), 1e-9
    p, a, j = (int(i) for i in np.unravel_index(int(np.argmax(miss)), miss.shape))
    text = f"dN[{a}] / d {'rst'[j]} at xi = {at(points[p])}: "
    text += f"dN gives {given[p, a, j]:.6g}, differences of N give {numeric[p, a, j]:.6g}"
    bad = [
        f"dN[{b}] / d {'rst'[k]}" for b, k in np.argwhere(~(miss.max(axis=0) <= limit)) if (b, k) != (a, j)
    ]
    if bad:
        text += f"; also {', '.join(bad[:6])}" + (f" and {len(bad) - 6} more" if len(bad) > 6 else "")
    return Measured(float(miss[p, a, j]), limit, text)


def broadcasting(shape: type[Shape]) -> Measured:
    """Check that N and dN of points (2, 3, d) give (2, 3, n) and (2, 3, n, d), the same as one by one."""
    points = inside(shape, 6)
    many = points.reshape(2, 3, -1)
    errors: dict[str, float] = {}
    for name, table in (("N", values), ("dN", gradients)):
        expected = table(shape, points)
        values_of_many = np.asarray(getattr(shape, name)(many), dtype=float)
        wanted = (2, 3, *expected.shape[1:])
        if values_of_many.shape != wanted:
            raise ConformanceError(
                f"{name} of points {many.shape} has shape {values_of_many.shape}; expected {wanted}"
            )
        errors[name] = float(np.abs(values_of_many - expected.reshape(wanted)).max(initial=0.0))
    error, name = worst(errors)
    return Measured(error, 1e-14, f"{name} of points {many.shape} against that of single points")


def kronecker(shape: type[Shape]) -> Measured:
    """Check that N_a is 1 at its own node and 0 at the others."""
    N = values(shape, shape.nodes)
    miss = np.abs(N - np.eye(len(N)))
    b, a = np.unravel_index(int(np.argmax(miss)), miss.shape)
    text = f"N[{a}] at node {b} {at(shape.nodes[b])} is {N[b, a]:.6g}; expected {float(a == b):g}"
    return Measured(float(miss[b, a]), 1e-14, text)


def partition_of_unity(shape: type[Shape]) -> Measured:
    """Check that the functions sum to 1 and their derivatives to 0."""
    points = np.vstack([inside(shape, 40), shape.nodes])
    N, dN = at_once(shape, points)
    functions, slopes = np.abs(N.sum(axis=1) - 1), np.abs(dN.sum(axis=1)).max(axis=1, initial=0.0)
    miss = np.maximum(functions, slopes)
    p = int(np.argmax(miss))
    text = f"at xi = {at(points[p])}: sum N = 1 is off by {functions[p]:.3g}, sum dN = 0 by {slopes[p]:.3g}"
    return Measured(float(miss[p]), 1e-14, text)


def reproduction(shape: type[Shape]) -> Measured:
    """Check that polynomials up to the degree of the shape, no higher ones, come back from nodal values."""
    error, text = worst(_misses(shape, exponents(shape.nodes.shape[1], shape.degree)))
    limit, more = 1e-14, shape.degree + 1
    higher = [e for e in exponents(shape.nodes.shape[1], more) if sum(e) == more]
    if error <= limit and higher and worst(_misses(shape, higher))[0] <= 1e-9:
        text = f"the functions span degree {more} completely; write degree = {more}"
        return Measured(1, 0, f"{text} (degree claimed: {shape.degree})")
    return Measured(error, limit, f"{text} (degree claimed: {shape.degree})")


def _misses(shape: type[Shape], powers: list[tuple[int, ...]]) -> dict[str, float]:
    """Return how far each monomial, interpolated from nodal values, and its slopes are off, and where."""
    points, d = inside(shape, 40), shape.nodes.shape[1]
    N, dN = at_once(shape, points)
    errors: dict[str, float] = {}
    for e in powers:
        power = np.array(e, dtype=int)
        nodal = np.prod(shape.nodes**power, axis=1)
        miss = np.abs(N @ nodal - np.prod(points**power, axis=1))
        for j in range(d):
            lower = power - (np.arange(d) == j)
            slope = power[j] * np.prod(points ** lower.clip(min=0), axis=1)
            miss = np.maximum(miss, np.abs(dN[..., j] @ nodal - slope))
        p = int(np.argmax(miss))
        errors[f"{monomial(e)} is off most at xi = {at(points[p])}"] = float(miss[p])
    return errors


def bounded(shape: type[Shape]) -> Measured | str:
    """Check that N is continuous and dN bounded at and beside every node, such as the apex of a pyramid."""
    (n, d), h = shape.nodes.shape, 1e-8
    if d == 0:
        return "a point has no neighborhood"
    usual = np.abs(at_once(shape, inside(shape, 40))[1]).max()
    near = (shape.nodes[:, None] + h * (inside(shape, 8) - shape.nodes[:, None])).reshape(-1, d)
    points = np.vstack([shape.nodes, near])
    N, dN = at_once(shape, points)
    jump = np.abs(N[n:].reshape(n, -1, n) - N[:n, None]).max()
    slopes = np.abs(dN).max(axis=(1, 2))
    p = int(np.argmax(slopes))
    text = f"beside the nodes N changes by {jump:.3g} over {h:g}, and dN reaches {slopes[p]:.3g} at xi = "
    text += f"{at(points[p])}; inside it reaches {usual:.3g}; the ratio is measured"
    return Measured(float(np.maximum(slopes[p], jump / h) / usual), 1000.0, text)


def mid_edges(shape: type[Shape]) -> Measured | str:
    """Check that node corners + e lies in the middle of edge e."""
    c = shape.corners
    if not shape.edges or len(shape.nodes) < c + len(shape.edges):
        return "the shape has no mid-edge nodes"
    ends = np.array(shape.edges)
    miss = np.abs(shape.nodes[c : c + len(ends)] - shape.nodes[ends].mean(axis=1)).max(axis=1)
    e = int(np.argmax(miss))
    i, j = shape.edges[e]
    return Measured(float(miss[e]), 1e-14, f"node {c + e} should lie in the middle of the edge {i}-{j}")


def faces(shape: type[Shape]) -> Measured | str:
    """Check that faces are outward, closed (each edge once in each direction) and list all their nodes."""
    if shape.nodes.shape[1] < 3:
        return "only solids have faces"
    wrong = [] if shape.faces else ["the shape lists no faces"]
    directed: dict[tuple[int, int], int] = {}
    center = shape.nodes[: shape.corners].mean(axis=0)
    for f, face in enumerate(shape.faces):
        wrong += [f"face {f} {face} {why}" for why in _face_problems(shape, face, center)]
        ring = [a for a in face if a < shape.corners]
        for edge in zip(ring, ring[1:] + ring[:1], strict=True):
            directed[edge] = directed.get(edge, 0) + 1
    open_ = [e for e, count in directed.items() if count != 1 or directed.get((e[1], e[0]), 0) != 1]
    if open_:
        wrong.append(f"edge {open_[0]} is not used once in each direction by two faces")
    return Measured(len(wrong), 0, wrong[0] if wrong else "no fault in the faces")


def _face_problems(shape: type[Shape], face: tuple[int, ...], center: Array) -> list[str]:
    if len(face) not in FACE_SHAPES or len(face) < 3:
        return [f"has {len(face)} nodes; faces have 3, 4, 6, 8 or 9"]
    kind, X = FACE_SHAPES[len(face)], shape.nodes[list(face)]
    c = kind.corners
    normal = sum(np.cross(X[i], X[(i + 1) % c]) for i in range(c))
    problems = []
    if not (X[:c].mean(axis=0) - center) @ normal > 0:
        problems.append("has its nodes clockwise from outside; write them counter-clockwise")
    on_plane = np.abs((shape.nodes - X[0]) @ normal) < 1e-9
    if set(np.flatnonzero(on_plane).tolist()) != set(face):
        problems.append(f"should list the nodes {np.flatnonzero(on_plane).tolist()}, which lie on it")
    linear = FACE_SHAPES[c]
    if np.abs(np.array([linear.N(xi) for xi in kind.nodes]) @ X[:c] - X).max() > 1e-12:
        problems.append("has its mid-edge nodes out of order")
    return problems


def node_orders(shape: type[Shape]) -> Measured:
    """Check that the orders for VTK and Gmsh are permutations of the nodes that keep corners corners."""
    n, c = len(shape.nodes), shape.corners
    wrong = [
        name
        for name, order in (("to_vtk", shape.to_vtk), ("to_gmsh", shape.to_gmsh))
        if sorted(order) != list(range(n)) or sorted(order[:c]) != list(range(c))
    ]
    return Measured(
        len(wrong), 0, f"not a permutation of {n} nodes, corners first: {', '.join(wrong) or 'none'}"
    )


BASIC = (derivatives, broadcasting, kronecker)
DEPENDENT = (partition_of_unity, reproduction, bounded)
DATA = (mid_edges, faces, node_orders)

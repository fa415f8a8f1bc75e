"""Cells to measure on, and patch tests: cells of one element reproduce simple exact solutions together."""

from __future__ import annotations

from itertools import combinations, permutations

import numpy as np

from kratos_lite import voigt
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.surface import area_vectors
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.generators import SPLITS, box, cut_bricks
from kratos_lite.shapes import Shape
from kratos_lite.testing.report import Measured, difference
from kratos_lite.testing.rules import VOLUME
from kratos_lite.typing import Array, Ints, Mask

Element = type[KinematicLinear]

MATERIAL = Isotropic3D(E=1e6, nu=0.25)
C_ISOTROPIC = Isotropic3D(E=2.0, nu=0.3).C


def anisotropic() -> Array:
    """Return a C without any symmetry but its own, positive definite: it tells all components apart."""
    L = np.random.default_rng(5).uniform(-1, 1, (6, 6))
    return C_ISOTROPIC + 0.2 * L @ L.T


def affine(element: Element) -> tuple[Array, float]:
    """Return the nodes of a sheared, shifted cell with plane faces, and its exact volume."""
    A = np.eye(3) + np.random.default_rng(11).uniform(-0.3, 0.3, (3, 3))
    X = element.shape.nodes @ A.T + [0.3, -0.2, 0.1]
    return X, float(np.linalg.det(A)) * VOLUME[element.shape.cell]


def distorted(element: Element) -> Array:
    """Return the nodes of the reference cell, each moved by up to 5 % of the shortest edge."""
    X = element.shape.nodes
    corners = X[: element.shape.corners]
    edge = min(float(np.abs(a - b).max()) for a, b in combinations(corners, 2))
    return X + 0.05 * edge * np.random.default_rng(3).uniform(-1, 1, X.shape)


def linear_field(X: Array) -> tuple[Array, Array]:
    """Return u of a translation and a displacement gradient without symmetry, and the strain (6,)."""
    G = np.random.default_rng(13).uniform(-1, 1, (3, 3))
    return X @ G.T + [0.5, -0.7, 0.3], voigt.symmetric_gradient(G)


def rotations(shape: type[Shape]) -> Array:
    """Return the node permutations (k, n) that turn the reference cell into itself."""
    H = np.column_stack([shape.nodes, np.ones(len(shape.nodes))])
    c = shape.corners
    base = next(list(b) for b in combinations(range(c), 4) if abs(np.linalg.det(H[list(b)])) > 1e-9)
    maps = np.linalg.inv(H[base]) @ H[np.array(list(permutations(range(c), 4)))]
    maps = maps[np.abs(np.linalg.det(maps) - 1) < 1e-9]
    distance = np.abs((H @ maps)[:, :, None, :] - H).max(axis=3)
    kept = distance[(distance.min(axis=2) < 1e-9).all(axis=1)]
    return kept.argmin(axis=2)


# ---- patches --------------------------------------------------------------------------------------


def patch(
    shape: type[Shape],
    cells: tuple[int, int, int],
    size: tuple[float, float, float] = (1, 1, 1),
    move: float = 0.0,
) -> tuple[Array, Ints]:
    """Return points (n, 3) and nodes (m, k) of a box of one shape, inner corners moved by up to `move`."""
    mesh = box(size, cells, "KinematicLinear3D8N")
    points, bricks = mesh.points.copy(), mesh.blocks[0].nodes.astype(np.int64)
    inner = ((points > 0) & (points < size)).all(axis=1)
    points[inner] += np.random.default_rng(3).uniform(-move, move, (int(inner.sum()), 3))
    return cut_bricks(points, bricks, shape)


def unbuildable(shape: type[Shape]) -> str:
    """Return why no patch of a shape can be made, or an empty text."""
    if shape.cell not in SPLITS:
        return f"no box can be cut into cells {shape.cell!r}"
    points, nodes = patch(shape, (1, 1, 1))
    H = np.column_stack([shape.nodes, np.ones(len(shape.nodes))])
    X = points[nodes[0]]
    if np.abs(H @ np.linalg.lstsq(H, X, rcond=None)[0] - X).max() > 1e-12:
        return "the nodes of the shape are not its corners and the middles of its edges, faces and cell"
    return ""


def assemble(element: Element, points: Array, nodes: Ints) -> Array:
    """Return the stiffness matrix of a patch as a full array (3n, 3n)."""
    K = np.zeros((3 * len(points), 3 * len(points)))
    dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1)
    np.add.at(K, (dofs[:, :, None], dofs[:, None, :]), element(points[nodes]).stiffness(MATERIAL.C))
    return K


def solve(K: Array, fixed: Mask, u: Array, f: Array) -> Array:
    """Return u (n, 3) with K u = f where `fixed` (n, 3) is False; elsewhere it keeps its values."""
    free, known = ~fixed.ravel(), u.ravel() * fixed.ravel()
    known[free] = np.linalg.solve(K[np.ix_(free, free)], (f.ravel() - K @ known)[free])
    return known.reshape(u.shape)


def on_box(points: Array) -> Mask:
    """Return for each component whether its node lies on the boundary of the unit cube."""
    outer = ((points == 0) | (points == 1)).any(axis=1)
    return np.repeat(outer[:, None], 3, axis=1)


def errors(cells: KinematicLinear, u: Array, exact: Array, stress: Array) -> tuple[float, float]:
    """Return the largest errors of u (m, k, 3) and of its stress at the Gauss points, relative, two-sided."""
    return difference(u, exact), difference(cells.stress(MATERIAL.C, u), stress)


def reproduced(field: str, of_u: float, of_stress: float) -> Measured:
    """Return errors of u and stress that rounding alone may make."""
    text = f"{field}: u is off by {of_u:.3g} (limit 1e-13), the stress by {of_stress:.3g} (1e-12)"
    return Measured(np.maximum(10 * of_u, of_stress), 1e-12, text)


def linear_patch(element: Element) -> Measured | str:
    """Check Irons' patch test with shear: 27 bricks, inner corners moved, u linear on the boundary."""
    # Source of the field: MacNeal & Harder, Finite Elements in Analysis and Design 1 (1985) 3-20.
    if why := unbuildable(element.shape):
        return why
    points, nodes = patch(element.shape, (3, 3, 3), move=0.08)
    exact = 0.5e-3 * points @ (np.ones((3, 3)) + np.eye(3))
    stress = np.array([2000.0, 2000, 2000, 400, 400, 400])
    u = solve(assemble(element, points, nodes), on_box(points), exact, np.zeros_like(exact))
    cells = element(points[nodes])
    at_points = np.broadcast_to(stress, (len(nodes), len(element.rule), 6))
    return reproduced("a distorted patch", *errors(cells, u[nodes], exact[nodes], at_points))


def quadratic_patch(element: Element) -> Measured | str:
    """Check a random quadratic u under the body force that holds it in balance, on sheared cells."""
    if element.shape.degree < 2:
        return f"{element.shape.__name__} spans no quadratics"
    if element.custom or not element.has_standard_strain():
        return (
            f"{element.__name__} has a B or local system of its own, which need not be exact for quadratics"
        )
    if why := unbuildable(element.shape):
        return why
    points, nodes = patch(element.shape, (2, 2, 2))
    fixed = on_box(points)
    rng = np.random.default_rng(23)
    points = points @ (np.eye(3) + rng.uniform(-0.3, 0.3, (3, 3)))
    H = rng.uniform(-1, 1, (3, 3, 3))  # u_i = H_ijk x_j x_k / 2, so that u_i,jk = H_ijk
    H += H.swapaxes(1, 2)
    exact = np.einsum("ijk,nj,nk->ni", H, points, points) / 2
    lam, mu = MATERIAL.lame
    b = -(lam + mu) * np.einsum("jji->i", H) - mu * np.einsum("ijj->i", H)
    cells, f = element(points[nodes]), np.zeros_like(points)
    np.add.at(f, nodes, cells.body_force(b))
    u = solve(assemble(element, points, nodes), fixed, exact, f)
    gradient = np.einsum("ijk,mgk->mgij", H, cells.gauss_points())
    stress = MATERIAL.stress(voigt.symmetric_gradient(gradient))
    return reproduced("quadratic u", *errors(cells, u[nodes], exact[nodes], stress))


def shared_faces(element: Element) -> Measured | str:
    """Check that two bricks of cells share whole faces: corners and all further nodes, outward everywhere."""
    shape = element.shape
    if why := unbuildable(shape):
        return why
    points, nodes = patch(shape, (2, 1, 1), (2, 1, 1))
    block = Block(element.__name__, nodes, shape=shape)
    area = flux = 0.0
    for face in Mesh(points, [block]).boundary:
        assert face.shape is not None
        X = points[face.nodes]
        vectors = area_vectors(face.shape, X).sum(axis=1)
        area += float(np.linalg.norm(vectors, axis=1).sum())
        flux += float((vectors * X.mean(axis=1)).sum())  # ∮ x · n dA = 3 V where all normals point outward
    rings = [[a for a in face if a < shape.corners] for face in shape.faces]
    whole = {tuple(sorted(cell[list(face)])) for cell in nodes for face in shape.faces}
    corners = {tuple(sorted(cell[ring])) for cell in nodes for ring in rings}
    torn = len(whole) - len(corners)
    text = f"the boundary of a 2x1x1 box has the area {area:.6g} (10) and ∮ x · n dA = {flux:.6g} (6); "
    text += f"{torn} faces share corners but not all nodes"
    return Measured(np.max([abs(area - 10), abs(flux - 6), torn]), 1e-12, text)


def bend(element: Element, bricks: tuple[int, int, int]) -> tuple[float, float, float]:
    """Bend a 2x1x1 bar by turning its ends; return strain energy / exact - 1, errors of u and of stress."""
    # u = κ (x z, -ν y z, (ν (y² - z²) - x²) / 2), σ_xx = E κ z; only what the ends need is held.
    points, nodes = patch(element.shape, bricks, (2, 1, 1))
    points = points - [1, 0.5, 0.5]
    x, y, z = points.T
    nu, E = MATERIAL.nu, MATERIAL.E
    exact = np.column_stack([x * z, -nu * y * z, (nu * (y**2 - z**2) - x**2) / 2])
    fixed = np.zeros(points.shape, dtype=bool)
    fixed[np.abs(x) == 1, 0] = True
    edge = (x == -1) & (z == -0.5)
    fixed[edge & (y == -0.5), 1:] = True
    fixed[edge & (y == 0.5), 2] = True
    K = assemble(element, points, nodes)
    u = solve(K, fixed, exact, np.zeros_like(points))
    cells = element(points[nodes])
    stress = np.zeros((len(nodes), len(element.rule), 6))
    stress[..., 0] = E * cells.gauss_points()[..., 2]
    energy = 0.5 * float(u.ravel() @ K @ u.ravel())
    return energy / (E * 2 / 24) - 1, *errors(cells, u[nodes], exact[nodes], stress)


def bending(element: Element) -> Measured | str:
    """Check pure bending: exact for quadratic shapes; others, and B or local system of a user, converge."""
    if why := unbuildable(element.shape):
        return why
    wide = 2 if element.spurious_modes else 1  # one brick wide, they are free
    coarse, of_u, of_stress = bend(element, (2, wide, 1))
    own = bool(element.custom) or not element.has_standard_strain()
    if element.shape.degree >= 2 and not own:
        text = f"pure bending of two bricks: u is off by {of_u:.3g}, the stress by {of_stress:.3g}"
        return Measured(np.maximum(of_u, of_stress), 1e-12, text)
    fine = bend(element, (4, 2, 2))[0]
    text = f"energy of pure bending / exact - 1 is {coarse:.3g} with 2x1x1 bricks, {fine:.3g} with 4x2x2; "
    if own:  # may be exact, or softer than any displacement
        text += "measured is that of 4x2x2, the limit half of that of 2x1x1"
        return Measured(abs(fine), max(abs(coarse) / 2, 1e-11), text)
    if min(coarse, fine) < -1e-12:
        return Measured(-min(coarse, fine), 1e-12, text + "below 0 the element is softer than any exact one")
    return Measured(
        fine / coarse, 0.5, text + "measured is their ratio, which falls with the square of the cell size"
    )


CHECKS = (shared_faces, linear_patch, quadratic_patch, bending)

"""Elements, loads and solutions of a problem, one cell after the other, with dense matrices."""

from dataclasses import dataclass, field
from functools import cache

import numpy as np

from tests.reference import rules, shapes

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Rows of strain and stress; shear strains are engineering ones."""


@dataclass
class Problem:
    """A model: points (n, 3), cells (kind, nodes, material), and what acts on it.

    `materials` are (C (6, 6), density, constants); `fixed` gives displacements by dof, `links` are
    (dependent, {independent: weight}, constant); loads on faces stand by tuples of nodes, counter-clockwise
    from outside.
    """

    points: np.ndarray
    cells: list
    materials: list
    fixed: dict = field(default_factory=dict)
    links: list = field(default_factory=list)
    gravity: np.ndarray | None = None
    body_force: np.ndarray | None = None  # (n, 3) in N/m³
    forces: dict = field(default_factory=dict)  # by node
    tractions: list = field(default_factory=list)  # (nodes, traction): on boundary faces among the nodes
    pressures: list = field(default_factory=list)  # (nodes, pressure (n,) at all nodes)
    prestress: np.ndarray | None = None  # (m, 6)
    stress_free: np.ndarray | None = None  # (n, 3): the displacement without stress


def isotropic(E, nu):
    """Return C (6, 6) from Hooke's law: stress = 2 G strain + lambda trace(strain) 1."""
    C = np.diag([E / (1 + nu)] * 3 + [E / (2 * (1 + nu))] * 3)
    C[:3, :3] += E * nu / ((1 + nu) * (1 - 2 * nu))
    return C


def orthotropic(Ex, Ey, Ez, nxy, nyz, nxz, Gxy, Gyz, Gxz):
    """Return C (6, 6), the inverse of the compliance."""
    S = np.diag([1 / Ex, 1 / Ey, 1 / Ez, 1 / Gxy, 1 / Gyz, 1 / Gxz])
    for i, j, value in ((0, 1, nxy / Ex), (1, 2, nyz / Ey), (0, 2, nxz / Ex)):
        S[i, j] = S[j, i] = -value
    return np.linalg.inv(S)


def dofs(nodes):
    return np.array([3 * node + axis for node in nodes for axis in range(3)])


def strain_operators(gradients):
    """Return B (g, 6, 3k) from dN/dX (g, k, 3) at each point."""
    g, k, _ = gradients.shape
    B = np.zeros((g, 6, k, 3))
    for row, (i, j) in enumerate(PAIRS):
        B[:, row, :, i] += gradients[:, :, j]
        if i != j:
            B[:, row, :, j] += gradients[:, :, i]
    return B.reshape(g, 6, 3 * k)


def gauss_points(kind, X, rule):
    """Return N (g, k), dN/dX (g, k, 3) and the volume (g,) of each point of a rule in a cell X (k, 3)."""
    N, dN, weights = table(kind, rule)
    J = X.T @ dN
    return N, dN @ np.linalg.inv(J), np.linalg.det(J) * weights


@cache
def table(kind, rule):
    """Return N, dN and weights of a rule of solids, of which there are two."""
    xi, weights = {"stiffness": rules.STIFFNESS, "mass": rules.MASS}[rule][kind]
    return *shapes.solid(kind, xi), weights


def matrices(problem):
    """Return stiffness and mass (3n, 3n) and the nodal forces (3n,) of loads and initial stress."""
    size = problem.points.size
    K, M, f = np.zeros((size, size)), np.zeros((size, size)), surface_forces(problem)
    b = np.zeros_like(problem.points) if problem.body_force is None else problem.body_force
    g = np.zeros(3) if problem.gravity is None else problem.gravity
    for node, force in problem.forces.items():
        f[3 * node : 3 * node + 3] += force
    for e, (kind, nodes, material) in enumerate(problem.cells):
        X, at, (C, density, _) = problem.points[list(nodes)], dofs(nodes), problem.materials[material]
        _, gradients, dV = gauss_points(kind, X, "stiffness")
        B = strain_operators(gradients)
        K[np.ix_(at, at)] += np.einsum("gri,rs,gsj,g->ij", B, C, B, dV, optimize=True)
        f[at] -= np.einsum("gri,gr,g->i", B, initial_stress(problem, e, B), dV)
        N, _, dV = gauss_points(kind, X, "mass")
        m = (N.T * dV) @ N
        M[np.ix_(at, at)] += density * np.kron(m, np.eye(3))
        f[at] += (np.outer(dV @ N, density * g) + m @ b[list(nodes)]).ravel()
    return K, M, f


def initial_stress(problem, e, B):
    """Return the stress (g, 6) of element e at u = 0, where it has the operators B (g, 6, 3k)."""
    _, nodes, material = problem.cells[e]
    stress = np.zeros((len(B), 6)) + (0 if problem.prestress is None else problem.prestress[e])
    if problem.stress_free is not None:
        stress -= B @ problem.stress_free.ravel()[dofs(nodes)] @ problem.materials[material][0]
    return stress


def boundary(problem):
    """Return the faces that belong to one cell alone."""
    found = {}
    for kind, nodes, _ in problem.cells:
        for face in shapes.faces_of(kind, nodes):
            found.setdefault(frozenset(face), []).append(face)
    return [faces[0] for faces in found.values() if len(faces) == 1]


def surface_forces(problem):
    """Return ∫ N t dA and -∫ N p n dA over the boundary faces whose nodes are all among the given ones."""
    f, faces = np.zeros(problem.points.size), boundary(problem)
    for nodes, traction, pressure in [(n, t, None) for n, t in problem.tractions] + [
        (n, None, p) for n, p in problem.pressures
    ]:
        for face in faces:
            if not set(face) <= set(nodes):
                continue
            xi, weights = rules.FACE[len(face)]
            for N, dN, weight in zip(*shapes.plane(len(face), xi), weights, strict=True):
                normal = np.cross(*(problem.points[list(face)].T @ dN).T) * weight
                if pressure is None:
                    push = traction * np.linalg.norm(normal)
                else:
                    push = -(N @ pressure[list(face)]) * normal
                f[dofs(face)] += np.outer(N, push).ravel()
    return f


def constraints(problem):
    """Return A (c, 3n) and values (c,) of all that is prescribed: A u = values."""
    rows, values = [], []
    for dof, value in problem.fixed.items():
        rows.append({dof: 1.0})
        values.append(value)
    for dependent, independents, constant in problem.links:
        rows.append({dependent: 1.0} | {dof: -weight for dof, weight in independents.items()})
        values.append(constant)
    A = np.zeros((len(rows), problem.points.size))
    for r, row in enumerate(rows):
        for dof, weight in row.items():
            A[r, dof] += weight
    return A, np.array(values)


def free_motions(A):
    """Return an orthonormal basis of the displacements that A allows, A Z = 0."""
    if not len(A):
        return np.eye(A.shape[1])
    _, s, V = np.linalg.svd(A)
    return V[int((s > 1e-12 * s[0]).sum()) :].T


def singularity(problem, K):
    """Return the smallest eigenvalue of the stiffness that is left, as a share of the largest."""
    Z = free_motions(constraints(problem)[0])
    if not Z.shape[1]:
        return 1.0
    values = np.linalg.eigvalsh(Z.T @ K @ Z)
    return values[0] / values[-1]


def solve(problem, K, f):
    """Return displacements u and residual K u - f, both (3n,)."""
    A, values = constraints(problem)
    Z = free_motions(A)
    u = np.linalg.lstsq(A, values, rcond=None)[0] if len(A) else np.zeros(len(f))
    u = u + Z @ np.linalg.solve(Z.T @ K @ Z, Z.T @ (f - K @ u))
    return u, K @ u - f


def stresses(problem, u):
    """Return the stress (g, 6) of each element at its Gauss points."""
    found = []
    for e, (kind, nodes, material) in enumerate(problem.cells):
        X, C, at = problem.points[list(nodes)], problem.materials[material][0], dofs(nodes)
        B = strain_operators(gauss_points(kind, X, "stiffness")[1])
        found.append(B @ u[at] @ C + initial_stress(problem, e, B))
    return found


def energy(problem, K, u):
    """Return ½ ∫ strain C strain dV, of the strain from the stress-free displacement."""
    strained = u if problem.stress_free is None else u - problem.stress_free.ravel()
    return strained @ K @ strained / 2


def frequencies(problem, K, M):
    """Return the squares of the natural frequencies in rad²/s², ascending."""
    Z = free_motions(constraints(problem)[0])
    L = np.linalg.cholesky(Z.T @ M @ Z)
    left = np.linalg.solve(L, Z.T @ K @ Z)
    return np.linalg.eigvalsh(np.linalg.solve(L, left.T))


def newmark(problem, K, M, f, h, steps):
    """Return u (3n,) after steps of the mean acceleration from rest, under constant loads.

    Source: Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67-94.
    """
    Z = free_motions(constraints(problem)[0])
    K, M, f = Z.T @ K @ Z, Z.T @ M @ Z, Z.T @ f
    u, v, a = np.zeros(len(f)), np.zeros(len(f)), np.linalg.solve(M, f)
    for _ in range(steps):
        u = u + h * v + h * h / 4 * a
        v = v + h / 2 * a
        a = np.linalg.solve(M + h * h / 4 * K, f - K @ u)
        u, v = u + h * h / 4 * a, v + h / 2 * a
    return Z @ u

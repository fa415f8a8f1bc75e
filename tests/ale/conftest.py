"""Wheels, bars and scalar matrices that the tests of moving bodies share."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import eye_array, kron
from scipy.sparse.linalg import splu, spsolve

import kratos_lite as kl
from kratos_lite.ale import MotionMatrices
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.elements.surface import area_vectors, face_rule
from kratos_lite.solvers.mass import Mass

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
A = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def disk(element: str, radial: int, around: int, hub: str = "clamped") -> kl.Model:
    """Return the annulus 0.3 … 1 m in plane strain."""
    mesh = kl.annulus(0.3, 1.0, 0.2, cells=(radial, around, 1), element=f"KinematicLinear3D{element}")
    model = kl.Model(mesh, STEEL)
    model.fix(lambda X: np.ones(len(X), dtype=bool), "z")
    if hub == "clamped":
        model.fix("inner", "xy")
    return model


def bar(element: str, n: int, half: float = 10.0, tied: str = "") -> kl.Model:
    """Return a bar -half … half along x that strains in this direction alone.

    Sections move as one where they are `tied`: "all" of them, or those "below" the upper end, which
    periodic ends tie.
    """
    mesh = kl.box((2 * half, 1, 1), (n, 1, 1), f"KinematicLinear3D{element}", origin=(-half, 0, 0))
    model = kl.Model(mesh, STEEL)
    model.fix(lambda X: np.ones(len(X), dtype=bool), "yz")
    x = np.round(mesh.points[:, 0], 9)
    for section in np.unique(x) if tied == "all" else np.unique(x)[:-1] if tied else []:
        first, *others = np.flatnonzero(x == section).tolist()
        for node in others:
            model.constrain((node, "x"), {(first, "x"): 1.0})
    return model


def matrices(motion: kl.ale.Motion, model: kl.Model) -> SimpleNamespace:
    """Return M, G, S, H as full matrices (n, n) of the motion in a model, and its loads."""
    groups, points = model.element_groups(), model.mesh.points
    pattern = Pattern(len(points), [group.nodes for group in groups])
    mass = Mass(points, groups, pattern, False)
    terms = MotionMatrices(motion, points, groups, pattern, mass)
    unit = np.eye(len(points))
    full = {name: terms.times(getattr(terms, name), unit) for name in "GSH"}
    return SimpleNamespace(terms=terms, M=mass.scalar.toarray(), **full)


def polar(mesh: kl.Mesh, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return r, angle, and the radial and tangential component of nodal vectors (n, 3)."""
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    r = np.hypot(x, y)
    return r, np.arctan2(y, x), (x * u[:, 0] + y * u[:, 1]) / r, (x * u[:, 1] - y * u[:, 0]) / r


def rim_load(mesh: kl.Mesh, pressure: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the nodal forces of a pressure(angle) on the rim that pushes inward."""
    total = np.zeros_like(mesh.points)
    rim = np.zeros(mesh.n_nodes, dtype=bool)
    rim[mesh.nodes("outer")] = True
    for block in mesh.boundary:
        faces = block.nodes[rim[block.nodes].all(axis=1)]
        if not len(faces):
            continue
        rule = face_rule(block.shape)
        X = mesh.points[faces]
        N = np.array([block.shape.N(xi) for xi in rule.points])
        at = N @ X
        area = area_vectors(block.shape, X, rule)
        area = np.linalg.norm(area, axis=-1, keepdims=True)
        inward = -at * (1.0, 1.0, 0.0) / np.hypot(at[..., 0], at[..., 1])[..., None]
        p = pressure(np.arctan2(at[..., 1], at[..., 0]))[..., None]
        np.add.at(
            total, faces, np.swapaxes(np.broadcast_to(N, (len(faces), *N.shape)), 1, 2) @ (p * inward * area)
        )
    return total


def lagrangian(model, angle, rate, acceleration, load, h, steps):
    """Move the same body in axes that turn with it, M w'' + 2 rate M A w' + … by the trapezoidal rule.

    Returns w (n, 3): the displacement in those axes of the material that starts at each node.
    """
    e = EquationsOfMotion(model)
    free, K = e.system.constraint_map.free, e.K.scipy().tocsr()
    M, scalar = kron(e.mass.scalar, eye_array(3)).tocsr(), e.mass.scalar
    MA, MAA = kron(scalar, A).tocsr(), kron(scalar, A @ A).tocsr()
    X = model.mesh.points
    take = lambda matrix: matrix[free][:, free]  # noqa: E731

    def terms(t):
        C = 2 * rate(t) * MA
        return take(C), take(K + acceleration(t) * MA + rate(t) ** 2 * MAA)

    def force(t):
        own = -(scalar @ (X @ (rate(t) ** 2 * A @ A + acceleration(t) * A).T))
        return (load(angle(t), t) + own).ravel()[free]

    Mf = take(M)
    u = v = np.zeros(len(free))
    a = spsolve(Mf.tocsc(), force(0.0))
    kept = None
    for k in range(1, steps + 1):
        t = k * h
        C, S = terms(t)
        if kept is None or acceleration(t) or kept[0] != rate(t):
            kept = rate(t), splu((Mf + h / 2 * C + h * h / 4 * S).tocsc())
        guess_v, guess_u = v + h / 2 * a, u + h * v + h * h / 4 * a
        a = kept[1].solve(force(t) - C @ guess_v - S @ guess_u)
        u, v = guess_u + h * h / 4 * a, guess_v + h / 2 * a
    out = np.zeros(e.size)
    out[free] = u
    return e.system.scatter(out)


@pytest.fixture(scope="session")
def wheels() -> SimpleNamespace:
    """Steel, its wave speeds, and the functions of this module."""
    C, rho = STEEL.C, STEEL.density
    return SimpleNamespace(
        steel=STEEL,
        c_p=np.sqrt(C[0, 0] / rho),
        c_s=np.sqrt(C[3, 3] / rho),
        disk=disk,
        bar=bar,
        matrices=matrices,
        polar=polar,
        rim_load=rim_load,
        lagrangian=lagrangian,
    )

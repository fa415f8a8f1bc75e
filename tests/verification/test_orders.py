"""Convergence orders against a manufactured solution: p + 1 for displacements, p for energy.

u = (s(x) s(y) s(z), s(x) s(y) z (1 - z), e^x y (1 - y) s(z)) with s(t) = sin(π t).
"""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.quadrature import rule_for
from kratos_lite.voigt import symmetric_gradient

STEEL = kl.Isotropic3D(E=1.0, nu=0.3)
MESHES = {4: 12, 5: 8, 6: 12, 8: 12, 10: 6, 13: 4, 15: 6, 20: 8, 27: 6}


def trigonometry(X):
    return (
        np.sin(np.pi * X.T),
        np.cos(np.pi * X.T),
        X[:, 2] * (1 - X[:, 2]),
        np.exp(X[:, 0]),
        X[:, 1] * (1 - X[:, 1]),
    )


def displacement(X):
    s, _, q, e, p = trigonometry(X)
    return np.column_stack([s[0] * s[1] * s[2], s[0] * s[1] * q, e * p * s[2]])


def gradient(X):
    s, c, q, e, p = trigonometry(X)
    dq, dp = 1 - 2 * X[:, 2], 1 - 2 * X[:, 1]
    rows = [
        [np.pi * c[0] * s[1] * s[2], np.pi * s[0] * c[1] * s[2], np.pi * s[0] * s[1] * c[2]],
        [np.pi * c[0] * s[1] * q, np.pi * s[0] * c[1] * q, s[0] * s[1] * dq],
        [e * p * s[2], e * dp * s[2], np.pi * e * p * c[2]],
    ]
    return np.array(rows).transpose(2, 0, 1)


def body_force(X):
    """Return -(μ Δu + (λ + μ) grad div u)."""
    s, c, q, e, p = trigonometry(X)
    dq, dp, w = 1 - 2 * X[:, 2], 1 - 2 * X[:, 1], np.pi
    u = displacement(X)
    laplacian = np.column_stack(
        [-3 * w**2 * u[:, 0], -2 * w**2 * u[:, 1] - 2 * s[0] * s[1], (1 - w**2) * u[:, 2] - 2 * e * s[2]]
    )
    grad_div = np.column_stack(
        [
            -(w**2) * u[:, 0] + w**2 * c[0] * c[1] * q + w * e * p * c[2],
            w**2 * c[0] * c[1] * s[2] - w**2 * s[0] * s[1] * q + w * e * dp * c[2],
            w**2 * c[0] * s[1] * c[2] + w * s[0] * c[1] * dq - w**2 * e * p * s[2],
        ]
    )
    lam, mu = STEEL.lame
    return -(mu * laplacian + (lam + mu) * grad_div)


def fine(group, points):
    """Return the elements of a group with a rule of degree 8, and the shape functions there."""
    rule = rule_for(group.element.shape.cell, 8)
    return group.element(points[group.nodes], rule), np.array([group.element.N(xi) for xi in rule.points])


def nodal_load(model):
    (group,) = model.element_groups()
    element, N = fine(group, model.mesh.points)
    X = element.gauss_points()
    b = body_force(X.reshape(-1, 3)).reshape(X.shape) * element.dV[..., None]
    total = np.zeros_like(model.mesh.points)
    np.add.at(total, group.nodes, np.einsum("gn,egi->eni", N, b))
    return total


def errors(split, nodes, n, distorted):
    brick = kl.box(cells=(n, n, n))
    points = brick.points
    if distorted:
        points = points + 0.1 * np.prod(np.sin(np.pi * points), axis=1)[:, None] * (1, -0.7, 0.5)
    mesh = split(points, brick.blocks[0].nodes, f"KinematicLinear3D{nodes}N")
    model = kl.Model(mesh, STEEL)
    edge = np.unique(np.concatenate([block.nodes.ravel() for block in mesh.boundary]))
    model.fix(edge, "xyz", displacement(mesh.points[edge]))
    model.add(kl.NodalForces(nodal_load(model)))
    result = model.solve("direct")
    (group,) = result.groups
    element, N = fine(group, mesh.points)
    X, u = element.gauss_points(), result.u[group.nodes]
    gap = N @ u - displacement(X.reshape(-1, 3)).reshape(X.shape)
    exact = symmetric_gradient(gradient(X.reshape(-1, 3))).reshape(*X.shape[:2], 6)
    strain = element.strain(u) - exact
    l2 = np.sqrt(((gap**2).sum(-1) * element.dV).sum())
    energy = np.sqrt(((strain * STEEL.stress(strain)).sum(-1) * element.dV).sum())
    return np.array([l2, energy])


@pytest.mark.parametrize("distorted", [False, True], ids=["cartesian", "distorted"])
@pytest.mark.parametrize("nodes", sorted(MESHES))
def test_orders_of_convergence(split, nodes, distorted):
    n = MESHES[nodes]
    rates = np.log2(errors(split, nodes, n // 2, distorted) / errors(split, nodes, n, distorted))
    p = 1 if nodes <= 8 else 2
    np.testing.assert_allclose(rates, (p + 1, p), rtol=0, atol=0.15)

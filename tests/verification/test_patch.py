"""Patch tests: prescribed on the boundary, a polynomial field must come out inside."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.voigt import symmetric_gradient

E, NU = 1e6, 0.25
STEEL = kl.Isotropic3D(E=E, nu=NU)
KINDS = [4, 5, 6, 8, 10, 13, 15, 20, 27]
GRADIENT = 1e-3 * np.array([[2, 1, 1], [1, 2, 1], [1, 1, 2]]) / 2
STRESS = np.array([2000.0, 2000, 2000, 400, 400, 400])
INNER = [
    (0.249, 0.342, 0.192), (0.826, 0.288, 0.288), (0.850, 0.649, 0.263), (0.273, 0.750, 0.230),
    (0.320, 0.186, 0.643), (0.677, 0.305, 0.683), (0.788, 0.693, 0.644), (0.165, 0.745, 0.702),
]  # fmt: skip


def kind(n):
    return f"KinematicLinear3D{n}N"


def on_boundary(mesh):
    rows = np.unique(np.concatenate([block.nodes.ravel() for block in mesh.boundary]))
    return np.isin(np.arange(mesh.n_nodes), rows)


def solve_patch(mesh, field, body=None, solver="auto"):
    """Prescribe `field` on the boundary; return the result and the exact displacements."""
    model = kl.Model(mesh, STEEL)
    u = field(mesh.points)
    edge = on_boundary(mesh)
    model.fix(edge, "xyz", u[edge])
    if body is not None:
        model.add(kl.BodyForce(body))
    return model.solve(solver), u


def check_linear(mesh, solver="auto"):
    result, u = solve_patch(mesh, lambda X: X @ GRADIENT.T, solver=solver)
    np.testing.assert_allclose(result.u, u, rtol=0, atol=1e-13 * np.abs(u).max())
    np.testing.assert_allclose(result.stress(), np.broadcast_to(STRESS, result.stress().shape), rtol=1e-11)
    np.testing.assert_allclose(result.stress("node"), np.tile(STRESS, (mesh.n_nodes, 1)), rtol=1e-11)
    assert not on_boundary(mesh).all()


@pytest.mark.parametrize("nodes", KINDS)
def test_linear_field_on_a_warped_lattice(warped, nodes):
    check_linear(warped(kind(nodes), 3, amount=0.24))


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_linear_field_with_each_solver(warped, solver):
    mesh = warped(kind(8), 4)
    result, u = solve_patch(mesh, lambda X: X @ GRADIENT.T, solver=solver)
    np.testing.assert_allclose(result.u, u, rtol=0, atol=1e-10 * np.abs(u).max())


@pytest.mark.parametrize("nodes", [5, 8, 13, 20, 27])
def test_linear_field_on_the_seven_bricks_of_macneal_and_harder(split, nodes):
    """MacNeal & Harder, Finite Elements in Analysis and Design 1 (1985) 3-20: one brick inside six."""
    corners = (kl.KinematicLinear3D8N.nodes + 1) / 2
    points = np.vstack([corners, INNER])
    inner = np.arange(8, 16)
    bricks = [inner]
    for face in kl.KinematicLinear3D8N.shape.faces:
        outer, near = np.array(face), inner[list(face)]
        bricks.append(
            np.concatenate([near, outer])
        )  # a face seen from outside is the floor of a brick that grows outward
    check_linear(split(points, np.array(bricks), kind(nodes)))


def quadratic(rng):
    """Return a random quadratic field with its gradient and the body force that balances it."""
    A = rng.uniform(-1, 1, (3, 3, 3))
    A = (A + A.swapaxes(1, 2)) / 2  # u_i = A_ijk x_j x_k
    G = rng.uniform(-1, 1, (3, 3))

    def field(X):
        return 1e-3 * (np.einsum("ijk,nj,nk->ni", A, X, X) + X @ G.T)

    def gradient(X):
        return 1e-3 * (2 * np.einsum("ijk,nk->nij", A, X) + G)

    lam, mu = STEEL.lame
    laplacian = 2e-3 * np.einsum("ijj->i", A)
    grad_div = 2e-3 * np.einsum("jjk->k", A)
    return field, gradient, -(mu * laplacian + (lam + mu) * grad_div)


@pytest.mark.parametrize("nodes", [10, 13, 15, 20, 27])
def test_quadratic_field_on_parallelepipeds(split, nodes):
    field, gradient, body = quadratic(np.random.default_rng(7))
    brick = kl.box(cells=(2, 2, 2))
    points = brick.points @ np.array([[1.0, 0.1, 0.05], [0.2, 0.9, -0.1], [0.1, 0.15, 1.1]])
    mesh = split(points, brick.blocks[0].nodes, kind(nodes))
    result, u = solve_patch(mesh, field, body)
    np.testing.assert_allclose(result.u, u, rtol=0, atol=1e-13 * np.abs(u).max())
    (group,) = result.groups
    X = group.at(mesh.points).gauss_points()
    strain = symmetric_gradient(gradient(X.reshape(-1, 3))).reshape(*X.shape[:2], 6)
    np.testing.assert_allclose(result.strain(), strain, rtol=0, atol=1e-11 * np.abs(strain).max())
    np.testing.assert_allclose(
        result.stress(), strain @ STEEL.C, rtol=0, atol=1e-11 * np.abs(strain @ STEEL.C).max()
    )


@pytest.mark.parametrize(
    ("nodes", "low", "high"), [(10, 0, 1e-13), (27, 0, 1e-13), (20, 1e-6, 1e-3), (15, 1e-6, 1e-3)]
)
def test_quadratic_field_with_a_moved_corner_is_exact_for_complete_elements_only(warped, nodes, low, high):
    field, _, body = quadratic(np.random.default_rng(7))
    result, u = solve_patch(warped(kind(nodes), 2, amount=0.2), field, body)
    error = np.abs(result.u - u).max() / np.abs(u).max()
    assert low <= error <= high


@pytest.mark.parametrize("nodes", [10, 13, 15, 20, 27])
def test_pure_bending_is_exact_for_quadratic_elements(nodes):
    """Source: u = k (x y, -(x² + ν (y² - z²)) / 2, -ν y z) bends a beam without shear; σ_xx = E k y."""
    k = 1e-3

    def field(X):
        x, y, z = X.T
        return k * np.column_stack([x * y, -(x**2 + NU * (y**2 - z**2)) / 2, -NU * y * z])

    mesh = kl.box((6, 1, 0.5), (3, 2, 1), kind(nodes), origin=(0, -0.5, -0.25))
    model = kl.Model(mesh, STEEL)
    for side in ("x-", "x+"):
        model.fix(side, "xyz", field(mesh.points[mesh.nodes(side)]))
    result = model.solve()
    expected = field(mesh.points)
    np.testing.assert_allclose(result.u, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    y = mesh.points[:, 1]
    stress = np.column_stack([E * k * y, *[0 * y] * 5])
    np.testing.assert_allclose(result.stress("node"), stress, rtol=0, atol=1e-9 * E * k)


def test_bricks_with_eight_nodes_lock_in_shear_when_bent():
    mesh = kl.box((6, 1, 0.5), (3, 1, 1), origin=(0, -0.5, -0.25))
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=0.0))
    model.fix("x-", "xyz")
    model.fix(mesh.nodes("x+"), "x", (1e-3 * 6 * mesh.points[mesh.nodes("x+"), 1])[:, None])
    result = model.solve()
    moment = (result.reaction("x+")[:, 0] * mesh.points[mesh.nodes("x+"), 1]).sum()
    assert moment > 1.5 * E * 1e-3 * 0.5 / 12

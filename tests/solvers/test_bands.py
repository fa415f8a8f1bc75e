"""Factorizations of matrices of one sparsity pattern: bands, numbering, and when a sparse one is taken."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.errors import SolveError
from kratos_lite.solvers import plan
from kratos_lite.solvers.direct import Factorizer
from kratos_lite.solvers.mass import Mass

MATERIAL = kl.Isotropic3D(2e6, 0.26, 7800.0)
MESHES = {
    "bar": ((0.1, 0.1, 1.0), (2, 2, 20), "KinematicLinear3D8N"),
    "cube": ((1.0, 1.0, 1.0), (3, 3, 3), "KinematicLinear3D8N"),
    "tets": ((0.3, 0.2, 1.0), (2, 1, 5), "KinematicLinear3D10N"),
}
symmetries = pytest.mark.parametrize("symmetric", [True, False])


def system(label, symmetric=True, shuffled=False):
    """Return the pattern of a mesh and M + c K, or M + c K of a step, at some displacement."""
    size, cells, element = MESHES[label]
    mesh, rng = kl.box(size, cells, element), np.random.default_rng(5)
    groups = kl.Model(mesh, MATERIAL).element_groups()
    points = mesh.points
    if shuffled:
        new = rng.permutation(len(points))
        points = np.empty_like(points)
        points[new] = mesh.points
        for group in groups:
            group.nodes = new[group.nodes].astype(np.int32)
    pattern = Pattern(len(points), [group.nodes for group in groups])
    q, dq = 1e-3 * rng.standard_normal((2, *points.shape))
    A = finite_strain.stiffness(points, groups, pattern, q, None if symmetric else dq)
    A.data *= 1e-4
    mass = Mass(points, groups, pattern, lumped=False).scalar
    A.add_scalar(mass.data)
    return pattern, A


@pytest.mark.parametrize("label", MESHES)
@symmetries
@pytest.mark.parametrize("method", ["band", "sparse"])
def test_solutions_are_those_of_a_full_matrix(label, symmetric, method, monkeypatch):
    if method == "sparse":
        monkeypatch.setattr(plan, "BAND_LIMIT", 0.0)
    pattern, A = system(label, symmetric)
    full = A.scipy().toarray()
    assert (np.abs(full - full.T).max() > 1e-6 * np.abs(full).max()) != symmetric
    solver = Factorizer(pattern, symmetric)
    assert solver.plan.method == method
    rng = np.random.default_rng(7)
    for factor in (1.0, 3.0):  # the second matrix with the same solver
        factors = solver.factorize(BlockMatrix(factor * A.data, A.indices, A.indptr))
        for shape in ((A.shape[0],), (A.shape[0], 4)):
            b = rng.standard_normal(shape)
            kept = b.copy()
            x = np.linalg.solve(factor * full, b)
            np.testing.assert_allclose(factors.solve(b), x, rtol=0, atol=1e-11 * np.abs(x).max())
            np.testing.assert_array_equal(b, kept)


def test_matrix_is_left_as_it_is():
    pattern, A = system("bar")
    kept = A.data.copy()
    Factorizer(pattern).factorize(A)
    np.testing.assert_array_equal(A.data, kept)


@pytest.mark.parametrize("shuffled", [False, True])
def test_bar_has_a_narrow_band_however_its_nodes_are_numbered(shuffled):
    """Layers of nine nodes: the least distance to a neighbor in the next layer is 13, in sorted layers."""
    pattern, _ = system("bar", shuffled=shuffled)
    solver = Factorizer(pattern)
    assert 3 * 13 + 2 <= solver.width <= 3 * 17 + 2
    assert solver.plan.reason == f"width {solver.width} ≤ 380: a band is fastest"


def test_width_is_the_largest_distance_from_the_diagonal():
    pattern, A = system("tets", shuffled=True)
    solver = Factorizer(pattern)
    rows, columns = A.scipy().tocsr()[solver._dofs][:, solver._dofs].nonzero()
    assert np.abs(rows - columns).max() == solver.width


def test_indefinite_matrix_is_an_error():
    pattern, A = system("bar")
    at = A.diagonal_blocks()[100]
    A.data[at, 1, 1] -= 2 * A.data[at, 1, 1]
    with pytest.raises(SolveError, match="not positive definite: the pivot of node row"):
        Factorizer(pattern).factorize(A)
    b = np.ones(A.shape[0])
    x = Factorizer(pattern, symmetric=False).factorize(A).solve(b)
    assert np.abs(A @ x - b).max() < 1e-10


@pytest.mark.parametrize("method", ["band", "sparse"])
def test_singular_matrix_is_an_error(method, monkeypatch):
    if method == "sparse":
        monkeypatch.setattr(plan, "BAND_LIMIT", 0.0)
    pattern, A = system("bar", symmetric=False)
    A.data[:] = 0.0
    with pytest.raises(SolveError, match="singular"):
        Factorizer(pattern, symmetric=False).factorize(A)


@symmetries
def test_nodes_without_elements_and_separate_bodies(symmetric):
    """Two bars and one node alone: its mass makes the matrix regular."""
    mesh = kl.box((0.1, 0.1, 0.5), (1, 1, 5))
    n = mesh.n_nodes
    (group,) = kl.Model(mesh, MATERIAL).element_groups()
    group.nodes = np.vstack([group.nodes, group.nodes + np.int32(n)])
    group.rows = np.arange(10)
    points = np.vstack([mesh.points, mesh.points, np.zeros((1, 3))])
    pattern = Pattern(2 * n + 1, [group.nodes, np.array([[2 * n]], np.int32)])
    A = assemble_stiffness(points, [group], pattern)
    A.data /= A.norm()
    rng = np.random.default_rng(3)
    A.add_scalar(1.0 + rng.random(2 * n + 1), A.diagonal_blocks())
    b = rng.standard_normal(A.shape[0])
    x = Factorizer(pattern, symmetric).factorize(A).solve(b)
    np.testing.assert_allclose(A @ x, b, rtol=0, atol=1e-13)


def test_scalar_matrices_are_added_to_the_diagonals_of_blocks():
    mesh = kl.box((1.0, 2.0, 1.0), (2, 1, 1))
    groups = kl.Model(mesh, MATERIAL).element_groups()
    pattern = Pattern(mesh.n_nodes, [group.nodes for group in groups])
    mass = Mass(mesh.points, groups, pattern, lumped=False).scalar
    A = assemble_stiffness(mesh.points, groups, pattern)
    K = A.scipy().toarray()
    A.add_scalar(mass.data)
    np.testing.assert_array_equal(A.scipy().toarray(), K + np.kron(mass.toarray(), np.eye(3)))
    lumped = np.arange(1.0, mesh.n_nodes + 1)
    B = BlockMatrix(np.zeros_like(A.data), A.indices, A.indptr)
    B.add_scalar(lumped, B.diagonal_blocks())
    np.testing.assert_array_equal(B.scipy().toarray(), np.diag(np.repeat(lumped, 3)))

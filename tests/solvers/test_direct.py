"""Factorizations, sparse, dense and of bands: one answer; singular matrices are refused; factors are kept."""

import gc
import weakref

import numpy as np
import pytest
from rounding import close
from scipy.sparse import csr_array
from systems import parts_of, pattern_of, stiffness_of, system_of

import kratos_lite as kl
from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.solvers import direct, plan
from kratos_lite.solvers.direct import Factorizer
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.mass import Mass
from kratos_lite.solvers.plan import Plan

STEEL = kl.Isotropic3D(2e6, 0.26, 7800.0)


def has_pardiso():
    """Return whether MKL PARDISO is there."""
    try:
        direct.pardiso(csr_array(np.eye(2)), True)
    except direct.Unsuitable:
        return False
    return True


needs_pardiso = pytest.mark.skipif(not has_pardiso(), reason="pypardiso is not installed")
each_backend = pytest.mark.parametrize(
    "backend", [pytest.param(direct.pardiso, marks=needs_pardiso), direct.superlu]
)


def equations(method="direct"):
    """Return the equations of a box of 4 x 3 x 3 bricks, held at a side."""
    model = kl.Model(kl.box((1.0, 0.8, 0.6), (4, 3, 3)), STEEL)
    model.fix("x-")
    points, groups = parts_of(model)
    K = stiffness_of(points, groups)
    K = K.scipy().toarray() if method == "dense" else K
    return LinearSolver(K, model.supports.constraint_map(np.arange(len(points))), points, Plan(method))


def skew(n=200):
    """Return a regular matrix that is not symmetric, with zeros on its diagonal."""
    rng = np.random.default_rng(3)
    sparse = np.where(rng.random((n, n)) < 0.05, rng.standard_normal((n, n)), 0.0)
    A = sparse + np.roll(np.eye(n), 1, axis=0) * 9
    np.fill_diagonal(A, 0.0)
    return A


@each_backend
def test_backends_solve(backend, monkeypatch):
    monkeypatch.setattr(direct, "BACKENDS", (backend,))
    for A, symmetric in ((equations().reduced_matrix, True), (csr_array(skew()), False)):
        b = np.random.default_rng(1).standard_normal(A.shape[0])
        for factors in (direct.factorize(A, symmetric), direct.factorize_dense(A.toarray())):
            assert factors.method in (backend.__name__, "dense")
            close(factors.solve(b), np.linalg.solve(A.toarray(), b), 1e-12)


def test_the_fastest_backend_that_is_installed_comes_first():
    assert direct.factorize(csr_array(np.eye(3))).method == ("pardiso" if has_pardiso() else "superlu")


@pytest.mark.parametrize("symmetric", [True, False])
def test_singular_matrices_are_refused(symmetric):
    empty_row = csr_array(np.diag([1.0, 0.0, 2.0]))
    equal_rows = csr_array(np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    for A in (empty_row, equal_rows):
        with pytest.raises(kl.SolveError, match="singular"):
            direct.factorize(A, symmetric)
        with pytest.raises(kl.SolveError, match="singular"):
            direct.factorize_dense(A.toarray())


@each_backend
def test_an_indefinite_symmetric_matrix_is_still_solved(backend, monkeypatch):
    monkeypatch.setattr(direct, "BACKENDS", (backend, direct.superlu))
    factors = direct.factorize(csr_array(np.array([[1.0, 2.0], [2.0, 1.0]])))
    assert factors.method == "superlu"
    np.testing.assert_allclose(factors.solve(np.array([3.0, 3.0])), [1.0, 1.0], rtol=1e-15)


def test_too_little_memory_is_told(monkeypatch):
    def none_left(A, symmetric):
        raise MemoryError

    monkeypatch.setattr(direct, "BACKENDS", (none_left,))
    with pytest.raises(kl.SolveError, match=r"not enough memory to factorize 3 unknowns; use solver='amg'"):
        direct.factorize(csr_array(np.eye(3)))


@pytest.mark.parametrize(("method", "name"), [("dense", "factorize_dense"), ("direct", "factorize")])
def test_a_second_right_side_does_not_factorize_again(method, name, monkeypatch):
    count, plain = [], getattr(direct, name)
    monkeypatch.setattr(direct, name, lambda *arguments: count.append(1) or plain(*arguments))
    solver, K = equations(method), equations().K
    for seed in (1, 2, 3):
        f = np.random.default_rng(seed).standard_normal(K.shape[0])
        solution, free = solver.solve(f, 1e-10), solver.constraint_map.free
        np.testing.assert_allclose((K @ solution.x)[free], f[free], rtol=0, atol=1e-10)
        assert solution.backward_error < 1e-14
    assert count == [1]


@needs_pardiso
def test_factors_are_given_back(monkeypatch):
    solvers = pytest.importorskip("pypardiso.pardiso_wrapper")
    freed, plain = [], solvers.PyPardisoSolver.free_memory

    def free_memory(self, everything=False):
        freed.append(everything)
        plain(self, everything)

    monkeypatch.setattr(solvers.PyPardisoSolver, "free_memory", free_memory)
    factors = direct.factorize(csr_array(np.eye(4)))
    del factors
    gc.collect()
    assert freed == [True]


def test_a_system_that_nobody_needs_is_gone_with_its_factors():
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), STEEL)
    model.fix("z-")
    system = system_of(model, solver="direct")
    system.solve(np.ones((model.mesh.n_nodes, 3)))
    factors = weakref.ref(system.equations.factors)
    gc.disable()
    try:
        del system
        assert factors() is None
    finally:
        gc.enable()


# ---- bands ----------------------------------------------------------------------------------------------

MESHES = {
    "bar": ((0.1, 0.1, 1.0), (2, 2, 20), "KinematicLinear3D8N"),
    "cube": ((1.0, 1.0, 1.0), (3, 3, 3), "KinematicLinear3D8N"),
    "tets": ((0.3, 0.2, 1.0), (2, 1, 5), "KinematicLinear3D10N"),
}
symmetries = pytest.mark.parametrize("symmetric", [True, False])


@pytest.fixture(params=["band", "sparse"])
def method(request, monkeypatch):
    """Factorize bands, then by a sparse factorization in their place."""
    if request.param == "sparse":
        monkeypatch.setattr(plan, "BAND_LIMIT", 0.0)
    return request.param


def step(label, symmetric=True, shuffled=False):
    """Return the pattern of a mesh and M + c K, or M + c K of a step, at some displacement."""
    size, cells, element = MESHES[label]
    mesh, rng = kl.box(size, cells, element), np.random.default_rng(5)
    points, groups = parts_of(kl.Model(mesh, STEEL))
    if shuffled:
        new = rng.permutation(len(points))
        points = points[np.argsort(new)]
        for group in groups:
            group.nodes = new[group.nodes].astype(np.int32)
    pattern = pattern_of(points, groups)
    q, dq = 1e-3 * rng.standard_normal((2, *points.shape))
    A = finite_strain.stiffness(points, groups, pattern, q, None if symmetric else dq)
    A.data *= 1e-4
    A.add_scalar(Mass(points, groups, pattern, lumped=False).scalar.data)
    return pattern, A


@pytest.mark.parametrize("label", MESHES)
@symmetries
def test_solutions_are_those_of_a_full_matrix(label, symmetric, method):
    pattern, A = step(label, symmetric)
    full, kept = A.scipy().toarray(), A.data.copy()
    assert (np.abs(full - full.T).max() > 1e-6 * np.abs(full).max()) != symmetric
    solver = Factorizer(pattern, symmetric)
    assert solver.plan.method == method
    rng = np.random.default_rng(7)
    for factor in (1.0, 3.0):  # the second matrix with the same solver
        solve = solver.factorize(BlockMatrix(factor * A.data, A.indices, A.indptr))
        for shape in ((A.shape[0],), (A.shape[0], 4)):
            b = rng.standard_normal(shape)
            right = b.copy()
            close(solve(b), np.linalg.solve(factor * full, b), 1e-11)
            np.testing.assert_array_equal(b, right)
    solver.factorize(A)
    np.testing.assert_array_equal(A.data, kept)


@pytest.mark.parametrize("shuffled", [False, True])
def test_bar_has_a_narrow_band_however_its_nodes_are_numbered(shuffled):
    """Layers of nine nodes: the least distance to a neighbor in the next layer is 13, in sorted layers."""
    pattern, _ = step("bar", shuffled=shuffled)
    solver = Factorizer(pattern)
    assert 3 * 13 + 2 <= solver.width <= 3 * 17 + 2
    assert solver.plan.reason == f"width {solver.width} ≤ 380: a band is fastest"


def test_width_is_the_largest_distance_from_the_diagonal():
    pattern, A = step("tets", shuffled=True)
    solver = Factorizer(pattern)
    rows, columns = A.scipy().tocsr()[solver._dofs][:, solver._dofs].nonzero()
    assert np.abs(rows - columns).max() == solver.width


def test_indefinite_matrix_is_an_error():
    pattern, A = step("bar")
    at = A.diagonal_blocks()[100]
    A.data[at, 1, 1] -= 2 * A.data[at, 1, 1]
    with pytest.raises(kl.SolveError, match="not positive definite: the pivot of node row"):
        Factorizer(pattern).factorize(A)
    b = np.ones(A.shape[0])
    x = Factorizer(pattern, symmetric=False).factorize(A)(b)
    assert np.abs(A @ x - b).max() < 1e-10


def test_singular_matrix_is_an_error(method):
    pattern, A = step("bar", symmetric=False)
    A.data[:] = 0.0
    with pytest.raises(kl.SolveError, match="singular"):
        Factorizer(pattern, symmetric=False).factorize(A)


@symmetries
def test_nodes_without_elements_and_separate_bodies(symmetric):
    """Two bars and one node alone: its mass makes the matrix regular."""
    mesh = kl.box((0.1, 0.1, 0.5), (1, 1, 5))
    n = mesh.n_nodes
    (group,) = kl.Model(mesh, STEEL).element_groups()
    group.nodes = np.vstack([group.nodes, group.nodes + np.int32(n)])
    group.rows = np.arange(10)
    points = np.vstack([mesh.points, mesh.points, np.zeros((1, 3))])
    pattern = Pattern(2 * n + 1, [group.nodes, np.array([[2 * n]], np.int32)])
    A = assemble_stiffness(points, [group], pattern)
    A.data /= A.norm()
    rng = np.random.default_rng(3)
    A.add_scalar(1.0 + rng.random(2 * n + 1), A.diagonal_blocks())
    b = rng.standard_normal(A.shape[0])
    x = Factorizer(pattern, symmetric).factorize(A)(b)
    np.testing.assert_allclose(A @ x, b, rtol=0, atol=1e-13)


def test_scalar_matrices_are_added_to_the_diagonals_of_blocks():
    points, groups = parts_of(kl.Model(kl.box((1.0, 2.0, 1.0), (2, 1, 1)), STEEL))
    mass = Mass(points, groups, pattern_of(points, groups), lumped=False).scalar
    A = stiffness_of(points, groups)
    K = A.scipy().toarray()
    A.add_scalar(mass.data)
    np.testing.assert_array_equal(A.scipy().toarray(), K + np.kron(mass.toarray(), np.eye(3)))
    lumped = np.arange(1.0, len(points) + 1)
    B = BlockMatrix(np.zeros_like(A.data), A.indices, A.indptr)
    B.add_scalar(lumped, B.diagonal_blocks())
    np.testing.assert_array_equal(B.scipy().toarray(), np.diag(np.repeat(lumped, 3)))

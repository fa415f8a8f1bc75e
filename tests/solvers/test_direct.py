"""Factorizations: every backend gives the same answer, singular matrices are refused, factors are kept."""

import gc
import weakref

import numpy as np
import pytest
from scipy.sparse import csr_array

import kratos_lite as kl
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.errors import SolveError
from kratos_lite.solvers import direct
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.plan import Plan


def has_pardiso():
    """Return whether MKL PARDISO is there."""
    try:
        direct.pardiso(csr_array(np.eye(2)), True)
    except direct.Unsuitable:
        return False
    return True


needs_pardiso = pytest.mark.skipif(not has_pardiso(), reason="pypardiso is not installed")
SPARSE = [pytest.param(direct.pardiso, marks=needs_pardiso), direct.superlu]


def block(fixed=True):
    """Return the equations of a box of 4 x 3 x 3 bricks, held at one side or not at all."""
    model = kl.Model(kl.box((1.0, 0.8, 0.6), (4, 3, 3)), kl.Isotropic3D(E=2e9, nu=0.3))
    if fixed:
        model.fix("x-")
    groups = model.element_groups()
    points = model.mesh.points
    K = assemble_stiffness(points, groups, Pattern(len(points), [group.nodes for group in groups]))
    return LinearSolver(K, model.supports.constraint_map(np.arange(len(points))), points, Plan("direct"))


def right_side(n, seed=1):
    return np.random.default_rng(seed).standard_normal(n)


def skew(n=200):
    """Return a regular matrix that is not symmetric, with zeros on its diagonal."""
    rng = np.random.default_rng(3)
    A = (
        np.where(rng.random((n, n)) < 0.05, rng.standard_normal((n, n)), 0.0)
        + np.roll(np.eye(n), 1, axis=0) * 9
    )
    np.fill_diagonal(A, 0.0)
    return A


@pytest.mark.parametrize("backend", SPARSE)
def test_backends_solve_a_stiffness_matrix(backend, monkeypatch):
    monkeypatch.setattr(direct, "BACKENDS", (backend,))
    A = block().reduced_matrix
    b = right_side(A.shape[0])
    factors = direct.factorize(A)
    assert factors.method == backend.__name__
    x = factors.solve(b)
    np.testing.assert_allclose(x, np.linalg.solve(A.toarray(), b), rtol=0, atol=1e-12 * np.abs(x).max())


@pytest.mark.parametrize("backend", SPARSE)
def test_backends_solve_a_matrix_that_is_not_symmetric(backend, monkeypatch):
    monkeypatch.setattr(direct, "BACKENDS", (backend,))
    A = skew()
    b = right_side(len(A))
    x = direct.factorize(csr_array(A), symmetric=False).solve(b)
    np.testing.assert_allclose(A @ x, b, rtol=0, atol=1e-12)


def test_dense_factors_solve_both_kinds():
    for A in (block().reduced_matrix.toarray(), skew()):
        b = right_side(len(A))
        factors = direct.factorize_dense(A)
        assert factors.method == "dense"
        x = factors.solve(b)
        assert np.abs(A @ x - b).max() <= 1e-14 * np.abs(A).sum(axis=1).max() * np.abs(x).max()


def test_the_fastest_backend_that_is_installed_comes_first():
    assert direct.factorize(csr_array(np.eye(3))).method == ("pardiso" if has_pardiso() else "superlu")


@pytest.mark.parametrize("symmetric", [True, False])
def test_singular_matrices_are_refused(symmetric):
    empty_row = csr_array(np.diag([1.0, 0.0, 2.0]))
    equal_rows = csr_array(np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    for A in (empty_row, equal_rows):
        with pytest.raises(SolveError, match="singular"):
            direct.factorize(A, symmetric)
        with pytest.raises(SolveError, match="singular"):
            direct.factorize_dense(A.toarray())


@pytest.mark.parametrize("backend", SPARSE)
def test_an_indefinite_symmetric_matrix_is_still_solved(backend, monkeypatch):
    monkeypatch.setattr(direct, "BACKENDS", (backend, direct.superlu))
    A = csr_array(np.array([[1.0, 2.0], [2.0, 1.0]]))
    factors = direct.factorize(A)
    assert factors.method == "superlu"
    np.testing.assert_allclose(factors.solve(np.array([3.0, 3.0])), [1.0, 1.0], rtol=1e-15)


def test_too_little_memory_is_told(monkeypatch):
    def none_left(A, symmetric):
        raise MemoryError

    monkeypatch.setattr(direct, "BACKENDS", (none_left,))
    with pytest.raises(SolveError, match=r"not enough memory to factorize 3 unknowns; use solver='amg'"):
        direct.factorize(csr_array(np.eye(3)))


@pytest.mark.parametrize("method", ["dense", "direct"])
def test_a_second_right_side_does_not_factorize_again(method, monkeypatch):
    count = []

    def counted(name):
        plain = getattr(direct, name)

        def factorize(*args):
            count.append(name)
            return plain(*args)

        return factorize

    for name in ("factorize", "factorize_dense"):
        monkeypatch.setattr(direct, name, counted(name))
    equations = block()
    if method == "dense":
        equations.K, equations.plan = equations.K.scipy().toarray(), Plan("dense")
    K = block().K
    for seed in (1, 2, 3):
        f = right_side(K.shape[0], seed)
        solution = equations.solve(f, 1e-10)
        free = equations.constraint_map.free
        np.testing.assert_allclose((K @ solution.x)[free], f[free], rtol=0, atol=1e-10)
    assert count == ["factorize_dense" if method == "dense" else "factorize"]


@needs_pardiso
def test_factors_are_given_back(monkeypatch):
    solvers = pytest.importorskip("pypardiso.pardiso_wrapper")
    freed = []
    plain = solvers.PyPardisoSolver.free_memory

    def free_memory(self, everything=False):
        freed.append(everything)
        plain(self, everything)

    monkeypatch.setattr(solvers.PyPardisoSolver, "free_memory", free_memory)
    factors = direct.factorize(csr_array(np.eye(4)))
    del factors
    gc.collect()
    assert freed == [True]


def test_a_system_that_nobody_needs_is_gone_with_its_factors():
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), kl.Isotropic3D(E=1.0, nu=0.3))
    model.fix("z-")
    mesh, supports = model.mesh, model.supports.constraint_map
    system = ConstrainedSystem(mesh.points, model.element_groups(), supports, solver="direct")
    system.solve(np.ones((mesh.n_nodes, 3)))
    factors = weakref.ref(system.equations.factors)
    gc.disable()
    try:
        del system
        assert factors() is None
    finally:
        gc.enable()

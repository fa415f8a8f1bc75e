"""Modes of larger models, by a block of vectors: none is missed, none comes twice."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

import kratos_lite as kl
from kratos_lite.analysis import modal
from kratos_lite.analysis.modal import critical_rate
from kratos_lite.assembly.matrix_free import MatrixFree
from kratos_lite.errors import SolveError
from kratos_lite.mesh.refinement import refine
from kratos_lite.native import kernels
from kratos_lite.solvers import eigen
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.plan import Plan
from tests.fixtures.systems import system_of

STEEL = {"E": 210e9, "density": 7850.0}
SOFTER = (1.0, 1e-3, 1e-6)


def two_of(mesh, scale):
    """Return a mesh and, apart from it, the same with another size."""
    points = np.vstack([mesh.points, mesh.points * scale + (9.0, 0.0, 0.0)])
    n = mesh.n_nodes
    return kl.Mesh(points, [kl.Block(b.name, np.vstack([b.nodes, b.nodes + n])) for b in mesh.blocks])


def random_model(seed):
    """Return a block of any element: flat or long, of two materials, of two nearly alike, tied, hanging."""
    rng = np.random.default_rng(seed)
    element = str(rng.choice(["4N", "8N", "10N", "20N", "27N"]))
    size = tuple(rng.choice([1.0, 1.0, 2.0, 0.1, 0.02], 3))
    cells = tuple(rng.integers(1, 4 if element in ("4N", "8N") else 3, 3).tolist())
    mesh = kl.box(size, cells, f"KinematicLinear3D{element}")
    kind = rng.integers(5)
    if kind == 0:
        mesh = two_of(mesh, 1 + rng.choice([0.0, 1e-6, 1e-3]))
    if kind == 1 and element in ("8N", "20N") and mesh.n_elements > 1:
        mesh = refine(mesh, np.arange(mesh.n_elements) == 0).mesh
    model = kl.Model(mesh, kl.Isotropic3D(nu=float(rng.choice([0.0, 0.3, 0.4999])), **STEEL))
    if kind == 2:
        half = np.arange(mesh.n_elements) < mesh.n_elements // 2
        soft = kl.Isotropic3D(E=210e9 * rng.choice(SOFTER), nu=0.3, density=1000.0)
        model.assign(soft, np.flatnonzero(half))
    for side, axes in ((), (("x-", "xyz"),), (("x-", "x"), ("y-", "y")))[rng.integers(3)]:
        model.fix(side, axes)
    if kind == 3:
        first, *others = [n for n in mesh.nodes("z+").tolist() if not model.supports.fixed[n].any()][:4]
        for node in others:
            model.constrain((node, "z"), {(first, "z"): 1.0})
    return model, bool(rng.integers(2))


@pytest.mark.parametrize("seeds", np.split(np.arange(100), 10))
def test_random_models_have_the_modes_of_lapack(seeds, monkeypatch):
    for seed in seeds:
        model, lumped = random_model(seed)
        mesh = model.mesh
        count = min(6, len(model.supports.constraint_map(np.arange(mesh.n_nodes)).free) // 5)
        M = model.matrices(lumped=lumped).M.diagonal()
        roundoff = 1e-12 * (model.matrices().K.diagonal()[M > 0] / M[M > 0]).max()
        monkeypatch.setattr(eigen, "DENSE_MODES", 2000)
        exact = model.modes(count, lumped=lumped)[0] ** 2
        monkeypatch.setattr(eigen, "DENSE_MODES", 0)
        squares = model.modes(count, lumped=lumped)[0] ** 2
        np.testing.assert_allclose(squares, exact, rtol=4e-8, atol=roundoff, err_msg=f"seed {seed}")


@pytest.mark.parametrize("seed", range(12))
def test_modes_near_a_frequency_are_those_of_lapack(seed, monkeypatch):
    """At a mode, between two, and below all of them: the same distances, to the rounding of the stiffness."""
    model, lumped = random_model(seed)
    count = 3
    monkeypatch.setattr(eigen, "DENSE_MODES", 3000)
    free = len(model.supports.constraint_map(np.arange(model.mesh.n_nodes)).free)
    every = model.modes(free, lumped=lumped)[0]
    omega, rounding = every[: free // 4], 1e-13 * every[-1] ** 2
    for near in (omega[0], omega[-2], 0.3 * omega[-3] + 0.7 * omega[-2], 0.0):
        nearest = every[np.argsort(np.abs(every - near))[:count]]
        exact = np.sort(np.abs(nearest**2 - near**2))
        for limit in (0, 3000) if near == omega[-2] else (0,):
            monkeypatch.setattr(eigen, "DENSE_MODES", limit)
            found, shapes = model.modes(count, lumped=lumped, near=near)
            squares = np.sort(np.abs(found**2 - near**2))
            np.testing.assert_allclose(squares, exact, rtol=1e-8, atol=rounding)
            assert (np.diff(found) >= 0).all()
            assert shapes.shape == (count, model.mesh.n_nodes, 3)


def test_modes_near_a_frequency_of_a_larger_body():
    """The same as those counted from the lowest; the double ones both."""
    model = kl.Model(kl.box((1, 1, 2), (6, 6, 12)), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("z-")
    omega, shapes = model.modes(12)
    near, found = model.modes(4, near=float(omega[5:9].mean()))
    chosen = np.sort(np.argsort(np.abs(omega - omega[5:9].mean()))[:4])
    np.testing.assert_allclose(near, omega[chosen], rtol=1e-9)
    mass = model.transient().equations.mass
    overlap = np.array([[a.ravel() @ mass.times(b.ravel()) for b in shapes] for a in found])
    np.testing.assert_allclose((overlap**2).sum(axis=1), 1.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("near", "words"),
    [
        (-1.0, "near must be one number ≥ 0, in rad/s; got -1.0"),
        ("low", "near must be"),
        (np.inf, "near"),
        (1.0, "take a factorization, of up to 20 unknowns; got 24; take a coarser mesh"),
    ],
)
def test_what_has_no_modes_near_a_frequency(near, words, monkeypatch):
    monkeypatch.setattr(modal, "FALLBACK_LIMIT", 20)
    with pytest.raises(kl.InputError, match=words):
        kl.Model(kl.box(), kl.Isotropic3D(nu=0.3, **STEEL)).modes(1, near=near)


def test_frequencies_that_a_model_does_not_have_are_refused(monkeypatch):
    model = kl.Model(kl.box((1, 1, 1), (4, 4, 4)), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("z-")
    monkeypatch.setattr(eigen, "DENSE_MODES", 0)
    monkeypatch.setattr(eigen, "RESTARTS", 1)
    with pytest.raises(SolveError, match=r"3 modes near 1e\+08 rad/s cannot be found .* at such frequencies"):
        model.modes(3, near=1e8)


def test_modes_of_larger_bodies_by_closed_forms():
    """A confined column: c π (k - ½) / L; a free cube has double and triple modes."""
    material = kl.Isotropic3D(E=1.0, nu=0.3, density=1.0)
    column = kl.Model(kl.box((1, 1, 8), (3, 3, 60)), material)
    column.fix(lambda X: np.ones(len(X), dtype=bool), "xy")
    column.fix("z-", "z")
    speed = np.sqrt(material.C[0, 0])
    omega, shapes = column.modes(3)
    np.testing.assert_allclose(omega, speed * np.pi * np.array([0.5, 1.5, 2.5]) / 8, rtol=2e-3)
    assert shapes.shape == (3, column.mesh.n_nodes, 3)
    cube = kl.Model(kl.box((1, 1, 1), (9, 9, 9), "EnhancedStrain3D8N"), material)
    omega = cube.modes(14)[0]
    assert not omega[:6].any()
    groups = [omega[6:8], omega[8:11], omega[11:14]]
    for group, reference in zip(groups, (1.77125, 2.38517, 2.42566), strict=True):
        np.testing.assert_allclose(group, group[0], rtol=1e-8)
        assert group[0] == pytest.approx(reference, rel=0.02)


@pytest.mark.parametrize("scale", [1.0, 1 + 1e-6])
def test_two_bodies_nearly_alike_have_each_mode_twice(scale):
    one = kl.box((1, 1, 1), (6, 6, 6))
    omegas = []
    for mesh in (one, two_of(one, scale)):
        model = kl.Model(mesh, kl.Isotropic3D(nu=0.3, **STEEL))
        model.fix(np.isclose(mesh.points[:, 2], 0.0))
        omegas.append(model.modes(4 if mesh is one else 8)[0])
    twice = np.sort(np.concatenate([omegas[0], omegas[0] / scale]))
    np.testing.assert_allclose(omegas[1], twice, rtol=1e-8)


def test_a_mode_that_a_start_misses_is_found(monkeypatch):
    """The first block begins without a trace of the lowest mode."""
    model = kl.Model(kl.box((1, 1, 2), (7, 7, 8)), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("x-")
    omega = model.modes(4)[0]
    plain = eigen.Problem._descend
    blocks = []

    def blind(self, X, done):
        if not blocks:
            squares, V, MV = plain(self, X, done)
            blocks.append(squares)
            return squares[1:], V[1:], MV[1:]
        blocks.append(X)
        return plain(self, X, done)

    monkeypatch.setattr(eigen.Problem, "_descend", blind)
    np.testing.assert_allclose(model.modes(4)[0], omega, rtol=1e-8)
    assert len(blocks) > 2


@pytest.mark.skipif(kernels("multigrid") is None, reason="the compiled kernels were not built")
@pytest.mark.parametrize("sides", [("x-",), ()])
@pytest.mark.parametrize("element", ["20N", "27N", "10N"])
def test_modes_of_the_linear_level_save_cycles_of_all_nodes(element, sides, monkeypatch):
    """Of a body that is held, and of a free one, whose rigid motions the level has, too."""
    model = kl.Model(
        kl.box((1, 1, 2), (4, 4, 7), f"KinematicLinear3D{element}"), kl.Isotropic3D(nu=0.3, **STEEL)
    )
    for side in sides:
        model.fix(side)
    cycles, omegas = [], []
    plain = LinearSolver.precondition

    def counted(self, r):
        cycles[-1] += len(r) * (self.K.shape[0] == 3 * model.mesh.n_nodes)
        return plain(self, r)

    monkeypatch.setattr(LinearSolver, "precondition", counted)
    for has_level in (True, False):
        if not has_level:
            monkeypatch.setattr(LinearSolver, "linear_level", lambda self: None)
        cycles.append(0)
        omegas.append(model.modes(8 if sides else 14)[0])
    np.testing.assert_allclose(*omegas, rtol=1e-8)
    assert 0 < cycles[0] < 0.85 * cycles[1]


def test_modes_beyond_reach_are_refused(monkeypatch):
    model = kl.Model(kl.box((1, 1, 1), (8, 8, 8)), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("z-")
    monkeypatch.setattr(eigen, "STEPS", 2)
    with pytest.raises(SolveError, match="cannot be found by iteration"):
        model.modes(3)


def wheel(cells, rate, **options):
    """Return a wheel that turns about its hub."""
    model = kl.Model(kl.annulus(0.3, 1.0, 0.2, cells=cells), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("inner")
    model.add(kl.ale.Rotation("z", rate, **options))
    return model


def test_critical_rates_of_larger_wheels(monkeypatch):
    """Those of the full matrices, and of a mesh above their limit near them."""
    small, large = (critical_rate(wheel((3, around, 2), 10.0), 3) for around in (12, 24))
    np.testing.assert_allclose(large, small, rtol=0.2)
    monkeypatch.setattr("kratos_lite.analysis.modal.DENSE_MODES", 0)
    np.testing.assert_allclose(critical_rate(wheel((3, 12, 2), 10.0), 3), small, rtol=1e-8)


def test_a_free_ring_of_quadratic_elements_has_the_modes_of_lapack():
    """What holds its rigid motions for the preconditioner are corner nodes, which the linear level has."""
    model = kl.Model(kl.annulus(0.5, 2, 0.3, (3, 16, 2)), kl.Isotropic3D(nu=0.3, **STEEL))
    omega, _ = model.modes(10)
    matrices = model.matrices()
    squares = eigh(matrices.K.toarray(), matrices.M.toarray(), eigvals_only=True, subset_by_index=[6, 9])
    np.testing.assert_allclose(omega[6:], np.sqrt(squares), rtol=1e-7)


# ---- steps in time of larger models ----


def struck(element, cells, count=1, **options):
    """Return a block on a clamped side in so many of its first modes, and the period of the first."""
    model = kl.Model(kl.box((1, 1, 2), cells, element), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("x-")
    omega, shapes = model.modes(count)
    return model.transient(velocity=shapes.sum(axis=0), **options), 2 * np.pi / omega[0]


@pytest.mark.parametrize(
    ("element", "cells"),
    [("8N", (4, 4, 8)), ("10N", (2, 2, 4)), ("27N", (2, 2, 3))],
)
def test_energy_is_kept_by_iterations(element, cells, monkeypatch):
    monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", 0)
    transient, period = struck(f"KinematicLinear3D{element}", cells, 8)
    energy = transient.energy()
    *_, end = kl.integrate(transient, period / 20, 30, every=30)
    assert abs(transient.energy(end) / energy - 1) < 1e-11


OF_STEP = 2e-5
"""What iterations may miss, as a fraction of what the steps themselves miss in time."""


def missed(ends):
    """Return what iterations with steps h miss beside factors, over what half the step changes."""
    by_iterations, by_factors, halved = ends
    return np.abs(by_iterations - by_factors).max() / np.abs(halved - by_factors).max()


def test_iterations_miss_far_less_than_the_steps(monkeypatch):
    ends = []
    for limit, n in ((0, 20), (40_000, 20), (40_000, 40)):
        monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", limit)
        transient, period = struck("KinematicLinear3D20N", (2, 2, 4), 8, rayleigh=(3.0, 1e-6))
        *_, end = kl.integrate(transient, period / n, n, every=n)
        ends.append(end.u)
    assert missed(ends) < OF_STEP


def test_a_step_of_one_mode_begins_near_its_end(monkeypatch):
    """What it comes to is a multiple of its Taylor start: of many modes at once it takes more iterations."""
    iterations, plain = [], LinearSolver.solve

    def counted(self, *arguments):
        iterations.append(plain(self, *arguments))
        return iterations[-1]

    monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", 0)
    transient, period = struck("KinematicLinear3D20N", (3, 3, 6))
    monkeypatch.setattr(LinearSolver, "solve", counted)
    deque(kl.integrate(transient, period / 20, 4), maxlen=0)
    noise = np.sin(0.1 * np.arange(transient.v.size) ** 2) * ~transient.equations.constrained
    transient.v = transient.v + 0.1 * np.abs(transient.v).max() * noise
    deque(kl.integrate(transient, period / 20, 4), maxlen=0)
    one, many = (sum(solution.iterations for solution in half) for half in (iterations[:4], iterations[4:]))
    assert one < 0.3 * many


def test_the_linear_level_of_a_step_has_mass():
    """Without it, slow motions of light time steps would be far from what the level takes them for."""
    transient, period = struck("KinematicLinear3D27N", (4, 5, 9))
    h = period / 200
    f = np.random.default_rng(0).standard_normal(transient.u.size)
    iterations = []
    for kept in (True, False):
        solve = transient.equations.solver(0.0, 4 / h**2, 0.0, 1.0, h)
        equations = solve.args[0]
        if not kept:
            equations.mass = None
            vars(equations).pop("_multigrid", None)
        iterations.append(equations.solve(f, 1e-10).iterations)
    assert iterations[0] < iterations[1]


@pytest.mark.parametrize("tied", [False, True])
def test_steps_by_products_of_the_stiffness_alone_come_to_what_factors_give(tied, monkeypatch):
    monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", 0)
    model = kl.Model(kl.box((1, 1, 2), (3, 3, 6), "KinematicLinear3D27N"), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("x-")
    if tied:
        first, *others = model.mesh.nodes("x+").tolist()
        for node in others[:20]:
            model.constrain((node, "z"), {(first, "z"): 0.5})
    e = model.transient(rayleigh=(3.0, 1e-6)).equations
    f = np.random.default_rng(0).standard_normal(e.size)
    for a, product in ((1e7, True), (1e12, False)):  # 1/s², a step that is short beside the cells
        equations = e.solver(0.0, a, 100.0, 0.9, 1.0).args[0]
        assert isinstance(equations.K, MatrixFree) == (product and kernels("multigrid") is not None)
        direct = replace(equations, K=e.matrix(0.0, a, 100.0, 0.9), plan=Plan("direct"))
        x, exact = e.solver(0.0, a, 100.0, 0.9, 1.0)(f, 0 * f, 0 * f), direct.solve(f, 1e-12).x
        assert np.abs(x - exact).max() < 1e-4 * np.abs(exact).max()


def test_transport_terms_by_minimal_residuals_come_to_what_factors_give(monkeypatch):
    ends = []
    for limit, n in ((0, 20), (40_000, 20), (40_000, 40)):
        monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", limit)
        model = wheel((2, 16, 1), 300.0, damping=20.0)
        model.add(kl.Traction("outer", (1e6, 0, 0)))
        *_, end = kl.integrate(model.transient(), 2e-3 / n, n, every=n)
        ends.append(end.u)
    assert np.abs(ends[1]).max() > 0
    assert missed(ends) < OF_STEP


def test_equations_out_of_reach_of_minimal_residuals_are_refused(monkeypatch):
    monkeypatch.setattr("kratos_lite.solvers.linear_solver.RESTART", 1)
    monkeypatch.setattr("kratos_lite.solvers.linear_solver.MAX_RESTARTS", 1)
    monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", 0)
    model = wheel((2, 16, 1), 300.0)
    model.add(kl.Traction("outer", (1e6, 0, 0)))
    with pytest.raises(SolveError, match="were not solved to"):
        list(kl.integrate(model.transient(), 1e-4, 2))


@pytest.mark.parametrize("tied", [False, True])
def test_the_first_acceleration_balances(tied):
    model = kl.Model(kl.box((1, 1, 2), (2, 2, 3), "KinematicLinear3D20N"), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("x-")
    model.add(kl.Traction("z+", (1e6, 2e6, 3e6)))
    if tied:
        first, *others = model.mesh.nodes("x+").tolist()
        for node in others:
            model.constrain((node, "x"), {(first, "x"): 0.5})
    transient = model.transient()
    e = transient.equations
    left = e.system.constraint_map.reduce(e.mass.times(transient.a) - e.load(0.0))
    assert np.abs(left).max() < 1e-12 * np.abs(e.load(0.0)).max()


@pytest.mark.skipif(kernels("sparse") is None, reason="the compiled kernels were not built")
@pytest.mark.parametrize("count", [1, 3, 4, 9])
def test_several_vectors_read_a_matrix_together(count):
    model = kl.Model(kl.box((1, 1, 2), (3, 2, 2)), kl.Isotropic3D(nu=0.3, **STEEL))
    e = model.transient().equations
    x = np.random.default_rng(count).standard_normal((count, e.size))
    np.testing.assert_allclose(e.K.times(x), (e.K.scipy() @ x.T).T, rtol=1e-12, atol=1e-3)
    np.testing.assert_allclose(e.mass.times(x), (e.mass.matrix() @ x.T).T, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("method", ["amg", "direct", "dense"])
def test_an_approximate_inverse_is_one(method):
    model = kl.Model(kl.box((1, 1, 2), (5, 5, 5)), kl.Isotropic3D(nu=0.3, **STEEL))
    model.fix("x-")
    system = system_of(model, solver=method)
    solver = LinearSolver(system.K, system.constraint_map, system.points, Plan(method), groups=system.groups)
    free = system.constraint_map.free
    q = np.random.default_rng(0).standard_normal(len(free))
    r = np.zeros((1, len(system.constraint_map.c)))
    r[0, free] = solver.times(system.constraint_map.transform(q)[None])[0, free]
    z = solver.precondition(r)
    assert not z[0, system.constraint_map.constrained].any()
    r, z = r[0, free], z[0, free]
    assert 0.3 < (r @ z) / (r @ q) < (1 + 1e-9 if method != "amg" else 1.5)
    if method != "amg":
        np.testing.assert_allclose(z, q, rtol=1e-6, atol=1e-9)

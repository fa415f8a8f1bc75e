"""Modes beside LAPACK on the same matrices: held and free, symmetric and not, on both sides of the limit."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.modal import reduced
from kratos_lite.errors import SolveError
from kratos_lite.solvers import complex_eigen, eigen

RUBBER = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)


def matrices(model):
    e = EquationsOfMotion(model, steady=True)
    return [reduced(e, e.matrix(0.0, *s)).toarray() for s in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]


def spectrum(model):
    """Return all eigenvalues, nearest to 0 first, and a bound of their errors by rounding."""
    M, C, K = matrices(model)
    scale = np.sqrt(np.abs(K).sum(axis=0).max() / np.abs(M).sum(axis=0).max())
    zero, one = np.zeros_like(K), np.eye(len(K))
    A = np.block([[zero, scale * one], [-np.linalg.solve(M, K) / scale, -np.linalg.solve(M, C)]])
    values = np.linalg.eigvals(A)
    return values[np.argsort(np.abs(values))], scale


def compare(model, exact, scale, count=12):
    """Compare with all eigenvalues; those near 0 stand in blocks and are known to the root of rounding."""
    found, shapes = model.complex_modes(count)
    blurred = 1e-6 * scale
    for value in found:
        error = np.abs(exact - value).min()
        assert error <= (blurred if abs(value) < 30 * blurred else 1e-7 * abs(value) + 1e-9 * scale)
    np.testing.assert_allclose(np.abs(found), np.abs(exact[:count]), rtol=1e-6, atol=blurred)
    assert shapes.shape == (count, model.mesh.n_nodes, 3)


def random_model(seed):
    """Return a small block, wheel or periodic bar: held or not, moving, damped and accelerated or not."""
    rng = np.random.default_rng(seed)
    kind, held = rng.integers(4), rng.integers(3)
    element = "KinematicLinear3D" + rng.choice(["8N", "20N"] if kind else ["4N", "6N", "8N"])
    material = kl.Isotropic3D(
        E=10 ** rng.uniform(5, 9), nu=rng.uniform(0, 0.45), density=rng.uniform(1e2, 9e3)
    )
    around, speed = int(rng.integers(10, 13)), np.sqrt(material.E / material.density)
    wheel = kl.annulus(0.3, 1.0, 0.2, cells=(1, around, 1), element="KinematicLinear3D8N")
    size, cells = rng.uniform(0.3, 3, 3), tuple(rng.integers(1, 4, 3).tolist())
    mesh = kl.box(size, (max(3, cells[0]), *cells[1:]), element) if kind in (0, 3) else wheel
    model = kl.Model(mesh, material)
    if kind in (1, 2):
        rate = kl.TimeSeries([0, 1], [0.1 * speed, rng.uniform(0, 0.3) * speed])
        damping = float(rng.choice([0.0, 0.1 * speed]))
        stiff = bool(rng.integers(2))
        model.add(kl.ale.Rotation("z", rate if kind == 2 else rate(0.5), stiffening=stiff, damping=damping))
        if held:
            model.fix("inner", "z" if held == 1 else "xyz")
    elif kind == 3:
        model.add(kl.ale.Translation("x", rng.uniform(0, 0.7) * speed, boundaries="periodic"))
        if held:
            model.fix("z-", "z" if held == 1 else "xyz")
    elif held:
        model.fix("z-", "z" if held == 1 else "xyz")
    return model


@pytest.mark.parametrize("seed", range(12))
def test_random_models_have_the_eigenvalues_of_lapack(seed, monkeypatch):
    model = random_model(seed)
    known = spectrum(model)
    compare(model, *known)
    for module in (eigen, complex_eigen):
        monkeypatch.setattr(module, "DENSE_MODES", 0)
    compare(model, *known)


@pytest.mark.parametrize("seed", [0, 1, 4, 9])
def test_natural_modes_of_random_models_are_those_of_lapack(seed, monkeypatch):
    from scipy.linalg import eigh

    model = random_model(seed)
    e = EquationsOfMotion(model)
    K, M = (reduced(e, A).toarray() for A in (e.K, e.matrix(0.0, 1.0, 0.0, 0.0)))
    squares = eigh(K, M, eigvals_only=True)
    exact, blurred = np.sqrt(np.maximum(squares[:10], 0.0)), 1e-7 * np.sqrt(squares[-1])
    for dense in (eigen.DENSE_MODES, 0):
        monkeypatch.setattr(eigen, "DENSE_MODES", dense)
        np.testing.assert_allclose(model.modes(10)[0], exact, rtol=1e-8, atol=blurred)


def free_wheel():
    """Return a free rotor of 912 unknowns."""
    wheel = kl.Model(kl.annulus(0.3, 1.0, 0.2, cells=(2, 16, 1)), RUBBER)
    wheel.add(kl.ale.Rotation("z", 30.0, stiffening=True))
    return wheel


def free_window():
    """Return a free periodic window of 1080 unknowns."""
    model = kl.Model(kl.box((20, 1, 1), (30, 1, 1), "KinematicLinear3D20N"), RUBBER)
    model.add(kl.ale.Translation("x", 57.0, boundaries="periodic"))
    return model


@pytest.mark.parametrize(("model", "zeros"), [(free_wheel, 2), (free_window, 8)])
def test_free_models_above_the_limit_of_dense_algebra_do_not_grow(model, zeros):
    """Rigid motions that nothing resists have the eigenvalue 0 twice, not what rounding makes of it."""
    values, _ = model().complex_modes(14)
    assert not values[:zeros].any()
    assert np.abs(values.real).max() < 2e-4
    assert np.abs(values[-1]) > 1.0


def test_a_damped_free_model_comes_to_rest():
    """λ² + α λ = 0 of each rigid translation: nothing resists it but the damping."""
    wheel = kl.Model(kl.annulus(0.3, 1.0, 0.2, cells=(2, 16, 1)), RUBBER)
    wheel.add(kl.ale.Rotation("z", 0.0, damping=0.1))
    values, _ = wheel.complex_modes(12)
    np.testing.assert_allclose(values, [0.0] * 6 + [-0.1] * 6, atol=1e-5)


def test_slender_free_bars_have_the_frequencies_of_beams():
    """(4.730, 7.853)² √(EI / ρA L⁴): three decades below those of the mesh; in plane strain."""
    bar = kl.Model(kl.box((100, 1, 1), (50, 1, 1), "KinematicLinear3D20N"), RUBBER)
    bar.fix(lambda X: np.ones(len(X), dtype=bool), "y")
    beam = np.array([4.730041, 7.853205]) ** 2 * np.sqrt(RUBBER.E / 0.91 / 12 / RUBBER.density) / 100**2
    np.testing.assert_allclose(bar.modes(5)[0][3:], beam, rtol=1e-2)
    values = bar.complex_modes(10)[0]
    assert not values[:6].any()
    np.testing.assert_allclose(np.abs(values[6:]), beam.repeat(2), rtol=1e-2)


def test_what_does_not_satisfy_the_equations_is_refused(monkeypatch):
    pencil = complex_eigen.Pencil

    def spoiled(self, count):
        values, shapes = beside(self, count)
        return values + 1e-3 * np.abs(values).max(), shapes

    beside = pencil._nearest
    monkeypatch.setattr(pencil, "_nearest", spoiled)
    with pytest.raises(SolveError, match="has a residual of"):
        free_wheel().complex_modes(14)


def test_frequencies_that_do_not_fit_their_shapes_are_refused(monkeypatch):
    plain = eigen.Problem._descend
    monkeypatch.setattr(eigen, "DENSE_MODES", 0)

    def doubled(*arguments):
        squares, *shapes = plain(*arguments)
        return 2 * squares, *shapes

    monkeypatch.setattr(eigen.Problem, "_descend", doubled)
    with pytest.raises(SolveError, match="has a residual of"):
        kl.Model(kl.box((1, 1, 1), (2, 2, 2)), RUBBER).modes(9)


def test_modes_that_the_start_does_not_hold_are_found(monkeypatch):
    """Two bars apart, without a factorization: nothing leads from the modes of the first to the second."""
    bars = {name: kl.box((3, 1, 1), (4, 1, 1), "KinematicLinear3D8N") for name in ("one", "other")}
    model = kl.Model(kl.join(bars), RUBBER)
    model.fix("one.z-")
    model.fix("other.z-")
    model.add(kl.ale.Translation("x", 20.0, boundaries="natural", damping=5.0))
    exact, scale = spectrum(model)
    plain = eigen.Problem.roughly

    def of_the_first(self, count):
        X = plain(self, count)
        X[:, X.shape[1] // 2 :] = 0.0
        return X

    monkeypatch.setattr(complex_eigen, "DENSE_MODES", 0)
    monkeypatch.setattr(eigen.Problem, "roughly", of_the_first)
    monkeypatch.setattr("kratos_lite.solvers.direct.factorize", None)
    compare(model, exact, scale, count=6)

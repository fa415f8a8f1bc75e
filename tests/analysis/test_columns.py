"""Confined columns: one degree of freedom, or a bar, whose motion is known."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.model.loads import ScaledLoad

SOIL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
MODULUS = SOIL.C[0, 0]
INTEGRATORS = [kl.Newmark(), kl.HHT(-0.1), kl.GeneralizedAlpha(0.8), kl.CentralDifference()]
each_integrator = pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda s: s.name)


def column(cells=1, load=None):
    model = kl.Model(kl.box((1, 1, 1), (1, 1, cells)), SOIL)
    for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
        model.fix(side, axis)
    if load is not None:
        model.add(load)
    return model


def pulled(model):
    """Return 1 mm up at the top, in proportion to the height."""
    u = np.zeros_like(model.mesh.points)
    u[:, 2] = 1e-3 * model.mesh.points[:, 2]
    return u


def frequency(lumped):
    """One element: k = M A / L, m = ρ A L / 3, or / 2 where it is lumped."""
    return np.sqrt(MODULUS / (SOIL.density * (1 / 2 if lumped else 1 / 3)))


@each_integrator
def test_a_step_load_swings_about_the_static_solution_with_order_two(integrator):
    omega = frequency(isinstance(integrator, kl.CentralDifference))
    errors = []
    for steps in (100, 200, 400):
        *_, end = kl.integrate(
            column(load=kl.Traction("z+", (0, 0, 1e3))).transient(integrator=integrator), 0.02 / steps, steps
        )
        exact = 1e3 / MODULUS * (1 - np.cos(omega * 0.02))
        errors.append(abs(end.u[:, 2].max() - exact) * MODULUS / 1e3)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([2, 2], abs=0.12)


@pytest.mark.parametrize("rho", [1.0, 0.8, 0.5])
def test_high_frequencies_shrink_by_the_factor_claimed(rho):
    """With h ω = 600 amplitudes shrink by ρ∞ a step, but for the factor n of a double root."""
    model = column()
    transient = model.transient(integrator=kl.GeneralizedAlpha(rho), displacement=pulled(model))
    list(kl.integrate(transient, 600 / frequency(False), 60))
    before = transient.energy()
    list(kl.integrate(transient, 600 / frequency(False), 20))
    assert (transient.energy() / before) ** (1 / 40) == pytest.approx(rho, abs=0.02)


def test_the_trapezoidal_rule_keeps_energy():
    model = column(9)
    transient = model.transient(displacement=pulled(model) ** 2 * 1e3)
    before = transient.energy()
    worst = max(abs(transient.energy() / before - 1) for _ in kl.integrate(transient, 1e-4, 2000, every=50))
    assert worst < 1e-12


def test_damping_takes_the_rate_of_rayleigh():
    """Amplitudes fall by exp(-ζ ω t), ζ ω = (α + β ω²) / 2."""
    omega = frequency(False)
    alpha, beta = 5.0, 2e-5
    model = column()
    transient = model.transient(displacement=pulled(model), rayleigh=(alpha, beta))
    before = transient.energy()
    period = 2 * np.pi / np.sqrt(omega**2 - ((alpha + beta * omega**2) / 2) ** 2)
    list(kl.integrate(transient, period / 500, 2500))
    decay = np.log(before / transient.energy()) / (2 * 5 * period)
    assert decay == pytest.approx((alpha + beta * omega**2) / 2, rel=2e-3)


@each_integrator
def test_a_moving_support_carries_the_column(integrator):
    """A slow rise of the foot: the column follows it as a rigid body."""
    model = kl.Model(kl.box(), SOIL)
    for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y")):
        model.fix(side, axis)
    model.fix("z-", "z", lambda t: 1e-3 * np.sin(t) ** 2)
    h = 1e-3 if not isinstance(integrator, kl.CentralDifference) else 1e-4
    foot, top = model.mesh.nodes("z-"), model.mesh.nodes("z+")
    transient = model.transient(integrator=integrator)
    for state in kl.integrate(transient, h, round(0.8 / h), every=100):
        assert state.u[foot, 2] == pytest.approx(np.full(4, 1e-3 * np.sin(state.time) ** 2), rel=1e-12)
        assert state.u[top, 2] == pytest.approx(state.u[foot, 2], abs=2e-7)
    if isinstance(integrator, (kl.HHT, kl.GeneralizedAlpha)):
        return  # its forces balance within the step, not at its end
    inertia = transient.equations.mass.times(transient.a).reshape(-1, 3)[:, 2].sum()
    assert state.reactions[:, 2].sum() == pytest.approx(inertia, abs=1e-6 * SOIL.density)


@each_integrator
def test_a_restart_goes_on_bit_by_bit(integrator, tmp_path):
    def made():
        load = ScaledLoad(kl.Traction("z+", (0, 0, 1e3)), kl.TimeSeries([0, 1e-3, 2e-3], [0, 1, -1]))
        model = column(3, load)
        return model.transient(integrator=integrator, rayleigh=(3.0, 0.0))

    *_, whole = kl.integrate(made(), 2e-5, 100)
    *_, half = kl.integrate(made(), 2e-5, 40, every=7)
    kl.write(tmp_path / "half.npz", half)
    again = made()
    kl.read_state(tmp_path / "half.npz").restore(again)
    *_, end = kl.integrate(again, 2e-5, 60)
    for name in ("u", "v", "a"):
        np.testing.assert_array_equal(getattr(end, name), getattr(whole, name))
    assert (end.time, end.step) == (whole.time, whole.step)


def test_tied_columns_swing_as_one():
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1)), SOIL)
    for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "xyz")):
        model.fix(side, axis)
    top = model.mesh.nodes("z+")
    for node in top[1:]:
        model.constrain((int(node), "z"), {(int(top[0]), "z"): 1.0})
    model.fix(lambda X: np.isclose(X[:, 0], 1), "x")
    model.add(kl.PointLoad([int(top[0])], (0, 0, 2e3)))
    omega = frequency(False)
    period = 2 * np.pi / omega
    for state in kl.integrate(model.transient(), period / 200, 200, every=50):
        exact = 1e3 / MODULUS * (1 - np.cos(omega * state.time))
        assert state.u[top, 2] == pytest.approx(np.full(6, exact), abs=2e-3 * 1e3 / MODULUS)


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("cells", [1, 2, 4, 8])
def test_frequencies_of_the_confined_column_are_those_of_the_discrete_bar(cells, lumped):
    c, h, k = np.sqrt(MODULUS / SOIL.density), 1 / cells, np.pi / (2 * cells)
    exact = 2 * c / h * np.sin(k / 2) if lumped else c / h * np.sqrt(6 * (1 - np.cos(k)) / (2 + np.cos(k)))
    model = column(cells)
    omega, shapes = model.modes(4 * cells, lumped=lumped)
    plane = [k for k, u in enumerate(shapes) if np.ptp(u[model.mesh.nodes("z+"), 2]) < 1e-9 * np.abs(u).max()]
    assert omega[plane[0]] == pytest.approx(exact, rel=1e-10)
    assert not shapes[plane[0]][model.mesh.nodes("z-")].any()


def test_complex_modes_without_motion_are_those_of_the_model_twice():
    model = column(3)
    omega = model.modes(3)[0]
    values, _ = model.complex_modes(6)
    np.testing.assert_allclose(np.sort(np.abs(values.imag))[::2], omega, rtol=1e-9)
    assert np.abs(values.real).max() < 1e-9 * omega[-1]


def test_wrong_words_are_told():
    model = column()
    for make, words in (
        (lambda: kl.Newmark(0.1, 0.5), "β ≥ γ/2"),
        (lambda: kl.HHT(0.1), "-1/3 … 0"),
        (lambda: kl.GeneralizedAlpha(1.5), "lies in 0 … 1"),
        (lambda: model.transient(integrator=3), "an integrator such as"),
        (lambda: model.transient(rayleigh=(-1, 0)), "α ≥ 0"),
        (lambda: model.transient(displacement=np.zeros((3, 3))), r"needs shape \(8, 3\)"),
        (lambda: list(kl.integrate(model.transient(), 0.0, 1)), "a step must be"),
        (lambda: list(kl.integrate(model.transient(), 1e-3, 0)), "steps must be"),
        (
            lambda: list(kl.integrate(model.transient(integrator=kl.CentralDifference()), 1.0, 1)),
            "critical step is",
        ),
        (lambda: ScaledLoad(3.0, 1.0), "multiplies a constant load such as"),
    ):
        with pytest.raises(kl.InputError, match=words):
            make()
    light = kl.Model(kl.box(), kl.Isotropic3D(E=1.0, nu=0.3))
    with pytest.raises(kl.ModelError, match="what moves needs mass"):
        light.transient()

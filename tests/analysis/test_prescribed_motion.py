"""Supports that move: their reactions, kinks of their tables, and what is tied to them."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.integrators import HHT, CentralDifference, GeneralizedAlpha, Newmark
from kratos_lite.time_series import TimeSeries

E, RHO = 1e6, 1000.0
INTEGRATORS = [Newmark(), HHT(-0.1), GeneralizedAlpha(0.8), CentralDifference()]


def everywhere(X: np.ndarray) -> np.ndarray:
    return np.ones(len(X), dtype=bool)


def carried(s) -> kl.Model:
    """Return a cube whose nodes all move along z by s(t)."""
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), kl.Isotropic3D(E=E, nu=0.3, density=RHO))
    model.fix(everywhere, "xy")
    model.fix(everywhere, "z", s)
    return model


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda s: s.name)
def test_reactions_are_those_of_the_acceleration(integrator):
    """m s'' from the first step to the last: nothing rings, nothing grows."""
    steady = carried(lambda t: 0.5 * 9.81 * t * t)
    for state in kl.integrate(steady.transient(integrator=integrator), 1e-3, 50):
        assert state.reactions[:, 2].sum() == pytest.approx(9.81 * RHO, rel=1e-5)
        assert state.v[:, 2] == pytest.approx(9.81 * state.time)
    swinging = carried(lambda t: 1e-2 * np.sin(30 * t))
    for state in kl.integrate(swinging.transient(integrator=integrator), 1e-3, 200):
        exact = -9.0 * RHO * np.sin(30 * state.time)
        assert state.reactions[:, 2].sum() == pytest.approx(exact, abs=1e-4 * 9.0 * RHO)


def test_a_kink_gives_its_whole_impulse():
    """A base that starts with V at T: u = V τ - 1.5 V / ω sin ωτ of one cell of consistent mass."""
    T, V = 0.05, 0.1
    model = kl.Model(kl.box(), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
    model.fix(everywhere, "xy")
    model.fix("z-", "z", TimeSeries([0.0, T, 10.0], [0.0, 0.0, V * (10.0 - T)]))
    omega, errors = np.sqrt(3 * E / RHO), []
    for h in (1e-3, 5e-4):
        steps = round(0.3 / h)
        *_, end = kl.integrate(model.transient(), h, steps, every=steps)
        exact = V * 0.25 - 1.5 * V / omega * np.sin(omega * 0.25)
        errors.append(np.abs(end.u[model.mesh.nodes("z+"), 2] - exact).max())
    assert errors[1] < 1e-4 * V
    assert errors[0] / errors[1] > 3


@pytest.mark.parametrize("integrator", INTEGRATORS[:3], ids=lambda s: s.name)
@pytest.mark.parametrize("steps", [(2e-3, 1e-3), (1e-3, 1e-4), (1e-5, 1e-3)])
def test_another_step_does_not_make_reactions_ring(integrator, steps):
    transient = carried(lambda t: 1e-2 * np.sin(30 * t)).transient(integrator=integrator)
    for h in steps:
        for state in kl.integrate(transient, h, 50):
            exact = -9.0 * RHO * np.sin(30 * state.time)
            assert state.reactions[:, 2].sum() == pytest.approx(exact, abs=4e-4 * 9.0 * RHO)


@pytest.mark.parametrize("hertz", [1e3, 1e5, 1e6])
def test_supports_may_move_fast(hertz):
    """A cell on a base that starts with V: u of one free cell against its closed form."""
    model, way = kl.Model(kl.box(), kl.Isotropic3D(E=E, nu=0.0, density=RHO)), 1e-9
    model.fix(everywhere, "xy")
    model.fix("z-", "z", lambda t: way * np.sin(2 * np.pi * hertz * t))
    h, turn, omega2 = 1 / (200 * hertz), 2 * np.pi * hertz, 3 * E / RHO
    *_, end = kl.integrate(model.transient(), h, 190, every=190)
    # u'' + ω² u = ω² g - g'' / 2, of the consistent mass, from rest
    ratio = (omega2 + turn**2 / 2) / (omega2 - turn**2)
    omega, t = np.sqrt(omega2), end.time
    exact = way * ratio * (np.sin(turn * t) - turn / omega * np.sin(omega * t))
    top = end.u[model.mesh.nodes("z+"), 2]
    assert top == pytest.approx(exact, abs=1e-3 * way)


def test_supports_that_come_to_be_equal():
    """Nothing jumps when the two ends of a bar are, for once, displaced alike."""
    ends = []
    for apart in (0.0, 1e-9):
        model = kl.Model(kl.box((1, 1, 4), (1, 1, 4)), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
        model.fix(everywhere, "xy")
        model.fix("z-", "z", TimeSeries([0.0, 0.2, 1.0], [0.0, 1e-3, 1e-3]))
        model.fix("z+", "z", TimeSeries([0.0, 0.2, 1.0], [0.0, 1e-3 + apart, 1e-3 + apart]))
        ends.append(np.array([state.u[:, 2] for state in kl.integrate(model.transient(), 2e-3, 200)]))
    assert np.abs(ends[0] - ends[1]).max() < 2e-9


def test_a_support_moves_by_one_function():
    def way(t):
        return 1e-3 * np.sin(30 * t)

    twice = "prescribed twice: by a function of time and otherwise"
    for second in (0.0, lambda t: 0.0, 1e-3):
        model = kl.Model(kl.box(), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
        model.fix("z-", "xyz", way)
        with pytest.raises(kl.ModelError, match="prescribed twice"):
            model.fix("x-", "z", second)
        model.fix("x-", "xyz", way)  # the same function, on a common edge
        model.fix("z-", "z", 0.0, override=True)
        *_, end = kl.integrate(model.transient(), 1e-3, 20, every=20)
        bottom, side = model.mesh.nodes("z-"), model.mesh.nodes("x-")
        assert not end.u[bottom, 2].any()
        np.testing.assert_allclose(end.u[bottom, 0], way(end.time), rtol=1e-12)
        np.testing.assert_allclose(end.u[np.setdiff1d(side, bottom), 2], way(end.time), rtol=1e-12)
    held = kl.Model(kl.box(), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
    held.fix("z-", "xyz")
    with pytest.raises(kl.ModelError, match=twice):
        held.fix("z-", "x", way)
    held.fix("z-", "x", way, override=True)


@pytest.mark.parametrize(
    "value", [lambda t: None, lambda t: "far", lambda t: [0.0, 1.0], lambda t: 1j, np.log]
)
def test_nonsense_of_a_moving_support_is_told(value):
    model = kl.Model(kl.box(), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
    with (
        np.errstate(divide="ignore"),
        pytest.raises(kl.InputError, match="a prescribed displacement at t = 0 s"),
    ):
        model.fix("z-", "z", value)


def test_what_is_tied_to_a_support_moves_with_it():
    """A top tied to its moving base is the same body carried as a whole."""
    model = kl.Model(kl.box((1, 1, 1), (1, 1, 2)), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
    model.fix(everywhere, "xy")
    model.fix("z-", "z", lambda t: 1e-2 * np.sin(30 * t))
    base = int(model.mesh.nodes("z-")[0])
    for node in np.flatnonzero(model.mesh.points[:, 2] > 0).tolist():
        model.constrain((node, "z"), {(base, "z"): 1.0})
    for state in kl.integrate(model.transient(), 1e-3, 200):
        np.testing.assert_allclose(state.u[:, 2], 1e-2 * np.sin(30 * state.time), atol=1e-13)
        np.testing.assert_allclose(state.v[:, 2], 0.3 * np.cos(30 * state.time), atol=1e-4)
        np.testing.assert_allclose(state.a[:, 2], -9.0 * np.sin(30 * state.time), atol=2e-3)

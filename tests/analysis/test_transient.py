"""Transients of models: orders, dissipation, energy, supports that move, restart, and what is refused."""

import pickle

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.ale import Rotation
from kratos_lite.analysis.integrators import HHT, Bossak, CentralDifference, GeneralizedAlpha, Newmark
from kratos_lite.analysis.state import State
from kratos_lite.errors import InputError, ModelError
from kratos_lite.time_series import TimeSeries

E, RHO, LENGTH = 1e6, 1000.0, 1.0
INTEGRATORS = {
    "trapezoidal": Newmark(),
    "hht": HHT(-0.1),
    "alpha": GeneralizedAlpha(0.6),
    "bossak": Bossak(-0.1),
    "central": CentralDifference(),
}


def bar(n: int = 4, density: float = RHO) -> kl.Model:
    """Return a bar of unit section along z, clamped below, that strains along z alone."""
    mesh = kl.box((1, 1, LENGTH), (1, 1, n))
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=0.0, density=density))
    model.fix(lambda X: np.ones(len(X), dtype=bool), "xy")
    model.fix("z-", "z")
    return model


def wave(n: int, lumped: bool) -> float:
    """Return the lowest frequency in rad/s of n equal cells: lumped or consistent mass."""
    h, c = LENGTH / n, np.sqrt(E / RHO)
    angle = np.pi / (2 * n)
    if lumped:
        return float(2 * c / h * np.sin(angle / 2))
    return float(c / h * np.sqrt(6 * (1 - np.cos(angle)) / (2 + np.cos(angle))))


def shape(model: kl.Model) -> np.ndarray:
    out = np.zeros_like(model.mesh.points)
    out[:, 2] = np.sin(np.pi * model.mesh.points[:, 2] / (2 * LENGTH))
    return out


def last(transient, dt: float, steps: int) -> State:
    *_, state = kl.integrate(transient, dt, steps, every=steps)
    return state


# ---- one frequency: a closed form --------------------------------------------------------------------


@pytest.mark.parametrize("name", INTEGRATORS)
def test_order_two(name):
    """The lowest mode alone is cos ωt and sin ωt; halved steps give a quarter of the error."""
    model, integrator = bar(), INTEGRATORS[name]
    omega, mode = wave(4, lumped=name == "central"), shape(bar())
    errors = []
    for steps in (64, 128, 256):
        transient = model.transient(integrator=integrator, displacement=mode, velocity=0.5 * omega * mode)
        end = last(transient, 1.3 / omega / steps * 4, steps)
        t = omega * end.time
        u = (np.cos(t) + 0.5 * np.sin(t)) * mode
        v = omega * (-np.sin(t) + 0.5 * np.cos(t)) * mode
        errors.append(np.hypot(np.abs(end.u - u).max(), np.abs(end.v - v).max() / omega))
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (np.abs(rates - 2) < 0.15).all()
    assert errors[-1] < 2e-3


@pytest.mark.parametrize(
    ("name", "share", "angle"),
    [
        ("trapezoidal", 0.3, 2 * np.arctan(0.15)),
        ("trapezoidal", 3.0, 2 * np.arctan(1.5)),
        ("central", 0.2, np.arccos(1 - 0.2**2 / 2)),
    ],
)
def test_a_mode_is_turned_by_the_same_angle_in_each_step(name, share, angle):
    """By 2 atan(ωh/2), and by θ with cos θ = 1 - (ωh)²/2, without loss."""
    model, omega, mode = bar(), wave(4, lumped=name == "central"), shape(bar())
    transient = model.transient(integrator=INTEGRATORS[name], displacement=mode)
    for k, state in enumerate(kl.integrate(transient, share / omega, 20), start=1):
        np.testing.assert_allclose(state.u, np.cos(k * angle) * mode, atol=1e-12)


def amplification(integrator, omega: float, h: float) -> np.ndarray:
    """Return the spectral radius of a step of one mode, from three steps of a bar of one cell."""
    model = bar(1)
    mode = shape(model)
    columns = []
    for start in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
        transient = model.transient(integrator=integrator)
        transient.u, transient.v, transient.a = (
            transient.equations.system.gather(x * s).copy()
            for x, s in zip((mode, mode * omega, mode * omega**2), start, strict=True)
        )
        end = last(transient, h, 1)
        top = np.argmax(mode[:, 2])
        columns.append([end.u[top, 2], end.v[top, 2] / omega, end.a[top, 2] / omega**2])
    return np.abs(np.linalg.eigvals(np.array(columns).T)).max()


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 1.0])
def test_the_highest_frequencies_shrink_by_rho_inf(rho):
    omega = wave(1, lumped=False)
    integrator = GeneralizedAlpha(rho)
    assert amplification(integrator, omega, 1e5 / omega) == pytest.approx(rho, abs=2e-2 if rho == 0 else 1e-3)
    assert amplification(integrator, omega, 1e-2 / omega) == pytest.approx(1.0, abs=1e-6)


def test_spectral_radii_of_hht_and_newmark():
    """The trapezoidal rule loses nothing; HHT's limit for ωh → ∞ with α = -0.1 is 0.9 / 1.1."""
    omega = wave(1, lumped=False)
    for h in (0.1, 1.0, 10.0, 100.0):
        assert amplification(Newmark(), omega, h / omega) == pytest.approx(1.0, abs=2e-6)
        assert amplification(HHT(-0.3), omega, h / omega) < 1.0
        assert amplification(Newmark(0.3025, 0.6), omega, h / omega) < 1.0
    assert amplification(HHT(-0.1), omega, 1e5 / omega) == pytest.approx(0.9 / 1.1, rel=1e-2)
    assert amplification(HHT(0.0), omega, 3.0 / omega) == pytest.approx(1.0, abs=2e-6)


def test_critical_step():
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), kl.Isotropic3D(E=E, nu=0.3, density=RHO))
    model.fix("z-")
    omega = model.modes(54, lumped=True)[0].max()
    transient = model.transient(integrator=CentralDifference())
    with pytest.raises(InputError, match=r"not stable with steps of .* critical step is [\d.e-]+ s"):
        kl.integrate(transient, 2 / omega * 1.3, 10)
    v = np.random.default_rng(0).standard_normal(model.mesh.points.shape)
    safe = model.transient(integrator=CentralDifference(), velocity=v)
    assert np.abs(last(safe, 0.5 / omega, 2000).u).max() < 1.0


# ---- energy and damping --------------------------------------------------------------------------------


def test_energy_of_the_trapezoidal_rule():
    model = kl.Model(kl.box((1, 1, 2), (2, 2, 4)), kl.Isotropic3D(E=E, nu=0.3, density=RHO))
    model.fix("z-")
    x, y, z = model.mesh.points.T
    transient = model.transient(velocity=np.column_stack([z * z, x * z, y * z]))
    start = transient.energy()
    energies = [transient.energy() for _ in kl.integrate(transient, 2.0**-9, 1000, every=100)]
    assert np.abs(np.array(energies) / start - 1).max() < 1e-12


@pytest.mark.parametrize(("alpha", "beta"), [(4.0, 0.0), (0.0, 2e-3), (2.0, 1e-3)])
@pytest.mark.parametrize("name", ["trapezoidal", "central"])
def test_rayleigh_damping(alpha, beta, name):
    """A mode fades as exp(-ξωt), ξ = α/(2ω) + βω/2, and swings with ω sqrt(1 - ξ²)."""
    model = bar()
    omega, mode = wave(4, lumped=name == "central"), shape(model)
    xi = alpha / (2 * omega) + beta * omega / 2
    damped = omega * np.sqrt(1 - xi * xi)
    transient = model.transient(
        integrator=INTEGRATORS[name], displacement=mode, velocity=-xi * omega * mode, rayleigh=(alpha, beta)
    )
    period = 2 * np.pi / damped
    n = 200 if name == "trapezoidal" else 1000
    end = last(transient, period / n, n)
    exact = np.exp(-xi * omega * period)
    np.testing.assert_allclose(
        end.u, exact * mode, atol=2e-3 * exact if name == "trapezoidal" else 1e-2 * exact
    )


# ---- loads and supports in time ------------------------------------------------------------------------


def pulled(factor) -> kl.Model:
    model = bar(1)
    load = kl.Traction("z+", (0.0, 0.0, 1e3))
    model.add(load, amplitude=factor)
    return model


W = wave(1, lumped=False)
RAMP = TimeSeries([0.0, 10 / W], [0.0, 1.0])
LOADS = {  # amplitude, u k / F of one cell from rest, ω h, steps and what they may miss
    "at once": (None, lambda x: 1 - np.cos(x), 0.01, 600, 2e-7),
    "harmonic": (
        lambda t: np.sin(0.6 * W * t),
        lambda x: (np.sin(0.6 * x) - 0.6 * np.sin(x)) / 0.64,
        *(0.005, 1500, 3e-8),
    ),
    "ramp": (RAMP, lambda x: (x - np.sin(x)) / 10, 0.01, 1000, 1e-7),
}


@pytest.mark.parametrize(("factor", "exact", "step", "steps", "off"), LOADS.values(), ids=LOADS)
def test_loads_in_time(factor, exact, step, steps, off):
    for state in kl.integrate(pulled(factor).transient(), step / W, steps, every=steps // 10):
        assert state.u[:, 2].max() == pytest.approx(max(1e3 / E * exact(W * state.time), 0), abs=off)


def test_statics_take_a_load_at_the_time_0():
    shifted = pulled(TimeSeries([0.0, 1.0], [0.25, 1.0]))
    assert shifted.solve().u[:, 2].max() == pytest.approx(0.25e-3, rel=1e-12)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_support_that_moves(name):
    """A base that moves by s(t): the bar of one cell answers m u'' + k u = k s - (m / 2) s''."""
    lumped = name == "central"
    omega = wave(1, lumped)
    drive, amplitude = 0.5 * omega, 1e-3
    model = kl.Model(kl.box((1, 1, LENGTH)), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
    model.fix(lambda X: np.ones(len(X), dtype=bool), "xy")
    model.fix("z-", "z", lambda t: amplitude * np.sin(drive * t))
    h = 0.016 / omega
    end = last(model.transient(integrator=INTEGRATORS[name]), h, 250)
    t, m = end.time, RHO / (2 if lumped else 3)
    push = E + (0 if lumped else RHO / 6 * drive**2)
    A = amplitude * push / (E - m * drive**2)
    exact = A * (np.sin(drive * t) - drive / omega * np.sin(omega * t))
    assert end.u[:, 2].max() == pytest.approx(max(exact, amplitude * np.sin(drive * t)), abs=2e-7)
    bottom = model.mesh.nodes("z-")
    np.testing.assert_allclose(end.u[bottom, 2], amplitude * np.sin(drive * t), atol=1e-15)
    velocity = amplitude * drive * np.cos(drive * t)
    np.testing.assert_allclose(end.v[bottom, 2], velocity, atol=5e-5 * amplitude * drive)


def test_free_fall():
    """No support at all: z = -g t²/2, exact for the trapezoidal rule."""
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), kl.Isotropic3D(E=E, nu=0.3, density=RHO))
    model.add(kl.Gravity((0, 0, -9.81)))
    end = last(model.transient(), 1e-2, 50)
    np.testing.assert_allclose(end.u, np.full_like(end.u, 1.0) * (0, 0, -0.5 * 9.81 * 0.25), atol=1e-9)
    np.testing.assert_allclose(end.v[:, 2], -9.81 * 0.5, rtol=1e-9)
    assert not end.reactions.any()


def test_constraints():
    """Two bars whose tops are tied are one of the mass and stiffness of both."""
    alone = pulled(None)
    mesh = kl.box((2, 1, LENGTH), (2, 1, 1))
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=0.0, density=RHO))
    model.fix(lambda X: np.ones(len(X), dtype=bool), "xy")
    model.fix("z-", "z")
    first, *others = mesh.nodes("z+").tolist()
    for node in others:
        model.constrain((node, "z"), {(first, "z"): 1.0})
    model.add(kl.PointLoad(np.array([first]), (0, 0, 2e3)))
    for a, b in zip(
        kl.integrate(alone.transient(), 1e-3, 50), kl.integrate(model.transient(), 1e-3, 50), strict=True
    ):
        np.testing.assert_allclose(b.u[mesh.nodes("z+"), 2], a.u[:, 2].max(), atol=1e-14)


@pytest.mark.parametrize("tied", [False, True])
def test_reactions_balance_load_and_inertia(tied):
    model = bar(4)
    if tied:  # a point of the top follows one of the middle
        middle, top = (model.mesh.nodes(lambda X, z=z: X[:, 2] == z)[0] for z in (LENGTH / 2, LENGTH))
        model.constrain((top, "z"), {(middle, "z"): 1.0})
    model.add(kl.Gravity((0, 0, -9.81)))
    e = model.transient()
    for state in kl.integrate(e, 1e-3, 20):
        inertia = e.equations.mass.times(e.a).reshape(-1, 3).sum(axis=0)
        total = state.reactions.sum(axis=0) + RHO * np.array([0, 0, -9.81])
        np.testing.assert_allclose(total, inertia, atol=1e-8 * RHO)


# ---- transients that go on --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", INTEGRATORS)
def test_restart_is_the_same_bit_by_bit(name, tmp_path):
    def made():
        model = bar(3)
        model.add(kl.Traction("z+", (0, 0, 1e3)), amplitude=lambda t: np.sin(40 * t))
        model.fix("z-", "z", lambda t: 1e-4 * np.sin(30 * t), override=True)
        return model.transient(integrator=INTEGRATORS[name], rayleigh=(1.0, 1e-4))

    whole = last(made(), 1e-3, 12)
    first = last(made(), 1e-3, 5)
    kl.write(tmp_path / "state.npz", first)
    again = made()
    kl.read_state(tmp_path / "state.npz").restore(again)
    second = last(again, 1e-3, 7)
    for field in ("u", "v", "a", "reactions", "imbalance"):
        assert (getattr(second, field) == getattr(whole, field)).all()
    assert (second.time, second.step) == (whole.time, 12)


@pytest.mark.parametrize("name", ["newmark", "central_difference"])
def test_a_pickled_transient_goes_on_bit_by_bit(name):
    model = kl.Model(kl.box(), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1.0)))
    transient = model.transient(integrator=name)
    last(transient, 1e-3, 3)
    twin = pickle.loads(pickle.dumps(transient))
    np.testing.assert_array_equal(last(twin, 1e-3, 3).u, last(transient, 1e-3, 3).u)


def test_lumped_mass_is_another_frequency():
    mode = shape(bar())
    for lumped in (False, True):
        omega = wave(4, lumped)
        end = last(bar().transient(displacement=mode, lumped=lumped), 2 * np.pi / omega / 250, 250)
        np.testing.assert_allclose(end.u, mode, atol=1e-4)


# ---- what is refused -------------------------------------------------------------------------------------


NO_NEWMARK = (0.0, 0.5), (0.2, 0.5), (0.25, 0.4), ("a",), (0.25, [0.5])


def transient(**options):
    return lambda: bar().transient(**options)


def steps(dt=1e-3, steps=2, **options):
    return lambda: kl.integrate(bar().transient(), dt, steps, **options)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (transient(integrator="newmrk"), r"unknown integrator 'newmrk'\. Did you mean newmark"),
        (transient(integrator=kl.Newmark), "an integrator such as Newmark"),
        (transient(displacement=np.zeros((3, 3))), r"displacement needs shape \(20, 3\); got \(3, 3\)"),
        (transient(velocity=np.full((20, 3), np.nan)), "initial velocity"),
        (transient(rayleigh=(-1.0, 0.0)), "Rayleigh damping is α ≥ 0"),
        (transient(rayleigh=(1.0,)), "Rayleigh damping is α ≥ 0"),
        (transient(lumped="no"), "lumped must be True or False; got 'no'"),
        (steps(0.0), "a step must be one number > 0, in s; got 0.0"),
        (steps(np.nan), "a step"),
        (steps(steps=0), "steps must be a whole number ≥ 1; got 0"),
        (steps(steps=2.5), "steps must be a whole number"),
        (steps(every=0), "every must be a whole number"),
        (steps(1e-300), "a step of 1e-300 s is too short to compute with"),
        (steps("1 ms"), "a step must be made of real numbers; got '1 ms'"),
        *((lambda numbers=numbers: Newmark(*numbers), "Newmark") for numbers in NO_NEWMARK),
        *((lambda alpha=alpha: HHT(alpha), "HHT") for alpha in (0.1, None, np.nan)),
        (lambda: Bossak(-0.4), "the α of Bossak"),
        (lambda: GeneralizedAlpha("0.8"), "generalized-α"),
        (lambda: GeneralizedAlpha(1.5), r"ρ∞ of the generalized-α method lies in 0 … 1; got 1\.5"),
    ],
)
def test_wrong_arguments(call, text):
    with pytest.raises(InputError, match=text):
        call()


def test_central_differences_take_neither_motion_nor_constraints():
    wheel = kl.Model(kl.annulus(0.3, 1.0, 0.2, (1, 24, 1)), kl.Isotropic3D(E=E, nu=0.3, density=RHO))
    wheel.add(Rotation("z", rate=1.0))
    with pytest.raises(ModelError, match="central differences do not take a motion"):
        wheel.transient(integrator=CentralDifference())
    tied = bar()
    top = tied.mesh.nodes("z+").tolist()
    tied.constrain((top[1], "z"), {(top[0], "z"): 1.0})
    with pytest.raises(ModelError, match="central differences do not take constraints"):
        tied.transient(integrator=CentralDifference())

"""Moving bodies in time: another frame of reference, energy, traveling waves."""

import numpy as np
import pytest
from meshes import elsewhere
from rounding import EPS
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import spsolve

import kratos_lite as kl
from kratos_lite.ale import Rotation, Translation
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.bodies.rotations import exp
from kratos_lite.voigt import acoustic_tensor

A = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


# ---- a rate that changes -----------------------------------------------------------------------------

ALPHA, SPAN = 20.0, 0.03


def rate(t):
    return 20 + 15 * np.sin(40 * t)


def acceleration(t):
    return 600 * np.cos(40 * t)


def load(t):
    return np.cos(70 * t)


def shaken_wheel(wheels):
    model = wheels.disk("8N", 1, 12)
    model.add(Rotation("z", rate, acceleration, damping=ALPHA))
    model.add(kl.Traction("z+", (1e3, 2e2, 0.0)), amplitude=load)
    return model


@pytest.fixture(scope="module")
def reference(wheels):
    """Return u at the end, of M u'' + (α M + 2 s S) u' + (K - s² H + (s' + α s) S) u = f by Runge-Kutta."""
    model = shaken_wheel(wheels)
    e = EquationsOfMotion(model)
    free, points = e.system.constraint_map.free, e.system.points
    own = wheels.matrices(model.motion, model)
    take = lambda full: np.kron(full, np.eye(3))[np.ix_(free, free)]  # noqa: E731
    M, S, H = (take(full) for full in (own.M, own.S, own.H))
    K, inverse = e.K.scipy().toarray()[np.ix_(free, free)], np.linalg.inv(M)
    push = model.loads[0].load.forces(model.mesh, model.element_groups()).ravel()[free]

    def slope(t, y):
        u, v = y.reshape(2, -1)
        s, spin = rate(t), acceleration(t)
        carried = -(own.M @ points @ (s * s * A @ A + spin * A).T).ravel()[free]
        force = load(t) * push + carried - ALPHA * (M @ v) - 2 * s * (S @ v)
        return np.concatenate([v, inverse @ (force - K @ u + s * s * (H @ u) - (spin + ALPHA * s) * (S @ u))])

    start = np.zeros(2 * len(free))
    done = solve_ivp(slope, (0, SPAN), start, method="DOP853", rtol=1e-10, atol=1e-14)
    return done.y[: len(free), -1]


@pytest.mark.parametrize(
    "integrator",
    [kl.Newmark(), kl.HHT(-0.3), kl.GeneralizedAlpha(0.3)],
    ids=str,
)
def test_order_two_while_the_rate_changes(integrator, wheels, reference):
    errors = []
    for steps in (100, 200):
        transient = shaken_wheel(wheels).transient(integrator=integrator)
        list(kl.integrate(transient, SPAN / steps, steps, every=steps))
        free = transient.equations.system.constraint_map.free
        errors.append(np.abs(transient.u[free] - reference).max() / np.abs(reference).max())
    assert errors[1] < 4e-3
    assert 1.95 < np.log2(errors[0] / errors[1]) < 2.05


@pytest.mark.parametrize("given", [kl.TimeSeries([0.0, 1.0], [10.0, 40.0]), lambda t: 10 + 30 * t])
def test_the_acceleration_is_the_slope_of_the_rate(given, wheels):
    ends = []
    for acceleration in (30.0, None):
        model = wheels.disk("8N", 1, 12)
        model.add(Rotation("z", given, acceleration))
        *_, end = kl.integrate(model.transient(), 1e-3, 20, every=20)
        ends.append(end.u)
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=1e-9 * np.abs(ends[0]).max())
    steady = model.solve()  # at the time 0, as if the rate stayed
    assert "the rate changes; this is the steady state of 10, as at the time 0" in steady.report.notes
    model.motion = None
    model.add(Rotation("z", 10.0))
    np.testing.assert_array_equal(steady.u, model.solve().u)


def test_kinks_between_the_steps_give_the_whole_impulse(wheels):
    """Σ Δt Euler load is that of the whole change of the rate, wherever its kinks lie."""
    model = wheels.disk("8N", 1, 12)
    model.add(Rotation("z", kl.TimeSeries([0.0, 0.0203, 0.0517], [0.0, 10.0, 3.0])))
    transient, h = model.transient(), 1e-2
    rates = [0.0]
    for state in kl.integrate(transient, h, 8):
        rates.append(transient.equations.rates(state.time)[1])
    first = transient.equations.rates(0.0)[1]
    assert h * (first / 2 + sum(rates[1:])) == pytest.approx(3.0, rel=1e-12)
    assert rates[-1] == 0.0


@pytest.mark.parametrize("integrator", [kl.Newmark(), kl.GeneralizedAlpha(0.5)], ids=str)
def test_restarts_beside_a_kink_of_the_rate_are_bitwise(integrator, wheels, tmp_path):
    def spun_up():
        model = wheels.disk("8N", 1, 12)
        model.add(Rotation("z", kl.TimeSeries([0.0, 0.0203, 0.0517], [0.0, 10.0, 3.0])))
        return model.transient(integrator=integrator)

    *_, whole = kl.integrate(spun_up(), 1e-2, 8)
    for steps in (2, 5):
        *_, half = kl.integrate(spun_up(), 1e-2, steps)
        kl.write(tmp_path / "half.npz", half)
        again = spun_up()
        kl.read_state(tmp_path / "half.npz").restore(again)
        *_, end = kl.integrate(again, 1e-2, 8 - steps)
        for name in ("u", "v", "a", "reactions"):
            np.testing.assert_array_equal(getattr(end, name), getattr(whole, name))


def test_a_constant_acceleration_changes_the_rate():
    for acceleration in (200.0, kl.TimeSeries([0.0, 1.0], [200.0, 200.0])):
        motion = Rotation("z", 10.0, acceleration)
        assert [motion.rate(t) for t in (0.0, 0.5)] == pytest.approx([10.0, 110.0])
        assert motion.acceleration(0.5) == 200.0
        assert not motion.steady


def test_a_rate_that_passes_the_critical_one_is_told_once(wheels, caplog):
    model = wheels.disk("8N", 1, 12)
    model.add(Rotation("z", lambda t: 2000 * t, 2000.0))
    lowest = kl.critical_rate(model)[0]
    transient, before = model.transient(), int(0.9 * lowest / 2)
    list(kl.integrate(transient, 1e-3, before))
    assert not any("critical" in text for text in transient.equations.warnings)
    list(kl.integrate(transient, 1e-3, 10))
    (said,) = [text for text in transient.equations.warnings if "critical" in text]
    assert said.startswith(
        f"at t = {1e-3 * (before + 1):g} s the rate {2 * (before + 1):g} rad/s is near the "
    )
    assert f"critical one, {lowest:.4g} rad/s on this mesh" in said
    assert [record.getMessage() for record in caplog.records] == [said]


# ---- frame invariance --------------------------------------------------------------------------------


def contact(wheels, mesh, turned=0.0):
    """Return a pressure on the rim about the angle -pi/2 in space, on material that has turned clockwise."""

    def pressure(angle):
        away = (angle - turned + np.pi / 2 + np.pi) % (2 * np.pi) - np.pi
        return 1e5 * np.exp(-(away**2) / (2 * 0.15**2))

    return wheels.rim_load(mesh, pressure)


@pytest.mark.parametrize(
    ("element", "cells", "start", "spin", "T", "steps", "tolerance"),
    [
        ("8N", (4, 32), 30.0, 0.0, np.pi / 60, 200, 1.7e-3),
        ("20N", (1, 32), 0.0, 872.664626, 0.03, 100, 5e-6),
    ],
)
def test_the_same_in_axes_that_turn_with_the_material(
    element, cells, start, spin, T, steps, tolerance, wheels
):
    """u(T, X) in space is R w(T, R^T X) of the material: M, G, H, acceleration and loads with all signs."""

    def rate(t):
        return start + spin * t

    def ramp(t):
        return np.sin(np.pi * min(t, 0.02) / 0.04) ** 2

    model = wheels.disk(element, *cells)
    plain = wheels.disk(element, *cells)
    w = wheels.lagrangian(
        plain,
        lambda t: start * t + spin * t * t / 2,
        rate,
        lambda t: spin,
        lambda turned, t: ramp(t) * contact(wheels, plain.mesh, turned),
        T / steps,
        steps,
    )
    model.add(kl.NodalForces(contact(wheels, model.mesh)), amplitude=ramp)
    model.add(Rotation("z", rate=rate, acceleration=spin))
    *_, state = kl.integrate(model.transient(), T / steps, steps, every=steps)
    turn = start * T + spin * T * T / 2
    R = exp(np.array([0.0, 0.0, -turn]))
    X = model.mesh.points
    distance = np.abs((X @ R)[:, None] - X[None]).max(axis=2)
    assert distance.min(axis=1).max() < 1e-6  # a whole number of cells, so that nodes come to nodes
    seen = w[distance.argmin(axis=1)] @ R.T
    assert np.abs(state.u - seen).max() < tolerance * np.abs(seen).max()


def test_a_further_rigid_turn(wheels):
    """u = (R(a) - 1) X is linear, so M u'' + 2 rate G u' + (-rate² H + …) u + loads is M R(angle + a)'' X."""
    model = wheels.disk("8N", 2, 16, hub="free")
    rate, spin, a, da, dda = 3.0, 7.0, 0.4, -2.0, 5.0
    X, M = model.mesh.points, wheels.matrices(Rotation("z"), model)
    m, S = M.M, M.G

    def turn(angle):
        return exp(np.array([0.0, 0.0, -angle]))

    R, first, second = turn(a), A @ turn(a), A @ A @ turn(a)
    u, v, acc = X @ (R - np.eye(3)).T, da * X @ first.T, X @ (dda * first + da * da * second).T
    left = m @ acc + 2 * rate * S @ v + (spin * S - rate**2 * M.H) @ u
    left -= rate**2 * M.terms.centrifugal + spin * M.terms.euler
    expected = m @ (X @ ((spin + dda) * first + (rate + da) ** 2 * second).T)
    r = np.hypot(X[:, 0], X[:, 1])
    inner = (r > 0.3 + 1e-9) & (r < 1.0 - 1e-9)  # H is by parts, with a flux through a polygonal rim
    assert inner.any()
    assert np.abs((left - expected)[inner]).max() < 1e-12 * np.abs(expected).max()


# ---- energy --------------------------------------------------------------------------------------------


STEP = 2.0**-11
"""A step whose powers are numbers without rounding: that of 1/h² and 2/h alone drifts by 1e-16 a step."""


def graded(wheels, **options):
    """Return a wheel at 90 rad/s in motion, whose mesh is no mirror image of itself."""
    model = wheels.disk("8N", 2, 32)
    points = model.mesh.points.copy()
    r, angle = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    angle = angle + 0.4 * np.sin(angle) + 0.25 * np.sin(2 * angle + 0.7)
    points[:, :2] = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    model = elsewhere(model, points)
    model.add(Rotation("z", rate=90.0, **options))
    e = EquationsOfMotion(model)
    model.add(kl.NodalForces(-e.system.scatter(e.inertia_load(0.0))))
    v = np.zeros_like(points)
    v[:, :2] = (r - 0.3)[:, None] * np.column_stack([np.cos(2 * angle), np.sin(3 * angle) + r - 0.3])
    return model.transient(velocity=v)


def test_energy_is_constant_on_a_graded_mesh(wheels):
    transient = graded(wheels)
    start = transient.energy()
    energies = [transient.energy() for _ in kl.integrate(transient, STEP, 500, every=125)]
    assert np.abs(np.array(energies) / start - 1).max() < 500 * EPS  # each step rounds once


def test_energy_grows_without_the_skew_form(wheels):
    transient = graded(wheels, skew=False)
    start = transient.energy()
    *_, _ = kl.integrate(transient, STEP, 1000, every=1000)
    assert transient.energy() > 1.05 * start


# ---- bars ------------------------------------------------------------------------------------------------

BAR = [
    (0.3, 2.078308400527e-03),
    (0.99, 1.485145714961e-02),
]


@pytest.mark.parametrize(("share", "figure"), BAR)
def test_moving_load_on_a_founded_bar(share, figure, wheels):
    """The discrete closed form of 80 hex8 to 1e-11, for a stiffness kv / ρ · M of the foundation."""
    L, n, kv = 20.0, 40, 2e6
    v, c = share * wheels.c_p, wheels.c_p
    model = wheels.bar("8N", 2 * n, L)
    model.add(Translation("x", rate=v, boundaries="fixed"))
    load = 1e5 / 4 * (np.abs(model.mesh.points[:, :1]) < 1e-9) * (1.0, 0, 0)
    e = EquationsOfMotion(model)
    free = e.system.constraint_map.free
    K = (e.matrix(0.0, kv / wheels.steel.density, 0.0, 1.0)).scipy().tocsr()[free][:, free]
    u = spsolve(K.tocsc(), load.ravel()[free])
    D, h = wheels.steel.C[0, 0] * (1 - v * v / c / c), L / n
    alpha, beta = D / h - kv * h / 6, D / h + kv * h / 3
    q = np.arccosh(beta / alpha)
    exact = 1e5 / (2 * (beta - alpha * np.cosh(q)) + 2 * alpha * np.sinh(q) / np.tanh(q * n))
    assert u.max() == pytest.approx(exact, rel=2e-11)
    assert u.max() == pytest.approx(figure, rel=1e-11)


def pulse(x):
    return 1e-3 * np.exp(-(x**2) / (2 * 0.8**2))


WAVES = [
    ("8N", 100, 400, 0.0, (1.5e-2, 2.9e-2, 8.5e-4)),
    ("27N", 50, 400, 0.0, (1.3e-2, 1.1e-3, 1.3e-4)),
    ("8N", 100, 400, 400.0, (1.5e-2, 1.2e-2, 1e-3)),
]


@pytest.mark.parametrize(("element", "n", "steps", "spin", "tolerances"), WAVES)
def test_pulse_through_absorbing_ends(element, n, steps, spin, tolerances, wheels):
    """D'Alembert's two pulses in a window of constant or growing speed; then nothing stays."""
    c, start = wheels.c_p, (0.2 if spin else 0.4) * wheels.c_p
    model = wheels.bar(element, n)
    x = model.mesh.points[:, 0]
    rate = (lambda t: start + spin * t) if spin else start
    model.add(Translation("x", rate=rate, acceleration=spin, boundaries="absorbing"))
    u, v = np.zeros_like(model.mesh.points), np.zeros_like(model.mesh.points)
    u[:, 0], v[:, 0] = pulse(x), -start * x / 0.64 * pulse(x)
    transient = model.transient(displacement=u, velocity=v)
    wanted = iter(tolerances)
    for state in kl.integrate(transient, 0.16 / steps, steps, every=steps // 4):
        z = start * state.time + spin * state.time**2 / 2
        exact = (pulse(x + z - c * state.time) + pulse(x + z + c * state.time)) / 2
        if round(state.time, 6) != 0.12:
            assert np.abs(state.u[:, 0] - exact).max() < next(wanted) * 1e-3


ORTHOTROPIC = kl.Orthotropic3D(4e6, 1e6, 2e6, 0.0, 0.0, 0.0, 5e5, 2e5, 3e5, 1000.0)


@pytest.mark.parametrize("along", "xyz")
@pytest.mark.parametrize("polarised", "xyz")
def test_absorbing_ends_of_an_anisotropic_material(along, polarised):
    """Waves of each polarisation leave along each axis of the material."""
    i, j, n, length = "xyz".index(along), "xyz".index(polarised), 60, 6.0
    size, cells = np.full(3, 0.5), [1, 1, 1]
    size[i], cells[i] = length, n
    mesh = kl.box(tuple(size), tuple(cells), "KinematicLinear3D8N")
    model = kl.Model(mesh, ORTHOTROPIC)
    for axis in set("xyz") - {polarised}:
        model.fix(range(mesh.n_nodes), axis)
    model.add(Translation(along, rate=1e-6, boundaries="absorbing"))
    u = np.zeros_like(mesh.points)
    u[:, j] = np.exp(-(((mesh.points[:, i] - length / 2) / 0.5) ** 2))
    speed = np.sqrt(acoustic_tensor(ORTHOTROPIC.C, np.eye(3)[i])[j, j] / 1000.0)
    transient, h = model.transient(displacement=u), length / n / speed / 2
    start = transient.energy()
    list(kl.integrate(transient, h, int(1.2 * length / speed / h), every=1000))
    assert transient.energy() < 1e-4 * start


def test_pulse_in_a_natural_window_comes_back(wheels):
    model = wheels.bar("8N", 60)
    x = model.mesh.points[:, 0]
    model.add(Translation("x", rate=0.4 * wheels.c_p, boundaries="natural"))
    u, v = np.zeros_like(model.mesh.points), np.zeros_like(model.mesh.points)
    u[:, 0], v[:, 0] = pulse(x), -0.4 * wheels.c_p * x / 0.64 * pulse(x)
    *_, last = kl.integrate(model.transient(displacement=u, velocity=v), 0.16 / 240, 240, every=240)
    assert np.abs(last.u[:, 0]).max() > 2e-4


def test_nothing_is_made_again_when_the_rate_changes(wheels, monkeypatch):
    """Another rate at each step: matrices G and H are assembled once."""
    from kratos_lite.ale import matrices

    made = []
    assemble = matrices.inertia_matrices
    monkeypatch.setattr(matrices, "inertia_matrices", lambda *a: made.append(a[3]) or assemble(*a))
    model = wheels.disk("8N", 2, 12)
    model.add(Rotation("z", rate=lambda t: 10 + 5 * t, acceleration=5.0))
    list(kl.integrate(model.transient(), 1e-3, 10))
    assert sorted("".join(made)) == ["G", "H"]
    made.clear()
    still = wheels.disk("8N", 2, 12)
    still.add(Rotation("z"))
    list(kl.integrate(still.transient(), 1e-3, 10))
    assert not made

"""Loads that a function of the time gives, and Bossak's method."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.model.loads import Load, ScaledLoad
from kratos_lite.time_series import integral_of

STEEL = kl.Isotropic3D(E=2e8, nu=0.3, density=7800.0)


def beam(*loads):
    model = kl.Model(kl.box((4.0, 0.4, 0.4), cells=(8, 1, 1)), STEEL)
    model.fix("x-")
    for load in loads:
        model.add(load)
    return model


def end(model, **options):
    *_, last = kl.integrate(model.transient(**options), dt=1e-3, steps=40)
    return last


@pytest.mark.parametrize("integrator", [kl.Newmark(), kl.HHT(-0.1), kl.GeneralizedAlpha(0.5), kl.Bossak()])
def test_a_timed_load_is_the_varying_one_that_it_repeats(integrator):
    ramp = kl.TimeSeries([0.0, 0.03], [0.0, 2.0])
    timed = kl.TimeDependentLoad(lambda t: kl.Traction("x+", (0.0, 0.0, 1e4 * ramp(t))))
    found = end(beam(timed), integrator=integrator)
    expected = end(beam(ScaledLoad(kl.Traction("x+", (0.0, 0.0, 1e4)), ramp)), integrator=integrator)
    for name in ("u", "v", "a", "reactions"):
        one, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * np.abs(other).max())


class Counted(Load):
    """A load that counts how often its forces are asked for."""

    def __init__(self, load):
        self.load, self.count = load, 0

    def forces(self, mesh, groups):
        self.count += 1
        return self.load.forces(mesh, groups)


def test_forces_are_kept_while_the_load_is_the_same():
    first, second = (Counted(kl.Gravity((0.0, 0.0, g))) for g in (-9.81, 5.0))
    last = end(beam(kl.TimeDependentLoad(lambda t: first if t < 0.02 else second)))
    assert (first.count, second.count) == (1, 1)
    assert np.abs(last.u).max() > 0
    times = []
    end(beam(kl.TimeDependentLoad(times.append)))
    assert len(times) == len(set(times)) == 41  # once for each time


def test_a_load_that_comes_late_finds_all_at_rest_before():
    push = kl.PointLoad("x+", (0.0, 0.0, 10.0), each=True)
    transient = beam(kl.TimeDependentLoad(lambda t: push if t > 0.0105 else None)).transient()
    sizes = [np.abs(state.u).max() for state in kl.integrate(transient, dt=1e-3, steps=20)]
    assert max(sizes[:10]) == 0 < min(sizes[10:])


def test_the_impulse_of_a_moving_load_stays_whatever_its_way():
    """Free body: momentum is the force times the time."""
    rows = np.flatnonzero(np.isclose(beam().mesh.points[:, 1:], 0.0).all(axis=1))

    def load(t):
        return kl.PointLoad(rows[[min(int(t / 5e-3), 8)]], (0.0, 0.0, -1e3))

    model = kl.Model(beam().mesh, STEEL)
    model.add(kl.TimeDependentLoad(load))
    transient = model.transient()
    *_, last = kl.integrate(transient, dt=1e-3, steps=40)
    e = transient.equations
    momentum = e.mass.times(e.system.gather(last.v)).reshape(-1, 3).sum(axis=0)
    assert momentum == pytest.approx([0.0, 0.0, -40.0], abs=1e-9)


def test_at_rest_it_is_that_of_the_time_0():
    timed = kl.TimeDependentLoad(lambda t: kl.Traction("x+", (0.0, 0.0, 1e4 * (1 + t))))
    found, expected = (beam(load).solve().u for load in (timed, kl.Traction("x+", (0.0, 0.0, 1e4))))
    assert np.array_equal(found, expected)
    assert not beam(kl.TimeDependentLoad(lambda t: None)).solve().u.any()


@pytest.mark.parametrize(
    "wrong", [3.0, ScaledLoad(kl.Gravity((0, 0, 1.0)), 1.0), kl.TimeDependentLoad(lambda t: None), [None]]
)
def test_what_is_no_load_is_refused(wrong):
    with pytest.raises(kl.InputError, match=r"the load at t = 0 s must be a PointLoad or another, or None"):
        beam(kl.TimeDependentLoad(lambda t: wrong)).transient()


@pytest.mark.parametrize("load", [3.0, kl.TimeDependentLoad(lambda t: None)])
def test_an_amplitude_is_one_of_a_constant_load(load):
    with pytest.raises(kl.InputError, match="an amplitude multiplies a constant load"):
        ScaledLoad(load, 1.0)


# ---- Bossak ----------------------------------------------------------------------------------------


def test_bossak_with_0_is_the_trapezoidal_rule():
    load = kl.Traction("x+", (0.0, 0.0, 1e4))
    found, expected = end(beam(load), integrator=kl.Bossak(0.0)), end(beam(load))
    assert np.array_equal(found.u, expected.u)


def test_the_integral_of_a_function_of_time_is_exact_for_a_polynomial_of_degree_five():
    found = integral_of(lambda t: 6 * t**5 - 4 * t**3 + 1, -1.0, 2.0)
    assert found == pytest.approx((2**6 - 2**4 + 2) - (1 - 1 - 1), rel=1e-13)

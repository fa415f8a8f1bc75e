"""Frequencies of turning wheels and of moving windows, and the rates at which they lose their stiffness."""

import numpy as np
import pytest
from scipy.linalg import eigh

import kratos_lite as kl
from kratos_lite.ale import Rotation, Translation
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.modal import critical_rate, reduced
from tests.ale.rotating_axes import waves

ANTIPLANE = [180.108469387701, 225.729859510629, 323.298640126683, 434.583943383590, 547.913923852690]


def antiplane(wheels, element, radial, around):
    """Return the annulus whose columns of nodes move along z as one."""
    mesh = kl.annulus(0.3, 1.0, 0.2, (radial, around, 1), f"KinematicLinear3D{element}")
    model = kl.Model(mesh, wheels.steel)
    model.fix(lambda X: np.ones(len(X), dtype=bool), "xy")
    model.fix("inner", "z")
    bottom = mesh.nodes("z-")
    place = {tuple(np.round(mesh.points[i, :2], 9)): int(i) for i in bottom}
    for i in np.setdiff1d(np.arange(mesh.n_nodes), bottom):
        independent = place.get(tuple(np.round(mesh.points[i, :2], 9)))
        assert independent is not None
        if not model.supports.fixed[i, 2]:
            model.constrain((int(i), "z"), {(independent, "z"): 1.0})
    return model


@pytest.mark.parametrize(
    ("element", "radial", "around", "tolerance"), [("8N", 4, 32, 2.1e-2), ("20N", 2, 16, 2e-3)]
)
def test_antiplane_frequencies_are_shifted(element, radial, around, tolerance, wheels):
    """|ω_n ∓ n rate|: the change of frame is all there is for a field without direction."""
    model = antiplane(wheels, element, radial, around)
    model.add(Rotation("z", rate=30.0))
    values, _ = model.complex_modes(18)
    found = np.sort(values.imag[values.imag > 0])
    for n, sign in ((0, 1), (1, -1), (1, 1), (2, -1), (2, 1), (3, -1), (3, 1)):
        exact = ANTIPLANE[n] + sign * 30.0 * n
        assert np.abs(found / exact - 1).min() < tolerance
    assert np.abs(values.real).max() < 5e-10 * np.abs(values).max()


def test_antiplane_critical_rates(wheels):
    """ω_n / n falls with n; that of 3 and 2 waves among the lowest of the mesh."""
    model = antiplane(wheels, "20N", 2, 16)
    model.add(Rotation("z", rate=1.0))
    found = critical_rate(model, 16)
    for n in (1, 2, 3, 4):
        exact = ANTIPLANE[n] / n
        if exact < found.max():
            assert np.abs(found / exact - 1).min() < 6e-3
    assert 102.95 < found[0] < 125


@pytest.mark.parametrize(
    ("element", "radial", "around", "tolerance"), [("20N", 3, 24, 3.5e-3), ("27N", 2, 16, 1e-2)]
)
def test_inplane_frequencies(element, radial, around, tolerance, wheels):
    model = wheels.disk(element, radial, around)
    model.add(Rotation("z", rate=30.0))
    values, _ = model.complex_modes(12)
    found = np.sort(values.imag[values.imag > 0])
    exact = np.concatenate([waves(n, wheels.steel).frequencies(30.0) for n in range(-4, 5)])
    assert len(found) == 6
    assert np.abs(found / np.sort(exact[exact > 0])[:6] - 1).max() < tolerance
    assert np.abs(values.real).max() < 5e-9 * np.abs(values).max()


def test_critical_rates_of_the_wheel(wheels):
    """Torsion is the first to go at 98.05 rad/s, which the centrifugal stress prevents."""
    model = wheels.disk("20N", 2, 16)
    model.add(Rotation("z", rate=1.0))
    found = critical_rate(model, 2)
    assert found[0] == pytest.approx(98.0521409, rel=6e-3)
    assert found[1] > 105
    stiff = wheels.disk("20N", 2, 16)
    stiff.add(Rotation("z", rate=1.0, stiffening=True))
    assert critical_rate(stiff, 1)[0] > 105


def test_critical_speed_of_a_bar_is_that_of_its_waves(wheels):
    """K - v² H = (1 - v²/c²) K entry by entry, so stiffness is lost at c and no sooner."""
    for kind in ("8N", "20N"):
        model = wheels.bar(kind, 6, 3.0, tied="all")
        for end in (-3.0, 3.0):
            model.fix(np.flatnonzero(model.mesh.points[:, 0] == end)[:1], "x")
        model.add(Translation("x", rate=1.0, boundaries="natural"))
        e = EquationsOfMotion(model)
        K = reduced(e, e.matrix(0.0, 0.0, 0.0, 1.0)).toarray()
        plain = reduced(e, e.K).toarray()
        np.testing.assert_allclose(K, (1 - 1 / wheels.c_p**2) * plain, atol=1e-14 * np.abs(plain).max())
        H = (plain - K) * wheels.c_p**2
        np.testing.assert_allclose(H, plain, atol=2e-10 * np.abs(plain).max())
        np.testing.assert_allclose(critical_rate(model, 3), wheels.c_p, rtol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.95])
def test_periodic_window_has_its_discrete_symbol(share, wheels):
    """λ² M + 2 v λ G + K - v² H = 0 of every wave that fits into the window."""
    n, h, c, rho = 12, 0.5, wheels.c_p, wheels.steel.density
    model = wheels.bar("8N", n, n * h / 2, tied="below")
    model.add(Translation("x", rate=share * c, boundaries="periodic"))
    expected = []
    for p in range(n):
        angle = 2 * np.pi * p / n
        M, G = rho * h * (2 + np.cos(angle)) / 3, -1j * rho * np.sin(angle)
        H = rho * (2 - 2 * np.cos(angle)) / h
        expected += list(np.roots([M, 2 * share * c * G, (c * c - (share * c) ** 2) * H]))
    values, _ = model.complex_modes(2 * n)
    top = np.abs(expected).max()
    np.testing.assert_allclose(np.sort(values.imag), np.sort(np.imag(expected)), atol=1e-5 * top)
    moving = np.abs(expected) > 1e-6 * top
    for value in np.array(expected)[moving]:
        assert np.abs(values - value).min() < 1e-11 * top


@pytest.mark.parametrize("rate", [0.0, 1e-3])
def test_repeated_frequencies_are_found_at_rest(rate, monkeypatch):
    """Waves come in pairs that a slow rate splits by n times itself."""
    from kratos_lite.analysis import modal

    monkeypatch.setattr(modal, "DENSE_MODES", 100)
    model = kl.Model(kl.annulus(0.1, 0.3, 0.02, (2, 16, 1)), kl.Isotropic3D(210e9, 0.3, 7850.0))
    model.fix("inner")
    model.add(Rotation("z", rate))
    omega, _ = model.modes(6)
    values, _ = model.complex_modes(8)
    upper = np.sort(values.imag[values.imag > 0])
    np.testing.assert_allclose(upper, omega[: len(upper)], rtol=0, atol=1e-6 * omega[0] + 4 * rate)
    assert len(upper) == 4
    assert np.abs(values.real).max() < 1e-7 * omega[0]


def test_faster_than_its_waves_a_window_is_unstable(wheels):
    for share, stable in ((0.98, True), (1.02, False)):
        model = wheels.bar("8N", 12, 3.0, tied="below")
        model.add(Translation("x", rate=share * wheels.c_p, boundaries="periodic"))
        growth = model.complex_modes(24)[0].real.max()
        assert (growth < 1e-3) if stable else (growth > 50)


def test_free_rotor(wheels):
    """Its rigid rotation grows at its rate, also in time; the centrifugal stress takes the cause away."""
    rate, ends = 30.0, {}
    for stiffening in (False, True):
        model = wheels.disk("8N", 2, 16, hub="free")
        model.add(Rotation("z", rate=rate, stiffening=stiffening))
        e = EquationsOfMotion(model)
        K, M = (reduced(e, e.matrix(0.0, *terms)).toarray() for terms in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
        lowest = eigh(K, M, eigvals_only=True)[0]
        assert lowest == pytest.approx(0.0 if stiffening else -(rate**2), rel=1e-6, abs=1e-5)
        model.add(kl.NodalForces(-e.system.scatter(e.inertia_load(0.0))))
        transient = model.transient(displacement=1e-6 * model.mesh.points[:, [1, 0, 2]] * [1, -1, 0])
        ends[stiffening] = [np.abs(m.u).max() for m in kl.integrate(transient, 2e-3, 150, every=25)]
    assert np.log(ends[False][-1] / ends[False][-3]) / 0.1 == pytest.approx(rate, rel=0.03)
    assert max(ends[True]) < 5e-6

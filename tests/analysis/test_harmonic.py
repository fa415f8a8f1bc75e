"""Harmonic response: closed forms of a mass and a bar, modes against the direct method, and a transient."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError, SolveError

E, RHO = 4e4, 10.0


def bar(n=8, kind="KinematicLinear3D20N"):
    """Return a bar 1 x .1 x .1 that moves along x alone, held at its left end."""
    model = kl.Model(kl.box((1.0, 0.1, 0.1), (n, 1, 1), kind), kl.Isotropic3D(E=E, nu=0.0, density=RHO))
    model.fix(np.arange(model.mesh.n_nodes), "yz")
    model.fix("x-", "x")
    return model


def cantilever(**density):
    material = kl.Isotropic3D(E=E, nu=0.3, **{"density": RHO, **density})
    model = kl.Model(kl.box((1.0, 0.2, 0.1), (4, 1, 1)), material)
    model.fix("x-")
    return model


@pytest.mark.parametrize("method", ["modes", "direct"])
def test_one_mass_in_closed_form(method):
    """One element: k = E A / L, and m = ρ V / 3 of a consistent mass."""
    model = bar(1, "KinematicLinear3D8N")
    end = model.mesh.nodes("x+")
    model.constrain(3 * end[1:], 3 * end[:1])
    model.add(kl.Traction("x+", (2.0, 0, 0)))
    k, m, F, alpha, beta, eta = E * 0.01, RHO * 0.01 / 3, 0.02, 3.0, 1e-3, 0.05
    omega = np.sqrt(k / m) * np.array([0.0, 0.5, 1.0, 3.0])
    u = model.harmonic(omega, rayleigh=(alpha, beta), hysteretic=eta, method=method).at((1, 0.05, 0.05))[:, 0]
    exact = F / (k * (1 + 1j * (eta + omega * beta)) + 1j * omega * alpha * m - omega**2 * m)
    assert np.abs(u - exact).max() < 1e-12 * np.abs(exact).max()
    if method == "modes":
        u = model.harmonic(omega, damping=0.1).at((1, 0.05, 0.05))[:, 0]
        exact = F / (k + 0.2j * omega * np.sqrt(k * m) - omega**2 * m)
        assert np.abs(u - exact).max() < 1e-12 * np.abs(exact).max()


@pytest.mark.parametrize("method", ["modes", "direct"])
def test_bar_under_end_force_and_moved_end(method):
    """u = F / (E A κ) tan κL under a force, u = u0 / cos κL where the other end swings by u0."""
    model, eta = bar(), 0.04
    omega = np.array([10.0, 60.0, 150.0])
    kappa = omega * np.sqrt(RHO / (E * (1 + 1j * eta)))
    load = kl.Traction("x+", (2.0, 0, 0))
    u = model.harmonic(omega, hysteretic=eta, loads=[(load, 3j)], method=method).at((1, 0, 0))[:, 0]
    exact = 3j * 2.0 / (E * (1 + 1j * eta) * kappa) * np.tan(kappa)
    assert np.abs(u / exact - 1).max() < 1e-3
    model.fix("x-", "x", 2e-3, override=True)
    u = model.harmonic(omega, hysteretic=eta, method=method).at([(1, 0, 0), (0, 0, 0)])[..., 0]
    assert np.abs(u[:, 0] / (2e-3 / np.cos(kappa)) - 1).max() < 1e-3
    assert np.abs(u[:, 1] - 2e-3).max() < 1e-15


def test_modes_with_static_correction_are_direct():
    model = cantilever()
    model.add(kl.Traction("x+", (1.0, 2.0, 3.0)))
    model.fix("x-", "z", 1e-3, override=True)
    model.constrain((7, "y"), {(8, "y"): 0.5, (9, "y"): 0.5})
    omega = np.linspace(0.0, 80.0, 4)
    damped = {"rayleigh": (2.0, 1e-4), "hysteretic": 0.02}
    direct = model.harmonic(omega, method="direct", **damped)
    size = np.abs([direct.displacement(i) for i in range(4)]).max()
    for modes, allowed in ((None, 1e-2), (40, 1e-6)):
        found = model.harmonic(omega, modes=modes, **damped)
        off = max(np.abs(found.displacement(i) - direct.displacement(i)).max() for i in range(4))
        assert off < allowed * size
    static = model.solve()
    assert np.abs(model.harmonic(0.0, modes=2).displacement(0) - static.u).max() < 1e-9 * size


def test_a_long_transient_ends_in_the_harmonic_response():
    model, omega = bar(2, "KinematicLinear3D8N"), 70.0
    load = kl.Traction("x+", (2.0, 0, 0))
    model.add(load, amplitude=lambda t: np.cos(omega * t - 0.3))
    dt, per = 2 * np.pi / omega / 60, 60
    states = list(kl.integrate(model.transient(rayleigh=(30.0, 0.0)), dt=dt, steps=6 * per))
    end = model.mesh.nodes("x+")[0]
    last = np.array([(state.time, state.u[end, 0]) for state in states[-per:]])
    swing = 2 * (last[:, 1] * np.exp(-1j * omega * last[:, 0])).mean()
    u = model.harmonic(omega, rayleigh=(30.0, 0.0), loads=[(load, np.exp(-0.3j))]).displacement(0)[end, 0]
    assert abs(swing / u - 1) < 5e-3


def test_curves_tables_and_stresses(tmp_path):
    model = bar()
    model.add(kl.Traction("x+", (2.0, 0, 0)))
    response = model.harmonic([0.0, 20.0, 40.0], damping=0.02)
    columns = response.columns((1, 0, 0))
    assert np.abs(columns["amplitude x [m]"] - np.abs(response.at((1, 0, 0))[:, 0])).max() == 0
    assert np.abs(columns["phase x [rad]"]).max() < 0.2
    assert abs(response.fields(0).stress("element")[:, 0] - 2.0).max() < 1e-9
    assert abs(response.fields(0, np.pi).stress("element")[:, 0] + 2.0).max() < 1e-9
    assert "3, 0 … 40 rad/s" in str(response)
    assert "modes with static correction" in str(response)
    assert "note" not in str(response)
    first = float(model.modes(1)[0][0])
    in_hertz = model.harmonic([0.0, 1.2 * first / (2 * np.pi)], damping=0.02)
    assert f"far below the first mode, {first:g} rad/s; give those in Hz times 2π" in str(in_hertz)
    with pytest.raises(InputError, match=r"in plot\(point, axis, path\), a point must be made of"):
        response.plot("curve.png")
    figure = response.plot((1, 0, 0), "x", tmp_path / "curve.png")
    assert figure.axes[0].lines[0].get_ydata()[-1] == columns["amplitude x [m]"][-1]
    assert (tmp_path / "curve.png").stat().st_size > 1000


def free():
    return kl.Model(kl.box(), kl.Isotropic3D(E=E, nu=0.3, density=RHO))


def plastic():
    model = cantilever()
    model.assign(kl.J2Plasticity3D(E=E, nu=0.3, yield_stress=1.0, density=RHO))
    return model


def moving():
    model = cantilever()
    model.fix("x+", "x", lambda t: t)
    return model


def carried():
    model = cantilever()
    model.add(kl.ale.Translation("x", rate=1e-3))
    return model


@pytest.mark.parametrize(
    ("make", "options", "error", "message"),
    [
        (cantilever, {"frequencies": -1.0}, InputError, "≥ 0"),
        (cantilever, {"frequencies": []}, InputError, "frequencies"),
        (cantilever, {"damping": -0.1}, InputError, "≥ 0"),
        (cantilever, {"damping": 2.0}, InputError, "0.02 for 2 per cent; got 2"),
        (cantilever, {"damping": [0.1, 0.2], "modes": 3}, InputError, "one of each of 3 modes"),
        (cantilever, {"damping": 0.1, "method": "direct"}, InputError, "belong to method='modes'"),
        (cantilever, {"modes": 4, "method": "direct"}, InputError, "belong to method='modes'"),
        (cantilever, {"method": "fft"}, InputError, "method"),
        (cantilever, {"loads": [kl.Temperature(3.0)]}, ModelError, "Temperature.* does not swing"),
        (cantilever, {"loads": [kl.TimeDependentLoad(lambda t: None)]}, ModelError, "does not swing"),
        (cantilever, {"loads": [(kl.Traction("x+", (1.0, 0, 0)), "x")]}, InputError, "complex number"),
        (cantilever, {"loads": kl.Traction("x+", (1.0, 0, 0))}, InputError, "loads must be a list"),
        (free, {"frequencies": [1.0, 0.0], "method": "direct"}, ModelError, "frequency 0 needs supports"),
        (
            cantilever,
            {"loads": [(kl.Traction("x+", (1.0, 0, 0)), 10**400)]},
            InputError,
            "the size of the fac",
        ),
        (lambda: cantilever(density=0.0), {}, ModelError, "needs mass"),
        (free, {}, ModelError, "method='direct' takes alone"),
        (plastic, {}, ModelError, "harmonic response takes linear laws"),
        (moving, {}, ModelError, "function of time is no amplitude"),
        (carried, {}, ModelError, "no motion of the material"),
    ],
)
def test_what_does_not_swing_is_refused(make, options, error, message):
    with pytest.raises(error, match=message):
        make().harmonic(**{"frequencies": [1.0], **options})


def test_what_is_read_is_checked():
    model = cantilever()
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    response = model.harmonic([1.0, 2.0], loads=[(model.loads[0], np.complex64(1j))])
    assert (response.displacement(-1) == response.displacement(1)).all()
    with pytest.raises(InputError, match="the number of a frequency"):
        response.displacement(2)
    with pytest.raises(InputError, match="the phase"):
        response.fields(0, "x")


def test_moved_supports_are_as_exact_as_loads():
    """What their inertia adds to the quasi-static motion is left of the modes beyond; e = (Ω / ω)⁴."""
    model, omega = bar(), np.array([10.0, 60.0, 150.0])
    model.fix("x-", "x", 2e-3, override=True)
    direct = model.harmonic(omega, hysteretic=0.02, method="direct").at((1, 0, 0))[:, 0]
    found = model.harmonic(omega, hysteretic=0.02).at((1, 0, 0))[:, 0]
    assert np.abs(found / direct - 1).max() < 1e-5


@pytest.mark.parametrize("method", ["modes", "direct"])
def test_an_undamped_mode_has_no_response_at_its_frequency(method):
    model = bar(1, "KinematicLinear3D8N")
    model.add(kl.Traction("x+", (2.0, 0, 0)))
    omega = model.modes(1)[0]
    with pytest.raises(SolveError, match=f"frequency {omega[0]:g} rad/s is that of an undamped mode"):
        model.harmonic([omega[0] / 2, omega[0]], method=method)
    near = model.harmonic(omega * (1 + 1e-6), method=method).at((1, 0, 0))[0, 0]
    k = E * 0.01
    assert abs(near / (-0.02 / (2e-6 * k)) - 1) < 1e-3
    assert np.isfinite(model.harmonic(omega, method=method, rayleigh=(1.0, 0.0)).at((1, 0, 0))).all()


@pytest.mark.parametrize("method", ["modes", "direct"])
def test_the_summary_finds_the_peak_without_all_displacements(method, monkeypatch):
    model = bar(2)
    model.add(kl.Traction("x+", (2.0, 0, 0)))
    omega = np.linspace(0.0, 150.0, 31)
    response = model.harmonic(omega, hysteretic=0.1, method=method)
    size = [np.linalg.norm(response.displacement(i), axis=1).max() for i in range(31)]
    asked, plain = [], type(response).displacement
    monkeypatch.setattr(type(response), "displacement", lambda *a: asked.append(a) or plain(*a))
    top = int(np.argmax(size))
    assert f"{size[top]:.6e} m at {omega[top]:g} rad/s" in str(response)
    assert len(asked) == 1


def test_a_free_body_swings_directly():
    """Along x, (-Ω² m) u = F."""
    model = free()
    model.add(kl.Gravity((3.0, 0, 0)))
    u = model.harmonic(0.5, method="direct").displacement(0)
    assert np.abs(u - [-3.0 / 0.25, 0, 0]).max() < 1e-3

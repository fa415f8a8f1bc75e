"""Steady motion: what rests in space while its material turns, against closed forms and spectral figures."""

import numpy as np
import pytest
from scipy.special import jv, yv

import kratos_lite as kl
from kratos_lite.ale import Rotation, Translation
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from tests.ale.rotating_axes import waves

E_PLANE, NU_PLANE = 210e6 / (1 - 0.3**2), 0.3 / 0.7
A, B, RHO = 0.3, 1.0, 7620.0


def spinning_load(r, rate):
    """Growth of a free plane annulus under the centrifugal load alone (a1)."""
    n, squares = NU_PLANE, A * A + B * B
    shape = (3 + n) * (1 - n) * squares + (1 + n) * (3 + n) * (A * B / r) ** 2 - (1 - n * n) * r * r
    return RHO * rate**2 * r / (8 * E_PLANE) * shape


def with_softening(r, rate, c_p, clamped):
    """Growth with the inertia of the growth itself (a2): u = -r + C1 J1(kr) + C2 Y1(kr)."""
    lam, mu, k = 1.211538461538462e8, 8.076923076923077e7, rate / c_p

    def stress(f, x):  # of u = f(1, k x)
        slope = k * f(0, k * x) - f(1, k * x) / x
        return (lam + 2 * mu) * slope + lam * f(1, k * x) / x

    rows = [[jv(1, k * A), yv(1, k * A)] if clamped else [stress(jv, A), stress(yv, A)]]
    rows.append([stress(jv, B), stress(yv, B)])
    right = [A if clamped else 2 * (lam + mu), 2 * (lam + mu)]
    c1, c2 = np.linalg.solve(rows, right)
    return -r + c1 * jv(1, k * r) + c2 * yv(1, k * r)


def free_hub(wheels, element, radial, around):
    """Return a wheel held by its symmetry."""
    return held_by_symmetry(wheels, wheels.disk(element, radial, around, hub="free"))


def held_by_symmetry(wheels, model):
    """Hold four points of the hub along their tangents; return the model."""
    r, angle, *_ = wheels.polar(model.mesh, np.zeros_like(model.mesh.points))
    for k, axis in enumerate("yxyx"):
        turned = np.abs(np.angle(np.exp(1j * (angle - k * np.pi / 2)))) < 1e-9
        model.fix(turned & (r < A + 1e-9), axis)
    return model


def test_the_closed_forms_are_those_of_the_tables(wheels):
    assert spinning_load(1.0, 30.0) == pytest.approx(6.53796e-3, rel=1e-12)
    assert spinning_load(0.65, 30.0) == pytest.approx(6.84285525e-3, rel=1e-12)
    table = {(60.0, 1.0, False): 2.717507462417e-02, (30.0, 0.65, True): 2.814535560453e-03}
    for (rate, r, clamped), u in table.items():
        assert with_softening(r, rate, wheels.c_p, clamped) == pytest.approx(u, rel=1e-10)


CASES = [("8N", 4, 32, 3.5e-2), ("20N", 4, 32, 1.05e-3)]


@pytest.mark.parametrize(("element", "radial", "around", "tolerance"), CASES)
def test_growth_with_a_free_hub(element, radial, around, tolerance, wheels):
    model = free_hub(wheels, element, radial, around)
    model.add(Rotation("z", rate=30.0))
    r, _, radial_u, tangential = wheels.polar(model.mesh, model.solve().u)
    exact = with_softening(r, 30.0, wheels.c_p, clamped=False)
    assert np.abs(radial_u / exact - 1).max() < tolerance
    assert np.abs(tangential).max() < 1e-6 * exact.max() + 1e-4 * tolerance


def test_figures_of_getfem(wheels):
    """An independent program gives the same numbers on the same meshes."""
    for element, expected in (("8N", 3.367005917789e-03), ("20N", 3.406360604829e-03)):
        model = wheels.disk(element, 4, 32)
        model.use_rule(4 if element == "20N" else 3)
        model.add(Rotation("z", rate=30.0))
        tip = model.solve().u[np.argmax(model.mesh.points[:, 0])]
        assert tip[0] == pytest.approx(expected, rel=1e-11 if element == "8N" else 1e-7)


def test_h_is_there_with_its_sign(wheels):
    """The load alone (a1) gives 0.95 % less at the rim than the load with -rate² H (a2)."""
    model = free_hub(wheels, "20N", 4, 32)
    model.add(Rotation("z", rate=30.0))
    with_h = model.solve().u
    load = EquationsOfMotion(model)
    nodal = load.system.scatter(load.inertia_load(0.0))
    plain = free_hub(wheels, "20N", 4, 32)
    plain.add(kl.NodalForces(nodal))
    tip = int(np.argmax(model.mesh.points[:, 0]))
    alone = plain.solve().u[tip, 0]
    assert alone == pytest.approx(spinning_load(1.0, 30.0), rel=1.1e-3)
    gap = with_h[tip, 0] / alone - 1
    assert gap == pytest.approx(6.600028313133e-03 / 6.53796e-03 - 1, abs=2e-5)
    assert gap == pytest.approx(0.0095, abs=1e-4)


def test_a_long_cylinder_with_free_ends(wheels):
    """The load alone, in generalized plane strain: ε_z = -ν ρ rate² (A² + B²) / 2 E."""
    spinning = wheels.disk("20N", 2, 16)
    spinning.add(Rotation("z", rate=30.0))
    e, mesh = EquationsOfMotion(spinning), spinning.mesh
    model = held_by_symmetry(wheels, kl.Model(mesh, wheels.steel))
    model.fix("z-", "z")
    top, *others = mesh.nodes("z+").tolist()
    for node in others:
        model.constrain((node, "z"), {(top, "z"): 1.0})
    model.add(kl.NodalForces(e.system.scatter(e.inertia_load(0.0))))
    u, strain = model.solve().u, -0.3 * RHO * 30.0**2 * (A * A + B * B) / 2 / 210e6
    assert u[top, 2] / 0.2 == pytest.approx(strain, rel=5e-3)
    assert u[np.argmax(mesh.points[:, 0]), 0] == pytest.approx(
        spinning_load(B, 30.0) - 0.3 * strain, rel=5e-3
    )


def test_orders_of_growth(wheels):
    """Halved cells: errors fall by 4 for hex8 (order 2), and by 8 and more for hex20."""
    for element, sizes, order in (("8N", (4, 8), 1.7), ("20N", (2, 4), 2.8)):
        errors = []
        for n in sizes:
            model = wheels.disk(element, n, 8 * n)
            model.add(Rotation("z", rate=30.0))
            r, _, u, _ = wheels.polar(model.mesh, model.solve().u)
            exact = with_softening(r, 30.0, wheels.c_p, clamped=True)
            errors.append(np.abs(u - exact).max() / exact.max())
        assert np.log2(errors[0] / errors[1]) > order
        assert errors[1] < (2e-4 if element == "20N" else 1e-2)


# ---- a load fixed in space -----------------------------------------------------------------------------


def under_rim_load(wheels, element, radial, around, pressure, rate, damping=0.0):
    """Return mesh and displacements under a rim load alone: those with it less those without."""
    found = []
    for share in (1.0, 0.0):
        model = wheels.disk(element, radial, around)
        model.add(kl.NodalForces(share * wheels.rim_load(model.mesh, pressure)))
        model.add(Rotation("z", rate=rate, damping=damping))
        found.append(model.solve())
    return model.mesh, found[0].u - found[1].u


def amplitudes(wheels, mesh, u, n):
    """Return the complex amplitudes of e^{i n angle} of u_r and u_phi on the rim, by the corner nodes."""
    _, angle, radial, tangential = wheels.polar(mesh, u)
    rim = mesh.nodes("outer")
    rim = rim[mesh.points[rim, 2] == 0]
    order = rim[np.argsort(angle[rim])]
    wave = np.exp(-1j * n * angle[order]) * (1 if n == 0 else 2) / len(order)
    return radial[order] @ wave, tangential[order] @ wave


WAVES = [(1, 30.0, 0.0), (2, 0.0, 0.0), (2, 60.0, 0.0), (4, 60.0, 0.0), (2, 30.0, 20.0), (3, 30.0, 20.0)]


@pytest.mark.parametrize(("n", "rate", "damping"), WAVES)
def test_pressure_waves_fixed_in_space(n, rate, damping, wheels):
    """Imaginary parts, which damping alone gives, have another sign if G has: to their own digits."""
    mesh, u = under_rim_load(wheels, "20N", 4, 32, lambda a: 1e5 * np.cos(n * a), rate, damping)
    radial, tangential = amplitudes(wheels, mesh, u, n)
    expected = waves(n, wheels.steel).steady(rate, 1e5, damping)
    assert abs(radial - expected[0]) < 1.3e-3 * abs(expected[0])
    assert abs(tangential - expected[1]) < 1.3e-3 * abs(expected[0])
    if damping:
        assert radial.imag == pytest.approx(expected[0].imag, rel=1e-2)
        assert tangential.real == pytest.approx(expected[1].real, rel=1e-2)


def test_the_reference_has_the_figures_of_a_spectral_code(wheels):
    expected = -2.873246732120e-04 - 2.243668094960e-06j, -2.093659449530e-07 - 1.737186794311e-05j
    found = waves(3, wheels.steel).steady(30.0, 1e5, 20.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("n", "critical"), [(3, 145.8091), (4, 130.5131)])
def test_the_answer_changes_sign_at_the_critical_rate(n, critical, wheels):
    found = []
    for share in (0.995, 1.005):
        mesh, u = under_rim_load(wheels, "20N", 4, 32, lambda a: 1e5 * np.cos(n * a), share * critical)
        found.append(amplitudes(wheels, mesh, u, n)[0].real)
    assert found[0] < -4e-3
    assert found[1] > 4e-3


def contact(angle):
    """A localised pressure at the lowest point."""
    return 1e5 * np.exp(-((angle + np.pi / 2) ** 2) / (2 * 0.15**2))


def test_a_localised_contact_fixed_in_space(wheels):
    mesh, u = under_rim_load(wheels, "20N", 4, 32, contact, 30.0, damping=20.0)
    _, angle, *of_mesh = wheels.polar(mesh, u)
    rim, grid = mesh.nodes("outer"), np.linspace(-np.pi, np.pi, 512, endpoint=False)
    exact = np.zeros((2, len(rim)))
    for n in range(25):
        push = (1 if n == 0 else 2) * (contact(grid) * np.exp(-1j * n * grid)).mean()
        answer = waves(n, wheels.steel).steady(30.0, push, 20.0)
        exact += np.outer(answer, np.exp(1j * n * angle[rim])).real
    assert np.abs(np.array(of_mesh)[:, rim] - exact).max() < 1.5e-2 * np.abs(exact).max()


def test_the_report_names_the_way_of_solving(wheels):
    model = wheels.disk("8N", 2, 16)
    model.add(Rotation("z", rate=30.0, damping=20.0))
    assert model.solve().report.reason == "the matrix of a motion with damping is not symmetric"
    still = wheels.disk("8N", 2, 16)
    still.add(kl.Gravity((0, -9.81, 0)))
    still.add(Rotation("z"))
    result = still.solve()
    assert result.report.skipped == ["convective terms, as the rate is 0"]
    plain = wheels.disk("8N", 2, 16)
    plain.add(kl.Gravity((0, -9.81, 0)))
    np.testing.assert_allclose(result.u, plain.solve().u, atol=1e-12 * np.abs(result.u).max())


def test_hub_reactions(wheels):
    """Forces of the hub balance those of the load but for what the curved motion of the mass asks for."""
    model = wheels.disk("20N", 3, 24)
    model.add(kl.NodalForces(wheels.rim_load(model.mesh, contact)))
    model.add(Rotation("z", rate=30.0))
    result = model.solve()
    total = wheels.rim_load(model.mesh, contact).sum(axis=0)
    np.testing.assert_allclose(result.reactions.sum(axis=0), -total, atol=1e-8 * np.abs(total).max())


# ---- a window with damping -----------------------------------------------------------------------------


@pytest.mark.parametrize(("rate", "ends"), [(40.0, "natural"), (-40.0, "absorbing")])
def test_a_damped_window_has_its_closed_form(rate, ends, wheels):
    """(Mc - ρ v²) u'' + ρ α v u' + f = 0 with u(0) = 0 and u'(L) = 0."""
    rho, length, alpha, f = wheels.steel.density, 10.0, 60.0, 1e5
    D, b = wheels.steel.C[0, 0] - rho * rate**2, rho * alpha * rate

    def exact(x):
        return f / b * (np.exp(b * length / D) * (-D / b) * (np.exp(-b * x / D) - 1) - x)

    errors = []
    for n in (20, 40):
        model = wheels.bar("8N", n, length / 2)
        model.fix("x-", "x")
        model.add(kl.BodyForce((f, 0, 0)))
        model.add(Translation("x", rate=rate, boundaries=ends, damping=alpha))
        u, x = model.solve().u[:, 0], model.mesh.points[:, 0] + length / 2
        errors.append(np.abs(u - exact(x)).max() / np.abs(exact(x)).max())
    assert errors[1] < 2e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("share", [0.3, 0.97, 1.3])
def test_multigrid_of_the_body_at_rest_comes_to_what_factors_give(share, wheels, monkeypatch):
    # Beyond the critical rate the matrix is not positive definite any more.
    monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", 0)

    def turning(rate):
        model = wheels.disk("20N", 2, 16)
        model.add(kl.Pressure("outer", lambda X: 1e5 * (1 + X[:, 0] * X[:, 1])))
        model.add(Rotation("z", rate=rate, stiffening=True))
        return model

    (critical,) = kl.critical_rate(turning(1.0))
    model = turning(share * critical)
    found, exact = model.solve(), model.solve(solver="direct")
    assert found.report.iterations > 0 or share > 1
    assert found.report.motion["critical_rate"] == pytest.approx(critical, rel=1e-6)
    assert np.abs(found.u - exact.u).max() < 1e-8 * np.abs(exact.u).max()


def test_a_beam_on_an_elastic_bed_sinks_below_a_moving_load():
    """w = P β / 2 k √(1 - (v / v_cr)²) at the load, v_cr⁴ = 4 k E I / (ρ A)², 4 β⁴ = k / E I.

    Source: Frýba, Vibration of Solids and Structures under Moving Loads (1999), chapter 13.
    """
    E, rho, h, k, P, share = 210e9, 7850.0, 0.1, 1e7, 1e3, 0.6  # k in N/m²
    EI, mass = E * h**4 / 12, rho * h**2
    beta, critical = (k / EI / 4) ** 0.25, (4 * k * EI / mass**2) ** 0.25
    length = 4 * 2 * np.pi / beta / 2**0.5  # waves at the critical speed
    mesh = kl.box((length, h, h), (60, 1, 1), "KinematicLinear3D20N", origin=(-length / 2, 0, 0))
    model = kl.Model(mesh, kl.Isotropic3D(E, 0.0, rho))
    model.fix("y-", "y")
    model.fix((-length / 2, 0.0, 0.0), "x")
    model.add(kl.ElasticSupport("z-", (0.0, 0.0, k / h)))
    model.add(kl.PointLoad((0.0, h / 2, h), (0.0, 0.0, -P)))
    model.add(Translation("x", rate=share * critical, boundaries="periodic"))
    result = model.solve()
    sunk = P * beta / 2 / k / np.sqrt(1 - share**2)
    assert result.at((0.0, h / 2, h / 2)).displacement[2] == pytest.approx(-sunk, rel=1e-2)
    assert result.report.motion["critical_rate"] == pytest.approx(critical, rel=1e-2)
    assert result.reaction("z-")[:, 2].sum() == pytest.approx(P, rel=1e-8)


@pytest.mark.parametrize("stiffening", [False, True])
def test_a_hub_on_hard_springs_is_a_fixed_one(stiffening, wheels):
    models = []
    for hub in ("fixed", "springs"):
        model = kl.Model(kl.annulus(0.3, 1.0, 0.25, (1, 12, 1)), wheels.steel)
        if hub == "fixed":
            model.fix("inner")
        else:
            model.add(kl.ElasticSupport("inner", (1e15, 1e15, 1e15)))
        model.add(kl.Traction("outer", lambda X: 1e4 * (1 + X[:, 1:2]) * [1.0, 2.0, 0.5]))
        model.add(Rotation("z", rate=20.0, stiffening=stiffening, damping=20.0))
        models.append(model)
    results = [model.solve() for model in models]
    states = [list(kl.integrate(model.transient(), dt=1e-3, steps=2))[-1] for model in models]
    for fixed, sprung in (results, states):
        assert np.abs(sprung.u - fixed.u).max() < 1e-5 * np.abs(fixed.u).max()
    resultants = [kl.reaction_resultant(*pair) for pair in zip(models, results, strict=True)]
    for fixed, sprung in zip(*resultants, strict=True):
        assert np.abs(sprung - fixed).max() < 1e-5 * np.abs(fixed).max()
    assert not any("nothing holds" in text for text in results[1].report.warnings)

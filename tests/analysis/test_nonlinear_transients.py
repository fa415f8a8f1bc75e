"""Transients of laws that are not linear beside linear ones, differential equations and waves; restart."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError, SolveError

IMPLICIT = (kl.Newmark(), kl.HHT(-0.1), kl.Bossak(-0.1), kl.GeneralizedAlpha(0.8))
INTEGRATORS = (*IMPLICIT, kl.CentralDifference())
RUBBER = kl.NeoHookean3D(1e6, 0.3, density=1000.0)
Y, H = 2e6, 1e8
METAL = kl.J2Plasticity3D(1e9, 0.0, Y, H, density=1000.0)


@dataclass(frozen=True)
class Hooke(kl.Material):
    """The linear law as one of those that may be anything."""

    E: float
    nu: float
    density: float = 0.0

    def response(self, strain, state, dt):
        C = kl.Isotropic3D(self.E, self.nu).C
        return strain @ C, np.broadcast_to(C, (*strain.shape, 6)), {}


def held(material, cells, size=(1, 1, 1), **options):
    """Return a bar along z that is strained in this direction alone."""
    mesh = kl.box(size, cells, "Element3D8N")
    model = kl.Model(mesh, material, **options)
    model.fix(lambda X: np.ones(len(X), dtype=bool), "xy")
    return model


def after(transient, dt, count, **options):
    """Return the state after some steps."""
    *_, state = kl.integrate(transient, dt, count, every=count, **options)
    return state


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=str)
def test_a_linear_law_moves_as_the_linear_model(integrator):
    found = []
    for law in (Hooke(1e6, 0.3, 1000.0), kl.Isotropic3D(1e6, 0.3, 1000.0)):
        model = kl.Model(kl.box((1, 1, 2), (1, 1, 2), "KinematicLinear3D8N"), law)
        model.fix("z-", "xyz", lambda t: 0.1 * np.sin(20 * t) ** 2)
        if integrator in IMPLICIT:
            last = model.mesh.n_nodes - 1
            model.constrain((last - 1, "x"), {(last, "y"): 0.5})
        model.add(kl.Traction("z+", (1e3, 0, 1e4)), amplitude=lambda t: 1 + t)
        transient = model.transient(integrator=integrator, rayleigh=(1.0, 1e-3))
        state = after(transient, 2e-3, 10, substeps=4)
        found.append([*(state.values[name] for name in ("u", "v", "a", "reactions")), transient.energy()])
    for one, other in zip(*found, strict=True):
        assert np.abs(one - other).max() < 1e-6 * np.abs(other).max() > 0


def swung(integrator, count):
    """Return the end of a struck body of rubber after so many steps, and the drift of its energy."""
    model = kl.Model(kl.box((1, 1, 1), (1, 1, 2), "Element3D8N"), RUBBER)
    model.fix("z-")
    z = model.mesh.points[:, 2:]
    transient = model.transient(velocity=np.hstack([3 * z * z, 0 * z, 8 * z]), integrator=integrator)
    start = transient.energy()
    return after(transient, 0.02 / count, count).u, abs(transient.energy() / start - 1)


@pytest.fixture(scope="module")
def consistent():
    """Return the end by steps so short that their error does not count."""
    return swung(kl.Newmark(), 128)[0]


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=str)
def test_order_and_energy_of_a_hyperelastic_body(integrator, consistent):
    exact = consistent if integrator in IMPLICIT else swung(integrator, 128)[0]  # which lumps the mass
    (fine, small_drift), (coarse, drift) = (swung(integrator, count) for count in (32, 16))
    ratio = np.abs(coarse - exact).max() / np.abs(fine - exact).max()
    assert np.abs(coarse - exact).max() < 0.01 * np.abs(exact).max() > 1e-3
    assert 3.5 < ratio < 4.8
    assert drift < 5e-3
    assert 3 < drift / small_drift < 5


@pytest.mark.parametrize("integrator", [kl.Newmark(), kl.CentralDifference()], ids=str)
def test_one_element_of_rubber_swings_as_the_differential_equation_says(integrator):
    model = held(RUBBER, (1, 1, 1))
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 3e5)))
    lam, mu = 0.3e6 / 1.3 / 0.4, 1e6 / 2.6

    def rate(t, x):
        stretch = 1 + x[0]
        stress = mu * (stretch - 1 / stretch) + lam * np.log(stretch) / stretch
        return x[1], (3e5 - stress) / 500.0

    exact = solve_ivp(rate, (0, 0.1), (0, 0), rtol=1e-11, atol=1e-13).y[:, -1]
    state = after(model.transient(integrator=integrator, lumped=True), 4e-4, 250)
    assert abs(state.u[:, 2].max() - exact[0]) < 1e-4 * abs(exact[0])
    assert abs(state.v[:, 2].min() - exact[1]) < 1e-3 * abs(exact[1])


@pytest.mark.parametrize("integrator", [kl.Newmark(), kl.CentralDifference()], ids=str)
def test_one_element_of_glue_dies_out_as_the_differential_equation_says(integrator):
    """Of a Maxwell element beside a spring: s' = w E x' - s / τ."""
    model = held(kl.GeneralizedMaxwell3D(1e6, 0.0, 0.5, 0.02, density=1000.0), (1, 1, 1))
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1e4)))

    def rate(t, x):
        return x[1], (1e4 - 5e5 * x[0] - x[2]) / 500.0, 5e5 * x[1] - x[2] / 0.02

    exact = solve_ivp(rate, (0, 0.1), (0, 0, 0), rtol=1e-11, atol=1e-13).y[:, -1]
    state = after(model.transient(integrator=integrator, lumped=True), 1e-3, 100)
    assert abs(state.u[:, 2].max() - exact[0]) < 5e-4 * abs(exact[0])
    assert abs(np.abs(state.v[:, 2]).max() - abs(exact[1])) < 5e-3 * abs(exact[1])


@pytest.mark.parametrize("integrator", [kl.CentralDifference(), kl.GeneralizedAlpha(0.5)], ids=str)
def test_a_struck_bar_yields_behind_a_slower_wave(integrator):
    """An elastic wave of the yield stress, and a plastic one whose speed is that of the tangent modulus."""
    E, rho, n = METAL.E, METAL.density, 100
    shear, bulk = E / 2, E / 3
    tangent = bulk + 4 / 3 * shear * H / (3 * shear + H)
    elastic, plastic = np.sqrt(E / rho), np.sqrt(tangent / rho)
    struck = 3 * Y / (rho * elastic)
    model = held(METAL, (1, 1, n), (0.01, 0.01, 1.0))
    model.fix("z-", "z", lambda t: struck * t)
    h = (0.5 if isinstance(integrator, kl.CentralDifference) else 1.0) / n / elastic
    count = round(0.7 / elastic / h)
    transient = model.transient(integrator=integrator)
    after(transient, h, count)
    result, time = transient.result(), count * h
    stress = np.asarray(result.stress("element"))[:, 2]
    z = (np.arange(n) + 0.5) / n
    behind = Y + rho * plastic * (struck - Y / (rho * elastic))
    between = (z > plastic * time + 0.08) & (z < elastic * time - 0.08)
    assert between.sum() > 10
    assert abs(-stress[z < plastic * time - 0.1].mean() / behind - 1) < 0.01
    assert abs(-stress[between].mean() / Y - 1) < 0.05
    assert np.abs(stress[z > elastic * time + 0.06]).max() < 0.02 * Y
    flow = transient.equations.history.states[0].variables["plastic_strain"]
    flow = np.abs(flow).reshape(n, -1).max(axis=1)
    front = z[flow > 0.5 * flow[:40].mean()].max()
    assert abs(front / (plastic * time) - 1) < 0.05


@pytest.mark.parametrize("integrator", [kl.HHT(-0.1), kl.CentralDifference()], ids=str)
@pytest.mark.parametrize("law", [METAL, kl.GeneralizedMaxwell3D(1e9, 0.2, 0.5, 2e-3, density=1000.0)])
def test_restart_goes_on_bit_by_bit(law, integrator):
    model = kl.Model(kl.box((1, 1, 2), (1, 1, 2), "Element3D8N"), law)
    model.fix("z-", "xyz", lambda t: 0.02 * np.sin(1e3 * t))
    model.add(kl.Traction("z+", (3e5, 0, 1e6)))
    whole, again = (model.transient(integrator=integrator) for _ in range(2))
    states = list(kl.integrate(whole, 1e-4, steps=12, every=3, substeps=2))
    states[1].restore(again)
    last = after(again, 1e-4, 6, substeps=2)
    for name, value in last.values.items():
        assert (np.asarray(value) == np.asarray(states[-1].values[name])).all(), name
    assert np.abs(whole.equations.history.states[0].stress).max() > 0.1 * Y
    now = whole.energy()
    stress = whole.result(states[0]).stress("element")
    assert np.abs(stress).max() > 0
    assert np.abs(stress - whole.result().stress("element")).max() > 0.01 * np.abs(stress).max()
    assert whole.energy() == now
    assert whole.energy(states[0]) != now
    other = kl.Model(model.mesh, kl.Isotropic3D(1e9, 0.2, 1000.0))
    with pytest.raises(InputError, match="does not fit"):
        other.transient().state().restore(again)


@pytest.mark.parametrize("direct", [0, 10_000], ids=["multigrid", "factors"])
def test_a_block_comes_to_rest_where_statics_has_it(direct, monkeypatch):
    """Under a pressure that follows its faces."""
    monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", direct)
    model = kl.Model(kl.box((1, 1, 2), (2, 2, 2), "Element3D8N"), RUBBER)
    model.fix("z-")
    model.add(kl.Pressure("x+", 6e4, follower=True))
    transient = model.transient(rayleigh=(15.0, 5e-3), integrator=kl.GeneralizedAlpha(0.2))
    after(transient, 0.1, 40)
    result, static = transient.result(), model.solve()
    assert np.abs(static.u).max() > 1.0
    assert np.abs(result.u - static.u).max() < 1e-5
    assert np.abs(result.report.total_load - static.report.total_load).max() < 1.0
    assert np.abs(result.report.total_load + result.report.total_reaction).max() < 1.0
    assert abs(static.report.total_load[2]) > 1e3  # as the face has turned


def test_a_step_without_a_solution_is_not_taken():
    model = held(RUBBER, (1, 1, 2))
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, -1e9)), amplitude=lambda t: float(t > 0.025))
    transient = model.transient()
    with pytest.raises(SolveError, match=r"from t = 0\.02 s .* smaller steps"):
        after(transient, 0.01, 5)
    before = transient.state()
    assert abs(before.time - 0.02) < 1e-12
    after(transient, 1e-4, 1)
    before.restore(transient)
    after(transient, 1e-4, 1)


def test_a_step_in_which_laws_do_not_converge_is_cut(caplog):
    tops = []
    for h in (0.02, 1e-3):
        model = held(RUBBER, (1, 1, 2))
        model.fix("z-")
        model.add(kl.Traction("z+", (0, 0, -2e6)))
        with caplog.at_level("INFO"):
            tops.append(after(model.transient(), h, round(0.02 / h)).u[:, 2].min())
        assert "is cut to 0.5" in caplog.text
    assert abs(tops[0] - tops[1]) < 0.08 * abs(tops[1])  # -.684 and -.726 m


def test_motions_of_the_material_take_linear_laws_alone():
    mesh = kl.annulus(0.3, 1.0, 0.1, cells=(1, 16, 1), element="Element3D8N")
    for law, name in ((RUBBER, "NeoHookean3D"), (METAL, "J2Plasticity3D")):
        model = kl.Model(mesh, law)
        model.fix("inner")
        model.add(kl.ale.Rotation("z", rate=1.0))
        with pytest.raises(ModelError, match=f"linear laws .* {name}"):
            model.transient()
        with pytest.raises(ModelError, match=f"linear laws .* {name}"):
            model.solve()

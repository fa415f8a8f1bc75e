"""Quasi-static analyses beside closed forms; convergence, restart, cuts and refusals."""

from dataclasses import dataclass

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError, SolveError
from kratos_lite.materials import MATERIALS
from kratos_lite.solvers.multigrid import multigrid

E, H, Y = 200e9, 2e9, 200e6
STEEL = kl.J2Plasticity3D(E, 0.3, Y, H)
HARD = kl.J2Plasticity3D(E, 0.3, Y, 20e9, 5e9)
ELEMENTS = (
    "Element3D8N",
    "KinematicLinear3D8N",
    "EnhancedStrain3D8N",
    "KinematicLinear3D20N",
    "KinematicLinear3D27N",
    "KinematicLinear3D10N",
    "KinematicLinear3D4N",
)


def bar(material, element="Element3D8N", cells=(2, 2, 2), size=(1, 1, 2), **options):
    """Return a bar along z on rollers."""
    model = kl.Model(kl.box(size, cells=cells, element=element), material, **options)
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(side, axis)
    return model


def steps(model, dt=1.0, count=1, **options):
    """Return an analysis after some steps."""
    analysis = model.quasi_static(**options)
    for _ in kl.integrate(analysis, dt=dt, steps=count):
        pass
    return analysis


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_bar_of_steel_yields_in_every_element(element):
    model = bar(STEEL, element)
    model.add(kl.Traction("z+", (0, 0, 1.05 * Y)))
    analysis = steps(model)
    result = analysis.result()
    strain = Y / E + 0.05 * Y * (E + H) / (E * H)
    assert np.abs(result.displacement("z+")[:, 2] - 2 * strain).max() < 1e-9 * strain
    assert np.abs(np.concatenate([*result.stress("gauss")])[:, 2] - 1.05 * Y).max() < 1e-9 * Y
    assert abs(result.report.total_reaction[2] + 1.05 * Y) < 1e-8 * Y


@pytest.mark.parametrize(
    ("law", "formulation", "load"),
    [
        (HARD, "standard", 2e7),
        (HARD, "enhanced", 2e7),
        (HARD, "b_bar", 2e7),
        (kl.DruckerPrager3D(20e9, 0.3, 50e6, 20.0, 10.0, 1e9), "enhanced", 1.5e7),
        (kl.DruckerPrager3D(20e9, 0.3, 50e6, 20.0, 10.0, 1e9), "b_bar", 1.5e7),
        (kl.NeoHookean3D(1e6, 0.3), "total_lagrangian", 2e3),
        (kl.MooneyRivlin3D(1e5, 0.5e5, 1e6), "total_lagrangian", 2e3),
        (kl.Ogden3D(2e5, 2.0, 1e6), "total_lagrangian", 2e3),
        (kl.Isotropic3D(1e6, 0.3), "total_lagrangian", 2e3),
    ],
    ids=lambda v: type(v).__name__ if isinstance(v, kl.Material) else v if isinstance(v, str) else "",
)
def test_newton_converges_quadratically(law, formulation, load):
    model = kl.Model(kl.box((4, 1, 1), (8, 2, 2), "Element3D8N"), law, formulation=formulation)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -load)))
    residuals = np.array(steps(model, tolerance=1e-12).reports[-1].residuals)
    assert len(residuals) > 3
    last = residuals[residuals > 1e-13][-2:]
    assert last[1] < 50 * last[0] ** 2 or last[1] < 1e-11


def test_a_cantilever_turns_by_a_force_at_its_end():
    """Sze, Liu & Lo, Finite Elem. Anal. Des. 40 (2004) 1551: 3.286 and 6.698 of the shell."""
    model = kl.Model(
        kl.box((10, 1, 0.1), (20, 1, 1), "Element3D27N"),
        kl.Isotropic3D(1.2e6, 0.0),
        formulation="total_lagrangian",
    )
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 4 / 0.1)))
    tip = model.solve().displacement("x+").mean(axis=0)
    assert abs(-tip[0] / 3.286 - 1) < 0.01
    assert abs(tip[2] / 6.698 - 1) < 0.01


def test_a_beam_of_steel_bends_beyond_its_yield_moment():
    """M/M_y = (3 - (κ_y/κ)²)/2 of an elastic, perfectly plastic rectangle."""
    mesh = kl.box((1, 0.1, 1), (1, 1, 16), "KinematicLinear3D20N")
    model = kl.Model(mesh, kl.J2Plasticity3D(E, 0.0, Y), formulation="standard")
    x, z = mesh.points[:, 0], mesh.points[:, 2] - 0.5
    kappa = 3 * Y / E / 0.5  # three times that of the first yield
    model.fix("x-", "x")
    for node in mesh.nodes("x+"):
        model.fix([int(node)], "x", float(kappa * z[node] * x[node]))
    model.fix((0, 0, 0.5), "yz")
    model.fix((0, 0.1, 0.5), "z")
    result = model.solve()
    moment = (result.reaction("x+")[:, 0] * z[mesh.nodes("x+")]).sum()
    elastic = Y * 0.1 / 6
    assert abs(moment / elastic / ((3 - 1 / 9) / 2) - 1) < 0.01


def test_a_load_beyond_the_limit_is_refused_with_how_far_it_came():
    model = bar(kl.J2Plasticity3D(E, 0.3, Y))
    model.add(kl.Traction("z+", (0, 0, 2 * Y)))
    analysis = model.quasi_static(iterations=8)
    with pytest.raises(SolveError, match=r"converges up to t = 0\.5 s only.* limit load"):
        for _ in kl.integrate(analysis, dt=1.0, steps=1):
            pass
    assert 0.49 < analysis.time <= 0.5  # the last converged state is kept
    assert abs(analysis.result().stress()[0, 0, 2] - 2 * Y * analysis.time) < 1e-6 * Y


def test_a_viscous_bar_creeps():
    law = kl.GeneralizedMaxwell3D(1e9, 0.3, 0.5, 2.0)
    model = bar(law)
    model.add(kl.Traction("z+", (0, 0, 1e6)))
    creep = []
    for count in (40, 80):
        analysis = model.quasi_static()
        analysis.prepare(1e-9, 1)
        analysis.advance(1e-9, 1)
        for _ in kl.integrate(analysis, dt=4.0 / count, steps=count):
            pass
        creep.append(analysis.result().displacement("z+")[:, 2].mean() / 2)
    exact = 1e-3 * (2 - np.exp(-4.0 / 4.0))  # J(t) of E (½ + ½ e^{-t/2})
    errors = [abs(value / exact - 1) for value in creep]
    assert errors[1] < 1e-4
    assert 3.5 < errors[0] / errors[1] < 4.5


def test_prestress_and_linear_parts_beside_a_law():
    mesh = kl.box((1, 1, 2), (2, 2, 2), "KinematicLinear3D8N")
    top = mesh.elements(None)[-4:]
    model = kl.Model(mesh, STEEL)
    model.assign(kl.Isotropic3D(E, 0.3), top)
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add_prestress((0, 0, 0.9 * Y, 0, 0, 0))
    model.fix("z+", "z", 0.0)
    result = model.solve()
    stress = result.stress("element")
    assert np.abs(stress[:, 2] - stress[0, 2]).max() < 1e-6 * Y
    linear = kl.Model(mesh, kl.Isotropic3D(E, 0.3))
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        linear.fix(side, axis)
    linear.add_prestress((0, 0, 0.9 * Y, 0, 0, 0))
    linear.fix("z+", "z", 0.0)
    assert np.abs(linear.solve().stress("element") - stress).max() < 1e-6 * Y  # nothing has yielded


@pytest.mark.parametrize("beyond", [1.5, 3.0, 10.0])
def test_a_prestress_beyond_yield_is_relieved_elastically(beyond):
    """A body on rollers becomes shorter by s / E and has no stress left; held, it yields along its axis."""
    model = bar(STEEL)
    model.add_prestress((0, 0, beyond * Y, 0, 0, 0))
    result = model.solve()
    assert np.abs(result.stress("element")).max() < 1e-6 * Y
    assert np.abs(result.displacement("z+")[:, 2] / (-2 * beyond * Y / E) - 1).max() < 1e-9
    model.fix("z+", "z")
    exact = Y + (beyond - 1) * Y * H / (E + H)
    assert np.abs(model.solve().stress("element")[:, 2] / exact - 1).max() < 1e-6


@pytest.mark.parametrize("law", [kl.NeoHookean3D(1e6, 0.3), kl.SaintVenantKirchhoff3D(1e6, 0.3)])
def test_an_element_turned_inside_out_is_named(law):
    model = bar(law, "Element3D8N")
    model.fix("z+", "z", -2.5)
    with pytest.raises(SolveError, match=r"inside out|no convergence|diverges"):
        model.solve()
    u = np.zeros_like(model.mesh.points)
    u[:, 2] = -1.25 * model.mesh.points[:, 2]
    with pytest.raises(SolveError, match=r"element 1 \(.*\), Gauss point 1: .* inside out"):
        model.quasi_static().assembly.evaluate(u.ravel(), model.quasi_static().states, 1.0)


def test_what_comes_back_to_rest_converges():
    law = kl.NeoHookean3D(1e6, 0.3)
    loaded = bar(law, size=(1, 1, 1))
    loaded.add(kl.Traction("z+", (0, 0, 3e5)), amplitude=lambda t: 1 - abs(t - 1))
    assert np.abs(steps(loaded, 1.0, 2).result().u).max() < 1e-6
    turned = kl.Model(kl.box(cells=(2, 1, 1)), law)
    x, y, _ = turned.mesh.points.T
    c, s = np.cos(0.5) - 1, np.sin(0.5)
    turned.fix("x-", value=np.stack([c * x - s * y, s * x + c * y, 0 * x], 1)[turned.mesh.nodes("x-")])
    turned.fix("x+", value=np.stack([c * x - s * y, s * x + c * y, 0 * x], 1)[turned.mesh.nodes("x+")])
    result = turned.solve()
    assert np.abs(result.stress()).max() < 1e-6 * 1e6


def test_a_law_that_overflows_is_approached_in_parts():
    """Its stress is not finite where the first correction leads."""

    @dataclass(frozen=True)
    class Bounded(kl.Material):
        E: float
        density: float = 0.0

        def response(self, strain, state, dt):
            return self.E * strain / np.sqrt(1 - (strain / 0.1) ** 2), None, {}

    with MATERIALS.temporary():
        model = bar(Bounded(1e6), "KinematicLinear3D8N", size=(1, 1, 1))
        model.add(kl.Traction("z+", (0, 0, 1.5e5)))
        result = model.solve()
    e = result.displacement("z+")[:, 2].mean()
    assert abs(1e6 * e / np.sqrt(1 - (e / 0.1) ** 2) / 1.5e5 - 1) < 1e-6


def test_refusals():
    with pytest.raises(ModelError, match="total_lagrangian"):
        bar(kl.NeoHookean3D(1e6, 0.3), "KinematicLinear3D8N").element_groups()
    free = kl.Model(kl.box(), STEEL)
    free.add(kl.Traction("z+", (0, 0, 1.0)))
    with pytest.raises(ModelError):
        free.solve()
    model = bar(STEEL)
    model.fix("z+", "z", 0.01)
    with pytest.raises(InputError, match="estimate of the error"):
        model.solve().error()


@pytest.mark.parametrize(
    "law",
    [kl.J2Plasticity3D(E, 0.3, Y, H), kl.DruckerPrager3D(E, 0.3, Y, 20.0, 5.0), kl.NeoHookean3D(E, 0.3)],
    ids=lambda law: type(law).__name__,
)
def test_one_multigrid_serves_many_tangents(law, monkeypatch):
    made = []

    def counted(*args):
        made.append(len(args[2]))
        return multigrid(*args)

    monkeypatch.setattr("kratos_lite.solvers.multigrid.multigrid", counted)
    size = 0.1 if law.strain_measure == "finite" else 0.004
    ends = []
    for solver in ("direct", "amg"):
        model = kl.Model(kl.box((1, 1, 2), (3, 3, 6), "Element3D8N"), law)
        model.fix("z-")
        model.fix("z+", "x", lambda t: size * t)
        analysis = steps(model, 0.25, 4, solver=solver)
        ends.append(analysis.u)
        state = analysis.state()
        again = model.quasi_static(solver=solver)
        state.restore(again)
        for one in (analysis, again):
            list(kl.integrate(one, dt=0.25, steps=1))
        assert (analysis.u == again.u).all()
    corrections = sum(report.iterations for report in analysis.reports)
    assert np.abs(ends[0] - ends[1]).max() < 1e-7 * size
    assert 1 <= len(made) <= 2 < corrections  # one for each analysis that makes a correction


def test_a_step_begins_where_the_last_ones_lead():
    model = bar(kl.NeoHookean3D(1e6, 0.3), size=(1, 1, 1))
    model.add(kl.Traction("z+", (0, 0, 1e5)), amplitude=lambda t: t if t < 8 else 16 - t)
    analysis = steps(model, 1.0, 16)
    counts = [report.iterations for report in analysis.reports]
    assert max(counts[3:8]) < counts[0]  # on the way up; then the load turns
    assert len(counts) == 16
    assert np.abs(analysis.u).max() < 1e-6
    bar_of_glue = bar(kl.GeneralizedMaxwell3D(1e6, 0.3, 0.0, 1.0), size=(1, 1, 1))
    bar_of_glue.add(kl.Traction("z+", (0, 0, 1e3)), amplitude=lambda t: t**2)  # a parabola all the way
    parts = steps(bar_of_glue, 1.0, 8).reports
    assert [report.iterations for report in parts][3:] == [0] * 5


def test_supports_that_let_go_where_they_must_not_are_refused():
    bar = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    bar.fix("z-", "xyz", lambda t: None if t > 1.5 else 0.0)
    states = kl.integrate(bar.quasi_static(), 1.0, 2)
    next(states)
    with pytest.raises(kl.ModelError, match=r"at t = 2 s: .*rigid-body modes free"):
        next(states)
    with pytest.raises(kl.InputError, match=r"at t = 0 s must be a number; got None"):
        bar.fix("z+", "z", lambda t: None)
    with pytest.raises(kl.ModelError, match=r"returns None is one of quasi-static analysis alone"):
        list(kl.integrate(bar.transient(), 1.0, 2))


def test_a_support_moves_with_places_and_time():
    """A twist that grows: the same as its field, at each time."""
    mesh = kl.box((2.0, 1.0, 1.0), (2, 1, 1))
    bar = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3))
    bar.fix("x-")
    bar.fix("x+", "y", lambda t: -0.01 * t * mesh.points[:, 2])
    bar.fix("x+", "z", lambda t: 0.01 * t * mesh.points[:, 1])
    still = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3))
    still.fix("x-")
    still.fix("x+", "yz", field=lambda X: 0.01 * np.stack([-X[:, 2], X[:, 1]], axis=1))
    u = still.solve().u
    for state in kl.integrate(bar.quasi_static(), 0.5, 3):
        assert np.abs(state.u - state.time * u).max() < 1e-12

"""Loads that follow the deformed body: pressures and tractions on deformed faces, with their tangents."""

from itertools import pairwise

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model.loads.surface import ConditionLoads
from kratos_lite.shapes import SHAPES

E, NU = 1e6, 0.3
SVK = kl.SaintVenantKirchhoff3D(E, NU)


def element(nodes):
    return f"TotalLagrangianElement3D{nodes}N"


def squeezed(nodes, n, pressure):
    """Return a cube under a follower pressure on three faces, with rollers on the others."""
    model = kl.Model(kl.box(cells=(n, n, n), element=element(nodes)), SVK)
    for axis in "xyz":
        model.fix(f"{axis}-", axis)
        model.add(kl.Pressure(f"{axis}+", pressure, follower=True))
    return model


@pytest.mark.parametrize("nodes", [4, 8, 10, 20, 27])
def test_cube_under_pressure_on_all_sides(nodes):
    """A stretch λ alike in all directions: 3 K (λ² - 1) / 2 = - p λ."""
    p, K = 3e5, E / 3 / (1 - 2 * NU)
    analysis = squeezed(nodes, 1, p).quasi_static()
    list(kl.integrate(analysis, dt=1.0, steps=1))
    stretch = (-p + (p**2 + 9 * K**2) ** 0.5) / (3 * K)
    u = analysis.result().u
    assert np.abs(u - (stretch - 1) * analysis.model.mesh.points).max() < 1e-9
    assert analysis.reports[-1].iterations <= 6


def test_convergence_is_quadratic_and_multigrid_agrees_with_factors(monkeypatch):
    """One face pressed: the tangent of the load is not symmetric at the edges of that face."""
    found = []
    for limit in (10**9, 0):
        monkeypatch.setattr("kratos_lite.solvers.plan.STEPPED_LIMIT", limit)
        model = kl.Model(kl.box(cells=(4, 4, 4), element=element(8)), SVK)
        model.fix("z-")
        model.add(kl.Pressure("x+", 4e4, follower=True))
        analysis = model.quasi_static(tolerance=1e-12)
        list(kl.integrate(analysis, dt=1.0, steps=1))
        found.append(analysis.result().u)
        residuals = analysis.reports[-1].residuals
        assert len(residuals) <= 7
        assert all(b < 30 * a**2 or b < 1e-11 for a, b in pairwise(residuals[1:])), residuals
    assert np.abs(found[0] - found[1]).max() < 1e-9 * np.abs(found[0]).max()


@pytest.mark.parametrize("shape", ["Triangle3", "Quadrilateral4", "Triangle6", "Quadrilateral8", "Line2"])
def test_tangent_of_conditions_is_the_difference_of_their_forces(shape):
    name = {"Line2": "LineLoadCondition3D2N"}.get(shape, f"SurfaceLoadCondition3D{shape[-1]}N")
    face = SHAPES[shape]
    rng = np.random.default_rng(1)
    k = len(face.nodes)
    points = np.pad(face.nodes, ((0, 0), (0, 3 - face.nodes.shape[1]))) + 0.1 * rng.random((k, 3))
    mesh = kl.Mesh(points, [], conditions=[kl.Block(name, np.arange(k)[None], shape=face)])
    nodal = {cell: rng.random((k, 3)) for cell in ("line", "triangle", "quadrilateral")}
    load = ConditionLoads(rng.random((1, 3)), nodal, rng.random(1) * (shape != "Line2"), rng.random(k))
    x = points + 0.2 * rng.random((k, 3))

    def forces(x):
        return sum(part[1][0] for part in load.follow(mesh, x))

    assert np.abs(forces(points)).max() < 1e-15
    tangent = sum(part[2][0] for part in load.follow(mesh, x))
    for b, i in np.ndindex(k, 3):
        step = np.zeros((k, 3))
        step[b, i] = 1e-6
        difference = (forces(x + step) - forces(x - step)) / 2e-6
        assert np.abs(difference - tangent[:, :, b, i]).max() < 1e-8


def test_a_follower_is_taken_in_parts_as_in_one_step():
    whole, parts = squeezed(8, 2, 3e5), squeezed(8, 2, 3e5)
    once, often = whole.quasi_static(), parts.quasi_static()
    list(kl.integrate(once, dt=1.0, steps=1))
    list(kl.integrate(often, dt=0.25, steps=4))
    assert np.abs(once.result().u - often.result().u).max() < 1e-8
    assert np.abs(once.load - often.load).max() < 1e-6 * np.abs(once.load).max()


def test_amplitudes_and_functions_of_time_follow_too():
    found = []
    for load in (
        (kl.Pressure("z+", 2e5, follower=True), {"amplitude": lambda t: t / 2}),
        (kl.TimeDependentLoad(lambda t: kl.Pressure("z+", 1e5 * t, follower=True), follower=True), {}),
    ):
        model = kl.Model(kl.box(element=element(8)), SVK)
        model.fix("z-")
        model.add(load[0], **load[1])
        analysis = model.quasi_static()
        list(kl.integrate(analysis, dt=0.5, steps=2))
        found.append(analysis.result())
    assert np.abs(found[0].u - found[1].u).max() < 1e-12
    dead = kl.Model(kl.box(element=element(8)), SVK)
    dead.fix("z-")
    dead.add(kl.Pressure("z+", 1e5))
    assert abs(found[0].u - dead.solve().u).max() > 1e-3


@pytest.mark.parametrize("more", [{}, {"amplitude": lambda t: t}])
def test_a_follower_makes_a_model_of_small_displacements_a_nonlinear_one(more):
    """The pressed face grows with its sides: ε = -p/E (1 - ν ε)²; it ends after two corrections."""
    for pressure, corrections in ((20.0, 2), (2e5, 4)):
        model = kl.Model(kl.box(cells=(2, 2, 2)), kl.Isotropic3D(E, 0.3))
        for axis in "xyz":
            model.fix(f"{axis}-", axis)
        model.add(kl.Pressure("x+", pressure, follower=True), **more)
        result = model.solve()
        strain = result.u[:, 0].max() + result.u[:, 0].min()
        assert abs(strain + pressure / E * (1 - 0.3 * strain) ** 2) < 1e-7 * abs(strain)
        assert result.report.iterations <= corrections
    with pytest.raises(ModelError, match="a load that follows the body"):
        model.static()


def test_functions_of_time_make_small_displacements_nonlinear_too_where_they_say_so():
    """In time, a free block whose pressed face grows with what its sides do."""
    found = []
    for load, how in (
        (kl.Pressure("x+", 4e5, follower=True), {"amplitude": lambda t: t}),
        (kl.TimeDependentLoad(lambda t: kl.Pressure("x+", 4e5 * t, follower=True), follower=True), {}),
        (kl.Pressure("x+", 4e5), {"amplitude": lambda t: t}),
    ):
        model = kl.Model(kl.box(cells=(1, 1, 2)), kl.Isotropic3D(E, 0.3, 1e3))
        model.fix("x-")
        model.add(load, **how)
        *_, state = kl.integrate(model.transient(), dt=0.1, steps=5)
        found.append(state.u)
    assert np.abs(found[1] - found[0]).max() < 1e-10 * np.abs(found[0]).max()
    assert np.abs(found[2] - found[0]).max() > 1e-2 * np.abs(found[0]).max()
    model.add(kl.TimeDependentLoad(lambda t: kl.Pressure("x+", t, follower=True)))
    with pytest.raises(InputError, match=r"take TimeDependentLoad\(function, follower=True\)"):
        model.transient()


def test_a_follower_by_places_is_refused():
    with pytest.raises(InputError, match="a follower pressure is a number"):
        kl.Pressure("z+", lambda X: X[:, 0], follower=True)
    with pytest.raises(InputError, match="follower must be True or False"):
        kl.Pressure("z+", 1.0, follower=1)

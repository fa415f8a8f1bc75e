"""Nonlinear laws at one point: tangents by differences, closed forms, energies, refusals."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, MaterialError, SolveError
from kratos_lite.materials import Material
from kratos_lite.materials.softening_curves import CURVES

CURVE = ((1e-4, 260e6), (2e-4, 260e6), (3e-4, 900e6), (2e-3, 950e6), (3e-3, 2000e6))  # steep between flat
LAWS = [
    (kl.J2Plasticity3D(200e9, 0.3, 250e6), 3e-3),
    (kl.J2Plasticity3D(200e9, 0.3, 250e6, 1e9, 2e9, 400e6, 20.0), 3e-3),
    (kl.J2Plasticity3D(200e9, 0.3, 250e6, 1e9, 2e9, 400e6, 20.0, curve=CURVE), 3e-3),
    (kl.J2Softening3D(200e9, 0.3, 250e6, 4e6), 3e-3),
    (kl.J2Softening3D(200e9, 0.3, 250e6, 4e5, curve=3), 3e-3),
    (kl.J2Softening3D(200e9, 0.3, 250e6, 4e6, curve=0), 3e-3),
    (kl.ConeSoftening3D(20e9, 0.3, 1e8, 4e6, friction=12.0, dilatancy=5.0), 3e-3),
    (kl.ConeSoftening3D(20e9, 0.3, 1e8, 4e6, 0, friction=10.0, dilatancy=10.0), 3e-3),
    (kl.CoulombDamage3D(30e9, 0.2, 3e6, 100.0, friction=30.0, compression=2e7), 1e-3),
    (kl.ConeDamage3D(30e9, 0.2, 3e6, 100.0, linear=1, friction=20.0), 2e-4),
    (kl.TrescaDamage3D(30e9, 0.2, 3e6, 100.0), 2e-4),
    (kl.SimoJuDamage3D(30e9, 0.2, 3e6, 100.0), 2e-4),
    (kl.DruckerPrager3D(20e6, 0.3, 1e4, 30.0), 2e-3),
    (kl.DruckerPrager3D(20e6, 0.3, 1e4, 30.0, 10.0, 1e5), 2e-3),
    (kl.DruckerPrager3D(20e6, 0.3, 1e4, 30.0, 30.0, 1e5), 2e-3),
    (kl.IsotropicDamage3D(30e9, 0.2, 3e6, 100.0), 2e-4),
    (kl.IsotropicDamage3D(30e9, 0.2, 3e6, 100.0, linear=1), 2e-4),
    (kl.VonMisesDamage3D(30e9, 0.2, 3e6, 100.0), 2e-4),
    (kl.RankineDamage3D(30e9, 0.2, 3e6, 100.0, linear=1), 2e-4),
    (kl.GeneralizedMaxwell3D(1e9, 0.3, 0.3, 10.0, 0.2, 1.0), 1e-2),
    (kl.SaintVenantKirchhoff3D(1e6, 0.3), 0.1),
    (kl.NeoHookean3D(1e6, 0.3), 0.1),
    (kl.MooneyRivlin3D(0.3e6, 0.1e6, 1e7), 0.1),
    (kl.Ogden3D(0.63e6, 1.3, 1e7, 1.2e3, 5.0, -1e4, -2.0), 0.1),
    (kl.Ogden3D(0.63e6, 1.3, 1e5, bulk4=3e6, bulk6=2e7), 0.1),
]
BY_STEPS = [  # what they come to depends on the steps, as in Kratos, or at large strains
    (kl.FiniteJ2Plasticity3D(200e9, 0.3, 250e6, 1e9), 3e-3),
    (kl.J2Softening3D(20e9, 0.3, 1e8, 4e6, 2, 2e8, peak=15e7, peak_at=0.3, potential="Tresca"), 3e-2),
    (kl.J2Softening3D(20e9, 0.3, 1e8, 4e6, 4, strains=(5e-3, 6e-3), stresses=(1e8, 9e9, -1e12)), 3e-2),
    (kl.TrescaSoftening3D(20e9, 0.3, 1e8, 4e6, 5), 3e-2),
    (kl.TrescaSoftening3D(20e9, 0.3, 1e8, 4e6, 6, strains=(0, 0.01, 0.03), stresses=(1e8, 2e8, 19e7)), 2e-2),
    (kl.CoulombSoftening3D(20e9, 0.3, 1e8, 4e7, 1, 3e8, friction=30.0, dilatancy=20.0), 3e-2),
]
HYPERELASTIC = [law for law, _ in LAWS if law.strain_measure == "finite"]


def start(law: Material, *shape: int) -> dict:
    """Return the state at the beginning, in elements of 0.1 m."""
    state = law.initial_state(*shape)
    for name in state.keys() & {"element_length", "element_radius"}:
        state[name][:] = 0.1
    return state


@pytest.mark.parametrize(  # but the first of BY_STEPS, whose tangent is by differences
    ("law", "size"), LAWS + BY_STEPS[1:], ids=lambda v: type(v).__name__ if isinstance(v, Material) else ""
)
def test_the_tangent_is_the_derivative_of_the_stress(law, size):
    strain = np.random.default_rng(1).normal(size=(40, 6)) * size
    state = start(law, 40)
    for _ in range(2):  # from rest, and on from there
        _, tangent, new = law.evaluate(strain, state, 0.7)
        numeric = np.empty_like(tangent)
        for j in range(6):
            h = 1e-6 * size * np.eye(6)[j]
            numeric[..., j] = (
                law.evaluate(strain + h, state, 0.7)[0] - law.evaluate(strain - h, state, 0.7)[0]
            ) / (2e-6 * size)
        assert np.abs(numeric - tangent).max() < 1e-7 * np.abs(tangent).max()
        state, strain = new, -0.5 * strain


@pytest.mark.parametrize("law", HYPERELASTIC, ids=lambda law: type(law).__name__)
def test_the_stress_is_the_derivative_of_the_energy(law):
    E, h = np.random.default_rng(2).normal(size=(20, 6)) * 0.1, 1e-6
    stress = law.evaluate(E, {}, 1.0)[0]
    for j in range(6):
        step = h * np.eye(6)[j]
        ends = [law.energy(e, law.evaluate(e, {}, 1.0)[0], {}) for e in (E + step, E - step)]
        assert np.abs((ends[0] - ends[1]) / (2 * h) - stress[:, j]).max() < 1e-8 * np.abs(stress).max()


def tensor(s):
    return s[[[0, 3, 5], [3, 1, 4], [5, 4, 2]]]


def uniaxial(law, strains, state=None, dt=1.0):
    """Return the axial stress along a path of axial strains under uniaxial stress."""
    state, e, out, D = start(law) if state is None else state, np.zeros(6), [], np.eye(6)
    for axial in strains:
        change = axial - e[0]
        e += np.append(change, -change * np.linalg.lstsq(D[1:, 1:], D[1:, 0], rcond=None)[0])
        for _ in range(30):
            stress, D, new = law.evaluate(e, state, dt)
            if np.abs(stress[1:]).max() < 1e-11 * max(np.abs(stress[0]), 1.0):
                break
            e[1:] -= np.linalg.solve(D[1:, 1:], stress[1:])
        state = new
        out.append(stress[0])
    return np.array(out), state


def test_steel_hardens_along_the_lines_of_a_bar():
    E, H, Y = 200e9, 2e9, 250e6
    for isotropic, kinematic in ((H, 0.0), (0.0, H), (H / 4, 3 * H / 4)):
        law = kl.J2Plasticity3D(E, 0.3, Y, isotropic, kinematic)
        stress, state = uniaxial(law, [Y / E, 0.01])
        slope = E * H / (E + H)
        assert abs(stress[0] - Y) < 1e-9 * Y
        top = Y + slope * (0.01 - Y / E)
        assert abs(stress[1] - top) < 1e-9 * Y
        p = 0.01 - top / E
        assert abs(state["accumulated_plastic_strain"][0] - p) < 1e-12
        # back again: yields after twice the present radius
        radius = Y + isotropic * p
        back, _ = uniaxial(law, [0.01 - 2 * radius / E, -0.01], state)
        assert abs(back[0] - (top - 2 * radius)) < 1e-9 * Y
        rest = 0.02 - 2 * radius / E
        assert abs(back[1] - (top - 2 * radius - slope * rest)) < 1e-9 * Y


def test_a_kinematic_loop_is_twice_its_first_branch_and_closes():
    """Masing: σ_r - σ = 2 f((ε_r - ε)/2) from a reversal on, where f is the first branch."""
    E, H, Y = 200e9, 2e9, 250e6

    def first(strain):
        return min(E * strain, Y + E * H / (E + H) * (strain - Y / E))

    law = kl.J2Plasticity3D(E, 0.3, Y, kinematic=H)
    path = [0.01, 0.009, 0.002, -0.01, 0.003, 0.01]
    stress, _ = uniaxial(law, path)
    for begin, places in ((0, (1, 2, 3)), (3, (4, 5))):
        for i in places:
            change, sign = path[i] - path[begin], np.sign(path[i] - path[begin])
            exact = stress[begin] + sign * 2 * first(abs(change) / 2)
            assert abs(stress[i] - exact) < 1e-9 * Y
    assert abs(stress[-1] - stress[0]) < 1e-9 * Y


def test_saturation_of_voce():
    law = kl.J2Plasticity3D(200e9, 0.3, 200e6, 0.0, 0.0, 300e6, 50.0)
    stress, state = uniaxial(law, [0.05])
    p = state["accumulated_plastic_strain"][0]
    assert abs(stress[0] - (200e6 + 100e6 * (1 - np.exp(-50 * p)))) < 1.0
    assert abs(p - (0.05 - stress[0] / 200e9)) < 1e-12


@pytest.mark.parametrize("steps", [1, 7, 100])
def test_a_bar_follows_its_measured_curve(steps):
    """σ = c(p) and ε = σ/E + p, at knots, between them, and constant after the last."""
    law = kl.J2Plasticity3D(200e9, 0.3, 250e6, curve=CURVE)
    for p in (1e-4, 1.5e-4, 2e-4, 2.7e-4, 3e-4, 1e-3, 3e-3, 0.1):
        expected = np.interp(p, [0, *(a for a, _ in CURVE)], [250e6, *(b for _, b in CURVE)])
        stress, state = uniaxial(law, np.linspace(0, expected / 200e9 + p, steps + 1)[1:])
        assert abs(stress[-1] - expected) < 1e-9 * expected
        assert abs(state["accumulated_plastic_strain"][0] - p) < 1e-9 * p + 1e-14


@pytest.mark.parametrize("J", [1.0, 1.2])
def test_large_plastic_strains_are_logarithmic_and_keep_the_volume(J):
    E, nu, Y, H = 200e9, 0.3, 250e6, 1e9
    law, mu, K = kl.FiniteJ2Plasticity3D(E, nu, Y, H), E / 2.6, E / 1.2
    state = law.initial_state()
    for stretch in np.linspace(1, 1.5, 201)[1:]:
        F = J ** (1 / 3) * np.array([stretch, stretch**-0.5, stretch**-0.5])
        strain = np.append((F**2 - 1) / 2, np.zeros(3))
        stress, _, state = law.evaluate(strain, state, 1.0, tangent=False)
    cauchy, p = F**2 * stress[:3] / J, state["accumulated_plastic_strain"][0]
    q = Y + H * p
    assert np.abs(cauchy - K / 2 * (J - 1 / J) - q * np.array([2, -1, -1]) / 3).max() < 1e-9 * q
    elastic = q * J / (3 * mu)  # the return keeps the volume, and logarithms, up to it
    assert abs(p - (np.log(1.5) - elastic)) < elastic
    assert abs(np.prod(1 + state["plastic_metric"][:3]) - 1) < 4 * elastic


def test_the_elastic_part_at_large_strains_is_the_work_of_its_stress():
    law = kl.FiniteJ2Plasticity3D(1e6, 0.3, 1e9)
    strain, state = np.array([0.3, -0.1, 0.05, 0.2, -0.1, 0.04]), law.initial_state()
    x, w = np.polynomial.legendre.leggauss(20)
    stresses = [law.evaluate((1 + a) / 2 * strain, state, 1.0, tangent=False)[0] for a in x]
    work = sum(b / 2 * s @ strain for b, s in zip(w, stresses, strict=True))
    assert abs(law.energy(strain, stresses[-1], state) - work) < 1e-9 * work


@pytest.mark.parametrize("curve", [[(0.0, 300e6)], [(0.1, 200e6)], [(0.1, 300e6), (0.1, 400e6)]])
def test_a_curve_that_falls_or_turns_back_is_refused(curve):
    with pytest.raises(
        MaterialError, match=r"the plastic strains of a curve grow from 0, .* at 0, which is no row of it"
    ):
        kl.J2Plasticity3D(200e9, 0.3, 250e6, curve=curve)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_cone_of_soils_in_triaxial_tests(sign):
    c, phi = 10e3, np.radians(30)
    law = kl.DruckerPrager3D(20e6, 0.3, c, 30.0, 30.0)
    stress = uniaxial(law, sign * np.linspace(0, 0.05, 51)[1:])[0][-1:]
    eta, xi = (6 * f / (3**0.5 * (3 - np.sin(phi))) for f in (np.sin(phi), np.cos(phi)))
    strength = xi * c / (1 / 3**0.5 + sign * eta / 3)  # √J₂ = |σ|/√3, p = σ/3
    assert abs(abs(stress[0]) - strength) < 1e-8 * strength
    if sign < 0:  # Mohr and Coulomb's in compression
        assert abs(strength - 2 * c * np.cos(phi) / (1 - np.sin(phi))) < 1e-8 * strength


@pytest.mark.parametrize("linear", [0, 1])
@pytest.mark.parametrize("make", [kl.IsotropicDamage3D, kl.VonMisesDamage3D, kl.RankineDamage3D])
def test_damage_dissipates_the_fracture_energy(make, linear):
    for length in (0.05, 0.1, 0.2):
        law = make(30e9, 0.2, 3e6, 100.0, linear=linear)
        state = law.initial_state()
        for name in state.keys() & {"element_length", "element_radius"}:
            state[name][:] = length
        strains = np.concatenate([[0.5e-4, 1e-4], np.geomspace(1.01e-4, 4e-2 if not linear else 2e-3, 100)])
        stress, _ = uniaxial(law, strains, state)
        energy = np.diff(strains, prepend=0) @ (stress + np.concatenate([[0], stress[:-1]])) / 2 * length
        assert abs(stress.max() - 3e6) < 1e-9 * 3e6
        assert abs(energy - 100.0) < 0.01 * 100.0


@pytest.mark.parametrize("curve", [0, 1])
def test_softening_is_linear_or_exponential_and_dissipates_the_fracture_energy(curve):
    """σ = σ_Y exp(-σ_Y p / g) or σ_Y (1 - σ_Y p / 2g) of a bar, to the first order in the steps."""
    errors = []
    for steps in (100, 200):
        law = kl.J2Softening3D(200e9, 0.3, 250e6, 4e5, curve=curve)
        g = 4e5 / 0.1
        strains = np.linspace(0, 0.025, steps)
        stress, state = uniaxial(law, strains, start(law))
        p = strains - stress / 200e9
        flowing = p > 1e-6
        exact = 250e6 * (np.exp(-250e6 * p / g) if curve else 1 - 250e6 * p / (2 * g))
        errors.append(np.abs(stress - exact)[flowing].max() / 250e6)
        energy = np.diff(strains) @ (stress[1:] + stress[:-1]) / 2
        assert abs(energy / g - state["plastic_dissipation"][0]) < 0.01
    assert errors[1] < 0.6 * errors[0] < 0.02


@pytest.mark.parametrize("sign", [1, -1])
def test_a_cone_that_softens_meets_its_strengths_and_its_dilatancy(sign):
    """σ_Y of tension, (3 + sin φ) / (3 - 3 sin φ) σ_Y of compression; dε_v / dε of the potential."""
    law = kl.ConeSoftening3D(50e9, 0.2, 10e6, 1e5, 3, friction=30.0, dilatancy=15.0)
    stress, state = uniaxial(law, sign * np.linspace(1e-5, 2e-3, 9))
    s, flow = 0.5, np.sin(np.radians(15))
    strength = 10e6 if sign > 0 else 10e6 * (3 + s) / (3 - 3 * s)
    assert abs(stress[-1] - sign * strength) < 1e-9 * strength
    plastic = state["plastic_strain"]
    mean, root = 2 * flow / (3 - 3 * flow), 3**0.5 * (3 - flow) / (3 - 3 * flow)
    ratio = 3 * mean / (mean + sign * root / 3**0.5)
    assert abs(plastic[:3].sum() / plastic[0] - ratio) < 1e-9 * abs(ratio)
    expected = np.abs(stress[-1] * plastic[0]) * 0.1 / 1e5
    assert abs(state["plastic_dissipation"][0] - expected) < 1e-9 * expected


def test_the_apex_of_a_cone_that_softens():
    """tr σ = (3 + sin φ) / (2 sin φ) σ_Y, and an energy of p Δε_v."""
    law = kl.ConeSoftening3D(50e9, 0.2, 10e6, 1e8, 3, friction=30.0, dilatancy=10.0)
    strain = np.array([2e-3, 2e-3, 2e-3, 1e-5, 0, 0])
    stress, _, state = law.evaluate(strain, start(law), 1.0)
    assert np.abs(stress - 35e6 / 3 * (np.arange(6) < 3)).max() < 1e-8 * 35e6
    plastic = strain - np.linalg.solve(law.C, stress)
    assert np.abs(state["plastic_strain"] - plastic).max() < 1e-12
    assert abs(state["plastic_dissipation"][0] / (stress @ plastic * 0.1 / 1e8) - 1) < 1e-9


@pytest.mark.parametrize("make", [kl.CoulombSoftening3D, kl.CoulombDamage3D])
def test_the_pyramid_meets_the_strengths_of_mohr_and_coulomb(make):
    """Bars of both signs; in shear τ = c cos φ, with the ratio of strengths that is theirs."""
    c, phi = 1e6, np.radians(35)
    tension, compression = (2 * c * np.cos(phi) / (1 + sign * np.sin(phi)) for sign in (1, -1))
    more = {"dilatancy": 35.0, "curve": 3} if make is kl.CoulombSoftening3D else {}
    law = make(30e9, 0.2, tension, 1e3, compression=compression, friction=35.0, **more)
    for strain in (np.linspace(0, 2e-4, 8), -np.linspace(0, 2e-3, 8)):
        strength = tension if strain[-1] > 0 else -compression
        assert abs(uniaxial(law, strain, law.initial_state())[0][-1] / strength - 1) < 1e-9
    path = kl.material_point(law, {"xy": [2e-4]}, steps=20, confined=True)
    assert repr(path).endswith("20 steps to t = 1 s)")  # no columns of numbers
    if make is kl.CoulombSoftening3D:  # dilatant and confined: the larger pressure carries more
        s = tensor(path.stress[-1].T).T
        ends = np.linalg.eigvalsh(s)[[2, 0]]
        assert abs((ends[0] - ends[1]) / 2 + ends.mean() * np.sin(phi) - c * np.cos(phi)) < 1e-9 * c
    else:
        assert abs(path.stress[-1, 3] / (c * np.cos(phi)) - 1) < 1e-9


@pytest.mark.parametrize("steps", [1, 2])
def test_a_bar_of_tresca_follows_points_and_falls_then(steps):
    """σ² is linear in the work of the stress between points, so that σ is linear in the plastic strain."""
    strains, stresses = (0.0, 1e-3, 3e-3), (1e8, 2e8, 1.5e8)
    law = kl.TrescaSoftening3D(200e9, 0.3, 1e8, 4e5, 6, strains=strains, stresses=stresses)
    knots = np.array([1e-3, 2e-3])
    expected = np.interp(knots, strains, stresses)
    ends = [0.0, *expected / 200e9 + knots, 0.02]
    counts = np.multiply(steps, [8, 8, 17])
    path = [np.linspace(a, b, n + 1)[1:] for (a, b), n in zip(pairwise(ends), counts, strict=True)]
    stress, _ = uniaxial(law, np.concatenate(path), start(law))
    assert np.abs(stress[counts.cumsum()[:2] - 1] / expected - 1).max() < 0.03 / steps
    p, rest = 0.02 - stress[-1] / 200e9, 4e6 - 0.15e6 - 0.35e6  # J/m³ that are left
    assert abs(stress[-1] / (1.5e8 * np.exp(-1.5e8 / rest * (p - 3e-3))) - 1) < 0.2 / steps


@pytest.mark.parametrize("curve", [0, 1, 2, 3, 5, 6])
def test_slopes_of_curves_are_their_derivatives(curve):
    more = {"peak": 1.5e8, "peak_at": 0.3, "strains": (0, 0.01, 0.02), "stresses": (1e8, 2e8, 1e8)}
    law = kl.J2Softening3D(200e9, 0.3, 1e8, 1.0, curve, **more)
    stress, slope = CURVES[curve](law, np.linspace(0.01, 0.98, 40) + 1e-30j, np.full(40, 5e6), np.zeros(40))
    assert np.abs(stress.imag / 1e-30 - slope.real).max() < 1e-10 * 1e8


def test_a_thrust_dissipates_the_larger_energy_of_compression():
    law = kl.CoulombSoftening3D(30e9, 0.2, 3e6, 1e4, 3, 15e6, friction=30.0, dilatancy=30.0)
    stress, state = uniaxial(law, [-1e-3], start(law))
    assert abs(stress[0] + 15e6) < 1e-9 * 15e6
    expected = stress[0] * state["plastic_strain"][0] * 0.1 / (1e4 * 5**2)
    assert abs(state["plastic_dissipation"][0] / expected - 1) < 1e-9


def test_a_curve_that_needs_more_than_the_fracture_energy_is_refused():
    law = kl.J2Softening3D(20e9, 0.3, 1e8, 1.0, 6, strains=(0, 0.1), stresses=(1e8, 2e8))
    with pytest.raises(MaterialError, match=r"fracture energy beyond 1.5e\+07 J/m³ times its radius"):
        law.evaluate(np.full(6, 1e-3), start(law), 1.0)


def test_a_softening_element_that_is_too_large_is_refused():
    law = kl.J2Softening3D(200e9, 0.3, 250e6, 1e3)
    state = start(law)
    state["element_radius"][:] = 10.0
    with pytest.raises(SolveError, match="an element of radius 10 m would snap back"):
        law.evaluate(np.array([0.01, 0, 0, 0, 0, 0]), state, 1.0)


def test_what_damages_is_the_stress_of_von_mises_or_the_largest_tension():
    """√3 τ and τ under shear, nothing under pressure, and under a thrust the one alone."""
    shear, pressure, thrust = (
        np.array(stress) * 1e6 for stress in ([0, 0, 0, 2, 0, 0], [-9, -9, -9, 0, 0, 0], [-4, 0, 0, 0, 0, 0])
    )
    for make, sizes in ((kl.VonMisesDamage3D, (2 * 3**0.5, 0, 4)), (kl.RankineDamage3D, (2, 0, 0))):
        law = make(30e9, 0.2, 1e3, 100.0)
        for stress, size in zip((shear, pressure, thrust), sizes, strict=True):
            strain = np.linalg.solve(law.elastic.C, stress)
            threshold = law.evaluate(strain, law.initial_state(), 1.0)[2]["threshold"][0]
            assert abs(threshold - max(size * 1e6, 1e3)) < 1e-6 * 1e6


def test_damage_does_not_heal():
    law = kl.IsotropicDamage3D(30e9, 0.2, 3e6, 100.0)
    stress, state = uniaxial(law, [3e-4], start(law))
    back, again = uniaxial(law, [1e-4], state)
    assert abs(back[0] / stress[0] - 1 / 3) < 1e-9
    assert again["damage"] == state["damage"]


@pytest.mark.parametrize("duration", [0.5, 20.0])
@pytest.mark.parametrize("confined", [True, False])
def test_a_point_takes_its_time_and_is_confined_or_free(duration, confined):
    """A ramp of a Prony series: σ = M ε̇ ((1 - w) t + w τ (1 - exp(-t / τ))), M of a bar or an oedometer."""
    E, nu, w, tau = 1e9, 0.3, 0.3, 10.0
    law = kl.GeneralizedMaxwell3D(E, nu, w, tau)
    path = kl.material_point(law, {"xx": [1e-3]}, duration=duration, confined=confined, steps=20)
    assert abs(path.time[-1] - duration) < 1e-12 * duration
    M = E * (1 - nu) / (1 + nu) / (1 - 2 * nu) if confined else E
    t = path.time
    exact = M * 1e-3 / duration * ((1 - w) * t + w * tau * (1 - np.exp(-t / tau)))
    assert np.abs(path.stress[:, 0] - exact).max() < 1e-3 * exact.max()
    lateral = nu / (1 - nu) * exact if confined else 0 * exact
    assert np.abs(path.stress[:, 1] - lateral).max() < 1e-3 * exact.max()


def test_relaxation_and_creep_of_order_two():
    law = kl.GeneralizedMaxwell3D(1e9, 0.3, 0.3, 10.0, 0.2, 1.0)
    held = np.array([1e-3, 0, 0, 0, 0, 0])
    stress, _, state = law.evaluate(held, law.initial_state(), 0.0)
    for t in (1.0, 2.0, 3.0):
        later, _, state = law.evaluate(held, state, 1.0)
        factor = 1 - 0.3 * (1 - np.exp(-t / 10)) - 0.2 * (1 - np.exp(-t))
        assert np.abs(later - factor * stress).max() < 1e-12 * np.abs(stress).max()
    errors = []
    for n in (20, 40, 80):  # a strain of sin t: convolution in closed form
        state, h = law.initial_state(), 2.0 / n
        for i in range(n):
            out, _, state = law.evaluate(held * np.sin((i + 1) * h), state, h)
        t, exact = 2.0, 0.5 * np.sin(2.0)
        for w, tau in law.terms:
            exact += w * tau * (tau * np.sin(t) + np.cos(t) - np.exp(-t / tau)) / (1 + tau**2)
        errors.append(abs(out[0] / stress[0] - exact))
    assert 3.8 < errors[0] / errors[1] < 4.2
    assert 3.8 < errors[1] / errors[2] < 4.2


def test_a_cycle_of_glue_loses_what_its_loss_modulus_says():
    """∮ σ dε = π ε² E Σ w ωτ / (1 + ω²τ²)."""
    law, n, omega = kl.GeneralizedMaxwell3D(1e9, 0.3, 0.3, 2.0, 0.2, 0.5), 200, 1.7
    strain = np.outer(1e-3 * np.sin(2 * np.pi * np.arange(1, 6 * n + 1) / n), [1.0, 0, 0, 0, 0, 0])
    state, stress = law.initial_state(), np.zeros(len(strain))
    for i, e in enumerate(strain):
        out, _, state = law.evaluate(e, state, 2 * np.pi / omega / n, tangent=False)
        stress[i] = out[0]
    middle = (stress[-n - 1 : -1] + stress[-n:]) / 2
    lost = (middle * np.diff(strain[-n - 1 :, 0])).sum()
    modulus = law.C[0, 0] * sum(w * omega * tau / (1 + (omega * tau) ** 2) for w, tau in law.terms)
    assert abs(lost / (np.pi * 1e-6 * modulus) - 1) < 1e-3


@pytest.mark.parametrize(("stretch", "sides"), [(0.6, 1), (1.8, 1), (0.7, 2), (1.5, 2)])
def test_rubber_pulled_along_one_side_or_two(stretch, sides):
    """Cauchy's stresses of neo-Hooke are (μ (λ² - 1) + Λ ln J) / J; those of free sides vanish."""
    law = kl.NeoHookean3D(1e6, 0.3)
    path = kl.material_point(law, {side: [(stretch**2 - 1) / 2] for side in ("xx", "yy")[:sides]})
    squares = 1 + 2 * path.strain[-1, :3]
    J, (lam, mu) = np.sqrt(squares.prod()), (law.E * 0.3 / (1.3 * 0.4), law.E / 2.6)
    cauchy = (mu * (squares - 1) + lam * np.log(J)) / J
    assert np.abs(cauchy[sides:]).max() < 1e-8 * np.abs(cauchy).max()
    assert np.abs(path.stress[-1, :3] - J * cauchy / squares).max() < 1e-8 * np.abs(cauchy).max()


@pytest.mark.parametrize("stretch", [0.6, 1.5, 3.0])
def test_rubber_pulled_and_sheared(stretch):
    green = (stretch**2 - 1) / 2
    shear = np.array([0, 1 / 2, 0, 1.0, 0, 0])  # simple shear of 1: F = 1 + e_x e_y
    F = np.array([[1.0, 1, 0], [0, 1, 0], [0, 0, 1]])
    for law in HYPERELASTIC[1:]:
        S = law.evaluate(shear, {}, 1.0)[0]
        sigma = F @ tensor(S) @ F.T
        if isinstance(law, kl.NeoHookean3D):
            mu = law.E / (2 * (1 + law.nu))
            assert abs(sigma[0, 1] - mu) < 1e-9 * mu
        # Rivlin's universal relation
        assert abs(sigma[0, 0] - sigma[1, 1] - sigma[0, 1]) < 1e-9 * abs(sigma[0, 1])
    nearly = kl.MooneyRivlin3D(0.3e6, 0.1e6, 1e12)
    stress, _ = uniaxial(nearly, [green])
    exact = 2 * (stretch - stretch**-2) * (0.3e6 + 0.1e6 / stretch) / stretch
    assert abs(stress[0] - exact) < 1e-4 * abs(exact)
    ogden = kl.Ogden3D(0.63e6, 1.3, 1e12)
    stress, _ = uniaxial(ogden, [green])
    exact = 0.63e6 * (stretch**0.3 - stretch ** (-0.65 - 1)) / stretch
    assert abs(stress[0] - exact) < 1e-4 * abs(exact)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda s, D, q: (s[:3], D, q), "stress must have shape"),
        (lambda s, D, q: (s, D[:3], q), "tangent must have shape"),
        (lambda s, D, q: (s * np.nan, D, q), "stress is not finite"),
        (lambda s, D, q: (s, D, {}), "internal variables plastic_strain"),
        (lambda s, D, q: (s, D, q | {"plastic_strain": np.zeros(2)}), "plastic_strain must have shape"),
        (lambda s, D, q: s, "must return stress, tangent"),
    ],
)
def test_a_law_that_breaks_the_contract_is_told_how(change, says, monkeypatch):
    law, response = kl.J2Plasticity3D(200e9, 0.3, 250e6), kl.J2Plasticity3D.response
    monkeypatch.setattr(kl.J2Plasticity3D, "response", lambda *a: change(*response(*a)))
    with pytest.raises((MaterialError, SolveError), match=says):
        law.evaluate(np.full(6, 1e-3), law.initial_state(), 1.0)


@dataclass(frozen=True)
class Stiffening(Material):
    E: float
    hidden: float = 0.0
    density: float = 0.0

    def response(self, strain, state, dt):
        return self.E * (strain + 100 * strain**3), None, {}


def test_a_law_of_a_user():
    law = Stiffening.from_variables({"E": 2e9, "DENSITY": 3.0})
    assert law == Stiffening(2e9, 0.0, 3.0)
    stress = law.evaluate([0.1, 0, 0, 0, 0, 0], {}, 1.0)[0]
    assert abs(law.energy(np.array([0.1, 0, 0, 0, 0, 0]), stress, {}) - 2e9 * (0.005 + 25e-4)) < 1e-3
    assert np.abs(law.C - 2e9 * np.eye(6)).max() < 1e-6 * 2e9
    with pytest.raises(MaterialError, match=r"needs E \(E\)"):
        Stiffening.from_variables({"hidden": 1.0})
    with pytest.raises(MaterialError, match="six components"):
        law.evaluate(np.zeros(5), {}, 1.0)


def test_a_law_that_is_not_a_frozen_dataclass_is_refused():
    class Plain(Material):
        def response(self, strain, state, dt):
            return strain, None, {}

    with pytest.raises(InputError, match="frozen dataclass with a density"):
        kl.Model(kl.box(), Plain())


def test_a_law_cannot_use_its_own_tangent_at_rest(monkeypatch):
    law = kl.J2Plasticity3D(200e9, 0.3, 250e6)
    monkeypatch.setattr(kl.J2Plasticity3D, "response", lambda self, e, q, dt: (e @ self.C, None, q))
    with pytest.raises(MaterialError, match=r"uses self\.C"):
        law.C  # noqa: B018


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: kl.J2Plasticity3D(200e9, 0.3, 0.0), "YIELD_STRESS"),
        (lambda: kl.J2Plasticity3D(200e9, 0.3, 1.0, -1.0), "softening"),
        (lambda: kl.FiniteJ2Plasticity3D(200e9, 0.3, 1.0, 0.0, 1.0), "only J2Plasticity3D hardens kin"),
        (lambda: kl.J2Plasticity3D(200e9, 0.3, 2.0, 0.0, 0.0, 1.0), "SATURATION"),
        (lambda: kl.J2Plasticity3D(200e9, 0.5, 1.0), "POISSON_RATIO"),
        (lambda: kl.DruckerPrager3D(1e6, 0.3, 1e3, 95.0), "FRICTION_ANGLE"),
        (lambda: kl.DruckerPrager3D(1e6, 0.3, 1e3, 20.0, 30.0), "DILATANCY"),
        (lambda: kl.ConeSoftening3D(1.0, 0.2, 1.0, 1.0), r"friction \(FRICTION_ANGLE\) 0 must"),
        (lambda: kl.ConeSoftening3D(1, 0.2, 1, 1, friction=9, dilatancy=10), "DILATANCY"),
        (lambda: kl.MooneyRivlin3D(-1.0, 0.0, 1.0), "shear modulus"),
        (lambda: kl.Ogden3D(1.0, -2.0, 1.0), "shear modulus"),
        (lambda: kl.IsotropicDamage3D(1.0, 0.2, 1.0, 0.0), "FRACTURE_ENERGY"),
        (lambda: kl.RankineDamage3D.from_variables({"SOFTENING_TYPE": 2.0}), "SOFTENING_TYPE must be 0"),
        (lambda: kl.J2Softening3D(1.0, 0.2, 1.0, 0.0), "FRACTURE_ENERGY"),
        (lambda: kl.J2Softening3D(1.0, 0.2, 1.0, 1.0, curve=7), r"HARDENING_CURVE\) must be one of .* got 7"),
        (lambda: kl.J2Softening3D(1.0, 0.2, 1.0, 1.0, compression=-2.0), "YIELD_STRESS_COMPRESSION"),
        (lambda: kl.J2Softening3D(1.0, 0.2, 1.0, 1.0, curve=2), "curve 2 needs peak .MAXIMUM_STRESS. > 1"),
        (lambda: kl.J2Softening3D(1.0, 0.2, 1.0, 1.0, curve=4), "curve 4 needs two strains"),
        (lambda: kl.J2Softening3D(1, 0.2, 1, 1, 6, strains=(0, 1), stresses=(1,)), "curve 6 needs strains"),
        (lambda: kl.J2Softening3D(1, 0.2, 1, 1, 6, strains=(1, 2), stresses=(1, 2)), "strains from 0"),
        (lambda: kl.J2Softening3D(1, 0.2, 1, 1, 6, strains=(0, 1), stresses=(1, -1)), "stresses > 0"),
        (lambda: kl.J2Softening3D(1.0, 0.2, 1.0, 1.0, linear_until=1.0), "linear_until .* must lie in 0 … 1"),
        (lambda: kl.J2Softening3D(1, 0.2, 1, 1, potential="Treska"), "one of VonMises, .*got 'Treska'"),
        (lambda: kl.TrescaSoftening3D(1, 0.2, 1, 1, potential="DruckerPrager"), "FRICTION_ANGLE"),
        (lambda: kl.CoulombDamage3D(1.0, 0.2, 1.0, 1.0), r"friction \(FRICTION_ANGLE\) 0 must"),
        (lambda: kl.J2Softening3D.from_variables({"TANGENCY_REGION2": True}), "TANGENCY_REGION2 is not"),
        (
            lambda: kl.SimoJuDamage3D.from_variables(
                {"YIELD_STRESS_TENSION": 1.0, "YIELD_STRESS_COMPRESSION": 2.0}
            ),
            "YIELD_STRESS_COMPRESSION of SimoJuDamage3D must be",
        ),
        (lambda: kl.GeneralizedMaxwell3D(1.0, 0.2, 0.9, 1.0, 0.2), "sum ≤ 1"),
        (lambda: kl.GeneralizedMaxwell3D(1.0, 0.2, 0.9, 0.0), "tau1"),
    ],
)
def test_constants_beyond_their_bounds(make, says):
    with pytest.raises(MaterialError, match=says):
        make()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (
            lambda: kl.Isotropic3D(youngs=1.0, nu=0.3),
            "Isotropic3D has no 'youngs'. It has E, nu, density, alpha",
        ),
        (lambda: kl.Isotropic3D(E=1.0, nu=0.3, densty=1.0), "no 'densty'. Did you mean density?"),
        (
            lambda: kl.J2Plasticity3D(1.0, 0.3, yield_stres=1.0),
            "no 'yield_stres'. Did you mean yield_stress?",
        ),
    ],
)
def test_a_constant_that_a_law_does_not_have(make, says):
    with pytest.raises(MaterialError) as raised:
        make()
    assert says in str(raised.value)


def test_an_internal_variable_that_a_law_or_its_state_does_not_have():
    @dataclass(frozen=True)
    class Misspelt(Material):
        density: float = 0.0

        internal_variables = {"plastic_strain": 6, "hardening": 1}  # noqa: RUF012

        def response(self, strain, state, dt):
            return strain - state["plastic_stain"], None, dict(state)

    says = "'plastic_stain', .* plastic_strain, hardening; add .* Did you mean plastic_strain"
    with pytest.raises(MaterialError, match=says):
        kl.material_point(Misspelt(), {"xx": [0.1]})
    law = kl.J2Plasticity3D(200e9, 0.3, 250e6)
    with pytest.raises(kl.InputError, match="confined must be True or False; got 'no'"):
        kl.material_point(law, {"xx": [0.1]}, confined="no")
    with pytest.raises(kl.InputError, match="give targets"):
        kl.material_point(law, {"xx": []})
    with pytest.raises(MaterialError, match=r"'back_stress', which .*start with its initial_state"):
        law.evaluate(np.zeros(6), {}, 1.0)


def test_an_error_of_a_response_that_is_no_missing_variable_stays(monkeypatch):
    monkeypatch.setattr(kl.J2Plasticity3D, "response", lambda self, e, q, dt: {}["plastic_strain"])
    law = kl.J2Plasticity3D(200e9, 0.3, 250e6)
    with pytest.raises(KeyError):
        law.evaluate(np.zeros(6), law.initial_state(), 1.0)


@pytest.mark.parametrize(("kind", "linear"), [(0, 1), (1, 0)])
def test_damage_of_a_file_softens_as_it_says(kind, linear):
    values = {"YOUNG_MODULUS": 30e9, "POISSON_RATIO": 0.2, "FRACTURE_ENERGY": 100.0, "SOFTENING_TYPE": kind}
    law = kl.VonMisesDamage3D.from_variables(values | {"YIELD_STRESS_TENSION": 3e6})
    assert law == kl.VonMisesDamage3D(30e9, 0.2, 3e6, 100.0, linear=linear)

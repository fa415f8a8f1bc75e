"""Springs, elastic foundations and added masses: closed forms, all analyses alike, what is refused."""

import numpy as np
import pytest
from scipy.optimize import brentq

import kratos_lite as kl
from kratos_lite.errors import KratosLiteError
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined

STEEL = kl.Isotropic3D(200e9, 0.0, density=7800.0)
RUBBER = kl.Isotropic3D(1e6, 0.3, density=1000.0)
CENTER = np.array([0.5, 0.5, 0.5])


def block(kind="Element3D8N", cells=(2, 2, 2), law=STEEL, **options):
    return kl.Model(kl.box((1, 1, 1), cells, kind), law, **options)


# ---- springs ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "nu", "solver"),
    [
        ("Element3D8N", 0.3, "auto"),
        ("Element3D8N", 0.3, "direct"),
        ("Element3D8N", 0.3, "dense"),
        ("Element3D8N", 0.49999, "amg"),  # displacements with pressures
        ("Element3D20N", 0.3, "amg"),  # with linear elements as a level
        ("Element3D10N", 0.3, "amg"),
    ],
)
def test_a_column_on_springs_alone_stands_exactly(kind, nu, solver):
    """Bottom: -q/k; a column of uniform stress: the sides are pulled so that it stays uniaxial."""
    k, q, law = 1e8, 1e6, kl.Isotropic3D(1e9, nu, density=1.0)
    model = block(kind, (3, 3, 3), law)
    model.add(kl.ElasticSupport("z-", (1e5, 1e5, k)))
    model.add(kl.Traction("z+", (0, 0, -q)))
    result = model.solve(solver)
    assert np.abs(result.reactions.sum(axis=0) - (0, 0, q)).max() < 1e-6 * q
    assert np.abs(result.reaction("z-").sum(axis=0) - (0, 0, q)).max() < 1e-6 * q
    if nu == 0.3:
        free = block(kind, (3, 3, 3), kl.Isotropic3D(1e9, 0.0, density=1.0))
        free.add(kl.ElasticSupport("z-", (1e5, 1e5, k)))
        free.add(kl.Traction("z+", (0, 0, -q)))
        z = free.mesh.points[:, 2]
        exact = np.outer(-q / k - q * z / 1e9, (0, 0, 1))
        assert np.abs(free.solve(solver).u - exact).max() < 1e-8 * q / k


def test_a_beam_on_an_elastic_foundation():
    """Hetényi, chapter III: both ends free, a force in the middle; b k is the modulus for each metre."""
    length, b, h, E, k = 4.0, 0.1, 0.05, 200e9, 4e7
    model = kl.Model(kl.box((length, b, h), (32, 1, 1), "Element3D20N"), kl.Isotropic3D(E, 0.0))
    model.fix("y-", "y")
    model.fix((2.0, 0, 0), "x")
    model.add(kl.ElasticSupport("z-", k))
    middle = np.isclose(model.mesh.points[:, 0], 2.0)
    model.add(kl.PointLoad(middle, (0, 0, -1e3 / middle.sum()), each=True))
    a = length * (k * b / (4 * E * b * h**3 / 12)) ** 0.25
    deep = 1e3 * a / (2 * k * b * length) * (np.cosh(a) + np.cos(a) + 2) / (np.sinh(a) + np.sin(a))
    result = model.solve()
    assert abs(result.u[middle, 2].mean() / -deep - 1) < 5e-3
    assert abs(result.reaction("z-")[:, 2].sum() - 1e3) < 1e-6


def test_springs_on_a_point_and_a_remote_point():
    """A rigid block on a spring with rotations; the same by its point: flexibilities are the inverse."""
    k = np.diag([1e6, 2e6, 3e6, 1e5, 2e5, 4e5]) + 1e4
    model = block()
    point = model.rigid(np.arange(model.mesh.n_nodes), (0.2, 0.3, -1.0))
    model.add(kl.ElasticSupport(point, k))
    load = np.array([1.0, -2.0, 3.0, 0.5, 0.7, -0.4])
    model.add(point.load(load[:3], load[3:]))
    result = model.solve()
    moved = np.concatenate([point.displacement(result), point.rotation(result)])
    assert np.abs(moved - np.linalg.solve(k, load)).max() < 1e-12 * 1e-5 * 1e5
    assert np.abs(np.concatenate(point.reaction(result)) + load).max() < 1e-8
    one = block()
    one.fix("z-", "z")
    one.fix("y-", "y")
    one.add(kl.ElasticSupport((0.25, 0.5, 0.0), (1e4, 0, 0)))
    one.add(kl.Traction("x+", (10.0, 0, 0)))
    result = one.solve()
    assert abs(result.reactions[:, 0].sum() + 10) < 1e-5
    assert abs(result.at((0.25, 0.5, 0.0)).displacement[0] - 1e-3) < 1e-9


def test_two_bodies_joined_by_a_spring():
    """Two columns, one above the other, a spring between the points of their faces: in series."""
    low, high = kl.box((1, 1, 1), (1, 1, 1)), kl.box((1, 1, 1), (1, 1, 1))
    points = np.concatenate([low.points, high.points + np.array([0, 0, 1.5])])
    nodes = np.concatenate([low.blocks[0].nodes, high.blocks[0].nodes + low.n_nodes])
    mesh = kl.Mesh(points, [kl.Block("Element3D8N", nodes)])
    model, k = kl.Model(mesh, kl.Isotropic3D(1e9, 0.0)), 5e6
    model.fix(lambda X: X[:, 2] == 0)
    model.fix(lambda X: X[:, 2] > 1, "xy")
    ends = [model.rigid(lambda X, z=z: X[:, 2] == z, (0.5, 0.5, z)) for z in (1.0, 1.5)]
    with pytest.raises(KratosLiteError, match="can still move: translation z"):
        model.solve()
    model.add(kl.ElasticSupport(ends[1], (0, 0, k), to=ends[0]))
    model.add(ends[1].load((0, 0, -1e4)))
    result = model.solve()
    stored = kl.Compliance().value(result) / 2  # of blocks and springs, by the work of the loads
    assert abs(result.energy() / stored - 1) < 1e-9
    gap = ends[1].displacement(result) - ends[0].displacement(result)
    assert abs(gap[2] + 1e4 / k) < 1e-12
    assert abs(ends[0].displacement(result)[2] + 1e4 / 1e9) < 1e-12
    assert abs(result.reactions[:, 2].sum() - 1e4) < 1e-6


def test_a_plastic_bar_and_a_large_strain_bar_pull_on_a_spring():
    """In series with a spring at one end: the force of the spring is the stress times the area."""
    law = kl.J2Plasticity3D(E=200e9, nu=0.3, yield_stress=200e6, hardening=2e9)
    model = block(cells=(1, 1, 1), law=law)
    for side, axis in (("x-", "x"), ("y-", "y")):
        model.fix(side, axis)
    model.fix("z+", "z", lambda t: 0.01 * t)
    model.add(kl.ElasticSupport("z-", (0, 0, 100e9)))
    analysis = model.quasi_static()
    list(kl.integrate(analysis, dt=0.5, steps=2))
    result = analysis.result()
    stress = result.stress()[0, 0, 2]
    below = result.displacement("z-")[0, 2]
    strain = 200e6 / 200e9 + (stress - 200e6) * (1 / 200e9 + 1 / 2e9)
    assert abs(stress / (100e9 * below) - 1) < 1e-7
    springs = 100e9 * below**2 / 2
    assert abs(result.energy() - result.totals()[0] - springs) < 1e-9 * springs
    assert abs((below + strain) / 0.01 - 1) < 1e-6
    assert abs(result.reaction("z-")[:, 2].sum() + stress) < 1e-6 * stress
    large = block(cells=(1, 1, 1), law=kl.Isotropic3D(1e6, 0.0), formulation="total_lagrangian")
    large.fix("z-", "z")
    large.fix("x-", "x")
    large.fix("y-", "y")
    large.add(kl.ElasticSupport("z+", (0, 0, 1e6)))
    large.add(kl.Traction("z+", (0, 0, 8e5)))
    u = large.solve().displacement("z+")[0, 2]
    stretch = 1 + u  # S = E (λ² - 1)/2, P = λ S
    assert abs(1e6 * stretch * (stretch**2 - 1) / 2 + 1e6 * u - 8e5) < 1.0


# ---- masses -------------------------------------------------------------------------------------------


def test_modes_of_a_rigid_body_with_mass_on_springs():
    """ω² = k / m in each direction and about each axis, J of the block and of the mass together."""
    model = block()
    point = model.rigid(np.arange(model.mesh.n_nodes), CENTER)
    k = np.array([1e6, 2e6, 3e6, 4e6, 5e6, 7e6])
    model.add(kl.ElasticSupport(point, k))
    model.add_mass(point, 2200.0, np.diag([100.0, 200.0, 300.0]))
    J = 7800 / 6 + np.array([100.0, 200.0, 300.0])
    omega, shapes = model.modes(6)
    assert np.abs(omega**2 / np.sort(k / [1e4, 1e4, 1e4, *J]) - 1).max() < 1e-9
    body = kl.MassProperties.of(model)
    assert abs(body.mass - 1e4) < 1e-8
    assert np.abs(body.inertia - np.diag(J)).max() < 1e-8
    assert np.abs(body.center - CENTER).max() < 1e-12
    assert shapes.shape == (6, 27, 3)
    other = model.matrices()
    K, M = ((other.T.T @ A @ other.T).toarray() for A in (other.K, other.M))
    assert np.abs(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real) / omega**2 - 1).max() < 1e-6


@pytest.mark.parametrize("ratio", [0.5, 5.0])
def test_a_cantilever_with_a_mass_at_its_end(ratio):
    """1 + cos β cosh β = r β (sin β cosh β - cos β sinh β), r = M / (ρ A L) (Rayleigh, Blevins)."""
    length, side = 2.0, 0.05
    model = kl.Model(kl.box((length, side, side), (20, 1, 1), "Element3D20N"), STEEL)
    model.fix("x-")
    mass = ratio * 7800 * length * side**2
    model.add_mass("x+", mass)

    def equation(b):
        return 1 + np.cos(b) * np.cosh(b) - ratio * b * (np.sin(b) * np.cosh(b) - np.cos(b) * np.sinh(b))

    beta = brentq(equation, 0.5, 1.875)
    omega = (beta / length) ** 2 * np.sqrt(200e9 * side**2 / 12 / 7800)
    assert np.abs(model.modes(2)[0] / omega - 1).max() < 2e-3
    point = kl.Model(model.mesh, STEEL)
    point.fix("x-")
    point.add_mass(point.rigid("x+", (length, side / 2, side / 2)), mass)
    assert np.abs(point.modes(2)[0] / omega - 1).max() < 3e-3
    point.add(kl.Gravity((0, 0, -10.0)))
    weight = (7800 * length * side**2 + mass) * 10
    assert abs(point.solve().reaction("x-")[:, 2].sum() / weight - 1) < 1e-7


def test_weight_scales_with_amplitudes_and_stands_in_load_cases():
    model = block(law=RUBBER)
    model.fix("z-")
    model.add_mass((0.3, 0.4, 1.0), 200.0)
    model.add_mass("z+", 300.0)
    load = kl.Gravity(lambda X: np.outer(X[:, 2], (0, 0, -10.0)))
    cases = model.solve_cases({"even": kl.Gravity((1.0, 0, -10.0)), "uneven": load})
    assert np.abs(cases["even"].loads.sum(axis=0) - (1500.0, 0, -15000.0)).max() < 1e-8
    assert abs(cases["uneven"].loads[:, 2].sum() + 10 * (500 + 500)) < 1e-8
    model.add(kl.Gravity((0, 0, -10.0)), amplitude=lambda t: 1 + t)
    assert abs(model.solve().reactions[:, 2].sum() - 15000.0) < 1e-6
    body = kl.MassProperties.of(model)
    center = (1000 * CENTER + 200 * np.array([0.3, 0.4, 1]) + 300 * np.array([0.5, 0.5, 1])) / 1500
    assert np.abs(body.center - center).max() < 1e-12


def test_derivatives_and_harmonic_response_know_the_weight_of_masses():
    """Of one load, the derivative by its factor is the value; the frequency 0 is statics."""
    model = block(law=RUBBER)
    model.fix("z-")
    model.add_mass("z+", 300.0)
    model.add(kl.Gravity((0, 0, -10.0)))
    result, top = model.solve(), kl.DisplacementAt((0.5, 0.5, 1), "z")
    assert abs(result.gradient(top, "loads")[0] / top.value(result) - 1) < 1e-9
    for method in ("modes", "direct"):
        swinging = model.harmonic(0.0, method=method).displacement(0)
        assert np.abs(swinging - result.u).max() < 1e-9 * np.abs(result.u).max()


@pytest.mark.parametrize("part", ["x-", "x+", "z-", "y+"])
def test_derivatives_of_reactions_know_springs(part):
    """Linear in the load: the derivative by its factor is the reaction, of supports, springs or both."""
    model = kl.Model(refine(kl.box((1, 1, 1), (2, 2, 2)), np.array([0])).mesh, RUBBER)
    model.fix("x-")
    model.add(kl.ElasticSupport("x+", (1e5, 1e5, 1e6)))
    model.add(kl.ElasticSupport("z-", 1e6))
    model.add(kl.Traction("z+", (0, 1e3, -1e4)))
    result = model.solve()
    for axis in "yz":
        force = kl.ReactionOf(part, axis)
        exact, size = force.value(result), np.abs(result.reactions).sum()
        assert abs(result.gradient(force, "loads")[0] - exact) < 1e-8 * size
        assert result.error(of=force).value == exact


@pytest.mark.parametrize("law", [STEEL, kl.NeoHookean3D(1e9, 0.0, density=7800.0)], ids=["linear", "any law"])
def test_a_mass_on_a_spring_swings_in_time(law):
    """Half a period after its start at z0 it is at -z0; energy stays."""
    model = block(cells=(1, 1, 1), law=law, formulation="total_lagrangian" if law is not STEEL else None)
    for side, axis in (("x-", "x"), ("y-", "y")):
        model.fix(side, axis)
    model.add(kl.ElasticSupport("z-", (0, 0, 1e6)))
    model.add_mass("z+", 2200.0)
    period, start = 2 * np.pi / 10.0, np.tile([0, 0, 1e-4], (8, 1))
    analysis = model.transient(displacement=start, integrator=kl.Newmark())
    energy = analysis.energy()
    assert abs(energy - 1e6 * 1e-8 / 2) < 1e-6 * energy
    states = list(kl.integrate(analysis, dt=period / 60, steps=30))
    assert np.abs(states[-1].u + start).max() < 3e-3 * 1e-4
    assert abs(analysis.energy() / energy - 1) < 1e-5
    force = states[-1].reactions[model.mesh.nodes("z-"), 2].sum()
    assert abs(force - 100.0) < 0.3  # -k u


def test_mass_proportional_damping_damps_added_mass():
    """m u'' + α m u' + k u = 0: the logarithmic decrement of a half period is α T / 4."""
    model = block(cells=(1, 1, 1))
    for side, axis in (("x-", "x"), ("y-", "y")):
        model.fix(side, axis)
    model.add(kl.ElasticSupport("z-", (0, 0, 1e6)))
    model.add_mass("z+", 2200.0)
    alpha = 1.0
    omega = np.sqrt(100 - alpha**2 / 4)
    analysis = model.transient(displacement=np.tile([0, 0, 1e-4], (8, 1)), rayleigh=(alpha, 0.0))
    for _ in kl.integrate(analysis, dt=np.pi / omega / 200, steps=200):
        pass
    expected = -1e-4 * np.exp(-alpha * np.pi / omega / 2)
    assert np.abs(analysis.state().u[:, 2] / expected - 1).max() < 1e-3


def test_a_finer_mesh_stands_on_the_same_springs():
    model = block("Element3D8N", (2, 2, 2), RUBBER)
    point = model.rigid("z+", (0.5, 0.5, 1.0))
    model.add(kl.ElasticSupport("z-", (1e5, 1e5, 1e6)))
    model.add(kl.ElasticSupport(point, (1e5, 1e5, 1e5, 1e3, 1e3, 1e3)))
    model.add_mass(point, 100.0)
    model.add(kl.Gravity((0, 0, -10.0)))
    finer = refined(model, refine(model.mesh, np.array([0, 5])))
    results = [model.solve(), finer.solve(), model.solve(error=0.1)]
    for result in results:
        assert abs(result.reactions[:, 2].sum() - 11000.0) < 1e-6
    z = [point.displacement(result)[2] for result in results]
    assert np.ptp(z) < 0.02 * abs(z[0])
    assert results[0].error(of=kl.MeanDisplacement("z+", "z")).relative < 0.05


def test_buckling_of_a_column_on_a_rotational_spring():
    """Foot on a rotational spring c, head free: β tan β = c L / EI, F = β² EI / L² (Timoshenko & Gere)."""
    length, side, E = 2.0, 0.1, 200e9
    EI = E * side**4 / 12
    model = kl.Model(kl.box((side, side, length), (1, 1, 16), "Element3D20N"), kl.Isotropic3D(E, 0.0))
    foot = model.rigid("z-", (side / 2, side / 2, 0))
    foot.fix()
    model.add(kl.ElasticSupport(foot, (0, 0, 0, 2 * EI / length, 10 * EI / length, 1e6)))
    model.add(kl.Resultant("z+", (0, 0, -1.0)))
    factor = model.buckling(1)[0][0]
    beta = brentq(lambda b: b * np.tan(b) - 2.0, 0.5, 1.5)
    assert abs(factor / (beta**2 * EI / length**2) - 1) < 5e-3


def test_the_summary_shows_them():
    model = block()
    model.add(kl.ElasticSupport("z-", 1e6))
    model.add_mass("z+", 100.0)
    assert "ElasticSupport(where='z-', stiffness=1000000.0)" in str(model)
    assert "AddedMass(where='z+', mass=100.0)" in str(model)


def written(model, path):
    model.add_mass("z+", 100.0)
    kl.write(path / "model.mdpa", model)


def explicit(model):
    model.fix("z-")
    model.add_mass("z+", 100.0)
    model.transient(integrator="central_difference")


def moving(model):
    model.add_mass("z+", 1.0)
    model.add(kl.ale.Translation("x", 5.0))
    model.solve()


def far(model):
    model.add(kl.ElasticSupport((0.0, 0, 0), (1, 1, 1), to=(1.0, 1, 1)))


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda m, p: m.add(kl.ElasticSupport("sole", 1e6)), "no part 'sole'"),
        (lambda m, p: m.add(kl.ElasticSupport((9.0, 9, 9), (1, 1, 1))), "an elastic support at .* outside"),
        (lambda m, p: m.add(kl.ElasticSupport("z-", -1e6)), "≥ 0 in each direction"),
        (lambda m, p: m.add(kl.ElasticSupport("z-", np.eye(3) + np.eye(3, k=1))), "must be symmetric"),
        (lambda m, p: m.add(kl.ElasticSupport("z-", (1.0, 2.0))), "a number, \\(3,\\)"),
        (lambda m, p: m.add(kl.ElasticSupport("z-", np.ones(6))), "with rotations is for remote points"),
        (lambda m, p: m.add(kl.ElasticSupport((0.0, 0, 0), 1e6)), "in N/m; got a number"),
        (lambda m, p: m.add(kl.ElasticSupport("z-", 1e6, to="z+")), "joins their remote points"),
        (lambda m, p: far(m), "along the line between them"),
        (lambda m, p: m.add(kl.ElasticSupport("z-", 1e6), name="bed"), "no amplitude nor name"),
        (lambda m, p: m.add_mass("z+", -1.0), "an added mass"),
        (lambda m, p: m.add_mass("z+", 1.0, np.eye(3)), "is for remote points"),
        (lambda m, p: m.add_mass(m.rigid("z+", (0, 0, 0)), 1.0, -np.eye(3)), "≥ 0 in each direction"),
        (lambda m, p: (m.add(kl.ElasticSupport("z-", 1e6)), m.solve()), "can still move: translation x, y"),
        (lambda m, p: explicit(m), "do not take springs"),
        (lambda m, p: moving(m), "added masses .* does not move through the mesh"),
        (written, "added mass cannot be written"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_in_words(act, words, tmp_path):
    with pytest.raises(KratosLiteError, match=words):
        act(block(), tmp_path)


@pytest.mark.parametrize("mass", [0.05, 5.0, 500.0])
def test_a_mass_far_heavier_than_its_beam_leaves_the_frequency_of_a_spring(mass):
    """ω² = k/m with the k of statics, though the mass of the beam is up to 1e-7 of it, and at most 2e-3."""
    model = kl.Model(
        kl.box((100.0, 10, 10), (10, 1, 1), "KinematicLinear3D20N"), kl.Isotropic3D(210e3, 0.3, 7.85e-9)
    )
    model.fix("x-")
    load = kl.Resultant("x+", (0, 0, 1.0))
    model.add(load)
    tip = model.mesh.nodes("x+")
    k = 1 / model.solve().u[tip, 2].mean()
    model.add_mass("x+", mass)
    omega = model.modes(1)[0][0]
    assert abs(omega * np.sqrt(mass / k) - 1) < 2e-3

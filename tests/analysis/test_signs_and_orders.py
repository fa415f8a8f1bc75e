"""Signs and orders of accuracy that other tests are too coarse to see, each against algebra written here."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.solution_checks import check_solution
from kratos_lite.assembly.nodal_extrapolation import extrapolation
from kratos_lite.errors import SolveError
from kratos_lite.model.checks import equilibrium
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.time_series import slope_of

SOIL = kl.Isotropic3D(E=1e7, nu=0.3, density=2000.0)


def model():
    found = kl.Model(kl.box(cells=(1, 1, 2)), SOIL)
    found.fix("z-")
    found.add(kl.Traction("z+", (1e3, 2e3, 0)), amplitude=lambda t: 1 + 100 * t * t)
    return found


def system(transient):
    """Return M, C, K on the free degrees of freedom as full matrices, and these."""
    e = transient.equations
    free = e.system.constraint_map.free
    shares = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    return *(e.matrix(0.0, *s).scipy().toarray()[np.ix_(free, free)] for s in shares), free


def test_the_euler_load_turns_against_the_acceleration():
    """Its power with the motion of the material at the rate 1 is -J α: it holds back."""
    wheel = kl.Model(kl.annulus(0.3, 1.0, 0.2, (2, 16, 1), "KinematicLinear3D20N"), SOIL)
    wheel.add(kl.ale.Rotation("z", 0.0, 7.0))
    e = EquationsOfMotion(wheel)
    f, X = e.inertia_load(0.0).reshape(-1, 3), e.system.points
    inertia = SOIL.density * 0.2 * np.pi / 2 * (1.0**4 - 0.3**4)
    assert (f * (X @ wheel.motion.A.T)).sum() == pytest.approx(-7.0 * inertia, rel=2e-3)


@pytest.mark.parametrize("alpha", [-0.05, -1 / 3])
def test_one_step_of_hht_satisfies_its_equation(alpha):
    """M a⁺ + (1+α)(C v⁺ + K u⁺) - α (C v + K u) = f at t + (1+α) h: damping too is a mean of both ends."""
    rng, h = np.random.default_rng(1), 2e-3
    subject = model()
    start = rng.uniform(-1, 1, (12, 3)) * (subject.mesh.points[:, 2:] > 0)
    options = {"displacement": 1e-3 * start, "velocity": start[::-1] * (start != 0), "rayleigh": (5.0, 1e-3)}
    transient = subject.transient(integrator=kl.HHT(alpha), **options)
    M, C, K, free = system(transient)
    u, v = transient.u[free], transient.v[free]
    (end,) = kl.integrate(transient, h, 1)
    u1, v1, a1 = (x.ravel()[free] for x in (end.u, end.v, end.a))
    f = transient.equations.load((1 + alpha) * h)[free]
    terms = [M @ a1, (1 + alpha) * (C @ v1), (1 + alpha) * (K @ u1), -alpha * (C @ v), -alpha * (K @ u), -f]
    assert np.abs(C @ (v1 - v)).max() > 1e-3 * np.abs(f).max()
    assert np.abs(sum(terms)).max() < 1e-9 * max(np.abs(term).max() for term in terms)


def test_one_step_of_central_differences_damps_the_velocity_at_its_end():
    """M a⁺ + α M v⁺ + K u⁺ = f."""
    subject = model()
    start = np.random.default_rng(2).uniform(-1, 1, (12, 3)) * (subject.mesh.points[:, 2:] > 0)
    options = {"velocity": start, "rayleigh": (50.0, 0.0)}
    transient = subject.transient(integrator=kl.CentralDifference(), **options)
    h = 0.5 * transient.critical_step()
    M, C, K, free = system(transient)
    old = transient.v[free]
    (end,) = kl.integrate(transient, h, 1)
    u1, v1, a1 = (x.ravel()[free] for x in (end.u, end.v, end.a))
    left = M @ a1 + C @ v1 + K @ u1 - transient.equations.load(h)[free]
    assert np.abs(left).max() < 1e-9 * np.abs(M @ a1).max()
    assert np.abs(C @ (v1 - old)).max() > 1e-4 * np.abs(M @ a1).max()


@pytest.mark.parametrize("alpha", [0.0, 40.0])
def test_order_of_central_differences_with_damping(alpha):
    """Errors at steps of h and h/2 against those of h/16."""
    ends = []
    for n in (1, 2, 16):
        options = {"velocity": 1e-3 * model().mesh.points, "rayleigh": (alpha, 0.0)}
        transient = model().transient(integrator=kl.CentralDifference(), **options)
        h = 0.4 * transient.critical_step()
        ends.append([state.u for state in kl.integrate(transient, h / n, 30 * n, every=30 * n)][-1])
    coarse, fine = (np.abs(end - ends[2]).max() for end in ends[:2])
    assert coarse / fine == pytest.approx(4 * (1 - 16.0**-2) / (1 - 8.0**-2), rel=0.2)


@pytest.mark.parametrize("rayleigh", [(0.0, 1e-3), (100.0, 5e-4)])
def test_damping_shortens_the_critical_step_of_central_differences(rayleigh):
    """With x = ω h / 2 the limit of stability is x² + 2 ξ x = 1, ξ = β ω / 2."""
    free, damped = (
        model().transient(integrator=kl.CentralDifference(), rayleigh=r).critical_step()
        for r in ((0.0, 0.0), rayleigh)
    )
    omega = 2 / free
    xi, x = rayleigh[1] * omega / 2, omega * damped / 2
    assert xi > 0.02
    assert x * x + 2 * xi * x == pytest.approx(1.0, rel=1e-12)


def test_moving_supports_start_with_the_velocity_of_their_function():
    """Differences of order 2 are exact for a parabola, whose slope those of order 1 miss."""
    subject = kl.Model(kl.box(), SOIL)
    subject.fix("z-", "z", lambda t: 0.5 * t + 1e3 * t * t)
    u, v, a = EquationsOfMotion(subject).prescribed.at_start(1e-3)
    bottom = 3 * subject.mesh.nodes("z-") + 2
    np.testing.assert_allclose(u[bottom], 0.0, atol=0)
    np.testing.assert_allclose(v[bottom], 0.5, rtol=1e-8)
    np.testing.assert_allclose(a[bottom], 2e3, rtol=1e-6)


def test_the_slope_of_a_table_at_a_kink_is_the_mean_of_both_sides():
    """Also where a time lies a little beside the kink by rounding; a far knot changes nothing of it."""
    for times, values, expected in (
        ([0.0, 0.3, 0.5, 0.6], [0.0, 3.0, 3.0, 1.0], {0.0: 10, 0.3: 5, 0.1 + 0.2: 5, 0.5: -10, 0.6: -10}),
        ([0.0, 0.1, 1e9], [0.0, 10.0, 10.0], {0.05: 100, 0.1: 50, sum([0.01] * 10): 50, 0.2: 0, 2e9: 0}),
    ):
        table = kl.TimeSeries(times, values)
        assert [table.slope(time) for time in expected] == pytest.approx(list(expected.values()))


def test_the_slope_of_a_function_at_the_start_looks_forward_and_is_exact_for_a_parabola():
    assert slope_of(lambda t: 3 + 2 * t + 5 * t * t, "a rate")(0.0) == pytest.approx(2.0, abs=1e-8)


def test_rigid_body_modes_are_translations_and_turns_about_the_center():
    X, center = np.random.default_rng(5).uniform(-1, 1, (4, 3)), np.array([0.3, -0.2, 0.7])
    modes = rigid_modes(X, center).reshape(4, 3, 6)
    for axis, e in enumerate(np.eye(3)):
        np.testing.assert_allclose(modes[:, :, axis], np.tile(e, (4, 1)), rtol=0, atol=1e-15)
        np.testing.assert_allclose(modes[:, :, 3 + axis], np.cross(e, X - center), rtol=0, atol=1e-15)


def test_a_single_force_and_a_pair_of_forces_are_out_of_balance():
    X = np.array([(0.0, 0, 0), (2.0, 0, 0)])
    both, pair = np.array([(0.0, 3.0, 0), (0.0, 3.0, 0)]), np.array([(0.0, 1.0, 0), (0.0, -1.0, 0)])
    assert equilibrium(X, both, np.zeros_like(both), both) == (1.0, 0.0)
    nothing = np.zeros_like(pair)
    force, moment = equilibrium(X, pair, nothing, pair)
    assert force == 0.0
    assert moment == pytest.approx(1.0)
    assert equilibrium(X, pair, -pair, nothing) == (0.0, 0.0)


def checked(backward_error, balance):
    check_solution(Solution(np.zeros(3), "direct", "", 0, backward_error), np.zeros(3), balance)


@pytest.mark.parametrize(
    ("backward_error", "balance", "words"),
    [(1e-16, (0.0, 0.02), "miss equilibrium"), (1e-16, (0.02, 0.0), "miss equilibrium")]
    + [(error, (0.0, 0.0), "reached a backward error of") for error in (2e-8, 9e-4, np.inf)],
)
def test_a_solution_out_of_balance_or_with_a_backward_error_is_refused(backward_error, balance, words):
    checked(0.9e-8, (1e-3, 1e-3))
    with pytest.raises(SolveError, match=words):
        checked(backward_error, balance)


FACE = """Begin Properties 1
 YOUNG_MODULUS 1e6
 POISSON_RATIO 0.2
End Properties
Begin Nodes
{nodes}
End Nodes
Begin Elements KinematicLinear3D8N
1 1 1 2 3 4 5 6 7 8
End Elements
Begin Conditions SmallDisplacementSurfaceLoadCondition3D4N
1 1 5 6 7 8
End Conditions
"""
CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]


@pytest.mark.parametrize(
    ("variable", "sign"), [("POSITIVE_FACE_PRESSURE", -1), ("NEGATIVE_FACE_PRESSURE", 1)]
)
def test_a_nodal_pressure_of_a_file_pushes_as_that_of_a_condition(variable, sign, tmp_path):
    """∓∫ N p n on the upper face of a unit cube, whose normal is z; from p = 4 at a node 4/9 … 1/9."""
    mesh = FACE.format(nodes="\n".join(f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(CUBE, 1)))
    nodal = [f"Begin NodalData {variable}\n7 0 {4.0}\nEnd NodalData\n"]
    face = [f"Begin ConditionalData {variable}\n1 {1.0}\nEnd ConditionalData\n"]
    forces = []
    for data in (nodal, face):
        (tmp_path / "face.mdpa").write_text(mesh + "".join(data))
        model = kl.read(tmp_path / "face.mdpa")
        forces.append(sum(load.forces(model.mesh, model.element_groups()) for load in model.loads))
    np.testing.assert_allclose(forces[0][4:, 2], sign * np.array([1, 2, 4, 2]) / 9, rtol=1e-12)
    np.testing.assert_allclose(forces[1][4:, 2], sign * np.full(4, 0.25), rtol=1e-12)


def test_poisson_ratios_of_a_file_keep_their_axes(tmp_path):
    """ε = S σ written here, with nine different constants, and the file written anew."""
    constants = {"YOUNG_MODULUS_X": 11e9, "YOUNG_MODULUS_Y": 7e9, "YOUNG_MODULUS_Z": 5e9}
    constants |= {"POISSON_RATIO_XY": 0.31, "POISSON_RATIO_YZ": 0.23, "POISSON_RATIO_XZ": 0.11}
    constants |= {"SHEAR_MODULUS_XY": 3e9, "SHEAR_MODULUS_YZ": 2e9, "SHEAR_MODULUS_XZ": 1e9}
    nodes = "\n".join(f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(CUBE, 1))
    head = " CONSTITUTIVE_LAW_NAME Orthotropic3D\n" + "".join(f" {k} {v}\n" for k, v in constants.items())
    text = FACE.format(nodes=nodes).replace(" YOUNG_MODULUS 1e6\n POISSON_RATIO 0.2\n", head)
    (tmp_path / "wood.mdpa").write_text(text)
    wood = kl.read(tmp_path / "wood.mdpa")
    kl.write(tmp_path / "again.mdpa", wood)
    x, y, z = 11e9, 7e9, 5e9
    S = np.array(
        [[1 / x, -0.31 / x, -0.11 / x], [-0.31 / x, 1 / y, -0.23 / y], [-0.11 / x, -0.23 / y, 1 / z]]
    )
    for model in (wood, kl.read(tmp_path / "again.mdpa")):
        C = model.element_groups()[0].material.C
        np.testing.assert_allclose(np.linalg.inv(C[:3, :3]), S, rtol=1e-9)
        np.testing.assert_allclose(np.diag(C)[3:], [3e9, 2e9, 1e9])


@pytest.mark.parametrize("element", [kl.KinematicLinear3D6N, kl.KinematicLinear3D15N])
def test_nodal_values_in_wedges_take_along_what_twists(element):
    """ξ ζ and η ζ are in the corner functions of a wedge; a plane misses them."""
    P, nodes = element.rule.points, np.asarray(element.nodes)
    fields = [lambda x: x[:, 2], lambda x: x[:, 0] * x[:, 2], lambda x: x[:, 1] * x[:, 2], lambda x: x[:, 0]]
    for field in fields:
        found = extrapolation(element, element.rule) @ field(np.asarray(P))
        np.testing.assert_allclose(found, field(nodes), atol=1e-12)

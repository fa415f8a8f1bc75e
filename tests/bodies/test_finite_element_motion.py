"""Finite-element bodies: free flight, natural frequencies, a rotating bar, mixed and quadratic meshes.

Reference values: the equations of motion solved with 12 digits, Ritz' method with Legendre polynomials,
closed forms of discrete bars, and numbers of Solfec-1.0 where it is right.
"""

from functools import cache

import motions
import numpy as np
import pytest
from meshes import NAMES, four_cells
from motions import end

import kratos_lite as kl
from kratos_lite.bodies.rotations import exp
from kratos_lite.elements import ELEMENTS

INTEGRATORS = ("DEF_EXP", "DEF_LIM", "ENERGY_MOMENTUM")
each_integrator = pytest.mark.parametrize("integrator", INTEGRATORS)
SPIN, FLIGHT, G = (0.05, 10, 0.05), (1, 2, 3), (0, 0, -9.81)
MOMENTUM = np.array([1.36, 232, 0.52])
"""Angular momentum of the box about its mass center."""


def one_element(name, X, E=1.0, **options):
    material = kl.Isotropic3D(E=E, nu=0.3, density=1.0)
    return kl.FiniteElementBody(kl.Mesh(X, {name: [range(len(X))]}), material, **options)


# ---- free flight with spin -------------------------------------------------------------------------


def thrown(brick, cells, integrator, **options):
    body = brick(cells=(cells,) * 3, integrator=integrator, **options)
    body.set_velocity(FLIGHT, SPIN)
    body.add(kl.Gravity(G))
    return body


def total(body):
    """Return the energy with a potential that is zero in the undeformed body."""
    return float(body.energy())


@cache
def thrown_by_the_equations():
    return motions.brick((0.4, 0.6, 1.0), 1e6, 0.3, 1000.0, FLIGHT, SPIN, G, [0.5])


CORNER = {1: (-0.17099327, 1.01893627, 0.0154804), 2: (-0.14845588, 1.01987322, 0.05198496)}
"""Displacement of the corner (+, +, +) after 0.5 s with lumped masses."""
LUMPED = {1: (5160.141, 3.0, 0.0101150947), 2: (3420.0705, 1.5, 0.0053560047)}
"""Energy, inertia as a multiple of the exact one, critical step."""


@pytest.mark.parametrize(
    ("cells", "integrator", "error", "gain", "moment"),
    [
        (1, "DEF_EXP", 1.2872e-4, 2.969e-5, 0.0),
        (1, "DEF_LIM", 2.5878e-4, 2.962e-5, 4.803e-9),
        (1, "ENERGY_MOMENTUM", 2.6e-4, 0.0, 0.0),
        (2, "DEF_EXP", 1.2886e-4, 2.273e-5, 0.0),
        (2, "DEF_LIM", 2.6797e-4, 2.339e-5, 5.416e-9),
        (2, "ENERGY_MOMENTUM", 2.7e-4, 0.0, 0.0),
    ],
)
def test_a_thrown_box_with_lumped_mass(cells, integrator, error, gain, moment, brick, drift):
    body = thrown(brick, cells, integrator, lumped=True)
    energy, factor, critical = LUMPED[cells]
    assert total(body) == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(body.angular_momentum(), factor * MOMENTUM, rtol=1e-11)
    assert 0.9 * critical < body.critical_step() <= critical * (1 + 1e-8)
    p = body.linear_momentum()
    np.testing.assert_allclose(p, 240 * np.array(FLIGHT), rtol=1e-13)
    changes, spins = [], []
    for state in kl.integrate(body, 1e-3, 500, every=5):
        t = state.time
        np.testing.assert_allclose(
            body.mass_center(), np.array(FLIGHT) * t + np.array(G) * t * t / 2, atol=2e-14
        )
        changes.append(abs(total(body) / energy - 1))
        spins.append(drift(factor * MOMENTUM, body.angular_momentum()))
    corner = body.displacement[np.argmax(body.points.sum(axis=1))]
    assert np.linalg.norm(corner - CORNER[cells]) < 3 * error
    assert np.linalg.norm(corner - CORNER[cells]) > error / 10
    assert max(changes) < (1.05 * gain if gain else 1e-12)
    assert max(spins) < (1.1 * moment if moment else 1e-13)
    np.testing.assert_allclose(body.linear_momentum(), p + 0.5 * 240 * np.array(G), rtol=1e-12)


@pytest.mark.parametrize(
    ("integrator", "errors"),
    [("DEF_EXP", (1.2872e-4, 3.2463e-5)), ("DEF_LIM", (2.5878e-4, 6.4741e-5)), ("ENERGY_MOMENTUM", None)],
)
def test_errors_of_all_nodes_against_the_equations_of_the_element(integrator, errors, brick):
    (points, (q,)), found = thrown_by_the_equations(), []
    for steps in (500, 1000):
        body = end(thrown(brick, 1, integrator, lumped=True), 0.5 / steps, steps)
        order = [int(np.argmin(np.linalg.norm(body.points - X, axis=1))) for X in points]
        found.append(np.sqrt(((body.displacement[order] - q) ** 2).sum(axis=1).mean()))
    if errors:
        np.testing.assert_allclose(found, errors, rtol=1e-3)
    assert np.log2(found[0] / found[1]) == pytest.approx(2, abs=0.05)


def test_the_corotational_formulation_follows_the_total_lagrangian_one_for_small_strains(brick):
    """A stiffer box at a moderate spin: strains of 1e-4."""
    spin = np.array([0.3, 2.0, 0.4])
    one = brick(E=1e7, cells=(2, 2, 2), integrator="DEF_LIM")
    other = brick(E=1e7, cells=(2, 2, 2), integrator="DEF_LIM", formulation="corotational")
    for body in (one, other):
        body.set_velocity(FLIGHT, spin)
        end(body, 5e-3, 60)
    strain = max(one.internal_energy(), other.internal_energy())
    assert one.internal_energy() == pytest.approx(other.internal_energy(), rel=2e-2)
    assert strain > 0
    moved = np.linalg.norm(one.displacement, axis=1).max()
    assert np.abs(one.displacement - other.displacement).max() < 2e-4 * moved


@pytest.mark.parametrize("integrator", ["DEF_EXP", "DEF_LIM"])
def test_all_modes_are_the_corotational_form(integrator, brick):
    bodies = [
        brick(E=1e6, cells=(1, 1, 2), integrator=integrator, formulation="corotational"),
        brick(E=1e6, cells=(1, 1, 2), integrator=integrator, formulation="modal", modes=36),
    ]
    for body in bodies:
        body.set_velocity(FLIGHT, SPIN)
        body.add(kl.Gravity(G))
        end(body, 1e-3, 100)
    np.testing.assert_allclose(bodies[0].q, bodies[1].q, atol=1e-10)
    np.testing.assert_allclose(bodies[0].u, bodies[1].u, atol=1e-8)


@pytest.mark.parametrize("modes", [6, 9, 12])
def test_few_modes_leave_rigid_motion_exact(modes, brick, drift):
    body = brick(E=1e9, cells=(2, 2, 3), formulation="modal", modes=modes)
    body.set_velocity(FLIGHT, SPIN)
    np.testing.assert_allclose(body.angular_momentum(), MOMENTUM, rtol=1e-10)
    p, start = body.linear_momentum(), float(body.kinetic_energy())
    rigid = brick(kl.RigidBody, integrator="RIG_IMP")
    rigid.set_velocity(FLIGHT, SPIN)
    end(body, 1e-3, 100)
    end(rigid, 1e-3, 100)
    np.testing.assert_allclose(body.linear_momentum(), p, rtol=1e-11)
    assert drift(MOMENTUM, body.angular_momentum()) < 1e-6
    assert float(body.energy()) == pytest.approx(start, rel=1e-4)
    X = body.points
    assert np.abs(body.position(X) - rigid.position(X)).max() < 1e-4


# ---- all kinds of elements -------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
@each_integrator
def test_every_element_spins_freely(name, integrator, brick, drift):
    body = brick(E=1e6, cells=(1, 1, 1), element=name, integrator=integrator)
    body.set_velocity(FLIGHT, SPIN)
    start, p = total(body), body.linear_momentum()
    np.testing.assert_allclose(body.angular_momentum(), MOMENTUM, rtol=1e-11)
    assert start == pytest.approx(1160.047 + 120 * 14, rel=1e-12)
    h = 0.9 * body.critical_step() if integrator == "DEF_EXP" else 1e-3
    end(body, h, 25)
    np.testing.assert_allclose(body.linear_momentum(), p, rtol=1e-12)
    if integrator == "ENERGY_MOMENTUM":
        assert total(body) == pytest.approx(start, rel=1e-11)
    else:
        assert total(body) == pytest.approx(start, rel=1e-2)
    assert drift(MOMENTUM, body.angular_momentum()) < (1e-5 if integrator == "DEF_LIM" else 1e-12)


@pytest.mark.parametrize("lumped", [False, True])
@each_integrator
def test_a_mesh_of_four_kinds_of_elements_spins_freely(integrator, lumped, drift):
    soft = kl.Isotropic3D(E=1e5, nu=0.3, density=100.0)
    body = kl.FiniteElementBody(four_cells(), soft, integrator=integrator, lumped=lumped)
    body.set_velocity(FLIGHT, (0.5, 3.0, -1.0))
    L, p, start = body.angular_momentum(), body.linear_momentum(), total(body)
    if not lumped:
        rigid = kl.RigidBody(body.mesh, body.material)
        rigid.set_velocity(FLIGHT, (0.5, 3.0, -1.0))
        np.testing.assert_allclose(L, rigid.angular_momentum(), rtol=1e-12)
        assert start == pytest.approx(float(rigid.kinetic_energy()), rel=1e-12)
    h = 0.9 * body.critical_step() if integrator == "DEF_EXP" else 5e-3
    end(body, h, 40)
    np.testing.assert_allclose(body.linear_momentum(), p, rtol=1e-12)
    assert drift(L, body.angular_momentum()) < (1e-5 if integrator == "DEF_LIM" else 1e-12)
    assert total(body) == pytest.approx(start, rel=1e-11 if integrator == "ENERGY_MOMENTUM" else 1e-3)


@pytest.mark.parametrize(("E", "h"), [(1e6, 5e-2), (2e11, 1e-3)])
def test_large_steps_keep_energy_and_momenta(E, h, brick, drift):
    body = brick(E=E, cells=(1, 2, 2))
    body.set_velocity(FLIGHT, SPIN)
    start, p = total(body), body.linear_momentum()
    for _ in kl.integrate(body, h, 15):
        assert abs(total(body) / start - 1) < 1e-10
        assert drift(MOMENTUM, body.angular_momentum()) < 1e-10
    np.testing.assert_allclose(body.linear_momentum(), p, rtol=1e-12)


def test_damping_dissipates_and_leaves_the_momenta(brick, drift):
    body = brick(cells=(1, 1, 2), damping=1e-3)
    body.set_velocity(FLIGHT, SPIN)
    energies = [total(body)]
    for _ in kl.integrate(body, 5e-3, 40):
        energies.append(total(body))
        assert drift(MOMENTUM, body.angular_momentum()) < 1e-12
    assert (np.diff(energies) < 1e-9).all()
    assert energies[-1] < energies[0] - 1.0


def test_a_homogeneous_motion_of_elements_is_that_of_the_pseudo_rigid_body(brick):
    """Without forces across the boundary it is not: but a single tetrahedron knows no other motion."""
    X = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1.2, 0], [0.1, 0.2, 0.9]])
    for integrator in INTEGRATORS:
        fem = one_element("KinematicLinear3D4N", X, E=50.0, integrator=integrator)
        whole = kl.PseudoRigidBody(fem.mesh, fem.material, integrator=integrator)
        for body in (fem, whole):
            body.set_velocity(FLIGHT, (0.3, -2, 1))
            end(body, 0.01, 60)
        np.testing.assert_allclose(fem.position(X), whole.position(X), atol=1e-11)
        assert float(fem.energy()) == pytest.approx(float(whole.energy()), rel=1e-11)


# ---- natural frequencies ---------------------------------------------------------------------------


PARENTS = {
    "KinematicLinear3D4N": (0.128205128, 0.128205128, 0.212521895, 0.320512821, 0.320512821, 1.005426823),
    "KinematicLinear3D5N": (
        *(0.135327635, 0.206552707, 0.206552707, 0.256410256, 0.256410256, 0.436387511),
        *(0.769230769, 0.769230769, 2.448227873),
    ),
    "KinematicLinear3D6N": (
        *(0.016025641, 0.120192308, 0.158760638, 0.185326991, 0.248397436, 0.256410256),
        *(0.272435897, 0.520585824, 0.641025641, 0.744160188, 0.769230769, 2.237320205),
    ),
    "KinematicLinear3D8N": (
        *(0.128205128,) * 2,
        *(0.235042735,) * 3,
        *(0.384615385,) * 3,
        0.512820513,
        *(0.769230769,) * 8,
        2.5,
    ),
}
SHARES = {
    "KinematicLinear3D4N": (1 / 6, [1 / 4] * 4),
    "KinematicLinear3D5N": (4 / 3, [3 / 16] * 4 + [1 / 4]),
    "KinematicLinear3D6N": (1.0, [1 / 6] * 6),
    "KinematicLinear3D8N": (8.0, [1 / 8] * 8),
}


@pytest.mark.parametrize("name", PARENTS)
def test_stiffness_and_lumped_mass_of_single_elements(name):
    """The lowest value of the pyramid is 0.106743 with the derivative of Solfec-1.0."""
    X = ELEMENTS[name].nodes
    if name.endswith("5N"):
        X = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0], [0, 0, 1]])
    body = one_element(name, X, lumped=True)
    K = body.formulation.K0.scipy().toarray()
    values = np.linalg.eigvalsh(K)
    assert np.abs(values[:6]).max() < 1e-14
    np.testing.assert_allclose(values[6:], PARENTS[name], rtol=2e-8)
    volume, shares = SHARES[name]
    assert float(body.mass) == pytest.approx(volume, rel=1e-14)
    np.testing.assert_allclose(body._mass.nodal, volume * np.array(shares), rtol=1e-13)


@pytest.mark.parametrize("name", NAMES[:4])
def test_the_stiffness_of_a_body_at_rest_is_that_of_small_strains(name):
    body = one_element(name, ELEMENTS[name].nodes)
    np.testing.assert_allclose(
        body.stiffness().scipy().toarray(), body.formulation.K0.scipy().toarray(), atol=1e-14
    )


def unit_cube(n, name="KinematicLinear3D8N", **options):
    mesh = kl.box(cells=(n, n, n), element=name)
    return kl.FiniteElementBody(mesh, kl.Isotropic3D(E=1.0, nu=0.3, density=1.0), **options)


def test_frequencies_of_lame():
    """π √2 √(μ/ρ)/L as cubes of eight-node elements have it; shapes are orthonormal by mass."""
    for n, lumped, expected in ((2, False, 3.038218101), (4, False, 2.870544305), (4, True, 2.653140712)):
        body = unit_cube(n, lumped=lumped)
        omega, shapes = body.modes(40)
        assert np.abs(omega - expected).min() < 1e-8
        np.testing.assert_allclose(shapes.T @ (body._mass.matrix() @ shapes), np.eye(40), atol=1e-10)


@pytest.mark.parametrize(
    ("n", "lowest"),
    [
        (1, [0.716114874] * 2 + [0.969624123] * 3 + [1.240347346] * 3 + [1.432229748]),
        (2, [1.432229748] * 2 + [1.704694373] * 2 + [1.754116039] * 4 + [1.832397908] * 3),
        (4, [1.667629594] * 2 + [2.163240563] * 3 + [2.314509271] + [2.409169897] * 3),
    ],
)
def test_frequencies_of_cubes_with_lumped_mass_are_those_of_solfec(n, lowest):
    omega, shapes = unit_cube(n, lumped=True).modes(6 + len(lowest))
    np.testing.assert_allclose(omega[6:], lowest, rtol=1e-8)
    M = unit_cube(n, lumped=True)._mass.matrix()
    np.testing.assert_allclose(shapes.T @ (M @ shapes), np.eye(len(omega)), atol=1e-10)


def bar(cells=(2, 2, 20), element="KinematicLinear3D8N", **options):
    mesh = kl.box((0.1, 0.1, 1.0), cells, element, origin=(-0.05, -0.05, -0.5))
    return kl.FiniteElementBody(mesh, kl.Isotropic3D(E=2e6, nu=0.26, density=7800.0), **options)


def test_frequencies_of_the_free_bar():
    omega, _ = bar(lumped=True).modes(15)
    solfec = (10.456338329, 25.847889375, 27.026114106, 27.026114106, 49.099502585, 49.099502585, 50.22525595)
    np.testing.assert_allclose(omega[7:14], solfec, rtol=1e-8)
    ritz = (*(9.9984938,) * 2, *(26.0679989,) * 2, 29.1039369, *(47.6794252,) * 2, 50.2775903)
    coarse, fine = (bar((1, 1, n), "KinematicLinear3D20N").modes(14)[0][6:] / ritz - 1 for n in (5, 10))
    bending = [0, 1, 2, 3, 5, 6, 7]  # that of torsion converges with the cells of the section
    assert (fine[bending] > -1e-9).all()
    assert (fine[bending] < coarse[bending]).all()
    assert (fine[bending] < [2.5e-3, 2.5e-3, 8.5e-3, 8.5e-3, 1.7e-2, 1.7e-2, 1e-5]).all()


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_confined_column_swings_with_that_frequency(integrator, lumped):
    """The same in time, held by constraints: the step turns ω into 2/h arcsin or arctan of ω h/2."""
    n, size = 2, 1e-7
    body = unit_cube(n, lumped=lumped, integrator=integrator)
    for side, axis in (("x-", 0), ("x+", 0), ("y-", 1), ("y+", 1), ("z-", 2)):
        body.constrain(kl.FixDirection(body.points[body.mesh.nodes(side)], np.eye(3)[axis]))
    kh = np.pi / (2 * n)
    c = np.sqrt(0.7 / 1.3 / 0.4)
    omega = n * c * (2 * np.sin(kh / 2) if lumped else np.sqrt(6 * (1 - np.cos(kh)) / (2 + np.cos(kh))))
    q = np.zeros_like(body.points)
    q[:, 2] = size * np.sin(np.pi / 2 * body.points[:, 2])
    body.set_configuration(q)
    for constraint in body.constraints:
        constraint.bind(body)
    top = int(np.argmax(body.points.sum(axis=1)))
    h = 0.1
    z = np.array([size] + [state.q[3 * top + 2] for state in kl.integrate(body, h, 16)])
    inverse = np.arcsin if integrator == "DEF_EXP" else np.arctan
    seen = np.arccos((z[2:] + z[:-2]) @ z[1:-1] / (2 * z[1:-1] @ z[1:-1])) / h
    assert seen == pytest.approx(2 / h * inverse(omega * h / 2), rel=1e-6)


# ---- a rotating bar --------------------------------------------------------------------------------


def elongations(body, q):
    """Return by how much the edges and axes along z are longer, (9,) in m."""
    x, ends = body.points + q.reshape(-1, 3), [np.flatnonzero(body.points[:, 2] == z) for z in (-0.5, 0.5)]
    return np.linalg.norm(x[ends[1]] - x[ends[0]], axis=1) - 1


@pytest.mark.parametrize(
    ("formulation", "h", "low", "high", "longest"),
    [
        ("total_lagrangian", 1 / 64, 3.30957, 3.31503, 7.038e-4),
        ("corotational", 1 / 64, 3.30955, 3.31503, 7.035e-4),
    ],
)
def test_a_rotating_bar(formulation, h, low, high, longest):
    """The window is that of the kinetic energy; Solfec-1.0 shows the same."""
    body = bar(formulation=formulation, integrator="DEF_LIM", lumped=True)
    body.set_velocity(angular=(1, 0, 0))
    kinetic, whole, most = [], [float(body.energy())], 0.0
    for state in kl.integrate(body, h, round(1 / h)):
        kinetic.append(float(body.kinetic_energy()))
        whole.append(float(body.energy()))
        most = max(most, elongations(body, state.q).max())
    assert min(kinetic) == pytest.approx(low, abs=1.5e-5)
    assert max(kinetic) == pytest.approx(high, abs=1.5e-5)
    assert np.ptp(whole) < 8 * h * h * whole[0] * 0.08
    assert most == pytest.approx(longest, rel=2e-4)


def test_a_turned_body_does_as_the_body(brick):
    """The co-rotational load turns with the body, whatever it looks like."""
    R = exp([0.4, -1.2, 0.7])
    rng = np.random.default_rng(5)
    for options in ({}, {"formulation": "corotational"}, {"formulation": "modal", "modes": 20}):
        body = brick(cells=(1, 2, 2), **options)
        d = 1e-2 * rng.uniform(-1, 1, body.points.shape)
        turned = (body.points + d) @ R.T - body.points
        f = body.internal_force(d.ravel()).reshape(-1, 3)
        g = body.internal_force(turned.ravel()).reshape(-1, 3)
        np.testing.assert_allclose(g, f @ R.T, atol=1e-11 * np.abs(f).max())

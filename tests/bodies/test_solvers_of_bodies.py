"""How finite-element bodies solve: large ones iterate, what is not needed is not made."""

import pickle

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.bodies import formulations
from kratos_lite.solvers import plan

RUBBER = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)


def spinning(formulation, integrator, damping=0.0):
    body = kl.FiniteElementBody(
        kl.box((0.4, 0.6, 1.0), (2, 3, 4)),
        RUBBER,
        formulation=formulation,
        integrator=integrator,
        damping=damping,
    )
    body.set_velocity((1.0, 2.0, 3.0), (2.0, 10.0, 1.0))
    return body


@pytest.mark.parametrize(
    ("formulation", "integrator", "damping"),
    [
        ("total_lagrangian", "DEF_LIM", 1e-3),
        ("total_lagrangian", "ENERGY_MOMENTUM", 0.0),
        ("total_lagrangian", "ENERGY_MOMENTUM", 1e-3),
        ("corotational", "DEF_LIM", 0.0),
    ],
)
def test_large_bodies_iterate_and_move_alike(formulation, integrator, damping, monkeypatch):
    factorized = spinning(formulation, integrator, damping)
    list(kl.integrate(factorized, 5e-3, 10))
    monkeypatch.setattr(plan, "STEPPED_LIMIT", 10)
    monkeypatch.setattr(plan, "REPEATED_LIMIT", 10)
    made = []
    solver = formulations.LinearSolver
    monkeypatch.setattr(formulations, "LinearSolver", lambda *a, **k: made.append(a) or solver(*a, **k))
    large = spinning(formulation, integrator, damping)
    list(kl.integrate(large, 5e-3, 10))
    assert made
    np.testing.assert_allclose(large.q, factorized.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(large.u, factorized.u, rtol=0, atol=1e-9)


def test_multigrid_of_quadratic_elements_turns_with_the_body(monkeypatch):
    monkeypatch.setattr(plan, "STEPPED_LIMIT", 10)
    mesh = kl.box((1, 1, 2), (3, 3, 6), "KinematicLinear3D20N")
    body = kl.FiniteElementBody(mesh, RUBBER)
    b, iterations = np.random.default_rng(0).standard_normal(body.dofs), []
    for angle in (0.0, np.pi / 2, 2.0):
        turned = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        body.rotate(turned)
        solve = body.solver(body.q, 1e-2)
        around = (b.reshape(-1, 3) @ turned.T).ravel()
        iterations.append(solve.equations.solve(around, 1e-10).iterations)
        residual = body.times_mass(solve(around)) + 1e-2 * (body.stiffness() @ solve(around)) - around
        assert np.abs(residual).max() < 1e-9 * np.abs(b).max()
    assert max(iterations) <= min(iterations) + 2


@pytest.mark.parametrize("formulation", ["total_lagrangian", "corotational", "modal"])
def test_a_pickled_body_goes_on_bit_by_bit(formulation):
    body = spinning(formulation, None)
    list(kl.integrate(body, 1e-3, 2))
    other = pickle.loads(pickle.dumps(body))
    for each in (body, other):
        list(kl.integrate(each, 1e-3, 3))
    np.testing.assert_array_equal(other.q, body.q)


def test_constant_matrices_are_factorized_once(monkeypatch):
    made = []
    kind = formulations.Factorizer
    factorize = kind.factorize
    monkeypatch.setattr(kind, "factorize", lambda self, A: made.append(A) or factorize(self, A))
    for formulation, count in (("corotational", 1), ("total_lagrangian", 7)):
        made.clear()
        list(kl.integrate(spinning(formulation, "DEF_LIM"), 1e-3, 7))
        assert len(made) == count


@pytest.mark.parametrize("limit", [10_000, 10])
def test_a_stiff_body_keeps_one_matrix_wherever_it_turns(limit, monkeypatch):
    monkeypatch.setattr(plan, "STEPPED_LIMIT", limit)
    body = spinning("total_lagrangian", "ENERGY_MOMENTUM")
    body.rotate([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    made = []
    for kind, name in ((formulations.Factorizer, "factorize"), (formulations.LinearSolver, "__init__")):
        make = getattr(kind, name)
        monkeypatch.setattr(kind, name, lambda *a, make=make, **k: made.append(1) or make(*a, **k))
    E, L = float(body.energy()), body.angular_momentum()
    list(kl.integrate(body, 1e-3, 7))
    assert len(made) == 1
    assert abs(float(body.energy()) / E - 1) < 1e-13
    np.testing.assert_allclose(body.angular_momentum(), L, rtol=1e-13)


def test_a_body_at_rest_builds_no_mass_matrix():
    mesh = kl.box(cells=(2, 1, 1))
    body = kl.FiniteElementBody(mesh, RUBBER)
    body.constrain(kl.FixPoint(mesh.points[mesh.nodes("x-")]))
    body.add(kl.Traction("x+", (1e3, 0, 0)))
    kl.find_equilibrium(body)
    assert not {"scalar", "nodal"} & set(vars(body._mass))
    body.kinetic_energy()
    assert "scalar" in vars(body._mass)


@pytest.mark.parametrize("kind", [kl.RigidBody, kl.PseudoRigidBody])
def test_nothing_is_integrated_over_the_volume_after_setup(kind, monkeypatch):
    body = kind(kl.box(), RUBBER)
    body.set_velocity(angular=(0, 1, 0))
    body.add(kl.Gravity((0, 0, -9.81)))

    def refuse(*_):
        raise AssertionError("the volume is integrated again")

    monkeypatch.setattr(kl.KinematicLinear, "_jacobian", refuse)
    monkeypatch.setattr(kl.MassProperties, "of", refuse)
    assert len(list(kl.integrate(body, 1e-3, 5))) == 5

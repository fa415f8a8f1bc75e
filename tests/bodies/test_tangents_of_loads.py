"""Derivatives of loads and reactions with respect to q, and equilibria that need them."""

import numpy as np
import pytest

import kratos_lite as kl

RUBBER = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
SIDES = ("x-", "x+", "y-", "y+", "z-", "z+")
KINDS = (kl.PseudoRigidBody, kl.FiniteElementBody)
INNER = np.array([0.3, 0.6, 0.8])
LOADS = {
    "pressure": lambda: kl.FollowerPressure("x+", 3e4),
    "spring": lambda: kl.Spring(INNER, (2.0, 1.0, 3.0), 5e3),
    "short spring": lambda: kl.Spring(INNER, (2.0, 1.0, 3.0), 5e3, length=0.2),
    "long spring": lambda: kl.Spring(INNER, (2.0, 1.0, 3.0), 5e3, length=9.0),
    "spring from its anchor": lambda: kl.Spring(INNER, INNER, 5e3, length=0.0),
    "curved spring": lambda: kl.Spring(INNER, (2.0, 1.0, 3.0), lambda s, rate: 1e3 * s + 4e3 * s**3 + rate),
    "damped spring": lambda: kl.Spring(INNER, (2.0, 1.0, 3.0), 5e3, damping=7.0),
    "follower force": lambda: kl.Force(INNER, (1.0, -2.0, 3.0), "follower"),
}


def deformed(kind, element="KinematicLinear3D8N"):
    """Return a body in an uneven configuration."""
    rng = np.random.default_rng(5)
    body = kind(kl.box(cells=(2, 1, 2), element=element), RUBBER)
    return body, body.q + 0.06 * rng.uniform(-1, 1, body.q.shape)


def dense(entries, n):
    A = np.zeros((n, n))
    np.add.at(A, entries[:2], entries[2])
    return A


def differences(function, q, h=1e-6):
    return np.array([(function(q + h * e) - function(q - h * e)) / (2 * h) for e in np.eye(len(q))]).T


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", LOADS)
def test_the_derivative_of_a_load_is_that_of_differences(name, kind):
    body, q = deformed(kind)
    body.add(LOADS[name](), amplitude=lambda t: 1.5)
    (load,), rest = body.loads, np.zeros_like(body.u)
    exact = differences(lambda q: load(q, rest, 0.0), q)
    assert np.abs(exact).max() > 0
    found = dense(load.derivative(q, rest, 0.0), body.dofs)
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-7 * np.abs(exact).max())


@pytest.mark.parametrize("element", ["4N", "5N", "6N", "10N", "20N", "27N"])
def test_the_derivative_of_a_pressure_on_faces_of_all_shapes(element):
    body, q = deformed(kl.FiniteElementBody, f"KinematicLinear3D{element}")
    body.add(kl.FollowerPressure(lambda X: X[:, 0] + X[:, 2] > -1, 3e4))
    rest = np.zeros_like(body.u)
    direction = np.random.default_rng(1).uniform(-1, 1, body.dofs)
    ends = [body.loads[0](q + s * 1e-6 * direction, rest, 0.0) for s in (1, -1)]
    exact = (ends[0] - ends[1]) / 2e-6
    found = dense(body.loads[0].derivative(q, rest, 0.0), body.dofs) @ direction
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize("kind", KINDS)
def test_the_derivative_of_the_reaction_of_a_link(kind):
    body, q = deformed(kind)
    link = kl.RigidLink(INNER, (2.0, 1.0, 3.0))
    body.constrain(link)
    pull = np.array([7.0])
    exact = differences(lambda q: link.jacobian(body, q).T @ pull, q)
    found = dense(link.tangent_entries(body, q, pull), body.dofs)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.05, 0.2])
def test_pressure_on_all_faces_has_its_closed_form(kind, share):
    """S = 3 K (a² - 1)/2, σ = S / a: the stretch a of a body that is held against rigid motions alone."""
    body = kind(kl.box(cells=(2, 2, 2)), RUBBER)
    for side in SIDES:
        body.add(kl.FollowerPressure(side, share * 1e6))
    body.constrain(kl.FixPoint((0, 0, 0)))
    body.constrain(kl.FixDirection((1, 0, 0), (0, 1, 0)))
    body.constrain(kl.FixDirection([(1, 0, 0), (0, 1, 0)], (0, 0, 1)))
    iterations = kl.find_equilibrium(body)
    a = body.position(np.array([1.0, 1.0, 1.0]))
    np.testing.assert_allclose(a, a[0], rtol=1e-9)
    bulk = 1e6 / (3 * (1 - 2 * 0.3))
    assert 3 * bulk / 2 * (a[0] ** 2 - 1) / a[0] == pytest.approx(-share * 1e6, rel=1e-8)
    assert iterations < 10


@pytest.mark.parametrize("kind", KINDS)
def test_springs_alone_hold_a_body(kind):
    """Four springs without length, equally stiff in all directions: each carries a quarter of the weight."""
    body = kind(kl.box(cells=(2, 2, 1)), RUBBER)
    corners = np.array([(x, y, 0.0) for x in (0.0, 1.0) for y in (0.0, 1.0)])
    for corner in corners:
        body.add(kl.Spring(corner, corner, 1e5, length=0.0))
    body.add(kl.Gravity((0, 0, -10.0)))
    kl.find_equilibrium(body)
    np.testing.assert_allclose(body.position(corners)[:, 2], -2500.0 / 1e5, rtol=1e-8)


def test_a_stiff_spring_moves_a_soft_body():
    """The reaction of a spring a thousand times as stiff as the body."""
    body = kl.FiniteElementBody(kl.box(cells=(2, 2, 2)), RUBBER)
    body.constrain(kl.FixPoint("z-"))
    body.add(kl.Spring((1, 1, 1), (1.5, 1.0, 2.0), 1e9, length=1.05))
    kl.find_equilibrium(body)
    distance = np.linalg.norm(body.position(np.array([1.0, 1.0, 1.0])) - [1.5, 1.0, 2.0])
    assert distance == pytest.approx(1.05, abs=1e-4)


def test_a_hanging_body_turns_under_its_links():
    """Two links of a pendulum: without the stiffness of their pull nothing holds the body sideways."""
    body = kl.PseudoRigidBody(kl.box((1, 1, 1)), RUBBER)
    for x in (0.0, 1.0):
        for y in (0.0, 1.0):
            body.constrain(kl.RigidLink((x, y, 1.0), (x, y, 3.0)))
    body.add(kl.Gravity((0, 0, -10.0)))
    body.add(kl.Force((0.5, 0.5, 1.0), (1e3, 0.0, 0.0)))
    kl.find_equilibrium(body)
    top = body.position(np.array([0.5, 0.5, 1.0])) - [0.5, 0.5, 3.0]
    assert top[0] / -top[2] == pytest.approx(0.1, rel=1e-6)


def test_a_damper_does_not_push_at_rest():
    """The velocity before is not that of the equilibrium."""
    body = kl.FiniteElementBody(kl.box(), RUBBER)
    body.constrain(kl.FixPoint("z-"))
    body.add(kl.Spring((1, 1, 1), (1, 1, 2), 0.0, damping=1e4))
    body.u[...] = 1.0
    kl.find_equilibrium(body)
    assert np.abs(body.q).max() < 1e-12

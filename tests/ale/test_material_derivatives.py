"""Material derivatives of fields: known ones, paths of material points, balance, and parts at rest."""

import numpy as np
import pytest
from rounding import close

import kratos_lite as kl
from kratos_lite.ale import Rotation, Translation
from kratos_lite.bodies.rotations import exp

A = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
CENTER = np.array([0.0, 0.0, 0.3])
S, SPIN = 7.0, -40.0


def wheel(element="8N", radial=2, around=12, density=1000.0):
    mesh = kl.annulus(0.3, 1.0, 0.2, (radial, around, 1), f"KinematicLinear3D{element}")
    model = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3, density=density))
    model.add(Rotation("z", S, SPIN, center=CENTER))
    return model


def gauss_points(model):
    (group,) = model.element_groups()
    return group.at(model.mesh.points).gauss_points()


@pytest.mark.parametrize("element", ["4N", "6N", "8N", "10N", "20N", "27N"])
def test_linear_fields_of_a_rotor_are_differentiated_exactly(element):
    """Θ = a·(X - X0): DΘ/Dt = s a·A X, and the second order s² a·A² X + s' a·A X."""
    model, a = wheel(element, around=16), np.array([0.7, -1.3, 0.4])
    for X, at in ((model.mesh.points, "node"), (gauss_points(model), "gauss")):
        arm, field = X - CENTER, (model.mesh.points - CENTER) @ a
        close(kl.material_derivative(model, field, at=at), S * arm @ A.T @ a)
        expected = (S * S * arm @ (A @ A).T + SPIN * arm @ A.T) @ a
        close(kl.material_derivative(model, field, order=2, at=at), expected, 1e-11)


def test_vectors_that_turn_with_the_material_change_by_its_rotation():
    """Of the rigid position X - X0 it is the velocity, and of that the acceleration."""
    model = wheel()
    arm = model.mesh.points - CENTER
    velocity = kl.material_derivative(model, arm)
    close(velocity, S * arm @ A.T)
    close(velocity, kl.material_velocity(model, np.zeros_like(arm)))
    at_rest = kl.material_acceleration(model, np.zeros_like(arm))
    close(kl.material_derivative(model, velocity, [SPIN * arm @ A.T]), at_rest)
    close(kl.material_derivative(model, arm, order=2), at_rest)


def test_constants_and_fields_that_only_time_changes():
    model = wheel("20N")
    ones, rates = np.ones(model.mesh.n_nodes), [np.full(model.mesh.n_nodes, 3.0)]
    assert np.abs(kl.material_derivative(model, ones)).max() < 1e-10
    close(kl.material_derivative(model, ones, rates), np.full(len(ones), 3.0), 1e-10)
    close(kl.material_derivative(model, ones, rates, at="gauss"), np.full((24, 27), 3.0), 1e-10)


def test_quadratic_fields_in_a_moving_frame_are_exact_to_the_second_order():
    """Θ(t, x): D = Θ' - z' Θ_x, D² = Θ'' - 2 z' Θ'_x - z'' Θ_x + z'² Θ_xx."""
    v, gained = 5.0, -30.0
    mesh = kl.box((2.0, 1.0, 0.5), (3, 2, 1), "KinematicLinear3D27N")
    model = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    model.add(Translation("x", v, gained, boundaries="natural"))

    def values(X):
        x, y, _ = np.moveaxis(X, -1, 0)
        return x * x * 3 - 2 * x * y + y, x * y + 4 * x * x, x - 7 * y * y  # Θ, Θ', Θ''

    field, first, second = values(mesh.points)
    for X, at in ((mesh.points, "node"), (gauss_points(model), "gauss")):
        x, y, _ = np.moveaxis(X, -1, 0)
        _, d, dd = values(X)
        close(kl.material_derivative(model, field, [first], at=at), d - v * (6 * x - 2 * y))
        expected = dd - 2 * v * (y + 8 * x) - gained * (6 * x - 2 * y) + v * v * 6
        close(kl.material_derivative(model, field, [first, second], order=2, at=at), expected, 1e-11)


def field_at(t, X):
    """Return a smooth scalar and a vector, (..., 4)."""
    x, y, z = np.moveaxis(X, -1, 0)
    parts = [np.sin(2 * x - y + 30 * t), x * y * np.cos(20 * t), np.exp(z - x) * t, np.cos(x + 2 * y) + z]
    return np.stack(parts, axis=-1)


@pytest.mark.parametrize(
    ("at", "order", "tolerance"), [("gauss", 1, 1e-2), ("node", 1, 2e-2), ("node", 2, 0.06)]
)
def test_differences_along_the_way_of_material_points(at, order, tolerance):
    T, h, errors = 0.3, 1e-3, []
    for cells in ((2, 16), (4, 32)):
        model = wheel("20N", *cells)
        X = model.mesh.points if at == "node" else gauss_points(model)

        def on_the_way(t, X=X):
            turn = exp(np.array([0.0, 0.0, -(S * (t - T) + SPIN * (t * t - T * T) / 2)]))
            return field_at(t, (X - CENTER) @ turn.T + CENTER)

        s = S + SPIN * T
        assert model.motion.rate(T) == pytest.approx(s)
        along, still = (
            [f(T + k * h, *rest) for k in (-1, 0, 1)]
            for f, rest in ((on_the_way, ()), (field_at, (model.mesh.points,)))
        )
        slopes = [(y[2] - y[0]) / (2 * h) for y in (along, still)]
        curves = [(y[2] - 2 * y[1] + y[0]) / h**2 for y in (along, still)]
        partial = [slopes[1], curves[1]][:order]
        found = kl.material_derivative(model, still[1], partial, order=order, time=T, at=at)
        expected = (slopes, curves)[order - 1][0]
        assert found.shape == expected.shape
        errors.append(np.abs(found - expected).max() / np.abs(expected).max())
    assert errors[0] < tolerance
    assert errors[1] < errors[0] / (3 if order == 1 else 2)


def test_a_closed_body_keeps_what_its_material_carries():
    """∫ ρ DΘ/Dt = d/dt ∫ ρ Θ: what flows out of one element flows into the next."""
    model = wheel("8N", 3, 16)
    mass = model.transient().equations.mass.scalar
    values = np.random.default_rng(3).standard_normal((model.mesh.n_nodes, 2))
    change = np.random.default_rng(4).standard_normal((model.mesh.n_nodes, 2))
    flow = kl.material_derivative(model, values, [change]) - change
    assert np.abs(flow).max() > 1.0
    close((mass @ (flow + change)).sum(axis=0), (mass @ change).sum(axis=0), 1e-11)


def test_elements_with_different_rules_give_lists():
    model = wheel("8N", 2, 12)
    model.use_rule(3, np.arange(5))
    field = model.mesh.points[:, 0]
    found = kl.material_derivative(model, field, at="gauss")
    assert [len(one) for one in found[:6]] == [27] * 5 + [8]
    groups = model.element_groups()
    for group in groups:
        expected = S * group.at(model.mesh.points).gauss_points()[..., 1]
        close(np.array([found[row] for row in group.rows]), expected)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"field": np.ones(3)}, r"a field needs shape \(\d+,\)"),
        ({"field": [["a"]]}, "real numbers"),
        ({"order": 3}, "order must be 1 or 2"),
        ({"order": True}, "order must be 1 or 2"),
        ({"at": "element"}, "at must be one of node, gauss"),
        ({"partial": [1.0]}, "a partial derivative must have shape"),
        ({"partial": [0.0, 0.0]}, "takes up to 1 partial"),
    ],
)
def test_arguments(arguments, text):
    model = wheel()
    with pytest.raises(kl.InputError, match=text):
        kl.material_derivative(model, **{"field": np.ones(model.mesh.n_nodes), **arguments})


def test_a_model_at_rest_has_no_material_derivative():
    model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    for ask in (kl.material_derivative, kl.material_velocity, kl.material_acceleration):
        with pytest.raises(kl.InputError, match="the model has no motion of its material"):
            ask(model, np.zeros((8, 3)))

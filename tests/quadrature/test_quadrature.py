"""Quadrature: closed forms, the degree of every rule, INTEGRATION_ORDER, and what is refused."""

from math import factorial, sqrt

import numpy as np
import pytest

from kratos_lite.errors import InputError
from kratos_lite.quadrature import (
    CELLS,
    Rule,
    by_order,
    gauss,
    line,
    rule_for,
    tetrahedron,
    triangle,
    wedge,
)

EPS = 4e-16


def same(found, expected, tolerance=EPS):
    np.testing.assert_allclose(np.sort(np.ravel(found)), np.sort(np.ravel(expected)), rtol=0, atol=tolerance)


# ---- closed forms --------------------------------------------------------------------------------


def test_gauss_legendre_points_and_weights_are_the_closed_forms():
    same(line(1).points, [0])
    same(line(1).weights, [2])
    same(line(3).points, [-1 / sqrt(3), 1 / sqrt(3)])
    same(line(5).points, [-sqrt(0.6), 0, sqrt(0.6)])
    same(line(5).weights, [5 / 9, 8 / 9, 5 / 9])
    inner, outer = sqrt(3 / 7 - 2 / 7 * sqrt(6 / 5)), sqrt(3 / 7 + 2 / 7 * sqrt(6 / 5))
    same(line(7).points, [-outer, -inner, inner, outer])
    same(line(9).weights, [(322 + k * 13 * sqrt(70)) / 900 for k in (-1, -1, 1, 1)] + [128 / 225])


def test_jacobi_rules_integrate_their_weight():
    for alpha in (0, 1, 2):
        for n in range(1, 9):
            x, w = gauss.jacobi(n, alpha)
            for k in range(2 * n):
                exact = factorial(k) * factorial(alpha) / factorial(k + alpha + 1)
                assert abs(w @ x**k - exact) <= 2e-14, (alpha, n, k)


def test_the_four_point_tetrahedron_has_all_its_digits():
    rule = tetrahedron(2)
    b = (5 - sqrt(5)) / 20
    same(rule.points, [b] * 9 + [1 - 3 * b] * 3)
    assert rule.weights.tolist() == [1 / 24] * 4
    assert abs(rule.points.max() - 0.58541020) > 1e-9


def test_the_seven_point_triangle_is_radons():
    rule = triangle(5)
    assert len(rule) == 7
    a, b = (6 - sqrt(15)) / 21, (6 + sqrt(15)) / 21
    same(rule.points, [1 / 3, 1 / 3, *[a] * 4, 1 - 2 * a, 1 - 2 * a, *[b] * 4, 1 - 2 * b, 1 - 2 * b])
    assert len(triangle(4)) == 6


def test_the_fifteen_point_tetrahedron_integrates_degree_five_and_not_six():
    rule = tetrahedron(5)
    assert len(rule) == 15
    x = rule.points[:, 0]
    assert abs(rule.weights @ x**5 - factorial(5) / factorial(8)) <= 1e-17
    assert abs(rule.weights @ x**6 - factorial(6) / factorial(9)) > 1e-6


# ---- what every rule must do ---------------------------------------------------------------------

VOLUMES = {
    "point": 1, "line": 2, "triangle": 1 / 2, "quadrilateral": 4,
    "tetrahedron": 1 / 6, "hexahedron": 8, "wedge": 1, "pyramid": 4 / 3,
}  # fmt: skip


@pytest.mark.parametrize("cell", list(CELLS))
def test_all_rules_have_positive_weights_that_sum_to_the_volume(cell):
    for degree in range(21):
        rule = rule_for(cell, degree)
        assert rule.degree >= degree
        assert (rule.weights > 0).all()
        assert abs(rule.weights.sum() / VOLUMES[cell] - 1) <= 1e-13


def test_a_rule_is_iterated_measured_shown_and_read_only():
    rule = wedge(2)
    assert len(rule) == 6
    assert sum(gamma for _, gamma in rule) == pytest.approx(1, abs=6 * EPS)
    assert repr(rule) == "Rule(Strang-Fix 3 x Gauss-Legendre 2: 6 points, degree 2)"
    with pytest.raises(ValueError, match="read-only"):
        rule.points[0, 0] = 1
    with pytest.raises(ValueError, match="read-only"):
        rule.weights[0] = 1
    assert isinstance(rule, Rule)


# ---- choice --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cell", "counts"),
    [
        ("line", [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]),
        ("triangle", [1, 1, 3, 6, 6, 7, 16, 16, 25, 25]),
        ("quadrilateral", [1, 1, 4, 4, 9, 9, 16, 16, 25, 25]),
        ("tetrahedron", [1, 1, 4, 8, 15, 15, 64, 64, 125, 125]),
        ("hexahedron", [1, 1, 8, 8, 27, 27, 64, 64, 125, 125]),
        ("wedge", [1, 1, 6, 12, 18, 21, 64, 64, 125, 125]),
        ("pyramid", [1, 1, 8, 8, 27, 27, 64, 64, 125, 125]),
    ],
)
def test_points_of_each_rule_by_degree(cell, counts):
    assert [len(rule_for(cell, degree)) for degree in range(10)] == counts


@pytest.mark.parametrize(
    ("cell", "counts"),
    [
        ("tetrahedron", [1, 4, 8, 15, 15]),
        ("hexahedron", [1, 8, 27, 64, 125]),
        ("pyramid", [1, 8, 27, 64, 125]),
        ("wedge", [3, 6, 9, 12, 15]),
        ("quadrilateral", [1, 4, 9, 16, 25]),
        ("line", [1, 2, 3, 4, 5]),
    ],
)
def test_integration_order_gives_the_number_of_points_stated(cell, counts):
    assert [len(by_order(cell, order)) for order in (1, 2, 3, 4, 5)] == counts


@pytest.mark.parametrize("order", [0, 6, -1, 2.5])
def test_an_integration_order_outside_one_to_five_is_refused(order):
    with pytest.raises(InputError, match=rf"INTEGRATION_ORDER must be 1 … 5; got {order}"):
        by_order("hexahedron", order)


@pytest.mark.parametrize("degree", [-1, 41, float("nan"), 2.5, "3", None])
@pytest.mark.parametrize("cell", [cell for cell in CELLS if cell != "point"])
def test_a_degree_outside_the_range_is_refused(cell, degree):
    for rule in (CELLS[cell], lambda degree: rule_for(cell, degree)):
        with pytest.raises(InputError, match="the degree of a rule must be a whole number from 0 to 40; got"):
            rule(degree)


def test_an_unknown_cell_is_refused_with_the_names_of_the_known_ones():
    with pytest.raises(
        InputError, match=r"no rules for cell 'prism'; cells are point, line, .*, wedge, pyramid"
    ):
        rule_for("prism", 2)
    with pytest.raises(InputError, match="no rules for cell 'prism'"):
        by_order("prism", 2)

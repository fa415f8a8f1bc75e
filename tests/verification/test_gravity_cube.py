"""The cube under its own weight on rollers: the exact solution is a parabola in z.

u_z(z) = -ρ g (L z - z²/2) / M with the confined modulus M; σ_zz = -ρ g (L - z).
"""

import numpy as np
import pytest
from meshes import named

import kratos_lite as kl
from kratos_lite.verification.meshes import warped
from kratos_lite.verification.scenes import on_rollers

RHO, E, NU, G = 7620.0, 210e6, 0.3, 9.81
M = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
TOP = -1.3221477551020406e-4
SOIL = kl.Isotropic3D(E=E, nu=NU, density=RHO)
NODALLY_EXACT = [6, 8, 10, 13, 15, 20, 27]
QUADRATIC = [10, 13, 15, 20, 27]


def cube(mesh):
    return on_rollers(kl.Model(mesh, SOIL)).model


def exact(points):
    z = points[:, 2]
    return np.column_stack([0 * z, 0 * z, -RHO * G * (z - z * z / 2) / M])


def error(result):
    return np.abs(result.u - exact(result.mesh.points)).max() / abs(TOP)


def test_reference_value_is_the_closed_form():
    assert pytest.approx(-RHO * G / (2 * M), rel=1e-15) == TOP


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("nodes", NODALLY_EXACT)
def test_all_nodes_lie_on_the_exact_parabola(nodes, n):
    result = cube(kl.box(cells=(n, n, n), element=named(nodes))).solve()
    assert error(result) < 1e-12
    np.testing.assert_allclose(result.displacement("z+")[:, 2], TOP, rtol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_pyramids_are_exact_at_the_top_and_near_inside(n):
    result = cube(kl.box(cells=(n, n, n), element=named(5))).solve()
    np.testing.assert_allclose(result.displacement("z+")[:, 2], TOP, rtol=1e-12)
    assert 1e-4 < error(result) < 1.2e-2 / n**2 * 1.2


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("nodes", [10, 27])
def test_27_node_bricks_and_10_node_tetrahedra_stay_exact_on_warped_cells(nodes, n):
    result = cube(warped(named(nodes), n)).solve()
    assert error(result) < 1e-12


@pytest.mark.parametrize(("nodes", "low", "high"), [(8, 1e-3, 5e-2), (20, 1e-5, 2e-3), (15, 1e-5, 2e-3)])
def test_other_cells_lose_exactness_when_warped_by_no_more_than_is_known(nodes, low, high):
    assert low < error(cube(warped(named(nodes), 2, seed=0)).solve()) < high


def test_four_node_tetrahedra_converge_with_order_two():
    errors = []
    for n in (4, 8):
        result = cube(kl.box(cells=(n, n, n), element=named(4))).solve()
        errors.append(np.sqrt(((result.u - exact(result.mesh.points)) ** 2).mean()))
    assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2


@pytest.mark.parametrize("nodes", [4, 5, 6, 8, 10, 13, 15, 20, 27])
def test_reactions_carry_the_weight(nodes):
    result = cube(kl.box(cells=(2, 2, 2), element=named(nodes))).solve()
    assert result.reaction("z-")[:, 2].sum() == pytest.approx(74752.2, rel=1e-12)
    np.testing.assert_allclose(result.report.total_reaction, (0, 0, 74752.2), atol=1e-7)
    np.testing.assert_allclose(result.report.total_load, (0, 0, -74752.2), atol=1e-7)
    assert result.report.force_error < 1e-12
    assert result.report.moment_error < 1e-12


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
@pytest.mark.parametrize("nodes", [8, 10])
def test_every_solver_gives_the_exact_solution(solver, nodes):
    result = cube(kl.box(cells=(4, 4, 4), element=named(nodes))).solve(solver, tolerance=1e-12)
    assert result.report.solver == solver
    assert error(result) < (1e-10 if solver == "amg" else 1e-12)


@pytest.mark.parametrize("nodes", QUADRATIC)
def test_stress_of_quadratic_elements_is_exact_at_gauss_points_and_nodes(nodes):
    result = cube(kl.box(cells=(2, 2, 2), element=named(nodes))).solve()
    peak = RHO * G
    (group,) = result.groups
    z = group.at(result.mesh.points).gauss_points()[..., 2]
    expected = stress_at(z)
    np.testing.assert_allclose(result.stress(), expected, atol=1e-11 * peak)
    np.testing.assert_allclose(result.stress("node"), stress_at(result.mesh.points[:, 2]), atol=1e-11 * peak)
    middle = np.einsum("eg,eg->e", group.at(result.mesh.points).dV, z) / group.at(result.mesh.points).volume()
    np.testing.assert_allclose(result.stress("element"), stress_at(middle), atol=1e-11 * peak)


def stress_at(z):
    zz = -RHO * G * (1 - z)
    side = NU / (1 - NU) * zz
    return np.stack([side, side, zz, 0 * z, 0 * z, 0 * z], axis=-1)


@pytest.mark.parametrize("nodes", QUADRATIC)
def test_energy_is_half_the_work_and_equals_the_integral(nodes):
    result = cube(kl.box(cells=(2, 2, 2), element=named(nodes))).solve()
    assert result.energy() == pytest.approx((RHO * G) ** 2 / (6 * M), rel=1e-12)
    assert result.energy() == pytest.approx((result.loads * result.u).sum() / 2, rel=1e-12)


@pytest.mark.parametrize("unit", [1e-12, 1e-6, 1e-3, 1e3, 1e9])
def test_the_unit_of_length_does_not_matter(unit):
    result = cube(kl.box((unit, unit, unit), (2, 2, 2))).solve()
    np.testing.assert_allclose(result.displacement("z+")[:, 2], TOP * unit**2, rtol=1e-12)


@pytest.mark.parametrize("aspect", [1e2, 1e4, 1e6, 1e8])
@pytest.mark.parametrize("nodes", [8, 10, 27])
def test_flat_cells_cost_no_digits(aspect, nodes):
    height = 1 / aspect
    result = cube(kl.box((1, 1, height), (2, 2, 2), named(nodes))).solve("direct")
    np.testing.assert_allclose(result.displacement("z+")[:, 2], TOP * height**2, rtol=1e-11)


@pytest.mark.parametrize(("offset", "bound"), [(1e3, 1e-11), (1e6, 1e-8), (1e8, 1e-6)])
def test_far_from_the_origin_only_the_digits_of_the_coordinates_are_lost(offset, bound):
    mesh = kl.box(cells=(2, 2, 2), origin=(offset, -offset, offset))
    result = cube(mesh).solve()
    np.testing.assert_allclose(result.displacement("z+")[:, 2], TOP, rtol=bound)
    assert any("far from the origin" in text for text in result.report.warnings) == (offset > 1e7)

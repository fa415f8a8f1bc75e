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
TOP = -RHO * G / (2 * M)
SOIL = kl.Isotropic3D(E=E, nu=NU, density=RHO)


def cube(mesh):
    return on_rollers(kl.Model(mesh, SOIL)).model


def exact(points):
    z = points[:, 2]
    return np.column_stack([0 * z, 0 * z, -RHO * G * (z - z * z / 2) / M])


def error(result):
    return np.abs(result.u - exact(result.mesh.points)).max() / abs(TOP)


@pytest.mark.parametrize("nodes", [4, 5, 6, 8, 10, 13, 15, 20, 27])
def test_a_cube_of_eight_bricks_stands_under_its_weight(nodes):
    """All nodes lie on the exact parabola, those of pyramids at the top alone."""
    result = cube(kl.box(cells=(2, 2, 2), element=named(nodes))).solve()
    if nodes == 5:
        assert 1e-4 < error(result) < 4e-3
    elif nodes != 4:
        assert error(result) < 1e-12
    if nodes != 4:
        np.testing.assert_allclose(result.displacement("z+")[:, 2], TOP, rtol=1e-12)
    assert result.reaction("z-")[:, 2].sum() == pytest.approx(74752.2, rel=1e-12)
    np.testing.assert_allclose(result.report.total_reaction, (0, 0, 74752.2), atol=1e-7)
    np.testing.assert_allclose(result.report.total_load, (0, 0, -74752.2), atol=1e-7)
    assert result.report.force_error < 1e-12
    assert result.report.moment_error < 1e-12
    if nodes >= 10:
        has_exact_stress_and_energy(result)


def has_exact_stress_and_energy(result):
    peak = RHO * G
    (group,) = result.groups
    cells = group.at(result.mesh.points)
    z = cells.gauss_points()[..., 2]
    middle = np.einsum("eg,eg->e", cells.dV, z) / cells.volume()
    for place, at in (("gauss", z), ("node", result.mesh.points[:, 2]), ("element", middle)):
        np.testing.assert_allclose(result.stress(place), stress_at(at), atol=1e-11 * peak)
    assert result.energy() == pytest.approx((RHO * G) ** 2 / (6 * M), rel=1e-12)
    assert result.energy() == pytest.approx((result.loads * result.u).sum() / 2, rel=1e-12)


def stress_at(z):
    zz = -RHO * G * (1 - z)
    side = NU / (1 - NU) * zz
    return np.stack([side, side, zz, 0 * z, 0 * z, 0 * z], axis=-1)


@pytest.mark.parametrize(
    ("nodes", "low", "high"),
    [(10, 0, 1e-12), (27, 0, 1e-12), (8, 1e-3, 5e-2), (20, 1e-5, 2e-3), (15, 1e-5, 2e-3)],
)
def test_warped_cells_lose_exactness_by_no_more_than_is_known(nodes, low, high):
    assert low < error(cube(warped(named(nodes), 2, seed=0)).solve()) < high


def test_four_node_tetrahedra_converge_with_order_two():
    errors = []
    for n in (4, 8):
        result = cube(kl.box(cells=(n, n, n), element=named(4))).solve()
        errors.append(np.sqrt(((result.u - exact(result.mesh.points)) ** 2).mean()))
    assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
@pytest.mark.parametrize("nodes", [8, 10])
def test_every_solver_gives_the_exact_solution(solver, nodes):
    result = cube(kl.box(cells=(4, 4, 4), element=named(nodes))).solve(solver, tolerance=1e-12)
    assert result.report.solver == solver
    assert error(result) < (1e-10 if solver == "amg" else 1e-12)


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

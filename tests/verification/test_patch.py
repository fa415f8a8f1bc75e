"""Patch tests: prescribed on the boundary, a polynomial field must come out inside."""

import numpy as np
import pytest
from meshes import named

from kratos_lite.verification import patch
from kratos_lite.verification.meshes import on_boundary, warped

KINDS = [4, 5, 6, 8, 10, 13, 15, 20, 27]


@pytest.mark.parametrize("nodes", KINDS)
def test_nodal_stress_of_a_linear_field_is_exact(nodes):
    result = patch.held(warped(named(nodes), 3, amount=0.24), patch.linear).solve()
    stress = result.stress("node")
    np.testing.assert_allclose(stress, patch.constant(result.mesh.points), rtol=1e-11)
    assert len(on_boundary(result.mesh)) < result.mesh.n_nodes


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_linear_field_with_each_solver(solver):
    result = patch.held(warped(named(8), 4), patch.linear).solve(solver)
    exact = patch.linear(result.mesh.points)
    np.testing.assert_allclose(result.u, exact, rtol=0, atol=1e-10 * np.abs(exact).max())


@pytest.mark.parametrize("nodes", [10, 13, 15, 20, 27])
def test_nodal_stress_of_pure_bending_is_exact_for_quadratic_elements(nodes):
    model = patch.bent(named(nodes))
    y, largest = model.mesh.points[:, 1], 1e-3 * patch.STEEL.E
    expected = np.column_stack([largest * y, *[0 * y] * 5])
    np.testing.assert_allclose(model.solve().stress("node"), expected, rtol=0, atol=1e-9 * largest)

"""The error estimate of given differences of stresses: its formula, its method, what makes it doubt."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.error_estimate import energy_error


def estimate(recovered, averaged, energy):
    """Return the estimate of 64 elements with these sums of squared differences."""
    model = kl.Model(kl.box((1, 1, 1), (4, 4, 4)), kl.Isotropic3D(E=1.0, nu=0.3))
    shares = np.full((2, 64), [[recovered / 64], [averaged / 64]])
    return energy_error(*shares, energy, model.element_groups(), model.mesh)


def test_the_energy_of_the_exact_solution_is_that_of_the_approximate_one_and_of_the_error():
    """‖u‖² = ‖u_h‖² + ‖u - u_h‖² (Galerkin orthogonality)."""
    found = estimate(1.0, 1.0, 3.0)
    assert found.absolute == pytest.approx(1.7)
    assert found.relative == pytest.approx(1.7 / 2)
    np.testing.assert_allclose(found.per_element, 1.7 / 8)


@pytest.mark.parametrize(("averaged", "method"), [(0.87, "averaging"), (0.92, "recovery")])
def test_the_method_whose_reported_error_is_smaller_counts(averaged, method):
    found = estimate(1.0, averaged, 3.0)
    assert found.method == method
    assert found.absolute == pytest.approx(min(1.7, 1.8 * averaged**0.5))


@pytest.mark.parametrize(("ratio", "coarse"), [(1.6, False), (1.8, True)])
def test_a_mesh_is_coarse_where_recovered_stresses_are_much_farther_than_averaged_ones(ratio, coarse):
    warnings = estimate(ratio**2, 1.0, 100.0).warnings
    assert [text.partition(":")[2][1:23] for text in warnings] == ["the mesh is too coarse"] * coarse

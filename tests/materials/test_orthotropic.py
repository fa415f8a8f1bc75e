"""Wood pulled along one axis narrows along the others by its own Poisson's ratios."""

import numpy as np
import pytest

import kratos_lite as kl

WOOD = kl.Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.4, 0.3, 0.35, 0.7e9, 0.05e9, 0.6e9)


@pytest.mark.parametrize(
    ("axis", "strain"),
    [
        (0, (1 / 11e9, -0.4 / 11e9, -0.35 / 11e9)),
        (1, (-0.4 / 11e9, 1 / 0.9e9, -0.3 / 0.9e9)),
        (2, (-0.35 / 11e9, -0.3 / 0.9e9, 1 / 0.5e9)),
    ],
)
def test_a_pull_along_an_axis_narrows_the_others(axis, strain):
    stress = 1e6 * np.eye(6)[axis]
    found = np.linalg.solve(WOOD.C, stress)
    np.testing.assert_allclose(found, 1e6 * np.array((*strain, 0, 0, 0)), rtol=0, atol=1e-15)


def test_shear_has_the_moduli_of_its_planes_in_the_order_xy_yz_xz():
    np.testing.assert_allclose(np.diag(WOOD.C)[3:], (0.7e9, 0.05e9, 0.6e9), rtol=1e-14)

"""The coarse level of thin bodies: which bodies bend, and the modes of their lines."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.solvers.coarse_level import p_coarse_level
from kratos_lite.solvers.plate_level import _shell_modes, plate_axes, plate_level


@pytest.mark.parametrize(("fraction", "bends"), [(0.45, True), (0.55, False), (0.85, False)])
def test_a_plate_most_of_whose_normal_displacements_are_constrained_does_not_bend(fraction, bends):
    points = kl.box((1, 1, 0.02), (20, 20, 1)).points
    free = np.ones((len(points), 3), dtype=bool)
    free[: int(fraction * len(points)), 2] = False
    assert (plate_axes(points, free.ravel()) is not None) == bends


@pytest.mark.parametrize(("fraction", "bends"), [(0.4, True), (0.6, False), (0.85, False)])
def test_a_shell_most_of_whose_normal_displacements_are_constrained_does_not_bend(fraction, bends):
    mesh = kl.annulus(1.0, 1.02, 2.0, (1, 24, 12))
    points = mesh.points
    model = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3))
    level = p_coarse_level(points, model.element_groups(), None)
    angle = np.round(np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi), 6)
    _, labels = np.unique(np.column_stack([angle, np.round(points[:, 2], 6)]), axis=0, return_inverse=True)
    free = np.ones((len(points), 3), dtype=bool)
    free[labels.ravel() < fraction * labels.max()] = False
    found = plate_level(points, free.ravel(), None, labels.ravel(), level)
    assert (found is not None) == bends


def test_shell_modes_bend_without_shear_across_the_thickness():
    """Kirchhoff: u = w n - z ∇w, with w = x_i x_j, so that ∂w/∂x + ∂u_x/∂z = 0."""
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-0.5, 0.5, 7), indexing="ij"))
    centers, height = np.column_stack([x, y, 0 * x]), 0.01
    frames = np.broadcast_to(np.eye(3)[:, [2, 0, 1]], (len(x), 3, 3))
    low, high = _shell_modes(centers, frames, height)[:, :, :, 6:]
    w = ((low + high) / 2)[:, 2].reshape(7, 7, 6)
    turned = ((high - low) / (2 * height))[:, :2].reshape(7, 7, 2, 6)
    for axis, spacing in ((0, 1 / 3), (1, 1 / 6)):
        slope = np.gradient(w, spacing, axis=axis, edge_order=2)  # exact for quadratic functions
        np.testing.assert_allclose(turned[:, :, axis], -slope, atol=1e-12)
    assert np.ptp(w, axis=(0, 1)) @ [1, 1, 0, 1, 0, 0] > 0.5

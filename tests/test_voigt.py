"""Principal values and directions and Tresca stresses beside closed forms and LAPACK."""

import numpy as np
import pytest

from kratos_lite import voigt

EPS = np.finfo(float).eps
SCALES = (1e-150, 1e-12, 1.0, 1e9, 1e140)


def turned(values, count=200, seed=0):
    """Return stresses (count, 6) with given principal values along random axes (count, 3, 3), one a row."""
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(count, 3, 3)))[0]
    tensors = np.swapaxes(axes, 1, 2) * np.asarray(values) @ axes
    return voigt.vector((tensors + np.swapaxes(tensors, 1, 2)) / 2), axes


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("gap", [0.0, 1e-15, 1e-10, 1e-8, 1e-5, 1e-2, 0.5, 2.0])
@pytest.mark.parametrize("others", [(1.0, -2.0), (-1.0, -1.0), (0.0, 0.0)])
def test_principal_values_are_exact_to_rounding_however_near_they_are(gap, others, scale):
    values = np.sort(scale * np.array([others[0] + gap, *others]))[::-1]
    stress, _ = turned(values)
    size = np.abs(values).max()
    assert np.abs(voigt.principal_values(stress) - values).max() <= 100 * EPS * size
    assert np.abs(voigt.tresca(stress) - (values[0] - values[2])).max() <= 100 * EPS * size


def test_principal_values_are_those_of_lapack():
    stress = np.random.default_rng(1).normal(size=(50, 20, 6)) * np.array([1, 1, 1, 1e-3, 1, 1e-6])
    expected = np.linalg.eigvalsh(voigt.tensor(stress))[..., ::-1]
    assert np.abs(voigt.principal_values(stress) - expected).max() < 30 * EPS


def test_textbook_states_of_stress():
    tau = 7.0
    for stress, values in (
        ([tau, 0, 0, 0, 0, 0], (tau, 0, 0)),
        ([-tau, 0, 0, 0, 0, 0], (0, 0, -tau)),
        ([0, 0, 0, 0, tau, 0], (tau, 0, -tau)),
        ([tau, tau, tau, 0, 0, 0], (tau, tau, tau)),
        ([0, 0, 0, 0, 0, 0], (0, 0, 0)),
        ([3, 5, 0, 4, 0, 0], (4 + np.sqrt(17), 0, 4 - np.sqrt(17))),
        ([0, 0, 0, tau, tau, tau], (2 * tau, -tau, -tau)),
    ):
        assert np.abs(voigt.principal_values(stress) - values).max() < 1e-14 * tau
        assert abs(voigt.tresca(stress) - (values[0] - values[2])) < 1e-14 * tau


def test_a_large_mean_stress_does_not_disturb_tresca_nor_the_directions():
    small = np.array([3.0, 5.0, 0.0, 4.0, 0.0, 0.0]) * 2.0**-10
    large = small + 2.0**30 * np.array([1, 1, 1, 0, 0, 0])  # both sums are exact
    assert abs(voigt.tresca(large) / voigt.tresca(small) - 1) < 4 * EPS
    assert np.abs(voigt.principal_directions(large) - voigt.principal_directions(small)).max() < 1e-12


@pytest.mark.parametrize("scale", SCALES)
def test_principal_directions_diagonalize(scale):
    values = scale * np.array([3.0, 1.0, -0.5])
    stress, axes = turned(values, seed=3)
    found = voigt.principal_directions(stress)
    assert np.abs(np.abs(np.einsum("mij,mij->mi", found, axes)) - 1).max() < 1e-14
    assert np.abs(np.linalg.det(found) - 1).max() < 1e-14
    first = np.take_along_axis(found, np.abs(found).argmax(axis=-1)[..., None], axis=-1)[:, :2]
    assert (first > 0).all()


def test_directions_of_equal_values_are_orthogonal():
    for values in ((2.0, 2.0, 1.0), (2.0, 1.0, 1.0), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)):
        stress, _ = turned(values)
        V = voigt.principal_directions(stress)
        assert np.abs(V @ np.swapaxes(V, 1, 2) - np.eye(3)).max() < 1e-14
        back = np.swapaxes(V, 1, 2) * np.array(values) @ V
        assert np.abs(voigt.vector(back) - stress).max() < 1e-14


def test_no_stresses_have_no_principal_values():
    none = np.zeros((0, 6))
    assert voigt.principal_values(none).shape == (0, 3)
    assert voigt.principal_directions(none).shape == (0, 3, 3)
    assert voigt.tresca(np.zeros((2, 0, 6))).shape == (2, 0)

"""The figures that other tests take for rotors, derived in axes that turn with the material, without ALE."""

import numpy as np
import pytest

from tests.ale import test_frequencies, test_steady
from tests.ale.rotating_axes import waves


def test_frequencies_in_space(wheels):
    """The lowest ones above 0 of up to four waves around, at 30 rad/s."""
    found = np.concatenate([waves(n, wheels.steel).frequencies(30.0) for n in range(-4, 5)])
    found = np.sort(found[found > 0])[: len(test_frequencies.INPLANE)]
    assert np.abs(found / np.sort(test_frequencies.INPLANE) - 1).max() < 3e-7


@pytest.mark.parametrize(("n", "rate", "radial", "tangential"), test_steady.STEADY)
def test_answers_to_a_pressure_at_rest(n, rate, radial, tangential, wheels):
    found = waves(n, wheels.steel).steady(rate, 1e5, 0.0)
    assert np.abs(np.array(found) - [radial, tangential / 1j]).max() < 3e-7 * abs(radial)


@pytest.mark.parametrize(("n", "radial", "tangential"), test_steady.DAMPED)
def test_answers_with_damping(n, radial, tangential, wheels):
    found = waves(n, wheels.steel).steady(30.0, 1e5, 20.0)
    assert np.abs(np.array(found) - [radial, tangential]).max() < 3e-7 * abs(radial)

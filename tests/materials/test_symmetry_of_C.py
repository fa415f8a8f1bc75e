"""C must be symmetric, but for the rounding of its own computation."""

from dataclasses import dataclass

import numpy as np
import pytest

from kratos_lite import LinearMaterial, MaterialError
from kratos_lite.materials import MATERIALS


def law(C):
    """Return a material with this C; it is not registered."""

    @dataclass(frozen=True)
    class Given3D(LinearMaterial):
        density: float = 0.0

        def elasticity(self):
            return C

    return Given3D()


@pytest.fixture(autouse=True)
def _registry(monkeypatch):
    monkeypatch.setattr(MATERIALS, "add", lambda *args: None)


def test_round_off_in_place_of_zeros_is_symmetric_enough():
    C = np.diag([3.0, 3.0, 3.0, 1.0, 1.0, 1.0]) * 1e11
    C[:3, :3] += 1e11
    C[0, 3], C[3, 0] = 3e-6, -2e-6  # Pa: as products of rotations leave it
    assert law(C).C is not None


@pytest.mark.parametrize(("row", "column"), [(0, 1), (2, 5), (3, 4)])
def test_more_than_round_off_is_refused(row, column):
    C = np.diag([3.0, 3.0, 3.0, 1.0, 1.0, 1.0]) * 1e11
    C[row, column] = 1e4
    with pytest.raises(MaterialError, match="not symmetric"):
        law(C)


@pytest.mark.parametrize(
    ("C", "told"),
    [
        (np.eye(3), r"got shape \(3, 3\)"),
        (np.full((6, 6), np.nan), "it holds nan"),
    ],
)
def test_a_C_of_another_shape_or_without_numbers_is_refused(C, told):
    with pytest.raises(MaterialError, match=rf"^Given3D: C must be \(6, 6\), finite; {told}"):
        law(C)


@pytest.mark.parametrize("C", [[[1.0, 2.0], [3.0]], "abc", None, 1j * np.eye(6)])
def test_a_C_that_is_not_made_of_numbers_is_refused(C):
    with pytest.raises(MaterialError, match=r"^Given3D: C must be made of real numbers"):
        law(C)
    with pytest.raises(MaterialError, match="LinearMaterial is a base of laws; derive"):
        LinearMaterial(C)


def test_a_compliance_of_another_shape_is_refused():
    @dataclass(frozen=True)
    class Thin3D(LinearMaterial):
        density: float = 0.0

        def compliance(self):
            return np.eye(3)

    with pytest.raises(MaterialError, match=r"^Thin3D: the compliance must be \(6, 6\); got shape \(3, 3\)"):
        Thin3D()

"""Work of the loads against twice the strain energy: rounding of K in thin bodies is not silent."""

import pytest

import kratos_lite as kl


def plate(kind, n, thickness):
    """Return a square plate whose edges are clamped, under a pressure."""
    model = kl.Model(kl.box((1, 1, thickness), (n, n, 1), kind), kl.Isotropic3D(E=210e9, nu=0.3))
    x, y = model.mesh.points[:, 0], model.mesh.points[:, 1]
    model.fix((x == 0) | (x == 1) | (y == 0) | (y == 1))
    model.add(kl.Pressure("z+", 1e3 * thickness**3))
    return model


@pytest.mark.parametrize("kind", ["20N", "27N", "8N"])
def test_a_plate_of_moderate_thickness_has_no_warning(kind):
    assert not plate(kind, 6, 1e-2).solve().report.warnings


@pytest.mark.parametrize(("kind", "thickness"), [("27N", 1e-4), ("8N", 1e-4)])
def test_a_thin_plate_has_a_warning_that_names_thinness(kind, thickness):
    warnings = plate(kind, 6, thickness).solve().report.warnings
    assert any("off twice the strain energy" in text and "very thin bodies" in text for text in warnings)


@pytest.mark.parametrize("kind", ["27N", "8N"])
def test_a_plate_without_digits_is_refused(kind):
    with pytest.raises(kl.SolveError, match=r"off twice the strain energy.*fewer layers"):
        plate(kind, 6, 3e-6).solve()
    with pytest.raises(kl.SolveError, match=r"off twice the strain energy.*fewer layers"):
        plate(kind, 6, 3e-6).solve_cases({"a": [kl.Pressure("z+", 1e3)]})

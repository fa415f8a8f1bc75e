"""Any C, turned: Young's moduli of crystals along directions, stresses that turn with the body, refusals."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite import voigt

RANDOM = np.random.default_rng(5)
ROOT = RANDOM.normal(size=(6, 6))
ANY = kl.Anisotropic3D(1e9 * (ROOT @ ROOT.T + np.eye(6)), 7.0, [1e-5, 2e-5, 3e-5, 4e-6, 5e-6, -6e-6])
R = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0]


def test_the_modulus_of_a_cubic_crystal_along_a_direction():
    """1/E = S11 - 2 (S11 - S12 - S44 / 2) (l² m² + m² n² + n² l²) (Nye, 1957)."""
    C = np.diag([0.0] * 3 + [75.4e9] * 3)
    C[:3, :3] = 121.4e9 * np.ones((3, 3)) + (168.4e9 - 121.4e9) * np.eye(3)
    S, copper = np.linalg.inv(C), kl.Anisotropic3D(C)
    for axes in (np.eye(3), R, kl.Cartesian((1, 1, 1)).directions((0, 0, 0)).T):
        (u, v, w), found = axes[:, 0] ** 2, np.linalg.inv(copper.turned(axes).C)[0, 0]
        expected = S[0, 0] - 2 * (S[0, 0] - S[0, 1] - S[3, 3] / 2) * (u * v + v * w + w * u)
        assert abs(found - expected) < 1e-12 * expected


def test_stress_and_expansion_turn_with_the_body():
    strain, law = RANDOM.normal(size=6), ANY.turned(R)
    own = ANY.stress(voigt.vector(R @ voigt.tensor(strain * voigt.HALF_SHEAR) @ R.T) * voigt.SHEAR_TWICE)
    expected = voigt.vector(R.T @ voigt.tensor(own) @ R)
    assert np.abs(law.stress(strain) - expected).max() < 1e-13 * np.abs(expected).max()
    growth = R.T @ voigt.tensor(ANY.expansion * voigt.HALF_SHEAR) @ R
    assert np.abs(voigt.tensor(law.expansion * voigt.HALF_SHEAR) - growth).max() < 1e-19
    assert law.density == ANY.density
    assert law.turned(R.T).C == pytest.approx(ANY.C, rel=0, abs=1e-13 * np.abs(ANY.C).max())


def test_a_heated_body_that_is_free_strains_by_its_expansion():
    model = kl.Model(kl.box(), ANY.turned(R))
    model.add(kl.Temperature(100.0))
    for place, axes in ((0, 0, 0), "xyz"), ((1, 0, 0), "yz"), ((0, 1, 0), "z"):
        model.fix((model.mesh.points == place).all(axis=1), axes)
    result = model.solve()
    assert np.abs(result.strain("gauss") - 100 * ANY.turned(R).expansion).max() < 1e-14
    assert np.abs(result.stress("gauss")).max() < 1e-9 * np.abs(ANY.C @ ANY.expansion).max() * 100


def test_it_is_known_by_its_constants():
    assert kl.Anisotropic3D(ANY.C, 7.0, ANY.expansion) == ANY
    assert hash(kl.Anisotropic3D(ANY.C.tolist(), 7.0, ANY.alpha)) == hash(ANY)
    assert "Anisotropic3D" in str(kl.Model(kl.box(), ANY))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: kl.Anisotropic3D(np.eye(3)), r"stiffness .* must have shape \(6, 6\); got \(3, 3\)"),
        (lambda: kl.Anisotropic3D("C"), r"stiffness .* must be made of real numbers; got 'C'"),
        (lambda: kl.Anisotropic3D([]), "C must be"),
        (lambda: kl.Anisotropic3D(np.full((6, 6), np.nan)), r"stiffness .* must be finite"),
        (lambda: kl.Anisotropic3D(np.triu(np.ones((6, 6)))), "C is not symmetric"),
        (lambda: kl.Anisotropic3D(-np.eye(6)), "C must be positive definite"),
        (lambda: kl.Anisotropic3D(np.eye(6), alpha=1e-5), r"alpha must have shape \(6,\); got \(\)"),
        (lambda: ANY.turned(2 * np.eye(3)), "axes of a material are orthogonal unit vectors"),
        (lambda: ANY.turned(np.eye(2)), r"axes of a material must have shape \(3, 3\)"),
    ],
)
def test_what_is_no_material_is_refused(make, message):
    with pytest.raises(kl.MaterialError, match=message):
        make()

"""Natural frequencies and shapes, and complex ones of what does not move through its mesh."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis import modal
from kratos_lite.errors import InputError, ModelError

UNIT = kl.Isotropic3D(E=1.0, nu=0.3, density=1.0)
CUBE = [1.77125] * 2 + [2.38517] * 3 + [2.42566] * 3 + [2.755359] * 3 + [2.83592] * 3 + [2.97223] * 3


def cube(n: int, element: str = "20N") -> kl.Model:
    return kl.Model(kl.box((1, 1, 1), (n, n, n), f"KinematicLinear3D{element}"), UNIT)


def column(n: int) -> kl.Model:
    """Return a confined column: rollers on its sides and below."""
    model = kl.Model(kl.box((1, 1, 1), (1, 1, n)), UNIT)
    model.fix(lambda X: np.ones(len(X), dtype=bool), "xy")
    model.fix("z-", "z")
    return model


@pytest.mark.parametrize(("element", "n", "above"), [("20N", 3, 1.2e-2), ("27N", 3, 1.2e-2)])
def test_free_cube(element, n, above):
    """Six rigid motions, then the Ritz values of the free cube, from above."""
    model = cube(n, element)
    omega, shapes = model.modes(6 + len(CUBE))
    assert omega[:6].max() < 1e-5
    assert (omega[6:] > np.array(CUBE) * (1 - 1e-5)).all()
    np.testing.assert_allclose(omega[6:], CUBE, rtol=above)
    assert shapes.shape == (23, model.mesh.n_nodes, 3)


def test_lame_mode_converges():
    """π sqrt(2 μ / ρ), exact: quadratic elements come to it with the fourth power of their size."""
    exact = np.pi * np.sqrt(2 * UNIT.C[3, 3])
    errors = []
    for n in (2, 4):
        found = cube(n).modes(18)[0] / exact - 1
        errors.append(np.abs(found).min())
    assert errors[0] / errors[1] > 10
    assert errors[1] < 1e-3


LUMPED = [(1, (0.71611, 0.96962)), (2, (1.43223, 1.70469)), (4, (1.66763, 2.16324))]


@pytest.mark.parametrize(("n", "figures"), LUMPED)
def test_lumped_free_cube(n, figures):
    """The figures of another program, hex8 with lumped mass: from below."""
    omega = cube(n, "8N").modes(10, lumped=True)[0]
    np.testing.assert_allclose(omega[6:8], figures[0], rtol=1e-5)
    np.testing.assert_allclose(omega[8:10], figures[1], rtol=1e-5)


@pytest.mark.parametrize(("n", "figure"), [(1, 2.009592), (2, 1.869627), (4, 1.834231), (8, 1.825428)])
def test_confined_column(n, figure):
    """The lowest of plane sections: closed forms, consistent and lumped; the exact one is 1.822499."""
    c, angle = np.sqrt(UNIT.C[0, 0]), np.pi / (2 * n)
    consistent = c * n * np.sqrt(6 * (1 - np.cos(angle)) / (2 + np.cos(angle)))
    lumped = 2 * c * n * np.sin(angle / 2)
    assert consistent == pytest.approx(figure, rel=1e-6)
    for exact, options in ((consistent, {}), (lumped, {"lumped": True})):
        model = column(n)
        top = model.mesh.nodes("z+")
        found = zip(*model.modes(4 * n, **options), strict=True)
        along = [w for w, shape in found if np.ptp(shape[top, 2]) < 1e-6 * np.abs(shape).max()]
        assert along[0] == pytest.approx(exact, rel=1e-11)


def test_shapes_belong_to_their_frequencies():
    model = cube(2, "8N")
    model.fix("z-")
    omega, shapes = model.modes(10)
    e = model.transient().equations
    for i in range(10):
        phi = shapes[i].ravel()
        left = (e.K @ phi - omega[i] ** 2 * e.mass.times(phi))[e.system.constraint_map.free]
        assert np.abs(left).max() < 1e-12
        assert [round(float(s.ravel() @ e.mass.times(phi)), 9) for s in shapes] == [
            float(i == j) for j in range(10)
        ]
    assert not shapes[:, model.mesh.nodes("z-")].any()


def test_a_mode_swings_as_it_is():
    model = cube(2, "8N")
    model.fix("z-")
    omega, shapes = model.modes(3)
    period = 2 * np.pi / omega[2]
    *_, end = kl.integrate(model.transient(displacement=shapes[2]), period / 200, 200, every=200)
    np.testing.assert_allclose(end.u, shapes[2], atol=1e-4 * np.abs(shapes[2]).max())


def test_complex_modes_of_what_stands_still():
    """±iω of the natural frequencies, with their shapes."""
    model = cube(2, "8N")
    model.fix("z-")
    omega, _ = model.modes(6)
    values, shapes = model.complex_modes(12)
    np.testing.assert_allclose(np.sort(values.imag), np.sort([*omega, *-omega]), rtol=1e-10)
    assert np.abs(values.real).max() < 1e-10
    assert shapes.shape == (12, model.mesh.n_nodes, 3)
    e = model.transient().equations
    for value, shape in zip(values, shapes, strict=True):
        phi = shape.ravel()
        left = value**2 * (e.mass.times(phi.real) + 1j * e.mass.times(phi.imag))
        left = left + e.K @ phi.real + 1j * (e.K @ phi.imag)
        assert np.abs(left[e.system.constraint_map.free]).max() < 1e-9 * np.abs(phi).max()


def test_constraints():
    """A column whose sections are tied to be plane has its axial modes alone."""
    model = column(2)
    z = model.mesh.points[:, 2]
    for height in (0.5, 1.0):
        first, *others = np.flatnonzero(z == height).tolist()
        for node in others:
            model.constrain((node, "z"), {(first, "z"): 1.0})
    omega, shapes = model.modes(2)
    assert omega[0] == pytest.approx(1.869627, rel=1e-6)
    assert np.ptp(shapes[0, z == 1.0, 2]) < 1e-14


def test_what_is_refused():
    with pytest.raises(ModelError, match="what moves needs mass"):
        kl.Model(kl.box(), kl.Isotropic3D(E=1.0, nu=0.3)).modes(1)
    with pytest.raises(InputError, match="this body has 1 … 24 modes; got 25"):
        cube(1, "8N").modes(25)
    with pytest.raises(InputError, match="this model has 1 … 8 complex modes; got 9"):
        column(1).complex_modes(9)
    for count in (0, 2.0, "all", True, None):
        for find in (column(1).modes, column(1).complex_modes):
            with pytest.raises(InputError, match="count must be a whole number ≥ 1; got"):
                find(count)
    with pytest.raises(InputError, match="a critical rate belongs to a motion"):
        modal.critical_rate(column(1))


def test_a_beam_that_mid_edge_nodes_alone_guide_has_the_modes_of_one_that_is_free_there():
    """Bending in one plane: u_z of the middle is 0 by symmetry, whether it is held or not."""
    model = kl.Model(kl.box((10, 0.1, 0.1), (40, 1, 1), "20N"), kl.Isotropic3D(E=1e6, nu=0.0, density=1.0))
    model.fix("x-")
    model.fix("x+", "yz")
    free, _ = model.modes(1)
    model.fix(lambda X: X[:, 2] == 0.05, "z")
    held, _ = model.modes(1)
    assert abs(held[0] / free[0] - 1) < 1e-6


def test_a_density_in_other_units_is_warned_of_in_modes_and_in_harmonic_response(caplog):
    model = kl.Model(kl.box((10, 1, 1), (4, 1, 1)), kl.Isotropic3D(E=210e9, nu=0.3, density=7.85))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    for solve in (
        lambda: model.modes(2),
        lambda: model.harmonic(frequencies=[1.0], damping=0.01, method="modes"),
    ):
        caplog.clear()
        solve()
        assert "speed of waves" in caplog.records[0].getMessage()

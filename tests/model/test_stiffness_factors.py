"""Factors of the stiffness of each element: as many materials, in everything that a result has."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError
from kratos_lite.native import kernels

FACTORS = np.random.default_rng(8).uniform(0.3, 3.0, 4)
PRESTRESS = np.random.default_rng(9).uniform(-5, 5, (4, 6))


def model_of(kind, materials, rule=None):
    """Return a warm cantilever under its weight, with one material or one for each element."""
    mesh = kl.box((2, 1, 1), (4, 1, 1), kind)
    mesh = mesh.replace(points=mesh.points + 0.02 * np.sin(9 * mesh.points[:, ::-1]))
    model = kl.Model(mesh)
    for where, E in materials:
        model.assign(kl.Isotropic3D(E=E, nu=0.3, density=2.0, alpha=1e-3), where)
    model.fix("x-")
    model.add_prestress(PRESTRESS)
    model.add(kl.Gravity((0, 0, -9.81)))
    model.add(kl.Temperature(mesh.points[:, 2]))
    return model


def both(kind):
    """Return models with factors, and with a material for each element."""
    model = model_of(kind, [(None, 1e3)])
    model.scale_stiffness(FACTORS)
    return model, model_of(kind, [([e], 1e3 * factor) for e, factor in enumerate(FACTORS)])


@pytest.fixture(params=["compiled", "NumPy"])
def twin(request, monkeypatch):
    """Compute compiled, or in NumPy."""
    if request.param == "NumPy":
        for module in ("element_groups", "gauss_point_fields", "stiffness"):
            monkeypatch.setattr(f"kratos_lite.assembly.{module}.kernels", lambda name: None, raising=False)
        monkeypatch.setattr("kratos_lite.assembly.matrix_free.compiled", lambda *of: None)
    elif kernels("gauss") is None:
        pytest.skip("no kernels")


@pytest.mark.parametrize(
    "kind", ["KinematicLinear3D8N", "EnhancedStrain3D8N", "BBar3D20N", "KinematicLinear3D20N"]
)
@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_factors_are_as_many_materials(kind, solver, twin):
    one, other = (model.solve(solver=solver, tolerance=1e-13) for model in both(kind))
    size = np.abs(other.u).max()
    assert np.abs(one.u - other.u).max() < 1e-9 * size
    for name, at in (("stress", "gauss"), ("stress", "element"), ("strain_energy_density", "element")):
        values = other.field(name, at)
        assert np.abs(one.field(name, at) - values).max() < 1e-8 * np.abs(values).max(), name
    assert abs(one.energy() / other.energy() - 1) < 1e-8
    point = (0.7, 0.4, 0.6)
    assert np.abs(one.at(point).stress - other.at(point).stress).max() < 1e-8 * np.abs(values).max()
    C = [result.at_integration_points("CONSTITUTIVE_MATRIX") for result in (one, other)]
    assert np.abs(C[0] - C[1]).max() < 1e-9


def test_element_matrices_modes_and_gradients_know_factors():
    one, other = both("KinematicLinear3D8N")
    a, b = (model.local_system(3) for model in (one, other))
    assert np.abs(a.K - b.K).max() < 1e-9
    assert np.abs(a.r - b.r).max() < 1e-9
    assert np.abs(one.modes(3)[0] / other.modes(3)[0] - 1).max() < 1e-9
    results = [model.solve() for model in (one, other)]
    stress = kl.StressAt((0.7, 0.4, 0.6), "xx")
    for wrt in ("E", "density", "coordinates", "loads"):
        found, known = (result.gradient(stress, wrt) for result in results)
        over = FACTORS if wrt == "E" else 1.0  # here E is that without the factor
        assert np.abs(found / over - known).max() < 1e-7 * np.abs(known).max(), wrt
    found, known = (result.gradient(stress, "stiffness") for result in results)
    assert np.abs(found * FACTORS - known).max() < 1e-7 * np.abs(known).max()
    errors = [result.error(of=stress) for result in results]
    assert abs(errors[0].value - errors[1].value) < 1e-9 * abs(errors[0].value)


def test_an_exact_field_has_no_error_and_that_of_others_is_in_their_energy():
    """With one factor for all, the error is that of a material with this E; energies under a load ~ 1 / E."""
    errors = []
    for factor in (1.0, 4.0):
        model = kl.Model(kl.box((2, 1, 1), (4, 2, 2)), kl.Isotropic3D(E=1e3, nu=0.3))
        model.fix("x-")
        model.add(kl.Traction("x+", (0, 0, 1.0)))
        model.scale_stiffness(factor)
        errors.append(model.solve().error().absolute)
    assert abs(errors[0] / errors[1] - 2) < 1e-9


def test_factors_by_part_replace_earlier_ones_and_are_shown():
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e3, nu=0.3))
    model.scale_stiffness(2.0)
    model.scale_stiffness([0.5], [1])
    assert model.stiffness_factors.tolist() == [2.0, 0.5]
    assert ("stiffness", "times 0.5 … 2, a factor for each element") in model.table()
    model.scale_stiffness(1.0)
    assert model.stiffness_factors is None


@pytest.mark.parametrize("factors", [0.0, [1.0, -1.0], [1.0, 2.0, 3.0], np.nan, [[1.0, 2.0]], "soft"])
def test_what_is_no_factor_is_refused(factors):
    with pytest.raises(InputError, match="factors of the stiffness"):
        kl.Model(kl.box((2, 1, 1), (2, 1, 1))).scale_stiffness(factors)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda m: m.assign(kl.J2Plasticity3D(E=1e3, nu=0.3, yield_stress=1.0)),
            "take linear laws and small",
        ),
        (lambda m: setattr(m, "formulation", "total_lagrangian"), "take linear laws and small"),
    ],
)
def test_factors_are_for_linear_laws(spoil, message):
    model = both("KinematicLinear3D8N")[0]
    spoil(model)
    with pytest.raises(ModelError, match=message):
        model.solve()


def test_factors_neither_move_nor_are_written(tmp_path):
    model = both("KinematicLinear3D8N")[0]
    with pytest.raises(InputError, match="a factor of the stiffness"):
        kl.write(tmp_path / "model.mdpa", model)
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e3, nu=0.3, density=1.0))
    model.scale_stiffness([1.0, 2.0])
    model.add(kl.ale.Translation("x", rate=1e-3))
    with pytest.raises(ModelError, match="factors of the stiffness stay with elements"):
        model.solve()

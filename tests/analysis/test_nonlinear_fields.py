"""Fields of results with any law: internal variables, measures of finite strains, energies."""

import csv
from dataclasses import dataclass
from typing import ClassVar

import meshio
import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.fields import known, listed

E, H, Y = 200e9, 2e9, 200e6
P = 0.05 * Y / H  # accumulated plastic strain at 1.05 Y
PLASTIC = np.array([-P / 2, -P / 2, P, 0, 0, 0])
STEEL = kl.J2Plasticity3D(E, 0.3, Y, H)
POINTS = [[0.21, 0.33, 0.41], [0.7, 0.5, 1.9]]
PLACES = ("gauss", "element", "node", "averaged", "raw")


@dataclass(frozen=True)
class Counted(kl.Material):
    """Hooke's law that keeps two numbers of its own, and one under the name of a field."""

    E: float
    density: float = 0.0
    internal_variables: ClassVar = {"steps": 2, "stress": 1}

    def response(self, strain, state, dt):
        new = {"steps": state["steps"] + np.array([1.0, 2.0]), "stress": state["stress"] + 3.0}
        return self.E * strain, self.E * np.eye(6), new


def bar(material=STEEL, element="Element3D8N", size=(1, 1, 2), **options):
    """Return a bar along z on rollers."""
    model = kl.Model(kl.box(size, cells=(2, 2, 2), element=element), material, **options)
    for side in "xyz":
        model.fix(f"{side}-", side)
    return model


@pytest.fixture(scope="module")
def yielded():
    model = bar()
    model.add(kl.Traction("z+", (0, 0, 1.05 * Y)))
    return model.solve()


def everywhere(result, name):
    """Return a field at all its places, as (..., parts)."""
    values = [result.field(name, at) for at in PLACES]
    return [*values, getattr(result.at(POINTS), name), getattr(result.along((0, 0, 0), (1, 1, 2), 4), name)]


@pytest.mark.parametrize("element", ["Element3D8N", "EnhancedStrain3D8N", "KinematicLinear3D10N"])
def test_internal_variables_of_a_bar_that_yields(element):
    model = bar(element=element)
    model.add(kl.Traction("z+", (0, 0, 1.05 * Y)))
    result = model.solve()
    for values in everywhere(result, "accumulated_plastic_strain"):
        assert np.abs(values / P - 1).max() < 1e-7
    for values in everywhere(result, "plastic_strain"):
        assert np.abs(values - PLASTIC).max() < 1e-7 * P
    for values in everywhere(result, "strain_energy_density"):  # of the elastic strain
        assert np.abs(values / ((1.05 * Y) ** 2 / 2 / E) - 1).max() < 1e-7
    strain = PLASTIC + 1.05 * Y / E * np.array([-0.3, -0.3, 1, 0, 0, 0])
    for values in everywhere(result, "strain"):
        assert np.abs(values - strain).max() < 1e-7 * P
    at_points = result.at_integration_points("PLASTIC_STRAIN_VECTOR", element=2)
    assert np.abs(at_points - PLASTIC).max() < 1e-7 * P


def test_measures_of_rubber_pulled_to_twice_its_length():
    model = bar(kl.NeoHookean3D(1e6, 0.3), size=(1, 1, 2))
    model.fix("z+", "z", 2.0)
    result = model.solve()
    F = np.diag([1 + result.displacement("x+")[:, 0].mean()] * 2 + [2.0])
    for values in everywhere(result, "deformation_gradient"):
        assert np.abs(values - F).max() < 1e-7
    for values in everywhere(result, "strain"):
        assert np.abs(values - [*(np.diag(F) ** 2 - 1) / 2, 0, 0, 0]).max() < 1e-7
    lam, mu, side, J = 0.3e6 / 1.3 / 0.4, 1e6 / 2.6, F[0, 0], np.linalg.det(F)
    pk2 = mu * (1 - 1 / 4) + lam * np.log(J) / 4
    assert abs(mu * (side**2 - 1) + lam * np.log(J)) < 1e-6 * mu  # no stress at the sides
    assert abs(result.reaction("z+")[:, 2].sum() - 2 * pk2) < 1e-8 * pk2
    energy = mu / 2 * (4 + 2 * side**2 - 3) - mu * np.log(J) + lam / 2 * np.log(J) ** 2
    assert abs(result.energy() / 2 - energy) < 1e-8 * energy  # in two cubic metres
    for values in everywhere(result, "pk2_stress"):
        assert np.abs(values - [0, 0, pk2, 0, 0, 0]).max() < 1e-7 * mu
    for values in everywhere(result, "stress"):
        assert np.abs(values - [0, 0, 4 * pk2 / J, 0, 0, 0]).max() < 1e-8 * mu
    of = result.at_integration_points
    assert np.abs(of("DEFORMATION_GRADIENT") - F).max() < 1e-7
    assert np.abs(of("PK2_STRESS_VECTOR")[..., 2] - pk2).max() < 1e-7 * mu
    assert np.abs(of("PK2_STRESS_TENSOR")[..., 2, 2] - pk2).max() < 1e-7 * mu
    energy = (result.field("strain_energy_density") * of("INTEGRATION_WEIGHT")).sum()
    assert abs(energy / result.energy() - 1) < 1e-12
    assert "pk2_stress" in listed("node", result.groups)


def test_a_turned_element_has_the_gradient_of_its_turn():
    model = bar(kl.Isotropic3D(1e6, 0.3), formulation="total_lagrangian")
    R = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    for axis in "xyz":
        model.release(f"{axis}-", axis)
    model.fix(np.arange(model.mesh.n_nodes), "xyz", model.mesh.points @ R.T - model.mesh.points)
    result = model.solve()
    for values in everywhere(result, "deformation_gradient"):
        assert np.abs(values - R).max() < 1e-12
    assert max(np.abs(values).max() for values in everywhere(result, "strain")) < 1e-12


def test_variables_of_a_law_of_ones_own(tmp_path):
    model = bar(Counted(1e6))
    model.fix("z+", "z", 0.1)
    result = model.solve()
    for values in everywhere(result, "steps"):
        assert np.abs(values - [1.0, 2.0]).max() < 1e-12
    for values in everywhere(result, "Counted_stress"):
        assert np.abs(values - 3.0).max() < 1e-12
    assert abs(result.stress()[0, 0, 2] / 5e4 - 1) < 1e-9
    kl.write(tmp_path / "own.csv", result)
    with open(tmp_path / "own.csv", newline="", encoding="utf-8") as lines:
        assert {"steps 1", "steps 2"} < set(next(csv.reader(lines)))
    kl.write(tmp_path / "own.vtu", result)
    assert np.abs(meshio.read(tmp_path / "own.vtu").point_data["steps"] - [1.0, 2.0]).max() < 1e-12


def test_what_is_linear_has_no_plastic_strain():
    mesh = kl.box((1, 1, 2), (1, 1, 2), "KinematicLinear3D8N")
    model = kl.Model(mesh, STEEL)
    model.assign(kl.Isotropic3D(E, 0.0), [1])
    for side in "xyz":
        model.fix(f"{side}-", side)
    model.add(kl.Traction("z+", (0, 0, 1.05 * Y)))
    plastic = model.solve().field("accumulated_plastic_strain", "element")
    assert plastic[0] > 0
    assert plastic[1] == 0.0


def test_files_tables_and_pictures_of_a_bar_that_yields(tmp_path, yielded):
    for name in ("a.vtu", "a.csv", "a.html", "a.pvtu"):
        kl.write(tmp_path / name, yielded)
    kl.write(tmp_path / "points.csv", yielded.at(POINTS))
    found = meshio.read(tmp_path / "a.vtu")
    cells = {name: parts[0] for name, parts in found.cell_data.items()}
    assert np.abs(found.point_data["ACCUMULATED_PLASTIC_STRAIN"] / P - 1).max() < 1e-7
    assert np.abs(cells["PLASTIC_STRAIN_VECTOR"] - PLASTIC).max() < 1e-7 * P
    assert "ENERGY_NORM_ERROR" not in cells
    assert "PK2_STRESS_VECTOR" not in found.point_data
    for file in ("a.csv", "points.csv"):
        with open(tmp_path / file, newline="", encoding="utf-8") as lines:
            rows = list(csv.DictReader(lines))
        assert abs(float(rows[0]["accumulated plastic strain"]) / P - 1) < 1e-7
        assert abs(float(rows[0]["plastic strain zz"]) / P - 1) < 1e-7
        assert "back stress xx [Pa]" in rows[0]
    kl.plot(yielded, tmp_path / "a.png", values="strain_energy_density")
    yielded.along((0, 0, 0), (1, 1, 2)).plot(values="accumulated_plastic_strain")


def test_fields_that_a_result_does_not_have(yielded):
    with pytest.raises(kl.InputError, match=r"a field must be one of .*plastic_strain.*got 'damage'"):
        yielded.field("damage")
    with pytest.raises(kl.InputError, match="J2Plasticity3D is not linear here; compare with a finer mesh"):
        yielded.field("error", "element")
    with pytest.raises(kl.InputError, match="J2Plasticity3D is not linear here"):
        yielded.plot(values="error")
    with pytest.raises(AttributeError, match="has no field 'damage'"):
        yielded.at(POINTS).damage  # noqa: B018
    linear = bar(kl.Isotropic3D(E, 0.3))
    linear.fix("z+", "z", 1e-3)
    with pytest.raises(kl.InputError, match="unknown field 'plastic_strain'"):
        linear.solve().plot(values="plastic_strain")
    assert set(known(linear.element_groups())) < set(known(yielded.groups))
    assert "error" in listed("element", linear.element_groups())

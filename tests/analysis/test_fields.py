"""The table of fields: each is found under its names wherever it is listed; strain energy densities."""

import csv

import meshio
import numpy as np
import pytest
from meshes import NAMES

import kratos_lite as kl
from kratos_lite.analysis.fields import FIELDS, listed

E, SIGMA = 2e5, 300.0
UNIAXIAL = SIGMA**2 / (2 * E)
POINTS = [[0.21, 0.33, 0.41], [1.7, 0.5, 0.9]]


def bar(kind="KinematicLinear3D8N", nu=0.3):
    """Return a bar 2 × 1 × 1 in uniaxial tension."""
    model = kl.Model(kl.box((2, 1, 1), (2, 2, 1), element=kind), kl.Isotropic3D(E=E, nu=nu))
    for side in "xyz":
        model.fix(f"{side}-", side)
    model.add(kl.Traction("x+", (SIGMA, 0, 0)))
    return model


def densities(result):
    """Return the strain energy density at every place."""
    places = [result.field("strain_energy_density", at) for at in ("gauss", "element", "node")]
    points = [result.at(POINTS, recovered=recovered).strain_energy_density for recovered in (False, True)]
    return [*places, *points, result.along((0, 0.5, 0.5), (2, 0.5, 0.5), 5).strain_energy_density]


@pytest.mark.parametrize("kind", NAMES)
def test_the_strain_energy_density_of_a_bar_in_tension(kind):
    result = bar(kind).solve()
    for density in densities(result):
        assert np.abs(density / UNIAXIAL - 1).max() < 1e-10
    assert abs(result.energy() / (2 * UNIAXIAL) - 1) < 1e-11


@pytest.mark.parametrize("kind", NAMES)
def test_its_integral_is_the_strain_energy(kind):
    mesh = kl.box((1.0, 0.8, 0.6), (2, 1, 1), element=kind)
    shift = np.random.default_rng(2).uniform(-0.03, 0.03, mesh.points.shape)
    mesh = kl.Mesh(mesh.points + shift, mesh.blocks)
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=0.3))
    model.fix(
        np.arange(mesh.n_nodes), "xyz", 1e-3 * np.random.default_rng(1).uniform(-1, 1, mesh.points.shape)
    )
    result = model.solve()
    volume = result.at_integration_points("INTEGRATION_WEIGHT")
    for integral in (
        (result.field("strain_energy_density") * volume).sum(),
        (result.field("strain_energy_density", "element") * volume.sum(axis=1)).sum(),
    ):
        assert abs(integral / result.energy() - 1) < 1e-12


def test_a_prestress_does_no_work_in_it():
    """The energy is ½ ε:C:ε, of strains that the load makes; the stress has the prestress, too."""
    model = bar()
    model.add_prestress([50.0, -20.0, 10.0, 0.0, 0.0, 0.0])
    for side in ("x+", "y+", "z+"):
        model.fix(side, side[0])
    model.fix("x+", "x", 1e-3, override=True)
    result = model.solve()
    lam, mu = 0.3 * E / 1.3 / 0.4, E / 2.6
    for density in densities(result):
        assert np.abs(density / ((lam / 2 + mu) * 5e-4**2) - 1).max() < 1e-10
    assert abs(result.stress("node")[0, 1] - (lam * 5e-4 - 20)) < 1e-9 * lam * 5e-4


def test_it_is_0_in_the_state_without_stress():
    model = bar()
    stretched = model.mesh.points * [1e-3, 0, 0]
    model.set_stress_free_state(stretched)
    result = model.solve()
    for density in densities(result):
        assert np.abs(density / UNIAXIAL - 1).max() < 1e-10
    assert (
        np.abs(result.at(POINTS).displacement[:, 0] - np.array(POINTS)[:, 0] * (1e-3 + SIGMA / E)).max()
        < 1e-9
    )


def test_nodes_between_materials_have_the_mean_of_both_sides():
    """In series the stress is one, with ν = 0, and a side has σ²/2E."""
    mesh = kl.box((2, 1, 1), (4, 1, 1))
    mesh.add_part("left", lambda X: X[:, 0] < 1.01)
    mesh.add_part("right", lambda X: X[:, 0] > 0.99)
    model = kl.Model(mesh, {"left": kl.Isotropic3D(E=E, nu=0.0), "right": kl.Isotropic3D(E=4 * E, nu=0.0)})
    for side in "xyz":
        model.fix(f"{side}-", side)
    model.add(kl.Traction("x+", (SIGMA, 0, 0)))
    result, x = model.solve(), mesh.points[:, 0]
    wanted = np.select([x < 0.9, x > 1.1], [UNIAXIAL, UNIAXIAL / 4], UNIAXIAL * 5 / 8)
    assert np.abs(result.field("strain_energy_density", "node") / wanted - 1).max() < 1e-10


def test_files_pictures_and_pages_hold_every_listed_field(tmp_path):
    result = bar("KinematicLinear3D20N").solve()
    for name in ("a.vtu", "a.csv", "a.html"):
        kl.write(tmp_path / name, result)
    kl.write(tmp_path / "points.csv", result.at(POINTS))
    found = meshio.read(tmp_path / "a.vtu")
    for place, data in (
        ("node", found.point_data),
        ("element", {k: v[0] for k, v in found.cell_data.items()}),
    ):
        for name, field in listed(place).items():
            if field.kratos:
                assert (data[field.kratos] == result.field(name, place)).all()
    for file, place in (("a.csv", "node"), ("points.csv", "point")):
        with open(tmp_path / file, newline="", encoding="utf-8") as lines:
            heads = next(csv.reader(lines))
        assert all(any(head.startswith(field.name) for head in heads) for field in listed(place).values())
        assert "strain energy density [J/m3]" in heads
    bars = result.plot(values="strain_energy_density").axes[-1]
    assert "J/m³" in bars.get_xlabel() + bars.get_ylabel() + bars.get_title()
    result.along((0, 0.5, 0.5), (2, 0.5, 0.5)).plot(values="strain_energy_density")


def test_fields_that_do_not_exist_are_named():
    result = bar().solve()
    with pytest.raises(
        kl.InputError, match=r"a field must be one of displacement, .* Did you mean von_mises"
    ):
        result.field("von_mise")
    with pytest.raises(
        kl.InputError, match=r"the place of the field error must be one of element; got 'node'"
    ):
        result.field("error", "node")
    with pytest.raises(AttributeError, match=r"no field 'von_mise'\. Did you mean von_mises"):
        result.at(POINTS).von_mise  # noqa: B018
    assert {name for name, field in FIELDS.items() if "point" in field.where} <= set(dir(result.at(POINTS)))

"""Large displacements and strains are warnings that ask for the units; unusual constants are notes."""

import re

import numpy as np
import pytest
from meshes import NAMES

import kratos_lite as kl
from kratos_lite.analysis.solution_checks import largest_elongation


def cantilever(E, load=-1e4, density=7850.0):
    model = kl.Model(kl.box((1, 0.1, 0.1), (4, 1, 1), "Element3D20N"), kl.Isotropic3D(E, 0.3, density))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, load)))
    return model


def told(warnings):
    return [text for text in warnings if "linear theory" in text]


def test_steel_in_megapascals_is_a_warning_and_a_note_that_ask_for_the_units():
    result = cantilever(210e3).solve()
    sag = 4 * 100 / (210e3 * 0.1**4)  # F L³ / (3 E I), m
    (text,) = told(result.report.warnings)
    assert f"{sag:.1f}"[:1] in text
    assert "times the size of the body" in text
    assert "is E in Pa (steel: 210e9)" in text
    assert "strains" in text
    assert any("soft as rubber: is E in Pa" in note for note in result.report.notes)
    assert "is E in Pa" in str(result)
    assert "soft as rubber" in str(cantilever(210e3))


def test_steel_in_pascals_is_neither():
    report = cantilever(210e9).solve().report
    assert not report.warnings
    assert not report.notes


@pytest.mark.parametrize(("share", "warned"), [(0.09, False), (0.11, True)])
def test_a_tenth_of_the_diagonal_is_the_limit_of_displacements(share, warned):
    once = cantilever(210e9).solve()
    size = np.linalg.norm([1, 0.1, 0.1])
    load = -1e4 * share * size / np.linalg.norm(np.ptp(once.u, axis=0))
    warnings = told(cantilever(210e9, load).solve().report.warnings)
    assert any("displacements differ" in text for text in warnings) == warned


@pytest.mark.parametrize("element", NAMES)
@pytest.mark.parametrize(("strain", "warned"), [(0.048, False), (0.052, True)])
def test_five_percent_is_the_limit_of_strains(element, strain, warned):
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2), element), kl.Isotropic3D(1e6, 0.0))
    model.fix("x-", "x")
    model.fix("y-", "y")
    model.fix("z-", "z")
    model.add(kl.Traction("z+", (0, 0, strain * 1e6)))
    warnings = told(model.solve().report.warnings)
    assert warnings == [text for text in warnings if "strains reach at least 5%" in text]
    assert bool(warnings) == warned


def test_elongations_are_bounded_by_the_principal_strains_of_random_gradients():
    rng = np.random.default_rng(4)
    for element in NAMES:
        mesh = kl.box((1, 2, 3), (3, 2, 2), element)
        gradient = rng.normal(size=(3, 3))
        principal = np.abs(np.linalg.eigvalsh((gradient + gradient.T) / 2)).max()
        found = largest_elongation(mesh, mesh.points @ gradient.T)
        assert 0.5 * principal < found <= principal * (1 + 1e-12)


def test_a_rotation_and_a_translation_do_not_elongate():
    mesh = kl.box((1, 2, 3), (2, 2, 2))
    assert largest_elongation(mesh, np.cross([1.0, 2.0, 3.0], mesh.points) + 5.0) < 1e-14


def test_large_meshes_are_sampled_everywhere():
    mesh = kl.box((1, 1, 1), (14, 14, 14))
    layer = 1e-3 * (mesh.points[:, 2:] > 1 - 1 / 28) * [0, 0, 1]  # the last layer alone, 1/14 thick
    assert largest_elongation(mesh, layer) == pytest.approx(0.014, rel=1e-9)


def test_large_prescribed_displacements_are_not_blamed_on_units_and_rigid_ones_on_nothing():
    model = cantilever(210e9, 0.0)
    model.fix("x+", "z", 0.3)
    (text,) = told(model.solve().report.warnings)
    assert "units" not in text
    assert "is E in Pa" not in text
    moved = kl.Model(kl.box(), kl.Isotropic3D(210e9, 0.3))
    moved.fix("z-", "xyz", [3.0, 2.0, 1.0])
    assert not told(moved.solve().report.warnings)


def test_displacement_counts_from_the_state_without_stress():
    model = kl.Model(kl.box(), kl.Isotropic3D(210e9, 0.3))
    u0 = 0.4 * model.mesh.points
    model.set_stress_free_state(u0)
    model.fix("z-", "xyz", u0[model.mesh.nodes("z-")])
    assert not told(model.solve().report.warnings)


def test_models_without_units_are_not_asked_for_them():
    model = kl.Model(kl.box(), kl.Isotropic3D(1.0, 0.3))
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1.0)))
    result = model.solve()
    assert np.abs(result.u).max() > 0.5
    assert not told(result.report.warnings)


def test_transients_are_warned_of_and_modes_are_not():
    model = cantilever(210e3)
    transient = model.transient()
    (state,) = kl.integrate(transient, dt=0.5, steps=1)
    assert told(transient.result(state).report.warnings)
    assert not told(model.check())
    model.modes(2)


def test_a_steady_motion_is_warned_of():
    wheel = kl.Model(kl.annulus(0.1, 0.4, 0.1, (1, 8, 1)), kl.Isotropic3D(1e5, 0.3, 1000.0))
    wheel.fix("inner")
    wheel.add(kl.ale.Rotation((0, 0, 1), 1.0))
    wheel.add(kl.Gravity((0, 0, -1000.0)))
    assert told(wheel.solve().report.warnings)


@pytest.mark.parametrize(
    ("constants", "text"),
    [
        ({"E": 0.5, "nu": 0.3}, "E of .* is far below .*is it in Pa"),
        ({"E": 2.1e14, "nu": 0.3}, "E of .* is far above"),
        ({"E": 1e9, "nu": 0.3, "density": 7.85e-6}, r"the density of .* is it in kg/m³"),
        ({"E": 1e9, "nu": 0.3, "density": 7.85e6}, "the density of"),
        ({"E": 30e3, "nu": 0.2, "density": 2400.0}, "soft as rubber: is E in Pa"),
    ],
)
def test_constants_far_from_those_of_all_materials_are_notes(constants, text):
    model = kl.Model(kl.box(), kl.Isotropic3D(**constants))
    (note,) = model.remarks()
    assert re.search(text, note)
    model.fix("z-")
    assert note in model.solve().report.notes
    assert not any("far" in warning for warning in model.check())


@pytest.mark.parametrize(
    ("E", "density"),
    [(100, 1000), (1.2e12, 3500), (1e6, 1), (5e7, 2000), (16e9, 11340), (210e6, 7620), (1, 1)],
)
def test_gels_foams_soils_metals_and_diamond_are_not(E, density):
    assert not kl.Model(kl.box(), kl.Isotropic3D(E, 0.3, density)).remarks()


def test_notes_are_of_materials_in_use():
    model = kl.Model(kl.box(), kl.Isotropic3D(0.01, 0.3))
    assert model.remarks()
    model.assign(kl.Isotropic3D(1e9, 0.3))
    assert not model.remarks()


def test_the_speed_of_waves_in_graphene_is_no_warning():
    model = kl.Model(kl.box(), kl.Isotropic3D(E=1.05e12, nu=0.17, density=2200.0))
    model.fix("x-")
    model.add(kl.Traction("x+", (1e6, 0.0, 0.0)))
    assert not [text for text in model.solve().report.warnings if "waves" in text]


def bracket(scale, E=210e9, density=7850.0):
    """Return a steel part of 100 x 60 x 10 mm³ under .1 MPa, in mm where the scale is 1."""
    points = kl.box((100, 60, 10), (4, 3, 1))
    model = kl.Model(points.replace(points=scale * points.points), kl.Isotropic3D(E, 0.3, density))
    model.fix("x-")
    return model


def test_a_mesh_in_millimetres_is_a_warning_that_names_the_cure():
    model = bracket(1.0)
    model.add(kl.Traction("x+", (0.1, 0, 0)))
    bulky, idle = model.solve().report.warnings
    assert bulky.startswith("6e+04 m³ are as stiff as metal: are lengths in mm (read with scale=1e-3")
    assert idle.startswith("displacements differ by 4")
    assert "e-13 of the size of the body (117 m); are lengths in mm" in idle
    model = bracket(1e-3)
    model.add(kl.Traction("x+", (1e5, 0, 0)))
    assert not model.solve().report.warnings
    model = bracket(1.0, E=210e3, density=0.0)  # in MPa
    model.add(kl.Traction("x+", (0.1, 0, 0)))
    assert "units= where E is in MPa" in "".join(model.solve().report.warnings)


def test_meshes_are_scaled_where_they_are_read(tmp_path):
    kl.write(tmp_path / "b.mdpa", bracket(1.0))
    model = kl.read(tmp_path / "b.mdpa", scale=1e-3)
    assert np.abs(model.mesh.extent[1] - [0.1, 0.06, 0.01]).max() < 1e-15
    for scale in (0, "mm", np.inf):
        with pytest.raises(kl.InputError, match="scale must be"):
            kl.read(tmp_path / "b.mdpa", scale=scale)
    (tmp_path / "p.json").write_text("{}")
    with pytest.raises(kl.InputError, match="scale is that of a mesh file"):
        kl.read(tmp_path / "p.json", scale=1e-3)

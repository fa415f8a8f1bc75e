"""Models said to be in other units than those of SI: the same numbers with the right words everywhere."""

import json
import re

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.cli import main
from kratos_lite.errors import KratosLiteError
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.checks import check_wave_speeds, recognized_units
from kratos_lite.model.refined import refined
from kratos_lite.tabular import UNITS, in_units, size_in_si, unit_name

MM = "mm N MPa t"
SIZES = {
    "SI": (1.0, 1.0, 1.0),
    MM: (1e3, 1e-6, 1e-12),
    "m kN kPa t": (1.0, 1e-3, 1e-3),
    "mm kN GPa kg ms": (1e3, 1e-9, 1e-9),
    "in lbf psi slinch": (1 / 0.0254, 0.0254**2 / 4.4482216152605, 0.0254**4 / 4.4482216152605),
}
"""Sizes of 1 m, 1 Pa and 1 kg/m³ in each set of units."""


def bracket(units="SI", gravity=0.0):
    """Return a steel bar of 100 × 20 × 10 mm under 1 MPa across its end, with its numbers in units."""
    m, Pa, dense = SIZES[units]
    mesh = kl.box(np.array([0.1, 0.02, 0.01]) * m, (5, 1, 1), "KinematicLinear3D20N")
    model = kl.Model(mesh, kl.Isotropic3D(E=210e9 * Pa, nu=0.3, density=7850 * dense), units=units)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1e6 * Pa)))
    if gravity:
        model.add(kl.Gravity((0, 0, -gravity)))
    return model


# ---- words -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("units", UNITS)
def test_sets_of_units_are_consistent(units):
    """Pa = N/m², J = N m, and N = kg m/s²."""
    m, N, Pa, J, kg, s = (size_in_si(unit, units) for unit in ("m", "N", "Pa", "J", "kg", "s"))
    assert abs(N / m**2 / Pa - 1) < 1e-12
    assert abs(N * m / J - 1) < 1e-12
    assert abs(kg * m / s**2 / N - 1) < 1e-12
    assert abs(size_in_si("kg/m³", units) / (kg / m**3) - 1) < 1e-12


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1.5e-3 m at node 3, (0, 0, 1) m", "1.5e-3 mm at node 3, (0, 0, 1) mm"),
        ("[0, 1] × [0, 2] m", "[0, 1] × [0, 2] mm"),
        ("3 Pa, 2 J, 4 N, 5 N m, 6 kg", "3 MPa, 2 mJ, 4 N, 5 N mm, 6 t"),
        ("2 J/m³, 3 m/s², 4 kg m², 5 √J, 7 m² (8 m³)", "2 mJ/mm³, 3 mm/s², 4 t mm², 5 √mJ, 7 mm² (8 mm³)"),
        (
            "stress xx [Pa], area [m2], energy [J/m3], time [s]",
            "stress xx [MPa], area [mm2], energy [mJ/mm3], time [s]",
        ),
        (
            "13 nodes, 4 modes, 165 MB, 0.1 s, 3 Hz, 2 rad/s",
            "13 nodes, 4 modes, 165 MB, 0.1 s, 3 Hz, 2 rad/s",
        ),
        ("8 KinematicLinear3D8N, E=3.0, 5 mm", "8 KinematicLinear3D8N, E=3.0, 5 mm"),
    ],
)
def test_units_in_texts(text, words):
    assert in_units(text, MM) == words
    assert in_units(in_units(text, MM), MM) == words
    assert in_units(text, "SI") == text


def test_names_of_units():
    assert unit_name("J/m³", MM) == "mJ/mm³"
    assert unit_name("", MM) == ""
    assert unit_name("my unit", MM) == "my unit"


# ---- results -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("units", UNITS)
def test_the_bracket_has_the_stress_of_its_units(units):
    """Whatever the units, it is the same bracket."""
    m, Pa, _ = SIZES[units]
    result, same = bracket(units).solve(), bracket().solve()
    assert abs(result.largest_von_mises()[0] / Pa / same.largest_von_mises()[0] - 1) < 1e-9
    assert np.abs(result.u / m - same.u).max() < 1e-9 * np.abs(same.u).max()
    assert abs(result.energy() * size_in_si("J", units) / same.energy() - 1) < 1e-9
    assert result.report.warnings == same.report.warnings
    assert result.report.notes == []


def test_all_words_of_the_bracket_in_mm(tmp_path):
    model = bracket(MM)
    result = model.solve()
    assert "extent    [0, 100] × [0, 20] × [0, 10] mm" in str(model)
    assert ("units", MM) in model.table()
    text = str(result)
    for words in (" mm at node", " mJ", " MPa (at a Gauss point)", ") N", "√mJ", ") mm"):
        assert words in text
    assert " m\n" not in text
    assert " Pa" not in text
    assert " J" not in text
    assert "mm" in result._repr_html_()
    assert {"x [mm]", "displacement z [mm]", "stress xx [MPa]", "strain energy density [mJ/mm3]"} <= set(
        result.columns()
    )
    line = result.along((0, 10, 5), (100, 10, 5), 3)
    assert {"distance [mm]", "stress xx [MPa]"} <= set(line.columns())
    cut = result.section(("x", 40.0))
    assert "x = 40 mm, area 200 mm²" in str(cut)
    assert "N mm" in str(cut)
    assert "area [mm2]" in cut.columns()
    assert "mJ" in str(kl.compare(result, result))
    assert "√mJ" in str(result.error())
    assert result.error(of=kl.DisplacementAt((100, 10, 5), "z")).unit == "mm"
    kl.write(tmp_path / "r.json", result)
    assert json.loads((tmp_path / "r.json").read_text())["units"] == MM


def test_pictures_in_mm(tmp_path):
    pytest.importorskip("matplotlib")
    result = bracket(MM).solve()
    figure = result.plot(tmp_path / "r.png")
    texts = {text.get_text() for axes in figure.axes for text in axes.texts}
    assert {"x  0 … 100 mm", "z  0 … 10 mm"} <= texts
    labels = {axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes}
    assert any(label.strip() == "MPa" for label in labels)
    axes = result.along((0, 10, 5), (100, 10, 5)).plot(values="sxx").axes[0]
    assert axes.yaxis.get_major_formatter()(10, 0) == "10 MPa"
    assert axes.xaxis.get_major_formatter()(5000, 0) == "5000 mm"


def test_harmonic_response_in_mm(tmp_path):
    pytest.importorskip("matplotlib")
    model, dense = bracket(MM), SIZES[MM][2]
    model.assign(kl.Isotropic3D(E=210e3, nu=0.3, density=7850.0 * dense))
    response, point = model.harmonic([0.0, 10.0], damping=0.02), (100.0, 10.0, 5.0)
    assert " mm at " in str(response)
    assert "amplitude z [mm]" in response.columns(point)
    axes = response.plot(point, "z", tmp_path / "h.png").axes[0]
    assert axes.yaxis.get_major_formatter()(0.5, 0) == "0.5 mm"
    assert axes.get_xlabel() == "frequency in rad/s"


def test_warnings_and_places_in_errors_are_in_mm():
    model = bracket(MM)
    model.add(kl.Traction("x+", (0, 0, -1e3)))
    (text,) = model.solve().report.warnings
    assert re.search(r"differ by \S+ mm, ", text)
    model.assign(kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0))
    report = model.solve().report
    assert "to 1.2e+06 MPa (diamond)" in " ".join(report.warnings)
    assert "2.26e-08 t/mm³ (osmium)" in " ".join(report.warnings)
    model.assign(kl.J2Plasticity3D(210e3, 0.3, 355e6))
    assert "J2Plasticity3D" in " ".join(model.checked()[1])
    model.assign(kl.J2Plasticity3D(210e3, 0.3, 355.0))
    assert not [text for text in model.checked()[1] if "J2Plasticity3D" in text]
    model.assign(kl.Isotropic3D(E=210e9, nu=0.3, density=7.85e-9))
    assert "2.5e+07 mm/s" in " ".join(model.solve().report.warnings)
    result = bracket(MM).solve()
    for act, words in (
        (
            lambda: result.at((300.0, 0, 0)),
            r"0.0\] mm lies outside the mesh, about 200 mm from",
        ),
        (lambda: model.fix((300.0, 0, 0)), "200 mm away"),
        (lambda: result.section(("x", 300.0)), "x = 300 mm misses the body, which spans 0 … 100 mm there"),
    ):
        with pytest.raises(kl.MeshError, match=words):
            act()
    assert result.section(("x", 50.0)).where == "x = 50 mm"
    model = bracket(MM, gravity=9810.0)
    model.loads[:] = model.loads[1:]
    model.assign(kl.Isotropic3D(E=210e3, nu=0.3))
    assert "give density in t/mm³" in " ".join(model.solve().report.warnings)
    model = kl.Model(result.mesh, kl.Isotropic3D(E=210e3, nu=0.3))
    model.add(kl.Resultant("x+", (0, 0, 1e3)))
    with pytest.raises(kl.ModelError, match=r"\(0 0 1000\) N and \(0 -50000 0\) N mm about \(50 10 5\)"):
        model.solve()
    finer = bracket(MM).solve(error=0.5).report.warnings
    assert not [text for text in finer if " Pa" in text]


def test_a_check_on_the_command_line_is_in_mm(tmp_path, run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    kl.write("bar.vtu", kl.box((100, 20, 10), (5, 1, 1)))
    words = ["--units", MM, "--material", "E=210e3,nu=0.3", "--fix", "x-:xyz", "--traction", "x+:0,0,-1"]
    assert "[0, 100] × [0, 20] × [0, 10] mm" in run("check", "bar.vtu", *words).out


def test_units_go_along_to_finer_meshes_and_studies():
    model = bracket(MM)
    assert refined(model, refine(model.mesh)).units == MM
    assert model.mesh.replace(points=2 * model.mesh.points).units == MM
    study = kl.converge(lambda h: bracket(MM), kl.MeanDisplacement("x+", "z"), (3, 2, 1))
    assert study.unit == "mm"


def test_units_go_along_to_meshes_that_are_made_of_others_and_to_harmonic_response():
    pytest.importorskip("matplotlib")
    bolt, other = kl.box(cells=(1, 1, 2)), kl.box()
    bolt.use_units("mm N MPa t")
    cut = kl.split(bolt, lambda X: X[:, 2] == 0.5)
    assert {mesh.units for mesh in (cut, refine(cut).mesh, kl.join({"a": cut, "b": other}))} == {bolt.units}
    other.use_units("m kN kPa t")
    with pytest.raises(KratosLiteError, match="one set of units; got m kN kPa t and mm N MPa t"):
        kl.join({"a": bolt, "b": other})
    model = kl.Model(bolt, kl.Isotropic3D(E=210e3, nu=0.3, density=7.85e-9))
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1.0)))
    response = model.harmonic([1.0, 2.0])
    assert " mm at " in str(response)
    assert "amplitude z [mm]" in response.columns((0, 0, 1))
    assert response.plot((0, 0, 1)).axes[0].yaxis.get_major_formatter()(10, 0) == "10 mm"


def test_steps_in_time_have_their_units(tmp_path, run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = bracket(MM)
    writer = kl.SeriesWriter("r.csv", transient := model.transient())
    for state in kl.integrate(transient, 1e-5, 2):
        writer.add(state)
    writer.close()
    assert "energy [mJ],largest displacement [mm]" in (tmp_path / "r.csv").read_text()
    mesh = kl.box((100, 20, 10), (5, 1, 1))
    kl.write("bar.vtu", mesh)
    words = ["--units", MM, "--material", "E=210e3,nu=0.3,density=7.85e-9", "--fix", "x-:xyz"]
    words += ["--traction", "x+:0,0,-1"]
    static = run("solve", "bar.vtu", *words, "--section", "x=50")
    assert "MPa (at a Gauss point)" in static.out
    assert "(0, 0, -200) N" in static.out
    assert "area 200 mm²" in static.out
    moving = run("solve", "bar.vtu", *words, "--time", "1e-5:2")
    assert " mJ at the start" in moving.out
    assert " m at" not in moving.out
    assert run("solve", "bar.vtu", *words, "--scale", "mm").refuses("--scale makes a mesh one in m")
    assert run("solve", "bar.vtu", "--units", "cm").refuses("units must be one of SI, mm N MPa t")


# ---- magnitudes --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("units", UNITS)
def test_magnitudes_of_each_set_of_units(units):
    m, Pa, dense = SIZES[units]
    wrong = kl.Model(
        kl.box(np.array([1, 1, 1]) * m), kl.Isotropic3D(E=1e16 * Pa, nu=0.3, density=1e8 * dense), units=units
    )
    wrong.fix("x-")
    wrong.add(kl.Traction("x+", (1e6 * Pa, 0, 0)))
    report = wrong.solve().report
    notes = " ".join(report.notes if units == "SI" else report.warnings)
    assert f"(diamond): is it in {unit_name('Pa', units)}?" in notes
    assert f"is it in {unit_name('kg/m³', units)} (steel: {7850 * dense:g})" in notes
    assert f"to {1.2e12 * Pa:g}" in notes


def test_metal_in_mm_is_no_mountain_and_its_waves_are_no_light():
    assert bracket(MM).check() == bracket().check()
    said_in_m = bracket(MM)
    vars(said_in_m.mesh)["units"] = "SI"
    assert any(
        "m³" in text or "speed of waves" in text
        for text in said_in_m.solve().report.warnings + said_in_m.remarks()
    )


@pytest.mark.parametrize(("gravity", "warned"), [(9.81, True), (9810.0, False)])
def test_gravity_in_mm(gravity, warned):
    warnings = " ".join(bracket(MM, gravity).check() + bracket(MM, gravity).solve().report.warnings)
    assert ("this model is in mm N MPa t: give 9810" in warnings) == warned
    assert "gravity is 9.81" not in " ".join(bracket("SI", 9.81).solve().report.warnings)


# ---- refused -----------------------------------------------------------------------------------------------


def _body(model, folder):
    kl.FiniteElementBody(model.mesh, kl.Isotropic3D(E=1e3, nu=0.3, density=1e-9))


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (_body, "bodies in motion are in SI, and this mesh is in mm N MPa t"),
        (
            lambda model, _: kl.compare(model.solve(), bracket().solve()),
            "one result is in mm N MPa t, the other in SI",
        ),
        (lambda model, _: model.mesh.use_units("m kN kPa t"), "is said to be in mm N MPa t"),
        (
            lambda model, _: kl.Model(kl.box(), units="mm"),
            "units must be one of SI, mm N MPa t, m kN kPa t, mm kN GPa kg ms, in lbf psi slinch; got 'mm'",
        ),
        (lambda model, _: kl.Model(kl.box(), units="mm"), "got 'mm'. Did you mean mm N MPa t?"),
        (lambda model, _: kl.Model(kl.box(), units=3), "units must be one of"),
        (lambda model, _: kl.Mesh([[0, 0, 0]], units="inch"), "units must be one of"),
    ],
)
def test_refused_by_name(act, words, tmp_path):
    with pytest.raises(KratosLiteError) as error:
        act(bracket(MM), tmp_path)
    assert words in str(error.value)


def test_a_file_of_a_model_does_not_hold_its_units(tmp_path):
    notes = kl.write(tmp_path / "r.mdpa", bracket(MM))
    assert any("that the numbers, which stay, are in mm N MPa t" in note for note in notes)
    assert not any("numbers" in note for note in kl.write(tmp_path / "s.mdpa", bracket()))


# ---- recognized --------------------------------------------------------------------------------------------

REAL = {  # E in Pa and density in kg/m³, as handbooks have them
    "steel": (210e9, 7850.0),
    "aluminium": (70e9, 2700.0),
    "titanium": (110e9, 4500.0),
    "lead": (16e9, 11340.0),
    "tungsten carbide": (600e9, 15600.0),
    "alumina": (380e9, 3900.0),
    "glass": (70e9, 2500.0),
    "concrete": (30e9, 2400.0),
    "carbon fibre": (140e9, 1600.0),
    "nylon": (2.8e9, 1140.0),
    "polyethylene": (0.8e9, 950.0),
    "wood": (11e9, 500.0),
    "rubber": (2e6, 1100.0),
    "rigid foam": (130e6, 100.0),
    "polystyrene foam": (5e6, 20.0),
}


def materials(names, units, density=1.0):
    pascal, dense = size_in_si("Pa", units), size_in_si("kg/m³", units)
    constants = (REAL[name] for name in names)
    return [kl.Isotropic3D(E=E / pascal, nu=0.3, density=density * heavy / dense) for E, heavy in constants]


@pytest.mark.parametrize("units", UNITS)
def test_real_materials_tell_their_units(units):
    for name in REAL:
        assert recognized_units(materials([name], units)) == units, name
    assert recognized_units(materials(REAL, units)) == units
    assert not check_wave_speeds(materials(REAL, units), units)


@pytest.mark.parametrize(
    ("E", "density", "units"),
    [
        (210000.0, 7.9e-9, MM),
        (210.0, 7.9e-6, "mm kN GPa kg ms"),
        (3e7, 7.3e-4, "in lbf psi slinch"),
        (210e9, 0.0, "SI"),
        (210000.0, 0.0, MM),
        (210.0, 0.0, None),  # steel in GPa, or polyethylene in MPa
        (3e7, 0.0, None),  # steel in psi, or concrete in kPa
        (210000.0, 7850.0, None),  # MPa and kg/m³
        (210e9, 7.85e-9, None),
        (1.0, 1.0, None),
    ],
)
def test_what_tells_units_and_what_does_not(E, density, units):
    assert recognized_units([kl.Isotropic3D(E=E, nu=0.3, density=density)]) == units


def test_steel_without_density_beside_rubber_with_it_and_nothing():
    pair = materials(["steel"], MM, density=0.0) + materials(["rubber"], MM)
    assert recognized_units(pair) == MM
    assert recognized_units(materials(["steel", "rubber"], MM, density=0.0)) == MM
    assert recognized_units(materials(["steel"], MM) + materials(["steel"], "SI")) is None
    assert recognized_units([]) is None


def test_a_model_takes_the_units_of_its_materials_and_says_so():
    steel = kl.Isotropic3D(E=210.0, nu=0.3, density=7.85e-6)
    model = kl.Model(kl.box((100, 20, 10)), steel, units="auto")
    model.fix("x-")
    model.add(kl.Traction("x+", (1e-3, 0, 0)))
    assert model.units == "mm kN GPa kg ms"
    assert f"units: mm, kN, GPa, kg, ms (recognized from E and density of {steel})" in str(model)
    result = model.solve()
    assert "kN" in str(result)
    assert not any("speed of waves" in text for text in result.report.warnings)
    other = kl.Model(kl.box(), kl.Isotropic3D(E=210000.0, nu=0.3, density=7850.0), units="auto")
    assert other.units == "SI"
    assert "units: not recognized" in str(other)
    assert in_units("3 m/s², 2 s, 5 Hz, 4 rad/s", model.units) == "3 mm/ms², 2 ms, 5 kHz, 4 rad/ms"


def test_units_are_recognized_on_the_command_line(tmp_path, capsys):
    kl.write(tmp_path / "box.vtu", kl.box((100.0, 20.0, 10.0)))
    options = ["--units", "auto", "--material", "E=210e3,nu=0.3,density=7.85e-9", "--fix", "x-:xyz"]
    assert main(["solve", str(tmp_path / "box.vtu"), *options, "--traction", "x+:1,0,0"]) == 0
    assert "units: mm, N, MPa, t (recognized" in capsys.readouterr().out

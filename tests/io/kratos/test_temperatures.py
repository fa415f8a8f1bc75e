"""Temperatures of files: nodal data, properties, processes; written again; refused where nothing expands."""

import numpy as np
import pytest
from run_files import CLAMP, CUBE_NODES, box_mdpa, materials, process, run_file, write

import kratos_lite as kl
from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.io.files import read_case
from kratos_lite.io.run import prepare

E, NU, ALPHA = 2e9, 0.3, 1e-5
THERMAL = "ThermalElasticIsotropic3D"
IMPOSE = "assign_scalar_variable_process"
MDPA = """Begin Properties 1
YOUNG_MODULUS 2e9
POISSON_RATIO 0.3
{properties}
End Properties
{nodes}
Begin Elements SmallDisplacementElement3D8N
1 1 1 2 3 4 5 6 7 8
End Elements
Begin NodalData TEMPERATURE
{temperature}
End NodalData
"""
EXPANDS = f"CONSTITUTIVE_LAW {THERMAL}\nTHERMAL_EXPANSION_COEFFICIENT 1e-5\nREFERENCE_TEMPERATURE 20"
HOT = "\n".join(f"{i} 0 120" for i in range(1, 9))


def imposed(value, part="Structure", **settings):
    return process(IMPOSE, part, "TEMPERATURE", value=value, **settings)


@pytest.fixture
def mdpa(tmp_path):
    def read(properties=EXPANDS, temperature=HOT):
        path = tmp_path / "cube.mdpa"
        path.write_text(MDPA.format(nodes=CUBE_NODES, properties=properties, temperature=temperature))
        return kl.read(path)

    return read


@pytest.fixture
def case(tmp_path):
    def read(processes, law=THERMAL, properties=None, **settings):
        (tmp_path / "box.mdpa").write_text(box_mdpa())
        own = {"THERMAL_EXPANSION_COEFFICIENT": ALPHA, "REFERENCE_TEMPERATURE": 20.0}
        own = own if properties is None else properties
        write(tmp_path, materials("Structure.Body", 7850.0, E, NU, law, **own), "materials.json")
        return read_case(write(tmp_path, run_file([CLAMP], processes, **settings)))

    return read


def clamped_stress(model):
    model.fix(np.arange(model.mesh.n_nodes), "xyz", override=True)
    return model.solve().stress("element")


def test_temperatures_of_nodes_strain_a_clamped_cube(mdpa):
    stress = clamped_stress(mdpa())
    closed = -E * ALPHA * 100 / (1 - 2 * NU)
    assert np.abs(stress - closed * np.array([1, 1, 1, 0, 0, 0])).max() < 1e-12 * -closed


def test_nodes_without_temperature_have_0_as_in_kratos(mdpa):
    model = mdpa(temperature="1 0 120")
    assert any("TEMPERATURE is 0 at 7 nodes" in note for note in model.notes)
    T = model.loads[0].difference(model.mesh)
    assert T.tolist() == [100.0, *[-20.0] * 7]


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        ("", "cube.mdpa:19: no element expands by its TEMPERATURE"),
        (
            "CONSTITUTIVE_LAW Isotropic3D\nTHERMAL_EXPANSION_COEFFICIENT 1e-5",
            "cube.mdpa:1: Properties 1: nodes",
        ),
        (
            EXPANDS.replace(THERMAL, "LinearElastic3DLaw"),
            "cube.mdpa:4: Properties 1: CONSTITUTIVE_LAW LinearEl",
        ),
        (
            EXPANDS.replace("REFERENCE_TEMPERATURE", "REFERENC_TEMPERATURE"),
            "cube.mdpa:6: unknown variable REF",
        ),
    ],
)
def test_temperatures_that_mean_nothing_are_refused_with_their_line(mdpa, properties, words):
    with pytest.raises(KratosLiteError) as caught:
        mdpa(properties)
    assert words in str(caught.value)


def test_a_process_imposes_a_function(case):
    run = case([imposed("20 + 100*x*t", interval=[0.0, "End"])], end=1.0, step=0.5)
    model = run.model
    T = model.loads[0].at(1.0).difference(model.mesh)
    assert np.abs(T - 100 * model.mesh.points[:, 0]).max() < 1e-12
    assert not any("TEMPERATURE" in note for note in model.notes if "static" in note or "ignored" in note)
    result = kl.run(run).result
    free = kl.Model(model.mesh, kl.Isotropic3D(E, NU, alpha=ALPHA))
    free.fix("z-", "xyz")
    free.add(kl.Temperature(lambda X: 100 * X[:, 0]))
    expected = free.solve().u
    assert np.abs(result.u - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"law": "LinearElastic3DLaw"}, "LinearElastic3DLaw has no thermal strain in Kratos"),
        ({"properties": {}}, "no element expands by its TEMPERATURE"),
        ({"properties": {"THERMAL_EXPANSION_COEFFICIENT": ALPHA}}, "give a REFERENCE_TEMPERATURE"),
        (
            {"properties": {"THERMAL_EXPANSION_COEFFICIENT": ALPHA, "REFERENCE_TEMPERATURE": [1.0, 2.0]}},
            "give a REFERENCE_TEMPERATURE, one number",
        ),
        ({"solver_type": "dynamic", "properties": {}}, "no element expands by its TEMPERATURE"),
        ({"solver_type": "dynamic", "law": "LinearElastic3DLaw"}, "has no thermal strain in Kratos"),
    ],
)
def test_processes_of_bodies_that_do_not_expand_are_refused(case, settings, words):
    with pytest.raises(InputError) as caught:
        case([imposed("20 + t", interval=[0.0, "End"])], **settings)
    assert words in str(caught.value)


def test_a_temperature_that_grows_in_time_acts_in_each_step(case):
    grows = imposed("20 + 100*t", interval=[0.0, "End"])
    one = case([grows], solver_type="dynamic", step=0.5, end=1.0, scheme_type="newmark")
    acting = [one.model.loads[-1].acting(t) for t in (0.0, 0.5, 1.0)]
    assert acting[0] == []
    for (factor, load), expected in zip((acting[1][0], acting[2][0]), (50.0, 100.0), strict=True):
        assert factor == 1
        assert np.abs(load.difference(one.model.mesh) - expected).max() < 1e-12


def strip(*temperatures):
    """Return a strip of two materials on rollers with temperatures."""
    mesh = kl.box((2, 1, 1), (2, 1, 2), "KinematicLinear3D20N")
    model = kl.Model(mesh, kl.Isotropic3D(E, NU, alpha=ALPHA))
    centers = mesh.points[mesh.blocks[0].nodes].mean(axis=1)
    model.assign(kl.Isotropic3D(3 * E, 0.2, alpha=2 * ALPHA), np.flatnonzero(centers[:, 2] > 0.5))
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(side, axis)
    for temperature in temperatures:
        model.add(temperature)
    return model


def field(X):
    return 300 + 50 * X[:, 0] ** 2 + 20 * X[:, 1] * X[:, 2]


@pytest.mark.parametrize(
    "temperatures",
    [
        (kl.Temperature(120.0, reference=20.0),),
        (kl.Temperature(field, reference=293.15), kl.Temperature(40.0, reference=30.0)),
        (kl.Temperature(field, reference=280.0, where=[0, 1]), kl.Temperature(field, 300.0, where=[2, 3])),
    ],
)
def test_a_model_that_is_written_and_read_is_as_hot_as_before(tmp_path, temperatures):
    model = strip(*temperatures)
    kl.write(tmp_path / "a.mdpa", model)
    again = kl.read(tmp_path / "a.mdpa")
    expected = model.solve()
    assert np.abs(again.solve().u - expected.u).max() < 1e-12 * np.abs(expected.u).max()
    kl.write(tmp_path / "b.mdpa", again)
    read = kl.read(tmp_path / "b.mdpa").solve()
    assert np.abs(read.u - expected.u).max() < 1e-12 * np.abs(expected.u).max()


@pytest.mark.parametrize(
    ("temperature", "words"),
    [
        (kl.Temperature(120.0, 20.0, where=[0]), "temperatures that differ on two sides of a node"),
        (kl.Temperature(field, 20.0, where=[0, 1]), "temperatures that differ on two sides of a node"),
    ],
)
def test_temperatures_that_a_file_cannot_hold_are_not_written(tmp_path, temperature, words):
    with pytest.raises(InputError, match=words):
        kl.write(tmp_path / "a.mdpa", strip(temperature))
    assert not (tmp_path / "a.mdpa").exists()


def test_kratos_has_no_orthotropic_law_with_thermal_strain(tmp_path):
    wood = kl.Orthotropic3D(11e9, 2e9, 1e9, 0.4, 0.3, 0.35, 0.7e9, 0.2e9, 0.6e9, alpha_x=5e-6)
    model = kl.Model(kl.box(), wood)
    model.fix("z-")
    kl.write(tmp_path / "a.mdpa", model)
    model.add(kl.Temperature(50.0))
    with pytest.raises(InputError, match="a temperature of Orthotropic3D cannot be written"):
        kl.write(tmp_path / "a.mdpa", model)


def test_a_crystal_is_written_with_its_c_but_not_with_its_expansion(tmp_path):
    C = kl.Orthotropic3D(11e9, 2e9, 1e9, 0.4, 0.3, 0.35, 0.7e9, 0.2e9, 0.6e9).C
    crystal = kl.Anisotropic3D(C, 500.0).turned(kl.Cartesian((1, 2, 3)).directions((0, 0, 0)))
    model = kl.Model(kl.box(), crystal)
    model.fix("z-")
    kl.write(tmp_path / "a.mdpa", model)
    again = kl.read(tmp_path / "a.mdpa")
    assert again.element_groups()[0].material == crystal
    assert not again.notes
    model.assign(kl.Anisotropic3D(C, alpha=[1e-5, 0, 0, 0, 0, 0]))
    with pytest.raises(InputError, match="the thermal expansion of Anisotropic3D cannot be written"):
        kl.write(tmp_path / "a.mdpa", model)


def test_a_law_that_flows_is_heated_step_by_step(case):
    """Heated by 200 K and cooled again: what has flowed stays, as with an amplitude in a script."""
    own = {"YIELD_STRESS": 1e6, "THERMAL_EXPANSION_COEFFICIENT": ALPHA, "REFERENCE_TEMPERATURE": 20.0}
    own |= {"ISOTROPIC_HARDENING_MODULUS": 1e8}
    heat = imposed("20 + 200*sin(pi*t)", interval=[0.0, "End"])
    settings = {"analysis_type": "non_linear", "step": 0.25, "end": 0.9}
    one = case([heat], law="J2Plasticity3D", properties=own, **settings)
    *_, last = prepare(one)[1]
    model = kl.Model(one.model.mesh, kl.J2Plasticity3D(E, NU, 1e6, hardening=1e8, alpha=ALPHA))
    model.fix("z-", "xyz")
    model.add(kl.Temperature(220.0, 20.0), amplitude=lambda t: np.sin(np.pi * t))
    *_, expected = kl.integrate(model.quasi_static(), dt=0.25, steps=4)
    assert np.abs(expected.u).max() > 1e-5
    assert np.abs(last.u - expected.u).max() < 1e-6 * np.abs(expected.u).max()

"""Laws in Kratos, live, and here: the same run file with the same displacements after each step."""

import json
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import pytest
from run_files import (
    CLAMP,
    PLASTIC,
    SOFTENING,
    VON_MISES,
    box_mdpa,
    materials,
    process,
    run_file,
    run_kratos,
    write,
)

from kratos_lite.elements import ELEMENTS
from kratos_lite.io.files import read_case
from kratos_lite.io.kratos.outputs.values import ORDER_OF_POINTS
from kratos_lite.io.kratos.properties import material_from
from kratos_lite.io.run import prepare, run

for wheel in ("Multiphysics", "StructuralMechanicsApplication", "ConstitutiveLawsApplication"):
    try:
        version(f"Kratos{wheel}")
    except PackageNotFoundError:
        pytest.skip(f"Kratos{wheel} is not installed", allow_module_level=True)

PERFECT = SOFTENING | {"HARDENING_CURVE": 3}
CASES = {
    "J2": ("SmallDisplacementElement", "SmallStrainJ2Plasticity3DLaw", PLASTIC, 0.01),
    "von Mises": ("SmallDisplacementElement", VON_MISES, SOFTENING, 0.01),
    "linear softening": ("SmallDisplacementElement", VON_MISES, SOFTENING | {"HARDENING_CURVE": 0}, 0.01),
    "perfect": ("SmallDisplacementElement", VON_MISES, PERFECT, 0.01),
    "neo-Hooke": ("TotalLagrangianElement", "HyperElastic3DLaw", {}, 0.3),
    "Saint Venant": ("TotalLagrangianElement", "KirchhoffSaintVenant3DLaw", {}, 0.3),
    "updated": ("UpdatedLagrangianElement", "HyperElastic3DLaw", {}, 0.3),
}

EXACT = {
    "analysis_type": "non_linear",
    "convergence_criterion": "residual_criterion",
    "residual_relative_tolerance": 1e-12,
    "residual_absolute_tolerance": 1e-9,
    "max_iteration": 50,
}


def compare(folder, content, steps):
    """Compare the displacements after each step of a folder."""
    path = write(folder, content)
    run_kratos(folder)
    expected = json.loads((folder / "kratos.json").read_text())["steps"]
    case = read_case(path)
    ids = [str(i) for i in case.model.mesh.node_ids]
    count = 0
    for state, known in zip(prepare(case)[1], expected, strict=True):
        reference = np.array([known[i] for i in ids])
        assert np.abs(state.u - reference).max() < 1e-8 * np.abs(reference).max(), state.step
        count += 1
    assert count == steps


def moved(axis, value):
    return process(
        "assign_scalar_variable_process",
        "Structure.Top",
        f"DISPLACEMENT_{axis}",
        value=value,
        interval=[0.0, "End"],
    )


@pytest.mark.parametrize("name", CASES)
def test_ten_steps_are_those_of_kratos(tmp_path, name):
    """The upper face goes forth and back, pulled and sheared; all else is free.

    In the first step all is elastic, as laws of Kratos do not flow in the first iteration of all.
    """
    element, law, variables, size = CASES[name]
    (tmp_path / "box.mdpa").write_text(box_mdpa().replace("SmallDisplacementElement", element))
    write(tmp_path, materials("Structure.Body", 7850.0, 2e9, 0.3, law, **variables), "materials.json")
    content = run_file(
        [CLAMP, moved("Z", f"{size}*sin(5*t*t)"), moved("X", f"{size / 2}*t*t")],
        [],
        step=0.1,
        end=0.95,
        **EXACT,
    )
    compare(tmp_path, content, 10)


DYNAMIC = {  # elements, law, its constants, traction on the top after 1 s, prefix of conditions
    "J2": (*CASES["J2"][:3], 3e8, "SmallDisplacement"),
    "neo-Hooke": (*CASES["neo-Hooke"][:3], 5e9, "SmallDisplacement"),
    "Saint Venant, followed": (*CASES["Saint Venant"][:3], 5e9, ""),
    "linear, followed": ("SmallDisplacementElement", "LinearElastic3DLaw", {}, 5e9, ""),
}


@pytest.mark.parametrize("scheme", ["newmark", "bossak"])
@pytest.mark.parametrize("name", DYNAMIC)
def test_dynamic_steps_are_those_of_kratos(tmp_path, name, scheme):
    """Also where loads follow the faces of linear elements, which makes these nonlinear."""
    element, law, variables, size, prefix = DYNAMIC[name]
    text = box_mdpa().replace("SmallDisplacementElement", element)
    (tmp_path / "box.mdpa").write_text(text.replace("SmallDisplacementSurface", f"{prefix}Surface"))
    write(tmp_path, materials("Structure.Body", 7850.0, 2e9, 0.3, law, **variables), "materials.json")
    vector = "assign_vector_variable_to_conditions_process"
    pull = process(vector, "Structure.Top", "SURFACE_LOAD", value=[f"{size / 5}*t", 0.0, f"{size}*t"])
    scalar = "assign_scalar_variable_to_conditions_process"
    loads = [pull, process(scalar, "Structure.Side", "POSITIVE_FACE_PRESSURE", value=f"{-size}*t")]
    how = {"solver_type": "dynamic", "scheme_type": scheme} | EXACT
    compare(tmp_path, run_file([CLAMP], loads, step=2e-3, end=0.029, **how), 15)


SURFACES = ("VonMises", "DruckerPrager", "Tresca", "ModifiedMohrCoulomb")
ROCK = {
    "YOUNG_MODULUS": 20e9, "POISSON_RATIO": 0.2, "FRACTURE_ENERGY": 5e5, "SOFTENING_TYPE": 1,
    "YIELD_STRESS_TENSION": 4e7, "YIELD_STRESS_COMPRESSION": 8e7, "FRICTION_ANGLE": 32.0,
    "DILATANCY_ANGLE": 20.0, "MAXIMUM_STRESS": 13e7, "MAXIMUM_STRESS_POSITION": 0.2,
    "PLASTIC_STRAIN_VECTOR_PLASTICITY_POINT_CURVE": [0.0, 1e-3, 4e-3, 8e-3],
    "EQUIVALENT_STRESS_VECTOR_PLASTICITY_POINT_CURVE": [4e7, 5e7, 5.5e7, 5e7],
    "PLASTIC_STRAIN_INDICATORS": [2e-3, 4e-3], "CURVE_FITTING_PARAMETERS": [4e7, 5e9, -1e12],
}  # fmt: skip


def stresses_in_kratos(name, variables, path):
    """Return the stresses (k, 6) of a law of Kratos at a point of a cube of 0.1 m along strains (k, 6)."""
    import KratosMultiphysics as KM
    import KratosMultiphysics.ConstitutiveLawsApplication as application

    part, properties, law = KM.Model().CreateModelPart("P"), KM.Properties(1), getattr(application, name)()
    for key, value in variables.items():
        variable = KM.KratosGlobals.GetVariable(key)
        whole = int(value) if key in ("HARDENING_CURVE", "SOFTENING_TYPE") else value
        properties.SetValue(variable, KM.Vector(value) if isinstance(value, list) else whole)
    corners = 0.1 * ELEMENTS["KinematicLinear3D8N"].nodes / 2
    cube = KM.Hexahedra3D8(*(part.CreateNewNode(i + 1, *place) for i, place in enumerate(corners.tolist())))
    info, options, at = KM.ProcessInfo(), KM.Flags(), KM.ConstitutiveLawParameters()
    info.SetValue(KM.STEP, 2)  # in the first iteration of all it does not flow
    options.Set(KM.ConstitutiveLaw.USE_ELEMENT_PROVIDED_STRAIN, True)
    options.Set(KM.ConstitutiveLaw.COMPUTE_STRESS, True)
    strain, stress, C, N = KM.Vector(6), KM.Vector(6), KM.Matrix(6, 6), KM.Vector([0.125] * 8)
    law.InitializeMaterial(properties, cube, N)
    for name, value in (
        ("Options", options), ("StrainVector", strain), ("StressVector", stress), ("ConstitutiveMatrix", C),
        ("ProcessInfo", info), ("MaterialProperties", properties), ("ElementGeometry", cube),
        ("ShapeFunctionsValues", N),
    ):  # fmt: skip
        getattr(at, f"Set{name}")(value)
    found = []
    for e in path:
        for i in range(6):
            strain[i] = e[i]
        law.CalculateMaterialResponseCauchy(at)
        found.append(list(stress))
        law.FinalizeMaterialResponseCauchy(at)
    return np.array(found)


def stresses_here(name, variables, path):
    law = material_from(variables | {"CONSTITUTIVE_LAW": name})
    state, found = law.initial_state(), []
    state["element_radius"][:] = 0.05 * 3**0.5
    for strain in path:
        stress, _, state = law.evaluate(strain, state, 1.0)
        found.append(stress)
    return np.array(found)


POINT_LAWS = [
    *(
        (f"SmallStrainIsotropicPlasticity3D{s}{s}", {"HARDENING_CURVE": c})
        for s in SURFACES
        for c in range(7)
    ),
    *(
        (f"SmallStrainIsotropicPlasticity3D{s}{p}", {"HARDENING_CURVE": 1})
        for s in SURFACES
        for p in SURFACES
    ),
    *((f"SmallStrainIsotropicDamage3D{s}", {}) for s in SURFACES[1:]),
    *(
        (f"SmallStrainIsotropicDamage3D{s}", {"YIELD_STRESS_COMPRESSION": 4e7})
        for s in ("VonMises", "Rankine")
    ),
    ("SmallStrainIsotropicDamage3DModifiedMohrCoulomb", {"SOFTENING_TYPE": 0}),
    ("SmallStrainIsotropicDamage3DSimoJu", {"FRACTURE_ENERGY": 1e16, "YIELD_STRESS_COMPRESSION": 4e7}),
]


@pytest.mark.parametrize(("name", "more"), POINT_LAWS)
def test_stresses_of_a_point_are_those_of_kratos(name, more):
    """Along three random paths of strains without shears yz and zx."""
    for seed in range(3):
        steps = np.random.default_rng(seed).normal(size=(8, 6)) * 6e-4 - 2e-4 * np.array([1, 1, 1, 0, 0, 0])
        path = np.cumsum(steps * [1, 1, 1, 1, 0, 0], axis=0)
        known = stresses_in_kratos(name, ROCK | more, path)
        assert np.abs(stresses_here(name, ROCK | more, path) - known).max() < 1e-10 * np.abs(known).max()


@pytest.mark.parametrize(("name", "depends"), [("VonMises", False), ("Tresca", True)])
def test_the_flow_of_tresca_in_kratos_depends_on_the_axes(name, depends):
    """The same strain, with the axes named anew: here the same stress."""
    law, variables = f"SmallStrainIsotropicPlasticity3D{name}{name}", ROCK | {"HARDENING_CURVE": 3}
    path = np.array([[2e-3, -2e-3, 1e-4, 0.0, -2e-3, 1e-3]])
    turned = [1, 2, 0, 4, 5, 3]
    for stresses, equal in ((stresses_in_kratos, not depends), (stresses_here, True)):
        one, other = stresses(law, variables, path)[0], stresses(law, variables, path[:, turned])[0]
        assert (np.abs(one[turned] - other).max() < 1e-10 * np.abs(one).max()) == equal


@pytest.mark.parametrize("prefix", ["", "SmallDisplacement"])
def test_loads_on_faces_follow_the_body_as_in_kratos(tmp_path, prefix):
    """Pressures and tractions of SurfaceLoadCondition act on deformed faces; these keep their direction."""
    text = box_mdpa().replace("SmallDisplacementElement", "TotalLagrangianElement")
    text = text.replace("SmallDisplacementSurfaceLoad", f"{prefix}SurfaceLoad")
    (tmp_path / "box.mdpa").write_text(text)
    write(tmp_path, materials("Structure.Body", 7850.0, 2e9, 0.3, "HyperElastic3DLaw"), "materials.json")
    to_conditions = "assign_scalar_variable_to_conditions_process"
    pressure = process(to_conditions, "Structure.Side", "POSITIVE_FACE_PRESSURE", value="-2e8*t")
    vector = "assign_vector_variable_to_conditions_process"
    traction = process(vector, "Structure.Top", "SURFACE_LOAD", value=["1e8*t", 0.0, "2e8*t"])
    compare(tmp_path, run_file([CLAMP], [pressure, traction], step=0.25, end=0.95, **EXACT), 4)


@pytest.mark.parametrize(
    ("name", "variables", "tolerance"),
    [
        ("J2", ["CAUCHY_STRESS_VECTOR"], 1.0),
        ("J2", ["GREEN_LAGRANGE_STRAIN_VECTOR"], 1e-9),
        ("von Mises", ["PLASTIC_DISSIPATION"], 1e-6),
        ("neo-Hooke", ["CAUCHY_STRESS_VECTOR", "PK2_STRESS_VECTOR"], 1.0),
    ],
)
def test_values_at_gauss_points_are_those_that_kratos_writes(tmp_path, name, variables, tolerance):
    element, law, constants, size = CASES[name]
    (tmp_path / "box.mdpa").write_text(box_mdpa().replace("SmallDisplacementElement", element))
    write(tmp_path, materials("Structure.Body", 7850.0, 2e9, 0.3, law, **constants), "materials.json")
    common = {"model_part_name": "Structure.Body", "time_frequency": 0.15}
    written = {"gauss_points_output_variables": variables, "output_file_name": "results.json"}
    checked = {"gauss_points_check_variables": variables, "input_file_name": "results.json"}
    module, supports = "json_output_process", [CLAMP, moved("Z", f"{size}*t*t"), moved("X", f"{size / 2}*t")]
    output = {"python_module": module, "kratos_module": "KratosMultiphysics", "Parameters": common | written}
    write(tmp_path, run_file(supports, [], step=0.1, end=0.95, checks=[output], **EXACT))
    run_kratos(tmp_path)
    common |= {"tolerance": tolerance, "relative_tolerance": 0.0}
    check = {"python_module": "from_json_check_result_process", "Parameters": common | checked}
    path = write(tmp_path, run_file(supports, [], step=0.1, end=0.95, checks=[check], **EXACT))
    lines = run(read_case(path)).compare()
    assert len(lines) == len(variables)
    for line in lines:
        assert " passed (element " in line, line
        assert line.endswith(" after 5 steps")


@pytest.mark.parametrize("nodes", [4, 6, 8, 10, 20, 27])
def test_gauss_points_in_the_order_of_kratos(nodes):
    import KratosMultiphysics as KM
    import KratosMultiphysics.StructuralMechanicsApplication as SMA

    element = ELEMENTS[f"KinematicLinear3D{nodes}N"]
    part = KM.Model().CreateModelPart("Part")
    steel = part.CreateNewProperties(1)
    steel.SetValue(KM.CONSTITUTIVE_LAW, SMA.LinearElastic3DLaw())
    for i, place in enumerate(element.nodes.tolist(), start=1):
        part.CreateNewNode(i, *place)
    name = f"SmallDisplacementElement3D{nodes}N"
    cell = part.CreateNewElement(name, 1, list(range(1, nodes + 1)), steel)
    cell.Initialize(part.ProcessInfo)
    places = cell.CalculateOnIntegrationPoints(KM.INTEGRATION_COORDINATES, part.ProcessInfo)
    assert np.abs(element.rule.points[ORDER_OF_POINTS[nodes]] - np.array(places)).max() < 1e-8


def test_steps_of_a_table_and_supports_in_turn_are_those_of_kratos(tmp_path):
    element, law, constants, size = CASES["J2"]
    (tmp_path / "box.mdpa").write_text(box_mdpa().replace("SmallDisplacementElement", element))
    write(tmp_path, materials("Structure.Body", 7850.0, 2e9, 0.3, law, **constants), "materials.json")
    supports = [CLAMP]
    for value, interval in ((f"{size}*t", [0.0, 0.5]), (f"{size / 2}", [0.5, 0.8]), ("0.0", [0.8, "End"])):
        supports.append(
            process("assign_scalar_variable_process", "Structure.Top", "DISPLACEMENT_Z", value=value)
        )
        supports[-1]["Parameters"]["interval"] = interval
    table = {"time_step_table": [[0.05, 0.06], [0.5, 0.15], [0.9, 0.1]]}
    compare(tmp_path, run_file(supports, [], end=1.0, time_stepping=table, **EXACT), 11)


@pytest.mark.parametrize("solver", ["static", "dynamic"])
def test_temperatures_in_time_are_those_of_kratos(tmp_path, solver):
    (tmp_path / "box.mdpa").write_text(box_mdpa())
    own = {"THERMAL_EXPANSION_COEFFICIENT": 1e-5, "REFERENCE_TEMPERATURE": 20.0}
    law = "ThermalElasticIsotropic3D"
    write(tmp_path, materials("Structure.Body", 7850.0, 2e9, 0.3, law, **own), "materials.json")
    hot = "20 + 1000*t*(1 + t)"  # linear elements take the mean temperature of their nodes here
    heat = process("assign_scalar_variable_process", "Structure", "TEMPERATURE", value=hot, constrained=False)
    heat["Parameters"]["interval"] = [0.0, "End"]
    settings = {"auxiliary_variables_list": ["TEMPERATURE"], "step": 0.01, "end": 0.035}
    content = run_file([CLAMP], [heat], solver_type=solver, **settings)
    compare(tmp_path, content, 4)

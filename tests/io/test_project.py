"""Run files: Kratos' ProjectParameters.json with its folder, and our own small one."""

import json
import subprocess
import sys
from importlib.util import find_spec
from itertools import product

import numpy as np
import pytest
from scenes import case, present

import kratos_lite as kl
from kratos_lite.errors import InputError, KratosLiteError, ModelError
from kratos_lite.io.case import Outputs
from kratos_lite.io.files import read_case

N = 3
"""Nodes along each side of the box."""
LENGTHS = (2.0, 1.0, 1.5)


def box_mdpa() -> str:
    """Return a box of eight hexahedra with loaded conditions and parts, as .mdpa text."""
    ids = {key: i for i, key in enumerate(product(range(N), repeat=3), start=1)}
    points = {i: [c * s / (N - 1) for c, s in zip(key, LENGTHS, strict=True)] for key, i in ids.items()}
    corners = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
    cells = [[ids[a + i, b + j, c + k] for i, j, k in corners] for a, b, c in product(range(N - 1), repeat=3)]
    square = ((0, 0), (1, 0), (1, 1), (0, 1))
    pairs = list(product(range(N - 1), repeat=2))
    top = [[ids[a + i, b + j, N - 1] for i, j in square] for a, b in pairs]
    side = [[ids[N - 1, a + i, b + j] for i, j in square] for a, b in pairs]
    tips = [[ids[N - 1, 0, N - 1]], [ids[N - 1, N - 1, N - 1]]]
    faces = list(enumerate(top + side, start=1))
    last = len(faces)

    def block(kind, rows):
        return "\n".join(
            [f"Begin {kind}", *(" ".join(map(str, row)) for row in rows), f"End {kind.split()[0]}", ""]
        )

    def part(name, nodes, elements=(), conditions=()):
        inner = [("Nodes", nodes), ("Elements", elements), ("Conditions", conditions)]
        body = "".join(block(f"SubModelPart{kind}", [[i] for i in rows]) for kind, rows in inner)
        return f"Begin SubModelPart {name}\n{body}End SubModelPart\n"

    bottom = [i for key, i in ids.items() if key[2] == 0]
    return "".join([
        "Begin Properties 0\nEnd Properties\n",
        block("Nodes", [[i, *map(repr, x)] for i, x in points.items()]),
        block("Elements SmallDisplacementElement3D8N", [[i, 0, *c] for i, c in enumerate(cells, start=1)]),
        block("Conditions SmallDisplacementSurfaceLoadCondition3D4N", [[i, 0, *c] for i, c in faces]),
        block("Conditions PointLoadCondition3D1N", [[last + i, 0, *c] for i, c in enumerate(tips, start=1)]),
        part("Body", ids.values(), range(1, len(cells) + 1)),
        part("Bottom", bottom),
        part("Top", sorted({n for c in top for n in c}), conditions=range(1, len(top) + 1)),
        part("Side", sorted({n for c in side for n in c}), conditions=range(len(top) + 1, last + 1)),
        part("Tips", [n for c in tips for n in c], conditions=[last + 1, last + 2]),
    ])  # fmt: skip


def process(module, part, variable, **settings):
    parameters = {"model_part_name": part, "variable_name": variable, **settings}
    return {"python_module": module, "kratos_module": "KratosMultiphysics", "Parameters": parameters}


MATERIALS = {
    "properties": [
        {
            "model_part_name": "Structure.Body",
            "properties_id": 1,
            "Material": {
                "constitutive_law": {"name": "LinearElastic3DLaw"},
                "Variables": {"DENSITY": 7850.0, "YOUNG_MODULUS": 2e9, "POISSON_RATIO": 0.3},
                "Tables": {},
            },
        }
    ]
}


def run_file(constraints, loads, *, step=1.1, end=1.0, checks=(), outputs=None, **solver):
    return {
        "problem_data": {
            "problem_name": "box",
            "parallel_type": "OpenMP",
            "start_time": 0.0,
            "end_time": end,
            "echo_level": 0,
        },
        "solver_settings": {
            "solver_type": "static",
            "model_part_name": "Structure",
            "domain_size": 3,
            "echo_level": 0,
            "analysis_type": "linear",
            "model_import_settings": {"input_type": "mdpa", "input_filename": "box"},
            "material_import_settings": {"materials_filename": "materials.json"},
            "time_stepping": {"time_step": step},
            "linear_solver_settings": {"solver_type": "skyline_lu_factorization"},
            **solver,
        },
        "processes": {
            "constraints_process_list": constraints,
            "loads_process_list": loads,
            "checks": list(checks),
        },
        "output_processes": outputs or {},
    }


CLAMP = process("assign_vector_variable_process", "Structure.Bottom", "DISPLACEMENT", value=[0.0, 0.0, 0.0])
GRAVITY = process(
    "assign_vector_by_direction_process",
    "Structure",
    "VOLUME_ACCELERATION",
    constrained=False,
    modulus=9.81,
    direction=[0.0, 0.0, -2.0],
)


def push(modulus, direction=(1.0, 0.0, 0.0), **settings):
    return process(
        "assign_vector_by_direction_to_condition_process",
        "Structure.Top",
        "SURFACE_LOAD",
        modulus=modulus,
        direction=list(direction),
        **settings,
    )


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "box.mdpa").write_text(box_mdpa())
    (tmp_path / "materials.json").write_text(json.dumps(MATERIALS))
    return tmp_path


def write(folder, content, name="ProjectParameters.json"):
    path = folder / name
    path.write_text(content if isinstance(content, str) else json.dumps(content, indent=1))
    return path


def solved(folder, content):
    return read_case(write(folder, content)).model.solve()


def by_hand(top=(0.0, 0.0, 0.0), gravity=(0.0, 0.0, 0.0)):
    """Return the model of the box made in Python."""
    mesh = kl.box(cells=(N - 1,) * 3, size=LENGTHS)
    model = kl.Model(mesh, kl.Isotropic3D(E=2e9, nu=0.3, density=7850.0))
    model.fix("z-", "xyz")
    model.add(kl.Traction("z+", top))
    model.add(kl.Gravity(gravity))
    return model


def same_field(result, other):
    """Compare displacements at equal points."""
    order = [np.lexsort(r.mesh.points.round(9).T) for r in (result, other)]
    scale = np.abs(other.displacement()).max()
    assert scale > 0
    np.testing.assert_allclose(
        result.displacement()[order[0]] / scale, other.displacement()[order[1]] / scale, rtol=0, atol=1e-11
    )


# ---- against Kratos itself -----------------------------------------------------------------------

RUN_KRATOS = """
import importlib, json
import KratosMultiphysics as KM
name = "KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis"
model = KM.Model()
parameters = KM.Parameters(open("ProjectParameters.json").read())
importlib.import_module(name).StructuralMechanicsAnalysis(model, parameters).Run()
nodes = model["Structure"].Nodes
found = {
    name: {node.Id: list(node.GetSolutionStepValue(getattr(KM, name))) for node in nodes}
    for name in ("DISPLACEMENT", "REACTION")
}
json.dump(found, open("kratos.json", "w"))
"""

ONE_STEP = run_file(
    [
        process(
            "assign_vector_variable_process",
            "Structure.Bottom",
            "DISPLACEMENT",
            value=["0.001*x*t", 0.0, "0.0005*y^2 if t<2 else 0.0"],
            constrained=[True, True, True],
            interval=[0.0, "End"],
        ),
        process("fix_scalar_variable_process", "Structure.Tips", "DISPLACEMENT_Y", interval=[0.0, "End"]),
    ],
    [
        GRAVITY,
        push("1.0e4*t*(1.0+y)", (3.0, 4.0, 0.0)),
        process(
            "assign_scalar_variable_to_conditions_process",
            "Structure.Side",
            "POSITIVE_FACE_PRESSURE",
            value="1e4*(1+x*z+X-Y*Z)",
        ),
        process(
            "assign_vector_variable_to_conditions_process",
            "Structure.Tips",
            "POINT_LOAD",
            value=[100.0, None, "-50*t"],
        ),
    ],
    checks=[
        {
            "python_module": "json_output_process",
            "kratos_module": "KratosMultiphysics",
            "Parameters": {
                "output_variables": ["DISPLACEMENT", "REACTION"],
                "output_file_name": "reference.json",
                "model_part_name": "Structure",
                "time_frequency": 0.0,
            },
        }
    ],
)
MANY_STEPS = run_file(
    [
        CLAMP,
        # Taken back after the step at 0.25: free in the end.
        process(
            "assign_scalar_variable_process",
            "Structure.Tips",
            "DISPLACEMENT_X",
            value=0.01,
            interval=[0.0, 0.3],
        ),
        {
            "name": "Processes.KratosMultiphysics.AssignScalarVariableProcess",
            "Parameters": {
                "model_part_name": "Structure.Tips",
                "variable_name": "DISPLACEMENT_Y",
                "value": "0.001*t",
                "interval": [0.6, "End"],
            },
        },
    ],
    [
        GRAVITY,
        # Stays at its last value, that of t = 0.5.
        push("1e5*t", (0.0, 1.0, 0.0), interval=[0.0, 0.5]),
        # The first process of the list wins over none: it never acts again after the start.
        process(
            "assign_vector_variable_to_conditions_process",
            "Structure.Side",
            "SURFACE_LOAD",
            value=["1e3*t", 0.0, 0.0],
            interval=[0.9, 0.95],
        ),
        process(
            "assign_scalar_variable_process",
            "Structure.Side",
            "NEGATIVE_FACE_PRESSURE",
            value="1e3+1e4*t",
            constrained=False,
            interval=[0.0, 0.0],
        ),
    ],
    step=0.25,
    move_mesh_flag=False,
)


@pytest.mark.skipif(
    find_spec("KratosMultiphysics") is None
    or find_spec("KratosMultiphysics.StructuralMechanicsApplication") is None,
    reason="Kratos is not installed",
)
@pytest.mark.parametrize("content", [ONE_STEP, MANY_STEPS], ids=["one step", "four steps"])
def test_the_same_folder_runs_in_kratos_and_here(folder, content):
    path = write(folder, content)
    run = subprocess.run(
        [sys.executable, "-c", RUN_KRATOS], cwd=folder, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-2000:]
    expected = json.loads((folder / "kratos.json").read_text())
    project = read_case(path)
    result = project.model.solve()
    for name, found in (("DISPLACEMENT", result.displacement()), ("REACTION", result.reaction())):
        reference = np.array([expected[name][str(i)] for i in result.mesh.node_ids])
        scale = np.abs(reference).max()
        assert scale > 0
        np.testing.assert_allclose(found / scale, reference / scale, rtol=0, atol=1e-10)
    if content is ONE_STEP:
        check = {
            "python_module": "from_json_check_result_process",
            "kratos_module": "KratosMultiphysics",
            "Parameters": {
                "check_variables": ["DISPLACEMENT", "REACTION_Z"],
                "input_file_name": "reference.json",
                "model_part_name": "Structure",
                "tolerance": 1e-9,
                "relative_tolerance": 1e-8,
            },
        }
        lines = read_case(write(folder, content | {"processes": {**content["processes"], "checks": [check]}}))
        assert [line.split()[4] for line in lines.compare(result)] == ["passed"] * 4


def test_nodal_point_load_acts_once_where_faces_share_the_node(folder):
    load = process("assign_scalar_variable_process", "Tips", "POINT_LOAD_Y", value=7.0, constrained=False)
    report = solved(folder, run_file([CLAMP], [load])).report
    np.testing.assert_allclose(report.total_load, [0.0, 14.0, 0.0], atol=1e-12)


# ---- real files ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "part", "component", "expected"),
    [
        row
        for row in (
            ("bar_8N", "Pulled", "DISPLACEMENT_X", 8e-3),
            ("patch_3D_shear_hexa", "SurfaceLoad3D_Load_on_surfaces_Auto", "DISPLACEMENT_Y", 7.8e-3),
            ("patch_3D_tension_tetra", "SurfaceLoad3D_Load_on_surfaces_Auto", "DISPLACEMENT_X", 2.73e-3),
        )
        if present(row[0])
    ],
)
def test_2019_folder_runs_and_its_own_check_passes(name, part, component, expected):
    project = read_case(case(name) / "ProjectParameters.json")
    (line,) = project.compare(project.model.solve())
    assert line.startswith(f"check {component} on {part}")
    assert (
        f"passed (node {line.split('node ')[1].split(':')[0]}: found {expected:g}, expected {expected:g}"
        in line
    )
    assert any("beside the run file is read" in note for note in project.model.notes)
    assert any("analysis_type is non_linear" in note for note in project.model.notes)
    assert any(note.endswith("those at t = 1.1 s") for note in project.model.notes)


def test_cantilever_beam_runs_as_kratos_computed_it(shared):
    folder = shared / "cases" / "response_cantilever_beam_8N"
    project = read_case(folder / "adjoint_max_stress_primal_parameters.json")
    found = project.model.solve()
    hand = kl.Model(project.model.mesh, kl.Isotropic3D(E=206.9e9, nu=0.29, density=7850.0))
    hand.fix("DISPLACEMENT_support", "xyz")
    hand.add(kl.PointLoad("PointLoad3D_load_point", (0.0, -1e4, 0.0)))
    np.testing.assert_allclose(found.displacement(), hand.solve().displacement(), rtol=0, atol=1e-17)


def test_a_law_that_is_not_linear_is_refused_by_name_and_part(folder):
    law = {"name": "SmallStrainIsotropicPlasticityFactory", "yield_surface": "VonMises"}
    body = MATERIALS["properties"][0]
    body = body | {"Material": body["Material"] | {"constitutive_law": law}}
    (folder / "materials.json").write_text(json.dumps({"properties": [body]}))
    with pytest.raises(InputError, match=r"materials.json:\d+:\d+: part Structure.Body: 'SmallStrainIso"):
        read_case(write(folder, run_file([CLAMP], [])))


def test_a_solver_of_eigenvalues_is_refused(folder):
    content = run_file([CLAMP], [], solver_type="eigen_value", eigensolver_settings={"solver_type": "feast"})
    with pytest.raises(InputError, match="solver_type 'eigen_value': run files are solved as"):
        read_case(write(folder, content))


def test_a_run_without_supports_and_with_unknown_settings_is_read_and_refused_when_solved(folder):
    content = run_file([], []) | {"rve_settings": {"perturbation": 1e-6}}
    del content["processes"]
    project = read_case(write(folder, content))
    assert "key 'rve_settings' is not used" in project.model.notes
    with pytest.raises(ModelError, match="rigid-body modes"):
        project.model.solve()


def test_plastic_law_is_refused_by_name_and_part(shared):
    with pytest.raises(
        InputError, match=r"StructuralMaterials.json:\d+:\d+: part Parts_Central: 'SmallStrainIso"
    ):
        read_case(shared / "cases" / "tensile_hexahedra" / "ProjectParameters.json")


def test_eigenvalue_run_is_refused(shared):
    with pytest.raises(InputError, match="solver_type 'eigen_value': run files are solved as"):
        read_case(shared / "cases" / "eigen_cube_8N" / "Eigen_TL_3D8N_Cube_test_parameters.json")


def test_run_without_supports_is_read_and_refused_when_solved(shared):
    project = read_case(shared / "cases" / "rve_4N_pressure" / "smallest_rve_test_parameters.json")
    assert "key 'rve_settings' is not used" in project.model.notes
    with pytest.raises(ModelError, match="rigid-body modes"):
        project.model.solve()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("61", "trailing comma"),
        ("62", "NaN is not a number"),
        ("63", "duplicate key 'E'"),
        ("64", "unknown key 'sovler'. Did you mean solver?"),
        ("65", "tolerance must be a number; got '1e-8'"),
        ("66", "leaves the folder"),
        ("67", "nesting deeper than 64"),
        ("68", "there is no file"),
        ("69", "is a folder"),
        ("70", "integer of 5001 digits is too long"),
    ],
)
def test_malformed_run_file_is_refused_with_the_problem(malformed, name, words):
    (path,) = malformed.glob(f"{name}_*.json")
    with pytest.raises(InputError) as caught:
        read_case(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}:1:")


def test_small_good_run_file_is_read(malformed):
    project = read_case(malformed / "60_good.json")
    assert project.solver == "direct"
    assert project.model.mesh.n_elements == 1


# ---- the style of Kratos -------------------------------------------------------------------------


def test_part_names_need_no_root_and_mesh_id_is_ignored(folder):
    old = process("assign_vector_variable_process", "Bottom", "DISPLACEMENT", value=[0.0] * 3, mesh_id=0)
    load = push(1e5) | {"help": "text", "process_name": "AnyName"}
    load["Parameters"] = load["Parameters"] | {"model_part_name": "Top"}
    same_field(solved(folder, run_file([old], [load])), by_hand(top=(1e5, 0.0, 0.0)).solve())


def test_a_later_process_replaces_the_value_of_an_earlier_one(folder):
    result = solved(folder, run_file([CLAMP], [push(9e9), push(1e5)]))
    same_field(result, by_hand(top=(1e5, 0.0, 0.0)).solve())


def test_lists_of_processes_act_in_alphabetical_order(folder):
    content = run_file([CLAMP], [push(1e5)])
    content["processes"]["z_list"] = [push(2e5)]
    content["processes"]["a_list"] = [push(9e9)]
    same_field(solved(folder, content), by_hand(top=(2e5, 0.0, 0.0)).solve())


def test_null_leaves_a_component_and_constrained_false_leaves_it_free(folder):
    value = process(
        "assign_vector_variable_process", "Structure.Top", "DISPLACEMENT", value=[None, 0.001, 0.002]
    )
    value["Parameters"]["constrained"] = [True, False, True]
    model = read_case(write(folder, run_file([CLAMP, value], []))).model
    top = model.mesh.part("Top").nodes
    np.testing.assert_array_equal(model.supports.fixed[top], [[False, False, True]] * len(top))
    np.testing.assert_array_equal(model.supports.values[top, 2], 0.002)


def test_a_process_outside_its_interval_does_nothing_and_is_noted(folder):
    project = read_case(write(folder, run_file([CLAMP], [GRAVITY, push(1e9, interval=[5.0, 6.0])])))
    assert "processes.loads_process_list[1]: SURFACE_LOAD_X is never set: its interval holds no step" in (
        project.model.notes
    )
    same_field(project.model.solve(), by_hand(gravity=(0.0, 0.0, -9.81)).solve())


def test_the_root_model_part_stands_for_all(folder):
    materials = json.loads(json.dumps(MATERIALS))
    materials["properties"][0]["model_part_name"] = "Structure"
    write(folder, materials, "materials.json")
    same_field(solved(folder, run_file([CLAMP], [GRAVITY])), by_hand(gravity=(0.0, 0.0, -9.81)).solve())


def test_material_variables_that_are_not_used_are_noted(folder):
    materials = json.loads(json.dumps(MATERIALS))
    materials["properties"][0]["Material"]["Variables"]["YIELD_STRESS"] = 1e6
    write(folder, materials, "materials.json")
    project = read_case(write(folder, run_file([CLAMP], [GRAVITY])))
    assert "Properties 1: YIELD_STRESS not used by a static solution of solids" in project.model.notes


def test_unknown_settings_are_noted_and_outputs_are_not_run(folder):
    vtk = {"python_module": "vtk_output_process", "Parameters": {}}
    content = run_file([CLAMP], [GRAVITY], outputs={"vtk": [vtk]}, shiny_setting=3)
    notes = read_case(write(folder, content)).model.notes
    assert any(note.startswith("solver setting 'shiny_setting' is not used.") for note in notes)
    assert "linear solver skyline_lu_factorization: kratos_lite chooses its own" in notes
    assert any(note.startswith("output_processes.vtk[0]: vtk_output_process is not run") for note in notes)


def check(**settings):
    return process("check_scalar_to_nodes_process", "Structure.Bottom", "DISPLACEMENT_X", **settings)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"value": 0.0}, "DISPLACEMENT_X on Structure.Bottom passed"),
        ({"value": 0.4999e-3}, "passed"),
        ({"value": 0.5001e-3}, "failed (node 1: found 0, expected 0.0005001, tolerance 0.0005)"),
        ({"value": 0.6e-6, "tolerance_rank": 6}, "failed"),
        ({"value": "0.001*x**2", "tolerance_rank": 6}, "failed (node 19: found 0, expected 0.004"),
        ({"value": "log(1)", "interval": [0.0, 1.1]}, "not evaluated: time 1.1 s is outside its interval"),
        (
            {"value": 0.0, "variable_name": "TEMPERATURE"},
            "not evaluated: kratos_lite has no nodal TEMPERATURE",
        ),
    ],
)
def test_expected_values_are_compared_as_kratos_does(folder, settings, words):
    project = read_case(write(folder, run_file([CLAMP], [GRAVITY], checks=[check(**settings)])))
    (line,) = project.compare(project.model.solve())
    assert line.startswith("check ")
    assert words in line


def test_expected_values_of_a_missing_file_are_reported(folder):
    entry = {
        "python_module": "from_json_check_result_process",
        "Parameters": {"input_file_name": "none.json", "model_part_name": "Structure"},
    }
    project = read_case(write(folder, run_file([CLAMP], [GRAVITY], checks=[entry])))
    (line,) = project.compare(project.model.solve())
    assert line.startswith("check against none.json not evaluated: ")


def file_check(**settings):
    parameters = {"input_file_name": "reference.json", "model_part_name": "Structure", **settings}
    return {"python_module": "from_json_check_result_process", "Parameters": parameters}


@pytest.mark.parametrize(
    ("content", "settings", "words"),
    [
        ({"TIME": [1.1]}, {}, "key 'NODE_1' is missing"),
        ({"TIME": [0.5]}, {}, "the file has no values at time 1.1 s"),
        (
            {"TIME": [1.1], "NODE_1": {"DISPLACEMENT_X": []}},
            {"model_part_name": "One"},
            "one number for each TIME",
        ),
        (
            {"TIME": [1.0, 2.0], "NODE_1": {"DISPLACEMENT_X": [0.0, 10.0]}},
            {"model_part_name": "Structure", "sub_model_part_name": "One"},
            "failed (node 1: found 0, expected 1, tolerance 0.001)",
        ),
        (
            {"TIME": [1.0, 2.0], "NODE_1": {"DISPLACEMENT_X": [0.0, 10.0]}},
            {"model_part_name": "One", "relative_tolerance": 1.0},
            "passed (node 1: found 0, expected 1, tolerance 1)",
        ),
        (
            {},
            {"check_variables": [], "gauss_points_check_variables": ["PK2"]},
            "values at Gauss points are not",
        ),
        ({}, {"model_part_name": "None"}, "its part has no nodes"),
    ],
)
def test_expected_values_of_a_file_are_compared_at_the_last_time(folder, content, settings, words):
    parts = "Begin SubModelPart One\nBegin SubModelPartNodes\n1\nEnd SubModelPartNodes\nEnd SubModelPart\n"
    parts += "Begin SubModelPart None\nEnd SubModelPart\n"
    (folder / "box.mdpa").write_text(box_mdpa() + parts)
    write(folder, content, "reference.json")
    entry = file_check(**{"check_variables": ["DISPLACEMENT_X"], **settings})
    project = read_case(write(folder, run_file([CLAMP], [GRAVITY], checks=[entry])))
    (line,) = project.compare(project.model.solve())
    assert words in line


def test_expected_values_count_places_from_the_deformed_body_unless_told(folder):
    lift = process("assign_scalar_variable_process", "Top", "DISPLACEMENT_Z", value=0.5)
    entries = [
        process(
            "check_scalar_to_nodes_process",
            "Top",
            "DISPLACEMENT_Z",
            value=f"0.5 + z - {z}",
            reference_conf=reference,
        )
        for z, reference in ((2.0, False), (1.5, True))
    ]
    project = read_case(write(folder, run_file([CLAMP, lift], [], checks=entries)))
    assert [line.split()[4] for line in project.compare(project.model.solve())] == ["passed"] * 2


def test_constraints_are_left_out_with_a_note_when_the_run_file_says_so(folder):
    row = "Begin Constraints LinearMasterSlaveConstraint DISPLACEMENT_X DISPLACEMENT_X\n1 0.0 [1.0] 27 26\n"
    (folder / "box.mdpa").write_text(box_mdpa() + row + "End Constraints\n")
    kept = read_case(write(folder, run_file([CLAMP], []))).model
    left = read_case(write(folder, run_file([CLAMP], [], multi_point_constraints_used=False))).model
    assert (len(kept.supports.constraints), len(left.supports.constraints)) == (1, 0)
    assert "multi_point_constraints_used is false: 1 constraints left out" in left.notes


def test_an_impossible_material_of_the_mesh_file_is_placed(folder):
    text = box_mdpa().replace(
        "Begin Properties 0\n", "Begin Properties 0\nYOUNG_MODULUS 1.0\nPOISSON_RATIO 0.5\n"
    )
    start = text.index("Begin SubModelPartElements")
    (folder / "box.mdpa").write_text(text[:start] + text[start:].replace("\n8\n", "\n", 1))
    with pytest.raises(InputError, match=r"box\.mdpa:1: Properties 0: .* must be < 0.5"):
        read_case(write(folder, run_file([CLAMP], [])))


def changed(**solver):
    return run_file([CLAMP], [GRAVITY], **solver)


def no_end():
    content = changed()
    del content["problem_data"]["end_time"]
    return content


def processes(*entries, key="loads_process_list"):
    content = changed()
    content["processes"][key] = list(entries)
    return content


def misplaced():
    content = changed()
    return {**content, "loads_process_list": []}


def in_time(*constraints):
    return run_file([CLAMP, *constraints], [GRAVITY], step=0.1, solver_type="dynamic")


BAD = {
    "explicit": (
        changed(solver_type="Dynamic", time_integration_method="explicit"),
        "time_integration_method 'explicit' is not supported: take 'implicit' with 'newmark'",
    ),
    "scheme": (changed(solver_type="dynamic", scheme_type="bdf2"), "scheme_type 'bdf2' is not supported"),
    "Bossak's number": (
        changed(solver_type="dynamic", damp_factor_m=0.5),
        "the α of Bossak lies in -1/3 … 0",
    ),
    "Newmark's number": (changed(solver_type="dynamic", newmark_beta=0.0), "newmark_beta must be 0.25"),
    "damping": (changed(solver_type="dynamic", rayleigh_beta=-1.0), "rayleigh_beta must be ≥ 0"),
    "late start": (
        {**changed(solver_type="dynamic"), "problem_data": {"start_time": 0.5, "end_time": 1.0}},
        "start_time must be 0 for dynamic solutions",
    ),
    "fixed velocity": (
        in_time(process("assign_scalar_variable_process", "Top", "VELOCITY_X", value=1.0)),
        "VELOCITY_X cannot be fixed",
    ),
    "given acceleration": (
        in_time(
            process(
                "assign_scalar_variable_process",
                "Top",
                "ACCELERATION_X",
                value=1.0,
                constrained=False,
                interval=[0.0, 0.0],
            )
        ),
        "ACCELERATION_X cannot be given",
    ),
    "support that ends": (
        in_time(process("assign_scalar_variable_process", "Top", "DISPLACEMENT_X", interval=[0.0, 0.5])),
        "DISPLACEMENT_X is held in a part of the run only",
    ),
    "support that begins": (
        in_time(process("fix_scalar_variable_process", "Top", "DISPLACEMENT_X", interval=[0.5, "End"])),
        "DISPLACEMENT_X is held in a part of the run only",
    ),
    "support by place and time": (
        in_time(process("assign_scalar_variable_process", "Top", "DISPLACEMENT_X", value="t*X")),
        "a support may move with x, y, z or with t, not with both",
    ),
    "two dimensions": (changed(domain_size=2), "domain_size must be 3; got 2"),
    "domain size as text": (
        changed(domain_size="3"),
        "solver_settings.domain_size must be an integer; got '3'",
    ),
    "analysis": (changed(analysis_type="quadratic"), "must be 'linear' or 'non_linear'"),
    "other physics": (changed(displacement_control=True), "displacement_control is not supported"),
    "endless": (changed(step=0.0), "time_step must be > 0 s"),
    "too many steps": (changed(step=1e-9), "more than 1000000 steps"),
    "no step": (changed(end=0.0), "no step is solved"),
    "no end": (no_end(), "key 'problem_data.end_time' is missing"),
    "no mesh": (
        changed(model_import_settings={"input_type": "mdpa", "input_filename": "bix"}),
        "there is no file",
    ),
    "mesh elsewhere": (changed(model_import_settings={"input_filename": "../box"}), "leaves the folder"),
    "mesh at the root": (changed(model_import_settings={"input_filename": "/box"}), "leaves the folder"),
    "mesh from a modeler": (
        changed(model_import_settings={"input_type": "use_input_model_part"}),
        "input_type 'use_input_model_part' is not supported",
    ),
    "misplaced list": (misplaced(), "belongs in the object 'processes'"),
    "unknown process": (
        processes({"python_module": "assign_vector_variable_proces", "Parameters": {}}),
        "unknown process 'assign_vector_variable_proces'. Did you mean assign_vector_variable_process",
    ),
    "no module": (processes({"Parameters": {}}), "python_module' is missing"),
    "no parameters": (processes({"python_module": "fix_vector_variable_process"}), "Parameters' is missing"),
    "unknown part": (
        processes(process("fix_vector_variable_process", "Structure.Botom", "DISPLACEMENT")),
        "there is no part 'Structure.Botom'. Did you mean Bottom?",
    ),
    "unknown variable": (
        processes(process("fix_vector_variable_process", "Bottom", "DISPLACMENT")),
        "'DISPLACMENT' is not a vector variable of static solids. Did you mean DISPLACEMENT?",
    ),
    "vector for scalar": (
        processes(process("assign_scalar_variable_process", "Bottom", "DISPLACEMENT", value=0.0)),
        "'DISPLACEMENT' is not a scalar variable",
    ),
    "unknown parameter": (processes(push(1.0, modulos=2.0)), "Parameters.modulos'. Did you mean modulus?"),
    "local axes": (processes(push(1.0, local_axes={"axes": []})), "local_axes are not supported"),
    "zero direction": (processes(push(1.0, (0.0, 0.0, 0.0))), "direction is zero"),
    "two directions": (processes(push(1.0, (0.0, 1.0))), "direction must be a list of three entries"),
    "automatic normal": (
        processes(
            process(
                "assign_vector_by_direction_to_condition_process",
                "Top",
                "SURFACE_LOAD",
                modulus=1.0,
                direction="automatic_inwards_normal",
            )
        ),
        "automatic normals are not supported",
    ),
    "bad modulus": (processes(push(True)), "modulus must be a number or an expression"),
    "bad expression": (processes(push("open('x')")), """SURFACE_LOAD_X: expression "open('x')":"""),
    "endless value": (processes(push("1/x")), "SURFACE_LOAD_X: expression '1/(x-x)'"),
    "bad interval": (
        processes(push(1.0, interval=[0.0, "Ende"])),
        'interval must be [number, number or "End"]',
    ),
    "bad constrained": (
        processes(process("fix_vector_variable_process", "Bottom", "DISPLACEMENT", constrained="yes")),
        "constrained must be true, false",
    ),
    "history": (
        processes(process("fix_vector_variable_process", "Top", "DISPLACEMENT", interval=[0.6, "End"]))
        | {"solver_settings": changed(step=0.25)["solver_settings"]},
        "held only from a later step",
    ),
}
BAD["endless value"] = (processes(push("1/(x-x)")), BAD["endless value"][1])


@pytest.mark.parametrize("name", BAD)
def test_bad_kratos_run_file_is_refused_with_place_and_problem(folder, name):
    content, words = BAD[name]
    path = write(folder, content)
    with pytest.raises(InputError) as caught:
        read_case(path)
    assert words in str(caught.value)
    line = int(str(caught.value).removeprefix(f"{path}:").split(":")[0])
    assert 1 <= line <= len(path.read_text().splitlines())


def test_files_outside_the_folder_are_read_only_when_allowed(folder):
    inner = folder / "runs"
    inner.mkdir()
    content = changed(
        model_import_settings={"input_type": "mdpa", "input_filename": "../box"},
        material_import_settings={"materials_filename": str(folder / "materials.json")},
    )
    path = write(inner, content)
    with pytest.raises(InputError, match="leaves the folder"):
        read_case(path)
    result = read_case(path, allow_outside=True).model.solve()
    same_field(result, by_hand(gravity=(0.0, 0.0, -9.81)).solve())


def bad_material(**changes):
    entry = json.loads(json.dumps(MATERIALS["properties"][0]))
    variables = changes.pop("variables", None)
    entry["Material"] |= changes.pop("material", {})
    entry |= changes
    if variables:
        entry["Material"]["Variables"] = variables
    return {"properties": [entry]}


BAD_MATERIALS = {
    "no list": ({"materials": []}, "needs a list of 'properties'"),
    "part without elements": (
        bad_material(model_part_name="Structure.Bottom"),
        "has no elements to carry a material; parts with elements are Structure (all), Body",
    ),
    "unknown part": (bad_material(model_part_name="Structure.Bodi"), "Did you mean Body?"),
    "unknown law": (
        bad_material(material={"constitutive_law": {"name": "HyperElastic3DLaw"}}),
        "part Structure.Body: 'HyperElastic3DLaw' is not a linear elastic law",
    ),
    "no law": (bad_material(material={"constitutive_law": {}}), "constitutive_law.name' is missing"),
    "text for E": (
        bad_material(variables={"YOUNG_MODULUS": "steel"}),
        "YOUNG_MODULUS must be a number; got 'steel'",
    ),
    "no nu": (
        bad_material(variables={"YOUNG_MODULUS": 1e9}),
        "part Structure.Body: Isotropic3D needs POISSON_RATIO",
    ),
    "nu of a fluid": (
        bad_material(variables={"YOUNG_MODULUS": 1e9, "POISSON_RATIO": 0.5}),
        "POISSON_RATIO) 0.5 must be < 0.5",
    ),
    "layers": (
        bad_material(material={"sub_properties": [1]}),
        "'sub_properties' in a material is not supported",
    ),
}


@pytest.mark.parametrize("name", BAD_MATERIALS)
def test_bad_materials_file_is_refused_with_place_and_problem(folder, name):
    content, words = BAD_MATERIALS[name]
    path = write(folder, content, "materials.json")
    with pytest.raises(InputError) as caught:
        read_case(write(folder, changed()))
    assert words in str(caught.value)
    line = int(str(caught.value).removeprefix(f"{path}:").split(":")[0])
    assert 1 <= line <= len(path.read_text().splitlines())


def test_elements_without_material_are_named(folder):
    text = box_mdpa().replace("Begin SubModelPart Body\n", "Begin SubModelPart Half\n")
    start = text.index("Begin SubModelPartElements")
    text = text[:start] + text[start:].replace("\n8\n", "\n", 1)
    (folder / "box.mdpa").write_text(text)
    write(folder, bad_material(model_part_name="Half"), "materials.json")
    with pytest.raises(ModelError, match=r"element 8 \(SmallDisplacementElement3D8N\) has no material"):
        read_case(write(folder, changed()))


def test_a_later_material_takes_the_elements_of_an_earlier_one(folder):
    first, second = bad_material(properties_id=7)["properties"], bad_material()["properties"]
    first[0]["Material"]["Variables"] = {"YOUNG_MODULUS": 1.0, "POISSON_RATIO": 0.0}
    write(folder, {"properties": first + second}, "materials.json")
    same_field(solved(folder, changed()), by_hand(gravity=(0.0, 0.0, -9.81)).solve())


def test_a_material_of_the_mesh_file_serves_elements_that_the_materials_file_leaves_out(folder):
    steel = "YOUNG_MODULUS 2e9\nPOISSON_RATIO 0.3\nDENSITY 7850\n"
    text = box_mdpa().replace("Begin Properties 0\n", "Begin Properties 0\n" + steel)
    start = text.index("Begin SubModelPartElements")
    (folder / "box.mdpa").write_text(text[:start] + text[start:].replace("\n8\n", "\n", 1))
    same_field(solved(folder, changed()), by_hand(gravity=(0.0, 0.0, -9.81)).solve())


def spots(value, path=()):
    """Yield the path of every value inside a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from spots(inner, (*path, key))


def replaced(content, path, junk):
    content = json.loads(json.dumps(content))
    owner = content
    for key in path[:-1]:
        owner = owner[key]
    owner[path[-1]] = junk
    return content


CHECKED = run_file(
    [CLAMP],
    [GRAVITY],
    checks=[
        process("check_vector_components_to_nodes_process", "Bottom", "DISPLACEMENT", value=[0, None, "x"]),
        {
            "python_module": "from_json_check_result_process",
            "Parameters": {
                "check_variables": ["DISPLACEMENT"],
                "input_file_name": "reference.json",
                "model_part_name": "Bottom",
                "tolerance": 1.0,
            },
        },
    ],
)
OWN = {
    "model": "box.mdpa",
    "material": {"Body": {"E": 2e9, "nu": 0.3}},
    "fix": {"Bottom": "xyz", "Top": {"x": 0.1}},
    "gravity": [0, 0, -9.81],
    "pressure": {"Top": 1.0},
    "solver": {"type": "dense"},
    "json": "a.json",
}
REFERENCE = {"TIME": [1.1], "NODE_1": {"DISPLACEMENT_X": [0.0], "DISPLACEMENT_Y": [0.0]}}


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("ProjectParameters.json", ONE_STEP),
        ("ProjectParameters.json", CHECKED),
        ("materials.json", MATERIALS),
        ("reference.json", REFERENCE),
        ("own.json", OWN),
    ],
    ids=["one step", "checked", "materials", "reference", "own"],
)
def test_any_value_of_a_wrong_kind_ends_in_a_project_or_a_clear_error(folder, name, content):
    write(folder, REFERENCE, "reference.json")
    write(folder, CHECKED)
    run = folder / ("own.json" if name == "own.json" else "ProjectParameters.json")
    result = by_hand().solve()
    paths, refused = list(spots(content)), 0
    for path, junk in product(
        paths, [None, True, -1, 0.5, 1e308, -(10**18), "", "x", "..", [], [[]], {}, {"a": 1}]
    ):
        write(folder, replaced(content, path, junk), name)
        try:
            project = read_case(run)
            if content in (CHECKED, REFERENCE):
                project.compare(result)
        except KratosLiteError as error:
            refused += 1
            assert str(folder) in str(error), (path, junk, str(error))  # noqa: PT017
    assert len(paths) < refused or name == "reference.json"


# ---- our own run files ---------------------------------------------------------------------------

STEEL = {"E": 2e9, "nu": 0.3, "density": 7850.0}


def test_own_run_file_with_all_keys(folder):
    own = {
        "model": "box.mdpa",
        "material": {"law": "Isotropic3D", **STEEL},
        "fix": {"Bottom": {"x": 0.0, "y": 0.0, "z": 0.0}},
        "gravity": [0, 0, -9.81],
        "traction": {"Top": [1e5, 0, 0]},
        "solver": {"type": "dense", "tolerance": 1e-8},
        "output": "out/box.vtu",
        "json": "box_result.json",
        "picture": "box.png",
    }
    project = read_case(write(folder, own, "own.json"))
    assert (project.solver, project.tolerance) == ("dense", 1e-8)
    assert project.outputs == Outputs(
        [str(folder / "out" / "box.vtu")], str(folder / "box_result.json"), str(folder / "box.png")
    )
    assert project.compare(project.model.solve()) == []
    same_field(project.model.solve(), by_hand(top=(1e5, 0.0, 0.0), gravity=(0.0, 0.0, -9.81)).solve())


def test_own_run_file_by_part_with_pressure_and_point_load(folder):
    own = {
        "model": "box.mdpa",
        "material": {"Body": STEEL},
        "fix": {"Bottom": "xyz", "z-": {"x": 0}},
        "pressure": {"Top": 2e4},
        "point_load": {"Tips": [0, 5.0, 0]},
    }
    project = read_case(write(folder, own, "own.json"))
    hand = by_hand(top=(0.0, 0.0, -2e4))
    hand.add(
        kl.PointLoad(lambda X: (X[:, 0] > 1.9) & (X[:, 2] > 1.4) & (np.abs(X[:, 1] - 0.5) > 0.4), (0, 5.0, 0))
    )
    same_field(project.model.solve(), hand.solve())
    assert (project.solver, project.tolerance, project.outputs) == ("auto", 1e-10, Outputs())


BAD_OWN = {
    "no model": ({}, "key 'model' is missing"),
    "model as number": ({"model": 3}, "model must be a string; got 3"),
    "run file as model": ({"model": "own.json"}, "model must be a mesh file"),
    "solver as text": ({"model": "box.mdpa", "solver": "amg"}, "solver must be an object {…}; got 'amg'"),
    "solver type": (
        {"model": "box.mdpa", "solver": {"type": "cg"}},
        "one of auto, dense, direct, amg; got 'cg'",
    ),
    "solver key": ({"model": "box.mdpa", "solver": {"kind": "amg"}}, "unknown key 'solver.kind'"),
    "tolerance": ({"model": "box.mdpa", "tolerance": -1}, "tolerance must lie between 0 and 1"),
    "two tolerances": (
        {"model": "box.mdpa", "tolerance": 1e-8, "solver": {"tolerance": 1e-9}},
        "tolerance is given twice",
    ),
    "steps": ({"model": "box.mdpa", "steps": 3}, "unknown key 'steps'"),
    "absolute picture": (
        {"model": "box.mdpa", "picture": "/box.png"},
        "picture: path '/box.png' leaves the folder",
    ),
    "drive": ({"model": "box.mdpa", "json": "C:\\box.json"}, "leaves the folder"),
    "hidden step up": ({"model": "box.mdpa", "json": "a/../../box.json"}, "leaves the folder"),
    "gravity": ({"model": "box.mdpa", "gravity": [0, 0]}, "gravity must be a list of three numbers"),
    "gravity of truth": (
        {"model": "box.mdpa", "gravity": [0, 0, True]},
        "gravity must be a list of three numbers",
    ),
    "fix number": ({"model": "box.mdpa", "fix": {"Bottom": 1}}, 'fix.Bottom must be axes such as "xz"'),
    "fix axes": ({"model": "box.mdpa", "fix": {"Bottom": "xw"}}, "fix.Bottom: axes must be some of x, y, z"),
    "fix axis": ({"model": "box.mdpa", "fix": {"Bottom": {"w": 1}}}, "unknown key 'fix.Bottom.w'"),
    "fix part": ({"model": "box.mdpa", "fix": {"Botom": "x"}}, "there is no part 'Botom'"),
    "fixed twice": (
        {"model": "box.mdpa", "fix": {"Bottom": "x", "z-": {"x": 0.1}}},
        "fix.z-.x: node 1 along x is prescribed twice",
    ),
    "traction": (
        {"model": "box.mdpa", "traction": {"Top": 5}},
        "traction.Top must be a list of three numbers",
    ),
    "pressure": ({"model": "box.mdpa", "pressure": {"Top": "5"}}, "pressure.Top must be a number; got '5'"),
    "pressure part": ({"model": "box.mdpa", "pressure": {"Topp": 5}}, "there is no part 'Topp'"),
    "law": ({"model": "box.mdpa", "material": {"law": "Isotrop3D"}}, "Did you mean Isotropic3D"),
    "no nu": ({"model": "box.mdpa", "material": {"E": 1}}, "material: Isotropic3D needs nu"),
    "unknown constant": ({"model": "box.mdpa", "material": {"E": 1, "mu": 0}}, "unknown key 'material.mu'"),
    "negative E": ({"model": "box.mdpa", "material": {"E": -1, "nu": 0}}, "must be > 0 Pa"),
    "material part": ({"model": "box.mdpa", "material": {"Bodi": STEEL}}, "there is no part 'Bodi'"),
    "materials file": (MATERIALS, "this is a materials file"),
    "a list": ([], "an object {…} is expected; got list"),
}


@pytest.mark.parametrize("name", BAD_OWN)
def test_bad_own_run_file_is_refused_with_place_and_problem(folder, name):
    content, words = BAD_OWN[name]
    path = write(folder, content, "own.json")
    with pytest.raises(InputError) as caught:
        read_case(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}:")


def test_all_problems_of_an_own_run_file_are_told_together(folder):
    own = {"model": "none.mdpa", "sovler": 1, "tolerance": "x", "output": "/x", "fix": [], "gravity": 1}
    with pytest.raises(InputError) as caught:
        read_case(write(folder, own, "own.json"))
    lines = str(caught.value).splitlines()
    assert [int(line.split("own.json:")[1].split(":")[0]) for line in lines] == [3, 4, 5, 2, 6, 7]


def test_damaged_run_files_end_in_a_project_or_a_clear_error(folder):
    text = json.dumps(ONE_STEP)
    refused = []
    for at in range(0, len(text), 7):
        path = write(folder, text[:at] + text[at + 1 :])
        try:
            read_case(path)
        except KratosLiteError as error:
            refused.append(str(error).startswith(str(folder)))
    assert len(refused) > 100
    assert all(refused)


@pytest.mark.parametrize(("prefix", "count"), [("", 1), ("SmallDisplacement", 0)])
def test_pressures_that_kratos_lets_follow_the_faces_are_noted(folder, prefix, count):
    name = "SurfaceLoadCondition3D4N"
    (folder / "box.mdpa").write_text(box_mdpa().replace(f"SmallDisplacement{name}", prefix + name))
    scalar = "assign_scalar_variable_to_conditions_process"
    pressure = process(scalar, "Structure.Top", "POSITIVE_FACE_PRESSURE", value=1.0)
    notes = read_case(write(folder, run_file([CLAMP], [pressure]))).model.notes
    assert (
        sum(note.startswith(f"{name}: the pressure acts on the undeformed body") for note in notes) == count
    )


@pytest.mark.parametrize(
    ("expression", "step", "moves", "noted"),
    [
        ("1e6*x", 0.4, True, True),
        ("1e6*x", 0.4, False, False),
        ("1e6*x", 1.1, True, False),
        ("1e6*X*exp(t)", 0.4, True, False),
    ],
)
def test_expressions_that_kratos_evaluates_on_the_moved_mesh_are_noted(
    folder, expression, step, moves, noted
):
    content = run_file([CLAMP], [push(expression)], step=step, move_mesh_flag=moves)
    notes = read_case(write(folder, content)).model.notes
    assert sum("as the steps before moved it" in note for note in notes) == noted
    assert sum("X, Y, Z are 0 on conditions" in note for note in notes) == ("X" in expression)

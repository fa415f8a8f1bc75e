"""Run files of Kratos: real folders, what Kratos computes of them, and the style of their entries."""

import json
import re
from importlib.util import find_spec

import numpy as np
import pytest
from run_files import (
    CLAMP,
    GRAVITY,
    MATERIALS,
    ONE_STEP,
    box_mdpa,
    by_hand,
    process,
    push,
    run_file,
    run_kratos,
    same_field,
    solved,
    write,
)
from scenes import case, present

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError
from kratos_lite.io.files import read_case
from kratos_lite.io.run import prepare

SCALAR, VECTOR_ON_CONDITIONS = (
    "assign_scalar_variable_process",
    "assign_vector_variable_to_conditions_process",
)
LATE = {
    "name": "Processes.KratosMultiphysics.AssignScalarVariableProcess",
    "Parameters": {
        "model_part_name": "Structure.Tips", "variable_name": "DISPLACEMENT_Y",
        "value": "0.001*t", "interval": [0.6, "End"],
    },
}  # fmt: skip
MANY_STEPS = run_file(
    # The first is taken back after the step at 0.25: free in the end.
    [CLAMP, process(SCALAR, "Structure.Tips", "DISPLACEMENT_X", value=0.01, interval=[0.0, 0.3]), LATE],
    [
        GRAVITY,
        # Stays at its last value, that of t = 0.5.
        push("1e5*t", (0.0, 1.0, 0.0), interval=[0.0, 0.5]),
        # The first process of the list wins over none: it never acts again after the start.
        process(
            VECTOR_ON_CONDITIONS, "Structure.Side", "SURFACE_LOAD",
            value=["1e3*t", 0.0, 0.0], interval=[0.9, 0.95],
        ),
        process(
            SCALAR, "Structure.Side", "NEGATIVE_FACE_PRESSURE",
            value="1e3+1e4*t", constrained=False, interval=[0.0, 0.0],
        ),
    ],
    step=0.25,
    move_mesh_flag=False,
)  # fmt: skip


def file_check(**settings):
    parameters = {"input_file_name": "reference.json", "model_part_name": "Structure", **settings}
    return {"python_module": "from_json_check_result_process", "Parameters": parameters}


def compared(folder, content):
    project = read_case(write(folder, content))
    return project.compare(project.model.solve())


@pytest.mark.skipif(
    find_spec("KratosMultiphysics") is None
    or find_spec("KratosMultiphysics.StructuralMechanicsApplication") is None,
    reason="Kratos is not installed",
)
@pytest.mark.parametrize("content", [ONE_STEP, MANY_STEPS], ids=["one step", "four steps"])
def test_the_same_folder_runs_in_kratos_and_here(folder, content):
    path = write(folder, content)
    run_kratos(folder)
    expected = json.loads((folder / "kratos.json").read_text())
    project = read_case(path)
    result = kl.run(project).result
    if project.time is not None:
        for state, step in zip(prepare(read_case(path))[1], expected["steps"], strict=True):
            wanted = np.array([step[str(i)] for i in result.mesh.node_ids])
            assert np.abs(state.u - wanted).max() < 1e-10 * np.abs(wanted).max()
    for name, found in (("DISPLACEMENT", result.displacement()), ("REACTION", result.reaction())):
        reference = np.array([expected[name][str(i)] for i in result.mesh.node_ids])
        scale = np.abs(reference).max()
        assert scale > 0
        np.testing.assert_allclose(found / scale, reference / scale, rtol=0, atol=1e-10)
    if content is ONE_STEP:
        variables = ["DISPLACEMENT", "REACTION_Z"]
        check = file_check(check_variables=variables, tolerance=1e-9, relative_tolerance=1e-8)
        lines = compared(folder, content | {"processes": {**content["processes"], "checks": [check]}})
        assert [line.split()[4] for line in lines] == ["passed"] * 4


def test_nodal_point_load_acts_once_where_faces_share_the_node(folder):
    load = process(SCALAR, "Tips", "POINT_LOAD_Y", value=7.0, constrained=False)
    report = solved(folder, run_file([CLAMP], [load])).report
    np.testing.assert_allclose(report.total_load, [0.0, 14.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "part", "component", "expected"),
    [
        row
        for row in (
            ("bar_8N", "Pulled", "DISPLACEMENT_X", 0.00798403989),
            ("patch_3D_shear_hexa", "SurfaceLoad3D_Load_on_surfaces", "DISPLACEMENT_Y", 0.00779997846),
            (
                "patch_3D_tension_tetra",
                "SurfaceLoad3D_Load_on_surfaces",
                "DISPLACEMENT_X",
                2.73106512e-3,
            ),
        )
        if present(row[0])
    ],
)
def test_2019_folder_runs_and_its_own_check_passes(name, part, component, expected):
    """Loads follow the faces: as in Kratos 10.4.4, and of the bar ε = t/E (1 - ν ε)²."""
    project = read_case(case(name) / "ProjectParameters.json")
    (line,) = project.compare(project.model.solve())
    assert line.startswith(f"check {component} on {part}")
    found = re.search(r"passed \(node \d+: found (\S+),", line)
    assert found
    assert abs(float(found[1]) - expected) < 1e-9 * expected + 1e-11
    assert any("beside the run file is read" in note for note in project.model.notes)


def test_files_are_found_from_a_folder_above_where_kratos_is_started(folder, monkeypatch):
    (folder / "small").mkdir()
    text = json.dumps(ONE_STEP).replace('"box"}', f'"{folder.name}/box"}}')
    text = text.replace("materials.json", f"{folder.name}/materials.json")
    path = write(folder / "small", text)
    notes = read_case(path).model.notes
    for name in ("box.mdpa", "materials.json"):
        assert f"{folder.name}/{name} is not there; {folder / name} is read" in notes
    path.write_text(text.replace(folder.name, "elsewhere"))
    (folder / "elsewhere").mkdir()
    for name in ("box.mdpa", "materials.json"):
        (folder / name).rename(folder / "elsewhere" / name)
    with pytest.raises(InputError, match="there is no such file"):
        read_case(path)
    monkeypatch.chdir(folder)  # the path does not lead through the folder of the run file
    assert read_case(path).model.mesh.n_elements == 8
    monkeypatch.chdir(folder / "elsewhere")  # which is not above
    with pytest.raises(InputError, match="there is no such file"):
        read_case(path)


def test_cantilever_beam_runs_as_kratos_computed_it(shared):
    folder = shared / "cases" / "response_cantilever_beam_8N"
    project = read_case(folder / "adjoint_max_stress_primal_parameters.json")
    found = project.model.solve()
    hand = kl.Model(project.model.mesh, kl.Isotropic3D(E=206.9e9, nu=0.29, density=7850.0))
    hand.fix("DISPLACEMENT_support", "xyz")
    hand.add(kl.PointLoad("PointLoad3D_load_point", (0.0, -1e4, 0.0), each=True))
    np.testing.assert_allclose(found.displacement(), hand.solve().displacement(), rtol=0, atol=1e-17)


def test_a_run_without_supports_and_with_unknown_keys_is_read_and_refused_when_solved(folder):
    content = run_file([], []) | {"my_settings": {"perturbation": 1e-6}}
    del content["processes"]
    project = read_case(write(folder, content))
    assert "key 'my_settings' is not used" in project.model.notes
    with pytest.raises(ModelError, match="rigid-body modes"):
        project.model.solve()


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
    given = {"value": [None, 0.001, 0.002], "constrained": [True, False, True]}
    value = process("assign_vector_variable_process", "Structure.Top", "DISPLACEMENT", **given)
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


def test_the_root_model_part_stands_for_all_and_unused_variables_are_noted(folder):
    materials = json.loads(json.dumps(MATERIALS))
    materials["properties"][0]["model_part_name"] = "Structure"
    materials["properties"][0]["Material"]["Variables"]["YIELD_STRESS"] = 1e6
    write(folder, materials, "materials.json")
    model = read_case(write(folder, run_file([CLAMP], [GRAVITY]))).model
    same_field(model.solve(), by_hand(gravity=(0.0, 0.0, -9.81)).solve())
    assert "Properties 1: YIELD_STRESS not used by a static solution of solids" in model.notes


def test_processes_that_change_nothing_are_not_run(folder):
    timer = {"python_module": "timer_process", "Parameters": {}}
    content = run_file([CLAMP], [GRAVITY], outputs={"timer": [timer]})
    notes = read_case(write(folder, content)).model.notes
    assert "linear solver skyline_lu_factorization: kratos_lite chooses its own" in notes
    assert "output_processes.timer[0]: timer_process is not run" in notes


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
    (line,) = compared(folder, run_file([CLAMP], [GRAVITY], checks=[check(**settings)]))
    assert line.startswith("check ")
    assert words in line


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
            "kratos_lite has no PK2 at Gauss points here",
        ),
        (
            {
                "TIME": [0.0, 2.0],
                "ELEMENT_1": {"CAUCHY_STRESS_VECTOR": {str(i): [[0.0] * 3] * 2 for i in range(8)}},
            },
            {"check_variables": [], "gauss_points_check_variables": ["CAUCHY_STRESS_VECTOR"]}
            | {"model_part_name": "First"},
            "CAUCHY_STRESS_VECTOR has 6 components, 3 in the file",
        ),
        (
            {"TIME": [0.0, 2.0]},
            {"check_variables": [], "gauss_points_check_variables": ["CAUCHY_STRESS_VECTOR"]}
            | {"model_part_name": "None"},
            "its part has no elements",
        ),
        ({}, {"model_part_name": "None"}, "its part has no nodes"),
        ({}, {"input_file_name": "none.json"}, "check against none.json not evaluated: "),
    ],
)
def test_expected_values_of_a_file_are_compared_at_the_last_time(folder, content, settings, words):
    parts = "Begin SubModelPart One\nBegin SubModelPartNodes\n1\nEnd SubModelPartNodes\nEnd SubModelPart\n"
    parts += "Begin SubModelPart None\nEnd SubModelPart\nBegin SubModelPart First\n"
    parts += "Begin SubModelPartElements\n1\nEnd SubModelPartElements\nEnd SubModelPart\n"
    (folder / "box.mdpa").write_text(box_mdpa() + parts)
    write(folder, content, "reference.json")
    entry = file_check(**{"check_variables": ["DISPLACEMENT_X"], **settings})
    (line,) = compared(folder, run_file([CLAMP], [GRAVITY], checks=[entry]))
    assert words in line


def test_expected_values_count_places_from_the_deformed_body_unless_told(folder):
    lift = process(SCALAR, "Top", "DISPLACEMENT_Z", value=0.5)
    at_top = ("check_scalar_to_nodes_process", "Top", "DISPLACEMENT_Z")
    entries = [
        process(*at_top, value=f"0.5 + z - {z}", reference_conf=reference)
        for z, reference in ((2.0, False), (1.5, True))
    ]
    lines = compared(folder, run_file([CLAMP, lift], [], checks=entries))
    assert [line.split()[4] for line in lines] == ["passed"] * 2


def test_constraints_are_left_out_with_a_note_when_the_run_file_says_so(folder):
    row = "Begin Constraints LinearMasterSlaveConstraint DISPLACEMENT_X DISPLACEMENT_X\n1 0.0 [1.0] 27 26\n"
    (folder / "box.mdpa").write_text(box_mdpa() + row + "End Constraints\n")
    kept = read_case(write(folder, run_file([CLAMP], []))).model
    left = read_case(write(folder, run_file([CLAMP], [], multi_point_constraints_used=False))).model
    assert (len(kept.supports.constraints), len(left.supports.constraints)) == (1, 0)
    assert "multi_point_constraints_used is false: 1 constraints omitted" in left.notes


@pytest.mark.parametrize(("prefix", "count"), [("", 1), ("SmallDisplacement", 0)])
def test_pressures_that_kratos_lets_follow_the_faces_are_noted(folder, prefix, count):
    name = "SurfaceLoadCondition3D4N"
    (folder / "box.mdpa").write_text(box_mdpa().replace(f"SmallDisplacement{name}", prefix + name))
    scalar = "assign_scalar_variable_to_conditions_process"
    pressure = process(scalar, "Structure.Top", "POSITIVE_FACE_PRESSURE", value=1.0)
    notes = read_case(write(folder, run_file([CLAMP], [pressure]))).model.notes
    followers = [note for note in notes if note.startswith(f"{name}: the pressure acts on the undeformed")]
    assert len(followers) == count


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

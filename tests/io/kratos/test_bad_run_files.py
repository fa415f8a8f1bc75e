"""Run files of Kratos that are wrong: each mistake is refused with its place."""

import json
from itertools import product

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
    replaced,
    run_file,
    same_field,
    solved,
    spots,
    write,
)

from kratos_lite.errors import InputError, KratosLiteError, ModelError
from kratos_lite.io.files import read_case


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
    "temperature": (
        processes(process("assign_scalar_variable_process", "Top", "TEMPERATURE", value=80.0)),
        "a TEMPERATURE is imposed, but there is no thermal strain",
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
    assert str(caught.value).startswith(f"{path}: ")


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
        "part Structure.Body: Isotropic3D needs nu (POISSON_RATIO)",
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
    assert str(caught.value).startswith(f"{path}: ")


def test_large_deformations_are_not_solved_as_small_ones(folder, run):
    (folder / "box.mdpa").write_text(box_mdpa().replace("SmallDisplacementElement", "TotalLagrangianElement"))
    with pytest.raises(InputError, match=r"TotalLagrangianElement3D8N with 'non_linear'.*set 'linear'"):
        read_case(write(folder, changed(analysis_type="non_linear")))
    assert read_case(write(folder, changed())).model.mesh.n_elements == 8
    path = write(folder, changed(analysis_type="non_linear"))
    assert read_case(path, linear=True).model.mesh.n_elements == 8
    done = run("solve", path)
    assert done.code == 2
    assert "--linear" in done.err
    assert run("solve", path, "--linear").code == 0


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
REFERENCE = {"TIME": [1.1], "NODE_1": {"DISPLACEMENT_X": [0.0], "DISPLACEMENT_Y": [0.0]}}


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("ProjectParameters.json", ONE_STEP),
        ("ProjectParameters.json", CHECKED),
        ("materials.json", MATERIALS),
        ("reference.json", REFERENCE),
    ],
    ids=["one step", "checked", "materials", "reference"],
)
def test_any_value_of_a_wrong_kind_ends_in_a_project_or_a_clear_error(folder, name, content):
    write(folder, REFERENCE, "reference.json")
    write(folder, CHECKED)
    result = by_hand().solve()
    paths, refused = list(spots(content)), 0
    for path, junk in product(
        paths, [None, True, -1, 0.5, 1e308, -(10**18), "", "x", "..", [], [[]], {}, {"a": 1}]
    ):
        write(folder, replaced(content, path, junk), name)
        try:
            project = read_case(folder / "ProjectParameters.json")
            if content in (CHECKED, REFERENCE):
                project.compare(result)
        except KratosLiteError as error:
            refused += 1
            assert str(folder) in str(error), (path, junk, str(error))  # noqa: PT017
    assert len(paths) < refused or name == "reference.json"


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

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


def processes(*entries):
    return run_file([CLAMP], entries)


def in_time(*constraints):
    return run_file([CLAMP, *constraints], [GRAVITY], step=0.1, solver_type="dynamic")


def on_top(variable, **settings):
    return process("assign_scalar_variable_process", "Top", variable, **settings)


def modes(**settings):
    return changed(solver_type="eigen_value", eigensolver_settings=settings)


def imported(**settings):
    return changed(model_import_settings=settings)


def dynamic(**solver):
    return changed(solver_type="dynamic", **solver)


NO_END = changed()
del NO_END["problem_data"]["end_time"]
START = {"constrained": False, "interval": [0.0, 0.0]}
NORMAL = process(
    "assign_vector_by_direction_to_condition_process", "Top", "SURFACE_LOAD",
    modulus=1.0, direction="automatic_inwards_normal",
)  # fmt: skip
FIX = "fix_vector_variable_process"
BAD = [
    (
        dynamic(time_integration_method="explicit"),
        "'explicit' is not supported: take 'implicit' with 'newmark'",
    ),
    (changed(solver_type="eigen"), "solver_type 'eigen': run files are solved as"),
    (modes(solver_type="spectra_sym_g_eigs"), "is not supported. Did you mean spectra_sym_g_eigs_shift?"),
    (modes(number_of_eigenvalues=0), "number_of_eigenvalues must be at least 1; got 0"),
    (modes(shift=-1.0), "shift must be an eigenvalue ω² ≥ 0"),
    (modes(tolerance=1e-6), "unknown key 'solver_settings.eigensolver_settings.tolerance'"),
    (modes(solver_type="feast", number_of_eigenvalues=3, e_min=2.0), "eigenvalues above e_min alone"),
    (modes(solver_type="feast"), "number_of_eigenvalues must be at least 1"),
    (dynamic(scheme_type="bdf2"), "scheme_type 'bdf2' is not supported"),
    (dynamic(damp_factor_m=0.5), "the α of Bossak lies in -1/3 … 0"),
    (dynamic(newmark_beta=0.0), "newmark_beta must be 0.25"),
    (dynamic(time_stepping={"time_step_table": [[0.0, 0.1]]}), "is for static steps; give 'time_step'"),
    (dynamic(rayleigh_beta=-1.0), "rayleigh_beta must be ≥ 0"),
    (dynamic() | {"problem_data": {"start_time": 0.5, "end_time": 1.0}}, "start_time must be 0"),
    (in_time(on_top("VELOCITY_X", value=1.0)), "VELOCITY_X cannot be fixed"),
    (in_time(on_top("ACCELERATION_X", value=1.0, **START)), "ACCELERATION_X cannot be given"),
    (in_time(on_top("DISPLACEMENT_X", interval=[0.0, 0.5])), "is fixed in a part of the run only"),
    (
        in_time(process("fix_scalar_variable_process", "Top", "DISPLACEMENT_X", interval=[0.5, "End"])),
        "is fixed in a part of the run only",
    ),
    (
        processes(on_top("TEMPERATURE", value=80.0)),
        "no element expands by its TEMPERATURE",
    ),
    (changed(domain_size=2), "domain_size must be 3; got 2"),
    (changed(domain_size="3"), "solver_settings.domain_size must be an integer; got '3'"),
    (changed(analysis_type="quadratic"), "must be 'linear' or 'non_linear'"),
    (changed(displacement_control=True), "displacement_control is not supported"),
    (changed(step=0.0), "time_step must be > 0 s"),
    (changed(step=1e-9), "more than 1000000 steps"),
    (changed(end=0.0), "no step is solved"),
    (NO_END, "key 'problem_data.end_time' is missing"),
    (
        imported(input_type="mdpa", input_filename="bix"),
        "bix.mdpa: there is no such file. Did you mean box.mdpa?",
    ),
    (imported(input_filename="../box"), "leaves the folder"),
    (imported(input_filename="/box"), "leaves the folder"),
    (imported(input_type="use_input_model_part"), "input_type 'use_input_model_part' is not supported"),
    (changed() | {"loads_process_list": []}, "belongs in the object 'processes'"),
    (
        processes({"python_module": FIX[:-1], "Parameters": {}}),
        "unknown process 'fix_vector_variable_proces'. Did you mean fix_vector_variable_process",
    ),
    (processes({"Parameters": {}}), "python_module' is missing"),
    (processes({"python_module": FIX}), "Parameters' is missing"),
    (
        processes(process(FIX, "Structure.Botom", "DISPLACEMENT")),
        "no part 'Structure.Botom'. Did you mean Bottom?",
    ),
    (
        processes(process(FIX, "Bottom", "DISPLACMENT")),
        "not a vector variable of static solids. Did you mean DISPL",
    ),
    (processes(on_top("DISPLACEMENT", value=0.0)), "'DISPLACEMENT' is not a scalar variable"),
    (processes(push(1.0, modulos=2.0)), "Parameters.modulos'. Did you mean modulus?"),
    (processes(push(1.0, local_axes={"axes": []})), "local_axes are not supported"),
    (processes(push(1.0, (0.0, 0.0, 0.0))), "direction is zero"),
    (processes(push(1.0, (0.0, 1.0))), "direction must be a list of three entries"),
    (processes(NORMAL), "automatic normals are not supported"),
    (processes(push(True)), "modulus must be a number or an expression"),
    (processes(push("open('x')")), """SURFACE_LOAD_X: expression "open('x')":"""),
    (processes(push("1/(x-x)")), "SURFACE_LOAD_X: expression '1/(x-x)'"),
    (processes(push(1.0, interval=[0.0, "Ende"])), 'interval must be [number, number or "End"]'),
    (processes(process(FIX, "Bottom", "DISPLACEMENT", constrained="yes")), "constrained must be true, false"),
    (
        run_file([CLAMP], [process(FIX, "Top", "DISPLACEMENT", interval=[0.6, "End"])], step=0.25),
        "fixed only from a later step on, at the value solved before",
    ),
]


@pytest.mark.parametrize(("content", "words"), BAD, ids=[words[:40] for _, words in BAD])
def test_bad_kratos_run_file_is_refused_with_place_and_problem(folder, content, words):
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


def bad_material(variables=None, material=None, **changes):
    entry = json.loads(json.dumps(MATERIALS["properties"][0])) | changes
    entry["Material"] |= material or {}
    if variables:
        entry["Material"]["Variables"] = variables
    return {"properties": [entry]}


BAD_MATERIALS = [
    ({"materials": []}, "needs a list of 'properties'"),
    ({"properties": []}, "properties: the materials file needs a list of 'properties', which is empty"),
    (
        bad_material({"YOUNG_MODULES": 1e9, "POISSON_RATIO": 0.3}),
        "Variables.YOUNG_MODULES: part Structure.Body: Isotropic3D needs E (YOUNG_MODULUS). Did you",
    ),
    (
        bad_material(model_part_name="Structure.Bottom"),
        "has no elements to carry a material; parts with elements are Structure (all), Body",
    ),
    (bad_material(model_part_name="Structure.Bodi"), "Did you mean Body?"),
    (
        bad_material(material={"constitutive_law": {"name": "HyperElastic3DLow"}}),
        "part Structure.Body: 'HyperElastic3DLow' is not a law that",
    ),
    (bad_material(material={"constitutive_law": {}}), "constitutive_law.name' is missing"),
    (bad_material({"YOUNG_MODULUS": "steel"}), "YOUNG_MODULUS must be a number; got 'steel'"),
    (bad_material({"YOUNG_MODULUS": 1e9}), "part Structure.Body: Isotropic3D needs nu (POISSON_RATIO)"),
    (bad_material({"YOUNG_MODULUS": 1e9, "POISSON_RATIO": 0.5}), "POISSON_RATIO) 0.5 must be < 0.5"),
    (
        bad_material(None, {"constitutive_law": {"name": "GenericAnisotropic3DLaw"}}, sub_properties=[{}]),
        "'GenericAnisotropic3DLaw' is not a law that",
    ),
    (bad_material(material={"sub_properties": [1]}), "'sub_properties' in a material is not supported"),
]


@pytest.mark.parametrize(("content", "words"), BAD_MATERIALS)
def test_bad_materials_file_is_refused_with_place_and_problem(folder, content, words):
    path = write(folder, content, "materials.json")
    with pytest.raises(InputError) as caught:
        read_case(write(folder, changed()))
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")


def without_element_8(constants=""):
    """Return the mesh whose part Body has seven of the eight elements; constants of Properties 0."""
    text = box_mdpa().replace("Begin Properties 0\n", "Begin Properties 0\n" + constants)
    start = text.index("Begin SubModelPartElements")
    return text[:start] + text[start:].replace("\n8\n", "\n", 1)


def test_elements_without_material_are_named(folder):
    (folder / "box.mdpa").write_text(without_element_8())
    with pytest.raises(ModelError, match=r"element 8 \(SmallDisplacementElement3D8N\) has no material"):
        read_case(write(folder, changed()))
    with pytest.raises(ModelError, match="solve the run file that names its materials"):
        read_case(folder / "box.mdpa").model.solve()


def test_a_later_material_takes_the_elements_of_an_earlier_one(folder):
    soft = bad_material({"YOUNG_MODULUS": 1.0, "POISSON_RATIO": 0.0}, properties_id=7)["properties"]
    write(folder, {"properties": soft + bad_material()["properties"]}, "materials.json")
    same_field(solved(folder, changed()), by_hand(gravity=(0.0, 0.0, -9.81)).solve())


def test_a_material_of_the_mesh_file_serves_elements_that_the_materials_file_leaves_out(folder):
    steel = "YOUNG_MODULUS 2e9\nPOISSON_RATIO 0.3\nDENSITY 7850\n"
    (folder / "box.mdpa").write_text(without_element_8(steel))
    same_field(solved(folder, changed()), by_hand(gravity=(0.0, 0.0, -9.81)).solve())
    (folder / "box.mdpa").write_text(without_element_8(steel.replace("0.3", "0.5")))
    with pytest.raises(InputError, match=r"box\.mdpa:3: Properties 0: .* must be < 0.5"):
        read_case(write(folder, changed()))


CHECK_FILE = {
    "check_variables": ["DISPLACEMENT"],
    "input_file_name": "reference.json",
    "model_part_name": "Bottom",
    "tolerance": 1.0,
}
CHECKED = run_file(
    [CLAMP],
    [GRAVITY],
    checks=[
        process("check_vector_components_to_nodes_process", "Bottom", "DISPLACEMENT", value=[0, None, "x"]),
        {"python_module": "from_json_check_result_process", "Parameters": CHECK_FILE},
    ],
)
REFERENCE = {"TIME": [1.1], "NODE_1": {"DISPLACEMENT_X": [0.0], "DISPLACEMENT_Y": [0.0]}}
JUNK = [None, True, -1, 0.5, 1e308, -(10**18), "", "x", "..", [], [[]], {}, {"a": 1}]


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
def test_a_value_of_a_wrong_kind_ends_in_a_project_or_a_clear_error(folder, name, content):
    """Every fourth pair of a place and a value: each place and each value comes several times."""
    (folder / "box.mdpa").write_text(box_mdpa(2))
    write(folder, REFERENCE, "reference.json")
    write(folder, CHECKED)
    result, refused = by_hand(n=2).solve(), 0
    pairs = list(product(spots(content), JUNK))[::4]
    for path, junk in pairs:
        write(folder, replaced(content, path, junk), name)
        try:
            project = read_case(folder / "ProjectParameters.json")
            if content in (CHECKED, REFERENCE):
                project.compare(result)
        except KratosLiteError as error:
            refused += 1
            assert str(folder) in str(error), (path, junk, str(error))  # noqa: PT017
    assert refused > len(pairs) / 13 or name == "reference.json"


def test_damaged_run_files_end_in_a_project_or_a_clear_error(folder):
    (folder / "box.mdpa").write_text(box_mdpa(2))
    text, refused = json.dumps(ONE_STEP), []
    for at in range(0, len(text), 14):
        path = write(folder, text[:at] + text[at + 1 :])
        try:
            read_case(path)
        except KratosLiteError as error:
            refused.append(str(error).startswith(str(folder)))
    assert len(refused) > 50
    assert all(refused)

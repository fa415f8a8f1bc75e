"""Keys and words of run files: Kratos refuses, or ignores, those that are refused, or named, here."""

import json
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from children import output_of
from run_files import CLAMP, materials, output, process, push, run_file, write

from kratos_lite.errors import InputError
from kratos_lite.io.files import read_case
from kratos_lite.io.kratos.context import Omission

SOLVER, PROBLEM = "solver_settings", "problem_data"
LOAD = ("processes", "loads_process_list", 0)
LOADS = (*LOAD, "Parameters")


def renamed(key):
    return lambda owner, old: owner.__setitem__(key, owner.pop(old))


def fixed(variable):
    return [process("assign_vector_variable_process", "Structure.Top", variable, value=[0.0] * 3)]


def linear_solver(name, **settings):
    return {"solver_type": name, **settings}


REFUSED = [
    # the path of a key, its new value or how it is changed, and words of the error
    ((SOLVER,), renamed("solver_setings"), "key 'solver_settings' is missing; is it 'solver_setings'?"),
    ((SOLVER, "solver_type"), renamed("solver_tpye"), "solver_type' is missing; is it 'solver_tpye'?"),
    (
        (SOLVER, "rotation_dof"),
        True,
        "unknown key 'solver_settings.rotation_dof'. Did you mean rotation_dofs",
    ),
    ((SOLVER, "analysis_type"), renamed("analysis_tpye"), "analysis_tpye'. Did you mean analysis_type"),
    (
        (SOLVER, "max_iterations"),
        10,
        "unknown key 'solver_settings.max_iterations'. Did you mean max_iteration",
    ),
    ((SOLVER, "max_iteration"), "10", "max_iteration must be a number; got '10'"),
    ((SOLVER, "compute_reactions"), 1, "compute_reactions must be true or false; got 1"),
    ((SOLVER, "scheme_type"), "newmark", "scheme_type: is a setting of solver_type 'dynamic'"),
    (
        (SOLVER, "rve_settings"),
        {},
        "rve_settings is not supported; a periodic cell is solved by kl.homogenized",
    ),
    ((SOLVER, "contact_settings"), {}, "contact_settings is not supported; contact is not solved here"),
    ((SOLVER, "time_stepping", "time_step"), renamed("time_stp"), "is missing; is it 'time_stp'?"),
    (
        (SOLVER, "material_import_settings", "materials_filename"),
        renamed("material_filename"),
        "material_import_settings.materials_filename' is missing; is it 'material_filename'?",
    ),
    ((SOLVER, "builder_and_solver_settings"), {"type": "blok"}, "type must be one of block, block_lagrange"),
    (
        (SOLVER, "builder_and_solver_settings"),
        {"type": "block", "foo": 1},
        "builder_and_solver_settings.foo'",
    ),
    (
        (SOLVER, "linear_solver_settings"),
        linear_solver("amgl"),
        "no linear solver 'amgl'. Did you mean amgcl",
    ),
    ((SOLVER, "linear_solver_settings"), linear_solver("FooApplication.cg"), "'FooApplication' is no appl"),
    (
        (SOLVER, "linear_solver_settings"),
        linear_solver("amgcl", toleranc=1e-9),
        "unknown key 'solver_settings.linear_solver_settings.toleranc'. Did you mean tolerance?",
    ),
    (
        (SOLVER, "linear_solver_settings"),
        linear_solver("cg", max_iteration="a"),
        "max_iteration must be a num",
    ),
    ((PROBLEM, "parallel_type"), "Foo", "problem_data.parallel_type must be 'OpenMP' or 'MPI'"),
    ((PROBLEM, "echo_level"), "a", "problem_data.echo_level must be a number"),
    ((PROBLEM, "domain_size"), 3, "problem_data.domain_size: stands in solver_settings, too"),
    (("json_check_process",), [], "'json_check_process' belongs in the object 'processes'"),
    ((*LOAD, "kratos_module"), "KratosMultiphysic", "is no module of Kratos here. Did you mean KratosMultip"),
    ((*LOADS, "modlus"), 1.0, "Parameters.modlus'. Did you mean modulus?"),
    ((*LOADS, "help"), 3, "Parameters.help must be a string"),
    ((*LOADS, "entities"), "conditions", "Parameters.entities must be a list"),
    (("processes", "x"), fixed("VELOCITY"), "Parameters.constrained: VELOCITY cannot be fixed"),
    (("processes", "x"), fixed("VOLUME_ACCELERATION"), "VOLUME_ACCELERATION cannot be fixed"),
]
NONLINEAR = [
    (
        (SOLVER, "convergence_criterion"),
        "foo_criterion",
        "'foo_criterion' is not supported; take one of resid",
    ),
    ((SOLVER, "solving_strategy_settings"), {"type": "newton"}, "the strategy 'newton' is not supported"),
    ((SOLVER, "solving_strategy_settings"), {"tpye": "newton_raphson"}, "is missing; is it 'tpye'?"),
]
IGNORED = [
    # the path of a key, its new value or how it is changed, and how the note names it
    (("proceses",), {}, "'proceses' (Did you mean processes?)"),
    ((PROBLEM, "echo_levl"), 1, "'problem_data.echo_levl' (Did you mean echo_level?)"),
    (
        (SOLVER, "convergence_criterion"),
        "foo_criterion",
        "solver_settings.convergence_criterion 'foo_criterion'",
    ),
    ((SOLVER, "solving_strategy_settings"), {"type": "newton"}, "solving_strategy_settings.type 'newton'"),
    (
        (SOLVER, "time_stepping", "time_stp"),
        1.0,
        "'solver_settings.time_stepping.time_stp' (Did you mean time_",
    ),
    ((SOLVER, "model_import_settings", "input_tpye"), "mdpa", "model_import_settings.input_tpye'"),
    (
        (SOLVER, "builder_and_solver_settings"),
        {"use_block_bulder": True},
        "use_block_bulder' (Did you mean use",
    ),
    ((SOLVER, "linear_solver_settings"), {"solver_tpye": "cg"}, "solver_tpye' (Did you mean solver_type?)"),
    ((*LOAD, "kratos_modul"), "Foo", "loads_process_list[0].kratos_modul' (Did you mean kratos_module?)"),
]


def changed(path, change, analysis="linear"):
    """Return a run file of Kratos with one change."""
    content = run_file([CLAMP], [push(1e5)], analysis_type=analysis)
    for entry in (*content["processes"]["constraints_process_list"], content["processes"][LOAD[1]][0]):
        name = entry["Parameters"]["model_part_name"].removeprefix("Structure.")
        entry["Parameters"]["model_part_name"] = f"Structure.{name}"
    content = owner = json.loads(json.dumps(content))
    for key in path[:-1]:
        owner = owner[key]
    if callable(change):
        change(owner, path[-1])
    else:
        owner[path[-1]] = change
    return content


ROWS = [(*row, "linear") for row in REFUSED] + [(*row, "non_linear") for row in NONLINEAR]


@pytest.mark.parametrize(("path", "change", "words", "analysis"), ROWS, ids=[row[2][:40] for row in ROWS])
def test_what_kratos_refuses_is_refused_with_the_nearest_word(folder, path, change, words, analysis):
    with pytest.raises(InputError) as caught:
        read_case(write(folder, changed(path, change, analysis)))
    assert words in str(caught.value)


@pytest.mark.parametrize(("path", "change", "name"), IGNORED, ids=[row[2][:40] for row in IGNORED])
def test_what_kratos_ignores_is_named_in_a_note(folder, path, change, name):
    notes = read_case(write(folder, changed(path, change))).model.notes
    (note,) = (note for note in notes if note.endswith("not used"))
    assert note.startswith("key ")
    assert name in note


def test_one_note_names_all_keys_that_are_not_used(folder):
    content = changed((PROBLEM, "parallel_type"), "MPI") | {"foo": 1, "_comment": 2}
    note = "keys 'foo', problem_data.parallel_type 'MPI' (mpirun and --backend petsc) are not used"
    assert note in read_case(write(folder, content)).model.notes


OUTPUT = {"python_module": "save_restart_process", "Parameters": {}}


@pytest.mark.parametrize("command", ["check", "solve"])
def test_strict_refuses_a_file_of_which_kratos_would_do_more(folder, run, command):
    content = changed((PROBLEM, "echo_levl"), 1)
    path = write(folder, content)
    assert run(command, "--strict", path).code == 0
    write(folder, content | {"output_processes": {"files": [OUTPUT]}})
    assert run(command, path).code == 0
    said = run(command, "--strict", path)
    assert said.refuses(
        "--strict: not everything requested is done", "output_processes.files[0]: save_restart_process is not"
    )
    write(folder, content | {"output_proceses": {}})
    assert run(command, path).code == 0
    assert run(command, "--strict", path).refuses("'output_proceses' (Did you mean output_processes?)")


def test_a_misspelt_section_is_named_where_the_run_ends_in_an_error(folder, run):
    path = write(folder, changed(("processes",), renamed("process")))
    said = run("solve", path)
    assert said.refuses("rigid-body modes free", "note: key 'process' (Did you mean processes?) is not used")


def test_strict_refuses_a_check_that_is_not_made(folder, run):
    wanted = {
        "check_variables": ["DISPLACEMENT"],
        "input_file_name": "none.json",
        "model_part_name": "Structure",
    }
    check = {"python_module": "from_json_check_result_process", "Parameters": wanted}
    path = write(folder, run_file([CLAMP], [push(1e5)], checks=[check]))
    codes = {options: run("solve", "-q", *options, path).code for options in ((), ("--strict",))}
    assert codes == {(): 0, ("--strict",): 2}


FACE, ELEMENT = "SmallDisplacementSurfaceLoadCondition3D4N", "SmallDisplacementElement3D8N"
STEPS = {"step": 0.5, "analysis_type": "linear"}
EXPANDING = materials(
    "Structure.Body", 7850.0, 2e9, 0.3, "ThermalElasticIsotropic3D",
    THERMAL_EXPANSION_COEFFICIENT=1e-5, REFERENCE_TEMPERATURE=20.0,
)  # fmt: skip
RUBBER = materials("Structure.Body", 7850.0, 2e9, 0.3, "HyperElastic3DLaw")
HEAT = process("assign_scalar_variable_process", "Structure", "TEMPERATURE", value="120.0*X*t")
WARM = process("assign_scalar_variable_process", "Structure", "TEMPERATURE", value="120.0*t")
BOSSAK = {"solver_type": "dynamic", "time_integration_method": "implicit", "step": 0.01, "end": 0.02}
PRESS = process(
    "assign_scalar_variable_to_conditions_process", "Structure.Top", "POSITIVE_FACE_PRESSURE", value="t"
)
CHOICE = push("1e5 if t<0.5 else 2e5")
STRAINS = {
    "files": [output("json", output_variables=["GREEN_LAGRANGE_STRAIN_VECTOR"], output_file_name="a.json")]
}
REACTIONS = {"files": [output("json", output_variables=["REACTION"], output_file_name="a.json")]}
UNLIKE = [
    # what is exchanged in the mesh, more loads, materials, settings, and the words of a note, or None
    ((FACE, "SurfaceLoadCondition3D4N"), [], None, STEPS, "SurfaceLoadCondition3D4N: Kratos puts the load"),
    ((FACE, "SurfaceLoadCondition3D4N"), [], None, {}, None),
    ((FACE, "SurfaceLoadCondition3D4N"), [], None, {**STEPS, "move_mesh_flag": False}, None),
    ((FACE, FACE), [], None, STEPS, None),
    ((FACE, FACE), [CHOICE], None, {}, "loads_process_list[1]: Kratos refuses 'if' in a modulus"),
    ((FACE, FACE), [WARM], EXPANDING, {"outputs": STRAINS}, "GREEN_LAGRANGE_STRAIN is the whole strain"),
    ((FACE, FACE), [], EXPANDING, {"outputs": STRAINS}, None),
    ((FACE, "OddCondition3D4N"), [], None, {}, "only faces carry it; OddCondition3D4N carries no load"),
    ((FACE, "SurfaceCondition3D4N"), [], None, {}, None),
    ((FACE, FACE), [HEAT], EXPANDING, {}, f"TEMPERATURE varies in {ELEMENT}: its mean strains"),
    ((FACE, FACE), [HEAT], EXPANDING, STEPS, f"TEMPERATURE varies in {ELEMENT}: its mean strains"),
    ((FACE, FACE), [WARM], EXPANDING, STEPS, None),
    (
        (ELEMENT, "UpdatedLagrangianElement3D8N"),
        [],
        RUBBER,
        {"step": 0.5, "analysis_type": "non_linear"},
        "UpdatedLagrangianElement3D8N: from the second step on Kratos writes other stresses",
    ),
    ((ELEMENT, "UpdatedLagrangianElement3D8N"), [], RUBBER, {"analysis_type": "non_linear"}, None),
    ((FACE, FACE), [], None, {**BOSSAK, "outputs": REACTIONS}, "REACTION of bossak has the inertia"),
    ((FACE, FACE), [], None, {**BOSSAK, "outputs": REACTIONS, "scheme_type": "newmark"}, None),
    ((FACE, FACE), [], None, BOSSAK, None),
]


@pytest.mark.parametrize(("names", "loads", "law", "settings", "words"), UNLIKE)
def test_what_kratos_computes_otherwise_is_a_note_that_strict_counts(
    folder, names, loads, law, settings, words
):
    (folder / "box.mdpa").write_text((folder / "box.mdpa").read_text().replace(*names))
    if law:
        write(folder, law, "materials.json")
    notes = read_case(write(folder, run_file([CLAMP], [push(1e5), *loads], **settings))).model.notes
    assert [words in note for note in notes if isinstance(note, Omission)] == [True] * (words is not None)
    assert not any("UpdatedLagrangian" in note and "small displacements" in note for note in notes)


@pytest.mark.parametrize(("settings", "moves"), [(STEPS, True), ({**STEPS, "move_mesh_flag": False}, False)])
def test_a_pressure_is_noted_where_kratos_moves_the_faces_in_a_linear_run(folder, settings, moves):
    text = (folder / "box.mdpa").read_text().replace(FACE, "SurfaceLoadCondition3D4N")
    (folder / "box.mdpa").write_text(text)
    model = read_case(write(folder, run_file([CLAMP], [PRESS], **settings))).model
    notes = " ".join(note for note in model.notes if isinstance(note, Omission))
    assert ("adds a pressure stiffness" in notes, "puts the load of a step on" in notes) == (True, moves)


def test_a_misspelt_variable_is_named_in_the_materials_file(folder):
    write(folder, materials("Structure.Body", 7850.0, 2e9, 0.3, YOUNGS_MODULUS=1.0), "materials.json")
    with pytest.raises(InputError, match=r"materials\.json: unknown variable YOUNGS_MODULUS\. Did you mean"):
        read_case(write(folder, run_file([CLAMP], [push(1e5)])))


def test_conditions_that_kratos_computes_nothing_of_carry_no_load(folder):
    """Measured against Kratos 10.4.4; values of nodes act on the faces beside, 0.75 m high and 1 m wide."""
    text = (folder / "box.mdpa").read_text().replace(FACE, "SurfaceCondition3D4N")
    before, head, rows = text.partition("Begin Conditions")
    text = before + head + rows.replace("\n5 0", f"\nEnd Conditions\nBegin Conditions {FACE}\n5 0", 1)
    (folder / "box.mdpa").write_text(text)
    nodal = process("assign_vector_variable_process", "Structure.Top", "SURFACE_LOAD", value=[0.0, 0.0, 8.0])
    nodal["Parameters"]["constrained"] = False
    model = read_case(write(folder, run_file([CLAMP], [push(1e5), nodal]))).model
    assert "SURFACE_LOAD on 4 conditions (first 1) has no effect" in "".join(model.notes)
    assert np.abs(model.solve().reactions.sum(axis=0) - [0, 0, -8 * 0.75 / 2]).max() < 1e-12
    (folder / "box.mdpa").write_text(text.replace("SurfaceCondition", "SurfaceLoadConditions"))
    words = r"box\.mdpa:\d+: unknown condition 'SurfaceLoadConditions3D4N' \(4 of them\)\. Did you mean Surf"
    with pytest.raises(InputError, match=words):
        read_case(folder / "ProjectParameters.json")


IN_KRATOS = """
import json, sys
import KratosMultiphysics as KM
from KratosMultiphysics.StructuralMechanicsApplication import structural_mechanics_analysis as module
for content in json.load(open("contents.json")):
    try:
        module.StructuralMechanicsAnalysis(KM.Model(), KM.Parameters(json.dumps(content))).Run()
        print("runs =", 1)
    except Exception:
        print("runs =", 0)
"""


@pytest.mark.skipif(not find_spec("KratosMultiphysics"), reason="Kratos is not installed")
def test_kratos_refuses_and_ignores_the_same(folder, monkeypatch):
    write(folder, changed((PROBLEM, "echo_level"), 0))
    rows = [(path, change, analysis) for path, change, _, analysis in ROWS]
    contents = [changed(*row) for row in (*rows, *((path, change) for path, change, _ in IGNORED))]
    write(folder, contents, "contents.json")
    monkeypatch.chdir(folder)
    found = [
        line[-1] == "1"
        for line in output_of(sys.executable, "-c", IN_KRATOS).splitlines()
        if "runs =" in line
    ]
    assert found == [False] * len(rows) + [True] * len(IGNORED)

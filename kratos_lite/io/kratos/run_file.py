"""Kratos run files: ``ProjectParameters.json`` with its materials file and its mesh.

Solids at rest, in quasi-static steps or in time, in the style of 2019 and in the present one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.errors import Problems, nearest
from kratos_lite.io.case import Case, Outputs
from kratos_lite.io.formats import read_document
from kratos_lite.io.formats.document import Document
from kratos_lite.io.formats.part_files import part_files, read_part
from kratos_lite.io.kratos.context import RunContext, module_of, times_of
from kratos_lite.io.kratos.expected_values import COMPARISONS
from kratos_lite.io.kratos.initial_state import MODULE, initial_state_of
from kratos_lite.io.kratos.laws import is_nonlinear, make_linear, notes_on_stress, quasi_static_of
from kratos_lite.io.kratos.motion import add_motion
from kratos_lite.io.kratos.outputs import OUTPUT_PROCESSES, OutputProcess
from kratos_lite.io.kratos.point_elements import set_apart
from kratos_lite.io.kratos.processes import PROCESSES, Action, actions_of, run
from kratos_lite.io.kratos.properties import NO_EXPANSION, expanding, use_materials
from kratos_lite.io.kratos.time_dependent import DYNAMIC, DYNAMIC_KEYS, ProcessesInTime, time_integration_of
from kratos_lite.io.kratos.to_model import model_from
from kratos_lite.io.kratos.variables import TEMPERATURE
from kratos_lite.io.settings import Settings, find_file, read_settings

ROOT_KEYS = ("problem_data", "solver_settings", "processes", "output_processes", "ale")
HARMLESS = frozenset(
    "solver_type model_part_name domain_size echo_level buffer_size analysis_type model_import_settings "
    "material_import_settings time_stepping rotation_dofs reform_dofs_at_each_step compute_reactions "
    "use_old_stiffness_in_first_iteration solving_strategy_settings builder_and_solver_settings "
    "clear_storage move_mesh_flag multi_point_constraints_used convergence_criterion max_iteration "
    "displacement_relative_tolerance displacement_absolute_tolerance residual_relative_tolerance "
    "residual_absolute_tolerance linear_solver_settings line_search block_builder "
    "problem_domain_sub_model_part_list processes_sub_model_part_list "
    "auxiliary_variables_list auxiliary_dofs_list auxiliary_reaction_list".split()
)
"""Solver settings that are used here, or that cannot change a static linear solution."""
OTHER_PHYSICS = (
    "displacement_control", "volumetric_strain_dofs", "strain_dofs", "pressure_dofs",
    "use_orthogonal_subscales", "contact_settings", "mpc_contact_settings", "computing_sub_model_part_name",
)  # fmt: skip
"""Solver settings that, unless false or empty, ask for equations that kratos_lite does not have."""
NOT_RUN = ("save_restart_process", "timer_process", "print_info_in_file_process")


def read_kratos_project(
    path: Path,
    allow_outside: bool = False,
    *,
    initial_displacement: bool = True,
    linear: bool = False,
    part: int | None = None,
) -> Case:
    """Return the case of a Kratos run file; errors name what is wrong, or no linear solid."""
    settings, folder = read_settings(path), path.parent
    if "properties" in settings:
        raise settings.error("properties", "this is a materials file; read the run file that names it")
    if not {"solver_settings", "problem_data"} & settings.values.keys():
        text = "this is no run file of Kratos, which has 'solver_settings'"
        raise settings.error("", f"{text}; write a Python script with a 'case'")
    solver = settings.section("solver_settings", required=True)
    times = times_of(settings.section("problem_data", required=True), solver)
    dynamic = solver.text("solver_type") in DYNAMIC
    notes = _check_solver(solver) + _check_root(settings)
    document = set_apart(_read_mesh(solver, folder, allow_outside, notes, part))
    root, moved = solver.text("model_part_name", "Structure"), solver.flag("move_mesh_flag", True)
    context = RunContext(document.mesh, root, folder, times, moved, allow_outside)
    _use_materials(solver, context, document, notes)
    small = linear or solver.text("analysis_type", "non_linear") == "linear"
    notes += make_linear(document) if small else []
    nonlinear = is_nonlinear(document)
    notes += notes_on_stress(document)
    if not small and not nonlinear:
        notes.append("analysis_type is non_linear: the linear solution is computed, on the undeformed body")
    steps = quasi_static_of(solver, times) if nonlinear and not dynamic else None
    in_steps = steps is not None and len(times) > 2
    if not dynamic and not in_steps:
        text = "supports, loads and motion are taken at the end of the run"
        notes.append(f"{text}: those at t = {times[-1]:g} s")
    actions, checks, states, written = _read_processes(settings, context, notes)
    outputs = Outputs(in_steps=list(written))
    for action in actions:
        if action.component == TEMPERATURE:
            action.settings.expect(expanding(document, True), "variable_name", NO_EXPANSION)
    in_time = ProcessesInTime(actions, context, dynamic, nonlinear) if dynamic or in_steps else None
    processes = partial(run, actions, context, notes) if in_time is None else in_time.prepare
    initial_displacement = initial_displacement and in_time is None
    model = model_from(document, initial_displacement=initial_displacement, processes=processes)
    for initial_state in states:
        initial_state(model)
    add_motion(model, settings, None if in_time else times[-1])
    model.notes += notes
    if in_time is None:
        return Case(model, outputs=outputs, expected=checks, files=settings.files)
    in_time.finish(model)
    time = time_integration_of(settings, in_time) if dynamic else steps
    return Case(model, time, outputs=outputs, expected=checks, files=settings.files)


def _check_root(settings: Settings) -> list[str]:
    for key in ("modelers", "stages", "orchestrator", "restart_load_file_label"):
        text = f"{key!r} is not supported; name the mesh in model_import_settings"
        settings.expect(not settings.values.get(key), key, text)
    unknown = settings.unknown(ROOT_KEYS)
    for key in unknown:
        text = f"{key!r} belongs in the object 'processes'; Kratos ignores it here"
        settings.expect(not key.endswith("_process_list"), key, text)
    return [f"key {key!r} is not used" for key in unknown if not key.startswith("_")]


def _check_solver(solver: Settings) -> list[str]:
    """Refuse what is not a solid in three dimensions; note what is treated otherwise."""
    kind, analysis = solver.text("solver_type"), solver.text("analysis_type", "non_linear")
    text = f"solver_type {kind!r}: run files are solved as 'static' or 'dynamic'"
    is_solved = kind in ("Static", "static", *DYNAMIC)
    solver.expect(is_solved, "solver_type", f"{text}; take 'static', then --modes for frequencies")
    size = solver.integer("domain_size")
    solver.expect(size == 3, "domain_size", f"must be 3; got {size}")
    text = f"must be 'linear' or 'non_linear'; got {analysis!r}"
    solver.expect(analysis in ("linear", "non_linear"), "analysis_type", text)
    for key in OTHER_PHYSICS:
        text = f"{key} is not supported; kratos_lite solves for displacements of all elements"
        solver.expect(not solver.values.get(key), key, text)
    known = (*HARMLESS, *OTHER_PHYSICS, *(DYNAMIC_KEYS if kind in DYNAMIC else ()))
    notes = [f"solver setting {key!r} is not used.{nearest(key, known)}" for key in solver.unknown(known)]
    chosen = solver.section("linear_solver_settings").text("solver_type", "")
    return notes + ([f"linear solver {chosen}: kratos_lite chooses its own"] if chosen else [])


def part_files_of(run_file: Path) -> dict[int, Path]:
    """Return the part files that hold the mesh of a run file, by number; none where it is in one file."""
    solver = read_settings(run_file).section("solver_settings", required=True)
    source = solver.section("model_import_settings", required=True)
    path = run_file.parent / (source.text("input_filename") + ".mdpa")
    return part_files(path) or part_files(run_file.parent / path.name)


def _read_mesh(solver: Settings, folder: Path, outside: bool, notes: list[str], part: int | None) -> Document:
    source = solver.section("model_import_settings", required=True)
    kind = source.text("input_type", "mdpa")
    source.expect(kind == "mdpa", "input_type", f"input_type {kind!r} is not supported; use 'mdpa'")
    if part is None:
        path, note = find_file(source, "input_filename", folder, outside=outside, ending=".mdpa")
        document = read_document(path)
    else:
        document, note = read_part(part_files_of(Path(solver.source))[part]), ""
    notes += [note] if note else []
    unused = len(document.constraints)
    if unused and not solver.flag("multi_point_constraints_used", True):
        notes.append(f"multi_point_constraints_used is false: {unused} constraints omitted")
        document.constraints = []
    return document


def _use_materials(solver: Settings, context: RunContext, document: Document, notes: list[str]) -> None:
    """Give the document the materials of the materials file, if there is one."""
    source = solver.section("material_import_settings")
    if source.text("materials_filename", ""):
        path, note = find_file(source, "materials_filename", context.folder, outside=context.outside)
        notes += [note] if note else []
        use_materials(read_settings(path), context, document, notes)


def _read_processes(
    settings: Settings, context: RunContext, notes: list[str]
) -> tuple[list[Action], list[Callable[[Result], str]], list[Callable[[Model], None]], list[OutputProcess]]:
    """Return what processes do, check, begin with and write; all that are unknown are reported together."""
    actions: list[Action] = []
    checks: list[Callable[[Result], str]] = []
    states: list[Callable[[Model], None]] = []
    written: list[OutputProcess] = []
    problems = Problems()
    for section in (settings.section("processes"), settings.section("output_processes")):
        # Kratos keeps the lists in alphabetical order; later processes replace earlier values.
        for key in sorted(section.values):
            for entry in section.sections(key):
                module = module_of(entry)
                if module in PROCESSES:
                    actions += actions_of(entry, module, context)
                elif module == MODULE:
                    states.append(initial_state_of(entry.section("Parameters", required=True), context))
                elif module in COMPARISONS:
                    checks += COMPARISONS[module](entry.section("Parameters", required=True), context)
                elif module in OUTPUT_PROCESSES:
                    output = OUTPUT_PROCESSES[module](entry.section("Parameters", required=True), context)
                    written.append(output)
                    notes += [f"{entry.path}: {output.note}"] if output.note else []
                elif module in NOT_RUN:
                    notes.append(f"{entry.path}: {module} is not run")
                else:
                    known = [*PROCESSES, *COMPARISONS, MODULE, *OUTPUT_PROCESSES]
                    text = f"unknown process {module!r}.{nearest(module, known)} Known are {', '.join(known)}"
                    problems.add(str(entry.error("", text)))
    problems.raise_if_any()
    return actions, checks, states, written

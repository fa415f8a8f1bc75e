"""Kratos run files: ``ProjectParameters.json`` with its materials file and its mesh.

Solids at rest, in quasi-static steps or in time, or their modes, in the style of 2019 and the present one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from kratos_lite.analysis.model import Model
from kratos_lite.errors import Problems, nearest
from kratos_lite.io.case import Case, Outputs
from kratos_lite.io.formats import read_document
from kratos_lite.io.formats.document import Document
from kratos_lite.io.formats.mdpa.reader import part_files, read_part
from kratos_lite.io.kratos.context import Omission, RunContext, module_of, times_of
from kratos_lite.io.kratos.expected_values import COMPARISONS, eigenvalue_comparisons
from kratos_lite.io.kratos.keys import EIGEN, EIGEN_KEYS, IN_TIME, modes_of, unused_keys
from kratos_lite.io.kratos.laws import make_linear, notes_on_laws, quasi_static_of
from kratos_lite.io.kratos.motion import add_motion
from kratos_lite.io.kratos.outputs import OUTPUT_PROCESSES, OutputProcess
from kratos_lite.io.kratos.point_elements import set_apart
from kratos_lite.io.kratos.processes import (
    INITIAL_STATE,
    PROCESSES,
    Action,
    actions_of,
    initial_state_of,
    run,
)
from kratos_lite.io.kratos.properties import NO_EXPANSION, expanding, use_materials
from kratos_lite.io.kratos.time_dependent import DYNAMIC, ProcessesInTime, time_integration_of
from kratos_lite.io.kratos.to_model import model_from
from kratos_lite.io.kratos.variables import TEMPERATURE
from kratos_lite.io.settings import Settings, find_file, read_settings

CHECK = "check_eigenvalues_process"
NOT_RUN = ("save_restart_process", "timer_process", "print_info_in_file_process")
DAMPING = Omission("rayleigh_beta damps by the stiffness at rest; Kratos takes that of each iteration")
REACTIONS = Omission("REACTION of bossak has the inertia at the end of a step; Kratos takes its mean over it")
STRAINS = Omission("GREEN_LAGRANGE_STRAIN is the whole strain; Kratos's is without that of TEMPERATURE")
LINEAR = "analysis_type is non_linear: the linear solution is computed, on the undeformed body"
PARTS = "results over part files are written by -o OUT.pvtu"


def read_kratos_project(
    path: Path,
    allow_outside: bool = False,
    *,
    initial_displacement: bool = True,
    linear: bool = False,
    part: int | None = None,
) -> Case:
    """Return the case of a Kratos run file; errors name what is wrong, or no linear solid."""
    settings = _read_run_file(path)
    solver, in_ale = settings.section("solver_settings", required=True), settings.section("ale")
    dynamic, eigen = (solver.text("solver_type") in kinds for kinds in (DYNAMIC, (EIGEN,)))
    times = times_of(settings.section("problem_data", required=True), solver, dynamic)
    small = linear or solver.text("analysis_type", "non_linear") == "linear"
    notes = _check_solver(solver) + _notes_on_keys(settings, dynamic, eigen, small)
    modes, above = modes_of(solver, notes) if eigen else (0, None)
    document = set_apart(_read_mesh(solver, path.parent, allow_outside, notes, part))
    root, moved = solver.text("model_part_name", "Structure"), solver.flag("move_mesh_flag", True)
    moved, dofs = moved and not eigen, _dofs(solver, dynamic)
    context = RunContext(document.mesh, root, path.parent, times, moved, allow_outside, dofs)
    _use_materials(solver, context, document, notes)
    notes += (make_linear(document) if small else []) + notes_on_laws(document, len(times) - 1)
    time = None if dynamic or eigen else quasi_static_of(solver, times)
    instead = "modes are written by -o OUT" if eigen else "" if part is None else PARTS
    processes = _Processes(context, notes, eigen, instead).read(settings)
    for action in processes.actions:
        if action.component == TEMPERATURE:
            action.settings.expect(expanding(document, True), "variable_name", NO_EXPANSION)
    in_steps = dynamic or not (eigen or in_ale.values or len(times) == 2)
    in_time = ProcessesInTime(processes.actions, context, dynamic) if in_steps else None
    act = in_time.prepare if in_time else partial(run, processes.actions, context, notes)
    displaced = initial_displacement and in_time is None
    follows = moved and not small
    model = model_from(document, initial_displacement=displaced, processes=act, follows=follows)
    notes += [LINEAR] if dynamic and not (small or model.is_nonlinear) else []
    for initial_state in processes.states:
        initial_state(model)
    add_motion(model, settings, None if in_time else times[-1])
    model.notes += notes
    if in_time:
        in_time.finish(model)
        if dynamic:
            time = time_integration_of(settings, in_time)
            model.notes += [DAMPING] if model.is_nonlinear and time.rayleigh[1] else []
    given = [*(data.variable for data in document.nodal_data), *(a.component for a in processes.actions)]
    bossak = dynamic and solver.text("scheme_type", "bossak") == "bossak"
    written = repr([settings.values.get(key) for key in ("processes", "output_processes")])
    unlike = ("REACTION", REACTIONS, bossak), ("GREEN_LAGRANGE_STRAIN", STRAINS, TEMPERATURE in given)
    model.notes += [note for word, note, is_other in unlike if is_other and word in written]
    outputs, files = Outputs(in_steps=list(processes.written)), settings.files
    if model.is_nonlinear and not (eigen or in_time) and times[-1] != 1:
        model.notes.append(f"the one step, to t = {times[-1]:g} s, is counted as one to t = 1 s")
    time = time if in_time else None
    return Case(model, time, modes, above, outputs=outputs, expected=processes.checks, files=files)


def _read_run_file(path: Path) -> Settings:
    """Return the settings of a run file; InputError for another JSON file."""
    settings = read_settings(path)
    if "properties" in settings:
        raise settings.error("properties", "this is a materials file; read the run file that names it")
    if not {"solver_settings", "problem_data"} & settings.values.keys():
        text = "this is no run file of Kratos, which has 'solver_settings'"
        raise settings.error("", f"{text}; write a Python script with a 'case'")
    return settings


def _notes_on_keys(settings: Settings, dynamic: bool, eigen: bool, small: bool) -> list[str]:
    """Return a note on keys that change nothing; InputError for those that Kratos refuses."""
    unused = unused_keys(settings, IN_TIME if dynamic else EIGEN_KEYS if eigen else {}, small or eigen)
    are = "key {} is" if len(unused) == 1 else "keys {} are"
    note = f"{are.format(', '.join(unused))} not used"
    misspelt = any("Did you mean" in key for key in unused if "." not in key)  # a whole section is left out
    return [Omission(note) if misspelt else note] if unused else []


def _dofs(solver: Settings, dynamic: bool) -> tuple[str, ...]:
    """Return the variables that Kratos can fix."""
    more = ["VELOCITY", "ACCELERATION"] if dynamic else []
    more += ["ROTATION"] if solver.flag("rotation_dofs", False) else []
    return ("DISPLACEMENT", TEMPERATURE, *more, *solver.texts("auxiliary_dofs_list"))


def _check_solver(solver: Settings) -> list[str]:
    """Refuse what is not a solid in three dimensions; note what is treated otherwise."""
    kind, analysis = solver.text("solver_type"), solver.text("analysis_type", "non_linear")
    text = f"solver_type {kind!r}: run files are solved as 'static', 'dynamic' or {EIGEN!r}"
    solver.expect(kind in ("Static", "static", EIGEN, *DYNAMIC), "solver_type", text)
    size = solver.integer("domain_size")
    solver.expect(size == 3, "domain_size", f"must be 3; got {size}")
    text = f"must be 'linear' or 'non_linear'; got {analysis!r}"
    solver.expect(analysis in ("linear", "non_linear"), "analysis_type", text)
    chosen = solver.section("linear_solver_settings").text("solver_type", "")
    return [f"linear solver {chosen}: kratos_lite chooses its own"] if chosen else []


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
    if source.values and source.text("materials_filename"):
        path, note = find_file(source, "materials_filename", context.folder, outside=context.outside)
        notes += [note] if note else []
        use_materials(read_settings(path), context, document, notes)


@dataclass
class _Processes:
    """What processes do, check, begin with and write; files are left out if something is said `instead`."""

    context: RunContext
    notes: list[str]
    eigen: bool
    instead: str
    actions: list[Action] = field(default_factory=list)
    checks: list[Callable[[Any], str]] = field(default_factory=list)
    states: list[Callable[[Model], None]] = field(default_factory=list)
    written: list[OutputProcess] = field(default_factory=list)

    def read(self, settings: Settings) -> _Processes:
        """Take what the processes of a run file are for; all that are unknown are reported together."""
        problems = Problems()
        for section in (settings.section("processes"), settings.section("output_processes")):
            # Kratos keeps the lists in alphabetical order; later processes replace earlier values.
            for key in sorted(section.values):
                for entry in section.sections(key):
                    if omitted := self._take(entry, problems):
                        self.notes.append(Omission(f"{entry.path}: {omitted}"))
        problems.raise_if_any()
        return self

    def _take(self, entry: Settings, problems: Problems) -> str:
        """Take what a process is for, or add it to the problems; return what is not done of it."""
        module, compare = module_of(entry), {CHECK: eigenvalue_comparisons} if self.eigen else COMPARISONS
        known = [*PROCESSES, *COMPARISONS, CHECK, INITIAL_STATE, *OUTPUT_PROCESSES]
        if module in NOT_RUN:
            return f"{module} is not run"
        if module not in known:
            text = f"unknown process {module!r}.{nearest(module, known)} Known are {', '.join(known)}"
            problems.add(str(entry.error("", text)))
            return ""
        if module in PROCESSES:
            self.actions += actions_of(entry, module, self.context)
            return ""
        if module not in (INITIAL_STATE, *compare, *OUTPUT_PROCESSES):
            return f"{module} is not evaluated: there are no such values"
        settings = entry.section("Parameters", required=True)
        if module == INITIAL_STATE:
            self.states.append(initial_state_of(settings, self.context))
        elif module in compare:
            self.checks += compare[module](settings, self.context)
        else:
            output = OUTPUT_PROCESSES[module](settings, self.context)
            self.written += [] if self.instead else [output]
            return f"{module} writes nothing: {self.instead}" if self.instead else output.note
        return ""

"""Kratos run files: ``ProjectParameters.json`` with its materials file and its mesh, to a Project.

Static linear solids in the style of 2019 and in the present one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, KratosLiteError, Problems, nearest
from kratos_lite.io.case import Case, module_of, times_of
from kratos_lite.io.document import Document, Properties
from kratos_lite.io.files import read_document
from kratos_lite.io.kratos import ELASTIC, check_elements, material_from, model_from
from kratos_lite.io.processes import PROCESSES, Action, actions_of, run
from kratos_lite.io.run_checks import CHECKS, Check
from kratos_lite.io.settings import Settings, inside, is_number, read_settings, shown
from kratos_lite.io.variables import Variables
from kratos_lite.materials import LinearMaterial
from kratos_lite.model import Model

ROOT_KEYS = ("problem_data", "solver_settings", "processes", "output_processes")
HARMLESS = frozenset(
    "solver_type model_part_name domain_size echo_level buffer_size analysis_type model_import_settings "
    "material_import_settings time_stepping rotation_dofs reform_dofs_at_each_step compute_reactions "
    "use_old_stiffness_in_first_iteration solving_strategy_settings builder_and_solver_settings "
    "clear_storage move_mesh_flag multi_point_constraints_used convergence_criterion max_iteration "
    "displacement_relative_tolerance displacement_absolute_tolerance residual_relative_tolerance "
    "residual_absolute_tolerance linear_solver_settings line_search block_builder "
    "problem_domain_sub_model_part_list processes_sub_model_part_list computing_sub_model_part_name "
    "auxiliary_variables_list auxiliary_dofs_list auxiliary_reaction_list".split()
)
"""Solver settings that are used here, or that cannot change a static linear solution."""
OTHER_PHYSICS = (
    "displacement_control", "volumetric_strain_dofs", "strain_dofs", "pressure_dofs",
    "use_orthogonal_subscales", "contact_settings", "mpc_contact_settings", "computing_sub_model_part_name",
)  # fmt: skip
"""Solver settings that, unless false or empty, ask for equations that kratos_lite does not have."""
MATERIAL_USES = ELASTIC | {
    "DENSITY", "INTEGRATION_ORDER", "VOLUME_ACCELERATION", "GRAVITY", "BODY_FORCE", "INSITU_STRESS",
    "PRESTRESS", "PRESTRESS_FACTOR",
}  # fmt: skip
OUTPUTS = ("save_restart_process", "timer_process", "print_info_in_file_process")


def read_kratos_project(
    settings: Settings, folder: Path, allow_outside: bool = False
) -> tuple[Model, list[Check]]:
    """Return the model and the checks of a Kratos run file.

    Parameters
    ----------
    settings : the run file.
    folder : its folder.
    allow_outside : let it name files outside the folder.

    Raises
    ------
    InputError
        With the place of what is wrong, or of what is not a static linear solid.
    """
    solver = settings.section("solver_settings", required=True)
    times = times_of(settings.section("problem_data", required=True), solver)
    notes = _check_root(settings) + _check_solver(solver, times)
    source = Case(Document(_no_mesh()).mesh, "", folder, outside=allow_outside)
    document = _read_mesh(solver, source, notes)
    check_elements(document)
    if not solver.flag("multi_point_constraints_used", True) and document.constraints:
        notes.append(f"multi_point_constraints_used is false: {len(document.constraints)} constraints left out")
        document.constraints = []
    root = solver.text("model_part_name", "Structure")
    moved = solver.flag("move_mesh_flag", True)
    case = Case(document.mesh, root, folder, times, moved, allow_outside)
    materials = _read_materials(solver, case, document, notes)
    actions, checks = _read_processes(settings, case, notes)
    model = model_from(
        document,
        materials=materials is None,
        processes=lambda values: notes.extend(run(actions, times, values)),
    )
    for number, material in (materials or {}).items():
        model.assign(material, number)
    model.notes += notes
    return model, checks

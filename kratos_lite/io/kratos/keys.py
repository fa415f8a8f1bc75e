"""Keys and words of run files: what Kratos refuses is refused, what it ignores is named; those of modes.

Kratos compares settings with the default ones, by key and by kind of value; of some objects it reads what it
needs and ignores the rest.  Measured against Kratos 10.4.4.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import sqrt
from typing import Any

from kratos_lite.errors import nearest
from kratos_lite.io.names import nearest_variable
from kratos_lite.io.settings import Settings


def _like(example: Any, names: str) -> dict[str, Any]:
    return dict.fromkeys(names.split(), example)


SOLVER = {
    **_like("", "solver_type model_part_name computing_sub_model_part_name analysis_type "
                "convergence_criterion"),
    **_like(0, "domain_size echo_level buffer_size max_iteration displacement_relative_tolerance "
               "displacement_absolute_tolerance residual_relative_tolerance residual_absolute_tolerance"),
    **_like(False, "volumetric_strain_dofs strain_dofs rotation_dofs pressure_dofs displacement_control "
                   "reform_dofs_at_each_step use_old_stiffness_in_first_iteration use_orthogonal_subscales "
                   "compute_reactions clear_storage move_mesh_flag multi_point_constraints_used "
                   "block_builder line_search"),
    **_like({}, "model_import_settings material_import_settings time_stepping solving_strategy_settings "
                "builder_and_solver_settings linear_solver_settings"),
    **_like([], "auxiliary_variables_list auxiliary_dofs_list auxiliary_reaction_list"),
    **_like(None, "use_computing_model_part computing_model_part_name problem_domain_sub_model_part_list "
                  "processes_sub_model_part_list"),
}  # fmt: skip
"""Solver settings with a value of the kind of each; of the last ones Kratos takes any."""
IN_TIME = {"time_integration_method": "", "scheme_type": ""} | _like(
    0.0, "damp_factor_m newmark_beta rayleigh_alpha rayleigh_beta"
)
"""Those of what moves."""
ELSEWHERE = {
    **_like("give 'solver_settings' in its place", "modelers stages orchestrator restart_load_file_label"),
    "rve_settings": "a periodic cell is solved by kl.homogenized",
    **_like("contact is not solved here", "contact_settings mpc_contact_settings"),
    **_like("kratos_lite solves for displacements of all elements",
            "displacement_control volumetric_strain_dofs strain_dofs pressure_dofs use_orthogonal_subscales "
            "computing_sub_model_part_name"),
}  # fmt: skip
"""Keys that, unless false or an empty text or list, ask for what kratos_lite does not do, with the cures."""
ROOT = ("problem_data", "solver_settings", "processes", "output_processes", "ale")
READ = {
    "problem_data": "problem_name parallel_type echo_level start_time end_time",
    "solver_settings.time_stepping": "time_step time_step_table",
    "solver_settings.model_import_settings": "input_type input_filename",
    "solver_settings.material_import_settings": "materials_filename",
    "solver_settings.solving_strategy_settings": "type advanced_settings",
}
"""Objects of which Kratos reads these keys, and ignores others."""
ENTRY = "python_module kratos_module process_name name Parameters help check".split()
OLD_LISTS = (
    "list_other_processes json_output_process json_check_process check_analytic_results_process".split()
)
CRITERIA = ("residual_criterion", "displacement_criterion", "and_criterion", "or_criterion")
STRATEGIES = ("newton_raphson", "line_search")
ARC = (
    "in Kratos the length of a step depends on the number of corrections before, so that its states would "
    "be others: take model.quasi_static(arc_length=True) in Python, or prescribe displacements"
)
BUILDERS = ("block", "block_lagrange", "elimination", "p_multigrid")
OLD_BUILDERS = ("use_block_builder", "use_lagrange_BS", "type", "advanced_settings")
ITERATIVE = "solver_type tolerance max_iteration preconditioner_type scaling"
LINEAR_SOLVERS = {
    **_like(ITERATIVE, "bicgstab cg tfqmr"),
    "deflated_cg": f"{ITERATIVE} assume_constant_structure max_reduced_size",
    "amgcl": f"{ITERATIVE} block_size coarse_enough coarsening_type direct_settings "
             "gmres_krylov_space_dimension krylov_type max_levels post_sweeps pre_sweeps provide_coordinates "
             "smoother_type use_block_matrices_if_possible use_gpgpu verbosity",
    "amgcl_ns": "solver_type inner_settings scaling schur_variable verbosity",
    "fallback_linear_solver": "solver_type reset_solver_each_try solvers",
    "monotonicity_preserving": "solver_type inner_solver_settings",
    **_like("", "scaling skyline_lu_factorization sparse_lu sparse_qr sparse_cg pardiso_lu pardiso_ldlt "
                "pardiso_llt super_lu super_lu_iterative klu mumps aztec multi_level"),
}  # fmt: skip
"""Linear solvers of Kratos and their keys; nothing where it ignores what it does not know."""
SOLVER_HOMES = ("LinearSolversApplication", "EigenSolversApplication", "ExternalSolversApplication")
CORE = "KratosMultiphysics"
HOMES = (CORE, "StructuralMechanicsApplication", "ConstitutiveLawsApplication")


def unused_keys(settings: Settings, more: Mapping[str, Any], linear: bool) -> list[str]:
    """Return keys and words that change nothing, with the nearest; InputError for what Kratos refuses.

    `more` are solver settings beside `SOLVER`.
    """
    solver = settings.section("solver_settings")
    _refuse_other(settings)
    _refuse_other(solver)
    for key in IN_TIME if not more else ():
        solver.expect(key not in solver, key, "is a setting of solver_type 'dynamic'; leave it out")
    solver.check_keys({**SOLVER, **more})
    unused = _unknown(settings, ROOT)
    for path, keys in READ.items():
        section = settings
        for key in path.split("."):
            section = section.section(key)
        unused += _unknown(section, keys.split())
    unused += _parallel(settings.section("problem_data"), solver)
    unused += _solution(solver, linear)
    lists = [settings.section("processes"), settings.section("output_processes")]
    for entry in (entry for each in lists for key in each.values for entry in each.sections(key)):
        home = entry.text("kratos_module", CORE).removeprefix(f"{CORE}.")
        text = f"{home!r} is no module of Kratos here.{nearest(home, HOMES)} Take one of {', '.join(HOMES)}"
        entry.expect(home in HOMES, "kratos_module", text)
        unused += _unknown(entry, ENTRY)
    return unused


def _refuse_other(section: Settings) -> None:
    """Refuse by name what asks for other solutions, and lists of processes that Kratos once had here."""
    for key, value in section.values.items():
        cure = ELSEWHERE.get(key)
        text = f"{key} is not supported; {cure}"
        section.expect(cure is None or value in (None, False, "", []), key, text)
        is_list = key.endswith("_process_list") or key in OLD_LISTS
        section.expect(not is_list, key, f"{key!r} belongs in the object 'processes'; Kratos refuses it here")


def _unknown(section: Settings, known: Iterable[str]) -> list[str]:
    """Return the names of unknown keys, but of comments, each with the nearest known one."""
    hints = {key: nearest_variable(key, known) for key in section.unknown(known) if not key.startswith("_")}
    return [repr(section.name(key)) + (f" ({hint[1:]})" if hint else "") for key, hint in hints.items()]


def _parallel(problem: Settings, solver: Settings) -> list[str]:
    problem.number("echo_level", 0)
    word = problem.text("parallel_type", "OpenMP")
    problem.expect(word in ("OpenMP", "MPI"), "parallel_type", f"must be 'OpenMP' or 'MPI'; got {word!r}")
    for key in ("domain_size", "model_part_name"):
        text = "stands in solver_settings, too; Kratos takes one of them"
        problem.expect(key not in problem or key not in solver, key, text)
    return ["problem_data.parallel_type 'MPI' (mpirun and --backend petsc)"] if word == "MPI" else []


def _solution(solver: Settings, linear: bool) -> list[str]:
    """Check how equations are to be made and solved; return what a linear solution does not use of it."""
    unused, strategy = list[str](), solver.section("solving_strategy_settings")
    if strategy.values and not linear:
        strategy.get("type")
    words = (
        (solver, "convergence_criterion", "convergence_criterion", CRITERIA),
        (strategy, "type", "the strategy", STRATEGIES),
    )
    for section, key, what, known in words:
        word = section.text(key, known[0])
        cure = ARC if word == "arc_length" else f"take one of {', '.join(known)}"
        text = f"{what} {word!r} is not supported; {cure}"
        section.expect(word in known or linear, key, text)
        unused += [] if word in known else [f"{section.name(key)} {word!r}"]
    builder = solver.section("builder_and_solver_settings")
    if "type" in builder and "use_block_builder" not in builder:
        builder.check_keys({"type": "", "advanced_settings": {}})
        text = f"must be one of {', '.join(BUILDERS)}; got {builder.text('type')!r}"
        builder.expect(builder.text("type") in BUILDERS, "type", text)
    unused += _unknown(builder, OLD_BUILDERS)
    inverse = solver.section("linear_solver_settings")
    if "solver_type" not in inverse:
        return unused + _unknown(inverse, ("solver_type",))
    home, _, name = inverse.text("solver_type").removeprefix(f"{CORE}.").rpartition(".")
    text = f"Kratos has no linear solver {name!r}.{nearest(name, LINEAR_SOLVERS)}"
    inverse.expect(name in LINEAR_SOLVERS, "solver_type", text)
    inverse.expect(home in ("", *SOLVER_HOMES), "solver_type", f"{home!r} is no application of Kratos.")
    if keys := LINEAR_SOLVERS[name].split():
        inverse.check_keys({key: 0 if key in ("tolerance", "max_iteration") else None for key in keys})
    return unused


# ---- natural frequencies -----------------------------------------------------------------------------------

EIGEN = "eigen_value"
"""Kratos' solver_type of natural frequencies."""
EIGEN_KEYS: dict[str, Any] = {
    "scheme_type": "",
    "eigensolver_settings": {},
    "eigensolver_diagonal_values": {},
    "compute_modal_decomposition": False,
    "normalize_eigenvectors_with_mass_matrix": False,
}
"""Its solver settings beside those of all, with a value of the kind of each."""
OF_ALL = ("solver_type", "max_iteration", "echo_level", "number_of_eigenvalues")
EIGENSOLVERS = {
    "spectra_sym_g_eigs_shift": (*OF_ALL, "normalize_eigenvectors", "shift"),
    "eigen_eigensystem": (*OF_ALL, "normalize_eigenvectors", "tolerance", "use_mkl_if_available"),
    "feast": (
        *OF_ALL, "symmetric", "search_lowest_eigenvalues", "search_highest_eigenvalues", "sort_eigenvalues",
        "sort_order", "subspace_size", "search_dimension", "tolerance", "e_min", "e_max", "lambda_min",
        "lambda_max", "print_feast_output", "perform_stochastic_estimate", "solve_eigenvalue_problem",
        "linear_solver_settings",
    ),
}  # fmt: skip
"""Settings of the solvers of Kratos that find the lowest modes, by their names."""
LARGEST = "search_highest_eigenvalues"


def modes_of(solver: Settings, notes: list[str]) -> tuple[int, float | None]:
    """Return the number of modes, and the frequency in rad/s above which they are, or None for the lowest."""
    scheme = solver.text("scheme_type", "dynamic")
    solver.expect(scheme == "dynamic", "scheme_type", f"scheme_type {scheme!r} is not known; take 'dynamic'")
    settings = solver.section("eigensolver_settings")
    kind = settings.text("solver_type", "spectra_sym_g_eigs_shift")
    hint = f"{nearest(kind, EIGENSOLVERS)} Take one of {', '.join(EIGENSOLVERS)}"
    settings.expect(kind in EIGENSOLVERS, "solver_type", f"the solver {kind!r} is not supported.{hint}")
    settings.check_keys(EIGENSOLVERS[kind])
    settings.expect(not settings.flag(LARGEST, False), LARGEST, "the lowest eigenvalues are found alone")
    for key in ("lambda_min", "e_min"):
        text = f"eigenvalues above {key} alone are not supported; take spectra_sym_g_eigs_shift with a shift"
        settings.expect(settings.number(key, 0.0) <= 0, key, text)
    default = 0 if kind == "feast" else 5 if "eigensolver_settings" not in solver else 1
    sizes = ("number_of_eigenvalues", "search_dimension", "subspace_size")
    count = max(settings.integer(key, default * (key == sizes[0])) for key in sizes)
    settings.expect(count >= 1, sizes[0], f"must be at least 1; got {count}")
    if kind == "feast":
        notes.append(f"feast: the {count} lowest modes are found, whatever the largest eigenvalue requested")
    shift = settings.number("shift", 0.0)
    # Spectra takes the largest 1 / (λ - shift), not the largest in magnitude; measured against Kratos 10.4.4.
    settings.expect(shift >= 0, "shift", f"must be an eigenvalue ω² ≥ 0; got {shift:g}")
    if solver.flag("compute_modal_decomposition", False):
        notes.append("compute_modal_decomposition is not used: modes have the modal mass 1, stiffness ω²")
    return count, sqrt(shift) or None

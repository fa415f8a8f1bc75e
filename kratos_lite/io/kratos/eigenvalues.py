"""Run files of Kratos with the solver_type ``eigen_value``: number and place of modes, expected values."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import sqrt
from typing import Any

import numpy as np

from kratos_lite.errors import nearest
from kratos_lite.io.kratos.context import RunContext
from kratos_lite.io.settings import Settings

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
COMMON = ("solver_type", "max_iteration", "echo_level", "number_of_eigenvalues")
KEYS = {
    "spectra_sym_g_eigs_shift": (*COMMON, "normalize_eigenvectors", "shift"),
    "eigen_eigensystem": (*COMMON, "normalize_eigenvectors", "tolerance", "use_mkl_if_available"),
    "feast": (
        *COMMON, "symmetric", "search_lowest_eigenvalues", "search_highest_eigenvalues", "sort_eigenvalues",
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
    text = f"the solver {kind!r} is not supported.{nearest(kind, KEYS)} Take one of {', '.join(KEYS)}"
    settings.expect(kind in KEYS, "solver_type", text)
    settings.check_keys(KEYS[kind])
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


def eigenvalue_comparisons(settings: Settings, context: RunContext) -> Iterator[Callable[[Any], str]]:
    """Yield the comparison of check_eigenvalues_process: ω² to 5 decimals, as many as are stated."""
    settings.check_keys(("help", "model_part_name", "variable_name", "reference_values"))
    text = settings.text("reference_values").strip("[] ")
    try:
        wanted = np.array([float(word) for word in text.split(",")])
    except ValueError:
        text = f"must be numbers such as '[1.0, 2.5]'; got {text!r}"
        raise settings.error("reference_values", text) from None

    def compare(frequencies: Any) -> str:
        found = frequencies[: len(wanted)] ** 2
        off = np.abs(found - wanted[: len(found)])
        i = int(off.argmax())
        word = "passed" if off[i] <= 0.5e-5 else "failed"
        numbers = f"found {found[i]:.9g}, expected {wanted[i]:.9g}, tolerance 5e-06"
        return f"check EIGENVALUE_VECTOR {word} (eigenvalue {i + 1}: {numbers})"

    yield compare

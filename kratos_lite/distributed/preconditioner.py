"""Which solver and preconditioner of PETSc a system gets, and why."""

from __future__ import annotations

from collections.abc import Mapping

from kratos_lite.elements.formulations import NEAR_HALF
from kratos_lite.solvers.linear_solver import METHODS
from kratos_lite.validation import choice

DIRECT_LIMIT = 30_000
"""Up to this many unknowns a factorization is as fast as an iteration, and exact for any conditioning."""
FALLBACK_LIMIT = 300_000
"""Up to this many unknowns a factorization is tried when the iteration fails."""

CONJUGATE_GRADIENTS: dict[str, str | None] = {"ksp_type": "cg", "ksp_norm_type": "unpreconditioned"}
"""K is symmetric and positive definite; the norm is that of the residual, to which tolerances refer."""
MULTIGRID: dict[str, str | None] = CONJUGATE_GRADIENTS | {
    "pc_type": "gamg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
}
"""Smoothed aggregation of PETSc."""
FACTORIZATION: dict[str, str | None] = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
}
"""MUMPS, which factorizes over ranks."""


def choose(solver: str, unknowns: int, nearly: bool, given: Mapping[str, str | None]) -> tuple[str, str]:
    """Return the method, ``direct`` or ``amg``, and the reason in words.

    Parameters
    ----------
    solver : ``auto``, ``dense``, ``direct`` or ``amg``.
    unknowns : of all ranks.
    nearly : whether a material is nearly incompressible.
    given : options of the user.

    Examples
    --------
    >>> choose("auto", 1000, False, {})[0], choose("auto", 10**7, False, {})[0]
    ('direct', 'amg')
    """
    if choice(solver, "solver", METHODS) != "auto":
        return "direct" if solver == "dense" else solver, "asked for"
    if {"ksp_type", "pc_type"} & set(given):
        return "amg", "PETSc options ask for it"
    if unknowns <= DIRECT_LIMIT:
        return "direct", f"{unknowns} unknowns ≤ {DIRECT_LIMIT}: a factorization is fastest"
    if nearly and unknowns <= FALLBACK_LIMIT:
        return "direct", f"few unknowns with a bulk modulus > {NEAR_HALF:g} shear moduli: iterations are slow"
    return "amg", f"{unknowns} unknowns > {DIRECT_LIMIT}: multigrid is fastest and takes least memory"


def options_of(method: str) -> dict[str, str | None]:
    """Return the options of PETSc for a method."""
    return FACTORIZATION if method == "direct" else MULTIGRID

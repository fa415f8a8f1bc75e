"""Options of PETSc for a method of solution."""

from __future__ import annotations

from collections.abc import Mapping

from kratos_lite.distributed.petsc import has_mumps
from kratos_lite.solvers.plan import Facts, Plan, over_ranks

CONJUGATE_GRADIENTS: dict[str, str | None] = {"ksp_type": "cg", "ksp_norm_type": "unpreconditioned"}
"""K is symmetric and positive definite; the norm is that of the residual, to which tolerances refer."""
MULTIGRID: dict[str, str | None] = CONJUGATE_GRADIENTS | {
    "pc_type": "gamg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
    "pc_gamg_threshold": "0.02",
    "pc_gamg_coarse_eq_limit": "1000",
}
"""Smoothed aggregation of PETSc.

Chosen on clamped blocks; a cube on rollers, whose load excites few modes, would choose wrongly.  Jacobi, as
aggregates of too few nodes leave zeros on the diagonal of coarse levels, on which others fail.  Two steps of
Chebyshev: three save fewer iterations than they cost, one takes 60 % more.  The threshold takes 10 % of the
iterations of 27N, none of 8N and 10N.  Without aggressive coarsening (the default of PETSc) there are a third
fewer iterations, but preparing takes five times as long, and twice the memory.
"""
NORMED = ("cg", "fcg", "pipecg", "gmres", "fgmres", "gcr", "bcgs")
"""Iterations that know the residual itself."""
FACTORIZATION: dict[str, str | None] = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
}
"""MUMPS, which factorizes over ranks."""


def plan_of(solver: str, unknowns: int, ratio: float, given: Mapping[str, str | None]) -> Plan:
    """Return how PETSc solves: of all ranks, the unknowns and the largest bulk over shear modulus."""
    facts = Facts(unknowns, bulk_over_shear=lambda: (ratio, ratio))
    return over_ranks(solver, facts, has_mumps(), bool({"ksp_type", "pc_type"} & set(given)))


def options_of(method: str, given: Mapping[str, str | None], multigrid: bool) -> dict[str, str | None]:
    """Return the options of PETSc for a method, but for what contradicts those of the user."""
    chosen = dict(CONJUGATE_GRADIENTS if method == "amg" and not multigrid else MULTIGRID)
    if method == "direct" and not {"ksp_type", "pc_type"} & set(given):
        chosen = dict(FACTORIZATION)
    if given.get("pc_type") in ("lu", "cholesky"):
        chosen["pc_factor_mat_solver_type"] = "mumps"
    if "pc_factor_mat_solver_type" in chosen and not has_mumps():
        del chosen["pc_factor_mat_solver_type"]  # PETSc's own, on one process
    if given.get("ksp_type", "cg") not in NORMED:
        chosen.pop("ksp_norm_type", None)
    return chosen

"""Steady motion: the state at rest in space of a body whose material moves through the mesh."""

from __future__ import annotations

from kratos_lite.ale.checks import critical_rate_estimate, near_critical
from kratos_lite.analysis.derived_quantities import motion_summary
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.modal import lowest_critical_rate
from kratos_lite.analysis.nodal_loads import at_temperature, initial_loads, stress_load
from kratos_lite.analysis.result import Result, result_of
from kratos_lite.analysis.solution_checks import Phases, check_arguments, check_deformation, check_solution
from kratos_lite.model.checks import check_loads, equilibrium
from kratos_lite.model.loads.base import equal_loads
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.plan import Facts, choose
from kratos_lite.typing import Progress


def solve_steady(
    model: Structure, solver: str = "auto", tolerance: float = 1e-10, progress: Progress | None = None
) -> Result:
    """Solve (K - rate² H + …) u = f of a model with a motion, at the time 0; see `Model.solve`."""
    check_arguments(solver, tolerance)
    phase = Phases(progress)
    with phase("check"):
        e = EquationsOfMotion(model, free=False, steady=True, solver=solver, progress=progress)
        assert e.terms is not None
        warnings, changing, motion, rate = list(e.warnings), [], e.terms.motion, e.rates(0.0)[0]
        if not motion.steady:
            changing.append(f"the rate changes; this is the steady state of {rate:g}, as at the time 0")
        if not motion.uniformly_accelerated:
            changing.append("the acceleration of the center changes; it is taken as at the time 0")
    with phase("load"):
        forces, inertia = e.load(0.0), e.inertia_load(0.0)
        nodal = e.system.scatter(forces).copy()
        warnings += equal_loads(model.loads, model.named_loads)
        warnings += check_loads(model.loads, e.system.groups, nodal, model.supports)
    with phase("assemble"):
        A, symmetric = e.matrix(0.0, 0.0, 0.0, 1.0), e.is_symmetric(0.0, 0.0)
    with phase("solve"):
        n, constraints = len(e.system.nodes), e.system.constraint_map
        plan = choose(solver, Facts(len(constraints.free), 3 * n, symmetric, "steps"))
        near = e.system.equations if plan.iterates else None
        equations = LinearSolver(A, constraints, e.system.points, plan, symmetric, near)
        solution = equations.solve(forces, tolerance, progress)
    with phase("verify"):
        u = solution.x
        warnings += check_deformation(model, e.groups, e.system.scatter(u))
        reactions = model.reactions(e.system.scatter(A @ u - forces), e.system.scatter(u))
        inner = e.system.scatter(e.times_stiffness(u, 0.0) - e.K @ u)  # what the motion adds is a force, too
        groups = at_temperature(model, e.groups, 0.0)
        stresses = stress_load(model, groups, e.system.scatter(u))
        initial = initial_loads(model, groups)
        stresses = stresses if initial is None else stresses - initial  # as in the load
        balance = equilibrium(model.mesh.points, nodal - inner, reactions, stresses)
        check_solution(solution, u, balance)
        critical = lowest_critical_rate(e) if rate else None
        if rate:
            limit = critical_rate_estimate(e.terms) if critical is None else critical
            warnings += near_critical(motion, 0.0, limit, critical is not None)
    report = {
        "unknowns": len(e.system.constraint_map.free),
        "seconds": phase.seconds,
        "warnings": warnings,
        "notes": changing,
        "skipped": [] if rate or inertia.any() else ["convective terms, as the rate is 0"],
    }
    fields = e.system.scatter(u), reactions, nodal
    result = result_of(Result, None, model, groups, fields, solution, balance, **report)
    result.report.motion = motion_summary(e, result, critical)
    return result

"""SfePy: its linear-elastic term on Lagrange fields; K solved by the common routine."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job, assembled, rows_of

CELLS = {"4N": ("3_4", 4, 1), "8N": ("3_8", 8, 1), "10N": ("3_4", 4, 2), "27N": ("3_8", 8, 2)}
"""Cell, its corners, and the order of the field."""


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import sfepy
        import sfepy.discrete.fem
        import sfepy.mechanics.matcoefs
        import sfepy.terms
    sfepy.base.base.output.set_output(quiet=True)
    job.answer["version"] = sfepy.__version__
    job.read()
    with job.phase("mesh"):
        problem, field = make_problem(job)
        places = rows_of(field.get_coor(), job.points)
        evaluator, start = problem.get_evaluator(), problem.get_initial_state()()
    dofs = 3 * places[:, None] + np.arange(3)
    return assembled(job, lambda: evaluator.eval_tangent_matrix(start), dofs)


def make_problem(job: Job) -> tuple[Any, Any]:
    """Return the problem without any support, and its field."""
    from sfepy.discrete import Equation, Equations, FieldVariable, Integral, Material, Problem
    from sfepy.discrete.conditions import Conditions
    from sfepy.discrete.fem import FEDomain, Field, Mesh
    from sfepy.mechanics.matcoefs import stiffness_from_youngpoisson
    from sfepy.terms import Term

    cell, corners, order = CELLS[job.kind]
    used, nodes = np.unique(job.nodes[:, :corners], return_inverse=True)
    nodes = nodes.reshape(-1, corners).astype(np.int32)
    groups, ids = np.zeros(len(used), dtype=np.int32), np.zeros(len(nodes), dtype=np.int32)
    mesh = Mesh.from_data("mesh", job.points[used], groups, [nodes], [ids], [cell])
    omega = FEDomain("domain", mesh).create_region("Omega", "all")
    field = Field.from_args("u", np.float64, "vector", omega, approx_order=order)
    u = FieldVariable("u", "unknown", field)
    v = FieldVariable("v", "test", field, primary_var_name="u")
    material = Material("m", D=stiffness_from_youngpoisson(3, *job.elasticity))
    integral = Integral("i", order={"4N": 1, "8N": 3, "10N": 2, "27N": 5}[job.kind])
    term = Term.new("dw_lin_elastic(m.D, v, u)", integral, omega, m=material, v=v, u=u)
    problem = Problem("elasticity", equations=Equations([Equation("balance", term)]))
    problem.set_bcs(ebcs=Conditions([]))
    problem.time_update()
    problem.update_materials()
    return problem, field

"""Kratos: read the `.mdpa` file, build, solve by its AMGCL at the same residual, write VTK."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.programs import linear
from benchmarks.programs.common import Array, Job

AXES = "XYZ"
SOLVERS = {
    "AMGCL": {"krylov_type": "cg", "smoother_type": "gauss_seidel"},
    "LU": {"solver_type": "LinearSolversApplication.sparse_lu"},
}
"""Its multigrid with the fastest and most robust settings of all tried, and Eigen's factorization."""
BLOCKS = {"block_size": 3, "use_block_matrices_if_possible": True, "verbosity": 0}
ON_MATRIX = {"krylov_type": "cg", "smoother_type": "ilu0", "coarsening_type": "smoothed_aggregation"}
"""The fastest settings of those tried on the matrix of the clamped block."""
KEEP: list[Any] = []  # Kratos frees a model as soon as Python forgets it


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import KratosMultiphysics as KM
        import KratosMultiphysics.LinearSolversApplication
        import KratosMultiphysics.StructuralMechanicsApplication as SMA
    KM.Logger.GetDefaultOutput().SetSeverity(KM.Logger.Severity.WARNING)
    job.answer["version"] = ".".join(re.findall(r"\d+", KM.KratosGlobals.Kernel.Version())[:3])
    if job.task == "linear":
        system(job, KM)
        return None
    with job.phase("read"):
        part = read(job, KM, SMA)
    if job.task == "parse":
        return None
    with job.phase("check"):
        prepare(part, KM, SMA)
    solve(job, KM, part)
    if job.task == "assembly":
        return None
    if job.given.get("write"):
        with job.phase("write"):
            write(job, KM, part)
    u = KM.VariableUtils().GetSolutionStepValuesVector(part.Nodes, KM.DISPLACEMENT, 0, 3)
    return np.array(u).reshape(-1, 3)


def read(job: Job, KM: Any, SMA: Any) -> Any:
    """Return the model part of the file."""
    model = KM.Model()
    KEEP.append(model)
    part = model.CreateModelPart("Structure")
    part.ProcessInfo[KM.DOMAIN_SIZE] = 3
    pressures = KM.POSITIVE_FACE_PRESSURE, KM.NEGATIVE_FACE_PRESSURE
    loads = KM.VOLUME_ACCELERATION, SMA.POINT_LOAD, SMA.SURFACE_LOAD
    for variable in (KM.DISPLACEMENT, KM.REACTION, *loads, *pressures):
        part.AddNodalSolutionStepVariable(variable)
    KM.ModelPartIO(job.stem, KM.IO.READ | KM.IO.SKIP_TIMER).ReadModelPart(part)
    return part


def prepare(part: Any, KM: Any, SMA: Any) -> None:
    """Add degrees of freedom and the constitutive law."""
    for axis in AXES:
        displacement, reaction = (getattr(KM, f"{name}_{axis}") for name in ("DISPLACEMENT", "REACTION"))
        KM.VariableUtils().AddDof(displacement, reaction, part)
    for properties in part.Properties:
        if not properties.Has(KM.CONSTITUTIVE_LAW):
            properties.SetValue(KM.CONSTITUTIVE_LAW, SMA.LinearElastic3DLaw())


def linear_solver(job: Job, KM: Any) -> Any:
    """Return the solver that the job names, or Kratos's AMGCL with 3 × 3 blocks as it comes."""
    from KratosMultiphysics.python_linear_solver_factory import ConstructSolver

    job.answer["solver"] = job.given.get("kratos_solver", "")
    settings = {"solver_type": "amgcl", "tolerance": job.tolerance, "max_iteration": 1000} | BLOCKS
    return ConstructSolver(KM.Parameters(json.dumps(settings | SOLVERS.get(job.answer["solver"], {}))))


def solve(job: Job, KM: Any, part: Any) -> None:
    """Take the steps of ResidualBasedLinearStrategy one by one, each timed."""
    solver = linear_solver(job, KM)
    scheme = KM.ResidualBasedIncrementalUpdateStaticScheme()
    builder = KM.ResidualBasedBlockBuilderAndSolver(solver)
    strategy = KM.ResidualBasedLinearStrategy(part, scheme, builder, True, False, False, False)
    strategy.SetEchoLevel(0)
    space = KM.UblasSparseSpace()
    with job.phase("pattern"):
        strategy.Initialize()
        strategy.InitializeSolutionStep()
        A, b = strategy.GetSystemMatrix(), strategy.GetSystemVector()

    def build() -> None:
        space.SetToZeroMatrix(A)
        space.SetToZeroVector(b)
        builder.Build(scheme, part, A, b)

    job.fastest("matrix", build)
    if job.task == "assembly":
        return
    x = KM.Vector(b.Size())
    space.SetToZeroVector(x)
    with job.phase("constrain"):
        builder.ApplyDirichletConditions(scheme, part, A, x, b)
    with job.phase("solve"):
        solver.Initialize(A, x, b)
        solver.Solve(A, x, b)
    with job.phase("verify"):
        scheme.Update(part, builder.GetDofSet(), A, x, b)
        builder.CalculateReactions(scheme, part, A, x, b)
    job.answer["unknowns"] = b.Size()
    if iterations := solver.GetIterationsNumber():
        job.answer["iterations"] = iterations


def system(job: Job, KM: Any) -> None:
    """Solve the system of a file by AMGCL; its matrix takes no arrays, so it is filled entry by entry."""
    A, b, _ = linear.read(job)
    with job.phase("matrix"):
        rows, K = A.tocsr(), KM.CompressedMatrix(*A.shape)
        ends = rows.indptr.tolist()
        for i, (start, end) in enumerate(pairwise(ends)):
            for j, value in zip(rows.indices[start:end].tolist(), rows.data[start:end].tolist(), strict=True):
                K[i, j] = value
        del rows
        load, x = KM.Vector(b), KM.Vector(0 * b)
    settings = {"tolerance": job.tolerance, "max_iteration": linear.MAX_ITERATIONS} | BLOCKS | ON_MATRIX
    solver = KM.AMGCLSolver(KM.Parameters(json.dumps(settings)))
    with linear.measured(job), job.phase("solve"):
        solver.Initialize(K, x, load)
        solver.Solve(K, x, load)
    linear.check_solution(job, A, b, np.array(x), solver.GetIterationsNumber())


def write(job: Job, KM: Any, part: Any) -> None:
    """Write displacements, reactions and nodal stresses as binary VTK."""
    settings = {
        "model_part_name": "Structure",
        "file_format": "binary",
        "output_path": job.given["folder"],
        "output_sub_model_parts": False,
        "nodal_solution_step_data_variables": ["DISPLACEMENT", "REACTION"],
        "gauss_point_variables_extrapolated_to_nodes": ["CAUCHY_STRESS_VECTOR", "VON_MISES_STRESS"],
    }
    KM.VtkOutput(part, KM.Parameters(json.dumps(settings))).PrintOutput()

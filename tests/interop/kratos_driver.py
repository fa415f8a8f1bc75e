"""Let Kratos read, solve and write `.mdpa` files: ``python kratos_driver.py jobs.json answers.json``.

It runs in a process of its own, since Kratos prints a lot and may abort.  A job is

    {"mdpa": path, "solve": bool, "elasticity": 6 × 6 or null, "write": path or null, "values": names or null}
"""

import json
import sys
from pathlib import Path

import KratosMultiphysics as KM
import KratosMultiphysics.LinearSolversApplication
import KratosMultiphysics.StructuralMechanicsApplication as SMA
from KratosMultiphysics.python_linear_solver_factory import ConstructSolver

AXES = "XYZ"
HISTORICAL = (
    KM.DISPLACEMENT, KM.REACTION, KM.VOLUME_ACCELERATION, KM.POSITIVE_FACE_PRESSURE,
    KM.NEGATIVE_FACE_PRESSURE, SMA.POINT_LOAD, SMA.SURFACE_LOAD,
)  # fmt: skip
MATERIAL = (KM.DENSITY, KM.YOUNG_MODULUS, KM.POISSON_RATIO)
KEEP = []  # Kratos frees a model as soon as Python forgets it, parts still in use included


def stem(path):
    return str(path).removesuffix(".mdpa")


def read(job):
    model = KM.Model()
    KEEP.append(model)
    part = model.CreateModelPart("Structure")
    part.ProcessInfo[KM.DOMAIN_SIZE] = 3
    for variable in HISTORICAL:
        part.AddNodalSolutionStepVariable(variable)
    flags = KM.IO.READ | KM.IO.SKIP_TIMER
    KM.ModelPartIO(stem(job["mdpa"]), flags).ReadModelPart(part)
    for axis in AXES:
        u, r = (getattr(KM, f"{name}_{axis}") for name in ("DISPLACEMENT", "REACTION"))
        KM.VariableUtils().AddDof(u, r, part)
    for properties in part.Properties:
        if job.get("elasticity"):
            properties.SetValue(KM.CONSTITUTIVE_LAW, SMA.UserProvidedLinearElastic3DLaw())
            properties.SetValue(SMA.ELASTICITY_TENSOR, KM.Matrix(job["elasticity"]))
        elif not properties.Has(KM.CONSTITUTIVE_LAW):
            properties.SetValue(KM.CONSTITUTIVE_LAW, SMA.LinearElastic3DLaw())
    return part


def solve(part):
    solver = ConstructSolver(KM.Parameters('{"solver_type": "LinearSolversApplication.sparse_lu"}'))
    scheme, builder = KM.ResidualBasedIncrementalUpdateStaticScheme(), KM.ResidualBasedBlockBuilderAndSolver
    strategy = KM.ResidualBasedLinearStrategy(part, scheme, builder(solver), True, False, False, False)
    strategy.SetEchoLevel(0)
    strategy.Check()
    strategy.Initialize()
    strategy.Solve()


def vectors(part, variable):
    return {node.Id: list(node.GetSolutionStepValue(variable)) for node in part.Nodes}


def matrix(m):
    return [[m[i, j] for j in range(m.Size2())] for i in range(m.Size1())]


def element(one, info):
    """Return what Kratos computes on one element: K, and the Gauss points X with their weights γ det J."""
    K, rhs = KM.Matrix(), KM.Vector()
    one.Initialize(info)
    one.CalculateLocalSystem(K, rhs, info)
    return {
        "nodes": [node.Id for node in one.GetNodes()],
        "points": [list(p) for p in one.CalculateOnIntegrationPoints(KM.INTEGRATION_COORDINATES, info)],
        "weights": list(one.CalculateOnIntegrationPoints(KM.INTEGRATION_WEIGHT, info)),
        "K": matrix(K),
    }


def rows(value):
    """Return what Kratos has at one point as numbers."""
    if hasattr(value, "Size2"):
        return matrix(value)
    return value if isinstance(value, float) else list(value)


def values(one, names, info):
    """Return quantities at the Gauss points of a solved element, and its matrices."""
    K, M, r = KM.Matrix(), KM.Matrix(), KM.Vector()
    one.CalculateLocalSystem(K, r, info)
    one.CalculateMassMatrix(M, info)
    found = {"K": matrix(K), "M": matrix(M), "r": list(r)}
    for name in names:
        variable = KM.KratosGlobals.GetVariable(name)
        found[name] = [rows(value) for value in one.CalculateOnIntegrationPoints(variable, info)]
    return found


def describe(part):
    fixed = [
        [node.Id, axis.lower(), node.GetSolutionStepValue(getattr(KM, f"DISPLACEMENT_{axis}"))]
        for node in part.Nodes
        for axis in AXES
        if node.IsFixed(getattr(KM, f"DISPLACEMENT_{axis}"))
    ]
    parts = {
        sub.FullName().removeprefix("Structure."): [node.Id for node in sub.Nodes]
        for sub in part.SubModelParts
    }
    properties = {
        p.Id: {v.Name(): p.GetValue(v) for v in MATERIAL if p.Has(v)}
        | {"VOLUME_ACCELERATION": list(p.GetValue(KM.VOLUME_ACCELERATION))}
        for p in part.Properties
    }
    return {
        "nodes": {node.Id: [node.X0, node.Y0, node.Z0] for node in part.Nodes},
        "conditions": part.NumberOfConditions(),
        "constraints": part.NumberOfMasterSlaveConstraints(),
        "fixed": fixed,
        "parts": parts,
        "properties": properties,
    }


def answer(job):
    part = read(job)
    found = describe(part)
    if job.get("write"):
        KM.ModelPartIO(stem(job["write"]), KM.IO.WRITE | KM.IO.SCIENTIFIC_PRECISION).WriteModelPart(part)
    solids = [one for one in part.Elements if len(one.GetNodes()) > 1]
    found["elements"] = {one.Id: element(one, part.ProcessInfo) for one in solids}
    if job.get("solve"):
        solve(part)
        found["displacement"] = vectors(part, KM.DISPLACEMENT)
        found["reaction"] = vectors(part, KM.REACTION)
    if job.get("values"):
        found["values"] = {one.Id: values(one, job["values"], part.ProcessInfo) for one in part.Elements}
    return found


if __name__ == "__main__":
    jobs, answers = map(Path, sys.argv[1:])
    answers.write_text(json.dumps([answer(job) for job in json.loads(jobs.read_text())]))

"""Copies of test folders of Kratos below a path, here and in a live Kratos with ConstitutiveLaws."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

import kratos_lite as kl
from benchmarks.driver import ROOT
from benchmarks.tables import Row, error, table
from kratos_lite.typing import Array

PAGE, LIMIT, AGREES = ROOT / "docs" / "about" / "kratos-folders.md", "120", 1e-6
KRATOS = """
import json, sys, time
import numpy as np, KratosMultiphysics as KM, KratosMultiphysics.ConstitutiveLawsApplication
import KratosMultiphysics.StructuralMechanicsApplication as application
from KratosMultiphysics.StructuralMechanicsApplication import structural_mechanics_analysis as module
class Analysis(module.StructuralMechanicsAnalysis):
    def OutputSolutionStep(self):
        part = self.model[solver["model_part_name"]]
        if solver["solver_type"] == "eigen_value":
            steps[:] = [list(part.ProcessInfo[application.EIGENVALUE_VECTOR])]
            return
        nodes = sorted(part.Nodes, key=lambda node: node.Id)
        steps.append([list(node.GetSolutionStepValue(KM.DISPLACEMENT)) for node in nodes])
        if time.time() > start + float(sys.argv[2]):
            self.end_time = 0.0
def modern(value):  # of files of 2019
    if isinstance(value, list):
        return [modern(one) for one in value if "check" not in str(dict(one).get("python_module", ""))
            ] if value and isinstance(value[0], dict) else value
    if not isinstance(value, dict):
        return value
    found = {key: modern(one) for key, one in value.items() if key not in old}
    name = found.get("model_part_name", root)
    if name.split(".")[0] != root:
        found["model_part_name"] = f"{root}.{name}"
    return found
def read(path):
    return json.loads(KM.Parameters(open(path).read()).WriteJsonString())
old = ("mesh_id", "problem_domain_sub_model_part_list", "processes_sub_model_part_list", "rve_settings")
settings = read(sys.argv[1])
root = settings["solver_settings"]["model_part_name"]
settings = modern(settings) | {"output_processes": {}}
solver = settings["solver_settings"]
if solver["solver_type"] == "eigen_value":
    kind = {"solver_type": "spectra_sym_g_eigs_shift", "number_of_eigenvalues": int(sys.argv[3])}
    if solver.get("eigensolver_settings", {}).get("solver_type") == "feast":
        solver["eigensolver_settings"] = kind
elif len(sys.argv) == 4:
    solver |= {"residual_relative_tolerance": 1e-10, "max_iteration": 30}
    if solver.get("linear_solver_settings", {}).get("solver_type", "").startswith("ExternalSolvers"):
        del solver["linear_solver_settings"]
materials = solver["material_import_settings"]["materials_filename"]
json.dump(modern(read(materials)), open("modern.json", "w"))
solver["material_import_settings"]["materials_filename"] = "modern.json"
steps, start, model = [], time.time(), KM.Model()
Analysis(model, KM.Parameters(json.dumps(settings))).Run()
np.save("u.npy", steps)
"""
"""Runs a file, also of 2019, without its checks, until its end or a limit in seconds, to small residuals, or
its own with a fourth word."""
FILES = r'"(?:input_filename|materials_filename)"\s*:\s*"(.*?)"'
LAW, NAMES = r'"constitutive_law"\s*:\s*\{([^}]*)\}', r'"(?:name|yield_surface)"\s*:\s*"([\w.]+)"'
SOLID = r"Begin Elements\s+((?:SmallDisplacement|TotalLagrangian|UpdatedLagrangian)\w*3D\d+N)"
REASON = r"^\S+: (?:[\w.\[\]]+: )?(?:part \S+: )?(.*?)(?:; (?:Did|Choose|take).*|\. (?=[A-Z]).*|)$"
DIFFERS = {
    "updated_lagrangian": "C E is Cauchy's stress in Kratos, a cycle of which does work; here Piola's second",
}
TEXT = """# Test folders of Kratos

Run files of solids from Kratos's own tests, of today and, below `2019`, of that year, here and in a live
Kratos 10.4.4, which runs them without their checks and outputs, to relative residuals of 1e-10, those of
2019 with the names of parts and keys of today. *Difference*: of the displacements of all nodes after
each step that Kratos takes in {limit} s, relative to the largest, or of frequencies; *agrees*: at most
{agrees:g}. *Expected*: in the folder; those of 2019 that failed are the PLASTIC_DISSIPATION of then.
Tests of Swift's law and of B-bar elements have no run files. Not taken over: the flow of Kratos's Tresca
and modified Mohr–Coulomb exchanges the shears yz and zx, so that it depends on the axes (a note says so);
without these shears it is the same here, with the jump of 5 % near the corners.

Nor is the stress of updated Lagrangian elements with LinearElastic3DLaw taken over. A cube of 1 m, E 1000 Pa
and ν .3, held at its sides and stretched by 1.5, has E_zz = .625 and the second stress of Piola and Kirchhoff
S_zz = (λ + 2 G) .625 = 841.346 Pa, so that the force is 1.5 S_zz = 1262.019 N: so it is here, and in Kratos
with total Lagrangian elements, or with KirchhoffSaintVenant3DLaw in both. With updated ones and
LinearElastic3DLaw it is 841.346 N there, and PK2_STRESS_VECTOR and CAUCHY_STRESS_VECTOR both are 841.346 Pa,
which cannot be at det F = 1.5. No energy has the stress σ = C E: with stretches a, b and forces T = σ_a b,
Q = σ_b a, ∂T/∂b - ∂Q/∂a = (G - λ)(a² - b²), so that a closed cycle does work.

{counts}.

`python -m benchmarks folders PATH --python PYTHON` makes this page of the folders below a path.

"""


def folders(path: Path, kratos: str) -> None:
    """Run all files below a folder and write the page."""
    rows = []
    for file in sorted(filter(is_of_solids, path.rglob("*arameters.json"))):
        year = "2019/" if "2019" in file.parts else ""
        name = f"{year}{file.parent.name}/{file.stem.removesuffix('_parameters')}"
        with tempfile.TemporaryDirectory() as scratch:
            rows.append({"file": name} | compared(file, kratos, scratch))
        print(rows[-1], flush=True)
        PAGE.write_text(page(rows), encoding="utf-8")


def is_of_solids(file: Path) -> bool:
    """Return whether a file runs elements of solids in three dimensions, as far as it can be read."""
    text = file.read_text()
    if not re.search(r'"solver_settings"', text) or not re.search(r'"domain_size"\s*:\s*3', text):
        return False
    if len(found := re.findall(FILES, text)) != 2:
        return False
    meshes = [folder / f"{found[0]}.mdpa" for folder in file.parents]
    mesh = next((one for one in meshes if one.is_file()), None)
    return mesh is None or re.search(SOLID, mesh.read_text()) is not None


def compared(file: Path, kratos: str, scratch: str) -> Row:
    """Return the row of a run file, whose names count from a folder above it."""
    mesh, materials = re.findall(FILES, file.read_text())
    root = next(folder for folder in file.parents if (folder / materials).is_file())
    laws = {" ".join(re.findall(NAMES, law)) for law in re.findall(LAW, (root / materials).read_text())}
    row: Row = {"law": ", ".join(sorted(laws))}
    if not (source := root / f"{mesh}.mdpa").is_file():
        return row | {"verdict": "file not at hand", "reason": mesh}
    row["elements"] = ", ".join({*re.findall(r"Begin Elements (\w+)", source.read_text())})
    run_file = shutil.copy(file, shutil.copytree(root, scratch, dirs_exist_ok=True))
    try:
        case = kl.read_case(run_file)
        theirs = of_kratos(kratos, run_file, scratch, case.modes)
        if theirs is None:
            return row | {"verdict": "not run by Kratos"}
        theirs = theirs[-1 if case.time is None else 0 :]
        if case.time is not None:
            case.time = replace(case.time, steps=min(len(theirs), case.time.steps))
            case.outputs.results = [f"{scratch}/u.npz"]
        outcome = kl.run(case)
    except kl.KratosLiteError as problem:
        return row | {"verdict": "refused", "reason": re.sub(REASON, r"\1", str(problem))}
    if case.modes:
        u, theirs = np.sqrt(np.sort([theirs[-1], outcome.modes[0] ** 2]))
    else:
        u = outcome.result.u if case.time is None else np.load(f"{scratch}/u.npz")["u"][1:]
        u = u[..., np.argsort(case.model.mesh.node_ids), :]
    off = np.abs(u - theirs).max() / (np.abs(theirs).max() or 1.0)
    found = re.findall("passed|failed|not evaluated", "\n".join(outcome.compare()))
    row |= {"steps": len(theirs), "difference": error(off), "expected": ", ".join(sorted({*found}))}
    why = {"verdict": "differs", "reason": DIFFERS.get(file.parent.name, "")}
    return row | (why if off > AGREES else {"verdict": "agrees"})


def of_kratos(kratos: str, run_file: str, scratch: str, modes: int) -> Array | None:
    """Return the displacements (steps, n, 3) in Kratos, or eigenvalues (1, k); None where it fails."""
    command = [kratos, "-c", KRATOS, run_file, LIMIT, str(modes)]
    done = subprocess.run(command, cwd=scratch, capture_output=True, check=False)
    return np.load(f"{scratch}/u.npy") if done.returncode == 0 else None


def page(rows: list[Row]) -> str:
    """Return the page of all rows."""
    names = ("file", "elements", "law", "steps", "verdict", "difference", "expected", "reason")
    counts = ", ".join(f"{n} {verdict}" for verdict, n in Counter(row["verdict"] for row in rows).items())
    body = [[str(row.get(name, "")) for name in names] for row in rows]
    return TEXT.format(limit=LIMIT, agrees=AGREES, counts=counts) + table(names, body)

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

PAGE, LIMIT, AGREES = ROOT / "docs" / "about" / "kratos-folders.md", "120", 1e-6
KRATOS = """
import json, sys, time
import numpy as np, KratosMultiphysics as KM, KratosMultiphysics.ConstitutiveLawsApplication
from KratosMultiphysics.StructuralMechanicsApplication import structural_mechanics_analysis as module
class Analysis(module.StructuralMechanicsAnalysis):
    def OutputSolutionStep(self):
        nodes = sorted(self.model["Structure"].Nodes, key=lambda node: node.Id)
        steps.append([list(node.GetSolutionStepValue(KM.DISPLACEMENT)) for node in nodes])
        if time.time() > start + float(sys.argv[2]):
            self.end_time = 0.0
settings = json.loads(KM.Parameters(open(sys.argv[1]).read()).WriteJsonString())
settings["processes"] = {key: one for key, one in settings["processes"].items() if "check" not in key}
settings["solver_settings"] |= {"residual_relative_tolerance": 1e-10, "max_iteration": 30}
steps, start, model = [], time.time(), KM.Model()
Analysis(model, KM.Parameters(json.dumps(settings))).Run()
np.save("u.npy", steps)
"""
"""Runs a file without its checks, to small residuals, until its end or a limit in seconds."""
FILES = r'"(?:input_filename|materials_filename)"\s*:\s*"(.*?)"'
LAW, NAMES = r'"constitutive_law"\s*:\s*\{([^}]*)\}', r'"(?:name|yield_surface)"\s*:\s*"([\w.]+)"'
REASON = r"^\S+: (?:[\w.\[\]]+: )?(?:part \S+: )?(.*?)(?:; (?:Did|Choose|take).*|\. (?=[A-Z]).*|)$"
DIFFERS = {
    "small_disp": "Kratos puts loads of SurfaceLoadCondition on the deformed face, whatever the elements",
    "updated_lagrangian": "C times Green's strain is Cauchy's stress in Kratos, here the second of Piola",
}
TEXT = """# Test folders of Kratos

Run files of solids from Kratos's own tests, here and in a live Kratos 10.4.4, which runs them without their
checks and to relative residuals of 1e-10. *Difference*: of the displacements of all nodes after each step
that Kratos takes in {limit} s, relative to the largest; *agrees*: at most {agrees:g}. *Expected*: in the
folder. Tests of Swift's law and of B-bar elements have no run files. Not taken over: Kratos's Tresca, whose
equivalent stress jumps by 5 % near the corners of the hexagon, and its modified Mohr–Coulomb, whose flow in
tension has the sign of that in compression. {counts}.

"""


def folders(path: Path, kratos: str) -> None:
    """Run all files below a folder and write the page."""
    rows = []
    for file in sorted(path.rglob("*arameters.json")):
        name = f"{file.parent.name}/{file.stem.removesuffix('_parameters')}"
        with tempfile.TemporaryDirectory() as scratch:
            rows.append({"file": name} | compared(file, kratos, scratch))
        print(rows[-1], flush=True)
        PAGE.write_text(page(rows), encoding="utf-8")


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
        subprocess.check_output([kratos, "-c", KRATOS, run_file, LIMIT], cwd=scratch)
        theirs = np.load(f"{scratch}/u.npy")[-1 if case.time is None else 0 :]
        if case.time is not None:
            case.time = replace(case.time, steps=min(len(theirs), case.time.steps))
            case.outputs.results = [f"{scratch}/u.npz"]
        outcome = kl.run(case)
    except kl.KratosLiteError as problem:
        return row | {"verdict": "refused", "reason": re.sub(REASON, r"\1", str(problem))}
    u = outcome.result.u if case.time is None else np.load(f"{scratch}/u.npz")["u"][1:]
    u = u[..., np.argsort(case.model.mesh.node_ids), :]
    off = np.abs(u - theirs).max() / (np.abs(theirs).max() or 1.0)
    found = re.findall("passed|failed|not evaluated", "\n".join(outcome.compare()))
    row |= {"steps": len(theirs), "difference": error(off), "expected": ", ".join(sorted({*found}))}
    why = {"verdict": "differs", "reason": DIFFERS.get(file.parent.name, "")}
    return row | (why if off > AGREES else {"verdict": "agrees"})


def page(rows: list[Row]) -> str:
    """Return the page of all rows."""
    names = ("file", "elements", "law", "steps", "verdict", "difference", "expected", "reason")
    counts = ", ".join(f"{n} {verdict}" for verdict, n in Counter(row["verdict"] for row in rows).items())
    body = [[str(row.get(name, "")) for name in names] for row in rows]
    return TEXT.format(limit=LIMIT, agrees=AGREES, counts=counts) + table(names, body)

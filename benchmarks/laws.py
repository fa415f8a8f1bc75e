"""Blocks of steel and rubber, and folders, beside Kratos; and the Gauss points that laws evaluate.

``python -m benchmarks laws [PATH] --python PYTHON``, the folders of Kratos's examples and an interpreter with
KratosConstitutiveLawsApplication, writes the page `docs/about/laws.md`.  Each row is two processes: ``python
-m benchmarks.laws PROGRAM LAW CELLS``, or a run file in place of a law.
"""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.driver import ROOT, load, save
from benchmarks.folders import KRATOS
from benchmarks.tables import Row, ratio, seconds, table
from kratos_lite.typing import Array

PAGE, RESULTS = ROOT / "docs" / "about" / "laws.md", ROOT / "benchmarks" / "results" / "laws.json"
LAWS = {"J2": (6e7, 200e9), "neo-Hookean": (2e4, 1e6)}
"""Shear traction on the top at the end and Young's modulus in Pa."""
FOLDERS = {"tensile_test": (1.0, "tensile test"), "stanford_bunny": (1.0, "Stanford bunny")}
"""End of the steps that are taken in folders, and their names."""
CLOCKS = "seconds", "processors"
STEPS, CELLS, LIMIT, CORES = 10, (12, 20), 600, 2
TEXT = """# Laws beside Kratos

Blocks of 1 × 1 × 2 m on a clamped side, sheared at the top in {steps} steps, elements 8N: steel
(`J2Plasticity3D`, linear hardening, B-bar) and rubber (`NeoHookean3D`, total Lagrangian); relative residual
1e-8; Kratos takes AMGCL with 3 × 3 blocks to 1e-10. Below, two run files of Kratos's published examples,
unchanged but for their end, with their own tolerances and solvers: a tensile test (softening plasticity, 31
steps) and the Stanford bunny (Saint Venant–Kirchhoff, total Lagrangian 4N, a step of a following pressure).
`python -m benchmarks laws`, two cores, from Python's start to the last step: seconds that passed and, after a
slash, of processors, each where measured: the former on a quiet machine, the latter on a busy one. The last
column is the difference of the largest displacement. The states of J2 take 152 bytes at a Gauss point: 13
internal variables and six stresses.

"""
POINTS = "\nGauss points a second of `evaluate` with the tangent, {}, in millions: {}."


def laws(kratos: str, cells: Sequence[int] = CELLS, path: Path = ROOT) -> None:
    """Measure all blocks, and folders below a path, and write the page."""
    files = [path / name / "ProjectParameters.json" for name in FOLDERS]
    what = [(law, n) for law in LAWS for n in cells]
    what += [(str(file), 0) for file in files if file.is_file()]
    rows = []
    for law, n in what:
        row: Row = {"law": law if n else FOLDERS[Path(law).parent.name][1], "n": n}
        for program, python in (("ours", sys.executable), ("Kratos", kratos)):
            row[program] = timed(python, program, law, n) if python else {"failed": "not asked for"}
        rows.append(row)
        print(row, flush=True)
        save(RESULTS, {"set": "laws", "rows": rows, "points": points()})
        PAGE.write_text(page(load(RESULTS)), encoding="utf-8")


def timed(python: str, *words: Any, code: Sequence[str] = ("-m", "benchmarks.laws")) -> Row:
    """Return what a process says, with its seconds."""
    command, start = [python, *code, *map(str, words)], perf_counter()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT, check=True)
    except subprocess.TimeoutExpired:
        return {"failed": f"> {LIMIT} s"}
    except subprocess.CalledProcessError as error:
        said = error.stderr.strip() or f"ended with {error.returncode}"
        return {"failed": said.splitlines()[-1][:200]}
    used, passed = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter() - start
    processors = used.ru_utime - before.ru_utime + used.ru_stime - before.ru_stime
    return json.loads(done.stdout.splitlines()[-1]) | {"seconds": passed, "processors": processors}


def page(found: Row) -> str:
    """Return the page of what is kept."""
    body = [[row["law"], *compared(row)] for row in found["rows"]]
    head = ["law", "unknowns", "kratos_lite (iterations)", "Kratos (iterations)", "ratio", "difference"]
    said = [
        POINTS.format(cores, ", ".join(f"{name} {value:.1f}" for name, value in laws.items()))
        for cores, laws in found["points"].items()
    ]
    return TEXT.format(steps=STEPS) + table(head, body) + "".join(said) + "\n"


def compared(row: Row) -> list[str]:
    """Return cells of a process beside Kratos: unknowns, times, their ratio, the difference."""
    ours, kratos = row["ours"], row["Kratos"]
    cells = [str(ours["unknowns"]), times(ours)]
    if "failed" in kratos:
        return [*cells, kratos["failed"], "", ""]
    ratios = " / ".join(ratio(ours.get(name), kratos.get(name)) or "–" for name in CLOCKS)
    return [*cells, times(kratos), ratios, f"{abs(ours['u'] / kratos['u'] - 1):.0e}"]


def times(row: Row) -> str:
    """Return both times of a process, with its iterations."""
    count = f" ({row['iterations']})" if "iterations" in row else ""
    return " / ".join(seconds(row.get(name)) or "–" for name in CLOCKS) + count


def made(law: str, n: int) -> Any:
    """Return the model of kratos_lite."""
    import kratos_lite as kl

    (traction, E), mesh = LAWS[law], kl.box((1, 1, 2), (n, n, 2 * n), "Element3D8N")
    model = kl.Model(mesh, kl.J2Plasticity3D(E, 0.3, 250e6, 2e9) if law == "J2" else kl.NeoHookean3D(E, 0.3))
    model.fix("z-")
    model.add(kl.Traction("z+", (traction, 0, 0)), amplitude=lambda t: t)
    return model


def ours(law: str, n: int) -> Row:
    """Solve the block."""
    import kratos_lite as kl

    model = made(law, n)
    analysis = model.quasi_static()
    *_, last = kl.integrate(analysis, 1 / STEPS, STEPS, every=STEPS)
    count = sum(report.iterations for report in analysis.reports)
    return {"unknowns": 3 * model.mesh.n_nodes, "iterations": count, "u": largest(last.u)}


def kratos(law: str, n: int) -> Row:
    """Solve the same nodes, elements and nodal forces with Kratos."""
    import KratosMultiphysics as KM
    import KratosMultiphysics.ConstitutiveLawsApplication as CLA
    import KratosMultiphysics.StructuralMechanicsApplication as SMA

    from benchmarks.programs.kratos import AXES, BLOCKS, SOLVERS

    KM.Logger.GetDefaultOutput().SetSeverity(KM.Logger.Severity.WARNING)
    model = made(law, n)
    mesh, whole = model.mesh, KM.Model()
    part, E = whole.CreateModelPart("Structure", 2), LAWS[law][1]
    part.ProcessInfo[KM.DOMAIN_SIZE] = 3
    for variable in (KM.DISPLACEMENT, KM.REACTION, KM.VOLUME_ACCELERATION, SMA.POINT_LOAD):
        part.AddNodalSolutionStepVariable(variable)
    steel = part.CreateNewProperties(1)
    constants = {"YOUNG_MODULUS": E, "POISSON_RATIO": 0.3, "DENSITY": 0.0}
    if law == "J2":
        constants |= {"YIELD_STRESS": 250e6, "ISOTROPIC_HARDENING_MODULUS": 2e9}
        constants |= {"EXPONENTIAL_SATURATION_YIELD_STRESS": 250e6, "HARDENING_EXPONENT": 1.0}
    for name, value in constants.items():
        steel.SetValue(KM.KratosGlobals.GetVariable(name), value)
    made_law = CLA.SmallStrainJ2Plasticity3DLaw() if law == "J2" else CLA.HyperElastic3DLaw()
    steel.SetValue(KM.CONSTITUTIVE_LAW, made_law)
    for i, x in enumerate(mesh.points.tolist()):
        part.CreateNewNode(i + 1, *x)
    kind = "SmallDisplacementBbarElement3D8N" if law == "J2" else "TotalLagrangianElement3D8N"
    for i, nodes in enumerate((mesh.blocks[0].nodes + 1).tolist()):
        part.CreateNewElement(kind, i + 1, nodes, steel)
    for axis in AXES:
        names = (getattr(KM, f"{name}_{axis}") for name in ("DISPLACEMENT", "REACTION"))
        KM.VariableUtils().AddDof(*names, part)
    for i in mesh.nodes("z-").tolist():
        for axis in AXES:
            part.GetNode(i + 1).Fix(getattr(KM, f"DISPLACEMENT_{axis}"))
    forces = model.loads[0].load.forces(mesh, model.element_groups())
    top = mesh.nodes("z+").tolist()
    for i in top:
        part.CreateNewCondition("PointLoadCondition3D1N", i + 1, [i + 1], steel)
    from KratosMultiphysics.python_linear_solver_factory import ConstructSolver

    settings = {"solver_type": "amgcl", "tolerance": 1e-10, "max_iteration": 1000} | BLOCKS | SOLVERS["AMGCL"]
    solver = ConstructSolver(KM.Parameters(json.dumps(settings)))
    strategy = KM.ResidualBasedNewtonRaphsonStrategy(
        part,
        KM.ResidualBasedIncrementalUpdateStaticScheme(),
        KM.ResidualCriteria(1e-8, 1e-9),
        KM.ResidualBasedBlockBuilderAndSolver(solver),
        25,
        False,
        False,
        True,
    )
    strategy.SetEchoLevel(0)
    strategy.Initialize()
    count = 0
    for step in range(1, STEPS + 1):
        part.CloneTimeStep(step / STEPS)
        for i in top:
            force = KM.Array3((forces[i] * step / STEPS).tolist())
            part.GetNode(i + 1).SetSolutionStepValue(SMA.POINT_LOAD, force)
        strategy.InitializeSolutionStep()
        strategy.Predict()
        if not strategy.SolveSolutionStep():
            raise RuntimeError(f"no convergence in step {step}")
        strategy.FinalizeSolutionStep()
        count += part.ProcessInfo[KM.NL_ITERATION_NUMBER]
    u = KM.VariableUtils().GetSolutionStepValuesVector(part.Nodes, KM.DISPLACEMENT, 0, 3)
    return {"unknowns": len(u), "iterations": count, "u": largest(np.array(u))}


def folder(program: str, file: Path) -> Row:
    """Run a folder up to the end that is taken here."""
    import kratos_lite as kl

    settings, end = json.loads(file.read_text()), FOLDERS[file.parent.name][0]
    if program == "ours":
        case = kl.read_case(file)
        case.outputs.in_steps.clear()
        assert case.time is not None
        case.time = replace(case.time, steps=round((end - case.time.start) / case.time.step))
        result = kl.run(case).result
        assert isinstance(result, kl.Result)
        return {"unknowns": 3 * len(result.u), "iterations": result.report.iterations, "u": largest(result.u)}
    settings["problem_data"]["end_time"] = end
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copytree(file.parent, scratch, dirs_exist_ok=True)
        Path(scratch, "run.json").write_text(json.dumps(settings))
        command = [sys.executable, "-c", KRATOS, "run.json", str(LIMIT), "0", "own"]
        subprocess.run(command, cwd=scratch, capture_output=True, check=True)
        u = np.load(f"{scratch}/u.npy")[-1]
    return {"unknowns": 3 * len(u), "u": largest(u)}


def largest(u: Array) -> float:
    """Return the largest displacement."""
    return float(np.abs(u).max())


def points() -> dict[str, dict[str, float]]:
    """Return millions of Gauss points a second of laws, on one core and on all."""
    with ProcessPoolExecutor(CORES) as pool:
        one, each = rates(), list(pool.map(rates, range(CORES)))
    return {"one core": one, "two cores": {law: sum(r[law] for r in each) for law in one}}


def rates(_: int = 0) -> dict[str, float]:
    """Return millions of Gauss points a second of laws, of steel mostly beyond its elastic limit."""
    import kratos_lite as kl

    strain = np.random.default_rng(1).normal(size=(500, 8, 6))
    found = {}
    np.zeros(3_000_000).sum()  # what is freed once is kept for arrays to come, as in a model
    for law, size in ((kl.J2Plasticity3D(200e9, 0.3, 250e6, 2e9), 5e-4), (kl.NeoHookean3D(1e6, 0.3), 0.05)):
        state, times = law.initial_state(500, 8), []
        for _ in range(50):
            start = perf_counter()
            law.evaluate(size * strain, state, 1.0)
            times.append(perf_counter() - start)
        found[type(law).__name__] = 4000 / min(times) / 1e6
    return found


if __name__ == "__main__":
    program, law, n = sys.argv[1:]
    if n == "0":
        print(json.dumps(folder(program, Path(law))))
    else:
        print(json.dumps((ours if program == "ours" else kratos)(law, int(n))))

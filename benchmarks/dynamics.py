"""Modes and steps in time beside the static solution of the same model, all in this process.

``python -m benchmarks dynamics`` solves a block on a clamped side under its weight, finds modes of it, and
lets it swing with steps of a twentieth of its longest period; then bodies, a ring that turns, matrices, and
with ``--python PYTHON`` whole processes beside Kratos.  It writes the page `docs/about/dynamics.md`.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

import kratos_lite as kl
from benchmarks.driver import ROOT, load, save
from benchmarks.laws import compared, timed, times
from benchmarks.programs.kratos import BLOCKS as IN_BLOCKS
from benchmarks.programs.kratos import SOLVERS
from benchmarks.tables import Row, megabytes, ratio, seconds, table
from kratos_lite.assembly.stiffness import assemble_stiffness

PAGE, RESULTS = ROOT / "docs" / "about" / "dynamics.md", ROOT / "benchmarks" / "results" / "dynamics.json"
BLOCKS = {"8N": (10, 16, 24, 32), "10N": (8, 14), "20N": (8, 14), "27N": (6, 10, 14)}
"""Cells along the short edges of the blocks of each element."""
STEPS, REPEATS, OWN = 12, 3, ("-m", "benchmarks.dynamics")
STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
KRATOS = """
import json, os, sys
import KratosMultiphysics as KM, KratosMultiphysics.StructuralMechanicsApplication as application
from KratosMultiphysics.StructuralMechanicsApplication import structural_mechanics_analysis as module
KM.Logger.GetDefaultOutput().SetSeverity(KM.Logger.Severity.WARNING)
os.chdir(os.path.dirname(sys.argv[1]))
model = KM.Model()
module.StructuralMechanicsAnalysis(model, KM.Parameters(open(sys.argv[1]).read())).Run()
part = model["Structure"]
u = KM.VariableUtils().GetSolutionStepValuesVector(part.Nodes, KM.DISPLACEMENT, 0, 3)
squares = part.ProcessInfo[application.EIGENVALUE_VECTOR]
print(json.dumps({"u": sum(square**0.5 for square in squares) or max(map(abs, u))}))
"""
SOLVER = {"solver_type": "amgcl", "tolerance": 1e-10} | IN_BLOCKS | SOLVERS["AMGCL"]
RUNS = {
    "6 modes": '"eigen_value", "eigensolver_settings": {"solver_type": "spectra_sym_g_eigs_shift", '
    '"number_of_eigenvalues": 6}',
    "100 Newmark steps": '"Dynamic", "analysis_type": "linear", "time_integration_method": "implicit", '
    f'"scheme_type": "newmark", "linear_solver_settings": {json.dumps(SOLVER)}',
}
RUN = """{
"problem_data": {
    "parallel_type": "OpenMP", "problem_name": "block", "start_time": 0.0, "end_time": END, "echo_level": 0},
"solver_settings": {
    "solver_type": SOLVER, "model_part_name": "Structure", "domain_size": 3,
    "time_stepping": {"time_step": STEP},
    "model_import_settings": {"input_type": "mdpa", "input_filename": "block"},
    "material_import_settings": {"materials_filename": "materials.json"}},
"processes": {
    "constraints_process_list": [{PROCESS, "Parameters": {"model_part_name": "Structure.Bottom",
        "variable_name": "DISPLACEMENT", "value": [0.0, 0.0, 0.0]}}],
    "loads_process_list": [{PROCESS, "Parameters": {"model_part_name": "Structure.Body",
        "variable_name": "VOLUME_ACCELERATION", "value": [0.0, 0.0, -9.81],
        "constrained": [false, false, false]}}]},
"output_processes": {}
}"""
RUN = RUN.replace(
    "PROCESS", '"python_module": "assign_vector_variable_process", "kratos_module": "KratosMultiphysics"'
)
MATERIALS = """{"properties": [{"model_part_name": "Structure.Body", "properties_id": 1, "Material": {
"constitutive_law": {"name": "LinearElastic3DLaw"}, "Tables": {}, "Variables": {"DENSITY": 7850.0,
"YOUNG_MODULUS": 210e9, "POISSON_RATIO": 0.3}}}]}"""
TEXT = """# Modes and steps beside statics

What modes and steps in time of a model cost beside its static solution: a block of 1 × 1 × 2 m on a clamped
side, `python -m benchmarks dynamics`, two cores, seconds (times the static solution), medians of {repeats}
runs in one process. Modes are found to 1e-9 of their frequencies ([how](../howto/modes.md)); a step is a
twentieth of the longest period, and the first one has the first acceleration, the matrix and the hierarchy of
multigrid in it ([how](../howto/models-in-time.md)).

"""
MORE = """
Free bodies that turn (total Lagrangian), a ring whose material turns (ALE) and matrices, each beside another
time on the same mesh; the ring beside its static solution at rest.

"""
WHOLE = """
Processes from Python's start to the end of a run file, beside Kratos with Spectra, and AMGCL to 1e-10:
seconds / of processors, and the difference of the sum of frequencies, or of the largest displacement. Six
modes of {unknowns} unknowns of 27N in such a process: {said}.

"""


def block(element: str, n: int) -> kl.Model:
    """Return a block under its weight."""
    mesh = kl.box((1, 1, 2), (n, n, 2 * n), f"KinematicLinear3D{element}")
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    return model


def measured(work: Callable[[], Any]) -> float:
    """Return the median of the seconds that work takes."""
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return median(times)


def of(element: str, n: int) -> Row:
    """Measure one block."""
    model = block(element, n)
    row: Row = {"element": element, "n": n, "unknowns": 3 * model.mesh.n_nodes}
    model.solve()  # what is loaded and built once
    row["static"] = measured(model.solve)
    row["modes 6"] = measured(lambda: model.modes(6))
    row["modes 20"] = measured(lambda: model.modes(20))
    h = step_of(model)
    first, further = zip(*(steps_of(model.transient(), h) for _ in range(REPEATS)), strict=True)
    return row | {"first step": median(first), "further step": median(further)}


def step_of(model: kl.Model) -> float:
    """Return a twentieth of the longest period."""
    return float(2 * np.pi / model.modes(1)[0][0] / 20)


def steps_of(moving: Any, h: float) -> tuple[float, float]:
    """Return the seconds of the first step, and of each further one."""
    start, states = perf_counter(), kl.integrate(moving, h, STEPS)
    next(states)
    first = perf_counter()
    deque(states, maxlen=0)
    return first - start, (perf_counter() - first) / (STEPS - 1)


def others(cells: tuple[int, ...] = (16, 8, 16, 40)) -> Iterator[tuple[str, kl.Model, float, float]]:
    """Yield what is measured, its model, the time, and that beside it."""
    for element, n in zip(("8N", "20N"), cells, strict=False):
        model = block(element, n)
        body = kl.FiniteElementBody(model.mesh, STEEL)
        body.set_velocity(angular=(1.0, 0.0, 0.0))
        _, took = steps_of(body, step_of(model))
        yield f"step of a body of {element} / static", model, took, measured(model.solve)
    model = kl.Model(kl.annulus(0.3, 1.0, 0.2, (cells[2], 6 * cells[2], -(-cells[2] // 2))), STEEL)
    model.fix("inner")
    model.add(kl.Traction("outer", (1e6, 0, 0)))
    static, h = measured(model.solve), step_of(model)
    model.add(kl.ale.Rotation("z", 300.0))
    for name, took in zip(("first", "further"), steps_of(model.transient(), h), strict=True):
        yield f"{name} step of the ring / static", model, took, static
    yield "6 complex modes of the ring / static", model, measured(lambda: model.complex_modes(6)), static
    model = block("8N", cells[3])
    system = model.transient().equations.system
    K = measured(lambda: assemble_stiffness(system.points, system.groups, system.pattern))
    yield "`matrices()` / assembly of K", model, measured(model.matrices), K


def processes(kratos: str, n: int = 16) -> Iterator[Row]:
    """Yield whole processes of run files of a block, here and in Kratos."""
    model = block("8N", n)
    h = step_of(model)
    parts = {"Body": kl.Part(np.arange(model.mesh.n_nodes), np.arange(model.mesh.n_elements))}
    parts["Bottom"] = kl.Part(model.mesh.nodes("x-"))
    with tempfile.TemporaryDirectory() as folder:
        kl.write(f"{folder}/block.mdpa", model.mesh.replace(parts=parts))
        Path(folder, "materials.json").write_text(MATERIALS)
        text, file = RUN.replace("END", str(99.5 * h)), Path(folder, "run.json")
        for what, solver in RUNS.items():
            step = h if "steps" in what else 100 * h  # Kratos finds modes in each step
            file.write_text(text.replace("SOLVER", solver).replace("STEP", str(step)))
            ours = timed(sys.executable, file, code=OWN)
            theirs = timed(kratos, file, code=("-c", KRATOS)) if kratos else {"failed": "not asked for"}
            yield {"what": what, "ours": ours, "Kratos": theirs}


def one(word: str) -> Row:
    """Run a file, or find six modes of a block of 27N of so many cells."""
    if word.isdigit():
        model = block("27N", int(word))
        omega, peak = model.modes(6)[0], resource.getrusage(resource.RUSAGE_SELF)
        return {"unknowns": 3 * model.mesh.n_nodes, "u": omega.sum(), "memory": 1024 * peak.ru_maxrss}
    outcome = kl.run(kl.read_case(word))
    u = outcome.modes[1][0] if outcome.modes else outcome.result.u
    return {"unknowns": u.size, "u": float(outcome.modes[0].sum() if outcome.modes else np.abs(u).max())}


def dynamics(kratos: str = "") -> None:
    """Measure all and write the page."""
    rows = []
    for element, cells in BLOCKS.items():
        for n in cells:
            rows.append(of(element, n))
            print(rows[-1], flush=True)
    more = [[what, 3 * model.mesh.n_nodes, *times] for what, model, *times in others()]
    large = timed(sys.executable, 27, code=OWN)
    found = {"rows": rows, "others": more, "processes": [*processes(kratos)], "million": large}
    save(RESULTS, {"set": "dynamics"} | found)
    PAGE.write_text(page(load(RESULTS)), encoding="utf-8")


def page(found: Row) -> str:
    """Return the page of what is kept."""
    rows, large = found["rows"], found["million"]
    names = ("modes 6", "modes 20", "first step", "further step")
    body = [
        [row["element"], str(row["unknowns"]), seconds(row["static"])]
        + [f"{seconds(row[name])} ({ratio(row[name], row['static'])})" for name in names]
        for row in rows
    ]
    head = ["element", "unknowns", "static", "6 modes", "20 modes", "first step", "further step"]
    more = [[what, str(n), *map(seconds, times), ratio(*times)] for what, n, *times in found["others"]]
    whole = [[row["what"], *compared(row)] for row in found["processes"]]
    said = large.get("failed") or f"{times(large)} s, {megabytes(large['memory'])} MB"
    text = WHOLE.format(unknowns=large.get("unknowns", "a million"), said=said)
    return (
        TEXT.format(repeats=REPEATS)
        + table(head, body)
        + MORE
        + table("what | unknowns | seconds | beside | ratio", more)
        + text
        + table("what | unknowns | kratos_lite | Kratos | ratio | difference", whole)
    )


if __name__ == "__main__":
    print(json.dumps(one(sys.argv[1])))

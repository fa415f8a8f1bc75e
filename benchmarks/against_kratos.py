"""Time one scene in kratos_lite and in Kratos, side by side: whole processes and phases, with the error.

Scene: a unit block of n³ cells, clamped at the bottom, under gravity in three directions; read from
one `.mdpa` file.  (The gravity cube cannot rank solvers: its load is one-dimensional.)  The
displacements of the two must agree.
Needs the Kratos wheels: ``pip install ".[compare]"``.

    python benchmarks/against_kratos.py --cells 10 16 --element 3D8N --runs 3
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import kratos_lite as kl

KRATOS = """
import json, sys, time
start = time.perf_counter()
import KratosMultiphysics as KM
import KratosMultiphysics.StructuralMechanicsApplication as SMA
import KratosMultiphysics.LinearSolversApplication
from KratosMultiphysics.python_linear_solver_factory import ConstructSolver
phase = {"import": time.perf_counter() - start}
def lap(name, since):
    phase[name] = time.perf_counter() - since
    return time.perf_counter()
t = time.perf_counter()
model = KM.Model(); part = model.CreateModelPart("S"); part.ProcessInfo[KM.DOMAIN_SIZE] = 3
for v in (KM.DISPLACEMENT, KM.REACTION, KM.VOLUME_ACCELERATION, SMA.POINT_LOAD):
    part.AddNodalSolutionStepVariable(v)
KM.ModelPartIO(sys.argv[1], KM.IO.READ | KM.IO.SKIP_TIMER).ReadModelPart(part)
t = lap("read", t)
for axis in "XYZ":
    displacement, reaction = (getattr(KM, f"{name}_{axis}") for name in ("DISPLACEMENT", "REACTION"))
    KM.VariableUtils().AddDof(displacement, reaction, part)
for p in part.Properties:
    p.SetValue(KM.CONSTITUTIVE_LAW, SMA.LinearElastic3DLaw())
settings = KM.Parameters(json.dumps({
    "solver_type": "amgcl", "tolerance": 1e-10, "max_iteration": 500,
    "block_size": 3, "use_block_matrices_if_possible": True,
}))
builder = KM.ResidualBasedBlockBuilderAndSolver(ConstructSolver(settings))
scheme = KM.ResidualBasedIncrementalUpdateStaticScheme()
strategy = KM.ResidualBasedLinearStrategy(part, scheme, builder, True, False, False, False)
strategy.SetEchoLevel(0); strategy.Initialize(); strategy.Solve()
lap("solve", t)
ids = [n.Id for n in part.Nodes]
u = [list(n.GetSolutionStepValue(KM.DISPLACEMENT)) for n in part.Nodes]
json.dump({"phase": phase, "u": dict(zip(ids, u))}, open(sys.argv[2], "w"))
"""

LITE = """
import json, sys, time
start = time.perf_counter()
import kratos_lite as kl
import numpy, scipy.sparse, pyamg
phase = {"import": time.perf_counter() - start}
t = time.perf_counter()
model = kl.read(sys.argv[1] + ".mdpa")
phase["read"] = time.perf_counter() - t
t = time.perf_counter()
result = model.solve()
phase["solve"] = time.perf_counter() - t
u = dict(zip(model.mesh.node_ids.tolist(), result.displacement().tolist()))
json.dump({"phase": phase, "u": u}, open(sys.argv[2], "w"))
"""


def scene(folder: Path, element: str, n: int) -> Path:
    """Write the block and return its path without ending."""
    model = kl.Model(
        kl.box(cells=(n, n, n), element=f"SmallDisplacementElement{element}"),
        kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0),
    )
    for block in model.mesh.blocks:
        block.name = f"SmallDisplacementElement{element}"
    model.fix("z-", "xyz")
    model.add(kl.Gravity((3.0, 2.0, -9.81)))
    path = folder / f"block_{element}_{n}"
    kl.write(f"{path}.mdpa", model)
    return path


def run(code: str, path: Path, out: Path) -> tuple[float, dict]:
    """Run one process; return its wall time and what it wrote."""
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", code, str(path), str(out)], check=True, capture_output=True)
    return time.perf_counter() - start, json.loads(out.read_text())


def main() -> None:
    """Print a table: seconds (median), ratio Kratos / kratos_lite, largest difference of displacements."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=int, nargs="+", default=[8, 16])
    parser.add_argument("--element", default="3D8N")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    print(f"{'scene':<16}{'phase':<10}{'kratos_lite':>12}{'Kratos':>10}{'ratio':>8}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for n in options.cells:
            path = scene(folder, options.element, n)
            runs = [
                (run(LITE, path, folder / "a"), run(KRATOS, path, folder / "b")) for _ in range(options.runs)
            ]
            for phase in ("import", "read", "solve", "process"):
                pick = [
                    [side[0] if phase == "process" else side[1]["phase"][phase] for side in pair]
                    for pair in runs
                ]
                ours, theirs = (statistics.median(column) for column in zip(*pick, strict=True))
                label = f"{options.element} n={n}" if phase == "import" else ""
                print(f"{label:<16}{phase:<10}{ours:>11.3f}s{theirs:>9.3f}s{theirs / ours:>8.2f}")
            ours, theirs = (np.array([side[1]["u"][k] for k in runs[0][0][1]["u"]]) for side in runs[0])
            print(f"{'':<16}largest difference {np.abs(ours - theirs).max() / np.abs(theirs).max():.1e}")


if __name__ == "__main__":
    main()

"""Try an installed kratos_lite: ``python quick.py compiled|NumPy [folder]``, not in the source tree.

What computes, and the folder that the package is in, must be those named. It needs matplotlib, not pytest.
"""

import logging
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import kratos_lite as kl
from kratos_lite.native import described, kernels

KERNELS = "gauss inertia lagrange mesh motion multigrid recovery sparse stiffness text threads".split()


def gravity_cube(folder: Path, element: str, solver: str) -> None:
    """Solve the cube of the README, write it, draw it, and estimate its error."""
    model = kl.Model(
        kl.box(cells=(3, 3, 3), element=element), kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
    )
    for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    result = model.solve(solver=solver)
    top = result.displacement("z+")[:, 2]
    assert abs(top + 1.322e-4).max() < 1e-7, top
    assert np.isfinite(result.stress()).all()
    assert 0 <= result.error().relative < 1
    path = folder / f"{element}.vtu"
    kl.write(path, result)
    assert len(kl.read(path).mesh.points) == len(model.mesh.points)


def motion() -> None:
    """Let three kinds of body fall, and a column swing."""
    rubber = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
    for kind in (kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody):
        body = kind(kl.box(cells=(1, 1, 2)), rubber)
        body.add(kl.Gravity((0.0, 0.0, -9.81)))
        *_, last = kl.integrate(body, dt=0.001, steps=100)
        assert abs(last.time - 0.1) < 1e-12
    column = kl.Model(kl.box((1.0, 1.0, 5.0), cells=(1, 1, 5), element="KinematicLinear3D20N"), rubber)
    column.fix("z-", "xyz")
    frequencies, _ = column.modes(4)
    assert frequencies[0] > 0
    assert (np.diff(frequencies) > -1e-6).all()


def command_line(folder: Path, model: Path) -> None:
    """Solve a model file by the command line."""
    out = folder / "cube"
    files = ["-o", f"{out}.vtu", "--picture", f"{out}.png"]
    command = [sys.executable, "-m", "kratos_lite", "solve", model, *files]
    subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL)
    assert out.with_suffix(".png").stat().st_size > 1000


def main(computes: str, home: str = "") -> None:
    """Try everything."""
    logging.basicConfig(level=logging.ERROR)
    assert Path(kl.__file__).resolve().is_relative_to(Path(home or sys.prefix).resolve()), kl.__file__
    missing = [name for name in KERNELS if kernels(name) is None]
    assert missing == ([] if computes == "compiled" else list(KERNELS)), missing
    assert described().startswith(computes), described()
    with tempfile.TemporaryDirectory() as name:
        for element, solver in (("KinematicLinear3D8N", "auto"), ("KinematicLinear3D27N", "amg")):
            gravity_cube(Path(name), element, solver)
        motion()
        command_line(Path(name), Path(__file__).resolve().parents[2] / "examples" / "gravity_cube.mdpa")


if __name__ == "__main__":
    main(*sys.argv[1:])

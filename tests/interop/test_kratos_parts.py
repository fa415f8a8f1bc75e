"""Kratos divides models by METIS, live; several ranks read its parts and find what one process does.

KratosMetisApplication and KratosStructuralMechanicsApplication are in the Python named in
KRATOS_LITE_KRATOS_PYTHON, or in this one.
"""

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib.util import find_spec
from pathlib import Path

import meshio
import numpy as np
import pytest
from children import output_of
from over_ranks import mpirun, needs_mpi

import kratos_lite as kl

HERE = os.environ.get("KRATOS_LITE_KRATOS_PYTHON") or (
    sys.executable if find_spec("KratosMultiphysics") else ""
)
NEEDED = "import KratosMultiphysics.MetisApplication, KratosMultiphysics.StructuralMechanicsApplication"
CANTILEVER = Path(__file__).resolve().parents[2] / "examples" / "cantilever"


RUNS = HERE and subprocess.run([HERE, "-c", NEEDED], capture_output=True, check=False).returncode == 0
pytestmark = [
    needs_mpi,
    pytest.mark.skipif(not RUNS, reason="KratosMetisApplication or KRATOS_LITE_KRATOS_PYTHON is absent"),
]


def solve(ranks, what, folder, *words):
    words = ("solve", what, "--backend", "petsc", *words)
    return mpirun(ranks, "-m", "kratos_lite", *words, cwd=folder, seconds=120)


def divided(path, ranks):
    """Let Kratos divide a file, and take the whole one away."""
    driver = Path(__file__).with_name("kratos_parts_driver.py")
    output = output_of(HERE, driver, ranks, path)
    parts = path.with_name(f"{path.stem}_partitioned")
    assert len(list(parts.glob("*.mdpa"))) == ranks, output
    path.unlink()
    return parts


def solved(ranks, what, folder):
    """Solve over ranks; return displacements and reactions by the ids of nodes."""
    run = solve(ranks, what, folder, "-o", "out.pvtu")
    assert run.returncode == 0, run.stderr
    found = {}
    for piece in ElementTree.parse(folder / "out.pvtu").getroot().iter("Piece"):
        values = meshio.read(folder / piece.get("Source")).point_data
        rows = np.column_stack([values["DISPLACEMENT"], values["REACTION"]])
        found |= dict(zip(values["NODE_ID"].tolist(), rows, strict=True))
    return found


def assert_same(found, result):
    """Assert that what ranks found is the result of one process."""
    assert found.keys() == set(result.mesh.node_ids.tolist())
    values = np.array([found[node] for node in result.mesh.node_ids.tolist()])
    for ours, serial in ((values[:, :3], result.u), (values[:, 3:], result.reactions)):
        assert np.abs(ours - serial).max() <= 1e-8 * np.abs(serial).max()


def beam(kind):
    """Return a clamped beam of cells that are no boxes, pulled and bent, under its weight."""
    mesh = kl.box((2, 1, 1), (4, 2, 2), element=f"KinematicLinear3D{kind}N")
    shift = np.random.default_rng(kind).uniform(-0.02, 0.02, mesh.points.shape)
    shift[mesh.points[:, 0] == 0.0] = 0.0
    model = kl.Model(
        mesh.replace(points=mesh.points + shift), kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
    )
    model.fix("x-", "x", 1e-5)
    model.fix("x-", "yz")
    model.add(kl.Gravity((1.0, 0.0, -9.81)))
    model.add(kl.Traction("x+", (1e6, 0.0, 2e6)))
    return model


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("kind", [4, 8, 10])
def test_parts_of_a_file_give_its_solution(kind, ranks, tmp_path):
    path = tmp_path / "beam.mdpa"
    kl.write(path, beam(kind))
    serial = kl.read(path).solve()
    parts = divided(path, ranks)
    assert_same(solved(ranks, parts.name, tmp_path), serial)


@pytest.mark.parametrize("ranks", [2, 3])
def test_a_run_file_of_kratos_takes_the_parts_of_its_mesh(ranks, tmp_path):
    """Surface loads, materials by name of a part, supports by processes."""
    folder = Path(shutil.copytree(CANTILEVER, tmp_path / "cantilever"))
    serial = kl.read_case(folder / "ProjectParameters.json").model.solve()
    divided(folder / "cantilever.mdpa", ranks)
    assert_same(solved(ranks, "ProjectParameters.json", folder), serial)


def test_as_many_ranks_as_parts_are_asked_for(tmp_path):
    kl.write(tmp_path / "beam.mdpa", beam(8))
    divided(tmp_path / "beam.mdpa", 2)
    run = solve(3, "beam_partitioned", tmp_path)
    assert run.returncode == 2
    assert re.search("there are 2 part files, .*, and 3 ranks; start `mpirun -n 2`", run.stderr)

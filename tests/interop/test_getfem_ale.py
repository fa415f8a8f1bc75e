"""The matrices and loads of bodies in flow in GetFEM, live: the same, entry by entry.

GetFEM works them out from formulas in its own language.  Its interpreter is that of ``GetFEM=PATH`` in
KRATOS_LITE_BENCH_PYTHON, else the system's.
"""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from children import output_of

import kratos_lite as kl
from kratos_lite.ale import MotionMatrices, Rotation
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.elements.exact_rules import exact_rule
from kratos_lite.elements.tables import lame_constants
from kratos_lite.solvers.mass import Mass

ROOT = Path(__file__).resolve().parents[2]
MATERIAL = kl.Isotropic3D(E=3e7, nu=0.3, density=1100.0)


def interpreter():
    """Return an interpreter that has GetFEM, or None."""
    words = dict(
        w.split("=", 1) for w in os.environ.get("KRATOS_LITE_BENCH_PYTHON", "").split(",") if "=" in w
    )
    python = words.get("GetFEM", "/usr/bin/python3")
    try:
        run = subprocess.run(
            [python, "-c", "import getfem, scipy"], capture_output=True, timeout=60, check=False
        )
    except OSError:
        return None
    return python if run.returncode == 0 else None


PYTHON = interpreter()
if PYTHON is None:
    pytest.skip("GetFEM is not installed", allow_module_level=True)


def wheel(kind):
    """Return a hollow cylinder, its cells unlike each other; curved where elements can be."""
    mesh = kl.annulus(0.3, 1.0, 0.2, (3, 10, 2), f"KinematicLinear3D{kind}N")
    shift = np.random.default_rng(kind).uniform(-1, 1, mesh.points.shape)
    mesh = mesh.replace(points=mesh.points + 0.01 * shift)
    return kl.Model(mesh, MATERIAL)


def computed(model):
    """Return our matrices as entries (nnz, b, b) and loads (n, 3), and the points of the rule of each."""
    points, groups = model.mesh.points, model.element_groups()
    (element,) = {group.element for group in groups}
    pattern = Pattern(len(points), [group.nodes for group in groups])
    mass = Mass(points, groups, pattern, False)
    terms = MotionMatrices(Rotation("z"), points, groups, pattern, mass)
    scalars = {"M": mass.scalar.data, "G": terms.G, "H": terms.H}
    found = {name: data[:, None, None] for name, data in scalars.items()}
    found["K"] = assemble_stiffness(points, groups, pattern).data
    found |= {"centrifugal": terms.centrifugal, "euler": terms.euler}
    mass, flow = (exact_rule(element.shape, 2, flow=flow) for flow in (False, True))
    rules = [mass, flow, flow, element.rule, mass, mass]
    gauss = [round(len(rule) ** (1 / 3)) for rule in rules]
    return found, dict(zip(found, gauss, strict=True))


@pytest.mark.parametrize("kind", [8, 20, 27])
def test_matrices_and_loads_are_those_of_getfem(kind, tmp_path):
    model = wheel(kind)
    ours, gauss = computed(model)
    (block,) = model.mesh.blocks
    given = {"points": model.mesh.points, "nodes": block.nodes, "reference": block.shape.nodes}
    material = np.array([MATERIAL.density, *lame_constants(MATERIAL.C)])
    words = {"material": material, "terms": np.array(list(gauss)), "gauss": np.array(list(gauss.values()))}
    np.savez(tmp_path / "given.npz", **given, **words)
    command = [PYTHON, "-m", "benchmarks.programs.getfem_ale", tmp_path / "given.npz", tmp_path / "found.npz"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    output_of(*command, env=environment, cwd=tmp_path)
    with np.load(tmp_path / "found.npz") as theirs:
        for name, values in ours.items():
            assert values.shape == theirs[name].shape, name
            assert np.abs(values - theirs[name]).max() <= 1e-13 * np.abs(theirs[name]).max(), name

"""A part that FreeCAD draws, meshes and sends to `kratos-lite-ccx` in place of its solver."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import kratos_lite as kl

pytestmark = pytest.mark.skipif(
    not (shutil.which("freecadcmd") and shutil.which("gmsh")), reason="FreeCAD or Gmsh is not installed"
)
SCRIPT = """
import json, os, FreeCAD, ObjectsFem
from femmesh.gmshtools import GmshTools
from femtools import ccxtools
doc = FreeCAD.newDocument("part")
box = doc.addObject("Part::Box", "Box")
box.Length, box.Width, box.Height = 100, 20, 10
doc.recompute()
analysis = ObjectsFem.makeAnalysis(doc, "Analysis")
solver = ObjectsFem.makeSolverCalculixCcxTools(doc)
solver.GeometricalNonlinearity = "linear"
material = ObjectsFem.makeMaterialSolid(doc, "Steel")
material.Material = dict(material.Material, Name="Steel", YoungsModulus="210000 MPa", PoissonRatio="0.3")
fixed = ObjectsFem.makeConstraintFixed(doc, "Fixed")
fixed.References = [(box, "Face1")]
pressure = ObjectsFem.makeConstraintPressure(doc, "Pressure")
pressure.References, pressure.Pressure = [(box, "Face6")], 0.5
mesh = ObjectsFem.makeMeshGmsh(doc, "Mesh")
mesh.Part, mesh.CharacteristicLengthMax, mesh.ElementOrder = box, "10 mm", "2nd"
for made in (solver, material, fixed, pressure, mesh):
    analysis.addObject(made)
doc.recompute()
GmshTools(mesh).create_mesh()
tools = ccxtools.FemToolsCcx(analysis, solver, test_mode=False)
tools.update_objects()
tools.setup_working_dir(os.environ["FOLDER"])
tools.purge_results()
tools.write_inp_file()
code = tools.ccx_run()
tools.load_results()
result = next(one for one in analysis.Group if one.isDerivedFrom("Fem::FemResultObject"))
answer = {"code": code, "u": max(result.DisplacementLengths), "mises": max(result.vonMises)}
open(os.path.join(os.environ["FOLDER"], "answer.json"), "w").write(json.dumps(answer))
"""


def test_freecad_shows_what_the_stand_in_of_its_solver_writes(tmp_path: Path) -> None:
    solver = tmp_path / "ccx"
    code = "import sys; from kratos_lite.cli.ccx import main; sys.exit(main())"
    solver.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{code}" "$@"\n')
    solver.chmod(0o755)
    script = tmp_path / "part.py"
    script.write_text(SCRIPT)
    places = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "FOLDER": str(tmp_path)}
    environment = {**os.environ, **places, "QT_QPA_PLATFORM": "offscreen"}
    subprocess.run(["freecadcmd", str(script)], env=environment, capture_output=True, check=True, timeout=120)
    answer = json.loads((tmp_path / "answer.json").read_text())
    result = kl.run(kl.read_case(next(tmp_path.glob("*.inp")))).result
    assert answer["code"] == 0
    assert abs(answer["u"] / np.linalg.norm(result.u, axis=1).max() - 1) < 1e-5
    assert answer["mises"] > 0
    bending = 0.5 * 20 * 100**4 / (8 * 210000 * 20 * 10**3 / 12)  # mm, of a slender beam
    assert abs(answer["u"] / bending - 1) < 0.03

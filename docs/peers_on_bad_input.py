"""What kratos-lite, Kratos and scikit-fem say of the same unsound input: the table of ``trust.md``.

``python docs/peers_on_bad_input.py PYTHON`` writes it, where PYTHON is an interpreter that has
KratosStructuralMechanicsApplication, KratosLinearSolversApplication and scikit-fem.  Each run is a process
of its own.  kratos-lite and Kratos read the same files; scikit-fem, which reads none, gets the arrays.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from itertools import product
from pathlib import Path

HEX = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


class Cube:
    """A cube of 2 × 2 × 2 elements under its weight, on its bottom; changed by each case."""

    def __init__(self):
        number = {at: i + 1 for i, at in enumerate(product(range(3), repeat=3))}
        self.nodes = [[i, *(x / 2 for x in at)] for at, i in number.items()]
        self.elements = [
            [e + 1, 1, *(number[tuple(a + b for a, b in zip(at, corner, strict=True))] for corner in HEX)]
            for e, at in enumerate(product(range(2), repeat=3))
        ]
        self.materials = {1: {"DENSITY": 1000.0, "YOUNG_MODULUS": 1e6, "POISSON_RATIO": 0.3}}
        self.held = [i for i, _, _, z in self.nodes if z == 0]
        self.loaded = []
        self.weight = True
        self.cut = None
        self.text = lambda text: text

    def _mdpa(self):
        rows = ["Begin ModelPartData", "End ModelPartData"]
        for i in sorted({element[1] for element in self.elements}):
            rows += [f"Begin Properties {i}", "End Properties"]
        rows += ["Begin Nodes", *(" ".join(map(str, node)) for node in self.nodes), "End Nodes"]
        rows += ["Begin Elements SmallDisplacementElement3D8N"]
        rows += [*(" ".join(map(str, element)) for element in self.elements), "End Elements"]
        conditions = []
        if self.loaded:
            rows += ["Begin Conditions PointLoadCondition3D1N"]
            rows += [f"{c + 1} 1 {i}" for c, i in enumerate(self.loaded)] + ["End Conditions"]
            conditions = [c + 1 for c in range(len(self.loaded))]
        known = {node[0] for node in self.nodes}
        parts = {"Body": (sorted(known), [element[0] for element in self.elements], [])}
        parts |= {f"Of{i}": ([], [e[0] for e in self.elements if e[1] == i], []) for i in self.materials}
        parts |= {"Held": (self.held, [], [])} if self.held else {}
        parts |= {"Loaded": (self.loaded, [], conditions)} if self.loaded else {}
        for name, members in parts.items():
            rows += [f"Begin SubModelPart {name}"]
            for kind, ids in zip(("Nodes", "Elements", "Conditions"), members, strict=True):
                rows += [f"Begin SubModelPart{kind}", *map(str, ids), f"End SubModelPart{kind}"]
            rows += ["End SubModelPart"]
        text = self.text("\n".join(rows) + "\n")
        return text[: int(len(text) * self.cut)] if self.cut else text

    def write(self, folder):
        """Write run file, model and materials, and the same as arrays."""
        (folder / "cube.mdpa").write_text(self._mdpa())
        materials = [
            {
                "model_part_name": f"Structure.Of{i}",
                "properties_id": i,
                "Material": {"constitutive_law": {"name": "LinearElastic3DLaw"}, "Variables": values},
            }
            for i, values in self.materials.items()
        ]
        (folder / "materials.json").write_text(json.dumps({"properties": materials}))
        (folder / "ProjectParameters.json").write_text(json.dumps(self._project(), indent=1))
        arrays = {"nodes": self.nodes, "elements": self.elements, "materials": self.materials}
        arrays |= {"held": self.held, "loaded": self.loaded, "weight": self.weight}
        (folder / "arrays.json").write_text(json.dumps(arrays))

    def _project(self):
        def process(module, name, **parameters):
            return {
                "python_module": module,
                "kratos_module": "KratosMultiphysics",
                "process_name": name,
                "Parameters": {**parameters, "interval": [0.0, "End"]},
            }

        held = process(
            "assign_vector_variable_process",
            "AssignVectorVariableProcess",
            model_part_name="Structure.Held",
            variable_name="DISPLACEMENT",
            constrained=[True] * 3,
            value=[0.0, 0.0, 0.0],
        )
        weight = process(
            "assign_vector_by_direction_process",
            "AssignVectorByDirectionProcess",
            model_part_name="Structure.Body",
            variable_name="VOLUME_ACCELERATION",
            constrained=False,
            modulus=9.81,
            direction=[0.0, 0.0, -1.0],
        )
        load = process(
            "assign_vector_by_direction_to_condition_process",
            "AssignVectorByDirectionToConditionProcess",
            model_part_name="Structure.Loaded",
            variable_name="POINT_LOAD",
            modulus=10.0,
            direction=[0.0, 0.0, -1.0],
        )
        return {
            "problem_data": {
                "problem_name": "cube",
                "parallel_type": "OpenMP",
                "echo_level": 0,
                "start_time": 0.0,
                "end_time": 1.0,
            },
            "solver_settings": {
                "solver_type": "Static",
                "echo_level": 0,
                "model_part_name": "Structure",
                "domain_size": 3,
                "time_stepping": {"time_step": 1.1},
                "analysis_type": "linear",
                "model_import_settings": {"input_type": "mdpa", "input_filename": "cube"},
                "material_import_settings": {"materials_filename": "materials.json"},
                "linear_solver_settings": {"solver_type": "LinearSolversApplication.sparse_lu"},
            },
            "processes": {
                "constraints_process_list": [held] if self.held else [],
                "loads_process_list": ([weight] if self.weight else []) + ([load] if self.loaded else []),
            },
        }


# ---- the cases -----------------------------------------------------------------------------------------


def _inverted(cube):
    first = cube.elements[0]
    first[2:] = first[6:] + first[2:6]


def _unsupported(cube):
    cube.held = []


def _hinged(cube):
    cube.held = [i for i, x, _, z in cube.nodes if x == 0 and z == 0]


def _two_cubes_on_an_edge(cube):
    ids = {i: i if x == z == 1 else i + 100 for i, x, _, z in cube.nodes}
    cube.nodes += [[ids[i], 2 - x, y, 2 - z] for i, x, y, z in cube.nodes if ids[i] != i]
    turn = (5, 4, 7, 6, 1, 0, 3, 2)  # by 180° about the edge
    for element in list(cube.elements):
        nodes = element[2:]
        cube.elements.append([element[0] + 100, 1, *(ids[nodes[turn[k]]] for k in range(8))])


def _not_a_number(cube):
    cube.nodes[13][1] = "nan"


def _twice(cube):
    cube.nodes.append([14, 0.6, 0.6, 0.6])


def _unknown_node(cube):
    cube.elements[0][9] = 999


def _flat(cube):
    cube.nodes = [[i, x, y, 0.5 if z == 1 else z] for i, x, y, z in cube.nodes]


def _negative_density(cube):
    cube.materials[1]["DENSITY"] = -1000.0


def _incompressible(cube):
    cube.materials[1]["POISSON_RATIO"] = 0.5


def _beyond(cube):
    cube.materials[1]["POISSON_RATIO"] = 0.6


def _no_stiffness(cube):
    cube.materials[1]["YOUNG_MODULUS"] = 0.0


def _negative_stiffness(cube):
    cube.materials[1]["YOUNG_MODULUS"] = -1e6


def _no_density(cube):
    cube.materials[1]["DENSITY"] = 0.0


def _stray_load(cube):
    cube.nodes.append([50, 5.0, 5.0, 5.0])
    cube.loaded, cube.weight = [50], False


def _no_material(cube):
    for element in cube.elements[:4]:
        element[1] = 2


def _contrast(cube):
    cube.materials[2] = {"DENSITY": 1000.0, "YOUNG_MODULUS": 1e26, "POISSON_RATIO": 0.3}
    for element in cube.elements[1::2]:
        element[1] = 2


def _nearly_free(cube):
    cube.materials[2] = {"DENSITY": 1000.0, "YOUNG_MODULUS": 1e-12, "POISSON_RATIO": 0.3}
    for element in cube.elements[::2]:
        element[1] = 2


def _truncated(cube):
    cube.cut = 0.62


def _letter(cube):
    cube.text = lambda text: text.replace("14 0.5 0.5 0.5", "14 0.5 O.5 0.5")


CASES = {
    "sound (for comparison)": lambda cube: None,
    "element with its top and bottom exchanged": _inverted,
    "no supports": _unsupported,
    "held on one edge alone (a hinge)": _hinged,
    "two cubes that share one edge": _two_cubes_on_an_edge,
    "coordinate `nan`": _not_a_number,
    "node id given twice": _twice,
    "element names an unknown node": _unknown_node,
    "elements without volume": _flat,
    "density < 0": _negative_density,
    "density 0, loaded by weight": _no_density,
    "ν = 0.5": _incompressible,
    "ν = 0.6": _beyond,
    "E = 0": _no_stiffness,
    "E < 0": _negative_stiffness,
    "load on a node without elements": _stray_load,
    "half of the elements without material": _no_material,
    "stiff on soft, 1e20 : 1": _contrast,
    "held by a layer of E = 1e-12 Pa": _nearly_free,
    "file cut off at 62 %": _truncated,
    "letter O for a zero in a coordinate": _letter,
}

# ---- the programs --------------------------------------------------------------------------------------

OURS = """
import json
from pathlib import Path
import kratos_lite as kl
from kratos_lite.cli import main
main(["solve", "ProjectParameters.json", "--json", "out.json"])
if Path("out.json").exists():
    u = json.loads(Path("out.json").read_text())["displacement"].values()
    print("LARGEST", max(abs(c) for row in u for c in row))
"""

KRATOS = """
import KratosMultiphysics as KM
from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import (
    StructuralMechanicsAnalysis,
)
model = KM.Model()
settings = KM.Parameters(open("ProjectParameters.json").read())
StructuralMechanicsAnalysis(model, settings).Run()
u = [list(node.GetSolutionStepValue(KM.DISPLACEMENT)) for node in model["Structure"].Nodes]
print("LARGEST", max(abs(c) for row in u for c in row) if all(c == c for row in u for c in row) else "nan")
"""

SKFEM = """
import json
import numpy as np
import skfem
from skfem import Basis, BilinearForm, ElementHex1, ElementVector, LinearForm, MeshHex, condense, solve
from skfem.helpers import ddot, eye, sym_grad, trace
data = json.load(open("arrays.json"))
row = {node[0]: r for r, node in enumerate(data["nodes"])}
p = np.array([[float(x) for x in node[1:]] for node in data["nodes"]]).T
cells = np.array([[row[i] for i in element[2:]] for element in data["elements"]]).T
# from the order of Kratos to that of MeshHex, by the places of the corners in the reference cell
ours = [(0,0,0),(1,0,0),(1,1,0),(0,1,0),(0,0,1),(1,0,1),(1,1,1),(0,1,1)]
order = [ours.index(tuple(int(x) for x in corner)) for corner in MeshHex.elem.refdom.p.T]
mesh = MeshHex(p, cells[order])
basis = Basis(mesh, ElementVector(ElementHex1()))
of = [data["materials"][str(element[1])] for element in data["elements"]]
E, nu, rho = (np.array([m[k] for m in of])[:, None] for k in ("YOUNG_MODULUS", "POISSON_RATIO", "DENSITY"))
lam, mu = E * nu / (1 + nu) / (1 - 2 * nu), E / 2 / (1 + nu)
@BilinearForm
def stiffness(u, v, w):
    e = sym_grad(u)
    return ddot(lam * eye(trace(e), 3) + 2 * mu * e, sym_grad(v))
@LinearForm
def weight(v, w):
    return -9.81 * rho * v[2]
K = stiffness.assemble(basis)
f = weight.assemble(basis) if data["weight"] else np.zeros(K.shape[0])
for i in data["loaded"]:
    f[basis.nodal_dofs[2, row[i]]] -= 10.0
held = basis.nodal_dofs[:, [row[i] for i in data["held"]]].ravel()
u = solve(*condense(K, f, D=held))
print("LARGEST", np.abs(u).max())
"""


NO_FILE = (_twice, _unknown_node, _no_material, _truncated, _letter)
"""Faults of a file, which arrays do not have."""
NOISE = ("DEPRECATION", "note", "LARGEST")


def told(run):
    """Return what a run came to, in a few words."""
    lines = [line.strip() for line in (run.stderr + "\n" + run.stdout).splitlines()]
    if run.returncode < 0:
        return f"crash (signal {-run.returncode})"
    largest = [line.split()[1] for line in lines if line.startswith("LARGEST")]
    if largest:
        words = [line for line in lines if "arning" in line and not any(noise in line for noise in NOISE)]
        said = f"; {shorter(words[0])}" if words else ", not a word"
        return f"**{float(largest[0]):.4g} m**{said}"
    errors = [line for line in lines if re.search(r"(rror|xception): ", line) and "occured in a" not in line]
    text = re.split(r"(?:rror|xception): ", errors[0])[-1] if errors else lines[-1]
    return f"error: {shorter(text)}"


def shorter(text):
    """Return a message for a table."""
    text = re.sub(r"^.*?Warning: |^warning +", "warning: ", text).replace("|", "\\|")
    return text if len(text) <= 150 else text[:147].rsplit(" ", 1)[0] + " …"


def run(code, python, folder):
    """Return the run of a program in a folder."""
    root = Path(__file__).resolve().parent.parent
    environment = {**os.environ, "PYTHONPATH": str(root) if code is OURS else ""}
    words = [python, "-c", code]
    return subprocess.run(
        words, cwd=folder, capture_output=True, text=True, timeout=600, check=False, env=environment
    )


def main(python):
    """Write the table."""
    programs = {
        "kratos-lite": (OURS, sys.executable),
        "Kratos": (KRATOS, python),
        "scikit-fem": (SKFEM, python),
    }
    sys.stdout.write(f"| input | {' | '.join(programs)} |\n|{' --- |' * (1 + len(programs))}\n")
    for name, change in CASES.items():
        cube, cells = Cube(), [name]
        change(cube)
        for code, which in programs.values():
            with tempfile.TemporaryDirectory() as folder:
                cube.write(Path(folder))
                skip = code is SKFEM and change in NO_FILE
                cells.append("(no such file)" if skip else told(run(code, which, folder)))
        sys.stdout.write(f"| {' | '.join(cells)} |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1])

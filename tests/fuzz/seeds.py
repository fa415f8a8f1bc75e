"""Good inputs of every format, small and full of features: what the fuzzers damage."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from pathlib import Path

import meshio
import numpy as np

import kratos_lite as kl
from tests.fixtures.run_files import materials

MDPA = """\
Begin ModelPartData
 DENSITY 1.0
End ModelPartData
Begin Table 1 TIME PRESSURE
 0.0 1.0
 1.0 2.0
End Table
Begin Properties 1
 DENSITY 7620.0
 YOUNG_MODULUS 2.1e8
 POISSON_RATIO 0.3
 PRESTRESS [6] (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
 PRESTRESS_FACTOR 2.0
 INTEGRATION_ORDER 2
 VOLUME_ACCELERATION [3] (0.0, 0.0, -9.81)
End Properties
Begin Nodes
 1 0.0 0.0 0.0
 2 2.0 0.0 0.0
 3 2.0 1.0 0.0
 4 0.0 1.0 0.0
 5 0.0 0.0 0.5
 6 2.0 0.0 0.5
 7 2.0 1.0 0.5
 8 0.0 1.0 0.5
 9 1.0 0.5 1.5
End Nodes
Begin Elements KinematicLinear3D8N // body
 1 1 1 2 3 4 5 6 7 8
End Elements
Begin Elements KinematicLinear3D5N
 2 1 5 6 7 8 9
End Elements
Begin Conditions SurfaceLoadCondition3D4N
 1 1 1 4 3 2
End Conditions
Begin Conditions PointLoadCondition3D1N
 2 1 9
End Conditions
Begin NodalData DISPLACEMENT_X
 1 1 0.0
 2 1 0.0
 3 1 0.001
 4 1 0.0
End NodalData
Begin NodalData DISPLACEMENT_Y
 1 1 0.0
 2 1 0.0
 3 1 0.0
 4 1 0.0
End NodalData
Begin NodalData DISPLACEMENT_Z
 1 1 0.0
 2 1 0.0
 3 1 0.0
 4 1 0.0
 9 0 0.001
End NodalData
Begin NodalData POINT_LOAD
 9 0 [3] (1.0, 2.0, -3.0)
End NodalData
Begin ConditionalData POSITIVE_FACE_PRESSURE
 1 100.0
End ConditionalData
Begin Constraints LinearMasterSlaveConstraint DISPLACEMENT_X
 1 0.0 [0.5, 0.5] 9 5 6
End Constraints
Begin SubModelPart Parts
 Begin SubModelPartNodes
  1
  2
 End SubModelPartNodes
 Begin SubModelPart Top
  Begin SubModelPartNodes
   5
   6
   7
   8
  End SubModelPartNodes
  Begin SubModelPartElements
   1
  End SubModelPartElements
  Begin SubModelPartConditions
   1
  End SubModelPartConditions
 End SubModelPart
End SubModelPart
"""
SET = {
    "set.node": "NODES = NodesList([\n[1, 0, 0, 0],\n[2, 1, 0, 0],\n[3, 0, 1, 0],\n[4, 0, 0, 1]\n])\n",
    "set.elem": "ElementsGroup = solid;\nELEMENTS[1] = KinematicLinear3D4N([1,2,3,4],1);\n",
    "set.cond": "NODES[1].Fix(DISPLACEMENT_X);\nNODES[1].Fix(DISPLACEMENT_Y);\n"
    "NODES[1].Fix(DISPLACEMENT_Z);\n"
    "NODES[2].Fix(DISPLACEMENT_Y);\nNODES[2].Fix(DISPLACEMENT_Z);\nNODES[3].Fix(DISPLACEMENT_Z);\n"
    "CONDITIONS = ConditionsList(Face3D3N,[\n[20,[1,3,2], 1],\n])\n",
    "set.prop": "PROPERTIES[1][DENSITY] = 2400.0;\nPROPERTIES[1][YOUNG_MODULUS] = 1e9;\n"
    "PROPERTIES[1][POISSON_RATIO] = 0.2;\nPROPERTIES[1][GRAVITY] = [0, 0, -9.81];\n"
    "PROPERTIES[1][INSITU_STRESS] = [1, 2, 3, 0, 0, 0];\n",
    "set.init": "NODES[2](DISPLACEMENT_Y, 0) = 0.001;\nNODES[4](DISPLACEMENT_Z, 0) = 0.002;\n",
}
KRATOS = {
    "problem_data": {"problem_name": "a", "parallel_type": "OpenMP", "start_time": 0.0, "end_time": 1.0},
    "solver_settings": {
        "solver_type": "Static",
        "model_part_name": "Structure",
        "domain_size": 3,
        "analysis_type": "linear",
        "model_import_settings": {"input_type": "mdpa", "input_filename": "mesh"},
        "material_import_settings": {"materials_filename": "materials.json"},
        "time_stepping": {"time_step": 0.5},
    },
    "processes": {
        "constraints_process_list": [
            {
                "python_module": "assign_vector_variable_process",
                "Parameters": {
                    "model_part_name": "Structure.Parts.Top",
                    "variable_name": "DISPLACEMENT",
                    "constrained": [True, False, True],
                    "value": ["0.003*t*x", None, 0.0],
                    "interval": [0.0, "End"],
                },
            }
        ],
        "loads_process_list": [
            {
                "python_module": "assign_vector_by_direction_process",
                "Parameters": {
                    "model_part_name": "Structure",
                    "variable_name": "VOLUME_ACCELERATION",
                    "modulus": "9.81*(1-exp(-t))",
                    "direction": [0.0, 0.0, -1.0],
                },
            },
            {
                "python_module": "assign_scalar_variable_to_conditions_process",
                "Parameters": {
                    "model_part_name": "Structure.Parts.Top",
                    "variable_name": "POSITIVE_FACE_PRESSURE",
                    "value": "2.0*y if z<1 else 0",
                },
            },
        ],
    },
}
MATERIALS = materials("Structure", 1000.0, 1e9, 0.3)
ALE = {"rotation": {"axis": "z", "rate": 3.0, "acceleration": 0.1, "center": [0, 0, 0], "stiffening": True}}
SCENE = """import kratos_lite as kl
body = kl.{kind}(kl.box((1, 0.5, 0.2), (2, 1, 1)), kl.Isotropic3D(1e6, 0.3, 1000.0){options})
body.set_velocity((1, 0, 0), (0, 0, 2))
body.add(kl.Gravity((0, 0, -9.81)))
body.constrain(kl.FixPoint((0, 0, 0)))
dt, steps, every = 0.001, 5, 2
"""
BODIES = {
    "RigidBody": "",
    "PseudoRigidBody": "",
    "FiniteElementBody": ", formulation='total_lagrangian', integrator='linearly_implicit'",
}


@dataclass(frozen=True)
class Seed:
    """A good input: its files by name, that which a command takes, and options that solve it."""

    kind: str
    files: dict[str, bytes]
    main: str
    options: tuple[str, ...] = ()
    convertible: bool = True
    in_time: bool = False
    damaged: tuple[str, ...] = field(default=())

    def targets(self) -> list[str]:
        """Return the files that are damaged; all if none is named."""
        return list(self.damaged or self.files)


def _json(value: object) -> bytes:
    return json.dumps(value, indent=1).encode()


def seeds(folder: Path) -> list[Seed]:
    """Return all seeds; `folder` is for files that other programs write."""
    mesh, files = MDPA.encode(), {name: text.encode() for name, text in SET.items()}
    found = [Seed("mdpa", {"mesh.mdpa": mesh}, "mesh.mdpa"), Seed("elem", files, "set.elem")]
    dynamic = json.loads(json.dumps(KRATOS))
    dynamic["solver_settings"] |= {"solver_type": "Dynamic", "scheme_type": "bossak", "rayleigh_alpha": 0.1}
    for settings, in_time in ((KRATOS, False), (KRATOS | {"ale": ALE}, False), (dynamic, True)):
        inputs = {"run.json": _json(settings), "materials.json": _json(MATERIALS), "mesh.mdpa": mesh}
        found.append(Seed("kratos", inputs, "run.json", (), True, in_time, ("run.json", "materials.json")))
    for kind, options in BODIES.items():
        scene = SCENE.format(kind=kind, options=options).encode()
        inputs = {"scene.py": scene, "state.npz": _state(folder, scene)}
        restart = ("--restart", "state.npz")
        found.append(Seed("state", inputs, "scene.py", restart, False, True, ("state.npz",)))
    return found + [_of_meshio(folder, *one) for one in MESHES]


def _state(folder: Path, scene: bytes) -> bytes:
    path = folder / "scene.py"
    path.write_bytes(scene)
    kl.write(folder / "state.npz", kl.State.of(kl.read_case(path).body))
    return (folder / "state.npz").read_bytes()


MESHES = [
    ("a.msh", {"file_format": "gmsh22", "binary": False}),
    ("a.msh", {"file_format": "gmsh22", "binary": True}),
    ("a.msh", {"file_format": "gmsh", "binary": False}),
    ("a.msh", {"file_format": "gmsh", "binary": True}),
    ("a.vtu", {"binary": False}),
    ("a.vtu", {"binary": True}),
    ("a.vtk", {"binary": False}),
    ("a.inp", {}),
    ("a.bdf", {}),
    ("a.mesh", {}),
]
SOLVED = ("--material", "E=1e9,nu=0.3,density=1000", "--fix", "z-:xyz", "--gravity", "0,0,-9.81")


def _of_meshio(folder: Path, name: str, options: dict[str, object]) -> Seed:
    box = kl.box(cells=(2, 1, 1))
    cells = [("hexahedron", box.blocks[0].nodes)]
    data = {"gmsh:physical": [np.array([1, 2], dtype=np.int32)]} if name.endswith(".msh") else {}
    if name.endswith(".msh"):
        data["gmsh:geometrical"] = [np.array([1, 2], dtype=np.int32)]
    with redirect_stderr(io.StringIO()):
        meshio.Mesh(box.points, cells, cell_data=data).write(folder / name, **options)
    return Seed(name[1:], {name: (folder / name).read_bytes()}, name, SOLVED)


def pack(arrays: dict[str, object]) -> bytes:
    """Return an .npz file of arrays."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()

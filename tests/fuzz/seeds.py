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

GOOD = {path.name: path.read_bytes() for path in (Path(__file__).parent / "good").iterdir()}
SET = ("node", "elem", "cond", "prop", "init")
KRATOS, MATERIALS = (json.loads(GOOD[name]) for name in ("run.json", "materials.json"))
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
    mesh, files = GOOD["mesh.mdpa"], {f"set.{name}": GOOD[f"set.{name}"] for name in SET}
    found = [Seed("mdpa", {"mesh.mdpa": mesh}, "mesh.mdpa"), Seed("elem", files, "set.elem")]
    found.append(Seed("deck", {"deck.inp": GOOD["deck.inp"]}, "deck.inp"))
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

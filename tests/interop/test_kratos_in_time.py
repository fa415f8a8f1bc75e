"""The same dynamic run files in Kratos, live, and here: displacements, velocities and accelerations."""

import json
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import pytest
from run_files import materials, process, run_file, run_kratos

import kratos_lite as kl
from kratos_lite.io.files import read_case
from kratos_lite.io.run import prepare

for wheel in ("Multiphysics", "StructuralMechanicsApplication"):
    try:
        version(f"Kratos{wheel}")
    except PackageNotFoundError:
        pytest.skip(f"Kratos{wheel} is not installed", allow_module_level=True)

MATERIALS = materials("Structure.Body", 2500.0, 3e8, 0.2)
TO_NODES, TO_CONDITIONS = "assign_vector_variable_process", "assign_vector_variable_to_conditions_process"


def column(size, cells, element):
    """Return a column with faces to load on top, points to load on its upper edge, and parts."""
    mesh = kl.box(size, cells=cells, element=element)
    (faces,) = mesh.faces("z+")
    count, corners = len(faces), mesh.nodes("z+")[[0, -1]]
    kind = f"SmallDisplacementSurfaceLoadCondition3D{faces.nodes.shape[1]}N"
    points = kl.Block("PointLoadCondition3D1N", corners[:, None], np.arange(2) + count + 1, properties=0)
    parts = {
        "Body": kl.Part(np.arange(mesh.n_nodes), np.arange(mesh.n_elements)),
        "Bottom": kl.Part(mesh.nodes("z-")),
        "Top": kl.Part(mesh.nodes("z+"), conditions=np.arange(count)),
        "Tips": kl.Part(corners, conditions=np.arange(count, count + 2)),
    }
    faces = kl.Block(kind, faces.nodes, properties=0, shape=faces.shape)
    return mesh.replace(conditions=[faces, points], parts=parts)


CLAMP = process(TO_NODES, "Structure.Bottom", "DISPLACEMENT", value=[0.0, 0.0, 0.0])
WEIGHT = process(
    TO_NODES, "Structure.Body", "VOLUME_ACCELERATION", value=[0.0, 0.0, -9.81], constrained=[False] * 3
)


def push(*value, **settings):
    return process(TO_CONDITIONS, "Structure.Top", "SURFACE_LOAD", value=list(value), **settings)


def start(variable, *value):
    return process(
        TO_NODES, "Structure.Body", variable, value=list(value), constrained=[False] * 3, interval=[0.0, 0.0]
    )


def in_time(constraints, loads, **solver):
    implicit = {"solver_type": "Dynamic", "time_integration_method": "implicit", "move_mesh_flag": False}
    return run_file(constraints, loads, mesh="mesh", step=2e-3, end=0.1, **implicit, **solver)


NEWMARK = {"scheme_type": "newmark"}
DAMPED = {"rayleigh_alpha": 2.0, "rayleigh_beta": 1e-4}
HEX, CANTILEVER = "KinematicLinear3D8N", "KinematicLinear3D20N"
THROWN = [CLAMP, start("VELOCITY", "0.1*Z", 0.0, None)]
PULLED = [start("DISPLACEMENT", "1e-3*Z", None, 0.0), CLAMP]
SWING = [push("1e4*sin(60*t)*(1+x)", 0.0, "-2e3*t^2")]
FADING = [
    WEIGHT,
    push("1e5*t", 0.0, 0.0, interval=[0.0, 0.03]),  # stays at its last value
    push(0.0, "1e4*t", None, interval=[0.02, 0.07]),
    process(TO_CONDITIONS, "Structure.Tips", "POINT_LOAD", value=[0.0, "5*t", 1.0], interval=[0.01, "End"]),
]
CASES = {
    "cantilever, newmark": (CANTILEVER, in_time([CLAMP], [WEIGHT, push(1e4, 0.0, 0.0)], **NEWMARK)),
    "cantilever, bossak": (CANTILEVER, in_time([CLAMP], SWING)),
    "column, newmark, damped": (HEX, in_time([CLAMP], [WEIGHT, *SWING], **NEWMARK, **DAMPED)),
    "column, bossak -0.1, damped": (HEX, in_time([CLAMP], SWING, damp_factor_m=-0.1, **DAMPED)),
    "loads that come and stay": (HEX, in_time([CLAMP], FADING, **DAMPED)),
    "thrown, newmark": (HEX, in_time(THROWN, [], **NEWMARK, **DAMPED)),
    "thrown, bossak": (HEX, in_time(THROWN, [WEIGHT], **DAMPED)),
    "let go, newmark": (HEX, in_time(PULLED, SWING, **NEWMARK)),
    "let go, bossak": (HEX, in_time(PULLED, [], **DAMPED)),
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Return the folders of all cases, in which Kratos has run."""
    found = {}
    for name, (element, content) in CASES.items():
        found[name] = folder = tmp_path_factory.mktemp("case")
        size, cells = ((0.2, 0.3, 2.0), (1, 1, 4)) if element == CANTILEVER else ((0.5, 0.4, 3.0), (2, 1, 5))
        kl.write(folder / "mesh.mdpa", column(size, cells, element))
        (folder / "materials.json").write_text(json.dumps(MATERIALS))
        (folder / "ProjectParameters.json").write_text(json.dumps(content))
    run_kratos(*found.values())
    return found


@pytest.mark.parametrize("name", CASES)
def test_a_dynamic_run_file_moves_as_in_kratos(folders, name):
    scene = read_case(folders[name] / "ProjectParameters.json")
    *_, state = prepare(scene)[1]
    expected = json.loads((folders[name] / "kratos.json").read_text())
    assert state.step >= 50
    fields = {"DISPLACEMENT": state.u, "VELOCITY": state.v, "ACCELERATION": state.a}
    if "newmark" in name:  # Bossak's integrator takes M a at another time, and Kratos' reactions with it
        fields["REACTION"] = state.reactions
    for field, found in fields.items():
        # without any damping Kratos' accelerations hand their rounding on from step to step
        rough = field == "ACCELERATION" and name == "cantilever, newmark"
        reference = np.array([expected[field][str(i)] for i in scene.model.mesh.node_ids])
        scale = np.abs(reference).max()
        assert scale > 0
        error = np.abs(found - reference).max() / scale
        assert error < (1e-8 if rough else 1e-10), field

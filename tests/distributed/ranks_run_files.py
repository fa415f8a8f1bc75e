"""Run files read by several ranks: what each holds, and errors, are those of one process."""

import json
import shutil
import tempfile
from itertools import product
from pathlib import Path

import numpy as np
from run_files import MATERIALS, ONE_STEP, box_mdpa, process, replaced, run_file, spots, write
from runner import ROOT, load

import kratos_lite as kl
from kratos_lite.analysis.nodal_loads import external_loads

KRATOS = load(ROOT / "tests" / "io" / "kratos" / "test_bad_run_files.py")
OWN = load(ROOT / "tests" / "io" / "readers" / "test_run_file.py")
PROJECT = "ProjectParameters.json"
JUNK = [None, -1, 1e308, "x", [], {"a": 1}]


class folder_of:
    """A folder that all ranks know, with the files that run files name."""

    def __init__(self, ranks):
        self.ranks = ranks

    def __enter__(self):
        self.path = Path(self.ranks.first(tempfile.mkdtemp() if self.ranks.rank == 0 else None))
        self.write(box_mdpa(), "box.mdpa")
        self.write(MATERIALS, "materials.json")
        self.write(KRATOS.REFERENCE, "reference.json")
        return self

    def __exit__(self, *error):
        self.ranks.sum(1)
        if self.ranks.rank == 0:
            shutil.rmtree(self.path)

    def write(self, content, name=PROJECT):
        """Write a file once all ranks have read what was there, and wait until it is written."""
        self.ranks.sum(1)
        if self.ranks.rank == 0:
            write(self.path, content, name)
        self.ranks.sum(1)
        return self.path / name


def read(path, **options):
    """Return the case of an input, or the text of its error."""
    try:
        return kl.read_case(path, **options), ""
    except kl.KratosLiteError as error:
        return None, f"{type(error).__name__}: {error}"


def forces(model):
    return external_loads(model.mesh, model.element_groups(), model.loads)


def same_model(ranks, whole, model):
    """Compare what is here with the same of the whole model; forces are whole on own nodes."""
    mesh, all_of = model.mesh, whole.mesh
    rows, own = all_of.node_rows(mesh.node_ids), mesh.own_nodes
    assert ranks.sum(int(own.sum())) == all_of.n_nodes
    assert np.array_equal(model.supports.fixed, whole.supports.fixed[rows])
    assert np.array_equal(model.supports.values, whole.supports.values[rows])
    assert (model.initial_displacement is None) == (whole.initial_displacement is None)
    if whole.initial_displacement is not None:
        assert np.array_equal(model.initial_displacement, whole.initial_displacement[rows])
    expected = forces(whole)
    scale = np.abs(expected).max(initial=1e-300)
    assert np.allclose(forces(model)[own] / scale, expected[rows[own]] / scale, rtol=0, atol=1e-13)
    assert model.table()[3:] == whole.table()[3:] or ranks.size > 1
    assert model.notes == whole.notes


def check(ranks, path):
    """Compare a run file read by ranks with the same read by one process; return its error."""
    (whole, expected), (case, error) = read(path), read(path, comm=ranks)
    assert error == expected, (error, expected)
    assert ranks.gather(error) == [expected] * ranks.size
    if whole is not None:
        same_model(ranks, whole.model, case.model)
        assert (case.solver, case.tolerance, case.outputs, len(case.expected)) == (
            whole.solver,
            whole.tolerance,
            whole.outputs,
            len(whole.expected),
        )
    return error


def everything():
    """Return a run file whose parts, conditions and points stand in a corner: most ranks have none."""
    return run_file(
        [KRATOS.CLAMP, process("fix_scalar_variable_process", "Structure.Tips", "DISPLACEMENT_Y")],
        [
            KRATOS.GRAVITY,
            process(
                "assign_vector_variable_to_conditions_process", "Tips", "POINT_LOAD", value=[1.0, "x*y", 2.0]
            ),
            process(
                "assign_scalar_variable_to_conditions_process", "Top", "POSITIVE_FACE_PRESSURE", value=1e5
            ),
            process("assign_vector_variable_process", "Tips", "VELOCITY", value=[1, 1, 1], constrained=False),
        ],
    )


OWN_FILES = {
    "all keys": {
        "model": "box.mdpa",
        "material": OWN.STEEL,
        "fix": {"Bottom": {"x": 0.0, "y": 0.001, "z": 0.0}, "Tips": "y"},
        "gravity": [0, 0, -9.81],
        "traction": {"Top": [1e5, 0, 0]},
        "pressure": {"Side": 1e4},
        "solver": {"type": "dense", "tolerance": 1e-8},
        "json": "box_result.json",
    },
    "by part": {
        "model": "box.mdpa",
        "material": {"Body": OWN.STEEL},
        "fix": {"Bottom": "xyz", "z-": {"x": 0}},
        "point_load": {"Tips": [0, 5.0, 0]},
    },
}


def test_run_files(ranks, name):
    content = {"one step": ONE_STEP, "checked": KRATOS.CHECKED, "corner": everything()}.get(name)
    with folder_of(ranks) as folder:
        path = folder.write(content or OWN_FILES[name], PROJECT if content else "own.json")
        assert check(ranks, path) == ""


test_run_files.cases = ["one step", "checked", "corner", *OWN_FILES]


def test_bad_run_files(ranks, table, name):
    """Each mistake has the error of one process on all ranks."""
    bad = {"kratos": KRATOS.BAD, "own": OWN.BAD_OWN}[table]
    with folder_of(ranks) as folder:
        error = check(ranks, folder.write(bad[name][0], "own.json" if table == "own" else PROJECT))
        assert bad[name][1] in error


test_bad_run_files.cases = [("kratos", name) for name in KRATOS.BAD] + [("own", name) for name in OWN.BAD_OWN]


def test_bad_materials(ranks, name):
    content, words = KRATOS.BAD_MATERIALS[name]
    with folder_of(ranks) as folder:
        folder.write(content, "materials.json")
        assert words in check(ranks, folder.write(KRATOS.changed()))


test_bad_materials.cases = list(KRATOS.BAD_MATERIALS)


def test_elements_without_material(ranks):
    """The element stands on one rank only."""
    text = box_mdpa().replace("Begin SubModelPart Body\n", "Begin SubModelPart Half\n")
    start = text.index("Begin SubModelPartElements")
    with folder_of(ranks) as folder:
        folder.write(text[:start] + text[start:].replace("\n8\n", "\n", 1), "box.mdpa")
        folder.write(KRATOS.bad_material(model_part_name="Half"), "materials.json")
        assert "element 8 " in check(ranks, folder.write(KRATOS.changed()))


def test_any_value_of_a_wrong_kind(ranks, content, name):
    """Whatever one process makes of a run file, several do."""
    content = {"one step": ONE_STEP, "checked": KRATOS.CHECKED, "own": OWN.OWN, "materials": MATERIALS}[
        content
    ]
    paths, refused = list(spots(content)), 0
    with folder_of(ranks) as folder:
        folder.write(KRATOS.CHECKED)
        for number, (path, junk) in enumerate(product(paths, JUNK)):
            if number % 7 == 0:
                folder.write(json.dumps(replaced(content, path, junk)), name)
                refused += bool(check(ranks, folder.path / (name if name == "own.json" else PROJECT)))
    assert refused > 3


test_any_value_of_a_wrong_kind.cases = [
    ("one step", PROJECT),
    ("checked", PROJECT),
    ("own", "own.json"),
    ("materials", "materials.json"),
]

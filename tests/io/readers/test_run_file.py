"""Run files of kratos_lite: what they mean, and what is refused with its place."""

import numpy as np
import pytest
from run_files import MATERIALS, by_hand, replaced, same_field, spots, write

import kratos_lite as kl
from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.io.case import Outputs
from kratos_lite.io.files import read_case


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("61", "trailing comma"),
        ("62", "NaN is not a number"),
        ("63", "duplicate key 'E'"),
        ("64", "unknown key 'sovler'. Did you mean solver?"),
        ("65", "tolerance must be a number; got '1e-8'"),
        ("66", "leaves the folder"),
        ("67", "nesting deeper than 64"),
        ("68", "there is no file"),
        ("69", "is a folder"),
        ("70", "integer of 5001 digits is too long"),
    ],
)
def test_malformed_run_file_is_refused_with_the_problem(malformed, name, words):
    (path,) = malformed.glob(f"{name}_*.json")
    with pytest.raises(InputError) as caught:
        read_case(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}:1:")


def test_small_good_run_file_is_read(malformed):
    project = read_case(malformed / "60_good.json")
    assert project.solver == "direct"
    assert project.model.mesh.n_elements == 1


STEEL = {"E": 2e9, "nu": 0.3, "density": 7850.0}


def test_own_run_file_with_all_keys(folder):
    own = {
        "model": "box.mdpa",
        "material": {"law": "Isotropic3D", **STEEL},
        "fix": {"Bottom": {"x": 0.0, "y": 0.0, "z": 0.0}},
        "gravity": [0, 0, -9.81],
        "traction": {"Top": [1e5, 0, 0]},
        "solver": {"type": "dense", "tolerance": 1e-8},
        "output": "out/box.vtu",
        "json": "box_result.json",
        "picture": "box.png",
    }
    project = read_case(write(folder, own, "own.json"))
    assert (project.solver, project.tolerance) == ("dense", 1e-8)
    assert project.outputs == Outputs(
        [str(folder / "out" / "box.vtu")], str(folder / "box_result.json"), str(folder / "box.png")
    )
    assert project.compare(project.model.solve()) == []
    same_field(project.model.solve(), by_hand(top=(1e5, 0.0, 0.0), gravity=(0.0, 0.0, -9.81)).solve())


def test_own_run_file_by_part_with_pressure_and_point_load(folder):
    own = {
        "model": "box.mdpa",
        "material": {"Body": STEEL},
        "fix": {"Bottom": "xyz", "z-": {"x": 0}},
        "pressure": {"Top": 2e4},
        "point_load": {"Tips": [0, 5.0, 0]},
    }
    project = read_case(write(folder, own, "own.json"))
    hand = by_hand(top=(0.0, 0.0, -2e4))
    hand.add(
        kl.PointLoad(lambda X: (X[:, 0] > 1.9) & (X[:, 2] > 1.4) & (np.abs(X[:, 1] - 0.5) > 0.4), (0, 5.0, 0))
    )
    same_field(project.model.solve(), hand.solve())
    assert (project.solver, project.tolerance, project.outputs) == ("auto", 1e-10, Outputs())


BAD_OWN = {
    "no model": ({}, "key 'model' is missing"),
    "model as number": ({"model": 3}, "model must be a string; got 3"),
    "run file as model": ({"model": "own.json"}, "model must be a mesh file"),
    "solver as text": ({"model": "box.mdpa", "solver": "amg"}, "solver must be an object {…}; got 'amg'"),
    "solver type": (
        {"model": "box.mdpa", "solver": {"type": "cg"}},
        "one of auto, dense, direct, amg; got 'cg'",
    ),
    "solver key": ({"model": "box.mdpa", "solver": {"kind": "amg"}}, "unknown key 'solver.kind'"),
    "tolerance": ({"model": "box.mdpa", "tolerance": -1}, "tolerance must lie between 0 and 1"),
    "two tolerances": (
        {"model": "box.mdpa", "tolerance": 1e-8, "solver": {"tolerance": 1e-9}},
        "tolerance is given twice",
    ),
    "steps": ({"model": "box.mdpa", "steps": 3}, "unknown key 'steps'"),
    "absolute picture": (
        {"model": "box.mdpa", "picture": "/box.png"},
        "picture: path '/box.png' leaves the folder",
    ),
    "drive": ({"model": "box.mdpa", "json": "C:\\box.json"}, "leaves the folder"),
    "hidden step up": ({"model": "box.mdpa", "json": "a/../../box.json"}, "leaves the folder"),
    "gravity": ({"model": "box.mdpa", "gravity": [0, 0]}, "gravity must be a list of three numbers"),
    "gravity of truth": (
        {"model": "box.mdpa", "gravity": [0, 0, True]},
        "gravity must be a list of three numbers",
    ),
    "fix number": ({"model": "box.mdpa", "fix": {"Bottom": 1}}, 'fix.Bottom must be axes such as "xz"'),
    "fix axes": ({"model": "box.mdpa", "fix": {"Bottom": "xw"}}, "fix.Bottom: axes must be some of x, y, z"),
    "fix axis": ({"model": "box.mdpa", "fix": {"Bottom": {"w": 1}}}, "unknown key 'fix.Bottom.w'"),
    "fix part": ({"model": "box.mdpa", "fix": {"Botom": "x"}}, "there is no part 'Botom'"),
    "fixed twice": (
        {"model": "box.mdpa", "fix": {"Bottom": "x", "z-": {"x": 0.1}}},
        "fix.z-.x: node 1 along x is prescribed twice",
    ),
    "traction": (
        {"model": "box.mdpa", "traction": {"Top": 5}},
        "traction.Top must be a list of three numbers",
    ),
    "pressure": ({"model": "box.mdpa", "pressure": {"Top": "5"}}, "pressure.Top must be a number; got '5'"),
    "pressure part": ({"model": "box.mdpa", "pressure": {"Topp": 5}}, "there is no part 'Topp'"),
    "law": ({"model": "box.mdpa", "material": {"law": "Isotrop3D"}}, "Did you mean Isotropic3D"),
    "no nu": ({"model": "box.mdpa", "material": {"E": 1}}, "material: Isotropic3D needs nu"),
    "unknown constant": ({"model": "box.mdpa", "material": {"E": 1, "mu": 0}}, "unknown key 'material.mu'"),
    "negative E": ({"model": "box.mdpa", "material": {"E": -1, "nu": 0}}, "must be > 0 Pa"),
    "material part": ({"model": "box.mdpa", "material": {"Bodi": STEEL}}, "there is no part 'Bodi'"),
    "materials file": (MATERIALS, "this is a materials file"),
    "a list": ([], "an object {…} is expected; got list"),
}


@pytest.mark.parametrize("name", BAD_OWN)
def test_bad_own_run_file_is_refused_with_place_and_problem(folder, name):
    content, words = BAD_OWN[name]
    path = write(folder, content, "own.json")
    with pytest.raises(InputError) as caught:
        read_case(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}:")


def test_all_problems_of_an_own_run_file_are_told_together(folder):
    own = {"model": "none.mdpa", "sovler": 1, "tolerance": "x", "output": "/x", "fix": [], "gravity": 1}
    with pytest.raises(InputError) as caught:
        read_case(write(folder, own, "own.json"))
    lines = str(caught.value).splitlines()
    assert [int(line.split("own.json:")[1].split(":")[0]) for line in lines] == [3, 4, 5, 2, 6, 7]


OWN = {
    "model": "box.mdpa",
    "material": {"Body": {"E": 2e9, "nu": 0.3}},
    "fix": {"Bottom": "xyz", "Top": {"x": 0.1}},
    "gravity": [0, 0, -9.81],
    "pressure": {"Top": 1.0},
    "solver": {"type": "dense"},
    "json": "a.json",
}


@pytest.mark.parametrize(
    "junk", [None, True, -1, 0.5, 1e308, -(10**18), "", "x", "..", [], [[]], {}, {"a": 1}]
)
def test_any_value_of_a_wrong_kind_ends_in_a_case_or_a_clear_error(folder, junk):
    paths, refused = list(spots(OWN)), 0
    for path in paths:
        write(folder, replaced(OWN, path, junk), "own.json")
        try:
            read_case(folder / "own.json")
        except KratosLiteError as error:
            refused += 1
            assert str(folder) in str(error), (path, junk, str(error))  # noqa: PT017
    assert refused > 3

"""Scenes against the results stored beside them: closed forms of ours, Kratos 10.4.4 of real ones."""

import json

import numpy as np
import pytest
from scenes import OURS, case, present

from benchmarks import cases
from kratos_lite.assembly.stiffness import assemble_dense

SOLVED = present(
    "bar_8N", "elem_column_27N", "eigen_cube_8N", "elem_activation_8N", "elem_balken_27N", "elem_beam3d_KL4N",
    "patch_3D_shear_hexa", "patch_3D_tension_tetra", "response_cantilever_beam_8N", "symmetrical_cube_4N",
    "tensile_hexahedra",
)  # fmt: skip


def model_of(folder, case, reference, file):
    """Return the model of a case: the file, what case.json adds, and pins where it floats."""
    model = cases.model_of(folder, {**case, "mdpa": file})
    if case.get("pin_minimal"):
        pins = reference["pins"]
        for node, axes in ((pins["a"], "xyz"), (pins["b"][0], "yz"), (pins["c"][0], "z")):
            model.fix(model.mesh.node_rows([node]), axes)
    return model


def files_of(case):
    return [case["mdpa"], *([case["datafile"] + ".elem"] if "datafile" in case else [])]


def load(name):
    folder = case(name)
    return folder, *(json.loads((folder / f"{f}.json").read_text()) for f in ("case", "reference"))


def reference_displacement(reference, mesh):
    rows = mesh.node_rows([int(i) for i in reference["displacement"]])
    u = np.zeros_like(mesh.points)
    u[rows] = list(reference["displacement"].values())
    return u


@pytest.mark.parametrize("name", SOLVED)
def test_displacements_reactions_and_stresses_are_those_of_kratos(name):
    folder, statement, reference = load(name)
    for file in files_of(statement):
        model = model_of(folder, statement, reference, file)
        model.formulation = "standard"  # names such as TotalLagrangian… are linear there
        result = model.solve()
        expected = reference_displacement(reference, model.mesh)
        assert np.abs(result.displacement() - expected).max() <= 1e-8 * np.abs(expected).max()
        assert model.mesh.n_elements == reference["n_elements"]
        total = np.array(reference["summary"]["reaction_sum"])
        scale = np.abs(result.reaction()).sum() + np.abs(result.loads).sum()
        assert np.abs(result.reaction().sum(axis=0) - total).max() <= 1e-9 * scale
        volume = sum(float(group.at(model.mesh.points).volume().sum()) for group in result.groups)
        assert abs(volume / reference["volume"] - 1) <= 1e-9
        # of TotalLagrangian Kratos gives the stress before the solution
        if "TotalLagrangian" not in model.mesh.blocks[0].name:
            stress = np.concatenate(list(result.stress("gauss")))
            for extreme, of in (("stress_max", stress.max(axis=0)), ("stress_min", stress.min(axis=0))):
                kratos = np.array(reference["summary"][extreme])
                assert np.abs(of - kratos).max() <= 1e-7 * np.abs(stress).max()


def test_pressure_on_rve_differs_from_kratos_by_its_load_stiffness_alone(shared):
    """SurfaceLoadCondition adds a load stiffness to K in a linear analysis, too, scaled by det J twice.

    The stored reference has it, so it is off from the dead-load solution by 4.9e-5.  With that matrix
    added to our K the reference comes out; without it ours is what Kratos gives with
    SmallDisplacementSurfaceLoadCondition (see test_kratos.py).
    """
    folder, statement, reference = load("rve_4N_pressure")
    model = model_of(folder, statement, reference, statement["mdpa"])
    result = model.solve()
    expected = reference_displacement(reference, model.mesh)
    assert np.abs(result.displacement() - expected).max() < 6e-5 * np.abs(expected).max()

    K = assemble_dense(model.mesh.points, result.groups)
    pressure = statement["surface_pressure"][0]["value"]
    dN = np.array([[-1, -1], [1, 0], [0, 1]])
    for nodes in model.mesh.conditions[0].nodes:
        X = model.mesh.points[nodes]
        first, second = X[1] - X[0], X[2] - X[0]
        area = np.linalg.norm(np.cross(first, second))
        for j, node in enumerate(nodes):
            turn = dN[j, 1] * cross_matrix(first) - dN[j, 0] * cross_matrix(second)
            for row in nodes:
                K[3 * row : 3 * row + 3, 3 * node : 3 * node + 3] += pressure / 6 * area * turn
    free = ~model.supports.fixed.ravel()
    u = np.zeros(len(free))
    u[free] = np.linalg.solve(K[np.ix_(free, free)], result.loads.ravel()[free])
    assert np.abs(u - expected.ravel()).max() <= 1e-8 * np.abs(expected).max()


def cross_matrix(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def test_every_folder_of_cases_is_solved_or_only_parsed(shared):
    folders = {p.name for p in (shared / "cases").iterdir() if p.is_dir()}
    parsed = {n for n in folders if load(n)[1].get("parse_only")}
    ours = {path.name for path in OURS.iterdir()}
    assert folders - parsed == {*SOLVED, "rve_4N_pressure"} - ours

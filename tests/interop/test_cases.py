"""Real scenes against the results of Kratos 10.4.4 stored beside them."""

import json

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.io.files import read

SOLVED = [
    "eigen_cube_8N",
    "elem_activation_8N",
    "elem_balken_27N",
    "elem_beam3d_KL4N",
    "patch_3D_shear_hexa",
    "patch_3D_tension_tetra",
    "response_cantilever_beam_8N",
    "rve_4N_pressure",
    "symmetrical_cube_4N",
    "tensile_hexahedra",
]


def model_of(folder, case, reference, file):
    """Return the model of a case: the file plus what case.json adds."""
    materials = case.get("materials", [])
    model = read(folder / file, materials=not materials)
    for m in materials:
        model.assign(kl.Isotropic3D(m["E"], m["nu"], m["rho"]), m["part"])
    for fix in case.get("fix", []):
        for axis, value in zip("xyz", fix["value"], strict=True):
            if value is not None:
                model.fix(fix["part"], axis, value, override=True)
    for plane in case.get("fix_plane", []):
        model.fix("xyz"[plane["axis"]] + "-+"[plane["at"] == "max"], "xyz")
    if case.get("pin_minimal"):
        pins = reference["pins"]
        for node, axes in ((pins["a"], "xyz"), (pins["b"][0], "yz"), (pins["c"][0], "z")):
            model.fix(model.mesh.node_rows([node]), axes)
    if "gravity" in case:
        model.add(kl.Gravity(case["gravity"]))
    for load in case.get("surface_load", []):
        model.add(kl.Traction(load["part"], load["value"]))
    for load in case.get("surface_pressure", []):
        model.add(kl.Pressure(load["part"], load["value"], normal="nodes"))
    for load in case.get("point_load", []):
        model.add(kl.PointLoad(load["part"], load["value"]))
    return model


def files_of(name, case):
    return [case["mdpa"], *([case["datafile"] + ".elem"] if "datafile" in case else [])]


@pytest.mark.parametrize("name", SOLVED)
def test_displacements_reactions_and_stresses_are_those_of_kratos(shared, name):
    folder = shared / "cases" / name
    case = json.loads((folder / "case.json").read_text())
    reference = json.loads((folder / "reference.json").read_text())
    for file in files_of(name, case):
        model = model_of(folder, case, reference, file)
        result = model.solve()
        ids = [int(i) for i in reference["displacement"]]
        expected = np.array(list(reference["displacement"].values()))
        found = result.displacement()[model.mesh.node_rows(ids)]
        assert np.abs(found - expected).max() <= 1e-8 * np.abs(expected).max()
        assert model.mesh.n_elements == reference["n_elements"]
        total = np.array(reference["summary"]["reaction_sum"])
        scale = np.abs(result.reaction()).sum()
        assert np.abs(result.reaction().sum(axis=0) - total).max() <= 1e-9 * scale
        stress = np.concatenate(list(result.stress("gauss")))
        for extreme, of in (("stress_max", stress.max(axis=0)), ("stress_min", stress.min(axis=0))):
            kratos = np.array(reference["summary"][extreme])
            assert np.abs(of - kratos).max() <= 1e-7 * np.abs(stress).max()
        volume = sum(float(batch.at(model.mesh.points).volume().sum()) for batch in result.batches)
        assert abs(volume / reference["volume"] - 1) <= 1e-9


def test_every_folder_of_cases_is_solved_or_only_parsed(shared):
    folders = {p.name for p in (shared / "cases").iterdir() if p.is_dir()}
    parsed = {n for n in folders if json.loads((shared / "cases" / n / "case.json").read_text()).get("parse_only")}
    assert folders - parsed == set(SOLVED)

"""Output processes of run files: their files, their steps, and what is refused."""

import json
import re

import meshio
import numpy as np
import pytest
from kratos_part_files import write_part_files
from run_files import CLAMP, GRAVITY, MATERIALS, box_mdpa, materials, output, process, run_file, write

import kratos_lite as kl
from kratos_lite.io.files import read_case
from kratos_lite.io.kratos.context import Omission
from kratos_lite.io.kratos.run_file import read_kratos_project
from kratos_lite.io.run import check, run

STRESS, STRAIN = "CAUCHY_STRESS_VECTOR", "GREEN_LAGRANGE_STRAIN_VECTOR"
NODAL = "nodal_solution_step_data_variables"
ON_NODES, IN_ELEMENTS = "gauss_point_variables_extrapolated_to_nodes", "gauss_point_variables_in_elements"
E, NU = 2e9, 0.3
GRADIENT = np.array([[1e-3, 2e-4, -3e-4], [4e-4, -2e-3, 5e-4], [1e-4, -6e-4, 3e-3]])
"""Of the displacement of the patch test, whose strain is the same everywhere."""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "box.mdpa").write_text(box_mdpa())
    write(tmp_path, MATERIALS, "materials.json")
    return tmp_path


def solved(folder, *outputs, **settings):
    """Run the patch test, all nodes moved as by `GRADIENT` at t = 1 s, with output processes."""
    rows = GRADIENT.tolist()
    value = [" + ".join(f"({c})*{x}*t" for c, x in zip(row, "XYZ", strict=True)) for row in rows]
    hold = process("assign_vector_variable_process", "Structure", "DISPLACEMENT", value=value)
    hold["Parameters"]["interval"] = [0.0, "End"]
    content = run_file([hold], [], outputs={"all": list(outputs)}, step=1.0, end=1.0) | settings
    outcome = run(read_case(write(folder, content)))
    return outcome, outcome.write()


def exact():
    """Return strain and stress of the patch test, of an isotropic law."""
    e = (GRADIENT + GRADIENT.T) / 2
    s = E / (1 + NU) * (e + NU / (1 - 2 * NU) * np.trace(e) * np.eye(3))
    order = ([0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2])
    return e[order] * [1, 1, 1, 2, 2, 2], s[order]


@pytest.mark.parametrize("kind", ["ascii", "binary"])
def test_a_patch_test_as_vtk(folder, kind):
    strain, stress = exact()
    mises = np.sqrt((np.sum((stress[:3] - np.roll(stress[:3], 1)) ** 2) + 6 * np.sum(stress[3:] ** 2)) / 2)
    fields = {NODAL: ["DISPLACEMENT"], ON_NODES: [STRESS], IN_ELEMENTS: ["VON_MISES_STRESS", STRAIN]}
    _, written = solved(folder, output("vtk", file_format=kind, **fields))
    (path,) = written
    assert path == str(folder / "VTK_Output" / "Structure_0_1.vtk")
    found, mesh = meshio.read(path), kl.read(folder / "box.mdpa").mesh
    assert found.cells_dict["hexahedron"].tolist() == mesh.blocks[0].nodes.tolist()
    assert np.abs(found.points - mesh.points).max() < 1e-6
    moved = mesh.points @ GRADIENT.T
    assert np.abs(found.point_data["DISPLACEMENT"] - moved).max() < 1e-6 * np.abs(moved).max()
    assert np.abs(found.point_data[STRESS] - stress).max() < 1e-5 * np.abs(stress).max()
    (of_cells,) = found.cell_data["VON_MISES_STRESS"]
    assert np.abs(of_cells - mises).max() < 1e-5 * mises
    (of_cells,) = found.cell_data[STRAIN]
    assert np.abs(of_cells - strain).max() < 1e-5 * np.abs(strain).max()


def test_a_gradient_extrapolated_to_nodes(folder):
    """Σ |N| V v / Σ |N| V of all elements, of one volume, under their weight."""
    fields = {ON_NODES: ["CAUCHY_STRESS_VECTOR"], "file_format": "ascii"}
    content = run_file([CLAMP], [GRAVITY], outputs={"all": [output("vtk", **fields)]})
    outcome = run(read_case(write(folder, content)))
    found = meshio.read(outcome.write()[0]).point_data[STRESS]
    mesh, stress = outcome.result.mesh, outcome.result.stress()
    g = 1 / np.sqrt(3)
    at = np.array([[x, y, z] for x in (-g, g) for y in (-g, g) for z in (-g, g)])
    corners = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]])
    corners = np.vstack([corners, np.add(corners, [0, 0, 2])])
    N = np.prod(1 + at[:, None] * corners, axis=2) / 8
    own = outcome.result.at_integration_points("INTEGRATION_POINT_LOCAL", 1)
    N = N[[np.abs(at - x).sum(axis=1).argmin() for x in own]]
    total, weight = np.zeros((27, 6)), np.zeros(27)
    for nodes, values in zip(mesh.blocks[0].nodes, stress, strict=True):
        total[nodes] += N.T @ values
        weight[nodes] += N.sum(axis=0)
    wanted = total / weight[:, None]
    assert np.abs(found - wanted).max() < 1e-5 * np.abs(wanted).max()


def test_values_over_time_and_at_a_point(folder):
    strain, stress = exact()
    values = output(
        "json", output_variables=["DISPLACEMENT_Y"], gauss_points_output_variables=[STRESS, STRAIN],
        output_file_name="out/values.json", time_frequency=0.5,
    )  # fmt: skip
    place = np.array([0.3, 0.7, 1.1])
    file = {"file_name": "point", "output_path": "out"}
    point = output(
        "point", position=place.tolist(), output_variables=["DISPLACEMENT"], output_file_settings=file
    )
    solved(folder, values, point)
    found = json.loads((folder / "out/values.json").read_text())
    assert found["TIME"] == [1.0]
    assert len(found) == 1 + 27 + 8
    for i, x in enumerate(kl.read(folder / "box.mdpa").mesh.points, 1):
        assert abs(found[f"NODE_{i}"]["DISPLACEMENT_Y"][0] - GRADIENT[1] @ x) < 1e-15
    for element in (found[f"ELEMENT_{i}"] for i in range(1, 9)):
        for name, wanted in ((STRESS, stress), (STRAIN, strain)):
            assert (
                np.abs(np.array([element[name][str(g)][0] for g in range(8)]) - wanted).max()
                < 1e-9 * wanted.max()
            )
    head, names, line = (folder / "out/point.dat").read_text().splitlines()
    assert head.startswith('# Results for "element" with Id # 4 ')
    assert names == "# time DISPLACEMENT_X DISPLACEMENT_Y DISPLACEMENT_Z"
    assert np.abs(np.array(line.split(), dtype=float) - [1.0, *(GRADIENT @ place)]).max() < 1e-15


def test_steps_are_those_of_the_intervals_and_parts_have_their_own_files(folder):
    """Ten steps, the last to almost 1 s; of those by time the first after each quarter of a second counts."""
    law = {"YIELD_STRESS": 4e6, "ISOTROPIC_HARDENING_MODULUS": 1e8, "HARDENING_EXPONENT": 0.0}
    law["EXPONENTIAL_SATURATION_YIELD_STRESS"] = 4e6
    write(
        folder,
        materials("Structure.Body", 7850.0, E, NU, "SmallStrainJ2Plasticity3DLaw", **law),
        "materials.json",
    )
    fields = {NODAL: ["DISPLACEMENT"], "output_sub_model_parts": True, "write_ids": True}
    by_step = output("vtk", output_interval=4, output_path="steps", **fields)
    by_time = output(
        "vtk", "Structure.Top", output_control_type="time", output_interval=0.25, output_precision=2
    )
    tensors = ["CAUCHY_STRESS_TENSOR", "DAMAGE"]
    asked = {"output_interval": 5, "nodal_results": ["REACTION"], "gauss_point_results": tensors}
    gid = output("gid", output_name="gid/box", postprocess_parameters={"result_file_configuration": asked})
    lists = [
        output("json", output_variables=["REACTION"], output_file_name=f"{f}.json", time_frequency=f)
        for f in (0.0, 0.2)
    ]
    content = run_file(
        [CLAMP], [GRAVITY], outputs={"all": [by_step, by_time, gid]}, checks=lists, step=0.1, end=0.95,
        analysis_type="non_linear",
    )  # fmt: skip
    outcome = run(read_case(write(folder, content)))
    lines = outcome.write()
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*.vt*")}
    parts = ("", "_Body", "_Bottom", "_Side", "_Tips", "_Top")
    assert names == {
        *(f"steps/Structure{part}_0_{step}.vtk" for part in parts for step in (4, 8)),
        *(f"VTK_Output/Top_0_{time}.vtk" for time in ("0.30", "0.50", "0.80")),
        *(f"gid/box_{step}.vtu" for step in (5, 10)),
    }
    assert any(line.endswith("Structure_Tips_0_8.vtk (12 files)") for line in lines)
    assert any(note.endswith(": DAMAGE not written") for note in outcome.case.model.notes)
    assert b'Name="CAUCHY_STRESS_VECTOR"' in folder.joinpath("gid/box_5.vtu").read_bytes()
    side = folder.joinpath("steps/Structure_Side_0_4.vtk").read_bytes()
    assert b"KRATOS_CONDITION_ID 1 4  int\n" + np.array([5, 6, 7, 8], ">i4").tobytes() in side
    for frequency, times in ((0.0, 10), (0.2, 3)):
        assert len(json.loads((folder / f"{frequency}.json").read_text())["TIME"]) == times


def test_several_points_and_points_on_a_line(folder):
    near = {"output_variables": ["DISPLACEMENT_Z"], "print_format": ".3e"}
    several = output(
        "multiple_points",
        positions=[[0, 0, 1], [1, 1, 1]],
        output_file_settings={"file_name": "p.dat"},
        **near,
    )
    line = output("line", start_point=[0, 0, 0], end_point=[2, 1, 1], sampling_points=1,
                  output_file_settings={"file_name": "line", "file_extension": "txt"}, **near)  # fmt: skip
    node = output("point", "Structure.Tips", position=[2, 0, 1.5], entity_type="node",
                  output_file_settings={"file_name": "tip"}, **near)  # fmt: skip
    _, written = solved(folder, several, line, node)
    names = ["p_1.dat", "p_2.dat", "line_1.txt", "tip.dat"]
    assert written == [str(folder / name) for name in names]
    for name, x in zip(names, ([0, 0, 1], [1, 1, 1], [1, 0.5, 0.5], [2, 0, 1.5]), strict=True):
        assert (folder / name).read_text().splitlines()[-1] == f"1.0 {GRADIENT[2] @ x:.3e}"


def test_sums_and_places_of_nodes(folder):
    """The reaction of all supports balances the weight of the box, 3 m³."""
    path = {"output_variables": ["REACTION"], "time_frequency": 0.0}
    total = output("json", "Structure.Bottom", output_file_name="sum.json", resultant_solution=True, **path)
    tips = output(
        "json", sub_model_part_name="Tips", output_file_name="tips.json", use_node_coordinates=True, **path
    )
    run(read_case(write(folder, run_file([CLAMP], [GRAVITY], checks=[total, tips])))).write()
    found = json.loads((folder / "sum.json").read_text())["RESULTANT"]
    assert abs(found["REACTION_Z"][0] - 3 * 7850 * 9.81) < 1e-6
    nodes = [f"NODE_X_2.000000_Y_{y}.000000_Z_1.500000" for y in (0, 1)]
    assert list(json.loads((folder / "tips.json").read_text())) == ["TIME", *nodes]


def test_our_check_takes_our_file(folder):
    """Values by places of nodes and at Gauss points, and one that is wrong."""
    names = {"output_variables": ["REACTION"], "gauss_points_output_variables": [STRESS]}
    file = output("json", output_file_name="all.json", use_node_coordinates=True, time_frequency=0.1, **names)
    solved(folder, file)
    keys = {
        "check_variables": ["REACTION"],
        "gauss_points_check_variables": [STRESS],
        "use_node_coordinates": True,
    }
    compare = {"model_part_name": "Structure", "input_file_name": "all.json", "tolerance": 1e-6}
    compare |= {"use_node_coordinates": True, **keys}
    checks = {"checks": [{"python_module": "from_json_check_result_process", "Parameters": compare}]}
    processes = json.loads((folder / "ProjectParameters.json").read_text())["processes"] | checks
    outcome, _ = solved(folder, processes=processes)
    assert [" passed " in line for line in outcome.compare()] == [True] * 4
    values = json.loads((folder / "all.json").read_text())
    values["ELEMENT_3"][STRESS]["5"][0][2] += 1e3
    (folder / "all.json").write_text(json.dumps(values))
    *_, line = solved(folder, processes=processes)[0].compare()
    assert " failed (element 3, point 5: " in line


VTK = "output_processes.all[0].Parameters"
POINT = {"position": [1, 1, 1], "output_variables": ["DISPLACEMENT"]}
FILE = {"output_file_settings": {"file_name": "p"}}
GAUSS = {"gauss_points_output_variables": [STRESS], "output_file_name": "a.json"}
JSON = {"output_file_name": "a.json"}
CUT = {"result_file_configuration": {"plane_output": [{}]}}
BAD = {
    "misspelt": ("vtk", {NODAL: ["DISPLACMENT"]}, "no DISPLACMENT at nodes here. Did you mean DISPLACEMENT"),
    "of motions": ("vtk", {NODAL: ["VELOCITY"]}, "no VELOCITY at nodes here."),
    "of another law": (
        "json",
        JSON | {"gauss_points_output_variables": ["PLASTIC_DISSIPATION"]},
        "no PLASTIC_DISSIPATION at Gauss points here.",
    ),
    "a matrix": ("vtk", {IN_ELEMENTS: ["CAUCHY_STRESS_TENSOR"]}, "Did you mean CAUCHY_STRESS_VECTOR"),
    "other values": (
        "vtk",
        {"nodal_data_value_variables": ["DISPLACEMENT"]},
        "is not supported; leave it out",
    ),
    "flags": ("vtk", {"element_flags": ["ACTIVE"]}, "element_flags is not supported"),
    "key": ("vtk", {"file_formt": "ascii"}, f"unknown key '{VTK}.file_formt'. Did you mean file_format"),
    "format": ("vtk", {"file_format": "text"}, "must be binary or ascii; got 'text'"),
    "part": ("vtk", {"model_part_name": "Structure.Tops"}, "no part 'Structure.Tops'. Did you mean Top"),
    "outside": ("vtk", {"output_path": "../x"}, "leaves the folder of the run file"),
    "outside by a prefix": ("vtk", {"custom_name_prefix": "../"}, "leaves the folder of the run file"),
    "an input": ("json", {"output_file_name": "materials.json"}, "materials.json: is an input or another"),
    "flag of nodes": ("json", JSON | {"check_for_flag": "ACTIVE"}, "check_for_flag is not supported"),
    "no history": ("json", JSON | {"historical_value": False}, "has historical values of nodes only"),
    "sums of points": ("json", GAUSS | {"resultant_solution": True}, "leave one out"),
    "no file": ("point", POINT, f"key '{VTK}.output_file_settings' is missing"),
    "no element": ("point", POINT | FILE | {"position": [9, 1, 1]}, "lies outside the mesh"),
    "no node": (
        "point",
        POINT | FILE | {"entity_type": "node", "position": [0.9, 1, 1]},
        "no node of the part is at [0.9, 1.0, 1.0] m",
    ),
    "no elements": (
        "point",
        POINT | FILE | {"model_part_name": "Structure.Top"},
        "the part has no elements;",
    ),
    "a variable twice": (
        "json",
        JSON | {"output_variables": ["DISPLACEMENT", "DISPLACEMENT_X"]},
        "DISPLACEMENT_X would be written twice",
    ),
    "faces": ("point", POINT | FILE | {"entity_type": "condition"}, "must be element or node"),
    "numbers": ("point", POINT | FILE | {"print_format": ".999999999f"}, "must be a format of numbers"),
    "cuts": ("gid", {"output_name": "a", "postprocess_parameters": CUT}, "plane_output is not supported"),
    "vtu": ("vtu", {}, "unknown process 'vtu_output_process'. Did you mean vtk_output_process"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_written_is_refused_before_any_work(folder, name):
    kind, settings, words = BAD[name]
    content = run_file([CLAMP], [GRAVITY], outputs={"all": [output(kind, **settings)]})
    with pytest.raises(kl.InputError, match=re.escape(words)):
        check(read_case(write(folder, content)))
    assert not list(folder.glob("*VTK*"))


def test_two_processes_with_the_same_file_are_refused(folder):
    content = run_file([CLAMP], [GRAVITY], outputs={"all": [output("vtk"), output("vtk", output_interval=1)]})
    with pytest.raises(kl.InputError, match=r"Structure_0_1\.vtk: is an input or another output"):
        check(read_case(write(folder, content)))


def test_other_gauss_points_than_those_of_kratos_are_refused(folder):
    case = read_case(write(folder, run_file([CLAMP], [GRAVITY], checks=[output("json", **GAUSS)])))
    case.model.use_rule(1)
    with pytest.raises(kl.InputError, match="Gauss points of elements with 8 nodes are not those of Kratos"):
        check(case)


def test_no_step_at_the_times_of_an_output_is_said(folder):
    _, (line,) = solved(folder, output("vtk", output_interval=2))
    assert line == f"nothing for {VTK}: no step at its times was taken"


def test_outputs_of_part_files_are_left_out_with_a_note(folder):
    """`--strict` counts it, as Kratos writes a file for each part."""
    vtk = output("vtk", "Structure")
    run_path = write(folder, run_file([CLAMP], [GRAVITY], outputs={"all": [vtk]}))
    mesh = next(folder.glob("*.mdpa"))
    write_part_files(mesh, folder, 2, [0, 0, 0, 0, 1, 1, 1, 1])
    mesh.unlink()
    case = read_kratos_project(run_path, part=1)
    (note,) = [text for text in case.model.notes if isinstance(text, Omission)]
    assert "vtk_output_process writes nothing: results over part files are written by -o OUT.pvtu" in note
    assert not case.outputs.in_steps

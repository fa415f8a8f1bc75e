"""Files of output processes, by Kratos, live, and by the same run file here: names, words and numbers."""

import json
import re
import shutil
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import pytest
from run_files import (
    CLAMP,
    GRAVITY,
    MATERIALS,
    PLASTIC,
    SOFTENING,
    VON_MISES,
    box_mdpa,
    materials,
    output,
    process,
    push,
    run_file,
    run_kratos,
    write,
)  # fmt: skip

from kratos_lite.io.files import read_case
from kratos_lite.io.run import run

for wheel in ("Multiphysics", "StructuralMechanicsApplication", "ConstitutiveLawsApplication"):
    try:
        version(f"Kratos{wheel}")
    except PackageNotFoundError:
        pytest.skip(f"Kratos{wheel} is not installed", allow_module_level=True)

EXACT = {
    "analysis_type": "non_linear",
    "convergence_criterion": "residual_criterion",
    "residual_relative_tolerance": 1e-12,
    "residual_absolute_tolerance": 1e-9,
    "max_iteration": 50,
}
STRESSES = ["VON_MISES_STRESS", "CAUCHY_STRESS_VECTOR", "GREEN_LAGRANGE_STRAIN_VECTOR"]


def outputs(nodal, gauss):
    """Return output processes of all kinds, and those of .json, which Kratos takes among the others."""
    vtk = {"file_format": "ascii", "nodal_solution_step_data_variables": nodal, "output_precision": 12}
    at_gauss = {
        "gauss_point_variables_extrapolated_to_nodes": gauss,
        "gauss_point_variables_in_elements": gauss,
    }
    binary = {**vtk, "file_format": "binary", "output_path": "binary", "output_precision": 3}
    file = {"file_name": "points.dat", "output_path": "points"}
    one, node, line = ({"output_file_settings": {"file_name": name}} for name in ("one.x", "node", "line"))
    at_node = {"entity_type": "node", "print_format": ".12e", "output_variables": ["DISPLACEMENT_X"], **node}
    two, ends = [[2.0, 0.1, 0.1], [1.0, 0.6, 0.4]], {"start_point": [0, 0, 0], "end_point": [2, 0.5, 1]}
    several = {"output_variables": nodal, "output_file_settings": file}
    deformed = {"write_deformed_configuration": True, "output_interval": 4, "output_path": "a/b"}
    by_time = {"output_control_type": "time", "output_interval": 0.35, "custom_name_prefix": "at_"}
    written = [
        output("vtk", output_sub_model_parts=True, write_ids=True, **vtk, **at_gauss),
        output("vtk", **binary, **by_time),
        output("vtk", "Structure.Top", **vtk, **deformed),
        output("point", position=[0.3, 0.4, 0.7], output_variables=nodal, **one),
        output("point", "Structure.Top", position=[1.0, 0.5, 1.5], interval=[0.25, 0.65], **at_node),
        output("multiple_points", "Structure.Body", positions=two, **several),
        output("line", sampling_points=2, output_variables=nodal, **ends, **line),
    ]
    common = {"output_variables": nodal, "time_frequency": 0.2}
    places = {"sub_model_part_name": "Tips", "use_node_coordinates": True}
    lists = [
        output("json", output_file_name="all.json", gauss_points_output_variables=gauss, **common),
        output("json", output_file_name="places.json", **places, **common),
        output("json", "Structure.Bottom", output_file_name="sum.json", resultant_solution=True, **common),
    ]
    return {"outputs": {"files": written}, "checks": lists}


def moved(axis, value):
    module, part = "assign_scalar_variable_process", "Structure.Top"
    return process(module, part, f"DISPLACEMENT_{axis}", value=value, interval=[0.0, "End"])


PULLED = [CLAMP, moved("Z", "0.01*t*t"), moved("X", "0.005*t")]
PULLED_FAR = [CLAMP, moved("Z", "0.3*t"), moved("X", "0.2*t")]
STATIC, MOVING = ["DISPLACEMENT", "REACTION"], ["DISPLACEMENT", "VELOCITY", "ACCELERATION", "REACTION"]
STEPS = {"step": 0.1, "end": 0.95}
IN_TIME = {"solver_type": "Dynamic", "time_integration_method": "implicit", "scheme_type": "newmark"}
SMALL, LARGE = "SmallDisplacementElement", "TotalLagrangianElement"


def solid(law, **constants):
    return materials("Structure.Body", 7850.0, 2e9, 0.3, law, **constants)


CASES = {
    "one step": (SMALL, MATERIALS, [CLAMP], [GRAVITY, push("1e4*t")], {}, STATIC, STRESSES),
    "J2": (SMALL, solid("SmallStrainJ2Plasticity3DLaw", **PLASTIC), PULLED, [], EXACT, STATIC, STRESSES),
    "plasticity": (SMALL, solid(VON_MISES, **SOFTENING), PULLED, [], EXACT, STATIC, ["PLASTIC_DISSIPATION"]),
    "large": (LARGE, solid("HyperElastic3DLaw"), PULLED_FAR, [], EXACT, STATIC, STRESSES[:2]),
    "in time": (SMALL, MATERIALS, [CLAMP], [GRAVITY, push("1e4*t")], IN_TIME, MOVING, STRESSES[:2]),
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Return for each case the folders in which Kratos and kratos_lite have run."""
    found = {}
    for name, (element, constants, supports, loads, solver, nodal, gauss) in CASES.items():
        steps = STEPS if name != "one step" else {}
        content = run_file(supports, loads, **steps, **solver, **outputs(nodal, gauss))
        found[name] = theirs, ours = tmp_path_factory.mktemp("theirs"), tmp_path_factory.mktemp("ours")
        (theirs / "box.mdpa").write_text(box_mdpa().replace("SmallDisplacementElement", element))
        write(theirs, constants, "materials.json")
        shutil.copytree(theirs, ours, dirs_exist_ok=True)
        run(read_case(write(ours, content))).write()
        write(theirs, content)
    run_kratos(*(theirs for theirs, _ in found.values()))
    return found


def files(folder, ending):
    return sorted(path.relative_to(folder) for path in folder.rglob(f"*.{ending}"))


def groups(path):
    """Return the lines of a file that have words, each with the numbers below it."""
    found = []
    for line in path.read_text().splitlines():
        if re.search("[A-Za-df-z]", line):
            found.append((line.strip(), []))
        elif line:
            found[-1][1].append([float(word) for word in line.split()])
    return found


def alike(ours, theirs, name):
    """Compare numbers; where nothing is held Kratos has rounding in place of 0."""
    ours, theirs = np.array(ours), np.array(theirs)
    assert ours.shape == theirs.shape, name
    allowed = 3e-7 * np.abs(theirs).max(axis=0, initial=0.0) + (1e-3 if "REACTION" in name else 1e-11)
    assert (np.abs(ours - theirs) <= allowed).all(), name


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("ending", ["vtk", "dat"])
def test_text_files_are_those_of_kratos(folders, name, ending):
    theirs, ours = folders[name]
    assert files(ours, ending) == files(theirs, ending)
    for path in files(ours, ending):
        if path.parts[0] == "binary":
            continue
        found, expected = groups(ours / path), groups(theirs / path)
        if re.search("Structure_(Side|Top|Tips)", path.name):  # there Kratos has stresses of faces, all 0
            found, expected = ([g for g in many if "FIELD" not in g[0]] for many in (found, expected))
            assert not any(np.any(numbers) for _, numbers in expected[len(found) :])
            expected = expected[: len(found)]
        assert [head for head, _ in found] == [head for head, _ in expected], path
        for (head, numbers), (_, wanted) in zip(found, expected, strict=True):
            alike(numbers, wanted, head)


@pytest.mark.parametrize("name", CASES)
def test_binary_files_are_those_of_kratos(folders, name):
    theirs, ours = folders[name]
    assert len(files(ours / "binary", "vtk")) == (1 if name == "one step" else 2)
    heads = [("POINTS 27 float", ">f4", 81), ("CELLS 8 72", ">i4", 72), ("CELL_TYPES 8", ">i4", 8)]
    heads += [(f"{field} 3 27  float", ">f4", 81) for field in (MOVING if name == "in time" else STATIC)]
    for path in files(ours / "binary", "vtk"):
        for head, kind, count in heads:
            read = [
                folder.joinpath("binary", path).read_bytes().split(f"{head}\n".encode())
                for folder in (ours, theirs)
            ]
            found, expected = (np.frombuffer(after, kind, count) for _, after in read)
            alike(found, expected, head)


@pytest.mark.parametrize("name", CASES)
def test_values_over_time_are_those_of_kratos(folders, name):
    theirs, ours = folders[name]
    for path in ("all.json", "places.json", "sum.json"):
        found, expected = (json.loads((folder / path).read_text()) for folder in (ours, theirs))
        assert list(found) == list(expected)
        assert len(found["TIME"]) == (1 if name == "one step" else 3)
        for key in found:
            same_values(found[key], expected[key], key)


def same_values(found, expected, name):
    if isinstance(found, dict):
        assert list(found) == list(expected), name
        for key in found:
            same_values(found[key], expected[key], key)
    else:
        alike(found, expected, name)


def test_kratos_takes_our_file_for_its_own(folders):
    """Kratos, which fails otherwise, compares its plastic solution with the values that are written here."""
    theirs, ours = folders["plasticity"]
    shutil.copy(ours / "all.json", theirs / "ours.json")
    check = process("from_json_check_result_process", "Structure", "", input_file_name="ours.json")
    parameters = check["Parameters"]
    del parameters["variable_name"]
    parameters |= {
        "check_variables": ["DISPLACEMENT"],
        "gauss_points_check_variables": ["PLASTIC_DISSIPATION"],
    }
    parameters |= {"time_frequency": 0.2, "tolerance": 1e-9, "relative_tolerance": 1e-6}
    write(theirs, run_file(PULLED, [], **STEPS, **EXACT, checks=[check]))
    run_kratos(theirs)
    values = json.loads((theirs / "ours.json").read_text())
    values["ELEMENT_8"]["PLASTIC_DISSIPATION"]["3"][1] += 0.01
    (theirs / "ours.json").write_text(json.dumps(values))
    with pytest.raises(AssertionError, match="PLASTIC_DISSIPATION in GP 3"):
        run_kratos(theirs)

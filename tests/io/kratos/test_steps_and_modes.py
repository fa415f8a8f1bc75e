"""Run files of Kratos for linear solids: several steps with one matrix, and natural frequencies."""

import json
from importlib.util import find_spec
from math import pi

import numpy as np
import pytest
from run_files import MATERIALS, box_mdpa, cube, output, process, run_file, run_kratos, write
from scenes import case, present

import kratos_lite as kl
from kratos_lite.io.files import read_case
from kratos_lite.io.run import prepare
from kratos_lite.solvers import linear_solver

E, DENSITY = 2e9, 7800.0
ELASTIC = {"law": "LinearElastic3DLaw", "material": (DENSITY, E, 0.0), "analysis_type": "linear"}
NEEDS_KRATOS = pytest.mark.skipif(
    find_spec("KratosMultiphysics") is None
    or find_spec("KratosMultiphysics.LinearSolversApplication") is None,
    reason="Kratos is not installed",
)
MODES = {"solver_type": "eigen_value", "eigensolver_settings": {"number_of_eigenvalues": 3}}


def test_linear_steps_share_one_matrix_while_the_supports_are_the_same(tmp_path, monkeypatch):
    """A bar that is pulled, let go under its own push, and pulled again."""
    made = []
    factorize = linear_solver.direct.factorize
    monkeypatch.setattr(linear_solver.direct, "factorize", lambda *how: made.append(1) or factorize(*how))
    push = process(
        "assign_vector_variable_process", "Structure.Top", "VOLUME_ACCELERATION",
        constrained=False, value=[0.0, 0.0, "-3.0*t"],
    )  # fmt: skip
    path = cube(tmp_path, [("0.01*t*(2*x+y)", [0.0, 0.9]), ("0.005", [1.5, "End"])], **ELASTIC)
    content = json.loads(path.read_text())
    content["processes"]["loads_process_list"] = [push]
    analysis, states = prepare(read_case(write(tmp_path, content)))
    tops, solved = [(state.time, state.u[4:, 2]) for state in states], len(made)
    x, y = analysis.model.mesh.points[4:, :2].T
    assert len(tops) == 11
    assert solved == 3
    push = -DENSITY * 3.0 / 3 / E  # the acceleration grows from 0 at the bottom: ∫ z ρ b z dV / E
    for time, u in tops:
        t = round(time, 9)
        wanted = 0.01 * t * (2 * x + y) if t < 0.9 else 0.005 if t > 1.5 else None
        if wanted is None:
            assert np.abs(u - push * t).max() < 1e-10 * abs(push)
        else:
            assert np.abs(u - wanted).max() < 1e-14


def test_frequencies_of_a_cube_are_those_of_its_stretch(tmp_path, run):
    """One element on rollers without contraction: K = E, M = ρ / 3 for each stretch, ω² = 3 E / ρ."""
    check = process("check_eigenvalues_process", "Structure", "EIGENVALUE_VECTOR")
    exact = 3 * E / DENSITY
    check["Parameters"]["reference_values"] = f"[{exact}, {exact}]"
    path = cube(tmp_path, [], [check], **ELASTIC, **MODES)
    outcome = kl.run(read_case(path))
    assert np.abs(outcome.modes[0] ** 2 / exact - 1).max() < 1e-12
    assert "check EIGENVALUE_VECTOR passed (eigenvalue " in outcome.compare()[0]
    done = run("solve", path, "--json", tmp_path / "modes.json")
    assert done.code == 0
    assert f"{exact**0.5 / (2 * pi):.8g}" in done.out
    found = json.loads((tmp_path / "modes.json").read_text())
    assert np.abs(np.array(found["EIGENVALUE_VECTOR"]) / exact - 1).max() < 1e-12
    assert np.abs(np.array(found["frequencies"]) * 2 * pi / exact**0.5 - 1).max() < 1e-12


def test_modes_above_a_shift(tmp_path):
    settings = {"solver_type": "eigen_value", "eigensolver_settings": {"number_of_eigenvalues": 12}}
    every = kl.run(read_case(cube(tmp_path, [], **ELASTIC, **settings))).modes[0] ** 2
    settings["eigensolver_settings"] = {"number_of_eigenvalues": 2, "shift": float(0.9 * every[2])}
    above = kl.run(read_case(cube(tmp_path, [], **ELASTIC, **settings))).modes[0] ** 2
    assert np.abs(above / every[:2] - 1).max() < 1e-9
    settings["eigensolver_settings"] = {"number_of_eigenvalues": 2, "shift": float(1.01 * every[2])}
    above = kl.run(read_case(cube(tmp_path, [], **ELASTIC, **settings))).modes[0] ** 2
    assert np.abs(above / every[3:5] - 1).max() < 1e-9


@pytest.mark.parametrize(
    ("interval", "step", "held"),
    [([0.0, 0.5], 0.5, False), ([1.5, 2.0], 0.5, True), ([0.0, 0.0], 0.5, False), ([0.0, 0.0], 3.0, True)],
)
def test_modes_are_those_of_the_supports_of_the_last_step(tmp_path, interval, step, held):
    """As in Kratos, which takes supports back after each step, but for those set before the first one."""
    settings = {**MODES, "step": step, "end": 2.0}
    omega = kl.run(read_case(cube(tmp_path, [("0.0", interval)], **ELASTIC, **settings))).modes[0]
    stretches = np.abs(omega**2 / (3 * E / DENSITY) - 1) < 1e-9
    assert stretches.sum() == (2 if held else 3)


@pytest.mark.parametrize("option", ["modes", "buckling"])
def test_modes_and_buckling_of_several_steps_are_those_at_their_end(tmp_path, run, option):
    """The same file in one step says at once what holds and loads the cube at its end."""
    push = process(
        "assign_vector_variable_process", "Structure.Top", "VOLUME_ACCELERATION",
        constrained=False, value=[0.0, "t", "-3.0*t"],
    )  # fmt: skip
    told = []
    for step in (0.5, 2.0):
        path = cube(tmp_path, [("-0.001*t", [1.0, "End"])], **ELASTIC, step=step, end=2.0)
        content = json.loads(path.read_text())
        supports = content["processes"]["constraints_process_list"]
        supports.append(json.loads(json.dumps(supports[0])))
        supports[-1]["Parameters"] |= {"model_part_name": "Structure.Body", "interval": [0.5, 0.5]}
        content["processes"]["loads_process_list"] = [push]
        told.append(run("solve", write(tmp_path, content), f"--{option}", "2").out.splitlines())
    steps, once = told
    assert len(once) >= 3
    assert steps[:3] == once[:3]
    assert any("those at t = 2 s, the end of the steps" in line for line in steps)
    rows = run("info", path).out + run("info", cube(tmp_path, [], **ELASTIC)).out
    assert "function" not in rows


def test_outputs_of_modes_are_omitted_with_a_note(tmp_path, run):
    path = cube(tmp_path, [], [output("vtk")], **ELASTIC, **MODES)
    text = "processes.checks[0]: vtk_output_process writes nothing: modes are written by -o OUT"
    assert text in run("solve", path).out
    assert text in run("solve", path, "--strict").err


@pytest.mark.skipif(not present("eigen_cube_8N"), reason="the folder is absent")
def test_kratos_own_frequencies_of_a_cube_are_found():
    outcome = kl.run(read_case(case("eigen_cube_8N") / "Eigen_TL_3D8N_Cube_test_parameters.json"))
    assert "passed" in outcome.compare()[0]
    assert len(outcome.modes[0]) == 6


@NEEDS_KRATOS
@pytest.mark.parametrize(
    "settings",
    [
        {"solver_type": "spectra_sym_g_eigs_shift", "number_of_eigenvalues": 4},
        {"solver_type": "spectra_sym_g_eigs_shift", "number_of_eigenvalues": 3, "shift": 4e6},
        {"solver_type": "eigen_eigensystem", "number_of_eigenvalues": 4, "tolerance": 1e-10},
    ],
)
def test_kratos_finds_the_same_frequencies(tmp_path, settings):
    (tmp_path / "box.mdpa").write_text(box_mdpa())
    write(tmp_path, MATERIALS, "materials.json")
    clamp = process("assign_vector_variable_process", "Structure.Bottom", "DISPLACEMENT", value=[0.0] * 3)
    solver = {"solver_type": "eigen_value", "eigensolver_settings": settings}
    content = run_file([clamp], [], **solver)
    del content["solver_settings"]["linear_solver_settings"]
    path = write(tmp_path, content)
    run_kratos(tmp_path)
    wanted = np.sqrt(json.loads((tmp_path / "kratos.json").read_text())["eigenvalues"])
    found = kl.run(read_case(path)).modes[0]
    assert np.abs(found / np.sort(wanted) - 1).max() < 1e-8

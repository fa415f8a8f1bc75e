"""Dynamic run files of Kratos: what processes mean in time."""

import json

import numpy as np
import pytest
from run_files import process, run_file

import kratos_lite as kl
from kratos_lite.io.files import read_case
from kratos_lite.io.kratos.keys import IN_TIME
from kratos_lite.io.run import prepare
from kratos_lite.model.loads import ScaledLoad

TO_NODES = "assign_scalar_variable_process"
TO_CONDITIONS = "assign_scalar_variable_to_conditions_process"
CLAMP = tuple(("Bottom", f"DISPLACEMENT_{axis}", 0.0) for axis in "XYZ")


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Return a function that writes a run file of processes (part, variable, value, settings)."""
    monkeypatch.chdir(tmp_path)
    mesh = kl.box((0.5, 0.5, 2.0), cells=(1, 1, 4))
    (faces,) = mesh.faces("z+")
    parts = {"Bottom": kl.Part(mesh.nodes("z-")), "Top": kl.Part(mesh.nodes("z+"), conditions=[0])}
    name = "SmallDisplacementSurfaceLoadCondition3D4N"
    face = kl.Block(name, faces.nodes, properties=0, shape=faces.shape)
    mesh = mesh.replace(conditions=[face], parts=parts)
    kl.write("bare.mdpa", mesh)
    text = (tmp_path / "bare.mdpa").read_text()
    constants = "YOUNG_MODULUS 1e8\nPOISSON_RATIO 0.2\nDENSITY 2000\n"
    head = "Begin Properties 1\n"
    (tmp_path / "mesh.mdpa").write_text(text.replace(head, head + constants))

    def write(*entries, step=0.01, end=0.2, data="", processes=(), **solver):
        lists = []
        for part, variable, value, *more in entries:
            on_conditions = variable.startswith("SURFACE")
            parameters = {"model_part_name": part, "variable_name": variable, "value": value}
            if not on_conditions:
                parameters["constrained"] = variable.startswith("DISPLACEMENT")
            parameters.update(*more)
            module = TO_CONDITIONS if on_conditions else TO_NODES
            lists.append({"python_module": module, "Parameters": parameters})
        dynamic = {"solver_type": "Dynamic", "time_integration_method": "implicit", **solver}
        content = run_file(lists, list(processes), mesh="mesh", step=step, end=end, **dynamic)
        del content["solver_settings"]["material_import_settings"]
        (tmp_path / "run.json").write_text(json.dumps(content, indent=1))
        if data:
            with open("mesh.mdpa", "a") as file:
                file.write(data)
        return tmp_path / "run.json"

    return write


def states(scene):
    return list(prepare(scene)[1])


def same(found, expected):
    for name in ("u", "v", "a", "reactions"):
        one, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-10 * max(np.abs(other).max(), 1e-300))


def by_hand():
    return kl.Model(kl.read("mesh.mdpa").mesh, kl.Isotropic3D(E=1e8, nu=0.2, density=2000.0))


def moved(model):
    return list(kl.integrate(model.transient(integrator=kl.Bossak()), dt=0.01, steps=20))


def test_integrator_damping_and_steps(write):
    scene = read_case(write(*CLAMP, rayleigh_alpha=0.5, rayleigh_beta=1e-4))
    assert str(scene.time) == "20 steps of 0.01 s by bossak(-0.3)"
    assert scene.time.rayleigh == (0.5, 1e-4)
    assert prepare(scene)[0].equations.rayleigh == (0.5, 1e-4)
    newmark = read_case(write(*CLAMP, scheme_type="newmark", damp_factor_m=-0.1))
    assert str(newmark.time) == "20 steps of 0.01 s by newmark(0.25, 0.5)"
    assert str(read_case(write(*CLAMP, damp_factor_m=-0.1)).time).endswith("bossak(-0.1)")


def test_loads_of_steady_processes_are_assembled_once(write, monkeypatch):
    weight = ("Structure", "VOLUME_ACCELERATION_Z", "-9.81*(1+Z)")
    scene = read_case(write(*CLAMP, weight, ("Top", "SURFACE_LOAD_X", "t")))
    assert [type(load).__name__ for load in scene.model.loads] == ["ScaledLoad", "TimeDependentLoad"]
    scene = read_case(write(*CLAMP, weight, ("Top", "SURFACE_LOAD_X", 1e4)))
    assert [type(load).__name__ for load in scene.model.loads] == ["ScaledLoad", "ScaledLoad"]
    calls = []
    for kind in (kl.Gravity, type(scene.model.loads[1].load)):
        forces = kind.forces

        def counted(self, mesh, groups, forces=forces):
            calls.append(type(self).__name__)
            return forces(self, mesh, groups)

        monkeypatch.setattr(kind, "forces", counted)
    states(scene)
    assert sorted(calls) == ["ConditionLoads", "Gravity"]


def test_a_load_stays_at_its_last_value_and_changes_no_more(write):
    write(*CLAMP, ("Top", "SURFACE_LOAD_X", "1e5*t", {"interval": [0.0, 0.055]}))
    scene = read_case("run.json")
    (load,) = scene.model.loads
    forces = [load.at(t) for t in (0.0, 0.01, 0.05, 0.06, 0.2)]
    assert forces[0] is None
    assert forces[2] is not forces[1]
    assert forces[4] is forces[3]
    ramp = kl.TimeSeries([0.0, 0.05], [0.0, 0.05])
    model = by_hand()
    model.fix("Bottom")
    model.add(ScaledLoad(kl.Traction("Top", (1e5, 0.0, 0.0)), ramp))
    for one, other in zip(states(scene), moved(model), strict=True):
        same(one, other)


def test_supports_that_move_with_t(write):
    scene = read_case(write(("Bottom", "DISPLACEMENT_X", "0.01*t^2"), *CLAMP[1:]))
    model = by_hand()
    model.fix("Bottom", "x", lambda t: 0.01 * t * t)
    model.fix("Bottom", "yz")
    same(states(scene)[-1], moved(model)[-1])
    assert any("Kratos takes Newmark's formulas" in note for note in scene.model.notes)


def test_a_constant_support_replaces_a_moving_one_that_comes_before(write):
    moving = ("Bottom", "DISPLACEMENT_X", "t")
    for entries, count in (((moving, *CLAMP), 0), ((*CLAMP, moving), 1)):
        assert len(read_case(write(*entries)).model.supports.motions) == count


def test_a_start_on_a_support_leaves_its_movement(write):
    pulled = ("Structure", "DISPLACEMENT_X", "0.01*Z", {"interval": [0.0, 0.0], "constrained": False})
    scene = read_case(write(*CLAMP, ("Bottom", "DISPLACEMENT_X", "0.01*t"), pulled))
    assert len(scene.model.supports.motions) == 1
    end = states(scene)[-1]
    bottom = scene.model.mesh.nodes("Bottom")
    np.testing.assert_allclose(end.u[bottom, 0], 0.01 * end.time, rtol=1e-12)
    assert scene.time.displacement[:, 0].max() == 0.02


@pytest.mark.parametrize("value", ["t", 0.01])
def test_a_support_that_changes_for_a_while_is_refused(write, value):
    path = write(*CLAMP, ("Bottom", "DISPLACEMENT_X", value, {"interval": [0.05, 0.1], "constrained": False}))
    with pytest.raises(kl.InputError, match=r"run\.json: .*.* changes in a part of the run"):
        read_case(path)


def test_a_kratos_file_with_the_key_time_of_ours_keeps_its_own_steps(write, run):
    path = write(*CLAMP)
    content = {**json.loads(path.read_text()), "time": {"step": 1.0, "steps": 2}}
    settings = content["solver_settings"]
    settings = {key: value for key, value in settings.items() if key not in IN_TIME}
    content["solver_settings"] = settings | {"solver_type": "static"}
    path.write_text(json.dumps(content))
    assert read_case(path).time.steps == 20
    assert "key 'time' is not used" in run("solve", path).out


def test_nodal_data_of_the_mesh_file_is_the_start(write):
    rows = "".join(f"{i} 0 {i * 0.01}\n" for i in range(1, 21))
    scene = read_case(write(*CLAMP, data=f"Begin NodalData VELOCITY_X\n{rows}End NodalData\n"))
    velocity = scene.time.velocity
    assert velocity[:, 0].tolist() == pytest.approx([i * 0.01 for i in range(1, 21)])
    told = [note for note in scene.model.notes if "VELOCITY" in note]
    assert told == ["VELOCITY of fixed nodes is omitted; Kratos keeps it in the first step"]
    assert np.abs(states(scene)[-1].u).max() > 0


def test_a_velocity_that_the_mesh_file_fixes_is_refused(write):
    path = write(*CLAMP, data="Begin NodalData VELOCITY_X\n1 1 0.0\nEnd NodalData\n")
    with pytest.raises(kl.InputError, match=r"mesh\.mdpa: VELOCITY_X is fixed; only DISPLACEMENT can be"):
        read_case(path)


def test_options_change_a_dynamic_run_file(write, run):
    write(*CLAMP, ("Top", "SURFACE_LOAD_X", "1e5*t"))
    words = ("--time", "5e-3:40:40", "--integrator", "newmark", "-o", "end.npz")
    done = run("solve", "run.json", *words)
    assert done.rows["integrator"] == "newmark(0.25, 0.5)"
    model = by_hand()
    model.fix("Bottom")
    model.add(kl.Traction("Top", (1e5, 0.0, 0.0)), amplitude=lambda t: t)
    *_, last = kl.integrate(model.transient(), dt=5e-3, steps=40)
    with np.load("end.npz") as file:
        np.testing.assert_allclose(file["u"][-1], last.u, rtol=0, atol=1e-10 * np.abs(last.u).max())
    assert "time        20 steps of 0.01 s by bossak(-0.3)" in run("info", "run.json").out
    assert "20 steps of 0.01 s by bossak(-0.3), no errors" in run("check", "run.json").out


@pytest.mark.parametrize(
    ("value", "start", "word", "code"),
    [(0.0, 0.195, "failed", 3), (None, 0.195, "passed", 0), (None, 0.0, "failed", 3)],
)
def test_expected_values_are_compared_after_the_steps_of_their_interval(write, run, value, start, word, code):
    push = ("Top", "SURFACE_LOAD_X", "1e5*t")
    end = states(read_case(write(*CLAMP, push)))[-1]
    mesh = kl.read("mesh.mdpa").mesh
    found = float(end.u[mesh.nodes("Top"), 0].mean())
    settings = {"value": found if value is None else value, "tolerance_rank": 6}
    settings["interval"] = [start, "End"]
    check = process("check_scalar_to_nodes_process", "Top", "DISPLACEMENT_X", **settings)
    done = run("solve", write(*CLAMP, push, processes=[check]))
    assert f"check DISPLACEMENT_X on Top {word}" in done.out
    assert done.code == code

"""Scenes of bodies: what a JSON scene means, what a script means, and what is refused with its line."""

import json
import re

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.io.files import read_case
from kratos_lite.io.readers.script import is_script
from kratos_lite.io.run import describe_case, prepare

BOX = {
    "mesh": {"box": {"size": [0.4, 0.6, 1.0], "cells": [1, 2, 2]}},
    "material": {"E": 1e6, "nu": 0.3, "density": 1000.0},
    "body": "rigid",
    "time": {"step": 0.01, "steps": 10},
}
RUBBER = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)


@pytest.fixture
def scene(tmp_path):
    """Return the scene of a box with changes."""

    def read(**changes):
        return read_case(written(tmp_path, **changes))

    return read


def written(folder, **changes):
    path = folder / "scene.json"
    values = {key: value for key, value in {**BOX, **changes}.items() if value is not None}
    path.write_text(json.dumps(values, indent=1))
    return path


def last(states):
    *_, state = states
    return state


@pytest.mark.parametrize(
    ("word", "kind"),
    [
        ("rigid", kl.RigidBody),
        ("pseudo-rigid", kl.PseudoRigidBody),
        ("finite-element", kl.FiniteElementBody),
        ("fixed", kl.FixedBody),
    ],
)
def test_one_word_is_the_kind(scene, word, kind):
    found = scene(body=word, start={"velocity": [1, 2, 3], "angular_velocity": [0, 0, 1]})
    assert type(found.body) is kind
    np.testing.assert_allclose(found.body.velocity(found.body.center), [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(found.body.velocity([0.4, 0.3, 0.5]) - [1, 2, 3], [0.0, 0.2, 0.0], atol=1e-12)


def test_a_run_is_that_of_python(scene):
    found = scene(
        body={
            "kind": "finite-element",
            "formulation": "total_lagrangian",
            "lumped": True,
            "integrator": "DEF_LIM",
            "damping": 1e-4,
        },
        start={"rotation": [0, 0, np.pi / 6], "angular_velocity": [0.05, 10, 0.05]},
        loads=[{"type": "gravity", "acceleration": [0, 0, -9.81]}],
        time={"step": 0.001, "steps": 6, "every": 2, "substeps": 2},
    )
    from kratos_lite.bodies.rotations import exp

    body = kl.FiniteElementBody(
        kl.box((0.4, 0.6, 1.0), (1, 2, 2)), RUBBER, lumped=True, integrator="DEF_LIM", damping=1e-4
    )
    body.rotate(exp(np.array([0, 0, np.pi / 6])))
    body.set_velocity(angular=(0.05, 10, 0.05))
    body.add(kl.Gravity((0, 0, -9.81)))
    expected = list(kl.integrate(body, 0.001, 6, every=2, substeps=2))
    states = list(prepare(found)[1])
    assert [state.step for state in states] == [2, 4, 6]
    np.testing.assert_array_equal(states[-1].q, expected[-1].q)


RAMP = {"times": [0.0, 1.0], "values": [0.0, 2.0]}
DESCENDING = {"times": [1, 0], "values": [0, 0]}
POINT, CORNER = [0.2, 0.3, 0.5], [0.4, 0.6, 1.0]
LOADS = {
    "gravity": ({"acceleration": [0, 0, -10]}, kl.Gravity((0, 0, -10))),
    "force": ({"point": CORNER, "force": [1, 2, 3]}, kl.Force(CORNER, (1, 2, 3))),
    "torque": ({"torque": [1, 2, 3], "frame": "follower"}, kl.Torque((1, 2, 3), "follower")),
    "traction": ({"on": "z+", "traction": [5, 0, 0]}, kl.Traction("z+", (5, 0, 0))),
    "pressure": ({"on": "x-", "pressure": 7.0}, kl.Pressure("x-", 7.0)),
    "follower_pressure": ({"on": "x-", "pressure": 7.0}, kl.FollowerPressure("x-", 7.0)),
    "point_load": ({"on": "z+", "force": [0, 1, 0]}, kl.PointLoad("z+", (0, 1, 0))),
    "spring": (
        {"point": CORNER, "anchor": [0, 0, 3], "stiffness": 9.0, "damping": 0.5, "length": 1.0},
        kl.Spring(CORNER, (0, 0, 3), 9.0, 0.5, 1.0),
    ),
}


@pytest.mark.parametrize("name", LOADS)
@pytest.mark.parametrize("amplitude", [None, 3.0, RAMP])
def test_every_load_is_that_of_python(scene, name, amplitude):
    values, load = LOADS[name]
    more = {} if amplitude is None else {"amplitude": amplitude}
    body = scene(loads=[{"type": name, **values, **more}]).body
    twin = kl.RigidBody(body.mesh, RUBBER)
    twin.add(
        load,
        amplitude=1.0 if amplitude is None else 3.0 if amplitude == 3.0 else kl.TimeSeries([0, 1], [0, 2]),
    )
    found = body.external_force(time=0.25)
    np.testing.assert_array_equal(found, twin.external_force(time=0.25))
    assert np.abs(found).max() > 0


CONSTRAINTS = {
    "fix_point": {"points": [[0, 0, 0], [0, 0.6, 0]]},
    "fix_direction": {"points": "z-", "direction": [0, 0, 2]},
    "prescribed_displacement": {"points": POINT, "direction": [1, 0, 0], "displacement": RAMP},
    "prescribed_velocity": {"points": POINT, "direction": [1, 0, 0], "velocity": 2.0},
    "prescribed_acceleration": {"points": POINT, "direction": [1, 0, 0], "acceleration": 2.0},
    "rigid_link": {"point": CORNER, "anchor": [0.4, 0.6, 3.0]},
}


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_every_constraint_holds(scene, name):
    found = scene(
        body="pseudo-rigid",
        loads=[{"type": "gravity", "acceleration": [0, 0, -10]}],
        constraints=[{"type": name, **CONSTRAINTS[name]}],
    )
    body = found.body
    last(prepare(found)[1])
    t, moved = 0.1, body.position(POINT) - POINT
    if name == "fix_point":
        assert np.abs(body.position([0, 0.6, 0]) - [0, 0.6, 0]).max() < 1e-12
    elif name == "fix_direction":
        assert np.abs(body.position(body.mesh.points[body.mesh.nodes("z-")])[:, 2]).max() < 1e-12
    elif name == "rigid_link":
        assert np.linalg.norm(body.position(CORNER) - [0.4, 0.6, 3.0]) == pytest.approx(2.0, abs=1e-12)
    elif name == "prescribed_displacement":
        assert moved[0] == pytest.approx(2 * t, abs=1e-12)
    else:
        assert body.velocity(POINT)[0] == pytest.approx(
            2.0 if name == "prescribed_velocity" else 2 * t, abs=1e-12
        )


def test_a_body_without_mesh_has_characteristics(scene):
    given = {"mass": 1.0, "inertia": [5, 10, 1], "center": [1, 2, 3]}
    body = scene(mesh=None, material=None, body={"kind": "rigid", "mass_properties": given}).body
    assert body.mesh is None
    assert float(body.mass) == 1.0
    assert body.mass_properties.inertia.diagonal().tolist() == [5, 10, 1]
    assert body.mass_center().tolist() == [1, 2, 3]


def test_characteristics_take_the_place_of_those_of_the_mesh(scene):
    body = scene(body={"kind": "rigid", "mass_properties": {"mass": 1.0}}).body
    assert float(body.mass) == 1.0
    np.testing.assert_allclose(body.center, [0.2, 0.3, 0.5])


def test_a_mesh_file_brings_parts_and_materials(tmp_path):
    mesh = kl.box((0.4, 0.6, 1.0), (1, 2, 2))
    kl.write(tmp_path / "box.mdpa", kl.Model(mesh, RUBBER))
    found = read_case(written(tmp_path, mesh="box.mdpa", material=None))
    assert [path.name for path in found.files] == ["scene.json", "box.mdpa"]
    assert float(found.body.mass) == pytest.approx(240)
    heavy = {"E": 1e6, "nu": 0.3, "density": 2000.0}
    assert float(read_case(written(tmp_path, mesh="box.mdpa", material=heavy)).body.mass) == pytest.approx(
        480
    )


def test_an_annulus_is_a_mesh(scene):
    ring = {"annulus": {"inner": 0.1, "outer": 0.2, "width": 0.05, "cells": [1, 12, 1]}}
    body = scene(mesh=ring, body="rigid").body
    assert float(body.mass) == pytest.approx(1000 * np.pi * 0.03 * 0.05, rel=1e-3)


def test_a_restart_goes_on_as_if_nothing_had_been(tmp_path):
    start = {"angular_velocity": [0.05, 10, 0.05]}
    whole = read_case(written(tmp_path, start=start, time={"step": 0.01, "steps": 20}))
    end = last(prepare(whole)[1])
    half = read_case(written(tmp_path, start=start))
    kl.write(tmp_path / "half.npz", last(prepare(half)[1]))
    rest = read_case(written(tmp_path, start=start, restart="half.npz"))
    body, states = prepare(rest)
    assert body.step == 10
    state = last(states)
    assert (state.time, state.step) == (end.time, end.step)
    np.testing.assert_array_equal(state.q, end.q)


MISTAKES = [
    ({"tiem": {}}, r"unknown key 'tiem'\. Did you mean time\?"),
    ({"time": None}, "key 'time' is missing"),
    ({"time": {"step": 0.1}}, r"key 'time\.steps' is missing"),
    ({"time": {"step": 0.1, "steps": 1, "evry": 2}}, r"unknown key 'time\.evry'\. Did you mean every"),
    ({"time": {"step": -0.1, "steps": 1}}, r"time\.step: a step must be one number > 0, in s; got -0\.1"),
    ({"time": {"step": 0.1, "steps": 0}}, r"time\.steps: steps must be a whole number ≥ 1; got 0"),
    ({"time": {"step": 0.1, "steps": 1, "substeps": "some"}}, "must be an integer; got 'some'"),
    ({"body": None}, "key 'body' is missing"),
    ({"body": "rigit"}, "unknown kind of body 'rigit'. Did you mean rigid"),
    ({"body": "car"}, r"unknown kind of body 'car'. There are (?=.*, rigid\b)(?=.*, finite-element\b)"),
    ({"body": {"kind": "rigid", "formulation": "total_lagrangian"}}, r"unknown key 'body\.formulation'"),
    ({"body": {"kind": "rigid", "integrator": "DEF_LIM"}}, "integrators of a rigid body are momentum"),
    (
        {"body": {"kind": "finite-element", "formulation": "TLL"}},
        "unknown formulation of a finite-element body 'TLL'",
    ),
    ({"body": {"kind": "rigid", "mass_properties": {"mas": 1}}}, r"unknown key 'body\.mass_properties\.mas'"),
    ({"body": {"kind": "rigid", "mass_properties": {"inertia": [1, 2]}}}, "three rows of three numbers"),
    ({"mesh": None}, "key 'mesh' is missing: it is the shape of the body"),
    ({"mesh": {"bix": {}}}, r'mesh must be the name of a file, \{"box": \{…\}\} or'),
    ({"mesh": {"box": {"size": [1, 1, 0]}}}, r"mesh\.box: size must be three lengths > 0 m"),
    ({"mesh": {"box": {"element": "KinematicLinear3D9N"}}}, "Did you mean KinematicLinear3D8N"),
    ({"mesh": {"annulus": {"inner": 1}}}, r"key 'mesh\.annulus\.outer' is missing"),
    ({"mesh": "none.mdpa"}, r"mesh: there is no file .*none\.mdpa"),
    ({"mesh": "../none.mdpa"}, "leaves the folder"),
    ({"material": None}, "key 'material' is missing, and the mesh has none"),
    ({"material": {"E": 1e6, "nu": 0.3}}, "no mass|density"),
    ({"material": {"E": 1e6, "nu": 0.5, "density": 1}}, r"material: .*nu"),
    ({"material": {"E": 1e6, "nu": 0.3, "densty": 1}}, r"'material\.densty'. Did you mean density"),
    ({"start": {"velocity": [1, 2]}}, r"start\.velocity must be a list of three numbers; got \[1, 2\]"),
    ({"loads": {}}, r"loads must be a list of objects"),
    ({"loads": [{"type": "gravty"}]}, "unknown type 'gravty'. Did you mean gravity"),
    ({"loads": [{"type": "gravity"}]}, r"loads\[0\]: a gravity also needs acceleration"),
    ({"loads": [{"type": "force", "point": [9, 9, 9], "force": [1, 0, 0]}]}, r"loads\[0\]\.type: .*outside"),
    ({"loads": [{"type": "pressure", "on": "top", "pressure": 1}]}, "there is no part 'top'"),
    ({"loads": [{"type": "torque", "torque": [1, 0, 0], "frame": "body"}]}, "'spatial' or 'follower'"),
    (
        {"loads": [{"type": "gravity", "acceleration": [0, 0, 1], "amplitude": "x"}]},
        r'must be a number or \{"times": \[…\], "values": \[…\]\}',
    ),
    (
        {"loads": [{"type": "torque", "torque": [0, 0, 1], "amplitude": DESCENDING}]},
        r"loads\[0\]\.amplitude: times of a series must ascend",
    ),
    ({"constraints": [{"type": "fix_point", "points": [1, 2]}]}, r"must be a point \[x, y, z\]"),
    ({"constraints": [{"type": "fix_point", "points": "top"}]}, "there is no part 'top'"),
    ({"constraints": [{"type": "rigid_link", "point": CORNER, "anchor": CORNER}]}, "anchor coincide"),
    ({"output": {"vtu": "a.vtu"}}, r"unknown key 'output\.vtu'"),
    ({"output": {"pvd": "../a.pvd"}}, r"output\.pvd: path '\.\./a\.pvd' leaves the folder"),
    ({"restart": "none.npz"}, r"restart: there is no file"),
    ({"model": "a.mdpa"}, "unknown key 'mesh'"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), MISTAKES)
def test_a_mistake_is_named_with_its_line(tmp_path, change, message):
    path = written(tmp_path, **change)
    with pytest.raises(kl.KratosLiteError) as caught:
        read_case(path)
    first = str(caught.value).splitlines()[0]
    assert re.search(message, first), first
    assert re.match(rf"{re.escape(str(path))}:\d+:\d+: ", first), first


def test_the_line_is_that_of_the_key(tmp_path):
    path = written(tmp_path, loads=[{"type": "gravity", "acceleration": [0, 0, 1], "amplitud": 1}])
    line = next(i for i, text in enumerate(path.read_text().splitlines(), 1) if "amplitud" in text)
    with pytest.raises(
        kl.InputError, match=rf":{line}:\d+: unknown key 'loads\[0\]\.amplitud'. Did you mean amplitude"
    ):
        read_case(path)


def test_a_step_that_is_too_long_has_its_place(tmp_path, script):
    body = {"kind": "pseudo-rigid", "integrator": "DEF_EXP"}
    path = written(tmp_path, body=body, time={"step": 0.1, "steps": 1})
    line = next(i for i, text in enumerate(path.read_text().splitlines(), 1) if '"step"' in text)
    with pytest.raises(
        kl.InputError, match=rf"scene\.json:{line}:\d+: the explicit integrator is not stable"
    ):
        prepare(read_case(path))
    with pytest.raises(kl.InputError, match=r"swing\.py: a step must be one number > 0, in s"):
        read_case(script(SCRIPT + "dt = 0\n"))


def test_all_problems_come_together(tmp_path):
    path = written(
        tmp_path,
        start={"velocty": [1, 0, 0]},
        loads=[{"type": "gravity"}, {"type": "pull"}],
        constraints=[{"type": "fix_point", "points": [9, 9, 9]}],
    )
    with pytest.raises(kl.InputError) as caught:
        read_case(path)
    assert len(str(caught.value).splitlines()) == 4


def test_a_description_says_what_is_doubtful(scene):
    heavy = {"E": 210.0, "nu": 0.3, "density": 7850.0}
    text = describe_case(scene(body="pseudo-rigid", material=heavy))
    assert re.search(r"^warning +the speed of waves .* 0\.164 m/s", text, flags=re.MULTILINE)


def test_a_description_says_what_there_is(scene):
    found = scene(
        body="pseudo-rigid",
        loads=[{"type": "gravity", "acceleration": [0, 0, -9.81]}],
        constraints=[{"type": "fix_point", "points": [0, 0, 0]}],
        output={"csv": "a.csv"},
    )
    text = describe_case(found)
    for words in (
        "pseudo-rigid, 12 velocities, energy_momentum",
        "240 kg",
        "27.2, 23.2, 10.4 kg m²",
        "0.00584 s",
        "FixPoint (3)",
        "10 steps of 0.01 s",
        "a.csv",
    ):
        assert words in text


# ---- scripts -------------------------------------------------------------------------------------

SCRIPT = """
import kratos_lite as kl
from helper import density
body = kl.RigidBody(kl.box(), kl.Isotropic3D(1e6, 0.3, density))
body.set_velocity((1, 0, 0))
dt, steps = 0.1, 10
output = {"csv": "out.csv"}
"""


@pytest.fixture
def script(tmp_path):
    (tmp_path / "helper.py").write_text("density = 7.0\n")

    def write(text):
        path = tmp_path / "swing.py"
        path.write_text(text)
        return path

    return write


def test_a_script_defines_a_scene(script, tmp_path):
    path = script(SCRIPT)
    assert is_script(path)
    found = read_case(path)
    assert float(found.body.mass) == pytest.approx(7.0, rel=1e-14)
    assert found.outputs.results == [str(tmp_path / "out.csv")]
    assert last(prepare(found)[1]).q[9] == pytest.approx(1.5)


def test_a_script_may_hold_many_bodies(script):
    found = read_case(script(SCRIPT + "body = [body, kl.RigidBody(body.mesh, body.material)]\noutput = {}\n"))
    assert last(prepare(found)[1]).q.shape == (2, 12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("body = 1 / 0\n", r"swing\.py:1: ZeroDivisionError: division by zero"),
        ("body = (\n", r"swing\.py:1: "),
        ("import kratos_lite as kl\nbody = kl.box((1, 1, 0))\n", r"swing\.py:2: size must be three lengths"),
        ("body = 1\ndt = 1\n", "a script defines body, dt, steps; 'steps' is missing"),
        ("body = 1\ndt = 1\nsteps = 1\n", "body must be a body such as kl.RigidBody"),
        (SCRIPT + "output = 3\n", "output must be a dict"),
        (SCRIPT + "output = {'pdv': 'a'}\n", "unknown output 'pdv'. Did you mean pvd"),
    ],
)
def test_mistakes_in_scripts_have_their_place(script, text, message):
    with pytest.raises(kl.InputError, match=message):
        read_case(script(text))


def test_what_is_a_script_of_a_body(script, tmp_path):
    assert not is_script(script("body = 1\n"))
    assert not is_script(script("body = (\n"))
    assert not is_script(tmp_path / "none.py")
    with pytest.raises(kl.InputError, match="there is no such file"):
        read_case(tmp_path / "a.py")

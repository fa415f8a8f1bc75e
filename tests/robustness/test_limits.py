"""Sizes that are absurd, in files and arguments: refused in words before memory or time is spent on them."""

from __future__ import annotations

import io
import sys
import zipfile

import meshio
import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.io.formats.vtu import write_vtu


@pytest.fixture
def msh(tmp_path):
    """Write a tetrahedron as .msh, with some bytes replaced."""

    def write(old, new):
        path = tmp_path / "broken.msh"
        mesh = meshio.Mesh(np.eye(4, 3), [("tetra", [[0, 1, 2, 3]])])
        mesh.write(path, file_format="gmsh", binary=False)
        data = path.read_bytes()
        assert old in data
        path.write_bytes(data.replace(old, new, 1))
        return path

    return write


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"$Nodes\n1 4 1 4", b"$Nodes\n1 4000000000000 1 4"),
        (b"3 0 4 1\n", b"3 0 4 1000000000000\n"),
        (b"3 0 0 4\n", b"3 0 0 400000000000\n"),
    ],
)
def test_a_gmsh_file_with_an_absurd_count_is_refused_within_its_memory(msh, old, new, run, tmp_path):
    run("convert", msh(old, new), tmp_path / "out.vtu").refuses("broken.msh: meshio needs more memory")
    assert not (tmp_path / "out.vtu").exists()


def test_a_missing_meshio_is_named_with_its_cure(monkeypatch, tmp_path):
    kl.write(tmp_path / "bar.vtu", kl.box())
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(kl.InputError, match=r"bar\.vtu: .*meshio.*pip install meshio"):
        kl.read(tmp_path / "bar.vtu")


@pytest.mark.parametrize("element", ["KinematicLinear3D8N", "KinematicLinear3D4N", "KinematicLinear3D27N"])
def test_a_box_that_no_memory_holds_is_refused_at_once(element):
    with pytest.raises(kl.InputError, match="bricks has more than"):
        kl.box(cells=(10**6,) * 3, element=element)
    with pytest.raises(kl.InputError, match="bricks has"):
        kl.annulus(1.0, 2.0, 1.0, cells=(1e40, 3, 1))


def scene(tmp_path, time, kind="Rigid", law="1e6, 0.3, 1000.0", options=""):
    path = tmp_path / "scene.py"
    path.write_text(
        f"import kratos_lite as kl\nbody = kl.{kind}Body(kl.box(), kl.Isotropic3D({law}){options})\n{time}\n"
    )
    return path


def test_a_scene_with_an_absurd_number_of_steps_is_refused_at_its_place(tmp_path, run):
    assert run("solve", scene(tmp_path, "dt, steps = 1e-9, 10**15")).refuses(
        "scene.py: ", "1000000000000000 steps are more than 1000000000; take longer ones"
    )
    path = scene(tmp_path, "dt, steps = 0.01, 10")
    assert run("solve", path, "--time", "1e-9:10000000000").refuses(
        "10000000000 steps are more than 1000000000"
    )


def test_a_step_that_needs_absurdly_many_substeps_is_refused(tmp_path, run):
    time = "dt, steps, substeps = 1.0, 1, 'auto'"
    path = scene(tmp_path, time, "FiniteElement", "1e30, 0.3, 1e-3", ", integrator='explicit'")
    assert run("solve", path).refuses("more than 1000000 substeps", "take shorter steps")


def array(value):
    stream = io.BytesIO()
    np.save(stream, value)
    return stream.getvalue()


def test_a_state_that_states_more_numbers_than_it_holds_is_refused(tmp_path):
    head = {"kind": "rigid", "integrator": "x", "time": 0.0, "step": 0, "external_work": 0.0}
    good = array(np.zeros(2))
    absurd = good.replace(b"(2,), }" + b" " * 11, b"(999999999999,), }")
    assert (absurd != good, len(absurd)) == (True, len(good))
    with zipfile.ZipFile(tmp_path / "state.npz", "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in (
            {name: array(value) for name, value in head.items()} | {"q": absurd, "u": good}
        ).items():
            file.writestr(f"{name}.npy", data)
    text = r"state\.npz: not a state that kl\.write wrote, or not all of it"
    with pytest.raises(kl.InputError, match=text):
        kl.read_state(tmp_path / "state.npz")


def test_a_state_with_numbers_that_are_none_is_refused(tmp_path):
    body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    state = kl.State.of(body)
    state.values["u"][0] = np.nan
    with pytest.raises(kl.SolveError, match=r"s\.npz: not written: u is not finite"):
        kl.write(tmp_path / "s.npz", state)
    assert not list(tmp_path.iterdir())


def test_a_field_that_is_not_finite_is_not_written(tmp_path):
    mesh = kl.box()
    with pytest.raises(kl.SolveError, match=r"a\.vtu: not written: T is not finite"):
        write_vtu(tmp_path / "a.vtu", mesh, {"T": np.full(8, np.inf)})
    assert not list(tmp_path.iterdir())

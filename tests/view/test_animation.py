"""kl.animate: films of modes, transients, bodies and results."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.view import animation

Image = pytest.importorskip("PIL.Image")
pytest.importorskip("matplotlib")
STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0)


@pytest.fixture
def model():
    model = kl.Model(kl.box((4, 1, 1), (2, 1, 1)), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0.0, 0.0, 1e6)))
    return model


@pytest.fixture
def pendulum():
    ball = kl.RigidBody(kl.box((0.2, 0.2, 0.2), origin=(0.9, -0.1, -0.1)), STEEL)
    ball.add(kl.Gravity((0, 0, -9.81)))
    ball.constrain(kl.RigidLink((1, 0, 0), (0, 0, 0)))
    return ball


def frames(path):
    """Return the frames of a .gif as arrays."""
    found = []
    with Image.open(path) as film:
        for i in range(film.n_frames):
            film.seek(i)
            found.append(np.asarray(film.convert("RGB")).astype(int))
    return found


def still(found):
    """Return the pixels that are the same in all frames."""
    return np.all([frame == found[0] for frame in found], axis=(0, 3))


def test_a_mode_swings_through_one_period(model, tmp_path):
    _, shapes = model.modes(1)
    kl.animate(tmp_path / "a.gif", model, modes=shapes[0], frames=4, size=(3, 2))
    found = frames(tmp_path / "a.gif")
    assert len(found) == 4
    assert {frame.shape for frame in found} == {found[0].shape}
    assert not np.array_equal(found[0], found[2])  # one side and the other
    assert np.abs(found[1] - found[3]).mean() < 0.5  # both ways through the middle
    assert (found[0][0, 0] == 255).all()


def test_camera_and_colors_of_all_frames_are_one(model, tmp_path):
    kl.animate(tmp_path / "a.gif", model.solve(), frames=3, size=(4, 3), title="bar")
    found = frames(tmp_path / "a.gif")
    same = still(found)
    assert 0.5 < same.mean() < 1
    height = same.shape[0]
    assert same[int(0.9 * height) :].all()  # the color bar beneath
    assert same[: int(0.1 * height)].all()  # the title


def test_states_of_a_body_are_shown_with_their_rods(pendulum, tmp_path):
    states = list(kl.integrate(pendulum, 0.1, 4))
    kl.animate(tmp_path / "a.gif", pendulum, states=states, view="y-", size=(3, 3))
    found = frames(tmp_path / "a.gif")
    assert len(found) == 4
    dark = [(frame.max(axis=2) < 90).sum() for frame in found]
    assert min(dark) > 45
    kl.animate(tmp_path / "few.gif", pendulum, states=states, frames=2, size=(3, 3))
    assert len(frames(tmp_path / "few.gif")) == 2


def test_states_of_a_transient_and_results_one_after_the_other(model, tmp_path):
    transient = model.transient()
    states = list(kl.integrate(transient, 1e-3, 2))
    kl.animate(tmp_path / "a.gif", transient, states=states, size=(3, 2))
    kl.animate(tmp_path / "b.gif", [transient.result(s) for s in states], values="ux", size=(3, 2))
    assert [len(frames(tmp_path / name)) for name in ("a.gif", "b.gif")] == [2, 2]


def test_complex_modes_turn(model):
    from kratos_lite.analysis.subjects import series_of

    shape = np.zeros((model.mesh.n_nodes, 3), complex)
    shape[:, 1], shape[:, 2] = 1.0, 1j
    given = dict.fromkeys(("values", "states", "view", "clim", "zoom", "clip", "title", "titles", "unit"))
    series, _ = series_of(model, {**given, "modes": shape, "frames": 4, "scale": "auto", "size": None}, 4)
    u = np.array([subject.u[0] for (subject,) in series])
    assert np.abs(u[:, 0]).max() == 0
    assert np.abs(np.linalg.norm(u, axis=1) / np.linalg.norm(u[0]) - 1).max() < 1e-12
    assert np.abs(u[0] + u[2]).max() < 1e-12


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is missing")
def test_a_film_has_frames_of_even_size(model, tmp_path):
    kl.animate(tmp_path / "a.mp4", model.solve(), frames=5, size=(3, 2.11))
    out = tmp_path / "f%d.png"
    subprocess.run(["ffmpeg", "-loglevel", "error", "-i", tmp_path / "a.mp4", out], check=True)
    sizes = []
    for path in tmp_path.glob("f*.png"):
        with Image.open(path) as picture:
            sizes.append(picture.size)
    assert len(sizes) == 5
    assert len(set(sizes)) == 1
    assert {side % 2 for side in sizes[0]} == {0}


def test_without_ffmpeg_the_cure_is_named_before_any_step(model, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)

    def states():
        pytest.fail("a step is taken")
        yield

    words = (
        r"a\.mp4: films need ffmpeg: apt install ffmpeg, or pip install imageio-ffmpeg; \.gif needs neither"
    )
    with pytest.raises(kl.KratosLiteError, match=words):
        kl.animate(tmp_path / "a.mp4", model.transient(), states=states())


def test_what_ffmpeg_says_is_told_and_nothing_is_left(model, tmp_path, monkeypatch):
    broken = tmp_path / "ffmpeg"
    broken.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n")
    broken.chmod(0o755)
    monkeypatch.setattr(animation, "_ffmpeg", lambda path: str(broken))
    with pytest.raises(
        kl.KratosLiteError, match=r"a\.mp4: not written: ffmpeg says 'no such codec'; try \.gif"
    ):
        kl.animate(tmp_path / "a.mp4", model.solve(), frames=2, size=(2, 2))
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


def test_what_does_not_move_is_refused(model, pendulum, tmp_path):
    with pytest.raises(kl.InputError, match=r"a\.png: animations are written as \.gif or \.mp4"):
        kl.animate(tmp_path / "a.png", model.solve())
    for thing in (model, model.mesh):
        with pytest.raises(kl.InputError, match="nothing moves here: give modes, states, or a result"):
            kl.animate(tmp_path / "a.gif", thing)
    with pytest.raises(kl.InputError, match="nothing moves here: give more than one state"):
        kl.animate(tmp_path / "a.gif", pendulum)
    with pytest.raises(kl.InputError, match="frames must be a whole number ≥ 2"):
        kl.animate(tmp_path / "a.gif", model.solve(), frames=1)
    with pytest.raises(kl.InputError, match="fps must be one number > 0"):
        kl.animate(tmp_path / "a.gif", model.solve(), fps=0)
    assert list(tmp_path.iterdir()) == []

import sys

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.mesh import Block, Mesh
from kratos_lite.shapes import SHAPES
from kratos_lite.shapes.faces import Point1
from kratos_lite.shapes.hexahedra import Hexahedron20
from kratos_lite.shapes.tetrahedra import Tetrahedron4
from kratos_lite.view import canvas

image = pytest.importorskip("matplotlib.image")


@pytest.fixture
def cube():
    nodes = np.arange(20, dtype=np.int32)[None]
    return Mesh(Hexahedron20.nodes, [Block("H", nodes, np.array([1]), np.array([1]), Hexahedron20)])


@pytest.fixture
def sharp(monkeypatch):
    """Let pictures have the dots per inch that users get."""
    monkeypatch.setattr(canvas, "DPI", 150)


def colors(path):
    pixels = image.imread(path)[..., :3]
    return pixels, len(np.unique((pixels.reshape(-1, 3) * 255).astype(int), axis=0))


def test_a_picture_shows_the_body_in_many_colors_and_fills_its_size(cube, sharp, tmp_path):
    kl.plot(cube, tmp_path / "a.png", values=cube.points[:, 2], title="STRESS", size=(4, 3))
    pixels, count = colors(tmp_path / "a.png")
    height, width, _ = pixels.shape
    assert 300 < height <= 3.3 * 150
    assert 300 < width <= 4.3 * 150
    assert count > 100
    assert 0.15 < (pixels.min(axis=2) < 0.95).mean() < 0.9


def test_without_values_the_body_is_plain(cube, tmp_path):
    kl.plot(cube, tmp_path / "a.png")
    pixels, _ = colors(tmp_path / "a.png")
    blue = (pixels[..., 2] > pixels[..., 0] + 0.1).mean()
    assert blue > 0.2


def labels(mesh, values, unit):
    """Return the numbers at the color bar, and the unit."""
    figure = kl.plot(mesh, values=values, unit=unit)
    bar = figure.axes[-1]
    axis = bar.xaxis if bar.get_xlabel() else bar.yaxis
    figure.canvas.draw()
    low, high = axis.get_view_interval()
    shown = [
        t.get_text()
        for t, x in zip(axis.get_ticklabels(), axis.get_ticklocs(), strict=True)
        if low <= x <= high
    ]
    return " ".join([*shown, axis.get_label_text()])


@pytest.mark.parametrize(
    ("low", "change", "unit", "shown"),
    [
        (1e6, 1e6, "Pa", "0 0.25 0.5 0.75 1 1.25 1.5 1.75 2 MPa"),
        (0.0, 1e7, "ksi", "-10 -7.5 -5 -2.5 0 2.5 5 7.5 10 × 1e6 ksi"),
        (5e6, 5e-3, "Pa", "3 4 5 6 7 MPa"),  # as good as uniform: a range around it
        (0.0, 0.0, "Pa", "-1 -0.75 -0.5 -0.25 0 0.25 0.5 0.75 1 Pa"),
    ],
)
def test_numbers_of_the_color_bar_are_round_and_have_one_unit(cube, low, change, unit, shown):
    assert labels(cube, low + change * cube.points[:, 0], unit).replace("−", "-") == shown


def test_a_deformation_is_never_shown_smaller_than_it_is(cube, tmp_path):
    u = 30.0 * cube.points
    kl.plot(cube, tmp_path / "a.svg", displacement=u)
    assert "deformation × 1 " in (tmp_path / "a.svg").read_text()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"displacement": np.zeros((20, 2))}, r"displacement must have shape \(20, 3\); got \(20, 2\)"),
        ({"values": np.full(20, np.nan)}, "values must be finite; got nan"),
    ],
)
def test_wrong_arrays_are_refused(cube, tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        kl.plot(cube, tmp_path / "a.png", **change)
    assert list(tmp_path.iterdir()) == []


def test_a_mesh_without_surface_is_refused(tmp_path):
    with pytest.raises(InputError, match="nothing to draw"):
        kl.plot(Mesh(np.eye(3)), tmp_path / "a.png")


def test_an_unknown_ending_names_the_known_ones(cube, tmp_path):
    with pytest.raises(InputError, match=r"cannot be written as \.bmpx; known are .*pdf.* png"):
        kl.plot(cube, tmp_path / "a.bmpx")
    with pytest.raises(InputError, match=r"an ending that says its format, such as \.png"):
        kl.plot(cube, tmp_path / "a")
    assert list(tmp_path.iterdir()) == []


def test_without_matplotlib_the_cure_is_named(cube, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    with pytest.raises(KratosLiteError, match=r"need matplotlib: pip install -e \"\.\[view\]\" in a clone"):
        kl.plot(cube, tmp_path / "a.png")


@pytest.mark.parametrize(
    "name", [name for name, s in zip(SHAPES, SHAPES.values(), strict=True) if s is not Point1]
)
def test_every_cell_is_drawn_with_all_its_numbers(tmp_path, name):
    kl.plot(SHAPES[name], tmp_path / "a.svg")
    text = (tmp_path / "a.svg").read_text()
    assert [a for a in range(30) if f"<!-- {a} -->" in text] == list(range(len(SHAPES[name].nodes)))


def test_a_single_point_is_drawn(tmp_path):
    kl.plot(Point1, tmp_path / "a.svg")
    assert "<!-- 0 -->" in (tmp_path / "a.svg").read_text()


def test_gauss_points_are_marked_in_red(tmp_path):
    kl.plot(Tetrahedron4, tmp_path / "plain.png")
    kl.plot(Tetrahedron4, tmp_path / "marked.png", points=[[0.25, 0.25, 0.25]])
    red = [
        (p[..., 0] > p[..., 2] + 0.3).sum()
        for p, _ in map(colors, [tmp_path / "plain.png", tmp_path / "marked.png"])
    ]
    assert red[0] == 0
    assert red[1] > 5
    with pytest.raises(InputError, match=r"points in a Tetrahedron4 must have shape \(g, 3\); got \(1, 2\)"):
        kl.plot(Tetrahedron4, tmp_path / "a.png", points=[[0.25, 0.25]])

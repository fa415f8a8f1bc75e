"""kl.plot and its options: values by name, views, limits, scale, zoom, cut, several side by side."""

import itertools
import subprocess
import sys

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis import model_picture
from kratos_lite.analysis.subjects import nodal_values
from kratos_lite.shapes import SHAPES
from kratos_lite.view.camera import OBLIQUE, VIEWS, rows_of, window_of
from kratos_lite.view.curves import response_figure
from kratos_lite.view.facets import behind, facets_of
from kratos_lite.view.plane import clip_facets, cut_cells, plane_of
from kratos_lite.view.rulers import extent
from kratos_lite.view.scene import place_text

matplotlib = pytest.importorskip("matplotlib")
STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0)


def bent(size=(4, 1, 1), cells=(4, 1, 1), element="KinematicLinear3D8N"):
    model = kl.Model(kl.box(size, cells, element), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0.0, 0.0, -1e6)))
    return model.solve()


@pytest.fixture(scope="module")
def result():
    return bent()


def bar(figure):
    """Return limits, unit and numbers of the color bar."""
    axes = figure.axes[-1]
    upright = axes.get_position().height > axes.get_position().width
    limits = axes.get_ylim() if upright else axes.get_xlim()
    return np.array(limits), axes.get_ylabel() if upright else axes.get_xlabel()


def body(axes):
    """Return corners of the polygons of a body in the picture."""
    drawn = [c for c in axes.collections if type(c).__name__ == "PolyCollection"]
    return np.concatenate([path.vertices for path in drawn[-1].get_paths()])


def words(figure):
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_springs_masses_and_remote_points_of_a_model_are_marked():
    """Seen along y, x is to the right and z upwards; a spring to ground is a tenth of the body."""
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), STEEL)
    assert len(kl.plot(model, view="y-").axes[0].lines) == 2  # the rulers
    model.rigid("x+", (5.0, 0.5, 0.5))
    model.add(kl.ElasticSupport((2.0, 0, 1), (1e3, 1e3, 1e7)))
    model.add(kl.ElasticSupport((0.0, 0, 0), (0, 0, 1e7), to=(0.0, 0, 1.0)))
    model.add(kl.ElasticSupport("z-", 1e6))
    model.add_mass((1.0, 1, 1), 5.0)
    lines = [np.array(line.get_xydata()) for line in kl.plot(model, view="y-").axes[0].lines]
    tenth = 0.1 * np.sqrt(18)
    ends = [line[[0, -1]] for line in lines if len(line) > 2]
    for exact in ([(2, 1), (2, 1 + tenth)], [(0, 0), (0, 1)]):
        assert min(np.abs(pair - exact).max() for pair in ends) < 1e-12
    below = [pair for pair in ends if abs(pair[0, 1]) < 1e-12 and abs(pair[1, 1] + tenth) < 1e-12]
    assert len(below) == 9
    dots = [tuple(line[0]) for line in lines if line.shape == (1, 2)]
    assert {(1.0, 1.0), (5.0, 0.5)} <= set(dots)
    spokes = [line for line in lines if line.shape == (2, 2) and (line[0] == (5.0, 0.5)).all()]
    assert {tuple(spoke[1]) for spoke in spokes} == {(4.0, 0.0), (4.0, 1.0)}


def marked(model):
    return model_picture.marks_of_model(model)


def test_supports_point_at_held_nodes_from_outside_along_the_axes_that_hold_them():
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), STEEL)
    model.fix("x-", "x")
    model.fix("z+", "z")
    lines = marked(model).supports
    size = 0.1 * np.sqrt(18) * model_picture.CONE
    along = lines[:, 1] - lines[:, 0]
    on_x = lines[:, 1, 0] == 0
    clamp = np.abs(along - [size, 0, 0]).max(axis=1) < 1e-12
    roller = np.abs(along - [0, 0, -size]).max(axis=1) < 1e-12
    assert (clamp | roller).all()
    assert clamp.sum() == 4
    assert on_x[clamp].all()
    assert (lines[roller, 1, 2] == 1).all()


def test_a_support_that_is_released_has_no_mark():
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), STEEL)
    model.fix("x-")
    model.release("x-", "yz")
    along = np.diff(marked(model).supports, axis=1)
    assert along.shape == (4, 1, 3)
    assert not along[..., 1:].any()


@pytest.mark.parametrize(
    ("load", "places", "way", "tip"),
    [
        (kl.Pressure("z+", 1e5), 4, (0, 0, -1), True),
        (kl.Pressure("z+", -1e5), 4, (0, 0, 1), False),
        (kl.Traction("x+", (0, 0, 2.0)), 1, (0, 0, 1), False),
        (kl.PointLoad((4.0, 1, 1), (-3.0, 0, 0)), 1, (-1, 0, 0), True),
        (kl.Resultant("x+", (5.0, 0, 0)), 1, (1, 0, 0), False),
        (kl.Gravity((0, 0, -9.81)), 1, (0, 0, -1), False),
        (kl.Temperature(50.0), 0, (0, 0, 0), True),
    ],
)
@pytest.mark.parametrize("element", ["8N", "20N"])
def test_arrows_of_loads(load, places, way, tip, element):
    """The longest is a tenth of the body; what pushes ends on the surface, what pulls starts there."""
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1), f"KinematicLinear3D{element}"), STEEL)
    model.add(load, amplitude=lambda t: t)  # shown, though it is 0 at the time 0
    arrows = marked(model).loads
    assert len(arrows) == places
    along = arrows[:, 1] - arrows[:, 0]
    assert np.abs(along - 0.1 * np.sqrt(18) * np.array(way)).max(initial=0.0) < 1e-12
    places = np.sort(arrows[:, int(tip)], axis=0)
    exact = {"z+": [(x, 0.5, 1) for x in (0.5, 1.5, 2.5, 3.5)], "x+": [(4, 0.5, 0.5)]}.get(
        getattr(load, "where", None) if isinstance(getattr(load, "where", None), str) else "", [(2, 0.5, 0.5)]
    )
    if not isinstance(load, (kl.PointLoad, kl.Temperature)):
        assert np.abs(places - exact).max() < 1e-9


def test_titles_stand_above_the_rulers_of_a_round_body():
    wheel = kl.annulus(0.3, 1.0, 0.25, cells=(1, 16, 1))
    turned = wheel.replace(points=wheel.points @ np.eye(3)[[0, 2, 1]])  # a ruler along z beside it
    (axes, *_) = kl.plot(turned, values=turned.points[:, 0]).axes
    tops = [line.get_window_extent().y1 for line in axes.lines]
    assert max(tops) > axes.get_window_extent().y1  # what it stands in the way of
    assert min(text.get_window_extent().y0 for text in axes.texts if "at node" in text.get_text()) > max(tops)


@pytest.mark.parametrize("force", [3.0, -3.0])
def test_arrows_of_a_bolt_meet_in_its_cut(force):
    bolt = kl.split(kl.box((1, 1, 4), (2, 2, 4)), lambda X: X[:, 2] == 2)
    model = kl.Model(bolt, STEEL)
    model.pretension("cut-", "cut+", force=force)
    tails, heads = marked(model).loads.transpose(1, 0, 2)
    assert np.abs(heads - (0.5, 0.5, 2)).max() < 1e-12
    assert np.abs(tails[:, 2] - 2 - np.array([-0.1, 0.1]) * np.sign(force) * np.sqrt(18)).max() < 1e-12


def test_moments_and_many_loads_have_arrows():
    model = kl.Model(kl.box((4, 1, 1), (4, 4, 4)), STEEL)
    model.add(kl.Resultant("x+", (0, 0, 0), moment=(0, 2.0, 0)))
    moments = marked(model).moments
    assert np.abs(moments - [[(4, 0.5, 0.5), (4, 0.5 + 0.1 * np.sqrt(18), 0.5)]]).max() < 1e-12
    for x in model.mesh.points[model.mesh.nodes("z+")]:
        for _ in range(3):
            model.add(kl.PointLoad(x, (0, 0, -1.0)))
    assert 0 < len(marked(model).loads) <= (model_picture.ALONE + 1) * 9


def test_materials_have_colors_and_a_legend():
    mesh = kl.box((4, 1, 1), (4, 1, 1))
    model = kl.Model(mesh)
    assert model_picture.materials_of(model) is None
    soft = kl.Isotropic3D(E=1e9, nu=0.3)
    model.assign(STEEL, [0, 1])
    model.assign(soft, [2])
    values = model_picture.materials_of(model)
    assert [values.names[int(i)] for i in values.numbers] == [str(STEEL)] * 2 + [str(soft), "no material"]
    model.fix("x-")
    model.add(kl.Temperature(20.0, reference=5.0), name="oven")
    model.add(kl.Resultant("x+", (0, 0, -9.0)))
    model.add(kl.Resultant("x+", (0, 0, 0), moment=(0, 8.0, 0)), amplitude=lambda t: t)
    figure = model.plot()
    said = [t.get_text() for t in figure.axes[-1].get_legend().get_texts()]
    assert said[:4] == [str(STEEL), str(soft), "no material", "x-, xyz = 0 m"]
    assert said[4:] == [
        "oven: temperature 20, reference 5.0 [°C or K]",
        "resultant force (0, 0, -9) on 'x+' [N]",
        "resultant moment (0, 8, 0) on 'x+', times an amplitude [N] [N m]",
    ]


@pytest.mark.parametrize("element", ["8N", "10N"])
def test_what_the_body_hides(element):
    mesh = kl.box((1, 1, 1), (2, 2, 2), element)
    towards = (1.0, -2.0, 3.0)  # also edges and corners of facets are hit
    rows = rows_of(towards, mesh.points)
    facets = facets_of(mesh, mesh.points, None, rows)
    inside = np.array([(x, y, z) for x in (0.1, 0.5, 0.9) for y in (0.25, 0.5) for z in (0.05, 0.95)])
    assert behind(facets, inside, rows).all()
    assert behind(facets, inside - 2 * np.array(towards), rows).all()
    assert not behind(facets, inside + 2 * np.array(towards), rows).any()
    assert not behind(facets, inside + 2 * rows[0], rows).any()


def test_rounding_in_places_is_said_as_0():
    assert place_text(np.array([11.265, 6.9e-16, 0.5])) == "(11.265, 0, 0.5)"
    assert place_text(np.zeros(3)) == "(0, 0, 0)"


def test_extremes_are_marked_with_their_place_and_number():
    mesh = kl.box((4, 1, 1), (4, 1, 1))
    mesh = kl.Mesh(mesh.points, mesh.blocks, node_ids=100 + np.arange(20))
    numbers = np.linspace(1.0, 2.0, 20) * 1e6
    figure = kl.plot(mesh, values=numbers, unit="Pa", view="y-")
    assert "▲ 2 MPa at node 119, (4, 1, 1) m\n▼ 1 MPa at node 100, (0, 0, 0) m" in words(figure)
    found = {line.get_marker(): line.get_xydata()[0].tolist() for line in figure.axes[0].lines}
    assert found["^"] == [4, 1]
    assert found["v"] == [0, 0]
    numbers[0] = 1e-9
    assert any("▼ 0 Pa at node 100" in text for text in words(kl.plot(mesh, values=numbers, unit="Pa")))
    of_elements = kl.plot(mesh, values=np.arange(4.0), view="y-")
    assert any("at element 4, (3.5, 0.5, 0.5) m" in text for text in words(of_elements))
    assert not [text for text in words(kl.plot(mesh, values=np.ones(20))) if "▲" in text]


@pytest.mark.parametrize(("view", "seen"), [("iso", "v"), ((150, 20), "^"), ("y-", "")])
def test_marks_of_extremes_are_pale_where_the_body_hides_them(view, seen):
    """They are in the middle of the sides x- and x+ of a cube."""
    mesh = kl.box((1, 1, 1), (2, 2, 2))
    on_axis = (np.abs(mesh.points[:, 1:] - 0.5) < 0.1).all(axis=1)
    numbers = np.where(on_axis, 0.5 - mesh.points[:, 0], 0.0)
    lines = kl.plot(mesh, values=numbers, view=view).axes[0].lines
    assert "".join(line.get_marker() for line in lines if line.get_alpha() == 1) == seen


def test_recovered_values_say_so(result):
    numbers = nodal_values(result, "von_mises").numbers
    text = f"▲ {numbers.max() / 1e6:.4g} MPa recovered at node {result.mesh.node_ids[numbers.argmax()]}, "
    assert any(text in found for found in words(result.plot()))


def test_a_few_singular_nodes_do_not_own_the_colors():
    mesh = kl.box((9, 9, 9), (9, 9, 9))
    numbers = np.linspace(0, 100, 1000)
    assert np.abs(bar(kl.plot(mesh, values=numbers))[0] - [0, 100]).max() == 0
    peaked = numbers.copy()
    peaked[-3:] = 4000.0, 4500.0, 5000.0
    figure = kl.plot(mesh, values=peaked)
    assert bar(figure)[0][1] < 100
    assert any("▲ 5000 at node 1000, " in text for text in words(figure))
    assert np.abs(bar(kl.plot(mesh, values=peaked, clim=(0, 5000)))[0] - [0, 5000]).max() == 0
    x, tiny = mesh.points.copy(), 1e-3
    x[:, 0] = np.where(x[:, 0] > 4, 9 + tiny * (x[:, 0] - 9), x[:, 0])  # half of the nodes lie at one end
    graded = kl.Mesh(x, mesh.blocks)
    at_end = np.where(mesh.points[:, 0] > 5.5, 1000.0, x[:, 0])
    assert np.abs(bar(kl.plot(graded, values=at_end))[0] - [0, 9 - 4 * tiny]).max() < 1e-12
    rare = np.where(numbers > 99.9, 1.0, 0.0)  # all others are one value: nothing would be seen
    assert np.abs(bar(kl.plot(mesh, values=rare))[0] - [0, 1]).max() == 0


@pytest.mark.parametrize(("point", "strengths"), [(0.1, {0.75}), (1.0, set())])
def test_lines_of_the_mesh_fade_where_they_are_dense_and_sharp_edges_stay(point, strengths):
    """A point is that many m in the picture; cells are 1 m."""
    mesh = kl.box((9, 9, 9), (9, 9, 9))
    found = facets_of(mesh, mesh.points, None, rows_of("iso", mesh.points), point=point)
    sharp = found.ink[:, 4] == 0.9
    assert set(found.ink[~sharp, 3]) == strengths
    assert np.abs(np.linalg.norm(np.diff(found.edges[sharp], axis=1), axis=2).sum() - 9 * 9) < 1e-9


def test_a_part_that_is_zoomed_to_is_outlined():
    mesh = kl.box((4, 1, 1), (4, 2, 2))
    part = np.isin(np.arange(mesh.n_nodes), mesh.nodes("x+"))
    found = facets_of(mesh, mesh.points, None, rows_of("iso", mesh.points), part=part)
    red = found.edges[found.ink[:, 0] > 0.5]
    assert (red[..., 0] == 4).all()
    assert np.abs(np.linalg.norm(np.diff(red, axis=1), axis=2).sum() - 4) < 1e-9


def test_lengths_are_in_the_units_of_the_mesh_and_modes_have_none():
    model = kl.Model(
        kl.box((400, 50, 50), (4, 1, 1)), kl.Isotropic3D(E=2e5, nu=0.3, density=8e-9), units="mm N MPa t"
    )
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1.0)))
    assert bar(model.solve().plot(values="uz"))[1] == "mm"
    shapes = model.modes(1)[1]
    assert bar(model.plot(modes=shapes[0]))[1] == "(normalized)"
    assert "(normalized)" in bar(model.plot(modes=shapes[0], values="uz"))[1]


# ---- values ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "unit", "numbers"),
    [
        ("von_mises", "Pa", lambda r: r.von_mises("node")),
        ("sxx", "Pa", lambda r: r.stress("node")[:, 0]),
        ("syy", "Pa", lambda r: r.stress("node")[:, 1]),
        ("s1", "Pa", lambda r: eigenvalues(r.stress("node"))[:, 2]),
        ("s3", "Pa", lambda r: eigenvalues(r.stress("node"))[:, 0]),
        ("tresca", "Pa", lambda r: np.ptp(eigenvalues(r.stress("node")), axis=1)),
        ("exy", "", lambda r: r.strain("node")[:, 3]),
        ("e2", "", lambda r: eigenvalues(r.strain("node") * [1, 1, 1, 0.5, 0.5, 0.5])[:, 1]),
        ("uz", "m", lambda r: r.u[:, 2]),
        ("displacement", "m", lambda r: np.linalg.norm(r.u, axis=1)),
        ("reaction", "N", lambda r: np.linalg.norm(r.reactions, axis=1)),
    ],
)
def test_values_by_name(result, name, unit, numbers):
    found, expected = nodal_values(result, name), numbers(result)
    assert found.unit == unit
    assert np.abs(found.numbers - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("name", "unit", "scale"), [("von_mises", "MPa", 1e6), ("uz", "µm", 1e-6), ("exy", "", 1.0)]
)
def test_the_color_bar_spans_the_values_in_their_unit(result, name, unit, scale):
    limits, label = bar(result.plot(values=name))
    numbers = nodal_values(result, name).numbers
    assert label == unit or not unit
    assert np.abs(limits - [numbers.min(), numbers.max()]).max() < 1e-9 * np.abs(numbers).max()


def eigenvalues(voigt):
    return np.linalg.eigvalsh(voigt[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]])


def test_the_error_of_elements_has_a_logarithmic_scale_and_one_color_an_element(result):
    figure = result.plot(values="error")
    assert figure.axes[-1].get_xscale() == "log" or figure.axes[-1].get_yscale() == "log"
    assert bar(figure)[1] in ("√J", "m√J")
    error = result.error().per_element
    assert np.abs(bar(figure)[0] / [error.min(), error.max()] - 1).max() < 1e-9


def test_own_values_of_nodes_and_of_elements(result):
    mesh = result.mesh
    of_nodes, of_elements = np.arange(mesh.n_nodes) + 5.0, np.arange(mesh.n_elements) + 2.0
    assert np.abs(bar(kl.plot(mesh, values=of_nodes, unit="K"))[0] - [5, 4 + mesh.n_nodes]).max() == 0
    figure = kl.plot(mesh, values=of_elements, view="y-")
    colors = figure.axes[0].collections[-1].get_facecolors()
    of_facets = colors[colors[:, 3] == 1]  # edges are weaker
    assert len(np.unique(of_facets.round(6), axis=0)) == mesh.n_elements


def test_displacements_of_a_mesh_have_names(result):
    u = np.zeros((result.mesh.n_nodes, 3))
    u[:, 1] = np.linspace(0, 2e-3, len(u))
    assert np.abs(bar(kl.plot(result.mesh, displacement=u, values="uy"))[0] - [0, 2e-3]).max() < 1e-15


# ---- camera ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", [None, *VIEWS, (30, 20), (120, -40), (0, 90), (1, 2, 3), (0, 0, -1)])
def test_cameras_are_right_handed_with_z_up(view):
    rows = rows_of(view, np.array([[0.0, 0.0, 0.0], [9.0, 1.0, 0.1]]))
    assert np.abs(rows @ rows.T - np.eye(3)).max() < 1e-14
    assert abs(np.linalg.det(rows) - 1) < 1e-14
    assert rows[1, 2] >= 0


def test_reference_cells_are_seen_by_a_nearly_right_handed_camera():
    assert np.abs(OBLIQUE @ OBLIQUE.T - np.eye(3)).max() < 0.02
    assert np.linalg.det(OBLIQUE) > 0.9


def test_a_side_is_seen_from_outside():
    assert np.abs(rows_of("x+", np.eye(3)) - [[0, 1, 0], [0, 0, 1], [1, 0, 0]]).max() == 0
    assert np.abs(rows_of("y-", np.eye(3)) - [[1, 0, 0], [0, 0, 1], [0, -1, 0]]).max() == 0
    assert np.abs(rows_of("z+", np.eye(3)) - np.eye(3)).max() == 0
    azimuth, elevation = np.radians((-45, np.degrees(np.arctan(1 / np.sqrt(2)))))
    angles = rows_of(np.degrees((azimuth, elevation)), np.eye(3))
    assert np.abs(angles - rows_of("iso", np.eye(3))).max() < 1e-14


SIZES = ((1, 1, 1), (100, 1, 1), (1, 100, 1), (1, 1, 100), (10, 10, 0.1), (0.1, 10, 10))


@pytest.mark.parametrize(
    ("size", "view"), [*((size, None) for size in SIZES), *zip(SIZES * 2, VIEWS, strict=False)]
)
def test_the_body_fills_the_picture(size, view):
    mesh = kl.box(size)
    figure = kl.plot(mesh, view=view)
    axes = figure.axes[0]
    drawn = np.ptp(body(axes), axis=0)
    window = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())])
    assert (drawn / window).max() > 0.9
    if view is None:
        assert (drawn / window).min() > 0.6
    width, height = figure.get_size_inches()
    assert width <= 8.1
    assert height <= 6.1
    assert max(width / 8, height / 6) > 0.9


def test_the_sizes_of_the_body_are_readable():
    ring = kl.annulus(0.1, 0.45, 0.1, cells=(1, 12, 1))
    assert {"x  -0.45 … 0.45 m", "y  -0.45 … 0.45 m", "z  0 … 0.1 m"} <= set(words(kl.plot(ring)))
    assert {"x  0 … 2 mm", "y  0 … 1 mm"} <= set(words(kl.plot(kl.box((0.002, 0.001, 0.001)))))
    assert extent(-1.225e-17, 1.0) == "0 … 1"
    assert extent(0.1 + 0.2, 0.7) == "0.3 … 0.7"


@pytest.mark.parametrize("size", [(100, 1, 1), (1, 1, 1), (10, 10, 0.1), (1, 0.01, 1)])
def test_texts_lie_on_no_other_and_within_the_figure(size):
    figure = kl.plot(kl.box(size), values=np.arange(8.0), title="a title", unit="Pa")
    figure.canvas.draw()
    texts = [t for axes in figure.axes for t in (*axes.texts, axes.title) if t.get_text()]
    boxes = [text.get_window_extent() for text in texts]
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:i])
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1


# ---- limits, scale, zoom ---------------------------------------------------------------------------


def test_scale_of_the_displacement(result):
    figures = [result.plot(scale=scale, view="y-") for scale in (0, 100, "auto")]
    assert [f.axes[0].get_title().splitlines()[1] for f in figures] == [
        "deformation × 0",
        "deformation × 100",
        "deformation × 500",
    ]
    low = [body(f.axes[0])[:, 1].min() for f in figures]
    tip = result.u[:, 2].min()
    assert abs(low[0]) < 1e-12
    assert abs(low[1] / (100 * tip) - 1) < 1e-9


def test_zoom_to_a_factor_a_part_or_a_box(result):
    whole = result.plot(scale=0, view="y-").axes[0]
    for zoom in (4, "x+", ((3, 0, 0), (4, 1, 1))):
        axes = result.plot(scale=0, view="y-", zoom=zoom).axes[0]
        assert np.ptp(axes.get_xlim()) < 0.4 * np.ptp(whole.get_xlim())
        assert axes.collections[-1].get_clip_on()
    assert axes.get_xlim()[0] < 3
    assert axes.get_xlim()[1] > 4


# ---- cuts ------------------------------------------------------------------------------------------


def area(polygons):
    """Return the area of flat polygons (m, 4, 3)."""
    a, b, c, d = np.moveaxis(polygons, 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a) + np.cross(c - a, d - a), axis=1).sum() / 2


@pytest.mark.parametrize("element", ["4N", "5N", "6N", "8N", "10N", "13N", "15N", "20N", "27N"])
def test_a_section_has_the_area_and_the_values_of_the_body(element):
    mesh = kl.box((1, 2, 3), (2, 2, 2), f"KinematicLinear3D{element}")
    normal = np.array([1.0, 2.0, 0.0]) / np.sqrt(5)
    distance = (mesh.points - [0.5, 1.0, 0.0]) @ normal
    found = 0.0
    for block in mesh.blocks:
        cells, found_at, edges = cut_cells(block, distance, np.column_stack([mesh.points, mesh.points[:, 2]]))
        corners, values, xi = found_at[..., :3], found_at[..., 3], found_at[..., 4:]
        edges = edges[..., :3]
        found += area(corners)
        assert np.abs((corners - [0.5, 1.0, 0.0]) @ normal).max() < 1e-12
        assert np.abs((edges - [0.5, 1.0, 0.0]) @ normal).max() < 1e-12
        assert np.abs(values - corners[:, :, 2]).max() < 1e-12
        places = np.einsum("pca,pad->pcd", block.known_shape.N(xi), mesh.points[block.nodes[cells]])
        assert np.abs(places - corners).max() < 1e-12
    assert abs(found - 3 * np.sqrt(1 + 0.25)) < 1e-12  # a rectangle from y = 0.75 to 1.25


def test_facets_are_clipped_exactly():
    square = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]])
    for normal, offset, kept in (((1, 0), 0.25, 0.25), ((1, 1), 0.5, 0.125), ((-1, -1), -0.5, 0.875)):
        d = square[..., :2] @ np.array(normal, dtype=float) - offset
        parts, owners = clip_facets(square, d)
        assert abs(area(parts) - kept) < 1e-15
        assert set(owners) == {0}
    assert len(clip_facets(square, d + 10)[0]) == 0


@pytest.mark.parametrize("name", [name for name in SHAPES if SHAPES[name].nodes.shape[1] == 3])
def test_a_cut_takes_away_what_lies_towards_the_viewer(name):
    shape = SHAPES[name]
    rows = np.arange(len(shape.nodes))[None]
    mesh = kl.Mesh(shape.nodes, [kl.Block("X", rows, shape=shape)])
    z = 0.6 * shape.nodes[:, 2].min() + 0.4 * shape.nodes[:, 2].max()
    for view, kept in (((-60, 30), -1), ((-60, -30), 1), ("y-", -1)):
        camera = rows_of(view, mesh.points)
        plane = plane_of(((0, 0, 2), 2 * z), camera[2])
        corners = facets_of(mesh, mesh.points, None, camera, plane).corners
        assert (kept * (corners[..., 2] - z)).min() > -1e-12
        assert (np.abs(corners[..., 2] - z) < 1e-12).all(axis=1).any()


# ---- several ---------------------------------------------------------------------------------------


def test_several_results_have_one_scale_one_camera_and_their_titles(result):
    other = bent(cells=(8, 2, 2), element="KinematicLinear3D20N")
    figure = kl.plot([result, other], values="sxx", titles=["coarse", "fine"])
    first, second, _ = figure.axes
    assert (first.get_title(), second.get_title()) == ("coarse", "fine")
    assert first.get_xlim() == second.get_xlim()
    assert first.get_ylim() == second.get_ylim()
    stresses = np.concatenate([r.stress("node")[:, 0] for r in (result, other)])
    assert np.abs(bar(figure)[0] - [stresses.min(), stresses.max()]).max() < 1e-3
    same = kl.plot({"coarse": result, "fine": other}, values="sxx")
    assert [axes.get_title() for axes in same.axes[:2]] == ["coarse", "fine"]
    with pytest.raises(kl.InputError, match="titles: one for each of 2 pictures"):
        kl.plot([result, other], titles=["coarse"])
    with pytest.raises(kl.InputError, match="nothing to draw in an empty list"):
        kl.plot([])


def test_panels_and_their_titles_are_apart(result):
    figure = kl.plot({f"a long title of the number {i}": result for i in range(4)})
    figure.canvas.draw()
    titles = [axes.title.get_window_extent() for axes in figure.axes[:-1]]
    panels = [axes.get_window_extent() for axes in figure.axes[:-1]]
    for boxes in (titles, panels):
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_titles_of_slender_modes_stand_below_the_modes_above_them():
    model = kl.Model(kl.box((1, 0.03, 0.05), (6, 1, 1)), STEEL)
    bends = np.sin(2 * np.pi * model.mesh.points[:, :1]) * [0, 0, 1]
    figure = model.plot(modes=[bends, -bends, bends], titles=list("abc"), title="all of them")
    figure.canvas.draw()
    panels = figure.axes[:3]
    for above, below in ((panels[0], panels[1]), (panels[1], panels[2])):
        assert below.title.get_window_extent().y1 <= above.get_window_extent().y0
    (head,) = figure.texts
    assert head.get_text() == "all of them"
    assert head.get_window_extent().y0 >= panels[0].title.get_window_extent().y1


def test_modes_are_drawn_side_by_side_with_one_amplitude():
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), STEEL)
    model.fix("x-")
    omega, shapes = model.modes(2)
    figure = model.plot(modes=shapes, titles=[f"{w:.0f} rad/s" for w in omega])
    assert len(figure.axes) == 3
    assert np.abs(bar(figure)[0] - [0, 1]).max() < 1e-15
    assert model.plot(modes=1000 * shapes[0], title="first").axes[0].get_title() == "first"
    moved = model.plot(modes=shapes[0], view="z+").axes[0]
    assert 0.05 * np.sqrt(18) < max(body(moved).max(axis=0) - [4, 1]) + 1 < 0.2 * np.sqrt(18) + 1
    with pytest.raises(kl.InputError, match=r"modes must have shape \(20, 3\) or \(k, 20, 3\)"):
        model.plot(modes=shapes[0][:5])


# ---- things ----------------------------------------------------------------------------------------


ALL = r"unknown field .*; there are displacement, ux, .*, error"
A_SIZE = [(0, 0), (1,), "a", (1e6, 1e6), (-1, 2), (np.nan, 1), 5]
REFUSED = [
    *(({"values": name}, ALL) for name in ("von_mise", "sxz", "VON_MISES_STRESS")),
    ({"values": [1, 2, 3]}, r"values must have shape \(20,\), .*, or \(4,\), .*; got \(3,\)"),
    ({"values": "sxx", "unit": "ksi"}, r"'sxx' is shown in Pa, .*; for another give an array in 'ksi'"),
    ({"view": "top"}, "view must be one of iso, x-, x.*got 'top'"),
    ({"view": (0, 0, 0)}, "a view is one of iso"),
    ({"view": (1, 2, 3, 4)}, "a view is one of iso"),
    ({"view": (0, 100)}, "the elevation of a view lies from -90 to 90 degrees"),
    *(({"clim": clim}, "clim") for clim in ((2, 1), (1, 1), (1,), (0, np.nan))),
    ({"scale": "big"}, "scale must be made of real numbers"),
    *(({"zoom": zoom}, "zoom, a factor, a part or a box") for zoom in (0, -1, (1, 2))),
    ({"zoom": "hole"}, "hole"),
    ({"zoom": ((9, 9, 9), (10, 10, 10))}, r"beside the body, which spans \(0, 0, 0\) … \(4, 1, 1\) m"),
    ({"clip": ("x", -1.0)}, r"clip leaves nothing .* at -1 m, the body spans 0 … 4 m"),
    ({"clip": "x"}, "clip is a plane, such as"),
    ({"clip": ("w", 1)}, "clip: an axis is x, y or z; got 'w'"),
    ({"clip": ((0, 0, 0), 1)}, "the normal of clip must not be zero"),
    ({"clip": ("x", "left")}, "the offset of clip"),
    ({"points": [[0, 0, 0]]}, "points belongs to an element"),
    ({"states": []}, "states belong to a body"),
    *(({"size": size}, "size") for size in A_SIZE),
]


@pytest.mark.parametrize(("options", "message"), REFUSED)
def test_wrong_options_are_refused(result, options, message):
    with pytest.raises((kl.InputError, kl.MeshError), match=message):
        result.plot(**options)


@pytest.mark.parametrize("size", A_SIZE)
def test_a_size_that_is_none_is_refused_by_films_and_curves(result, size, tmp_path):
    with pytest.raises(kl.InputError, match="size"):
        kl.animate(tmp_path / "a.gif", result, size=size)
    with pytest.raises(kl.InputError, match="size"):
        result.along((0, 0, 0), (1, 0, 0)).plot(size=size)


@pytest.mark.parametrize(
    ("thing", "options", "message"),
    [
        *(
            (thing, {}, "a mesh, a model, .* can be drawn; got")
            for thing in (3, "a.png", None, object(), [1, 2])
        ),
        (int, {}, "the class of an element or a shape can be drawn"),
        (kl.box(), {"values": "sxx"}, "a mesh or a model has no field 'sxx'"),
        (kl.KinematicLinear3D8N, {"clip": ("x", 0)}, "clip does not belong to the picture of an element"),
    ],
)
def test_what_cannot_be_drawn_is_refused(thing, options, message):
    with pytest.raises(kl.InputError, match=message):
        kl.plot(thing, **options)


def test_nothing_is_written_where_the_picture_fails(result, tmp_path):
    with pytest.raises(kl.InputError):
        result.plot(tmp_path / "a.png", "nonsense")
    with pytest.raises(kl.InputError, match=r"no folder .*missing"):
        result.plot(tmp_path / "missing" / "a.png")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("top", [30.0, 4e3, 2e6])
def test_numbers_of_a_logarithmic_axis_are_apart(top):
    x = np.geomspace(1.0, top, 9)
    figure = response_figure(x, 1 / x, "m", "amplitude of uz")
    figure.canvas.draw()
    axes = figure.axes[0]
    boxes = [t.get_window_extent() for t in axes.get_xticklabels() if t.get_text()]
    inside = [box for box in boxes if axes.bbox.x0 <= box.x0 and box.x1 <= axes.bbox.x1]
    assert len(inside) >= 2
    assert not any(a.overlaps(b) for a, b in itertools.pairwise(inside))


def test_a_notebook_shows_the_figure_once_with_and_without_pyplot():
    interactive = pytest.importorskip("IPython.core.interactiveshell")
    code = """
from IPython.core.interactiveshell import InteractiveShell
from IPython.core.pylabtools import select_figure_formats
import kratos_lite as kl
shell = InteractiveShell.instance()
for inline in (False, True):
    if inline:  # as %matplotlib inline does
        select_figure_formats(shell, {"png"})
        import matplotlib.pyplot
    shown, _ = shell.display_formatter.format(kl.plot(kl.box(), size=(2, 2)))
    print([kind for kind in shown if kind.startswith("image/")])
import matplotlib.pyplot as plt
print(plt.get_fignums())
"""
    assert interactive is not None
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["['image/png']", "['image/png']", "[]"]


def test_a_window_has_an_area_whatever_lies_in_it():
    low, high = window_of(np.array([[1.0, 2.0], [1.0, 5.0]]))
    assert ((high - low) > 0).all()


def test_a_window_on_a_gap_between_faces_is_empty(result):
    window = (np.array([90.0, 90.0]), np.array([91.0, 91.0]))
    found = facets_of(
        result.mesh, result.mesh.points, None, rows_of("iso", result.mesh.points), None, 100, window
    )
    assert len(found.corners) == 0


@pytest.mark.parametrize("place", [0.0, 1.0, 1e8])
def test_a_mesh_collapsed_to_a_point_is_drawn(place):
    mesh = kl.Mesh(np.full((8, 3), place), {"KinematicLinear3D8N": [list(range(8))]})
    assert np.isfinite(kl.plot(mesh).get_size_inches()).all()


def test_ties_are_marked_and_listed_with_all_that_acts_and_its_units():
    pair = {"a": kl.box((1, 1, 1), (1, 1, 1)), "b": kl.box((1, 1, 1), (2, 2, 2), origin=(1, 0, 0))}
    model = kl.Model(kl.join(pair), STEEL)
    plain = len(model.plot().axes[0].lines)
    model.tie("a.x+", "b.x-")
    model.symmetry("a.x-")
    model.add(kl.Pressure("b.x+", 2.0), amplitude=lambda t: t)
    model.add(kl.ElasticSupport("b.z-", 7.0))
    point = model.rigid("b.y+", (1.5, 2, 0.5))
    model.add_mass(point, 3.0, inertia=np.eye(3))
    figure, table = model.plot(), str(model)
    assert len(figure.axes[0].lines) > plain
    said = [t.get_text() for t in figure.axes[-1].get_legend().get_texts()]
    assert "tie a.x+ to b.x-: 9 nodes depend on the others" in said
    for row in ("a.x-, x = 0 m", "stiffness=7.0) [N/m³]", "[kg] [kg m²]", "amplitude=<lambda>) [Pa]"):
        assert row in table

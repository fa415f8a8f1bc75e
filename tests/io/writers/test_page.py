"""Pages for the browser: what they hold, and in test_page_in_browser what they do."""

import base64
import json
import re
import struct
import zlib

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, SolveError
from kratos_lite.io.writers.page.content import TETRAHEDRA, lattice_of_cell, lattice_of_face
from kratos_lite.shapes import LINEAR, SHAPES
from kratos_lite.view.facets import sharp_edges

CELLS = [
    *("Tetrahedron4", "Tetrahedron10", "Hexahedron8", "Hexahedron20", "Hexahedron27"),
    *("Wedge6", "Wedge15", "Pyramid5", "Pyramid13"),
]
FACES = ["Triangle3", "Triangle6", "Quadrilateral4", "Quadrilateral8", "Quadrilateral9"]
VOLUME = {"tetrahedron": 1 / 6, "hexahedron": 8.0, "wedge": 1.0, "pyramid": 4 / 3}


@pytest.fixture
def result():
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1e5)))
    return model.solve()


def content_of(path):
    """What the page's script unpacks, in plain NumPy."""
    text = re.search(r'id="data">([^<]*)<', path.read_text(encoding="utf-8"))[1]
    raw = zlib.decompress(base64.b64decode(text))
    (size,) = struct.unpack("<I", raw[:4])
    return unpacked(json.loads(raw[4 : 4 + size]), raw[4 + size :])


def unpacked(value, raw):
    if isinstance(value, list):
        return [unpacked(item, raw) for item in value]
    if not isinstance(value, dict):
        return value
    if value.get("type") not in ("f4", "i8", "i4", "i2"):
        return {name: unpacked(item, raw) for name, item in value.items()}
    kind = np.dtype("<" + value["type"])
    part = raw[value["start"] : value["start"] + value["count"] * kind.itemsize]
    sorted_ = np.frombuffer(part, np.uint8).reshape(kind.itemsize, -1)
    array = np.ascontiguousarray(sorted_.T).view(kind).reshape(-1, value["width"])
    if kind.kind == "i":
        array = np.cumsum(array, axis=0, dtype=kind)
    return array * value["step"] if "step" in value else array


def test_a_page_has_the_units_of_the_mesh(tmp_path):
    model = kl.Model(kl.box((200, 100, 50)), kl.Isotropic3D(E=210e3, nu=0.3), units="mm kN GPa kg ms")
    model.fix("x-")
    kl.write(tmp_path / "part.html", model.solve())
    head = content_of(tmp_path / "part.html")
    assert dict(head["about"])["size"] == "200 × 100 × 50 mm"
    assert not head["prefixed"]
    assert {"mm", "kN", "GPa"} <= {field["unit"] for field in head["fields"]}
    kl.write_modes(tmp_path / "modes.html", model.mesh, [2 * np.pi], np.ones((1, 8, 3)))
    assert content_of(tmp_path / "modes.html")["frames"][0]["name"] == "1: 1 kHz"


@pytest.mark.parametrize("name", CELLS)
def test_tetrahedra_fill_a_cell(name):
    shape = SHAPES[name]
    lattice = lattice_of_cell(shape)
    places = np.array(lattice["N"]) @ shape.nodes
    corners = np.array([places[four] for four, _ in lattice["tetrahedra"]])
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    assert volumes.min() > 1e-3
    assert abs(volumes.sum() - VOLUME[shape.cell]) < 1e-12


@pytest.mark.parametrize("name", CELLS)
def test_outer_faces_of_tetrahedra_cover_the_faces_of_their_cell(name):
    shape = SHAPES[name]
    lattice = lattice_of_cell(shape)
    places = np.array(lattice["N"]) @ shape.nodes
    area = sum(
        triangle_area(places[[corner for j, corner in enumerate(four) if j != i]])
        for four, outer in lattice["tetrahedra"]
        for i in range(4)
        if outer[i]
    )
    wanted = 0.0
    for face in LINEAR[shape.cell].faces:
        X = LINEAR[shape.cell].nodes[list(face)]
        wanted += triangle_area(X[[0, 1, 2]]) + (triangle_area(X[[0, 2, 3]]) if len(face) == 4 else 0)
    assert abs(area - wanted) < 1e-12


def triangle_area(X):
    return np.linalg.norm(np.cross(X[1] - X[0], X[2] - X[0])) / 2


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize("name", FACES)
def test_triangles_and_edges_cover_a_face(name, n):
    shape = SHAPES[name]
    lattice = lattice_of_face(shape, n)
    places = np.array(lattice["N"]) @ shape.nodes
    corners = places[lattice["triangles"]]
    one, other = (corners[:, i] - corners[:, 0] for i in (1, 2))
    areas = (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2
    assert areas.min() > 0
    assert abs(areas.sum() - (0.5 if shape.cell == "triangle" else 4.0)) < 1e-12
    ends = places[lattice["edges"]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    assert abs(length - (2 + np.sqrt(2) if shape.cell == "triangle" else 8.0)) < 1e-12


def test_tetrahedra_are_known_for_every_cell_with_a_volume():
    assert set(TETRAHEDRA) == set(VOLUME)


def test_sharp_edges_of_a_box_are_its_twelve():
    mesh = kl.box((3, 2, 1), (3, 2, 1))
    ends = mesh.points[sharp_edges(mesh)]
    assert abs(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() - 4 * (3 + 2 + 1)) < 1e-12


def test_a_page_holds_mesh_and_fields(result, tmp_path):
    kl.write(tmp_path / "a.html", result)
    content = content_of(tmp_path / "a.html")
    mesh = result.mesh
    assert abs(content["points"] + content["center"] - mesh.points).max() < 1e-6
    assert content["node_ids"].ravel().tolist() == mesh.node_ids.tolist()
    assert content["element_ids"].ravel().tolist() == mesh.element_ids.tolist()
    assert content["cells"][0]["nodes"].tolist() == mesh.blocks[0].nodes.tolist()
    assert content["faces"][0]["element"].ravel().tolist() == mesh.boundary[0].ids.tolist()
    u, reaction, stress, density, error = content["frames"][0]["values"]
    for found, wanted in (
        (u, result.u),
        (stress, result.stress("node")),
        (reaction, result.reaction()),
        (density[:, 0], result.field("strain_energy_density", "node")),
        (error[:, 0], result.error().per_element),
    ):
        assert abs(found - wanted).max() <= 1e-7 * abs(wanted).max()


def test_a_large_page_holds_the_surface_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("kratos_lite.io.writers.page.content.MOST_CELLS", 26)
    mesh = kl.box((3, 3, 3), (3, 3, 3))
    kl.write_modes(tmp_path / "a.html", mesh, [1.0], np.ones((1, 64, 3)))
    content = content_of(tmp_path / "a.html")
    inside = (abs(mesh.points - 1.5) < 1).all(axis=1)
    assert content["cells"] == []
    assert content["node_ids"].ravel().tolist() == mesh.node_ids[~inside].tolist()
    assert abs(content["points"] + content["center"] - mesh.points[~inside]).max() < 1e-6
    faces = mesh.node_ids[mesh.boundary[0].nodes]
    assert content["node_ids"].ravel()[content["faces"][0]["nodes"]].tolist() == faces.tolist()
    ends = content["points"][content["outline"]]
    assert abs(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() - 36) < 1e-5


def test_factors_of_buckling_are_no_frequencies(tmp_path):
    kl.write_modes(tmp_path / "a.html", kl.box(), [1.5, 2.5], np.ones((2, 8, 3)), buckling=True)
    names = [frame["name"] for frame in content_of(tmp_path / "a.html")["frames"]]
    assert names == ["1: factor 1.5", "2: factor 2.5"]


def test_large_ids_keep_their_digits(tmp_path):
    box = kl.box()
    ids = box.node_ids + 2**62
    mesh = kl.Mesh(box.points, box.blocks, node_ids=ids)
    kl.write_modes(tmp_path / "a.html", mesh, [1.0], np.ones((1, 8, 3)))
    assert content_of(tmp_path / "a.html")["node_ids"].ravel().tolist() == ids.tolist()


def test_numbers_beyond_single_precision_are_refused(result, tmp_path):
    stiff = kl.Model(kl.box(), kl.Isotropic3D(E=1e45, nu=0.3))
    stiff.fix("x-")
    stiff.fix("x+", value=(1e-3, 0, 0))
    with pytest.raises(
        SolveError, match=r"not written: reaction reaches \S+ and a page holds numbers up to 1e\+38"
    ):
        kl.write(tmp_path / "a.html", stiff.solve())
    assert not list(tmp_path.iterdir())


def test_a_mesh_without_solids_is_refused(tmp_path):
    mesh = kl.Mesh(np.eye(3), [kl.Block("Unknown3N", [[0, 1, 2]])])
    with pytest.raises(InputError, match="nothing to show: the mesh has no element of a known shape"):
        kl.write_modes(tmp_path / "a.html", mesh, [1.0], np.ones((1, 3, 3)))


def test_of_very_many_states_some_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("kratos_lite.io.writers.page.write.MOST_FRAMES", 4)
    body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    with kl.SeriesWriter(tmp_path / "a.html", body) as series:
        for state in kl.integrate(body, dt=0.01, steps=10):
            series.add(state)
    content = content_of(tmp_path / "a.html")
    assert [frame["name"] for frame in content["frames"]] == [f"t = {t} s" for t in (0.01, 0.04, 0.07, 0.1)]
    assert ["states", "4 of 10"] in content["about"]


def test_a_page_asks_nothing_of_a_network(result, tmp_path):
    kl.write(tmp_path / "a.html", result)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    assert not re.findall(r"<(?:script|img|iframe)[^>]* src|<link|@import|url\(", text)
    assert len(text) < 1e6


def test_a_series_becomes_a_page_of_its_states(tmp_path):
    body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    body.set_velocity(linear=(1, 0, 0), angular=(0, 0, 1))
    moved = []
    with kl.SeriesWriter(tmp_path / "new" / "spin.html", body) as series:
        for state in kl.integrate(body, dt=0.01, steps=20, every=10):
            series.add(state)
            moved.append(body.position(body.mesh.points, state.q) - body.mesh.points)
    content = content_of(tmp_path / "new" / "spin.html")
    assert [frame["name"] for frame in content["frames"]] == ["t = 0.1 s", "t = 0.2 s"]
    assert content["scale"] == 1
    for frame, wanted in zip(content["frames"], moved, strict=True):
        assert abs(frame["values"][0] - wanted).max() <= 2e-5 * abs(wanted).max()


def test_a_title_is_no_markup(result, tmp_path):
    kl.write(tmp_path / "a<b>&amp{data}.html", result)
    text = (tmp_path / "a<b>&amp{data}.html").read_text(encoding="utf-8")
    assert "<title>a&lt;b&gt;&amp;amp{data}</title>" in text


def test_modes_keep_their_shapes_and_have_names(tmp_path):
    mesh, shapes = kl.box(), np.random.default_rng(2).normal(size=(2, 8, 3))
    kl.write_modes(tmp_path / "m.html", mesh, [2 * np.pi, 20 * np.pi], shapes)
    content = content_of(tmp_path / "m.html")
    assert [frame["name"] for frame in content["frames"]] == ["1: 1 Hz", "2: 10 Hz"]
    for frame, shape in zip(content["frames"], shapes, strict=True):
        assert abs(frame["values"][0] - shape / np.linalg.norm(shape, axis=1).max()).max() < 2e-5


def test_modes_of_another_mesh_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"must have shape \(k, 8, 3\); got \(1, 7, 3\)"):
        kl.write_modes(tmp_path / "m.html", kl.box(), [1.0], np.zeros((1, 7, 3)))
    with pytest.raises(InputError, match=r"must be finite"):
        kl.write_modes(tmp_path / "m.html", kl.box(), [1.0], np.full((1, 8, 3), np.nan))
    with pytest.raises(InputError, match=r"modes are written as .pvd"):
        kl.write_modes(tmp_path / "m.txt", kl.box(), [1.0], np.zeros((1, 8, 3)))
    assert not list(tmp_path.iterdir())


def test_only_vtu_files_have_a_mode(result, tmp_path):
    with pytest.raises(InputError, match=r"only .vtu files are written as ascii"):
        kl.write(tmp_path / "a.html", result, mode="ascii")

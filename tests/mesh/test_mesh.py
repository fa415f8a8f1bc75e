"""Mesh: choosing nodes and elements, faces, orientation."""

import copy
import pickle

import numpy as np
import pytest
from meshes import NAMES

import kratos_lite as kl
from kratos_lite.elements.surface import area_vectors

UNIT = kl.Isotropic3D(E=1.0, nu=0.3)


def test_values_meet_their_nodes():
    model = kl.Model(kl.box(cells=(2, 1, 1)), UNIT)
    model.fix([7, 5], "z", [[1.0], [2.0]])
    assert model.supports.values[[7, 5], 2].tolist() == [1.0, 2.0]


def test_sides_are_measured_along_their_own_axis():
    mesh = kl.box((1, 1, 1e-7)).replace(parts={})
    assert len(mesh.nodes("z-")) == len(mesh.nodes("z+")) == 4
    assert not set(mesh.nodes("z-")) & set(mesh.nodes("z+"))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("abc",), "real numbers"),
        (([[0, 0]],), r"shape \(n, 3\)"),
        ((np.diag([0, np.nan, 0]),), "points must be finite"),
        (([[0, 0, 0]], [], {"node_ids": ["a"]}), "whole numbers"),
        (([[0, 0, 0], [1, 0, 0]], [], {"node_ids": [4, 4]}), "node id 4 occurs more than once"),
        (([[0, 0, 0]], [], {"parts": {"A": kl.Part(nodes=np.array([1]))}}), "'A': indices of nodes"),
        (([[0, 0, 0]], [], {"parts": {"A": kl.Part(nodes=np.array([-1]))}}), "'A': indices of nodes"),
    ],
)
def test_wrong_arguments_are_mesh_errors(arguments, text):
    points, blocks, more = (*arguments, [], {})[:3] if len(arguments) < 3 else arguments
    with pytest.raises(kl.MeshError, match=text):
        kl.Mesh(points, blocks, **more)


@pytest.mark.parametrize("element", NAMES)
def test_inverted_elements_are_reoriented(element):
    mesh = kl.box((1.0, 2.0, 3.0), (2, 1, 1), element)
    broken = kl.Mesh(mesh.points * [-1, 1, 1], mesh.blocks)
    model = kl.Model(broken, UNIT)
    with pytest.raises(kl.MeshError, match="inverted"):
        model.check_geometry()
    mended = broken.reoriented()
    assert kl.Model(mended, UNIT).check_geometry() == []
    kind = kl.ELEMENTS[element]
    volume = kind(mended.points[mended.blocks[0].nodes]).volume().sum()
    assert abs(volume - 6) < 1e-12


@pytest.mark.parametrize("element", NAMES)
def test_boundary_of_a_box_has_its_area_outward(element):
    mesh = kl.box((1.0, 2.0, 3.0), (2, 2, 2), element)
    area = [area_vectors(block.shape, mesh.points[block.nodes]) for block in mesh.boundary]
    assert abs(sum(np.linalg.norm(a, axis=-1).sum() for a in area) - 22) < 1e-12
    assert np.abs(sum(a.sum(axis=(0, 1)) for a in area)).max() < 1e-12
    for block, vectors in zip(mesh.boundary, area, strict=True):
        outward = mesh.points[block.nodes].mean(axis=1) - [0.5, 1.0, 1.5]
        assert ((vectors.sum(axis=1) * outward).sum(axis=1) > 0).all()


def test_parts_are_given_by_places_and_written_by_their_names(tmp_path):
    mesh = kl.box(cells=(2, 1, 1))
    mesh.add_part("middle", lambda X: X[:, 0] == 0.5)
    mesh.add_part("again", "middle")
    assert mesh.nodes("again").tolist() == mesh.nodes("middle").tolist()
    assert mesh.points[mesh.nodes("middle"), 0].tolist() == [0.5] * 4
    kl.write(tmp_path / "box.mdpa", mesh)
    written = kl.read(tmp_path / "box.mdpa").mesh
    assert {"middle", "again", "x_plus", "z_minus"} <= set(written.parts)
    assert "x+" in mesh.parts
    for name, where, words in (
        ("", "x-", "a part needs a name"),
        ("none", lambda X: X[:, 0] > 9, "no node is chosen for part 'none'"),
    ):
        with pytest.raises(kl.MeshError, match=words):
            mesh.add_part(name, where)
    with pytest.raises(kl.MeshError, match="a part is known by its name"):
        mesh.part(3)


def test_a_part_stays_what_it_is():
    mesh = kl.box(cells=(2, 1, 1))
    mesh.add_part("tip", "x+")
    mesh.add_part("tip", lambda X: X[:, 0] > 0.9)  # the same again, as a cell that is run twice
    with pytest.raises(kl.MeshError, match="there is a part 'tip' with other nodes already"):
        mesh.add_part("tip", "x-")
    assert mesh.nodes("tip").tolist() == mesh.nodes("x+").tolist()


@pytest.mark.parametrize("cells", [[[0, 1, 2, 3]], np.arange(8)[None], [[0, 1, 2, 3], [1, 2]], 3])
def test_rows_of_nodes_without_a_name_are_refused_with_the_call_that_is_meant(cells):
    with pytest.raises(kl.MeshError, match=r"kl\.Mesh\(points, \{'KinematicLinear3D8N': nodes\}\)"):
        kl.Mesh(kl.box().points, cells)


@pytest.mark.parametrize("word", ["20N", "3D20N", "3d20n"])
def test_a_number_of_nodes_names_the_element_that_does_not_lock(word):
    for mesh in (kl.box(element=word), kl.annulus(1, 2, 1, element=word)):
        assert [block.name for block in mesh.blocks] == ["Element3D20N"]


def test_unknown_elements_are_answered_with_all_names_or_the_nearest():
    with pytest.raises(kl.InputError, match=r"unknown element 'Hex8'\. There are .*KinematicLinear3D8N, "):
        kl.box(element="Hex8")
    with pytest.raises(kl.InputError, match="Did you mean Element3D8N"):
        kl.box(element="9N")


DUPLICATES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    **{f"pickle {k}": lambda x, k=k: pickle.loads(pickle.dumps(x, k)) for k in (2, pickle.HIGHEST_PROTOCOL)},
}


@pytest.mark.parametrize("duplicate", DUPLICATES.values(), ids=DUPLICATES)
def test_copies_of_meshes_are_read_only_with_parts_of_their_own(duplicate):
    mesh = kl.Mesh(
        kl.box(cells=(2, 1, 1)).points,
        [kl.Block("KinematicLinear3D8N", kl.box(cells=(2, 1, 1)).blocks[0].nodes, [7, 4], [1, 2])],
        node_ids=np.arange(12)[::-1] + 3,
        parts={"rim": kl.Part(nodes=[1, 2], data={"TIME": 2.0})},
        source="rim.mdpa",
    )
    mesh.boundary  # what is computed once does not come along writable  # noqa: B018
    other = duplicate(mesh)
    block, part = other.blocks[0], other.parts["rim"]
    assert (other.points == mesh.points).all()
    assert (other.node_ids == mesh.node_ids).all()
    assert (block.nodes == mesh.blocks[0].nodes).all()
    assert (block.ids.tolist(), block.properties.tolist()) == ([7, 4], [1, 2])
    assert (part.nodes.tolist(), part.data, other.source) == ([1, 2], {"TIME": 2.0}, "rim.mdpa")
    single = [array for x in (block, part) for array in vars(duplicate(x)).values()]
    for array in (other.points, other.node_ids, *vars(block).values(), *vars(part).values(), *single):
        assert not isinstance(array, np.ndarray) or not array.flags.writeable
    other.add_part("top", "z+")
    assert "top" not in mesh.parts


def test_nothing_of_a_mesh_is_deleted():
    mesh = kl.box()
    with pytest.raises(kl.MeshError, match=r"a mesh does not change.*replace\(points="):
        del mesh.points
    assert mesh.n_nodes == 8


def test_a_read_only_view_of_memory_that_changes_is_copied():
    memory = np.array([[0, 1, 2, 3]], dtype=np.int32)
    ids = np.array([5, 6, 7, 8])
    views = memory[:], ids[:]
    for view in views:
        view.flags.writeable = False
    mesh = kl.Mesh(np.eye(4, 3), {"KinematicLinear3D4N": views[0]}, node_ids=views[1])
    memory[:], ids[:] = 3, 9
    assert mesh.blocks[0].nodes.tolist() == [[0, 1, 2, 3]]
    assert mesh.node_ids.tolist() == [5, 6, 7, 8]


def test_a_block_without_cells_is_an_empty_list_too():
    for nodes in ([], np.zeros((0, 8), dtype=int)):
        mesh = kl.Mesh([[0, 0, 0]], {"KinematicLinear3D8N": nodes})
        assert (mesh.n_elements, mesh.blocks[0].nodes.shape) == (0, (0, 8))


# ---- nodes at a point, and triples that may be a point or rows ------------------------------------------

MESH = kl.box((2, 1, 1), cells=(2, 1, 1))
POINT = (1.0, 1.0, 0.0)


@pytest.mark.parametrize("where", [POINT, list(POINT), np.array(POINT), (1, 1, 0.0), tuple(np.array(POINT))])
def test_three_coordinates_choose_the_node_there(where):
    (row,) = MESH.nodes(where)
    assert MESH.points[row].tolist() == list(POINT)
    assert MESH.nodes(np.array(where) + 1e-7).tolist() == [row]


def test_all_nodes_at_a_place_are_chosen():
    twice = kl.Mesh(np.vstack([MESH.points, MESH.points]), {})
    assert twice.nodes(POINT).tolist() == [row + at for at in (0, 12) for row in MESH.nodes(POINT)]


@pytest.mark.parametrize("where", [(0, 1, 2), [0, 1, 2], (1, 1, 1)])
def test_three_whole_numbers_are_refused_with_both_readings(where):
    model, words = kl.Model(MESH, UNIT), r"point or three node indices: write \(.\.0, 1\.0, .*np\.array\(\["
    part, load = (lambda w: MESH.replace().add_part("a", w)), (lambda w: kl.PointLoad(w, POINT))
    for call in (MESH.nodes, model.fix, part, load):
        with pytest.raises(kl.MeshError, match=words):
            call(where)


@pytest.mark.parametrize(
    ("where", "rows"),
    [
        *((three, [0, 1, 2]) for three in (np.arange(3), range(3), [*np.arange(3)], [np.int32(0), 1, 2])),
        ([4, 1], [4, 1]),
        ([7, 5, 7, 5], [7, 5]),
        (np.arange(12) % 5 == 0, [0, 5, 10]),
    ],
)
def test_indices_and_masks_choose_nodes_in_their_order(where, rows):
    assert MESH.nodes(where).tolist() == rows


def test_a_place_without_a_node_is_an_error_that_names_the_nearest():
    match = (
        r"no node at \[0\.9, 1\.0, 0\.0\] m; the nearest node is that at \[1\.0, 1\.0, 0\.0\] m .*0\.1 m away"
    )
    with pytest.raises(kl.MeshError, match=match):
        MESH.nodes((0.9, 1.0, 0.0))
    with pytest.raises(kl.MeshError, match="must be finite"):
        MESH.nodes((0.9, np.nan, 0.0))
    with pytest.raises(kl.MeshError, match="there are no nodes"):
        kl.Mesh(np.zeros((0, 3)), {}).nodes(POINT)


def test_a_support_and_a_displacement_at_a_point():
    model = kl.Model(MESH, UNIT)
    model.fix("x-")
    model.fix((2.0, 0.0, 0.0), "z", 1e-3)
    assert model.solve().displacement((2.0, 0.0, 0.0))[0, 2] == 1e-3


def test_a_point_on_a_thin_plate_does_not_choose_its_other_side():
    plate = kl.box((1e3, 1e3, 1e-3), cells=(2, 2, 2))
    for row, point in enumerate(plate.points):
        assert plate.nodes(tuple(map(float, point))).tolist() == [row]
    assert len(plate.nodes((500.0, 500.0, 2.5e-4))) == 1

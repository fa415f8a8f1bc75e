"""Sets of nodes that occur more than once, and what hangs together: compiled and NumPy alike."""

import numpy as np
import pytest
from computing import EITHER, compiled, same_on_all_threads
from meshes import NAMES, named

import kratos_lite as kl
from kratos_lite.mesh import Faces, components, equal_sets, topology
from kratos_lite.native import kernels


@pytest.fixture(params=EITHER)
def way(request, monkeypatch):
    if request.param == "numpy":
        monkeypatch.setattr(topology, "kernels", lambda name: None)
    return request.param


def smallest_members(n, pairs):
    """Return the labels of `components` by walking from each member in turn."""
    around = {i: set() for i in range(n)}
    for a, b in pairs.tolist():
        around[a].add(b)
        around[b].add(a)
    label = [-1] * n
    for start in range(n):
        waiting = [start] if label[start] < 0 else []
        while waiting:
            i = waiting.pop()
            if label[i] < 0:
                label[i] = start
                waiting += around[i]
    return label


@pytest.mark.parametrize(("n", "m"), [(1, 0), (5, 0), (40, 15), (200, 150), (300, 600)])
def test_components_have_the_names_of_their_smallest_members(way, n, m):
    rng = np.random.default_rng(n + m)
    pairs = rng.integers(0, n, (m, 2))
    assert components(n, pairs).tolist() == smallest_members(n, pairs)


def test_equal_sets_are_paired_with_the_next_one_across_groups(way):
    quads = np.array([[4, 7, 1, 2], [9, 9, 8, 3]], dtype=np.int32)
    triangles = np.array([[7, 1, 4], [3, 9, 8], [4, 1, 7]])
    one, other = equal_sets([(quads, [(0, 1, 2), (1, 2, 3), (0, 1, 2, 3)]), (triangles, [(2, 1, 0)])])
    assert one.tolist() == [0, 3, 6]
    assert other.tolist() == [6, 7, 8]
    one, other = equal_sets([])
    assert one.tolist() == other.tolist() == []


def test_faces_of_mixed_cells(way):
    """A brick with a wedge on its side and a pyramid on top of it."""
    cells = {8: range(8), 6: (1, 8, 2, 5, 9, 6), 5: (4, 5, 6, 7, 10)}
    blocks = [kl.Block(named(n), [nodes]) for n, nodes in cells.items()]
    faces = Faces(blocks)
    pairs = {
        tuple(sorted(faces.element[[a, b]].tolist())) for a, b in zip(faces.one, faces.other, strict=True)
    }
    assert pairs == {(0, 1), (0, 2)}
    assert sorted((block.name, len(block)) for block in faces.boundary) == [
        ("Quadrilateral4", 4 + 2),
        ("Triangle3", 2 + 4),
    ]
    assert [len(rows) for rows in faces.non_conforming()] == [0, 0]


@pytest.mark.parametrize("element", NAMES)
def test_both_ways_find_the_same_faces(element, monkeypatch):
    mesh = kl.box(cells=(3, 2, 2), element=element)
    rng = np.random.default_rng(7)
    renumbered = rng.permutation(mesh.n_nodes).astype(np.int32)
    block = mesh.blocks[0]
    kept = kl.Block(block.name, renumbered[block.nodes], block.ids, block.properties, block.shape)
    first = Faces([kept])
    monkeypatch.setattr(topology, "kernels", lambda name: None)
    second = Faces([kept])
    assert len(first.one) > 0
    np.testing.assert_array_equal(first.one, second.one)
    np.testing.assert_array_equal(first.other, second.other)


@compiled
def test_results_do_not_depend_on_the_number_of_threads():
    blocks = kl.box(cells=(22, 22, 22)).blocks

    def compute():
        faces = Faces(blocks)
        return faces.one, faces.other

    same_on_all_threads(compute)


@compiled
def test_wrong_arrays_are_refused():
    module = kernels("mesh")
    nodes = np.zeros((2, 4), dtype=np.int32)
    with pytest.raises(ValueError, match="picks must be columns of the nodes"):
        module.equal_sets([nodes], [np.array([[4]], dtype=np.int32)])
    with pytest.raises(ValueError, match="must come in pairs"):
        module.equal_sets([nodes], [])
    with pytest.raises(ValueError, match="must name members"):
        module.components(3, np.array([[0, 3]]))
    with pytest.raises(ValueError, match=r"pairs must be \(p, 2\)"):
        module.components(3, np.array([[0, 1, 2]]))

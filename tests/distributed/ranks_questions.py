"""Questions to a mesh that ranks share have the answers of the whole mesh."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed.subdomains import scattered
from kratos_lite.errors import MeshError, ModelError
from kratos_lite.mesh.order import raised
from kratos_lite.mesh.refinement import refine


def whole_mesh(element="Element3D8N"):
    mesh = kl.box((2, 1, 1), cells=(4, 3, 2), element=element, origin=(-1.0, 2.0, 0.0))
    bent = mesh.points + 0.05 * np.sin(3 * mesh.points[:, [1, 2, 0]])
    left = np.flatnonzero(mesh.points[mesh.blocks[0].nodes].mean(axis=1)[:, 0] < 0)
    faces = next(iter(mesh.boundary))
    conditions = [kl.Block("SurfaceLoadCondition3D4N", faces.nodes, None, 1, faces.shape)]
    chosen = np.flatnonzero((mesh.points[faces.nodes][:, :, 2] > 0.9).all(axis=1))
    parts = {
        "left": kl.Part(elements=left),
        "loaded": kl.Part(conditions=chosen),
        "tip": kl.Part(nodes=[59, 0]),
    }
    return mesh.replace(points=bent, conditions=conditions, parts=parts)


def by_ids(ranks, ids):
    return np.unique(np.concatenate(ranks.gather(ids)))


def cut(ranks, whole, seed=3):
    return scattered(whole, ranks, np.random.default_rng(seed).integers(ranks.size, size=whole.n_elements))


def ends(ranks, whole):
    """Elements in order of x, so that a rank knows nothing of the other end."""
    x = whole.points[whole.blocks[0].nodes].mean(axis=1)[:, 0]
    return scattered(whole, ranks, np.argsort(np.argsort(x)) * ranks.size // len(x))


def test_summary_extent_and_sides(ranks, share):
    whole = whole_mesh()
    mesh = share(ranks, whole)
    assert str(mesh) == str(whole)
    assert np.array_equal(mesh.extent, [whole.points.min(axis=0), whole.points.max(axis=0)])
    assert mesh.totals.counts == {"nodes": 60, "elements": 24, "conditions": len(whole.conditions[0])}
    straight = kl.box(cells=(4, 3, 2))
    mesh = share(ranks, straight.replace(parts={}))
    for side in ("x-", "x+", "y-", "z+"):
        expected = straight.node_ids[straight.nodes(side)]
        assert np.array_equal(by_ids(ranks, mesh.node_ids[mesh.nodes(side)]), expected)


test_summary_extent_and_sides.cases = [cut, ends]


def test_a_rank_alone_may_ask_for_the_summary(ranks):
    mesh = ends(ranks, whole_mesh())
    if ranks.rank == 0:
        assert "60" in str(mesh)
        assert mesh.subdomain.n_all == mesh.totals.counts["nodes"] == 60
        assert mesh.extent.shape == (2, 3)
        assert mesh.nodes("tip").shape <= (2,)


def test_nodes_elements_and_faces_that_some_ranks_do_not_have(ranks):
    whole = whole_mesh()
    mesh = ends(ranks, whole)
    point = tuple(whole.points[7].tolist())
    assert by_ids(ranks, mesh.node_ids[mesh.nodes(point)]).tolist() == [8]
    for where in ("left", 1):
        expected = whole.element_ids[whole.elements(where)]
        assert np.array_equal(by_ids(ranks, mesh.element_ids[mesh.elements(where)]), expected)
    for where in ("loaded", lambda X: X[:, 0] < -0.9):
        expected = {tuple(sorted(whole.node_ids[n])) for b in whole.faces(where) for n in b.nodes}
        mine = [tuple(sorted(mesh.node_ids[n].tolist())) for b in mesh.faces(where) for n in b.nodes]
        assert {one for some in ranks.gather(mine) for one in some} == expected
    mesh.add_part("corner", lambda X: X[:, 0] > 0.9)
    assert dict(mesh.table()[-1:]) == {"part": "corner: 12 nodes"}
    mesh.add_part("corner", lambda X: X[:, 0] > 0.9)
    for where, words in {
        (9.0, 9.0, 9.0): "there is no node at .* the nearest node is that at",
        "nothing": "there is no part",
    }.items():
        with pytest.raises(MeshError, match=words):
            mesh.nodes(where)
    with pytest.raises(MeshError, match=r"no element has property 7; the properties are \[1\]"):
        mesh.elements(7)
    with pytest.raises(MeshError, match="part 'tip' has no elements"):
        mesh.elements("tip")
    with pytest.raises(MeshError, match="no node is chosen"):
        mesh.add_part("none", lambda X: X[:, 0] > 9)
    with pytest.raises(MeshError, match="with other nodes already"):
        mesh.add_part("tip", lambda X: X[:, 0] > 0.9)


def test_points_are_in_the_element_of_the_whole_mesh(ranks, element, share):
    whole = whole_mesh(element) if element == "Element3D8N" else kl.box((2, 1, 1), (4, 3, 2), element)
    mesh = share(ranks, whole)
    low, high = whole.extent
    x = np.random.default_rng(0).uniform(low - 0.1, high + 0.1, (200, 3))
    x = np.vstack([x, whole.points[::3]])  # nodes belong to many elements
    theirs, mine = whole.locate(x), mesh.locate(x)
    ids = np.where(theirs.inside, whole.element_ids[theirs.rows], -1)
    found = np.where(mine.inside, mesh.element_ids[mine.rows], -1)
    assert np.array_equal(ranks.max(found), ids)
    own = mine.inside & mesh.own_elements[mine.rows]
    assert np.array_equal(ranks.sum(own.astype(int)), theirs.inside.astype(int))
    assert np.array_equal(found[mine.inside], ids[mine.inside])
    assert np.isin(ids, mesh.element_ids)[ids >= 0].sum() == mine.inside.sum()  # wherever it is
    assert np.abs(mine.xi[mine.inside] - theirs.xi[mine.inside]).max(initial=0) < 1e-9
    mesh.locate(whole.points[[0, -1]], required=True)
    text = "lies outside the mesh, .* m from element"
    with pytest.raises(MeshError, match=text):
        mesh.locate([[0.5, 0.5, 0.5], [9.0, 2.5, 0.5]], required=True)


test_points_are_in_the_element_of_the_whole_mesh.cases = [
    (element, share) for element in ("Element3D8N", "Element3D10N") for share in (cut, ends)
]


def test_a_load_at_a_point_acts_on_own_nodes_once(ranks, point):
    whole = whole_mesh()
    expected = kl.PointLoad(point, (1.0, 2.0, 3.0)).forces(whole, [])
    mesh = cut(ranks, whole)
    force = kl.PointLoad(point, (1.0, 2.0, 3.0)).forces(mesh, [])
    own = mesh.own_nodes
    assert np.allclose(force[own], expected[whole.node_rows(mesh.node_ids[own])], atol=1e-14)
    with pytest.raises(ModelError, match="finds no node"):
        kl.PointLoad(lambda X: X[:, 0] > 9, (1.0, 2.0, 3.0)).forces(mesh, [])
    with pytest.raises(MeshError, match="outside the mesh; the nearest node is that"):
        kl.PointLoad((9.0, 0.0, 0.0), (1.0, 2.0, 3.0)).forces(mesh, [])


test_a_load_at_a_point_acts_on_own_nodes_once.cases = [
    (tuple(whole_mesh().points[20].tolist()),),
    ((0.1, 2.3, 0.4),),
]


def test_ranks_with_other_blocks_are_refused(ranks):
    name = "Element3D8N" if ranks.rank == 0 else "KinematicLinear3D8N"
    mesh = cut(ranks, kl.box(cells=(3, 1, 1)))
    blocks = [kl.Block(name, mesh.blocks[0].nodes, mesh.blocks[0].ids)]
    if ranks.size == 1:
        assert mesh.replace(blocks=blocks).n_elements == 3
        return
    with pytest.raises(MeshError, match=r"rank 0 has Element3D8N.*, rank 1 KinematicLinear3D8N"):
        mesh.replace(blocks=blocks)


def test_what_needs_the_whole_mesh_is_refused(ranks):
    mesh = cut(ranks, kl.box(cells=(3, 1, 1)))
    for change in (refine, raised):
        if ranks.size == 1:
            assert change(mesh).mesh.n_nodes > mesh.n_nodes
        else:
            with pytest.raises(MeshError, match=f"that {ranks.size} ranks share keeps its elements"):
                change(mesh)


def test_a_comparison_needs_the_whole_mesh(ranks):
    mesh = cut(ranks, kl.box(cells=(3, 1, 1)))
    model = kl.Model(mesh, kl.Isotropic3D(1e6, 0.3))
    model.fix("x-")
    result = model.solve(engine="petsc")
    if ranks.size == 1:
        assert kl.compare(result, result).displacement.maximum == 0
    else:
        with pytest.raises(ModelError, match="a comparison of results needs the whole mesh"):
            kl.compare(result, result)

"""Subdomains of a mesh of which each rank knows a piece by ids."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed.pieces import Kind, Piece
from kratos_lite.distributed.subdomains import scattered, subdomain_mesh
from kratos_lite.errors import MeshError
from kratos_lite.mesh import ids_of


def mixed():
    """Bricks, wedges and tetrahedra with faces, parts and a node of no element; no ids in order."""
    random = np.random.default_rng(5)
    box = kl.box(cells=(4, 3, 3))
    bricks, more = box.blocks[0].nodes[:20], box.blocks[0].nodes[20:]
    wedges = more[:8][:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]].reshape(-1, 6)
    tetrahedra = more[8:][:, [[0, 1, 3, 4], [1, 2, 3, 6]]].reshape(-1, 4)
    cells = {"KinematicLinear3D8N": bricks, "KinematicLinear3D6N": wedges, "KinematicLinear3D4N": tetrahedra}
    ids = np.split(1 + random.permutation(20 + 16 + 16), [20, 36])
    blocks = [kl.Block(n, c, np.sort(i), i % 3) for (n, c), i in zip(cells.items(), ids, strict=True)]
    mesh = kl.Mesh(np.vstack([box.points, [[9.0, 9, 9]]]), blocks)
    faces = next(face for face in mesh.boundary if face.nodes.shape[1] == 4)
    conditions = [
        kl.Block("SurfaceLoadCondition3D4N", faces.nodes, 10 * np.arange(len(faces)), 4, faces.shape)
    ]
    parts = {
        "some": kl.Part(nodes=np.arange(0, 40, 3), elements=np.arange(5, 40), data={"A": 1}),
        "some.faces": kl.Part(conditions=np.arange(3, 25), nodes=[80, 3], properties=(4,)),
        "nothing": kl.Part(),
    }
    node_ids = np.sort(random.permutation(1000)[: mesh.n_nodes])
    return kl.Mesh(mesh.points, blocks, node_ids=node_ids, conditions=conditions, parts=parts)


def quadratic():
    return kl.box(cells=(3, 2, 4), element="KinematicLinear3D20N")


def kinds_of(mesh, blocks):
    """Return blocks by the ids of their nodes."""
    return [
        Kind(b.name, mesh.node_ids[b.nodes], b.ids, b.properties, b.shape, b.lines, place)
        for place, b in enumerate(blocks)
    ]


def part_by_ids(mesh, part):
    conditions = ids_of(mesh.conditions)[part.conditions]
    ids = {"nodes": mesh.node_ids[part.nodes], "elements": mesh.element_ids[part.elements]}
    return kl.Part(**ids, conditions=conditions, properties=part.properties, data=part.data)


def pieces(mesh, ranks, parts, seed=7):
    """Return what a rank is to give: its elements, and any share of all the rest, some of it twice."""
    random = np.random.default_rng(seed)
    elements, conditions = kinds_of(mesh, mesh.blocks), kinds_of(mesh, mesh.conditions)
    ends = np.cumsum([len(kind.ids) for kind in elements])[:-1]

    def mine(size):
        return random.integers(ranks.size, size=size) == ranks.rank

    def take(kind, chosen):
        at = np.random.default_rng(1).permutation(np.flatnonzero(chosen))
        rest = kind.shape, None, kind.place
        return Kind(kind.name, kind.nodes[at], kind.ids[at], kind.properties[at], *rest)

    parts_by_ids = {name: part_by_ids(mesh, part) for name, part in mesh.parts.items()}
    nodes = mine(mesh.n_nodes) | (np.arange(mesh.n_nodes) % 5 == 0)
    shares = {
        name: kl.Part(
            nodes=part.nodes[mine(len(part.nodes)) | (part.nodes % 4 == 0)],
            elements=part.elements[mine(len(part.elements))],
            conditions=part.conditions[mine(len(part.conditions))],
            properties=part.properties,
            data=part.data,
        )
        for name, part in parts_by_ids.items()
        if name != "nothing" or ranks.rank == ranks.size - 1
    }
    own = np.split(parts == ranks.rank, ends)
    return Piece(
        tuple(take(kind, at) for kind, at in zip(elements, own, strict=True)),
        tuple(take(kind, mine(len(kind.ids))) for kind in conditions),
        mesh.node_ids[nodes],
        mesh.points[nodes],
        parts=shares,
    )


def random_ranks(mesh, size):
    return np.random.default_rng(3).integers(size, size=mesh.n_elements)


def all_on_the_last(mesh, size):
    return np.full(mesh.n_elements, size - 1)


def in_order(mesh, size):
    return np.arange(mesh.n_elements) * size // mesh.n_elements


def same(mesh, expected, whole):
    """Compare with the cut of the whole mesh, which is known there; a loose node may be anybody's."""
    used = np.isin(mesh.node_ids, whole.node_ids[whole.used_nodes()])
    theirs = np.isin(expected.node_ids, whole.node_ids[whole.used_nodes()])
    assert np.array_equal(mesh.node_ids[used], expected.node_ids[theirs])
    assert np.array_equal(mesh.points[used], expected.points[theirs])
    assert np.array_equal(mesh.subdomain.owner[used], expected.subdomain.owner[theirs])
    assert np.array_equal(mesh.own_elements, expected.own_elements)
    for one, other in ((mesh.blocks, expected.blocks), (mesh.conditions, expected.conditions)):
        assert [block.name for block in one] == [block.name for block in other]
        for a, b in zip(one, other, strict=True):
            assert np.array_equal(a.ids, b.ids)
            assert np.array_equal(a.properties, b.properties)
            assert a.shape is b.shape
            assert np.array_equal(mesh.node_ids[a.nodes], expected.node_ids[b.nodes])
    assert np.array_equal(mesh.own_conditions, expected.own_conditions)
    assert sorted(mesh.parts) == sorted(expected.parts)
    for name, part in mesh.parts.items():
        other = expected.parts[name]
        assert np.array_equal(
            np.intersect1d(mesh.node_ids[part.nodes], mesh.node_ids[used]),
            np.intersect1d(expected.node_ids[other.nodes], mesh.node_ids[used]),
        )
        assert np.array_equal(part.elements, np.sort(other.elements))
        assert np.array_equal(part.conditions, np.sort(other.conditions))
        assert (part.data, part.properties) == (other.data, other.properties)


def check_numbers(ranks, mesh, whole):
    share = mesh.subdomain
    assert share.n_all == whole.n_nodes
    assert np.array_equal(share.numbers[share.mine], np.arange(*share.offsets[ranks.rank : ranks.rank + 2]))
    assert np.array_equal(share.fetch(np.where(share.mine, mesh.node_ids, 0)), mesh.node_ids)
    assert np.array_equal(share.fetch(np.where(share.mine, share.numbers, 0)), share.numbers)
    assert ranks.sum(int(mesh.own_elements.sum())) == whole.n_elements
    assert ranks.sum(int(mesh.own_conditions.sum())) == whole.n_conditions


def test_pieces(ranks, make, cut, layers):
    whole = make()
    parts = cut(whole, ranks.size)
    mesh = subdomain_mesh(ranks, pieces(whole, ranks, parts), layers=layers)
    check_numbers(ranks, mesh, whole)
    same(mesh, scattered(whole, ranks, parts, layers), whole)


test_pieces.cases = [
    (make, cut, layers)
    for make in (mixed, quadratic)
    for cut in (random_ranks, all_on_the_last, in_order)
    for layers in (1, 2)
]


def test_a_given_owner_and_wanted_nodes(ranks):
    whole = quadratic()
    owner = np.random.default_rng(1).integers(ranks.size, size=whole.n_nodes)
    piece = pieces(whole, ranks, in_order(whole, ranks.size))
    owners = owner[whole.node_rows(piece.node_ids)]
    given = Piece(
        piece.elements,
        (),
        piece.node_ids,
        piece.points,
        owners,
        wanted=whole.node_ids[[0, 50, whole.n_nodes - 1]],
    )
    mesh = subdomain_mesh(ranks, given)
    check_numbers(ranks, mesh, whole)
    assert np.array_equal(mesh.subdomain.owner, owner[whole.node_rows(mesh.node_ids)])
    assert {0, 50, whole.n_nodes - 1} <= set(whole.node_rows(mesh.node_ids).tolist())
    mine = set(mesh.node_ids[mesh.own_nodes].tolist())
    touching = [mine & set(whole.node_ids[n].tolist()) for b in whole.blocks for n in b.nodes]
    assert set(whole.element_ids[[bool(one) for one in touching]]) <= set(mesh.element_ids)


def test_nobody_has_anything(ranks):
    mesh = subdomain_mesh(ranks, Piece())
    assert (mesh.n_nodes, mesh.blocks, mesh.conditions, mesh.subdomain.n_all) == (0, (), (), 0)


NODES = np.arange(1, 9)
CUBE = Kind("KinematicLinear3D8N", NODES[[[0, 4, 6, 2, 1, 5, 7, 3]]], np.array([1]), np.array([1]))


def cube(ranks, elements=(), points=None, **more):
    box = kl.box()
    return Piece(elements, (), NODES, box.points if points is None else points, **more)


def test_ranks_that_disagree_on_a_place(ranks):
    points = kl.box().points.copy()
    points[3, 0] += 0.25 * (ranks.rank == ranks.size - 1)
    given = cube(ranks, points=points)
    if ranks.size == 1:
        assert subdomain_mesh(ranks, given).n_nodes == 8
        return
    text = (
        rf"node 4 is at \[0.0, 1.0, 1.0\] m on rank 0, but at \[0.25, 1.0, 1.0\] m on rank {ranks.size - 1}"
    )
    with pytest.raises(MeshError, match=text):
        subdomain_mesh(ranks, given)


def test_ranks_that_disagree_on_an_owner(ranks):
    if ranks.size > 1:
        owners = np.full(8, ranks.rank % 2)
        with pytest.raises(MeshError, match=r"node 1 belongs to rank 1 according to rank 1, but to rank 0"):
            subdomain_mesh(ranks, cube(ranks, owners=owners))
    with pytest.raises(MeshError, match=rf"node 3 belongs to rank 7, but there are {ranks.size} ranks"):
        subdomain_mesh(ranks, cube(ranks, owners=np.where(NODES == 3, 7, 0)))


def test_an_element_that_two_ranks_give(ranks):
    if ranks.size == 1:
        assert subdomain_mesh(ranks, cube(ranks, (CUBE,))).n_elements == 1
        return
    who = " and ".join(map(str, range(ranks.size)))
    with pytest.raises(MeshError, match=f"element 1 is given by the ranks {who}"):
        subdomain_mesh(ranks, cube(ranks, (CUBE,)))


def test_a_node_that_nobody_knows(ranks):
    piece = Piece((CUBE,) if ranks.rank == 0 else (), (), NODES[:7], kl.box().points[:7])
    with pytest.raises(MeshError, match="KinematicLinear3D8N 1: there is no node 8 on any rank"):
        subdomain_mesh(ranks, piece)
    with pytest.raises(MeshError, match="there is no node 77 on any rank"):
        subdomain_mesh(ranks, Piece(wanted=np.array([77])))

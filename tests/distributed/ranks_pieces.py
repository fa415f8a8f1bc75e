"""Subdomains of a mesh of which each rank knows a piece by ids."""

import numpy as np
import pytest
from mesh_pieces import mixed, pieces, quadratic, random_ranks

import kratos_lite as kl
from kratos_lite.distributed.pieces import Kind, Piece
from kratos_lite.distributed.subdomains import scattered, subdomain_mesh
from kratos_lite.errors import MeshError


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

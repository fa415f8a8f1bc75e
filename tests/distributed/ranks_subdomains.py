"""What each rank holds of a mesh."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed.subdomains import scattered
from kratos_lite.errors import MeshError


def random_ranks(mesh, size, seed=3):
    return np.random.default_rng(seed).integers(size, size=mesh.n_elements)


def halves(mesh, size):
    """Slabs along x."""
    x = np.concatenate([mesh.points[block.nodes].mean(axis=1)[:, 0] for block in mesh.blocks])
    order = np.argsort(np.argsort(x, kind="stable"))
    return order * size // len(x)


def check(ranks, whole, mesh, layers=1):
    part = mesh.subdomain
    assert ranks.sum(int(mesh.own_nodes.sum())) == whole.n_nodes == part.n_all
    assert ranks.sum(int(mesh.own_elements.sum())) == whole.n_elements
    assert ranks.sum(int(mesh.own_conditions.sum())) == whole.n_conditions
    ids = np.sort(np.concatenate(ranks.gather(mesh.node_ids[mesh.own_nodes])))
    assert np.array_equal(ids, np.sort(whole.node_ids))
    assert np.array_equal(part.fetch(np.where(part.mine, mesh.node_ids, 0)), mesh.node_ids)
    assert np.array_equal(mesh.points, whole.points[whole.node_rows(mesh.node_ids)])
    own = np.sort(part.numbers[part.mine])
    assert np.array_equal(own, np.arange(*part.offsets[ranks.rank : ranks.rank + 2]))
    assert (np.diff(part.numbers[part.mine]) > 0).all()
    # every element at an own node is here, with the same nodes
    ours = {i: mesh.node_ids[n].tolist() for b in mesh.blocks for i, n in zip(b.ids, b.nodes, strict=True)}
    mine = set(mesh.node_ids[mesh.own_nodes].tolist())
    for block in whole.blocks:
        for one, nodes in zip(block.ids, block.nodes, strict=True):
            theirs = whole.node_ids[nodes].tolist()
            if mine & set(theirs):
                assert ours[one] == theirs
    assert list(mesh.parts) == list(whole.parts)
    for name, part in whole.parts.items():
        inside = np.isin(mesh.node_ids, whole.node_ids[part.nodes])
        assert np.array_equal(np.sort(mesh.parts[name].nodes), np.flatnonzero(inside))


def test_scattered(ranks, cut, layers):
    whole = kl.box(cells=(4, 3, 2), element="EnhancedStrain3D8N")
    whole.add_part("top", lambda X: X[:, 2] > 0.99)
    check(ranks, whole, scattered(whole, ranks, cut(whole, ranks.size), layers))


test_scattered.cases = [(random_ranks, 1), (halves, 1), (halves, 2)]


def test_an_empty_rank(ranks):
    whole = kl.box(cells=(3, 1, 1))
    parts = np.zeros(3, dtype=int)
    mesh = scattered(whole, ranks, parts)
    check(ranks, whole, mesh)
    assert mesh.n_elements == (3 if ranks.rank == 0 else 0)


def test_a_rank_that_does_not_exist(ranks):
    with pytest.raises(MeshError, match="ranks 0 …"):
        scattered(kl.box(), ranks, [ranks.size])

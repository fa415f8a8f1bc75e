"""Parts of equal work, whoever has which element; with METIS and without."""

import numpy as np
from mesh_pieces import mixed, pieces, random_ranks

import kratos_lite as kl
from kratos_lite.distributed import partition
from kratos_lite.distributed.bisection import bisected
from kratos_lite.distributed.partition import metis, partitioned, parts_of
from kratos_lite.distributed.pieces import cell_ids
from kratos_lite.distributed.scatter import _owners
from kratos_lite.distributed.subdomains import scattered, subdomain_mesh
from kratos_lite.mesh.subdomain import ALONE


class Without:
    """METIS as if it were not installed."""

    def __enter__(self):
        self.found, partition.find_spec = partition.find_spec, lambda name: None

    def __exit__(self, *error):
        partition.find_spec = self.found


def centers_and_work(mesh):
    centers = np.concatenate([mesh.points[block.nodes].mean(axis=1) for block in mesh.blocks])
    return centers, np.concatenate([np.full(len(b), b.nodes.shape[1] ** 2) for b in mesh.blocks])


def test_halving_is_balanced_and_does_not_depend_on_who_has_what(ranks, size):
    whole = kl.box((3, 1, 1), cells=(9, 7, 5))
    centers, _ = centers_and_work(whole)
    work = 1 + np.arange(len(centers)) % 5
    expected = bisected(ALONE, centers, work, size)
    mine = np.random.default_rng(2).integers(ranks.size, size=len(centers)) == ranks.rank
    assert np.array_equal(bisected(ranks, centers[mine], work[mine], size), expected[mine])
    done = np.bincount(expected, weights=work, minlength=size)
    assert abs(done - work.sum() / size).max() <= 5 * np.ceil(np.log2(size))


test_halving_is_balanced_and_does_not_depend_on_who_has_what.cases = [2, 3, 4, 7, 16]


def test_more_parts_than_elements(ranks):
    centers = np.eye(3)[: 3 * (ranks.rank == 0)]
    parts = bisected(ranks, centers, np.ones(len(centers), dtype=int), 8)
    assert len(set(parts.tolist())) == len(centers)
    same = bisected(ranks, np.ones((4, 3)), np.ones(4, dtype=int), 4)  # all at one place
    assert len(set(same.tolist())) == 1


def shared_nodes(mesh, parts, size):
    """Return how many nodes belong to elements of several parts."""
    low = _owners(mesh, parts, size)
    high = size - 1 - _owners(mesh, size - 1 - parts, size)
    return int((low < high).sum())


def test_parts_are_compact(ranks, cut):
    mesh = kl.box(cells=(12, 12, 12))
    _, work = centers_and_work(mesh)
    size = 8
    parts = (
        metis(mesh.blocks, work, size) if cut == "metis" else bisected(ALONE, *centers_and_work(mesh), size)
    )
    sizes = np.bincount(parts, minlength=size)
    assert sizes.max() <= 1.03 * sizes.mean()
    assert shared_nodes(mesh, parts, size) <= 1.2 * (3 * 13**2 - 3 * 13 + 1)  # that of eight cubes


test_parts_are_compact.cases = ["metis", "halves"]


def test_elements_of_pieces_move_to_their_parts(ranks, installed):
    whole = mixed()
    piece = pieces(whole, ranks, random_ranks(whole, ranks.size))
    if installed:
        moved = partitioned(ranks, piece)
    else:
        with Without():
            moved = partitioned(ranks, piece)
            parts = parts_of(whole, ranks)
    work = sum(len(kind.ids) * kind.nodes.shape[1] ** 2 for kind in moved.elements)
    assert ranks.max(work) <= 1.1 * ranks.sum(work) / ranks.size + 64
    ids = np.concatenate(ranks.gather(cell_ids(moved.elements)))
    assert np.array_equal(np.sort(ids), np.sort(whole.element_ids))
    mesh = subdomain_mesh(ranks, moved)
    assert mesh.subdomain.n_all == whole.n_nodes
    assert mesh.own_elements.sum() == len(cell_ids(moved.elements))
    if not installed:
        assert np.array_equal(mesh.element_ids, scattered(whole, ranks, parts).element_ids)


test_elements_of_pieces_move_to_their_parts.cases = [(True,), (False,)]


def test_all_ranks_agree_on_the_parts_of_a_mesh_that_all_know(ranks):
    mesh = mixed()
    parts = parts_of(mesh, ranks)
    assert (ranks.max(parts) == ranks.min(parts)).all()
    _, work = centers_and_work(mesh)
    assert np.bincount(parts, weights=work).max() <= 1.1 * work.sum() / ranks.size + 64


def test_nothing_to_share(ranks):
    assert len(parts_of(kl.Mesh(np.zeros((2, 3))), ranks)) == 0

"""A box of which each rank makes a part is the cut of the whole box."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed.box import block_of
from kratos_lite.distributed.subdomains import scattered
from kratos_lite.errors import InputError


def parts_of_blocks(cells, size, per_brick):
    """Return the rank of each element of the whole box."""
    parts = np.full(cells, -1)
    for rank in range(size):
        (a, b, c), (d, e, f) = block_of(cells, rank, size)
        parts[a:d, b:e, c:f] = rank
    assert parts.min() == 0
    return np.repeat(parts.ravel(), per_brick)


def check(ranks, cells, element):
    size, origin = (3.0, 0.7, 0.5), (1.0, 2.0, -3.0)
    whole = kl.box(size, cells, element, origin)
    mesh = kl.box(size, cells, element, origin, comm=ranks.comm)
    parts = parts_of_blocks(cells, ranks.size, whole.n_elements // np.prod(cells))
    cut = scattered(whole, ranks, parts)
    assert np.array_equal(mesh.node_ids, cut.node_ids)
    assert np.array_equal(mesh.points, cut.points)  # to the last bit
    assert [block.name for block in mesh.blocks] == [block.name for block in whole.blocks]
    assert np.array_equal(mesh.blocks[0].ids, cut.blocks[0].ids)
    assert np.array_equal(mesh.blocks[0].nodes, cut.blocks[0].nodes)
    assert np.array_equal(mesh.subdomain.owner, cut.subdomain.owner)
    assert np.array_equal(mesh.subdomain.numbers, cut.subdomain.numbers)
    assert np.array_equal(mesh.own_elements, cut.own_elements)
    assert list(mesh.parts) == list(whole.parts)
    for name in whole.parts:
        assert np.array_equal(mesh.parts[name].nodes, cut.parts[name].nodes)


ELEMENTS = ["4N", "10N", "5N", "13N", "6N", "15N", "8N", "20N", "27N", "EnhancedStrain3D8N"]


def test_box(ranks, element):
    check(ranks, (4, 3, 2), element)


test_box.cases = ELEMENTS


def test_thin_boxes_and_more_ranks_than_bricks(ranks, cells, element):
    check(ranks, cells, element)


test_thin_boxes_and_more_ranks_than_bricks.cases = [
    (cells, element)
    for cells in ((1, 1, 1), (1, 1, 5), (2, 1, 1), (1, 3, 2))
    for element in ("13N", "27N", "10N")
]


def test_wrong_arguments_are_one_error(ranks):
    for words, arguments in {
        "comm must be a communicator such as mpi4py.MPI.COMM_WORLD; got 3": {"comm": 3},
        "cells must be three whole numbers": {"cells": (0, 1, 1), "comm": ranks.comm},
        "unknown element": {"element": "Brick", "comm": ranks.comm},
        "size must be three lengths": {"size": (1, 1, -1), "comm": ranks.comm},
    }.items():
        with pytest.raises(InputError, match=words):
            kl.box(**arguments)

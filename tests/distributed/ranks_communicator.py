"""Communication between ranks, and errors of one of them."""

import numpy as np
import pytest

from kratos_lite.distributed.communicator import ranks_of
from kratos_lite.errors import InputError, MeshError
from kratos_lite.mesh.subdomain import Alone, Subdomain


def test_reductions(ranks):
    size, rank = ranks.size, ranks.rank
    assert ranks.sum(rank + 1) == size * (size + 1) // 2
    assert ranks.max(float(rank)) == size - 1
    assert ranks.min(rank) == 0
    assert ranks.any(rank == size - 1) is True
    assert ranks.all(rank == 0) is (size == 1)
    assert np.array_equal(ranks.sum(np.array([[rank, 1.0]])), [[size * (size - 1) / 2, size]])
    assert ranks.any(np.array([rank == 0, False])).tolist() == [True, False]
    assert ranks.gather(str(rank)) == [str(one) for one in range(size)]
    assert ranks.first(rank if rank == size - 1 else None) == size - 1
    assert ranks.first(None) is None


def test_exchange(ranks):
    arrays = [np.full((rank + 1, 2), 10.0 * ranks.rank + rank) for rank in range(ranks.size)]
    came = ranks.exchange(arrays)
    for rank, rows in enumerate(came):
        assert rows.shape == (ranks.rank + 1, 2)
        assert (rows == 10.0 * rank + ranks.rank).all()


def test_an_error_of_one_rank_is_that_of_all(ranks):
    last = ranks.size - 1
    for after in range(3):
        with pytest.raises(MeshError, match=f"rank {last}"), ranks.together():
            for step in range(3):
                if ranks.rank == last and step == after:
                    raise MeshError(f"rank {last}")
                ranks.sum(1)
    assert ranks.sum(1) == ranks.size


def test_the_error_of_the_lowest_rank_is_taken_and_blocks_nest(ranks):
    with pytest.raises(InputError, match="rank 0"), ranks.together(), ranks.together():
        raise InputError(f"rank {ranks.rank}")
    with pytest.raises(InputError, match="of 0"), ranks.together():
        with ranks.together():
            ranks.sum(1)
        if ranks.rank == 0:
            raise InputError("of 0")


def test_an_error_that_cannot_be_packed_gives_its_text(ranks):
    class Local(Exception):
        pass

    with pytest.raises(Exception, match="my text"), ranks.together():
        raise Local("my text")


def test_what_is_not_shared_leaves_at_once(ranks):
    """Nobody may be listening: each rank would wait for the others if it told them."""
    picky = ranks_of(ranks.comm)
    picky.shares = (MeshError,)
    for alone in (ValueError, KeyboardInterrupt):
        for rank in range(ranks.size):
            if rank == ranks.rank:
                with pytest.raises(alone) as caught, picky.together():
                    raise alone
                assert not hasattr(caught.value, "is_shared")
            ranks.agree()


def test_what_is_no_communicator_is_refused(ranks):
    assert type(ranks_of(None)) is Alone
    assert ranks_of(ranks) is ranks
    with pytest.raises(InputError, match="got 3"):
        ranks_of(3)


def test_values_of_ghosts(ranks):
    """Each rank owns two nodes, and has the first of the next rank as a ghost in its first row."""
    size, rank = ranks.size, ranks.rank
    after = (rank + 1) % size
    alone = size == 1
    owner = np.array([after, rank, rank])[int(alone) :]
    numbers = np.array([2 * after, 2 * rank, 2 * rank + 1])[int(alone) :]
    part = Subdomain(ranks, owner, numbers, np.zeros(0, bool), np.zeros(0, bool))
    assert part.n_all == 2 * size
    fetched = part.fetch(np.where(part.mine, numbers, -1))
    assert np.array_equal(fetched, numbers)
    added = part.add(np.ones((len(owner), 3)))
    assert (added[numbers % 2 == 0] == (1 if alone else 2)).all()
    assert (added[numbers % 2 == 1] == 1).all()

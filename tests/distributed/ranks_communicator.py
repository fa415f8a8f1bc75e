"""Communication between ranks, tasks, and errors of one of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from kratos_lite.distributed import petsc
from kratos_lite.distributed.communicator import Ranks, _check, start, started
from kratos_lite.errors import InputError, MeshError


def reductions(ranks):
    size, rank = ranks.size, ranks.rank
    assert ranks.sum(rank + 1) == size * (size + 1) // 2
    assert ranks.max(float(rank)) == size - 1
    assert ranks.min(rank) == 0
    assert ranks.any(rank == size - 1) is True
    assert ranks.all(rank == 0) is (size == 1)
    assert np.array_equal(ranks.sum(np.array([[rank, 1.0]])), [[size * (size - 1) / 2, size]])
    assert ranks.gather(str(rank)) == [str(one) for one in range(size)]


def exchange(ranks):
    arrays = [np.full((rank + 1, 2), 10.0 * ranks.rank + rank) for rank in range(ranks.size)]
    for rank, rows in enumerate(ranks.exchange(arrays)):
        assert rows.shape == (ranks.rank + 1, 2)
        assert (rows == 10.0 * rank + ranks.rank).all()


@pytest.mark.parametrize("task", [reductions, exchange])
def test_values(task):
    started().run(task)


def sum_of(ranks, common, own):
    return ranks.sum(common * own)


def test_tasks_get_arguments_of_all_and_of_each():
    ranks = started()
    assert ranks.run(sum_of, 3, each=lambda rank: rank + 1) == 3 * ranks.size * (ranks.size + 1) // 2
    assert start() is ranks


def fail_last(ranks, error):
    with ranks.agree_on_errors():
        if ranks.rank == ranks.size - 1:
            raise error
    return ranks.sum(1)


def fail_all(ranks):
    ranks.sum(1)
    raise MeshError(f"of {ranks.rank}")


class Odd(Exception):
    """One that is not packed: its text goes."""

    def __init__(self, one, other):
        super().__init__(f"{one} {other}")


@pytest.mark.parametrize("error", [MeshError("torn"), InputError("torn"), Odd("it is", "torn")])
def test_an_error_of_one_rank_is_that_of_all(error):
    ranks = started()
    with pytest.raises(Exception, match="torn"):
        ranks.run(fail_last, error if ranks.size == 1 or not isinstance(error, Odd) else MeshError("torn"))
    with pytest.raises(MeshError, match="of 0"):
        ranks.run(fail_all)
    assert ranks.run(sum_of, 1, each=lambda rank: 1) == ranks.size


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (KeyError("odd"), "KeyError: 'odd'"),
        (MemoryError(), "MemoryError: "),
        (SystemExit(0), "SystemExit: 0"),
    ],
)
def test_a_defect_of_one_rank_ends_all(error, text, capfd):
    ended = []
    comm = SimpleNamespace(Get_rank=lambda: 0, Get_size=lambda: 1, allgather=lambda value: [value])
    comm.Abort = ended.append

    def fail(ranks):
        raise error

    Ranks(comm).run(fail)
    assert ended == [2]
    assert capfd.readouterr().err == f"error: rank 0: {text}\n"


def lacking_petsc(ranks):
    """Check the ranks, of which the last one has no PETSc."""
    real = petsc.petsc
    if ranks.rank == ranks.size - 1:
        petsc.petsc = absent
    try:
        _check(ranks, [])
    finally:
        petsc.petsc = real


def absent():
    raise InputError("needs petsc4py")


def test_a_rank_without_petsc_is_named():
    ranks = started()
    if ranks.size > 1:
        with pytest.raises(InputError, match=f"rank {ranks.size - 1}: needs petsc4py"):
            ranks.run(lacking_petsc)

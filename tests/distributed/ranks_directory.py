"""Who knows what: messages with answers, and ids that are looked after by one rank each."""

import numpy as np

from kratos_lite.distributed.directory import Directory, Route, all_of

EMPTY = np.zeros(0, dtype=np.int64)


def test_rows_go_to_other_ranks_and_answers_come_back(ranks):
    random = np.random.default_rng(ranks.rank)
    to = random.integers(ranks.size, size=20 * ranks.rank)  # rank 0 has nothing to send
    values = np.column_stack([to, np.full(len(to), ranks.rank), np.arange(len(to))])
    route = Route(ranks, to)
    came = route.send(values)
    assert (came[:, 0] == ranks.rank).all()
    assert np.array_equal(came[:, 1], route.sources)
    for source in range(ranks.size):
        assert (np.diff(came[came[:, 1] == source, 2]) > 0).all()
    assert np.array_equal(route.back(came), values)


def test_a_directory_knows_what_any_rank_knows(ranks):
    mine = np.arange(1, 1000, ranks.size) + ranks.rank
    directory = Directory(ranks, np.append(mine, 5000))
    assert ranks.sum(len(directory.ids)) == ranks.size * len(mine) + 1
    ids = np.random.default_rng(ranks.rank).permutation(np.append(np.arange(1, 900), 5000))
    asked = directory.ask(ids)
    assert asked.has().all()
    assert np.array_equal(asked.answer(directory.ids), ids)
    assert directory.ask(np.array([7, 6000])).has().tolist() == [True, False]
    assert (asked.tell(ids) == directory.ids[asked.rows]).all()
    nobody = Directory(ranks, EMPTY)
    assert nobody.ask(np.array([3])).has().tolist() == [False]


def test_all_values_of_an_id(ranks):
    """Rank r knows of each of 1 … 200 that it divides into r + 1 parts, if it does."""
    ids = np.arange(ranks.rank + 1, 201, ranks.rank + 1)
    wanted = np.arange(200, 0, -3) if ranks.rank else EMPTY
    found, values = all_of(ranks, ids, np.column_stack([ids // (ranks.rank + 1)] * 2), wanted)
    expected = [(i, i // r) for i in wanted for r in range(1, ranks.size + 1) if i % r == 0]
    assert sorted(zip(found.tolist(), values[:, 1].tolist(), strict=True)) == sorted(expected)

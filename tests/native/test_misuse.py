"""What the multigrid is given wrongly is refused in words, or right all the same."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from computing import compiled
from native_models import multigrid, stiffness

from kratos_lite.native import kernels

pytestmark = compiled
NATIVE = Path(__file__).parents[2] / "kratos_lite" / "native"


def ints(*numbers):
    return np.array(numbers, np.int32)


class OneRank:
    """What a level of a multigrid over ranks calls, on one."""

    def update(self, memory):
        """Do nothing: there are no copies."""

    add = update

    def sum(self, value):
        return value

    max = sum

    def solve(self, c, x):
        return False


def over_ranks(n, data=None):
    """Return a multigrid over ranks of n nodes, each by itself, all fixed; its first level has been added."""
    found = kernels("multigrid").RankMultigrid(2, 12.0, 0.0, 0)
    blocks = np.tile(np.eye(3), (n, 1, 1)) if data is None else data
    A = np.arange(n + 1, dtype=np.int32), np.arange(n, dtype=np.int32), blocks
    found.add_matrix(A, np.full(3 * n, data is None, np.uint8), OneRank(), None)
    return found


def test_a_rank_without_free_nodes_has_blocks_and_no_weights():
    found, coarse = over_ranks(2), (ints(0, 1), ints(0), np.eye(6)[None])
    blocks = ints(0, 0, 0), ints(), np.zeros((0, 3, 6), np.float32)
    found.add_matrix(coarse, np.zeros(6, np.uint8), OneRank(), blocks)
    found.finish()
    np.testing.assert_array_equal(np.isfinite(found.cycle(np.ones(6))), [True] * 6)
    with pytest.raises(ValueError, match="a way leads to each level"):
        over_ranks(2).add_matrix(coarse, np.zeros(6, np.uint8), OneRank(), None)
    with pytest.raises(ValueError, match="from own nodes to coarse ones"):
        over_ranks(3).add_matrix(coarse, np.zeros(6, np.uint8), OneRank(), blocks)


def test_columns_of_a_prolongator_must_rise():
    model = stiffness((2, 2, 2))
    n, shape = model.n, (2 * model.n, 3, 6)
    indptr = np.arange(0, 2 * n + 1, 2, dtype=np.int32)
    blocks = np.random.default_rng(1).random(shape).astype(np.float32)
    swapped = np.tile(ints(1, 0), n)
    solver, _ = multigrid((2, 2, 2), aggregated=False)
    with pytest.raises(ValueError, match="columns of each row of P must rise"):
        solver.aggregate_plate(indptr, swapped, blocks, np.ones((12, 12)))
    A = over_ranks(1, np.eye(3)[None])
    with pytest.raises(ValueError, match="columns of each row of P must rise"):
        A.galerkin(ints(0, 2), ints(1, 0), blocks[:2], 2)
    sums = A.galerkin(ints(0, 2), ints(0, 1), blocks[[1, 0]], 2)[2]
    P = blocks[[1, 0]].astype(float)
    np.testing.assert_allclose(sums[:36].reshape(6, 6), P[0].T @ P[0], rtol=1e-14)


def test_no_nodes():
    module = kernels("multigrid")
    empty = module.Matrix(ints(0), ints(), np.zeros((0, 3, 3)))
    product = module.Product(np.zeros((0, 3)), [])
    assert product.norm() == 0
    for A in (empty, product):
        with pytest.raises(ValueError, match="there must be a node"):
            module.Multigrid(A, np.zeros(0, np.uint8), np.zeros((0, 3)), 2, 12.0, 0.0)


def test_a_multigrid_serves_when_it_is_aggregated():
    solver, model = multigrid((3, 3, 3), aggregated=False)
    for call in (lambda: solver.cycle(model.b), lambda: solver.solve(model.b, 1e-8, 1.0, 9, None)):
        with pytest.raises(ValueError, match="must be aggregated first"):
            call()
    solver.aggregate(model.modes)
    with pytest.raises(ValueError, match="aggregated already"):
        solver.aggregate(model.modes)
    assert np.isfinite(solver.cycle(model.b)).all()


@pytest.mark.parametrize(
    ("said", "iterations"), [(False, 1), (np.False_, 1), (None, 9), (True, 9), (np.True_, 9)]
)
def test_a_callback_may_say_stop(said, iterations):
    solver, model = multigrid((9, 9, 9))
    assert solver.solve(model.b, 0.0, 0.0, 9, lambda _: said)[1:] == (iterations, False)


COUNT = """
#include <cstdio>
#include <new>
#include "pattern.hpp"
using namespace kl;
static int64_t bytes = 0;
void* operator new(size_t n) { bytes += n; return std::malloc(n); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, size_t) noexcept { std::free(p); }
struct Serial final : Threads {
    void run(int64_t n, const Task& f, Interruption) override { while (n--) f(n); }
    void look(Interruption) override {}
};
int main() {
    Serial serial;
    threads() = &serial;
    for (int64_t n : {1 << 18, 1 << 20}) {
        bytes = 0;
        const UnionRows rows(n, n, [&](int64_t i, const auto& add) {
            for (int64_t number : {n - 1 - i, i, i, i / 2}) add(static_cast<int32_t>(number));
        });
        if (rows.size() > 3 * n || rows.size() < 2.9 * n) return 1;
        std::printf("%lld\\n", static_cast<long long>(bytes));
    }
}
"""


@pytest.mark.skipif(sys.platform != "linux" or not shutil.which("g++"), reason="GCC on Linux is absent")
def test_rows_are_united_in_memory_that_grows_with_them(tmp_path):
    source = tmp_path / "count.cpp"
    source.write_text(COUNT)
    flags = ["-std=c++17", "-O1", "-pthread", f"-I{NATIVE}"]
    subprocess.run(["g++", *flags, source, "-o", tmp_path / "count"], check=True)
    done = subprocess.run([tmp_path / "count"], capture_output=True, text=True, check=True)
    less, more = map(int, done.stdout.split())
    assert more < 6 * less  # of four times as many rows; 16 times, where each task clears all columns

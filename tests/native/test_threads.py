"""One pool of threads serves all kernels; a second Python thread, or a wrong call there, changes nothing."""

import os
import threading
from pathlib import Path

import numpy as np
import pytest
from computing import compiled, printed, set_threads
from native_models import multigrid, stiffness

import kratos_lite as kl
from kratos_lite.native import kernels

pytestmark = compiled

COUNTED = """
import os, kratos_lite as kl
for element in ("KinematicLinear3D8N", "KinematicLinear3D10N"):
    model = kl.Model(kl.box(cells=(9, 9, 9), element=element), kl.Isotropic3D(E=1.0, nu=0.3, density=1.0))
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -1)))
    result = model.solve("amg")
    result.stress(), result.error(), model.check()
print(len(os.listdir("/proc/self/task")))
"""


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted by Linux")
def test_solutions_with_eight_threads_leave_few_of_them():
    assert int(printed(COUNTED, KRATOS_LITE_THREADS="8", OPENBLAS_NUM_THREADS="1")) <= 16


def together(*works):
    """Run functions in threads of their own; return what each returns, or its error."""
    found, start = [None] * len(works), threading.Barrier(len(works))

    def run(i):
        start.wait()
        try:
            found[i] = works[i]()
        except Exception as error:
            found[i] = error

    each = [threading.Thread(target=run, args=(i,)) for i in range(len(works))]
    for thread in each:
        thread.start()
    for thread in each:
        thread.join()
    return found


@pytest.fixture
def four_threads():
    """Let kernels use four threads."""
    set_threads(4)
    yield
    set_threads()


@pytest.mark.usefixtures("four_threads")
def test_two_python_threads_both_get_their_right_answer():
    def solved(n, element):
        model = kl.Model(kl.box(cells=(n, n, n), element=element), kl.Isotropic3D(E=1.0, nu=0.3, density=1.0))
        model.fix("z-")
        model.add(kl.Gravity((0, 0, -1)))
        return lambda: [model.solve("amg").u for _ in range(4)]

    works = solved(9, "KinematicLinear3D8N"), solved(5, "KinematicLinear3D10N")
    expected = [work()[0] for work in works]
    for found, right in zip(together(*works), expected, strict=True):
        for u in found:
            np.testing.assert_array_equal(u, right)


@pytest.mark.usefixtures("four_threads")
def test_a_wrong_call_in_one_thread_does_not_end_a_right_one_in_another():
    n, sparse = 30_000, kernels("sparse")
    indptr, data, x = np.arange(n + 1, dtype=np.int32), np.ones((n, 3, 3)), np.ones(3 * n)
    wrong = np.full(n, n, np.int32)

    def fail():
        for _ in range(200):
            with pytest.raises(ValueError, match="no column"):
                sparse.multiply(indptr, wrong, data, x)
        return True

    def succeed():
        return all(sparse.norm(indptr, data) == 3 for _ in range(1000))

    assert together(fail, succeed) == [True, True]


@pytest.mark.usefixtures("four_threads")
def test_a_product_serves_several_python_threads():
    product = stiffness((7, 7, 7), product=True).A
    vectors = np.random.default_rng(1).random((2, 3 * 8**3))
    expected = [product.times(x) for x in vectors]
    works = [lambda x=x: [product.times(x) for _ in range(300)] for x in vectors]
    for found, right in zip(together(*works), expected, strict=True):
        np.testing.assert_array_equal(found, np.tile(right, (300, 1)))


def test_a_multigrid_is_aggregated_once():
    for _ in range(5):
        solver, model = multigrid((9, 9, 9), aggregated=False)
        found = together(*[lambda s=solver, m=model: s.aggregate(m.modes)] * 3)
        assert sorted(str(one) for one in found) == ["None", "aggregated already", "aggregated already"]
        assert np.isfinite(solver.cycle(model.b)).all()


@pytest.mark.parametrize("call", ["cycle", "solve"])
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of a fork beside threads
def test_a_callback_that_uses_its_own_multigrid_is_refused(call):
    solver, model = multigrid((5, 5, 5))

    def callback(_):
        return solver.cycle(model.b) if call == "cycle" else solver.solve(model.b, 1e-8, 1.0, 9, None)

    with pytest.raises(RuntimeError, match="a callback cannot use it"):
        solver.solve(model.b, 1e-8, 1.0, 100, callback)
    assert np.isfinite(solver.cycle(model.b)).all()


@pytest.mark.parametrize("product", [False, True])
def test_a_callback_may_multiply(product):
    model = stiffness((5, 5, 5), product=True)
    solver, _ = multigrid((5, 5, 5), product=product)
    _, iterations, converged = solver.solve(
        model.b, 1e-8, 1.0, 100, lambda _: model.A.times(model.b) is not None
    )
    assert converged
    assert iterations < 100


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows has no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of a fork beside threads
@pytest.mark.usefixtures("four_threads")
def test_a_forked_process_makes_a_pool_of_its_own():
    solver, model = multigrid((9, 9, 9))
    expected = solver.cycle(model.b)
    child = os.fork()
    if child == 0:
        os._exit(0 if (solver.cycle(model.b) == expected).all() else 1)
    assert os.waitpid(child, 0)[1] == 0

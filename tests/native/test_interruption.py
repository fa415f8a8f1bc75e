"""Kernels let Python handle signals while they run, and give up where a handler raises an error."""

import os
import signal
import threading
from contextlib import contextmanager

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.native import kernels
from kratos_lite.solvers.constraint_map import rigid_modes

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="the signals are those of Unix"),
    pytest.mark.skipif(kernels("multigrid") is None, reason="the kernels are not compiled"),
]


class Stop(Exception):
    """What a handler raises."""


@contextmanager
def signaled(handle):
    """Send this thread a signal every 5 ms, which `handle` handles."""
    over, main = threading.Event(), threading.get_ident()

    def send():
        while not over.wait(0.005):
            signal.pthread_kill(main, signal.SIGUSR1)

    before = signal.signal(signal.SIGUSR1, lambda *_: handle())
    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        over.set()
        sender.join()
        signal.signal(signal.SIGUSR1, before)


def long_solution(n):
    """Return a kernel's solution, without progress, that ends where its residual falls no more."""
    model = kl.Model(kl.box(cells=(n, n, n)), kl.Isotropic3D(E=1.0, nu=0.3))
    points, groups = model.mesh.points, model.element_groups()
    K = assemble_stiffness(points, groups, Pattern(len(points), [group.nodes for group in groups]))
    module, fixed = kernels("multigrid"), np.repeat(points[:, 2] == 0, 3).astype(np.uint8)
    solver = module.Multigrid(module.Matrix(K.indptr, K.indices, K.data), fixed, points, 2, 12.0, 0.0, 0)
    solver.aggregate(rigid_modes(points))
    b = np.where(fixed, 0.0, 1.0)
    return lambda: solver.solve(b, 0.0, 0.0, 1_000_000, None)


def test_signals_are_handled_while_a_kernel_runs_and_change_nothing():
    for n in (4, 8, 12, 16, 24):  # more work, until it takes so long that signals come
        solve, seen = long_solution(n), []
        x, *_ = solve()
        with signaled(lambda seen=seen: seen.append(1)):
            seen.clear()
            again, *_ = solve()
            count = len(seen)  # one of them may have been handled after the kernel's end
        assert np.array_equal(x, again)
        if count >= 2:
            return
    pytest.fail("no signal was handled while the kernel ran")


def test_an_error_in_a_handler_ends_a_kernel_which_can_be_used_again():
    solve = long_solution(12)
    x, *_ = solve()
    running = []

    def stop():
        if running:
            running.clear()
            raise Stop

    def work():
        while True:
            running.append(1)
            solve()

    with signaled(stop), pytest.raises(Stop):
        work()
    assert np.array_equal(solve()[0], x)

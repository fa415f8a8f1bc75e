"""Kernels let Python handle signals while they run, and give up where a handler raises an error."""

import os
import signal
import threading
from contextlib import contextmanager

import numpy as np
import pytest
from native_models import multigrid

from kratos_lite.native import kernels

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
    solver, model = multigrid((n, n, n))
    return lambda: solver.solve(model.b, 0.0, 0.0, 1_000_000, None)


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

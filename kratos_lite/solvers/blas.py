"""Threads of dense algebra: more than one only get in each other's way on small arrays."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any, cast


@cache
def _controller() -> Any:
    """Return what limits threads, or None where it is not installed."""
    import scipy.linalg.lapack  # noqa: F401 (a library that is loaded later would not heed the limit)

    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:
        return None
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[Any]:
    """Keep dense algebra to one thread within a ``with`` block, where threadpoolctl is installed.

    Idle threads that wait actively for the next small product take three quarters of the time, and more if
    other processes want the cores; and sums of several threads may differ from one run to the next.
    """
    controller = _controller()
    if controller is None:
        return nullcontext()
    return cast("AbstractContextManager[Any]", controller.limit(limits=1, user_api="blas"))

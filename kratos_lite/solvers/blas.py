"""Libraries of dense algebra: their memory, and their threads, which small arrays only slow down."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any, cast

import numpy as np

BUFFERS = 10**8
"""Bytes that such a library takes at its first product; without them OpenBLAS ends the program."""


def reserve_buffers(of_scipy: bool = False) -> None:
    """Let the library of NumPy, or of SciPy, take its memory now; MemoryError where there is not enough."""
    np.empty(BUFFERS, dtype=np.uint8)
    if of_scipy:
        from scipy.linalg.lapack import dpotrf

        dpotrf(np.eye(2))
    else:
        np.linalg.inv(np.eye(2))


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

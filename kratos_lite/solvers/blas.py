"""Threads of dense algebra: more than one only get in each other's way on small arrays."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from typing import Any, cast

_controllers: dict[bool, Any] = {}


def one_thread() -> AbstractContextManager[Any]:
    """Keep dense algebra to one thread within a ``with`` block, where threadpoolctl is installed.

    Idle threads that wait actively for the next small product take three quarters of the time, and more if
    other processes want the cores.
    """
    loaded = "scipy.linalg" in sys.modules  # SciPy brings a library of its own
    if loaded not in _controllers:
        try:
            from threadpoolctl import ThreadpoolController
        except ImportError:
            return nullcontext()
        _controllers[loaded] = ThreadpoolController()
    return cast("AbstractContextManager[Any]", _controllers[loaded].limit(limits=1, user_api="blas"))

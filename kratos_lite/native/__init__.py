"""Compiled kernels, where they could be built; everything works without them, slower.

Each `.cpp` file of this folder is one extension module.  `kernels("multigrid")` returns the module
`_multigrid`, or None on a machine where it was not built: then the caller takes its NumPy path,
which is the reference the kernels are tested against.

Environment
-----------
KRATOS_LITE_KERNELS : ``numpy`` leaves the compiled kernels aside.
KRATOS_LITE_THREADS : number of threads; the default is every core this process may use.
KRATOS_LITE_ISA : ``base``, ``avx2`` or ``avx512`` in place of the best this machine has.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from typing import Any


@cache
def kernels(name: str) -> Any:
    """Return the compiled module of a name, or None if it is not there or not wanted."""
    if os.environ.get("KRATOS_LITE_KERNELS", "").lower() == "numpy":
        return None
    try:
        module = import_module(f"kratos_lite.native._{name}")
    except ImportError as error:
        _say_once(str(error))
        return None
    module.set_threads(threads())
    return module


@cache
def _said() -> list[str]:
    """Return what was said so far about missing kernels."""
    return []


def _say_once(why: str) -> None:
    """Warn of the first kernel that is missing; the others are missing for the same reason."""
    if _said():
        return
    _said().append(why)
    import logging

    log = logging.getLogger("kratos_lite")
    log.warning("compiled kernels are not available (%s); computing with NumPy", why)


def threads() -> int:
    """Return the number of threads that kernels use."""
    wanted = os.environ.get("KRATOS_LITE_THREADS", "")
    if wanted.isdigit() and int(wanted) > 0:
        return int(wanted)
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def described() -> str:
    """Return in a few words what computes: the instruction set and the threads, or NumPy."""
    module = kernels("sparse")
    if module is None:
        return "NumPy"
    count = threads()
    return f"compiled ({module.isa()}, {count} thread{'s' if count > 1 else ''})"

"""Compiled kernels, where they could be built; everything works without them, slower.

Each `.cpp` file of this folder is one extension module.  `kernels("multigrid")` returns the module
`_multigrid`, or None on a machine where it was not built: then the caller takes its NumPy path,
which is the reference the kernels are tested against.

Environment
-----------
KRATOS_LITE_KERNELS : ``numpy`` leaves the compiled kernels aside; ``compiled`` is the default.
KRATOS_LITE_THREADS : number of threads, at most four a core; the default is every core this process may use.
KRATOS_LITE_ISA : ``base``, ``avx2`` or ``avx512`` in place of the best this machine has.

Anything else in one of them is an InputError.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib import import_module
from typing import Any

from kratos_lite.errors import InputError


@cache
def kernels(name: str) -> Any:
    """Return a compiled module by its name without the underscore; None if it is missing or not wanted."""
    if _chosen("KRATOS_LITE_KERNELS", "numpy", "compiled") == "numpy":
        return None
    _chosen("KRATOS_LITE_ISA", "base", "avx2", "avx512")
    try:
        if name != "threads":
            kernels("threads")  # the pool of all of them
        module = import_module(f"kratos_lite.native._{name}")
    except ImportError as error:
        _warn_once(str(error))
        return None
    if name == "threads":
        module.set_threads(threads())
    return module


def _chosen(variable: str, *known: str) -> str:
    """Return the value of an environment variable, one of those known or empty."""
    value = os.environ.get(variable, "")
    if value and value not in known:
        raise InputError(f"{variable}={value!r}; expected {' or '.join(known)}, or nothing")
    return value


@cache
def _warnings() -> list[str]:
    """Return the warnings about missing kernels so far."""
    return []


def _warn_once(why: str) -> None:
    """Warn of the first kernel that is missing; the others are missing for the same reason."""
    if _warnings():
        return
    _warnings().append(why)
    import logging

    log = logging.getLogger("kratos_lite")
    log.warning("compiled kernels are not available (%s); computing with NumPy%s", why, _cure())


def _cure() -> str:
    """Return how to get kernels in a source tree: Python prefers the one it runs in to what is installed."""
    from pathlib import Path

    here = Path(__file__).parents[2]
    if not (here / "setup.py").is_file():
        return ""
    elsewhere = [Path(folder) for folder in sys.path if folder and Path(folder).resolve() != here.resolve()]
    found = [folder for folder in elsewhere if any((folder / "kratos_lite" / "native").glob("_gauss.*"))]
    installed = f"run elsewhere to use what is installed in {found[0]}, or " if found else ""
    tree = f"This is the source tree of kratos_lite in {here}"
    return f". {tree}: {installed}build them here by pip install -e ."


def threads() -> int:
    """Return the number of threads that kernels use; InputError for a KRATOS_LITE_THREADS that is none."""
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    wanted = os.environ.get("KRATOS_LITE_THREADS", "")
    if not wanted:
        return cores
    if not (wanted.isascii() and wanted.isdigit() and wanted.strip("0")):
        raise InputError(f"KRATOS_LITE_THREADS={wanted!r}; expected a whole number of threads from 1 on")
    return min(int(wanted.lstrip("0")[:9]), 4 * cores)


def described() -> str:
    """Return what computes, in a few words: the instruction set and the threads, or NumPy."""
    module = kernels("gauss")  # which every solution has loaded
    if module is None:
        return "NumPy"
    count = threads()
    return f"compiled ({module.isa()}, {count} thread{'s' if count > 1 else ''})"

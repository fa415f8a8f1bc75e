"""PETSc, where it is installed: its import, its options and its errors in plain words."""

from __future__ import annotations

import atexit
import ctypes
import glob
import re
import shlex
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from typing import Any
from weakref import WeakSet

from kratos_lite.errors import InputError, SolveError

PREFIX = "kratos_lite_"
"""Prefix of the options that are ours, so that those of other users of PETSc in the process stay theirs."""
DEBIAN = "/usr/lib/petscdir/petsc*/*-real/lib/python3/dist-packages"
"""Where Debian puts petsc4py; a link that others find exists only with its -dev packages."""
INSTALL = (
    "install it with `apt-get install python3-petsc4py python3-mpi4py` on Debian, with "
    "`conda install -c conda-forge petsc4py mpi4py`, or with `pip install petsc petsc4py`"
)
OTHER_NUMPY = "it was made for another NumPy: install 'numpy<2' in this environment"
NAME = re.compile(r"-[A-Za-z_]\w*")
NUMBER = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.IGNORECASE)
MEANINGS = {
    55: "PETSc found too little memory; take more ranks or nodes, or an iteration (solver='amg')",
    56: "PETSc cannot do this with these types: {}; change the PETSc options",
    71: "a pivot is 0, so that the matrix is singular: parts may be free to move, or nearly so",
    76: "a library that PETSc uses has failed: {}",
    86: "PETSc has no such type: {}; it may be misspelt, or PETSc was made without it",
    92: "PETSc was made without this factorization: {}; take solver='amg', or a PETSc with MUMPS",
    91: "PETSc met a number that is not finite, or a pivot of 0: {}",
}
"""What error codes of PETSc say and what to do; ``{}`` stands for the words of PETSc."""
OF_OPTIONS = (56, 86)
"""Codes of errors that options cause."""


@lru_cache(maxsize=1)
def petsc() -> Any:
    """Return petsc4py's module PETSc."""
    try:
        import petsc4py
    except ImportError:
        sys.path.extend(sorted(glob.glob(DEBIAN)))
    try:
        import petsc4py

        petsc4py.init(["kratos-lite", "-no_signal_handler"])  # not the options of our own command line
        from petsc4py import PETSc
    except (ImportError, ValueError, RuntimeError) as error:
        cure = INSTALL if "numpy" not in str(error) else OTHER_NUMPY
        raise InputError(f"backend='petsc' needs petsc4py, which does not load ({error}); {cure}") from None
    if PETSc.ScalarType().dtype.kind != "f":
        raise InputError("petsc4py is one for complex numbers; install one for real numbers")
    atexit.register(_keep_all)
    return PETSc


LIVE: WeakSet[Any] = WeakSet()
"""What holds objects of PETSc and has not been destroyed."""


def _keep_all() -> None:
    """Keep PETSc from destroying what is left: it ends after Python, which its objects may call."""
    # To destroy them here would wait for other ranks, which may have ended in another way.
    for one in list(LIVE):
        one.keep()


def has_mumps() -> bool:
    """Return whether PETSc was made with MUMPS, which factorizes over ranks."""
    return bool(petsc().Sys.hasExternalPackage("mumps"))


def parsed(options: str | None) -> dict[str, str | None]:
    """Return PETSc options as names without their dash, and values (None for a switch)."""
    if options is None:
        return {}
    if not isinstance(options, str):
        raise InputError(f"PETSc options are a text such as '-ksp_type cg -pc_type gamg'; got {options!r}")
    try:
        words = shlex.split(options)
    except ValueError as error:
        raise InputError(f"PETSc options {options!r} cannot be read: {error}") from None
    found: dict[str, str | None] = {}
    name = ""
    for word in words:
        if NAME.fullmatch(word):
            name = word[1:]
            found[name] = None
        elif name and found[name] is None and (not word.startswith("-") or NUMBER.fullmatch(word)):
            found[name] = word
        else:
            raise InputError(
                f"PETSc options {options!r}: {word!r} is no option and the value of none; "
                "expected such as '-ksp_type cg -ksp_view'"
            )
    return found


def unused(prefix: str, options: Mapping[str, str | None]) -> list[str]:
    """Return the names of those options that PETSc has not used, such as misspelt ones."""
    asked = getattr(ctypes.CDLL(petsc().__file__), "PetscOptionsUsed", None)  # petsc4py lacks it
    if asked is None:
        return []
    found, left = ctypes.c_int(0), []
    for name in options:
        asked(None, f"{prefix}{name}".encode(), ctypes.byref(found))
        if not found.value:
            left.append(name)
    return left


@contextmanager
def plain_errors() -> Iterator[None]:
    """Turn errors of PETSc into one sentence: an InputError for wrong options, else a SolveError."""
    PETSc = petsc()
    try:
        yield
    except PETSc.Error as error:
        raise (InputError if error.ierr in OF_OPTIONS else SolveError)(_meaning(error)) from None


def _meaning(error: Any) -> str:
    """Return what an error of PETSc says, with its last line that is not a place in its source."""
    lines = [line.split("] ", 1)[-1].strip() for line in str(error).splitlines()[1:]]
    words = [line for line in lines if line and not re.search(r"\(\) (line \d+ in|at) ", line)]
    said = words[-1].rstrip(".") if words else "no details"
    return MEANINGS.get(error.ierr, "PETSc stopped with error {code}: {}").format(said, code=error.ierr)

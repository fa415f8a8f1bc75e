"""Whole-or-nothing output: a file is replaced only once its successor is safe on the disk."""

from __future__ import annotations

import errno
import io
import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, SolveError, no_such_file
from kratos_lite.typing import Numbers

CURES = {
    errno.EFBIG: "raise the limit on the size of files (ulimit -f)",
    **dict.fromkeys((errno.ENOSPC, getattr(errno, "EDQUOT", None), None), "free some space"),
}
"""Cures of a file too large, of a full disk or quota, and of what NumPy raises then, without a number."""
WAITING: ContextVar[list[tuple[Path, Path]] | None] = ContextVar("waiting", default=None)
"""Written files, and those whose places they take together at the end of `all_or_none`."""


def read_arrays(
    path: str | Path, names: Sequence[str], what: str, others: bool = False
) -> dict[str, Numbers]:
    """Return arrays of an .npz file by name, all if wanted; InputError if it is not `what` it should be."""
    try:
        with np.load(io.BytesIO(Path(path).read_bytes()), allow_pickle=False) as file:
            return {name: np.asarray(file[name]) for name in (*names, *(file.files if others else ()))}
    except FileNotFoundError:
        raise no_such_file(path) from None
    except Exception as error:  # whatever NumPy and zipfile raise for a damaged file
        raise InputError(f"{path}: not {what}, or not all of it") from error


def write_arrays(path: str | Path, arrays: Mapping[str, Any]) -> None:
    """Write named arrays or numbers to an .npz file, as a whole or not at all; SolveError if one is NaN."""
    for name, values in arrays.items():
        refuse_nan(path, name, values)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    write_whole(path, buffer.getvalue())


def refuse_nan(path: str | Path, name: str, values: Any) -> None:
    """Raise SolveError, before anything is written, for numbers that are not finite."""
    array = np.asarray(values)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise SolveError(
            f"{path}: not written: {name} is not finite everywhere, beyond what a computer holds (1.8e308); "
            "look for coordinates, loads, supports or constants in wrong units"
        )


def write_whole(path: str | Path, data: bytes) -> None:
    """Write a file as a whole, or leave what was there before untouched."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


@contextmanager
def all_or_none() -> Iterator[None]:
    """Let all files that are written in a ``with`` statement take their places at its end, or none."""
    if WAITING.get() is not None:  # they wait for the end of the outer statement
        yield
        return
    written: list[tuple[Path, Path]] = []
    token = WAITING.set(written)
    try:
        yield
        for temporary, target in written:
            try:
                os.replace(temporary, target)
            except OSError as error:
                raise InputError(_text(target, error)) from error
    finally:
        WAITING.reset(token)
        for temporary, _ in written:
            with suppress(OSError):  # those that have taken their places are no longer there
                temporary.unlink()


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give an empty temporary file, with the ending of `path`, that replaces `path` on success.

    It is forced to the disk before it takes the place of `path`.  A failure of any kind, also Ctrl-C,
    deletes it.
    """
    try:
        # Through a symbolic link the target is replaced, not the link.
        target = Path(os.path.realpath(path))
        if target.exists() and not target.is_file():
            # Replacing a device such as /dev/null would harm the whole machine.
            raise OSError(errno.EINVAL, "it is a folder or a device, not a file")
        temporary = target.with_name(f".{os.urandom(16).hex()}{''.join(target.suffixes)[-40:]}")
        temporary.open("xb").close()
        try:
            if target.exists():
                temporary.chmod(stat.S_IMODE(target.stat().st_mode))
            yield temporary
            with open(temporary, "r+b") as file:
                os.fsync(file.fileno())
            waiting = WAITING.get()
            if waiting is None:
                os.replace(temporary, target)
            else:
                waiting.append((temporary, target))
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise
    except OSError as error:
        raise InputError(_text(Path(path), error)) from error


def _text(path: Path, error: OSError) -> str:
    """Say what went wrong with `path` and how to cure it."""
    if error.errno in (errno.ENOENT, errno.ENOTDIR):
        found = f"there is no folder {path.absolute().parent}"
        return f"{path}: cannot be written: {found}; create it or choose another path"
    cure = CURES.get(error.errno, "choose a file name in a folder where you may write")
    return f"{path}: cannot be written: {error.strerror or error}; {cure}"

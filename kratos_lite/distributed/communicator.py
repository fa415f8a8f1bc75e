"""Ranks: the processes that share a mesh, over MPI; an error of one of them ends the work of all."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter, sleep
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.mesh.subdomain import ALONE, Alone

INSTALL = "python3-mpi4py of Debian or `pip install kratos-lite[mpi]`"
SPIN, PAUSE = 1e-3, 1e-4
"""Seconds that a rank looks for the others without a pause, and between two looks after that."""


def world() -> Alone:
    """Return the ranks that ``mpirun`` has started, or the single process."""
    return ranks_of(_mpi().COMM_WORLD)


def ranks_of(comm: Any) -> Alone:
    """Return the ranks of an mpi4py communicator; InputError if it is none.

    Parameters
    ----------
    comm : such as ``mpi4py.MPI.COMM_WORLD``; Ranks are returned as they are, and None is the one process.
    """
    if comm is None:
        return ALONE
    if isinstance(comm, Alone):
        return comm
    if not isinstance(comm, _mpi().Comm):
        raise InputError(f"comm must be a communicator such as mpi4py.MPI.COMM_WORLD; got {comm!r}")
    return Ranks(comm)


def _mpi() -> Any:
    """Return mpi4py's MPI; InputError where it is absent."""
    try:
        from mpi4py import MPI
    except ImportError as error:
        raise InputError(
            f"several ranks need mpi4py, which does not load ({error}); install {INSTALL}"
        ) from None
    return MPI


class Ranks(Alone):
    """The ranks of an MPI communicator.

    Each call below is made by all ranks.  It begins by agreeing that nobody has failed: a rank that fails
    inside `together` takes part in that with its error, which all others then raise as well.

    Parameters
    ----------
    comm : mpi4py communicator.

    Attributes
    ----------
    shares : the kinds of errors that all ranks raise if one does.  Others, and Ctrl-C, may come while the
        others wait for something else: they leave `together` at once, and who catches them ends all ranks.
    """

    shares: tuple[type[BaseException], ...] = (BaseException,)

    def __init__(self, comm: Any) -> None:
        self.comm, self._MPI = comm, _mpi()
        self.rank, self.size = comm.Get_rank(), comm.Get_size()

    def __deepcopy__(self, memo: Any) -> Ranks:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        raise InputError("what is shared by several ranks cannot be pickled; each rank writes its own piece")

    # ---- reductions --------------------------------------------------------------------------------

    def sum(self, value: Any) -> Any:
        """Return the sum over ranks."""
        return self._reduce(value, self._MPI.SUM)

    def max(self, value: Any) -> Any:
        """Return the largest over ranks."""
        return self._reduce(value, self._MPI.MAX)

    def min(self, value: Any) -> Any:
        """Return the smallest over ranks."""
        return self._reduce(value, self._MPI.MIN)

    def any(self, value: Any) -> Any:
        """Return whether it is true on any rank."""
        return self._reduce(np.asarray(value, dtype=bool), self._MPI.LOR)

    def all(self, value: Any) -> Any:
        """Return whether it is true on all ranks."""
        return self._reduce(np.asarray(value, dtype=bool), self._MPI.LAND)

    def _reduce(self, value: Any, operation: Any) -> Any:
        self.agree()
        given = np.ascontiguousarray(value)
        found = np.empty_like(given)
        self.comm.Allreduce(given, found, operation)
        if isinstance(value, np.ndarray) and value.ndim:
            return found.reshape(value.shape)
        return found.ravel()[0].item()

    # ---- messages ----------------------------------------------------------------------------------

    def gather(self, value: Any) -> list[Any]:
        """Return the value of each rank."""
        self.agree()
        found: list[Any] = self.comm.allgather(value)
        return found

    def exchange(self, arrays: Sequence[Any]) -> list[Any]:
        """Send array i to rank i, and return what each rank has sent here."""
        self.agree()
        counts = np.array([len(one) for one in arrays], dtype=np.int64)
        coming = np.empty_like(counts)
        self.comm.Alltoall(counts, coming)
        shape, dtype = arrays[0].shape[1:], arrays[0].dtype
        sent = np.ascontiguousarray(np.concatenate(arrays))
        came = np.empty((int(coming.sum()), *shape), dtype=dtype)
        width = int(np.prod(shape, dtype=np.int64)) * dtype.itemsize
        row = self._MPI.BYTE.Create_contiguous(max(width, 1)).Commit()  # so that counts are those of rows
        try:
            self.comm.Alltoallv(
                [sent, (counts, _starts(counts)), row], [came, (coming, _starts(coming)), row]
            )
        finally:
            row.Free()
        return np.split(came, np.cumsum(coming)[:-1])

    # ---- errors ------------------------------------------------------------------------------------

    def agree(self) -> None:
        """Raise on all ranks the error that one of them has met."""
        if self._has_anybody_failed(False):
            raise self._shared(None)

    @contextmanager
    def together(self) -> Iterator[None]:
        """Let an error that a rank raises inside end the block on all ranks."""
        try:
            yield
            self.agree()
        except BaseException as error:
            is_known = getattr(error, "is_shared", False)
            if is_known or isinstance(error, KeyboardInterrupt) or not isinstance(error, self.shares):
                raise
            self._has_anybody_failed(True)
            raise self._shared(error) from None

    def _has_anybody_failed(self, mine: bool) -> bool:
        flag = np.array([mine], dtype=np.int32)
        request = self.comm.Iallreduce(self._MPI.IN_PLACE, flag, self._MPI.MAX)
        start = perf_counter()
        while not request.Test():  # in Python, so that a signal ends a rank that waits for the others
            if perf_counter() - start > SPIN:
                sleep(PAUSE)
        return bool(flag[0])

    def _shared(self, error: BaseException | None) -> BaseException:
        """Return the error of the lowest rank that has one, marked as known to all."""
        found = next(one for one in self.comm.allgather(_packed(error)) if one is not None)
        shared: BaseException = pickle.loads(found)
        shared.is_shared = True  # type: ignore[attr-defined]
        return shared


def _starts(counts: Any) -> Any:
    return np.concatenate([[0], np.cumsum(counts)[:-1]])


def _packed(error: BaseException | None) -> bytes | None:
    """Return an error as bytes; one that cannot be packed as its text."""
    if error is None:
        return None
    try:
        packed = pickle.dumps(error)
        pickle.loads(packed)
    except Exception:
        packed = pickle.dumps(KratosLiteError(f"{type(error).__name__}: {error}"))
    return packed

"""Ranks: the processes that mpirun has started. Rank 0 runs the program; the others work for it."""

from __future__ import annotations

import atexit
import ctypes
import logging
import os
import pickle
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from signal import SIG_IGN, SIGINT, signal
from threading import Timer
from time import sleep
from typing import Any, TypeVar

import numpy as np

from kratos_lite.errors import InputError, KratosLiteError, installing

T = TypeVar("T")
LOG = logging.getLogger(__name__)
INSTALL = f"python3-mpi4py of Debian or `{installing('mpi')}`"
LIMIT = 60.0
"""Seconds within which all ranks must have begun: one that has ended would be waited for without end."""
PAUSE = 1e-3
"""Seconds between two looks for work, so that a rank without work leaves its core to others."""


class Alone:
    """The communicator of a single process: each reduction returns what it is given.

    All ranks make each call but `run`, which rank 0 makes.
    """

    rank = 0
    size = 1
    comm: Any = None

    def sum(self, value: Any) -> Any:
        """Return the sum over ranks of a number or of each entry of an array, the same on all ranks."""
        return value

    max = min = sum

    def any(self, value: bool) -> bool:
        """Return whether it is true on any rank."""
        return bool(self.max(int(value)))

    def all(self, value: bool) -> bool:
        """Return whether it is true on all ranks."""
        return bool(self.min(int(value)))

    def gather(self, value: Any) -> list[Any]:
        """Return the value of each rank, on all ranks; for small values."""
        return [value]

    collect = gather
    """Return the values of all ranks on rank 0, nothing on the others."""

    def exchange(self, arrays: Sequence[Any]) -> list[Any]:
        """Send array i to rank i, and return what each rank has sent here."""
        return list(arrays)

    @contextmanager
    def agree_on_errors(self) -> Iterator[None]:
        """Let an error of one rank in this block, in which nothing is sent, be raised on all ranks."""
        yield

    def run(self, task: Callable[..., T], *arguments: Any, each: Callable[[int], Any] | None = None) -> T:
        """Call task(ranks, *arguments) on all ranks; return what it returns on rank 0, which calls this."""
        # A task sends and receives on all ranks alike.  It raises a KratosLiteError on all ranks, or before
        # it sends anything inside `agree_on_errors`; whatever else one rank raises ends all of them.
        # `each` gives one more argument for the rank of a number.
        return task(self, *arguments, *([] if each is None else [each(0)]))


ALONE = Alone()


class Ranks(Alone):
    """The ranks of a communicator of mpi4py."""

    def __init__(self, comm: Any) -> None:
        self.comm, self._MPI = comm, _mpi()
        self.rank, self.size = comm.Get_rank(), comm.Get_size()

    def __deepcopy__(self, memo: Any) -> Ranks:
        return self

    # ---- values ------------------------------------------------------------------------------------

    def sum(self, value: Any) -> Any:
        """Return the sum over ranks."""
        return self._reduce(value, self._MPI.SUM)

    def max(self, value: Any) -> Any:
        """Return the largest over ranks, entry by entry."""
        return self._reduce(value, self._MPI.MAX)

    def min(self, value: Any) -> Any:
        """Return the smallest over ranks, entry by entry."""
        return self._reduce(value, self._MPI.MIN)

    def _reduce(self, value: Any, operation: Any) -> Any:
        given = np.ascontiguousarray(value)
        found = np.empty_like(given)
        self.comm.Allreduce(given, found, operation)
        return found.reshape(value.shape) if isinstance(value, np.ndarray) else found.item()

    def gather(self, value: Any) -> list[Any]:
        """Return the value of each rank."""
        return list(self.comm.allgather(value))

    def collect(self, value: Any) -> list[Any]:
        """Return the values of all ranks on rank 0, nothing on the others."""
        return self.comm.gather(value) or []

    def exchange(self, arrays: Sequence[Any]) -> list[Any]:
        """Send array i to rank i, and return what each rank has sent here."""
        sent = list(arrays)
        own, sent[self.rank] = sent[self.rank], None
        received: list[Any] = self.comm.alltoall(sent)
        received[self.rank] = own
        return received

    # ---- errors ------------------------------------------------------------------------------------

    @contextmanager
    def agree_on_errors(self) -> Iterator[None]:
        """Let an error of one rank in this block, in which nothing is sent, be raised on all ranks."""
        error = None
        try:
            yield
        except Exception as raised:
            error = raised
        found = [pickle.loads(one) for one in self.gather(_packed(error)) if one is not None]
        if found:
            raise found[0] from error

    def abort(self, error: BaseException) -> None:
        """End all ranks, of which others may wait for this one, and say why."""
        text = str(error) if isinstance(error, KratosLiteError) else f"{type(error).__name__}: {error}"
        LOG.debug("%s", "".join(traceback.format_exception(error)))
        # a signal comes from mpirun, which says so, or ends this rank since another has said its error
        if not isinstance(error, KeyboardInterrupt):
            _say(f"rank {self.rank}: {text}")
        self.comm.Abort(2)

    # ---- work --------------------------------------------------------------------------------------

    def run(self, task: Callable[..., T], *arguments: Any, each: Callable[[int], Any] | None = None) -> T:
        """Call task(ranks, *arguments) on all ranks, and return what it returns here, on rank 0."""

        def given(rank: int) -> tuple[Any, ...]:
            return arguments if each is None else (*arguments, each(rank))

        for rank in range(1, self.size):
            try:
                self.comm.send(self._message(task, given(rank)), dest=rank)
            except BaseException as error:
                if rank > 1:  # those before wait for the others
                    self.abort(error)
                raise
        return self._do(lambda: (task, given(0)))

    def _message(self, task: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
        try:
            return pickle.dumps((task, arguments), protocol=5)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise InputError(
                f"this model cannot be sent to other ranks: {error}; define its elements and materials in a "
                "module that all ranks can import"
            ) from None

    def _do(self, work: Callable[[], tuple[Callable[..., T], tuple[Any, ...]]]) -> T:
        """Do one task here; all ranks raise the error of one of them."""
        with self.agree_on_errors():
            task, arguments = work()
        result: Any = None
        with self.agree_on_errors():
            try:
                result = task(self, *arguments)
            except KratosLiteError:
                raise
            except BaseException as error:
                self.abort(error)
        return result

    def serve(self) -> None:
        """Do the tasks of rank 0 until it ends."""
        while True:
            while not self.comm.Iprobe(source=0):
                sleep(PAUSE)  # in Python, so that a signal ends a rank that waits
            message = self.comm.recv(source=0)
            if message is None:
                return
            try:
                self._do(lambda message=message: pickle.loads(message))  # type: ignore[misc]
            except Exception as error:
                LOG.debug("rank %d: %s", self.rank, error)  # rank 0 raises it

    def stop(self) -> None:
        """End the other ranks."""
        for rank in range(1, self.size):
            self.comm.send(None, dest=rank)


def world(launched: int = 1) -> Alone:
    """Return the ranks that mpirun has started, or the single process."""
    comm = _mpi().COMM_WORLD
    if launched > comm.Get_size():
        raise InputError(
            f"{launched} processes have been started, but mpi4py sees {comm.Get_size()}: it was made for "
            "another MPI than that of this mpirun or srun; use the mpirun of its MPI "
            "(python -m mpi4py --version)"
        )
    return Ranks(comm) if comm.Get_size() > 1 else ALONE


def start(words: Sequence[str] = (), launched: int = 1) -> Alone:
    """Return the ranks on rank 0; on the others, work for it until it ends, and end.

    A script that ``mpirun`` starts calls this before anything else but the definition of its own elements and
    materials.  Rank 0 goes on with the script; the others assemble and solve their parts whenever a model is
    solved with ``backend="petsc"``.

    Parameters
    ----------
    words : of the command, the same on all ranks.
    launched : processes that a launcher says it has started.

    Returns
    -------
    Ranks of mpirun, or the single process.

    Raises
    ------
    InputError
        mpi4py or PETSc is missing on a rank, or the ranks were started with different words.
    """
    if _STARTED:
        return _STARTED[0]
    ranks = world(launched)
    if isinstance(ranks, Ranks):
        with _limited():
            ranks.comm.Barrier()
        try:
            _check(ranks, list(words))
        except InputError:
            if ranks.rank:
                sys.exit()
            raise
        if ranks.rank:
            signal(SIGINT, SIG_IGN)  # rank 0 ends the others
            try:
                ranks.serve()
            except BaseException as error:
                ranks.abort(error)
            sys.exit()
        atexit.register(ranks.stop)
    _STARTED.append(ranks)
    return ranks


def started() -> Alone:
    """Return the ranks that `start` has found, or the single process; InputError for several without it."""
    if not _STARTED and find_spec("mpi4py") is not None and (size := world().size) > 1:
        raise InputError(
            f"{size} ranks have been started, and each runs this program; begin it with "
            "kratos_lite.distributed.start(), so that rank 0 runs it and the others work for it"
        )
    return _STARTED[0] if _STARTED else ALONE


_STARTED: list[Alone] = []
"""What `start` has found, once it was called."""


def _check(ranks: Ranks, words: list[str]) -> None:
    """Raise InputError on all ranks where one of them lacks a package or was started otherwise."""
    from kratos_lite.distributed.petsc import petsc

    with ranks.agree_on_errors():
        try:
            petsc()
        except InputError as error:
            raise InputError(f"rank {ranks.rank}: {error}" if ranks.rank else str(error)) from None
    found = ranks.gather(words)
    for rank, one in enumerate(found):
        if one != found[0]:
            raise InputError(
                f"ranks share one command; rank 0 has {' '.join(found[0])!r}, rank {rank} {' '.join(one)!r}"
            )


def _mpi() -> Any:
    """Return mpi4py's MPI, initialized; InputError where it is absent."""
    try:
        import mpi4py

        if "mpi4py.MPI" not in sys.modules:  # its own initialization would let no other thread run
            mpi4py.rc.initialize, mpi4py.rc.finalize = False, True
        from mpi4py import MPI
    except ImportError as error:
        raise InputError(
            f"several ranks need mpi4py, which does not load ({error}); install {INSTALL}"
        ) from None
    if not MPI.Is_initialized():
        with _limited():
            ctypes.CDLL(MPI.__file__).MPI_Init(None, None)
    return MPI


def _say(text: str) -> None:
    if sys.__stderr__ is not None:
        sys.__stderr__.write(f"error: {text}\n")
        sys.__stderr__.flush()


@contextmanager
def _limited() -> Iterator[None]:
    """End this process, and so all ranks, where the others do not come: one may have ended early."""

    def end() -> None:
        _say(f"after {LIMIT:g} s not all ranks have begun; one may have ended early")
        os._exit(2)

    timer = Timer(LIMIT, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _packed(error: BaseException | None) -> bytes | None:
    """Return an error as bytes; one that cannot be packed as its text."""
    if error is None:
        return None
    try:
        packed = pickle.dumps(error)
        pickle.loads(packed)
        return packed
    except Exception:
        return pickle.dumps(KratosLiteError(f"{type(error).__name__}: {error}"))

"""One command over many processes (ranks): what started them, who speaks, and how they end together."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import sleep
from typing import Any, TextIO

LAUNCHERS = (
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_SIZE"),
    ("MV2_COMM_WORLD_RANK", "MV2_COMM_WORLD_SIZE", "MV2_COMM_WORLD_LOCAL_SIZE"),
    ("PMI_RANK", "PMI_SIZE", "MPI_LOCALNRANKS"),
    ("SLURM_PROCID", "SLURM_STEP_NUM_TASKS", ""),
)
"""Variables that mpirun of Open MPI, MVAPICH and MPICH or Intel, and srun set: rank, ranks, on this machine.

In the script of a Slurm job, outside srun, there is no SLURM_STEP_NUM_TASKS.
"""
COMMANDS = ("solve", "check")
"""Commands that ranks share."""
ENDING = 3.0
"""Seconds after a signal in which the launcher, if it was that which sent it, ends all ranks by force."""
PATIENCE = 0.2
"""Seconds that rank r waits r times for a rank below it to say what is wrong, five times at most."""


def launched(environment: Mapping[str, str] | None = None) -> tuple[int, int, int]:
    """Return the rank, the number of ranks and those of this machine that a launcher has started.

    >>> launched({"PMI_RANK": "1", "PMI_SIZE": "4"}), launched({"SLURM_PROCID": "0", "SLURM_NTASKS": "4"})
    ((1, 4, 4), (0, 1, 1))
    """
    given = os.environ if environment is None else environment
    for names in LAUNCHERS:
        rank, size, local = (given.get(name, "") for name in names)
        if rank.isdecimal() and size.isdecimal():
            return int(rank), int(size), int(local) if local.isdecimal() else int(size)
    return 0, 1, 1


class Job:
    """The processes that run one command.

    Parameters
    ----------
    words : of the command.

    Attributes
    ----------
    rank, size : as the launcher says.
    ranks : the communicator, None while there is none.
    """

    def __init__(self, words: Sequence[str]) -> None:
        self.rank, self.size, self._local = launched()
        is_for_ranks = len(words) > 0 and words[0] in COMMANDS and _engine(words) != "own"
        self._is_shared = is_for_ranks and self.size > 1
        self.ranks: Any = None
        self._streams: tuple[TextIO, TextIO] | None = None

    @contextmanager
    def quiet(self) -> Iterator[None]:
        """Let rank 0 alone speak, if the ranks share the command."""
        if not (self._is_shared and self.rank):
            yield
            return
        self._streams = sys.stdout, sys.stderr
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            sys.stdout = sys.stderr = nowhere
            try:
                yield
            finally:
                sys.stdout, sys.stderr = self._streams

    def run(self, command: Callable[[Namespace], int], options: Namespace) -> int:
        """Run a command, over all ranks with ``--engine petsc``; return its exit code."""
        from kratos_lite.errors import InputError

        engine = getattr(options, "engine", "own")
        if self._is_shared and engine is None:
            raise InputError(
                f"{self.size} copies of this command have been started, which would all {options.command} "
                f"{options.input} and write the same files; add --engine petsc to share it among them, start "
                "it without mpirun or srun, or add --engine own if each has an input of its own"
            )
        if engine != "petsc":
            if getattr(options, "petsc", None) is not None:
                raise InputError("--petsc belongs to --engine petsc; add that, too")
            return command(options)
        from kratos_lite.cli.over_ranks import connected, prepare, refuse_serial_options

        refuse_serial_options(options)
        self._share_cores()
        self.ranks = options.ranks = connected(self.size)
        with self.ranks.together():
            prepare(options, self.ranks)
            return command(options)

    def _share_cores(self) -> None:
        """Give each rank its share of the cores, unless the user has said how many threads it takes."""
        if self._local < 2:
            return
        count = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0)
        share = str(max(1, len(count) // self._local))
        for name in ("KRATOS_LITE_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
            os.environ.setdefault(name, os.environ.get("OMP_NUM_THREADS", share))

    def end(self, code: int, error: BaseException | None = None, text: str = "") -> int:
        """Say a text and end, all ranks together; return the exit code of this process.

        An error that the others do not know, as of a defect, ends them as well: they may wait for this rank.
        """
        many = self.ranks is not None and self.ranks.size > 1
        if many and error is not None and not getattr(error, "is_shared", False):
            if isinstance(error, KeyboardInterrupt):
                sleep(ENDING)
            sleep(PATIENCE * min(self.rank, 5))  # it may be the same on all
            stderr = self._streams[1] if self._streams else sys.stderr
            print(f"rank {self.rank}: {text}", file=stderr, flush=True)
            self.ranks.comm.Abort(code)
        if text:
            print(text, file=sys.stderr, flush=True)
        if many:
            self.ranks.agree()  # mpirun kills the others once one has ended with an error
            return code
        return 0 if self._is_shared and self.rank else code


def _engine(words: Sequence[str]) -> str:
    """Return what follows ``--engine``, before the words are parsed."""
    joined = " ".join(words).replace("--engine=", "--engine ").split()
    after = [joined[at + 1 : at + 2] for at, word in enumerate(joined) if word == "--engine"]
    return "".join(after[-1]) if after else ""

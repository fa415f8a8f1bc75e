"""One command over many processes (ranks): rank 0 runs it, the others work for it."""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from kratos_lite.errors import InputError

if TYPE_CHECKING:
    from kratos_lite.distributed.communicator import Alone

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


def share(words: Sequence[str]) -> bool:
    """Let ranks of ``--backend petsc`` share a command; return whether this one runs it."""
    rank, size, local = launched()
    if size == 1 or not words or words[0] not in COMMANDS:
        return True
    backend = _backend(words)
    if backend == "petsc":
        from kratos_lite.distributed.communicator import start

        _share_cores(local)
        start(words, size)
    elif not backend:
        if rank:
            return False
        raise InputError(
            f"{size} copies of this command have been started, which would all {' '.join(words[:2])} and "
            "write the same files; add --backend petsc to share it among them, start it without mpirun or "
            "srun, or add --backend own if each has an input of its own"
        )
    return True


def _share_cores(local: int) -> None:
    """Give each rank its fraction of the cores, unless the user has said how many threads it takes."""
    if local < 2:
        return
    count = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0)
    threads = str(max(1, len(count) // local))
    for name in ("KRATOS_LITE_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, os.environ.get("OMP_NUM_THREADS", threads))


def _backend(words: Sequence[str]) -> str:
    """Return what follows ``--backend``, before the words are parsed."""
    joined = " ".join(words).replace("--backend=", "--backend ").split()
    after = [joined[at + 1 : at + 2] for at, word in enumerate(joined) if word == "--backend"]
    return "".join(after[-1]) if after else ""


# ---- part files ----------------------------------------------------------------------------------------


def part_files_of(options: Namespace) -> dict[int, Path]:
    """Return the part files that an input stands for, by number; none where one file holds the mesh."""
    if getattr(options, "backend", None) != "petsc":
        return {}
    from kratos_lite.io.formats import ending, input_file
    from kratos_lite.io.formats.mdpa.reader import check_part_files, part_files
    from kratos_lite.io.kratos.run_file import part_files_of as of_project

    path = input_file(options.input)
    files = of_project(path) if ending(path) == ".json" else part_files(path)
    if files:
        from kratos_lite.distributed.communicator import started

        check_part_files(path, files, started().size)
    return files


def solve_parts(options: Namespace) -> tuple[list[str], list[str]]:
    """Let each rank solve its part; return the lines of the summary and the files written."""
    from kratos_lite.distributed.communicator import started

    lines: tuple[list[str], list[str]] = started().run(_solve_part, options)
    return lines


def _solve_part(ranks: Alone, options: Namespace) -> tuple[list[str], list[str]]:
    from kratos_lite.analysis.partitioned_static import solve_part
    from kratos_lite.cli.apply_options import case_of
    from kratos_lite.distributed.partition import Partition
    from kratos_lite.io.outputs import check_outputs
    from kratos_lite.io.run import check_case
    from kratos_lite.io.runners.outcome import Outcome
    from kratos_lite.io.writers.pvtu import write_pieces

    with ranks.agree_on_errors():
        case = case_of(options, part=ranks.rank)
        check_case(case)
        check_outputs(case)
        for path in case.outputs.paths():
            if not path.endswith(".pvtu"):
                text = "no process has the whole of a mesh in part files; write -o OUT.pvtu"
                raise InputError(f"{path}: {text}")
    mesh = case.model.mesh
    result = solve_part(case.model, Partition(ranks, mesh), case.solver, case.tolerance, None, case.petsc)
    for path in case.outputs.results:
        write_pieces(path, result, case.outputs.mode or "binary")
    return Outcome(case, result.table()).summary(verbose=options.verbose), case.outputs.results

"""What ``--engine petsc`` needs before a file is read: the ranks, PETSc, and options that it carries."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from kratos_lite.cli.apply_options import OF_TIME, refuse
from kratos_lite.distributed.communicator import world
from kratos_lite.distributed.petsc import parsed, petsc
from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.io.writers.endings import check_result, check_result_of_ranks

OF_STATICS = ("modes", "time", "restart", "state", *OF_TIME)
EXPECTED = (KratosLiteError, ArithmeticError, OSError)
"""Errors that a command may meet on any rank, while no other waits for PETSc."""


def refuse_serial_options(options: Namespace) -> None:
    """Raise InputError for an option that does not go with PETSc."""
    refuse(options, OF_STATICS, "does not go with --engine petsc, which solves statics; leave one out")
    refuse(options, ("rotation", "translation"), "does not go with --engine petsc, which solves statics")
    refuse(options, ("error",), "is for one process; leave it out, or --engine petsc")
    if Path(options.input).suffix.lower() == ".py":
        raise InputError(f"{options.input}: scripts are for one process; leave --engine petsc out")
    parsed(options.petsc)


def connected(launched: int) -> Any:
    """Return the ranks; InputError where mpi4py is missing, or does not belong to what has started them."""
    try:
        ranks: Any = world()
    except InputError:
        petsc()  # its error names both packages, which come together
        raise
    if launched > ranks.size:
        raise InputError(
            f"{launched} processes have been started, but mpi4py sees {ranks.size}: it was made for another "
            "MPI than that of this mpirun or srun; use the mpirun of its MPI (python -m mpi4py --version)"
        )
    ranks.shares = EXPECTED
    return ranks


def prepare(options: Namespace, ranks: Any) -> None:
    """Raise InputError, before anything is read, if PETSc is missing or many ranks cannot write an output."""
    petsc()
    if ranks.size > 1:
        refuse(options, ("picture",), "is drawn on one process; write -o OUT.pvtu for ParaView")
        for path in options.output:
            check_result_of_ranks(path)
            check_result(path)

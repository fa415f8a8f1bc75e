"""``kratos-lite-ccx``: in place of the solver ccx, for programs that start it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from kratos_lite import __version__
from kratos_lite.errors import KratosLiteError, within_numbers

ERROR = 201
"""Exit code of ccx after an error."""
USAGE = f"kratos-lite {__version__} in place of CalculiX: kratos-lite-ccx -i JOB solves JOB.inp"


def main(words: Sequence[str] | None = None) -> int:
    """Solve a deck as ccx does: ``-i JOB`` or ``JOB``; ``-v`` says the version."""
    given = [word.strip() for word in (sys.argv[1:] if words is None else words)]
    if "-v" in given:
        print(f"\nThis is Version 2.20 of CalculiX, as kratos-lite {__version__} stands in for it")
        return 0
    job = next((word for word in given if not word.startswith("-")), None)
    if job is None:
        print(USAGE)
        return 0
    from kratos_lite.io.abaqus.job import Job

    print(f"{USAGE.partition(':')[0]}\n")
    try:
        path = Path(job.removesuffix(".inp") + ".inp")
        with within_numbers(str(path)):
            Job(path, print).run()
    except (KratosLiteError, OSError) as error:
        print(f"\n*ERROR: {error}")
        return ERROR
    print("\nJob finished")
    return 0

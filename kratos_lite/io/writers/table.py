"""Tables: columns of numbers as `.csv`, one line for each node or point."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from kratos_lite.atomic import refuse_nan, write_whole
from kratos_lite.io.writers.endings import check_ending
from kratos_lite.typing import Numbers


def write_table(path: str | Path, columns: Mapping[str, Numbers]) -> None:
    """Write columns (k,) by their headers, as a whole or not at all; numbers are not rounded.

    >>> path = getfixture("tmp_path") / "two.csv"
    >>> write_table(path, {"node": np.array([1, 2]), "x [m]": np.array([0.1, 1.0])})
    >>> print(path.read_text())
    node,x [m]
    1,0.1
    2,1.0
    <BLANKLINE>
    """
    check_ending(path, ".csv")
    for name, values in columns.items():
        refuse_nan(path, name, values)
    cells = [map(repr, np.asarray(values).tolist()) for values in columns.values()]
    lines = [",".join(columns), *map(",".join, zip(*cells, strict=True))]
    write_whole(path, ("\n".join(lines) + "\n").encode())

"""Columns: numbers of results as tables, by headers with units, for files and data frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kratos_lite import voigt
from kratos_lite.errors import KratosLiteError
from kratos_lite.typing import Array, Numbers

AXES = ("x", "y", "z")
COMPONENTS = tuple(name.lower() for name in voigt.NAMES)


def vector_columns(name: str, values: Array, unit: str) -> dict[str, Numbers]:
    """Return the columns of vectors (n, 3).

    >>> import numpy as np
    >>> list(vector_columns("displacement", np.zeros((1, 3)), "m"))
    ['displacement x [m]', 'displacement y [m]', 'displacement z [m]']
    """
    return {f"{name} {axis} [{unit}]".lstrip(): values[:, i] for i, axis in enumerate(AXES)}


def stress_columns(stress: Array) -> dict[str, Numbers]:
    """Return the columns of stresses (n, 6) in Pa: components, von Mises, Tresca and principal stresses."""
    principal = voigt.principal_values(stress)
    return {
        **{f"stress {name} [Pa]": stress[:, i] for i, name in enumerate(COMPONENTS)},
        "von Mises stress [Pa]": voigt.von_mises(stress),
        "Tresca stress [Pa]": voigt.tresca(stress),
        **{f"principal stress {i + 1} [Pa]": principal[:, i] for i in range(3)},
    }


def data_frame(columns: Mapping[str, Numbers]) -> Any:
    """Return columns as a data frame of pandas.

    Raises
    ------
    KratosLiteError
        pandas is not installed.
    """
    try:
        from pandas import DataFrame
    except ImportError as error:
        raise KratosLiteError(
            "data frames need pandas: pip install pandas; kl.write('values.csv', ...) writes the same table "
            "without it"
        ) from error
    return DataFrame(columns)

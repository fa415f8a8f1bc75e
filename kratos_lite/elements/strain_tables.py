"""Strain tables: what elements add to the strain of the displacements, as kernels take it."""

from __future__ import annotations

from typing import NamedTuple

from kratos_lite.typing import Array


class StrainTables(NamedTuple):
    """What kernels need to add to the strain of the displacements; see `KinematicLinear.strain_tables`."""

    center: Array  # (n, 3), dN at the center
    functions: Array  # (g, 6) enhanced monomials; N - N(center) (g, n), or (g, 0), of a dilatation
    C: Array | None  # (6, 6) Pa, which enhanced modes depend on; None of a dilatation
    fraction: float  # of the dilatation that is projected

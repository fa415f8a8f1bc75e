"""Strain tables: what elements add to the strain of the displacements, as kernels take it."""

from __future__ import annotations

from typing import NamedTuple

from kratos_lite.typing import Array


class StrainTables(NamedTuple):
    """What kernels need to add to the strain of the displacements; see `KinematicLinear.strain_tables`.

    Attributes
    ----------
    center : (n, 3), dN at the center.
    functions : (g, 6), the monomials of enhanced modes at the Gauss points; or of a projected dilatation that
        is linear in x, y, z, N less N at the center, (g, n), and (g, 0) of a mean one.
    C : (6, 6) in Pa, which the enhanced modes depend on; None of a dilatation.
    share : of the dilatation that is projected.
    """

    center: Array
    functions: Array
    C: Array | None
    share: float

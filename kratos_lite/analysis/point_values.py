"""Point values: displacements, strains and stresses of a result anywhere in its mesh."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from kratos_lite import voigt
from kratos_lite.analysis.columns import data_frame, stress_columns, vector_columns
from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.mesh.locate import Located
from kratos_lite.typing import Array, Numbers


class PointValues:
    """Values of a result at points (...) of its mesh, each computed when it is first asked for.

    Those of a face between elements, where strains jump, are of the element in the lowest row.

    Parameters
    ----------
    fields : the result.
    located : where the points lie.
    recovered : stresses are those recovered at nodes, interpolated in the element that holds the point, of
        its material; otherwise C B u there.
    """

    def __init__(self, fields: ElementFields, located: Located, recovered: bool = False) -> None:
        self._fields = fields
        self._located = located
        self._recovered = recovered

    def __repr__(self) -> str:
        name, shape = type(self).__name__, self.points.shape
        return f"{name} at points {shape}: displacement, strain, stress, von_mises, ..."

    @property
    def points(self) -> Array:
        """The points (..., 3) in m."""
        return self._located.points

    @cached_property
    def displacement(self) -> Array:
        """Displacements N u (..., 3) in m."""
        return self._located.interpolate(self._fields.u)

    @cached_property
    def strain(self) -> Array:
        """Strains B u (..., 6) in Voigt order xx yy zz xy yz zx, with engineering shear."""
        return self._fields.at_located(self._located, stress=False)

    @cached_property
    def stress(self) -> Array:
        """Stresses (..., 6) in Pa in Voigt order xx yy zz xy yz zx."""
        return self._fields.at_located(self._located, recovered=self._recovered)

    @property
    def von_mises(self) -> Array:
        """Von Mises stresses (...) in Pa."""
        return voigt.von_mises(self.stress)

    @property
    def tresca(self) -> Array:
        """Tresca stresses σ1 - σ3 (...) in Pa, twice the largest shear stress."""
        return voigt.tresca(self.stress)

    @property
    def principal_stresses(self) -> Array:
        """Principal stresses σ1 ≥ σ2 ≥ σ3 (..., 3) in Pa."""
        return voigt.principal_values(self.stress)

    @property
    def principal_directions(self) -> Array:
        """Unit vectors along the principal axes of the stress, rows (..., 3, 3) as σ1 ≥ σ2 ≥ σ3."""
        return voigt.principal_directions(self.stress)

    def columns(self) -> dict[str, Numbers]:
        """Return coordinates, displacements and stresses of the points in a row, with units in the headers.

        Returns
        -------
        dict of str to (k,) array
            ``kl.write("values.csv", values)`` writes them.
        """
        return {
            **vector_columns("", self.points.reshape(-1, 3), "m"),
            **vector_columns("displacement", self.displacement.reshape(-1, 3), "m"),
            **stress_columns(self.stress.reshape(-1, 6)),
        }

    def to_dataframe(self) -> Any:
        """Return the columns as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        KratosLiteError
            pandas is not installed.
        """
        return data_frame(self.columns())

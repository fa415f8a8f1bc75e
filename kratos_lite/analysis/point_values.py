"""Point values: displacements, strains and stresses of a result anywhere in its mesh."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.analysis.fields import FIELDS, PLACE, data_frame, listed
from kratos_lite.errors import nearest
from kratos_lite.mesh.locate import Located
from kratos_lite.typing import Array, Numbers


class PointValues:
    """Values of a result at points (...) of its mesh, each computed when it is first asked for.

    Beside the attributes below, it has every field that the table of fields knows at points: ``von_mises``,
    ``tresca``, ``principal_stresses``, ``principal_directions``, ``strain_energy_density``, …

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
    def elastic(self) -> tuple[Array, Array]:
        """Strains and stresses (..., 6) in Pa without prestress, both recovered, or both of B u."""
        strain, stress = (
            self._fields.without_prestress.at_located(self._located, stress=stress, recovered=self._recovered)
            for stress in (False, True)
        )
        return strain, stress

    def __getattr__(self, name: str) -> Array:
        if name not in FIELDS or "point" not in FIELDS[name].where:
            raise AttributeError(f"{type(self).__name__} has no field {name!r}.{nearest(name, FIELDS, 1)}")
        return FIELDS[name].at(self)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *FIELDS]

    def columns(self) -> dict[str, Numbers]:
        """Return coordinates and fields of the points in a row, with units in the headers.

        Returns
        -------
        dict of str to (k,) array
            ``kl.write("values.csv", values)`` writes them.
        """
        columns = PLACE.columns(self.points)
        for field in listed("point").values():
            columns |= field.columns(field.at(self))
        return columns

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

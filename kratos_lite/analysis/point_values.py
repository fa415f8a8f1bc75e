"""Point values: displacements, strains and stresses of a result anywhere in its mesh."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.analysis.fields import COMPONENTS, PLACE, Field, data_frame, known, labelled, listed
from kratos_lite.errors import nearest
from kratos_lite.mesh.crossings import crossings
from kratos_lite.mesh.locate import Located
from kratos_lite.quadrature.gauss import legendre
from kratos_lite.tabular import unit_name
from kratos_lite.typing import Array, Numbers
from kratos_lite.validation import choice


class PointValues:
    """Values of a result at points (...) of its mesh, each computed when it is first requested.

    Beside the attributes below, it has every field that the table of fields knows at points: ``von_mises``,
    ``tresca``, ``principal_stresses``, ``principal_directions``, ``strain_energy_density``, …, and internal
    variables of laws, such as ``plastic_strain``.

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
        if name.startswith("_"):
            raise AttributeError(name)
        fields = self._known
        if name not in fields:
            raise AttributeError(f"{type(self).__name__} has no field {name!r}.{nearest(name, fields, 1)}")
        return self._at(fields[name])

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._known]

    @property
    def _known(self) -> dict[str, Field]:
        """The fields that there are at points."""
        return {name: field for name, field in known(self._fields.groups).items() if "point" in field.where}

    def _at(self, field: Field) -> Array:
        return self._fields.sampled_at(field, self._located) if field.sampled else field.at(self)

    def columns(self) -> dict[str, Numbers]:
        """Return coordinates and fields of the points in a row, with units in the headers.

        Returns
        -------
        dict of str to (k,) array
            ``kl.write("values.csv", values)`` writes them.
        """
        columns = PLACE.columns(self.points)
        for field in listed("point", self._fields.groups).values():
            columns |= field.columns(self._at(field))
        return labelled(columns, self._fields.mesh.units)

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


GAUSS_POINTS = 5  # on the part of a line in one element: exact to degree 9 of x σ
ZERO = 1e-10  # fraction of the largest stress that is drawn as 0: rounding


class LineValues(PointValues):
    """Values of a result at n points of the line from a to b, and its linearized stress.

    With x from 0 to t along the line, the membrane part of the stress is its mean, the bending part the one
    that is linear in x with the same moment, and the peak is the rest:

    σ = σ_m + σ_b (1 - 2 x / t) + σ_p,   σ_m = 1/t ∫ σ dx,   σ_b = 6/t² ∫ σ (t/2 - x) dx.

    Each component is treated alone, in the axes of the model, and the integrals are sums over the pieces of
    the line in its elements.

    Source: ASME Boiler and Pressure Vessel Code VIII-2, annex 5-A, for solids without the terms of curvature.

    Parameters
    ----------
    fields : the result.
    ends : (2, 3) m.
    n : number of points, at equal distances.
    recovered : as for `PointValues`.
    """

    def __init__(self, fields: ElementFields, ends: Array, n: int, recovered: bool = False) -> None:
        self._ends = ends
        self.distance = np.linspace(0.0, float(np.linalg.norm(ends[1] - ends[0])), n)
        located = fields.mesh.locate(self._on_line(np.linspace(0, 1, n)), required=True)
        super().__init__(fields, located, recovered)

    def _on_line(self, t: Array) -> Array:
        """Return points (..., 3) at fractions t (...) of the line."""
        a, b = self._ends
        return a * (1 - t[..., None]) + b * t[..., None]

    @cached_property
    def _moments(self) -> tuple[Array, Array]:
        """Membrane and bending part (6,) in Pa."""
        edges = crossings(self._fields.mesh, *self._ends)
        x, weights = legendre(GAUSS_POINTS)
        half = np.diff(edges)[:, None] / 2
        t, weight = edges[:-1, None] + half * (1 + x), half * weights
        located = self._fields.mesh.locate(self._on_line(t), required=True)
        stress = self._fields.at_located(located, recovered=self._recovered)
        membrane, bending = (np.tensordot(weight * f, stress, 2) for f in (1.0, 6 * (0.5 - t)))
        return membrane, bending

    @property
    def membrane(self) -> Array:
        """Mean stress σ_m (6,) in Pa."""
        return self._moments[0]

    @property
    def bending(self) -> Array:
        """Bending stress σ_b (6,) in Pa where the line begins; it is -σ_b where it ends."""
        return self._moments[1]

    @property
    def linear(self) -> Array:
        """Membrane and bending stress σ_m + σ_b (1 - 2 x / t) together, (n, 6) in Pa."""
        fraction = self.distance[:, None] / self.distance[-1]
        return self.membrane + self.bending * (1 - 2 * fraction)

    @property
    def peak(self) -> Array:
        """What the stress is beyond that, (n, 6) in Pa."""
        return self.stress - self.linear

    def columns(self) -> dict[str, Numbers]:
        """Return distance, coordinates and fields, with units in the headers."""
        return labelled({"distance [m]": self.distance, **super().columns()}, self._fields.mesh.units)

    def plot(
        self,
        path: str | Path | None = None,
        values: str = "von_mises",
        *,
        title: str = "",
        size: tuple[float, float] = (6, 4),
    ) -> Any:
        """Draw values along the line; of a stress component also its membrane and bending part.

        Parameters
        ----------
        path : picture to write; .png, .pdf or .svg.
        values : a field by its name in pictures, as for `kratos_lite.plot`, but for reactions and errors.
        title : above the picture.
        size : width and height in inches, at 150 dots per inch.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        InputError
            There are no such values, the size is none, or the file cannot be written.
        KratosLiteError
            matplotlib is missing.
        """
        from kratos_lite.analysis.subjects import named_values, names_of_parts  # pictures alone need these
        from kratos_lite.view.canvas import checked_size, saved
        from kratos_lite.view.curves import line_figure

        names = names_of_parts(self._known)
        shown = named_values(names[choice(values, "values", names)], lambda name: getattr(self, name))
        curves = {shown.title: shown.numbers}
        if shown.unit == "Pa":
            seen = np.abs(shown.numbers) > ZERO * np.abs(self.stress).max()
            curves[shown.title] = np.where(seen, shown.numbers, 0.0)
        if values[1:] in COMPONENTS and shown.unit == "Pa":
            i = COMPONENTS.index(values[1:])
            curves["membrane and bending"] = self.linear[:, i]
            curves["membrane"] = np.full(len(self.distance), self.membrane[i])
        units = [unit_name(unit, self._fields.mesh.units) for unit in ("m", shown.unit)]
        inches = checked_size(size) or (6, 4)
        return saved(line_figure(self.distance, curves, units, title, inches), path)

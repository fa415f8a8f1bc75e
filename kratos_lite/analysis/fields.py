"""Fields: the one table of what a result holds, which files, tables, pages and pictures read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter, methodcaller
from typing import Any, Protocol, runtime_checkable

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import (
    at_gauss,
    deformation_gradient,
    energy_density,
    of_law,
    volumes,
)
from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import KratosLiteError
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.vtk import mesh_fields
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.tabular import in_units
from kratos_lite.typing import Array, Numbers
from kratos_lite.validation import instance

AXES = ("x", "y", "z")
COMPONENTS = tuple(name.lower() for name in voigt.NAMES)
PARTS: dict[str, tuple[str, ...]] = {
    "scalar": (),
    "vector": AXES,
    "tensor": COMPONENTS,
    "principal": ("1", "2", "3"),
    "axes": (),
}
"""Kinds of fields and their parts; tensors are in Voigt order, principal values in descending order."""
NODES, ELEMENTS, STATES = ("node",), ("element",), ("state",)
INTERPOLATED = ("node", "gauss", "point")
INTEGRATED = ("gauss", "element", "node", "point")
EVERYWHERE = ("gauss", "element", "node", "averaged", "raw", "point")


@dataclass(frozen=True, eq=False)
class Field:
    """A field of results."""

    name: str  # in headings and legends
    kratos: str  # its variable in Kratos and in files for ParaView, which hold it if there is one
    unit: str  # in SI; `in_units` says it in others
    kind: str  # a key of `PARTS`
    # ``point`` is any point of the mesh, ``state`` the nodes in a state; others as of `ElementFields.stress`
    where: tuple[str, ...]
    function: Callable[[Any], Array]  # of the values at a place, such as `PointValues`; or of the tensor `of`
    of: str = ""  # key of the tensor whose invariant it is
    symbol: str = ""  # before the names of its parts, as in ``sxx``; pictures show no parts without it
    listed: bool = True  # whether files and tables hold it
    log: bool = False  # whether pictures show it on a logarithmic scale
    sampled: bool = False  # known at Gauss points alone: elsewhere extrapolated from there, at nodes averaged
    local: LocalAxes | None = None  # the axes of its parts, if not x y z
    needs: str = ""  # files hold it only of ``linear`` laws and strains, or where one of them is ``finite``

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of its parts; a kind that is a number has that many."""
        parts = PARTS[self.kind] if self.kind in PARTS else tuple(str(i + 1) for i in range(int(self.kind)))
        letters = str.maketrans("xyz", self.local.letters if self.local else "xyz")
        return tuple(part.translate(letters) for part in parts)

    @property
    def nodal_place(self) -> str:
        """Where pictures show it: at nodes if it is known there."""
        return "node" if "node" in self.where else "element"

    def along(self, local: LocalAxes | None) -> Field:
        """Return the field with its parts along local axes, if it has parts along axes."""
        if local is None or self.kind not in ("vector", "tensor"):
            return self
        return replace(self, local=instance(local, "local", LocalAxes, "kl.Cylindrical()"))

    def turned(self, values: Array, points: Array) -> Array:
        """Return values (..., parts) of the axes x y z at points (..., 3) along the axes of the field."""
        if self.local is None:
            return values
        if self.kind == "vector":
            return self.local.vectors(values, points)
        shear = 1.0 if self.unit else voigt.HALF_SHEAR  # strains have engineering shear
        return self.local.stresses(values * shear, points) / shear

    def at(self, values: Any) -> Array:
        """Return the field (..., parts) from the values at a place."""
        return self.function(getattr(values, self.of) if self.of else values)

    def columns(self, values: Array) -> dict[str, Numbers]:
        """Return the columns of a table from values (..., parts), by headers in ASCII.

        >>> import numpy as np
        >>> list(FIELDS["displacement"].columns(np.zeros((1, 3))))
        ['displacement x [m]', 'displacement y [m]', 'displacement z [m]']
        """
        parts, unit = self.parts or ("",), f"[{self.unit.replace('³', '3')}]" if self.unit else ""
        flat = values.reshape(-1, len(parts))
        return {" ".join(f"{self.name} {part} {unit}".split()): flat[:, i] for i, part in enumerate(parts)}


def _strain_energy_density(at: Any) -> Array:
    """Return ½ ε:C:ε, without the work of a prestress; or the energy of a law that is not linear."""
    if isinstance(at, GaussPoints) and not at.group.is_linear:
        return energy_density(at.points, at.group, at.strained)
    strain, stress = at.elastic
    return (strain * stress).sum(axis=-1) / 2


FIELDS: dict[str, Field] = {
    "displacement": Field(
        "displacement", "DISPLACEMENT", "m", "vector", INTERPOLATED, attrgetter("displacement"), symbol="u"
    ),
    "reaction": Field("reaction", "REACTION", "N", "vector", NODES, attrgetter("reactions")),
    "stress": Field(
        "stress", "CAUCHY_STRESS_VECTOR", "Pa", "tensor", EVERYWHERE, attrgetter("stress"), symbol="s"
    ),
    "von_mises": Field(
        "von Mises stress", "VON_MISES_STRESS", "Pa", "scalar", EVERYWHERE, voigt.von_mises, "stress"
    ),
    "tresca": Field("Tresca stress", "", "Pa", "scalar", EVERYWHERE, voigt.tresca, "stress"),
    "principal_stresses": Field(
        "principal stress", "", "Pa", "principal", EVERYWHERE, voigt.principal_values, "stress", "s"
    ),
    "principal_directions": Field(
        "principal axes", "", "", "axes", EVERYWHERE, voigt.principal_directions, "stress", listed=False
    ),
    "strain": Field(
        "strain", "GREEN_LAGRANGE_STRAIN_VECTOR", "", "tensor", EVERYWHERE, attrgetter("strain"),
        symbol="e", listed=False,
    ),
    "principal_strains": Field(
        "principal strain", "", "", "principal", EVERYWHERE,
        lambda strain: voigt.principal_values(strain * voigt.HALF_SHEAR), "strain", "e", listed=False,
    ),
    "strain_energy_density": Field(
        "strain energy density", "STRAIN_ENERGY", "J/m³", "scalar", INTEGRATED, _strain_energy_density
    ),
    "error": Field(
        "estimated error", "ENERGY_NORM_ERROR", "√J", "scalar", ELEMENTS, 
        lambda result: result.error().per_element, log=True, needs="linear",
    ),
    "pk2_stress": Field(
        "second Piola-Kirchhoff stress", "PK2_STRESS_VECTOR", "Pa", "tensor", EVERYWHERE, attrgetter("pk2"),
        sampled=True, needs="finite",
    ),
    "deformation_gradient": Field(
        "deformation gradient", "DEFORMATION_GRADIENT", "", "axes", EVERYWHERE, attrgetter("F"),
        sampled=True, needs="finite", listed=False,
    ),
    "velocity": Field("velocity", "VELOCITY", "m/s", "vector", STATES, attrgetter("v")),
    "acceleration": Field("acceleration", "ACCELERATION", "m/s²", "vector", STATES, attrgetter("a")),
}  # fmt: skip
VARIABLES = {
    "plastic_strain": ("PLASTIC_STRAIN_VECTOR", ""),
    "accumulated_plastic_strain": ("ACCUMULATED_PLASTIC_STRAIN", ""),
    "back_stress": ("BACK_STRESS_VECTOR", "Pa"),
    "plastic_dissipation": ("PLASTIC_DISSIPATION", ""),
    "damage": ("DAMAGE", ""),
    "element_length": ("element_length", "m"),
}
"""Kratos's names and units of internal variables; others have their own name, and Pa if they are stresses."""
PLACE = Field("", "", "m", "vector", INTERPOLATED, attrgetter("points"))


@runtime_checkable
class Fields(Protocol):
    """What a result offers."""

    mesh: Mesh
    groups: list[ElementGroup]
    u: Array
    reactions: Array
    loads: Array

    def field(self, name: str, at: str, local: LocalAxes | None = None) -> Any:
        """Return a field at a place, along local axes if these are not x y z."""

    def at(self, points: Array) -> Any:
        """Return displacements and stresses at points."""

    def stress_in(self, group: ElementGroup) -> Array:
        """Return stresses (m, g, 6) in Pa at the Gauss points of elements."""

    def stress_of_material(self, row: int) -> Array:
        """Return recovered stresses (n, 6) in Pa at the nodes of the material of an element."""

    def totals(self) -> tuple[float, float, int]:
        """Return strain energy, largest von Mises stress of Gauss points and the index of its element."""


def variable(name: str, size: int) -> Field:
    """Return an internal variable of a law, of so many numbers, as a field."""
    kratos, unit = VARIABLES.get(name, (name, "Pa" if "stress" in name else ""))
    kind = {1: "scalar", 3: "vector", 6: "tensor"}.get(size, str(size))
    text, symbol = name.replace("_", " "), f"{name}_"
    get = methodcaller("variable", name, size)
    return Field(text, kratos, unit, kind, EVERYWHERE, get, symbol=symbol, sampled=True)


def known(groups: Sequence[ElementGroup]) -> dict[str, Field]:
    """Return the fields of a result of groups: those of the table, and the internal variables of its laws."""
    if all(group.is_linear and group.heating is None for group in groups):
        return FIELDS
    energy = replace(FIELDS["strain_energy_density"], where=EVERYWHERE, sampled=True)
    laws = [group.material for group in groups]
    sizes = [(law, name, size) for law in laws for name, size in law.internal_variables.items()]
    found = FIELDS | {"strain_energy_density": energy}
    for law, name, size in sizes:
        field = variable(name, size)
        known_as = found.get(name, field)
        alike = (known_as.name, known_as.kind) == (field.name, field.kind)
        key = name if alike else f"{type(law).__name__}_{name}"
        found[key] = field
    return found


def listed(place: str, groups: Sequence[ElementGroup] = ()) -> dict[str, Field]:
    """Return the fields of a place that files and tables of a result of groups hold."""
    has = {
        "": True,
        "linear": all(group.is_linear for group in groups),
        "finite": any(group.element.finite for group in groups),
    }
    fields = known(groups).items()
    return {
        name: field for name, field in fields if field.listed and place in field.where and has[field.needs]
    }


def fields(result: Fields) -> tuple[dict[str, Numbers], dict[str, Numbers]]:
    """Return point data and cell data of a result by Kratos's names, as files and viewers hold them."""
    points, cells = (
        {f.kratos: result.field(name, place) for name, f in listed(place, result.groups).items() if f.kratos}
        | ids
        for place, ids in zip(("node", "element"), mesh_fields(result.mesh), strict=True)
    )
    return points, cells


def nodal_columns(result: Fields, local: LocalAxes | None = None) -> dict[str, Numbers]:
    """Return ids, places and the fields of the nodes, along local axes if these are not x y z."""
    columns = {"node": result.mesh.node_ids, **PLACE.columns(result.mesh.points)}
    for name, field in listed("node", result.groups).items():
        columns |= field.along(local).columns(result.field(name, "node", local))
    return labelled(columns, result.mesh.units)


def labelled(columns: Mapping[str, Numbers], units: str) -> dict[str, Numbers]:
    """Return columns whose headers are in a set of units."""
    return {in_units(name, units): values for name, values in columns.items()}


def data_frame(columns: Mapping[str, Numbers]) -> Any:
    """Return columns as a data frame of pandas; KratosLiteError if pandas is not installed."""
    try:
        from pandas import DataFrame
    except ImportError as error:
        raise KratosLiteError(
            "data frames need pandas: pip install pandas; kl.write('values.csv', ...) writes the same table "
            "without it"
        ) from error
    return DataFrame(columns)


@dataclass(eq=False)
class GaussPoints:
    """The g Gauss points of m elements."""

    points: Array  # (n, 3) in m, the nodes of the mesh
    group: ElementGroup  # the elements
    u: Array  # (n, 3) in m, the displacement
    strained: Array  # (n, 3) in m, the displacement without its stress-free part

    @cached_property
    def element(self) -> KinematicLinear:
        """The elements, placed."""
        return self.group.at(self.points)

    @property
    def strain(self) -> Array:
        """ε (m, g, 6), engineering shear."""
        return at_gauss(self.points, self.group, self.strained, stress=False)

    @property
    def stress(self) -> Array:
        """σ (m, g, 6) in Pa, with the prestress."""
        return at_gauss(self.points, self.group, self.strained)

    @property
    def pk2(self) -> Array:
        """S (m, g, 6) in Pa, which is σ at small strains."""
        return self.stress if self.group.is_linear else of_law(self.points, self.group, self.strained)[1]

    @property
    def F(self) -> Array:
        """F (m, g, 3, 3), 1 + ε at small strains."""
        return deformation_gradient(self.points, self.group, self.strained)

    def variable(self, name: str, size: int) -> Array:
        """Return an internal variable (m, g, size), or (m, g) of one number; 0 where the law has none."""
        states, none = self.group.states, np.zeros((len(self.group), len(self.group.rule), size))
        values = none if states is None else states.variables.get(name, none)
        values = values if values.shape == none.shape else none
        return values[..., 0] if size == 1 else values

    @property
    def elastic(self) -> tuple[Array, Array]:
        """The elastic strain and its stress (m, g, 6) in Pa, without prestress."""
        strain = self.strain - self.group.thermal_strain()
        return strain, self.group.elastic(strain)

    @property
    def displacement(self) -> Array:
        """Displacement (m, g, 3) in m."""
        return self.element._N(self.group.rule) @ self.u[self.group.nodes]

    def mean(self, values: Array) -> Array:
        """Return the means over the volume of each element (m, ...) of values (m, g, ...)."""
        volume = volumes(self.points, self.group)
        return np.asarray(np.einsum("mg,mg...->m...", volume / volume.sum(axis=1, keepdims=True), values))


QUANTITIES: dict[str, Callable[[GaussPoints], Array]] = {
    **{field.kratos: field.at for field in FIELDS.values() if field.kratos and "gauss" in field.where},
    "CAUCHY_STRESS_TENSOR": lambda at: voigt.tensor(at.stress),
    "PK2_STRESS_TENSOR": lambda at: voigt.tensor(at.pk2),
    "STRESSES": FIELDS["stress"].at,
    "GREEN_LAGRANGE_STRAIN_TENSOR": lambda at: voigt.tensor(at.strain * voigt.HALF_SHEAR),
    "STRAIN": FIELDS["strain"].at,
    "CONSTITUTIVE_MATRIX": lambda at: at.group.scaled(
        np.tile(at.group.material.C, (*at.element.dV.shape, 1, 1))
    ),
    "JACOBIAN": lambda at: at.element.dV / at.group.rule.weights,
    "JACOBIAN_0": lambda at: at.element.dV / at.group.rule.weights,
    "INTEGRATION_WEIGHT": lambda at: at.element.dV,
    "INTEGRATION_COORDINATES": lambda at: at.element.gauss_points(),
    "INTEGRATION_POINT_GLOBAL": lambda at: at.element.gauss_points(),
    "INTEGRATION_POINT_LOCAL": lambda at: np.tile(at.group.rule.points, (len(at.group), 1, 1)),
    "STRAIN_INTERPOLATION_OPERATOR": lambda at: at.element._operator(at.group.material.C),
}
"""What is known at Gauss points by Kratos's names, beside internal variables.

Names are those of KinematicLinear and SmallDisplacementElement.
"""

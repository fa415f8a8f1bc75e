"""Temperature: thermal strain."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh, WhereElements, mask_of
from kratos_lite.model.loads.base import Load, OfPlace, at_places, is_of_places
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import finite, number

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh


class Temperature(Load):
    """A temperature of the body, which strains it by α (T - reference) without stress where it is free.

    α is the `alpha` of the materials.  Temperatures that act together add their differences to the reference.

    Parameters
    ----------
    values : °C or K: one number, (n,) of the nodes, or a function of places (m, 3) that gives (m,) of nodes.
    reference : temperature without thermal strain, in the same unit.
    where : elements that have it: part name, property id or indices; all if not given.

    Raises
    ------
    InputError
        The values have another shape, or are not finite.

    Notes
    -----
    Between nodes T is interpolated by the shape functions; linear elements take the mean of their nodes, as
    their strains cannot follow more.  σ = C (B u - α ΔT), and the nodes are loaded by ∫ B^T C α ΔT dV.
    At large displacements Green's strain of the stretch 1 + α ΔT takes the place of α ΔT.
    Source: Cook, Malkus, Plesha & Witt, Concepts and Applications of Finite Element Analysis (2002), section
    3.9.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box(), kl.Isotropic3D(E=200e9, nu=0.0, alpha=12e-6))
    >>> bar.fix("z-")
    >>> bar.fix("z+", "z")
    >>> bar.add(kl.Temperature(120.0, reference=20.0))
    >>> print(f"{bar.solve().stress('element')[0, 2] / 1e6:.1f} MPa")  # -E α ΔT
    -240.0 MPa
    """

    unit = " [°C or K]"

    def __init__(
        self, values: ArrayLike | OfPlace, reference: float = 0.0, where: WhereElements = None
    ) -> None:
        if not is_of_places(values, "a temperature"):
            values = finite(values, "temperatures")
            if values.ndim > 1:
                raise InputError(f"temperatures are a number or (n,) of the nodes; got shape {values.shape}")
        self.values: Any = values
        self.reference, self.where = number(reference, "the reference temperature"), where

    def check(self, mesh: Mesh) -> None:
        """Raise an error if there is no such part, or another number of nodes."""
        mesh.elements(self.where)
        self.difference(mesh)

    def difference(self, mesh: Mesh) -> Array:
        """Return T - reference (n,) of the nodes of a mesh.

        Parameters
        ----------
        mesh : of which the nodes are.

        Returns
        -------
        (n,) in K.

        Raises
        ------
        InputError
            The mesh has another number of nodes.
        """
        if callable(self.values):
            values = at_places(self.values, "a temperature", ())(mesh.points)
        else:
            values = self.values
        if np.shape(values) not in ((), (mesh.n_nodes,)):
            raise InputError(f"temperatures of nodes need shape ({mesh.n_nodes},); got {np.shape(values)}")
        return np.broadcast_to(values - self.reference, (mesh.n_nodes,))

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return no forces: a temperature strains, and pushes nothing."""
        return np.zeros_like(mesh.points)

    def by_coordinates(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return 0, of temperatures of nodes; ModelError of a function of places."""
        if callable(self.values):
            raise self.without_derivative("it is a function of places")
        return np.zeros_like(v)

    def warnings(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[str]:
        """Return a warning if no element swells."""
        has = mask_of(mesh.elements(self.where), mesh.n_elements)
        if any(has[group.rows].any() and group.material.expansion.any() for group in groups):
            return []
        return [f"{self!r} strains nothing: no material there has an alpha, its thermal expansion"]

    def refined(self, finer: RefinedMesh) -> Load:
        """Return the temperature on a finer mesh."""
        nodal = not callable(self.values) and np.ndim(self.values)
        values = finer.interpolate(self.values) if nodal else self.values
        return Temperature(values, self.reference, finer.where_elements(self.where))


def heated(
    mesh: Mesh, groups: Sequence[ElementGroup], acting: Iterable[tuple[float, Load]]
) -> list[ElementGroup]:
    """Return groups with the temperatures among some loads, each with a factor; the same ones without any."""
    temperatures = [(factor, load) for factor, load in acting if isinstance(load, Temperature)]
    if not temperatures:
        return list(groups)
    heating = [np.zeros(group.nodes.shape) for group in groups]
    for factor, load in temperatures:
        has = mask_of(mesh.elements(load.where), mesh.n_elements)
        difference = factor * load.difference(mesh)
        for i, group in enumerate(groups):
            heating[i] += np.where(has[group.rows][:, None], difference[group.nodes], 0.0)
    return [_heated(group, values) for group, values in zip(groups, heating, strict=True)]


def _heated(group: ElementGroup, heating: Array) -> ElementGroup:
    if not (heating.any() and group.material.expansion.any()):
        return group
    if "local_system" in group.element.custom:
        raise ModelError(
            f"{group.element.__name__}: a temperature is for no local system of one's own; leave it out"
        )
    return replace(group, heating=heating)

"""CellMass: body forces and mass of placed cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.elements import arguments
from kratos_lite.elements.geometry import PlacedCell
from kratos_lite.elements.tables import lumped
from kratos_lite.errors import InputError
from kratos_lite.quadrature import Rule
from kratos_lite.typing import Array


class CellMass(PlacedCell):
    """Body forces and mass of a cell: shape × mass rule at the places X of its nodes."""

    mass_rule: Rule

    def body_force(self, b: ArrayLike) -> Array:
        """Return the load r_ext = Σ N b γ det J of a body force.

        Parameters
        ----------
        b : (3,) or (..., 3) constant, or (..., n, 3) at the nodes; N/m³.

        Returns
        -------
        (..., n, 3) float, N

        Raises
        ------
        InputError
            If `b` is none of these.
        """
        force = arguments.real(b, "a body force b", (3,), "give its x, y and z in N/m³")
        if force.ndim == self.X.ndim and force.shape[-2:] == self.nodes.shape:
            return self.scalar_mass() @ arguments.nodal(force, self.X, "a body force b")
        if force.shape[:-1] not in ((), self.X.shape[:-2]):
            raise InputError(
                f"a body force b must have shape (3,), {(*self.X.shape[:-2], 3)} or {self.X.shape}; "
                f"got {force.shape}"
            )
        share = self.dV @ self._N(self.rule)
        return share[..., :, None] * force[..., None, :]

    def scalar_mass(self, density: ArrayLike = 1.0) -> Array:
        """Return the mass matrix of one axis, Σ ρ N N^T γ det J.

        Parameters
        ----------
        density : number, or (...) one for each element; kg/m³.

        Returns
        -------
        (..., n, n) float, kg

        Raises
        ------
        InputError
            If the density is none of these.
        """
        rho = arguments.density(density, self.X)
        N = self._N(self.mass_rule)
        dV = self._volumes(self.mass_rule) * rho[..., None]
        return (N.T * dV[..., None, :]) @ N

    def mass(self, density: ArrayLike) -> Array:
        """Return the consistent mass matrix.

        Parameters
        ----------
        density : number, or (...) one for each element; kg/m³.

        Returns
        -------
        (..., 3n, 3n) float, kg

        Raises
        ------
        InputError
            If the density is none of these.
        """
        m = self.scalar_mass(density)
        n = len(self.nodes)
        M = m[..., :, None, :, None] * np.eye(3)[:, None, :]
        return M.reshape(*m.shape[:-2], 3 * n, 3 * n)

    def lumped_mass(self, density: ArrayLike) -> Array:
        """Return the mass of each node; it is positive and sums to the mass of the element.

        It is the row sum where row sums are positive, on the reference cell and on the element; otherwise
        the scaled diagonal of Hinton, Rock & Zienkiewicz, Earthq. Eng. Struct. Dyn. 4 (1976) 245-249.

        Parameters
        ----------
        density : number, or (...) one for each element; kg/m³.

        Returns
        -------
        (..., n) float, kg

        Raises
        ------
        InputError
            If the density is none of these.
        """
        m = self.scalar_mass(density)
        diagonal = np.diagonal(m, axis1=-2, axis2=-1)
        return lumped(m.sum(axis=-1), diagonal, self.shape, self.mass_rule)

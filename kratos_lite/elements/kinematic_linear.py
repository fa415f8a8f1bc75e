"""KinematicLinear: small-strain solid elements built on the B-operator.

One class serves one element, X (n, 3), or a batch, X (..., n, 3): all methods broadcast over
the leading axes.  With g Gauss points xi and weights gamma,

    r_int = Σ B^T σ γ det J        r_ext = ∫ N ρg dV        K = Σ B^T C B γ det J

Source: KratosWiki, *Kinematic Linear Element*; Zienkiewicz & Taylor, vol. 1, ch. 6.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.elements import arguments, custom, tables
from kratos_lite.elements.mass import CellMass
from kratos_lite.elements.tables import StrainTables
from kratos_lite.errors import InputError
from kratos_lite.quadrature import Rule
from kratos_lite.registry import Registry
from kratos_lite.typing import Array
from kratos_lite.validation import short

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

ELEMENTS: Registry[type[KinematicLinear]] = Registry("element")
"""Every element by its class name and by the names that mean the same in files."""

SAME_ELEMENT = ("SmallDisplacementElement", "TotalLagrangian", "Element")
"""Prefixes of element names in files that are solved as KinematicLinear."""
UNNAMED = "Element3D"
"""Start of the names that say the number of nodes alone; see `elements.formulations`."""


def same_names(name: str) -> list[str]:
    """Return the names in files that mean the element class of a name."""
    suffix = name.removeprefix("KinematicLinear")
    return [] if suffix == name else [prefix + suffix for prefix in SAME_ELEMENT]


class KinematicLinear(CellMass):
    """A small-strain solid element: shape × rule × the B-operator.

    Parameters
    ----------
    X : (n, 3) or (..., n, 3) float, m; reference coordinates of the nodes.
    rule : quadrature rule in place of the element's own.

    Raises
    ------
    MeshError
        If X does not have the right shape, or is not made of real numbers.
    InputError
        If `rule` is not a rule.

    Notes
    -----
    A subclass states `shape` and `rule`; it may state a `mass_rule` in place of exact rules for the mass, its
    `formulation`, a word, whether it is total Lagrangian (`finite`), and how many `spurious_modes` (modes
    without energy beside the rigid ones) one element alone has.  It may override `B`, from which all else
    follows, or `local_system`; nothing else.  These take one element, X (n, 3), unless the class that defines
    them states ``batched = True``.
    Voigt rows are xx yy zz xy yz zx with engineering shear; dof = 3·node + axis.

    Examples
    --------
    >>> from kratos_lite import Isotropic3D, KinematicLinear3D8N
    >>> element = KinematicLinear3D8N(0.5 * KinematicLinear3D8N.nodes)
    >>> K = element.stiffness(Isotropic3D(E=210e6, nu=0.3).C)
    >>> K.shape, round(float(element.volume()), 12)
    ((24, 24), 1.0)
    """

    aliases: ClassVar[tuple[str, ...]] = ()
    formulation: ClassVar[str] = "standard"
    spurious_modes: ClassVar[int] = 0
    finite: ClassVar[bool] = False
    batched: ClassVar[bool] = False
    custom: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.custom = custom.custom_methods(cls)
        if not (hasattr(cls, "shape") and hasattr(cls, "rule")):
            return  # a family of elements, not an element
        if not isinstance(cls.rule, Rule):
            expected = f"kratos_lite.quadrature.{cls.shape.cell}(degree=3)"
            raise InputError(f"{cls.__name__}.rule must be a Rule, such as {expected}; got {short(cls.rule)}")
        ELEMENTS.add(cls.__name__, cls, [*cls.__dict__.get("aliases", ()), *same_names(cls.__name__)])

    @classmethod
    def has_standard_strain(cls) -> bool:
        """Return whether the strain is that of the displacement gradient, which is quicker than B u."""
        return cls.B is KinematicLinear.B

    @classmethod
    def strain_tables(cls, rule: Rule, C: Array) -> StrainTables | None:
        """Return what kernels add to the strain of the displacements, so that they give that of `B`.

        Parameters
        ----------
        rule : quadrature rule.
        C : (6, 6) float, Pa.

        Returns
        -------
        StrainTables, or None for nothing
        """
        return None

    # ---- strain --------------------------------------------------------------------------------

    def B(self, xi: ArrayLike, C: ArrayLike | None = None) -> Array:
        """Return the B-operator at points: strain = B u.

        A class that overrides it writes ``B(self, xi)`` or ``B(self, xi, C)`` for one point.

        Parameters
        ----------
        xi : (3,) or (..., 3) float, points in reference coordinates.
        C : (6, 6) or (..., 6, 6) float, Pa; for elements whose strain depends on the material.

        Returns
        -------
        (..., 6, 3n) float, 1/m
            Axes of the elements, axes of the points, 6, 3n.
        """
        at_gauss = xi is self.rule.points
        return tables.strain_rows(self._gauss[1] if at_gauss else np.swapaxes(self.dNdX(xi), -1, -2))

    def _operator(self, C: ArrayLike | None, xi: Array | None = None) -> Array:
        """Return B (..., g, 6, 3n) at points (g, 3), or at the Gauss points."""
        points = self.rule.points if xi is None else xi
        return custom.operator(self, points, C) if "B" in self.custom else self.B(points, C)

    def strain(self, u: ArrayLike, C: ArrayLike | None = None) -> Array:
        """Return the strain at the Gauss points.

        Parameters
        ----------
        u : (..., n, 3) float, nodal displacements in m.
        C : (6, 6) or (..., 6, 6) float, Pa; for elements whose strain depends on the material.

        Returns
        -------
        (..., g, 6) float
        """
        u = arguments.nodal(u, self.X)
        if self.has_standard_strain():
            gradient = self._gauss[1] @ u[..., None, :, :]
            return voigt.symmetric_gradient(np.swapaxes(gradient, -1, -2))
        return (self._operator(C) @ u.reshape(*u.shape[:-2], 1, -1, 1))[..., 0]

    def strain_at(self, xi: ArrayLike, u: ArrayLike, C: ArrayLike | None = None) -> Array:
        """Return the strain at points.

        Parameters
        ----------
        xi : (3,) or (..., 3) float, points in reference coordinates.
        u : (..., n, 3) float, nodal displacements in m.
        C : (6, 6) or (..., 6, 6) float, Pa; for elements whose strain depends on the material.

        Returns
        -------
        (..., 6) float
            Axes of the elements, axes of the points, 6.
        """
        xi, u = arguments.points(xi), arguments.nodal(u, self.X)
        strain = self._strain_at(xi.reshape(-1, 3), u, C)
        return strain.reshape(*strain.shape[:-2], *xi.shape[:-1], 6)

    def _strain_at(self, xi: Array, u: Array, C: ArrayLike | None) -> Array:
        """Return the strain (..., g, 6) at points (g, 3)."""
        if self.has_standard_strain():
            return voigt.symmetric_gradient(np.swapaxes(u, -1, -2)[..., None, :, :] @ self.dNdX(xi))
        return (self._operator(C, xi) @ u.reshape(*u.shape[:-2], 1, -1, 1))[..., 0]

    # ---- stress, internal forces, stiffness --------------------------------------------------------

    def stress(self, C: ArrayLike, u: ArrayLike) -> Array:
        """Return the stress σ = C ε at the Gauss points.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa.
        u : (..., n, 3) float, nodal displacements in m.

        Returns
        -------
        (..., g, 6) float, Pa
        """
        C = arguments.elasticity(C, self.X)
        return self.strain(u, C) @ np.swapaxes(C[..., None, :, :] if C.ndim > 2 else C, -1, -2)

    def internal_force(self, stress: ArrayLike, C: ArrayLike | None = None) -> Array:
        """Return the internal force vector of stresses, r_int = Σ B^T σ γ det J.

        Parameters
        ----------
        stress : (..., g, 6) float, Pa.
        C : (6, 6) or (..., 6, 6) float, Pa; for elements whose strain depends on the material.

        Returns
        -------
        (..., n, 3) float, N
        """
        stress = arguments.at_gauss(stress, self.X, len(self.rule))
        if self.has_standard_strain():
            s = voigt.tensor(stress) * self.dV[..., None, None]
            return (np.swapaxes(self._gauss[1], -1, -2) @ s).sum(axis=-3)
        weighted = stress * self.dV[..., None]
        f = (np.swapaxes(self._operator(C), -1, -2) @ weighted[..., None]).sum(axis=-3)
        return f.reshape(*f.shape[:-2], -1, 3)

    def stiffness(self, C: ArrayLike) -> Array:
        """Return the stiffness K = Σ B^T C B γ det J, or that of the class's own local system.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa.

        Returns
        -------
        (..., 3n, 3n) float, N/m
        """
        return tables.by_dof(self.stiffness_by_axis(C))

    def stiffness_by_axis(self, C: ArrayLike) -> Array:
        """Return the stiffness in the order in which assembly takes it: by axis, then node.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa.

        Returns
        -------
        (..., 3, n, 3, n) float, N/m
            Axis and node of the row, axis and node of the column.
        """
        C = arguments.elasticity(C, self.X)
        if "local_system" in self.custom:
            return tables.by_axis(custom.stiffness(self, C))
        return self._stiffness(C)

    def _stiffness(self, C: Array) -> Array:
        """Return K (..., 3, n, 3, n) of B; in a short way where C is isotropic and B that of gradients."""
        if C.ndim == 2 and self.has_standard_strain() and (lame := tables.lame_constants(C)):
            return tables.isotropic(self._gauss[1], self.dV, lame)
        B = self._operator(C)
        return tables.by_axis(tables.summed(B, (C[..., None, :, :] if C.ndim > 2 else C) @ B, self.dV))

    def local_system(self, C: ArrayLike, u: ArrayLike) -> tuple[Array, Array]:
        """Return stiffness and internal force vector of B: what a formulation of its own overrides.

        Strains and stresses of results, and the forces of a prestress, remain those of B.

        Parameters
        ----------
        C : (6, 6) float, Pa.
        u : (..., n, 3) float, nodal displacements in m.

        Returns
        -------
        K : (..., 3n, 3n) float, N/m
        r_int : (..., n, 3) float, N; K u
        """
        C = arguments.elasticity(C, self.X)
        return tables.by_dof(self._stiffness(C)), self.internal_force(self.stress(C, u), C)

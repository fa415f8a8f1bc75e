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
from kratos_lite.elements import arguments, stiffness
from kratos_lite.elements.geometry import GEOMETRY, same_methods
from kratos_lite.elements.mass import CellMass
from kratos_lite.elements.overridden_steps import (
    STRAIN,
    STRESS,
    brought,
    columns,
    internal_load_of,
    run_step,
    strain_of,
    stress_of,
)
from kratos_lite.elements.tables import lame_constants, reference_products, tabulate
from kratos_lite.errors import InputError
from kratos_lite.quadrature import Rule
from kratos_lite.registry import Registry
from kratos_lite.typing import Array
from kratos_lite.validation import short

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from kratos_lite.elements.strain_tables import StrainTables

ELEMENTS: Registry[type[KinematicLinear]] = Registry("element")
"""Every element by its class name and by the names that mean the same in files."""

SAME_ELEMENT = (
    "SmallDisplacementElement",
    "TotalLagrangian",
    "TotalLagrangianElement",
    "UpdatedLagrangianElement",
    "Element",
)
"""Prefixes of element names in files that are solved as KinematicLinear."""
UNNAMED = "Element3D"
"""Start of the names that say the number of nodes alone; see `elements.formulations`."""


def same_names(name: str) -> list[str]:
    """Return the names in files that mean the element class of a name.

    >>> same_names("KinematicLinear3D8N")[:2], same_names("BBar3D8N")
    (['SmallDisplacementElement3D8N', 'TotalLagrangian3D8N'], [])
    """
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
    A subclass states `shape` and `rule`.  Mass and body forces take rules that are exact for the shape and
    the geometry of each cell; a subclass that states a `mass_rule` takes that one for the mass of all cells.
    It may state its `formulation`, a word, and how many `spurious_modes` one element alone has: modes without
    energy beside the rigid ones.
    Voigt rows are xx yy zz xy yz zx with engineering shear; dof = 3·node + axis.

    The steps of an element are ``N, dN → J → dNdX → B → B_at_gauss_points → strain → stress → internal_load →
    stiffness``; a class that overrides one has all later ones follow from it, in every analysis.  Its methods
    take one element at a time, X (n, 3), unless it states ``batched = True``.  Short ways
    (gradients, constant Jacobians, compiled kernels) are taken only where a class inherits every step that
    they stand for.

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
    batched: ClassVar[bool] = True

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if not (hasattr(cls, "shape") and hasattr(cls, "rule")):
            return  # a family of elements, not an element
        if not isinstance(cls.rule, Rule):
            expected = f"kratos_lite.quadrature.{cls.shape.cell}(degree=3)"
            raise InputError(f"{cls.__name__}.rule must be a Rule, such as {expected}; got {short(cls.rule)}")
        cls.nodes = cls.shape.nodes
        ELEMENTS.add(cls.__name__, cls, [*cls.__dict__.get("aliases", ()), *same_names(cls.__name__)])

    @classmethod
    def inherits(cls, *methods: str) -> bool:
        """Return whether a class has these methods from `KinematicLinear`, so that short ways may be taken.

        Parameters
        ----------
        methods : names of methods.

        Returns
        -------
        bool
            False if the class overrides one of them.

        Raises
        ------
        InputError
            If `KinematicLinear` has no such method.
        """
        if unknown := [name for name in methods if not isinstance(name, str) or not hasattr(cls, name)]:
            raise InputError(f"{cls.__name__} has no method {short(unknown[0])}")
        return same_methods(cls, KinematicLinear, *methods)

    @classmethod
    def strain_tables(cls, rule: Rule, C: Array) -> StrainTables | None:
        """Return what kernels add to the strain of the displacements.

        A class that overrides it says that kernels with these tables give the same as its methods.

        Parameters
        ----------
        rule : quadrature rule.
        C : (6, 6) float, Pa.

        Returns
        -------
        StrainTables, or None for nothing
        """
        return None

    @classmethod
    def has_kernels(cls, *methods: str) -> bool:
        """Return whether kernels give the same as these methods of a class.

        Parameters
        ----------
        methods : names of methods.

        Returns
        -------
        bool
            False if the class overrides one of them, or one that its `strain_tables` stand for.
        """
        owner = next(base for base in cls.__mro__ if "strain_tables" in vars(base))
        if getattr(owner, "shape", cls.shape) is not cls.shape:
            return False
        return same_methods(cls, owner, *methods, *brought(owner, KinematicLinear))

    # ---- strain --------------------------------------------------------------------------------

    def B(self, xi: ArrayLike) -> Array:
        """Return the B-operator at points: strain = B u.

        Parameters
        ----------
        xi : (3,) or (..., 3) float, points in reference coordinates.

        Returns
        -------
        (..., 6, 3n) float, 1/m
            Axes of the elements, axes of the points, 6, 3n.

        Raises
        ------
        InputError
            If `xi` are not points.
        """
        return stiffness.strain_rows(np.swapaxes(self.dNdX(xi), -1, -2))

    def B_at_gauss_points(self, C: ArrayLike | None = None) -> Array:
        """Return the B-operator at the Gauss points.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa; for elements whose strain depends on the material.

        Returns
        -------
        (..., g, 6, 3n) float, 1/m
        """
        if self.inherits("B"):
            return stiffness.strain_rows(self._gauss[1])
        tail = (6, 3 * len(self.nodes))
        return np.stack([run_step(self, "B", tail, xi) for xi in self.rule.points], axis=-3)

    def _operator(self, C: ArrayLike | None) -> Array:
        """Return B (..., g, 6, 3n) of the steps before the strain."""
        if self.inherits("B_at_gauss_points"):
            return self.B_at_gauss_points(C)
        return run_step(self, "B_at_gauss_points", (len(self.rule), 6, 3 * len(self.nodes)), C)

    def strain(self, u: ArrayLike, C: ArrayLike | None = None) -> Array:
        """Return the strain at the Gauss points.

        A class that overrides it writes ``strain(self, u)``, linear in u.

        Parameters
        ----------
        u : (..., n, 3) float, nodal displacements in m.
        C : (6, 6) or (..., 6, 6) float, Pa; for elements whose strain depends on the material.

        Returns
        -------
        (..., g, 6) float

        Raises
        ------
        InputError
            If `u` is not made of nodal displacements.
        """
        u = arguments.nodal(u, self.X)
        if self.inherits("B", "B_at_gauss_points"):
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

        Raises
        ------
        InputError
            If `xi` are not points or `u` is not made of nodal displacements.
        """
        xi, u = arguments.points(xi), arguments.nodal(u, self.X)
        axes = (1,) * (xi.ndim - 1)
        B = self.B(xi)
        return (B @ u.reshape(*u.shape[:-2], *axes, -1, 1))[..., 0]

    # ---- stress, internal load, stiffness --------------------------------------------------------

    def stress(self, C: ArrayLike, u: ArrayLike) -> Array:
        """Return the stress σ = C ε at the Gauss points.

        A class that overrides it, such as for a C that differs from point to point, writes it linear in u.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa.
        u : (..., n, 3) float, nodal displacements in m.

        Returns
        -------
        (..., g, 6) float, Pa

        Raises
        ------
        InputError
            If `C` is not an elasticity matrix or `u` is not made of nodal displacements.
        """
        C = arguments.elasticity(C, self.X)
        strain = strain_of(self, u, C)
        return strain @ np.swapaxes(arguments.elasticity(C, strain), -1, -2)

    def internal_load(self, stress: ArrayLike, C: ArrayLike | None = None) -> Array:
        """Return the internal load r_int = Σ B^T σ γ det J.

        A class that overrides it writes ``internal_load(self, stress)``, linear in the stress.

        Parameters
        ----------
        stress : (..., g, 6) float, Pa.
        C : (6, 6) or (..., 6, 6) float, Pa; for elements whose strain depends on the material.

        Returns
        -------
        (..., n, 3) float, N

        Raises
        ------
        InputError
            If `stress` is not made of stresses at the Gauss points.
        """
        stress = arguments.at_gauss(stress, self.X, len(self.rule))
        if self.inherits(*STRAIN):
            s = voigt.tensor(stress) * self.dV[..., None, None]
            return (np.swapaxes(self._gauss[1], -1, -2) @ s).sum(axis=-3)
        weighted = stress * self.dV[..., None]
        f = (np.swapaxes(self._B(C), -1, -2) @ weighted[..., None]).sum(axis=-3)
        return f.reshape(*f.shape[:-2], -1, 3)

    def stiffness(self, C: ArrayLike) -> Array:
        """Return the stiffness K = Σ B^T C B γ det J.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa.

        Returns
        -------
        (..., 3n, 3n) float, N/m

        Raises
        ------
        InputError
            If `C` is not an elasticity matrix, or a step that the class overrides is not linear in u.
        """
        if self.inherits("stiffness_by_axis"):
            return stiffness.by_dof(self._stiffness(C))
        n = len(self.nodes)
        return stiffness.by_dof(run_step(self, "stiffness_by_axis", (3, n, 3, n), C))

    def stiffness_by_axis(self, C: ArrayLike) -> Array:
        """Return the stiffness in the order in which assembly takes it: by axis, then node.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa.

        Returns
        -------
        (..., 3, n, 3, n) float, N/m
            Axis and node of the row, axis and node of the column.

        Raises
        ------
        InputError
            As by `stiffness`.
        """
        if self.inherits("stiffness"):
            return self._stiffness(C)
        n = 3 * len(self.nodes)
        return stiffness.by_axis(run_step(self, "stiffness", (n, n), C))

    def _stiffness(self, C: ArrayLike) -> Array:
        """Return K (..., 3, n, 3, n) of the steps before it, by a short way where the class inherits them."""
        C = arguments.elasticity(C, self.X)
        if C.ndim == 2 and self.inherits(*STRESS, "internal_load"):
            if self.inherits(*GEOMETRY) and self.constant_jacobian:
                J = self._jacobian(tabulate(self.shape, self.rule)[1][:1])[..., 0, :, :]
                return stiffness.affine(J, reference_products(self.shape, self.rule), C)
            if lame := lame_constants(C):
                return stiffness.isotropic(self._gauss[1], self.dV, lame)
        S = self._stress_matrix(C)
        if self.inherits("internal_load"):
            return stiffness.by_axis(stiffness.summed(self._B(C), S, self.dV))
        loads = [internal_load_of(self, S[..., j], C) for j in range(S.shape[-1])]
        return stiffness.by_axis(np.stack([f.reshape(*f.shape[:-2], -1) for f in loads], axis=-1))

    def _B(self, C: ArrayLike | None) -> Array:
        """Return B (..., g, 6, 3n) of the last step to the strain that the class overrides."""
        if self.inherits("strain"):
            return self._operator(C)
        return columns(self, "strain", lambda u: strain_of(self, u))

    def _stress_matrix(self, C: Array) -> Array:
        """Return S (..., g, 6, 3n), stress = S u."""
        if self.inherits("stress"):
            return (C[..., None, :, :] if C.ndim > 2 else C) @ self._B(C)
        return columns(self, "stress", lambda u: stress_of(self, C, u))

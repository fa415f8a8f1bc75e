"""KinematicLinear: small-strain solid elements built on the B-operator.

One class serves one element, X (n, 3), or a batch, X (..., n, 3): all methods broadcast over
the leading axes.  With g Gauss points xi and weights gamma,

    r_int = Σ B^T σ γ det J        r_ext = Σ N ρg γ det J        K = Σ B^T C B γ det J

Source: KratosWiki, *Kinematic Linear Element*; Zienkiewicz & Taylor, vol. 1, ch. 6.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite import voigt
from kratos_lite.elements.exact import AFFINE, exact_rule, geometries, has_rules
from kratos_lite.elements.tables import (
    cofactors,
    determinant,
    lame_constants,
    lumped,
    reference_products,
    tabulate,
)
from kratos_lite.errors import MeshError
from kratos_lite.quadrature import Rule
from kratos_lite.registry import Registry
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Mask

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


STIFFNESS_STEPS = ("stiffness_by_axis", "stiffness", "B", "dNdX", "J", "_jacobian", "_gauss")
"""What an element class may redefine so that its stiffness is not that of its tables."""


class KinematicLinear:
    """A small-strain solid element: shape × rule × the B-operator.

    Parameters
    ----------
    X : (n, 3) or (..., n, 3) float, m; reference coordinates of the nodes.
    rule : quadrature rule in place of the element's own.

    Raises
    ------
    MeshError
        If X does not have the right shape.

    Notes
    -----
    A subclass states `shape` and `rule`.  Mass and body forces take rules that are exact for the shape and
    the geometry of each cell; a subclass that states a `mass_rule` takes that one for the mass of all cells.
    Voigt rows are xx yy zz xy yz zx with engineering shear; dof = 3·node + axis.

    Examples
    --------
    >>> from kratos_lite import Isotropic3D, KinematicLinear3D8N
    >>> element = KinematicLinear3D8N(0.5 * KinematicLinear3D8N.nodes)
    >>> K = element.stiffness(Isotropic3D(E=210e6, nu=0.3).C)
    >>> K.shape, round(float(element.volume()), 12)
    ((24, 24), 1.0)
    """

    shape: ClassVar[type[Shape]]
    nodes: ClassVar[Array]
    rule: Rule
    mass_rule: ClassVar[Rule | None] = None
    aliases: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if not (hasattr(cls, "shape") and hasattr(cls, "rule")):
            return  # a family of elements, not an element
        cls.nodes = cls.shape.nodes
        suffix = cls.__name__.removeprefix("KinematicLinear")
        same = [] if suffix == cls.__name__ else [prefix + suffix for prefix in SAME_ELEMENT]
        ELEMENTS.add(cls.__name__, cls, [*cls.__dict__.get("aliases", ()), *same])

    def __init__(self, X: ArrayLike, rule: Rule | None = None) -> None:
        self.X: Array = np.asarray(X, dtype=float)
        if self.X.ndim < 2 or self.X.shape[-2:] != self.nodes.shape:
            n = len(self.nodes)
            raise MeshError(f"{type(self).__name__} needs X of shape (..., {n}, 3); got {self.X.shape}")
        if rule is not None:
            self.rule = rule

    # ---- geometry at given points ----------------------------------------------------------

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the shape functions at points.

        Parameters
        ----------
        xi : (..., 3) float, points in reference coordinates.

        Returns
        -------
        (..., n) float
        """
        return cls.shape.N(xi)

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return the derivatives dN_a/dxi_j at points.

        Parameters
        ----------
        xi : (..., 3) float, points in reference coordinates.

        Returns
        -------
        (..., n, 3) float
        """
        return cls.shape.dN(xi)

    def _jacobian(self, dN: Array) -> Array:
        """Return dX_i/dxi_j for tabulated dN (g, n, 3) as (..., g, 3, 3)."""
        n, g = len(self.nodes), len(dN)
        flat = np.swapaxes(self.X, -1, -2) @ dN.transpose(1, 0, 2).reshape(n, 3 * g)
        return np.moveaxis(flat.reshape(*self.X.shape[:-2], 3, g, 3), -2, -3)

    def determinants(self, dN: Array) -> Array:
        """Return det J for tabulated derivatives.

        Parameters
        ----------
        dN : (g, n, 3) float, derivatives of the shape functions at the points of a rule.

        Returns
        -------
        (..., g) float, m³
        """
        return determinant(self._jacobian(dN))

    def J(self, xi: ArrayLike) -> Array:
        """Return the Jacobian dX_i/dxi_j at one point.

        Parameters
        ----------
        xi : (3,) float, one point in reference coordinates.

        Returns
        -------
        (..., 3, 3) float, m
        """
        return self._jacobian(self.dN(xi)[None])[..., 0, :, :]

    def detJ(self, xi: ArrayLike) -> Array:
        """Return det J at one point.

        Parameters
        ----------
        xi : (3,) float, one point in reference coordinates.

        Returns
        -------
        (...) float, m³
        """
        return determinant(self.J(xi))

    def dNdX(self, xi: ArrayLike) -> Array:
        """Return the gradients dN_a/dX_i at one point.

        Parameters
        ----------
        xi : (3,) float, one point in reference coordinates.

        Returns
        -------
        (..., n, 3) float, 1/m
        """
        J = self.J(xi)
        return self.dN(xi) @ (cofactors(J) / determinant(J)[..., None, None])

    def B(self, xi: ArrayLike) -> Array:
        """Return the B-operator at one point: strain = B u.

        Parameters
        ----------
        xi : (3,) float, one point in reference coordinates.

        Returns
        -------
        (..., 6, 3n) float, 1/m
        """
        D = np.moveaxis(self.dNdX(xi), -1, 0)
        B = np.zeros((*D.shape[1:-1], 6, D.shape[-1], 3))
        for row, (i, j) in enumerate(voigt.PAIRS):
            B[..., row, :, i] = D[j]
            B[..., row, :, j] = D[i]
        return B.reshape(*D.shape[1:-1], 6, 3 * D.shape[-1])

    def position(self, xi: ArrayLike) -> Array:
        """Return the place X(xi) of one point.

        Parameters
        ----------
        xi : (3,) float, one point in reference coordinates.

        Returns
        -------
        (..., 3) float, m
        """
        return self.N(xi) @ self.X

    # ---- geometry at the Gauss points, made once per instance --------------------------------

    @cached_property
    def _gauss(self) -> tuple[Array, Array]:
        """Return weights γ det J (..., g) and gradients dN_a/dX_i as (..., g, 3, n)."""
        _, dN = tabulate(self.shape, self.rule)
        J = self._jacobian(dN)
        inverse = cofactors(J)
        det = (J[..., :, 0] * inverse[..., 0, :]).sum(axis=-1)
        inverse /= det[..., None, None]
        D = dN[:, None, :, 0] * inverse[..., 0, :, None]
        for j in (1, 2):
            D += dN[:, None, :, j] * inverse[..., j, :, None]
        return det * self.rule.weights, D

    @property
    def dV(self) -> Array:
        """Volume of each Gauss point, γ det J, as (..., g) in m³."""
        return self._gauss[0]

    def volume(self) -> Array:
        """Return the volume, exact for every geometry of the cell.

        Returns
        -------
        (...) float, m³
        """
        if not self.inherits("_gauss", "dV"):
            return self.dV.sum(axis=-1)
        return self._integrate(lambda N, dV: dV.sum(axis=-1), factors=0)

    def gauss_points(self) -> Array:
        """Return the places X of the Gauss points.

        Returns
        -------
        (..., g, 3) float, m
        """
        return tabulate(self.shape, self.rule)[0] @ self.X

    # ---- strain, stress, loads, stiffness ----------------------------------------------------

    def strain(self, u: ArrayLike) -> Array:
        """Return the strain at the Gauss points.

        Parameters
        ----------
        u : (..., n, 3) float, nodal displacements in m.

        Returns
        -------
        (..., g, 6) float
        """
        _, D = self._gauss
        gradient = D @ np.asarray(u, dtype=float)[..., None, :, :]
        return voigt.symmetric_gradient(np.swapaxes(gradient, -1, -2))

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
        C = np.asarray(C, dtype=float)
        return self.strain(u) @ np.swapaxes(C, -1, -2)

    def internal_load(self, stress: ArrayLike) -> Array:
        """Return the internal load r_int = Σ B^T σ γ det J.

        Parameters
        ----------
        stress : (..., g, 6) float, Pa.

        Returns
        -------
        (..., n, 3) float, N
        """
        dV, D = self._gauss
        s = voigt.tensor(stress) * dV[..., None, None]
        return (np.swapaxes(D, -1, -2) @ s).sum(axis=-3)

    def body_force(self, b: ArrayLike) -> Array:
        """Return the load r_ext = ∫ N b dV of a body force, by the rules of `scalar_mass`.

        Parameters
        ----------
        b : (3,) or (..., 3) constant, or (..., n, 3) at the nodes; N/m³.

        Returns
        -------
        (..., n, 3) float, N
        """
        b = np.asarray(b, dtype=float)
        if b.ndim == self.X.ndim and b.shape[-2:] == self.nodes.shape:
            return self.scalar_mass() @ b
        if self.inherits("_gauss", "dV"):
            share = self._integrate(lambda N, dV: dV @ N, factors=1)
        else:
            share = self.dV @ tabulate(self.shape, self.rule)[0]
        return share[..., :, None] * b[..., None, :]

    def stiffness(self, C: ArrayLike) -> Array:
        """Return the stiffness K = Σ B^T C B γ det J.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa.

        Returns
        -------
        (..., 3n, 3n) float, N/m
        """
        K = self.stiffness_by_axis(C)
        n = len(self.nodes)
        order = np.moveaxis(K, (-4, -2), (-3, -1))
        return order.reshape(*K.shape[:-4], 3 * n, 3 * n)

    def stiffness_by_axis(self, C: ArrayLike) -> Array:
        """Return the stiffness in the order in which assembly takes it: by axis, then node.

        An isotropic C takes the short way
        K_iajb = λ P_iajb + μ P_jaib + μ δ_ij P_kakb with P_iajb = Σ dN_a/dX_i dN_b/dX_j dV.

        Parameters
        ----------
        C : (6, 6) or (..., 6, 6) float, Pa.

        Returns
        -------
        (..., 3, n, 3, n) float, N/m
            Axis and node of the row, axis and node of the column.
        """
        C = np.asarray(C, dtype=float)
        if C.ndim == 2 and self.inherits(*STIFFNESS_STEPS) and self.constant_jacobian:
            return self._affine_stiffness(C)
        dV, D = self._gauss
        g, n = D.shape[-3], D.shape[-1]
        if C.ndim == 2 and (lame := lame_constants(C)):
            A = D.reshape(*D.shape[:-3], g, 3 * n)
            P = (np.swapaxes(A, -1, -2) * dV[..., None, :]) @ A
            P = P.reshape(*P.shape[:-2], 3, n, 3, n)
            K = lame[0] * P + lame[1] * np.swapaxes(P, -4, -2)
            trace = lame[1] * (P[..., 0, :, 0, :] + P[..., 1, :, 1, :] + P[..., 2, :, 2, :])
            for i in range(3):
                K[..., i, :, i, :] += trace
            return K
        B = np.zeros((*D.shape[:-2], 6, 3, n))
        for row, (i, j) in enumerate(voigt.PAIRS):
            B[..., row, i, :] = D[..., j, :]
            B[..., row, j, :] = D[..., i, :]
        B = B.reshape(*B.shape[:-2], 3 * n)
        CB = (C[..., None, :, :] if C.ndim > 2 else C) @ B * dV[..., None, None]
        K = np.swapaxes(B.reshape(*B.shape[:-3], 6 * g, 3 * n), -1, -2) @ CB.reshape(
            *B.shape[:-3], 6 * g, 3 * n
        )
        return K.reshape(*K.shape[:-2], 3, n, 3, n)

    def _affine_stiffness(self, C: Array) -> Array:
        """Return K (..., 3, n, 3, n) of elements with one J each, by the products of the reference cell.

        K_iajb = Σ_kl G_ijkl R_kalb with G_ijkl = det J Σ_pq C_ipjq J^-1_kp J^-1_lq.
        """
        J = self._jacobian(tabulate(self.shape, self.rule)[1][:1])[..., 0, :, :]
        inverse, det = cofactors(J), determinant(J)[..., None, None]
        pairs = (inverse / det)[..., :, None, :, None] * inverse[..., None, :, None, :]
        tensor = voigt.tensor(np.moveaxis(voigt.tensor(C), 0, -1))  # j q i p
        G = pairs.reshape(*J.shape[:-2], 9, 9) @ tensor.transpose(3, 1, 2, 0).reshape(9, 9)
        K = np.swapaxes(G, -1, -2).reshape(-1, 9) @ reference_products(self.shape, self.rule)
        n = len(self.nodes)
        return np.swapaxes(K.reshape(*J.shape[:-2], 3, 3, n, n), -3, -2)

    @cached_property
    def constant_jacobian(self) -> bool:
        """Whether J is the same at all Gauss points of each element, but for the rounding of its sums."""
        J = self._jacobian(tabulate(self.shape, self.rule)[1])
        change = np.abs(J - J[..., :1, :, :]).max(axis=(-3, -2, -1))
        size = np.abs(self.X).max(axis=(-2, -1))
        return bool((change <= 8 * np.finfo(float).eps * size).all())

    @classmethod
    def inherits(cls, *methods: str) -> bool:
        """Return whether a class has these methods from `KinematicLinear`, so that kernels may replace them.

        Parameters
        ----------
        methods : names of methods.

        Returns
        -------
        bool
            False if the class overrides one of them.
        """
        return all(getattr(cls, name) is getattr(KinematicLinear, name) for name in methods)

    # ---- mass ----------------------------------------------------------------------------------

    def scalar_mass(self, density: ArrayLike = 1.0) -> Array:
        """Return the mass matrix of one axis, ∫ ρ N N^T dV, exact for every geometry of the cell.

        A `mass_rule` of the class is used as it is.

        Parameters
        ----------
        density : number, or (...) one for each element; kg/m³.

        Returns
        -------
        (..., n, n) float, kg
        """
        m = self._integrate(lambda N, dV: (N.T * dV[..., None, :]) @ N, factors=2)
        return m * np.asarray(density, dtype=float)[..., None, None]

    def _integrate(self, of: Callable[[Array, Array], Array], factors: int) -> Array:
        """Return integrals of products of `factors` functions, made of N (g, n) and γ det J (..., g)."""
        total: Array | None = None
        for mine, rule in self.mass_rules(geometries(self.shape, self.X), factors):
            N, dN = tabulate(self.shape, rule)
            found = of(N, self.determinants(dN) * rule.weights)
            if total is not None:
                found[~mine] = total[~mine]
            total = found
        assert total is not None
        return total

    @classmethod
    def mass_rules(cls, kinds: Ints, factors: int, flow: bool = False) -> list[tuple[Mask, Rule]]:
        """Return the rules for products of shape functions over cells, each with a mask of its cells.

        Parameters
        ----------
        kinds : (...) int, the geometry of each cell; see `geometries`.
        factors : number of functions in the product.
        flow : whether it is one of G or H; see `exact_rule`.

        Returns
        -------
        list of (mask (...), Rule)
            For the mass itself a `mass_rule` of the class; the own rule for cells of unknown degree.
        """
        stated = cls.mass_rule if factors == 2 and not flow else None
        if stated is None and not has_rules(cls.shape):
            stated = cls.rule
        if stated is not None:
            return [(np.ones(kinds.shape, dtype=bool), stated)]
        rules: dict[Rule, Mask] = {}
        for kind in np.unique(kinds).tolist() or [AFFINE]:
            rule = exact_rule(cls.shape, factors, kind, flow)
            rules[rule] = rules.get(rule, np.zeros(kinds.shape, dtype=bool)) | (kinds == kind)
        return [(mask, rule) for rule, mask in rules.items()]

    def mass(self, density: ArrayLike) -> Array:
        """Return the consistent mass matrix.

        Parameters
        ----------
        density : number, or (...) one for each element; kg/m³.

        Returns
        -------
        (..., 3n, 3n) float, kg
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
        """
        m = self.scalar_mass(density)
        _, reference = self.mass_rules(geometries(self.shape, self.nodes), factors=2)[0]
        return lumped(m.sum(axis=-1), np.diagonal(m, axis1=-2, axis2=-1), self.shape, reference)

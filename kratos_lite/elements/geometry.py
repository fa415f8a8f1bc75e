"""PlacedCell: geometry of cells at their places, at given points and at the Gauss points.

One object holds one cell, X (n, 3), or many, X (..., n, 3).  At many points (..., 3) a result has the
leading axes of X first, then those of the points, then its own.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kratos_lite.elements import arguments
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import InputError, MeshError
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes import Shape
from kratos_lite.shapes.inverse import cofactors, determinant
from kratos_lite.tabular import Tabular
from kratos_lite.typing import Array
from kratos_lite.validation import short

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class _OfClass(property):
    """A property of the class, which ``help`` shows by its own text."""

    def __get__(self, cell: Any, kind: type | None = None) -> Any:
        return self.fget(kind or type(cell))  # type: ignore[misc]


class PlacedCell(Tabular):
    """Geometry of a cell: shape × rule at the places X of its nodes; see `KinematicLinear`."""

    shape: ClassVar[type[Shape]]
    rule: Rule

    @_OfClass
    def nodes(cls) -> Array:
        """Return the reference coordinates (n, 3) of the nodes."""
        return cls.shape.nodes

    def __init__(self, X: ArrayLike, rule: Rule | None = None) -> None:
        name = type(self).__name__
        if not hasattr(self, "nodes"):
            raise InputError(f"{name} states no shape and rule; use an element such as KinematicLinear3D8N")
        self.X: Array = arguments.real(X, f"nodes X of a {name}", self.nodes.shape, error=MeshError)
        if rule is not None:
            if not isinstance(rule, Rule):
                raise InputError(f"rule must be a Rule, such as hexahedron(degree=3); got {short(rule)}")
            self.rule = rule

    # ---- at given points -----------------------------------------------------------------------

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the shape functions (..., n) at points xi (..., 3)."""
        xi = arguments.points(xi)
        return _table(cls.shape, "N", xi, (len(cls.nodes),))

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return the derivatives dN_a/dxi_j (..., n, 3) at points xi (..., 3)."""
        xi = arguments.points(xi)
        return _table(cls.shape, "dN", xi, cls.nodes.shape)

    def _jacobian(self, dN: Array) -> Array:
        """Return dX_i/dxi_j for tabulated dN (g, n, 3) as (..., g, 3, 3)."""
        n, g = len(self.nodes), len(dN)
        flat = np.swapaxes(self.X, -1, -2) @ dN.transpose(1, 0, 2).reshape(n, 3 * g)
        return np.moveaxis(flat.reshape(*self.X.shape[:-2], 3, g, 3), -2, -3)

    def determinants(self, dN: Array) -> Array:
        """Return det J (..., g) in m³ of derivatives dN (g, n, 3) tabulated at points."""
        dN = arguments.real(dN, "derivatives dN", self.nodes.shape)
        if dN.ndim != 3:
            raise InputError(f"derivatives dN must have shape (g, {len(self.nodes)}, 3); got {dN.shape}")
        return determinant(self._jacobian(dN))

    def J(self, xi: ArrayLike) -> Array:
        """Return the Jacobian dX_i/dxi_j (..., 3, 3) in m at points xi (..., 3)."""
        xi = arguments.points(xi)
        dN = self.dN(xi).reshape(-1, *self.nodes.shape)
        return self._jacobian(dN).reshape(*self.X.shape[:-2], *xi.shape[:-1], 3, 3)

    def detJ(self, xi: ArrayLike) -> Array:
        """Return det J (...) in m³ at points xi (..., 3)."""
        return determinant(self.J(xi))

    def dNdX(self, xi: ArrayLike) -> Array:
        """Return the gradients dN_a/dX_i (..., n, 3) in 1/m at points xi (..., 3)."""
        J = self.J(xi)
        inverse = cofactors(J)
        det = (J[..., :, 0] * inverse[..., 0, :]).sum(axis=-1)
        return self.dN(xi) @ (inverse / det[..., None, None])

    def position(self, xi: ArrayLike) -> Array:
        """Return the places X(xi) (..., 3) in m of points xi (..., 3)."""
        xi = arguments.points(xi)
        N = self.N(xi).reshape(-1, len(self.nodes))
        return (N @ self.X).reshape(*self.X.shape[:-2], *xi.shape[:-1], 3)

    # ---- at the Gauss points, made once per instance ---------------------------------------------

    def _N(self, rule: Rule) -> Array:
        """Return N (g, n) at the points of a rule."""
        return tabulate(self.shape, rule)[0]

    def _volumes(self, rule: Rule) -> Array:
        """Return γ det J (..., g) at the points of a rule."""
        return determinant(self._jacobian(tabulate(self.shape, rule)[1])) * rule.weights

    @cached_property
    def _gauss(self) -> tuple[Array, Array]:
        """Return weights γ det J (..., g) and gradients dN_a/dX_i as (..., g, 3, n)."""
        _, dN = tabulate(self.shape, self.rule)
        J = self._jacobian(dN)
        inverse = cofactors(J)
        det = (J[..., :, 0] * inverse[..., 0, :]).sum(axis=-1)
        if self.rule is type(self).rule and not (det > 0).all():  # others may see more of a curved cell
            raise InputError(
                f"{type(self).__name__}: det J must be > 0 at all Gauss points; got {det.min():.3g} m³: the "
                "nodes X are not in the order of the reference cell, mirrored, or in one plane"
            )
        inverse /= det[..., None, None]
        D = dN[:, None, :, 0] * inverse[..., 0, :, None]
        for j in (1, 2):
            D += dN[:, None, :, j] * inverse[..., j, :, None]
        return det * self.rule.weights, D

    @property
    def dV(self) -> Array:
        """Volume of each Gauss point, γ det J, as (..., g) in m³."""
        return self._gauss[0]

    def gauss_points(self) -> Array:
        """Return the places X (..., g, 3) in m of the Gauss points."""
        return self._N(self.rule) @ self.X

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of a summary: shape, rule, nodes and volume."""
        count, rule = int(np.prod(self.X.shape[:-2])), self.rule
        volume = self._volumes(rule).sum()
        return [
            *([("elements", str(count))] if self.X.ndim > 2 else []),
            ("shape", self.shape.__name__),
            ("nodes", str(len(self.nodes))),
            ("rule", f"{rule.name}: {len(rule)} points, degree {rule.degree}"),
            ("volume", f"{volume:g} m³"),
        ]


def _table(shape: type[Shape], name: str, xi: Array, tail: tuple[int, ...]) -> Array:
    """Return N or dN of a shape at points; InputError if the shape does not take them."""
    values = _at_point(shape, name, xi.tobytes()).copy() if xi.ndim == 1 else getattr(shape, name)(xi)
    if np.shape(values) != (*xi.shape[:-1], *tail):
        raise InputError(
            f"{shape.__name__}.{name} must return {(*xi.shape[:-1], *tail)} for points {xi.shape}; "
            f"got {np.shape(values)}"
        )
    return np.asarray(values)


@remembered
def _at_point(shape: type[Shape], name: str, xi: bytes) -> Array:
    """Return N or dN at one point: one element after the other asks for the same ones."""
    return np.asarray(getattr(shape, name)(np.frombuffer(xi)))

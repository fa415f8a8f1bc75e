"""LinearMaterial: what every linear elastic law shares."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kratos_lite.errors import InputError, MaterialError
from kratos_lite.materials.material import MATERIALS, GaussState, Material, Response
from kratos_lite.typing import Array
from kratos_lite.validation import finite, reals

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["MATERIALS", "LinearMaterial"]


class LinearMaterial(Material, family=True):
    """A linear elastic material: stress = C strain in Voigt order xx yy zz xy yz zx.

    A subclass is a frozen dataclass of its constants that defines `compliance` (or overrides
    `elasticity`).

    Attributes
    ----------
    density, aliases, variables : as of `Material`.

    Raises
    ------
    MaterialError
        If a constant is not a finite number, the density is negative, or C is not (6, 6), symmetric and
        positive definite.
    """

    is_linear: ClassVar[bool] = True

    def __init_subclass__(cls, **kwargs: Any) -> None:
        for name in ("stress", "response", "C"):
            if getattr(cls, name) is not getattr(LinearMaterial, name):
                raise MaterialError(
                    f"{cls.__name__} overrides {name}, but a LinearMaterial has stress = C strain; override "
                    "compliance() or elasticity(), which gives C, or write a kl.Material with a response"
                )
        super().__init_subclass__(**kwargs)

    def check(self) -> None:
        """Check that C is symmetric and positive definite; subclasses check their own bounds here.

        Raises
        ------
        MaterialError
            If it is not, or not (6, 6) and finite.
        """
        if self.C.shape != (6, 6) or not np.isfinite(self.C).all():
            found = f"got shape {self.C.shape}" if self.C.shape != (6, 6) else "it holds nan or inf"
            raise MaterialError(f"{type(self).__name__}: C must be (6, 6), finite; {found}")
        scale = np.sqrt(np.abs(np.diag(self.C)))
        scales = np.outer(scale, scale)  # a C that was turned has round-off in place of zeros
        if not (np.abs(self.C - self.C.T) <= 1e-10 * scales).all():
            raise MaterialError(f"{type(self).__name__}: C is not symmetric; check entries, Poisson ratios")
        if not (scale > 0).all() or not np.linalg.eigvalsh(self.C / scales)[0] > 0:
            raise MaterialError(f"{type(self).__name__}: C must be positive definite; {self.why_unstable()}")

    def why_unstable(self) -> str:
        """Return which bound the constants violate."""
        return "the strain energy of some strain is not positive"

    def compliance(self) -> Array:
        """Return the compliance S (6, 6) in 1/Pa, strain = S stress; subclasses define it.

        Raises
        ------
        TypeError
            If the subclass defines neither this nor `elasticity`.
        """
        raise TypeError(f"{type(self).__name__} must define compliance() or elasticity()")

    def elasticity(self) -> Array:
        """Return the elasticity matrix C (6, 6) in Pa, by default the inverse of the compliance.

        Raises
        ------
        MaterialError
            If the compliance is singular, or not (6, 6).
        """
        S = reals(self.compliance(), f"{type(self).__name__}: the compliance", MaterialError)
        if S.shape != (6, 6):
            raise MaterialError(f"{type(self).__name__}: the compliance must be (6, 6); got shape {S.shape}")
        try:
            return np.asarray(np.linalg.inv(S), dtype=float)
        except np.linalg.LinAlgError:
            raise MaterialError(f"{type(self).__name__}: the compliance is singular") from None

    @cached_property
    def C(self) -> Array:
        """Elasticity matrix (6, 6) in Pa, read-only."""
        C = reals(self.elasticity(), f"{type(self).__name__}: C", MaterialError, copy=True)
        C.setflags(write=False)
        return C

    def stress(self, strain: ArrayLike) -> Array:
        """Return the stress C strain; a class that overrides this is refused.

        Parameters
        ----------
        strain : (..., 6) float.

        Returns
        -------
        (..., 6) float, Pa

        Raises
        ------
        InputError
            The strain has another shape, or is not finite.
        """
        e = finite(strain, "a strain")
        if e.shape[-1:] != (6,):
            raise InputError(f"a strain has six components xx yy zz xy yz zx; got shape {e.shape}")
        return e @ self.C.T

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return C strain, C and no internal variables; a class that overrides this is refused."""
        return strain @ self.C.T, self.C, {}

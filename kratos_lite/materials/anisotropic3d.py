"""Anisotropic3D: linear elasticity with any symmetric C."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError
from kratos_lite.materials.linear_material import LinearMaterial
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import Axes, finite


@dataclass(frozen=True)
class Anisotropic3D(LinearMaterial):
    """Linear elasticity with any symmetric C, such as that of a single crystal or of turned fibers.

    Parameters
    ----------
    stiffness : C (6, 6) in Pa, σ = C ε in the order xx yy zz xy yz zx with engineering shear.
    density : kg/m³, ≥ 0.
    alpha : thermal strain (6,) in 1/K, in that order; see `Temperature`.

    Raises
    ------
    MaterialError
        If C is not symmetric and positive definite.

    Notes
    -----
    Source: Lekhnitskii, Theory of Elasticity of an Anisotropic Body (1963), sections 3 and 5.

    Examples
    --------
    Wood whose fibers, along x of its own axes, lie at 45° between x and y of the model:

    >>> import kratos_lite as kl
    >>> wood = kl.Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.4, 0.3, 0.4, 0.7e9, 0.05e9, 0.7e9)
    >>> axes = kl.Cartesian((1, 1, 0), (-1, 1, 0)).directions((0, 0, 0))
    >>> slanted = kl.Anisotropic3D(wood.C, density=450.0).turned(axes)
    >>> print(f"{1 / np.linalg.inv(slanted.C)[0, 0] / 1e9:.2f} GPa along x")
    1.56 GPa along x
    """

    stiffness: ArrayLike
    density: float = 0.0
    alpha: ArrayLike = (0.0,) * 6

    aliases: ClassVar[tuple[str, ...]] = ("UserProvidedLinearElastic3DLaw",)
    variables: ClassVar[dict[str, str]] = {"stiffness": "ELASTICITY_TENSOR", "density": "DENSITY"}
    tables: ClassVar[Mapping[str, Axes]] = {"stiffness": (6, 6), "alpha": (6,)}

    @property
    def expansion(self) -> Array:
        """Thermal strain (6,) in 1/K."""
        return np.array(self.alpha)

    def elasticity(self) -> Array:
        """Return C (6, 6) in Pa."""
        return np.array(self.stiffness)

    def turned(self, axes: ArrayLike) -> Anisotropic3D:
        """Return the law of a body whose own axes lie along others.

        Parameters
        ----------
        axes : unit vectors (3, 3) along its axes, rows, such as of `Cartesian.directions`.

        Returns
        -------
        Anisotropic3D

        Raises
        ------
        MaterialError
            The axes are not orthogonal to each other, or not of length 1.
        """
        R = finite(axes, "axes of a material", (3, 3), error=MaterialError)
        if np.abs(R @ R.T - np.eye(3)).max() > 1e-9:
            raise MaterialError(f"axes of a material are orthogonal unit vectors, rows; got {R.tolist()}")
        own = voigt.turned_strain(np.eye(6), R)  # of each strain along x y z
        C = own @ self.C @ own.T
        return Anisotropic3D((C + C.T) / 2, self.density, voigt.turned_strain(self.expansion, R.T))

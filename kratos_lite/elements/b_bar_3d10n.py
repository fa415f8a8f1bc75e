"""BBar3D10N: ten-node tetrahedron with the mean dilatation of each element."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.elements import arguments
from kratos_lite.elements.b_bar import BBar
from kratos_lite.errors import InputError, MaterialError
from kratos_lite.quadrature import tetrahedron
from kratos_lite.shapes.tetrahedra import Tetrahedron10
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class BBar3D10N(BBar):
    """Ten-node tetrahedron, 4 points, the mean dilatation of each element.

    Three quadratic displacements of a straight tetrahedron change volumes but no angles, and their mean
    dilatation is 0.  They keep as much of their dilatation as shearing of the same size costs: with the bulk
    modulus κ and the shear modulus μ, mᵀB̄ = Π(mᵀB) + √min(1, μ / κ) (mᵀB - Π(mᵀB)).
    """

    shape = Tetrahedron10
    rule = tetrahedron(degree=2)

    def kept(self, C: ArrayLike | None) -> Array:
        """Return √min(1, μ / κ); InputError without C, MaterialError if κ or μ is not positive."""
        if C is None:
            raise InputError(f"the strain of {type(self).__name__} depends on the material; give its C")
        C = arguments.elasticity(C, self.X)
        bulk = C[..., :3, :3].sum(axis=(-1, -2)) / 9
        shear = np.einsum("...ii->...", C[..., 3:, 3:]) / 3
        if not ((bulk > 0) & (shear > 0)).all():
            raise MaterialError(
                f"{type(self).__name__} needs a C with bulk and shear modulus > 0; got {bulk.min():.3g} and "
                f"{shear.min():.3g} Pa"
            )
        return np.sqrt(np.minimum(1.0, shear / bulk))

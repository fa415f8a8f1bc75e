"""Anisotropic3D: linear elasticity with any C."""

from dataclasses import dataclass
from kratos_lite.materials.linear_material import LinearMaterial


@dataclass(frozen=True)
class Anisotropic3D(LinearMaterial):
    """x"""

    density: float = 0.0

    def elasticity(self):
        raise NotImplementedError


def turned(law, axes):
    raise NotImplementedError

"""Materials: constitutive laws, one file each; they register themselves."""

from kratos_lite.materials.base import MATERIALS, LinearMaterial
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.materials.orthotropic3d import Orthotropic3D

__all__ = ["MATERIALS", "Isotropic3D", "LinearMaterial", "Orthotropic3D"]

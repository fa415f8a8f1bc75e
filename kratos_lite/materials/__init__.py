"""Materials: constitutive laws, one file each; they register themselves when they are requested.

The file ``isotropic3d.py`` holds the class ``Isotropic3D``.
"""

import os

from kratos_lite.materials.linear_material import LinearMaterial
from kratos_lite.materials.material import MATERIALS, Material

__all__ = ["MATERIALS", "LinearMaterial", "Material"]

for _file in sorted(os.listdir(__path__[0])):
    if _file.endswith("3d.py"):
        _name = _file[:-5].title().replace("_", "")
        MATERIALS.expect(f"{_name}3D", f"{__name__}.{_file[:-3]}")
# for ``from kratos_lite.materials import …``; whose types are those of `kratos_lite`
globals()["__getattr__"] = MATERIALS.attribute

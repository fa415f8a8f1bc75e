"""Materials: constitutive laws, one file each; they register themselves when they are asked for.

The file ``isotropic3d.py`` holds the class ``Isotropic3D``.
"""

import os

from kratos_lite.materials.base import MATERIALS, LinearMaterial

__all__ = ["MATERIALS", "LinearMaterial"]

for _file in sorted(os.listdir(__path__[0])):
    if _file.endswith("3d.py"):
        MATERIALS.expect(f"{_file[:-5].title()}3D", f"{__name__}.{_file[:-3]}")

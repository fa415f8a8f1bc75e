"""Elements: the KinematicLinear family, one file each; they register themselves when they are requested.

The file ``kinematic_linear_3d8n.py`` holds the class ``KinematicLinear3D8N``.
"""

import os

from kratos_lite.elements.kinematic_linear import ELEMENTS, KinematicLinear, same_names

__all__ = ["ELEMENTS", "KinematicLinear"]

_FILES = [file.removesuffix("n.py").split("_3d") for file in os.listdir(__path__[0]) if "_3d" in file]
for _family, _nodes in sorted(_FILES, key=lambda words: (words[0], int(words[1]))):
    _name = f"{_family.title().replace('_', '')}3D{_nodes}N"
    ELEMENTS.expect(_name, f"{__name__}.{_family}_3d{_nodes}n", same_names(_name))
for _count in (4, 5, 6, 8, 10, 13, 15, 20, 27):
    _name = f"TotalLagrangianElement3D{_count}N"
    _alias = _name.replace("Total", "Updated")
    ELEMENTS.expect(_name, f"{__name__}.total_lagrangian_elements", [_alias])
# for ``from kratos_lite.elements import …``; whose types are those of `kratos_lite`
globals()["__getattr__"] = ELEMENTS.attribute

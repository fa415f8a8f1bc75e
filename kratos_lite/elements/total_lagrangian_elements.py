"""TotalLagrangianElement3D4N … 3D27N: the elements for large displacements and strains.

Their strain is Green's, see `total_lagrangian`; for small displacements they are the KinematicLinear elements
that they derive from, with the same shapes and rules.
"""

from __future__ import annotations

from kratos_lite.elements.kinematic_linear import ELEMENTS, KinematicLinear


def _total_lagrangian(nodes: int) -> type[KinematicLinear]:
    """Return the class with so many nodes, which registers itself."""
    name = f"TotalLagrangianElement3D{nodes}N"
    body = {
        "__module__": __name__,
        "__doc__": f"KinematicLinear3D{nodes}N with Green's strain, for large displacements.",
        "formulation": "total_lagrangian",
        "finite": True,
    }
    return type(name, (ELEMENTS[f"KinematicLinear3D{nodes}N"],), body)


for _nodes in (4, 5, 6, 8, 10, 13, 15, 20, 27):
    _total_lagrangian(_nodes)

"""One routine for the error of all programs, from nodal displacements alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks import fields
from benchmarks.scenes import Scene
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.tables import tabulate
from kratos_lite.quadrature import rule_for

Array = NDArray[np.float64]
DEGREE, FINE_DEGREE = 8, 5
"""Of the rule for the integrals of the error; the lower one for linear elements on fine meshes."""
FINE = 20_000
"""Elements from which a mesh of linear elements counts as fine: their error is quadratic in each then."""


def errors(scene: Scene, u: Array) -> dict[str, float]:
    """Return the relative errors of nodal displacements u (n, 3) in m.

    ``displacement`` is the L2 norm of the error, ``energy`` its energy norm, ``nodal`` its maximum at
    the nodes.  Where no exact field is known, they come from the work W = f · u / 2 of the loads, which is
    the energy U of the exact solution in the limit: ``displacement`` is |W/U - 1|, the error of the
    displacement under the load, and ``energy`` its root.
    """
    if scene.exact is None:
        if scene.energy is None:
            return {}
        off = abs(float((scene.forces() * u).sum()) / 2 / scene.energy - 1)
        return {"displacement": off, "energy": off**0.5}
    exact = scene.exact(scene.model.mesh.points)
    found = np.zeros(4)
    for group in scene.model.element_groups():
        for start in range(0, len(group), 1000):
            found += _integrals(scene, group, group.nodes[start : start + 1000], u)
    l2, energy = np.sqrt(found[0] / found[1]), np.sqrt(found[2] / found[3])
    nodal = np.abs(u - exact).max() / np.abs(exact).max()
    return {"displacement": float(l2), "energy": float(energy), "nodal": float(nodal)}


def _integrals(scene: Scene, group: ElementGroup, nodes: NDArray[np.int32], u: Array) -> Array:
    """Return ∫ |u_h - u|², ∫ |u|², ∫ e:C:e of the error and of the exact strain, over some elements."""
    shape = group.element.shape
    fine = len(group) >= FINE and len(shape.nodes) == shape.corners
    rule = rule_for(shape.cell, FINE_DEGREE if fine else DEGREE)
    N, _ = tabulate(shape, rule)
    placed = group.element(scene.model.mesh.points[nodes], rule)
    X, dV = N @ scene.model.mesh.points[nodes], placed.dV
    exact = scene.exact(X)
    strain = _strain(fields.gradient(scene.exact, X))
    off = placed.strain(u[nodes]) - strain
    C = group.material.C
    return np.array(
        [
            (((N @ u[nodes] - exact) ** 2).sum(axis=-1) * dV).sum(),
            ((exact**2).sum(axis=-1) * dV).sum(),
            (((off @ C) * off).sum(axis=-1) * dV).sum(),
            (((strain @ C) * strain).sum(axis=-1) * dV).sum(),
        ]
    )


def _strain(G: Array) -> Array:
    """Return the strain vectors xx yy zz xy yz zx of displacement gradients (..., 3, 3)."""
    normal = [G[..., i, i] for i in range(3)]
    shear = [G[..., i, j] + G[..., j, i] for i, j in ((0, 1), (1, 2), (2, 0))]
    return np.stack([*normal, *shear], axis=-1)

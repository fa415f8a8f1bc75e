"""Error of a quantity by the adjoint solution.

The adjoint z of a quantity Q is the displacement under the load ∂Q/∂u, with supports at rest.  The error e
of a solution is orthogonal to all displacements of the mesh, so that Q(e) = a(e, z) = a(e, e_z) with the
error e_z of the adjoint solution on the same mesh: the product of both errors, element by element, with
recovered stresses in place of the exact ones; near singular points averaged ones show more, and the safe
figure is not smaller than what they say.  A reaction is the virtual work of a unit displacement of its
part; the adjoint has this displacement as its support.  The adjoint of a stress at a point is too singular:
the error of the mean around the point takes its place, and what recovery shows of the difference is added;
the safe figure also has the spread of recovered less own stresses around the point.

Source: Becker & Rannacher, Acta Numerica 10 (2001) 1-102; Ainsworth & Oden, A Posteriori Error Estimation in
Finite Element Analysis (2000), chapter 8.
"""

from __future__ import annotations

import numpy as np

from kratos_lite.analysis.error_estimate import SAFETY, QuantityError, in_few_elements, too_few
from kratos_lite.analysis.origin import Origin
from kratos_lite.analysis.quantities import Quantity, Solved
from kratos_lite.assembly.recovery import Recovery
from kratos_lite.errors import ModelError
from kratos_lite.model.supports import AXES
from kratos_lite.typing import Array, Mask

SAME = 1e-6
"""Relative difference up to which a reaction is the virtual work of a unit displacement of its part."""


def error_of(
    result: Solved, origin: Origin, quantity: Quantity, strained: Array, recovery: Recovery
) -> QuantityError:
    """Return the estimated error of a quantity of a result."""
    load, motion, value = quantity.load(result), quantity.motion(result), quantity.value(result)
    z = origin.adjoint(load, motion)
    warnings = []
    if motion.any():
        warnings = _shared(result, origin.model.supports.fixed, motion != 0)
        work, size = -float((result.reactions * z).sum()), float(np.abs(result.reactions).sum())
        if abs(work - value) > SAME * size:
            raise ModelError(
                f"{quantity}: multi-point constraints tie the part to nodes beside it, so that its reaction "
                "is that of no support; take the whole of what is tied together"
            )
    shares, averaged = recovery.products(strained, z, result.mesh.n_elements)
    local = quantity.local(result)
    absolute = max(
        SAFETY["recovery"] ** 2 * float(np.abs(shares).sum()),
        SAFETY["averaging"] ** 2 * abs(float(averaged.sum())),
    )
    absolute += SAFETY["recovery"] * (float(np.abs(local).sum()) + quantity.spread(result))
    warnings += _concentrated(np.abs(shares)) + too_few(result.mesh)
    shares = shares + local
    return QuantityError(value, float(shares.sum()), absolute, shares, quantity.unit, warnings)


def _concentrated(sizes: Array) -> list[str]:
    """Return a warning where few elements contribute most."""
    if not in_few_elements(sizes, len(sizes)):
        return []
    return [
        f"few elements contribute most of the error, above all row {int(sizes.argmax())}: near the point "
        "asked for, a re-entrant corner, the edge of a support or a concentrated load; it may be several "
        "times larger where stresses have no limit"
    ]


def _shared(result: Solved, held: Mask, part: Mask) -> list[str]:
    """Return a warning where a support goes on beside the part whose reaction is asked for."""
    axis = int(part.any(axis=0).argmax())
    for block in result.mesh.boundary:
        inside = part[block.nodes, axis]
        both = held[block.nodes, axis].all(axis=1) & inside.any(axis=1) & ~inside.all(axis=1)
        if both.any():
            return [
                f"{int(both.sum())} faces beside the part are held along {AXES[axis]}, too: nodes on its "
                "edge carry a share of theirs, which depends on the mesh and is not in the estimate"
            ]
    return []

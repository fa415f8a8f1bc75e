"""Reference nodes: nodes that no element uses, which follow others, so that the equations never see them."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.model.supports import Supports
from kratos_lite.typing import Array


def followed(supports: Supports, values: Array) -> tuple[Any, Array]:
    """Return P (3n, 3n) and c: all displacements are P u + c with reference nodes held at values."""
    from scipy.sparse import diags_array

    known, held = supports.followers, supports.fixed & ~supports.mesh.used_nodes()[:, None]
    P = known.following(held.size)
    c = P @ np.where(held, values, 0.0).ravel()
    c[known.dependents] += known.constants
    return P @ diags_array(1.0 * ~held.ravel()), c


def displacements(supports: Supports, u: Array, time: float = 0.0) -> Array:
    """Return displacements (n, 3) at a time with those of reference nodes."""
    if supports.mesh.used_nodes().all():
        return u
    now = supports.at(time)
    P, c = followed(now, now.values)
    return np.asarray(P @ u.ravel() + c).reshape(-1, 3)


def carried(supports: Supports, forces: Array) -> Array:
    """Return forces (n, 3) with those on reference nodes passed on to what they follow."""
    if supports.mesh.used_nodes().all():
        return forces
    return np.asarray(followed(supports, supports.values)[0].T @ forces.ravel()).reshape(-1, 3)

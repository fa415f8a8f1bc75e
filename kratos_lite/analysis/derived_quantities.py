"""Quantities derived from results: the resultant of the reactions, and the figures of a motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.ale import Motion
from kratos_lite.ale.checks import critical_rate_estimate
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Where
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import finite

if TYPE_CHECKING:
    from kratos_lite.analysis.result import Result
    from kratos_lite.analysis.state import State


def reaction_resultant(
    model: Structure, of: Result | State, where: Where | None = None, center: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Return the force of the supports on the body and its moment about a point, as those of a hub.

    Arms are those of the undeformed body.

    Parameters
    ----------
    model : the model.
    of : its result, or a state of it.
    where : nodes whose reactions count; all if not given.
    center : (3,) m; the center of the rotation of the model, otherwise the origin, if not given.

    Returns
    -------
    force (3,) in N, moment (3,) in N m.

    Raises
    ------
    InputError
        The reactions are not those of this model, or the center is not a point.
    ModelError
        No node is chosen.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
    >>> bar.fix("x-")
    >>> bar.add(kl.Traction("x+", (0, 0, 2.0)))
    >>> force, moment = reaction_resultant(bar, bar.solve(), "x-", center=(0, 0.5, 0.5))
    >>> print(f"{force[2]:.6f} N, {moment[1]:.6f} N m")
    -2.000000 N, 2.000000 N m
    """
    if not hasattr(of, "reactions"):
        raise InputError(f"a Result or a State is needed; got {type(of).__name__}")
    if of.reactions.shape != model.mesh.points.shape:
        raise InputError(f"reactions of {len(of.reactions)} nodes; the model has {model.mesh.n_nodes}")
    rows = np.arange(model.mesh.n_nodes) if where is None else model.mesh.nodes(where)
    if not len(rows):
        raise ModelError(f"no node is chosen by {where!r}")
    hub = model.motion.center if isinstance(model.motion, Motion) else np.zeros(3)
    point = hub if center is None else finite(center, "a center")
    if point.shape != (3,):
        raise InputError(f"a center must have shape (3,); got {point.shape}")
    forces = of.reactions[rows]
    return forces.sum(axis=0), np.cross(model.mesh.points[rows] - point, forces).sum(axis=0)


def motion_summary(
    e: EquationsOfMotion, of: Result | State, critical: float | None, time: float = 0.0
) -> dict[str, Any]:
    """Return the figures of a motion at a time for a report; `critical` is the lowest critical rate."""
    assert e.terms is not None
    (rate, acceleration), waves = e.rates(time), critical_rate_estimate(e.terms)
    critical = None if critical == np.inf else critical
    noise = 1e-12 * float(np.abs(of.reactions).sum())  # what is left of reactions that balance one another
    carried = reaction_resultant(e.model, of, e.terms.motion.moving(e.model.mesh))
    force, moment = (np.where(np.abs(v) < noise, 0.0, v) for v in carried)
    return {
        "kind": e.terms.motion.kind,
        "unit": e.terms.motion.unit,
        "direction": e.terms.motion.direction.tolist(),
        "rate": rate,
        "acceleration": acceleration,
        "critical_rate": critical,
        "critical_rate_of_waves": waves,
        "margin": 1 - abs(rate) / (critical or waves),
        **_center(e, time),
        "support_force": force.tolist(),
        "support_moment": moment.tolist(),
    }


def _center(e: EquationsOfMotion, time: float) -> dict[str, list[float]]:
    """Return Ż and Z̈ of a center that moves, for a report."""
    assert e.terms is not None
    if not e.terms.motion.travels:
        return {}
    velocity, acceleration = e.center_rates(time)
    return {"center_velocity": velocity.tolist(), "center_acceleration": acceleration.tolist()}

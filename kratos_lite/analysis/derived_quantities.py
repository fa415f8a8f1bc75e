"""Quantities derived from results: resultants, figures of a motion, and how fast what moves changes.

At a point of the mesh other material arrives with the velocity s c(X).  A quantity Θ(t, X) of the material,
given at points of the mesh, changes along with the material by

    DΘ/Dt   = Θ' + s (c·grad) Θ
    D²Θ/Dt² = Θ'' + 2 s (c·grad) Θ' + s' (c·grad) Θ + s² (c·grad)² Θ

with the rate s of the motion and its acceleration s'; Θ' and Θ'' are taken at a fixed point of the mesh.
Nodal values of (c·grad) Θ are its L2 projection weighted by density, M^-1 G Θ with the consistent M, and
those of (c·grad)² Θ are (M^-1 G)² Θ.  At Gauss points grad is that of the elements, and (c·grad)² Θ the
derivative of the projected (c·grad) Θ.

Source: GetFEM user documentation, ALE support for objects having a large rigid body motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.ale import Motion
from kratos_lite.ale.checks import critical_rate_estimate
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.assembly.gauss_point_fields import in_order
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Where
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import choice, finite, instance

if TYPE_CHECKING:
    from kratos_lite.analysis.result import Result
    from kratos_lite.analysis.state import State

PLACES = ("node", "gauss")


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
    point = hub if center is None else finite(center, "a center", (3,))
    forces = of.reactions[rows]
    return forces.sum(axis=0), np.cross(model.mesh.points[rows] - point, forces).sum(axis=0)


def motion_summary(
    e: EquationsOfMotion, of: Result | State, critical: float | None, time: float = 0.0
) -> dict[str, Any]:
    """Return the figures of a motion at a time for a report; `critical` is the lowest critical rate."""
    assert e.terms is not None
    (rate, acceleration), waves = e.rates(time), critical_rate_estimate(e.terms)
    critical = None if critical == np.inf else critical
    rounding = 1e-12 * float(np.abs(of.reactions).sum())  # what is left of reactions that balance one another
    carried = reaction_resultant(e.model, of, e.terms.motion.moving(e.model.mesh))
    force, moment = (np.where(np.abs(v) < rounding, 0.0, v) for v in carried)
    names, moves = ("center_velocity", "center_acceleration"), e.terms.motion.travels
    center = dict(zip(names, (v.tolist() for v in e.center_rates(time)), strict=True)) if moves else {}
    return {
        "kind": e.terms.motion.kind,
        "unit": e.terms.motion.unit,
        "direction": e.terms.motion.direction.tolist(),
        "rate": rate,
        "acceleration": acceleration,
        "critical_rate": critical,
        "critical_rate_of_waves": waves,
        "margin": 1 - abs(rate) / (critical or waves),
        **center,
        "support_force": force.tolist(),
        "support_moment": moment.tolist(),
    }


# ---- material that moves through the mesh ------------------------------------------------------------


def material_velocity(model: Structure, displacement: ArrayLike, time: float = 0.0) -> Array:
    """Return the velocity of the material in space where nothing changes with the time.

    It is rate (A (X - X0) + (c·grad) u) + Ż, projected on the nodes: M v = rate (∫ ρ N A (X - X0) + G u) +
    ∫ ρ N Ż.  A moving frame has only the term of u: its body is at rest but for its waves.  Parts at rest
    have the velocity 0.  That of a `TransientAnalysis` adds u'.

    Parameters
    ----------
    model : with a motion of the material.
    displacement : (n, 3) m, such as `Result.u`.
    time : s, of a rate that changes.

    Returns
    -------
    (n, 3) in m/s.

    Raises
    ------
    InputError
        The model has no motion, or the displacement another shape.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> wheel = kl.Model(kl.annulus(0.2, 1.0, 0.1), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> wheel.fix("inner")
    >>> wheel.add(kl.ale.Rotation("z", rate=10.0))
    >>> v = material_velocity(wheel, wheel.solve().u)
    >>> print(f"{abs(v).max():.2f} m/s")
    10.00 m/s
    """
    e, u = _equations_and_displacement(model, displacement)
    return e.system.scatter(velocity_of_material(e, u, np.zeros_like(u), time))


def material_acceleration(model: Structure, displacement: ArrayLike, time: float = 0.0) -> Array:
    """Return the acceleration of the material in space where nothing changes with the time but the rate.

    It is rate² (A² (X - X0) + (c·grad)² u) + acceleration (A (X - X0) + (c·grad) u) + Z̈; derivatives of u
    are those of `material_derivative`.  That of a `TransientAnalysis` adds u'' + 2 rate (c·grad) u'.

    Parameters
    ----------
    model, displacement, time : as for `material_velocity`.

    Returns
    -------
    (n, 3) in m/s².

    Raises
    ------
    InputError
        The model has no motion, or the displacement another shape.
    """
    e, u = _equations_and_displacement(model, displacement)
    rest = np.zeros_like(u)
    return e.system.scatter(acceleration_of_material(e, u, rest, rest, time))


def material_derivative(
    model: Structure,
    field: ArrayLike,
    partial: Sequence[ArrayLike] = (),
    *,
    order: int = 1,
    time: float = 0.0,
    at: str = "node",
) -> Any:
    """Return the material time derivative of a quantity of the material, such as its temperature.

    Components are differentiated one by one: those of vectors and tensors are in axes fixed in space.

    Parameters
    ----------
    model : with a motion of the material.
    field : (n,) or (n, k) nodal values Θ.
    partial : ∂Θ/∂t at points fixed in the mesh, and ∂²Θ/∂t² for the second order, as `field`; 0 if not given.
    order : 1 for DΘ/Dt, 2 for D²Θ/Dt².
    time : s, of a rate that changes.
    at : ``"node"`` for the projection on the nodes, weighted by density; ``"gauss"`` for Gauss points.

    Returns
    -------
    (n,) or (n, k) at nodes; at Gauss points (m, g) or (m, g, k), or a list of (g,) or (g, k) where elements
    have different rules.

    Raises
    ------
    InputError
        The model has no motion, or an argument is invalid.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> wheel = kl.Model(kl.annulus(0.2, 1.0, 0.1), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> wheel.add(kl.ale.Rotation("z", rate=10.0))
    >>> warm_right = wheel.mesh.points[:, 0]  # x passes with the velocity 10 y
    >>> change = material_derivative(wheel, warm_right)
    >>> print(f"{abs(change - 10 * wheel.mesh.points[:, 1]).max():.6f} K/s")
    0.000000 K/s
    """
    e, place = _equations(model), choice(at, "at", PLACES)
    if isinstance(order, bool) or order not in (1, 2):
        raise InputError(f"order must be 1 or 2; got {order!r}")
    values = finite(field, "a field")
    if values.ndim not in (1, 2) or len(values) != model.mesh.n_nodes:
        raise InputError(f"a field needs shape ({model.mesh.n_nodes},) or (…, k); got {values.shape}")
    instance(partial, "partial", (list, tuple), "[change]")
    if len(partial) > order:
        raise InputError(f"the order {order} takes up to {order} partial derivatives; got {len(partial)}")
    given = [finite(one, "a partial derivative", values.shape) for one in partial]
    given += [np.zeros_like(values)] * (order - len(given))
    nodes, tail = e.system.nodes, values.shape[1:]
    flat = [one[nodes].reshape(len(nodes), -1) for one in (values, *given)]
    still, carried = _terms(e, flat, time)
    if place == "node":
        out = np.zeros((model.mesh.n_nodes, flat[0].shape[1]))
        out[nodes] = still + _convected(e, carried)
        return out.reshape(values.shape)
    parts = [_at_gauss(e, number, still, carried) for number in range(len(e.groups))]
    shaped = [part.reshape(*part.shape[:2], *tail) for part in parts]
    return in_order(e.groups, shaped)


def velocity_of_material(e: EquationsOfMotion, u: Array, v: Array, time: float) -> Array:
    """Return u' + rate (A (X - X0) + M^-1 G u) + Ż, (3a,) in m/s."""
    out = v.reshape(-1, 3).copy()
    if e.terms is not None:
        motion, moving, rate = e.terms.motion, e.terms.moving, e.rates(time)[0]
        if rate:
            out += _convected(e, rate * u.reshape(-1, 3))
        out[moving] += rate * motion.body_velocity(e.terms.moving_points) + e.center_rates(time)[0]
    return out.ravel()


def acceleration_of_material(e: EquationsOfMotion, u: Array, v: Array, a: Array, time: float) -> Array:
    """Return D²u/Dt² + rate² A² (X - X0) + acceleration A (X - X0) + Z̈, (3a,) in m/s²."""
    still, carried = _terms(e, [x.reshape(-1, 3) for x in (u, v, a)], time)
    out = still + _convected(e, carried)
    if e.terms is not None:
        (rate, acceleration), A = e.rates(time), e.terms.motion.A
        along = e.terms.motion.body_velocity(e.terms.moving_points)
        out[e.terms.moving] += rate**2 * along @ A.T + acceleration * along + e.center_rates(time)[1]
    return out.ravel()


def _terms(e: EquationsOfMotion, fields: list[Array], time: float) -> tuple[Array, Array]:
    """Return the a and b (a, k) of the derivative a + (c·grad) b of Θ, Θ' and for the second order Θ''."""
    rate, acceleration = e.rates(time)
    if len(fields) == 2:
        return fields[1], rate * fields[0]
    value, first, second = fields
    return second, 2 * rate * first + acceleration * value + rate**2 * _convected(e, value)


def _convected(e: EquationsOfMotion, values: Array) -> Array:
    """Return (c·grad) Θ of nodal values (a, k), projected: M^-1 G Θ."""
    if e.terms is None or not values.any():
        return np.zeros_like(values)
    return e.terms.mass.solve(e.terms.times(e.terms.G, values))


def _at_gauss(e: EquationsOfMotion, number: int, still: Array, carried: Array) -> Array:
    """Return a + (c·grad) b (m, g, k) at the Gauss points of the elements of a group."""
    assert e.terms is not None
    group, points, motion = e.system.groups[number], e.system.points, e.terms.motion
    out = []
    for chunk in group.chunks():
        element, nodes = group.at(points, chunk), group.nodes[chunk]
        c = motion.field(element.gauss_points()) * e.terms.moving[nodes[:, :1, None]]
        gradient = element._gauss[1] @ carried[nodes][:, None]
        N = element._N(group.rule)
        out.append(N @ still[nodes] + (c[..., None, :] @ gradient)[..., 0, :])
    return np.concatenate(out)


def _equations(model: Structure) -> EquationsOfMotion:
    if not isinstance(model.motion, Motion):
        raise InputError("the model has no motion of its material, so that it is at rest")
    return EquationsOfMotion(model)


def _equations_and_displacement(model: Structure, displacement: ArrayLike) -> tuple[EquationsOfMotion, Array]:
    e, u = _equations(model), finite(displacement, "a displacement")
    if u.shape != model.mesh.points.shape:
        raise InputError(f"a displacement needs shape {model.mesh.points.shape}; got {u.shape}")
    return e, e.system.gather(u)

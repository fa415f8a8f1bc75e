"""Adjoint solutions of quantities, and derivatives of quantities by what a model is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from kratos_lite.analysis.fields import Fields
from kratos_lite.analysis.nodal_loads import nodal_forces
from kratos_lite.analysis.quantities_of_interest import Compliance, Quantity
from kratos_lite.assembly.attached import Attached
from kratos_lite.assembly.gauss_point_fields import internal_load, virtual_work, work_by_coordinates
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model.free_motions import FreeMotions
from kratos_lite.model.loads.merging import joined
from kratos_lite.model.loads.temperature import heated
from kratos_lite.model.local_axes import Cartesian
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array
from kratos_lite.validation import choice

WRT = ("E", "stiffness", "density", "loads", "coordinates")
"""What derivatives are taken by."""
SAME = 1e-6
"""Relative difference up to which a reaction is the virtual work of a unit displacement of its part."""


def adjoint_of(
    result: Fields,
    quantity: Quantity,
    load: Array,
    adjoint: Callable[..., Array],
    attached: Attached | None,
    tolerance: float | None = None,
) -> Array:
    """Return the adjoint solution (n, 3) of a quantity whose derivative by u is a load (n, 3).

    The forces of springs are among reactions, so that those of a part are a load, too.
    """
    motion, hanging = quantity.motion(result), result.mesh.hanging
    held = result.reactions
    if motion.any() and attached:
        of_springs = attached.forces(motion if hanging is None else hanging.interpolate(motion))
        load, held = load - of_springs, held - attached.forces(result.u)
    z = adjoint(load, motion, tolerance)
    if motion.any():
        work, size = float((load * result.u - held * z).sum()), float(np.abs(result.reactions).sum())
        if abs(work - quantity.value(result)) > SAME * size:
            raise ModelError(
                f"{quantity}: multi-point constraints tie the part to nodes beside it, so that its reaction "
                "is that of no support; take the whole of what is tied together"
            )
    return z


def gradient_of(
    result: Any, quantity: Quantity, wrt: str, model: Structure, adjoint: Callable[..., Array]
) -> Array:
    """Return the derivative of a quantity; see `Result.gradient`."""
    # With residuals r = f - ∫ B^T σ dV and the adjoint z, dQ/dp = ∂Q/∂p + z·∂r/∂p where u stays. Source:
    # Haftka & Gürdal, Elements of Structural Optimization (1992), section 7.2.
    by = "stiffness" if choice(wrt, "wrt", WRT) == "E" else wrt
    E: Array | float = _moduli(result) if wrt == "E" else 1.0
    if by == "coordinates":
        _check_supports(model)
    if by != "stiffness":
        _check_held(model.free_motions(result.groups), wrt)

    of_loads = partial(_of_loads, model, result, by)
    if isinstance(quantity, Compliance) and _is_own_adjoint(result, model):
        z = result.u
    else:
        z = adjoint_of(result, quantity, quantity.derivative(result), adjoint, model.attached)
    total = of_loads(z) - _of_stresses(result, by, z) + quantity.explicit(result, by, of_loads)
    return np.asarray(total / E)


def _of_loads(model: Structure, result: Any, by: str, v: Array) -> Array:
    """Return the derivative of the work v·f of the loads."""
    known = result.mesh, result.groups
    if by == "loads":
        found = (nodal_forces(model, known[1], [load]) for load in result._acting)
        return np.array([sum((forces * v[nodes]).sum() for nodes, forces in some) for some in found])
    total = np.zeros_like(v) if by == "coordinates" else np.zeros(result.mesh.n_elements)
    acting = chain.from_iterable(load.acting(0.0) for load in result._acting if by != "stiffness")
    for factor, part in joined(result.mesh, acting):
        total += factor * (part.by_density if by == "density" else part.by_coordinates)(*known, v)
    return total


def _of_stresses(result: Any, by: str, z: Array) -> Array | float:
    """Return the derivative of the virtual work z·∫ B^T σ dV."""
    mesh, groups, u = result.mesh, result.groups, result._strained
    if by == "stiffness":
        out = np.zeros(mesh.n_elements)
        for group in groups:
            X, strained, v = (values[group.nodes] for values in (mesh.points, u, z))
            plain = replace(group, prestress=None, factors=None)
            out[group.rows] = virtual_work(X, plain, strained, v)
        return out
    if by == "coordinates":
        return np.asarray(sum(work_by_coordinates(mesh.points, group, u, z) for group in groups))
    if by == "loads":
        cold, rest = [group.without_initial for group in groups], np.zeros_like(u)
        warm = [heated(mesh, cold, load.acting(0.0)) for load in result._acting]
        return np.array([(internal_load(mesh.points, some, rest) * z).sum() for some in warm])
    return 0.0


def _is_own_adjoint(result: Any, model: Structure) -> bool:
    """Return whether nothing but loads strains the body."""
    warm = any(group.prestress is not None or group.heating is not None for group in result.groups)
    return not (model.supports.displaced or warm or model.initial_displacement is not None)


def _moduli(result: Any) -> Array:
    """Return Young's modulus (m,) in Pa of each element, over its factor of the stiffness."""
    E = np.ones(result.mesh.n_elements)
    for group in result.groups:
        modulus: Any = getattr(group.material, "E", None)
        if not isinstance(modulus, float):
            raise InputError(
                f"{type(group.material).__name__} has no Young's modulus E; take wrt='stiffness', the "
                "derivative by a factor of the stiffness of each element"
            )
        E[group.rows] = modulus if group.factors is None else modulus / group.factors
    return E


def _check_supports(model: Structure) -> None:
    """Raise ModelError where what supports, ties or springs do depends on places."""
    attached = [("attached", each) for each in model.attachments]
    for title, each in [(tie.title, tie) for tie in model.supports.ties] + attached:
        raise ModelError(
            f"there is no derivative by coordinates with the {title} {each}, whose equations depend on "
            "places; take another wrt, or a model without it"
        )
    for condition in model.supports.conditions:
        local = condition.local is not None and not isinstance(condition.local, Cartesian)
        if local or condition.field is not None:
            raise ModelError(
                f"there is no derivative by coordinates with the support {condition}, which depends on "
                "places; prescribe values of nodes along fixed axes"
            )


def _check_held(free: FreeMotions, wrt: str) -> None:
    """Raise ModelError where supports leave rigid motions free, as loads would balance no more."""
    if free.any:
        text = "needs supports that hold the body: its loads would not balance"
        raise ModelError(f"a derivative by {wrt} {text}; {free.described()}")

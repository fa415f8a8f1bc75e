"""Custom elements: B or the local system of a user, run for many elements; other overrides are refused."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from inspect import signature
from types import FunctionType
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.typing import Array
from kratos_lite.validation import short

CUSTOM = ("B", "local_system")
"""What a class of a user may override."""
METHODS = (FunctionType, classmethod, staticmethod, property, cached_property)
SAME = 1e-10
"""Relative difference up to which a value is the same, computed for many elements or for one."""
LINEAR = 1e-8
"""Relative error up to which a local system is symmetric, and linear in u."""

STRAIN = "override B(xi), from which strain, stress, internal forces and stiffness follow"
SYSTEM = "override local_system(C, u), which returns K and r_int"
MASS = "mass and body forces are exact for the shape; state a mass_rule to change the mass"
CURES = {
    **dict.fromkeys(("N", "dN"), "write it in the Shape of the element"),
    **dict.fromkeys(("J", "detJ", "dNdX", "dV", "strain", "strain_at"), STRAIN),
    **dict.fromkeys(("internal_force", "stiffness", "stiffness_by_axis", "K", "r_int"), SYSTEM),
    **dict.fromkeys(("body_force", "r_ext", "mass", "scalar_mass", "lumped_mass", "volume"), MASS),
    "stress": "stress is C strain: write a LinearMaterial with that C",
    "__init__": f"{STRAIN}; or {SYSTEM}",
}
"""What to write in place of a method that is not overridden."""


def is_builtin(cls: type[Any]) -> bool:
    """Return whether a class is one of the library."""
    return cls.__module__.startswith("kratos_lite.")


def custom_methods(cls: type[Any]) -> frozenset[str]:
    """Return which of B and local_system are a user's; InputError if the user overrides another method."""
    builtin = {
        name
        for base in filter(is_builtin, cls.__mro__)
        for name, value in vars(base).items()
        if isinstance(value, METHODS) and (name == "__init__" or not name.startswith("__"))
    }
    custom = {name for base in cls.__mro__[:-1] if not is_builtin(base) for name in vars(base)}
    for name in sorted(custom & (builtin | CURES.keys()) - {*CUSTOM, "table"}):
        cure = CURES.get(name, "the library needs its own: give yours another name")
        raise InputError(f"{cls.__name__} overrides {name}, which analyses would not use; {cure}")
    return frozenset(custom & set(CUSTOM))


def operator(element: Any, xi: Array, C: Any) -> Array:
    """Return B (..., g, 6, 3n) at points (g, 3) by the class's own `B`."""
    more = len(signature(type(element).B).parameters) > 2  # B(xi, C) of a B that depends on the material
    tail = (6, element.nodes.size)

    def B(cells: Any, *C: Any) -> tuple[Array]:
        return (np.stack([_checked(cells, "B", cells.B(t, *C), tail) for t in xi], axis=-3),)

    return _of_each(element, "B", B, *(C,) * more)[0]


def system(element: Any, C: Array, u: Array) -> tuple[Array, Array]:
    """Return K (..., 3n, 3n) and r_int (..., n, 3) by the class's own `local_system`."""
    name, tails = type(element).__name__, ((element.nodes.size,) * 2, element.nodes.shape)

    def local_system(cells: Any, C: Array, u: Array) -> tuple[Array, ...]:
        try:
            pair = cells.local_system(C, u)
        except RecursionError:
            raise InputError(
                f"{name}.local_system calls itself through stiffness; take super().local_system(C, u)"
            ) from None
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise InputError(f"{name}.local_system must return K and r_int; got {short(pair)}")
        K, r = (_checked(cells, "local_system", *part) for part in zip(pair, tails, strict=True))
        return K, r

    K, r = _of_each(element, "local_system", local_system, C, u)
    return K, r


def stiffness(element: Any, C: Array) -> Array:
    """Return K (..., 3n, 3n) of the class's own `local_system`; InputError unless r_int = K u and K = K^T."""
    name, X = type(element).__name__, element.X
    K, _ = system(element, C, np.zeros_like(X))
    first = (0,) * (X.ndim - 2)
    u = np.random.default_rng(1).uniform(-1, 1, X.shape[-2:]) * np.ptp(X[first])
    cell = type(element)(X[first], element.rule)
    r = system(cell, C if C.ndim == 2 else C[first], u)[1].ravel()
    miss, size = np.abs(r - K[first] @ u.ravel()).max(), np.abs(K[first]).max() * np.abs(u).max()
    if not miss <= LINEAR * size:
        raise InputError(
            f"{name}.local_system is not linear: at a random u, r_int is not K u, by {miss / size:.1e} of "
            "|K| |u|; elements of small strains return K, and r_int = K u"
        )
    miss, size = np.abs(K - np.swapaxes(K, -1, -2)).max(), np.abs(K).max()
    if not miss <= LINEAR * size:
        raise InputError(
            f"{name}.local_system returns a K that is not symmetric, by {miss / size:.1e} of its largest "
            "number, so that it has no energy; correct it"
        )
    return K


def _of_each(
    element: Any, name: str, values: Callable[..., tuple[Array, ...]], *arguments: Any
) -> tuple[Array, ...]:
    """Return values of elements X (..., n, 3), one by one, or at once if `batched`."""
    cls, X = type(element), element.X
    lead, cells = X.shape[:-2], X.reshape(-1, *X.shape[-2:])
    if not lead:
        return values(element, *arguments)
    cut = [_by_element(value, lead) for value in arguments]

    def alone(e: int) -> tuple[Array, ...]:
        return values(cls(cells[e], element.rule), *[value(e) for value in cut])

    owner = next(base for base in cls.__mro__ if name in vars(base))
    if not vars(owner).get("batched", False):
        results = [alone(e) for e in range(len(cells))]
        return tuple(np.stack(part).reshape(*lead, *part[0].shape) for part in zip(*results, strict=True))
    try:
        many = values(element, *arguments)
    except KratosLiteError:
        raise
    except (ValueError, IndexError, TypeError) as error:
        raise InputError(
            f"{cls.__name__}.{name} fails for many elements: {error}; write it for X (..., n, 3), "
            "or leave out batched = True"
        ) from error
    for e in (0, len(cells) - 1):
        for part, one in zip(many, alone(e), strict=True):
            if (np.abs(part.reshape(-1, *one.shape)[e] - one) > SAME * np.abs(one).max()).any():
                raise InputError(
                    f"{cls.__name__}.{name} gives other values for many elements than for one; write it for "
                    "X (..., n, 3), or leave out batched = True"
                )
    return many


def _by_element(value: Any, lead: tuple[int, ...]) -> Callable[[int], Any]:
    """Return what gives the part of an argument for one element: nodal values and C have two axes."""
    if np.ndim(value) <= 2:
        return lambda e: value
    each = np.broadcast_to(value, (*lead, *np.shape(value)[-2:])).reshape(-1, *np.shape(value)[-2:])
    return lambda e: each[e]


def _checked(element: Any, name: str, value: Any, tail: tuple[int, ...]) -> Array:
    """Return what a method of a user returned as numbers (..., *tail)."""
    shape = (*element.X.shape[:-2], *tail)
    try:
        array = np.asarray(value, dtype=float)
        found = f"got {array.shape}"
    except (TypeError, ValueError):
        array, found = np.empty(0), f"got {short(value)}"
    if array.shape == shape and np.isnan(array).any():
        found = "got nan"
    elif array.shape == shape:
        return array
    raise InputError(
        f"{type(element).__name__}.{name} must return numbers of shape {shape} here; {found}; "
        "see docs/howto/own-element.md"
    )

"""Overridden steps: methods that an element class overrides, run for many elements even if written for one.

Whoever computes with many elements takes strain, stress, internal load and stiffness from here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from types import FunctionType
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, KratosLiteError, ModelError
from kratos_lite.tabular import Tabular
from kratos_lite.typing import Array
from kratos_lite.validation import short

STRAIN = ("B", "B_at_gauss_points", "strain")
"""Steps to the strain; what follows has the short way of gradients where a class inherits them."""
STRESS = (*STRAIN, "stress")
"""Steps to the stress."""
MECHANICS = (*STRESS, "internal_load", "stiffness", "stiffness_by_axis")
"""Steps to the stiffness, but for the geometry."""

METHODS = (FunctionType, classmethod, staticmethod, property, cached_property)
SAME = 1e-10
"""Relative difference up to which a value is the same, computed for many elements or for one."""
LINEAR = 1e-8
"""Relative error up to which a step is linear in u."""
SYMMETRIC = 1e-8
"""Relative difference up to which a stiffness is symmetric."""


def takes_many(cls: type[Any]) -> bool:
    """Return whether every class that brings methods states ``batched = True``: they take X (..., n, 3)."""
    return all(
        vars(base).get("batched", False)
        for base in cls.__mro__
        if base is not Tabular  # its methods know no X
        and any(
            isinstance(value, METHODS) for name, value in vars(base).items() if name != "__annotate_func__"
        )
    )


def brought(cls: type[Any], base: type[Any]) -> list[str]:
    """Return the names of the methods that a class and its bases up to `base` bring."""
    return [
        name
        for one in cls.__mro__[: cls.__mro__.index(base)]
        for name, value in vars(one).items()
        if isinstance(value, METHODS) and name != "__annotate_func__"
    ]


def run_step(element: Any, name: str, tail: tuple[int, ...], *given: Any) -> Array:
    """Return a step that a class overrides, (..., *tail) for elements (..., n, 3).

    One by one, so that a class may be written for one element, X (n, 3), unless the class is `batched`.
    """
    cls, X = type(element), element.X
    lead, cells = X.shape[:-2], X.reshape(-1, *X.shape[-2:])
    if not lead:
        return _checked(getattr(element, name)(*given), cls, name, tail)
    if not len(cells):
        return np.zeros((*lead, *tail))
    cut = [_by_element(value, lead) for value in given]
    placed, compared = element.__dict__.setdefault("_one_by_one", ({}, set()))

    def alone(e: int) -> Array:
        if e not in placed:
            placed[e] = cls(cells[e], element.rule)
        return _checked(getattr(placed[e], name)(*[value(e) for value in cut]), cls, name, tail)

    if not takes_many(cls):
        return np.stack([alone(e) for e in range(len(cells))]).reshape(*lead, *tail)
    many = _checked(_of_many(element, name, given), cls, name, (*lead, *tail))
    if name not in compared:
        compared.add(name)
        rows = many.reshape(-1, *tail)
        if not all(_same(rows[e], alone(e)) for e in (0, len(cells) - 1)):
            raise InputError(
                f"{cls.__name__}.{name} gives other values for many elements than for one; write it for "
                "X (..., n, 3), or leave out batched = True"
            )
    return many


def _of_many(element: Any, name: str, given: tuple[Any, ...]) -> Any:
    """Return a step of a batched class; one that was written for one element may fail with NumPy's words."""
    try:
        return getattr(element, name)(*given)
    except KratosLiteError:
        raise
    except (ValueError, IndexError, TypeError) as error:
        raise InputError(
            f"{type(element).__name__}.{name} fails for many elements: {error}; write it for X (..., n, 3), "
            "or leave out batched = True"
        ) from error


def _by_element(value: Any, lead: tuple[int, ...]) -> Callable[[int], Any]:
    """Return what gives the part of an argument for one element: nodal values, stresses, C have two axes."""
    if np.ndim(value) <= 2:
        return lambda e: value
    rows = np.broadcast_to(value, (*lead, *np.shape(value)[-2:])).reshape(-1, *np.shape(value)[-2:])
    return lambda e: rows[e]


def _checked(value: Any, cls: type[Any], name: str, tail: tuple[int, ...]) -> Array:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{cls.__name__}.{name} must return numbers of shape {tail} here; got {short(value)}; "
            "see docs/howto/own-element.md"
        ) from error
    if array.shape != tail:
        raise InputError(
            f"{cls.__name__}.{name} must return shape {tail} here; got {array.shape}; "
            "see docs/howto/own-element.md"
        )
    return array


def _same(many: Array, one: Array) -> bool:
    """Whether two values agree; what is no number is found elsewhere."""
    return bool((~(np.abs(many - one) > SAME * np.abs(one).max(initial=0.0))).all())


def columns(element: Any, name: str, values: Callable[[Array], Array]) -> Array:
    """Return the matrix (..., g, 6, 3n) of a step that is linear in u: its values of unit displacements.

    Raises
    ------
    InputError
        If the step is not linear.
    """
    shape = element.X.shape
    found = []
    for dof in range(3 * shape[-2]):
        u = np.zeros(shape)
        u[..., dof // 3, dof % 3] = 1.0
        found.append(values(u))
    matrix = np.stack(found, axis=-1)
    u = np.broadcast_to(np.random.default_rng(1).uniform(-1, 1, shape[-2:]), shape)
    miss = np.abs(values(np.array(u)) - (matrix @ u.reshape(*shape[:-2], 1, -1, 1))[..., 0])
    size = np.abs(matrix).max(initial=0.0)
    if not (miss <= LINEAR * size).all() or values(np.zeros(shape)).any():
        raise InputError(
            f"{type(element).__name__}.{name} is not linear in u: its values of a random u miss the sum of "
            f"those of unit displacements by {miss.max() / max(size, 1e-300):.1e} of the largest; elements "
            "of small strains need a linear one"
        )
    return matrix


# ---- the steps as they are ----------------------------------------------------------------------


def strain_of(element: Any, u: Any, C: Any = None) -> Array:
    """Return the strain (..., g, 6) of elements; `C` is for those whose strain depends on it."""
    if element.inherits("strain"):
        return np.asarray(element.strain(u, C))
    return run_step(element, "strain", (len(element.rule), 6), u)


def stress_of(element: Any, C: Any, u: Any) -> Array:
    """Return the stress (..., g, 6) of elements in Pa."""
    if element.inherits("stress"):
        return np.asarray(element.stress(C, u))
    return run_step(element, "stress", (len(element.rule), 6), C, u)


def internal_load_of(element: Any, stress: Any, C: Any = None) -> Array:
    """Return the internal load (..., n, 3) of elements in N."""
    if element.inherits("internal_load"):
        return np.asarray(element.internal_load(stress, C))
    return run_step(element, "internal_load", element.nodes.shape, stress)


def stiffness_of(element: Any, C: Any) -> Array:
    """Return the stiffness (..., 3, n, 3, n) of elements in N/m, by axis, then node.

    Raises
    ------
    ModelError
        If the class overrides a step so that its stiffness is not symmetric.
    """
    if element.inherits(*MECHANICS):
        return np.asarray(element.stiffness_by_axis(C))
    n = len(element.nodes)
    own = not element.inherits("stiffness_by_axis")
    K = run_step(element, "stiffness_by_axis", (3, n, 3, n), C) if own else element.stiffness_by_axis(C)
    miss = np.abs(K - K.transpose(*range(K.ndim - 4), -2, -1, -4, -3)).max(initial=0.0)
    if not miss <= SYMMETRIC * np.abs(K).max(initial=0.0):
        found = f"is not symmetric (by {miss:.1e} N/m), so that it has no energy"
        if not np.isfinite(miss):
            found = "holds nan or inf"
        raise ModelError(
            f"the stiffness of {type(element).__name__} {found}; check the steps that the class overrides "
            "with kratos-lite check"
        )
    return np.asarray(K)

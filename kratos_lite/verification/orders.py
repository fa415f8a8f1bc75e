"""Orders of convergence against a manufactured solution: p + 1 for displacements, p for the energy norm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.verification import fields, scenes
from kratos_lite.verification.errors import FINE, FINE_OF_SMOOTH, energy_norm, l2_norm
from kratos_lite.verification.meshes import is_quadratic, kind_of
from kratos_lite.verification.problem import Models, Of, Problem

Norm = Callable[..., float]
"""`l2_norm` or `energy_norm`."""
CELLS = {"tetrahedron": (12, 6), "pyramid": (8, 4), "wedge": (8, 4), "hexahedron": (8, 6)}
"""Bricks along an edge of the finer mesh, for linear and for quadratic elements; 8 for the 20-node brick."""


def error_of(field: fields.Field, norm: Norm = l2_norm) -> Callable[[Result], float]:
    """Return a function: the relative error of a result in a norm."""
    fine = FINE_OF_SMOOTH if field is fields.manufactured else FINE
    return lambda result: norm(field, result.mesh.points, result.groups, result.u, fine)


def order_of(field: fields.Field, norm: Norm) -> Callable[[Result, Result], float]:
    """Return a function: the order of the error between two results, the second with half the cells' size."""
    error = error_of(field, norm)
    return lambda coarse, fine: float(np.log2(error(coarse) / error(fine)))


def two_meshes(distortion: float) -> Models:
    """Return a function: the manufactured solution on a mesh and on one twice as fine."""

    def models(kind: str) -> tuple[Model, ...]:
        n = CELLS[kind_of(kind).shape.cell][is_quadratic(kind)]
        n = 8 if len(kind_of(kind).shape.nodes) == 20 else n
        return tuple(scenes.manufactured(kind, m, distortion).model for m in (n // 2, n))

    return models


MESHES = {"cubic": two_meshes(0.0), "distorted": two_meshes(0.1)}


def _is_plain_quadratic(kind: str) -> bool:
    """Return whether an element is a plain quadratic one: the orders of others may be higher."""
    return is_quadratic(kind) and kind_of(kind).formulation == "standard"


def _problem(word: str, norm: Norm, degree: int) -> Problem:
    linear = degree == 1
    takes: Of = (lambda kind: kind_of(kind).shape.degree < 2) if linear else _is_plain_quadratic
    what, order = ("displacement", degree + 1) if norm is l2_norm else ("energy", degree)
    return Problem(
        f"order/{word}_{what}_{'linear' if linear else 'quadratic'}",
        f"order of the error of {'u (L2 norm)' if norm is l2_norm else 'σ (energy norm)'}, "
        f"manufactured solution, {word} cells",
        "Roache", float(order), MESHES[word], order_of(fields.manufactured, norm), 0.15 / order, takes=takes,
    )  # fmt: skip


PROBLEMS: list[Problem] = [
    _problem(word, norm, degree) for degree in (1, 2) for word in MESHES for norm in (l2_norm, energy_norm)
]
"""The rows of this family."""

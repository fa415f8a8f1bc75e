"""What every solution without time has in common: its arguments, phases, quality and checks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, SolveError
from kratos_lite.mesh import Mesh
from kratos_lite.model.checks import young_moduli
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.solvers.plan import METHODS
from kratos_lite.tabular import size_in_si
from kratos_lite.typing import Array, Progress
from kratos_lite.validation import choice, function_or_none


class Phases:
    """Seconds spent in each named phase; `progress` is called where one begins and ends."""

    def __init__(self, progress: Progress | None = None) -> None:
        function_or_none(progress, "progress must be a function of a phase and a fraction")
        self.seconds: dict[str, float] = {}
        self.progress = progress

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Measure the body of a ``with`` statement."""
        start = perf_counter()
        if self.progress:
            self.progress(name, 0.0)
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start
        if self.progress:
            self.progress(name, 1.0)


def check_arguments(solver: str, tolerance: float) -> None:
    """Raise InputError for an unknown solver, or a tolerance beyond 0 … 1."""
    if isinstance(tolerance, bool) or not isinstance(tolerance, (float, int)) or not 0 < tolerance < 1:
        raise InputError(f"tolerance must be a number between 0 and 1; got {tolerance!r}")
    choice(solver, "solver", METHODS)


def check_solution(solution: Solution, u: Array, balance: tuple[float, float]) -> None:
    """Raise SolveError for a solution that does not solve its equations or is not in equilibrium."""
    if not np.isfinite(u).all() or solution.backward_error > 1e-8:
        raise SolveError(
            f"{solution.method} solver reached a backward error of {solution.backward_error:.1e} only; "
            "ask for a smaller tolerance, or look for very thin elements, a large stiffness contrast or "
            "nearly free parts"
        )
    if max(balance) > 1e-2:
        raise SolveError(
            f"loads, reactions and stresses miss equilibrium by {balance[0]:.1e} (forces) and "
            f"{balance[1]:.1e} (moments) of their size; look for a large stiffness contrast, spurious modes, "
            "nearly free parts or an element class whose stiffness is not that of its stresses, and please "
            "report a model that has none"
        )


LARGE = 0.1  # displacement, as fraction of the diagonal of the body, from which it is not small
TINY = 1e-11
"""Displacement, as fraction of the diagonal, below which a load does nothing: 0.2 Pa on steel do more."""
STRAINED = 0.05  # strain from which it is not small
SAMPLE = 500  # elements whose strain is looked at, spread over the mesh
UNITLESS = 10.0
"""Young's modulus in Pa below all materials, gels included, so that models with it are without units."""
GOLDEN = (5**0.5 - 1) / 2
UNITS = "is E in Pa (steel: 210e9), are lengths in m, forces in N and pressures in Pa?"
IN_MM = "are lengths in mm (read with scale=1e-3, or --scale mm) and pressures in MPa?"


def check_deformation(model: Structure, groups: Sequence[ElementGroup], u: Array) -> list[str]:
    """Warn of displacements u (n, 3) in m, or strains, too large for linear theory, or next to nothing."""
    # Those of a model without units, softer than everything there is, are whatever they are.
    mesh, start, prescribed = model.mesh, model.initial_displacement, model.supports.values
    moved = u if start is None else u - start
    if not moved.any():
        return []
    strain, size, largest = largest_elongation(mesh, moved), _diagonal(mesh.points), _diagonal(moved)
    if largest > LARGE * size:  # nodes without elements stay, whatever the body does
        largest = _diagonal(moved[mesh.used_nodes()])
    found = []
    if largest > LARGE * size:
        fraction = largest / size
        times = f"{fraction:.0%} of" if fraction < 2 else f"{fraction:.3g} times"
        found.append(f"displacements differ by {largest:.3g} m, {times} the size of the body")
    elif largest < TINY * size:
        return [
            f"displacements differ by {largest:.3g} m only, {largest / size:.1e} of the size of the body "
            f"({size:.3g} m); {IN_MM if model.units == 'SI' else f'are all numbers in {model.units}?'}"
        ]
    if strain > STRAINED:
        found.append(f"strains reach at least {strain:.0%}")
    softest = UNITLESS / size_in_si("Pa", model.units)
    if not found or all(young_moduli(group.material)[1] < softest for group in groups):
        return []
    meant = prescribed.any() and _diagonal(prescribed) > 0.5 * largest
    asked = UNITS if model.units == "SI" else f"are all numbers in {model.units}?"
    limits = f"linear theory holds up to about {LARGE:.0%} of the size and strains of {STRAINED:.0%}"
    return ["; ".join([", ".join(found), *([] if meant else [asked]), limits])]


def largest_elongation(mesh: Mesh, u: Array) -> float:
    """Return the largest change of length of the lines between corners of elements, relative."""
    # It is a lower bound of the largest principal strain; of a large mesh, of `SAMPLE` elements.
    found = 0.0
    for block in mesh.blocks:
        if block.shape is None or not len(block):
            continue
        count, wanted = len(block), -(-SAMPLE * len(block) // mesh.n_elements)
        # spread so that no regular order of the elements hides any
        cells = np.arange(count) if wanted >= count else (np.arange(wanted) * GOLDEN % 1 * count).astype(int)
        corners = block.nodes[cells, : block.shape.corners]
        one, other = np.triu_indices(block.shape.corners, 1)
        X, D = mesh.points[corners], u[corners]
        X, D = X[:, one] - X[:, other], D[:, one] - D[:, other]
        length = np.maximum(np.einsum("epi,epi->ep", X, X), np.finfo(float).tiny)
        found = max(found, float(np.abs(np.einsum("epi,epi->ep", X, D) / length).max()))
    return found


def _diagonal(values: Array) -> float:
    """Return the diagonal of the smallest box around vectors (n, 3)."""
    return float(np.linalg.norm(np.ptp(values, axis=0))) if len(values) else 0.0

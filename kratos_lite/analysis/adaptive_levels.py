"""Levels of an adaptive solution: a mesh, its solution, and what it and the level before say of the error."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kratos_lite.analysis.error_estimate import FEW, NEGLIGIBLE, QuantityError
from kratos_lite.analysis.quantities_of_interest import Quantity
from kratos_lite.analysis.report import RefinementStep
from kratos_lite.analysis.result import Result
from kratos_lite.assembly.gauss_point_fields import totals, volumes
from kratos_lite.errors import ModelError
from kratos_lite.mesh.refined_mesh import RefinedMesh
from kratos_lite.mesh.refinement import axes_along
from kratos_lite.model.structure import Structure
from kratos_lite.quadrature import Rule
from kratos_lite.typing import Array, Ints

CORRECTED = 1.1  # safety of an estimate that coarser meshes correct
MOST_CORRECTED = 1.4  # times that it may exceed the estimate of its own mesh
FALLEN, SETTLED = 0.7, 0.9
"""Fraction of an earlier estimate by which one is corrected, as short steps say little; the largest one."""
AIM = 0.93  # fraction of the requested error at which the next mesh aims
SINGULAR = 0.25
"""Fraction of its squared error that an element keeps when it is cut or becomes quadratic, from which the
solution counts as singular there."""
ROUNDING = 1e-10  # fraction of the sizes that a quantity is the sum of, up to which its value is rounding


@dataclass(eq=False)
class Level:
    """A model solved, and what is known of its error; the level before it, and the step from there."""

    model: Structure
    result: Result
    step: RefinedMesh | None
    before: Level | None

    @cached_property
    def squares(self) -> Array:
        """Squared estimate of each element (m,) in J, the best guess."""
        found = self.result.error()
        return (found.per_element / found.safety) ** 2

    @cached_property
    def estimate(self) -> float:
        """Estimate of the error in √J."""
        return float(np.sqrt(self.squares.sum()))

    @cached_property
    def norm(self) -> float:
        """‖u‖ in √J."""
        return self.result.norm

    @cached_property
    def order(self) -> int:
        """Order of the elements."""
        shapes = [block.shape for block in self.model.mesh.blocks if len(block) and block.shape]
        return min(shape.degree for shape in shapes)

    @cached_property
    def change(self) -> float:
        """‖u - u_H‖ in √J from the solution of the level before."""
        assert self.before is not None
        assert self.step is not None
        change = self.result.u - self.step.interpolate(self.before.result.u)
        cold = [group.without_initial for group in self.result.groups]
        return float(np.sqrt(2 * totals(self.model.mesh.points, cold, change)[0]))

    @property
    def is_nested(self) -> bool:
        """Whether a finer mesh has the strains of this one: others are not of displacements alone."""
        return all(group.element.formulation == "standard" for group in self.result.groups)

    @cached_property
    def trail(self) -> list[tuple[float, float]]:
        """Estimates of the levels of this order up to this one, and ‖u - u_H‖² in J from their solutions."""
        before = self.before
        if before is None or not before.is_nested or before.is_blind or before.order < self.order:
            return [(self.estimate, 0.0)]
        return [*((one, far + self.change**2) for one, far in before.trail), (self.estimate, 0.0)]

    @cached_property
    def corrected(self) -> float:
        """The estimate in √J as the last level with a clearly larger one corrects it."""
        *earlier, (now, _) = self.trail
        if not earlier:
            return now
        larger = [k for k, (one, _) in enumerate(reversed(earlier), 1) if now <= FALLEN * one]
        steps = larger[0] if larger else len(earlier)
        one, far = earlier[-steps]
        # An estimate that falls faster than cells shrink was too large before.
        ratio = float(np.clip(now / one if one > 0 else 1.0, 2.0 ** (-self.order * steps), SETTLED))
        return ratio * float(np.sqrt(far / (1 - ratio**2)))

    @cached_property
    def bound(self) -> float:
        """The error in √J that is reported."""
        alone = self.result.error().absolute
        corrected = alone if self.before is None else CORRECTED * self.corrected
        return float(np.clip(corrected, alone, MOST_CORRECTED * alone))

    @property
    def reported(self) -> float:
        """The same, relative."""
        return self.bound / self.norm if self.norm > 0 else 0.0

    @property
    def is_blind(self) -> bool:
        """Whether there is no error to be seen because elements are too few or too simple to see one by."""
        # Linear elements of a twisted bar may have stresses that go on smoothly from one to the next.
        simple = self.model.mesh.n_elements < FEW or (self.order == 1 and self.before is None)
        return simple and self.norm > 0 and self.reported <= NEGLIGIBLE

    @property
    def is_settled(self) -> bool:
        """Whether the estimate needs no other level beside it."""
        return not self.is_blind

    def aim(self, error: float) -> float:
        """Return the estimate in √J at which a mesh aims that is to reach a relative error."""
        return AIM * error / self.reported * self.estimate

    def refinement_step(self, seconds: float) -> RefinementStep:
        """Return the level as a step of the history."""
        kinds = dict.fromkeys(group.element.__name__ for group in self.result.groups)
        count, unknowns = self.model.mesh.n_elements, self.result.report.unknowns
        return RefinementStep(count, ", ".join(kinds), unknowns, self.reported, seconds)

    def kept(self) -> Array:
        """Return the fraction of its squared error (m,) that each element keeps if it is cut."""
        smooth = 4.0**-self.order
        kept = np.full(len(self.squares), smooth)
        if self.before is None or self.step is None:
            return kept
        parents, old = self.step.elements, self.before.squares
        if self.before.order < self.order:
            kept[self.squares > SINGULAR * old[parents]] = 0.5
            return kept
        count, total = np.bincount(parents)[parents], np.bincount(parents, weights=self.squares)
        remaining = np.clip(total / np.maximum(old, np.finfo(float).tiny), smooth, 0.8)[parents]
        heavy = (count > 1) & (self.squares * count > total[parents])
        return np.where(heavy, remaining, kept)


@dataclass(eq=False)
class QuantityLevel(Level):
    """The same for the error of a quantity: products of two errors stand for the squares of one."""

    quantity: Quantity

    @cached_property
    def found(self) -> QuantityError:
        """Error of the quantity."""
        return self.result.error(self.quantity)

    @cached_property
    def squares(self) -> Array:
        """What each element contributes to the error of the quantity (m,), in its unit."""
        return np.abs(self.found.per_element)

    @property
    def is_settled(self) -> bool:
        """Whether the level before has elements of the same order: one level alone may say too little."""
        if self.reported == 0:
            return not self.is_blind
        return self.before is not None and self.before.order == self.order

    def __post_init__(self) -> None:
        """Raise ModelError if the value is rounding of what it is made of, and has no relative error."""
        result, load = self.result, np.abs(self.quantity.load(self.result))
        size = float(load.sum() * np.abs(result.u).max(initial=0.0))
        if self.quantity.motion(result).any():
            size += float(np.abs(result.reactions).sum())
        found = self.found
        if self.before is not None and 0 < max(abs(found.value), abs(found.signed)) < ROUNDING * size:
            raise ModelError(
                f"{self.quantity} is 0 but for rounding, {found.value:.1e} {found.unit}, so that it has no "
                "relative error; ask for that of another quantity or of the energy norm"
            )

    @property
    def reported(self) -> float:
        """The error on the safe side, relative; at least what the last step promises of the next ones."""
        found, before = self.found, self.before
        absolute = found.absolute
        if isinstance(before, QuantityLevel) and before.order == self.order:
            ratio = min(SETTLED, (self.estimate / before.estimate) ** 2) if before.estimate > 0 else 0.0
            change = abs(found.value - before.found.value)
            absolute = max(absolute, CORRECTED * change * ratio / (1 - ratio))
        size = abs(found.value + found.signed)
        return absolute / size if size > 0 else float(absolute > 0)

    def aim(self, error: float) -> float:
        """Return the root of the sum of `squares` at which a mesh aims that is to reach a relative error."""
        return self.estimate * float(np.sqrt(AIM * error / self.reported))


def layer_direction(result: Result, allowed: float) -> Array | None:
    """Return the first of x, y and z along which all elements have straight edges and constant stress."""
    for direction in np.eye(3):
        axes = [axes_along(result.mesh, block, direction) for block in result.mesh.blocks if len(block)]
        along = np.concatenate(axes)
        if len(along) and (along >= 0).all() and _variation(result, along) <= allowed**2:
            return direction
    return None


def _variation(result: Result, along: Ints) -> float:
    """Return ∫ Δσ : C⁻¹ : Δσ dV of the stress less its mean along an axis of each cell, in J."""
    total = 0.0
    for group in result.groups:
        stress = result.stress_in(group)
        density = np.zeros(stress.shape[:2])
        for axis in range(3):
            cells = along[group.rows] == axis
            off = _off_mean(group.rule, axis) @ stress[cells]
            density[cells] = ((off @ np.linalg.inv(group.material.C)) * off).sum(axis=-1)
        over = 1.0 if group.factors is None else group.factors[:, None]
        total += float((density / over * volumes(result.mesh.points, group)).sum())
    return total


def _off_mean(rule: Rule, axis: int) -> Array:
    """Return the matrix (g, g) from values at the points of a rule to their differences from means."""
    others = np.delete(rule.points, axis, axis=1)
    same = np.abs(others[:, None] - others[None]).max(axis=2) < 1e-9
    weights = same * rule.weights
    return np.eye(len(others)) - weights / weights.sum(axis=1, keepdims=True)

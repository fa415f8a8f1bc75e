"""Estimates of the error of a result, in the energy norm and of a quantity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.analysis.adjoint import adjoint_of
from kratos_lite.analysis.fields import Fields
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.formulations import NEAR_HALF, bulk_over_shear
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.facets import facets
from kratos_lite.model.locking import better_element
from kratos_lite.model.supports import AXES
from kratos_lite.tabular import unit_name
from kratos_lite.typing import Array, Mask

if TYPE_CHECKING:
    from kratos_lite.analysis.quantities_of_interest import Quantity
    from kratos_lite.assembly.nodal_recovery import Recovery
    from kratos_lite.model.structure import Structure


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """How far a result is from the exact solution, in the energy norm ‖e‖² = ∫ e : C : e dV.

    `Result.error` makes it.

    It is meant to be on the safe side: where nothing speaks against it, the true error is smaller, but seldom
    less than half as large; see the page about accuracy.

    Attributes
    ----------
    absolute : ‖e‖ of the whole model in √J.
    relative : ‖e‖ / ‖u‖, with ‖u‖ of the exact solution as the estimate has it.
    per_element : (m,) ‖e‖ of each element in √J; the root of the sum of their squares is `absolute`.
    method : how it was found: ``"recovery"`` or ``"averaging"`` of stresses, whichever is smaller.
    warnings : why it cannot be trusted; empty where nothing speaks against it.
    safety : factor in all these; without it they are the best guess.
    units : set of units of the mesh.
    """

    absolute: float
    relative: float
    per_element: Array
    method: str
    warnings: list[str] = field(default_factory=list)
    safety: float = 1.0
    units: str = "SI"

    def __str__(self) -> str:
        unit = unit_name("√J", self.units)
        return f"{self.relative:.2%} in the energy norm ({self.absolute:.4e} {unit}, by {self.method})"


SAFETY = {"recovery": 1.7, "averaging": 1.8}
"""Factors by which the differences of the elements' stresses to smooth ones are raised to errors."""

NEGLIGIBLE, COARSE, FEW, FOCUS = 1e-9, 1.7, 8, 0.4
"""Relative error that is rounding; ratio of the differences to recovered and averaged stresses beyond which a
mesh is coarse; elements that are few; much of the error, in the worst hundredth of elements."""
CURVED = 10.0
"""Degrees from one face to the next at which a curved surface of straight cells is off by half a percent."""
WORST = 3  # least number of elements of that hundredth; meshes of less than twenty times as many have none


def energy_error(
    recovered: Array, averaged: Array, energy: float, groups: Sequence[ElementGroup], mesh: Mesh
) -> ErrorEstimate:
    """Return the estimate of squared differences to recovered and to averaged stresses."""
    # Both underestimate the error near singular points and in coarse meshes; the recovered ones, polynomials
    # of patches, may overestimate it many times where a few cells make up a curved body. So both are raised
    # by factors measured on problems with known solutions, and the smaller counts.
    squares = {"recovery": recovered, "averaging": averaged}
    sums = {name: float(values.sum()) for name, values in squares.items()}
    method = min(SAFETY, key=lambda name: SAFETY[name] ** 2 * sums[name])
    per_element = SAFETY[method] * np.sqrt(squares[method])
    absolute = SAFETY[method] * float(np.sqrt(sums[method]))
    size = energy + sums[method]
    relative = absolute / size**0.5 if size > 0 else 0.0
    is_coarse = sums["recovery"] > COARSE**2 * sums["averaging"]
    warnings = _warnings(recovered, is_coarse, groups, mesh) if relative > NEGLIGIBLE else []
    if mesh.n_elements == 1 and energy > 0 and not warnings:
        warnings = ["one element has no neighbors that could show its error"]
    return ErrorEstimate(absolute, relative, per_element, method, warnings, SAFETY[method], mesh.units)


def _warnings(recovered: Array, is_coarse: bool, groups: Sequence[ElementGroup], mesh: Mesh) -> list[str]:
    """Return what speaks against trusting an estimate."""
    warnings, count = [], mesh.n_elements
    plain = sorted({group.element.__name__: group.element for group in groups if _locks(group)}.items())
    locked = {name: better_element(element, "BBar") for name, element in plain}
    if locked:
        warnings.append(
            f"{', '.join(locked)} may lock near ν = ½, and the estimated error may be several times too "
            f"small; take {', '.join(sorted(set(locked.values())))}"
        )
    if is_coarse:
        warnings.append(
            "recovered stresses are farther from those of the elements than averaged ones: the mesh is too "
            "coarse for them, and the estimated error may be several times too large"
        )
    warnings += too_few(mesh) + curved(mesh, least=CURVED)
    if in_few_elements(recovered, count):
        element = mesh.element_ids[int(recovered.argmax())]
        warnings.append(
            f"a large part of the error lies in few elements, most in element {element}: near a re-entrant "
            "corner, the edge of a support or a concentrated load stresses have no limit"
        )
    return warnings


def curved(mesh: Mesh, least: float = 0.0) -> list[str]:
    """Return a warning of straight cells that seem to stand for a curved surface."""
    count, angle = facets(mesh)
    if not count or angle < least:
        return []
    return [
        f"{count} boundary faces of straight cells turn by about {angle:.0f}° from one to the next, as if "
        "they stood for a curved surface: what that costs is not in the error; take cells with curved edges, "
        "or error= with geometry={part: function of places}"
    ]


def too_few(mesh: Mesh) -> list[str]:
    """Return a warning for a mesh of few elements."""
    n = mesh.n_elements
    return [f"{n} elements are too few to estimate their error by one another"] if n < FEW else []


def in_few_elements(errors: Array, count: int) -> bool:
    """Return whether the hundredth of `count` elements with the largest errors holds much of their sum."""
    if count < 20 * WORST:
        return False
    few = max(WORST, count // 100)
    return float(np.partition(errors, -few)[-few:].sum()) > FOCUS * float(errors.sum())


def _locks(group: ElementGroup) -> bool:
    """Return whether a plain element has a nearly incompressible material; jumps of pressure show in 10N."""
    shape = group.element.shape
    plain = group.element.formulation == "standard" and not (shape.cell == "tetrahedron" and shape.degree > 1)
    return plain and bulk_over_shear(group.material.C) > NEAR_HALF


@dataclass(frozen=True, eq=False)
class QuantityError:
    """How far a quantity of a result is from that of the exact solution: Q(u) - Q(u_h).

    `Result.error` makes it.

    Attributes
    ----------
    value : Q(u_h), in its unit.
    signed : the best guess of Q(u) - Q(u_h); value + signed is a better value.
    absolute : on the safe side: the sum of the sizes of what the elements contribute, as if nothing canceled,
        with the factors of the energy norm for both errors of the product; no less than `signed` by averaged
        stresses with theirs.
    per_element : (m,) what each element contributes to `signed`.
    unit : of all these.
    warnings : why it cannot be trusted; empty where nothing speaks against it.
    """

    value: float
    signed: float
    absolute: float
    per_element: Array
    unit: str
    warnings: list[str] = field(default_factory=list)

    @property
    def relative(self) -> float:
        """`absolute` over the size of the better value; 0 where there is no error, inf where that is 0."""
        size = abs(self.value + self.signed)
        return self.absolute / size if size else np.inf if self.absolute else 0.0

    def __str__(self) -> str:
        return f"{self.signed:+.3e} {self.unit}, at most about ±{self.absolute:.1e} (value {self.value:.6e})"


ADJOINT_TOLERANCE = 1e-5
"""Relative residual that is enough for the adjoint: its own error on the mesh is far larger."""


def error_of(
    result: Fields,
    quantity: Quantity,
    adjoint: Callable[..., Array],
    model: Structure,
    strained: Array,
    recovery: Recovery,
) -> QuantityError:
    """Return the estimated error of a quantity of a result."""
    # Q has the adjoint z, the displacement under the load ∂Q/∂u, with supports at rest. The error e of a
    # solution is orthogonal to all displacements of the mesh, so that Q(e) = a(e, z) = a(e, e_z) with the
    # error e_z of the adjoint solution on the same mesh: the product of both errors, element by element, with
    # recovered stresses in place of the exact ones; near singular points averaged ones show more, and the
    # safe figure is not smaller than what they say. A reaction is the virtual work of a unit displacement of
    # its part; the adjoint has this displacement as its support. The adjoint of a stress at a point is too
    # singular: the error of the mean around the point takes its place, and what recovery shows of the
    # difference is added; the safe figure also has the spread of recovered less own stresses around the
    # point. Source: Becker & Rannacher, Acta Numerica 10 (2001) 1-102; Ainsworth & Oden, A Posteriori Error
    # Estimation in Finite Element Analysis (2000), chapter 8.
    motion, value = quantity.motion(result), quantity.value(result)
    z = adjoint_of(result, quantity, quantity.load(result), adjoint, model.attached, ADJOINT_TOLERANCE)
    warnings = _shared(result, model.supports.fixed, motion != 0) if motion.any() else []
    contributions, averaged = recovery.products(strained, z, result.mesh.n_elements)
    local = quantity.local(result)
    absolute = max(
        SAFETY["recovery"] ** 2 * float(np.abs(contributions).sum()),
        SAFETY["averaging"] ** 2 * abs(float(averaged.sum())),
    )
    absolute += SAFETY["recovery"] * (float(np.abs(local).sum()) + quantity.spread(result))
    warnings += _concentrated(np.abs(contributions)) + too_few(result.mesh)
    contributions = contributions + local
    unit = unit_name(quantity.unit, result.mesh.units)
    return QuantityError(value, float(contributions.sum()), absolute, contributions, unit, warnings)


def _concentrated(sizes: Array) -> list[str]:
    """Return a warning where few elements contribute most."""
    if not in_few_elements(sizes, len(sizes)):
        return []
    return [
        f"few elements contribute most of the error, above all row {int(sizes.argmax())}: near the point "
        "requested, a re-entrant corner, the edge of a support or a concentrated load; it may be several "
        "times larger where stresses have no limit"
    ]


def _shared(result: Fields, held: Mask, part: Mask) -> list[str]:
    """Return a warning where a support goes on beside the part whose reaction is requested."""
    axis = int(part.any(axis=0).argmax())
    for block in result.mesh.boundary:
        inside = part[block.nodes, axis]
        both = held[block.nodes, axis].all(axis=1) & inside.any(axis=1) & ~inside.all(axis=1)
        if both.any():
            return [
                f"{int(both.sum())} faces beside the part are held along {AXES[axis]}, too: nodes on its "
                "edge carry a part of theirs, which depends on the mesh and is not in the estimate"
            ]
    return []

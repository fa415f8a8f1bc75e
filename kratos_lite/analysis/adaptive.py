"""Adaptive solution: a static model solved to a requested accuracy, its mesh made finer where that pays.

Linear elements become quadratic first; then the elements that hold most of the error are cut, few steps
with many elements each.  The estimate of a result is corrected by what the last step has changed: of nested
meshes ‖u - u_H‖² = ‖u - u_h‖² + ‖u_h - u_H‖², so that, if estimates fall by β = η_h/η_H, the error is
‖u_h - u_H‖ β/√(1 - β²).

Sources: Dörfler, SIAM J. Numer. Anal. 33 (1996) 1106-1124; Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 24
(1987) 337-357 (density of the mesh); Ainsworth & Oden, A Posteriori Error Estimation (2000), ch. 3.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import TypeAlias, TypeVar

import numpy as np

from kratos_lite.analysis.adaptive_levels import SINGULAR, Level, QuantityLevel
from kratos_lite.analysis.layers import layer_direction
from kratos_lite.analysis.quantities import Quantity
from kratos_lite.analysis.report import RefinementStep
from kratos_lite.analysis.result import Result
from kratos_lite.analysis.static import StaticAnalysis
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.custom import is_builtin
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh, with_rows
from kratos_lite.mesh.facets import facets
from kratos_lite.mesh.refined_mesh import RefinedMesh
from kratos_lite.mesh.refinement import quadratic, raised, refine
from kratos_lite.model.refined import refined
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array, Mask, Progress
from kratos_lite.validation import number, short, whole_number

S = TypeVar("S", bound=Structure)
Geometry: TypeAlias = Mapping[str, Callable[[Array], Array]]
"""By part, a function that takes places (k, 3) near its true surface onto it."""
GROWTH = 1.2
"""How many times more elements the next mesh has, unless singular ones hold most of the error."""
FLAT = 0.05
"""Share of the error asked for that the stress may vary along a direction in which nothing is cut."""
DEPTH = 2
"""Times that elements around a singular point are cut at once."""
ROUGH, ROUGH_SHARE = 1e-5, 1e-3
"""Relative residual of the meshes on the way at most, and as a share of the error asked for."""
FAIR = 1e-3
"""Share of the forces that such a mesh may miss to equilibrium; beyond it is solved in full."""
STEPS = 25
"""Meshes after which the accuracy counts as out of reach."""
UNKNOWNS = 400_000
"""Unknowns of the largest mesh that is solved."""


def solve_to(
    model: S,
    error: float,
    solver: str = "auto",
    tolerance: float = 1e-10,
    progress: Progress | None = None,
    most_unknowns: int = UNKNOWNS,
    geometry: Geometry | None = None,
    quantity: Quantity | None = None,
) -> Result:
    """Solve a static model on meshes that become finer until the error is as small as asked for."""
    aim = number(error, "error")
    if not 0 < aim < 1:
        raise InputError(f"error must be a share between 0 and 1, such as 0.01; got {error!r}")
    most = whole_number(most_unknowns, "most_unknowns")
    check_geometry(geometry, model.mesh)
    if model.motion is not None:
        raise ModelError(
            "a model whose material moves through its mesh is not refined; solve it without error"
        )
    check_quantity(quantity)
    level: Level | None = None
    steps: list[RefinedMesh] = []
    history: list[RefinementStep] = []
    missed, keep = "", None
    rough = max(tolerance, min(ROUGH, ROUGH_SHARE * aim))
    warnings = [] if geometry else _curved(model.mesh)
    while True:
        start = perf_counter()
        analysis = StaticAnalysis(model, solver, tolerance, progress)
        result, before = _solved(analysis, _started(level, steps), rough), level
        level = _level(model, result, steps, before, quantity)
        history.append(level.step(perf_counter() - start))
        if before is not None:
            before.before = None  # the meshes before it are needed no more
        if level.reported <= aim and level.is_settled:
            break
        if keep is None and quantity is None and model.mesh.hanging is None and not _can_be_raised(model):
            keep = layer_direction(result, FLAT * aim * level.norm)
        steps = _next(level, aim, keep, geometry or {})
        model = _carried(model, steps)
        if 3 * model.mesh.n_nodes > most:
            missed = f"the next mesh has more than {most} unknowns"
        elif len(history) == STEPS:
            missed = f"{STEPS} meshes did not suffice"
        if missed:
            break
        analysis.release()
    if result.report.iterations and rough > tolerance:
        result = analysis.solve(start=result.u)
    analysis.release()
    if missed:
        warnings += [
            f"the error asked for, {aim:.3g}, was not reached: it may be {level.reported:.3g}; {missed}"
        ]
    report = result.report
    report.history, report.error, report.error_asked = history, level.reported, aim
    report.error_of = "the energy norm" if quantity is None else str(quantity)
    report.warnings += warnings
    if history[0].kinds != history[-1].kinds:
        report.formulation = f"{history[-1].kinds}, raised from {history[0].kinds}"
    return result


def _level(
    model: Structure,
    result: Result,
    steps: Sequence[RefinedMesh],
    before: Level | None,
    quantity: Quantity | None,
) -> Level:
    """Return what is known of the error of a result, or of a quantity of it."""
    if quantity is None:
        return Level(model, result, steps, before)
    level = QuantityLevel(model, result, steps, before, quantity)
    level.check_value()
    return level


def _curved(mesh: Mesh) -> list[str]:
    """Return the warning about a surface that seems curved and is not followed, if any."""
    count, angle = facets(mesh)
    if not count:
        return []
    return [
        f"{count} boundary faces of straight cells turn by about {angle:.0f}° from one to the next, as if "
        "they stood for a curved surface: what that costs is not in the error; give geometry={part: function "
        "of places}, or cells with curved edges"
    ]


def _solved(analysis: StaticAnalysis, start: Array | None, rough: float) -> Result:
    """Return a solution to a rough tolerance, or to the full one if equilibrium needs it."""
    result = analysis.solve(start=start, tolerance=rough)
    good = (result.report.force_error or 0.0) <= FAIR
    return result if good else analysis.solve(start=result.u)


def _started(level: Level | None, steps: Sequence[RefinedMesh]) -> Array | None:
    """Return the solution of a level on the next mesh, or None without one."""
    if level is None:
        return None
    u = level.result.u
    for step in steps:
        u = step.interpolate(u)
    return u


def check_quantity(quantity: Quantity | None) -> None:
    """Raise InputError for what is no quantity, or one that does not hold on finer meshes."""
    if quantity is None:
        return
    if not isinstance(quantity, Quantity):
        raise InputError(f"quantity must be one such as DisplacementAt; got {short(quantity)}")
    part = getattr(quantity, "part", "")
    if not (isinstance(part, str) or callable(part)):
        raise InputError(
            f"{quantity} is of rows of nodes, which are others on a finer mesh; give the part by its name, "
            "or a function of places"
        )


def check_geometry(geometry: Geometry | None, mesh: Mesh) -> None:
    """Raise an error for what are no functions of places by parts of a mesh."""
    must = "geometry must map parts to functions of places (k, 3)"
    if not (geometry is None or isinstance(geometry, Mapping)):
        raise InputError(f"{must}; got {short(geometry)}")
    for part, function in (geometry or {}).items():
        if not isinstance(part, str) or not callable(function):
            raise InputError(f"{must}; got {short(function)} for {short(part)}")
        mesh.nodes(part)


def _next(level: Level, error: float, keep: Array | None, geometry: Geometry) -> list[RefinedMesh]:
    """Return the steps to the next mesh; edges along `keep` are not cut."""
    mesh = level.model.mesh
    if _can_be_raised(level.model):
        named = raised(mesh, lambda name: f"Element3D{len(ELEMENTS[quadratic(name)].nodes)}N")
        return [named.onto(geometry)]
    if level.is_blind:
        return [refine(mesh, keep=keep).onto(geometry)]
    aim = level.aim(error)
    kept = level.kept()
    times = _times(level.squares, kept, aim, 8 if keep is None else 4)
    steps = [refine(mesh, times > 0, keep).onto(geometry)]
    points = _singular_points(mesh, kept > SINGULAR)
    wanted = times[steps[0].elements]
    known = level.before is not None and level.before.order == level.order
    for done in range(1, DEPTH if known else 1):
        finer = steps[-1].mesh
        again = (wanted > done) & _touching(finer, points)
        if not again.any():
            break
        steps.append(refine(finer, again, keep).onto(geometry))
        wanted = wanted[steps[-1].elements]
    return steps


def _singular_points(mesh: Mesh, singular: Mask) -> Mask:
    """Return which nodes (n,) have singular elements alone around them, two or more."""
    around, of_these = np.zeros(mesh.n_nodes, dtype=np.int64), np.zeros(mesh.n_nodes, dtype=np.int64)
    for block, at in with_rows(mesh.blocks):
        np.add.at(around, block.nodes, 1)
        np.add.at(of_these, block.nodes[singular[at]], 1)
    return (around > 1) & (around == of_these)


def _touching(mesh: Mesh, points: Mask) -> Mask:
    """Return which elements (m,) have one of some nodes, the first of the mesh, as a corner."""
    every = np.zeros(mesh.n_nodes, dtype=bool)
    every[: len(points)] = points
    corners = [ELEMENTS[block.name].shape.corners for block in mesh.blocks]
    cells = [block.nodes[:, :c] for block, c in zip(mesh.blocks, corners, strict=True)]
    return np.concatenate([np.asarray(every[nodes].any(axis=1)) for nodes in cells])


def _can_be_raised(model: Structure) -> bool:
    """Return whether linear elements may become quadratic: those of the library, with their own rules."""
    mesh = model.mesh
    kinds = [ELEMENTS[block.name] for block in mesh.blocks if len(block)]
    return (
        mesh.hanging is None
        and not model.has_own_rules
        and all(map(is_builtin, kinds))
        and any(kind.shape.degree == 1 for kind in kinds)
    )


def _times(squares: Array, kept: Array, aim: float, pieces: int) -> Array:
    """Return how often elements (m,) are cut on the way to a mesh with the error `aim`.

    On it all elements have the same error τ.  An element cut k times has pieces^k children, or pieces · k
    around a singular point, that hold kept^k of its squared error.
    """
    singular = kept > SINGULAR
    rate = np.where(singular, -np.log(kept), np.log(pieces / kept))
    logs = np.log(np.maximum(squares, np.finfo(float).tiny))

    def times(tau: float) -> Array:
        return np.maximum(np.ceil((logs - tau) / rate - 0.5), 0.0)

    low, high = float(logs.max()) - 60.0, float(logs.max())
    for _ in range(40):
        middle = (low + high) / 2
        if (squares * kept ** times(middle)).sum() > aim**2:
            high = middle
        else:
            low = middle
    found = times(low)
    least = 1
    if squares[singular].sum() < squares.sum() / 2:
        least = int(np.ceil((GROWTH - 1) * len(squares) / (pieces - 1)))
    largest = np.argsort(-squares)[:least]
    found[largest] = np.maximum(found[largest], 1.0)
    return found


def _carried(model: S, steps: Sequence[RefinedMesh]) -> S:
    """Return a model after some steps."""
    for step in steps:
        finer = refined(model, step)
        if step.mesh.n_elements == step.coarse.n_elements and model.formulation != "b_bar":
            finer.formulation = None  # quadratic elements: those that do not lock
        model = finer
    return model

"""Adaptive solution: a static model solved to a requested accuracy, its mesh made finer where that pays.

Linear elements become quadratic first; then, mesh by mesh, those elements are cut that hold a fraction θ of
the squared error (bulk marking).  The estimate of a result is corrected by what has changed since a clearly
larger one: of nested meshes ‖u - u_H‖² = ‖u - u_h‖² + ‖u_h - u_H‖², so that, if estimates fall by
β = η_h/η_H, the error is ‖u_h - u_H‖ β/√(1 - β²); over several steps squares of changes add up.

Sources: Dörfler, SIAM J. Numer. Anal. 33 (1996) 1106-1124; Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 24
(1987) 337-357 (density of the mesh); Ainsworth & Oden, A Posteriori Error Estimation (2000), ch. 3.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import TypeAlias

import numpy as np

from kratos_lite.analysis.adaptive_levels import Level, QuantityLevel, layer_direction
from kratos_lite.analysis.error_estimate import curved
from kratos_lite.analysis.peak import peak
from kratos_lite.analysis.prepared import LoadSet
from kratos_lite.analysis.quantities_of_interest import Quantity
from kratos_lite.analysis.report import RefinementStep, Report
from kratos_lite.analysis.result import Result
from kratos_lite.analysis.static import StaticAnalysis
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.custom import is_builtin
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.refined_mesh import RefinedMesh
from kratos_lite.mesh.refinement import quadratic, raised, refine
from kratos_lite.model.loads.base import warnings_of
from kratos_lite.model.refined import refined
from kratos_lite.model.structure import Structure
from kratos_lite.tabular import in_units
from kratos_lite.typing import Array, Ints, Progress
from kratos_lite.validation import fraction, short, whole_number

Geometry: TypeAlias = Mapping[str, Callable[[Array], Array]]
"""By part, a function that takes places (k, 3) near its true surface onto it."""
LEAST = 1e-8  # relative error that can be requested: what rounding leaves of a solution
BULK, BULK_FAR, FAR = 0.75, 0.85, 3.0
"""Fraction θ of the squared error that is cut, and that where the error is `FAR` times the one requested."""
GROWTH = 1.2  # how many times more elements the next mesh has at least
FLAT = 0.05
"""Fraction of the requested error that the stress may vary along a direction in which nothing is cut."""
ROUGH, ROUGH_FRACTION = 1e-3, 3e-2
"""Relative residual of the meshes on the way at most, and as a fraction of the requested error."""
FAIR = 1e-3  # fraction of the forces that such a mesh may miss to equilibrium; beyond it is solved in full
STEPS = 25  # meshes after which the accuracy counts as out of reach
LAST, HOPELESS = 4, 1e12
"""Unknowns from which the accuracy counts as out of reach, by the rate of so many of the last meshes."""
SCANT = 0.05  # of a step that there must be room for
BYTES = 6000  # that an unknown may need; the largest mesh is one that fits into what is free


def solve_to(
    model: Structure,
    error: float | str,
    solver: str = "auto",
    tolerance: float = 1e-10,
    progress: Progress | None = None,
    most_unknowns: int | None = None,
    geometry: Geometry | None = None,
    quantity: Quantity | None = None,
) -> Result:
    """Solve a static model on meshes that become finer until the error is as small as requested."""
    aim = fraction(error, "error")
    if not LEAST <= aim < 1:
        raise InputError(f"error must be a fraction between {LEAST:g} and 1, such as 0.01; got {error!r}")
    most = _affordable() if most_unknowns is None else whole_number(most_unknowns, "most_unknowns")
    check_geometry(geometry, model.mesh)
    if model.motion is not None:
        raise ModelError(
            "a model whose material moves through its mesh is not refined; solve it without error"
        )
    model.require_linear("a requested error")
    check_quantity(quantity)
    level: Level | None = None
    step: RefinedMesh | None = None
    history: list[RefinementStep] = []
    seconds, clock = Counter[str](), perf_counter()
    missed, keep, start = "", None, None
    rough = max(tolerance, min(ROUGH, ROUGH_FRACTION * aim))
    warnings = [] if geometry else curved(model.mesh)
    while True:
        begin, analysis = perf_counter(), StaticAnalysis(model, solver, tolerance, progress)
        case = analysis.case(checked=False)
        result = _solved(analysis, case, start, rough)
        before, known = level, (model, result, step, level)
        level = Level(*known) if quantity is None else QuantityLevel(*known, quantity)
        history.append(level.refinement_step(perf_counter() - begin))
        if before is not None:
            before.before = None  # the meshes before it are not needed any more
        if level.reported <= aim and level.is_settled:
            break
        if keep is None and quantity is None and model.mesh.hanging is None and not _can_be_raised(model):
            keep = layer_direction(result, FLAT * aim * level.norm)
        go_on = len(history) < STEPS and _needed(history, aim, LAST) < HOPELESS
        step = _next(level, aim, keep, geometry or {}, most) if go_on else None
        if step is None:
            missed = _missed(history, aim, most)
            break
        seconds.update(case.phase.seconds)
        analysis.release()
        model, start = _model_on(model, step), step.interpolate(result.u)
    if result.report.iterations and rough > tolerance:
        result = analysis.solve(case, start=result.u)
    seconds.update(case.phase.seconds)
    analysis.release()
    warnings += warnings_of(model.loads, model.mesh, result.groups)
    if missed:
        warnings += [
            f"the error requested, {aim:.3g}, was not reached: it may be {level.reported:.3g}; {missed}"
        ]
    if top := peak(result):
        warnings.append(in_units(f"the largest von Mises stress lies{top}", result.units))
    result.report.seconds = {**seconds, "refine": perf_counter() - clock - seconds.total()}
    result.report.warnings += warnings
    _tell(result.report, history, aim, quantity)
    return result


def _tell(report: Report, history: list[RefinementStep], aim: float, quantity: Quantity | None) -> None:
    """Tell in the report of the last mesh what led there."""
    first, last = history[0].kinds, history[-1].kinds
    report.history, report.error, report.error_asked = history, history[-1].error, aim
    report.error_of = "the energy norm" if quantity is None else str(quantity)
    report.formulation = f"{last}, raised from {first}" if first != last else report.formulation


def _solved(analysis: StaticAnalysis, case: LoadSet, start: Array | None, rough: float) -> Result:
    """Return a solution to a rough tolerance, or to the full one if equilibrium needs it."""
    result = analysis.solve(case, start=start, tolerance=rough)
    if (result.report.force_error or 0.0) <= FAIR:
        return result
    return analysis.solve(case, start=result.u)


def check_quantity(quantity: Quantity | None) -> None:
    """Raise InputError for what is no quantity, or one that does not hold on finer meshes."""
    if not isinstance(quantity, Quantity | None):
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


def _next(
    level: Level, error: float, keep: Array | None, geometry: Geometry, most: int
) -> RefinedMesh | None:
    """Return the step to the next mesh, edges along `keep` uncut; None if that has too many nodes."""
    mesh = level.model.mesh
    if _can_be_raised(level.model):
        named = raised(mesh, lambda name: f"Element3D{len(ELEMENTS[quadratic(name)].nodes)}N")
        if 3 * named.mesh.n_nodes <= most:
            return named.onto(geometry)
    if level.is_blind:
        finer = refine(mesh, keep=keep)
        return finer.onto(geometry) if 3 * finer.mesh.n_nodes <= most else None
    marked = _marked(level, level.aim(error), 8 if keep is None else 4)
    order = np.argsort(-level.squares)
    while len(marked):
        finer = refine(mesh, np.isin(np.arange(mesh.n_elements), marked), keep)
        n = 3 * finer.mesh.n_nodes
        if n <= most:
            return finer.onto(geometry)
        room = (most - 3 * mesh.n_nodes) / (n - 3 * mesh.n_nodes)
        marked = order[: int(0.9 * room * len(marked))] if room > SCANT else marked[:0]
    return None


def _marked(level: Level, aim: float, pieces: int) -> Ints:
    """Return the fewest elements that hold a fraction θ of the squared error, or that bring it to its aim."""
    # Source: Dörfler 1996, marking.
    squares = level.squares
    order = np.argsort(-squares)
    held, total = np.cumsum(squares[order]), squares.sum()
    bulk = (BULK if total < (FAR * aim) ** 2 else BULK_FAR) * total
    gained = np.cumsum((squares * (1 - level.kept()))[order])
    count = 1 + min(np.searchsorted(held, bulk), np.searchsorted(gained, total - aim**2))
    least = int(np.ceil((GROWTH - 1) * len(squares) / (pieces - 1)))
    return order[: max(count, least)]


def _missed(history: Sequence[RefinementStep], aim: float, most: int) -> str:
    """Return why the error was not reached, and what it would take by the rate of the last meshes."""
    if _needed(history, aim, LAST) > HOPELESS:
        return (
            "finer meshes hardly help, as under forces on points or edges, whose energy is infinite: spread "
            "them over faces (Resultant, Traction), or ask for a quantity away from there"
        )
    why = f"{STEPS} meshes did not suffice" if len(history) == STEPS else f"there is room for {most} unknowns"
    needed = _needed(history, aim, 1)
    return f"{why}; it would take about {needed:.2g}" if needed else why


def _needed(history: Sequence[RefinementStep], aim: float, last: int) -> float:
    """Return the unknowns that an error takes by the rate of the last meshes; 0 where that is not known."""
    alike = [step for step in history if step.kinds == history[-1].kinds]
    if len(alike) <= last or not alike[-1 - last].error > alike[-1].error > 0:
        return 0.0
    before, now = alike[-1 - last], alike[-1]
    rate = np.log(before.error / now.error) / np.log(now.unknowns / before.unknowns)
    with np.errstate(over="ignore"):
        return float(now.unknowns * np.float64(now.error / aim) ** (1 / rate))


def _affordable() -> int:
    """Return how many unknowns fit into the memory that is free."""
    try:
        free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):  # another system
        free = 4 << 30
    return max(int(free / BYTES), 100_000)


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


def _model_on(model: Structure, step: RefinedMesh) -> Structure:
    """Return a model on the mesh after a step."""
    finer = refined(model, step)
    if step.mesh.n_elements == step.coarse.n_elements and model.formulation != "b_bar":
        finer.formulation = None  # quadratic elements: those that do not lock
    return finer

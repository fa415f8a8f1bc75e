"""Natural frequencies of a model, and the complex ones of a model whose material moves through its mesh."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.preload import Preload, preload_stiffness, tangent_beyond_rest
from kratos_lite.analysis.result import Result
from kratos_lite.analysis.solution_checks import Phases
from kratos_lite.assembly.block_matrix import BlockMatrix, times_numbers
from kratos_lite.errors import InputError, ModelError, SolveError
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.complex_eigen import Pencil
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.eigen import TOLERANCE, Operator, Problem, dense_modes, is_small, modes, modes_near
from kratos_lite.solvers.linear_solver import LinearSolver, on_all
from kratos_lite.solvers.plan import DENSE_MODES, FALLBACK_LIMIT, REPEATED_LIMIT, Plan
from kratos_lite.typing import Array, Complexes, Progress
from kratos_lite.validation import instance, number, whole_number

OF_REPORT = 1e-6
"""Relative error of the square of a critical rate that a report states."""
SMALL_STRAIN, MOST_STRAIN = 0.1, 1.0
"""Mean strains at which buckling of small strains is doubtful, and beyond which it is of the mesh alone."""
_log = logging.getLogger("kratos_lite")


def natural_modes(
    model: Structure,
    count: int,
    lumped: bool = False,
    near: float | None = None,
    preload: Preload | None = None,
    progress: Progress | None = None,
) -> tuple[Array, Array]:
    """Return frequencies (count,) in rad/s and shapes (count, n, 3) of K φ = ω² M φ; see `Model.modes`."""
    near = None if near is None else number(near, "near", least=0, unit="rad/s")
    if not (near is None or preload is None):
        raise InputError("near does not go with a preload; leave near out for the lowest modes")
    solver = "auto" if near is None else "direct"
    phase = Phases(progress)
    with phase("check"):
        options: Any = {"solver": solver, "use": "modes", "progress": progress}
        e = EquationsOfMotion(model, lumped=lumped, free=preload is None, **options)
        e.log_warnings()
    constraints, n = e.system.constraint_map, len(e.system.constraint_map.free)
    if near is not None and n > FALLBACK_LIMIT:
        raise InputError(
            f"modes near a frequency take a factorization, of up to {FALLBACK_LIMIT} unknowns; got {n}; take "
            "a coarser mesh, or leave near out for the lowest modes"
        )
    with phase("assemble"):
        small = is_small(n, count)
        equations = e.system.equations
        K_g: BlockMatrix | None
        if isinstance(preload, Result) and model.is_nonlinear:
            K_g = tangent_beyond_rest(e, preload)
        else:
            K_g = None if preload is None else preload_stiffness(e, preload, "a preload of modes")[0]
    with phase("modes"):
        if near is not None:
            omega, shapes = modes_near(
                equations.reduced_matrix, constraints.reduce_matrix(e.mass.matrix()), count, near
            )
        elif small:
            K, M = equations.reduced_matrix, constraints.reduce_matrix(e.mass.matrix())
            K = K if K_g is None else K + reduced(e, K_g)
            omega, shapes = dense_modes(K if isinstance(K, np.ndarray) else K.toarray(), M.toarray(), count)
        else:
            try:
                omega, shapes = _by_iteration(e, equations, count, progress, K_g)
            except SolveError:  # multigrid is poor, such as where mid-edge nodes alone are held
                if not equations.plan.iterates or n > FALLBACK_LIMIT:
                    raise
                K = equations.reduced_matrix + (0 if K_g is None else reduced(e, K_g))
                omega, shapes = modes(K, constraints.reduce_matrix(e.mass.matrix()), count, progress)
    if K_g is not None and not omega[0] > 0:  # ω² is not, or its sign is rounding
        raise ModelError("the preload is beyond buckling; take less than model.buckling(1) times these loads")
    return omega, expanded(e, shapes)


def _by_iteration(
    e: EquationsOfMotion, solver: LinearSolver, count: int, progress: Progress | None, K_g: Any = None
) -> tuple[Array, Array]:
    """Return ω (count,) and shapes (q, count): the rigid motions that are free, then the lowest others."""
    problem, free = _at_rest(e, solver, progress, K_g), e.system.constraint_map.free
    R = problem.known[0] if problem.known else np.zeros((0, problem.n))
    if count <= len(R):
        return np.zeros(count), R[:count, free].T
    squares, shapes = problem.lowest(count - len(R))
    omega = np.sqrt(np.append(np.zeros(len(R)), np.maximum(squares, 0.0)))
    return omega, np.vstack([R[:, free], shapes[:, free]]).T


def _at_rest(
    e: EquationsOfMotion, solver: LinearSolver, progress: Progress | None, K_g: Any = None
) -> Problem:
    """Return K x = λ M x without a motion, beside the rigid motions that are free."""
    constraints, rigid, firm = e.system.constraint_map, _free_motions(e), _firm(e, solver)
    stiffness = solver.times if K_g is None else lambda u: solver.times(u) + K_g.times(u)
    norms = solver.norm, e.mass.norm()
    problem = _problem(constraints, firm, stiffness, e.mass.times, rigid, norms)
    return replace(problem, progress=progress, coarse=_coarse(e, firm, rigid))


def _problem(
    constraints: ConstraintMap,
    firm: LinearSolver,
    K: Operator,
    M: Operator,
    rigid: Array,
    norms: tuple[float, float],
) -> Problem:
    """Return K x = λ M x, given by products of (k, N), beside rigid motions (a, 3, k), which `firm` holds."""
    times_K, times_M = (_product(constraints, times) for times in (K, M))
    known = None
    if rigid.shape[2]:
        R = np.ascontiguousarray(rigid.reshape(3 * len(rigid), -1).T)
        R = np.linalg.solve(np.linalg.cholesky(R @ M(R).T), R)
        R[:, constraints.constrained] = 0.0
        known = R, times_M(R)
    operators = times_K, times_M, _preconditioner(constraints, firm)
    return Problem(len(constraints.c), *operators, norms, known, constrained=constraints.constrained)


def _coarse(e: EquationsOfMotion, firm: LinearSolver, rigid: Array) -> tuple[Problem, Operator] | None:
    """Return the equations of the linear elements inside quadratic ones, and what leads to all nodes."""
    level = firm.linear_level()
    if level is None:
        return None
    below, linear = level
    fine, P = e.system.constraint_map, linear.interpolation
    constraints, masses = fine.at(linear.nodes), np.repeat(P.T @ e.mass.nodal, 3)
    if not (masses > 0).all():
        return None
    norms = below.norm, float(masses.max())
    problem = _problem(constraints, below, below.times, lambda u: masses * u, rigid[linear.nodes], norms)

    def onto_all(X: Array) -> Array:
        out = np.stack([(P @ x.reshape(-1, 3)).ravel() for x in X])
        out[:, fine.constrained] = 0.0
        return out

    return problem, onto_all


def _firm(e: EquationsOfMotion, solver: LinearSolver) -> LinearSolver:
    """Return the solver with rigid motions that are free held."""
    held = e.system.constraint_map.holding(e.free_motions.constrained[e.system.nodes])
    return replace(solver, constraint_map=held)


def _preconditioner(constraints: ConstraintMap, firm: LinearSolver) -> Operator:
    """Return about K⁻¹ of vectors (k, N), rigid motions that are free being held."""
    if firm.constraint_map is constraints:
        return firm.precondition

    def precondition(r: Array) -> Array:
        r = r.copy()
        r[:, firm.constraint_map.constrained] = 0.0
        return firm.precondition(r)

    return precondition


def _product(constraints: ConstraintMap, times: Operator) -> Operator:
    """Return T^T A T by the product of A with vectors (k, N), T having its columns at the free components."""
    if constraints.T is None:

        def product(X: Array) -> Array:
            Y = times(X)
            Y[:, constraints.constrained] = 0.0
            return Y

        return product
    T = on_all(constraints.T, constraints.free)
    return lambda X: np.stack([T.T @ y for y in times(np.stack([T @ x for x in X]))])


def _free_motions(e: EquationsOfMotion) -> Array:
    """Return the rigid motions (a, 3, k) that supports leave to each part."""
    return e.free_motions.basis()[e.system.nodes]


def complex_modes(
    model: Structure, count: int, progress: Progress | None = None
) -> tuple[Complexes, Complexes]:
    """Return λ (count,) and shapes (count, n, 3) of λ² M + λ C + K = 0; see `Model.complex_modes`."""
    phase = Phases(progress)
    count = whole_number(count, "count")
    with phase("check"):
        e = EquationsOfMotion(model, steady=True, solver="auto", use="modes", progress=progress)
        e.log_warnings()
    with phase("assemble"):
        solver = e.system.equations
        pencil = _pencil(e, solver, progress)
    with phase("modes"):
        try:
            values, shapes = pencil.modes(count)
        except SolveError:
            if not solver.plan.iterates or len(pencil.rest.free) > FALLBACK_LIMIT:
                raise
            by_factors = replace(solver, K=e.system.assembled(), plan=Plan("direct"))
            values, shapes = _pencil(e, by_factors, progress).modes(count)
    return values, expanded(e, shapes[e.system.constraint_map.free])


def _pencil(e: EquationsOfMotion, solver: LinearSolver, progress: Progress | None) -> Pencil:
    """Return λ² M + λ C + K of a model with its motion at the time 0."""
    of_K, rest = e.scalars(0.0)[0], _at_rest(e, solver, progress)

    def stiffness(u: Array) -> Array:
        return solver.times(u) if of_K is None else solver.times(u) + times_numbers(of_K, u)

    both = (lambda v: e.times_damping(v, 0.0)), stiffness
    return Pencil(rest, *(_product(e.system.constraint_map, times) for times in both))


def critical_rate(model: Structure, count: int = 1) -> Array:
    """Return the lowest rates at which K - rate² H is singular.

    They are those of the mesh, and fall with ever finer ones.

    Parameters
    ----------
    model : with a motion of the material.
    count : number of rates.

    Returns
    -------
    (count,) in rad/s or m/s.

    Raises
    ------
    InputError
        The model has no motion, or not so many rates.
    ModelError
        The supports leave rigid-body modes free.
    """
    count = whole_number(count, "count")
    instance(model, "a model", Structure, "kl.Model(mesh, material)")
    e = EquationsOfMotion(model, free=False, solver="auto")
    if e.terms is None:
        raise InputError("a critical rate belongs to a motion; add kratos_lite.ale.Rotation or Translation")
    return critical_rates(e, count)


def critical_rates(e: EquationsOfMotion, count: int, tolerance: float = TOLERANCE) -> Array:
    """Return the lowest critical rates (count,) of equations whose supports hold all rigid motions."""
    few = 100 if count == 1 else DENSE_MODES  # one by iteration takes a tenth of the time of all
    largest = _largest(e, _critical_terms(e), e.system.equations, count, few, tolerance)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sort(np.where(largest > 0, 1 / np.sqrt(np.maximum(largest, 1e-300)), np.inf))


def lowest_critical_rate(e: EquationsOfMotion) -> float | None:
    """Return the lowest critical rate; None if rigid modes are free, or it is not found (many unknowns)."""
    if e.free_motions.any or len(e.system.constraint_map.free) > REPEATED_LIMIT:
        return None
    try:
        return float(critical_rates(e, 1, OF_REPORT)[0])
    except SolveError:
        return None


def buckling(
    model: Structure, count: int, preload: Preload, progress: Progress | None = None
) -> tuple[Array, Array]:
    """Return factors (count,) and shapes (count, n, 3) of (K + λ K_g) φ = 0; see `Model.buckling`."""
    count, phase = whole_number(count, "count"), Phases(progress)
    with phase("check"):
        e = EquationsOfMotion(model, free=False, massless=True, solver="auto", progress=progress)
        e.log_warnings()
    with phase("assemble"):
        K_g, strain = preload_stiffness(e, preload, "buckling")
        K_g.data *= -1
    with phase("modes"):
        try:
            inverse, vectors = _largest(e, K_g, e.system.equations, count, DENSE_MODES)
        except SolveError as error:
            text = f"found no {count} factors > 0: loads that only pull do not buckle a body"
            raise SolveError(f"{text}; if some press, the iteration failed: {error}") from None
    if not inverse[-1] > 1e-9 * K_g.norm() / e.system.norm:  # less is rounding: strains of 1e9
        raise ModelError(f"the loads have less than {count} factors > 0; ask for fewer, or reverse the loads")
    text = f"the least factor > 0, {1 / inverse[0]:.3g}, strains the body by {strain / inverse[0]:.0%}"
    text += ": it does not buckle at small strains; reverse the loads if these only pull"
    if not inverse[0] * MOST_STRAIN > strain:
        raise ModelError(text)
    if not inverse[0] * SMALL_STRAIN > strain:
        _log.warning("%s", text)
    shapes = expanded(e, vectors)
    return 1 / inverse, shapes / np.linalg.norm(shapes, axis=2).max(axis=1)[:, None, None]


def _largest(
    e: EquationsOfMotion,
    H: BlockMatrix,
    solver: LinearSolver,
    count: int,
    few: int,
    tolerance: float = TOLERANCE,
) -> tuple[Array, Array]:
    """Return the largest μ (count,) of H x = μ K x, descending, and x (q, count); of `few` by LAPACK."""
    constraints, n = e.system.constraint_map, len(e.system.constraint_map.free)
    if count > n:
        raise InputError(f"this model has up to {n} of them, one for each unknown; got {count}")
    if n <= few or count > n // 4:
        from scipy.linalg import eigh

        K = solver.reduced_matrix
        K = K if isinstance(K, np.ndarray) else K.toarray()
        values, vectors = eigh(reduced(e, H).toarray(), K, subset_by_index=[n - count, n - 1])
        return values[::-1], vectors[:, ::-1]
    times_H, times_K = (_product(constraints, A.times) for A in (H, solver))
    norms = H.norm(), solver.norm
    operators = lambda X: -times_H(X), times_K, solver.precondition
    size, constrained = len(constraints.c), constraints.constrained
    problem = Problem(size, *operators, norms, power=2, tolerance=tolerance, constrained=constrained)
    values, vectors = problem.lowest(count)
    return -values, vectors[:, constraints.free].T


def _critical_terms(e: EquationsOfMotion) -> BlockMatrix:
    """Return H, less what stiffens."""
    assert e.terms is not None
    pattern, scalar = e.system.pattern, e.terms.H - (e.stiffening if e.stiffened else 0.0)
    H = BlockMatrix(np.zeros((len(pattern.indices), 3, 3)), pattern.indices, pattern.indptr)
    H.add_scalar(scalar)
    return H


def reduced(equations: EquationsOfMotion, A: BlockMatrix) -> Any:
    """Return T^T A T on the free degrees of freedom as CSR."""
    return equations.system.constraint_map.reduce_matrix(A.scipy().tocsr())


def expanded(equations: EquationsOfMotion, shapes: Any) -> Any:
    """Return shapes on the free degrees of freedom (q, k) as nodal ones (k, n, 3), 0 where held."""
    system, count = equations.system, shapes.shape[1]
    out = np.zeros((count, system.n_nodes, 3), dtype=shapes.dtype)
    out[:, system.nodes] = system.constraint_map.transform(shapes).T.reshape(count, -1, 3)
    return out

"""Static equilibrium of a body, by Newton's method with the tangent, not by dynamic relaxation."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.bodies.body import Body, Deformable
from kratos_lite.bodies.constraints import with_slices
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.bodies.formulations import Modal
from kratos_lite.bodies.linear_algebra import Entries, sum_of
from kratos_lite.errors import InputError, ModelError, SolveError
from kratos_lite.solvers import direct
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.newton import in_parts, newton
from kratos_lite.solvers.plan import Facts, choose
from kratos_lite.typing import Array, Ints, Progress

NEWTON_MAX = 25
CONVERGED = 1e-9
"""Last Newton step, as a fraction of the displacement; the remaining error is its square."""
ROUND_OFF = 4e-15
"""Newton step, as a fraction of the size of the body, that is nothing but rounding."""
UNBALANCED = 1e-8
"""Fraction of the loads that may remain."""


def find_equilibrium(body: Body, *, progress: Progress | None = None) -> int:
    """Bring a deformable body to static equilibrium under its loads and constraints at its time.

    The configuration becomes that of equilibrium, the velocity zero; constraints know their reactions.

    Parameters
    ----------
    body : pseudo-rigid or finite-element, not modal, supported by constraints or springs.  A `Callback` that
        depends on the configuration counts as a load without a derivative, and must be weak beside the other
        stiffness.
    progress : called with ``"equilibrium"`` and the fraction of the load, 0 … 1.

    Returns
    -------
    int, Newton iterations.

    Raises
    ------
    ModelError
        A rigid or a modal body, or a constraint on velocities.
    SolveError
        There is no equilibrium near by: the body is not supported, or it buckles.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> mesh = kl.box(cells=(2, 2, 2))
    >>> steel = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
    >>> body = kl.FiniteElementBody(mesh, steel, formulation="corotational")
    >>> for side, axis in (("x-", 0), ("x+", 0), ("y-", 1), ("y+", 1), ("z-", 2)):
    ...     body.constrain(kl.FixDirection(mesh.points[mesh.nodes(side)], [axis == k for k in range(3)]))
    >>> body.add(kl.Gravity((0, 0, -9.81)))
    >>> iterations = find_equilibrium(body)
    >>> print(f"{body.displacement[:, 2].min():.6e} m")
    -1.322148e-04 m
    """
    if not isinstance(body, Deformable) or body.q.ndim > 1:
        raise ModelError(f"find_equilibrium is for a single deformable body; got {body!r}")
    if isinstance(body, FiniteElementBody) and isinstance(body.formulation, Modal):
        raise ModelError(
            "find_equilibrium is not for modal bodies, which have no statics here; "
            "take formulation='total_lagrangian' or 'corotational'"
        )
    for constraint in body.constraints:
        if not constraint.positional:
            raise ModelError(
                f"a {type(constraint).__name__} does not apply in statics; use PrescribedDisplacement"
            )
    start, total = body.q.copy(), 0

    def advance(done: float, fraction: float) -> int:
        nonlocal total
        before = body.q
        try:
            iterations = _increment(body, start, fraction)
            body.set_configuration(body.q)  # Newton may end at an inverted shape
        except (SolveError, InputError, np.linalg.LinAlgError) as error:
            body.q = before
            raise SolveError(str(error)) from None
        total += iterations
        if progress:
            progress("equilibrium", fraction)
        return iterations

    reached, failed = in_parts(advance)
    if failed:
        body.q = start
        raise SolveError(
            f"no equilibrium was found under more than {reached:.0%} of the load: {failed}; is the body "
            "supported by constraints or springs, and are the loads not too large?"
        )
    body.u = np.zeros_like(body.u)
    return total


def _increment(body: Deformable, start: Array, fraction: float) -> int:
    """Find the equilibrium under a fraction of the loads; return the number of iterations."""
    initial, roundoff, size = _gap(body, start), ROUND_OFF * body.extent(), len(body.q)
    rest = np.zeros_like(body.u)

    def evaluate(x: Array) -> tuple[float, tuple[Array, Array]]:
        body.q, multipliers = x[:size], x[size:]
        residual = fraction * body.external_force(u=rest) - body.internal_force(body.q)
        gap = _gap(body, body.q) - (1 - fraction) * initial
        step, multipliers = _newton_step(body, residual, gap, _tangent(body, fraction, multipliers))
        largest = float(np.abs(step).max())
        if largest <= roundoff and x is not begin:  # more would not make it better
            return 0.0, (0.0 * step, multipliers)
        return largest / (float(np.abs(body.q + step - start).max()) or 1.0), (step, multipliers)

    def correction(x: Array, known: tuple[Array, Array], residuals: list[float]) -> Array:
        return np.concatenate([known[0], known[1] - x[size:]])

    begin = np.concatenate([body.q, 0.0 * initial])
    x, (step, multipliers), residuals = newton(begin, evaluate, correction, CONVERGED, NEWTON_MAX)
    body.q = x[:size] + step
    _balance(body, fraction, multipliers)
    return len(residuals)


def _gap(body: Deformable, q: Array) -> Array:
    """Return by how much the constraints are violated in m."""
    gaps = [c.gaps(body, q, np.zeros_like(q), body.time, 2.0) for c in body.constraints]
    return np.concatenate([np.zeros(0), *gaps])


def _tangent(body: Deformable, fraction: float, multipliers: Array) -> Entries:
    """Return the derivative of a fraction of the loads, and of the reactions, with respect to q."""
    zero, parts = np.zeros_like(body.u), []
    for load in body.loads:
        row, column, value = load.derivative(body.q, zero, body.time)
        parts.append((row, column, fraction * value))
    for constraint, part in with_slices(body.constraints):
        parts.append(constraint.tangent_entries(body, body.q, multipliers[part]))
    return sum_of(parts)


def _jacobian(body: Deformable) -> Entries:
    """Return rows, dofs and values of H of all constraints."""
    parts = []
    for constraint, part in with_slices(body.constraints):
        row, dof, value = constraint.jacobian_entries(body, body.q)
        parts.append((row + part.start, dof, value))
    return sum_of(parts)


def _balance(body: Deformable, fraction: float, multipliers: Array) -> None:
    """Set the reactions; SolveError if loads, reactions and internal forces do not balance."""
    reaction = np.zeros_like(body.q)
    for constraint, part in with_slices(body.constraints):
        constraint.set_reactions(body, body.q, multipliers[part])
    row, dof, value = _jacobian(body)
    np.add.at(reaction, dof, multipliers[row] * value)
    load = fraction * body.external_force(u=np.zeros_like(body.u))
    inner = body.internal_force()
    residual = np.abs(load + reaction - inner).max()
    scale = max(np.abs(load).max(), np.abs(reaction).max(), np.abs(inner).max())
    K = body.stiffness(body.q)
    roundoff = 1e-14 * float(np.abs(K.data if isinstance(K, BlockMatrix) else K).max() * np.abs(body.q).max())
    if residual > UNBALANCED * scale + roundoff:
        raise SolveError(f"{residual / scale:.1%} of the loads find no reaction, so the body would move")


# ---- one Newton step: (K - A) x = residual + H^T multipliers with H x = -gap ---------------------------


def _newton_step(body: Deformable, residual: Array, gap: Array, tangent: Entries) -> tuple[Array, Array]:
    """Return x (dofs,) and multipliers (c,), with the tangent A of loads and reactions."""
    K, H = body.stiffness(), _jacobian(body)
    row, dof, value = H
    if not isinstance(K, BlockMatrix):
        return _dense_step(K, residual, H, gap, tangent)
    symmetric = not len(tangent[0])
    if not symmetric:
        K = BlockMatrix.of(K.scipy().tocsr() - _sparse(tangent, K.shape))
    if len(row) == len(gap) == len(np.unique(row)):  # each row prescribes one displacement
        assert body.mesh is not None
        return _eliminated(K, body.mesh.points, residual, dof, value, gap, symmetric)
    return _with_multipliers(K, residual, H, gap)


def _dense_step(K: Array, residual: Array, H: Entries, gap: Array, tangent: Entries) -> tuple[Array, Array]:
    """Return the step of a full matrix K of the first dofs, which may be singular: least squares."""
    n, c = len(residual), len(gap)
    row, dof, value = H
    A = np.zeros((n + c, n + c))
    A[: len(K), : len(K)] = K
    np.subtract.at(A, tangent[:2], tangent[2])
    size = np.abs(A).max()
    A[n + row, dof], A[dof, n + row] = value, value
    scale = np.concatenate([np.full(n, size**-0.5), np.full(c, size**0.5)])
    b = np.concatenate([residual, -gap])
    x = scale * np.linalg.lstsq(scale[:, None] * A * scale, scale * b, rcond=1e-12)[0]
    return x[:n], -x[n:]


def _eliminated(
    K: BlockMatrix, points: Array, residual: Array, dof: Ints, value: Array, gap: Array, symmetric: bool
) -> tuple[Array, Array]:
    n = len(residual)
    prescribed, free = np.zeros(n), np.ones(n, dtype=bool)
    prescribed[dof], free[dof] = -gap / value, False
    constraints = ConstraintMap(np.flatnonzero(free), prescribed)
    plan = choose("auto", Facts(len(constraints.free), n, symmetric))
    matrix: Any = K.scipy().toarray() if plan.method == "dense" else K
    solver = LinearSolver(matrix, constraints, points, plan, symmetric=symmetric)
    x = solver.solve(residual, 1e-12).x
    reaction = (K @ x - residual)[dof] / value
    twice = np.bincount(dof, minlength=n)[dof]
    return x, np.asarray(reaction / twice)


def _with_multipliers(K: BlockMatrix, residual: Array, H: Entries, gap: Array) -> tuple[Array, Array]:
    from scipy.sparse import block_array, csr_array, eye_array

    n, c = len(residual), len(gap)
    size = K.norm()
    rows = _sparse(H, (c, n)) * size
    soft = -1e-11 * size * eye_array(c)  # lets rows that say the same share their reaction
    A = block_array([[K.scipy(), rows.T], [rows, soft]], format="csr") if c else K.scipy().tocsr()
    x = direct.factorize(csr_array(A), symmetric=False).solve(np.concatenate([residual, -gap * size]))
    return x[:n], -x[n:] * size


def _sparse(entries: Entries, shape: tuple[int, int]) -> Any:
    from scipy.sparse import csr_array

    row, column, value = entries
    return csr_array((value, (row, column)), shape=shape)

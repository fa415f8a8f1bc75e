"""One Newton step towards equilibrium: K x = residual + H^T multipliers with H x = -gap."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.bodies.linear_algebra import Entries
from kratos_lite.solvers import direct
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.plan import Facts, choose
from kratos_lite.typing import Array, Ints


def dense_step(K: Array, residual: Array, entries: Entries, gap: Array) -> tuple[Array, Array]:
    """Return x (n,) and multipliers (c,) for a full matrix K (n, n), which may be singular: least squares."""
    n, c = len(residual), len(gap)
    row, dof, value = entries
    A = np.zeros((n + c, n + c))
    A[:n, :n] = K
    A[n + row, dof], A[dof, n + row] = value, value
    size = np.abs(K).max()
    scale = np.concatenate([np.full(n, size**-0.5), np.full(c, size**0.5)])
    b = np.concatenate([residual, -gap])
    x = scale * np.linalg.lstsq(scale[:, None] * A * scale, scale * b, rcond=1e-12)[0]
    return x[:n], -x[n:]


def sparse_step(
    K: BlockMatrix, points: Array, residual: Array, entries: Entries, gap: Array, tangent: Entries
) -> tuple[Array, Array]:
    """Return x (3n,) and multipliers (c,) for a matrix K less a tangent (3n, 3n) on points (n, 3)."""
    row, dof, value = entries
    symmetric = not len(tangent[0])
    if not symmetric:
        K = _less(K, tangent)
    if len(row) == len(gap) and len(set(row.tolist())) == len(row):  # each row prescribes one displacement
        return _eliminated(K, points, residual, dof, value, gap, symmetric)
    return _with_multipliers(K, residual, entries, gap)


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


def _less(K: BlockMatrix, tangent: Entries) -> BlockMatrix:
    from scipy.sparse import csr_array

    row, column, value = tangent
    return BlockMatrix.of(K.scipy().tocsr() - csr_array((value, (row, column)), shape=K.shape))


def _with_multipliers(K: BlockMatrix, residual: Array, entries: Entries, gap: Array) -> tuple[Array, Array]:
    from scipy.sparse import block_array, csr_array, eye_array

    n, c = len(residual), len(gap)
    row, dof, value = entries
    size = K.norm()
    H = csr_array((value, (row, dof)), shape=(c, n)) * size
    soft = -1e-11 * size * eye_array(c)  # lets rows that say the same share their reaction
    A = block_array([[K.scipy(), H.T], [H, soft]], format="csr") if c else K.scipy().tocsr()
    x = direct.factorize(csr_array(A), symmetric=False).solve(np.concatenate([residual, -gap * size]))
    return x[:n], -x[n:] * size

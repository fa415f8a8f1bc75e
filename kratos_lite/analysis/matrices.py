"""Matrices: the equations of a model and of its elements, to be studied and solved elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.nodal_loads import at_temperature
from kratos_lite.assembly.block_matrix import rows_of_numbers
from kratos_lite.assembly.element_groups import group_of_element
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.assembly.sparsity_pattern import dofs_of
from kratos_lite.model.loads import ScaledLoad
from kratos_lite.model.loads.body import BodyForce
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array, ArrayLike, Ints
from kratos_lite.validation import finite, flag, number

if TYPE_CHECKING:
    from scipy.sparse import csr_array


@dataclass(frozen=True, eq=False)
class Matrices:
    """M u'' + C u' + K u = f + reactions of a model, with u = T q + c; made by `Model.matrices`.

    Degrees of freedom are dof = 3·node + axis of all n nodes of the mesh; q are the free ones.  Rows of
    nodes without elements are empty, and so are those of T.

    Attributes
    ----------
    K : (3n, 3n) CSR in N/m, stiffness.
    M : (3n, 3n) CSR in kg, mass; empty where materials have no density.
    C : (3n, 3n) CSR in N s/m, damping.
    f : (3n,) in N, all loads, with those of prestress and of a stress-free displacement.
    T : (3n, q) CSR, from the free degrees of freedom to all: supports and multi-point constraints.
    c : (3n,) in m, what supports and constraints prescribe.
    free : (q,) int, the free degrees of freedom: u[free] = q.
    """

    K: csr_array[Any, Any]
    M: csr_array[Any, Any]
    C: csr_array[Any, Any]
    f: Array
    T: csr_array[Any, Any]
    c: Array
    free: Ints


def matrices_of(
    model: Structure, time: float = 0.0, lumped: bool = False, rayleigh: tuple[float, float] = (0.0, 0.0)
) -> Matrices:
    """Return the equations of a model; see `Model.matrices`."""
    from scipy.sparse import csr_array

    t, n = number(time, "the time"), model.mesh.n_nodes
    e = EquationsOfMotion(model, lumped=flag(lumped, "lumped"), rayleigh=rayleigh, massless=True)
    dofs = dofs_of(e.system.nodes)

    def whole(A: Any, square: bool = True) -> csr_array[Any, Any]:
        """Return a matrix (3a, ...) with the rows, and columns if it is square, of all degrees of freedom."""
        if len(dofs) == 3 * n:
            return A
        indptr = np.zeros(3 * n + 1, dtype=A.indptr.dtype)
        indptr[dofs + 1] = np.diff(A.indptr)
        indices = dofs.astype(A.indices.dtype)[A.indices] if square else A.indices
        shape = 3 * n, 3 * n if square else A.shape[1]
        return csr_array((A.data, indices, np.cumsum(indptr, dtype=indptr.dtype)), shape=shape)

    damped = e.terms is not None or any(e.rayleigh)
    C = rows_of_numbers(e.matrix(t, 0.0, 1.0, 0.0)) if damped else csr_array((e.size, e.size))
    K, M = e.matrix(t, 0.0, 0.0, 1.0) if damped else e.system.assembled(), e.mass.matrix()
    M.eliminate_zeros()
    return Matrices(
        K=whole(rows_of_numbers(K)),
        M=whole(M),
        C=whole(C),
        f=e.system.scatter(e.load(t)).ravel().copy(),
        T=whole(e.system.constraint_map.transform_matrix(), square=False),
        c=e.system.scatter(e.prescribed(t)).ravel().copy(),
        free=dofs[e.system.constraint_map.free],
    )


class LocalSystem(NamedTuple):
    """The matrices of one element of a model with k nodes.

    Attributes
    ----------
    K : (3k, 3k) in N/m, stiffness.
    r : (3k,) in N, external less internal force vector.
    M : (3k, 3k) in kg, consistent mass.
    dofs : (3k,) int, degrees of freedom among those of the model, 3·node + axis.
    """

    K: Array
    r: Array
    M: Array
    dofs: Ints


def local_system_of(model: Structure, element: int, u: ArrayLike | None = None) -> LocalSystem:
    """Return the matrices of an element; see `Model.local_system`."""
    points = model.mesh.points
    displaced = np.zeros_like(points) if u is None else finite(u, "the displacement", points.shape)
    if u is not None:
        model.require_linear("the local system at a displacement")
    if model.initial_displacement is not None:
        displaced = displaced - model.initial_displacement
    group = group_of_element(model.mesh, model.element_groups(), element)
    load = -internal_load(points, at_temperature(model, [group], 0.0), displaced)
    for one in model.loads:
        of, factor = (one.load, one.amplitude(0.0)) if isinstance(one, ScaledLoad) else (one, 1.0)
        if isinstance(of, BodyForce):
            load += factor * of.forces(model.mesh, [group])
    nodes, placed, material = group.nodes[0].astype(np.int64), group.at(points), group.material
    dofs = dofs_of(nodes)
    K = group.scaled(placed.stiffness(material.C))[0]
    return LocalSystem(K, load[nodes].ravel(), placed.mass(material.density)[0], dofs)

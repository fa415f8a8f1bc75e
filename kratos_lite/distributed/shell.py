"""The stiffness and the multigrid of ranks as objects of PETSc, which calls them in its iterations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kratos_lite.distributed.communicator import Ranks
from kratos_lite.distributed.petsc import petsc
from kratos_lite.distributed.petsc_matrix import communicator
from kratos_lite.distributed.stiffness import SharedStiffness


def product_of(K: SharedStiffness) -> Any:
    """Return a matrix of PETSc that multiplies by K."""
    PETSc = petsc()
    sizes = ((K.own, None), (K.own, None))
    matrix = PETSc.Mat().createPython(sizes, _Product(K), comm=communicator(K.ranks))
    matrix.setUp()
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    return matrix


def set_multigrid(ksp: Any, K: SharedStiffness) -> None:
    """Let the own multigrid of K precondition a solver of PETSc; it is made when the solver is set up."""
    preconditioner = ksp.getPC()
    preconditioner.setType("python")
    preconditioner.setPythonContext(_Cycle(K))


class _Product:
    """K x, as PETSc calls it."""

    def __init__(self, K: SharedStiffness) -> None:
        self.K = K

    def mult(self, matrix: Any, x: Any, y: Any) -> None:
        y.setArray(_safely(self.K, self.K.times, x.getArray(readonly=True)))


class _Cycle:
    """One V-cycle, as PETSc calls it."""

    def __init__(self, K: SharedStiffness) -> None:
        self.K = K
        self.multigrid: Any = None

    def setUp(self, preconditioner: Any) -> None:
        if self.multigrid is None:
            self.multigrid = _safely(self.K, self.K.multigrid)

    def apply(self, preconditioner: Any, x: Any, y: Any) -> None:
        y.setArray(_safely(self.K, self.multigrid.precondition, x.getArray(readonly=True)))


def _safely(K: SharedStiffness, call: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a call returns; an error ends all ranks, as the others wait for this one in an exchange."""
    try:
        return call(*arguments)
    except Exception as error:
        if isinstance(K.ranks, Ranks):
            K.ranks.abort(error)
        raise

"""The stiffness and the multigrid of ranks as objects of PETSc, which calls them in its iterations."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from kratos_lite.distributed.petsc import petsc
from kratos_lite.distributed.petsc_matrix import communicator
from kratos_lite.distributed.stiffness import SharedStiffness
from kratos_lite.typing import Array

LOG = logging.getLogger(__name__)


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
            with self.K.ranks.together():
                self.multigrid = self.K.multigrid()

    def apply(self, preconditioner: Any, x: Any, y: Any) -> None:
        y.setArray(_safely(self.K, self.multigrid.precondition, x.getArray(readonly=True)))


def _safely(K: SharedStiffness, call: Callable[[Array], Array], x: Array) -> Array:
    """Return what a call returns; an error ends all ranks, as the others wait for this one in an exchange."""
    try:
        return call(x)
    except Exception as error:
        if K.ranks.size == 1:
            raise
        LOG.critical("rank %d: %s: %s", K.ranks.rank, type(error).__name__, error)
        K.ranks.comm.Abort(1)  # type: ignore[attr-defined]
        raise

"""Many processes (ranks): rank 0 has the model, and all of them assemble and solve parts of it, in PETSc."""

from kratos_lite.distributed.communicator import start

__all__ = ["start"]

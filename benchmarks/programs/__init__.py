"""The programs compared, run as ``python -m benchmarks.programs NAME job.json``."""

from __future__ import annotations

from dataclasses import dataclass, field

ALL = ("4N", "8N", "10N", "20N", "27N")
FORMULATIONS = {
    "8N enhanced": "EnhancedStrain3D8N",
    "10N B-bar": "BBar3D10N",
    "20N reduced": "Reduced3D20N",
    "20N B-bar": "BBar3D20N",
    "27N B-bar": "BBar3D27N",
}
"""Elements that do not lock, by the kind shown."""
MORE = ("5N", "6N", "13N")
"""Those that `benchmarks.verification` asks for, too.

Kratos' 15N has other shape functions (linear over the triangle at mid-height), for which our nodal forces
are not consistent; scikit-fem's 6N integrates over half of its volume.
"""


@dataclass(frozen=True)
class Program:
    """How a program is run and what it takes.

    Attributes
    ----------
    module : of this package, and its function if that is not `work`.
    kinds : element kinds that it has.
    curved : those of them that follow curved edges as ours do.
    environment : variables of its process.
    digits : of its displacements, where it prints fewer than it computes.
    code : run as ``python -c`` in place of a module.
    launcher : words before the interpreter, where there is such a command.
    """

    module: str
    kinds: tuple[str, ...] = ALL
    curved: tuple[str, ...] = ()
    environment: dict[str, str] = field(default_factory=dict)
    digits: int = 15
    code: str = ""
    launcher: tuple[str, ...] = ()


ONE_BLAS_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
AS_ANYONE = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1"}
SHARED = {"OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_hwloc_base_binding_policy": "none"}
QUADRATIC = ("10N", "20N", "27N")
CALCULIX = ("4N", "6N", "8N", "10N", "15N", "20N", "20N reduced")
TORCH = ("4N", "8N", "10N", "20N reduced")
OWN = ALL + tuple(FORMULATIONS)
PROGRAMS = {
    "kratos_lite": Program("lite", OWN, OWN),
    "kratos_lite adaptive": Program("adaptive", OWN, OWN),
    "kratos_lite NumPy": Program("lite", OWN, OWN, {"KRATOS_LITE_KERNELS": "numpy"}),
    "Kratos": Program("kratos", kinds=(*ALL, *MORE), curved=(*ALL, *MORE)),
    "scikit-fem": Program("libraries.scikit_fem", curved=("10N", "27N"), environment=ONE_BLAS_THREAD),
    "FElupe": Program("libraries.felupe", curved=QUADRATIC, environment=ONE_BLAS_THREAD),
    "fedoo": Program("libraries.fedoo", ("4N", "8N", "10N", "20N"), ("20N",), ONE_BLAS_THREAD),
    "SfePy": Program("libraries.sfepy", ("4N", "8N", "10N", "27N"), environment=ONE_BLAS_THREAD),
    "NGSolve": Program("libraries.ngsolve", ("4N", "8N"), environment=ONE_BLAS_THREAD),
    "CalculiX": Program("calculix", CALCULIX, CALCULIX, digits=6),
    "GetFEM": Program("getfem_"),
    "torch-fem": Program(
        "libraries.torch_fem", ("4N", "8N", "10N", "20N reduced"), ("10N", "20N reduced"), digits=8
    ),
    "JAX-FEM": Program("libraries.jax_fem", ("4N", "8N", "10N", "27N"), ("10N", "27N"), ONE_BLAS_THREAD),
}
"""Every program that solves, by the name shown."""
PEERS = ("scikit-fem", "FElupe", "fedoo", "SfePy", "NGSolve", "GetFEM", "torch-fem", "JAX-FEM")
"""Those of them that are Python libraries."""
HELPERS = {
    "pyamg": Program("linear.pyamg"),
    "PETSc GAMG": Program("linear.petsc", environment=AS_ANYONE, launcher=("mpiexec", "-n", "2")),
    "PETSc BoomerAMG": Program("linear.petsc", environment=AS_ANYONE, launcher=("mpiexec", "-n", "2")),
    "PARDISO": Program("linear.factorized"),
    "CHOLMOD": Program("linear.factorized"),
    "meshio": Program("libraries.meshio"),
    "import numpy": Program("", code="import numpy"),
}
"""What else is timed: solvers on our matrix, a reader, and the least that NumPy takes to start."""
SOLVERS = ("Kratos", "pyamg", "PETSc GAMG", "PETSc BoomerAMG", "PARDISO", "CHOLMOD")
"""Programs that solve the linear system of a file."""


def on_ranks(backend: str, count: int) -> Program:
    """Return the program that solves a block by an backend, on so many ranks, or threads of one process."""
    own = backend == "own"
    environment = AS_ANYONE | SHARED | {"KRATOS_LITE_THREADS": str(count if own else 1)}
    return Program("ranks", environment=environment, launcher=() if own else ("mpirun", "-n", str(count)))


BACKENDS = (*(("own", n) for n in (1, 2)), *(("petsc", n) for n in (1, 2)), ("whole", 2),
           *(("plain", n) for n in (1, 2)))  # fmt: skip
RANKS = {f"{backend} {count}": on_ranks(backend, count) for backend, count in BACKENDS}
"""Programs of `scaling`."""

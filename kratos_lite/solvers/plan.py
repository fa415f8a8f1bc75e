"""The plan of solution: which method solves a system, and why, from facts of the system alone.

All thresholds of such choices stand here, each with what it means and, in parentheses, where it was measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kratos_lite.elements.formulations import NEAR_HALF
from kratos_lite.errors import InputError, SolveError
from kratos_lite.native import kernels
from kratos_lite.validation import choice

# ---- numbers of unknowns, unless something else is said ----
DENSE_LIMIT = 600  # full matrix without kernels, and without importing sparse libraries (8N cubes: 28 ms)
COMPILED_DENSE_LIMIT = 60  # full matrix beside kernels (8N cubes, 54: 3.3 ms, multigrid 3.9; 300: 13 and 6)
DENSE_MAX = 10_000  # degrees of freedom of a full matrix, 0.8 GB several times; more are refused
DIRECT_LIMIT = 10_000  # factorization without kernels; with them, iterations go on to round-off (8N cubes)
SUPERLU_LIMIT = 30_000  # SuperLU takes less time than some hundred iterations (stretched boxes)
FALLBACK_LIMIT = 150_000  # so does PARDISO; above, no factorization takes over from iterations (boxes)
REPEATED_LIMIT = 30_000  # a matrix that serves many times is factorized; motions get critical rates (boxes)
STEPPED_LIMIT = 4_000  # factors beside a near state or matrix (8N cubes: 41 ms, multigrid 35; 6,600: 99, 45)
DENSE_MODES = 1_200  # all modes at once, none is missed (8N cubes, 882: 80 ms, some by iteration 43)
MUMPS_LIMIT = 6_000  # MUMPS takes no longer than iterations: 0.2 s; at 26,000 five times as long (boxes)
MUMPS_FALLBACK = 300_000  # a factorization by MUMPS takes over where iterations fail (boxes)
# ---- nearly incompressible materials: bulk over shear modulus > NEAR_HALF ----
LOCKED = 3_000.0  # that ratio (ν = .4998) where plain elements take too many iterations (plate with a hole)
QUICK, SLOW = 1_000, 10_000  # unknowns always, and never, factorized within 30 iterations (plate with a hole)
QUICK_BAND = 2e9  # unknowns times band² up to which they are (layer of cells, 6,000: 191 ms, iterations 634)
# ---- products without a matrix: multigrid smooths single nodes ----
LARGEST_CONTRAST = 1e3  # stiffest to softest material; above, errors may triple (27N, layers 1 : 1,000,000)
STRETCHED, EXTREME = 3.0, 30.0  # longest to shortest side of a cell (8N 1:5: 12 iterations, not 48)
PER_STRETCHED, PER_EXTREME = 20, 200  # cells among which one such does not matter (columns: 22, not 190)
FLAT = 0.1  # thickness to width up to which a body bends like a plate (8N 1:20: 14 iterations, not 28)
# ---- steps without a matrix: multigrid smooths the stiffness alone ----
MANY_NODES = (
    20  # of elements that need no matrix (steps of 10N: 0.24 s, with one 0.18; of 27N: 0.13 and 0.25)
)
LIGHT = 0.1  # largest mass of a node by the norm of K (27N, 0.06: 9 iterations, not 7; 0.2: 13, not 6)
# ---- iterations ----
ROUND_OFF = 1e-15  # a tolerance that is never reached: iterations stop at what round-off allows
PATIENCE, PATIENCE_FROM = 400, 60  # iterations as long as a factorization; those that show a rate (boxes)
# ---- bands ----
BAND_LIMIT = 16.0  # width over √n: a band takes n w² multiplications, a sparse solid some n² (bars, cubes)
BAND_NUMBERS = 50_000_000  # a band of more numbers (0.4 GB) is not made

METHODS = ("auto", "dense", "direct", "amg")
REQUESTED = "requested"


@dataclass(frozen=True)
class Plan:
    """How a system is solved, and why."""

    method: str  # ``dense``, ``direct``, ``amg``, ``displacement-pressure``; of bands ``band`` or ``sparse``
    reason: str = ""  # in words
    matrix_free: bool = False  # whether products with K are enough, so that it is not assembled

    @property
    def iterates(self) -> bool:
        """Whether conjugate gradients or minimal residuals solve the equations."""
        return self.method in ("amg", "displacement-pressure")


@dataclass(frozen=True)
class Facts:
    """Facts of a system; those that take time to find are functions, called where a choice needs them."""

    unknowns: int  # free degrees of freedom
    dofs: int = 0  # all degrees of freedom
    symmetric: bool = True  # whether the matrix is symmetric positive definite
    use: str = "once"  # several vectors at once: ``modes``; a near state or matrix is known: ``steps``
    # whether there are kernels of multigrid
    compiled: Callable[[], bool] = lambda: kernels("multigrid") is not None
    # largest ratio among elements that can have pressures of their own, and among plain ones
    bulk_over_shear: Callable[[], tuple[float, float]] = lambda: (0.0, 0.0)
    bandwidth: Callable[[], float] = lambda: 0.0  # of the unknowns in the order of Cuthill and McKee
    has_product: Callable[[], bool] = lambda: False  # whether kernels multiply with K, and no nodes are tied
    contrast: Callable[[], float] = lambda: 1.0  # largest to smallest modulus of materials
    is_stretched: Callable[[], bool] = lambda: False  # whether many cells are long or flat, or some extremely
    is_plate: Callable[[], bool] = lambda: False  # whether the body is thin and flat, and free to bend
    nodes: Callable[[], int] = lambda: 0  # of the element that has the fewest


def choose(solver: str, facts: Facts) -> Plan:
    """Return how to solve a system."""
    choice(solver, "solver", METHODS)
    if facts.use == "steps":
        return _of_steps(solver, facts)
    plan = _by_size(facts) if solver == "auto" else Plan(solver, REQUESTED)
    if plan.method == "dense" and facts.dofs > DENSE_MAX:
        raise InputError(f"solver='dense' is for up to {DENSE_MAX} degrees of freedom; got {facts.dofs}")
    if not plan.iterates:
        return plan
    mixed, plain = facts.bulk_over_shear()
    nearly = f"a bulk modulus > {NEAR_HALF:g} shear moduli"
    if solver == "auto" and max(mixed, plain) > NEAR_HALF and _is_soon_factorized(facts, plain):
        return Plan("direct", f"few unknowns with {nearly}: a factorization is fastest")
    if mixed > NEAR_HALF and facts.compiled():
        return Plan("displacement-pressure", f"{nearly}: pressures beside displacements keep multigrid fast")
    return Plan("amg", plan.reason, needs_no_matrix(facts))


def _by_size(facts: Facts) -> Plan:
    n = facts.unknowns
    few = n <= COMPILED_DENSE_LIMIT  # no kernel needs to be loaded
    compiled = not few and facts.compiled()
    limit = COMPILED_DENSE_LIMIT if few or compiled else DENSE_LIMIT
    if n <= limit and facts.dofs <= 4 * DENSE_LIMIT:
        return Plan("dense", f"{n} unknowns ≤ {limit}: a full matrix is fastest")
    if not facts.symmetric:
        return Plan("direct", "the matrix is not symmetric: conjugate gradients do not apply")
    if not compiled and n <= DIRECT_LIMIT:
        return Plan("direct", f"{n} unknowns ≤ {DIRECT_LIMIT}: sparse factorization is fastest")
    limit = COMPILED_DENSE_LIMIT if compiled else DIRECT_LIMIT
    return Plan("amg", f"{n} unknowns > {limit}: multigrid is fastest and takes least memory")


def _of_steps(solver: str, facts: Facts) -> Plan:
    n = facts.unknowns
    if not facts.symmetric:
        return Plan("direct", "the matrix of a motion with damping is not symmetric")
    if solver not in ("auto", "amg") or (solver == "auto" and n <= STEPPED_LIMIT):
        few = f"{n} unknowns ≤ {STEPPED_LIMIT}: factors are fastest"
        return Plan("direct", few if solver == "auto" else REQUESTED)
    many = f"{n} unknowns > {STEPPED_LIMIT}: few iterations from what is near"
    reason = many if solver == "auto" else REQUESTED
    return Plan("amg", reason, max(facts.bulk_over_shear()) <= NEAR_HALF and needs_no_matrix(facts))


def _is_soon_factorized(facts: Facts, plain: float) -> bool:
    n = facts.unknowns
    if n <= QUICK or (n <= SLOW and n * facts.bandwidth() ** 2 <= QUICK_BAND):
        return True
    return (plain > LOCKED or not facts.compiled()) and is_quick_to_factorize(n)


def needs_no_matrix(facts: Facts) -> bool:
    """Return whether multigrid smooths well without a matrix: like stiffnesses, compact cells, no plate.

    Several vectors and many steps take a matrix of elements with few nodes (8N: 0.73 s, without 1.07).
    """
    return (
        (facts.use == "once" or facts.nodes() >= MANY_NODES)
        and facts.has_product()
        and facts.contrast() <= LARGEST_CONTRAST
        and not facts.is_stretched()
        and not facts.is_plate()
    )


def is_quick_to_factorize(unknowns: int) -> bool:
    """Return whether a factorization takes less time than some hundred iterations.

    >>> is_quick_to_factorize(FALLBACK_LIMIT + 1)
    False
    """
    from importlib.util import find_spec  # a quick start for small models

    return unknowns <= (FALLBACK_LIMIT if find_spec("pypardiso") else SUPERLU_LIMIT)


def tolerance_of(tolerance: float, unknowns: int) -> float:
    """Return the tolerance of iterations: few unknowns go on to round-off, as exact as by factors."""
    return min(tolerance, ROUND_OFF) if unknowns <= DIRECT_LIMIT else tolerance


def after(iterations: int, tolerance: float, unknowns: int, slow: bool) -> Plan:
    """Return how to solve a system instead whose iterations did not converge, or were too `slow`."""
    why = f"multigrid stopped after {iterations} iterations short of {tolerance:g}"
    if slow:
        why += f", at a rate that takes more than {PATIENCE}: a factorization is faster"
    if unknowns > FALLBACK_LIMIT:
        raise SolveError(
            f"{why}; {unknowns} unknowns are too many to factorize instead; look for thin elements, "
            "for plain ones with ν near 0.5 (formulation='non_locking' takes others), or ask for "
            "solver='direct'"
        )
    return Plan("direct", why)


def of_band(unknowns: int, width: int, height: int) -> Plan:
    """Return how to factorize a matrix in a band of a width, stored in so many rows: ``band`` or ``sparse``.

    >>> of_band(567, 44, 45).method, of_band(30_000, 4000, 4001).method
    ('band', 'sparse')
    """
    limit = int(BAND_LIMIT * unknowns**0.5)
    if width > limit:
        return Plan("sparse", f"width {width} > {limit}: a sparse factorization takes less work")
    if unknowns * height > BAND_NUMBERS:
        return Plan("sparse", f"{unknowns * height} numbers > {BAND_NUMBERS}: a band takes too much memory")
    return Plan("band", f"width {width} ≤ {limit}: a band is fastest")


def over_ranks(solver: str, facts: Facts, mumps: bool, options: bool) -> Plan:
    """Return how PETSc solves a system over ranks: ``direct`` or ``amg``."""
    if choice(solver, "solver", METHODS) != "auto":
        return Plan("direct" if solver == "dense" else solver, REQUESTED)
    if options:
        return Plan("amg", "PETSc options ask for it")
    n = facts.unknowns
    if not mumps:
        return Plan("amg", "PETSc was made without MUMPS, so that it iterates")
    if n <= MUMPS_LIMIT:
        return Plan("direct", f"{n} unknowns ≤ {MUMPS_LIMIT}: a factorization is fastest")
    if n <= MUMPS_FALLBACK and max(facts.bulk_over_shear()) > NEAR_HALF:
        nearly = f"a bulk modulus > {NEAR_HALF:g} shear moduli"
        return Plan("direct", f"few unknowns with {nearly}: iterations are slow")
    return Plan("amg", f"{n} unknowns > {MUMPS_LIMIT}: multigrid is fastest and takes least memory")

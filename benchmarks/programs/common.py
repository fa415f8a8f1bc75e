"""What the programs share: the job, the clock, and the linear solver of those that bring none.

Only NumPy is imported here; SciPy and the rest where they are needed, inside the phase that they belong to.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DIRECT_LIMIT = 10_000
"""Unknowns up to which SuperLU is the fastest way; PARDISO, where it is there, up to PARDISO_LIMIT."""
PARDISO_LIMIT = 50_000
SMOOTHER = ("chebyshev", {"degree": 2, "iterations": 1})
FASTEST: dict[str, Any] = {
    "strength": ("symmetric", {"theta": 0.0}),
    "improve_candidates": None,
    "presmoother": SMOOTHER,
    "postsmoother": SMOOTHER,
    "max_coarse": 300,
    "coarse_solver": "splu",
}
"""The fastest settings of pyamg that were measured; fixed components stay in, uncoupled."""
OVERHEAD = ("import", "write", "answer")
"""Phases outside the work that is compared with the error."""
WARM = 1.0
"""Seconds of warm work after which it isn't repeated further."""


class Job:
    """What to do: the problem, the folder for answers, and the clock.

    Attributes
    ----------
    stem : path of the scene without ending.
    kind : element kind such as ``8N``.
    tolerance : relative residual for iterative solvers.
    element, points, nodes, fixed, values, forces, elasticity, factors, reference : the problem, as `read`
        leaves it.
    """

    element: NDArray[np.str_]
    points: Array
    nodes: NDArray[np.int32]
    vtk_order: NDArray[np.int64]
    fixed: NDArray[np.bool_]
    values: Array
    forces: Array
    elasticity: Array
    factors: Array
    reference: Array

    def __init__(self, given: dict[str, Any]) -> None:
        self.given = given
        self.task, self.stem, self.kind = given["task"], given["stem"], given["kind"]
        self.tolerance = given.get("tolerance", 1e-10)
        self.repeat = given.get("repeat", 1)
        self.answer: dict[str, Any] = {"phases": {}, "version": ""}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Measure the body of a ``with`` statement."""
        start = perf_counter()
        yield
        phases = self.answer["phases"]
        phases[name] = phases.get(name, 0.0) + perf_counter() - start

    def read(self) -> None:
        """Read the problem from the `.npz` file."""
        with self.phase("read"), np.load(f"{self.stem}.npz") as file:
            for name in file.files:
                setattr(self, name, file[name])

    @property
    def cells(self) -> NDArray[np.int32]:
        """The elements in the node order of VTK."""
        return self.nodes[:, self.vtk_order]

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's constants."""
        E, nu = self.elasticity.tolist()
        return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

    def fastest(self, name: str, action: Callable[[], Any]) -> Any:
        """Run an action `repeat` times; keep its first time as `name` and its shortest as ``name, again``."""
        times = []
        for _ in range(self.repeat):
            start = perf_counter()
            found = action()
            times.append(perf_counter() - start)
        self.answer["phases"][name] = times[0]
        if len(times) > 1:
            self.answer["phases"][f"{name}, again"] = min(times[1:])
        return found


Work = Callable[[Job], Array | None]


def run(work: Work, given: dict[str, Any]) -> None:
    """Do a job and write its answer; say so where the program is absent."""
    job = Job(given)
    try:
        u = work(job)
    except ModuleNotFoundError as error:
        job.answer, u = {"absent": str(error), "phases": {}}, None
    with job.phase("answer"):
        if u is not None:
            np.save(given["displacement"], u)
            if given.get("warm"):
                job.answer["warm"] = again(work, given)
    Path(given["answer"]).write_text(json.dumps(job.answer))


def again(work: Work, given: dict[str, Any]) -> float:
    """Return the seconds of the same work in a process that has done it: the shortest of three times."""
    times: list[float] = []
    while len(times) < 3 and sum(times) < WARM:
        job = Job(given)
        work(job)
        times.append(sum(s for name, s in job.answer["phases"].items() if name not in OVERHEAD))
    return min(times)


def assembled(job: Job, stiffness: Callable[[], Any], dofs: NDArray[np.int64] | None = None) -> Array | None:
    """Time the matrix of a program; return the solution unless the matrix alone is asked for."""
    K = job.fastest("matrix", stiffness)
    if job.task == "assembly":
        return None
    return solve(job, K, np.arange(3 * len(job.points)).reshape(-1, 3) if dofs is None else dofs)


def rows_of(points: Array, wanted: Array) -> NDArray[np.int64]:
    """Return for each wanted point (m, 3) the row of the nearest of `points`."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(points).query(wanted)[1])


def solve(job: Job, K: Any, dofs: NDArray[np.int64], multigrid: dict[str, Any] | None = None) -> Array:
    """Return the displacements (n, 3) that solve K u = f with the supports of the job.

    Parameters
    ----------
    K : sparse matrix of the program, before any support.
    dofs : (n, 3), the row of K for each component of each node of the job.
    multigrid : settings of pyamg; else a factorization for few unknowns, and `FASTEST` for many.
    """
    with job.phase("import"):  # whatever the method needs belongs to the start, not to its time
        import scipy.sparse as sp

        direct = None if multigrid is not None else _direct(int((~job.fixed).sum()))
        pyamg = None if direct else _pyamg()
    with job.phase("constrain"):
        order = dofs.ravel()
        K = sp.csr_matrix(K)
        if (order != np.arange(len(order))).any():
            K = K[order][:, order]
        fixed, u = job.fixed.ravel(), np.where(job.fixed, job.values, 0.0).ravel()
        free = np.flatnonzero(~fixed)
        b = (job.forces.ravel() - K @ u) * ~fixed
        A = K[free][:, free] if direct else sp.bsr_matrix(uncoupled(K, ~fixed), blocksize=(3, 3))
    with job.phase("solve"):
        if direct:
            u[free] = direct(A, b[free])
        else:
            settings = FASTEST if multigrid is None else multigrid
            modes, residuals = rigid_modes(job.points) * ~fixed[:, None], []
            hierarchy = pyamg.smoothed_aggregation_solver(A, B=modes, **settings)
            x = hierarchy.solve(b, tol=job.tolerance, accel="cg", maxiter=500, residuals=residuals)
            u = np.where(fixed, u, x)
            job.answer["iterations"] = len(residuals) - 1
    job.answer["unknowns"] = len(free)
    return u.reshape(-1, 3)


def _direct(unknowns: int) -> Callable[[Any, Array], Array] | None:
    """Return the fastest factorization for so many unknowns, or None."""
    if unknowns <= PARDISO_LIMIT:
        try:
            import pypardiso

            return lambda A, b: np.asarray(pypardiso.spsolve(A, b))
        except ImportError:
            pass
    if unknowns > DIRECT_LIMIT:
        return None
    from scipy.sparse.linalg import splu

    def factorized(A: Any, b: Array) -> Array:
        options = {"SymmetricMode": True}
        factors = splu(A.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        return np.asarray(factors.solve(b))

    return factorized


def _pyamg() -> Any:
    """Return pyamg; a program that is there but has no solver fails rather than being absent."""
    try:
        import pyamg
    except ImportError:
        raise RuntimeError(f"more than {DIRECT_LIMIT} unknowns need pyamg in this interpreter") from None
    return pyamg


def rigid_modes(points: Array) -> Array:
    """Return the six rigid modes (3n, 6)."""
    x, y, z = (points - points.mean(axis=0)).T
    modes = np.zeros((len(points), 3, 6))
    modes[:, range(3), range(3)] = 1
    modes[:, 1, 3], modes[:, 2, 3] = -z, y
    modes[:, 0, 4], modes[:, 2, 4] = z, -x
    modes[:, 0, 5], modes[:, 1, 5] = -y, x
    return modes.reshape(-1, 6)


def uncoupled(K: Any, free: NDArray[np.bool_]) -> Any:
    """Return a copy of a CSR matrix whose rows and columns that are not free hold their diagonal alone."""
    rows = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    K = K.copy()
    K.data = np.where((free[rows] & free[K.indices]) | (rows == K.indices), K.data, 0.0)
    return K

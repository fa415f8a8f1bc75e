"""Homogenization: the stiffness of a periodic cell in the mean."""

from __future__ import annotations

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.static import StaticAnalysis
from kratos_lite.errors import ModelError
from kratos_lite.model.matching import Periodic
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array
from kratos_lite.validation import instance


def homogenized(model: Structure, *, solver: str = "auto", tolerance: float = 1e-10) -> Array:
    """Return the stiffness of a periodic cell: mean stress by mean strain, of six strains and one matrix.

    The mean is over the cell with its holes.  Loads of the model do not count.

    Parameters
    ----------
    model : a cell with three pairs of parts that are `Model.periodic`; it may be held in one node.
    solver, tolerance : as for `Model.solve`.

    Returns
    -------
    (6, 6) float, Pa, in the order xx yy zz xy yz zx; the ``elasticity`` of a law of your own.

    Raises
    ------
    ModelError
        There are not three pairs along three directions, supports or springs hold more than one node, or
        the model has a motion, initial stress or laws that are not linear.
    MeshError, InputError, SolveError
        As for `Model.solve`.

    Notes
    -----
    Mean stress by the virtual work of the forces f that strain the cell: V σ·ε = Σ f·u, Hill, J. Mech. Phys.
    Solids 11 (1963) 357-372.

    Examples
    --------
    >>> import numpy as np, kratos_lite as kl
    >>> steel = kl.Isotropic3D(E=210e9, nu=0.3)
    >>> cell = kl.Model(kl.box(cells=(2, 2, 2)), steel)
    >>> for a, b in (("x-", "x+"), ("y-", "y+"), ("z-", "z+")):
    ...     cell.periodic(a, b)
    >>> bool(np.abs(kl.homogenized(cell) - steel.C).max() < 1e-9 * steel.C.max())
    True
    """
    instance(model, "a cell", Structure, "kl.Model(mesh, material)")
    cell = next((tie for tie in model.supports.ties if isinstance(tie, Periodic)), None)
    ways = np.zeros((0, 3)) if cell is None else cell.ways
    if cell is None or ways.shape != (3, 3) or np.linalg.matrix_rank(ways) < 3:
        raise ModelError(
            f"a cell has three pairs of periodic parts along three directions; got {len(ways)}: give each as "
            "model.periodic('x-', 'x+')"
        )
    if model.supports.fixed.sum(axis=0).max() > 1:
        raise ModelError("supports hold more of the cell than one node; release them")
    if model.prestress is not None or model.initial_displacement is not None:
        raise ModelError("a cell with initial stress has no stiffness alone; leave the initial stress out")
    size, K = model.supports.fixed.size, model.attached.K if model.attached else None
    if K is not None and np.abs(K @ np.tile(np.eye(3), (model.mesh.n_nodes, 1))).max() > 1e-9 * abs(K).max():
        raise ModelError("springs hold the cell to the ground; join parts of the cell by them alone")
    analysis, rows = StaticAnalysis(model, solver, tolerance), []
    try:
        for strain in (np.zeros(6), *np.diag(voigt.HALF_SHEAR)):
            model.supports.add_tie(cell.strained(voigt.tensor(strain)))
            result = analysis.solve([]) if model.supports.displaced else None
            rows.append([result.u.ravel(), result.reactions.ravel()] if result else np.zeros((2, size)))
    finally:
        model.supports.add_tie(cell)
        analysis.release()
    u, forces = np.swapaxes(np.array(rows[1:]) - rows[0], 0, 1)  # less what displaces the cell by itself
    forces = forces if K is None else forces + (K @ u.T).T
    return np.asarray(forces @ u.T / abs(np.linalg.det(ways)))

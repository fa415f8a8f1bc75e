"""Remote points: a part follows a point, rigidly or in the mean; it is loaded, held and read there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import dofs_of
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh, Where
from kratos_lite.model.supports import AXES, Supports, axis_numbers
from kratos_lite.model.ties import Coupling
from kratos_lite.solvers.constraints import Constraints, independent_rows, rigid_modes
from kratos_lite.solvers.elimination import ROUNDING
from kratos_lite.typing import Array, ArrayLike, Ints, Mask
from kratos_lite.validation import finite, short

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh
    from kratos_lite.model.loads.surface import Resultant

MOST = 1000
"""Nodes of a part whose mean motion is prescribed or has springs: all of them then meet in matrices."""


class RemotePoint(Coupling):
    """A point whose motion is that of a part: displacement u0 and small rotation w, u = u0 + w × (x - point).

    `Structure.rigid` makes one that all nodes of the part follow, `Structure.distribute` one that moves as
    the part does in the mean, weighted by area: ∫ (u - u0 - w × (x - point))² dA is least.

    Parameters
    ----------
    supports : of the model.
    where : the part.
    point : (3,) m.
    rigid : whether the part is rigid.

    Attributes
    ----------
    is_rigid : the same.
    fixed : (6,) bool, which of the displacements x y z and rotations x y z are prescribed.
    values : (6,) m and rad, those prescribed.

    Raises
    ------
    InputError
        The point is none.
    MeshError, ModelError
        There is no such part, or it has no nodes or faces.

    Notes
    -----
    With the rigid modes R of nodes, u = R q for all nodes of a rigid part, where six of its degrees of
    freedom stand for q.  In the mean q = (∫ RᵀR dA)⁻¹ ∫ Rᵀu dA, whose transpose spreads force and moment.
    Source: Shephard, Int. J. Numer. Meth. Eng. 20 (1984) 2107-2112 (constraints by transformation).

    Examples
    --------
    A lid on a hinge that is turned by a moment:

    >>> import kratos_lite as kl
    >>> model = kl.Model(kl.box((1, 1, 0.2), (4, 4, 1)), kl.Isotropic3D(E=1e9, nu=0.3))
    >>> hinge = model.rigid("x-", (0, 0.5, 0.1))
    >>> hinge.fix("xyz")
    >>> hinge.fix_rotation("xz")
    >>> model.fix("x+", "z")
    >>> model.add(hinge.load((0, 0, 0), moment=(0, 50.0, 0)))
    >>> result = model.solve()
    >>> force, moment = hinge.reaction(result)
    >>> float(force[2].round(6)), bool(hinge.rotation(result)[1] > 0)
    (-50.0, True)
    """

    title = "remote point"

    def __init__(self, supports: Supports, where: Where, point: ArrayLike, rigid: bool) -> None:
        self.mesh, self._supports, self.where, self.is_rigid = supports.mesh, supports, where, rigid
        self.point = finite(point, "a remote point", (3,))
        self.fixed, self.values = np.zeros(6, dtype=bool), np.zeros(6)
        if not self.mesh.whole:
            raise ModelError("a remote point needs all nodes of its part in one mesh; solve without mpirun")
        if not len(self.mesh.nodes(where)):
            raise ModelError(f"a remote point needs nodes, and there is none in {short(where)}")
        arms = self.mesh.points[self.mesh.nodes(where)] - self.point
        self.moves_all = (self.mesh.nodes(where),) if rigid else ()
        self._sizes = np.repeat([1.0, float(np.abs(arms).max()) or 1.0], 3)  # m, that a rotation moves nodes
        if not rigid:
            self._weights(self.mesh)
        self.place = id(self)

    def __repr__(self) -> str:
        where = self.where if isinstance(self.where, str) else f"{len(self.mesh.nodes(self.where))} nodes"
        at, units, place = np.flatnonzero(self.fixed), ("m", "rad"), ", ".join(f"{x:g}" for x in self.point)
        held = [f"{'uw'[i // 3]} {AXES[i % 3]} = {self.values[i]:g} {units[i // 3]}" for i in at]
        how = "rigid" if self.is_rigid else "mean of"
        return f"{how} {where} at ({place}) m: {', '.join(held) or 'free'}"

    # ---- what is prescribed and applied ------------------------------------------------------------------

    def fix(self, axes: str = "xyz", value: ArrayLike = 0.0) -> None:
        """Prescribe the displacement of the point; it replaces earlier values.

        Parameters
        ----------
        axes : some of ``"x"``, ``"y"``, ``"z"``.
        value : m; one number, or one per axis.

        Raises
        ------
        InputError
            The axes or the value make no sense.
        """
        self._prescribe(axis_numbers(axes), value, "displacement")

    def fix_rotation(self, axes: str = "xyz", value: ArrayLike = 0.0) -> None:
        """Prescribe the rotation about axes through the point; it replaces earlier values.

        Parameters
        ----------
        axes : some of ``"x"``, ``"y"``, ``"z"``.
        value : rad, small; one number, or one per axis.

        Raises
        ------
        InputError
            The axes or the value make no sense.
        """
        self._prescribe([3 + axis for axis in axis_numbers(axes)], value, "rotation")

    def _prescribe(self, components: list[int], value: ArrayLike, what: str) -> None:
        if callable(value):
            raise InputError(f"the {what} of a remote point is constant; got a function of time")
        values = finite(value, f"the {what} of a remote point")
        if values.shape not in ((), (len(components),)):
            raise InputError(f"the {what} needs one number, or {len(components)}; got shape {values.shape}")
        known = bool(self.fixed[components].all())
        self.fixed[components], self.values[components] = True, values
        self._supports.changed(values_only=known)

    def release(self) -> None:
        """Prescribe nothing any more."""
        self.fixed[:], self.values[:] = False, 0.0
        self._supports.changed()

    def load(self, force: ArrayLike = (0.0, 0.0, 0.0), moment: ArrayLike = (0.0, 0.0, 0.0)) -> Resultant:
        """Return a load on the point, for `Structure.add` or a load case.

        Parameters
        ----------
        force : (3,) N.
        moment : (3,) N m about the point.

        Returns
        -------
        Resultant
            Over the faces of the part; of a rigid one, over its nodes.
        """
        from kratos_lite.model.loads.surface import Resultant  # a quick start without it

        return Resultant(self.where, force, moment, self.point, nodes=self.is_rigid)

    # ---- what is read ------------------------------------------------------------------------------------

    def displacement(self, result: Any) -> Array:
        """Return the displacement of the point.

        Parameters
        ----------
        result : a result or state; or displacements, shapes (..., n, 3).

        Returns
        -------
        (3,) or (..., 3) in m.
        """
        return self._motion(result)[..., :3]

    def rotation(self, result: Any) -> Array:
        """Return the rotation, as a small one.

        Parameters
        ----------
        result : a result or state; or displacements, shapes (..., n, 3).

        Returns
        -------
        (3,) or (..., 3) in rad.
        """
        return self._motion(result)[..., 3:]

    def reaction(self, result: Any) -> tuple[Array, Array]:
        """Return force and moment about the point of all that holds the part there, but for ties of parts.

        Parameters
        ----------
        result : a result or state.

        Returns
        -------
        force : (3,) N.
        moment : (3,) N m.

        Raises
        ------
        InputError
            It is none, or on another mesh where the part has no name.
        """
        mesh = self._mesh_of(result)
        if not hasattr(result, "reactions"):
            raise InputError(f"the reaction is read from a result or state; got {short(result)}")
        nodes = mesh.nodes(self.where)
        analysis = None if mesh is self.mesh else getattr(result, "_analysis", None)
        supports = analysis.model.supports if analysis else self._supports
        reactions = supports.past_ties(result.reactions) if mesh is supports.mesh else result.reactions
        both = reactions[nodes].ravel() @ rigid_modes(mesh.points[nodes], self.point)
        return both[:3], both[3:]

    def _motion(self, result: Any) -> Array:
        """Return displacement and rotation (..., 6)."""
        mesh = self._mesh_of(result)
        u = finite(getattr(result, "u", result), "displacements", ("...", mesh.n_nodes, 3))
        dofs, D = self._operator(mesh)
        return u.reshape(*u.shape[:-2], -1)[..., dofs] @ D.T

    def _mesh_of(self, result: Any) -> Mesh:
        """Return the mesh of a result, on which a part has a name."""
        mesh: Mesh = getattr(result, "mesh", self.mesh)
        if mesh is not self.mesh and not (isinstance(self.where, str) or callable(self.where)):
            raise InputError("the result is on another mesh; make the remote point of a part with a name")
        return mesh

    def _check(self, groups: Sequence[ElementGroup], motion: object) -> list[str]:
        """Raise ModelError for a model whose displacements are large, or whose material moves through it."""
        turns = not self.fixed[3:].all() or self.values[3:].any() if self.is_rigid else self.fixed[3:].any()
        if turns and any(group.element.finite for group in groups):
            raise ModelError(
                f"a remote point ({self!r}) turns by small rotations alone, and the model has large ones: "
                "prescribe its rotation as 0 by fix_rotation(), or take small displacements"
            )
        if motion is not None and (self.is_rigid or self.fixed.any()):
            raise ModelError(f"a remote point ({self!r}) ties material that moves through the mesh")
        return []

    def refined(self, finer: RefinedMesh, supports: Supports) -> RemotePoint:
        """Return the same on the nodes of a finer mesh."""
        new = RemotePoint(supports, finer.where(self.where), self.point, self.is_rigid)
        new.fixed, new.values = self.fixed.copy(), self.values.copy()
        return new

    # ---- how the part follows ----------------------------------------------------------------------------

    def _operator(self, mesh: Mesh) -> tuple[Ints, Array]:
        """Return degrees of freedom (k,) and D (6, k): the point moves by D u[dofs]."""
        if self.is_rigid:
            dofs, R = self._modes(mesh)
            chosen = independent_rows(R)
            return dofs[chosen], np.asarray(np.linalg.pinv(R[chosen]) / self._sizes[:, None], dtype=float)
        weights = self._weights(mesh)
        if mesh.hanging is not None:
            weights = mesh.hanging.gather(weights)
        nodes = np.flatnonzero(weights.any(axis=(1, 2)))
        dofs, B = dofs_of(nodes), weights[nodes].reshape(-1, 6)
        G: Array = B.T @ rigid_modes(mesh.points[nodes], self.point)
        return dofs, np.asarray(np.linalg.solve(G, B.T), dtype=float)

    def _tying(self) -> tuple[Ints, Array]:
        """Return dofs and D of matrices in which all of these meet; ModelError for too many."""
        dofs, D = self._operator(self.mesh)
        if len(dofs) > 3 * MOST:
            raise ModelError(
                f"{self!r}: what is prescribed or attached there ties all {len(dofs) // 3} nodes to each "
                f"other; at most {MOST} may be: take a smaller part, a coarser mesh, or model.rigid(...)"
            )
        return dofs, D

    def _weights(self, mesh: Mesh) -> Array:
        """Return ∫ N R dA (n, 3, 6) over the faces of the part."""
        from kratos_lite.model.loads.surface import Traction  # a quick start without it

        def mode(i: int) -> Array:
            traction = Traction(self.where, lambda X: rigid_modes(X, self.point)[:, i].reshape(-1, 3))
            return traction.forces(mesh, [])

        return np.stack([mode(i) for i in range(6)], axis=2)

    def _modes(self, mesh: Mesh) -> tuple[Ints, Array]:
        """Return the degrees of freedom (3k,) of the nodes that do not hang, and R (3k, 6) by its sizes."""
        nodes = mesh.nodes(self.where)
        if mesh.hanging is not None:
            nodes = np.setdiff1d(nodes, mesh.hanging.nodes)
        return dofs_of(nodes), rigid_modes(mesh.points[nodes], self.point) / self._sizes

    def constraints(self, fixed: Mask, known: Mask) -> Constraints:
        """Return what the nodes follow; see `Coupling`."""
        if self.is_rigid:
            return self._of_rigid()
        if not self.fixed.any():
            return Constraints.none()
        dofs, D = self._tying()
        return _solved_for(dofs, D[self.fixed], self.values[self.fixed])

    def _of_rigid(self) -> Constraints:
        """Return u = R q of all nodes, by as many of their components as q has, and A q = b of the point."""
        from kratos_lite.mesh.hanging import is_corner  # a quick start without it

        dofs, R = self._modes(self.mesh)
        # Corner nodes come first, as the coarse level of multigrid has these alone.
        corner = np.flatnonzero(is_corner(self.mesh.blocks, self.mesh.n_nodes)[dofs // 3])
        chosen = corner[independent_rows(R[corner])]
        chosen = chosen if len(chosen) == 6 else independent_rows(R)
        D, A, b = np.linalg.pinv(R[chosen]), np.eye(6)[self.fixed], (self.values * self._sizes)[self.fixed]
        # Of nodes on a line, q = D u + N s with one rotation s that moves none, which the point must hold.
        N = np.linalg.qr(R[chosen].T, mode="complete")[0][:, len(chosen) :]
        if len(independent_rows(A @ N)) < N.shape[1]:
            raise ModelError(
                f"the nodes of {short(self.where)} lie on a line or at one place, and a rotation of the "
                "remote point about it moves none: prescribe it by fix_rotation, or take more nodes"
            )
        without = np.linalg.qr(A @ N, mode="complete")[0][:, N.shape[1] :].T
        rest = np.delete(np.arange(len(dofs)), chosen)
        weights = R[rest] @ D
        weights[np.abs(weights) < ROUNDING] = 0.0
        each = np.broadcast_to(dofs[chosen], weights.shape)
        follow = Constraints.of(dofs[rest], each, weights, np.zeros(len(rest)))
        return follow + _solved_for(dofs[chosen], without @ A @ D, without @ b)


def _solved_for(dofs: Ints, C: Array, values: Array) -> Constraints:
    """Return C u = values (k,) by as many of the degrees of freedom."""
    chosen = independent_rows(C.T)
    others, inverse = np.delete(np.arange(len(dofs)), chosen), np.linalg.inv(C[:, chosen])
    each = np.broadcast_to(dofs[others], (len(C), len(others)))
    return Constraints.of(dofs[chosen], each, -inverse @ C[:, others], inverse @ values)

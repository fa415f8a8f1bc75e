"""Attachments: what is added besides loads; springs and masses on points, faces and remote points."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from kratos_lite.assembly.attached import Attached
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh, Where
from kratos_lite.mesh.selection import point_of, spread
from kratos_lite.model.remote_point import RemotePoint
from kratos_lite.typing import Array, ArrayLike, Csr, Ints
from kratos_lite.validation import finite, number, short

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh

MARKS, SHOWN = 9, 0.1
"""Marks that show what is on faces, nodes that show what follows a remote point; springs, of the size."""
Place: TypeAlias = "Where | RemotePoint"
"""A part, a point (x, y, z) in m, or a remote point."""


class Attachment(ABC):
    """What `Structure.add` takes besides loads: springs and masses, and the motions of `kratos_lite.ale`."""

    @abstractmethod
    def attach(self, structure: Any) -> None:
        """Become a part of a structure: check it, and set what it needs.

        Parameters
        ----------
        structure : that it is added to.

        Raises
        ------
        ModelError
            It does not fit the structure.
        """


class AttachedMatrix(Attachment):
    """A matrix Jᵀ W J on what moves by J u, integrated over faces."""

    what: ClassVar[str]
    is_mass: bool = False
    where: Place
    to: Place | None = None
    W: Array

    def attach(self, structure: Any) -> None:
        """Add the matrix to the springs, or masses, of a structure; ModelError for a part of a mesh."""
        if not structure.mesh.whole:
            raise ModelError("springs and added masses need the whole mesh; solve without mpirun")
        matrix = self.matrix(structure.mesh)
        known = structure.attached or Attached(0 * matrix, 0 * matrix)
        K, M = (known.K, known.M + matrix) if self.is_mass else (known.K + matrix, known.M)
        structure.attached, structure.supports.springs = Attached(K, M), K
        structure.attachments.append(self)
        structure._changes += 1

    def matrix(self, mesh: Mesh) -> Csr:
        """Return the matrix (3n, 3n) on a mesh."""
        from scipy.sparse import bsr_array, csr_array

        J, vectors = _places(mesh, self.where, self.what)
        W = self.W[None] if vectors is None else self._weights(vectors)
        p, r = len(W), W.shape[1]
        if p * r > J.shape[0]:
            raise ModelError(f"{self.what} with rotations is for remote points, such as model.rigid(...)")
        J = J[: p * r]
        if self.to is not None:
            other, more = _places(mesh, self.to, self.what)
            if vectors is not None or more is not None or other.shape[0] < r:
                raise ModelError(f"{self.what} between parts joins their remote points: model.rigid(...)")
            J = J - other[:r]
        A = csr_array(J.T @ bsr_array((W, np.arange(p), np.arange(p + 1)), shape=(p * r, p * r)) @ J)
        A.eliminate_zeros()
        return A

    def drawn(self, mesh: Mesh) -> Array:
        """Return lines (k, 2, 3) in m: from points, or some of faces, to another or along the stiffness."""
        places, other, X = self._points(mesh), _point_of(self.to), mesh.points
        if places is None:
            J, normals = _places(mesh, self.where, self.what)
            assert normals is not None
            ways, places = normals, (J @ X.ravel()).reshape(-1, 3)
        else:
            ways = np.linalg.eigh(self.W[..., :3, :3])[1][..., -1].reshape(-1, 3)
            ways = ways * np.where(((places - X.mean(axis=0)) * ways).sum(axis=1) < 0, -1, 1)[:, None]
        some = spread(places, MARKS)
        size = SHOWN * np.linalg.norm(np.ptp(X[mesh.used_nodes()], axis=0))
        ways = size * ways[some] / np.linalg.norm(ways[some], axis=1)[:, None]
        ends = places[some] + ways if other is None else other[None]
        return np.stack([places[some], ends], axis=1)

    def _points(self, mesh: Mesh) -> Array | None:
        """Return the points (k, 3) that it is on; None for faces."""
        point = _point_of(self.where)
        return None if point is None else point[None]

    @abstractmethod
    def _weights(self, vectors: Array) -> Array:
        """Return W (p, 3, 3) at places of faces with normals times areas (p, 3) in m²."""

    def refined(
        self, finer: RefinedMesh, old: Sequence[RemotePoint], new: Sequence[RemotePoint]
    ) -> AttachedMatrix:
        """Return the same on a finer mesh, whose remote points are new."""
        made = copy(self)
        for name in ("where", "to"):
            place = getattr(self, name)
            if isinstance(place, RemotePoint):
                setattr(made, name, new[old.index(place)])
            elif place is not None and _point_of(place) is None:
                setattr(made, name, finer.where(place))
        return made

    def _unit(self) -> str:
        """Return the units of its values, in brackets."""
        per = "" if self.is_mass else "/m³" if _point_of(self.where) is None else "/m"
        rotation = " [kg m²]" if self.is_mass else " [N m/rad]"
        return f" [{'kg' if self.is_mass else 'N'}{per}]{rotation if self.W[3:, 3:].any() else ''}"

    def __repr__(self) -> str:
        named = {name: value for name, value in vars(self).items() if name != "W" and value is not None}
        values = ", ".join(f"{name}={short(value)}" for name, value in named.items())
        return f"{type(self).__name__}({values}){self._unit()}"


class ElasticSupport(AttachedMatrix):
    """Springs: on a point or remote point, or over faces as an elastic foundation; to ground or to another.

    Its forces on the body are among the reactions of a result.

    Parameters
    ----------
    where : a point (x, y, z) in m, a `RemotePoint`, or a part: its conditions if it has any, otherwise the
        boundary faces among its nodes.
    stiffness : on points (3,) along x, y, z, or (3, 3), N/m; on remote points also (6,) or (6, 6) with those
        of rotations in N m/rad.  On faces a number, along the normal, or (3,) or (3, 3), N/m³.
    to : the other end, a point or remote point; the ground if not given.

    Raises
    ------
    InputError
        The stiffness has another shape, is not symmetric, or would push what moves.
    ModelError
        Two ends lie apart, and the stiffness is not along the line between them: it would resist rotations.

    Notes
    -----
    K = ∫ Nᵀ k N dA.  Source: Hetényi, Beams on Elastic Foundation (1946), chapter I.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> block = kl.Model(kl.box((2.0, 1.0, 1.0)), kl.Isotropic3D(E=1e9, nu=0.3))
    >>> block.add(kl.ElasticSupport("z-", (1e5, 1e5, 1e7)))
    >>> block.add(kl.Resultant("z+", (0, 0, -1e4)))
    >>> result = block.solve()
    >>> print(f"{result.displacement('z-')[:, 2].mean():.2e} m, {result.reaction('z-')[:, 2].sum():.2e} N")
    -5.00e-04 m, 1.00e+04 N
    """

    what = "an elastic support"

    def __init__(self, where: Place, stiffness: ArrayLike, to: Place | None = None) -> None:
        k = finite(stiffness, "the stiffness of an elastic support")
        if k.shape not in ((), (3,), (6,), (3, 3), (6, 6)):
            raise InputError(f"the stiffness must be a number, (3,), (3, 3), (6,) or (6, 6); got {k.shape}")
        W = _semidefinite(k if k.ndim == 2 else np.diag(np.atleast_1d(k)), "the stiffness")
        self.where, self.stiffness, self.to, self.W = where, k.tolist(), to, W
        one, other = _point_of(where), _point_of(to)
        if k.ndim == 0 and one is not None:
            raise InputError("the stiffness on a point is (3,) or (3, 3), in N/m; got a number")
        if one is not None and other is not None:
            size = float(np.linalg.norm(other - one) * np.abs(W).max())
            if np.abs(np.cross(other - one, W[:3, :3])).max() > 1e-9 * size:
                raise ModelError(
                    "a spring between two places acts along the line between them, k d dᵀ with its direction "
                    "d; for others give both ends one place, such as two remote points there"
                )

    def _weights(self, vectors: Array) -> Array:
        """Return k dA at places of faces, along the normal for a number."""
        areas = np.linalg.norm(vectors, axis=1)[:, None, None]
        return areas * self.W if len(self.W) > 1 else self.W * vectors[:, :, None] * vectors[:, None] / areas


class AddedMass(AttachedMatrix):
    """Mass on a point, over faces, or on a remote point; see `Structure.add_mass`."""

    what, is_mass = "an added mass", True

    def __init__(self, where: Place, mass: float, inertia: ArrayLike | None = None) -> None:
        self.where, self.mass = where, number(mass, "an added mass", above=0, unit="kg")
        self.W = np.diag([self.mass] * 3 + [0.0] * 3 * isinstance(where, RemotePoint))
        if inertia is not None:
            if not isinstance(where, RemotePoint):
                raise InputError("an inertia is for remote points, such as model.rigid(...)")
            known = _semidefinite(finite(inertia, "the inertia of an added mass", (3, 3)), "the inertia")
            self.W[3:, 3:], self.inertia = known, known.tolist()

    def _weights(self, vectors: Array) -> Array:
        """Return the mass at places of faces, by area."""
        areas = np.linalg.norm(vectors, axis=1)[:, None, None]
        return areas / areas.sum() * self.W


class OnNodes(AttachedMatrix):
    """Springs, or masses, on nodes (k,) by their matrix (3n, 3n) in N/m or kg."""

    what = "an element of one node"
    where = None  # type: ignore[assignment]

    def __init__(self, nodes: Ints, A: Csr, is_mass: bool) -> None:
        self.nodes, self.A, self.is_mass = nodes, A, is_mass
        self.W = A.diagonal().reshape(-1, 3)[nodes, None] * np.eye(3)

    def matrix(self, mesh: Mesh) -> Csr:
        """Return the matrix (3n, 3n) on a mesh."""
        if len(idle := self.nodes[~mesh.used_nodes()[self.nodes]]):
            raise ModelError(f"{self.what} is at node {mesh.node_ids[idle[0]]}, which no solid has")
        A: Any = self.A.copy()
        A.resize(mesh.points.size, mesh.points.size)
        return A

    def __repr__(self) -> str:
        x, y, z = self.A.diagonal().reshape(-1, 3).sum(axis=0)
        total = f"mass {x:g} kg" if self.is_mass else f"stiffness ({x:g}, {y:g}, {z:g}) N/m"
        return f"{total} on {len(self.nodes)} nodes in all"

    def _points(self, mesh: Mesh) -> Array:
        return mesh.points[self.nodes]

    def _weights(self, vectors: Array) -> Array:
        return self.W


def _semidefinite(W: Array, what: str) -> Array:
    """Return a symmetric matrix without negative eigenvalues; InputError for any other."""
    size = 1e-12 * float(np.abs(W).max())
    if np.abs(W - W.T).max() > size or np.linalg.eigvalsh(W)[0] < -size:
        raise InputError(f"{what} must be symmetric, and ≥ 0 in each direction; got {short(W.tolist())}")
    return W


def _point_of(end: Place | None) -> Array | None:
    """Return the point (3,) at which a spring ends; None for faces and the ground."""
    return end.point if isinstance(end, RemotePoint) else None if end is None else point_of(end)


def _places(mesh: Mesh, where: Place, what: str) -> tuple[Csr, Array | None]:
    """Return J (r, 3n), displacements at places by those of nodes, and normals times areas of faces."""
    from scipy.sparse import csr_array, eye_array, kron, vstack

    from kratos_lite.elements.surface import area_vectors, face_rule  # a quick start without springs
    from kratos_lite.elements.tables import tabulate
    from kratos_lite.model.loads.nodal import around
    from kratos_lite.model.loads.surface import loaded_faces

    n = mesh.n_nodes
    if isinstance(where, RemotePoint):
        dofs, D = where._tying()
        rows, columns = np.repeat(np.arange(6), len(dofs)), np.tile(dofs, 6)
        return csr_array((D.ravel(), (rows, columns)), shape=(6, 3 * n)), None
    point, vectors = point_of(where), []
    if point is not None:
        nodes, N = around(mesh, point, what)
        parts = [csr_array((N, (0 * nodes, nodes)), shape=(1, n))]
    else:
        parts = []
        for block in loaded_faces(mesh, where, what):
            rule = face_rule(block.known_shape)
            N, (m, k) = tabulate(block.known_shape, rule)[0], block.nodes.shape
            entries = np.tile(N, (m, 1)).ravel(), np.repeat(block.nodes, len(N), axis=0).ravel()
            parts.append(csr_array((*entries, np.arange(m * len(N) + 1) * k), shape=(m * len(N), n)))
            vectors.append(area_vectors(block.known_shape, mesh.points[block.nodes], rule).reshape(-1, 3))
    J = csr_array(kron(vstack(parts), eye_array(3)))
    return J, np.concatenate(vectors) if vectors else None

"""Section: the force and moment that pass through a cut of a body, and the stress on it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, TypeAlias

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.analysis.fields import FIELDS, PLACE, labelled
from kratos_lite.analysis.report import vector
from kratos_lite.assembly.nonlinear_assembly import internal_forces
from kratos_lite.elements.surface import area_vectors, face_rule
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import InputError, MeshError
from kratos_lite.mesh import Mesh, WhereElements, mask_of, with_rows
from kratos_lite.mesh.locate import Located
from kratos_lite.mesh.topology import faces_of
from kratos_lite.model.ties import Coupling
from kratos_lite.quadrature import rule_for
from kratos_lite.shapes.faces import FACE_SHAPES, Triangle3
from kratos_lite.tabular import Tabular, in_units
from kratos_lite.typing import Array, ArrayLike, Ints, Mask, Numbers
from kratos_lite.validation import finite, short
from kratos_lite.view.plane import Plane, cut_cells, plane_of

ON_PLANE = 1e-9
"""Distance of nodes on a plane, as fraction of the size of the mesh."""
DEGREE = 4
"""Of the rule on triangles of a cut: stresses of quadratic elements times arms."""
FAR = 0.05
"""Part of a force up to which that of the stress is near it."""
Pieces: TypeAlias = "Iterator[tuple[int, Ints, Array, Array, Array]]"
"""Block, cells (p,), places (p, g, 3), reference coordinates (p, g, 3) and normal × area (p, g, 3)."""


@dataclass(frozen=True, eq=False)
class Section(Tabular):
    """A cut of a body with what passes through it; it prints as a table.

    Force and moment are those of the internal nodal forces beyond the cut, so that they are in equilibrium
    with the loads and reactions there to rounding; nodes on the cut count half.  A distributed load counts
    by its nodal forces, so that of elements which the cut divides is known by the length of an element: let
    it run along faces of elements where that matters.  How far the integral of the stress is from the force
    shows how well the mesh resolves the stress.

    Attributes
    ----------
    where : the cut, in words.
    normal : (3,) unit vector, into what lies beyond the cut; the mean one of a part, 0 where that is closed.
    area : of the undeformed cut in m².
    centroid : (3,) m, of the cut; deformed where displacements are large, as all places and arms are.
    force : (3,) N, of what lies beyond the cut on the rest.
    moment : (3,) N m, likewise, about the centroid.
    points : (q, 3) m, quadrature points of the cut.
    weights : (q,) m², their areas.
    stress : (q, 6) Pa, there.
    traction : (q, 3) Pa, force for each undeformed area there, σ n.
    units : set of units of all numbers, which are said here as in SI.
    """

    where: str
    normal: Array
    area: float
    centroid: Array
    force: Array
    moment: Array
    points: Array
    weights: Array
    stress: Array
    traction: Array
    units: str = "SI"

    def moment_about(self, point: ArrayLike) -> Array:
        """Return the moment about another point.

        Parameters
        ----------
        point : (3,) m.

        Returns
        -------
        (3,) N m
        """
        arm = self.centroid - finite(point, "the point of a moment", (3,))
        return self.moment + np.cross(arm, self.force)

    @property
    def stress_force(self) -> Array:
        """The integral ∫ σ n dA of the stress (3,) in N, for comparison with the force."""
        return self.weights @ self.traction

    @property
    def stress_moment(self) -> Array:
        """The moment ∫ x × σ n dA of the stress about the centroid (3,) in N m, likewise."""
        return self.weights @ np.cross(self.points - self.centroid, self.traction)

    def columns(self) -> dict[str, Numbers]:
        """Return places, areas and stresses of the quadrature points, with units in the headers.

        Returns
        -------
        dict of str to (q,) array
            ``kl.write("cut.csv", section)`` writes them.
        """
        places = {**PLACE.columns(self.points), "area [m2]": self.weights}
        return labelled({**places, **FIELDS["stress"].columns(self.stress)}, self.units)

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary, labels and values."""
        rows = [("section", f"{self.where}, area {self.area:.6g} m², centroid {vector(self.centroid)} m")]
        for name, unit, arm, along, across in (
            ("force", "N", 1.0, "normal", "shear"),
            ("moment", "N m", self.area**0.5, "torsion", "bending"),
        ):
            values, size = getattr(self, name), arm * float(np.linalg.norm(self.force))
            text, n = f"{vector(values, size)} {unit}", float(values @ self.normal)
            if self.normal.any():
                parts = np.array([n, np.linalg.norm(values - n * self.normal)])
                n, t = np.where(np.abs(parts) < 1e-12 * max(size, *np.abs(values)), 0.0, parts)
                text += f" ({along} {n:.6g}, {across} {t:.6g})"
            stress = vector(getattr(self, f"stress_{name}"), size)
            off = np.linalg.norm(getattr(self, f"stress_{name}") - values)
            least = 0.02 * arm * self.weights @ np.linalg.norm(self.traction, axis=1)  # where none passes
            far = off > FAR * max(size, np.linalg.norm(values), least)
            mark = f", more than {FAR:.0%} off: a finer mesh there resolves it" * bool(far)
            rows += [(f"section {name}", text), (f"{name} of stress", f"{stress} {unit}{mark}")]
        return rows


def section(fields: ElementFields, where: Any, part: WhereElements = None, recovered: bool = True) -> Section:
    """Return a cut of a result by a plane or around a part; see `Result.section`."""
    mesh, u = fields.mesh, fields._strained
    name, weights, pieces = cut_of(mesh, where, part, fields._ties)
    located, area = _located(mesh, pieces, name)
    values = fields.at(located, recovered=recovered)  # type: ignore[attr-defined]
    x, points, sigma = mesh.points, located.points, voigt.tensor(values.stress)
    if any(group.element.finite for group in fields.groups):
        x, points = x + u, points + located.interpolate(u)
        sigma = values.deformation_gradient @ voigt.tensor(values.pk2_stress)
    dA, total = np.linalg.norm(area, axis=1), area.sum(axis=0)
    whole, net = float(dA.sum()), float(np.linalg.norm(total))
    centroid, normal = dA @ points / whole, total / net if net > ON_PLANE * whole else 0 * total
    inside = mask_of(mesh.elements(part), mesh.n_elements)
    groups = [group.take(inside[group.rows]) for group in fields.groups]
    forces = internal_forces(mesh.points, groups, u)
    forces = forces if mesh.hanging is None else mesh.hanging.gather(forces)
    both = weights @ forces, weights @ np.cross(x - centroid, forces)
    traction = np.einsum("qij,qj->qi", sigma, area / dA[:, None])
    of_points = points, dA, values.stress, traction
    return Section(name, normal, whole, centroid, *both, *of_points, mesh.units)


def cut_of(
    mesh: Mesh, where: Any, part: WhereElements, ties: Sequence[Coupling]
) -> tuple[str, Array, Pieces]:
    """Return a cut in words, by how much nodes lie beyond it (n,), and its pieces; raise for none."""
    if not mesh.whole:
        raise MeshError("a section needs the whole mesh on one process; solve it from one file")
    pair = isinstance(where, (tuple, list)) and len(where) == 2
    if pair and isinstance(where[0], (str, tuple, list, np.ndarray)):
        return _by_plane(mesh, plane_of(where, np.zeros(3), "a section"), part)
    if isinstance(where, str) and "=" in where and where not in mesh.parts:
        raise InputError(f"a section by a plane is a pair such as ('x', 0.5); got {where!r}")
    if part is not None:
        raise InputError(f"part belongs to a section by a plane, such as ('x', 0.5); got {short(where)}")
    return _around(mesh, where, ties)


def _by_plane(mesh: Mesh, plane: Plane, part: WhereElements) -> tuple[str, Array, Pieces]:
    """Return the cut by a plane: nodes beyond it count 1, nodes on it half, unless it bounds the body."""
    inside = mask_of(mesh.elements(part), mesh.n_elements)
    n, offset = plane.normal, plane.offset
    d = mesh.points @ n - offset
    d[np.abs(d) <= ON_PLANE * np.linalg.norm(np.ptp(mesh.extent, axis=0))] = 0.0
    if not inside.any():
        raise MeshError("the part of a section has no elements; leave it out for all")
    used = mesh.used_nodes(inside)
    low, high = float(d[used].min()), float(d[used].max())
    axis = "xyz"[int(n.argmax())] if n.max() == 1 else f"({', '.join(f'{c:.4g}' for c in n)})·X"
    name, spans = (
        in_units(text, mesh.units)
        for text in (f"{axis} = {offset:g} m", f"{offset + low:g} … {offset + high:g} m")
    )
    if low > 0 or high < 0:
        what = "the body" if part is None else "the part"
        raise MeshError(f"the section {name} misses {what}, which spans {spans} there")
    if part is not None:
        name += f" of {part!r}" if isinstance(part, (str, int)) else " of some elements"
    weights = np.heaviside(d, 0.0 if low == 0 else 1.0 if high == 0 else 0.5)
    return name, weights, _polygons(mesh, -d if high == 0 else d, n, inside)


def _polygons(mesh: Mesh, d: Array, n: Array, inside: Mask) -> Pieces:
    """Yield the section of elements inside where the distance (n,) of nodes is 0, in triangles."""
    rule = rule_for("triangle", DEGREE)
    for number, (block, at) in enumerate(with_rows(mesh.blocks)):
        if len(block):
            straight = len(block.known_shape.nodes) == block.known_shape.corners
            cells, corners, _ = cut_cells(block, d, mesh.points, 1 if straight else None)
            kept = inside[at][cells]
            cells, corners = cells[kept], corners[kept]
            P = corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 6)
            area = np.linalg.norm(np.cross(P[:, 1, :3] - P[:, 0, :3], P[:, 2, :3] - P[:, 0, :3]), axis=1)
            x = tabulate(Triangle3, rule)[0] @ P
            dA = area[:, None, None] * rule.weights[:, None] * n
            yield number, np.repeat(cells, 2), x[..., :3], x[..., 3:], dA


def _around(mesh: Mesh, where: Any, ties: Sequence[Coupling]) -> tuple[str, Array, Pieces]:
    """Return the cut around a part: its nodes count 1, those that others share half, tied ones 0."""
    name = f"around {where!r}" if isinstance(where, (str, int)) else "around some elements"
    inside = mask_of(mesh.elements(where), mesh.n_elements)
    own, others = mesh.used_nodes(inside), mesh.used_nodes(~inside)
    tied = np.zeros(mesh.n_nodes, dtype=bool)
    for pair in chain.from_iterable(zip(tie.nodes_of[::2], tie.nodes_of[1::2], strict=True) for tie in ties):
        for a, b in (pair, pair[::-1]):
            tied[a] |= own[a].all() and not own[b].any()
    return name, np.where(tied, 0.0, own - 0.5 * (own & others)), _faces(mesh, inside, tied)


def _faces(mesh: Mesh, inside: Mask, tied: Mask) -> Pieces:
    """Yield the faces between elements inside and others, of the smaller ones where nodes hang, and tied."""
    faces, start = mesh.all_faces, 0
    between = inside[faces.element[faces.one]] != inside[faces.element[faces.other]]
    cut = np.isin(np.arange(len(faces.element)), faces.other[between])
    for number, (block, rows) in enumerate(with_rows(mesh.blocks)):
        for columns in map(list, faces_of(block)):
            on_tie = inside[rows] & tied[block.nodes[:, columns]].all(axis=1)
            cells = np.flatnonzero(cut[start : start + len(block)] | on_tie)
            start += len(block)
            shape = FACE_SHAPES[len(columns)]
            N, X = tabulate(shape, face_rule(shape))[0], mesh.points[block.nodes[cells][:, columns]]
            xi = np.broadcast_to(N @ block.known_shape.nodes[columns], (len(cells), len(N), 3))
            into = np.where(inside[rows][cells], -1.0, 1.0)[:, None, None]
            yield number, cells, N @ X, xi, into * area_vectors(shape, X)


def _located(mesh: Mesh, pieces: Pieces, name: str) -> tuple[Located, Array]:
    """Return the points (q,) of a cut in their elements, and normal × area (q, 3) of each."""
    starts, flat = np.array([at.start for _, at in with_rows(mesh.blocks)]), []
    for number, cells, x, xi, dA in pieces:
        vectors = (a.reshape(-1, 3) for a in (x, xi, dA))
        flat.append((np.full(x[..., 0].size, number), np.repeat(cells, x.shape[1]), *vectors))
    block, cell, points, xi, area = (np.concatenate(part) for part in zip(*flat, strict=True))
    kept = area.any(axis=1)
    if not kept.any():
        raise MeshError(
            f"the section {name} cuts no element and meets no face between two elements; the force in a tie "
            "or in a bolt is that of one of its sides, result.reaction('part.z-')"
        )
    located = Located(mesh, points, starts[block] + cell, block, cell, xi)
    return located[kept], area[kept]

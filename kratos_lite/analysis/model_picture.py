"""Pictures of models: supports, loads, springs and remote points as marks, materials as colors."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kratos_lite.assembly.element_groups import add_nodal
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Mesh, distinct
from kratos_lite.mesh.facets import unit_normals
from kratos_lite.mesh.selection import spread
from kratos_lite.model.attachments import MARKS, SHOWN
from kratos_lite.model.loads.base import Drawn, Load
from kratos_lite.model.loads.merging import joined
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.model.structure import Structure
from kratos_lite.model.supports import AXES, DirichletCondition, axis_numbers
from kratos_lite.tabular import in_units
from kratos_lite.typing import Array
from kratos_lite.view.marks import DARK, LOAD, SUPPORT, Entry, Marks
from kratos_lite.view.scene import Values

ALONE = 50
"""Loads that are drawn one by one; the forces of all others together."""
MANY = 4
"""Supports of one kind from which each has fewer marks."""
CONE = 0.4
"""Height of the cone of a support, of the longest arrow."""
LEAST = 0.02
"""Part of the longest arrow that is drawn."""
TIE = r"$\circ$"
"""Marker of a tie."""
LETTERS, LINES = 90, 12
"""Of a line of the legend; and of the legend."""


def materials_of(structure: Structure) -> Values | None:
    """Return the numbers (m,) of the materials of elements, and their names; None if there is none."""
    of, named = structure._material_of, dict[str, int]()
    if not (of >= 0).any():
        return None
    numbers = np.zeros(len(of))
    for i in sorted(distinct(of), key=lambda i: (i < 0, i)):
        name = in_units(str(structure._materials[i]), structure.units) if i >= 0 else "no material"
        numbers[of == i] = named.setdefault(_cut(name), len(named))
    return Values(numbers, names=tuple(named))


def legend_of(structure: Structure) -> list[Entry]:
    """Return what the marks of a model stand for."""
    rows = [("^", SUPPORT, str(condition)) for condition in structure.supports.conditions]
    rows += [(TIE if tie.nodes_of else "x", DARK, f"{tie.title} {tie}") for tie in structure.supports.ties]
    rows += [("o" if one.is_mass else "s", DARK, repr(one)) for one in structure.attachments]
    rows += [(_marker(load), LOAD, structure._said(load, str)) for load in structure.loads]
    entries = [(marker, color, _cut(in_units(text, structure.units))) for marker, color, text in rows]
    more = len(entries) - LINES
    return entries if more <= 0 else [*entries[:LINES], ("", DARK, f"and {more} more: print(model)")]


def _marker(load: Load) -> str:
    """Return the marker of a load: none of a temperature, which has no arrows."""
    return "" if isinstance(getattr(load, "load", load), Temperature) else ">"


def _cut(text: str) -> str:
    return text if len(text) <= LETTERS else f"{text[: LETTERS - 1]}…"


def marks_of_model(structure: Structure) -> Marks:
    """Return the marks of supports, loads, springs, added masses, ties and remote points."""
    shown, mesh, none = structure.attachments, structure.mesh, np.zeros((0, 2, 3))
    spokes = [none]
    for point in structure.remote_points:
        X = mesh.points[mesh.nodes(point.where)]
        some = X[spread(X, MARKS)]
        spokes.append(np.stack([np.broadcast_to(point.point, some.shape), some], axis=1))

    def lines(mass: bool, inside: bool) -> Array:
        some = (one.drawn(mesh) for one in shown if one.is_mass == mass and (one.to is not None) == inside)
        return np.concatenate([none, *some])

    surface = _Surface(mesh)
    arrows: dict[str, list[Array]] = {"on": [none], "from": [none], "to": [none], "about": [none]}
    for drawn in _loads(structure):
        for kind, known in arrows.items():
            known.append(surface.arrows(kind, [(X, v) for X, v, way in drawn if way == kind]))
    tied = [mesh.points[nodes] for tie in structure.supports.ties for nodes in tie.nodes_of[1::2]]
    return Marks(
        pivots=np.concatenate([none[:, 0], *(X[spread(X, MARKS)] for X in tied)]),
        springs=lines(mass=False, inside=False),
        between=lines(mass=False, inside=True),
        masses=lines(mass=True, inside=False)[:, 0],
        spokes=np.concatenate(spokes),
        supports=np.concatenate([none, *_supports(structure, surface)]),
        loads=np.concatenate([*arrows["on"], *arrows["from"], *arrows["to"]]),
        moments=np.concatenate(arrows["about"]),
    )


class _Surface:
    """The surface of a mesh, from outside which marks point at it."""

    def __init__(self, mesh: Mesh) -> None:
        self.size = SHOWN * float(np.linalg.norm(np.ptp(mesh.points[mesh.used_nodes()], axis=0)))
        normals = np.zeros_like(mesh.points)
        for block in mesh.boundary:
            normal = unit_normals(mesh.points[block.nodes[:, : block.known_shape.corners]])
            np.add.at(normals, block.nodes, normal[:, None])
        outer = np.flatnonzero(normals.any(axis=1))
        self._points, self._normals = mesh.points[outer], normals[outer]

    def outwards(self, X: Array, ways: Array) -> Array:
        """Return along ways (k, 3) at places (k, 3), > 0 where these lead out of the body."""
        normals = np.array([self._normal(x) for x in X]).reshape(-1, 3)
        found = (normals * ways).sum(axis=1)
        sizes = np.linalg.norm(normals, axis=1) * np.linalg.norm(ways, axis=1)
        return np.where(np.abs(found) > 1e-6 * sizes, found, 0.0)

    def _normal(self, x: Array) -> Array:
        """Return the sum (3,) of the normals of the nodes that are nearest to a place."""
        away = ((self._points - x) ** 2).sum(axis=1)
        return np.asarray(self._normals[away <= (1 + 1e-6) * away.min()].sum(axis=0))

    def arrows(self, kind: str, drawn: list[tuple[Array, Array]]) -> Array:
        """Return tails and heads (k, 2, 3) of some vectors at places, the longest as `SHOWN` says."""
        X, v = (np.concatenate([np.zeros((0, 3)), *(one[i] for one in drawn)]) for i in range(2))
        lengths = np.linalg.norm(v, axis=1)
        X, v = (some[lengths > LEAST * lengths.max(initial=0.0)] for some in (X, v))
        v = v * (self.size / lengths.max(initial=1e-300))
        some = spread(np.hstack([X, v]), MARKS)
        X, v = X[some], v[some]
        ahead = self.outwards(X, v) < 0 if kind == "on" else np.full(len(X), kind == "to")
        tails = X - ahead[:, None] * v
        return np.stack([tails, tails + v], axis=1)


def _supports(structure: Structure, surface: _Surface) -> Iterator[Array]:
    """Yield lines (k, 2, 3) from outside to nodes that are held, along the axes that hold them."""
    supports, alike = structure.supports, dict[tuple[int, str], list[DirichletCondition]]()
    for condition in supports.conditions:
        if not condition.released:
            letters = condition.local.letters if condition.local else AXES
            for axis in axis_numbers(condition.axes, letters):
                alike.setdefault((axis, repr(condition.local)), []).append(condition)
    for (axis, _), conditions in alike.items():
        local, held = conditions[0].local, np.concatenate([condition.nodes for condition in conditions])
        held = held if local else held[supports.fixed[held, axis]]
        X = structure.mesh.points[held]
        X = X[spread(X, MARKS * min(len(conditions), MANY))]
        ways = local.directions(X)[:, axis] if local else np.tile(np.eye(3)[axis], (len(X), 1))
        ways = ways * np.where(surface.outwards(X, ways) > 0, CONE, -CONE)[:, None]
        yield np.stack([X + surface.size * ways, X], axis=1)


def _loads(structure: Structure) -> Iterator[list[Drawn]]:
    """Yield what shows each load, those of one kind as one, and what is beyond `ALONE` as nodal forces."""
    mesh = structure.mesh
    try:
        groups = structure.element_groups()
    except ModelError:  # without materials there is no weight
        groups = []
    loads = [load for _, load in joined(mesh, ((1.0, load) for load in structure.loads))]
    for load in loads[:ALONE]:
        yield load.drawn(mesh, groups)
    if rest := loads[ALONE:]:
        forces = np.zeros_like(mesh.points)
        for load in rest:
            add_nodal(forces, *load.on_nodes(mesh, groups))
        yield [(mesh.points, forces, "on")]

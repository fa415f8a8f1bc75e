"""Tables as CalculiX 2.20 prints them to `.dat` files: lists of lines, none of what a result has not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.elements.surface import area_vectors
from kratos_lite.io.writers.calculix import at_gauss, at_nodes, order
from kratos_lite.io.writers.frd import FIELDS
from kratos_lite.mesh import Block
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.quadrature import rule_for
from kratos_lite.shapes.base import at_points
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import choice

TENSOR = "(elem, integ.pnt.,{0}xx,{0}yy,{0}zz,{0}xy,{0}xz,{0}yz) "
VARIABLES = {
    "U": ("DISP", "displacements (vx,vy,vz) ", ""),
    "V": ("VELO", "velocities (vx,vy,vz) ", ""),
    "RF": ("FORC", "forces (fx,fy,fz) ", "total force (fx,fy,fz) "),
    "NT": ("NDTEMP", "temperatures ", ""),
    "S": ("stress", "stresses " + TENSOR.format("s"), ""),
    "E": ("strain", "strains " + TENSOR.format("e"), ""),
    "ME": ("mechanical_strain", "mechanical strains " + TENSOR.format("e"), ""),
    "PEEQ": ("accumulated_plastic_strain", "equivalent plastic strain (elem, integ.pnt.,pe)", ""),
    "ENER": ("strain_energy_density", "internal energy density (elem, integ.pnt.,energy) ", ""),
    "COORD": ("place", "global coordinates (elem, integ.pnt.,x,y,z) ", ""),
    "EVOL": ("volume", "volume (element, volume) ", "total volume "),
    "ELSE": ("energy", "internal energy (element, energy) ", "total internal energy "),
}
"""Variables of *NODE PRINT and *EL PRINT: the field, and titles of its values and their total."""
PARTS = [f"{axis}-{what}     " for what in ("COMPONENT", "ROTATION ") for axis in "XYZ"]
HEAD = ["MODE NO.   " + "".join(PARTS).rstrip()]


def prints(
    result: ElementFields,
    rows: Ints,
    variable: str,
    where: str,
    time: float = 1.0,
    totals: str = "NO",
    local: Sequence[tuple[str, LocalAxes, Ints]] = (),
    known: Mapping[str, Array] | None = None,
) -> list[str]:
    """Return the table of a variable of nodes or elements in order, of the set `where`.

    `totals` is NO, YES or ONLY.  Some nodes or elements have vectors and tensors along `local` axes, and a
    mark; `known` are the fields of nodes, which are made if not given.
    """
    field, title, total = VARIABLES[choice(variable, "a printed variable", VARIABLES)]
    mesh, at_node = result.mesh, field in FIELDS
    every = mesh.node_ids if at_node else mesh.element_ids
    if at_node:
        values = (at_nodes(result, [field]) if known is None else known).get(field)
        tables = [] if values is None else [(every[rows], values[rows], mesh.points[rows])]
    else:
        tables = _of_elements(result, rows, field, bool(total))
    if not tables:
        return []
    numbers, table, places = (
        np.vstack([part[:, None] if part.ndim == 1 else part for part in parts])
        for parts in zip(*tables, strict=True)
    )
    if not at_node:
        some = _in_turn(numbers, every[rows])
        numbers, table, places = numbers[some], table[some], places[some]
    of, lines, shown = f"for set {where} and time{fortran(time):>15}", list[str](), table.copy()
    marks = np.full(len(table), "", dtype=object)
    for mark, axes, turned in local if table.shape[1] == (3 if at_node else 6) else ():
        at = np.isin(numbers[:, 0], every[turned])
        marks[at], shown[at] = mark, _along(axes, table[at], places[at])
    if totals != "ONLY" or not total:
        form = "%10d" + "%4d" * (numbers.shape[1] - 1) + "%14.6E" * table.shape[1]
        printed = np.hstack([numbers, shown]).tolist()
        lines += ["", f" {title}{of}", ""]
        lines += [form % tuple(row) + mark for row, mark in zip(printed, marks, strict=True)]
    if totals != "NO" and total:
        lines += ["", f" {total}{of}", "", "      " + "".join(f"{sum_:14.6E}" for sum_ in table.sum(axis=0))]
    return lines


def _along(axes: LocalAxes, values: Array, places: Array) -> Array:
    """Return vectors (k, 3), or tensors (k, 6) as CalculiX orders them, along local axes at places (k, 3)."""
    if values.shape[1] == 3:
        return axes.vectors(values, places)
    return axes.stresses(values[:, voigt.ABAQUS], places)[:, voigt.ABAQUS]


def _in_turn(numbers: Ints, ids: Ints) -> Ints:
    """Return the rows of elements in the order of their ids, and of their points."""
    order = np.lexsort(numbers.T[::-1])
    first, last = (np.searchsorted(numbers[order, 0], ids, side) for side in ("left", "right"))
    return order[np.concatenate([np.arange(0), *map(np.arange, first, last)])]


def _of_elements(
    result: ElementFields, rows: Ints, field: str, whole: bool
) -> list[tuple[Ints, Array, Array]]:
    """Return ids, or also numbers of Gauss points, values and places of elements of each group."""
    tables = []
    values = zip(result.groups, at_gauss(result, field), at_gauss(result, "place"), strict=False)
    for group, *parts in values:
        chosen, turn = np.isin(group.rows, rows), order(group.rule)
        there, places = (part[chosen][:, turn] for part in parts)
        if whole:
            there, places = there.sum(axis=1, keepdims=True), places[:, :1]
        there = there[..., voigt.ABAQUS] if there.shape[-1] == 6 else there
        (m, g, c), ids = there.shape, result.mesh.element_ids[group.rows[chosen]]
        named = np.column_stack([ids.repeat(g), np.tile(np.arange(1, g + 1), m)])[:, : 1 if whole else 2]
        tables.append((named, there.reshape(m * g, c), places.reshape(m * g, 3)))
    return tables


def section_print(result: ElementFields, faces: Sequence[Block], where: str, time: float = 1.0) -> list[str]:
    """Return *SECTION PRINT of faces, outward: force, moment and area of the stress that nodes show."""
    stress, X, parts = at_nodes(result, ["STRESS"])["STRESS"], result.mesh.points, np.zeros(13)
    full = any(len(group.rule) == 27 for group in result.groups)
    degrees = {3: 1, 4: 3, 6: 2, 8: 5 if full else 3}
    for block in faces:
        shape, nodes = block.known_shape, block.nodes
        rule = rule_for(shape.cell, degrees[nodes.shape[1]])
        N, n = at_points(shape.N, rule.points), area_vectors(shape, X[nodes], rule)
        force, place = np.einsum("fgij,fgj->fgi", voigt.tensor(N @ stress[nodes]), n), N @ X[nodes]
        area = np.linalg.norm(n, axis=-1, keepdims=True)
        parts += np.concatenate([force, np.cross(place, force), place * area, n, area], -1).sum(axis=(0, 1))
    F, M, center, normal, area = np.split(parts, [3, 6, 9, 12])
    center, normal = center / area, normal / area
    moment = M - np.cross(center, F)
    tension, torque = F @ normal, moment @ normal
    shear, bending = np.linalg.norm([F - tension * normal, moment - torque * normal], axis=1)
    forces = [*area, tension, shear, torque, bending]
    tables: dict[str, Any] = {
        "total surface force (fx,fy,fz) and moment about the origin(mx,my,mz)": [*F, *M],
        "center of gravity and mean normal": [*center, *normal],
        "moment about the center of gravity(mx,my,mz)": moment,
        "area, normal force (+ = tension), shear force (size), torque and bending moment (size)": forces,
    }
    lines = ["", "", "", f" statistics for surface set {where} and time{fortran(time):>15}"]
    for title, values in tables.items():
        lines += ["", f"   {title}", "", "  " + "".join(f"{value:14.6E}" for value in values)]
    return lines


def frequencies(omega: Array, shapes: Array, M: Any, points: Array, free: Ints) -> list[str]:
    """Return the tables of modes: ω (k,) in rad/s, shapes (k, n, 3), M (3n, 3n), free degrees of freedom."""
    flat, axes, rigid = shapes.reshape(len(shapes), -1), np.eye(3)[:, None, :], np.zeros((6, points.size))
    motions = np.vstack([np.broadcast_to(axes, (3, *points.shape)), np.cross(axes, points)])
    rigid[:, free] = motions.reshape(6, -1)[:, free]
    masses = np.einsum("ki,ik->k", flat, M @ flat.T)
    factors = flat @ (M @ rigid.T) / np.sqrt(masses)[:, None]
    effective, total = [*factors**2, (factors**2).sum(axis=0)], np.einsum("ki,ik->k", rigid, M @ rigid.T)
    head = [
        " MODE NO    EIGENVALUE                       FREQUENCY   ",
        f"{'REAL PART':>46}{'IMAGINARY PART':>26}",
        f"{'(RAD/TIME)      (CYCLES/TIME     (RAD/TIME)':>70}",
    ]
    values = np.column_stack([omega**2, omega, omega / (2 * pi), 0 * omega])
    return [
        *_titled("E I G E N V A L U E   O U T P U T", head, values),
        *_titled("P A R T I C I P A T I O N   F A C T O R S", HEAD, factors),
        *_titled("E F F E C T I V E   M O D A L   M A S S", HEAD, effective, "TOTAL"),
        *_titled("T O T A L   E F F E C T I V E   M A S S", HEAD, [total], ""),
    ]


def buckling(factors: Array) -> list[str]:
    """Return the table of factors of buckling (k,)."""
    head = [" MODE NO       BUCKLING", f"{'FACTOR':>22}"]
    return _titled("B U C K L I N G   F A C T O R   O U T P U T", head, factors[:, None])


def mode(number: int) -> list[str]:
    """Return the head of the tables of a mode."""
    return ["", f"{'E I G E N V A L U E    N U M B E R':>54}{number:6d}", ""]


def _titled(title: str, head: list[str], table: Any, last: str | None = None) -> list[str]:
    """Return a table with numbered rows, or another name of the last one."""
    names = [f"{i:7d}" for i in range(1, len(table) + 1)]
    names[-1] = names[-1] if last is None else f"{last:7}"
    rows = [name + "".join(f"{fortran(v):>16}" for v in row) for name, row in zip(names, table, strict=True)]
    return ["", f"     {title}", "", *head, "", *rows]


def fortran(value: float, digits: int = 7) -> str:
    """Return a number with some digits in the format E of Fortran.

    >>> fortran(-12.5)
    '-0.1250000E+02'
    """
    mantissa, power = f"{abs(value):.{digits - 1}E}".split("E")
    exponent = int(power) + 1 if value else 0
    return f"{'-' if value < 0 else ''}0.{mantissa.replace('.', '')}E{exponent:+03d}"

"""Materials and sections of a deck."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import KratosLiteError
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.materials import Material
from kratos_lite.materials.anisotropic3d import Anisotropic3D
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.materials.orthotropic3d import Orthotropic3D
from kratos_lite.mesh import Mesh
from kratos_lite.model.local_axes import Cartesian, Cylindrical, LocalAxes
from kratos_lite.typing import Array, Ints

ELASTIC = {"ISO": 2, "ORTHO": 9, "ENGINEERINGCONSTANTS": 9, "ANISO": 21}
EXPANSION = {"ISO": 1, "ORTHO": 3, "ANISO": 6}
"""Types of cards and their numbers of constants."""
WIDTH = 8
"""Constants on a line at most."""
NO_COMPRESSIBILITY = 1e-10
"""Size of a D that counts as 0: CalculiX takes a Poisson's ratio of about 0.475 then."""


@dataclass
class Definition:
    """What the cards between *MATERIAL and the next other card say."""

    card: Card
    cards: dict[str, Card] = field(default_factory=dict)
    now: float | None = 0.0  # its temperature, and that at the beginning; None where there are several
    start: float | None = 0.0

    def constants(self, keyword: str, count: int) -> list[float]:
        """Return the constants of a card at the temperature, between lines for others."""
        card = self.cards[keyword]
        rows, height = list(card.rows()), -(-count // WIDTH)
        if not rows or len(rows) % height:
            card.wrong(f"{count} constants are needed, {WIDTH} on a line; got {len(rows)} lines")
        sizes = [min(count - WIDTH * i, WIDTH) for i in range(height)]
        lines = [row.numbers(sizes[i % height]) for i, row in enumerate(rows)]
        table = np.concatenate(lines).reshape(-1, count)
        if (table == table[0]).all():
            return table[0].tolist()
        if self.now is None:
            card.wrong("it depends on the temperature, which must be the same in the body and the step")
        at = [row.number(sizes[-1]) for row in rows[height - 1 :: height]]
        if (np.diff(at) <= 0).any():
            card.wrong(f"temperatures must ascend; got {', '.join(f'{T:g}' for T in at)}")
        return [float(np.interp(self.now, at, column)) for column in table.T]

    def typed(self, keyword: str, sizes: dict[str, int]) -> tuple[str, list[float]]:
        """Return the TYPE of a card, ISO by default, and its constants."""
        kind = self.cards[keyword].option("TYPE", "ISO").upper().replace(" ", "")
        known = [name for name in sizes if kind.startswith(name)]
        if not known:
            self.cards[keyword].wrong(f"TYPE={kind} is not supported; there are {', '.join(sizes)}")
        return known[0], self.constants(keyword, sizes[known[0]])


def material_of(definition: Definition, axes: LocalAxes | None, *, finite: bool) -> Material:
    """Return the law that a material is, along local axes; `finite` where displacements are large."""
    card = definition.card
    try:
        return _law(definition, axes, finite)
    except KratosLiteError as error:
        if card.file in str(error):
            raise
        card.wrong(str(error))


def _law(definition: Definition, axes: LocalAxes | None, finite: bool) -> Material:
    card, cards = definition.card, definition.cards
    density = definition.constants("DENSITY", 1)[0] if "DENSITY" in cards else 0.0
    if "HYPERELASTIC" in cards:
        if "EXPANSION" in cards:
            cards["EXPANSION"].wrong("rubber that temperatures strain is not supported")
        return _rubber(definition, density)
    if "ELASTIC" not in cards:
        card.wrong(f"material {card.option('NAME')} has no *ELASTIC; got {', '.join(cards) or 'no card'}")
    kind, constants = definition.typed("ELASTIC", ELASTIC)
    alpha = _expansion(definition)
    if kind == "ISO" and (alpha == alpha[0] * voigt.UNIT).all():
        E, nu = constants
        if "PLASTIC" not in cards:
            return Isotropic3D(E, nu, density, float(alpha[0]))
        return _plastic(cards["PLASTIC"], finite, E, nu, density, float(alpha[0]))
    if "PLASTIC" in cards:
        cards["PLASTIC"].wrong("it is supported with *ELASTIC and *EXPANSION of TYPE=ISO alone")
    law = Anisotropic3D(_elasticity(kind, constants), density, alpha)
    if axes is not None and not isinstance(axes, Cartesian):
        card.wrong("an *ORIENTATION of an anisotropic material must be SYSTEM=RECTANGULAR")
    return law if axes is None else law.turned(axes.directions(np.zeros(3)))


def _expansion(definition: Definition) -> Array:
    """Return the thermal strain (6,) in 1/K from the temperature at the beginning."""
    if "EXPANSION" not in definition.cards:
        return np.zeros(6)
    kind, given = definition.typed("EXPANSION", EXPANSION)
    now, start, card = definition.now, definition.start, definition.cards["EXPANSION"]
    if now is not None and start is not None and now != start:  # both strains count from ZERO
        zero = Row(card.place, (card.option("ZERO", "0"),)).number(0)
        first = replace(definition, now=start).typed("EXPANSION", EXPANSION)[1]
        strains = np.array(given) * (now - zero) - np.array(first) * (start - zero)
        given = (strains / (now - start)).tolist()
    given = 3 * given if kind == "ISO" else given
    return np.array([*given, 0.0, 0.0, 0.0])[voigt.ABAQUS] * voigt.SHEAR_TWICE


def _plastic(card: Card, finite: bool, E: float, nu: float, density: float, alpha: float) -> Material:
    """Return J2 plasticity with isotropic hardening by a curve, or kinematic one by one slope."""
    from kratos_lite.materials.finite_j2_plasticity3d import FiniteJ2Plasticity3D
    from kratos_lite.materials.j2_plasticity3d import J2Plasticity3D

    at = dict[float, list[tuple[float, float]]]()
    for row in card.rows():
        at.setdefault(row.number(2, 0.0), []).append((row.number(1), row.number(0)))
    curves = list(at.values())
    if any(curve != curves[0] for curve in curves):
        card.wrong("yield stresses that depend on the temperature are not supported; give them at one")
    if not curves or curves[0][0][0] != 0:
        card.wrong("the first line gives the yield stress at the plastic strain 0")
    (_, first), *curve = curves[0]
    kind = card.option("HARDENING", "ISOTROPIC").upper()
    if kind == "ISOTROPIC":
        law = FiniteJ2Plasticity3D if finite else J2Plasticity3D
        return law(E, nu, first, density=density, alpha=alpha, curve=curve)
    if finite:
        card.wrong("kinematic hardening with NLGEOM is not supported")
    if kind != "KINEMATIC" or len(curve) != 1 or curve[0][0] <= 0:
        card.wrong("HARDENING is ISOTROPIC, or KINEMATIC with two lines, which give its slope")
    slope = (curve[0][1] - first) / curve[0][0]
    return J2Plasticity3D(E, nu, first, kinematic=slope, density=density, alpha=alpha)


def _elasticity(kind: str, constants: list[float]) -> Array:
    """Return C (6, 6) of the types of *ELASTIC, xx yy zz xy yz zx."""
    if kind == "ISO":
        return Isotropic3D(constants[0], constants[1]).C
    if kind == "ENGINEERINGCONSTANTS":
        E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 = constants
        return Orthotropic3D(E1, E2, E3, nu12, nu23, nu13, G12, G23, G13).C
    C = np.zeros((6, 6))
    j, i = np.tril_indices(6)  # 1111, 1122, 2222, 1133, …
    used = range(21) if kind == "ANISO" else [0, 1, 2, 3, 4, 5, 9, 14, 20]
    C[i[used], j[used]] = C[j[used], i[used]] = constants
    return C[np.ix_(voigt.ABAQUS, voigt.ABAQUS)]


def _rubber(definition: Definition, density: float) -> Material:
    """Return the rubber of *HYPERELASTIC."""
    from kratos_lite.materials.mooney_rivlin3d import MooneyRivlin3D
    from kratos_lite.materials.ogden3d import Ogden3D

    card = definition.cards["HYPERELASTIC"]
    kinds, order = sorted(card.options.keys() - {"N"}), card.option("N", "1")
    if kinds == ["OGDEN"] and order in ("1", "2", "3"):
        n = int(order)
        constants = definition.constants(card.keyword, 3 * n)
        mu, alpha = np.reshape(constants[: 2 * n], (n, 2)).T
        if not alpha.all():
            card.wrong("the exponents alpha of OGDEN are not 0")
        bulk = _bulk(constants[2 * n :], mu.sum())
        terms = zip(("mu1", "mu2", "mu3"), (2 * mu / alpha).tolist(), strict=False)
        powers = zip(("alpha1", "alpha2", "alpha3"), alpha.tolist(), strict=False)
        volume = zip(("bulk", "bulk4", "bulk6"), (2 * bulk[0], *bulk[1:]), strict=False)
        return Ogden3D(**dict([*terms, *powers, *volume]), density=density)
    if kinds not in (["NEOHOOKE"], ["MOONEY-RIVLIN"]) or order != "1":
        card.wrong("it is supported with NEO HOOKE, MOONEY-RIVLIN or OGDEN, N=1 … 3")
    c10, *rest, D1 = definition.constants(card.keyword, 2 + (kinds == ["MOONEY-RIVLIN"]))
    c01 = sum(rest)
    return MooneyRivlin3D(c10, c01, 2 * _bulk([D1], 2 * (c10 + c01))[0], density)


def _bulk(D: list[float], shear: float) -> list[float]:
    """Return 1/D_i in Pa, the factors of (J - 1)^2i; D_i = 0 means (0.1 / shear)^i."""
    return [1 / d if abs(d) >= NO_COMPRESSIBILITY else (10 * shear) ** i for i, d in enumerate(D, 1)]


def orientation(card: Card) -> LocalAxes:
    """Return the axes of *ORIENTATION."""
    card.check_options(("NAME", "SYSTEM", "DEFINITION"))
    if card.option("DEFINITION", "COORDINATES").upper() != "COORDINATES":
        card.wrong("the axes are given by DEFINITION=COORDINATES alone")
    rows = list(card.rows())
    if len(rows) != 1:
        card.wrong("two points on one line give the axes; further rotations are not supported")
    return axes_of(rows[0], card.option("SYSTEM", "RECTANGULAR"))


def axes_of(row: Row, system: str) -> LocalAxes:
    """Return local axes by two points: on x and in the plane x y, or on the axis of a cylinder."""
    a, b = np.array(row.numbers(3)), np.array(row.numbers(3, 3))
    kind = system[:1].upper()
    if kind not in ("R", "C"):
        row.wrong(f"axes are RECTANGULAR or CYLINDRICAL; got {system}")
    return Cartesian(a, b) if kind == "R" else Cylindrical(a, b - a)


@dataclass
class Axes:
    """Local axes of nodes (*TRANSFORM)."""

    of_node: Ints  # index of `each`, or -1
    each: list[LocalAxes] = field(default_factory=list)

    def directions(self, mesh: Mesh, rows: Ints) -> Array:
        """Return the axes (m, 3, 3) of nodes."""
        out = np.broadcast_to(np.eye(3), (len(rows), 3, 3)).copy()
        for i, axes in enumerate(self.each):
            of = self.of_node[rows] == i
            out[of] = axes.directions(mesh.points[rows[of]])
        return out

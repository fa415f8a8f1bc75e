"""Materials and sections of a deck."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from kratos_lite.errors import KratosLiteError, nearest
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.materials import Material
from kratos_lite.materials.anisotropic3d import Anisotropic3D, turned
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.model.local_axes import Cartesian, Cylindrical, LocalAxes
from kratos_lite.typing import Array

OURS = [0, 1, 2, 3, 5, 4]
"""Where each of our components stands among those of a deck, 11 22 33 12 13 23."""


@dataclass
class Definition:
    """What the cards between *MATERIAL and the next other card say."""

    card: Card
    cards: dict[str, Card] = field(default_factory=dict)

    def row(self, keyword: str) -> Row | None:
        """Return the only line of a card, or None; more are values at other temperatures, refused."""
        if keyword not in self.cards:
            return None
        card = self.cards[keyword]
        rows = list(card.rows())
        if not rows:
            card.wrong("its data line is missing")
        if len(rows) > 1:
            rows[1].wrong(f"*{keyword} that depends on the temperature is not supported; give one line")
        return rows[0]

    def values(self, keyword: str, count: int) -> list[float]:
        """Return the numbers of a card of several lines."""
        card = self.cards[keyword]
        fields = [(row, i) for row in card.rows() for i in range(len(row.fields))][:count]
        if len(fields) < count:
            card.wrong(f"{count} constants are needed; got {len(fields)}")
        return [row.number(i) for row, i in fields]

    def number(self, keyword: str) -> float:
        """Return the number of a card, or 0 where there is none."""
        row = self.row(keyword)
        return row.number(0) if row else 0.0


def material_of(definition: Definition, axes: LocalAxes | None, *, finite: bool) -> Material:
    """Return the law that a material is, along local axes; `finite` where displacements are large."""
    card, cards = definition.card, definition.cards
    density = definition.number("DENSITY")
    try:
        if "HYPERELASTIC" in cards:
            return _rubber(definition, density)
        if "ELASTIC" not in cards:
            card.wrong(f"material {card.option('NAME')} has no *ELASTIC; got {', '.join(cards) or 'no card'}")
        kind = cards["ELASTIC"].option("TYPE", "ISO").upper().replace(" ", "")
        alpha = _expansion(definition)
        if kind in ("ISO", "ISOTROPIC") and alpha.ndim == 0:
            return _isotropic(definition, density, float(alpha), finite)
        if "PLASTIC" in cards or finite:
            cards["ELASTIC"].wrong("other than TYPE=ISO is solved with small displacements and no *PLASTIC")
        alpha = np.array([alpha] * 3 if alpha.ndim == 0 else alpha)
        law = Anisotropic3D(_elasticity(definition, kind), density, tuple(alpha))
        if axes is None:
            return law
        if not isinstance(axes, Cartesian):
            card.wrong("an *ORIENTATION of an anisotropic material must be SYSTEM=RECTANGULAR")
        return turned(law, axes.directions(np.zeros((1, 3)))[0])
    except KratosLiteError as error:
        card.wrong(str(error)) if card.file not in str(error) else None
        raise


def _expansion(definition: Definition) -> Array:
    """Return α, or α (3,) along the axes."""
    if "EXPANSION" not in definition.cards:
        return np.array(0.0)
    card, row = definition.cards["EXPANSION"], definition.row("EXPANSION")
    assert row is not None
    kind = card.option("TYPE", "ISO").upper()
    return np.array(row.numbers(3) if kind == "ORTHO" else row.number(0))


def _isotropic(definition: Definition, density: float, alpha: float, finite: bool) -> Material:
    row = definition.row("ELASTIC")
    assert row is not None
    E, nu = row.numbers(2)
    if "PLASTIC" not in definition.cards:
        if finite:
            from kratos_lite.materials.saint_venant_kirchhoff3d import SaintVenantKirchhoff3D

            return SaintVenantKirchhoff3D(E, nu, density, alpha)
        return Isotropic3D(E, nu, density, alpha)
    return _plastic(definition, E, nu, density, alpha)


def _plastic(definition: Definition, E: float, nu: float, density: float, alpha: float) -> Material:
    """Return J2 plasticity, whose curve is one line, or stays at its last stress."""
    from kratos_lite.materials.j2_plasticity3d import J2Plasticity3D

    card = definition.cards["PLASTIC"]
    rows = list(card.rows())
    curve = [row.numbers(2) for row in rows]
    if not curve or curve[0][1] != 0:
        card.wrong("the first line gives the yield stress at the plastic strain 0")
    slopes = [(b[0] - a[0]) / (b[1] - a[1]) if b[1] > a[1] else np.inf for a, b in pairwise(curve)]
    if slopes and np.ptp(slopes) > 1e-6 * max(map(abs, slopes)):
        card.wrong("a curve of more than one slope is not supported; give yield stress and one further line")
    kind = card.option("HARDENING", "ISOTROPIC").upper()
    known = {"ISOTROPIC": "hardening", "KINEMATIC": "kinematic"}
    if kind not in known:
        card.wrong(f"HARDENING={kind} is not supported; take ISOTROPIC or KINEMATIC")
    modulus = {known[kind]: float(slopes[0]) if slopes else 0.0}
    return J2Plasticity3D(E, nu, curve[0][0], **modulus, density=density, alpha=alpha)


def _elasticity(definition: Definition, kind: str) -> Array:
    """Return C (6, 6) of the types of *ELASTIC, xx yy zz xy yz zx."""
    C = np.zeros((6, 6))
    if kind == "ISO":
        row = definition.row("ELASTIC")
        assert row is not None
        return Isotropic3D(*row.numbers(2)).C
    if kind == "ENGINEERINGCONSTANTS":
        E1, E2, E3, nu12, nu13, nu23, *G = definition.values("ELASTIC", 9)
        C[:3, :3] = [[1 / E1, -nu12 / E1, -nu13 / E1], [-nu12 / E1, 1 / E2, -nu23 / E2],
                     [-nu13 / E1, -nu23 / E2, 1 / E3]]  # fmt: skip
        C[:3, :3] = np.linalg.inv(C[:3, :3])
        C[range(3, 6), range(3, 6)] = G
    elif kind in ("ORTHO", "ORTHOTROPIC"):
        D = definition.values("ELASTIC", 9)
        C[[0, 0, 1, 0, 1, 2, 3, 4, 5], [0, 1, 1, 2, 2, 2, 3, 4, 5]] = D
        C = np.triu(C) + np.triu(C, 1).T
    elif kind in ("ANISO", "ANISOTROPIC"):
        columns, rows = np.tril_indices(6)
        C[rows, columns] = definition.values("ELASTIC", 21)
        C = np.triu(C) + np.triu(C, 1).T
    else:
        known = ("ISO", "ENGINEERING CONSTANTS", "ORTHO", "ANISO")
        definition.cards["ELASTIC"].wrong(f"TYPE={kind} is not known.{nearest(kind, known)}")
    return C[np.ix_(OURS, OURS)]


def _rubber(definition: Definition, density: float) -> Material:
    """Return the rubber of *HYPERELASTIC."""
    from kratos_lite.materials.mooney_rivlin3d import MooneyRivlin3D
    from kratos_lite.materials.ogden3d import Ogden3D

    card = definition.cards["HYPERELASTIC"]
    kinds = set(card.options) - {"N"}
    order = int(card.option("N", "1"))
    if kinds <= {"NEOHOOKE"} and kinds:
        c10, D = definition.values("HYPERELASTIC", 2)
        return MooneyRivlin3D(c10, 0.0, 2 / D, density=density)
    if kinds == {"MOONEY-RIVLIN"}:
        c10, c01, D = definition.values("HYPERELASTIC", 3)
        return MooneyRivlin3D(c10, c01, 2 / D, density=density)
    if kinds == {"OGDEN"} and order <= 3:
        constants = definition.values("HYPERELASTIC", 3 * order)
        pairs = constants[: 2 * order]
        terms: dict[str, Any] = {f"mu{i + 1}": pairs[2 * i] for i in range(order)}
        terms |= {f"alpha{i + 1}": pairs[2 * i + 1] for i in range(order)}
        return Ogden3D(**terms, bulk=2 / constants[2 * order], density=density)
    card.wrong("it is supported with NEO HOOKE, MOONEY-RIVLIN or OGDEN, N=1 … 3")


def orientation(card: Card) -> LocalAxes:
    """Return the axes of *ORIENTATION."""
    card.check_options(("NAME", "SYSTEM"))
    rows = list(card.rows())
    if len(rows) != 1:
        card.wrong("two points on one line give the axes; further rotations are not supported")
    return axes_of(rows[0], card.option("SYSTEM", "RECTANGULAR"))


def axes_of(row: Row, system: str) -> LocalAxes:
    """Return local axes by two points: on x and in the plane x y, or on the axis of a cylinder."""
    a, b = np.array(row.numbers(3)), np.array(row.numbers(3, 3))
    make: dict[str, Callable[[], LocalAxes]] = {
        "R": lambda: Cartesian(a, b),
        "C": lambda: Cylindrical(a, b - a),
    }
    if system[:1].upper() not in make:
        row.wrong(f"axes are RECTANGULAR or CYLINDRICAL; got {system}")
    return make[system[0].upper()]()

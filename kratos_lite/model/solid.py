"""Solid: a mesh whose elements have a material, a quadrature rule and an initial stress."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.element_groups import (
    ElementGroup,
    element_class,
    element_groups_of,
)
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.formulations import (
    NON_LOCKING,
    checked_formulation,
    is_nearly_incompressible,
    is_unnamed,
)
from kratos_lite.errors import InputError
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Mesh, WhereElements
from kratos_lite.model import checks
from kratos_lite.quadrature import Rule
from kratos_lite.typing import Array
from kratos_lite.validation import finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Solid:
    """What the stress of a strained mesh follows from; it knows neither supports nor loads.

    Parameters
    ----------
    mesh : points, elements and named parts.
    material : one material for all elements, or materials by part name or property id.
    formulation : of the elements, in place of what their names in the mesh say; see `formulation`.

    Raises
    ------
    InputError
        `mesh` is not a Mesh, `material` not a material, or an element of the mesh has no such formulation.
    MeshError
        A part or property of `material` does not exist.
    """

    def __init__(
        self,
        mesh: Mesh,
        material: LinearMaterial | Mapping[Any, LinearMaterial] | None = None,
        formulation: str | None = None,
    ) -> None:
        self._mesh = checks.checked_mesh(mesh)
        self._formulation: str | None = None
        self._materials: list[LinearMaterial] = []
        self._material_of = np.full(mesh.n_elements, -1)
        self._rules: dict[int, Rule | int] = {}
        self._rule_of = np.full(mesh.n_elements, -1)
        self._initial_displacement: Array | None = None
        self._prestress: Array | None = None
        self._changes = 0
        self.formulation = formulation
        if isinstance(material, Mapping):
            for where, one in material.items():
                self.assign(one, where)
        elif material is not None:
            self.assign(material)

    @property
    def mesh(self) -> Mesh:
        """Points, elements and named parts, which do not change."""
        return self._mesh

    @property
    def formulation(self) -> str | None:
        """Formulation of the elements, or None: their names in the mesh say it.

        ``standard``, ``enhanced``, ``b_bar``, ``reduced``, or ``non_locking``: that of each shape which does
        not lock with its material.  Elements have the last whose names say only the number of nodes, such as
        ``Element3D8N``.  Elements of users keep theirs.
        """
        return self._formulation

    @formulation.setter
    def formulation(self, word: str | None) -> None:
        if word is not None:
            checked_formulation(word)
            for block in self.mesh.blocks:
                if len(block) and block.name in ELEMENTS:
                    element_class(self.mesh, block, word)
        self._formulation = word
        self._changes += 1

    def assign(self, material: LinearMaterial, where: WhereElements = None) -> None:
        """Give elements a material.

        Parameters
        ----------
        material : such as `Isotropic3D`.
        where : elements by part name, property id or rows; all if not given.

        Raises
        ------
        InputError
            `material` is not a material.
        MeshError
            There is no such part, property or element.
        """
        checks.checked_material(material)
        rows = self.mesh.elements(where)
        self._materials.append(material)
        self._material_of[rows] = len(self._materials) - 1
        self._changes += 1

    @property
    def has_own_rules(self) -> bool:
        """Whether any element has another quadrature rule than that of its class."""
        return bool((self._rule_of >= 0).any())

    def use_rule(self, rule: Rule | int, where: WhereElements = None) -> None:
        """Replace the quadrature rule of elements.

        Parameters
        ----------
        rule : a Rule, or an INTEGRATION_ORDER 1 … 5 of Kratos.
        where : elements by part name, property id or rows; all if not given.

        Raises
        ------
        InputError
            `rule` is invalid.
        MeshError
            There is no such part, property or element.
        """
        if isinstance(rule, bool) or not isinstance(rule, (int, Rule)):
            raise InputError(f"a Rule or an INTEGRATION_ORDER 1 … 5 is needed; got {rule!r}")
        number = len(self._rules)
        self._rules[number] = rule
        self._rule_of[self.mesh.elements(where)] = number
        self._changes += 1

    def element_groups(self, unnamed: str = NON_LOCKING) -> list[ElementGroup]:
        """Return the elements grouped by kind, rule and material.

        Parameters
        ----------
        unnamed : formulation of elements whose names in the mesh say none.

        Returns
        -------
        The groups.

        Raises
        ------
        ModelError
            An element has no material, or there are no elements.
        InputError
            An element has an unknown kind, or a rule does not fit it.
        """
        return element_groups_of(
            self.mesh,
            self._materials,
            self._material_of,
            self._rules,
            self._rule_of,
            self.prestress,
            self.formulation,
            unnamed,
        )

    def chosen(self, groups: Sequence[ElementGroup] = ()) -> str:
        """Return which formulation was chosen and why, in one line; "" where names of elements say it.

        Parameters
        ----------
        groups : of `element_groups`.

        Returns
        -------
        Such as ``non_locking, as the mesh names none: EnhancedStrain3D8N``.
        """
        found = dict.fromkeys(_kind(group) for group in groups)
        unnamed = any(is_unnamed(block.name) for block in self.mesh.blocks if len(block))
        if self.formulation is None and not unnamed:
            return ""
        why = "as the mesh names none" if self.formulation is None else "as asked for"
        kinds = f": {', '.join(found)}" if found else ""
        return f"{self.formulation or NON_LOCKING}, {why}{kinds}"

    # ---- initial stress -----------------------------------------------------------------------

    @property
    def initial_displacement(self) -> Array | None:
        """Displacement (n, 3) in m without stress, read-only, or None; see `stress_free_at`."""
        return self._initial_displacement

    @property
    def prestress(self) -> Array | None:
        """Stress (m, 6) in Pa of unstrained elements, tension positive, or None; see `add_prestress`."""
        return self._prestress

    def stress_free_at(self, displacement: ArrayLike) -> None:
        """Make the body stress-free at a displacement u0: strain comes from u - u0.

        Parameters
        ----------
        displacement : (n, 3) m.

        Raises
        ------
        InputError
            It has another shape, or is not finite.
        """
        u0 = finite(displacement, "the initial displacement", self.mesh.points.shape)
        u0.flags.writeable = False
        self._initial_displacement = u0
        self._changes += 1

    def add_prestress(self, stress: ArrayLike, where: WhereElements = None) -> None:
        """Add a stress that elements carry before they are strained: σ = C ε + stress, tension positive.

        PRESTRESS and INSITU_STRESS in files of Kratos have the opposite sign: σ = C ε - PRESTRESS.

        Parameters
        ----------
        stress : (6,) or (m, 6) Pa, in the order xx yy zz xy yz zx.
        where : m elements by part name, property id or rows; all if not given.

        Raises
        ------
        InputError
            It has another shape, or is not finite.
        MeshError
            There is no such part, property or element.
        """
        s, rows = finite(stress, "a prestress"), self.mesh.elements(where)
        if s.shape not in ((6,), (len(rows), 6)):
            raise InputError(
                f"a prestress has six components xx yy zz xy yz zx, or shape ({len(rows)}, 6); "
                f"got shape {s.shape}"
            )
        total = np.zeros((self.mesh.n_elements, 6)) if self._prestress is None else self._prestress.copy()
        total[rows] += s
        total.flags.writeable = False
        self._prestress = total
        self._changes += 1

    def check_geometry(self) -> list[str]:
        """Check coordinates, node lists and det J of all elements, whatever their material.

        Returns
        -------
        Warnings, one sentence each.

        Raises
        ------
        MeshError, InputError
            With every element that is wrong.
        """
        return checks.check_geometry(self.mesh, self.formulation)


def _kind(group: ElementGroup) -> str:
    """Return the name of the element of a group, with its material where that decides about it."""
    name = group.element.__name__
    return f"{name} for {group.material}" if is_nearly_incompressible(group.material.C) else name

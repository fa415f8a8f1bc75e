"""Solid: a mesh with the materials, quadrature rules and initial stress of its elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, element_class, element_groups_of
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.formulations import (
    NON_LOCKING,
    checked_formulation,
    is_nearly_incompressible,
    is_unnamed,
)
from kratos_lite.errors import InputError, ModelError
from kratos_lite.materials import Material
from kratos_lite.mesh import Mesh, WhereElements, distinct
from kratos_lite.model import checks
from kratos_lite.quadrature import Rule
from kratos_lite.tabular import Tabular
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import finite, instance


class Solid(Tabular):
    """A mesh whose elements have materials, rules and initial stress; `Structure` adds supports and loads."""

    def __init__(
        self,
        mesh: Mesh,
        material: Material | Mapping[Any, Material] | None = None,
        formulation: str | None = None,
        units: str | None = None,
    ) -> None:
        self._mesh = instance(mesh, "a mesh", Mesh, "kl.box()")
        if units is not None:
            mesh.use_units(units)
        self._materials: list[Material] = []
        self._material_of = np.full(mesh.n_elements, -1)
        self._rules: dict[int, Rule | int] = {}
        self._rule_of = np.full(mesh.n_elements, -1)
        self._initial_displacement: Array | None = None
        self._prestress: Array | None = None
        self._factors: Array | None = None
        self._changes = 0
        self.formulation = formulation
        if isinstance(material, Mapping):
            for where, assigned in material.items():
                self.assign(assigned, where)
        elif material is not None:
            self.assign(material)

    # ---- elements and materials ---------------------------------------------------------------

    @property
    def units(self) -> str:  # type: ignore[override]
        """Set of units of the mesh, which all numbers are in."""
        return self.mesh.units

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

    def assign(self, material: Material, where: WhereElements = None) -> None:
        """Give elements a material.

        Parameters
        ----------
        material : such as `Isotropic3D`.
        where : elements by part name, property id or indices; all if not given.

        Raises
        ------
        InputError
            `material` is not a material.
        MeshError
            There is no such part, property or element.
        """
        checks.checked_material(material)
        elements = self.mesh.elements(where)
        self._materials.append(material)
        self._material_of[elements] = len(self._materials) - 1
        self._changes += 1

    @property
    def stiffness_factors(self) -> Array | None:
        """Factors (m,) of the stiffness of elements, read-only, or None; see `scale_stiffness`."""
        return self._factors

    def scale_stiffness(self, factors: ArrayLike, where: WhereElements = None) -> None:
        """Multiply the stiffness of each element by a factor of its own: σ = factor · C ε + prestress.

        Density stays.  `Result.gradient` has the derivative by these factors.  Recovered stresses, those at
        nodes, are smooth across them: where stresses jump, give each part a material of its own.

        Parameters
        ----------
        factors : > 0, one or (m,); they replace earlier ones, 1 for none.
        where : m elements by part name, property id or indices; all if not given.

        Raises
        ------
        InputError
            A factor is not > 0, or they have another shape.
        MeshError
            There is no such part, property or element.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((2, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("x-")
        >>> bar.add(kl.Traction("x+", (10.0, 0, 0)))
        >>> bar.scale_stiffness([1.0, 0.5])
        >>> bar.solve().displacement("x+")[:, 0].round(9).tolist()
        [3e-05, 3e-05, 3e-05, 3e-05]
        """
        values, elements = finite(factors, "factors of the stiffness"), self.mesh.elements(where)
        if values.shape not in ((), (len(elements),)) or not (values > 0).all():
            given = f"shape {values.shape} from {values.min(initial=np.inf):g}"
            raise InputError(f"factors of the stiffness are > 0, one or ({len(elements)},); got {given}")
        every = np.ones(self.mesh.n_elements) if self._factors is None else self._factors.copy()
        every[elements] = values
        every.flags.writeable = False
        self._factors = None if (every == 1).all() else every
        self._changes += 1

    @property
    def is_nonlinear(self) -> bool:
        """Whether a law is not linear, or an element has large displacements."""
        laws = self._used_materials()
        small = all(law.is_linear and law.strain_measure == "small" for law in laws)
        return not small or self._has_large_displacements

    @property
    def _has_large_displacements(self) -> bool:
        """Whether an element has them."""
        if self.formulation is not None:
            return self.formulation in ("total_lagrangian", "f_bar")
        return any(len(b) and b.name in ELEMENTS and ELEMENTS[b.name].finite for b in self.mesh.blocks)

    def require_linear(self, what: str) -> None:
        """Refuse laws and displacements that are not linear.

        Parameters
        ----------
        what : needs them linear; the error begins with it.

        Raises
        ------
        ModelError
            A law is not linear, or an element has large displacements.
        """
        if self.is_nonlinear:
            laws = {type(law).__name__ for law in self._used_materials() if not law.is_linear}
            large = "large displacements" if self._has_large_displacements else "a load that follows the body"
            raise ModelError(
                f"{what} takes linear laws and small displacements; got {', '.join(sorted(laws)) or large}; "
                "take model.solve() or model.quasi_static() of the model as it is"
            )

    @property
    def has_own_rules(self) -> bool:
        """Whether any element has another quadrature rule than that of its class."""
        return bool((self._rule_of >= 0).any())

    def use_rule(self, rule: Rule | int, where: WhereElements = None) -> None:
        """Replace the quadrature rule of elements.

        Parameters
        ----------
        rule : a Rule, or an INTEGRATION_ORDER 1 … 5 of Kratos.
        where : elements by part name, property id or indices; all if not given.

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
        """Return the elements grouped by type, rule and material.

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
            An element has an unknown type, or a rule does not fit it.
        """
        return element_groups_of(
            self.mesh,
            self._materials,
            self._material_of,
            self._rules,
            self._rule_of,
            self.prestress,
            self.stiffness_factors,
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
        names = dict.fromkeys(_element_name(group) for group in groups)
        unnamed = any(is_unnamed(block.name) for block in self.mesh.blocks if len(block))
        if self.formulation is None and not unnamed:
            return ""
        why = "as the mesh names none" if self.formulation is None else "as requested"
        elements = f": {', '.join(names)}" if names else ""
        return f"{self.formulation or NON_LOCKING}, {why}{elements}"

    # ---- initial stress -----------------------------------------------------------------------

    @property
    def initial_displacement(self) -> Array | None:
        """Displacement (n, 3) in m without stress, read-only, or None; see `set_stress_free_state`."""
        return self._initial_displacement

    @property
    def prestress(self) -> Array | None:
        """Stress (m, 6) in Pa of unstrained elements, tension positive, or None; see `add_prestress`."""
        return self._prestress

    def set_stress_free_state(self, displacement: ArrayLike) -> None:
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
        where : m elements by part name, property id or indices; all if not given.

        Raises
        ------
        InputError
            It has another shape, or is not finite.
        MeshError
            There is no such part, property or element.
        """
        s, elements = finite(stress, "a prestress"), self.mesh.elements(where)
        if s.shape not in ((6,), (len(elements), 6)):
            raise InputError(
                f"a prestress has six components xx yy zz xy yz zx, or shape ({len(elements)}, 6); "
                f"got shape {s.shape}"
            )
        total = np.zeros((self.mesh.n_elements, 6)) if self._prestress is None else self._prestress.copy()
        total[elements] += s
        total.flags.writeable = False
        self._prestress = total
        self._changes += 1

    def _used_materials(self) -> list[Material]:
        used = distinct(self._material_of)
        return [self._materials[i] for i in used[used >= 0]]


def _element_name(group: ElementGroup) -> str:
    """Return the name of the element of a group, with its material where that decides about it."""
    name = group.element.__name__
    return f"{name} for {group.material}" if is_nearly_incompressible(group.material.C) else name

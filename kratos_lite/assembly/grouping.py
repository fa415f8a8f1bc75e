"""Grouping: the elements of a mesh as groups of one kind, rule and material."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements import ELEMENTS, KinematicLinear
from kratos_lite.errors import InputError, ModelError
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Block, Mesh, with_rows
from kratos_lite.quadrature import Rule, by_order
from kratos_lite.typing import Ints


def element_groups_of(
    mesh: Mesh,
    materials: Sequence[LinearMaterial],
    material_of: Ints | None = None,
    rules: Mapping[int, Rule | int] | None = None,
    rule_of: Ints | None = None,
    prestress: NDArray[np.float64] | None = None,
) -> list[ElementGroup]:
    """Return the elements of a mesh grouped by kind, rule and material.

    Parameters
    ----------
    mesh : the elements.
    materials : all materials.
    material_of : (m,) number of the material of each element, -1 for none; the first for all if not given.
    rules : rules or orders of integration 1 … 5 that replace those of the elements, by number.
    rule_of : (m,) number of the rule of each element, -1 for its own; its own for all if not given.
    prestress : (m, 6) Pa.

    Raises
    ------
    ModelError, InputError
        For elements without material, unknown kinds, and rules that do not fit; and if there are no elements.

    Examples
    --------
    >>> from kratos_lite import Isotropic3D, box
    >>> [len(group) for group in element_groups_of(box(cells=(2, 2, 2)), [Isotropic3D(E=1e9, nu=0.3)])]
    [8]
    """
    m, found = mesh.n_elements, []
    material_of = np.zeros(m, dtype=np.int64) if material_of is None else material_of
    rule_of = np.full(m, -1) if rule_of is None else rule_of
    for block, at in with_rows(mesh.blocks):
        if not len(block):
            continue
        element = element_class(mesh, block)
        for material, rule, mine in _alike(mesh, block, material_of[at], rule_of[at]):
            rows = at.start + mine
            chosen = _rule(element, rules[rule]) if rules and rule >= 0 else element.rule
            nodes = block.nodes if len(mine) == len(block) else block.nodes[mine]
            stress = None if prestress is None else prestress[rows]
            found.append(ElementGroup(element, chosen, materials[material], nodes, rows, stress))
    if not found:
        raise ModelError("the model has no elements; nothing can be solved")
    return found


def _alike(mesh: Mesh, block: Block, material: Ints, rule: Ints) -> list[tuple[int, int, Ints]]:
    """Return number of material, number of rule and cells of each group in a block."""
    if material.min() < 0:
        e = int(np.argmax(material < 0))
        raise ModelError(
            f"{mesh.place(block, e)} has no material (property {block.properties[e]}); "
            "give one with Model(mesh, material), model.assign or --material"
        )
    if material.min() == material.max() and rule.min() == rule.max():
        return [(int(material[0]), int(rule[0]), np.arange(len(block)))]
    code = material * (int(rule.max()) + 2) + rule
    order = np.argsort(code, kind="stable")
    alike = np.split(order, np.flatnonzero(np.diff(code[order])) + 1)
    return [(int(material[mine[0]]), int(rule[mine[0]]), mine) for mine in alike]


def _rule(element: type[KinematicLinear], chosen: Rule | int) -> Rule:
    """Return a rule or an order of integration as a rule that fits an element."""
    rule = by_order(element.shape.cell, chosen) if isinstance(chosen, int) else chosen
    if abs(rule.weights.sum() / element.rule.weights.sum() - 1) > 1e-9:
        raise InputError(f"{rule} does not fit {element.__name__}: its weights miss the volume of the cell")
    return rule


def element_class(mesh: Mesh, block: Block) -> Any:
    """Return the element class of a block; raise InputError for unknown kinds."""
    if block.name not in ELEMENTS:
        try:
            ELEMENTS[block.name]
        except InputError as error:
            raise InputError(f"{mesh.place(block, 0)}: {error}") from None
    return ELEMENTS[block.name]

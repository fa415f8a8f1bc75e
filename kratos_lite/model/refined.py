"""Refined: a structure on a finer mesh, with the same materials, supports and loads."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TypeVar

import numpy as np

from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh.refined_mesh import RefinedMesh
from kratos_lite.model.structure import Structure
from kratos_lite.model.supports import DirichletCondition
from kratos_lite.quadrature import Rule

S = TypeVar("S", bound=Structure)


def refined(structure: S, finer: RefinedMesh) -> S:
    """Return a structure on a finer mesh; what nodes have is interpolated, forces on nodes stay there."""
    if structure.motion is not None:
        raise ModelError(
            "a model whose material moves through the mesh cannot be carried over to a finer one"
        )
    new = copy(structure)  # a class of a user may have a constructor of its own
    Structure.__init__(new, finer.mesh, units=structure.units)
    try:
        new.formulation = structure.formulation
    except InputError:
        new.formulation = None  # of linear elements, which have become quadratic ones
    new._materials = list(structure._materials)
    new._material_of = structure._material_of[finer.elements]
    _carry_rules(structure, new, finer)
    if structure.initial_displacement is not None:
        new.set_stress_free_state(finer.interpolate(structure.initial_displacement))
    if structure.stiffness_factors is not None:
        new.scale_stiffness(structure.stiffness_factors[finer.elements])
    if structure.prestress is not None:
        new.add_prestress(structure.prestress[finer.elements])
    for condition in structure.supports.conditions:
        new.supports.add(_refined_condition(condition, finer))
    _carry_constraints(structure, new, finer)
    for tie in structure.supports.ties:
        new.supports.add_tie(tie.refined(finer, new.supports))
    for attachment in structure.attachments:
        new.add(attachment.refined(finer, structure.remote_points, new.remote_points))
    new.loads = [load.refined(finer) for load in structure.loads]
    finer_of = {id(load): one for load, one in zip(structure.loads, new.loads, strict=True)}
    new._named = {name: finer_of[id(load)] for name, load in structure.named_loads.items()}
    new.notes = list(structure.notes)
    return new


def _carry_rules(structure: Structure, new: Structure, finer: RefinedMesh) -> None:
    """Give elements the rules of those that they have come from; refuse those of another shape."""
    rule_of = structure._rule_of[finer.elements]
    new._rules, new._rule_of = dict(structure._rules), rule_of
    if (rule_of < 0).all():
        return
    shapes = [
        np.concatenate([np.full(len(b), hash(b.shape)) for b in mesh.blocks])
        for mesh in (finer.coarse, finer.mesh)
    ]
    fixed = [number for number, rule in structure._rules.items() if isinstance(rule, Rule)]
    if (np.isin(rule_of, fixed) & (shapes[0][finer.elements] != shapes[1])).any():
        raise ModelError(
            "a quadrature rule that replaces that of elements does not fit those of another shape"
        )


def _refined_condition(condition: DirichletCondition, finer: RefinedMesh) -> DirichletCondition:
    """Return what a Dirichlet condition means on the finer mesh."""
    where, value = finer.where(condition.where), condition.value
    nodes = finer.mesh.nodes(where)
    if condition.field is not None or callable(value) or np.ndim(value) < 2:
        return replace(condition, where=where, nodes=nodes, override=True)
    nodal = np.full((finer.coarse.n_nodes, np.shape(value)[1]), np.nan)
    nodal[condition.nodes] = value
    nodal = finer.interpolate(nodal)[nodes]
    known = ~np.isnan(nodal).any(axis=1)
    return replace(condition, where=where, nodes=nodes[known], value=nodal[known], override=True)


def _carry_constraints(structure: Structure, new: Structure, finer: RefinedMesh) -> None:
    """Carry over constraints of nodes; refuse those that tie edges on which new nodes lie."""
    own = structure.supports.added
    if not len(own):
        return
    tied = np.unique(own.dependents // 3)
    if len(finer.refined_nodes(tied)) > len(tied):
        raise ModelError(
            f"{len(own)} constraints tie nodes of edges that are cut, but not their new nodes; constrain "
            "a finer mesh instead"
        )
    new.supports.add_constraints(own)

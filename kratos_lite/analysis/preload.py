"""What the stress of a preload adds to the stiffness of a model: K_g = ∫ grad N·σ grad N dV."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.quasi_static import assembly_of
from kratos_lite.analysis.result import Result
from kratos_lite.analysis.static import StaticAnalysis
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.stiffness import stress_stiffness
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model.loads import Load
from kratos_lite.solvers.constrained_system import renumber
from kratos_lite.solvers.tangents import turned

Preload: TypeAlias = "Result | Load | Sequence[Load] | Literal[True]"
"""A result, loads of which one is made, or True for those of the model."""


def preload_stiffness(e: EquationsOfMotion, preload: Preload, what: str) -> tuple[BlockMatrix, float]:
    """Return K_g (3a, 3a) in N/m of the stress of a preload, and the mean of its strains.

    What needs it is named in errors.
    """
    model, result = e.model, preload
    model.require_linear(what)
    if model.motion is not None:
        raise ModelError(f"{what} takes no motion of the material; take a model without it")
    if not isinstance(result, Result):
        result = StaticAnalysis(model, progress=e.system.progress).solve(None if result is True else result)
    if result.mesh is not model.mesh or not all(group.is_linear for group in result.groups):
        raise InputError("a preload must be a linear result on the mesh of the model; got another one")
    nodes, groups = renumber(model.mesh.points, result.groups)
    pattern = model.patterns.get(len(nodes), [group.nodes for group in groups])
    data = stress_stiffness(model.mesh.points, result.groups, pattern, result.stress_in)
    if not data.any():
        raise ModelError("the preload makes no stress; add loads, or displace supports")
    matrix = BlockMatrix(np.zeros((len(data), 3, 3)), pattern.indices, pattern.indptr)
    matrix.add_scalar(data)
    strains = [result.stress_in(g).reshape(-1, 6) @ np.linalg.inv(g.material.C).T for g in result.groups]
    return matrix, float(np.sqrt((np.concatenate(strains) ** 2).sum(axis=1).mean()))


def tangent_beyond_rest(e: EquationsOfMotion, result: Result) -> BlockMatrix:
    """Return what the tangent (3a, 3a) at a nonlinear result, also of its loads, has beyond that at rest."""
    states, assembly = [g.states for g in result.groups], assembly_of(e.model, e.system)
    fits = result.mesh is e.model.mesh and len(states) == len(assembly.groups)
    if not fits or any(
        s.variables if s else s is not t for s, t in zip(states, assembly.start(), strict=True)
    ):
        raise InputError("a preload must be a result of this model, of laws without history; got another one")
    u = e.system.gather(result.u)
    tangent = assembly.evaluate(u, states, 0.0, [g.heating for g in result.groups])[1]
    assert tangent is not None
    data = tangent.data - e.system.assembled().data
    _, following = e.applied.following(result.report.steps[-1].time, u)
    e.system.pattern.add_tangents(data, [(nodes, -(k + turned(k)) / 2) for nodes, k in following])
    return BlockMatrix(data, tangent.indices, tangent.indptr)

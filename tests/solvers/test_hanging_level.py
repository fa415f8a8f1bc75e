"""The linear level within quadratic elements with hanging nodes: a subspace, and its energy."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.assembly.gauss_point_fields import totals
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined
from kratos_lite.solvers.coarse_level import p_coarse_level
from kratos_lite.verification.meshes import warped


def corner_model(element, times=3):
    """A block whose cells at one corner are cut again and again."""
    model = kl.Model(kl.box(cells=(3, 3, 3), element=element), kl.Isotropic3D(E=1e6, nu=0.3))
    model.fix("z-")
    model.add(kl.Traction("z+", (1.0, 2.0, 3.0)))
    for _ in range(times):
        X = model.mesh.points
        near = [np.abs(X[nodes]).sum(axis=2).min() < 1e-9 for nodes in model.mesh.blocks[0].nodes[:, None]]
        model = refined(model, refine(model.mesh, np.array(near)))
    return model


@pytest.mark.parametrize("element", ["KinematicLinear3D20N", "KinematicLinear3D27N", "KinematicLinear3D10N"])
def test_its_fields_are_linear_continuous_and_have_their_energy(element):
    if element.endswith("10N"):
        mesh = refine(warped("10N", 2, amount=0.0), [0, 7]).mesh
        model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.3))
    else:
        model = corner_model(element, 2)
    mesh, groups = model.mesh, model.element_groups()
    level = p_coarse_level(mesh.points, groups, mesh.hanging)
    P = np.zeros((mesh.n_nodes, len(level.nodes)))
    rows = np.repeat(np.arange(mesh.n_nodes), np.diff(level.indptr))
    np.add.at(P, (rows, level.indices), level.weights)
    assert np.abs(P[level.nodes] - np.eye(len(level.nodes))).max() == 0
    linear = mesh.points @ np.array([1.0, -2.0, 3.0])
    assert np.abs(P @ linear[level.nodes] - linear).max() < 1e-12
    v = np.random.default_rng(0).normal(size=(len(level.nodes), 3))
    fine = P @ v
    assert np.abs(mesh.hanging.interpolate(fine) - fine).max() < 1e-12
    energy = 2 * totals(mesh.points, groups, fine)[0]
    assert abs(v.ravel() @ (level.K @ v.ravel()) / energy - 1) < 1e-12


def test_multigrid_needs_few_iterations_with_hanging_nodes():
    result = corner_model("KinematicLinear3D20N").solve(solver="amg")
    assert result.report.solver == "amg"
    assert result.report.iterations < 40  # to rounding; 56 where the linear level comes apart

"""Solutions that begin at a given displacement: the same result, fewer iterations."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined


def model(hanging):
    made = kl.Model(
        kl.box(cells=(4, 4, 4), element="KinematicLinear3D20N"), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
    )
    made.fix("z-", value=(0.0, 0.0, 0.1))
    made.fix("z+", "x", value=0.2)
    made.add(kl.Gravity((1.0, 0.0, -9.81)))
    return refined(made, refine(made.mesh, [0, 63])) if hanging else made


@pytest.mark.parametrize("hanging", [False, True])
@pytest.mark.parametrize("solver", ["amg", "direct"])
def test_it_is_the_same_solution_with_fewer_iterations(hanging, solver):
    analysis = model(hanging).static(solver=solver)
    cold = analysis.solve()
    near = cold.u * (1 + 1e-6 * np.sin(np.arange(3)))
    warm = analysis.solve(start=near)
    assert np.abs(warm.u - cold.u).max() < 1e-8 * np.abs(cold.u).max()  # they start 1e-6 apart
    assert warm.report.backward_error < 1e-10
    if solver == "amg":
        assert 0 < warm.report.iterations < 0.7 * cold.report.iterations
        assert analysis.solve(start=warm.u, tolerance=1e-6).report.iterations == 0


def test_a_start_that_is_far_away_does_no_harm():
    analysis = model(False).static(solver="amg")
    cold = analysis.solve()
    far = analysis.solve(start=np.full(cold.u.shape, 1e6))
    assert np.abs(far.u - cold.u).max() < 1e-8 * np.abs(cold.u).max()  # they start 1e-6 apart


def test_a_rough_tolerance_is_met_and_takes_fewer_iterations():
    analysis = model(False).static(solver="amg")
    cold = analysis.solve()
    rough = analysis.solve(start=0.9 * cold.u, tolerance=1e-3)
    assert rough.report.iterations < cold.report.iterations / 1.5
    assert 1e-9 < np.abs(rough.u - cold.u).max() / np.abs(cold.u).max() < 1e-2


@pytest.mark.parametrize("start", [np.zeros((3, 3)), "u", np.full((425, 3), np.nan)])
def test_a_start_of_the_wrong_kind_is_refused(start):
    with pytest.raises(kl.InputError, match="start"):
        model(False).static().solve(start=start)


@pytest.mark.parametrize("tolerance", [0.0, 2.0, "1e-3", True])
def test_a_tolerance_beyond_0_and_1_is_refused(tolerance):
    with pytest.raises(kl.InputError, match="tolerance must be a number between 0 and 1"):
        model(False).static().solve(tolerance=tolerance)

"""Multigrid on stretched meshes, thin plates and unlike materials: iterations and exactness."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.native import kernels
from kratos_lite.solvers import equations
from kratos_lite.solvers.multigrid import Compiled

pytestmark = pytest.mark.skipif(kernels("multigrid") is None, reason="multigrid is not compiled")
LIMIT = 60
CELLS = {"4N": (11, 11, 11), "8N": (11, 11, 11), "10N": (5, 5, 5), "20N": (6, 6, 6), "27N": (5, 5, 5)}


def body(element, size, side, cells=None, contrast=None):
    """Return a box under its own weight, which acts in no special direction, clamped at a side."""
    mesh = kl.box(size, cells or CELLS[element], f"KinematicLinear3D{element}")
    model = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    if contrast:
        centers = np.vstack([mesh.points[b.nodes].mean(axis=1) for b in mesh.blocks]) / size
        model.assign(kl.Isotropic3D(E=1e3, nu=0.3, density=1000.0), np.flatnonzero(contrast(centers)))
    if side == "rollers":
        for face, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
            model.fix(face, axis)
    else:
        model.fix(side)
    model.add(kl.Gravity((3.0, 4.0, -9.0)))
    return model


def check(model, rtol=1e-8):
    found, exact = model.solve("amg"), model.solve("direct")
    assert found.report.solver == "amg", found.report.reason
    assert found.report.iterations < LIMIT
    np.testing.assert_allclose(found.u, exact.u, rtol=0, atol=rtol * np.abs(exact.u).max())


@pytest.fixture(autouse=True)
def to_the_tolerance(monkeypatch):
    """Few unknowns are iterated to round-off otherwise, like a factorisation."""
    monkeypatch.setattr(equations, "ROUND_OFF", 1e-10)


@pytest.mark.parametrize("element", CELLS)
@pytest.mark.parametrize("aspect", [10, 100, 1000])
def test_flat_elements(element, aspect):
    check(body(element, (1.0, 1.0, 1.0 / aspect), "z-"))


@pytest.mark.parametrize("element", CELLS)
def test_flat_elements_clamped_at_their_edge(element):
    check(body(element, (1.0, 1.0, 0.1), "x-"))


@pytest.mark.parametrize("element", ["4N", "8N"])
def test_very_flat_linear_elements_clamped_at_their_edge(element):
    check(body(element, (1.0, 1.0, 0.01), "x-"))


@pytest.mark.parametrize("element", CELLS)
def test_long_elements(element):
    check(body(element, (1.0, 1.0, 10.0), "z-"))


@pytest.mark.parametrize("element", CELLS)
def test_very_long_elements_on_rollers(element):
    check(body(element, (1.0, 1.0, 100.0), "rollers"))


@pytest.mark.parametrize("element", ["4N", "8N", "10N", "27N"])
def test_extremely_long_elements_on_rollers(element):
    check(body(element, (1.0, 1.0, 1000.0), "rollers"))


@pytest.mark.parametrize("element", ["4N", "8N"])
def test_a_plate_of_linear_elements(element):
    check(body(element, (1.0, 1.0, 0.01), "x-", (26, 26, 2)))


@pytest.mark.parametrize("element", CELLS)
def test_stiff_and_soft_layers(element):
    check(body(element, (1.0, 1.0, 1.0), "z-", contrast=lambda x: np.floor(5 * x[:, 2]) % 2 == 1))


@pytest.mark.parametrize("element", CELLS)
def test_stiff_inclusions(element):
    check(
        body(element, (1.0, 1.0, 1.0), "z-", contrast=lambda x: np.abs(x - 0.4).max(axis=1) > 0.21), rtol=1e-7
    )


@pytest.mark.parametrize("element", ["4N", "8N"])
def test_layers_of_flat_elements(element):
    model = body(element, (1.0, 1.0, 0.1), "z-", contrast=lambda x: np.floor(50 * x[:, 2]) % 2 == 1)
    check(model)


def hierarchy(model, points=None):
    """Return the multigrid of a model, and a right side; its clusters are those of nodes at `points`."""
    module = kernels("multigrid")
    system = kl.system.System(model.mesh.points, model.batches(), model.supports)
    free = np.zeros(3 * len(system.points), dtype=bool)
    free[system.reduced.free] = True
    points = system.points if points is None else points
    linear = kl.linear_level.linear_level(system.points, system.batches)
    b = np.random.default_rng(1).standard_normal(len(free)) * free
    return Compiled(module, system.K, free, points, linear), b


@pytest.mark.parametrize(("element", "size"), [("8N", (1.0, 1.0, 0.1)), ("10N", (1.0, 1.0, 20.0))])
def test_results_do_not_depend_on_the_number_of_threads(element, size):
    module, results = kernels("multigrid"), []
    for threads in (1, 2, 3, 5):
        module.set_threads(threads)
        solver, b = hierarchy(body(element, size, "z-"))
        results.append(solver.precondition(b))
    module.set_threads(2)
    for other in results[1:]:
        np.testing.assert_array_equal(other, results[0])

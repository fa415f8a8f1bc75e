"""The stiffness as a product, element by element: the same as with the matrix."""

import threading

import numpy as np
import pytest
from computing import compiled
from rounding import close
from systems import system_of

import kratos_lite as kl
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.matrix_free import MatrixFree, factors
from kratos_lite.elements.tables import tabulate
from kratos_lite.native import kernels
from kratos_lite.quadrature import Rule
from kratos_lite.solvers.coarse_level import p_coarse_level
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.multigrid import multigrid

pytestmark = compiled

STEEL = kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0)
WOOD = kl.Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.4, 0.3, 0.4, 0.7e9, 0.05e9, 0.6e9, 450.0)
KINDS = ("8N", "10N", "13N", "15N", "20N", "27N")


def model_of(kind, material=STEEL, curved=False, cells=(3, 2, 2), size=(1.1, 0.8, 0.7)):
    mesh = kl.box(size, cells, f"KinematicLinear3D{kind}")
    if curved:
        X = mesh.points
        mesh = mesh.replace(points=X + 0.04 * np.sin(3.0 * X[:, [1, 2, 0]] + [0.1, 0.5, 0.9]))
    model = kl.Model(mesh, material)
    model.fix(np.flatnonzero(model.mesh.points[:, 0] < 0.05))
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    return model


def both(model):
    """Return the product, the matrix, and a vector with a random number for each unknown."""
    product = MatrixFree(model.mesh.points, model.element_groups())
    return product, product.assembled(), np.random.default_rng(3).standard_normal(3 * model.mesh.n_nodes)


@pytest.mark.parametrize("curved", [False, True], ids=["affine", "curved"])
@pytest.mark.parametrize("material", [STEEL, WOOD], ids=["isotropic", "orthotropic"])
@pytest.mark.parametrize("kind", KINDS)
def test_products_are_those_of_the_matrix(kind, material, curved):
    product, K, x = both(model_of(kind, material, curved))
    expected = K @ x
    close(product @ x, expected, 2e-14)
    close(product.times(np.stack([x, -2 * x, x])), np.stack([expected, -2 * expected, expected]), 2e-14)
    assert abs(product.norm() / K.norm() - 1) < (0.3 if curved else 1e-12)
    assert (product.scipy() != K.scipy()).nnz == 0


@pytest.mark.parametrize("material", [STEEL, WOOD], ids=["isotropic", "orthotropic"])
@pytest.mark.parametrize("kind", KINDS)
def test_smoothing_is_that_of_the_matrix(kind, material):
    model = model_of(kind, material, curved=True)
    system = system_of(model, solver="amg")
    product, K, r = both(model)
    free = system.constraint_map.is_free
    linear = p_coarse_level(system.points, system.groups)
    r[~free] = 0.0
    solvers = [multigrid(A, free, model.mesh.points, linear) for A in (product, K)]
    z = [solver.precondition(r) for solver in solvers]
    close(*z, 1e-4)  # in single precision
    for solver in solvers:
        close(solver.precondition(np.stack([r, -2 * r])), np.stack([z[0], -2 * z[0]]), 1e-4)


def test_groups_of_several_kinds_and_a_last_group_that_is_not_full():
    quadratic, linear = model_of("20N", cells=(5, 3, 2)).mesh, model_of("8N", cells=(1, 1, 1)).mesh
    points = np.vstack([quadratic.points, linear.points + np.array([2.0, 0, 0])])
    nodes = quadratic.blocks[0].nodes
    blocks = {
        "KinematicLinear3D20N": nodes[:17],
        "KinematicLinear3D27N": np.zeros((0, 27), np.int32),
        "KinematicLinear3D8N": np.vstack([nodes[17:, :8], linear.blocks[0].nodes + len(quadratic.points)]),
    }
    mesh = kl.Mesh(points, {name: cells for name, cells in blocks.items() if len(cells)})
    model = kl.Model(mesh, STEEL)
    model.assign(WOOD, np.arange(5))
    product, K, x = both(model)
    close(product @ x, K @ x, 2e-14)


def test_iterations_with_a_mass_added_come_to_what_the_matrix_gives():
    """Also where it is far heavier than the stiffness that multigrid knows."""
    model = model_of("27N", curved=True)
    product, K, b = both(model)
    M, free = model.matrices().M, system_of(model).constraint_map.is_free
    for m in (1e6, 1e12):
        A = product.with_mass(m, M[::3, ::3].tocsr(), product.assembled)
        close(A @ b, K @ b + m * (M @ b), 1e-13)
        x, _, converged = multigrid(A, free, model.mesh.points).solve(np.where(free, b, 0.0), 1e-12, A.norm())
        assert converged
        close((A @ x)[free], b[free], 1e-10)


# ---- factors of gradients --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["8N", "20N", "27N"])
def test_factors_give_the_gradients(kind):
    element = kl.ELEMENTS[f"KinematicLinear3D{kind}"]
    order, values, slopes, places = factors(element.shape, element.rule)
    n, dN = len(values), tabulate(element.shape, element.rule)[1][order]
    for field in np.random.default_rng(1).standard_normal((3, len(element.shape.nodes))):
        at = (places @ field).reshape(n, n, n)
        at = np.einsum("zc,yb,xa,cba->zyx", values, values, values, at)
        along = [np.einsum(f"{term}->zyx", slopes, at) for term in ("xi,zyi", "yi,zix", "zi,iyx")]
        np.testing.assert_allclose(np.stack(along, -1).reshape(-1, 3), field @ dN, rtol=0, atol=1e-12)


def test_shapes_and_rules_without_factors():
    hexahedron, wedge = kl.ELEMENTS["KinematicLinear3D8N"], kl.ELEMENTS["KinematicLinear3D15N"]
    assert factors(wedge.shape, wedge.rule) is None
    flat = Rule(hexahedron.rule.points * [1.0, 1.0, 0.9], hexahedron.rule.weights, 1, "flat")
    assert factors(hexahedron.shape, flat) is None
    quadratic = kl.ELEMENTS["KinematicLinear3D27N"]
    assert factors(quadratic.shape, hexahedron.rule) is None  # slopes of degree 2 from two points


# ---- where the matrix is needed --------------------------------------------------------------------


def links():
    model = model_of("27N")
    first, second, *_ = np.flatnonzero(model.mesh.points[:, 0] > 1.09).tolist()
    model.constrain((first, "x"), {(second, "x"): 1.0})
    return model


@pytest.mark.parametrize("make", [lambda: model_of("27N"), links], ids=["plain", "with a constraint"])
def test_a_scene_without_a_matrix_says_so_and_never_makes_one(make, monkeypatch):
    model = make()
    monkeypatch.setattr(MatrixFree, "_assembled", None)
    monkeypatch.setattr(ConstrainedSystem, "assembled", None)
    analysis = model.static("amg")
    result = analysis.solve()
    assert isinstance(analysis.system.K, MatrixFree)
    assert result.report.backward_error < 1e-14
    assert any("the stiffness matrix" in words for words in result.report.skipped)


def test_a_callback_may_multiply_between_iterations():
    model = model_of("27N", cells=(4, 4, 4))
    alone, seen = model.static("amg").solve(), []

    def progress(phase, share):
        if phase == "solve" and 0 < share < 1:
            seen.append(analysis.system.K @ np.ones(3 * model.mesh.n_nodes))

    analysis = model.static("amg", progress=progress)
    thread = threading.Thread(target=lambda: seen.append(analysis.solve()), daemon=True)
    thread.start()
    thread.join(20.0)
    assert not thread.is_alive()
    assert len(seen) > 3
    np.testing.assert_array_equal(seen[-1].u, alone.u)


def unlike():
    model = model_of("27N")
    model.assign(kl.Isotropic3D(E=2e15, nu=0.3), [0])
    return model


NEEDED = {
    "a large contrast": unlike,
    "linear tetrahedra": lambda: model_of("4N"),
    "flat cells": lambda: model_of("27N", size=(1.0, 1.0, 0.1)),
    "a plate": lambda: model_of("20N", cells=(16, 16, 1), size=(1.6, 1.6, 0.1)),
}


@pytest.mark.parametrize("name", NEEDED)
def test_others_have_a_matrix(name):
    system = system_of(NEEDED[name](), solver="amg")
    assert isinstance(system.K, BlockMatrix)


def test_a_stiffness_that_kernels_do_not_know_has_a_matrix():
    with kl.ELEMENTS.temporary():

        class Own(kl.KinematicLinear3D27N):
            def B(self, xi):
                return 2.0 * super().B(xi)

    group = model_of("27N").element_groups()[0]
    assert MatrixFree.takes(group)
    assert not MatrixFree.takes(ElementGroup(Own, group.rule, group.material, group.nodes, group.rows))


def test_wrong_tables_are_refused():
    module, model = kernels("multigrid"), model_of("8N")
    group = model.element_groups()[0]
    nodes, _, dN, weights = group.tables()
    C = group.kernel_arguments()[0]
    points = np.ascontiguousarray(model.mesh.points)
    for X, factors_, message in (
        (points[:-1].copy(), None, "nodes must be rows of points"),
        (points, (np.eye(3), np.eye(3), np.eye(8)), "factors must be"),
        (points, (np.eye(2), np.eye(2), np.ones((8, 8))), "each node must have a place"),
    ):
        with pytest.raises(ValueError, match=message):
            module.Product(X, [(nodes, dN, weights, C, factors_)])
    with pytest.raises(ValueError, match="three numbers for each point"):
        module.Product(points, [(nodes, dN, weights, C, None)]).times(np.zeros(5))
    product, x = module.Product(points, [(nodes, dN, weights, C, None)]), np.zeros(points.size)
    start, columns = np.arange(len(points) + 1, dtype=np.int32), np.arange(len(points), dtype=np.int32)
    for added, message in (
        ((1.0, start[:-1], columns, np.ones(len(points))), "a row for each point"),
        ((1.0, start, columns, np.ones(3)), "a row for each point"),
        ((1.0, start, columns + 1, np.ones(len(points))), "no column of the matrix"),
    ):
        with pytest.raises(ValueError, match=message):
            product.times(x, False, added)

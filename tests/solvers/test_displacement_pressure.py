"""Displacements and pressures of nearly incompressible elements: few iterations, and the exact solution."""

import numpy as np
import pytest
from computing import compiled, same_on_all_threads
from meshes import joined
from rounding import close, factorized
from systems import system_of

import kratos_lite as kl
from kratos_lite.assembly.stiffness import assemble_dense
from kratos_lite.solvers import dilatation, displacement_pressure, plan
from kratos_lite.solvers.dilatation import SplitMatrix

pytestmark = compiled
CELLS = {
    "EnhancedStrain3D8N": 6,
    "BBar3D8N": 6,
    "BBar3D10N": 3,
    "BBar3D13N": 3,
    "BBar3D15N": 3,
    "BBar3D20N": 4,
    "BBar3D27N": 3,
}
LIMIT = 45
GRAVITY = kl.Gravity((3.0, 4.0, -9.0))  # in no special direction
STEEL = kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0)


def rubber(nu=0.4999, E=3e6):
    return kl.Isotropic3D(E=E, nu=nu, density=1100.0)


def body(element, material=None, cells=None, size=(1.0, 0.9, 1.1), face="z-"):
    """Return a box under its own weight, clamped at a side."""
    n = cells or CELLS[element]
    cells = n if isinstance(n, tuple) else (n, n, n)
    model = kl.Model(kl.box(size, cells, element), material or rubber())
    model.fix(face)
    model.add(GRAVITY)
    return model


def two_meshes():
    """Return a mesh of two parts: elements with one pressure and with four."""
    parts = [body("EnhancedStrain3D8N", cells=4).mesh, body("BBar3D27N", cells=2).mesh]
    return joined(parts[0], parts[1].replace(points=parts[1].points + np.array([2.0, 0.0, 0.0])))


def amg_system(model):
    return system_of(model, solver="amg")


def centers(model):
    return np.vstack([model.mesh.points[block.nodes].mean(axis=1) for block in model.mesh.blocks])


def moved(mesh, by=0.05):
    """Return a mesh whose inner nodes are moved along smooth fields: no side stays parallel to another."""
    X = mesh.points
    low, high = X.min(axis=0), X.max(axis=0)
    x = (X - low) / (high - low)
    change = by * np.prod(np.sin(np.pi * x), axis=1, keepdims=True) * np.sin(3 * x[:, [1, 2, 0]] + 1)
    return kl.Mesh(X + change, mesh.blocks)


def check(model, limit, rtol=1e-8, **options):
    """Solve by pressures in few iterations, and compare with a factorization of the same matrix.

    Both are off by rounding times the condition of K, which ν makes large.
    """
    found, (u, rounding) = model.solve("amg", **options), factorized(model)
    assert found.report.solver == "displacement-pressure", found.report.reason
    assert found.report.iterations <= limit
    close(found.u, u, rtol + rounding)
    return found


@pytest.fixture(autouse=True)
def to_the_tolerance(monkeypatch):
    """Few unknowns are iterated to round-off otherwise, like a factorization."""
    monkeypatch.setattr(plan, "ROUND_OFF", 1e-8)


# ---- iterations ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("nu", [0.4902, 0.499, 0.4999, 0.499999])
@pytest.mark.parametrize("element", CELLS)
def test_iterations_do_not_grow_towards_incompressibility(element, nu):
    check(body(element, rubber(nu)), LIMIT, 1e-7, tolerance=1e-8)


@pytest.mark.parametrize(("element", "sizes"), [("EnhancedStrain3D8N", (8, 14)), ("BBar3D27N", (3, 7))])
def test_iterations_hardly_grow_with_the_mesh(element, sizes):
    few, many = (body(element, cells=n).solve("amg", tolerance=1e-8).report.iterations for n in sizes)
    assert many <= few + 12


MIXED = ("EnhancedStrain3D8N", "BBar3D10N", "BBar3D27N")
FLAT = ("BBar3D8N", "BBar3D10N", "BBar3D15N", "BBar3D20N", "BBar3D27N")


def beam(element):
    n = CELLS[element] // 2 + 1
    return body(element, cells=(4 * n, n, n), size=(8.0, 1.0, 1.0), face="x-")


def confined(element):
    model = body(element)
    for face in ("x-", "x+", "y-", "y+"):
        model.fix(face)
    return model


def fixed(mesh):
    model = kl.Model(mesh, rubber())
    model.fix(mesh.points[:, 2] == 0)
    model.add(GRAVITY)
    return model


def flat(element, height=0.1):
    return body(element, cells=4, size=(1.0, 1.0, height))


def long(element):
    axis = {"BBar3D8N": 0, "BBar3D20N": 2, "BBar3D27N": 1}[element]
    return body(element, cells=5, size=tuple(np.where(np.arange(3) == axis, 10.0, 1.0)))


@pytest.mark.parametrize(
    ("make", "elements", "limit"),
    [
        (beam, MIXED, 60),
        (confined, MIXED, 60),
        (lambda element: fixed(moved(body(element).mesh)), ("EnhancedStrain3D8N", "BBar3D20N"), 45),
        (flat, FLAT, 45),
        (long, ("BBar3D8N", "BBar3D20N", "BBar3D27N"), 45),
        (lambda element: fixed(two_meshes()), ("both",), 55),
        (lambda element: flat(element, 0.01), {*FLAT} - {"BBar3D15N"}, 45),
    ],
    ids=["beam", "confined", "distorted", "flat", "long", "one and four pressures", "very flat"],
)
def test_bodies_take_few_iterations(make, elements, limit):
    for element in elements:
        check(make(element), limit)


@pytest.mark.parametrize(("element", "axis"), [("BBar3D27N", 0), ("BBar3D27N", 2), ("BBar3D15N", 2)])
def test_means_of_pressures_around_halves_of_long_edges(element, axis):
    size = tuple(8.0 if a == axis else 1.0 for a in range(3))
    K = amg_system(body(element, cells=2, size=size)).K
    points = kl.box(size, (2, 2, 2), element).points
    z, u, linear = points[:, axis], np.zeros_like(points), np.zeros_like(points)
    u[:, axis], linear[:, axis] = z, z**2 / 2  # dilatations 1 and z
    one, mean = (K.means.matrix.T @ (K.D @ field.ravel()) for field in (u, linear))
    at = np.flatnonzero(one)
    low, high = z[K.means.ends[at]].T
    assert ((high - low) == 4.0).all()
    assert len(at) == 2 * 18  # nine edges in each layer, by halves
    place = mean[at] / one[at]
    first = np.abs(place - (3 * low + high) / 4) < 1e-12
    second = np.abs(place - (low + 3 * high) / 4) < 1e-12
    assert (first ^ second).all()
    assert first.sum() == second.sum()
    volumes = one[at] ** 2 * 2 * (3e6 / (2 * 1.4999))
    np.testing.assert_allclose(volumes.sum(), 8.0, rtol=1e-11)


def test_means_of_pressures_around_nodes():
    K = amg_system(body("BBar3D27N", cells=2, size=(1.0, 1.0, 1.0))).K
    one = K.means.matrix.T @ (K.D @ kl.box((1.0, 1.0, 1.0), (2, 2, 2), "BBar3D27N").points.ravel() / 3)
    assert np.count_nonzero(one) == 27
    assert (K.means.ends[:, 0] == K.means.ends[:, 1]).all()
    np.testing.assert_allclose((one**2).sum() * 2 * (3e6 / (2 * 1.4999)), 1.0, rtol=1e-11)


# ---- materials -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", MIXED)
@pytest.mark.parametrize("inside", ["rubber", "steel"])
def test_rubber_and_steel(element, inside):
    materials = (STEEL, rubber()) if inside == "rubber" else (rubber(), STEEL)
    model = body(element, materials[0])
    model.assign(materials[1], np.flatnonzero(np.abs(centers(model) - 0.5).max(axis=1) < 0.3))
    check(model, 75)


def test_a_rubber_with_fibers_is_nearly_incompressible():
    fibers = kl.Orthotropic3D(
        E_x=9e6, E_y=3e6, E_z=3e6, nu_xy=0.4999, nu_yz=0.833, nu_xz=0.4999, G_xy=1e6, G_yz=1e6, G_xz=1e6,
        density=1100.0,
    )  # fmt: skip
    check(body("BBar3D27N", fibers), 60)


def test_compressible_bodies_have_no_pressures():
    assert body("BBar3D27N", rubber(0.49)).solve("amg").report.solver == "amg"


@pytest.mark.parametrize(
    ("element", "cells", "method"),
    [
        ("EnhancedStrain3D8N", (5, 5, 5), "direct"),
        ("EnhancedStrain3D8N", (20, 20, 1), "direct"),
        ("EnhancedStrain3D8N", (11, 11, 11), "displacement-pressure"),
        ("BBar3D27N", (5, 5, 5), "displacement-pressure"),
        ("KinematicLinear3D8N", (5, 5, 5), "direct"),
        ("KinematicLinear3D8N", (10, 10, 10), "direct"),
    ],
)
def test_few_unknowns_are_factorized(element, cells, method):
    model = body(element, cells=cells, size=(0.1 * cells[0], 0.1 * cells[1], 0.1 * cells[2]))
    report = model.solve().report
    assert report.solver == method, report.reason
    if method == "direct":
        assert report.reason.startswith("few unknowns with a bulk modulus > 50 shear moduli")
    assert body(element, rubber(0.3), cells).solve().report.solver == "amg"


# ---- the matrix ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", CELLS)
def test_the_split_matrix_is_the_stiffness_and_what_remains_that_of_an_ordinary_material(element):
    model = kl.Model(moved(kl.box((1.0, 1.0, 1.0), (2, 2, 1), element)), rubber(0.4999))
    model.fix("z-")
    K, shear = amg_system(model).K, 3e6 / (2 * 1.4999)
    assert isinstance(K, SplitMatrix)
    exact, soft = (
        assemble_dense(model.mesh.points, kl.Model(model.mesh, material).element_groups())
        for material in (rubber(0.4999), kl.Isotropic3D(E=2.5 * shear, nu=0.25))
    )
    x, size = np.random.default_rng(0).standard_normal(len(exact)), np.abs(exact).sum(axis=1).max()
    np.testing.assert_allclose(K @ x, exact @ x, rtol=0, atol=1e-13 * size)
    np.testing.assert_allclose(K.scipy().toarray(), exact, rtol=0, atol=1e-13 * size)
    assert size * (1 - 1e-12) <= K.norm() <= 2 * size
    A = K.A.scipy().toarray()
    if element.startswith("BBar") and element != "BBar3D10N":  # the others depend on the material
        close(A, soft, 1e-9)
    values = np.linalg.eigvalsh(A)
    assert values[0] > -1e-9 * values[-1]
    assert values[-1] < 3 * np.linalg.eigvalsh(soft)[-1]


@pytest.mark.parametrize(
    ("element", "height", "longest", "sizes"),
    [
        ("EnhancedStrain3D8N", 1.0, 40, {1}),
        ("EnhancedStrain3D8N", 0.05, 40, {5}),
        ("EnhancedStrain3D8N", 0.05, 4, {1}),  # larger groups are taken as single nodes
        ("BBar3D20N", 0.04, 40, {5, 9}),
    ],
)
def test_inverse_within_lines_across_flat_cells(element, height, longest, sizes, monkeypatch):
    monkeypatch.setattr(displacement_pressure, "LONGEST", longest)
    system = amg_system(body(element, cells=4, size=(1.0, 1.0, height)))
    A, D, kept, n = system.K.A, system.K.D, system.K.kept, len(system.points)
    free = np.ones(3 * n, dtype=bool)
    free[:75:2] = False
    group, place = displacement_pressure._groups(A, A.rows(), system.points)
    assert set(np.bincount(group)) == sizes
    full, exact = A.scipy().toarray() - D.T @ (kept[:, None] * D.toarray()), np.zeros((3 * n, 3 * n))
    for number in set(group):
        nodes = np.flatnonzero(group == number)
        assert np.ptp(system.points[nodes, :2], axis=0).max() < 1e-12
        assert sorted(place[nodes]) == list(range(len(nodes)))
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        dofs = dofs[free[dofs]]
        exact[np.ix_(dofs, dofs)] = np.linalg.inv(full[np.ix_(dofs, dofs)])
    close(displacement_pressure.block_inverse(A, free, system.points, D, kept).toarray(), exact, 1e-11)


def test_an_element_of_a_user_with_a_strain_of_its_own_has_no_pressures():
    with kl.ELEMENTS.temporary():

        class Own8N(kl.EnhancedStrain3D8N):
            def B(self, xi, C):
                return 1.01 * super().B(xi, C)

        assert not dilatation.is_split(body("Own8N", cells=3).element_groups()[0])


# ---- constraints, right sides, ways ----------------------------------------------------------------------


def test_multi_point_constraints():
    model = body("EnhancedStrain3D8N", cells=4)
    first, *others = model.mesh.nodes("z+").tolist()
    for node in others:
        model.constrain((node, "z"), {(first, "z"): 1.0})
    check(model, 50)


def test_prescribed_displacements():
    model = body("BBar3D20N", cells=3)
    model.fix("z+", value=(0.01, 0.0, -0.05))
    found = check(model, 65)
    assert found.report.backward_error < 1e-11


def test_tolerances_refer_to_forces_without_the_bulk_modulus():
    model = body("BBar3D20N", cells=5)
    model.fix("z+", value=(0.01, 0.0, -0.05))
    report = model.static("amg", tolerance=1e-5).solve().report
    assert report.iterations < 50
    assert report.force_error < 1e-3


def test_without_kernels_it_is_factorized(monkeypatch):
    monkeypatch.setattr(plan, "kernels", lambda name: None)
    monkeypatch.setattr(plan, "DENSE_LIMIT", 0)
    monkeypatch.setattr(plan, "DIRECT_LIMIT", 0)
    report = body("EnhancedStrain3D8N", cells=5).solve().report
    assert report.solver == "direct"
    assert "bulk modulus" in report.reason


def test_iterations_start_anew_from_the_residual(monkeypatch):
    monkeypatch.setattr(displacement_pressure, "DIRECTIONS", 12)
    found = check(body("BBar3D20N", cells=3), 100)
    assert found.report.iterations > 30


def test_the_kernel_refuses_what_does_not_fit():
    equations = amg_system(body("EnhancedStrain3D8N", cells=3)).equations
    solver = equations._multigrid
    D, S = (displacement_pressure._arrays(A) for A in (equations.K.D, solver._S))
    vectors = [solver._scale, equations.K.bulk, equations.K.kept, solver._weight]

    def made(D=D, S=S, vectors=vectors):
        return solver._cycle.with_pressures(D, S, *vectors, 0.1, 10)

    made()
    for wrong, why in (
        ({"D": (D[0][:-1], D[1], D[2])}, "a row for each row of blocks"),
        ({"D": (D[0], D[1] + 1000, D[2])}, "must be columns"),
        ({"D": (D[0], D[1], D[2][:, :, :2].copy())}, "blocks of D must be R x 3"),
        ({"D": (D[0], D[1], D[2].repeat(2, axis=1))}, "1 or 4 pressures"),
        ({"S": (S[0], S[1] - 5, S[2])}, "must be columns"),
        ({"S": (S[0], S[1], S[2].repeat(2, axis=1))}, "blocks of S must be R x R"),
        ({"vectors": [*vectors[:3], vectors[3][1:]]}, "each pressure needs"),
    ):
        with pytest.raises(ValueError, match=why):
            made(**wrong)
    with pytest.raises(ValueError, match="one number for each unknown"):
        made().solve(np.zeros(5), 1e-8, 1.0, 10, 10, 1e-10, lambda residual: True)


def test_results_do_not_depend_on_the_number_of_threads():
    same_on_all_threads(lambda: body("EnhancedStrain3D8N").solve("amg").u, (1, 2, 3))


def test_no_load_has_no_displacement():
    system = amg_system(body("EnhancedStrain3D8N", cells=4))
    u, solution = system.solve(np.zeros((125, 3)))
    assert not u.any()
    assert solution.iterations == 0


# ---- where it does not converge --------------------------------------------------------------------------


def test_a_factorization_takes_over(monkeypatch):
    monkeypatch.setattr(displacement_pressure, "MAX_ITERATIONS", 5)
    model = body("EnhancedStrain3D8N", cells=5)
    found = model.solve("amg")
    assert found.report.solver == "direct"
    assert found.report.reason == "multigrid stopped after 5 iterations short of 1e-10"
    close(found.u, model.solve("direct").u, 1e-9)
    monkeypatch.setattr(plan, "FALLBACK_LIMIT", 100)
    with pytest.raises(
        kl.SolveError, match="too many to factorize instead; look for thin elements, for plain"
    ):
        model.solve("amg")

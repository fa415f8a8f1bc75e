"""Multigrid on stretched meshes, thin plates and unlike materials: iterations and exactness."""

import numpy as np
import pytest
from computing import compiled, same_on_all_threads
from rounding import close, factorized
from systems import parts_of, stiffness_of, system_of

import kratos_lite as kl
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.solvers import plan
from kratos_lite.solvers.coarse_level import p_coarse_level
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.solvers.multigrid import Compiled
from kratos_lite.solvers.plate_level import bending_modes, plate_axes, plate_level

pytestmark = compiled
LIMIT = 60
STEEL = kl.Isotropic3D(E=2e11, nu=0.3)
CELLS = {"4N": (9, 9, 9), "8N": (9, 9, 9), "10N": (4, 4, 4), "20N": (5, 5, 5), "27N": (4, 4, 4)}


WEIGHT = (3.0, 4.0, -9.0)  # in no special direction


def body(element, size, side, cells=None, contrast=None):
    """Return a box under its own weight, clamped at a side or between rollers."""
    name = "EnhancedStrain3D8N" if element == "E8N" else f"KinematicLinear3D{element}"
    mesh = kl.box(size, cells or CELLS[element], name)
    model = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    if contrast:
        centers = np.vstack([mesh.points[b.nodes].mean(axis=1) for b in mesh.blocks]) / size
        model.assign(kl.Isotropic3D(E=1e3, nu=0.3, density=1000.0), np.flatnonzero(contrast(centers)))
    for face, axes in (("x-", "x"), ("y-", "y"), ("z-", "z")) if side == "rollers" else ((side, "xyz"),):
        model.fix(face, axes)
    model.add(kl.Gravity(WEIGHT))
    return model


def check(model, exact=None, rtol=1e-8):
    found = model.solve("amg")
    assert found.report.solver == "amg", found.report.reason
    assert found.report.iterations < LIMIT
    close(found.u, model.solve("direct").u if exact is None else exact, rtol)


def hierarchy(model):
    """Return the multigrid of a model, and a right side."""
    system = system_of(model)
    free, linear = system.constraint_map.is_free, p_coarse_level(system.points, system.groups)
    b = np.random.default_rng(1).standard_normal(len(free)) * free
    return Compiled(system.K, free, system.points, linear), b


def iterations(model, load=None):
    """Return the iterations to 1e-8 under a load of every node, or random numbers."""
    solver, b = hierarchy(model)
    b = b if load is None else np.where(b != 0, np.tile(load, len(b) // 3), 0.0)
    return solver.solve(b, 1e-8, 0.0)[1]


@pytest.fixture(autouse=True)
def to_the_tolerance(monkeypatch):
    """Few unknowns are iterated to round-off otherwise, like a factorization."""
    monkeypatch.setattr(plan, "ROUND_OFF", 1e-10)


LINEAR, QUADRATIC = ("4N", "8N"), ("10N", "15N", "20N", "27N")
STRETCHED = {
    "flat": (CELLS, (1.0, 1.0, 0.1), "z-"),
    "extremely flat": (CELLS, (1.0, 1.0, 0.001), "z-"),
    "flat, clamped at their edge": (CELLS, (1.0, 1.0, 0.1), "x-"),
    "very flat, clamped at their edge": (LINEAR, (1.0, 1.0, 0.01), "x-"),
    "long": (CELLS, (1.0, 1.0, 10.0), "z-"),
    "very long on rollers": (CELLS, (1.0, 1.0, 100.0), "rollers"),
    "extremely long on rollers": (("4N", "8N", "10N", "27N"), (1.0, 1.0, 1000.0), "rollers"),
}
"""Elements, size of the body in which they are stretched, and its supports."""


@pytest.mark.parametrize(
    ("element", "size", "side"),
    [
        pytest.param(element, size, side, id=f"{element} {name}")
        for name, (elements, size, side) in STRETCHED.items()
        for element in elements
    ],
)
def test_stretched_elements(element, size, side):
    check(body(element, size, side))


@pytest.mark.parametrize(("element", "n"), [("8N", 20), ("20N", 22), ("27N", 18), ("15N", 18), ("10N", 14)])
@pytest.mark.parametrize("length", [0.3, 4.0])
def test_long_elements_in_planes_too_large_to_be_solved(element, n, length):
    model = body(element, (1.0, 1.0, length), "x-", (n, n, 1))
    assert not hierarchy(model)[0].clusters[0]
    assert iterations(model) <= (45 if element == "10N" else 30)


def rim(element, n):
    """Return a plate 1:1000 with a clamped rim."""
    model = body(element, (1.0, 1.0, 0.001), "x-", (n, n, 1))
    for side in ("x+", "y-", "y+"):
        model.fix(side)
    return model


def on_edges(element, n):
    """Return a plate supported along two lower edges."""
    mesh = kl.box((1.0, 1.0, 0.01), (n, n, 1), f"KinematicLinear3D{element}")
    model = kl.Model(mesh, STEEL)
    model.fix((mesh.points[:, 2] == 0) & (np.abs(mesh.points[:, 0] - 0.5) == 0.5), "z")
    model.fix("y-", "y")
    model.fix("x-", "x")
    return model


def thin(side, layers=1):
    return lambda element, n: body(element, (1.0, 1.0, 0.01), side, (n, n, layers))


FINE = {
    **{"4N": (24, 30), "8N": (40, 20), "E8N": (40, 26)},
    **{"10N": (14, 24), "15N": (14, 26), "20N": (16, 28), "27N": (14, 30)},
}
VERY_THIN = {"8N": (40, 20), "E8N": (30, 26), "10N": (14, 32), "15N": (14, 38), "20N": (20, 60)}
PLATES = {
    "clamped along x": (thin("x-"), FINE),
    "clamped along y": (thin("y+"), {"8N": FINE["8N"], "20N": FINE["20N"]}),
    "three layers": (thin("x-", 3), dict.fromkeys(QUADRATIC, (12, 32))),
    "clamped rim": (rim, VERY_THIN),
    "lower edges": (on_edges, {"20N": (12, 40)}),
    "curved shell": (lambda element, n: cylinder(n, element), dict.fromkeys(QUADRATIC, (12, 90))),
}
"""Plates, and for elements the cells along an edge and the iterations that it may take."""


@pytest.mark.parametrize(
    ("plate", "element", "n", "limit"),
    [
        pytest.param(plate, element, n, limit, id=f"{name} {element}")
        for name, (plate, rows) in PLATES.items()
        for element, (n, limit) in rows.items()
    ],
)
def test_plates_have_modes_of_bending(plate, element, n, limit):
    assert iterations(plate(element, n), WEIGHT) <= limit


@pytest.mark.parametrize(("element", "n"), [("E8N", 30), ("10N", 14), ("20N", 16)])
def test_very_thin_cantilevers_converge(element, n):
    found = body(element, (1.0, 1.0, 0.001), "x-", (n, n, 1)).solve("amg")
    assert found.report.solver == "amg", found.report.reason
    strip = 1.5 * (1 - 0.3**2) * 9000.0 / 1e9 / 0.001**2  # q L^4 / (8 D)
    np.testing.assert_allclose(np.abs(found.u[:, 2]).max(), strip, rtol=0.1)


def test_enhanced_cells_whose_lines_leave_bending_smooth_larger_parts():
    for n, parts in ((20, True), (80, False)):
        memory = [
            (solver := hierarchy(body(element, (1.0, 1.0, 0.01), "x-", (n, n, 1)))[0]).memory
            for element in ("E8N", "8N")
        ]
        assert (memory[0] > 1.3 * memory[1]) == parts, solver.levels


def lines_across(points):
    """Return the number of the line across a plate on which each node lies."""
    return np.unique(np.round(points[:, :2], 9), axis=0, return_inverse=True)[1].ravel()


def assert_spanned(found, by, rank):
    """Assert that modes are combinations of others, and as many."""
    residual = found - by @ np.linalg.lstsq(by, found, rcond=None)[0]
    assert np.abs(residual).max() < 1e-6
    assert np.linalg.matrix_rank(found, tol=1e-4) == rank


@pytest.mark.parametrize("known", [True, False], ids=["plate", "shell"])
@pytest.mark.parametrize("element", ["10N", "13N", "15N", "20N", "27N"])
def test_lines_of_a_plate_interpolate_constant_curvature(element, known):
    """Of a plate as it is, and as a shell, whose modes are quadratic in all coordinates."""
    mesh = kl.box((1.0, 0.7, 0.01), (4, 3, 2), f"KinematicLinear3D{element}")
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    points, free = mesh.points @ turn, np.ones(mesh.points.size, dtype=bool)
    groups = kl.Model(mesh, STEEL).element_groups()
    lines = lines_across(mesh.points)
    axes, linear = plate_axes(points, free), p_coarse_level(points, groups)
    level = plate_level(points, free, axes if known else None, lines, linear)
    nodes = np.repeat(np.arange(len(points)), np.diff(level.indptr))
    found = np.zeros((len(points), 3, 12))
    modes = level.modes.reshape(-1, 6, 12)[level.indices]
    np.add.at(found, nodes, np.einsum("kij,kjm->kim", level.blocks, modes))
    found, want = found.reshape(-1, 12), bending_modes(points, axes)[:, :9]
    assert_spanned(found, want, 9)


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_iterations_of_a_plate_do_not_grow_with_its_mesh(turn):
    for n in (20, 50):
        model = body("8N", (1.0, 1.0, 0.02), "x-", (n, n, 1))
        c, s = np.cos(turn), np.sin(turn)
        points = model.mesh.points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        turned = kl.Model(kl.Mesh(points, model.mesh.blocks), STEEL)
        turned.fix(model.mesh.nodes("x-"))
        assert iterations(turned, WEIGHT) <= 26


def cylinder(n, element="8N"):
    """Return part of a thin cylinder of cells with three unlike sides."""
    mesh = kl.box((1.5, 1.0, 0.01), (n, n, 1), f"KinematicLinear3D{element}")
    angle, radius = mesh.points[:, 0], 1 + mesh.points[:, 2]
    points = np.column_stack([radius * np.sin(angle), mesh.points[:, 1], radius * np.cos(angle)])
    model = kl.Model(kl.Mesh(points, mesh.blocks), STEEL)
    model.fix(mesh.nodes("x-"))
    return model


def test_modes_of_a_shell_hold_its_rigid_motions():
    model = cylinder(12, "20N")
    points, groups = model.mesh.points, model.element_groups()
    lines = lines_across(kl.box((1.5, 1.0, 0.01), (12, 12, 1), "KinematicLinear3D20N").points)
    linear = p_coarse_level(points, groups)
    level = plate_level(points, np.ones(points.size, dtype=bool), None, lines, linear)
    own = level.indptr[linear.nodes]  # each corner belongs to one line
    modes = level.modes.reshape(-1, 6, 12)[level.indices[own], :, :6]
    found = np.einsum("kij,kjm->kim", level.blocks[own], modes).reshape(-1, 6)
    want = rigid_modes(points[linear.nodes])
    assert_spanned(found, want, 6)


@pytest.mark.parametrize("case", ["thick", "plane strain", "single nodes"])
def test_lines_that_are_no_shell_are_left(case):
    size = (1.0, 1.0, 0.5 if case == "thick" else 0.01)
    mesh = kl.box(size, (4, 4, 1), "KinematicLinear3D20N")
    lines = np.arange(len(mesh.points)) if case == "single nodes" else lines_across(mesh.points)
    free = np.ones((len(mesh.points), 3), dtype=bool)
    free[:, 2] = case != "plane strain"
    linear = p_coarse_level(mesh.points, kl.Model(mesh, STEEL).element_groups())
    assert plate_level(mesh.points, free.ravel(), None, lines, linear) is None


def test_modes_of_bending_have_the_energy_of_constant_curvature():
    mesh = kl.box((1.0, 0.7, 0.05), (3, 2, 1), "KinematicLinear3D27N")
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    points = mesh.points @ turn
    modes = bending_modes(points, plate_axes(points, np.ones(points.size, dtype=bool)))
    K = stiffness_of(*parts_of(kl.Model(kl.Mesh(points, mesh.blocks), STEEL)))
    energy = modes.T @ K.scipy() @ modes
    mu = STEEL.E / 2 / (1 + STEEL.nu)
    lame = 2 * mu * STEEL.nu / (1 - 2 * STEEL.nu)
    inertia = 4 * 0.7 * 0.05**3 / 12 / np.ptp(points, axis=0).max() ** 4
    want = np.zeros((12, 12))
    want[6:9, 6:9] = inertia * np.array([[lame + 2 * mu, lame, 0], [lame, lame + 2 * mu, 0], [0, 0, mu]])
    np.testing.assert_allclose(np.abs(energy), want, rtol=0, atol=1e-6 * want.max())


def layers(count):
    return lambda x: np.floor(count * x[:, 2]) % 2 == 1


def outside(x):
    return np.abs(x - 0.4).max(axis=1) > 0.21


@pytest.mark.parametrize(
    ("elements", "height", "soft", "rtol"),
    [(CELLS, 1.0, layers(5), 1e-8), (CELLS, 1.0, outside, 1e-7), (LINEAR, 0.1, layers(50), 1e-8)],
    ids=["layers", "inclusions", "layers of flat elements"],
)
def test_stiff_and_soft_materials(elements, height, soft, rtol):
    for element in elements:
        cells = (11, 11, 11) if (element, soft) == ("4N", outside) else None
        model = body(element, (1.0, 1.0, height), "z-", cells, soft)
        u, rounding = factorized(model)
        check(model, u, rtol + rounding)


@pytest.mark.parametrize(
    ("element", "size", "cells"),
    [
        *[("8N", (1.0, 1.0, 0.1), None), ("10N", (1.0, 1.0, 20.0), None)],
        *[("20N", (1.0, 1.0, 0.01), (30, 30, 1)), ("E8N", (1.0, 1.0, 0.001), (26, 26, 1))],
    ],
)
def test_results_do_not_depend_on_the_number_of_threads(element, size, cells):
    def compute():
        solver, b = hierarchy(body(element, size, "z-" if cells is None else "x-", cells))
        return solver.precondition(b)

    same_on_all_threads(compute)


def unstructured(aspect):
    """Return a body of Delaunay tetrahedra between scattered nodes, made flat."""
    from scipy.spatial import Delaunay

    points = np.random.default_rng(0).random((1500, 3))
    nodes = Delaunay(points).simplices
    edges = points[nodes[:, 1:]] - points[nodes[:, :1]]
    volume = np.linalg.det(edges)
    nodes[volume < 0] = nodes[volume < 0][:, [1, 0, 2, 3]]
    nodes = nodes[np.abs(volume) > 1e-5]
    used, nodes = np.unique(nodes, return_inverse=True)
    nodes = nodes.reshape(-1, 4)
    mesh = kl.Mesh(points[used] * [1, 1, 1 / aspect], {"KinematicLinear3D4N": nodes})
    model = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3))
    model.fix(np.flatnonzero(points[used, 2] < 0.1))
    return model


def halves(x):
    return x[:, 2] > 5 / 9


CLUSTERS = {
    **{element: (0, lambda element=element: body(element, (1.0, 1.1, 0.9), "z-")) for element in CELLS},
    "a little stretched": (0, lambda: body("8N", (2.5, 1.0, 1.0), "z-")),
    "three sides without a gap": (0, lambda: cylinder(40)),
    "unstructured": (0, lambda: unstructured(1)),
    "unstructured and flat": (0, lambda: unstructured(10)),
    "flat: lines": (10**2, lambda: body("8N", (1.0, 1.0, 0.1), "rollers")),
    "long: planes": (10, lambda: body("8N", (1.0, 1.0, 10.0), "rollers")),
    "flat, of unlike materials": (2 * 10**2, lambda: body("8N", (1, 1, 0.1), "rollers", contrast=halves)),
}
"""Clusters of nodes on the finest level, and a body with as many."""


@pytest.mark.parametrize("case", CLUSTERS)
def test_clusters_are_lines_across_flat_elements_and_planes_across_long_ones(case):
    count, make = CLUSTERS[case]
    found = hierarchy(make())[0]
    assert found.clusters[0] == count
    assert count or case == "unstructured and flat" or not any(found.clusters)


def test_an_unstructured_plate_takes_no_more_memory_than_its_matrix():
    assert hierarchy(unstructured(100))[0].complexity < 3.5


@pytest.mark.parametrize("quick", [True, False])
def test_an_iteration_slower_than_a_factorization_stops_early(quick, monkeypatch):
    monkeypatch.setattr("kratos_lite.solvers.plan.PATIENCE", 70)
    monkeypatch.setattr("kratos_lite.solvers.linear_solver.is_quick_to_factorize", lambda unknowns: quick)
    model = body("8N", (1.0, 1.0, 1.0), "z-", (8, 8, 8))
    model.assign(kl.Isotropic3D(E=1e9, nu=0.4999, density=1000.0))
    result, exact = model.solve("amg"), model.solve("direct").u
    if quick:
        assert (result.report.solver, result.report.reason) == (
            "direct",
            "multigrid stopped after 60 iterations short of 1e-10, at a rate that takes more than 70: "
            "a factorization is faster",
        )
    else:
        assert result.report.solver == "amg"
        assert result.report.iterations > 70
    close(result.u, exact, 1e-7)


def bonded(kind, thickness, layers=40):
    """Return a column of cubes with one layer of that many times their thickness in the middle."""
    size = 5 if kind == "8N" else 3
    mesh = kl.box((1.0, 1.0, float(layers)), (size, size, layers), f"KinematicLinear3D{kind}")
    heights = np.insert(np.cumsum(np.where(np.arange(layers) == layers // 2, thickness, 1.0)), 0, 0.0) / size
    X = mesh.points.copy()
    X[:, 2] = np.interp(X[:, 2], np.arange(layers + 1.0), heights)
    model = kl.Model(mesh.replace(points=X), kl.Isotropic3D(E=2e11, nu=0.3, density=7800.0))
    model.fix("z-")
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    return model


@pytest.mark.parametrize("thickness", [0.01, 1e-4])
@pytest.mark.parametrize("kind", ["8N", "10N", "15N", "20N", "27N"])
def test_one_very_thin_layer_among_cubes_does_not_stall(kind, thickness):
    analysis = bonded(kind, thickness).static("amg")
    report = analysis.solve().report
    assert (report.solver, report.backward_error < 2e-14) == ("amg", True)
    assert report.iterations <= 30  # 60 to 190 with single nodes, or none that converge
    assert isinstance(analysis.system.K, BlockMatrix)

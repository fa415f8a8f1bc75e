"""Multigrid, compiled and of pyamg: the same displacements as a factorization, whatever the model."""

from functools import cache

import numpy as np
import pytest
from computing import compiled, same_on_all_threads
from meshes import KINDS, joined
from rounding import close, factorized
from systems import stiffness_of, system_of

import kratos_lite as kl
from kratos_lite.assembly.matrix_free import MatrixFree
from kratos_lite.native import kernels
from kratos_lite.solvers import multigrid
from kratos_lite.solvers.coarse_level import p_coarse_level

STEEL = kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0)
GRAVITY = kl.Gravity((1.0, 2.0, -9.81))
MODULE = kernels("multigrid")


@pytest.fixture(
    params=[*(pytest.param(way, marks=compiled) for way in ("compiled", "with a matrix")), "pyamg"]
)
def path(request, monkeypatch):
    """Run a test with both hierarchies, the compiled one without and with a matrix."""
    if request.param != "compiled":
        monkeypatch.setattr(MatrixFree, "takes", lambda group: False)
    if request.param == "pyamg":
        monkeypatch.setattr(multigrid, "kernels", lambda name: None)
    return request.param


# ---- models --------------------------------------------------------------------------------------


def box(size=(1.0, 0.8, 0.6), cells=(6, 4, 4), kind="8N"):
    return kl.box(size, cells, f"KinematicLinear3D{kind}")


def clamped(mesh, material=STEEL, held=lambda p: p[:, 0] <= p[:, 0].min()):
    """Return a model held where x is smallest, under gravity in all directions."""
    model = kl.Model(mesh, material)
    model.fix(held)
    model.add(GRAVITY)
    return model


def mesh_of(points, **cells):
    """Return a mesh of nodes by the kinds of cells, such as n8=…."""
    return kl.Mesh(points, {f"KinematicLinear3D{kind[1:]}N": nodes for kind, nodes in cells.items()})


def mixed():
    """Return bricks, of which some are cut into tetrahedra or wedges."""
    mesh = box()
    cells = mesh.blocks[0].nodes
    corners = ([0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7])
    tetrahedra = np.vstack([cells[:1, c] for c in corners])
    wedges = np.vstack([cells[-6:][:, [0, 1, 2, 4, 5, 6]], cells[-6:][:, [0, 2, 3, 4, 6, 7]]])
    return clamped(mesh_of(mesh.points, n8=cells[1:-6], n4=tetrahedra, n6=wedges))


def orders():
    """Return quadratic bricks beside linear ones on the same points."""
    mesh = box(kind="20N", cells=(4, 2, 2))
    cells = mesh.blocks[0].nodes
    return clamped(mesh_of(mesh.points, n20=cells[:8], n8=cells[8:, :8]))


def bodies(count, stiffer=1.0, cells=(2, 2, 2), kind="8N"):
    """Return separate boxes in a row, each stiffer than the one before."""
    cell = box((1, 1, 1), cells, kind)
    mesh = joined(*(cell.replace(points=cell.points + np.array([2.0 * i, 0, 0])) for i in range(count)))
    model = clamped(mesh, held=lambda p: p[:, 2] == 0)
    for i, rows in enumerate(np.arange(mesh.n_elements).reshape(count, -1)):
        model.assign(kl.Isotropic3D(E=2e11 * stiffer**i, nu=0.3, density=7850.0 * stiffer**i), rows)
    return model


def periodic(kind="8N"):
    """Return a block whose right side moves as the left one, 1 mm further apart."""
    model = clamped(box(kind=kind), held="z-")
    points = model.mesh.points
    sides = [model.mesh.nodes(side) for side in ("x-", "x+")]
    left, right = (rows[np.lexsort(points[rows, 1:].round(9).T)] for rows in sides)
    above = points[right, 2] > 0
    for axis in range(3):
        model.constrain(3 * right[above] + axis, 3 * left[above] + axis, 1e-3 if axis == 0 else 0.0)
    return model


def stiff_end(kind="8N", held=False):
    """Return a beam whose end moves as one; one of its independents may be prescribed."""
    model = clamped(box(kind=kind))
    first, *others = model.mesh.nodes("x+").tolist()
    if held:
        model.fix(np.array([first]), "x", 1e-4)
    for dependent in others:
        model.constrain((dependent, "x"), {(first, "x"): 1.0})
        model.constrain((dependent, "y"), {(first, "y"): 1.0, (first, "z"): 0.5})
    return model


def rigid_end(kind):
    """Return a beam whose end is rigid and turns about an axis in front of it."""
    model = clamped(box(kind=kind, cells=(5, 4, 3)))
    point = model.rigid("x+", (1.2, 0.3, 0.2))
    point.fix("z")
    point.fix_rotation("x")
    return model


def partly_fixed():
    """Return a block whose nodes are held in components chosen at random."""
    model = clamped(box(cells=(5, 4, 4)))
    draw = np.random.default_rng(5)
    for axis in "xyz":
        model.fix(np.flatnonzero(draw.random(model.mesh.n_nodes) < 0.2), axis)
    return model


def prescribed():
    model = clamped(box())
    model.fix("x+", value=(1e-3, 2e-3, 0.0))
    return model


def contrast(factor, kind="8N"):
    model = clamped(box(kind=kind))
    rows = np.flatnonzero(np.random.default_rng(1).random(model.mesh.n_elements) < 0.5)
    model.assign(kl.Isotropic3D(E=2e11 * factor, nu=0.3, density=7850.0), rows)
    return model


def scattered():
    """Return a block with nodes that no element uses, before and behind its own."""
    mesh = box()
    points = np.vstack([[[9.0, 9, 9]], mesh.points, [[7.0, 7, 7]]])
    return clamped(mesh_of(points, n8=mesh.blocks[0].nodes + 1), held=np.flatnonzero(points[:, 0] == 0))


def distorted(kind="8N"):
    mesh = box(cells=(4, 4, 3), kind=kind)
    change = 0.01 * np.random.default_rng(7).uniform(-1, 1, mesh.points.shape)
    return clamped(mesh.replace(points=mesh.points + change), held=np.flatnonzero(mesh.points[:, 0] <= 0))


def one_unknown():
    mesh = box(cells=(2, 2, 2))
    inner = np.flatnonzero((np.abs(mesh.points - mesh.points.mean(axis=0)) < 1e-9).all(axis=1))
    model = clamped(mesh, held=np.setdiff1d(np.arange(mesh.n_nodes), inner))
    model.fix(inner, "xy")
    return model


WOOD = kl.Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.4, 0.3, 0.4, 0.7e9, 0.05e9, 0.6e9, 450.0)
MODELS = {
    **{f"clamped {kind}": lambda kind=kind: clamped(box(kind=kind)) for kind in KINDS},
    "mixed": mixed,
    "linear beside quadratic": orders,
    "bodies": lambda: bodies(5),
    "bodies of one brick": lambda: bodies(60, cells=(1, 1, 1)),
    "bodies of six tetrahedra": lambda: bodies(40, cells=(1, 1, 1), kind="10N"),
    "unlike bodies": lambda: bodies(3, stiffer=1e3),
    "periodic": periodic,
    "periodic, quadratic": lambda: periodic("20N"),
    "end that moves as one": stiff_end,
    "end that moves as one, quadratic": lambda: stiff_end("20N"),
    "independent that is held": lambda: stiff_end(held=True),
    "independent that is held, quadratic": lambda: stiff_end("10N", held=True),
    "rigid end, 20N": lambda: rigid_end("20N"),
    "rigid end, 10N": lambda: rigid_end("10N"),
    "partly fixed": partly_fixed,
    "prescribed": prescribed,
    "contrast": lambda: contrast(1e6),
    "contrast, quadratic": lambda: contrast(1e3, "10N"),
    "nodes without elements": scattered,
    "distorted": distorted,
    "distorted, quadratic": lambda: distorted("27N"),
    "bar": lambda: clamped(box((40, 1, 1), (40, 1, 1))),
    "bar, quadratic": lambda: clamped(box((12, 1, 1), (12, 1, 1), "20N")),
    "one brick": lambda: clamped(box(cells=(1, 1, 1))),
    "tetrahedra in one brick": lambda: clamped(box(cells=(1, 1, 1), kind="4N")),
    "one unknown": one_unknown,
    "nearly incompressible": lambda: clamped(box(), kl.Isotropic3D(E=2e11, nu=0.49, density=7850.0)),
    "wood": lambda: clamped(box(), WOOD),
}


@cache
def factorized_of(name):
    return factorized(MODELS[name]())


def assert_solved(model, accuracy=1e-10, exact=None):
    """Assert that multigrid solves a model, and as a factorization does; return the report."""
    found, (u, rounding) = model.solve("amg"), exact or factorized(model)
    assert found.report.solver == "amg"
    assert found.report.backward_error < 3e-14
    close(found.u, u, accuracy + rounding)
    return found.report


@pytest.mark.parametrize("name", MODELS)
def test_displacements_are_those_of_a_factorization(path, name):
    assert_solved(MODELS[name](), exact=factorized_of(name))


@pytest.mark.parametrize(("E", "length"), [(1e-6, 1e-3), (1e-6, 1e6), (1e15, 1.0), (1e15, 1e6)])
def test_units_do_not_matter(path, E, length):
    mesh = box(np.array([1.0, 0.8, 0.6]) * length, (6, 5, 4))
    report = assert_solved(clamped(mesh, kl.Isotropic3D(E=E, nu=0.3, density=1e-8 * E)))
    assert report.iterations <= 25


def test_the_origin_does_not_matter(path):
    mesh = box(cells=(6, 5, 4))
    near = assert_solved(clamped(mesh))
    mesh = mesh.replace(points=mesh.points + 1e6)
    rounding = 1e6 * np.finfo(float).eps / 0.15  # of coordinates, to the size of a cell
    assert assert_solved(clamped(mesh), accuracy=rounding).iterations <= near.iterations + 2


@pytest.mark.parametrize(("kind", "n"), [("8N", 10), ("8N", 16), ("20N", 4)])
def test_iterations_do_not_grow_with_the_mesh(path, kind, n):
    system, b = equations(clamped(box((1, 1, 1), (n, n, n), kind)))
    solver = system.equations._multigrid
    x, iterations, converged = solver.solve(b, 1e-10, system.norm, None)
    assert converged
    assert iterations <= 25
    residual = np.where(system.constraint_map.is_free, b - system.K @ x, 0.0)
    assert np.linalg.norm(residual) <= 1.01e-10 * np.linalg.norm(b)
    if kind == "20N":  # linear elements are the first coarse level
        assert solver.levels[:2] == [3 * len(system.nodes), 3 * 5**3]


# ---- the solver by itself ------------------------------------------------------------------------


def equations(model):
    """Return the system of a model and its right side, zero at fixed components."""
    system = system_of(model, solver="amg")
    free = system.constraint_map.is_free
    return system, np.where(free, system.gather(GRAVITY.forces(model.mesh, model.element_groups())), 0.0)


def solver_of(model):
    """Return a solver, its right side and the norm of its matrix."""
    system, b = equations(model)
    return system.equations._multigrid, b, system.norm


CYCLES = [
    "clamped 8N",
    "clamped 10N",
    "clamped 20N",
    "partly fixed",
    "bodies",
    "bar",
    "contrast",
    "rigid end, 20N",
]


@pytest.mark.parametrize("name", CYCLES)
def test_the_preconditioner_is_symmetric_and_positive(path, name):
    solver, b, _ = solver_of(MODELS[name]())
    free = b != 0
    draw = np.random.default_rng(2)
    for _ in range(5):
        x, y = (np.where(free, draw.standard_normal(len(b)), 0.0) for _ in range(2))
        Mx, My = solver.precondition(x), solver.precondition(y)
        size = np.sqrt((x @ Mx) * (y @ My))
        assert x @ My == pytest.approx(y @ Mx, rel=0, abs=1e-5 * size)
        assert x @ Mx > 0
        np.testing.assert_array_equal(Mx[~free], 0.0)
        for k in (2, 9):  # at once, as one by one
            several = solver.precondition(np.stack([(i + 1) * x - i * y for i in range(k)]))
            expected = np.stack([(i + 1) * Mx - i * My for i in range(k)])
            np.testing.assert_allclose(several, expected, rtol=0, atol=2e-5 * k * np.abs([Mx, My]).max())


THREADED = ["clamped 8N", "clamped 20N", "clamped 10N", "partly fixed", "periodic", "large"]


@compiled
@pytest.mark.parametrize("name", THREADED)
def test_results_do_not_depend_on_the_number_of_threads(name):
    models = MODELS | {"large": lambda: clamped(box(cells=(14, 12, 12)))}
    same_on_all_threads(lambda: models[name]().solve("amg").u, (1, 2, 3, 5, 2))


def test_results_are_the_same_from_run_to_run(path):
    np.testing.assert_array_equal(*(clamped(box()).solve("amg").u for _ in range(2)))


def test_a_second_right_side_needs_no_set_up(path, monkeypatch):
    made, plain = [], multigrid.multigrid
    monkeypatch.setattr(multigrid, "multigrid", lambda *arguments: made.append(1) or plain(*arguments))
    model = clamped(box())
    ready = model.static("amg")
    first, other = ready.solve(), ready.solve([kl.Gravity((0.0, 0.0, 1.0))])
    assert len(made) == 1
    assert not np.array_equal(first.u, other.u)
    np.testing.assert_array_equal(ready.solve().u, first.u)


@pytest.mark.parametrize("tolerance", [1e-10, 1e-15])
def test_progress_rises_to_one(path, tolerance):
    seen = []
    system, b = equations(clamped(box((2, 1, 1), (10, 6, 6))))
    system.progress = lambda phase, fraction: seen.append(fraction) if phase == "solve" else None
    _, solution = system.solve(b.reshape(-1, 3), tolerance=tolerance)
    assert solution.iterations <= len(seen) <= solution.iterations + 1
    assert seen == sorted(seen)
    assert 0 <= seen[0] < seen[len(seen) // 2]
    assert seen[-1] == 1.0


def test_what_a_callback_raises_ends_the_solution(path):
    solver, b, norm = solver_of(clamped(box(cells=(6, 6, 6))))
    seen = []

    def stop(residual):
        seen.append(residual)
        if len(seen) == 3:
            raise KeyboardInterrupt
        return True

    with pytest.raises(KeyboardInterrupt):
        solver.solve(b, 1e-10, norm, stop)
    assert len(seen) == 3
    again, other = solver.solve(b, 1e-10, norm), solver.solve(b, 1e-10, norm)
    np.testing.assert_array_equal(again[0], other[0])
    assert again[2]


def test_zeros_and_numbers_that_are_not_finite_end_the_iteration(path):
    solver, b, norm = solver_of(clamped(box()))
    x, iterations, converged = solver.solve(np.zeros_like(b), 1e-10, norm)
    assert (iterations, converged) == (0, True)
    np.testing.assert_array_equal(x, 0.0)
    np.testing.assert_array_equal(solver.precondition(np.zeros_like(b)), 0.0)
    b[np.flatnonzero(b)[0]] = np.nan
    with np.errstate(invalid="ignore"):
        _, iterations, converged = solver.solve(b, 1e-10, norm)
    assert not converged
    assert iterations <= 2


def kernel_of(K, fixed, points, thin=0):
    return MODULE.Multigrid(MODULE.Matrix(K.indptr, K.indices, K.data), fixed, points, 2, 12.0, 0.0, thin)


@compiled
def test_wrong_shapes_are_refused():
    system, b = equations(clamped(box()))
    K, n = stiffness_of(system.points, system.groups), 3 * len(system.points)
    points, modes, fixed = np.zeros((n // 3, 3)), np.zeros((n, 6)), np.zeros(n, np.uint8)
    made = kernel_of(K, fixed, points)
    made.aggregate(modes)
    for error, message, call in (
        (ValueError, "data must be", lambda: MODULE.Matrix(K.indptr, K.indices, K.data[:-1])),
        (ValueError, "indptr must end", lambda: MODULE.Matrix(K.indptr[:-1], K.indices, K.data)),
        (TypeError, "indptr must be", lambda: MODULE.Matrix(K.indptr.astype(np.int64), K.indices, K.data)),
        (ValueError, "fixed must have one entry", lambda: kernel_of(K, fixed[:5], points)),
        (ValueError, r"modes must be \(3n, 6\)", lambda: kernel_of(K, fixed, points).aggregate(modes[:-1])),
        (ValueError, "r must have one number", lambda: made.cycle(b[:-1])),
        (ValueError, "b must have one number", lambda: made.solve(b[:-1], 1e-10, 1.0, 10, None)),
    ):
        with pytest.raises(error, match=message):
            call()


@compiled
def test_coarse_levels_of_the_wrong_shape_are_refused():
    system, _ = equations(clamped(box(kind="20N", cells=(2, 2, 2))))
    K, level = stiffness_of(system.points, system.groups), p_coarse_level(system.points, system.groups)
    below = MODULE.Matrix(level.K.indptr, level.K.indices, level.K.data)
    n, m = len(system.points), len(level.nodes)
    fixed, corners, points = np.zeros(3 * n, np.uint8), np.zeros(3 * m, np.uint8), np.zeros((n, 3))
    rows, none = np.arange(n + 1, dtype=np.int32), np.zeros(n, np.int32)
    interpolation = level.indptr, level.indices, level.weights
    linear = (below, corners, *interpolation, np.zeros((m, 3)), np.zeros((3 * m, 6)))
    plate = rows, none, np.zeros((n, 3, 6), np.float32), np.zeros((6, 12))
    for method, right, at, value, message in (
        ("aggregate_linear", linear, 1, corners[:-1], "one entry for each linear unknown"),
        ("aggregate_linear", linear, 2, level.indptr[:-1], "one row for each node"),
        ("aggregate_linear", linear, 3, level.indices + 3 * m, "nodes of the linear level"),
        ("aggregate_linear", linear, 4, level.weights[:-1], "one weight, or 3 x 3, for each"),
        ("aggregate_linear", linear, 6, np.zeros((3, 6)), "modes must be"),
        ("aggregate_plate", plate, 0, rows[:-1], "one row for each node"),
        ("aggregate_plate", plate, 1, none + 1, "nodes of the plate"),
        ("aggregate_plate", plate, 2, np.zeros((3, 3, 6), np.float32), r"blocks must be \(k, 3, 6\)"),
        ("aggregate_plate", plate, 3, np.zeros((5, 12)), r"modes must be \(6m, 12\)"),
    ):
        kernel = kernel_of(K, fixed, points, thin=int(method == "aggregate_plate"))
        with pytest.raises(ValueError, match=message):
            getattr(kernel, method)(*right[:at], value, *right[at + 1 :])


@compiled
def test_parts_without_stiffness_do_no_harm():
    system, b = equations(clamped(box()))
    K, free = stiffness_of(system.points, system.groups), system.constraint_map.is_free
    K.data[K.rows() < 9] = 0.0
    K.data[K.indices < 9] = 0.0
    b[:27] = 0.0
    solver = multigrid.Compiled(K, free, system.points, None)
    x, _, converged = solver.solve(b, 1e-10, K.norm())
    assert converged
    assert np.isfinite(x).all()
    np.testing.assert_array_equal(x[:27], 0.0)

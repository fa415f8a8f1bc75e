"""The plan of solution: facts of a system lead to a method, and each threshold has two sides."""

import numpy as np
import pytest
from computing import compiled

import kratos_lite as kl
from kratos_lite.solvers import coarse_level, plan, plate_level
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.plan import Facts, Plan


def facts(unknowns, **known):
    """Return facts; those that are found by functions are given as values."""
    plain = {name: known.pop(name) for name in ("dofs", "symmetric") if name in known}
    known = {"compiled": True} | known
    return Facts(unknowns, **plain, **{name: lambda value=value: value for name, value in known.items()})


@pytest.mark.parametrize(
    ("unknowns", "known", "method"),
    [
        # few unknowns, with kernels and without
        (60, {}, "dense"),
        (61, {}, "amg"),
        (60, {"dofs": 2400}, "dense"),
        (60, {"dofs": 2401}, "direct"),
        (600, {"compiled": False}, "dense"),
        (601, {"compiled": False}, "direct"),
        (10_000, {"compiled": False}, "direct"),
        (10_001, {"compiled": False}, "amg"),
        # matrices that are not symmetric
        (60, {"symmetric": False}, "dense"),
        (61, {"symmetric": False}, "direct"),
        (10**6, {"symmetric": False}, "direct"),
        # nearly incompressible: few unknowns, narrow bands, plain elements that lock
        (1_000, {"bulk_over_shear": (0.0, 50.0)}, "amg"),
        (1_000, {"bulk_over_shear": (0.0, 50.1)}, "direct"),
        (1_000, {"bulk_over_shear": (50.1, 0.0)}, "direct"),
        (1_001, {"bulk_over_shear": (50.0, 0.0), "bandwidth": 1e4}, "amg"),
        (1_001, {"bulk_over_shear": (50.1, 0.0), "bandwidth": 1e4}, "displacement-pressure"),
        (5_000, {"bulk_over_shear": (50.1, 0.0), "bandwidth": 632}, "direct"),
        (5_000, {"bulk_over_shear": (50.1, 0.0), "bandwidth": 633}, "displacement-pressure"),
        (10_000, {"bulk_over_shear": (50.1, 0.0), "bandwidth": 447}, "direct"),
        (10_001, {"bulk_over_shear": (50.1, 0.0), "bandwidth": 1}, "displacement-pressure"),
        (30_000, {"bulk_over_shear": (0.0, 3000.0)}, "amg"),
        (30_000, {"bulk_over_shear": (0.0, 3001.0)}, "direct"),
        (30_000, {"bulk_over_shear": (3001.0, 3001.0)}, "direct"),
        (30_000, {"bulk_over_shear": (3001.0, 3000.0)}, "displacement-pressure"),
        (150_001, {"bulk_over_shear": (0.0, 3001.0)}, "amg"),
    ],
)
def test_method_follows_from_facts(unknowns, known, method):
    assert plan.choose("auto", facts(unknowns, **known)).method == method


@pytest.mark.parametrize(
    ("known", "matrix_free"),
    [
        ({}, True),
        ({"has_product": False}, False),
        ({"contrast": 1000.0}, True),
        ({"contrast": 1000.1}, False),
        ({"is_stretched": True}, False),
        ({"is_plate": True}, False),
    ],
)
def test_products_are_for_compact_cells_of_like_stiffness(known, matrix_free):
    known = {"has_product": True} | known
    assert plan.choose("amg", facts(1000, **known)) == Plan("amg", "requested", matrix_free)
    assert not plan.choose("direct", facts(1000, **known)).matrix_free
    assert not plan.choose("amg", facts(1000, bulk_over_shear=(51.0, 0.0), **known)).matrix_free


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_a_requested_method_is_taken(solver):
    chosen = plan.choose(solver, facts(500, bulk_over_shear=(0.0, 1e4)))
    assert chosen == Plan(solver, "requested")
    mixed = plan.choose(solver, facts(500, bulk_over_shear=(1e4, 0.0)))
    assert mixed.method == ("displacement-pressure" if solver == "amg" else solver)


def test_reasons_name_numbers_and_thresholds():
    def reason(unknowns, **known):
        return plan.choose("auto", facts(unknowns, **known)).reason

    assert reason(24) == "24 unknowns ≤ 60: a full matrix is fastest"
    assert reason(61) == "61 unknowns > 60: multigrid is fastest and takes least memory"
    assert reason(700, compiled=False) == "700 unknowns ≤ 10000: sparse factorization is fastest"
    assert reason(700, bulk_over_shear=(0.0, 51.0)) == (
        "few unknowns with a bulk modulus > 50 shear moduli: a factorization is fastest"
    )


def test_costly_facts_are_not_asked_for_small_systems():
    def never():
        pytest.fail("a fact that does not matter")

    lazy = dict.fromkeys(("compiled", "bulk_over_shear", "bandwidth", "has_product", "is_plate"), never)
    assert plan.choose("auto", Facts(60, 90, **lazy)).method == "dense"
    assert plan.choose("direct", Facts(10**6, 10**6, **lazy)).method == "direct"


def test_full_matrices_have_a_largest_size():
    assert plan.choose("dense", facts(9_000, dofs=10_000)).method == "dense"
    with pytest.raises(kl.InputError, match="up to 10000 degrees of freedom; got 10001"):
        plan.choose("dense", facts(9_000, dofs=10_001))


@pytest.mark.parametrize(("installed", "limit"), [(True, 150_000), (False, 30_000)])
def test_superlu_is_quick_on_fewer_unknowns(monkeypatch, installed, limit):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: object() if installed else None)
    assert plan.is_quick_to_factorize(limit)
    assert not plan.is_quick_to_factorize(limit + 1)


def test_after_an_iteration_few_unknowns_are_factorized():
    failed = plan.after(7, 1e-10, 150_000, False)
    assert failed == Plan("direct", "multigrid stopped after 7 iterations short of 1e-10")
    assert plan.after(60, 1e-10, 10, True).reason.endswith("more than 400: a factorization is faster")
    with pytest.raises(kl.SolveError, match="150001 unknowns are too many to factorize instead"):
        plan.after(7, 1e-10, 150_001, False)


def test_bands_are_narrow_and_small():
    assert plan.of_band(10_000, 1600, 1601) == Plan("band", "width 1600 ≤ 1600: a band is fastest")
    assert plan.of_band(10_000, 1601, 1602) == Plan(
        "sparse", "width 1601 > 1600: a sparse factorization takes less work"
    )
    assert plan.of_band(100_000, 499, 500).method == "band"
    assert plan.of_band(100_000, 500, 501) == Plan(
        "sparse", "50100000 numbers > 50000000: a band takes too much memory"
    )


@pytest.mark.parametrize(
    ("solver", "unknowns", "symmetric", "method"),
    [
        ("auto", 30_000, True, "direct"),
        ("dense", 30_000, True, "direct"),
        ("auto", 30_001, True, "amg"),
        ("amg", 10, True, "amg"),
        ("direct", 30_001, True, "direct"),
        ("amg", 30_001, False, "direct"),
    ],
)
def test_matrices_of_motions(solver, unknowns, symmetric, method):
    assert plan.repeated(solver, unknowns, symmetric).method == method


@pytest.mark.parametrize(
    ("solver", "unknowns", "nearly", "mumps", "options", "method"),
    [
        ("auto", 6_000, False, True, False, "direct"),
        ("auto", 6_001, False, True, False, "amg"),
        ("auto", 6_000, False, False, False, "amg"),
        ("auto", 6_000, False, True, True, "amg"),
        ("auto", 300_000, True, True, False, "direct"),
        ("auto", 300_001, True, True, False, "amg"),
        ("dense", 10**6, False, False, False, "direct"),
        ("amg", 10, True, True, False, "amg"),
    ],
)
def test_methods_over_ranks(solver, unknowns, nearly, mumps, options, method):
    shared = facts(unknowns, bulk_over_shear=(0.0, 50.1 if nearly else 50.0))
    assert plan.over_ranks(solver, shared, mumps, options).method == method


# ---- thresholds that change a result ---------------------------------------------------------------------


def system_of(size=(1.0, 1.0, 1.0), cells=(8, 8, 8), side="z-"):
    """Return the equations of a box of 8N, clamped at a side, and its weight in no special direction."""
    mesh = kl.box(size, cells, "KinematicLinear3D8N")
    model = kl.Model(mesh, kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0))
    model.fix(side)
    points, constraints = model.mesh.points, model.supports.constraint_map
    forces = np.tile([3.0, 4.0, -9.0], (len(points), 1))
    return ConstrainedSystem(points, model.element_groups(), constraints, solver="amg"), forces


def test_few_unknowns_are_iterated_to_round_off_whatever_the_tolerance(monkeypatch):
    system, forces = system_of()
    few, solution = system.solve(forces, tolerance=1e-3)
    size = np.abs(few).max()
    np.testing.assert_allclose(system.solve(forces, tolerance=1e-14)[0], few, rtol=0, atol=1e-12 * size)
    monkeypatch.setattr(plan, "DIRECT_LIMIT", len(system.constraint_map.free) - 1)
    many, sooner = system.solve(forces, tolerance=1e-3)
    assert sooner.iterations < solution.iterations
    assert 1e-9 * size < np.abs(many - few).max() < 1e-2 * size


@compiled
@pytest.mark.parametrize(
    ("module", "name", "size", "cells", "side"),
    [
        (coarse_level, "STRETCHED", (1.0, 1.0, 0.2), (11, 11, 11), "z-"),
        (plate_level, "FLAT", (1.0, 1.0, 0.05), (20, 20, 1), "x-"),
    ],
)
def test_products_alone_do_not_serve_flat_cells_and_plates(module, name, size, cells, side, monkeypatch):
    """Without these thresholds iterations are at least half as many again."""
    system, forces = system_of(size, cells, side)
    assert not system.plan.matrix_free
    iterations = system.solve(forces)[1].iterations
    monkeypatch.setattr(module, name, 0.0 if name == "FLAT" else 1e9)
    careless, _ = system_of(size, cells, side)
    assert careless.plan.matrix_free or name == "FLAT"
    assert careless.solve(forces)[1].iterations > 1.5 * iterations


@pytest.mark.parametrize(("aspect", "stretched"), [(2.9, False), (3.1, True)])
def test_cells_are_stretched_from_a_third_on(aspect, stretched):
    model = kl.Model(kl.box((aspect, 1.0, 1.0), (1, 1, 1)), kl.Isotropic3D(E=1.0, nu=0.3))
    assert coarse_level.is_stretched(model.mesh.points, model.element_groups()) == stretched


@pytest.mark.parametrize(("aspect", "many", "few"), [(3.5, 11, 10), (31.0, 2, 1), (29.0, 11, 10)])
def test_one_of_20_stretched_cells_matters_and_one_of_200_extreme_ones(aspect, many, few):
    for count, stretched in ((many, True), (few, False)):
        mesh = kl.box((200.0, 1.0, 1.0), (200, 1, 1))
        widths = np.where(np.arange(200) < count, 1 / aspect, 1.0)
        X = mesh.points.copy()
        X[:, 0] = np.interp(X[:, 0], np.arange(201.0), np.insert(np.cumsum(widths), 0, 0.0))
        groups = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3)).element_groups()
        assert coarse_level.is_stretched(X, groups) == stretched


@pytest.mark.parametrize(("thickness", "flat"), [(0.09, True), (0.11, False)])
def test_a_plate_is_ten_times_as_wide_as_thick(thickness, flat):
    points = np.stack(np.meshgrid(*[np.linspace(0, 1, 20)] * 3), axis=-1).reshape(-1, 3)
    axes = plate_level.plate_axes(points * [1.0, 1.0, thickness], np.ones(points.size, dtype=bool))
    assert (axes is not None) == flat

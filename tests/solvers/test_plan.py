"""The plan of solution: facts of a system lead to a method, and each threshold has two sides."""

import numpy as np
import pytest
from computing import compiled
from systems import system_of

import kratos_lite as kl
from kratos_lite.solvers import coarse_level, plan, plate_level
from kratos_lite.solvers.plan import Facts, Plan

STEEL = kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0)


def facts(unknowns, **known):
    """Return facts; those that are found by functions are given as values."""
    plain = {name: known.pop(name) for name in ("dofs", "symmetric", "use") if name in known}
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
        # without kernels no pressures
        (30_000, {"bulk_over_shear": (51.0, 0.0), "compiled": False}, "direct"),
        (150_001, {"bulk_over_shear": (51.0, 0.0), "compiled": False}, "amg"),
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


@pytest.mark.parametrize(
    ("band", "method", "reason"),
    [
        ((10_000, 1600, 1601), "band", "width 1600 ≤ 1600: a band is fastest"),
        ((10_000, 1601, 1602), "sparse", "width 1601 > 1600: a sparse factorization takes less work"),
        ((100_000, 499, 500), "band", "width 499 ≤ 5059: a band is fastest"),
        ((100_000, 500, 501), "sparse", "50100000 numbers > 50000000: a band takes too much memory"),
    ],
)
def test_bands_are_narrow_and_small(band, method, reason):
    assert plan.of_band(*band) == Plan(method, reason)


@pytest.mark.parametrize(
    ("solver", "unknowns", "symmetric", "method"),
    [
        ("auto", 4_000, True, "direct"),
        ("dense", 4_000, True, "direct"),
        ("auto", 4_001, True, "amg"),
        ("amg", 10, True, "amg"),
        ("direct", 4_001, True, "direct"),
        ("amg", 4_001, False, "direct"),
    ],
)
def test_matrices_of_motions(solver, unknowns, symmetric, method):
    known = facts(unknowns, use="steps", symmetric=symmetric)
    assert plan.choose(solver, known).method == method


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


def system(size=(1.0, 1.0, 1.0), cells=(8, 8, 8), side="z-"):
    """Return the equations of a box of 8N, clamped at a side, and its weight in no special direction."""
    model = kl.Model(kl.box(size, cells, "KinematicLinear3D8N"), STEEL)
    model.fix(side)
    return system_of(model, solver="amg"), np.tile([3.0, 4.0, -9.0], (model.mesh.n_nodes, 1))


def test_few_unknowns_are_iterated_to_round_off_whatever_the_tolerance(monkeypatch):
    few_unknowns, forces = system()
    few, solution = few_unknowns.solve(forces, tolerance=1e-3)
    size = np.abs(few).max()
    np.testing.assert_allclose(few_unknowns.solve(forces, tolerance=1e-14)[0], few, rtol=0, atol=1e-12 * size)
    monkeypatch.setattr(plan, "DIRECT_LIMIT", len(few_unknowns.constraint_map.free) - 1)
    many, sooner = few_unknowns.solve(forces, tolerance=1e-3)
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
    careful, forces = system(size, cells, side)
    assert not careful.plan.matrix_free
    iterations = careful.solve(forces)[1].iterations
    monkeypatch.setattr(module, name, 0.0 if name == "FLAT" else 1e9)
    careless, _ = system(size, cells, side)
    assert careless.plan.matrix_free or name == "FLAT"
    assert careless.solve(forces)[1].iterations > 1.5 * iterations


@pytest.mark.parametrize(
    ("aspect", "count", "stretched"),
    [
        *[(2.9, 200, False), (3.1, 200, True), (3.5, 11, True), (3.5, 10, False)],
        *[(31.0, 2, True), (31.0, 1, False), (29.0, 11, True), (29.0, 10, False)],
    ],
)
def test_one_of_20_stretched_cells_matters_and_one_of_200_extreme_ones(aspect, count, stretched):
    mesh = kl.box((200.0, 1.0, 1.0), (200, 1, 1))
    widths = np.where(np.arange(200) < count, 1 / aspect, 1.0)
    X = mesh.points.copy()
    X[:, 0] = np.interp(X[:, 0], np.arange(201.0), np.insert(np.cumsum(widths), 0, 0.0))
    assert coarse_level.is_stretched(X, kl.Model(mesh, STEEL).element_groups()) == stretched


@pytest.mark.parametrize(("thickness", "flat"), [(0.09, True), (0.11, False)])
def test_a_plate_is_ten_times_as_wide_as_thick(thickness, flat):
    points = np.stack(np.meshgrid(*[np.linspace(0, 1, 20)] * 3), axis=-1).reshape(-1, 3)
    axes = plate_level.plate_axes(points * [1.0, 1.0, thickness], np.ones(points.size, dtype=bool))
    assert (axes is not None) == flat

"""Convergence studies: orders, limits and bands beside exact values, and values that do not converge."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.convergence import limit_of
from kratos_lite.errors import KratosLiteError
from kratos_lite.verification import fields
from kratos_lite.verification.scenes import manufactured

MIDDLE = np.full(3, 0.5)


def beam(element="KinematicLinear3D8N", cells=(2, 1, 1), nu=0.0):
    model = kl.Model(kl.box((4, 1, 1), cells, element), kl.Isotropic3D(E=1e6, nu=nu, density=1.0))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 5.0)))
    return model


TIP = kl.MeanDisplacement("x+", "z")


@pytest.mark.parametrize("order", [0.6, 1.0, 2.0, 3.7, 8.0])
@pytest.mark.parametrize("sizes", [(4, 2, 1), (1, 0.7, 0.4), (8, 4, 2, 1), (3, 2, 1.7)])
def test_power_laws_have_their_order_and_limit(order, sizes):
    h, exact, a = np.array(sizes, dtype=float), 3.0, -0.02
    f = exact + a * h**order
    orders, limit, band, warning = limit_of(h, f)
    assert warning == ""
    assert np.isnan(orders[:2]).all()
    assert np.abs(orders[2:] - order).max() < 1e-6
    assert abs(limit - exact) < 1e-9
    assert abs(band - 1.25 * abs(f[-1] - exact)) < 1e-9


@pytest.mark.parametrize("kind", ["8N", "10N"])
def test_the_band_of_a_manufactured_solution_holds_the_exact_value(kind):
    exact = fields.manufactured(MIDDLE)[0]
    quantity = kl.DisplacementAt(MIDDLE, "x")
    sizes = [1 / 2, 1 / 4, 1 / 6] if kind == "10N" else [1 / 4, 1 / 6, 1 / 8]
    study = kl.converge(lambda h: manufactured(kind, round(1 / h)).model, quantity, sizes)
    low, high = study.interval
    assert study.warning == ""
    assert abs(study.orders[-1] - {"8N": 2, "10N": 3}[kind]) < 0.35
    assert low < exact < high
    assert abs(study.extrapolated - exact) < 0.4 * abs(study.values[-1] - exact)


def test_the_hole_of_a_cylinder_on_its_true_surface():
    """Outward displacement by Lamé: u(a) = p a / E ((1 - ν) a² + (1 + ν) b²) / (b² - a²) in plane stress."""
    mesh = kl.annulus(1.0, 2.0, 0.5, cells=(1, 8, 1), element="KinematicLinear3D8N")
    model = kl.Model(mesh, kl.Isotropic3D(E=1e3, nu=0.3))
    model.fix("z-", "z")
    for i, axis in enumerate("xy"):
        model.fix(np.abs(mesh.points[:, i]) < 1e-9, axis)
    model.add(kl.Pressure("inner", 1.0))

    def onto(radius):
        return lambda X: X * np.column_stack([*[radius / np.hypot(X[:, 0], X[:, 1])] * 2, np.ones(len(X))])

    (inner,) = mesh.nodes((1.0, 0.0, 0.0))
    geometry = {"inner": onto(1.0), "outer": onto(2.0)}
    study = kl.converge(model, lambda result: result.u[inner, 0], geometry=geometry)
    exact = 1 / 1e3 * (0.7 * 1 + 1.3 * 4) / 3
    low, high = study.interval
    assert low < exact < high
    assert abs(study.extrapolated / exact - 1) < 6e-3
    assert abs(study.orders[-1] - 2) < 0.5
    straight = kl.converge(model, lambda result: result.u[inner, 0])
    assert straight.of == "value"  # not <lambda>
    assert abs(straight.values[-1] / exact - 1) > 0.05  # a polygon with 8 sides stays one


def test_unknowns_and_values_are_those_of_the_meshes():
    study = kl.converge(beam(), TIP)
    finer = [beam(cells=(2 * n, n, n)) for n in (1, 2, 4)]
    found = [model.solve() for model in finer]
    assert study.unknowns.tolist() == [result.report.unknowns for result in found]
    assert np.abs(study.values / [TIP.value(result) for result in found] - 1).max() < 1e-9
    assert study.sizes.tolist() == [1, 0.5, 0.25]


def test_the_frequency_of_a_bar():
    bar = beam()
    bar.fix(np.arange(bar.mesh.n_nodes), "yz")
    study = kl.converge(bar, lambda modes: modes[0][0], solve=lambda model: model.modes(1))
    exact = np.pi / 2 * np.sqrt(1e6 / 1.0) / 4
    low, high = study.interval
    assert low < exact < high
    assert abs(study.extrapolated / exact - 1) < 1e-3
    assert abs(study.orders[-1] - 2) < 0.1


def test_a_law_that_is_not_linear():
    law = kl.J2Plasticity3D(E=1e6, nu=0.0, yield_stress=4.0, hardening=1e6)
    plastic = kl.Model(kl.box((2, 1, 1)), law)
    plastic.fix("x-", "x")
    plastic.fix("y-", "y")
    plastic.fix("z-", "z")
    plastic.add(kl.Traction("x+", (8.0, 0, 0)))
    study = kl.converge(plastic, kl.MeanDisplacement("x+", "x"))
    assert abs(study.extrapolated - 2 * (8 / 1e6 + 4 / 1e6)) < 1e-10
    assert study.band < 1e-10
    assert study.warning == ""


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([1.0, 2.0, 1.5], "to and fro"),
        ([1.0, 2.0, 4.0], "change by more"),
        ([1.0, 2.0, 2.8], "the order 0.32 is below 0.5"),
        ([0.0, 1.0, 1.5, 1.6], "the last two orders differ"),
        ([2.0, 1.0, 1.5, 1.75, 1.8], "the last two orders differ"),
    ],
)
def test_values_out_of_the_asymptotic_range_say_so_and_have_a_wide_band(values, words):
    f = np.array(values)
    _, limit, band, warning = limit_of(0.5 ** np.arange(len(f)), f)
    assert words in warning
    assert warning.startswith("not in the asymptotic range")
    assert limit == f[-1]
    assert band == 3 * np.ptp(f[-3:])


def test_a_stress_at_a_clamped_edge_has_no_limit():
    cube = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), kl.Isotropic3D(E=1e6, nu=0.3))
    cube.fix("x-")
    cube.add(kl.Traction("x+", (1.0, 0, 0)))
    study = kl.converge(cube, kl.StressAt((0.0, 0.0, 0.0), "xx"))
    assert "not in the asymptotic range" in study.warning
    assert "warning" in str(study)


def test_values_that_stay_have_no_order():
    for f in ([0.0] * 3, [2.0] * 3, [2.0, 2.0 + 1e-13, 2.0 + 3e-13]):
        orders, _, band, warning = limit_of(0.5 ** np.arange(3), np.array(f))
        assert np.isnan(orders).all()
        assert band < 1e-11
        assert warning == ""


def test_the_table_and_the_picture(tmp_path):
    study = kl.converge(beam(), TIP)
    labels = [label for label, _ in study.table()]
    assert labels == ["quantity", "24 unknowns", "108 unknowns", "600 unknowns", "extrapolated"]
    rows = dict(study.table())
    assert rows["quantity"] == "MeanDisplacement('x+', 'z')"
    assert "change" not in rows["24 unknowns"]
    assert "order" not in rows["108 unknowns"]
    assert f"order {study.orders[2]:.2f}" in rows["600 unknowns"]
    assert "nan" not in str(study)
    pytest.importorskip("matplotlib")
    axes = study.plot(tmp_path / "study.png").axes[0]
    assert axes.lines[0].get_ydata().tolist() == study.values.tolist()
    assert (tmp_path / "study.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"meshes": 2},
            "meshes of a model, unlike sizes of a function of h, must be a whole number from 3 to 20; got 2",
        ),
        ({"model": lambda h: beam(), "meshes": 3}, "must have shape"),
        ({"model": lambda h: beam(), "meshes": [1.0, 0.5]}, "three or more sizes > 0 that fall"),
        ({"model": lambda h: beam(), "meshes": [1.0, 0.5, 0.7]}, "three or more sizes > 0 that fall"),
        ({"model": lambda h: 3, "meshes": [3, 2, 1]}, "the model of size 3 must be a Structure"),
        (
            {"model": lambda h: beam(), "meshes": [3, 2, 1], "geometry": {}},
            "with its geometry, or a function",
        ),
        ({"model": 3}, "a model, with its geometry, or a function of h"),
        ({"quantity": 3}, "a quantity must be one such as"),
        ({"quantity": lambda result: np.nan}, "the value of the quantity must be finite"),
        ({"quantity": kl.ReactionOf([0, 1, 2], "x")}, "is of rows of nodes"),
        ({"solve": "modes"}, "solve must be a function of a model"),
        ({"geometry": {"hub": lambda X: X}}, "no part 'hub'"),
    ],
)
def test_studies_that_cannot_be_made(options, words):
    with pytest.raises(KratosLiteError) as error:
        kl.converge(**{"model": beam(), "quantity": TIP, **options})
    assert words in str(error.value)


def test_a_model_with_a_motion_is_not_refined():
    wheel = kl.Model(kl.annulus(0.2, 1.0, 0.1), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    wheel.fix("inner")
    wheel.add(kl.ale.Rotation("z", rate=10.0))
    with pytest.raises(KratosLiteError, match="cannot be carried over to a finer one"):
        kl.converge(wheel, kl.MeanDisplacement("outer", "z"))


def test_the_last_value_is_not_called_extrapolated():
    values = iter((1.0, 2.0, 1.5))
    study = kl.converge(lambda h: beam(), lambda result: next(values), (3, 2, 1))
    assert study.warning
    assert "last value" in str(study)
    assert "extrapolated" not in str(study)

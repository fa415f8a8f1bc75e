"""What is refused, and what is doubtful, with its figures."""

import numpy as np
import pytest
from meshes import changed_at, elsewhere

import kratos_lite as kl
from kratos_lite.ale import Rotation, Translation
from kratos_lite.ale.checks import rayleigh_speed
from kratos_lite.errors import InputError, ModelError


def spun(model, **options):
    model.add(Rotation("z", **options))
    return model.solve().report.warnings


def box(wheels):
    return kl.Model(kl.box((1, 1, 1), (2, 2, 2), origin=(-0.5, -0.5, 0)), wheels.steel)


def disk(wheels):
    return wheels.disk("8N", 2, 32)


def cone(wheels):
    model = kl.Model(kl.box((10, 1, 1), (10, 1, 1)), wheels.steel)
    return elsewhere(model, model.mesh.points * (1 + 0.3 * model.mesh.points[:, :1] * [0, 1, 1]))


def bent_end(wheels):
    model = wheels.bar("8N", 4)
    end = model.mesh.nodes("x+")[0]
    return elsewhere(model, changed_at(model.mesh.points, (end, 1), model.mesh.points[end, 1] + 0.2))


@pytest.mark.parametrize(
    ("make", "motion", "words"),
    [
        (box, Rotation("z", 1.0), r"not one of revolution about the axis \[0.0, 0.0, 1.0\]: \d+% of"),
        (disk, Rotation("x", 1.0), "give the axis of the body and a point of it, center="),
        (disk, Rotation("z", 1.0, center=(0.5, 0.0, 0.0)), "give the axis of the body and a point of it, ce"),
        (cone, Translation("x", 5.0), r"not straight along the axis \[1\.0, 0\.0, 0\.0\]"),
        (bent_end, Translation("x", 1.0, boundaries="periodic"), "opposite one another; there are 4 and 4"),
    ],
)
def test_motions_that_do_not_fit_the_body(make, motion, words, wheels):
    model = make(wheels)
    with pytest.raises(ModelError, match=words):
        model.add(motion)
    assert model.motion is None


def test_a_wheel_that_stands_elsewhere(wheels):
    model = wheels.disk("8N", 2, 48)
    model = elsewhere(model, model.mesh.points[:, [2, 0, 1]] + (5.0, -3.0, 8.0))
    model.add(Rotation("x", rate=1.0, center=(0.0, -3.0, 8.0)))
    assert model.motion.leak(model.mesh) < 0.06


def test_polygonal_rim(wheels):
    coarse = spun(wheels.disk("8N", 2, 16), rate=10.0)
    assert any("of the velocity passes through the polygonal rim" in text for text in coarse)
    assert not any("rim" in text for text in spun(wheels.disk("20N", 1, 24), rate=10.0))


def test_rates_near_the_critical_one(wheels):
    (lowest,) = kl.critical_rate(wheels_with(wheels.disk("20N", 1, 24), 1.0))
    limit = f"the critical one, {lowest:.4g} rad/s on this mesh"
    for fraction, words in ((0.8, ""), (0.94, f"is near {limit}"), (-1.01, f"is above {limit}")):
        said = " ".join(spun(wheels.disk("20N", 1, 24), rate=fraction * lowest))
        assert words in said
        assert ("critical" in said) == bool(words)
    free = wheels.disk("20N", 1, 24, hub="free")
    free.add(Rotation("z", rate=87.0, stiffening=True))
    (warning,) = free.transient().equations.warnings
    assert "near the critical one, about 95.48 rad/s by wave speeds" in warning
    assert rayleigh_speed(wheels.c_p, wheels.c_s) == pytest.approx(95.481345662, rel=1e-10)


@pytest.mark.parametrize(
    ("rate", "damping", "words"),
    [
        (35.0, 0.0, ""),
        (41.0, 20.0, "the rate 41 rad/s is near the critical one, 43.6 rad/s on this mesh"),
        (-43.7, 0.0, "the rate 43.7 rad/s is above the critical one, 43.6 rad/s on this mesh"),
        (1e6, 20.0, "the rate 1e+06 rad/s is above the critical one, 43.6 rad/s on this mesh"),
    ],
)
def test_a_thick_wheel_bends_at_less_than_half_the_rate_of_waves(rate, damping, words, wheels):
    mesh = kl.annulus(0.3, 1.0, 0.25, (3, 32, 1), "KinematicLinear3D20N")
    model = kl.Model(mesh, wheels.steel)
    model.fix("inner")
    model.add(Rotation("z", rate=rate, damping=damping))
    result = model.solve()
    for warnings in (result.report.warnings, model.transient().equations.warnings):
        said = [text for text in warnings if "critical" in text]
        assert (len(said) == 1 and said[0].startswith(words)) if words else not said
    assert (result.report.motion["margin"] < 0) == ("above" in words)


def wheels_with(model, rate):
    model.add(Rotation("z", rate=rate))
    return model


@pytest.mark.parametrize(("ends", "share"), [("natural", 0.742), ("absorbing", 0.742), ("periodic", 0.9)])
def test_windows_near_their_critical_speed(ends, share, wheels):
    """With free surfaces it lies below c_s, and further below with free ends; in one dimension it is c_p."""
    bedded = kl.Model(kl.box((10, 1, 1), (20, 1, 1), "KinematicLinear3D20N"), wheels.steel)
    bedded.fix("z-")
    bedded.add(Translation("x", rate=0.95 * share * wheels.c_s, boundaries=ends))
    words = f"is near the critical one, {share * wheels.c_s:.4g}"[:-2]
    for warnings in (bedded.transient().equations.warnings, bedded.solve().report.warnings):
        assert sum(words in text for text in warnings) == 1
    model = wheels.bar("8N", 10)
    model.fix("x-", "x")
    model.add(kl.PointLoad(lambda X: np.abs(X[:, 0]) < 1e-9, (1.0, 0, 0), each=True))
    model.add(Translation("x", rate=0.95 * wheels.c_p, boundaries="natural"))
    assert any("m/s is near the critical one, 192.6 m/s on" in t for t in model.solve().report.warnings)


@pytest.mark.parametrize(("cells", "found"), [(80, True), (160, False)])
def test_a_rod_whose_critical_speeds_are_all_alike_is_solved(cells, found):
    """All are c = √(E/ρ), of many no iteration finds the lowest; u = F L / (E A (1 - v²/c²)) all the same."""
    model = kl.Model(kl.box((20, 1, 1), (cells, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1e3))
    model.fix(lambda X: np.ones(len(X), dtype=bool), "yz")
    model.fix("x-", "x")
    model.add(kl.Traction("x+", (10.0, 0, 0)))
    model.add(Translation("x", rate=10.0, boundaries="natural"))
    result = model.solve()
    u, motion = result.displacement("x+")[:, 0], result.report.motion
    assert np.abs(u / (10 * 20 / 1e6 / (1 - 0.1)) - 1).max() < 1e-12
    assert (motion["critical_rate"] is not None) == found
    rate = motion["critical_rate" if found else "critical_rate_of_waves"]
    assert not found or abs(rate - 1000**0.5) < 1e-6 * 1000**0.5
    assert motion["margin"] == 1 - 10 / rate
    assert not any("critical" in text for text in model.transient().equations.warnings)


def test_free_rotor(wheels):
    model = wheels.disk("20N", 1, 24, hub="free")
    rim = model.mesh.nodes("inner")
    x = model.mesh.points[rim]
    model.fix(rim[np.abs(x[:, 1]) < 1e-9], "x")  # works along the radius alone
    model.fix(rim[np.abs(x[:, 0]) < 1e-9], "y")
    with pytest.raises(ModelError, match="rotat"):
        spun(model, rate=5.0)
    warned = "nothing holds the rotation about the axis"
    assert not any(warned in text for text in spun(wheels.disk("20N", 1, 24), rate=5.0))


def test_doubtful_options_and_a_second_motion(wheels):
    model = wheels.disk("20N", 1, 24)
    model.add(Rotation("z", rate=1.0))
    (warning,) = model.transient(rayleigh=(0.0, 1e-4)).equations.warnings
    assert warning.startswith("Rayleigh's β K u' damps in fixed axes")
    assert not model.transient(rayleigh=(1.0, 0.0)).equations.warnings
    with pytest.raises(ModelError, match="has a motion already"):
        model.add(Rotation("z", rate=2.0))
    model.assign(kl.Orthotropic3D(2e8, 1e8, 1e8, 0.2, 0.2, 0.2, 4e7, 4e7, 4e7, 7620.0))
    warnings = model.transient().equations.warnings
    assert any("an anisotropic material is not axisymmetric" in text for text in warnings)


def test_no_density():
    mesh = kl.annulus(0.3, 1.0, 0.2, (2, 24, 1))
    model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.3))
    model.fix("inner")
    model.add(Rotation("z", rate=1.0))
    with pytest.raises(ModelError, match="density 0, but what moves needs mass"):
        model.solve()


@pytest.mark.parametrize("sectors", [1, 8])
@pytest.mark.parametrize(
    ("other", "what"),
    [(kl.Isotropic3D(210e6, 0.3, 3 * 7620.0), "density"), (kl.Isotropic3D(21e6, 0.3, 7620.0), "stiffness")],
)
def test_sectors_of_another_material_are_no_body_of_revolution(other, what, sectors, wheels):
    model = wheels.disk("8N", 2, 60)
    centers = np.mean(model.mesh.points[model.mesh.blocks[0].nodes], axis=1)
    angle = np.arctan2(centers[:, 1], centers[:, 0]) % (2 * np.pi)
    model.assign(other, np.flatnonzero(angle * sectors % (2 * np.pi) < np.pi))
    with pytest.raises(
        ModelError, match=rf"the {what} of the body is not spread evenly about its axis \(harmonic"
    ):
        spun(model, rate=5.0)


def test_rings_of_another_material_are_one(wheels):
    for element, cells in (("8N", (3, 12)), ("20N", (3, 16))):
        model = wheels.disk(element, *cells)
        centers = np.mean(model.mesh.points[model.mesh.blocks[0].nodes], axis=1)
        ring = np.flatnonzero(np.hypot(centers[:, 0], centers[:, 1]) > 0.6)
        model.assign(kl.Isotropic3D(21e6, 0.3, 3 * 7620.0), ring)
        spun(model, rate=5.0)


def bedded(wheels, cells=(10, 1, 1), place=lambda X: X):
    """Return a window that is held below, and whose lower layer, if it has two, is of another material."""
    mesh = kl.box((10, 1, 1), cells)
    model = kl.Model(mesh.replace(points=place(mesh.points)), wheels.steel)
    model.fix("z-")
    if cells[2] > 1:
        low = mesh.points[mesh.blocks[0].nodes].mean(axis=1)[:, 2] < 0.5
        model.assign(kl.Isotropic3D(21e6, 0.3, 9000.0), np.flatnonzero(low))
    model.add(Translation("x", rate=5.0))
    return model


def test_a_window_must_be_alike_along_its_way(wheels):
    tapered = bedded(wheels, place=lambda X: X * (1 + 0.03 * X[:, :1] * [0, 1, 1]))
    assert any("through the sides of the body" in text for text in tapered.solve().report.warnings)
    series = wheels.bar("8N", 10)
    series.fix("x-", "x")
    series.assign(kl.Isotropic3D(21e6, 0.3, 7620.0), np.arange(4))
    series.add(Translation("x", rate=5.0))
    with pytest.raises(ModelError, match="the stiffness of the body is not spread evenly along the"):
        series.solve()
    bedded(wheels, (10, 1, 2)).solve()
    bedded(wheels, (8, 1, 2), lambda X: changed_at(X, np.s_[:, 0], (X[:, 0] / 10) ** 3 * 10)).solve()


@pytest.mark.parametrize("end", ["x-", "x+"])
def test_periodic_ends_take_supports_of_either_end_before_and_after(end, wheels):
    found = []
    for before in (True, False):
        model = wheels.bar("8N", 4)
        if before:
            model.fix(end, "x", 1e-3)
        model.add(Translation("x", rate=1.0, boundaries="periodic"))
        if not before:
            model.fix(end, "x", 1e-3)
        model.add(kl.PointLoad(lambda X: np.abs(X[:, 0]) < 1e-9, (1e3, 0.0, 0.0), each=True))
        found.append(model.solve().u)
        for side in ("x-", "x+"):
            np.testing.assert_array_equal(found[-1][model.mesh.nodes(side), 0], 1e-3)
    np.testing.assert_array_equal(*found)
    pulled = 4e3 * 10 / (2 * wheels.steel.C[0, 0])
    assert found[0][:, 0].max() == pytest.approx(1e-3 + pulled, rel=1e-5)


def test_joined_ends_move_by_one_function(wheels):
    model = wheels.bar("8N", 4)
    model.add(Translation("x", rate=1.0, boundaries="periodic"))
    way = kl.TimeSeries([0.0, 1.0], [0.0, 1e-3])
    model.fix("x-", "x", way)
    *_, one = kl.integrate(model.transient(), 1e-2, 5)
    model.fix("x+", "x", way)
    *_, both = kl.integrate(model.transient(), 1e-2, 5)
    np.testing.assert_allclose(both.u, one.u, atol=1e-16)
    for other in (0.0, kl.TimeSeries([0.0, 1.0], [0.0, 2e-3])):
        model.fix("x+", "x", other, override=True)
        with pytest.raises(ModelError, match="give all that moves the same function"):
            model.transient()
    for end, value in (("x-", 0.0), ("x+", 1e-3)):
        model.fix(end, "x", value, override=True)
    with pytest.raises(ModelError, match=r"node 1 along x = 0 m is prescribed; node 17 along x = 0\.001 m"):
        model.solve()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Rotation("w"), "an axis is 'x', 'y', 'z' or a vector; got 'w'"),
        (lambda: Rotation((0, 0, 0)), "not all 0"),
        (lambda: Rotation((1, 0)), "three components"),
        (lambda: Rotation("z", rate=np.nan), "rate"),
        (lambda: Rotation("z", rate=[1, 2]), "a rate must be a number"),
        (lambda: Rotation("z", center=(1, 2)), r"center of a rotation must have shape \(3,\)"),
        (lambda: Rotation("z", stiffening="no"), "stiffening must be True or False; got 'no'"),
        (lambda: Rotation("z", skew=1), "skew must be True or False; got 1"),
        (lambda: Rotation("z", damping=(1, 2)), "a damping must be one number"),
        (lambda: Rotation("z", damping=-1.0), "a damping must be one number ≥ 0, in 1/s; got -1.0"),
        (
            lambda: Translation("x", boundaries="open"),
            "boundaries must be one of absorbing, periodic,",
        ),
    ],
)
def test_arguments(make, text):
    with pytest.raises(InputError, match=text):
        make()

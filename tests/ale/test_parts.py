"""Motions of a part of a model: the rest is at rest; boundaries, checks and loads are those of the part."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.ale import Rotation, Translation
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion

RUBBER = kl.Isotropic3D(E=2e6, nu=0.3, density=1200.0)
STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)


def wheel_mesh(element="8N"):
    return kl.annulus(0.3, 1.0, 0.25, (2, 16, 1), f"KinematicLinear3D{element}")


def rail_mesh(element="8N", size=(2.0, 0.3, 0.25)):
    return kl.box(size, (4, 1, 1), f"KinematicLinear3D{element}", origin=(-1.0, -1.4, 0.0))


def loaded(model, name="", prefix=""):
    """Hold and load the wheel, the rail or both."""
    if name in ("", "wheel"):
        model.fix(f"{prefix and 'wheel.'}inner")
        model.add(kl.Pressure(f"{prefix and 'wheel.'}outer", lambda X: 1e4 * (1 + X[:, 0] * X[:, 1])))
    if name in ("", "rail"):
        model.fix(f"{prefix and 'rail.'}y-")
        model.add(kl.Traction(f"{prefix and 'rail.'}y+", (2e3, -1e4, 1e3)))
    return model


def two(motion, element="8N"):
    """Return one model of both, and both apart with the motion in the wheel alone."""
    both = kl.Model(
        kl.join({"wheel": wheel_mesh(element), "rail": rail_mesh(element)}), {"wheel": STEEL, "rail": RUBBER}
    )
    loaded(both, prefix="both").add(motion(part="wheel"))
    wheel = loaded(kl.Model(wheel_mesh(element), STEEL), "wheel")
    wheel.add(motion())
    return both, wheel, loaded(kl.Model(rail_mesh(element), RUBBER), "rail")


def same(found, *expected, tolerance=1e-12):
    whole = np.concatenate(expected)
    for axis in range(whole.shape[-1]):  # each against its own size
        size = np.abs(whole[..., axis]).max()
        np.testing.assert_allclose(found[..., axis], whole[..., axis], rtol=0, atol=tolerance * size)


def turning(**more):
    options = {"damping": 3.0, "stiffening": True, "center_acceleration": (0.0, 4.0, 0.0)}
    return Rotation("z", 20.0, 5.0, **options, **more)


@pytest.mark.parametrize("element", ["8N", "20N"])
def test_two_bodies_with_one_in_motion_are_two_models(element):
    both, wheel, rail = two(turning, element)
    results = [model.solve() for model in (both, wheel, rail)]
    same(results[0].u, results[1].u, results[2].u, tolerance=1e-10)
    same(results[0].reactions, results[1].reactions, results[2].reactions, tolerance=1e-9)
    warnings = [[w for w in r.report.warnings if "in bending" not in w] for r in results]
    assert warnings[0] == warnings[1]
    for key in ("critical_rate", "critical_rate_of_waves"):
        assert results[0].report.motion[key] == pytest.approx(results[1].report.motion[key], rel=1e-6)
    for key in ("support_force", "support_moment"):
        found, expected = (np.array(result.report.motion[key]) for result in results[:2])
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    velocity = kl.material_velocity(both, results[0].u)
    same(velocity, kl.material_velocity(wheel, results[1].u), np.zeros_like(results[2].u), tolerance=1e-9)
    assert not velocity[both.mesh.nodes("rail")].any()
    assert not kl.material_acceleration(both, results[0].u)[both.mesh.nodes("rail")].any()


def test_in_time_two_bodies_with_one_in_motion_are_two_models():
    both, wheel, rail = two(turning)
    ends = [
        list(kl.integrate(m.transient(rayleigh=(2.0, 0.0)), 1e-3, 15, every=15))[-1]
        for m in (both, wheel, rail)
    ]
    for name in "uva":
        same(*(getattr(end, name) for end in ends), tolerance=1e-9)
    assert np.abs(ends[2].u).max() > 1e-4


def test_frequencies_and_critical_rates_are_those_of_the_two_models():
    both, wheel, rail = two(turning)
    found = both.complex_modes(12)[0]
    own = np.concatenate([wheel.complex_modes(12)[0], rail.complex_modes(12)[0]])
    expected = own[np.argsort(np.abs(own), kind="stable")][:12]
    np.testing.assert_allclose(np.abs(found), np.abs(expected), rtol=1e-8)
    for z in found:
        assert np.abs(own - z).min() < 1e-7 * abs(z)
    np.testing.assert_allclose(kl.critical_rate(both, 3), kl.critical_rate(wheel, 3), rtol=1e-8)


def test_without_kernels_the_matrices_are_the_same(monkeypatch):
    terms = EquationsOfMotion(two(turning)[0]).terms
    compiled = terms.G, terms.H
    monkeypatch.setattr("kratos_lite.assembly.mass_and_convection.compiled", lambda *a: None)
    terms = EquationsOfMotion(two(turning)[0]).terms
    for found, expected in zip((terms.G, terms.H), compiled, strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("boundaries", ["absorbing", "periodic", "fixed", "natural"])
def test_the_cut_faces_of_a_strip_are_its_own(boundaries):
    """A strip shorter than what rests beside it, in all its dimensions."""
    strip = kl.box((4.0, 0.5, 0.2), (8, 1, 1), origin=(-2.0, 0.0, 0.0))
    rest = kl.box((9.0, 2.0, 2.0), (3, 2, 2), origin=(-4.0, 3.0, -5.0))
    motion = {"rate": 12.0, "acceleration": 3.0, "boundaries": boundaries, "damping": 2.0}
    both = kl.Model(kl.join({"strip": strip, "rest": rest}), {"strip": RUBBER, "rest": STEEL})
    both.fix("rest.z-")
    both.fix("strip.z-")
    both.add(kl.PointLoad("strip.y+", (1.0, 2.0, -3.0), each=True))
    both.add(Translation("x", part="strip", **motion))
    alone = kl.Model(kl.box((4.0, 0.5, 0.2), (8, 1, 1), origin=(-2.0, 0.0, 0.0)), RUBBER)
    alone.fix("z-")
    alone.add(kl.PointLoad("y+", (1.0, 2.0, -3.0), each=True))
    alone.add(Translation("x", **motion))
    n = strip.n_nodes
    same(both.solve().u[:n], alone.solve().u)
    ends = [list(kl.integrate(model.transient(), 1e-3, 10, every=10))[-1] for model in (both, alone)]
    same(ends[0].u[:n], ends[1].u, tolerance=1e-9)
    assert not ends[0].u[n:].any()


def wheel_on_rail(axes):
    """Return a rotor pressed on a rail by its lowest nodes, which are tied to those of the rail below."""
    rail = kl.box((1.0, 0.2, 0.25), (2, 1, 1), origin=(-0.5, -1.2, 0.0))
    mesh = kl.join({"wheel": wheel_mesh(), "rail": rail})
    low = np.flatnonzero(np.abs(mesh.points[:, :2] - (0.0, -1.0)).max(axis=1) < 1e-9)
    model = kl.Model(mesh, {"wheel": STEEL, "rail": RUBBER})
    model.fix("wheel.inner")
    model.fix("rail.y-")
    upper, lower = low[low < wheel_mesh().n_nodes], low[low >= wheel_mesh().n_nodes]
    assert len(upper) == len(lower) == 2
    for a, b in zip(upper.tolist(), lower.tolist(), strict=True):
        for axis in axes:
            model.constrain((b, axis), {(a, axis): 1.0})
    model.add(kl.Pressure("wheel.outer", 1e4))
    return model, upper, lower


def test_a_wheel_on_a_resting_rail_by_lagrange_multipliers():
    """K - s² H + … of the wheel alone and K of the rail alone, joined by multipliers in full NumPy."""
    model, upper, lower = wheel_on_rail("y")
    model.add(Rotation("z", 20.0, damping=4.0, part="wheel"))
    u = model.solve().u
    parts = [kl.Model(wheel_mesh(), STEEL), kl.Model(kl.box((1.0, 0.2, 0.25), (2, 1, 1)), RUBBER)]
    parts[0].fix("inner")
    parts[0].add(kl.Pressure("outer", 1e4))
    parts[1].fix("y-")
    parts[0].add(Rotation("z", 20.0, damping=4.0))
    equations = [EquationsOfMotion(part, steady=True) for part in parts]
    K = [e.matrix(0.0, 0.0, 0.0, 1.0).scipy().toarray() for e in equations]
    n, m = len(K[0]), len(K[0]) + len(K[1])
    rows = np.zeros((2, m))
    for i, (a, b) in enumerate(zip(upper, lower, strict=True)):
        rows[i, 3 * a + 1], rows[i, 3 * b + 1] = 1.0, -1.0
    whole, load = np.zeros((m + 2, m + 2)), np.zeros(m + 2)
    whole[:n, :n], whole[n:m, n:m], whole[m:, :m], whole[:m, m:] = K[0], K[1], rows, rows.T
    load[:n] = equations[0].load(0.0)
    free = np.concatenate([~model.supports.fixed.ravel(), np.ones(2, dtype=bool)])
    expected = np.zeros(m + 2)
    scale = np.abs(rows @ whole[:m, :m]).max()
    whole[m:], whole[:, m:] = whole[m:] * scale, whole[:, m:] * scale
    expected[free] = np.linalg.solve(whole[np.ix_(free, free)], load[free])
    assert np.abs(expected[3 * lower + 1]).min() > 1e-7
    assert np.abs(u.ravel() - expected[:m]).max() < 1e-10 * np.abs(expected[:m]).max()


def test_ties_along_the_flow_are_glue():
    for axes, glued in (("y", 0), ("xy", 2), ("x", 2), ("z", 0)):
        model, _, _ = wheel_on_rail(axes)
        model.add(Rotation("z", 1.0, part="wheel"))
        said = [text for text in model.transient().equations.warnings if "as glue would" in text]
        assert len(said) == (glued > 0)
        assert all(
            text.startswith(f"{glued} constraints hold moving material along its flow") for text in said
        )
    for along in (0.02, 0.3):  # a force mostly across the flow, which is along x there
        model, upper, lower = wheel_on_rail("")
        model.constrain((int(lower[0]), "y"), {(int(upper[0]), "y"): 1.0, (int(upper[0]), "x"): along})
        model.add(Rotation("z", 1.0, part="wheel"))
        assert any(text.startswith("1 constraints hold") for text in model.transient().equations.warnings)
    whole = kl.Model(wheel_mesh(), STEEL)
    whole.fix("inner")
    whole.constrain((40, "x"), {(41, "x"): 1.0})
    whole.add(Rotation("z", 1.0))
    assert not any("glue" in text for text in whole.transient().equations.warnings)


def test_a_rotor_that_travels_is_not_tied_to_what_rests():
    model, _, _ = wheel_on_rail("y")
    model.add(Rotation("z", 1.0, center_velocity=(1.0, 0, 0), part="wheel"))
    with pytest.raises(kl.ModelError, match="along y travels with the center of the moving part, but"):
        model.solve()


def test_moving_and_resting_elements_share_no_nodes():
    mesh = wheel_mesh()
    model = kl.Model(mesh, STEEL)
    centers = mesh.points[mesh.blocks[0].nodes].mean(axis=1)
    ring = np.flatnonzero(np.hypot(centers[:, 0], centers[:, 1]) > 0.65)
    with pytest.raises(
        kl.ModelError, match=r"16 moving elements share 32 nodes with elements at rest, .*its own nodes"
    ):
        model.add(Rotation("z", 1.0, part=ring))
    assert model.motion is None
    with pytest.raises(kl.MeshError, match="there is no part 'whel'"):
        model.add(Rotation("z", 1.0, part="whel"))


def test_checks_of_symmetry_and_supports_look_at_the_moving_part_alone():
    both = kl.Model(kl.join({"wheel": wheel_mesh(), "rail": rail_mesh()}), {"wheel": STEEL, "rail": RUBBER})
    both.fix("rail.y-")
    both.assign(
        kl.Orthotropic3D(2e8, 1e8, 1e8, 0.2, 0.2, 0.2, 4e7, 4e7, 4e7, 7620.0), both.mesh.elements("rail")[:2]
    )
    with pytest.raises(kl.ModelError, match="not one of revolution"):
        both.add(Rotation("z", 1.0))
    with pytest.raises(kl.ModelError, match="not one of revolution"):
        both.add(Rotation("z", 1.0, part="rail"))
    both.add(Rotation("z", 1.0, part="wheel"))
    assert str(both.motion) == "Rotation [0.0, 0.0, 1.0], rate 1, part 'wheel'"
    warnings = both.transient().equations.warnings
    assert any("nothing holds the rotation about the axis" in text for text in warnings)
    assert not any("anisotropic" in text for text in warnings)
    both.fix("wheel.inner")
    assert not any("nothing holds" in text for text in both.transient().equations.warnings)
    both.assign(RUBBER, both.mesh.elements("wheel")[:5])
    with pytest.raises(kl.ModelError, match="is not spread evenly about its axis"):
        both.transient()


def test_fields_of_the_part_at_rest_change_only_in_time():
    both = kl.Model(kl.join({"wheel": wheel_mesh(), "rail": rail_mesh()}), {"wheel": STEEL, "rail": RUBBER})
    both.add(Rotation("z", 5.0, part="wheel"))
    X, rail = both.mesh.points, both.mesh.nodes("rail")
    change = X[:, 2]
    found = kl.material_derivative(both, X[:, 0], [change])
    np.testing.assert_allclose(found[rail], change[rail], atol=1e-12)
    wheel = both.mesh.nodes("wheel")
    np.testing.assert_allclose(found[wheel], (change + 5 * X[:, 1])[wheel], atol=1e-11)
    at_gauss = kl.material_derivative(both, X[:, 0], at="gauss")
    assert not at_gauss[both.mesh.elements("rail")].any()
    assert np.abs(at_gauss[both.mesh.elements("wheel")]).max() > 4.0

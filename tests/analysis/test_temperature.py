"""Thermal strain beside closed forms: statics, load cases, steps, transients, finer meshes; refusals."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import KratosLiteError, SolveError
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined

E, NU, ALPHA = 200e9, 0.3, 12e-6
STEEL = kl.Isotropic3D(E, NU, density=7800.0, alpha=ALPHA)
ELEMENTS = (
    "KinematicLinear3D4N",
    "KinematicLinear3D6N",
    "KinematicLinear3D8N",
    "BBar3D8N",
    "EnhancedStrain3D8N",
    "KinematicLinear3D10N",
    "BBar3D10N",
    "KinematicLinear3D20N",
    "Reduced3D20N",
    "KinematicLinear3D27N",
)
CLAMPED = -E * ALPHA * 100 / (1 - 2 * NU)


def everywhere(X):
    return np.ones(len(X), dtype=bool)


@pytest.mark.parametrize("kernels", ["compiled", "numpy"])
@pytest.mark.parametrize("element", ELEMENTS)
def test_a_free_body_has_no_stress_and_a_clamped_one_no_strain(element, kernels, monkeypatch):
    monkeypatch.setenv("KRATOS_LITE_KERNELS", kernels)
    model = kl.Model(kl.box((1, 1, 2), (2, 2, 2), element), STEEL)
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Temperature(120.0, reference=20.0))
    result = model.solve()
    assert np.abs(result.u - 100 * ALPHA * model.mesh.points).max() < 1e-12
    assert np.abs(result.stress()).max() < 1e-9 * E * ALPHA * 100
    model.fix(everywhere, "xyz", override=True)
    result = model.solve()
    for place in ("gauss", "element", "node", "averaged", "raw"):
        stress = result.stress(place)
        assert np.abs(stress[..., :3] - CLAMPED).max() < 1e-12 * -CLAMPED
        assert np.abs(stress[..., 3:]).max() < 1e-12 * -CLAMPED
    inside = result.at((0.3, 0.4, 0.7))
    assert np.abs(inside.stress[:3] - CLAMPED).max() < 1e-12 * -CLAMPED
    density = -1.5 * CLAMPED * ALPHA * 100  # ½ σ : (-α ΔT)
    assert abs(result.energy() - 2 * density) < 1e-12 * density
    for place in ("gauss", "element", "node"):
        assert np.abs(result.field("strain_energy_density", place) - density).max() < 1e-12 * density
    assert abs(inside.strain_energy_density - density) < 1e-12 * density


@pytest.mark.parametrize("element", ["KinematicLinear3D10N", "KinematicLinear3D20N", "KinematicLinear3D27N"])
def test_a_linear_temperature_bends_a_free_body_without_stress(element):
    model = kl.Model(kl.box((1, 1, 2), (2, 2, 2), element), STEEL)
    model.add(kl.Temperature(lambda X: 20 + 100 * X[:, 2] + 30 * X[:, 0], reference=20.0))
    result = model.solve()
    assert np.abs(result.u).max() > 1e-3
    assert np.abs(result.stress("node")).max() < 1e-9 * E * ALPHA * 100


def test_a_bimetal_strip_bends_as_timoshenko_says():
    """Timoshenko, J. Opt. Soc. Am. 11 (1925) 233: two like layers bend by 1/ρ = 3 Δα ΔT / 2 h."""
    length, h, T = 40.0, 1.0, 50.0
    model = kl.Model(
        kl.box((length, 1, h), (20, 1, 2), "KinematicLinear3D20N"), kl.Isotropic3D(E, 0.0, alpha=1e-5)
    )
    centers = model.mesh.points[model.mesh.blocks[0].nodes].mean(axis=1)
    model.assign(kl.Isotropic3D(E, 0.0, alpha=3e-5), np.flatnonzero(centers[:, 2] > h / 2))
    model.fix("x-", "x")
    model.fix((0.0, 0.0, 0.0), "yz")
    model.fix((0.0, 1.0, 0.0), "z")
    model.add(kl.Temperature(T))
    w = model.solve().at((length, 0.5, 0.0)).displacement[2]
    assert abs(w / (-3 * 2e-5 * T / (2 * h) * length**2 / 2) - 1) < 0.01


def le11(element, n):
    """Return a quarter of NAFEMS' sphere, taper and cylinder, 2 n × 4 n × 9 n bricks; axes in m."""

    def place(X):
        t, angle = (
            9 * X[:, 2],
            np.pi / 2 * X[:, 1],
        )  # 3 layers of the sphere, 4 of the taper, 2 of the cylinder
        up = 0.69 * np.clip((t - 3) / 4, 0, 1) + 0.4 * np.clip((t - 7) / 2, 0, 1)
        inner, outer = (a / 3 * np.minimum(t, 3) for a in (np.pi / 4, np.arcsin(np.sqrt(0.5) / 1.4)))
        r = np.where(t <= 3, 1.4 * np.cos(outer), np.interp(t, [3, 7], [np.sqrt(1.46), 1.0]))
        r = np.cos(inner) + X[:, 0] * (r - np.cos(inner))
        z = np.sin(inner) + X[:, 0] * (1.4 * np.sin(outer) - np.sin(inner)) + up
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])

    box = kl.box(cells=(2 * n, 4 * n, 9 * n), element=element)
    return kl.Mesh(place(box.points), box.blocks)


@pytest.mark.parametrize(
    ("element", "n", "close"),
    [("KinematicLinear3D20N", 1, 0.3), ("KinematicLinear3D20N", 2, 0.3), ("KinematicLinear3D27N", 1, 0.1)],
)
def test_nafems_le11(element, n, close):
    """σ_zz at A (1, 0, 0) is -105 MPa; FeenoX, 27 nodes, 4 × 12 × 18 bricks: -105.04.

    Ours: 20 nodes -105.13, -104.92, -105.22; 27 nodes -104.97, -105.02, -105.26 for n = 1, 2, 3.
    """
    model = kl.Model(le11(element, n), kl.Isotropic3D(210e9, 0.3, alpha=2.3e-4))
    for axis in "xyz":
        model.fix(f"{axis}-", axis)
    model.fix(lambda X: X[:, 2] > np.sqrt(0.5) + 1.09 - 1e-9, "z")
    model.add(kl.Temperature(lambda X: np.hypot(X[:, 0], X[:, 1]) + X[:, 2]))
    A = np.flatnonzero(np.abs(model.mesh.points - [1, 0, 0]).max(axis=1) < 1e-9)
    assert abs(model.solve().stress("node")[A, 2].item() / 1e6 + 105) < close


def test_a_hot_cylinder_between_walls_has_the_stress_of_the_closed_form():
    """Timoshenko & Goodier, Theory of Elasticity (1970), article 151; T = T₀ ln(b/r) / ln(b/a)."""
    a, b, T0 = 1.0, 2.0, 100.0
    mesh = kl.annulus(a, b, 0.1, cells=(8, 24, 1), element="KinematicLinear3D20N")
    model = kl.Model(mesh, STEEL)
    model.fix(everywhere, "z")
    model.fix((a, 0.0, 0.0), "y")
    model.fix((-a, 0.0, 0.0), "y")
    model.fix((0.0, a, 0.0), "x")
    model.add(kl.Temperature(lambda X: T0 * np.log(b / np.hypot(X[:, 0], X[:, 1])) / np.log(b / a)))
    result = model.solve()
    size = E * ALPHA * T0 / (2 * (1 - NU) * np.log(b / a))
    for r in (1.0, 1.4, 2.0):
        ln, ratio = np.log(b / r), a**2 / (b**2 - a**2)
        hoop = size * (1 - ln - ratio * (1 + b**2 / r**2) * np.log(b / a))
        stress = result.at((r, 0, 0.05)).stress
        assert abs(stress[1] - hoop) < 0.01 * size
        assert abs(stress[0] - size * (-ln - ratio * (1 - b**2 / r**2) * np.log(b / a))) < 0.01 * size


def rod(law=STEEL, **options):
    """Return a rod between walls along z, free to swell across."""
    model = kl.Model(kl.box((1, 1, 2), (1, 1, 2), "Element3D8N"), law, **options)
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z"), ("z+", "z")):
        model.fix(side, axis)
    return model


def test_load_cases_amplitudes_and_parts_scale_it():
    model = rod()
    hot, pull = kl.Temperature(100.0), kl.Traction("x+", (1e6, 0, 0))
    cases = model.solve_cases({"hot": hot, "pull": pull, "both": [hot, pull], "twice": [hot, hot]})
    stress = {name: result.stress() for name, result in cases.items()}
    assert np.abs(stress["hot"][..., 2] + E * ALPHA * 100).max() < 1.0
    assert np.abs(stress["hot"] + stress["pull"] - stress["both"]).max() < 1.0
    assert np.abs(2 * stress["hot"] - stress["twice"]).max() < 1.0
    assert np.abs(cases["hot"].report.total_load).max() == 0.0
    model.add(hot, amplitude=lambda t: 0.5 + t)
    assert np.abs(model.solve().stress() - 0.5 * stress["hot"]).max() < 1.0
    half = rod(kl.Orthotropic3D(E, E, E, 0, 0, 0, E, E, E, alpha_z=ALPHA))
    half.add(kl.Temperature(100.0, where=[0]))
    assert np.abs(half.solve().stress("element")[:, 2] + E * ALPHA * 50).max() < 1.0


def test_steps_of_any_law_flow_where_it_is_too_hot():
    metal = kl.J2Plasticity3D(E, NU, yield_stress=200e6, alpha=ALPHA)
    model = rod(metal)
    model.add(kl.Temperature(100.0), amplitude=lambda t: t)
    analysis, found = model.quasi_static(), []
    for state in kl.integrate(analysis, 0.25, 8):
        result = analysis.result()
        found.append(result.stress("element")[0, 2])
        exact = -min(E * ALPHA * 100 * state.time, 200e6)
        assert abs(found[-1] - exact) < 1e-6 * 200e6
    assert np.abs(analysis.result(state).stress() - result.stress()).max() == 0.0
    glue = kl.GeneralizedMaxwell3D(E, NU, 0.0, 1.0, alpha=ALPHA)
    linear, any_law = rod(formulation="b_bar"), rod(glue, formulation="b_bar")
    for each in (linear, any_law):
        each.add(kl.Temperature(lambda X: 50 * X[:, 2]))
    one, other = linear.solve(), any_law.solve()
    assert np.abs(one.u - other.u).max() < 1e-8 * np.abs(one.u).max()
    assert abs(one.energy() - other.energy()) < 1e-6 * one.energy()


def test_a_step_that_breaks_off_keeps_the_temperature_that_it_reached():
    mesh = kl.box((1, 1, 2), (1, 1, 2), "Element3D8N")
    model = kl.Model(mesh, kl.J2Plasticity3D(E, NU, 200e6, alpha=ALPHA))
    model.assign(STEEL, [1])  # its stress is of the strain and the temperature
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Traction("z+", (0, 0, 400e6)))
    model.add(kl.Temperature(1e5), amplitude=lambda t: t)
    analysis = model.quasi_static(iterations=8)
    with pytest.raises(SolveError, match="limit load"):
        list(kl.integrate(analysis, dt=1.0, steps=1))
    assert 0.49 < analysis.time < 0.6
    assert abs(analysis.result().stress()[1, :, 2].mean() - 400e6 * analysis.time) < 1e-6 * 200e6


@pytest.mark.parametrize("law", [STEEL, kl.J2Plasticity3D(E, NU, 1e12, density=7800.0, alpha=ALPHA)])
def test_a_transient_is_heated_at_once_and_moves_then(law):
    model = kl.Model(kl.box((1, 1, 2), (1, 1, 2), "Element3D8N"), law)
    model.fix("z-")
    model.add(kl.Temperature(100.0))
    transient = model.transient()
    next(kl.integrate(transient, 1e-9, 1))
    stress = transient.result().stress("element")[:, :3]
    assert np.abs(stress / CLAMPED - 1).max() < 1e-3


def test_finer_meshes_and_files_have_it(tmp_path):
    values = rod().mesh.points[:, 2] * 50
    for given, slope in ((values, 50.0), (lambda X: 50 * X[:, 2], 50.0), (60.0, 0.0)):
        model = rod()
        model.add(kl.Temperature(given, reference=60.0))
        finer = refined(model, refine(model.mesh))
        T = finer.loads[0].difference(finer.mesh)
        assert np.abs(T - slope * finer.mesh.points[:, 2] + (60 if slope else 0)).max() < 1e-12
    kl.write(tmp_path / "cold.mdpa", rod())
    assert kl.read(tmp_path / "cold.mdpa").solve is not None
    assert "1.2e-05" in (tmp_path / "cold.mdpa").read_text()


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: rod().add(kl.Temperature(np.zeros(5))), r"need shape \(12,\)"),
        (lambda: rod().add(kl.Temperature(20.0, where="lid")), "lid"),
        (lambda: kl.Temperature(np.zeros((3, 3))), "a number or"),
        (lambda: kl.Temperature("hot"), "temperatures"),
        (lambda: kl.Temperature(20.0, reference=np.nan), "reference temperature"),
        (lambda: rod().add(kl.Temperature(lambda x, y, z: x)), "temperature|argument"),
        (lambda: kl.RigidBody(kl.box(), STEEL).add(kl.Temperature(20.0)), "bodies in motion"),
    ],
)
def test_what_is_no_temperature_is_refused(act, words):
    with pytest.raises((KratosLiteError, TypeError), match=words):
        act()


def test_a_body_that_does_not_swell_is_named():
    model = rod(kl.Isotropic3D(E, NU))
    model.add(kl.Temperature(100.0))
    assert any("no material there has an alpha" in text for text in model.solve().report.warnings)


@pytest.mark.parametrize("values", [1e4, lambda X: 1e4 + 0 * X[:, 0]], ids=["even", "of places"])
def test_large_bodies_swell_without_stress(values):
    alpha = 1e-5
    model = kl.Model(kl.box(element="TotalLagrangianElement3D20N"), kl.Isotropic3D(E, NU, alpha=alpha))
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Temperature(values))
    result = model.solve()
    assert np.abs(result.u - 0.1 * model.mesh.points).max() < 1e-9
    assert np.abs(result.stress()).max() < 1e-6 * E
    for side in ("x+", "y+", "z+"):
        model.fix(side, side[0])
    held = -(0.1 + 0.1**2 / 2) * E / (1 - 2 * NU)  # Green's strain of the stretch 1.1
    assert np.abs(model.solve().stress()[..., :3] - held).max() < 1e-9 * E


def test_part_of_a_large_body_is_warm():
    # Its temperature is not the same at all nodes of an element; little heat strains as small strains do.
    found = []
    for element in ("KinematicLinear3D20N", "TotalLagrangianElement3D20N"):
        model = kl.Model(kl.box((1, 1, 3), (1, 1, 3), element), kl.Isotropic3D(E, NU, alpha=1e-5))
        model.fix("z-")
        model.fix("z+")
        model.add(kl.Temperature(lambda X: 0.1 * X[:, 2] * (3 - X[:, 2]) * X[:, 0]))
        found.append(model.solve())
    small, large = found
    assert np.abs(large.u - small.u).max() < 1e-5 * np.abs(small.u).max()
    assert np.abs(large.stress() - small.stress()).max() < 1e-5 * np.abs(small.stress()).max()


def test_orthotropic_bodies_swell_by_axes():
    law = kl.Orthotropic3D(1e9, 2e9, 3e9, 0.2, 0.2, 0.2, 1e9, 1e9, 1e9, 0.0, 1e-5, 2e-5, 3e-5)
    model = kl.Model(kl.box(element="KinematicLinear3D8N"), law)
    for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Temperature(100.0))
    assert np.abs(model.solve().u - model.mesh.points * [1e-3, 2e-3, 3e-3]).max() < 1e-12


def test_a_hot_hollow_sphere_has_the_stress_of_the_closed_form():
    """Of a sector on rollers all around, hot inside.  Source: Timoshenko & Goodier, section 151."""
    a, b, E, nu, alpha, T = 1.0, 2.0, 210e9, 0.3, 12e-6, 100.0
    box = kl.box((1, 1, 1), (8, 2, 2), "KinematicLinear3D20N")
    r, polar, azimuth = a + (b - a) * box.points[:, 0], 1.2 + 0.4 * box.points[:, 1], 0.4 * box.points[:, 2]
    outwards = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
    model = kl.Model(
        box.replace(points=r[:, None] * np.stack(outwards, axis=1)), kl.Isotropic3D(E, nu, alpha=alpha)
    )
    axes = kl.Spherical()
    for column, letter in ((1, "t"), (2, "p")):
        model.fix(np.flatnonzero(box.points[:, column] % 1 == 0), letter, local=axes)
    model.add(kl.Temperature(T * (b / r - 1) / (b / a - 1)))
    found = model.solve().stress("node", local=axes)
    size = alpha * E * T / (1 - nu) * a * b / (b**3 - a**3)
    across = a + b - (a * a + a * b + b * b) / (2 * r) - (a * b) ** 2 / (2 * r**3)
    along = a + b - (a * a + a * b + b * b) / r + (a * b) ** 2 / r**3
    expected = size * np.stack([along, across, across], axis=1)
    assert np.abs(found[:, :3] - expected).max() < 0.02 * np.abs(expected).max()

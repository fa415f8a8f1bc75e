"""Buckling under loads, and modes of a body under stress: columns, plates, strings."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.sparse import csr_array, kron

import kratos_lite as kl
from kratos_lite.analysis import modal
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.stiffness import stress_stiffness
from kratos_lite.errors import InputError, KratosLiteError, ModelError, SolveError
from tests.analysis.test_block_modes import random_model

STEEL = {"E": 210e9, "nu": 0.3, "density": 7850.0}
H, L = 0.1, 2.0
EI = STEEL["E"] * H**4 / 12
EULER = np.pi**2 * EI / L**2
STRAIGHT = kl.Isotropic3D(**STEEL | {"nu": 0.0})  # ends that are held do not press from the side
KINDS = [
    ("EnhancedStrain3D8N", (1, 1, 24)),
    ("KinematicLinear3D10N", (1, 1, 10)),
    ("KinematicLinear3D20N", (1, 1, 10)),
]


def column(element="KinematicLinear3D20N", cells=(1, 1, 10), force=-1.0, **law):
    """Return a column under a force in N, clamped at its foot."""
    model = kl.Model(kl.box((H, H, L), cells, element), kl.Isotropic3D(**STEEL | law))
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, force / H**2)))
    return model


def half_column(force=-1.0):
    """Return half of a column with two hinges: its lower end slides in a plane of symmetry."""
    model = kl.Model(kl.box((H, H, L / 2), (1, 1, 8), "KinematicLinear3D20N"), STRAIGHT)
    model.fix("z-", "z")
    model.fix("z+", "xy")
    model.add(kl.Traction("z+", (0, 0, force / H**2)))
    return model


@pytest.mark.parametrize(("element", "cells"), KINDS)
@pytest.mark.parametrize(("end", "euler"), [("free", 1 / 4), ("hinged", 2.0457), ("clamped", 4.0)])
def test_euler_columns(element, cells, end, euler):
    """Clamped at the foot; each factor twice, as the section is a square."""
    model = column(element, cells, nu=0.0)
    if end == "hinged":
        model.fix("z+", "xy")
    if end == "clamped":
        model.fix("z+", "xy")
        model.fix("z+", "z", -L / STEEL["E"] / H**2)
    factors, shapes = model.buckling(2)
    shear = 1 + euler * EULER / (5 / 6 * STEEL["E"] / 2 * H**2)
    assert factors == pytest.approx(euler * EULER / shear, rel=1.5e-2)
    assert np.linalg.norm(shapes, axis=2).max(axis=1) == pytest.approx(1.0, rel=1e-12)
    assert np.abs(shapes[:, :, 2]).max() < 0.3  # they bend


def test_column_with_two_hinges_by_symmetry():
    assert half_column().buckling(2)[0] == pytest.approx(EULER, rel=1e-2)


def test_nearly_incompressible_column_by_iteration():
    model = column("EnhancedStrain3D8N", (4, 4, 24), nu=0.49999)
    assert model.mesh.n_nodes * 3 > 1200
    assert model.buckling(2)[0] == pytest.approx(EULER / 4, rel=3e-2)  # the clamp holds the section, too


def test_with_pressures_beside_displacements_factors_and_critical_rates_are_those_of_lapack(monkeypatch):
    model = column("EnhancedStrain3D8N", (2, 2, 14), nu=0.49999)
    wheel = kl.Model(kl.annulus(0.3, 1.0, 0.2, (2, 12, 3), "EnhancedStrain3D8N"), kl.Isotropic3D(**STEEL))
    wheel.assign(kl.Isotropic3D(**STEEL | {"nu": 0.49999}))
    wheel.fix("inner")
    wheel.add(kl.ale.Rotation("z", rate=1.0))
    monkeypatch.setattr(modal, "DENSE_MODES", 10**5)
    exact = model.buckling(2)[0], kl.critical_rate(wheel, 2)
    monkeypatch.setattr(modal, "DENSE_MODES", 10)
    monkeypatch.setattr("kratos_lite.solvers.plan._is_soon_factorized", lambda facts, plain: False)
    assert EquationsOfMotion(model, solver="auto").system.plan.method == "displacement-pressure"
    np.testing.assert_allclose(model.buckling(2)[0], exact[0], rtol=1e-5)
    np.testing.assert_allclose(kl.critical_rate(wheel, 2), exact[1], rtol=1e-5)


def test_of_two_columns_no_factor_is_missed():
    """By iteration, those of two columns are those of each of them."""
    alone, cells = [], (1, 1, 24)
    meshes = [kl.box((H, H, length), cells, "KinematicLinear3D20N") for length in (2.0, 1.7)]
    points = np.vstack([meshes[0].points, meshes[1].points + np.array([1.0, 0.0, 0.0])])
    n = meshes[0].n_nodes
    blocks = [kl.Block(b.name, np.vstack([b.nodes, b.nodes + n])) for b in meshes[0].blocks]
    for mesh in (*meshes, kl.Mesh(points, blocks)):
        model = kl.Model(mesh, kl.Isotropic3D(**STEEL))
        model.fix(lambda X: X[:, 2] < 1e-9)
        model.add(kl.BodyForce((0.0, 0.0, -1.0)))
        alone.append(model.buckling(6)[0])
    assert len(model.supports.fixed) * 3 > 1200
    np.testing.assert_allclose(alone[2], np.sort(np.concatenate(alone[:2]))[:6], rtol=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_random_models(seed, monkeypatch):
    """K_g is what a prestress adds to the tangent of large displacements; factors are those of LAPACK."""
    model, _ = random_model(seed)
    model.fix("z-")
    rng = np.random.default_rng(seed)
    model.add(kl.BodyForce(-1e5 * rng.random(3)))
    e = EquationsOfMotion(model)
    at, pattern = e.system.points, e.system.pattern
    free = [replace(g, prestress=None) for g in e.system.groups]
    stressed = [replace(g, prestress=1e11 * rng.standard_normal((len(g), 6))) for g in free]
    tangents = (finite_strain.stiffness(at, groups, pattern, 0 * at).data for groups in (stressed, free))
    found = stress_stiffness(at, stressed, pattern, lambda g: g.prestress[:, None].repeat(len(g.rule), 1))
    np.testing.assert_allclose(
        np.subtract(*tangents), found[:, None, None] * np.eye(3), atol=1e-10 * abs(found).max()
    )

    monkeypatch.setattr(modal, "MOST_STRAIN", np.inf)  # whatever the body is
    made, result = model.matrices(), model.solve()
    data = stress_stiffness(at, result.groups, pattern, result.stress_in)
    K_g = kron(csr_array((data, pattern.indices, pattern.indptr)), np.eye(3)).tocsr()
    dense = ((made.T.T @ A @ made.T).toarray() for A in (-K_g, made.K))
    largest = eigh(*dense, eigvals_only=True)[::-1][:3]
    for limit in (modal.DENSE_MODES, 10):
        monkeypatch.setattr(modal, "DENSE_MODES", limit)
        np.testing.assert_allclose(model.buckling(3)[0], 1 / largest, rtol=1e-6)


def test_iteration_finds_what_lapack_finds(monkeypatch):
    model = column(cells=(1, 1, 12))
    whole = model.buckling(5)[0]
    stressed = model.modes(4, preload=True)[0]
    monkeypatch.setattr(modal, "DENSE_MODES", 10)
    monkeypatch.setattr("kratos_lite.solvers.eigen.DENSE_MODES", 10)
    np.testing.assert_allclose(model.buckling(5)[0], whole, rtol=1e-8)
    np.testing.assert_allclose(model.modes(4, preload=True)[0], stressed, rtol=1e-8)


@pytest.mark.parametrize(("element", "cells"), [("EnhancedStrain3D8N", 16), ("KinematicLinear3D27N", 12)])
def test_strip_of_a_plate(element, cells):
    """In plane strain, clamped at one end: π² D / (2 L)² for each width."""
    t = 0.02
    model = kl.Model(kl.box((1, 0.1, t), (cells, 1, 1), element), kl.Isotropic3D(**STEEL))
    model.fix("x-")
    for side in ("y-", "y+"):
        model.fix(side, "y")
    model.add(kl.Traction("x+", (-1 / t, 0, 0)))
    D = STEEL["E"] * t**3 / 12 / (1 - STEEL["nu"] ** 2)
    assert model.buckling(2)[0] == pytest.approx(np.pi**2 * D / 4 * np.array([1, 9]), rel=1.5e-2)


def test_heated_column():
    """Between two walls, its load is E α ΔT A: K_g of the thermal stress, it bends about x alone."""
    mesh = kl.box((H, H, L), (1, 1, 10), "KinematicLinear3D20N")
    model = kl.Model(mesh, kl.Isotropic3D(**STEEL, alpha=1e-5))
    for side in ("z-", "z+"):
        model.fix(side, "z")
        model.fix(mesh.nodes(side)[:1], "xy")
    model.fix("x-", "x")
    model.add(kl.Temperature(10.0))
    factor = model.buckling(1)[0][0]
    assert factor * STEEL["E"] * 1e-4 * H**2 == pytest.approx(4 * EULER, rel=2e-2)


def arc(angle, t, cells):
    """Return an arc of a ring of radius 1 m with a square section, and the nodes of both cuts."""
    box = kl.box((1, 1, t), (1, cells, 1), "KinematicLinear3D20N")
    r, a = 1 + t * (box.points[:, 0] - 0.5), angle * box.points[:, 1]
    points = np.stack([r * np.cos(a), r * np.sin(a), box.points[:, 2]], axis=1)
    return kl.Mesh(points, box.blocks), [np.flatnonzero(box.points[:, 1] == end) for end in (0, 1)]


AROUND = kl.Cylindrical()


def test_ring_under_pressure_that_keeps_its_direction():
    """p = n² E I / R³, n = 2, 4 by symmetry: 4 E I / R³.  Source: Bodner, J. Aeronaut. Sci. 25 (1958) 358.

    Pressure that follows has 3 (Lévy 1884), towards the center 4.5.  It acts on the center line here, as a
    force of the volume.
    """
    t, (mesh, _) = 0.05, arc(np.pi / 2, 0.05, 16)
    model = kl.Model(mesh, STRAIGHT)
    for axis in "xyz":
        model.fix(f"{axis}-", axis)
    model.add(kl.BodyForce((-1.0, 0.0, 0.0), local=AROUND))
    factors = model.buckling(2)[0] * t / (STEEL["E"] * t**3 / 12)
    np.testing.assert_allclose(factors, [4, 16], rtol=6e-3)


def test_spinning_ring():
    """The hoop stress ρ Ω² R² raises ω² of n = 2 by n² Ω² across the plane, 9/5 Ω² in it.

    K_g is N v'² of the turn v' of the center line: that of w = cos n θ is n w, in the plane (n² - 1) / n,
    and the mass there 1 + 1 / n²; without stress ω² = E I n² (n² - 1)² / (n² + 1) ρ A R⁴ (Hoppe 1871).
    """
    t, (mesh, (plane, node)) = 0.05, arc(np.pi / 4, 0.05, 8)
    ring, model = kl.Model(mesh, kl.Isotropic3D(**STEEL)), kl.Model(mesh, kl.Isotropic3D(**STEEL))
    for cut in (plane, node):
        ring.fix(cut, "t", local=AROUND)
    ring.fix((1 + t / 2, 0.0, 0.0), "z")
    model.fix(plane, "t", local=AROUND)
    model.fix(node, "rz", local=AROUND)
    across, inside = model.modes(2)[0]
    hoppe = np.sqrt(STEEL["E"] * t**2 / 12 / STEEL["density"] * 36 / 5)
    assert inside == pytest.approx(hoppe, rel=3e-3)
    rate = across / 2
    ring.add(kl.Gravity(lambda X: rate**2 * X * [1, 1, 0]))
    spun, shapes = model.modes(2, preload=ring.solve())
    assert np.abs(shapes[0, :, 2]).max() < 1e-2 * np.abs(shapes[0]).max()
    assert (spun[0] ** 2 - inside**2) / rate**2 == pytest.approx(9 / 5, rel=2e-3)
    assert (spun[1] ** 2 - across**2) / rate**2 == pytest.approx(4, rel=5e-3)


def test_spinning_bar():
    """A blade flaps across its plane of rotation at ω² = ω0² + B Ω², B by Rayleigh's quotient.

    With the shape φ of the blade at rest, B = ∫ (L² - x²) φ'² dx / 2 ∫ φ² dx = 1.193 is an upper bound, the
    string's 1 a lower one.  Source: Southwell & Gough, ARC R&M 766 (1921).
    """
    h, root, x = 0.02, 1.8751040687, np.linspace(0, 1, 2001)
    ratio = (np.cos(root) + np.cosh(root)) / (np.sin(root) + np.sinh(root))
    phi = np.cosh(root * x) - np.cos(root * x) - ratio * (np.sinh(root * x) - np.sin(root * x))
    rise = np.trapezoid((1 - x**2) * np.gradient(phi, x) ** 2) / (2 * np.trapezoid(phi**2))
    model = kl.Model(kl.box((1, h, h), (12, 1, 1), "KinematicLinear3D20N"), STRAIGHT)
    model.fix("x-")
    model.fix(np.arange(model.mesh.n_nodes), "y")
    still = model.modes(1)[0][0]
    for rate, least, most in ((0.1, rise - 0.002, rise + 0.002), (3.0, 1.0, rise - 0.05)):
        spins = kl.Gravity(lambda X, rate=rate * still: np.outer(X[:, 0], [rate**2, 0, 0]))
        found = model.modes(1, preload=spins)[0][0]
        assert least < (found**2 - still**2) / (rate * still) ** 2 < most


def stretched(strain):
    """Return a thin bar between two clamps that stretch it."""
    size = (0.02, 0.02, 2.0)
    model = kl.Model(kl.box(size, (1, 1, 24), "KinematicLinear3D20N"), STRAIGHT)
    model.fix("z-")
    model.fix("z+", "xy")
    model.fix("z+", "z", strain * size[2])
    return model


def of_string(strain, number):
    """Return a frequency in rad/s of a clamped beam under tension: E I w'''' - N w'' = ρ A ω² w."""
    b, length = 0.02, 2.0
    bending, force, mass = STEEL["E"] * b**4 / 12, STEEL["E"] * strain * b**2, STEEL["density"] * b**2

    def determinant(omega):
        root = np.sqrt(force**2 + 4 * bending * mass * omega**2)
        s, k = np.sqrt((root + force) / 2 / bending), np.sqrt((root - force) / 2 / bending)
        tanh, sech = np.tanh(s * length), 1 / np.cosh(s * length)
        return 2 * s * k * (sech - np.cos(k * length)) + (s**2 - k**2) * tanh * np.sin(k * length)

    scale = np.pi / length * np.sqrt(force / mass + (np.pi / length) ** 2 * bending / mass)
    grid = np.linspace(0.05, 4 * number, 4000) * scale
    signs = np.sign([determinant(w) for w in grid])
    at = np.flatnonzero(signs[1:] != signs[:-1])[number - 1]
    return brentq(determinant, grid[at], grid[at + 1])


@pytest.mark.parametrize("strain", [1e-5, 1e-3, 1e-2])
def test_string(strain):
    """Modes in pairs, of the beam under tension; the taut one sounds like a string."""
    omega, _ = stretched(strain).modes(6, preload=True)
    exact = [of_string(strain, number) for number in (1, 1, 2, 2, 3, 3)]
    np.testing.assert_allclose(omega, exact, rtol=1.5e-2)
    if strain == 1e-2:
        string = np.pi / 2.0 * np.sqrt(STEEL["E"] * strain / STEEL["density"])
        assert omega[0] == pytest.approx(string, rel=0.08)
        assert omega[0] > string


def test_frequencies_fall_to_zero_at_buckling():
    """ω² = ω0² (1 - P / P_cr), as shapes stay alike; of a result, of loads and of the model the same."""
    model = half_column()
    free, critical = model.modes(1)[0][0], model.buckling(1)[0][0]
    load, almost, beyond = (kl.Traction("z+", (0, 0, -critical * f / H**2)) for f in (0.5, 0.999, 1.001))
    half = model.modes(1, preload=load)[0][0]
    assert half == pytest.approx(free * np.sqrt(0.5), rel=2e-3)
    assert 0 < model.modes(1, preload=[almost])[0][0] < 0.05 * free
    with pytest.raises(ModelError, match="the preload is beyond buckling"):
        model.modes(3, preload=beyond)
    assert model.buckling(1, preload=beyond)[0][0] == pytest.approx(1 / 1.001, rel=1e-6)
    loaded = half_column(-critical / 2)
    for preload in (True, loaded.solve()):
        assert loaded.modes(1, preload=preload)[0][0] == pytest.approx(half, rel=1e-8)
    assert model.modes(1)[0][0] == free


def test_beyond_buckling_by_iteration():
    model = column(cells=(1, 1, 40))
    beyond = kl.Traction("z+", (0, 0, -0.3 * EULER / H**2))
    with pytest.raises(ModelError, match="the preload is beyond buckling"):
        model.modes(2, preload=beyond)


def test_loads_that_pull_do_not_buckle(caplog):
    with pytest.raises(ModelError, match="less than 4 factors > 0; ask for fewer, or reverse"):
        column(force=1.0).buckling(4)
    with pytest.raises(SolveError, match="loads that only pull do not buckle"):
        column(force=1.0, cells=(1, 1, 40)).buckling(2)
    message = (
        "strains the body by {}%: it does not buckle at small strains; reverse the loads if these only pull"
    )
    with pytest.raises(ModelError, match=message.format(r"\d{5}")):  # the clamp presses from the side
        column(force=1.0, cells=(1, 1, 8)).buckling(2)
    column(force=1.0, cells=(1, 1, 4)).buckling(2)
    assert re.search(message.format("33"), caplog.text)


def other_mesh():
    return column(cells=(1, 1, 2)).solve()


@pytest.mark.parametrize(
    ("change", "options", "kind", "message"),
    [
        (lambda m: m.loads.clear(), {}, ModelError, "the preload makes no stress; add loads"),
        (lambda m: m.release("z-"), {}, ModelError, "rigid"),
        (lambda m: None, {"count": 0}, InputError, "count"),
        (lambda m: None, {"count": 10**6}, InputError, "got 1000000"),
        (lambda m: None, {"preload": "wind"}, KratosLiteError, "load"),
        (lambda m: None, {"preload": False}, KratosLiteError, "load"),
        (lambda m: None, {"preload": other_mesh()}, InputError, "a linear result on the mesh of the model"),
    ],
)
@pytest.mark.parametrize("analysis", ["buckling", "modes"])
def test_bad_input_is_refused(change, options, kind, message, analysis):
    model = column(cells=(1, 1, 2))
    change(model)
    with pytest.raises(kind, match=message):
        getattr(model, analysis)(**{"preload": True} | options)


def test_what_is_not_linear_is_refused():
    model = kl.Model(kl.box(), kl.NeoHookean3D(E=1e6, nu=0.3, density=1.0))
    model.fix("z-")
    linear = kl.Model(model.mesh, kl.Isotropic3D(**STEEL))
    linear.fix("z-")
    with pytest.raises(InputError, match="a preload must be a linear result on the mesh"):
        linear.buckling(preload=model.solve())
    with pytest.raises(ModelError, match="buckling takes linear laws"):
        model.buckling()
    with pytest.raises(ModelError, match="a preload of modes takes linear laws"):
        model.modes(preload=True)
    wheel = kl.Model(kl.annulus(0.3, 1.0, 0.1, cells=(1, 8, 1)), kl.Isotropic3D(**STEEL))
    wheel.fix("inner")
    wheel.add(kl.ale.Rotation("z", rate=1.0))
    with pytest.raises(ModelError, match="buckling takes no motion of the material"):
        wheel.buckling()
    with pytest.raises(ModelError, match="a preload of modes takes no motion of the material"):
        wheel.modes(preload=True)
    with pytest.raises(InputError, match="near does not go with a preload"):
        column().modes(near=1.0, preload=True)

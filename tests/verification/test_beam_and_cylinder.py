"""Benchmarks with published values: MacNeal & Harder's cantilever and cylinder, Lamé's solutions.

Source: MacNeal & Harder, Finite Elements in Analysis and Design 1 (1985) 3-20; Timoshenko &
Goodier, Theory of Elasticity, 3rd ed., sections 28 and 142.
"""

import numpy as np
import pytest

import kratos_lite as kl

BEAM = {
    8: ((0.986, 0.093, 0.025), (0.986, 0.026, 0.010), (0.986, 0.032, 0.014)),
    20: ((0.994, 0.970, 0.961), (0.994, 0.886, 0.920), (0.994, 0.967, 0.941)),
    27: ((0.994, 0.978, 0.977), (0.994, 0.968, 0.966), (0.994, 0.969, 0.967)),
    4: ((0.978, 0.031, 0.009), (0.980, 0.019, 0.006), (0.980, 0.022, 0.007)),
    10: ((0.993, 0.962, 0.957), (0.994, 0.945, 0.943), (0.994, 0.951, 0.945)),
}
TRUTH = (3.0e-5, 0.1081, 0.4321)
FORMS = ("rectangle", "trapezoid", "parallelogram")


def kind(n):
    return f"KinematicLinear3D{n}N"


def beam(form, nodes, split):
    """Return the 6 x 0.2 x 0.1 beam of six cells with slanted inner stations."""
    brick = kl.box((6, 0.2, 0.1), (6, 1, 1))
    points = brick.points.copy()
    station = np.rint(points[:, 0]).astype(int)
    slant = np.where(station % 2 == 1, 1, -1) if form == "trapezoid" else np.ones(len(points))
    inner = (station > 0) & (station < 6) & (form != "rectangle")
    points[inner, 0] += (slant * np.where(points[:, 1] > 0.1, -0.1, 0.1))[inner]
    return split(points, brick.blocks[0].nodes, kind(nodes))


def tip(mesh, axis):
    model = kl.Model(mesh, kl.Isotropic3D(E=1e7, nu=0.3))
    model.fix("x-")
    traction = np.zeros(3)
    traction[axis] = 1 / 0.02
    model.add(kl.Traction("x+", traction))
    result = model.solve()
    return result.displacement("x+")[:, axis].mean()


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("nodes", sorted(BEAM))
def test_straight_cantilever(split, nodes, form):
    mesh = beam(form, nodes, split)
    ratios = [tip(mesh, axis) / TRUTH[axis] for axis in range(3)]
    np.testing.assert_allclose(ratios, BEAM[nodes][FORMS.index(form)], rtol=0, atol=0.0006)


RADII = (3.0, 3.5, 4.2, 5.2, 6.75, 9.0)
CYLINDER = {
    0.3: {8: 0.9908, 4: 0.9679, 10: 0.9997, 20: 0.9996, 27: 0.9998},
    0.4999: {8: 0.0534, 4: 0.8608, 10: 0.9988, 20: 0.8793, 27: 0.8793},
}
EXACT = {0.3: 4.5825e-3, 0.4999: 5.062275e-3}


@pytest.mark.parametrize("nu", [0.3, 0.4999])
@pytest.mark.parametrize("nodes", [8, 4, 10, 20, 27])
def test_thick_cylinder(nodes, nu):
    mesh = kl.box((5, 1, 1), (5, 1, 1), kind(nodes))
    r = np.interp(mesh.points[:, 0], range(6), RADII)
    angle = np.deg2rad(10) * mesh.points[:, 1]
    bottom, top = mesh.nodes("y-"), mesh.nodes("y+")
    mesh = mesh.replace(points=np.column_stack([r * np.cos(angle), r * np.sin(angle), mesh.points[:, 2]]))
    model = kl.Model(mesh, kl.Isotropic3D(E=1000.0, nu=nu))
    model.fix("z-", "z")
    model.fix("z+", "z")
    model.fix(bottom, "y")
    for node in top:  # the normal displacement of the slanted side is zero
        model.constrain((int(node), "y"), {(int(node), "x"): np.tan(np.deg2rad(10))})
    model.add(kl.Pressure("x-", 1.0))
    result = model.solve()
    ratio = np.hypot(*result.displacement("x-")[:, :2].T).mean() / EXACT[nu]
    flat = np.sin(np.deg2rad(10)) / np.deg2rad(10) if nodes in (4, 8) else 1.0
    assert ratio == pytest.approx(CYLINDER[nu][nodes] * flat, abs=5e-4)


def wheel(nodes, cells):
    mesh = kl.annulus(1.0, 2.0, 0.25, cells, kind(nodes))
    model = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3))
    model.fix("z-", "z")
    model.fix("z+", "z")
    model.fix(lambda X: np.isclose(X[:, 1], 0), "y")
    model.fix(lambda X: np.isclose(X[:, 0], 0, atol=1e-12), "x")
    model.add(kl.Pressure("inner", 1.0))
    return model.solve()


@pytest.mark.parametrize("nodes", [10, 15, 20, 27])
def test_lame_cylinder_under_inner_pressure(nodes):
    result = wheel(nodes, (6, 16, 1))
    x, y, _ = result.displacement("inner").T
    points = result.mesh.points[result.mesh.nodes("inner")]
    radial = (x * points[:, 0] + y * points[:, 1]) / np.hypot(points[:, 0], points[:, 1])
    np.testing.assert_allclose(radial, 1.906666667, rtol=2e-3)
    np.testing.assert_allclose(result.report.total_load, 0, atol=1e-13)
    assert result.energy() == pytest.approx(0.5 * 1.906666667 * 2 * np.pi * 0.25, rel=2e-3)


def test_lame_cylinder_hoop_stress():
    result = wheel(27, (8, 32, 1))
    node = int(np.argmin(np.linalg.norm(result.mesh.points - (1, 0, 0), axis=1)))
    assert result.stress("node")[node, 1] == pytest.approx(5 / 3, rel=0.01)
    assert result.stress("node")[node, 0] == pytest.approx(-1, rel=0.05)


def octant(n, nodes, split):
    """Return an eighth of a hollow sphere, radii 1 and 2, made of three blocks of n x n x n bricks."""
    brick = kl.box((1, 1, 1), (n, n, n))
    s, t, r = brick.points.T
    points, bricks = [], []
    center, edge = np.ones(3) / np.sqrt(3), np.array([[1, 1, 0], [0, 1, 1], [1, 0, 1]]) / np.sqrt(2)
    for k in range(3):
        pole = np.roll([1.0, 0, 0], k)
        a, b = edge[k], edge[(k + 2) % 3]
        flat = (
            np.outer((1 - s) * (1 - t), pole) + np.outer(s * (1 - t), a)
            + np.outer((1 - s) * t, b) + np.outer(s * t, center)
        )  # fmt: skip
        bricks.append(brick.blocks[0].nodes + k * len(s))
        points.append(flat / np.linalg.norm(flat, axis=1, keepdims=True) * (1 + r)[:, None])
    points, bricks = np.vstack(points), np.vstack(bricks)
    _, first, merged = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    mesh = split(points[first], merged.ravel()[bricks], kind(nodes))
    radius = np.linalg.norm(mesh.points, axis=1)
    shell = np.rint((radius - 1) * 2 * n) / (2 * n) + 1  # mid-edge nodes go out to their sphere
    if nodes > 8:
        mesh = mesh.replace(points=mesh.points * (shell / radius)[:, None])
    return mesh, shell


@pytest.mark.parametrize(("nodes", "bound"), [(20, 2e-3), (27, 2e-3), (15, 4e-3), (10, 1.3e-2)])
def test_lame_sphere_under_inner_pressure(split, nodes, bound):
    mesh, radius = octant(3, nodes, split)
    model = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3))
    for axis, letter in enumerate("xyz"):
        model.fix(np.abs(mesh.points[:, axis]) < 1e-9, letter)
    inner = np.abs(radius - 1) < 1e-9
    model.add(kl.Pressure(inner, 1.0))
    result = model.solve()
    np.testing.assert_allclose(np.linalg.norm(result.displacement(inner), axis=1), 0.8, rtol=bound)
    assert result.energy() == pytest.approx(0.5 * 0.8 * np.pi / 2, rel=bound)
    np.testing.assert_allclose(result.report.total_load, np.pi / 4, rtol=5e-4)

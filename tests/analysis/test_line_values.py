"""Values along lines, and the membrane and bending parts of stresses, beside closed forms."""

from itertools import pairwise

import numpy as np
import pytest

import kratos_lite as kl

E, NU = 2e5, 0.3


def held(mesh, u, material=None):
    """Return the result of a model whose displacements are all prescribed."""
    model = kl.Model(mesh, material or kl.Isotropic3D(E=E, nu=NU))
    model.fix(np.arange(mesh.n_nodes), "xyz", u)
    return model.solve()


def lame_cylinder(cells):
    """Return a slice of a thick cylinder, radii 1 and 2 m, in plane strain, under inner pressure 1 Pa."""
    mesh = kl.annulus(1.0, 2.0, 0.1, cells=(cells, 32, 1), element="KinematicLinear3D20N")
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=NU))
    model.fix("z-", "z")
    model.fix("z+", "z")
    on_axis = [np.flatnonzero(np.abs(mesh.points[:, i]) < 1e-9) for i in (0, 1)]
    model.fix(on_axis[0], "x")
    model.fix(on_axis[1], "y")
    model.add(kl.Pressure("inner", 1.0))
    return model.solve()


def test_thick_cylinder_has_the_membrane_and_bending_stress_of_lame():
    a, b = 1.0, 2.0
    K = a**2 / (b**2 - a**2)  # stresses K (1 ± b²/r²)
    line = lame_cylinder(cells=6).along((a, 0, 0.05), (b, 0, 0.05))
    t, log = b - a, np.log(b / a)
    over_r2 = (t / 2 + a) * (1 / a - 1 / b) - log  # ∫ (t/2 - x) / r² dr, x = r - a
    mean = {"xx": K * (1 - b / a), "yy": K * (1 + b / a)}  # b²/t ∫ dr/r² = b/a
    bend = {"xx": -6 / t**2 * K * b**2 * over_r2, "yy": 6 / t**2 * K * b**2 * over_r2}
    for i, name in ((0, "xx"), (1, "yy")):
        assert abs(line.membrane[i] - mean[name]) < 2e-3 * abs(mean["yy"])
        assert abs(line.bending[i] - bend[name]) < 1e-2 * abs(bend["yy"])
    r = a + line.distance
    exact = K * (1 + b**2 / r**2)
    peak = exact - mean["yy"] - bend["yy"] * (1 - 2 * line.distance / t)
    assert np.abs(line.peak[:, 1] - peak).max() < 0.03 * exact.max()
    assert abs(line.membrane[3:]).max() < 2e-3


def test_linear_stress_of_a_cantilever_is_membrane_and_bending_and_nothing_else():
    length, height, force, pull = 4.0, 1.0, 100.0, 50.0
    mesh = kl.box((length, 1.0, height), cells=(8, 1, 3), element="KinematicLinear3D20N")
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=0.0))
    model.fix("x-", "xyz")
    model.add(kl.Traction("x+", (pull, 0.0, force)))
    x = 2.25 + 0.25 / np.sqrt(3)  # among the Gauss points, where stresses are closest
    line = model.solve().along((x, 0.4, 0.0), (x, 0.4, height))
    moment = force * (length - x)
    assert abs(line.membrane[0] / pull - 1) < 1e-4
    assert abs(line.bending[0] / (6 * moment / height**2) - 1) < 5e-3
    assert abs(line.membrane[5] / force - 1) < 1e-2  # shear: V / A
    assert abs(line.bending[5]) < 1e-2 * force


@pytest.mark.parametrize("kind", ["KinematicLinear3D20N", "KinematicLinear3D27N", "KinematicLinear3D10N"])
def test_parts_of_a_polynomial_stress_are_exact_across_elements(kind):
    """A displacement u_x of second degree gives a linear stress, and of pieces of it the mean is exact."""
    mesh = kl.box((2, 1, 1), cells=(3, 2, 2), element=kind)
    x, y, _ = mesh.points.T
    u = 1e-3 * np.array([x * x + x * y, 0 * x, 0 * x]).T
    a, b = np.array([0.1, 0.2, 0.3]), np.array([1.9, 0.7, 0.8])
    line = held(mesh, u, kl.Isotropic3D(E=E, nu=0.0)).along(a, b, n=7)
    ends = E * 1e-3 * np.array([2 * p[0] + p[1] for p in (a, b)])
    assert abs(line.membrane[0] - ends.mean()) < 1e-10 * ends[1]
    assert abs(line.bending[0] - (ends[0] - ends[1]) / 2) < 1e-10 * ends[1]
    assert np.abs(line.peak).max() < 1e-10 * ends[1]
    assert np.abs(line.linear[[0, -1], 0] - ends).max() < 1e-10 * ends[1]


def test_jumps_between_materials_are_integrated_side_by_side():
    mesh = kl.box((1, 1, 1), cells=(7, 1, 1))
    mesh.add_part("left", lambda X: X[:, 0] < 3 / 7 + 1e-9)
    mesh.add_part("right", lambda X: X[:, 0] > 3 / 7 - 1e-9)
    model = kl.Model(mesh, {"left": kl.Isotropic3D(E=1e5, nu=0.0), "right": kl.Isotropic3D(E=3e5, nu=0.0)})
    u = np.zeros((mesh.n_nodes, 3))
    u[:, 1] = 1e-3 * mesh.points[:, 1]
    model.fix(np.arange(mesh.n_nodes), "xyz", u)
    for recovered in (False, True):
        line = model.solve().along((0, 0.5, 0.5), (1, 0.5, 0.5), recovered=recovered)
        s, c = (100.0, 300.0), 3 / 7
        mean = s[0] * c + s[1] * (1 - c)
        bending = 6 * (s[0] * (c / 2 - c**2 / 2) + s[1] * (0.5 - c / 2 - (1 - c**2) / 2))
        assert abs(line.membrane[1] - mean) < 1e-6
        assert abs(line.bending[1] - bending) < 1e-6


def test_points_of_a_line_are_those_of_at():
    mesh = kl.box((2, 1, 1), cells=(3, 2, 2))
    u = 1e-3 * np.random.default_rng(0).uniform(-1, 1, mesh.points.shape)
    result = held(mesh, u)
    line = result.along((0.1, 0.2, 0.3), (1.9, 0.7, 0.8), n=11)
    points = np.linspace((0.1, 0.2, 0.3), (1.9, 0.7, 0.8), 11)
    values = result.at(points)
    assert np.abs(line.points - points).max() < 1e-14
    assert np.abs(line.distance - np.linalg.norm(points - points[0], axis=1)).max() < 1e-14
    for name in ("displacement", "strain", "stress", "von_mises", "tresca", "principal_stresses"):
        assert np.abs(getattr(line, name) - getattr(values, name)).max() < 1e-9 * E


def test_unsound_lines_are_refused():
    result = held(kl.box(), np.zeros((8, 3)))
    for ends, n, words in (
        (((0.5, 0.5, 0.5), (0.5, 0.5, 0.5)), 9, r"a line needs two ends; both are \[0.5, 0.5, 0.5\]"),
        (((0, 0, 0), (1, 1)), 9, r"the end of a line must have shape \(3,\)"),
        (((0, 0, 0), (1, 1, 1)), 1, "n must be"),
        (((0, 0, 0), (2, 0, 0)), 9, r"point 5 .* lies outside the mesh"),
    ):
        with pytest.raises((kl.InputError, kl.MeshError), match=words):
            result.along(*ends, n=n)
    with pytest.raises(kl.InputError, match=r"values must be one of displacement, .*Did you mean von_mises"):
        result.along((0, 0, 0), (1, 0, 0)).plot(values="von_misses")


def test_plot_draws_the_stress_with_its_parts(tmp_path):
    pytest.importorskip("matplotlib")
    mesh = kl.box((2, 1, 1), cells=(2, 2, 2), element="KinematicLinear3D20N")
    x, y, _ = mesh.points.T
    result = held(mesh, 1e-3 * np.array([x * y, 0 * x, 0 * x]).T, kl.Isotropic3D(E=E, nu=0.0))
    line = result.along((1, 0, 0.5), (1, 1, 0.5), n=11)
    axes = line.plot(tmp_path / "line.png", "sxx").axes[0]
    drawn = {curve.get_label(): curve.get_xydata() for curve in axes.lines}
    assert list(drawn) == ["stress xx", "membrane and bending", "membrane"]
    assert np.abs(drawn["stress xx"].T - [line.distance, 200 * line.distance]).max() < 1e-9
    assert np.abs(drawn["membrane"][:, 1] - 100).max() < 1e-9
    assert (tmp_path / "line.png").stat().st_size > 10_000
    for values in ("von_mises", "s1", "ux", "exx", "displacement"):
        assert len(line.plot(values=values).axes[0].lines) == 1
    assert (line.plot(values="szz").axes[0].lines[0].get_ydata() == 0).all()  # not its rounding


def test_numbers_below_a_line_stand_apart():
    pytest.importorskip("matplotlib")
    mesh = kl.box((2000, 200, 200))
    mesh.use_units("mm N MPa t")
    line = held(mesh, np.zeros((8, 3)), kl.Isotropic3D(E=E, nu=0.0)).along((0, 9, 9), (2000, 9, 9), n=3)
    figure = line.plot()
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in figure.axes[0].get_xticklabels()]
    assert len(boxes) > 2
    assert all(a.x1 < b.x0 for a, b in pairwise(boxes))

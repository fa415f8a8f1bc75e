"""Transients as files; velocities of the material and resultants of supports."""

import re

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.io.writers.recorded import OF_MODELS as MOMENT_COLUMNS

RUBBER = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)


def shaken_bar():
    model = kl.Model(kl.box((0.2, 0.2, 1.0), cells=(1, 1, 4), element="KinematicLinear3D8N"), RUBBER)
    model.fix("z-")
    model.add(kl.Gravity((9.81, 0, 0)))
    return model


def wheel(element="KinematicLinear3D20N", **options):
    model = kl.Model(kl.annulus(0.3, 1.0, 0.1, cells=(2, 16, 1), element=element), RUBBER)
    model.fix("inner")
    model.add(kl.ale.Rotation("z", **options))
    return model


def test_frames_table_and_arrays_hold_each_state(tmp_path):
    meshio = pytest.importorskip("meshio")
    model = shaken_bar()
    transient = model.transient()
    endings = [kl.SeriesWriter(tmp_path / f"swing{ending}", transient) for ending in (".pvd", ".csv", ".npz")]
    states = [transient.state()]
    for series in endings:
        series.add()
    for state in kl.integrate(transient, dt=0.01, steps=6, every=3):
        states.append(state)
        for series in endings:
            series.add(state)
    for series in endings:
        series.close()
    index = re.findall(r'timestep="(\S+)" part="0" file="(\S+)"', (tmp_path / "swing.pvd").read_text())
    assert [float(time) for time, _ in index] == [state.time for state in states]
    for state, (_, name) in zip(states, index, strict=True):
        frame = meshio.read(tmp_path / name)
        np.testing.assert_array_equal(frame.points, model.mesh.points)
        names = {"DISPLACEMENT": "u", "VELOCITY": "v", "ACCELERATION": "a", "REACTION": "reactions"}
        for kratos, ours in names.items():
            np.testing.assert_array_equal(frame.point_data[kratos], getattr(state, ours))
        result = transient.result(state)
        np.testing.assert_array_equal(frame.point_data["VON_MISES_STRESS"], result.von_mises("node"))
        np.testing.assert_array_equal(frame.cell_data["CAUCHY_STRESS_VECTOR"][0], result.stress("element"))
    arrays = np.load(tmp_path / "swing.npz")
    assert sorted(arrays) == ["a", "reactions", "step", "time", "u", "v"]
    np.testing.assert_array_equal(arrays["v"], [state.v for state in states])
    assert arrays["step"].tolist() == [0, 3, 6]
    lines = (tmp_path / "swing.csv").read_text().splitlines()
    assert lines[0].split(",") == list(MOMENT_COLUMNS)
    last = np.array([float(word) for word in lines[-1].split(",")])
    assert last[0] == states[-1].time
    assert last[1] == transient.energy() > 0
    assert last[2] == np.linalg.norm(states[-1].u, axis=1).max() > 0
    np.testing.assert_array_equal(last[3:], states[-1].reactions.sum(axis=0))


def test_the_energy_of_an_earlier_state_is_that_of_then():
    transient = shaken_bar().transient()
    then = transient.state()
    start = transient.energy()
    list(kl.integrate(transient, dt=0.01, steps=3))
    assert transient.energy(then) == start
    assert transient.energy() > 10 * abs(start)


def test_stress_of_a_state_is_that_of_its_displacement(tmp_path):
    """A bar that has come to rest has the stress of statics; a state has summary and files of results."""
    model = shaken_bar()
    transient = model.transient(rayleigh=(2 * model.modes(1)[0][0], 0.0))
    *_, late = kl.integrate(transient, dt=0.02, steps=600, every=600)
    static, result = model.solve(), transient.result(late)
    np.testing.assert_allclose(result.stress("node"), static.stress("node"), rtol=0, atol=1e-5 * 8e4)
    np.testing.assert_allclose(result.report.total_load, static.report.total_load, atol=1e-9)
    assert result.report.backward_error < 1e-9
    rows = dict(result.table())
    assert rows["solver"] == "newmark(0.25, 0.5): step 600, t = 12 s"
    assert {"total reaction", "largest von Mises"} <= rows.keys()
    kl.write(tmp_path / "late.vtu", result)
    kl.write(tmp_path / "late.json", result)


def test_a_state_is_drawn_deformed(tmp_path):
    pytest.importorskip("matplotlib")
    transient = shaken_bar().transient()
    *_, state = kl.integrate(transient, dt=0.02, steps=5)
    kl.plot(transient, tmp_path / "bar.png", values="ux", states=state)
    assert (tmp_path / "bar.png").stat().st_size > 10_000


def test_the_hub_carries_what_pushes_the_rim():
    missed = []
    for stiffening in (True, False):
        model = wheel(rate=10.0, stiffening=stiffening)
        model.add(kl.PointLoad(lambda X: X[:, 1] < -0.99, (100.0, 300.0, 0.0), each=True))
        result = model.solve()
        nodes = result.mesh.nodes(lambda X: X[:, 1] < -0.99)
        pushed = np.zeros_like(result.mesh.points)
        pushed[nodes] = (100.0, 300.0, 0.0)
        force, moment = kl.reaction_resultant(model, result, "inner")
        scale = len(nodes) * 300.0
        np.testing.assert_allclose(force, -pushed.sum(axis=0), atol=1e-9 * scale)
        wanted = -np.cross(result.mesh.points, pushed).sum(axis=0)
        assert abs(wanted[2]) > 0.3 * scale
        missed.append(moment[2] / wanted[2] - 1)
        assert result.report.motion["support_moment"][2] == moment[2]
    # The moment of the inertia of the turning material about the axis is balanced by its centrifugal stress.
    assert abs(missed[0]) < 1e-6
    assert abs(missed[1]) > 1e-3


def test_a_clamp_carries_the_weight_of_a_bar_and_its_moment():
    model = shaken_bar()
    weight = 0.2 * 0.2 * 1.0 * 1000.0 * 9.81
    force, moment = kl.reaction_resultant(model, model.solve(), "z-", center=(0.1, 0.1, 0.0))
    np.testing.assert_allclose(force, (-weight, 0, 0), atol=1e-9 * weight)
    np.testing.assert_allclose(moment, (0, -weight * 0.5, 0), atol=1e-9 * weight)
    # In motion: d/dt of the momentum is weight + reaction, here at the first state, at rest but accelerated.
    transient = model.transient()
    start = transient.state()
    mass = transient.equations.mass.nodal
    force, _ = kl.reaction_resultant(model, start)
    np.testing.assert_allclose(mass @ start.a, np.array((weight, 0, 0)) + force, atol=1e-9 * weight)


def test_resultants_refuse_what_is_not_of_the_model():
    model, other = shaken_bar(), wheel()
    result = model.solve()
    for owner, options, words in (
        (other, {}, "reactions of 20 nodes; the model has"),
        (model, {"center": (0, 0)}, r"shape \(3,\); got \(2,\)"),
        (model, {"where": lambda X: X[:, 0] > 5}, "no node is chosen"),
    ):
        with pytest.raises((kl.InputError, kl.ModelError), match=words):
            kl.reaction_resultant(owner, result, **options)


def test_the_material_of_a_wheel_turns_and_takes_the_displacement_along():
    model = wheel("KinematicLinear3D8N", rate=7.0)
    X = model.mesh.points
    A = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 0]])
    L = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9]]) * 1e-3
    # The gradient of a linear u is L everywhere: D_t (X + u) = rate (1 + L) A X
    np.testing.assert_allclose(
        kl.material_velocity(model, X @ L.T), 7.0 * X @ (A + L @ A).T, rtol=0, atol=1e-12
    )
    with pytest.raises(kl.InputError, match="no motion"):
        kl.material_velocity(shaken_bar(), np.zeros((20, 3)))
    with pytest.raises(kl.InputError, match="needs shape"):
        kl.material_velocity(model, np.zeros((2, 3)))


def test_a_wave_that_stands_in_the_window_moves_with_it():
    bar = kl.Model(kl.box((10.0, 1.0, 1.0), cells=(20, 1, 1)), RUBBER)
    bar.add(kl.ale.Translation("x", rate=3.0, boundaries="natural"))
    u = np.zeros_like(bar.mesh.points)
    u[:, 0] = 1e-3 * bar.mesh.points[:, 0]
    v = np.zeros_like(u)
    v[:, 1] = 0.5
    transient = bar.transient(displacement=u, velocity=v)
    expected = np.tile([-3.0 * 1e-3, 0.5, 0.0], (len(u), 1))
    np.testing.assert_allclose(transient.material_velocity(), expected, atol=1e-12)
    then = transient.state()
    list(kl.integrate(transient, dt=1e-3, steps=2))
    np.testing.assert_allclose(transient.material_velocity(then), expected, atol=1e-12)


def test_the_report_of_a_steady_motion_tells_rate_and_critical_rate():
    result = wheel(rate=-30.0, acceleration=2.0).solve()
    rows = dict(result.table())
    assert rows["rotation"] == "-30 rad/s, 2 rad/s² (0, 0, 1)"
    critical = r"3\.\d+ rad/s on this mesh, about 18\.\d+ rad/s by wave speeds, margin -\d+\.\d%"
    assert re.fullmatch(critical, rows["critical rate"])
    assert {"force of supports", "moment of supports"} <= rows.keys()
    assert "rotation" not in dict(shaken_bar().solve().table())


def test_transients_and_steady_motions_warn_alike():
    model = kl.Model(kl.annulus(0.3, 1.0, 0.1, cells=(1, 12, 1), element="KinematicLinear3D8N"), RUBBER)
    model.add(kl.ale.Rotation("z", rate=18.0))
    warnings = model.transient().equations.warnings
    for words in ("near the critical one, about", "polygonal rim", "nothing holds the rotation"):
        assert sum(words in text for text in warnings) == 1, words
    model.fix("inner")
    warnings = model.transient().equations.warnings
    for words in ("rad/s on this mesh", "polygonal rim"):
        assert sum(words in text for text in warnings) == 1, words
    steady = [text for text in model.solve().report.warnings if "linear theory" not in text]
    assert [text for text in steady if "critical" not in text] == [w for w in warnings if "critical" not in w]
    assert len(steady) == len(warnings)
    assert ("motion", "Rotation [0.0, 0.0, 1.0], rate 18") in model.table()

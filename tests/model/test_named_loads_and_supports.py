"""Loads and supports are listed, named, replaced and taken away; equal loads are told."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.loads.base import equal_loads
from kratos_lite.model.refined import refined

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
UP, PUSH = (0.0, 0.0, 1e3), (1e3, 0.0, 0.0)
RAMP = kl.TimeSeries([0.0, 1.0], [0.0, 2.0])


def a_model():
    model = kl.Model(kl.box(cells=(2, 2, 2)), STEEL)
    model.fix("z-", name="clamp")
    return model


def by_cell():
    """Return loads as a cell of a notebook makes them anew each time."""
    side, factor = 0.5, 3.0
    return [
        (kl.Gravity((0, 0, -9.81)), None),
        (kl.Traction("x+", UP), None),
        (kl.Traction(lambda X: X[:, 2] > side, UP), None),
        (kl.Pressure("x+", lambda X: 1e3 * X[:, 2]), None),
        (kl.PointLoad((1.0, 1.0, 1.0), UP), None),
        (kl.PointLoad(np.array([26, 25]), UP, each=True), None),
        (kl.BodyForce(UP, [0, 1]), None),
        (kl.NodalForces(np.ones((27, 3))), None),
        (kl.Traction("y+", UP), 2.0),
        (kl.Traction("y+", UP), lambda t: factor * t),
        (kl.Traction("y+", UP), kl.TimeSeries([0.0, 1.0], [0.0, 2.0])),
        (kl.TimeDependentLoad(lambda t: kl.PointLoad("x+", (0, 0, factor * t), each=True)), None),
    ]


def test_equal_loads_are_warned_of_and_those_that_differ_in_any_value_are_not():
    model = a_model()
    for load, amplitude in by_cell():
        model.add(load, amplitude=amplitude)
    model.add(kl.Traction("x+", (0.0, 0.0, 1.001e3)))
    model.add(kl.Traction("x-", UP))
    model.add(kl.Gravity((0, 0, -9.81), [0]))
    model.add(kl.Pressure("x+", 1e3))
    model.add(kl.Pressure("x+", 1e3, normal="nodes"))
    model.add(kl.Traction(lambda X: X[:, 2] > 0.25, UP))
    for z in (0.1, 0.2):
        model.add(kl.Traction(lambda X, z=z: X[:, 2] > z, UP))
    assert not equal_loads(model.loads, model.named_loads)
    for load, amplitude in by_cell():  # the cell is run again
        model.add(load, amplitude=amplitude)
    texts = equal_loads(model.loads, model.named_loads)
    assert len(texts) == len(by_cell()) - 1  # two are told by the same words
    assert all(text.startswith("2 equal loads ") for text in texts)
    assert set(texts) <= set(model.solve().report.warnings)
    warnings = model.transient().equations.warnings
    assert all(any(text in warning for warning in warnings) for text in texts)


def test_equal_loads_of_two_names_are_meant():
    model = a_model()
    model.add(kl.Traction("x+", PUSH), name="wind")
    model.add(kl.Traction("x+", PUSH), name="gust")
    assert not model.solve().report.warnings
    model.add(kl.Traction("x+", PUSH))
    assert "3 equal loads" in str(model.solve().report.warnings)


def test_a_name_is_given_once_and_replaced_only_if_asked_for():
    model = a_model()
    model.add(kl.Gravity(UP))
    for _ in range(3):
        model.add(kl.Traction("x+", PUSH), name="wind")
    model.add(kl.Gravity(PUSH))
    with pytest.raises(
        kl.ModelError, match=r"another load 'wind' .*where='x\+'.*override=True.*remove\('wind'\)"
    ):
        model.add(kl.Traction("x-", PUSH), name="wind")
    model.add(kl.Traction("x-", PUSH), name="wind", override=True)
    assert model.named_loads["wind"].where == "x-"
    assert [type(load).__name__ for load in model.loads] == ["Gravity", "Traction", "Gravity"]
    with pytest.raises(kl.MeshError):
        model.add(kl.Traction("nowhere", PUSH), name="wind", override=True)
    assert model.named_loads["wind"].where == "x-"


def test_loads_are_removed_by_name_or_as_they_are():
    model, weight = a_model(), kl.Gravity(UP)
    model.add(weight)
    model.add(kl.Traction("x+", PUSH), name="wind")
    model.add(weight, amplitude=2.0)
    model.remove("wind")
    model.remove(weight)
    assert model.loads == [weight]
    model.remove(weight)
    assert not model.loads
    model.add(kl.Traction("x+", PUSH), name="wind")
    with pytest.raises(kl.ModelError, match=r"no load 'winds'; the names are wind\. Did you mean wind\?"):
        model.remove("winds")
    with pytest.raises(kl.ModelError, match="no load Gravity"):
        model.remove(weight)
    model.loads.clear()
    assert model.named_loads == {}
    with pytest.raises(kl.ModelError, match="none has a name"):
        model.remove("wind")


def test_names_are_words_and_a_motion_takes_none():
    for call, words in (
        (lambda: a_model().add(kl.Gravity(UP), name=3), "the name of a load must be a str"),
        (lambda: a_model().fix("x+", name=3), "the name of a support must be a str"),
        (lambda: a_model().add(kl.ale.Rotation((0, 0, 1), 1.0), name="spin"), "nor name"),
    ):
        with pytest.raises(kl.InputError, match=words):
            call()


def test_the_summary_lists_loads_and_named_supports_with_their_values():
    model = a_model()
    model.add(kl.Traction("x+", UP), name="wind")
    model.add(kl.Gravity((0, 0, -9.81)))
    text = str(model)
    assert "wind: Traction(where='x+', traction=(0, 0, 1000))" in text
    assert "Gravity(force=(0, 0, -9.81), where=None)" in text
    assert "clamp: z-, xyz = 0 m" in text
    model.fix("z+", "y", 1e-3)
    model.fix(model.mesh.nodes("z+")[:2], "x", lambda t: t)
    assert str(model.supports).splitlines() == [
        "clamp: z-, xyz = 0 m",
        "z+, y = 0.001 m",
        "2 nodes, x as a function of time",
    ]


def test_names_stay_on_a_finer_mesh():
    model = a_model()
    model.add(kl.Gravity(UP))
    model.add(kl.Traction("x+", UP), name="wind")
    model.release("z-", "x")
    finer = refined(model, refine(model.mesh))
    assert list(finer.named_loads) == ["wind"]
    assert finer.named_loads["wind"] is finer.loads[1]
    low = finer.mesh.nodes("z-")
    assert finer.supports.fixed[low].all(axis=0).tolist() == [False, True, True]
    finer.release("clamp")
    assert not finer.supports.fixed.any()


# ---- supports ----------------------------------------------------------------------------------------


def test_a_named_support_is_released_and_others_keep_what_they_share():
    model = a_model()
    model.fix("x-", "x")
    model.fix("x+", "x", 1e-3, override=True)
    before = model.version
    model.release("clamp")
    assert model.version != before
    fixed = np.zeros((27, 3), dtype=bool)
    fixed[model.mesh.nodes("x-"), 0] = fixed[model.mesh.nodes("x+"), 0] = True
    assert (model.supports.fixed == fixed).all()
    assert (model.supports.values[model.mesh.nodes("x+"), 0] == 1e-3).all()
    assert not model.supports.named


def test_nodes_are_released_along_axes_and_the_equations_follow():
    model = a_model()
    model.add(kl.Traction("z+", UP))
    analysis = model.static()
    held = analysis.solve()
    model.release("z-", "xy")
    model.fix((0.0, 0.0, 0.0), "xy")
    model.fix((1.0, 0.0, 0.0), "y")
    loose = analysis.solve()
    assert np.abs(loose.u - held.u).max() > 1e-3 * np.abs(held.u).max()
    np.testing.assert_allclose(loose.stress("element")[:, 2], 1e3, rtol=1e-9)


def test_motion_is_released_and_comes_back_with_what_it_had_hidden():
    model = a_model()
    model.fix("z-", "z", RAMP, override=True, name="lift")
    assert len(model.supports.motions) == 1
    model.release("lift")
    assert not model.supports.motions
    assert model.supports.fixed[model.mesh.nodes("z-")].all()
    assert not model.supports.values.any()


def test_a_named_support_is_given_once_or_replaced():
    model = a_model()
    model.fix("z-", name="clamp")
    assert len(model.supports.conditions) == 1
    with pytest.raises(
        kl.ModelError, match=r"another support 'clamp' .*clamp: z-, xyz = 0 m; replace it by over"
    ):
        model.fix("z+", name="clamp")
    with pytest.raises(kl.InputError, match="axes must be"):
        model.fix("z+", "w", name="clamp", override=True)
    assert model.supports.fixed[model.mesh.nodes("z-")].all()
    model.fix("z+", "z", 1e-3, name="clamp", override=True)
    assert np.flatnonzero(model.supports.fixed[:, 2]).tolist() == model.mesh.nodes("z+").tolist()
    assert not model.supports.fixed[:, :2].any()


def test_wrong_releases_are_refused_with_names():
    model = a_model()
    with pytest.raises(
        kl.MeshError, match=r"no part 'clam'.*named supports are clamp\. Did you mean clamp\?"
    ):
        model.release("clam")
    with pytest.raises(kl.ModelError, match="nothing is prescribed along y there"):
        model.release("z+", "y")
    with pytest.raises(kl.InputError, match="axes must be"):
        model.release("z-", "q")
    model.fix("z-", "x", 1e-3, override=True)
    model.release("clamp")
    assert (model.supports.values[model.mesh.nodes("z-"), 0] == 1e-3).all()
    assert not model.supports.fixed[:, 1].any()

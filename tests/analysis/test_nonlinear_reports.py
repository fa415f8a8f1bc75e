"""Summaries, series, films and restarts of quasi-static analyses."""

import json
from itertools import pairwise

import meshio
import numpy as np
import pytest

import kratos_lite as kl

E, H, Y, K = 200e9, 2e9, 200e6, 1e9
STEEL = kl.J2Plasticity3D(E, 0.3, Y, H, K)
TIMES = (0.25, 0.5, 0.75, 1.0)


def bar(material=STEEL, element="EnhancedStrain3D8N", **options):
    """Return a bar along z on rollers that is pulled to a strain of 0.01."""
    model = kl.Model(kl.box((1, 1, 2), cells=(2, 2, 2), element=element), material, **options)
    for side in "xyz":
        model.fix(f"{side}-", side)
    model.fix("z+", "z", lambda t: 0.02 * t)
    return model


def plastic(time):
    """Return the plastic strain of the bar at a time, with all of its hardening."""
    return max((0.01 * time - Y / E) * E / (E + H + K), 0.0)


@pytest.fixture
def steps():
    """A bar after four steps, and its states."""
    analysis = bar().quasi_static()
    return analysis, list(kl.integrate(analysis, dt=0.25, steps=4))


def test_the_summary_has_steps_work_and_plastic_strain_and_no_error(tmp_path, steps):
    analysis, states = steps
    result = analysis.result()
    rows = dict(reversed(result.table()))
    assert "estimated error" not in rows
    assert "t = 0.25 s: 2 iterations" in rows["step"]
    stress = Y + (H + K) * plastic(1)
    assert abs(float(rows["plastic strain"].split()[2]) / plastic(1) - 1) < 1e-6
    rule = f"by the trapezoidal rule over {len(analysis.reports)} steps"
    assert rows["work of loads"] == f"{result.report.work:.6e} J, {rule}"
    kl.write(tmp_path / "a.json", result)
    data = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert "estimated_error" not in data
    assert abs(data["largest_accumulated_plastic_strain"]["value"] / plastic(1) - 1) < 1e-7
    assert abs(data["strain_energy"] / (stress**2 / E) - 1) < 1e-7
    assert [step["time"] for step in data["steps"]] == list(TIMES)
    assert all(step["residuals"][-1] < 1e-8 for step in data["steps"])
    # the work by the trapezoidal rule, and what is stored, dissipated and hardened
    sigma = [Y + (H + K) * plastic(t) for t in (0.0, *TIMES)]
    sigma[0] = 0.0
    work = 2 * sum((a + b) / 2 * 0.0025 for a, b in pairwise(sigma))
    assert abs(data["work"] / work - 1) < 1e-7
    early = analysis.result(states[1]).report
    assert [step.time for step in early.steps] == [0.25, 0.5]
    assert 0 < early.work < data["work"]


def test_the_summary_says_which_steps_were_cut():
    model = bar(kl.NeoHookean3D(1e6, 0.3), "TotalLagrangianElement3D8N")
    model.release("z+", "z")
    model.add(kl.Traction("z+", (0, 0, 3e6)))
    analysis = model.quasi_static(iterations=4)
    for _ in kl.integrate(analysis, dt=1.0, steps=1):
        pass
    parts = [step.part for step in analysis.reports]
    assert len(parts) > 1
    assert abs(sum(parts) - 1) < 1e-12
    assert f"{parts[-1]:g} of a step" in str(analysis.result())


def test_series_of_steps(tmp_path, steps):
    analysis, states = steps
    for ending in ("pvd", "csv", "npz", "html"):
        with kl.SeriesWriter(tmp_path / f"pull.{ending}", analysis) as series:
            for state in states:
                series.add(state)
    for i, time in enumerate(TIMES):
        points = meshio.read(tmp_path / f"pull_{i:05d}.vtu").point_data
        assert np.abs(points["ACCUMULATED_PLASTIC_STRAIN"] - plastic(time)).max() < 1e-7 * plastic(1)
    table = np.genfromtxt(tmp_path / "pull.csv", delimiter=",", names=True)
    assert (table["work_J"] == [float(state.work) for state in states]).all()
    arrays = np.load(tmp_path / "pull.npz")
    assert (arrays["u"][2] == states[2].u).all()
    assert (tmp_path / "pull.html").stat().st_size > 10_000


def test_films_of_steps(tmp_path, steps):
    analysis, states = steps
    kl.animate(tmp_path / "pull.gif", analysis, states=states, values="accumulated_plastic_strain", frames=2)
    assert (tmp_path / "pull.gif").read_bytes()[:6] == b"GIF89a"
    kl.plot(analysis, tmp_path / "pull.png", states=states[::3], values="plastic_strain_zz")


@pytest.mark.parametrize("law", [STEEL, kl.GeneralizedMaxwell3D(1e9, 0.3, 0.5, 2.0)], ids=["J2", "Maxwell"])
def test_a_restart_from_a_file_goes_on_bit_by_bit(tmp_path, law):
    whole = bar(law).quasi_static()
    states = list(kl.integrate(whole, dt=0.25, steps=4))
    kl.write(tmp_path / "half.npz", states[1])
    again = bar(law).quasi_static()
    kl.read_state(tmp_path / "half.npz").restore(again)
    *_, end = kl.integrate(again, dt=0.25, steps=2)
    assert end.values.keys() == states[-1].values.keys()
    for name, value in states[-1].values.items():
        assert np.array_equal(end.values[name], value), name
    other = bar(law, "KinematicLinear3D8N").quasi_static()
    with pytest.raises(kl.InputError, match="does not fit"):
        kl.read_state(tmp_path / "half.npz").restore(other)

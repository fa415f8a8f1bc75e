"""Pictures of the history of a solution to a requested error."""

import pytest

import kratos_lite as kl


@pytest.fixture(scope="module")
def result():
    pytest.importorskip("matplotlib")
    model = kl.Model(kl.box(cells=(2, 1, 1)), kl.Isotropic3D(E=1e9, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (0.0, 0.0, 1e3)))
    return model.solve(error=0.2)


def test_it_is_written_in_the_type_of_its_name(result, tmp_path):
    kl.plot(result.report, tmp_path / "a.png")
    kl.plot(result.report, tmp_path / "a.svg", title="bar")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")


def test_the_figure_has_all_meshes_and_the_error_asked_for(result):
    import numpy as np

    steps = result.report.history
    unknowns, errors = np.array([s.unknowns for s in steps]), np.array([s.error for s in steps])
    assert result.report.error_asked == 0.2
    axes = kl.plot(result.report).axes[0]
    drawn, goal = axes.get_lines()
    assert np.abs(drawn.get_xdata() - unknowns).max() == 0
    assert np.abs(drawn.get_ydata() - 100 * errors).max() == 0
    assert set(goal.get_ydata()) == {20.0}
    assert axes.get_ylabel() == "error of the energy norm in %"


def test_a_report_without_a_history_is_refused(tmp_path):
    model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3))
    model.fix("x-")
    with pytest.raises(kl.InputError, match=r"no history to draw: that of model.solve\(error=...\) has"):
        kl.plot(model.solve().report, tmp_path / "a.png")

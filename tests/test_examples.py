"""Every example runs as a script and prints the numbers that are known."""

import json
import logging
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from pages import DOCS, run_scripts, text_of

pytest.importorskip("matplotlib")
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
README = (EXAMPLES.parent / "README.md").read_text()


@pytest.fixture
def script(capsys, monkeypatch, tmp_path):
    """Run an example in the folder of the test and return what it prints: ``script(path, …)``."""

    def call(path, *words):
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, words)])
        runpy.run_path(str(path), run_name="__main__")
        return capsys.readouterr().out

    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    yield call
    logging.getLogger("kratos_lite").setLevel(logging.NOTSET)


@pytest.fixture
def command(run, monkeypatch, tmp_path):
    """Run a command in the folder of the test and return what it prints: ``command("solve", path, …)``."""

    def call(*words):
        done = run(*words)
        assert done.code == 0, done.err
        return done.out

    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    return call


def test_gravity_cube_sinks_by_the_exact_amount(script):
    out = script(EXAMPLES / "gravity_cube.py")
    top = float(re.search(r"top: (\S+) mm", out).group(1))
    assert abs(top / -0.13221477551020406 - 1) < 1e-9


def test_stiffness_by_hand_equals_the_library(script):
    out = script(EXAMPLES / "stiffness_by_hand.py")
    largest = float(re.search(r"entry of K: (\S+) N/m", out).group(1))
    # K_11 of a unit cube in closed form: (λ + 2μ + 2μ) / 9 with λ + 2μ = M
    modulus, mu = 210e6 * 0.7 / (1.3 * 0.4), 210e6 / 2.6
    assert abs(largest / ((modulus + 2 * mu) / 9) - 1) < 1e-6
    assert "rigid motions: 6" in out


def python_blocks(text):
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


PAGES = sorted(
    str(page.relative_to(DOCS))
    for folder in (DOCS, DOCS / "howto", DOCS / "reference", DOCS / "topics")
    for page in folder.glob("*.md")
    if python_blocks(page.read_text())
)


def test_pages_with_python_are_found():
    assert len(PAGES) >= 20


def test_python_of_the_readme_and_of_each_page_runs(tmp_path):
    readme = {f"README {number}": block for number, block in enumerate(python_blocks(README))}
    pages = {page: "\n".join(python_blocks(text_of(page))) for page in PAGES}
    del pages["howto/moving-material.md"]  # runs before its commands
    assert pages.pop("index.md") in README  # which runs
    printed = run_scripts(tmp_path, readme | pages)
    (sunk,) = (printed[name] for name, block in readme.items() if "0.1322" in block)
    assert abs(float(sunk) / -0.13221477551020406 - 1) < 1e-12


@pytest.mark.parametrize("page", ["moving-material.md", "run-bodies.md", "models-in-time.md", "modes.md"])
def test_command_lines_of_each_page_run(page, script, command, tmp_path):
    text = text_of(f"howto/{page}").replace("\\\n", "")
    lines = re.findall(r"^kratos-lite ([^#\n]*)", text, re.M)
    assert lines
    (tmp_path / "examples").symlink_to(EXAMPLES)
    if page == "moving-material.md":
        assert len(lines) == 6
        (tmp_path / "page.py").write_text("\n".join(python_blocks(text)))
        script(tmp_path / "page.py")  # it writes the mesh of the commands
    for line in lines:
        command(*line.split())


def test_elements_of_the_guide_conform(tmp_path, command):
    script = tmp_path / "guide.py"
    pages = [(DOCS / "howto" / f"own-{what}.md").read_text() for what in ("element", "material")]
    script.write_text("\n".join(python_blocks("".join(pages))))
    out = command("check", script)
    assert "MyWedge3D6N conforms: 32 checks passed" in out
    assert "MeanDilatation3D8N conforms: 32 checks passed" in out
    assert "Blended3D8N conforms: 32 checks passed" in out
    assert "slate (TransverseIsotropic3D) conforms: 5 checks passed" in out


def test_cantilever_folder_of_kratos_bends_as_a_beam(tmp_path, command):
    out = tmp_path / "r.json"
    folder = EXAMPLES / "cantilever"
    command("solve", folder / "ProjectParameters.json", "--json", out)
    result = json.loads(out.read_text())
    F, L, b, E, nu = 1e5 * 0.1**2, 1.0, 0.1, 210e9, 0.3
    beam = F * L**3 / (3 * E * b**4 / 12) + F * L / (5 / 6 * E / (2 * (1 + nu)) * b**2)
    work = result["strain_energy"]
    assert abs(work / (F * beam / 2) - 1) < 0.02  # clamped edge and 10 x 2 x 2 bricks: 1.5 % stiff
    assert result["total_reaction"][2] == pytest.approx(F, rel=1e-9)


def test_the_gust_bends_the_tower_twice_as_far_as_the_steady_wind(tmp_path, command):
    gust, table = EXAMPLES / "tower" / "gust.py", tmp_path / "swing.csv"
    out = command("solve", gust, "-o", table)
    rows = np.array([line.split(",") for line in table.read_text().splitlines()[1:]], dtype=float)
    assert len(rows) == 201
    largest, time = rows[:, 2].max(), rows[rows[:, 2].argmax(), 0]
    q, length, EI, mass = 1000.0 * 2, 20.0, 30e9 * 2**4 / 12, 2500.0 * 4
    still = q * length**4 / (8 * EI)
    omega = 1.8751041**2 * (EI / (mass * length**4)) ** 0.5
    ratio = 0.3 / (2 * omega) + 0.001 * omega / 2  # of Rayleigh damping
    assert largest == pytest.approx(still * (1 + np.exp(-np.pi * ratio)), rel=0.03)
    assert time == pytest.approx(np.pi / omega, abs=0.02)
    assert f"{largest:.6e} m at node" in out
    assert gust.read_text().partition("\n\n")[2] in (DOCS / "howto" / "models-in-time.md").read_text()


def test_own_element_passes_its_conformance_kit(command):
    out = command("check", EXAMPLES / "my_wedge.py")
    assert "MyWedge3D6N conforms: " in out


BODIES = EXAMPLES / "bodies"


def number(pattern, text):
    return float(re.search(pattern, text).group(1))


@pytest.mark.parametrize("kind", ["rigid", "pseudo-rigid", "finite-element"])
def test_a_thrown_box_falls_and_tumbles_the_same_whatever_its_kind(kind, tmp_path, script):
    out = script(BODIES / "tumbling_box.py", kind, tmp_path / "box.png")
    moved = [float(x) for x in re.search(r"moved by \[(.*?)\]", out).group(1).split()]
    assert moved == pytest.approx([1.5, 1.5, 0.0], abs=1e-9)
    momentum = [float(x) for x in re.search(r"angular momentum \[(.*?)\]", out).group(1).split()]
    assert momentum == pytest.approx([1.36, 232.0, 0.52], abs=1e-9)
    assert abs(number(r"energy drift (\S+)", out)) < (1e-6 if kind == "rigid" else 1e-13)
    assert (tmp_path / "box.png").stat().st_size > 10_000


def test_the_top_nutates_as_elliptic_integrals_say(script):
    out = script(BODIES / "heavy_top.py")
    assert number(r"tilt from (\S+)", out) == pytest.approx(0.5, abs=1e-5)
    assert number(r"to (\S+) rad", out) == pytest.approx(0.7576379147, abs=2e-5)
    assert number(r"period (\S+) s", out) == pytest.approx(1.7588577458, abs=2e-3)
    assert number(r"momentum (\S+),", out) == pytest.approx(number(r"at first (\S+) kg", out), abs=1e-9)


def test_the_pendulum_is_back_after_its_period(tmp_path, command):
    out = command("solve", BODIES / "pendulum.py", "-o", "p.csv")
    rows = [list(map(float, row.split(","))) for row in (tmp_path / "p.csv").read_text().splitlines()[1:]]
    assert rows[-1][6:9] == pytest.approx([1.0, 0.0, 0.0], abs=1e-8)
    assert all(abs(x * x + z * z - 1) < 1e-12 for *_, x, _, z in (row[:9] for row in rows))
    assert abs(number(r"energy drift +(\S+)", out)) < 1e-12


def test_a_scene_in_python_is_integrated(tmp_path, command):
    out = command("solve", BODIES / "thrown_box.py", "-o", "out/box.csv")
    rows = [
        list(map(float, row.split(","))) for row in (tmp_path / "out/box.csv").read_text().splitlines()[1:]
    ]
    assert len(rows) == 51
    # with the drag 2 |w| w, w = wind - v, of the mass center alone, by a Runge-Kutta method of high order
    from scipy.integrate import solve_ivp

    def rate(t, y):
        flow = [-6.0 - y[3], -y[4], -y[5]]
        drag = [2.0 * sum(w * w for w in flow) ** 0.5 * w / 24.0 for w in flow]
        return [*y[3:], drag[0], drag[1], drag[2] - 9.81]

    end = solve_ivp(rate, (0, 1), [0.2, 0.3, 0.5, 6.0, 0.0, 4.905], rtol=1e-10, atol=1e-10).y[:3, -1]
    assert rows[-1][6:9] == pytest.approx(end.tolist(), abs=1e-5)
    assert rows[-1][12:] == pytest.approx([0.136, 23.2, 0.052], rel=1e-9)  # J ω: drag has no torque
    assert abs(number(r"energy drift +(\S+)", out)) < 1e-6
    assert "examples/bodies/thrown_box.py" in (DOCS / "howto" / "run-bodies.md").read_text()


def test_both_forms_of_the_spinning_bar_stretch_alike(script):
    out = script(BODIES / "rotating_bar.py")
    # Solfec-1.0: 7.038e-4 m and 7.035e-4 m
    assert number(r"total_lagrangian: elongation (\S+) m", out) == pytest.approx(7.038e-4, abs=1e-7)
    assert number(r"corotational: elongation (\S+) m", out) == pytest.approx(7.035e-4, abs=1e-7)
    for formulation in ("total_lagrangian", "corotational"):
        assert number(rf"{formulation}: energy (\S+) J", out) == pytest.approx(3.315, abs=1e-3)


def test_a_stiff_box_keeps_its_energy_by_energy_momentum_alone(script):
    out = script(BODIES / "stiff_box.py")
    assert number(r"DEF_LIM: energy drift (\S+),", out) > 1e6
    assert number(r"ENERGY_MOMENTUM: energy drift (\S+),", out) < 1e-12
    assert number(r"ENERGY_MOMENTUM: .* momentum drift (\S+)", out) < 1e-12


def test_soft_box_is_pulled_wide_by_its_spin(tmp_path, command):
    command("solve", BODIES / "soft_box.py", "-o", "s.npz", "-q")
    with np.load(tmp_path / "s.npz") as file:
        F = file["q"][:, :9].reshape(-1, 3, 3)
    stretch = np.linalg.svd(F, compute_uv=False)
    # the strain at rest in its spin, σ = ρ ω² c² / 12; let go at once it overshoots, and spins slower then
    at_rest = (1000 * 81 / 12) * (1.0**2 - 0.3 * 0.6**2) / 5e4
    assert 1 + at_rest < stretch[:, 0].max() < 1 + 2 * at_rest
    assert stretch.min() > 0.8


def test_turntable_moves_as_it_is_told(tmp_path, command):
    command("solve", BODIES / "turntable.py", "-o", "t.npz", "-q")
    with np.load(tmp_path / "t.npz") as file:
        end = file["q"][-1]
    np.testing.assert_allclose(end[:9], [0, 1, 0, -1, 0, 0, 0, 0, 1], atol=1e-12)
    assert end[11] == pytest.approx(0.15)


def test_the_wheel_gives_way_to_its_contact_as_a_spectral_solution_says(tmp_path, script):
    out = script(EXAMPLES / "rotating_wheel.py", tmp_path / "wheel.png")
    for rate, dent in ((0, 2.068909634465), (30, 2.120223003867), (60, 2.314713545843)):
        assert number(rf"{rate} rad/s: .* by (\S+) mm", out) == pytest.approx(dent, rel=6e-3)
    sides = [number(rf"{word} (\S+) ", out) for word in ("side:", "and")]
    assert sides == pytest.approx([0.01354089404349, 0.01952175037520], rel=2e-2)
    # c_R / 1 m, and the contact is ∫ p cos(angle) dA
    assert number(r"about (\S+) rad/s by wave speeds", out) == pytest.approx(95.4813, abs=0.05)
    contact = 4e3 * 0.25 * 0.15 * (2 * 3.141592653589793) ** 0.5 * 2.718281828459045 ** (-(0.15**2) / 2)
    assert number(r"the hub carries (\S+) kN", out) == pytest.approx(-contact, rel=1e-4)
    assert (tmp_path / "wheel.png").stat().st_size > 10_000


def test_the_pulse_leaves_the_window(tmp_path, script):
    out = script(EXAMPLES / "translated_bar.py", tmp_path / "pulse.png")
    assert number(r"of the material (\S+) mm/s", out) < 1e-3 * number(r"at first (\S+) mm/s", out)
    wrong = dict(re.findall(r"t = (\S+) s: .* wrong by (\S+)", out))
    # Hexahedra of 8 nodes, 0.2 m and 0.4 ms, against d'Alembert's solution
    for time, error in (("0.04", 1.4e-2), ("0.08", 2.8e-2), ("0.16", 8.1e-4)):
        assert float(wrong[time]) == pytest.approx(error, rel=0.05)
    assert number(r"energy left (\S+)", out) < 1e-4
    assert (tmp_path / "pulse.png").stat().st_size > 10_000


def test_twisted_rubber_resists_and_pushes(tmp_path, script):
    out = script(EXAMPLES / "twisted_rubber.py", tmp_path / "rubber.png")
    torque, push = np.array(re.findall(r"torque +(\S+) kN m, push +(\S+) N", out), float).T
    slope = 1e6 / 2.8 * 0.1406 / 4 / 1e3  # G J / L of a square in kN m
    assert abs(torque[0] / (slope * np.pi / 4) - 1) < 0.05
    assert abs(push[1] / push[0] / 4 - 1) < 0.06  # Poynting: with the square of small angles
    assert (tmp_path / "rubber.png").stat().st_size > 10_000


def test_bolts_of_a_tight_flange_feel_little_of_the_moment(tmp_path, script):
    out = script(EXAMPLES / "bolted_flange.py", tmp_path / "flange.png")
    bolts = np.array([float(word) for word in re.search(r"bolts: \[(.*?)\]", out).group(1).split()])
    loose = number(r"loose: up to (\S+) kN", out)
    assert abs(loose - 4 * 1.0 / (8 * 0.21)) < 0.005  # M = 1 kN m about y
    added = bolts - 40.0
    assert np.abs(added + added.max() * np.cos(np.pi / 4 * np.arange(8))).max() < 0.011
    assert 0.01 * loose < added.max() < 0.1 * loose
    assert number(r"joint, with the moment: pressure (\S+)", out) > 0  # else the tie would pull
    assert number(r"above the bolts: (\S+) N m", out) == pytest.approx(1000.0, abs=1e-3)
    assert (tmp_path / "flange.png").stat().st_size > 10_000


def test_a_foundation_block_swings_as_one_mass_up_and_down(tmp_path, script):
    out = script(EXAMPLES / "foundation_block.py", tmp_path / "block.png")
    assert number(r"the curve is within (\S+) %", out) < 1.0
    mass, spring, damping = 9000.0, 1.2e8, 0.05
    assert number(r"along z: (\S+) µm", out) == pytest.approx(1e9 / spring / (2 * damping), rel=5e-3)
    assert number(r"along z: .* at (\S+) rad/s", out) == pytest.approx((spring / mass) ** 0.5, rel=6e-3)
    # to the side a rigid block slides by u and rocks by w about its middle, 0.5 m above the soil
    height, rock = 0.5, 2500 * 3.0 * (1 + 4) / 12 + 200 + 1500 * 1.0**2
    M = np.array([[mass, 1500 * 1.0], [1500 * 1.0, rock]])
    K = 6e7 * np.array([[1.0, -height], [-height, height**2]]) + np.diag([0, 4e7 * 1.5 * 2**3 / 12])
    exact = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)))
    found = [float(word) for word in re.findall(r"along x: .* at (\S+) rad/s", out)]
    assert found == pytest.approx(sorted(exact.real), rel=0.01)


def test_an_arch_carries_the_deck(tmp_path, script):
    out = script(EXAMPLES / "stiffest_arch.py", tmp_path / "arch.png")
    assert number(r"compliance (\S+) of the first", out) < 0.25
    assert number(r"volume (\S+)", out) == pytest.approx(0.35, abs=1e-3)
    assert (tmp_path / "arch.png").stat().st_size > 10_000

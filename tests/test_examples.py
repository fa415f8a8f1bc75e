"""Every example runs as a script and prints the numbers that are known."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
README = (EXAMPLES.parent / "README.md").read_text()


def run(*words, **options):
    return subprocess.run(words, capture_output=True, text=True, check=True, **options).stdout


def test_gravity_cube_sinks_by_the_exact_amount():
    out = run(sys.executable, EXAMPLES / "gravity_cube.py")
    top = float(re.search(r"top: (\S+) mm", out).group(1))
    assert abs(top / -0.13221477551020406 - 1) < 1e-9


def test_stiffness_by_hand_equals_the_library():
    out = run(sys.executable, EXAMPLES / "stiffness_by_hand.py")
    largest = float(re.search(r"entry of K: (\S+) N/m", out).group(1))
    # K_11 of a unit cube in closed form: (λ + 2μ + 2μ) / 9 with λ + 2μ = M
    modulus, mu = 210e6 * 0.7 / (1.3 * 0.4), 210e6 / 2.6
    assert abs(largest / ((modulus + 2 * mu) / 9) - 1) < 1e-6
    assert "rigid motions: 6" in out


def python_blocks(text):
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


@pytest.mark.parametrize("number", range(len(python_blocks(README))))
def test_python_of_the_readme_runs(number, tmp_path):
    out = run(sys.executable, "-c", python_blocks(README)[number], cwd=tmp_path)
    if "0.1322" in python_blocks(README)[number]:
        assert abs(float(out) / -0.13221477551020406 - 1) < 1e-12


@pytest.mark.parametrize("page", ["users.md", "add-an-element.md", "formats.md", "exercises.md"])
def test_python_of_each_page_runs_from_top_to_bottom(page, tmp_path):
    blocks = python_blocks((EXAMPLES.parent / "docs" / page).read_text())
    assert blocks
    script = tmp_path / "page.py"
    script.write_text("\n".join(blocks))
    out = run(sys.executable, "-W", "error", script, cwd=tmp_path)
    if page == "exercises.md":
        shares = [float(share) for share in re.findall(r"(\S+) of the beam", out)]
        assert len(shares) == 4
        assert shares[0] < shares[1] < 1  # linear elements are too stiff
        assert all(abs(share - 1) < 0.01 for share in shares[2:])


def test_elements_of_the_guide_conform(tmp_path):
    script = tmp_path / "guide.py"
    script.write_text("\n".join(python_blocks((EXAMPLES.parent / "docs" / "add-an-element.md").read_text())))
    out = run(sys.executable, "-m", "kratos_lite", "check", script)
    assert "MyWedge3D6N: 36 checks passed, 0 failed" in out
    assert "slate (TransverseIsotropic3D): 6 checks passed, 0 failed" in out


def test_cantilever_folder_of_kratos_bends_as_a_beam(tmp_path):
    out = tmp_path / "r.json"
    folder = EXAMPLES / "cantilever"
    run(sys.executable, "-m", "kratos_lite", "solve", folder / "ProjectParameters.json", "--json", out)
    result = json.loads(out.read_text())
    F, L, b, E, nu = 1e5 * 0.1**2, 1.0, 0.1, 210e9, 0.3
    beam = F * L**3 / (3 * E * b**4 / 12) + F * L / (5 / 6 * E / (2 * (1 + nu)) * b**2)
    work = result["strain_energy"]
    assert abs(work / (F * beam / 2) - 1) < 0.02  # clamped edge and 10 x 2 x 2 bricks: 1.5 % stiff
    assert result["total_reaction"][2] == pytest.approx(F, rel=1e-9)


def test_own_element_passes_its_conformance_kit():
    out = run(sys.executable, "-m", "kratos_lite", "check", EXAMPLES / "my_wedge.py")
    assert "0 failed" in out

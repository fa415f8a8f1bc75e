"""Every example runs as a script and prints the numbers that are known."""

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

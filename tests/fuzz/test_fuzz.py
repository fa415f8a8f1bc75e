"""A short run of the fuzzers, and every input with which something was wrong before."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("resource", reason="limits of a process are those of Unix")
ROOT = Path(__file__).parents[2]
BAD = ROOT / "tests" / "fixtures" / "bad"


def test_damaged_and_random_inputs_end_in_a_result_or_in_one_error():
    words = [sys.executable, "-m", "tests.fuzz", "--count", "400", "--seed", "12"]
    run = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
    assert "400 inputs of seed 12: 0 findings" in run.stdout


def test_an_input_depends_on_its_seed_and_number_alone(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    from tests.fuzz.__main__ import main

    def written(*words):
        monkeypatch.setattr(sys, "argv", ["fuzz", "--write", str(tmp_path), *words])
        assert main() == 0
        return {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    whole = written("--count", "5")
    assert len(whole) > 10
    shutil.rmtree(tmp_path / "3")
    assert written("--start", "3", "--count", "1") == whole


@pytest.fixture(scope="module")
def findings():
    sys.path.insert(0, str(ROOT))
    try:
        from tests.fuzz.oracle import findings
    finally:
        sys.path.remove(str(ROOT))
    return findings


@pytest.mark.parametrize("name", sorted(path.name for path in BAD.iterdir()))
def test_what_once_was_wrong_ends_in_a_result_or_in_one_error(name, findings, tmp_path, monkeypatch):
    for path in (BAD / name).iterdir():
        shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    files = [path for path in os.listdir() if path != "command"]
    assert findings((tmp_path / "command").read_text().split(), files) == []

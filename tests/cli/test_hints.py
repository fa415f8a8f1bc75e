"""Words that are misspelt, or that other versions and programs use, are answered with the right one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import kratos_lite as kl

BODY = {
    "mesh": {"box": {"size": [1, 1, 1]}},
    "material": {"E": 1e6, "nu": 0.3, "density": 1000},
    "body": "rigid",
    "time": {"step": 0.01, "steps": 1},
}
GUST = Path(__file__).parents[2] / "examples" / "tower" / "gust.json"


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["solve", "a.json", "--scheme", "newmark"], "It is called --integrator here"),
        (["solve", "a.json", "--march", "1e-3:10"], "It is called --time here"),
        (["solve", "a.json", "--ends", "periodic"], "It is called --boundaries here"),
        (["solve", "a.json", "--csv", "a.csv"], "It is called --output here"),
        (
            ["solve", "a.json", "--tractoin", "z+:0,0,1"],
            "--tractoin: there is no such option. Did you",
        ),
        (
            ["solve", "a.json", "--gravty=0,0,1"],
            "error: --gravty: there is no such option. Did you mean --gra",
        ),
        (["solve", "a.json", "--tracton", "z+:0,0,1"], "Did you mean --traction or --translation?"),
        (["check", "a.json", "-gravty", "0,0,1"], "Did you mean --gravity?"),
        (["info", "a.json", "--fix", "z-:xyz"], "--fix: info does not take it; solve and check do"),
        (["solve", "a.json", "--gravity", "0", "0", "-9.81"], "joined by commas, as in --gravity 0,0,-9.81"),
        (["solve", "a.json", "b.json"], "'b.json' is one word too many"),
        (["convert", "a.mdpa", "b.vtu", "--lenent"], "Did you mean --lenient?"),
        (["march", "a.json"], "Did you mean solve, with --time STEP:STEPS?"),
        (["slove", "a.json"], "Did you mean solve?"),
        (["solve", "a.json", "--solver", "direkt"], "Did you mean direct?"),
    ],
)
def test_an_option_or_command_of_another_name_is_answered_with_ours(run, words, hint):
    done = run(*words)
    assert (done.code, done.out) == (2, "")
    assert done.err.count("error: ") == 1
    assert len(done.err.splitlines()) == 2
    assert hint in done.err


@pytest.mark.parametrize(
    ("change", "hint"),
    [
        ({"body": {"kind": "pseudo-rigid", "scheme": "x"}}, "It is called integrator here"),
        ({"body": {"kind": "finite-element", "form": "TL"}}, "It is called formulation here"),
        ({"march": BODY["time"]}, "It is called time here"),
        (
            {"loads": [{"type": "gravity", "acceleration": [0, 0, -1], "factor": 2}]},
            "It is called amplitude here",
        ),
        (
            {"loads": [{"type": "gravity", "acceleration": [0, 0, -1], "amplitude": {"factors": [1]}}]},
            "It is called values here",
        ),
        ({"constraints": [{"type": "set_velocity"}]}, "It is called prescribed_velocity here"),
    ],
)
def test_a_key_of_another_name_is_answered_with_ours(run, tmp_path, change, hint):
    (tmp_path / "a.json").write_text(json.dumps(BODY | change))
    assert run("check", tmp_path / "a.json").refuses("a.json:1:", hint)


def test_the_ends_of_a_translation_are_called_boundaries(run, tmp_path):
    kl.write(tmp_path / "box.mdpa", kl.box())
    ale = {"translation": {"direction": "x", "rate": 1.0, "ends": "periodic"}}
    (tmp_path / "a.json").write_text(
        json.dumps({"model": "box.mdpa", "ale": ale, "material": BODY["material"]})
    )
    assert run("check", tmp_path / "a.json").refuses("a.json:1:", "It is called boundaries here")


def test_converting_what_changes_in_time_speaks_of_no_format_that_nobody_named(run, tmp_path):
    done = run("convert", GUST, tmp_path / "a.vtu")
    assert done.refuses("gust.json: a load that changes in time cannot be written")
    assert ".mdpa" not in done.err

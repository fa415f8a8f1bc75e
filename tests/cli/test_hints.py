"""Words that are misspelt, or that other versions and programs use, are answered with the right one."""

from __future__ import annotations

from pathlib import Path

import pytest

import kratos_lite as kl

GUST = Path(__file__).parents[2] / "examples" / "tower" / "gust.py"


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
        (["solve", "a.json", "--line"], "--line: there is no such option. Did you mean --linear?"),
        (["solve", "a.json", "--tracton", "z+:0,0,1"], "Did you mean --traction or --translation"),
        (["check", "a.json", "-gravty", "0,0,1"], "Did you mean --gravity?"),
        (["info", "a.json", "--fix", "z-:xyz"], "--fix: info does not take it; solve and check do"),
        (["solve", "a.json", "--gravity", "0", "0", "-9.81"], "joined by commas, as in --gravity 0,0,-9.81"),
        (["solve", "a.json", "b.json"], "'b.json' is one word too many"),
        (["convert", "a.mdpa", "b.vtu", "--lenent"], "Did you mean --lenient?"),
        (["slove", "a.json"], "Did you mean solve?"),
        (["--versoin"], "--versoin: there is no such option. Did you mean --version?"),
        (["solve", "a.json", "--solver", "direkt"], "Did you mean direct?"),
    ],
)
def test_an_option_or_command_of_another_name_is_answered_with_ours(run, words, hint):
    done = run(*words)
    assert (done.code, done.out) == (2, "")
    assert done.err.count("error: ") == 1
    assert len(done.err.splitlines()) == 2
    assert hint in done.err


def test_converting_what_changes_in_time_speaks_of_no_format_that_nobody_named(run, tmp_path):
    done = run("convert", GUST, tmp_path / "a.vtu")
    assert done.refuses("gust.py: a load that changes in time cannot be written")
    assert ".mdpa" not in done.err


@pytest.mark.parametrize(
    ("call", "meant"),
    [
        (lambda: kl.box(element="C3D8"), "KinematicLinear3D8N"),
        (lambda: kl.box(element="C3D20R"), "Reduced3D20N"),
        (lambda: kl.box(element="3D8"), "KinematicLinear3D8N"),
        (lambda: pulled().plot("no.png", "S11"), "sxx"),
        (lambda: pulled().plot("no.png", "S13"), "szx"),
        (lambda: pulled().plot("no.png", "U3"), "uz"),
    ],
)
def test_names_of_abaqus_are_answered_with_ours(call, meant):
    with pytest.raises(kl.InputError, match=f"It is called {meant} here"):
        call()


def pulled():
    """Return the result of a cube under tension."""
    model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (1e3, 0, 0)))
    return model.solve()

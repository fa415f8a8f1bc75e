"""The command line with laws that are not linear: flags on a mesh, scripts, checks, what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.cli import main

LAW = "J2Plasticity3D:E=200e9,nu=0.3,yield_stress=200e6,hardening=2e9,kinematic=1e9"
STEEL = kl.J2Plasticity3D(200e9, 0.3, 200e6, 2e9, 1e9)
HELD = ("--fix", "x-:x", "--fix", "y-:y", "--fix", "z-:z", "--fix", "z+:z=0.01")


@pytest.fixture(autouse=True)
def box(tmp_path, monkeypatch):
    """A small mesh as box.vtu in the current folder."""
    monkeypatch.chdir(tmp_path)
    mesh = kl.box(cells=(2, 2, 2))
    kl.write("box.vtu", mesh)
    return mesh


def bar(mesh, law, **options):
    model = kl.Model(mesh, law, **options)
    for side in "xyz":
        model.fix(f"{side}-", side)
    model.fix("z+", "z", 0.01)
    return model


def displacement(path):
    return np.array(list(json.loads(Path(path).read_text(encoding="utf-8"))["displacement"].values()))


def test_a_mesh_with_a_law_that_yields(box, capsys):
    assert main(["solve", "box.vtu", "--material", LAW, *HELD, "-o", "out.vtu", "--json", "out.json"]) == 0
    out = capsys.readouterr().out
    assert "plastic strain        up to 8.86" in out
    assert "estimated error" not in out
    result = bar(box, STEEL).solve()
    assert np.abs(displacement("out.json") - result.u).max() < 1e-12
    read = json.loads(Path("out.json").read_text(encoding="utf-8"))["largest_accumulated_plastic_strain"][
        "value"
    ]
    assert abs(read / ((0.01 - 1e-3) * 200 / 203) - 1) < 1e-6
    assert main(["check", "box.vtu", "--material", LAW, *HELD]) == 0
    assert main(["solve", "box.vtu", "--material", LAW + ",flow=1", *HELD]) != 0
    assert "constants of J2Plasticity3D are E, nu, yield_stress" in capsys.readouterr().err


def test_large_displacements_by_a_flag(box):
    words = ["--material", "E=1e6,nu=0.3", "--formulation", "total_lagrangian", *HELD[:-1], "z+:z=0.5"]
    assert main(["solve", "box.vtu", *words, "--json", "out.json", "--picture", "out.png"]) == 0
    model = bar(box, kl.Isotropic3D(1e6, 0.3), formulation="total_lagrangian")
    model.fix("z+", "z", 0.5, override=True)
    assert np.abs(displacement("out.json") - model.solve().u).max() < 1e-12


def test_what_is_for_linear_laws(capsys):
    words = ["solve", "box.vtu", "--material", LAW, *HELD]
    assert main([*words, "--error", "1%"]) != 0
    assert "a requested error takes linear laws" in capsys.readouterr().err

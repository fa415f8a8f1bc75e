"""What describes the library in several files is the same in all of them."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import kratos_lite as kl

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def project():
    """Return the table of the project; Python has a reader from 3.11 on."""
    tomllib = pytest.importorskip("tomllib")
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def text(name):
    """Return the text of a file beside the package."""
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_version_is_the_same_everywhere():
    assert json.loads(text("codemeta.json"))["version"] == kl.__version__
    assert f"version: {kl.__version__}\n" in text("CITATION.cff")
    assert f'version: "{kl.__version__}"\n' in text("conda/recipe.yaml")


def test_addresses_and_words_are_the_same_everywhere(project):
    known, urls = json.loads(text("codemeta.json")), project["urls"]
    assert [known["url"], known["codeRepository"], known["issueTracker"]] == [
        urls[name] for name in ("Homepage", "Source", "Issues")
    ]
    recipe = text("conda/recipe.yaml")
    for name, field in (
        ("Homepage", "homepage"),
        ("Documentation", "documentation"),
        ("Source", "repository"),
    ):
        assert f"{field}: {urls[name]}\n" in recipe
    assert known["description"] == project["description"]
    assert known["keywords"] == project["keywords"]
    assert [author["name"] for author in known["author"]] == [author["name"] for author in project["authors"]]


def test_requirements_are_the_same_everywhere(project):
    required = project["dependencies"]
    assert json.loads(text("codemeta.json"))["softwareRequirements"] == required
    run, optional = text("conda/recipe.yaml").split("  run:")[1].split("  run_constraints:")
    recipe = re.findall(r"- (\w+ >=[\d.]+)", run)
    assert [line.replace(" ", "") for line in recipe] == required
    extra = [line.split(";")[0] for line in project["optional-dependencies"]["mpi"]]
    assert {line.replace(" ", "") for line in re.findall(r"- (\w+ >=[\d.]+)", optional)} <= set(extra)
    oldest = dict(line.split("==") for line in text(".ci/oldest.txt").split() if "==" in line)
    bounds = dict(line.split(">=") for line in (*required, *project["optional-dependencies"]["view"]))
    for name, version in bounds.items():
        assert f"{oldest.pop(name)}.".startswith(f"{version}.")
    assert list(oldest) == ["pyparsing"]  # which matplotlib needs


def test_an_unknown_kind_of_build_is_refused():
    pytest.importorskip("setuptools")
    run = subprocess.run(
        [sys.executable, "setup.py", "--version"],
        cwd=ROOT,
        env={**os.environ, "KRATOS_LITE_BUILD": "fast"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode
    assert run.stderr == "KRATOS_LITE_BUILD='fast'; expected compiled or pure, or nothing\n"

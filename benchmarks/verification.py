"""The pages of verification, with what other programs find: ``python -m benchmarks.verification``.

Every problem at rest is given to Kratos, CalculiX and scikit-fem as the same nodes, elements, supports and
nodal forces; the quantity of the table follows from their nodal displacements.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import kratos_lite as kl
from benchmarks.driver import ROOT
from benchmarks.programs import PROGRAMS
from benchmarks.scenes import write
from kratos_lite.verification import page
from kratos_lite.verification.problem import Row, as_tuple
from kratos_lite.verification.scenes import Scene
from kratos_lite.verification.table import verify

PAGE = ROOT / "docs" / "about" / "verification.md"
PARTS = PAGE.with_suffix("")
RESULTS = ROOT / "benchmarks" / "results" / "verification.json"
COMMAND = "python -m benchmarks.verification"
PEERS = ("Kratos", "CalculiX", "scikit-fem")
CURVED = 1e-9
"""Distance of a mid-edge node from the middle / size of the mesh, from which an edge is curved."""


@dataclass
class Given:
    """A model as the programs get it, and their displacements by program."""

    scene: Scene
    forces: np.ndarray
    stem: Path
    curved: bool

    def result(self, u: np.ndarray) -> kl.Result:
        """Return a result with the displacements of another program."""
        model = self.scene.model
        zero = np.zeros_like(u)
        return kl.Result(model.mesh, model.element_groups(), u, zero, self.forces.copy(), None)

    def displacement(self, program: str) -> Path:
        """Return the file of the displacements of a program."""
        return self.stem.with_suffix(f".{PROGRAMS[program].module}.npy")

    def job(self, program: str) -> dict[str, str]:
        """Return the job for a program."""
        job = {"task": "solve", "stem": str(self.stem), "kind": self.scene.kind, "kratos_solver": "LU"}
        return job | {"folder": str(self.stem.parent), "displacement": str(self.displacement(program))}


def is_curved(mesh: kl.Mesh) -> bool:
    """Return whether a mid-edge node lies off the middle of its edge."""
    (block,) = mesh.blocks
    shape, X = block.shape, mesh.points[block.nodes]
    if len(shape.nodes) == shape.corners:
        return False
    ends = np.array(shape.edges)
    middles = X[:, shape.corners : shape.corners + len(ends)]
    return bool(np.abs(middles - X[:, ends].mean(axis=2)).max() > CURVED * np.ptp(mesh.points))


def given(model: kl.Model, kind: str, folder: Path, number: int) -> Given | None:
    """Write a model for the programs; None where it ties displacements to others, which not all can."""
    if len(model.supports.constraints) or model.motion is not None:
        return None
    scene = Scene("m", kind, number, model)
    forces = scene.forces()
    model.loads.clear()
    model.add(kl.NodalForces(forces))
    return Given(scene, forces, write(scene, folder), is_curved(model.mesh))


def prepared(rows: list[Row], folder: Path) -> dict[int, list[Given]]:
    """Write the models of all rows that are problems at rest; rows with the same models share them."""
    known: dict[object, list[Given | None]] = {}
    ready = {}
    for i, row in enumerate(rows):
        if row.problem.models is not None:
            key = row.problem.models, row.element
            if key not in known:
                models = as_tuple(row.problem.models(row.element))
                known[key] = [given(m, row.kind, folder, 10 * len(known) + k) for k, m in enumerate(models)]
            if None not in known[key]:
                ready[i] = known[key]
    return ready


def takes(program: str, one: Given) -> bool:
    """Return whether a program has this element, with edges as these are."""
    has = PROGRAMS[program]
    return one.scene.kind in has.kinds and (not one.curved or one.scene.kind in has.curved)


def solved(program: str, python: str, jobs: list[dict[str, str]], folder: Path) -> str:
    """Let a program do its jobs in one process; return its version, or "" where it is absent."""
    module, environment = PROGRAMS[program].module, PROGRAMS[program].environment
    path = folder / f"{module}.json"
    path.write_text(json.dumps(jobs))
    with path.with_suffix(".log").open("w") as log:
        variables = os.environ | {"PYTHONPATH": str(ROOT)} | environment
        command = [python, "-m", "benchmarks.programs", module, str(path)]
        subprocess.run(command, env=variables, cwd=folder, check=True, stdout=log, stderr=subprocess.STDOUT)
    told = json.loads(path.with_suffix(".answer.json").read_text())
    if "absent" in told:
        print(f"{program} is left out: {told['absent']}")
        return ""
    for line in told["failed"]:
        print(f"{program}: {line}")
    return str(told["version"])


def beside(rows: list[Row], python: str, folder: Path) -> tuple[list[Row], dict[str, str]]:
    """Return the rows with what other programs find, and the versions of these."""
    ready, versions = prepared(rows, folder), {}
    for program in PEERS:
        able = {i: models for i, models in ready.items() if all(takes(program, one) for one in models)}
        jobs = {str(one.stem): one.job(program) for models in able.values() for one in models}
        version = solved(program, python, list(jobs.values()), folder)
        if not version:
            continue
        versions[program] = version
        for i, models in able.items():
            paths = [one.displacement(program) for one in models]
            if all(path.exists() for path in paths):
                results = [one.result(np.load(path)) for one, path in zip(models, paths, strict=True)]
                value = float(rows[i].problem.measure(*results))
                rows[i] = replace(rows[i], others=rows[i].others | {program: value})
    return rows, versions


def keep(rows: list[Row], versions: dict[str, str]) -> None:
    """Write what the other programs find, to four digits more than the page shows."""
    found: dict[str, dict[str, dict[str, float]]] = {}
    for row in rows:
        if row.others:
            values = {name: float(f"{value:.8g}") for name, value in row.others.items()}
            found.setdefault(row.problem.name, {})[row.kind] = values
    problems = ",\n".join(f"  {json.dumps(name)}: {json.dumps(kinds)}" for name, kinds in found.items())
    head = f'{{\n "versions": {json.dumps(versions)},\n "problems": {{\n'
    RESULTS.write_text(f"{head}{problems}\n }}\n}}\n", encoding="utf-8")


def kept(rows: list[Row]) -> tuple[list[Row], dict[str, str]]:
    """Return the rows with what the other programs found when they last ran."""
    told = json.loads(RESULTS.read_text(encoding="utf-8"))
    known = told["problems"]
    rows = [replace(row, others=known.get(row.problem.name, {}).get(row.kind, {})) for row in rows]
    return rows, told["versions"]


def write_pages(text: str) -> None:
    """Write the table as pages: the overview and the sources, and one page for each family."""
    intro, overview, *families, sources = text.split("\n## ")
    names = {title: family for family, title in page.TITLES.items()}
    pages = {names[part.partition("\n")[0]]: f"# {part}" for part in families}
    PARTS.mkdir(exist_ok=True)
    for name, part in pages.items():
        (PARTS / f"{name}.md").write_text(part, encoding="utf-8")
    links = "".join(f"- [{page.TITLES[name]}]({PARTS.name}/{name}.md)\n" for name in pages)
    tree = "\n".join(f"{PARTS.name}/{name}" for name in pages)
    overview += f"\n## Values\n\n{links}\n```{{toctree}}\n:hidden:\n\n{tree}\n```\n"
    PAGE.write_text("\n## ".join((intro, overview, sources)), encoding="utf-8")


def main() -> None:
    """Compute the table, let the other programs solve its problems, and write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description=__doc__)
    parser.add_argument("--python", help="let the programs of this interpreter solve the problems anew")
    options = parser.parse_args()
    rows = list(verify())
    if options.python:
        with tempfile.TemporaryDirectory(prefix="kratos_lite_verify_") as folder:
            rows, versions = beside(rows, options.python, Path(folder))
        keep(rows, versions)
    rows, versions = kept(rows)
    write_pages(page.markdown(rows, versions, COMMAND))
    print(page.summary(rows))


if __name__ == "__main__":
    main()

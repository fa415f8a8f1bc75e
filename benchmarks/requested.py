"""Solutions to a requested accuracy beside the best hand-made meshes, on every scene with an exact field.

``python -m benchmarks adaptive`` asks `Model.solve(error=…)` for three errors from one coarse mesh of 8N, and
solves meshes made by hand, uniform ones and at the re-entrant corner graded ones, of several elements.  Times
are of the processor, that of the solution alone; hand-made meshes have theirs at the true error of the
adaptive solution, on the line through the two meshes of one element nearest to it.  It writes
benchmarks/results/adaptive.json; docs/about/estimated-errors.md shows it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import kratos_lite as kl
from benchmarks import scenes
from benchmarks.programs import FORMULATIONS
from benchmarks.programs.adaptive import geometry_of
from kratos_lite.errors import KratosLiteError
from kratos_lite.typing import Array
from kratos_lite.verification import concentrations, fields
from kratos_lite.verification import scenes as shared
from kratos_lite.verification.errors import errors, norms
from kratos_lite.verification.meshes import plane, shaped
from kratos_lite.verification.pressure import lame_cylinder
from kratos_lite.verification.scenes import UNIT, Scene

RESULTS = Path(__file__).with_name("results") / "adaptive.json"
GOALS = (0.03, 0.01, 0.003)
KINDS = ("20N", "20N reduced", "27N", "8N enhanced", "27N B-bar")
"""Elements of the meshes made by hand."""
SIZES = (1, 2, 3, 4, 6, 8, 12, 16)
GRADINGS = {"l_domain": (2.0,)}
"""Powers with which cells become smaller towards the planes through the origin."""
LONGEST = 0.4
"""Seconds after which no finer mesh is made by hand."""
TEXT = """
A requested error, from one coarse mesh of 8N: asked for, true and reported error in percent of the energy
norm, unknowns of the last mesh, number of meshes, and processor time of all; beside them the fastest mesh
made by hand with the same true error, and the ratio of the two times. These are of the elements
{kinds}, uniform or, at the corner of the L, graded;
"-" where none of half a second has that error. They have no estimate, and nobody knows their error
beforehand.

"""


def cylinder(kind: str, n: int) -> Scene:
    """Return a quarter of a thick cylinder, radii 1 and 3, under inner pressure in plane strain."""

    def place(X: Array) -> Array:
        r, angle = 1 + 2 * X[:, 0], np.pi / 2 * X[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.5 * X[:, 2]])

    def exact(X: Array) -> Array:
        r = np.linalg.norm(X[..., :2], axis=-1, keepdims=True)
        flat = lame_cylinder(UNIT.nu, UNIT.E, 1.0, 3.0, r) * X[..., :2] / r
        return np.concatenate([flat, 0.0 * r], axis=-1)

    mesh = shaped(kind, (n, n, 1), place)
    model = kl.Model(mesh, UNIT)
    model.fix(plane(0, 0.0), "x")
    model.fix(plane(1, 0.0), "y")
    for end in (0.0, 0.5):
        model.fix(plane(2, end), "z")
    model.add(kl.Pressure(np.abs(np.linalg.norm(mesh.points[:, :2], axis=1) - 1) < 1e-9, 1.0))
    return Scene("cylinder", kind, n, model, exact)


def manufactured(kind: str, n: int) -> Scene:
    """Return the manufactured solution with its force known everywhere, not at the nodes of one mesh."""
    scene = shared.manufactured(kind, n)
    scene.model.loads[:] = [
        kl.BodyForce(lambda X: fields.manufactured_force(X, UNIT.E, UNIT.nu)),
    ]
    return scene


MAKERS: dict[str, Callable[[str, int], Scene]] = {
    "l_domain": shared.l_domain,
    "cavity": shared.cavity,
    "hole": concentrations.hole,
    "sphere": shared.sphere,
    "cylinder": cylinder,
    "manufactured": manufactured,
    "bending": shared.bending,
    "hole_incompressible": scenes.hole_incompressible,
}


def make(name: str, kind: str, n: int, grading: float = 1.0) -> Scene:
    """Return a scene, its cells smaller towards the planes x = 0 and y = 0 by a power of the places."""
    scene = replace(MAKERS[name](FORMULATIONS.get(kind, kind), n), kind=kind)
    if grading == 1.0:
        return scene
    old, X = scene.model, scene.model.mesh.points.copy()
    X[:, :2] = np.sign(X[:, :2]) * np.abs(X[:, :2]) ** grading
    scene.model = kl.Model(kl.Mesh(X, old.mesh.blocks), UNIT)
    for fixing in old.supports.fixings:
        where = fixing.rows if fixing.where is None else fixing.where
        scene.model.fix(where, fixing.axes, field=fixing.field)
    return scene


def timed(work: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """Return what some work gives, and its least processor time in s."""
    least = np.inf
    for _ in range(repeats):
        start = process_time()
        found = work()
        least = min(least, process_time() - start)
    return found, least


def by_hand(name: str, kind: str, grading: float, aim: float) -> list[dict[str, Any]]:
    """Return meshes of one element, ever finer, until the relative error is below `aim`."""
    rows: list[dict[str, Any]] = []
    for n in SIZES:
        scene = make(name, kind, n, grading)
        try:
            result, seconds = timed(scene.model.solve, 3)
        except KratosLiteError:
            return rows
        true = errors(scene, result.u)["energy"]
        row = {"scene": name, "kind": kind, "grading": grading, "n": n, "true": true}
        rows.append(row | {"unknowns": result.report.unknowns, "seconds": seconds})
        if true < aim or seconds > LONGEST:
            break
    return rows


def adaptive(name: str, goal: float, kind: str = "8N", n: int = 2) -> dict[str, Any]:
    """Return what a solution to a requested error says."""
    row: dict[str, Any] = {"scene": name, "goal": goal}
    scene = make(name, kind, n)
    geometry = geometry_of(name, scene.model.mesh)
    result, seconds = timed(lambda: scene.model.solve(error=goal, geometry=geometry), 2)
    true = norms(scene.exact, result.mesh.points, result.groups, result.u)[1]  # type: ignore[arg-type]
    report = result.report
    row |= {"true": true, "reported": report.error, "unknowns": report.unknowns, "seconds": seconds}
    row |= {"history": [[step.unknowns, step.error, step.seconds] for step in report.history]}
    return row | {"warnings": report.warnings}


def at_error(rows: Sequence[dict[str, Any]], true: float, key: str = "seconds") -> float:
    """Return time or unknowns of meshes of one element at an error, on a line of logarithms.

    >>> at_error([{"true": 0.1, "seconds": 1.0}, {"true": 0.001, "seconds": 100.0}], 0.01)
    10.0
    """
    for coarse, fine in pairwise(rows):
        if fine["true"] <= true <= coarse["true"]:
            a, b, t = (np.log(x) for x in (coarse["true"], fine["true"], max(true, 1e-300)))
            share = (a - t) / (a - b)
            return float(np.exp((1 - share) * np.log(coarse[key]) + share * np.log(fine[key])).round(9))
    return float(rows[0][key]) if rows and rows[0]["true"] <= true else float("inf")


def best(rows: Sequence[dict[str, Any]], name: str, true: float) -> dict[str, Any]:
    """Return element, grading, time and unknowns of the fastest mesh made by hand at an error."""
    mine = [row for row in rows if row["scene"] == name]
    found = []
    for kind, grading in dict.fromkeys((row["kind"], row["grading"]) for row in mine):
        line = [row for row in mine if (row["kind"], row["grading"]) == (kind, grading)]
        figures = {key: at_error(line, true, key) for key in ("seconds", "unknowns")}
        found.append({"kind": kind, "grading": grading} | figures)
    return min(found, key=lambda row: row["seconds"])


def table(rows: Sequence[dict[str, Any]], hand: Sequence[dict[str, Any]]) -> str:
    """Return the table of requested errors beside hand-made meshes."""
    heads = (
        "scene",
        "asked",
        "true",
        "reported",
        "unknowns",
        "meshes",
        "time",
        "by hand",
        "unknowns",
        "time",
    )
    lines = ["| " + " | ".join([*heads, "ratio"]) + " |", "| --- " * (len(heads) + 1) + "|"]
    for row in rows:
        other = best(hand, row["scene"], row["true"])
        name = f"{other['kind']}{' graded' * (other['grading'] > 1)}"
        known = np.isfinite(other["seconds"])
        theirs = (
            [name, f"{other['unknowns']:.0f}", f"{1e3 * other['seconds']:.0f} ms"] if known else ["-"] * 3
        )
        true = f"{100 * row['true']:.2g}" if row["true"] > 1e-9 else "exact"
        mine = [f"{100 * row['reported']:.2g}{'*' * bool(row['warnings'])}", f"{row['unknowns']}"]
        mine += [f"{len(row['history'])}", f"{1e3 * row['seconds']:.0f} ms"]
        ratio = f"{row['seconds'] / other['seconds']:.1f}" if known else "-"
        cells = [row["scene"].replace("_", " "), f"{100 * row['goal']:.2g}", true, *mine, *theirs, ratio]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def kept() -> dict[str, Any]:
    """Return the results kept, or none."""
    return dict(json.loads(RESULTS.read_text())) if RESULTS.exists() else {"rows": [], "hand": []}


def section() -> str:
    """Return the text and table of the results kept, for the page about accuracy."""
    found = kept()
    if not found["rows"]:
        return ""
    return TEXT.format(kinds=", ".join(KINDS)) + table(found["rows"], found["hand"])


def run(names: Sequence[str] | None, kinds: Sequence[str] | None) -> dict[str, Any]:
    """Measure the scenes and elements asked for, and print and return them."""
    rows: list[dict[str, Any]] = []
    hand: list[dict[str, Any]] = []
    for name in names or MAKERS:
        mine = [adaptive(name, goal) for goal in GOALS]
        aim = min(row["true"] for row in mine)
        for kind in kinds or KINDS:
            for grading in GRADINGS.get(name, (1.0,)):
                hand += by_hand(name, kind, grading, aim)
        print(table(mine, hand).partition("\n")[2].partition("\n")[2], end="", flush=True)
        rows += mine
    return {"set": "adaptive", "rows": rows, "hand": hand}


def write(found: dict[str, Any]) -> None:
    """Write the results."""
    lists = [
        f'"{key}": [\n' + ",\n".join("  " + json.dumps(row) for row in found[key]) + "\n]"
        for key in ("rows", "hand")
    ]
    RESULTS.write_text('{"set": "adaptive", ' + ",\n".join(lists) + "}\n", encoding="utf-8")

"""Estimated over true errors on every scene with an exact field, the last section of a page of the docs.

``python -m benchmarks effectivity`` solves the scenes with all elements on two meshes each, compares
`result.error()` with the error of the solution, and recovered and averaged stresses at nodes with the exact
ones; it writes benchmarks/results/effectivity.json and the last section of docs/about/estimated-errors.md.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import requested, scenes
from benchmarks.driver import ROOT
from kratos_lite import voigt
from kratos_lite.errors import KratosLiteError
from kratos_lite.verification import fields
from kratos_lite.verification.errors import errors
from kratos_lite.verification.meshes import kind_of

RESULTS = Path(__file__).with_name("results") / "effectivity.json"
PAGE = ROOT / "docs" / "about" / "estimated-errors.md"
NAMES = ("manufactured", "sphere", "bending", "l_domain", "cavity", "hole_incompressible")
KINDS = ("4N", "5N", "6N", "8N", "10N", "13N", "15N", "20N", "27N", *scenes.FORMULATIONS)
SIZES = {1: (4, 8), 2: (2, 4)}
"""Cells along an edge by degree of the element."""
EXACT = 1e-9
"""Relative error below which a solution is exact, and has no effectivity."""
TEXT = """## Measured

Reported over true error on two meshes, the second of half the cell size; "exact" where the element has the
exact solution, "-" where it is refused or the scene is not made for it.

"""
"""Heading of what is measured, which `write` renews at the end of the page."""


def measured(name: str, kind: str, n: int) -> dict[str, Any]:
    """Return what one scene says: true and reported error, and errors of nodal stresses, all relative."""
    row: dict[str, Any] = {"scene": name, "kind": kind, "n": n}
    try:
        scene = scenes.make(name, kind, n)
        result = scene.model.solve()
    except KratosLiteError as error:
        return row | {"failed": str(error)}
    true, estimate = errors(scene, result.u)["energy"], result.error()
    row |= {"true": true, "reported": estimate.relative, "method": estimate.method}
    row |= {"warnings": estimate.warnings}
    C = scene.model.element_groups()[0].material.C
    exact = voigt.symmetric_gradient(fields.gradient(scene.exact, scene.model.mesh.points)) @ C
    known = np.isfinite(exact).all(axis=1)
    for place in ("node", "averaged"):
        off = (result.stress(place) - exact)[known]
        row[place] = float(np.linalg.norm(off) / np.linalg.norm(exact[known]))
    return row


def entry(rows: Sequence[dict[str, Any]]) -> str:
    """Return reported over true error of the meshes of a scene.

    >>> entry([{"true": 0.2, "reported": 0.3, "warnings": ["coarse"]}])
    '1.50*'
    """
    if not rows or any("failed" in row for row in rows):
        return "-"
    if all(row["true"] < EXACT for row in rows):
        return "exact"
    return " → ".join(f"{row['reported'] / row['true']:.2f}{'*' * bool(row['warnings'])}" for row in rows)


def stress_entry(rows: Sequence[dict[str, Any]]) -> str:
    """Return the errors of recovered and of averaged stresses on the finer mesh in percent."""
    if not rows or "failed" in rows[-1]:
        return "-"
    return f"{100 * rows[-1]['node']:.2g} / {100 * rows[-1]['averaged']:.2g}"


def table(rows: Sequence[dict[str, Any]], show: Any, names: Sequence[str]) -> str:
    """Return a table, elements down and scenes across."""
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    lines = ["| element | " + " | ".join(name.replace("_", " ") for name in names) + " |"]
    lines.append("| --- " * (len(names) + 1) + "|")
    for kind in kinds:
        found = [[r for r in rows if r["kind"] == kind and r["scene"] == name] for name in names]
        lines.append(f"| {kind} | " + " | ".join(map(show, found)) + " |")
    return "\n".join(lines) + "\n"


def page(rows: Sequence[dict[str, Any]]) -> str:
    """Return the end of the page about the accuracy of results: what was measured."""
    smooth = [name for name in NAMES if name not in ("l_domain", "hole_incompressible")]
    stresses = (
        "\nStresses at nodes, relative error in percent on the finer mesh, root mean square over all nodes: "
        "recovered / averaged.\n\n"
    )
    return (
        TEXT + table(rows, entry, NAMES) + stresses + table(rows, stress_entry, smooth) + requested.section()
    )


def run(names: Sequence[str] | None, kinds: Sequence[str] | None) -> list[dict[str, Any]]:
    """Measure the scenes and elements asked for, print them as they come, and return all rows."""
    rows = []
    for kind in kinds or KINDS:
        for name in names or NAMES:
            degree = kind_of(scenes.FORMULATIONS.get(kind, kind)).shape.degree
            found = [measured(name, kind, n) for n in SIZES[degree]]
            print(f"{name:20} {kind:12} {entry(found)}", flush=True)
            rows += found
    return rows


def write(rows: Sequence[dict[str, Any]]) -> None:
    """Write the results and the page."""
    lines = ",\n".join("  " + json.dumps(row, ensure_ascii=False) for row in rows)
    RESULTS.write_text(f'{{"set": "effectivity", "rows": [\n{lines}\n]}}\n', encoding="utf-8")
    write_page(rows)


def write_page(rows: Sequence[dict[str, Any]]) -> None:
    """Write what was measured at the end of the page."""
    written = PAGE.read_text(encoding="utf-8").partition(TEXT.splitlines()[0])[0]
    PAGE.write_text(written + page(rows), encoding="utf-8")

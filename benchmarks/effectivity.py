"""Estimated over true errors on every scene with an exact field, and the page about them.

``python -m benchmarks effectivity`` solves the scenes with all elements on two meshes each, compares
`result.error()` with the error of the solution, and recovered and averaged stresses at nodes with the exact
ones; it writes benchmarks/results/effectivity.json and docs/accuracy.md.
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
PAGE = ROOT / "docs" / "accuracy.md"
NAMES = ("manufactured", "sphere", "bending", "l_domain", "cavity", "hole_incompressible")
KINDS = ("4N", "5N", "6N", "8N", "10N", "13N", "15N", "20N", "27N", *scenes.FORMULATIONS)
SIZES = {1: (4, 8), 2: (2, 4)}
"""Cells along an edge by degree of the element."""
EXACT = 1e-9
"""Relative error below which a solution is exact, and has no effectivity."""
TEXT = """# How accurate a result is

```python
import kratos_lite as kl

bar = kl.Model(kl.box((4, 1, 1), (4, 2, 2)), kl.Isotropic3D(E=210e9, nu=0.3))
bar.fix("x-")
bar.add(kl.Traction("x+", (0, 0, -1e6)))

result = bar.solve()
print(result.error())  # in the energy norm
tip = kl.DisplacementAt((4, 0.5, 0.5), "z")
print(result.error(of=tip))  # of a displacement; there are reactions and stresses, too
kl.draw("error.png", result, values="ENERGY_NORM_ERROR")

better = bar.solve(error=0.05)  # on meshes that become finer until the error is 5 %
for mesh in better.report.history:
    print(mesh)
kl.draw_history("history.png", better)
```

On the command line the summary shows the estimated error, `--error 5%` asks for one, and `.vtu` files have that of
each element as `ENERGY_NORM_ERROR`.

## Estimated error

The error e = u - u_h is measured in the energy norm, ‖e‖² = ∫ ε(e) : C : ε(e) dV: `absolute` is ‖e‖ in √J,
`relative` is ‖e‖ / √(‖u_h‖² + ‖e‖²), `per_element` has the share of each element. Stresses of elements jump
from one to the next; the estimate is the energy of their difference to smooth stresses, which are recovered or
averaged, raised by a factor of safety (1.7 and 1.8); the smaller of the two is reported. `result.error(of=…)` gives for
a quantity Q the best guess of Q(u) - Q(u_h) as `signed`, so that `value + signed` is a better value, and `absolute`, on
the safe side; it takes one more solution with the same matrix. At a point of quadratic elements trust `absolute`, not
the sign.

How safe that is, is measured: the first table shows reported over true error on two meshes of every scene with a known
solution. Most lie between 1 and 2; where a curved body has few cells or a corner is near, some lie between 0.8 and 1, and
on coarse meshes of quadratic elements some lie above 2. A star marks a warning, and `warnings` says of what:

| warning | what it means | what to do |
| --- | --- | --- |
| … may lock near ν = ½ | plain elements; the error may be several times larger | the element that is named |
| recovered stresses are farther … | few cells across a curved body; the error may be several times smaller | a finer mesh |
| … elements are too few | no neighbors to compare with | a finer mesh |
| a large share of the error lies in few elements | a re-entrant corner, the edge of a support or a point load: the stress there has no limit | judge stresses away from it |

`result.error(method="equilibrated")` seeks stresses in equilibrium with the loads, which bound the error from above, up
to the polynomials that they are sought in. It takes longer than the solution, and plain elements, loads on surfaces and
volumes, and no constraints between nodes, which finer meshes of a requested error have.

What no estimate sees: the wrong load, the wrong support, a straight-sided mesh of a curved body, yielding.

## Stresses at nodes

`result.stress("node")` fits polynomials to the stresses of the elements around a node, at the points where these are
most accurate (Zienkiewicz & Zhu 1992). Each material is fitted by itself; nodes between materials have the mean of
both. What a polynomial leaves of the elements at its node is extrapolated to it and added. `result.stress("averaged")`
is extrapolated in each element and averaged over the elements at a node, as in Kratos; `result.stress("raw")` is that
of each element. With two elements along a side, and in thin layers of tetrahedra, averaged stresses can be closer.

## A requested error

`model.solve(error=0.01)` makes linear elements quadratic first, then cuts the elements that hold most of the error;
hanging nodes, on edges and faces of larger neighbors, follow these. Estimates of successive meshes correct each other,
so that the reported error is safe at singular points, too. The result is on the last mesh; the summary, `.json` and
`report.history` have all of them. Edges along a direction in which neither cells nor stresses change, as in plane
strain, are not cut. Where the next mesh would have more than 400,000 unknowns (`most_unknowns=`) it ends with a warning,
and the command with exit code 3.

- Give supports and loads by part, by predicate, or as functions of places (`model.fix(…, field=…)`): new nodes take
  them exactly. Rows and masks of nodes grow by their faces; forces on single nodes stay there.
- Meshes with straight edges of a curved body stay as they are without `geometry={part: function}`, which puts new nodes
  on the true surface, such as `geometry={"hole": lambda X: X / np.linalg.norm(X[:, :2], axis=1)[:, None] * [1, 1, 0] +
  X * [0, 0, 1]}` for a hole of radius 1 along z; or mesh with curved cells (`gmsh -order 2`). The report warns of it.
- With `quantity=kl.StressAt((2, 0.5, 0.9), "xx")` the error is that of the quantity, relative to its value, and the
  elements that matter for it are cut. Name parts, as rows are others on finer meshes. Stresses at re-entrant corners
  have no limit: no mesh reaches an error there.

## Measured

Reported over true error on two meshes, the second of half the cell size; "exact" where the element has the exact
solution, "-" where it is refused or the scene is not made for it.

"""


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
    """Return the page about the accuracy of results."""
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
    PAGE.write_text(page(rows), encoding="utf-8")

"""Modes and steps in time beside the static solution of the same model, all in this process.

``python -m benchmarks dynamics`` solves a block on a clamped side under its weight, finds modes of it, and
lets it swing with steps of a twentieth of its longest period; it writes the page `docs/about/dynamics.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

import kratos_lite as kl
from benchmarks.driver import ROOT, load, save
from benchmarks.tables import Row, ratio, seconds, table

PAGE, RESULTS = ROOT / "docs" / "about" / "dynamics.md", ROOT / "benchmarks" / "results" / "dynamics.json"
BLOCKS = {"8N": (10, 16, 24, 32), "10N": (8, 14), "20N": (8, 14), "27N": (6, 10, 14)}
"""Cells along the short edges of the blocks of each element."""
STEPS, REPEATS = 12, 3
TEXT = """# Modes and steps beside statics

What modes and steps in time of a model cost beside its static solution: a block of 1 × 1 × 2 m on a clamped
side, `python -m benchmarks dynamics`, two cores, seconds (times the static solution), medians of {repeats}
runs in one process. Modes are found to 1e-9 of their frequencies ([how](../howto/modes.md)); a step is a
twentieth of the longest period, and the first one has the first acceleration, the matrix and the hierarchy of
multigrid in it ([how](../howto/models-in-time.md)).

"""


def block(element: str, n: int) -> kl.Model:
    """Return a block under its weight."""
    mesh = kl.box((1, 1, 2), (n, n, 2 * n), f"KinematicLinear3D{element}")
    model = kl.Model(mesh, kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0))
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    return model


def measured(work: Callable[[], Any]) -> float:
    """Return the median of the seconds that work takes."""
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return median(times)


def of(element: str, n: int) -> Row:
    """Measure one block."""
    model = block(element, n)
    row: Row = {"element": element, "n": n, "unknowns": 3 * model.mesh.n_nodes}
    model.solve()  # what is loaded and built once
    row["static"] = measured(model.solve)
    row["modes 6"] = measured(lambda: model.modes(6))
    row["modes 20"] = measured(lambda: model.modes(20))
    h = 2 * np.pi / model.modes(1)[0][0] / 20
    first, further = [], []
    for _ in range(REPEATS):
        start = perf_counter()
        states = kl.integrate(model.transient(), h, STEPS)
        next(states)
        first.append(perf_counter() - start)
        start = perf_counter()
        for _state in states:
            pass
        further.append((perf_counter() - start) / (STEPS - 1))
    return row | {"first step": median(first), "further step": median(further)}


def dynamics() -> None:
    """Measure all blocks and write the page."""
    rows = []
    for element, cells in BLOCKS.items():
        for n in cells:
            rows.append(of(element, n))
            print(rows[-1], flush=True)
    save(RESULTS, {"set": "dynamics", "rows": rows})
    PAGE.write_text(page(load(RESULTS)["rows"]), encoding="utf-8")


def page(rows: list[Row]) -> str:
    """Return the page of the rows kept."""
    names = ("modes 6", "modes 20", "first step", "further step")
    body = [
        [row["element"], str(row["unknowns"]), seconds(row["static"])]
        + [f"{seconds(row[name])} ({ratio(row[name], row['static'])})" for name in names]
        for row in rows
    ]
    head = ["element", "unknowns", "static", "6 modes", "20 modes", "first step", "further step"]
    return TEXT.format(repeats=REPEATS) + table(head, body)

"""Thousands of loads beside one of the same faces, in one process: ``python -m benchmarks loads``.

Each row is a kind of load on all faces of the top of a block, one load a face or node, and one load in all:
seconds of the processor for ``model.add``, ``model.solve`` and ``print``, and microseconds for each load.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np

import kratos_lite as kl
from benchmarks.driver import ROOT, save
from benchmarks.tables import Row

RESULTS = ROOT / "benchmarks" / "results" / "loads.json"
CELLS, REPEATS = (54, 54, 15), 3
"""47,000 nodes, 2,916 faces on the top."""
FORCE = (0.0, 0.0, -1.0)
KINDS: dict[str, tuple[Callable[[Any, Any], Any], Any]] = {
    "pressures": (lambda nodes, point: kl.Pressure(nodes, 1e5), kl.Pressure("z+", 1e5)),
    "tractions": (lambda nodes, point: kl.Traction(nodes, FORCE), kl.Traction("z+", FORCE)),
    "forces on nodes": (
        lambda nodes, point: kl.PointLoad(nodes[[0]], FORCE),
        kl.PointLoad("z+", FORCE, each=True),
    ),
    "forces on points": (
        lambda nodes, point: kl.PointLoad(point, FORCE),
        kl.PointLoad("z+", FORCE, each=True),
    ),
}
"""A load on the nodes of a face or on its first point, and one on all faces."""


def loads() -> None:
    """Measure all kinds and write the results."""
    mesh = kl.box((1.0, 1.0, 0.3), CELLS)
    faces = mesh.faces("z+")[0].nodes
    points = [tuple(map(float, mesh.points[nodes[0]])) for nodes in faces]
    rows: list[Row] = []
    for kind, (load, whole) in KINDS.items():
        many = [load(nodes, point) for nodes, point in zip(faces, points, strict=True)]
        times = np.array([[timed(mesh, some) for some in ([whole], many)] for _ in range(REPEATS)]).min(
            axis=0
        )
        extra = 1e6 * (times[1] - times[0]) / len(many)
        rows.append({"kind": kind, "loads": len(many), "one": times[0], "many": times[1], "us": extra})
        print(f"{kind}: {times[1] / times[0]:.2f} times as long, {extra:.0f} us for each of {len(many)}")
    save(RESULTS, {"set": "loads", "rows": rows})


def timed(mesh: kl.Mesh, some: list[Any]) -> float:
    """Return the seconds from an empty model to the printed result."""
    start = process_time()
    model = kl.Model(mesh, kl.Isotropic3D(E=210e9, nu=0.3))
    model.fix("z-")
    for load in some:
        model.add(load)
    str(model.solve().report) + str(model)
    return process_time() - start

"""kratos_lite, adaptive: from a coarse mesh of the scene itself to the error asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job

ROUND = {
    "sphere": ((1.0, 3), (2.0, 3)),
    "cavity": ((1.0, 3),),
    "hole": ((1.0, 2),),
    "hole_incompressible": ((1.0, 2),),
    "cylinder": ((1.0, 2), (3.0, 2)),
}
"""Radius and number of axes of the spheres and cylinders that bound a scene."""


def work(job: Job) -> Array:
    """Do the job; the true error is found on the final mesh, outside the time."""
    with job.phase("import"):
        import kratos_lite as kl
        from benchmarks import scenes
        from kratos_lite.verification import errors
    job.answer["version"] = kl.__version__
    name = job.given["scene"]
    with job.phase("read"):
        scene = scenes.make(name, job.kind, job.given["n"])
        geometry = geometry_of(name, scene.model.mesh)
    with job.phase("solve"):
        result = scene.model.solve(error=job.given["goal"], geometry=geometry)
    with job.phase("answer"):
        job.answer |= {"unknowns": result.report.unknowns, "reported": result.report.error}
        if scene.exact is not None:
            off = errors.norms(scene.exact, result.mesh.points, result.groups, result.u)
            found = dict(zip(("displacement", "energy"), off, strict=True))
        else:
            off = abs(result.energy() / scene.energy - 1)
            found = {"displacement": off, "energy": off**0.5}
        job.answer["errors"] = found
    return np.asarray(result.u)


def geometry_of(name: str, mesh: Any) -> dict[str, Callable[[Array], Array]]:
    """Add the round surfaces of a scene as parts; return what takes places onto them."""
    found = {}
    for radius, axes in ROUND.get(name, ()):
        part = f"radius {radius:g}"
        mesh.add_part(part, np.abs(np.linalg.norm(mesh.points[:, :axes], axis=1) - radius) < 1e-9)
        found[part] = onto(radius, axes)
    return found


def onto(radius: float, axes: int) -> Callable[[Array], Array]:
    """Return what takes places (k, 3) onto a sphere, or a cylinder along z."""

    def moved(X: Array) -> Array:
        r = np.linalg.norm(X[:, :axes], axis=1, keepdims=True)
        return np.column_stack([X[:, :axes] * (radius / r), X[:, axes:]])

    return moved

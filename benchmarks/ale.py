"""Matrices of a wheel in flow: M, G, H and K on a hollow cylinder, by rules that are exact.

The goal is a quarter of the time of GetFEM, which works these terms out from their formulas.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from benchmarks.programs.common import Job

Array = NDArray[np.float64]
SCENE = "wheel"
MESHES = (("8N", 8), ("8N", 16), ("20N", 8), ("27N", 8))
"""Element kind and n: n cells along the radius, 8 n around, n along the axis."""
GAUSS = {"8N": 3, "20N": 4, "27N": 4}
"""Points of the rule in each direction: those that integrate all terms exactly over affine cells."""
DENSITY, YOUNG, POISSON = 1000.0, 1e7, 0.3
NAMES = ("M", "G", "H", "M+G+H", "K")
"""What is timed, once the pattern is there where a program has one."""


def wheel(kl: Any, kind: str, n: int) -> Any:
    """Return the model of the hollow cylinder."""
    mesh = kl.annulus(0.3, 1.0, 0.2, (n, 8 * n, n), f"KinematicLinear3D{kind}")
    return kl.Model(mesh, kl.Isotropic3D(E=YOUNG, nu=POISSON, density=DENSITY))


def write(folder: Path, kind: str, n: int) -> Path:
    """Write what the other programs need as `.npz`; return the path without ending."""
    import kratos_lite as kl

    stem = folder / f"{SCENE}_{kind}_{n}"
    mesh = wheel(kl, kind, n).mesh
    (block,) = mesh.blocks
    np.savez(f"{stem}.npz", points=mesh.points, nodes=block.nodes, reference=block.shape.nodes)
    return stem


def work(job: Job, kl: Any) -> Array:
    """Time the matrices in kratos_lite; return their entries."""
    from kratos_lite.ale import Rotation
    from kratos_lite.assembly.mass_and_convection import inertia_matrices
    from kratos_lite.assembly.sparsity_pattern import Pattern
    from kratos_lite.assembly.stiffness import assemble_stiffness
    from kratos_lite.quadrature import hexahedron

    with job.phase("read"):
        model = wheel(kl, job.kind, job.given["n"])
        points, groups = model.mesh.points, model.element_groups()
    pattern = job.fastest("pattern", lambda: Pattern(len(points), [group.nodes for group in groups]))
    velocity = np.column_stack([Rotation("z").A, np.zeros(3)])

    def made(names: str) -> dict[str, Array]:
        return inertia_matrices(points, groups, pattern, names, velocity)

    rule = hexahedron(degree=2 * GAUSS[job.kind] - 1)
    fine = [replace(group, rule=rule) for group in groups]
    return timed(job, made, lambda: assemble_stiffness(points, fine, pattern).data)


def timed(
    job: Job,
    made: Callable[[str], dict[str, Any]],
    stiffness: Callable[[], Any],
    entries: Callable[[Any], Array] = np.asarray,
) -> Array:
    """Time M, G, H, all three, and K; return all their entries, each over the largest of its matrix."""
    for name in "MGH":
        job.fastest(name, partial(made, name))
    found = list(job.fastest("M+G+H", partial(made, "MGH")).values())
    found.append(job.fastest("K", stiffness))
    flat = [entries(matrix).ravel() for matrix in found]
    return np.concatenate([values / np.abs(values).max() for values in flat])

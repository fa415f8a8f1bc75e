"""Scenes on which multigrid may stall, and the linear system of a scene as a file.

Cells that are flat or long, thin plates, jumps of the stiffness, nearly incompressible materials, links
between nodes, and tetrahedra without any order: bodies under their weight, each held along one side or more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

import kratos_lite as kl
from kratos_lite.mesh.centers import raise_order
from kratos_lite.mesh.refinement import refine
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.typing import Array
from kratos_lite.verification.meshes import element, kind_of
from kratos_lite.verification.scenes import Scene

Maker = Callable[[str, int], kl.Model]
STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7620.0)
SOFT = kl.Isotropic3D(E=210e3, nu=0.3, density=7620.0)
"""A millionth as stiff."""
GRAVITY = kl.Gravity((3.0, 2.0, -9.81))
RATIOS = (0.45, 0.49, 0.499, 0.4999, 0.499999)
RIM = ("x-", "x+", "y-", "y+")


def weighty(mesh: kl.Mesh, sides: Iterable[str] = ("z-",), material: kl.Isotropic3D = STEEL) -> kl.Model:
    """Return a body under gravity in three directions, some sides of which are held."""
    model = kl.Model(mesh, material)
    for side in sides:
        model.fix(side)
    model.add(GRAVITY)
    return model


def nearly_incompressible(nu: float) -> Maker:
    """Return what makes the unit cube of n³ cells with a ratio of Poisson."""
    material = kl.Isotropic3D(E=210e9, nu=nu, density=7620.0)
    return lambda kind, n: weighty(kl.box(cells=(n, n, n), element=element(kind)), material=material)


def stretched(size: tuple[float, float, float], layers: int = 0, sides: tuple[str, ...] = ("z-",)) -> Maker:
    """Return what makes a box with the nodes of about n³ cells, `layers` of them across z if given."""

    def make(kind: str, n: int) -> kl.Model:
        m = round((n**3 / (layers + 0.7)) ** 0.5) if layers else n
        return weighty(kl.box(size, (m, m, layers or n), element(kind)), sides)

    return make


def layered(kind: str, n: int) -> kl.Model:
    """Return the unit cube in four layers, soft and stiff in turn."""
    mesh = kl.box(cells=(n, n, n), element=element(kind))
    return _mixed(mesh, (4 * _centers(mesh)[:, 2]).astype(int) % 2 == 0)


def with_inclusions(kind: str, n: int) -> kl.Model:
    """Return the soft unit cube with eight stiff balls in it."""
    mesh = kl.box(cells=(n, n, n), element=element(kind))
    return _mixed(mesh, np.linalg.norm(_centers(mesh) % 0.5 - 0.25, axis=1) > 0.18)


def _mixed(mesh: kl.Mesh, soft: np.ndarray) -> kl.Model:
    model = weighty(mesh)
    model.assign(SOFT, np.flatnonzero(soft))
    return model


def _centers(mesh: kl.Mesh) -> Array:
    return mesh.points[mesh.blocks[0].nodes].mean(axis=1)


def periodic(kind: str, n: int) -> kl.Model:
    """Return the unit cube whose sides x- and x+ move alike."""
    model = weighty(kl.box(cells=(n, n, n), element=element(kind)))
    model.periodic("x-", "x+")
    return model


def tied(kind: str, n: int) -> kl.Model:
    """Return two blocks, one on the other, whose nodes do not meet."""
    lower, upper = (
        kl.box((1, 1, 0.5), (m, m, (m + 1) // 2), element(kind), (0, 0, z))
        for m, z in ((round(0.85 * n), 0.0), (round(1.1 * n), 0.5))
    )
    model = weighty(kl.join({"lower": lower, "upper": upper}), ())
    model.fix("lower.z-")
    model.tie("lower.z+", "upper.z-")
    return model


def hanging(kind: str, n: int) -> kl.Model:
    """Return the unit cube with cells half as large in one octant, nodes of which hang."""
    mesh = kl.box((1.0, 1.0, 1.0), 3 * (max(2, round(n / 1.875 ** (1 / 3))),), element(kind))
    centers = np.concatenate([mesh.points[block.nodes].mean(axis=1) for block in mesh.blocks])
    return weighty(refine(mesh, (centers < 0.5).all(axis=1)).mesh)


def unordered(kind: str, n: int, jitter: float = 0.25) -> kl.Model:
    """Return the unit cube in tetrahedra as Delaunay makes them of points in disorder, slivers included."""
    from scipy.spatial import Delaunay

    rng, m = np.random.default_rng(1), max(2, round(n / 2 ** (1 / 3)))
    grid = np.stack(np.meshgrid(*3 * [np.arange(m + 1)], indexing="ij"), -1).reshape(-1, 3) / m
    inside = (grid > 0) & (grid < 1)
    grid = grid + inside * rng.uniform(-jitter, jitter, grid.shape) / m
    middles = np.stack(np.meshgrid(*3 * [np.arange(m) + 0.5], indexing="ij"), -1).reshape(-1, 3)
    middles += rng.uniform(-jitter, jitter, middles.shape)
    points = np.vstack([grid, middles / m])
    corners = Delaunay(points).simplices.astype(np.int64)
    edges = points[corners[:, 1:]] - points[corners[:, :1]]
    volume = np.linalg.det(edges)
    corners[volume < 0] = corners[volume < 0][:, [0, 2, 1, 3]]
    corners = corners[np.abs(volume) > 1e-9 * m**-3]  # flat ones, on a side of the cube
    points, nodes = raise_order(points, corners, kind_of(kind).shape)
    mesh = kl.Mesh(points, [kl.Block(element(kind), nodes)])
    model = weighty(mesh, ())
    model.fix(points[:, 2] < 1e-9)
    return model


def name_of(nu: float) -> str:
    """Return the name of the block of a ratio of Poisson.

    >>> name_of(0.4999)
    'block_nu_4999'
    """
    return f"block_nu_{str(nu)[2:]}"


MAKERS: dict[str, Maker] = {
    **{f"flat_{a}": stretched((1.0, 1.0, 1.0 / a)) for a in (10, 100, 1000)},
    **{f"needles_{a}": stretched((1.0, 1.0, 1.0 * a), sides=("x-",)) for a in (10, 100, 1000)},
    "needles_one_layer": stretched((1.0, 1.0, 0.5), 1),
    "plate_100": stretched((1.0, 1.0, 0.01), 1, RIM),
    "plate_1000": stretched((1.0, 1.0, 0.001), 1, RIM),
    "cantilever_plate_100": stretched((1.0, 1.0, 0.01), 1, ("x-",)),
    "cantilever_plate_100_layers": stretched((1.0, 1.0, 0.01), 3, ("x-",)),
    "cantilever_plate_1000": stretched((1.0, 1.0, 0.001), 1, ("x-",)),
    "contrast_layers": layered,
    "contrast_inclusions": with_inclusions,
    "links_periodic": periodic,
    "links_tied": tied,
    "links_hanging": hanging,
    "tetrahedra": unordered,
    **{name_of(nu): nearly_incompressible(nu) for nu in RATIOS},
}


def system(scene: Scene) -> dict[str, Array]:
    """Return the matrix of the free components of a scene in 3 × 3 blocks, its load, and its nodes."""
    model = scene.model
    constraints = model.supports.constraint_map
    system = ConstrainedSystem(model.mesh.points, model.element_groups(), constraints, solver="direct")
    reduction, K = system.constraint_map, system.K
    free = reduction.free.reshape(-1, 3)
    if not (free == 3 * (free[:, :1] // 3) + np.arange(3)).all():
        raise ValueError(f"{scene.name}: a node is constrained along some axes alone")
    load = reduction.reduce(system.gather(scene.forces()) - K @ reduction.c)
    A = reduction.reduce_matrix(K.scipy().tocsr()).tobsr((3, 3))
    A.sort_indices()
    arrays = {"data": A.data, "indices": A.indices, "indptr": A.indptr}
    return arrays | {"load": load, "points": system.points[free[:, 0] // 3]}

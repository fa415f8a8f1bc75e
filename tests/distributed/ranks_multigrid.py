"""The multigrid over ranks: symmetric, positive definite, and as quick on several ranks as on one."""

import numpy as np

import kratos_lite as kl
from kratos_lite.distributed.partition import parts_of
from kratos_lite.distributed.stiffness import SharedStiffness
from kratos_lite.distributed.subdomains import scattered

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0)


def stiffness(ranks, whole, soft=False):
    """Return the model clamped below, of which each rank has its share, and its stiffness."""
    mesh = scattered(whole, ranks, parts_of(whole, ranks))
    model = kl.Model(mesh, STEEL)
    if soft:
        half = np.concatenate([mesh.points[b.nodes].mean(axis=1)[:, 0] > 0.5 for b in mesh.blocks])
        model.assign(kl.Isotropic3D(E=2e6, nu=0.3), np.flatnonzero(half))
    free = np.repeat(mesh.points[:, 2:] > 1e-9, 3, axis=1)
    rows = np.flatnonzero(mesh.own_nodes & free.any(axis=1))
    counts = ranks.gather(len(rows))
    number = np.full(mesh.n_nodes, -1)
    number[rows] = sum(counts[: ranks.rank]) + np.arange(len(rows))
    number = mesh.subdomain.fetch(number)
    groups = model.element_groups()
    return mesh, SharedStiffness(ranks, mesh.points, groups, rows, number, free)


def conjugate_gradients(ranks, K, M, b, tolerance=1e-10):
    """Return the solution and the number of iterations."""

    def dot(p, q):
        return ranks.sum(float(p @ q))

    x, r = np.zeros_like(b), b.copy()
    z = M.precondition(r)
    p, rz, size = z, dot(r, z), dot(b, b)
    for step in range(1, 200):
        Kp = K.times(p)
        alpha = rz / dot(p, Kp)
        x, r = x + alpha * p, r - alpha * Kp
        if dot(r, r) <= tolerance**2 * size:
            return x, step
        z = M.precondition(r)
        old, rz = rz, dot(r, z)
        p = z + rz / old * p
    return x, step


def serial(whole, soft=False):
    model = kl.Model(whole, STEEL)
    if soft:
        half = np.concatenate([whole.points[b.nodes].mean(axis=1)[:, 0] > 0.5 for b in whole.blocks])
        model.assign(kl.Isotropic3D(E=2e6, nu=0.3), np.flatnonzero(half))
    model.fix("z-")
    return model


def test_iterations_and_solution(ranks, element, cells, most, soft):
    whole = kl.box(cells=cells, element=element)
    mesh, K = stiffness(ranks, whole, soft)
    M = K.multigrid()
    own = mesh.node_ids[mesh.own_nodes & (mesh.points[:, 2] > 1e-9)] - 1
    f = np.random.default_rng(1).normal(size=(whole.n_nodes, 3))
    b = f[own].ravel()
    x, steps = conjugate_gradients(ranks, K, M, b)
    assert steps <= most, (steps, M.sizes)
    u = np.zeros((whole.n_nodes, 3))
    u[own] = x.reshape(-1, 3)
    free = np.repeat(whole.points[:, 2] > 1e-9, 3)
    left = (serial(whole, soft).matrices().K @ ranks.sum(u).ravel() - f.ravel())[free]
    assert np.linalg.norm(left) <= 1e-9 * np.linalg.norm(f)


test_iterations_and_solution.cases = [
    ("KinematicLinear3D8N", (10, 10, 10), 20, False),
    ("KinematicLinear3D8N", (14, 10, 8), 20, False),
    ("EnhancedStrain3D8N", (10, 10, 10), 24, False),
    ("KinematicLinear3D4N", (8, 8, 8), 26, False),
    ("KinematicLinear3D10N", (5, 5, 5), 30, False),
    ("KinematicLinear3D20N", (6, 6, 6), 30, False),
    ("KinematicLinear3D27N", (6, 6, 6), 30, False),
    ("KinematicLinear3D6N", (8, 8, 8), 26, False),
    ("KinematicLinear3D8N", (10, 10, 10), 40, True),
]


def test_the_cycle_is_symmetric_and_positive_definite(ranks):
    whole = kl.box(cells=(6, 5, 4), element="KinematicLinear3D20N")
    _, K = stiffness(ranks, whole)
    M = K.multigrid()
    rng = np.random.default_rng(ranks.rank)
    a, b = rng.normal(size=(2, K.own))
    Ma, Mb = M.precondition(a), M.precondition(b)
    ab, ba, aa = (ranks.sum(float(p @ q)) for p, q in ((a, Mb), (b, Ma), (a, Ma)))
    assert abs(ab - ba) <= 1e-5 * (ranks.sum(float(a @ a)) * ranks.sum(float(Mb @ Mb))) ** 0.5
    assert aa > 0


def test_an_empty_rank_takes_part(ranks):
    whole = kl.box(cells=(9, 9, 9), element="KinematicLinear3D8N")
    parts = np.zeros(whole.n_elements, dtype=int)
    mesh = scattered(whole, ranks, parts)
    model = kl.Model(mesh, STEEL)
    free = np.repeat(mesh.points[:, 2:] > 1e-9, 3, axis=1)
    rows = np.flatnonzero(mesh.own_nodes & free.any(axis=1))
    number = np.full(mesh.n_nodes, -1)
    number[rows] = np.arange(len(rows))
    groups = model.element_groups()
    K = SharedStiffness(ranks, mesh.points, groups, rows, number, free)
    b = np.ones(K.own)
    x, steps = conjugate_gradients(ranks, K, K.multigrid(), b)
    assert steps <= 20
    left = K.times(x) - b
    assert ranks.sum(float(left @ left)) <= 1e-18 * ranks.sum(float(b @ b))

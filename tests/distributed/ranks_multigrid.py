"""The multigrid over ranks: symmetric, positive definite, and as quick on several ranks as on one."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed import cut
from kratos_lite.distributed.communicator import started
from kratos_lite.distributed.cut import Cut
from kratos_lite.distributed.stiffness import SharedStiffness

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0)


def clamped(element, cells, soft=False):
    model = kl.Model(kl.box(cells=cells, element=element), STEEL)
    if soft:
        mesh = model.mesh
        half = np.concatenate([mesh.points[b.nodes].mean(axis=1)[:, 0] > 0.5 for b in mesh.blocks])
        model.assign(kl.Isotropic3D(E=2e6, nu=0.3), np.flatnonzero(half))
    model.fix("z-")
    return model


def cut_of(model, size):
    nodes = np.arange(model.mesh.n_nodes)
    return Cut(model.mesh.points, model.element_groups(), model.supports.constraint_map(nodes), size)


def solve(ranks, given):
    """Return the own part of the solution for some forces, and the number of iterations."""
    part, f = given
    K = SharedStiffness(ranks, part)
    M, b = K.multigrid(), f.ravel()

    def dot(p, q):
        return ranks.sum(float(p @ q))

    x, r = np.zeros_like(b), b.copy()
    z = M.precondition(r)
    p, rz, size = z, dot(r, z), dot(b, b)
    step = 0
    while step < 200:
        step += 1
        Kp = K.times(p)
        alpha = rz / dot(p, Kp)
        x, r = x + alpha * p, r - alpha * Kp
        if dot(r, r) <= 1e-20 * size:
            break
        z = M.precondition(r)
        old, rz = rz, dot(r, z)
        p = z + rz / old * p
    return ranks.gather(x.reshape(-1, 3)), step


@pytest.mark.parametrize(
    ("element", "cells", "most", "soft"),
    [
        ("KinematicLinear3D8N", (14, 10, 8), 20, False),
        ("EnhancedStrain3D8N", (10, 10, 10), 24, False),
        ("KinematicLinear3D4N", (8, 8, 8), 26, False),
        ("KinematicLinear3D10N", (5, 5, 5), 30, False),
        ("KinematicLinear3D20N", (6, 6, 6), 30, False),
        ("KinematicLinear3D27N", (6, 6, 6), 30, False),
        ("KinematicLinear3D6N", (8, 8, 8), 26, False),
        ("KinematicLinear3D8N", (10, 10, 10), 40, True),
    ],
)
def test_iterations_and_solution(element, cells, most, soft):
    ranks, model = started(), clamped(element, cells, soft)
    whole = cut_of(model, ranks.size)
    f = np.random.default_rng(1).normal(size=model.mesh.points.shape) * whole.free
    found, steps = ranks.run(solve, each=lambda rank: (whole.part(rank), f[whole.own[rank]]))
    assert steps <= most
    u = np.zeros_like(f)
    for rows, values in zip(whole.own, found, strict=True):
        u[rows] = values
    left = (model.matrices().K @ u.ravel() - f.ravel())[whole.free.ravel()]
    assert np.linalg.norm(left) <= 1e-9 * np.linalg.norm(f)


def products(ranks, part):
    """Return b M a, a M b, a M a and the sizes of a and M b."""
    K = SharedStiffness(ranks, part)
    M, rng = K.multigrid(), np.random.default_rng(ranks.rank)
    a, b = rng.normal(size=(2, K.own))
    Ma, Mb = M.precondition(a), M.precondition(b)
    return [ranks.sum(float(p @ q)) for p, q in ((a, Mb), (b, Ma), (a, Ma), (a, a), (Mb, Mb))]


def test_the_cycle_is_symmetric_and_positive_definite():
    ranks, model = started(), clamped("KinematicLinear3D20N", (6, 5, 4))
    ab, ba, aMa, aa, bb = ranks.run(products, each=cut_of(model, ranks.size).part)
    assert abs(ab - ba) <= 1e-5 * (aa * bb) ** 0.5
    assert aMa > 0


def test_an_empty_rank_takes_part(monkeypatch):
    monkeypatch.setattr(cut, "parts_of", lambda points, groups, size: np.zeros(729, dtype=int))
    ranks, model = started(), clamped("KinematicLinear3D8N", (9, 9, 9))
    whole = cut_of(model, ranks.size)
    _, steps = ranks.run(solve, each=lambda r: (whole.part(r), np.ones((len(whole.own[r]), 3))))
    assert steps <= 20

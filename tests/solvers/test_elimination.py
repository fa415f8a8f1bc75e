"""Elimination with pivoting: rank, solutions and contradictions as linear algebra has them; large rings."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed.cut import Cut
from kratos_lite.errors import ModelError
from kratos_lite.solvers.constraints import Constraints, constraint_map
from kratos_lite.solvers.elimination import eliminate, independent, without


def equations(seed):
    """Return random constraints, dependents among one another, fixed dofs, and A u = b that they mean."""
    rng = np.random.default_rng(seed)
    n, c = rng.integers(2, 8), rng.integers(3, 20)
    fixed, u = rng.random((n, 3)) < 0.2, rng.normal(size=3 * n)
    dependents, count = rng.integers(0, 3 * n, c), rng.integers(0, 4, c)
    start = np.concatenate([[0], np.cumsum(count)])
    others = rng.integers(0, 3 * n, start[-1])
    weights = rng.choice([1, -1, 0.5, 1e-4, 30.0, rng.normal()], start[-1])
    A = np.zeros((c, 3 * n))
    np.add.at(A, (np.arange(c), dependents), 1.0)
    np.add.at(A, (np.repeat(np.arange(c), count), others), -weights)
    return (
        Constraints(dependents, start, others, weights, A @ u),
        fixed,
        np.where(fixed, u.reshape(-1, 3), 0.0),
        A,
    )


@pytest.mark.parametrize("seed", range(40))
def test_any_equations_that_agree_are_solved(seed):
    """As many dofs are left as the rank says, and what follows from them fulfills all."""
    given, fixed, values, A = equations(seed)
    found, rest = independent(given, fixed)
    made = constraint_map(fixed, values, eliminate(found, fixed, values))
    every = np.vstack([A, np.eye(fixed.size)[fixed.ravel()]])
    rank = np.linalg.matrix_rank(every, tol=1e-7)
    assert len(made.free) == fixed.size - rank
    u = made.expand(np.random.default_rng(seed).normal(size=len(made.free)))
    assert np.abs(A @ u - given.constants).max() < 1e-9 * max(np.abs(u).max(), 1.0)
    if rest is not None:
        rest.check(values.ravel(), 1.0, str, "{} {}", "")
    wrong = given.constants + np.random.default_rng(seed).normal(size=len(given))
    b = np.append(wrong, values[fixed])
    agrees = np.linalg.matrix_rank(np.column_stack([every, b]), tol=1e-7) == rank
    other = Constraints(given.dependents, given.start, given.independents, given.weights, wrong)
    rest = independent(other, fixed)[1]
    if agrees:
        assert rest is None or not rest.check(values.ravel(), 1.0, str, "{} {}", "")
    else:
        with pytest.raises(ModelError, match="contradicts itself"):
            rest.check(values.ravel(), 1.0, str, "{} {}", "")


def rows_of(constraints, size):
    """Return (A, b) of A u = b."""
    A = np.zeros((len(constraints), size + 1))
    np.add.at(A, (np.arange(len(A)), constraints.dependents), 1.0)
    np.add.at(A, (constraints.owner, constraints.independents), -constraints.weights)
    A[:, -1] = constraints.constants
    return A


@pytest.mark.parametrize("seed", range(20))
def test_equations_without_some_degrees_of_freedom_mean_the_same(seed):
    given, fixed, _, _ = equations(seed)
    gone = np.random.default_rng(seed).random(fixed.size) < 0.3
    rest, of_gone = without(given, gone, np.zeros(fixed.size, dtype=int))
    A, B, C = (rows_of(each, fixed.size) for each in (given, rest, of_gone))
    ranks = [np.linalg.matrix_rank(M, tol=1e-7) for M in (A, np.vstack([B, C]), np.vstack([A, B, C]))]
    assert ranks[0] == ranks[1] == ranks[2]
    assert gone[of_gone.dependents].all()
    assert np.abs(B[:, :-1][:, gone]).max(initial=0.0) == 0


def test_equations_of_a_node_of_no_element_that_contradict_are_refused():
    twice = Constraints.of(np.array([0, 0]), np.array([[1], [1]]), np.ones(2), np.array([0.0, 1.0]))
    gone = np.array([True, True, False])
    with pytest.raises(ModelError, match="contradict each other"):
        without(twice, gone, np.zeros(3, dtype=int))


@pytest.mark.parametrize("step", [1, 7, -1])
def test_a_ring_of_thousands_with_a_side_chain(step):
    """u[i] = u[i + step] + 1e-3 once around, where the last takes all of it back; another hangs on it."""
    n = 5000
    i = np.arange(n)
    constants = np.where(i == n - 1, -1e-3 * (n - 1), 1e-3)
    dependents, others = np.append(i * step % n, n), np.append((i + 1) * step % n, 3)
    ring = Constraints.of(dependents, others[:, None], np.append(np.ones(n), 2.0), np.append(constants, 0.0))
    fixed = np.zeros((2000, 3), dtype=bool)
    found, rest = independent(ring, fixed)
    found = eliminate(found, fixed, 0.0 * fixed)
    assert len(found) == n
    assert len(np.unique(found.independents)) == 1
    rest.check(np.zeros(6000), 1.0, str, "{} {}", "")
    u = constraint_map(fixed, 0.0 * fixed, found).expand(np.ones(6000 - n))
    assert np.abs(u[ring.dependents] - ring.weights * u[ring.independents] - ring.constants).max() < 1e-9


def test_what_is_in_order_already_is_left_as_it_is():
    apart = Constraints.of(np.array([0, 3]), np.array([[3], [5]]), np.array([2.0, 1.0]), np.zeros(2))
    twice = Constraints.of(np.array([6, 6]), np.array([[7], [8]]), np.ones(2), np.zeros(2))
    fixed = np.zeros((4, 3), dtype=bool)
    assert independent(apart, fixed)[0] is apart
    found = independent(apart + twice, fixed)[0]
    assert found.dependents[:2].tolist() == [0, 3]
    assert found.independents[:2].tolist() == [3, 5]
    assert len(found) == 4


def test_equations_rounded_to_six_digits_are_redundant():
    """Both ends of a turned pair held along the tangent: its equation for the tangent says no more."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    pair = Constraints.of(
        np.array([3, 4]), np.array([[0, 1]] * 2), np.array([[0.866025, -0.5], [0.5, 0.866025]]), np.zeros(2)
    )
    held = Constraints.of(np.array([1, 4]), np.array([[0], [3]]), np.array([0.0, s / c]), np.zeros(2))
    found = independent(pair + held, np.zeros((2, 3), dtype=bool))[0]
    assert len(found) == 3


def test_a_stated_dependent_stays_where_its_weight_is_not_small():
    fixed = np.zeros((3, 3), dtype=bool)
    for weight, expected in ((2.0, {0, 1}), (1e3, {0, 2})):
        rows = Constraints.of(
            np.array([0, 0, 1]), np.array([[1], [1], [2]]), np.array([1, 1, weight]), np.zeros(3)
        )
        assert set(independent(rows, fixed)[0].dependents) == expected


STEEL = kl.Isotropic3D(200e9, 0.3, density=7800.0)


def test_a_sector_whose_equations_and_local_supports_form_rings():
    """A twelfth of a disk under tangential forces: its sides by equations, its bore held in local axes."""
    full = kl.Model(kl.annulus(0.5, 1.0, 0.1, cells=(2, 24, 1)), STEEL)
    mesh, axes = full.mesh, kl.Cylindrical()
    angle = np.arctan2(mesh.points[:, 1], mesh.points[:, 0])[mesh.blocks[0].nodes]
    some = np.flatnonzero((angle > -1e-9).all(axis=1) & (angle < np.pi / 6 + 1e-9).all(axis=1))
    part = kl.Model(mesh.replace(blocks=[mesh.blocks[0].take(some)], conditions=[], parts={}), STEEL)
    theta, r = np.arctan2(mesh.points[:, 1], mesh.points[:, 0]), np.hypot(*mesh.points[:, :2].T)
    inside = np.isclose(r, 0.5)
    in_part = np.zeros(mesh.n_nodes, dtype=bool)
    in_part[part.mesh.blocks[0].nodes] = True
    for model, chosen in ((full, inside), (part, inside & in_part)):
        model.fix(np.flatnonzero(chosen), "rt", 1e-4, local=axes)
        model.fix(np.flatnonzero(chosen & np.isclose(mesh.points[:, 2], 0)), "z")
        model.add(kl.BodyForce(lambda X: 1e9 * np.column_stack([-X[:, 1], X[:, 0], 0 * X[:, 0]])))
    assert len(some) == 4
    low, high = (np.flatnonzero(in_part & np.isclose(theta, a)) for a in (0.0, np.pi / 6))
    key = [np.lexsort(np.stack([r[nodes], mesh.points[nodes, 2]]).round(9)) for nodes in (low, high)]
    R = np.array([[3**0.5 / 2, -0.5, 0], [0.5, 3**0.5 / 2, 0], [0, 0, 1]])
    low, high = low[key[0]], high[key[1]]
    for axis in range(3):
        others = 3 * low[:, None] + np.arange(3)
        part.constrain(3 * high + axis, others, weights=np.broadcast_to(R[axis], others.shape))
    one, other = full.solve(), part.solve()
    assert np.abs((one.u - other.u)[in_part]).max() < 1e-10 * np.abs(one.u).max()
    assert np.abs(other.u[inside & in_part]).max() > 1e-4


def moved_in_time():
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1)), STEEL)
    model.fix("x-", "xyz", lambda t: 1e-3 * t)
    return model, *(model.mesh.nodes(side).tolist() for side in ("x-", "x+"))


def test_what_moves_in_time_is_followed_through_redundant_equations():
    """Two nodes that move by one function are tied as well; a third is half of a free one."""
    model, held, end = moved_in_time()
    model.constrain((held[0], "x"), {(held[1], "x"): 1.0})
    model.constrain((held[2], "x"), {(end[0], "x"): 0.5})
    analysis = model.transient()
    for _ in kl.integrate(analysis, dt=1e-6, steps=3):
        assert abs(analysis.state().u[end[0], 0] - 2e-3 * analysis.time) < 1e-18
    model.constrain((end[1], "x"), {(held[0], "x"): 1.0})
    model.constrain((end[1], "x"), {(held[1], "x"): 2.0})
    with pytest.raises(ModelError, match="give all that moves the same function of time, or remove one"):
        model.transient()


def test_what_equations_hold_alone_is_held_in_parts_of_ranks():
    model = kl.Model(kl.box(), STEEL)
    model.fix("z-")
    model.constrain((5, "x"), {(5, "x"): 0.5}, 1e-3)
    made = model.supports.constraint_map(np.arange(8))
    assert made.c[15] == 2e-3
    assert Cut(model.mesh.points, model.element_groups(), made, 1).held[5].tolist() == [True, False, False]

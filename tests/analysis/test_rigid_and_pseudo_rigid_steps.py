"""Steps of rigid and pseudo-rigid bodies: loads, compiled against NumPy, many against one, what fails.

Their invariants, orders and errors are those of `tests/bodies`.
"""

import numpy as np
import pytest
from computing import EITHER, compiled, same_on_all_threads

from kratos_lite import native
from kratos_lite.analysis.integrators import pseudo_rigid, rigid
from kratos_lite.bodies.rotations import exp, hat
from kratos_lite.errors import SolveError

RIGID, PSEUDO = rigid.KERNEL, pseudo_rigid.KERNEL
NONE3, NONE6, NONE12 = np.zeros(3), np.zeros(6), np.zeros(12)


@pytest.fixture(params=EITHER)
def backend(request, monkeypatch):
    """Run a test with the compiled kernel and without it."""
    if request.param == "numpy":
        monkeypatch.setattr(native, "kernels", lambda name: None)
    return request.param


def rigid_bodies(n, seed=1):
    """Return q, u and (inertia, inverse, mass) of n bodies."""
    rng = np.random.default_rng(seed)
    q = np.empty((n, 12))
    q[:, :9] = exp(rng.standard_normal((n, 3))).reshape(n, 9)
    q[:, 9:] = rng.standard_normal((n, 3))
    E0 = rng.standard_normal((n, 3, 3))
    E0 = E0 @ np.swapaxes(E0, 1, 2) + np.eye(3)
    J = np.trace(E0, axis1=1, axis2=2)[:, None, None] * np.eye(3) - E0
    return q, 3 * rng.standard_normal((n, 6)), (J, np.linalg.inv(J), rng.uniform(1, 2, n))


def isotropic(young, nu=0.3):
    """Return C (6, 6)."""
    lam, mu = young * nu / (1 + nu) / (1 - 2 * nu), young / 2 / (1 + nu)
    C = np.diag([2 * mu] * 3 + [mu] * 3)
    C[:3, :3] += lam
    return C


def pseudo_bodies(n, seed=2, young=100.0):
    """Return q, u and (Euler tensor, mass, volume, C, damping) of n bodies, C being anisotropic."""
    rng = np.random.default_rng(seed)
    q = rng.standard_normal((n, 12))
    F = exp(rng.standard_normal((n, 3))) @ (np.eye(3) + 0.05 * rng.standard_normal((n, 3, 3)))
    q[:, :9] = F.reshape(n, 9)
    E0, C = rng.standard_normal((n, 3, 3)), 0.2 * rng.standard_normal((n, 6, 6))
    E0 = E0 @ np.swapaxes(E0, 1, 2) + np.eye(3)
    C = young * (C @ np.swapaxes(C, 1, 2)) + isotropic(young)
    ones = rng.uniform(1, 2, (3, n))
    return q, rng.standard_normal((n, 12)), (E0, ones[0], ones[1], C, 1e-2 * ones[2])


@pytest.mark.parametrize("integrator", ["momentum_conserving", "implicit"])
def test_spatial_momentum_is_that_of_the_impulse(backend, integrator):
    q, u, (J, inverse, mass) = rigid_bodies(20)
    torque, force, gravity = np.array([3.0, -2, 1]), np.array([1.0, 2, 3]), np.array([0, 0, -9.81])

    def momentum():
        R = np.swapaxes(q[:, :9].reshape(-1, 3, 3), 1, 2)
        return (R @ J @ u[:, :3, None])[..., 0], mass[:, None] * u[:, 3:]

    (angular, linear), spatial = momentum(), np.concatenate([torque, force])
    RIGID.steps(q, u, J, inverse, mass, gravity, spatial, NONE6, h=0.01, count=100, method=integrator)
    after = momentum()
    np.testing.assert_allclose(after[0], angular + torque, rtol=0, atol=1e-12 * np.abs(angular).max())
    np.testing.assert_allclose(after[1], linear + force + mass[:, None] * gravity, rtol=0, atol=1e-12)


def test_work_of_a_constant_force_is_force_times_way(backend):
    q, u, constant = rigid_bodies(5)
    start, work, force = q[:, 9:].copy(), np.ones(5), np.array([0, 0, 0, 1.0, -2, 3])
    RIGID.steps(
        q, u, *constant, NONE3, force, NONE6, h=0.01, count=50, method="momentum_conserving", work=work
    )
    np.testing.assert_allclose(work, 1 + (q[:, 9:] - start) @ force[3:], rtol=1e-13)
    q, u, constant = pseudo_bodies(5)
    start, work, load = q.copy(), np.ones(5), np.arange(12.0)
    PSEUDO.steps(q, u, *constant, NONE3, load, h=0.01, count=50, method="linearly_implicit", work=work)
    np.testing.assert_allclose(work, 1 + (q - start) @ load, rtol=1e-13)


def test_follower_loads_turn_with_the_body(backend):
    """A force along a body axis about which nothing turns it, and a torque about a principal axis."""
    q, u = np.zeros(12), np.zeros(6)
    q[:9] = exp([0, 0, 1.0]).T.ravel()
    J = np.diag([1.0, 2, 4])
    constant = (J, np.linalg.inv(J), np.array(2.0), NONE3, NONE6)
    follower = np.array([3.0, 0, 0, 4, 0, 0])
    RIGID.steps(q, u, *constant, follower, h=0.01, count=100, method="momentum_conserving")
    axis = np.array([np.cos(1), np.sin(1), 0])
    np.testing.assert_allclose(u, [3, 0, 0, *(2 * axis)], atol=1e-13)
    np.testing.assert_allclose(q[9:], axis, atol=1e-13)


# compiled against NumPy


def run_rigid(integrator, n=37, count=20, h=0.01):
    q, u, constant = rigid_bodies(n)
    rng, work = np.random.default_rng(5), np.zeros(n)
    loads = rng.standard_normal((n, 3)), rng.standard_normal((n, 6)), rng.standard_normal((n, 6))
    RIGID.steps(q, u, *constant, *loads, h=h, count=count, method=integrator, work=work)
    return np.column_stack([q, u, work])


def run_pseudo(integrator, n=37, count=20, h=0.01):
    q, u, constant = pseudo_bodies(n)
    rng, work = np.random.default_rng(6), np.zeros(n)
    PSEUDO.steps(
        q,
        u,
        *constant,
        NONE3 + 1,
        rng.standard_normal((n, 12)),
        h=h,
        count=count,
        method=integrator,
        work=work,
    )
    return np.column_stack([q, u, work])


RUNS = [(run_rigid, integrator) for integrator in RIGID.methods] + [
    (run_pseudo, integrator) for integrator in PSEUDO.methods
]


LARGE = {"count": 1, "h": 0.25}
"""A step in half of which some bodies turn by more than a radian."""


@compiled
@pytest.mark.parametrize(
    ("run", "integrator", "options"),
    [*((*run, {}) for run in RUNS), *((run_rigid, method, LARGE) for method in RIGID.methods)],
)
def test_compiled_steps_are_those_of_numpy(run, integrator, options, monkeypatch):
    assert (np.linalg.norm(rigid_bodies(37)[1][:, :3], axis=1) * LARGE["h"] / 2 > 1).any()
    found = run(integrator, **options)
    monkeypatch.setattr(native, "kernels", lambda name: None)
    np.testing.assert_allclose(found, run(integrator, **options), rtol=0, atol=2e-13)


@compiled
@pytest.mark.parametrize(("run", "integrator"), RUNS)
def test_steps_do_not_depend_on_the_number_of_threads(run, integrator):
    same_on_all_threads(lambda: run(integrator, n=1100, count=3))


EITHER_KIND = [(RIGID, rigid_bodies, (NONE3, NONE6, NONE6), m) for m in RIGID.methods] + [
    (PSEUDO, pseudo_bodies, (NONE3, NONE12), m) for m in PSEUDO.methods
]


@compiled
@pytest.mark.parametrize(("kernel", "bodies", "loads", "integrator"), EITHER_KIND)
def test_one_body_moves_as_in_a_crowd(kernel, bodies, loads, integrator):
    q, u, constant = bodies(1000)
    one, rate = q[437].copy(), u[437].copy()
    kernel.steps(q, u, *constant, *loads, h=0.01, count=7, method=integrator)
    kernel.steps(one, rate, *(c[437] for c in bodies(1000)[2]), *loads, h=0.01, count=7, method=integrator)
    np.testing.assert_array_equal(one, q[437])
    np.testing.assert_array_equal(rate, u[437])


@pytest.mark.parametrize(("kernel", "bodies", "_", "integrator"), EITHER_KIND)
def test_two_halves_are_a_step(backend, kernel, bodies, _, integrator):
    q, u, constant = bodies(21)
    q2, u2, load = q.copy(), u.copy(), np.arange(1.0, 7 if kernel is RIGID else 13)
    halves = [np.concatenate([NONE3, load[3:]]), np.concatenate([load[:3], NONE3])]
    loads = (NONE3, *(halves if kernel is RIGID else [load]))
    for _ in range(5):
        kernel.steps(q, u, *constant, *loads, h=0.01, count=1, method=integrator)
        half = [rigid.half_step(q2, u2, 0.01)] if kernel is RIGID else []
        kernel.finish(q2, u2, *half, np.tile(load, (21, 1)), *constant, h=0.01, method=integrator)
    np.testing.assert_array_equal(q, q2)
    np.testing.assert_array_equal(u, u2)


def test_what_bodies_share_is_given_once(backend):
    q, u, constant = rigid_bodies(9)
    first = tuple(value[0].copy() for value in constant)
    every = tuple(np.repeat(value[:1], 9, axis=0) for value in constant)
    q2, u2 = q.copy(), u.copy()
    RIGID.steps(q, u, *first, NONE3, NONE6, NONE6, h=0.01, count=3, method="momentum_conserving")
    RIGID.steps(q2, u2, *every, NONE3, NONE6, NONE6, h=0.01, count=3, method="momentum_conserving")
    np.testing.assert_array_equal(np.column_stack([q, u]), np.column_stack([q2, u2]))


def test_arrays_that_the_kernel_does_not_take_are_computed_all_the_same():
    q, u, constant = rigid_bodies(9)
    wide = np.zeros((9, 24))
    wide[:, ::2] = q
    strided, u2 = wide[:, ::2], u.copy()
    RIGID.steps(q, u, *constant, NONE3, NONE6, NONE6, h=0.01, count=3, method="momentum_conserving")
    RIGID.steps(strided, u2, *constant, NONE3, NONE6, NONE6, h=0.01, count=3, method="momentum_conserving")
    np.testing.assert_allclose(strided, q, rtol=0, atol=1e-13)


@compiled
def test_wrong_shapes_are_refused():
    q, u, (J, inverse, mass) = rigid_bodies(9)
    with pytest.raises(ValueError, match=r"u must be \(N, 6\)"):
        rigid.half_step(q, u[:5], 0.01)
    with pytest.raises(ValueError, match=r"q must be \(N, 12\)"):
        rigid.half_step(u, u, 0.01)
    with pytest.raises(ValueError, match="inertia must be"):
        RIGID.steps(
            q, u, J[:4], inverse, mass, NONE3, NONE6, NONE6, h=0.01, count=1, method="momentum_conserving"
        )


# what cannot be computed


def test_a_body_without_a_velocity_is_named(backend):
    q, u, constant = pseudo_bodies(30, young=1e8)
    u[:] = 0
    q[:, :9] = np.eye(3).ravel()
    u[17, :9] = hat([0, 300.0, 10]).ravel()
    with pytest.raises(
        SolveError, match=r"energy_momentum: step number 10 of body 17, h = 1 s, failed: Newton"
    ):
        PSEUDO.steps(q, u, *constant, NONE3, NONE12, h=1.0, count=20, method="energy_momentum")


def test_a_motion_without_bounds_is_named(backend):
    q, u, constant = pseudo_bodies(1, young=1e8)
    with pytest.raises(
        SolveError,
        match=r"explicit: step number \d+ of body 0, h = 0.1 s, failed: its velocity grew .* shorter",
    ):
        PSEUDO.steps(q, u, *constant, NONE3, NONE12, h=0.1, count=200, method="explicit")


def test_an_implicit_rotation_without_a_velocity_is_named(backend):
    q, u, constant = rigid_bodies(12)
    u[5, :3] = np.nan
    with pytest.raises(SolveError, match=r"implicit: step of body 5, h = 0.1 s, failed: Newton's method"):
        RIGID.finish(q, u, rigid.half_step(q, u, 0.1), np.zeros((12, 6)), *constant, h=0.1, method="implicit")

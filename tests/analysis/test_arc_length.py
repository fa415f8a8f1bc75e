"""Snap-through along the path of equilibrium: a truss with a closed form, and a roof of the literature."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError


def truss():
    """Return half of von Mises's truss, one brick between hinges 1 m apart and 0.2 m high, E A = 1e6 N."""
    a, h, side = 1.0, 0.2, 0.1
    length = np.hypot(a, h)
    mesh = kl.box((length, side, side), element="TotalLagrangianElement3D8N")
    at, turn = mesh.points - [0, 0, side / 2], np.array([[a, 0, h], [0, length, 0], [-h, 0, a]]) / length
    model = kl.Model(mesh.replace(points=at @ turn), kl.Isotropic3D(1e6 / side**2, 0.0))
    model.fix(np.arange(8), "y")
    left, right = np.flatnonzero(at[:, 0] == 0), np.flatnonzero(at[:, 0] > 0)
    for (first, *others), axes in ((left, "xz"), (right, "x")):
        for axis in axes:  # the middle of each end is held, the end may turn
            model.constrain((int(first), axis), {(int(node), axis): -1.0 for node in others})
    forces = np.zeros((8, 3))
    forces[right, 2] = -1000.0 / 4
    model.add(kl.NodalForces(forces), amplitude=lambda t: t)
    return model, right, lambda w: 1e6 * (h - w) * (2 * h * w - w**2) / (2 * length**3) / 1000


def test_a_truss_snaps_through():
    model, right, factor = truss()
    analysis = model.quasi_static(arc_length=True, tolerance=1e-10)
    path = np.array(
        [(-state.u[right, 2].mean(), state.time) for state in kl.integrate(analysis, dt=0.6, steps=22)]
    )
    assert np.abs(path[:, 1] - factor(path[:, 0])).max() < 1e-8
    assert path[:, 1].max() > 0.95 * factor(0.2 * (1 - 3**-0.5))  # the limit
    assert path[:, 1].min() < 0.95 * factor(0.2 * (1 + 3**-0.5))  # the other one
    assert (np.diff(path[:, 0]) > 0).all()
    assert path[-1, 0] > 0.4
    residuals = np.array(analysis.reports[-1].residuals)
    last = residuals[residuals > 1e-13][-2:]
    assert last[1] < 50 * last[0] ** 2 or last[1] < 1e-11


def test_it_goes_on_bit_by_bit():
    model, _, _ = truss()
    whole, again = (model.quasi_static(arc_length=True) for _ in range(2))
    states = list(kl.integrate(whole, dt=0.6, steps=8))
    states[4].restore(again)
    *_, last = kl.integrate(again, dt=0.6, steps=3)
    assert last.time == states[-1].time
    assert (last.u == states[-1].u).all()
    with pytest.raises(InputError, match="increment"):
        model.quasi_static().state().restore(whole)


def test_a_hinged_roof_has_the_limit_of_the_literature():
    """Sze, Liu & Lo, Finite Elem. Anal. Des. 40 (2004) 1551, h 12.7: about 2,200 N at 11 mm."""
    radius, half, theta, h = 2540.0, 254.0, 0.1, 12.7
    mesh = kl.box((theta, half, h), (4, 4, 1), "TotalLagrangianElement3D27N")
    angle, y, r = mesh.points[:, 0], mesh.points[:, 1], radius + mesh.points[:, 2] - h / 2
    places = np.stack([r * np.sin(angle), y, r * np.cos(angle)], axis=1)
    model = kl.Model(mesh.replace(points=places), kl.Isotropic3D(3102.75, 0.3))
    model.fix(np.flatnonzero(angle == 0), "x")
    model.fix(np.flatnonzero(y == 0), "y")
    model.fix(np.flatnonzero((angle == theta) & (abs(r - radius) < 1e-9)), "xyz")
    center = int(np.flatnonzero((angle == 0) & (y == 0) & (r > radius + h / 3))[0])
    model.add(kl.PointLoad(center, (0, 0, -1000.0 / 4)), amplitude=lambda t: t)
    analysis = model.quasi_static(arc_length=True, tolerance=1e-6)
    path = [(-s.u[center, 2], s.time) for s in kl.integrate(analysis, dt=0.8, steps=9)]
    limit = max(path, key=lambda point: point[1])
    assert abs(limit[1] - 2.2) < 0.05
    assert path[-1][1] < 0.9 * limit[1]


def test_what_it_cannot_scale_is_refused():
    model, _, _ = truss()
    model.add(kl.Traction("z+", (0, 0, 1.0)), amplitude=lambda t: t**2)
    with pytest.raises(InputError, match="amplitude=lambda t: t"):
        model.quasi_static(arc_length=True)
    still = kl.Model(kl.box(), kl.Isotropic3D(1e9, 0.3), formulation="total_lagrangian")
    still.fix("z-")
    with pytest.raises(InputError, match="no load grows"):
        still.quasi_static(arc_length=True)

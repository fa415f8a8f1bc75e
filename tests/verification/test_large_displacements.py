"""Rubber that is twisted, and shells that turn, as single layers of solid elements, beside the literature."""

import numpy as np

import kratos_lite as kl
from kratos_lite.verification.meshes import nearest


def last(model, steps, **options):
    """Return displacements (n, 3) under all of the load."""
    return [state.u for state in kl.integrate(model.quasi_static(**options), dt=1 / steps, steps=steps)][-1]


def test_a_twisted_cylinder_of_rubber_pushes_against_its_ends():
    """Rivlin, Phil. Trans. R. Soc. A 242 (1949) 173: M = π ψ a⁴ (C₁ + C₂), N = -π ψ² a⁴ (C₁ + 2 C₂)/2."""
    psi, length, c10, c01 = 1.0, 0.25, 0.3, 0.1
    box = kl.box((2, 2, length), (4, 4, 1), "Element3D27N", (-1, -1, 0))
    x, y, z = box.points.T
    X = np.stack([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2), z], axis=1)  # a disc of radius 1
    model = kl.Model(box.replace(points=X), kl.MooneyRivlin3D(c10, c01, 400.0))
    ends = [np.flatnonzero(z == place) for place in (0, length)]
    bottom, top = (end[np.lexsort(X[end, :2].T.round(9))] for end in ends)
    model.fix(np.concatenate(ends), "z")
    c, s = np.cos(psi * length), np.sin(psi * length)
    Q = np.array([[c, -s], [s, c]])  # one slice of a long cylinder: its top moves as its bottom, and turns
    for axis in range(2):
        weights = np.tile(Q[axis], (len(top), 1))
        constant = X[bottom, :2] @ (Q - np.eye(2))[axis]
        model.constrain(3 * top + axis, 3 * bottom[:, None] + [0, 1], constant, weights=weights)
    model.fix([nearest(model.mesh, (0, 0, 0))], "xy")
    model.fix([nearest(model.mesh, (1, 0, 0))], "y")
    result = model.solve()
    place, forces = X[top] + result.u[top], result.reactions[top]
    moment = (place[:, 0] * forces[:, 1] - place[:, 1] * forces[:, 0]).sum()
    assert abs(moment / (np.pi * psi * (c10 + c01)) - 1) < 0.002
    assert abs(forces[:, 2].sum() / (-np.pi * psi**2 / 2 * (c10 + 2 * c01)) - 1) < 0.003


def test_a_pinched_hemisphere_with_a_hole():
    """Sze, Liu & Lo, Finite Elem. Anal. Des. 40 (2004) 1551: 3.406 and 5.902 at half of P = 400.

    16 × 16 of these elements have 3.401 and 5.858, 12 × 12 3.380 and 5.826.
    """
    radius, h, n = 10.0, 0.04, 8
    box = kl.box((1, 1, 1), (n, n, 1), "Element3D20N")
    s, t, z = box.points.T
    down, around, r = np.radians(18 + 72 * s), np.pi / 2 * t, radius + h * (z - 0.5)
    points = [r * np.sin(down) * np.cos(around), r * np.sin(down) * np.sin(around), r * np.cos(down)]
    mesh = box.replace(points=np.stack(points, axis=1))
    model = kl.Model(mesh, kl.Isotropic3D(6.825e7, 0.3), formulation="total_lagrangian")
    model.use_rule(2)
    model.fix(np.flatnonzero(t == 0), "y")
    model.fix(np.flatnonzero(t == 1), "x")
    pulled, pushed = nearest(mesh, (radius, 0, 0)), nearest(mesh, (0, radius, 0))
    model.fix([pulled], "z")
    for node, force in ((pulled, (100.0, 0, 0)), (pushed, (0, -100.0, 0))):  # half of 200 N on half the body
        model.add(kl.PointLoad(node, force), amplitude=lambda t: t)
    u = last(model, 2, tolerance=1e-4)
    assert abs(u[pulled, 0] / 3.406 - 1) < 0.05
    assert abs(-u[pushed, 1] / 5.902 - 1) < 0.05


def test_an_open_cylinder_is_pulled_apart():
    """Sze, Liu & Lo (2004): 2.768 under P = 40,000, and 4.551 inwards at a quarter of the circumference.

    18 × 12 of these elements have 2.738 and 4.546.
    """
    radius, length, h = 4.953, 10.35, 0.094
    box = kl.box((1, 1, 1), (8, 4, 1), "Element3D20N")
    s, t, z = box.points.T
    angle, r = np.pi / 2 * s, radius + h * (z - 0.5)
    mesh = box.replace(points=np.stack([r * np.cos(angle), -length / 2 * t, r * np.sin(angle)], axis=1))
    model = kl.Model(mesh, kl.Isotropic3D(10.5e6, 0.3125), formulation="total_lagrangian")
    model.use_rule(2)
    for place, axis in ((s == 0, "z"), (s == 1, "x"), (t == 0, "y")):
        model.fix(np.flatnonzero(place), axis)
    pulled, side = nearest(mesh, (0, 0, radius)), nearest(mesh, (radius, 0, 0))
    model.add(kl.PointLoad(pulled, (0, 0, 10e3)), amplitude=lambda t: t)  # a quarter of P
    u = last(model, 2, tolerance=1e-4)
    assert abs(u[pulled, 2] / 2.768 - 1) < 0.05
    assert abs(-u[side, 0] / 4.551 - 1) < 0.04


def test_a_slit_annular_plate_is_lifted():
    """Sze, Liu & Lo (2004): 13.891 and 17.528 at the ends of the edge under 0.8 N/m."""
    h = 0.03
    box = kl.box((1, 1, 1), (2, 18, 1), "Element3D20N")
    s, t, z = box.points.T
    r, angle = 6 + 4 * s, 2 * np.pi * t
    mesh = box.replace(points=np.stack([r * np.cos(angle), r * np.sin(angle), h * (z - 0.5)], axis=1))
    model = kl.Model(mesh, kl.Isotropic3D(21e6, 0.0), formulation="total_lagrangian")
    model.use_rule(2)
    model.fix(np.flatnonzero(t == 1), "xyz")
    model.add(kl.Traction(np.flatnonzero(t == 0), (0, 0, 0.8 / h)), amplitude=lambda t: t)
    u = last(model, 2, tolerance=1e-4, iterations=60)
    for radial, exact in ((0, 13.891), (1, 17.528)):
        (node,) = np.flatnonzero((t == 0) & (s == radial) & (z == 0))
        assert abs(u[node, 2] / exact - 1) < 0.01

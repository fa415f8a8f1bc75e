"""Equilibrium of deformable bodies: columns and cubes in closed form, supports of every kind."""

from itertools import product

import numpy as np
import pytest

import kratos_lite as kl

RHO, NU, G = 7620.0, 0.3, 9.81
EXACT = -RHO * G * (1 + NU) * (1 - 2 * NU) / (2 * 210e6 * (1 - NU))
"""Displacement of the top of a cube of 1 m between rollers, E = 210 MPa, by its weight, ρ g / (2 Mc)."""
ALL = [f"KinematicLinear3D{n}N" for n in (4, 5, 6, 8, 10, 15, 20, 27)]
each_soft = pytest.mark.parametrize("kind", [kl.PseudoRigidBody, kl.FiniteElementBody])
ROLLERS = (("x-", 0), ("x+", 0), ("y-", 1), ("y+", 1), ("z-", 2))


def cube(cells=1, element="KinematicLinear3D8N", kind=kl.FiniteElementBody, E=210e6, **options):
    mesh = kl.box(cells=(cells,) * 3, element=element)
    return kind(mesh, kl.Isotropic3D(E=E, nu=NU, density=RHO), **options)


def confine(body, sides=ROLLERS):
    rollers = []
    for side, axis in sides:
        roller = kl.FixDirection(body.mesh.points[body.mesh.nodes(side)], np.eye(3)[axis])
        body.constrain(roller)
        rollers.append(roller)
    return rollers


# ---- the cube between rollers ----------------------------------------------------------------------


@pytest.mark.parametrize(("element", "cells"), [*product(ALL, (1, 2)), (ALL[0], 4)])
def test_a_cube_settles_under_its_weight(element, cells):
    body = cube(cells, element, formulation="corotational")
    confine(body)
    body.add(kl.Gravity((0, 0, -G)))
    kl.find_equilibrium(body)
    if element == "KinematicLinear3D4N":  # constant strains: the error falls with the size
        assert body.displacement[:, 2].min() == pytest.approx(EXACT, rel=0.4 / cells)
        return
    top = body.mesh.nodes("z+")
    np.testing.assert_allclose(body.displacement[top, 2], EXACT, rtol=1e-12)
    z = body.points[:, 2]
    assert np.abs(body.displacement[:, :2]).max() < 1e-16
    if ALL.index(element) > 1:  # all nodes of a pyramid but its apex
        np.testing.assert_allclose(body.displacement[:, 2], EXACT * z * (2 - z), atol=1e-16 - 1e-12 * EXACT)


def test_the_weight_stands_on_the_lower_rollers():
    body = cube(2, formulation="corotational")
    rollers = confine(body)
    body.add(kl.Gravity((0, 0, -G)))
    kl.find_equilibrium(body)
    assert rollers[-1].reactions.sum(axis=0)[2] == pytest.approx(RHO * G, rel=1e-12)
    side = RHO * G / 2 * NU / (1 - NU)
    np.testing.assert_allclose(
        [rollers[i].reactions.sum(axis=0)[i // 2] for i in range(4)], [side, -side] * 2
    )
    assert body.u.tolist() == np.zeros(body.dofs).tolist()
    assert body.internal_energy() == pytest.approx(
        -float(body.potential_energy() - RHO * G / 2) / 2, rel=1e-9
    )


# ---- large strains ---------------------------------------------------------------------------------


def stretch_of(p, Mc):
    """Return the stretch a of a confined column under a dead traction p: p = Mc/2 (a³ - a)."""
    roots = np.roots([Mc / 2, 0, -Mc / 2, -p])
    return max(root.real for root in roots if abs(root.imag) < 1e-12)


@pytest.mark.parametrize("element", ALL)
@pytest.mark.parametrize("share", [0.3, -0.1])
def test_a_confined_column_of_large_strain(element, share):
    body = cube(2 if ALL.index(element) < 4 else 1, element, E=1e6)
    Mc = 1e6 * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    confine(body)
    body.add(kl.Traction("z+", (0, 0, share * Mc)))
    kl.find_equilibrium(body)
    a = stretch_of(share * Mc, Mc)
    assert abs(a - 1) > 0.1
    np.testing.assert_allclose(body.displacement[:, 2], (a - 1) * body.points[:, 2], atol=1e-11)


def test_a_column_under_too_much_load_is_refused():
    """Below a stretch of 1/√3 the law of Saint Venant and Kirchhoff softens: there is no equilibrium."""
    body = cube(E=1e6)
    Mc = 1e6 * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    confine(body)
    body.add(kl.Traction("z+", (0, 0, -0.25 * Mc)))
    q = body.q.copy()
    reached = r"no equilibrium was found under more than 77% of the load"  # 1/√27 of Mc
    with pytest.raises(kl.SolveError, match=reached):
        kl.find_equilibrium(body)
    assert body.q.tolist() == q.tolist()


def test_a_body_that_turns_far_while_it_is_loaded():
    """A prescribed displacement of an edge turns the cube by 40°, without strain."""
    body = cube(kind=kl.PseudoRigidBody, E=1e6)
    angle = np.radians(40)
    body.constrain(kl.FixPoint([[0, 0, 0], [0, 0, 1.0]]))
    body.constrain(kl.PrescribedDisplacement([1.0, 0, 0], (0, 1, 0), lambda t: t * np.sin(angle)))
    body.time = 1.0
    kl.find_equilibrium(body)
    R = body.deformation
    assert body.position(np.array([1.0, 0, 0]))[1] == pytest.approx(np.sin(angle), rel=1e-9)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-7)


# ---- one dimension, several kinds ------------------------------------------------------------------


@each_soft
def test_a_bar_under_tension(kind):
    body = cube(kind=kind, E=1e9)
    confine(body, (("x-", 0), ("y-", 1), ("z-", 2)))
    body.add(kl.Traction("z+", (0, 0, 1e4)))
    kl.find_equilibrium(body)
    corner = body.position(np.ones(3)) - 1
    np.testing.assert_allclose(corner, 1e-5 * np.array([-NU, -NU, 1]), rtol=1e-4)


@each_soft
def test_redundant_supports_share_the_load(kind):
    body = cube(kind=kind, E=1e9)
    base = body.mesh.points[body.mesh.nodes("z-")]
    twice = [kl.FixPoint(base), kl.FixPoint(base)]
    for support in twice:
        body.constrain(support)
    body.add(kl.Gravity((0, 0, -G)))
    kl.find_equilibrium(body)
    parts = [support.reactions.sum(axis=0) for support in twice]
    np.testing.assert_allclose(parts[0] + parts[1], (0, 0, RHO * G), rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(parts[0], parts[1], rtol=1e-6, atol=1e-3)


@each_soft
def test_an_oblique_support_pushes_along_its_normal(kind):
    """A block on a slope, held by a stop: the slope carries cos, the stop sin of the weight."""
    body = cube(kind=kind, E=1e9)
    slope = np.radians(25)
    n, s = np.array([np.sin(slope), 0, np.cos(slope)]), np.array([np.cos(slope), 0, -np.sin(slope)])
    base = body.mesh.points[body.mesh.nodes("z-")]
    ground, stop, side = kl.FixDirection(base, n), kl.FixDirection(base, s), kl.FixDirection(base, (0, 1, 0))
    for support in (ground, stop, side):
        body.constrain(support)
    body.add(kl.Gravity((0, 0, -G)))
    kl.find_equilibrium(body)
    W = RHO * G
    np.testing.assert_allclose(ground.reactions.sum(axis=0), W * np.cos(slope) * n, rtol=1e-7, atol=1e-3)
    np.testing.assert_allclose(stop.reactions.sum(axis=0), -W * np.sin(slope) * s, rtol=1e-7, atol=1e-3)


@each_soft
def test_a_body_that_is_not_held_is_refused(kind):
    body = cube(kind=kind)
    body.add(kl.Gravity((0, 0, -G)))
    with pytest.raises(kl.SolveError, match=r"no equilibrium was found.*is the body supported"):
        kl.find_equilibrium(body)
    assert np.isfinite(body.q).all()


def test_loads_that_balance_each_other_need_no_support():
    body = cube(kind=kl.PseudoRigidBody, E=1e6)
    for face, sign in (("z+", 1), ("z-", -1)):
        body.add(kl.Traction(face, (0, 0, sign * 1e3)))
    kl.find_equilibrium(body)
    np.testing.assert_allclose(np.diag(body.deformation) - 1, 1e-3 * np.array([-NU, -NU, 1]), rtol=5e-3)


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-6])
def test_small_loads_give_small_displacements(size):
    body = cube(1, E=210e9)
    confine(body)
    body.add(kl.Gravity((0, 0, -G * size)))
    kl.find_equilibrium(body)
    assert body.displacement[:, 2].min() == pytest.approx(EXACT / 1e3 * size, rel=1e-6)


def fixed_in_velocity():
    body = cube()
    body.constrain(kl.PrescribedVelocity([0, 0, 0], (1, 0, 0), 1.0))
    return body


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (lambda: cube(kind=kl.RigidBody), "single deformable body"),
        (lambda: kl.FixedBody(kl.box()), "single deformable body"),
        (lambda: cube(formulation="modal"), "modal bodies.*take formulation='total_lagrangian' or"),
        (fixed_in_velocity, "PrescribedVelocity does not apply in statics; use PrescribedDisplacement"),
    ],
)
def test_bodies_without_equilibrium(body, words):
    with pytest.raises(kl.ModelError, match=words):
        kl.find_equilibrium(body())

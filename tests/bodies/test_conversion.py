"""The same body in the same motion as another kind."""

import numpy as np
import pytest
from motions import end

import kratos_lite as kl
from kratos_lite.bodies.rotations import exp

SPIN, FLIGHT = (0.05, 10, 0.05), (1, 2, 3)
KINDS = (kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody)
PAIRS = [(a, b) for a in KINDS for b in KINDS]


def spinning(brick, kind, steps=40):
    body = brick(kind, cells=(1, 2, 2))
    body.set_velocity(FLIGHT, SPIN)
    end(body, 1e-3, steps)
    return body


@pytest.mark.parametrize(("kind", "other"), PAIRS)
def test_place_mass_and_momenta_go_along(kind, other, brick):
    body = spinning(brick, kind)
    result = kl.convert(body, other)
    assert type(result) is other
    assert (result.time, result.step) == (body.time, body.step)
    np.testing.assert_allclose(result.mass_center(), body.mass_center(), atol=1e-13)
    np.testing.assert_allclose(result.linear_momentum(), body.linear_momentum(), rtol=1e-12)
    exact = kind is kl.RigidBody or other is kl.RigidBody or kind is kl.PseudoRigidBody
    rtol = 1e-10 if exact else 1e-3
    np.testing.assert_allclose(result.angular_momentum(), body.angular_momentum(), rtol=rtol, atol=rtol)
    X = body.mesh.points
    far = np.abs(result.position(X) - body.position(X)).max()
    assert far < (
        1e-12 if KINDS.index(kind) <= KINDS.index(other) and kind is not kl.FiniteElementBody else 0.02
    )


@pytest.mark.parametrize(
    ("kind", "between"), [(a, b) for a, b in PAIRS if KINDS.index(a) <= KINDS.index(b)][:-1]
)
def test_there_and_back_is_the_same(kind, between, brick):
    body = spinning(brick, kind)
    back = kl.convert(kl.convert(body, between), kind)
    np.testing.assert_allclose(back.q, body.q, atol=1e-12)
    np.testing.assert_allclose(back.u, body.u, atol=1e-11)


def test_a_turned_rigid_body_becomes_turned_elements(brick):
    body = brick(kl.RigidBody)
    body.rotate(exp([0.5, 1.5, -0.7]))
    body.set_velocity(FLIGHT, SPIN)
    soft = kl.convert(body, kl.FiniteElementBody, formulation="corotational", damping=1e-3)
    assert (soft.formulation.name, soft.damping) == ("corotational", 1e-3)
    X = body.mesh.points
    np.testing.assert_allclose(soft.position(X), body.position(X), atol=1e-14)
    np.testing.assert_allclose(soft.velocity(X), body.velocity(X), atol=1e-13)
    assert soft.internal_energy() < 1e-15
    assert soft.kinetic_energy() == pytest.approx(float(body.kinetic_energy()), rel=1e-12)


def test_what_elements_do_beyond_an_affine_motion_is_left_out(brick):
    """The nearest affine place with respect to mass: its rest has no moment; both momenta stay."""
    rng = np.random.default_rng(2)
    body = brick(cells=(2, 2, 2))
    body.set_configuration(0.02 * rng.uniform(-1, 1, body.q.shape))
    body.u[...] = rng.uniform(-1, 1, body.u.shape)
    whole = kl.convert(body, kl.PseudoRigidBody)
    X = body.points
    rest = body.times_mass((body.position(X) - whole.position(X)).ravel()).reshape(-1, 3)
    np.testing.assert_allclose(rest.sum(axis=0), 0, atol=1e-11)
    np.testing.assert_allclose(rest.T @ X, 0, atol=1e-11)
    np.testing.assert_allclose(whole.linear_momentum(), body.linear_momentum(), rtol=1e-11)
    np.testing.assert_allclose(whole.angular_momentum(), body.angular_momentum(), rtol=1e-11)
    assert whole.kinetic_energy() < body.kinetic_energy()


@pytest.mark.parametrize(("kind", "other"), [(a, b) for a, b in PAIRS if a is not kl.FiniteElementBody])
def test_given_mass_properties_go_along_or_are_refused(kind, other, brick):
    plain = brick(kind)
    heavy = plain.mass_properties.with_(mass=5 * float(plain.mass))
    body = kind(plain.mesh, plain.material, mass_properties=heavy)
    body.set_velocity(FLIGHT, SPIN)
    if other is kl.FiniteElementBody:
        with pytest.raises(kl.ModelError, match="the mass of a finite-element body follows from its mesh"):
            kl.convert(body, other)
        same = kind(plain.mesh, plain.material, mass_properties=plain.mass_properties)
        assert kl.convert(same, other).mass == pytest.approx(float(plain.mass))
        return
    result = kl.convert(body, other)
    assert result.mass == heavy.mass
    np.testing.assert_allclose(result.linear_momentum(), body.linear_momentum(), rtol=1e-14)
    np.testing.assert_allclose(result.angular_momentum(), body.angular_momentum(), rtol=1e-12)


@pytest.mark.parametrize(("kind", "other"), PAIRS)
def test_lumped_mass_keeps_both_momenta(kind, other, brick):
    """Nodes of an uneven mesh stand for another mass center and inertia than the shape."""
    body = brick(kind, cells=(1, 2, 2))
    mesh = kl.Mesh(body.mesh.points**2 + body.mesh.points, body.mesh.blocks)
    fine = {"lumped": True} if other is kl.FiniteElementBody else {}
    start = kind(mesh, body.material, **({"lumped": True} if kind is kl.FiniteElementBody else {}))
    start.set_velocity(FLIGHT, SPIN)
    result = kl.convert(start, other, **fine)
    np.testing.assert_allclose(result.linear_momentum(), start.linear_momentum(), rtol=1e-12)
    momentum = start.angular_momentum()
    np.testing.assert_allclose(result.angular_momentum(), momentum, atol=1e-11 * np.abs(momentum).max())


def test_settings_go_along_where_the_kind_takes_them(brick, caplog):
    plain = brick(kl.PseudoRigidBody)
    body = kl.PseudoRigidBody(plain.mesh, plain.material, damping=1e-3, integrator="linearly_implicit")
    body.external_work[...] = 7.0
    soft = kl.convert(body, kl.FiniteElementBody)
    assert (soft.damping, soft.integrator, float(soft.external_work)) == (1e-3, "linearly_implicit", 7.0)
    assert kl.convert(body, kl.FiniteElementBody, damping=0.5, integrator="explicit").damping == 0.5
    assert not caplog.records
    stiff = kl.convert(body, kl.RigidBody)
    assert (stiff.damping, stiff.integrator) == (0.0, "momentum_conserving")
    assert [record.getMessage() for record in caplog.records] == [
        "a rigid body takes no damping: 0.001 s is omitted",
        "a rigid body has no integrator linearly_implicit: it takes momentum_conserving",
    ]


def test_a_copy_has_all_settings(brick):
    plain = brick(kl.FiniteElementBody)
    options = {"formulation": "modal", "modes": 14, "lumped": True, "integrator": "explicit"}
    body = kl.FiniteElementBody(plain.mesh, plain.material, damping=1e-4, tolerance=1e-9, **options)
    copy = kl.convert(body, "finite-element")
    assert copy.settings() == body.settings()
    assert len(copy.formulation.omega) == 14
    assert kl.convert(body, "finite-element", formulation="corotational").settings()["modes"] is None


def test_loads_and_constraints_that_stay_behind_are_reported(brick, caplog):
    body = brick(kl.PseudoRigidBody)
    body.add(kl.Gravity((0, 0, -9.81)))
    body.constrain(kl.FixPoint(body.center))
    other = kl.convert(body, kl.RigidBody)
    assert not other.loads
    assert not other.constraints
    assert [record.getMessage() for record in caplog.records] == [
        "1 loads of the pseudo-rigid body do not go along; add them anew",
        "1 constraints of the pseudo-rigid body do not go along; add them anew",
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_a_word_is_a_kind_too(kind, brick):
    body = spinning(brick, kind)
    found = kl.convert(body, kind.kind)
    assert type(found) is kind
    np.testing.assert_allclose(found.u, body.u, atol=1e-11)
    assert not np.shares_memory(body.u, found.u)


def without_mesh():
    return kl.RigidBody(mass_properties=kl.MassProperties(mass=1.0, inertia=np.eye(3)))


KIND = "becomes a RigidBody, PseudoRigidBody or FiniteElementBody"


@pytest.mark.parametrize(
    ("body", "kind", "words"),
    [
        *((None, kind, KIND) for kind in (kl.FixedBody, "fixed", None)),
        (None, "rigit", "unknown kind of body 'rigit'. Did you mean rigid"),
        (without_mesh, kl.PseudoRigidBody, "only a single body with a mesh and a material"),
        *((lambda no=no: no, "rigid", "what is converted must be a Body") for no in (None, kl.box())),
    ],
)
def test_what_is_not_converted(body, kind, words, brick):
    with pytest.raises(kl.KratosLiteError, match=words):
        kl.convert(body() if body else brick(kl.RigidBody), kind)


@pytest.mark.parametrize("options", [{}, {"formulation": "modal"}])
def test_the_share_of_the_deformation_that_stays_behind_is_reported(options, caplog):
    """z = 0 … 4 m bends by a z² off the axis, beside a rotation; the affine part is the nearest one."""
    mesh = kl.box((1, 1, 4), cells=(1, 1, 4), origin=(3, 0, 1))
    body = kl.FiniteElementBody(mesh, kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    X = mesh.points
    bent = X + np.outer(0.05 * X[:, 2] ** 2, [1, 0, 0])
    body.set_configuration(bent - X)
    kl.convert(body, kl.FiniteElementBody, **options)
    body.set_configuration(bent @ exp([0.4, 1.0, -0.6]).T - X)
    other = kl.convert(body, kl.FiniteElementBody, **options)
    straight, record = caplog.records
    assert record.args[0] == pytest.approx(straight.args[0], rel=1e-6)  # a rotation is no deformation
    percent, largest = record.args[0], record.args[2]
    lost = np.linalg.norm(other.position(X) - body.position(X), axis=1)
    assert largest == pytest.approx(lost.max(), rel=1e-12)
    assert 1 < percent < 100
    assert "of the displacement that deforms the finite-element body, up to" in record.getMessage()
    caplog.clear()
    kl.convert(other, kl.PseudoRigidBody)
    assert not caplog.records

"""What bodies refuse: one clear error each, and the body stays as it was."""

import re

import numpy as np
import pytest

import kratos_lite as kl

KINDS = (kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody)
each_kind = pytest.mark.parametrize("kind", KINDS)
STEEL = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
NAN = float("nan")


def body_of(kind, **options):
    body = kind(kl.box(), STEEL, **options)
    body.set_velocity((1, 2, 3), (0.1, 0.2, 0.3))
    return body


def snapshot(body):
    return (
        *(body.q.tolist(), body.u.tolist(), body.time, body.step, np.array(body.external_work).tolist()),
        *(len(body.loads), len(body.constraints), body.integrator),
    )


def refused(body, action, words, error=kl.InputError):
    """Show that an action on a body ends with an error, and that nothing has changed."""
    before = snapshot(body)
    with pytest.raises(error, match=words):
        action(body)
    assert snapshot(body) == before


def table(*rows):
    """Return rows of an action, what its error says, and its class where it is no InputError."""
    full = [(*row, kl.InputError)[:3] for row in rows]
    return pytest.mark.parametrize(("action", "words", "error"), full, ids=[row[1] for row in full])


# ---- making bodies ---------------------------------------------------------------------------------


def box(scale, *lost):
    mesh = kl.box()
    return kl.Mesh(np.vstack([mesh.points * (1, 1, scale), *lost]), mesh.blocks)


def massless():
    return kl.Isotropic3D(E=1e6, nu=0.3, density=0.0)


VOLUME = r"(?i)jacobian|inverted|volume|same place"


@each_kind
@table(
    (lambda kind: kind(box(-1), STEEL), VOLUME, kl.KratosLiteError),
    (lambda kind: kind(box(0), STEEL), VOLUME, kl.KratosLiteError),
    (lambda kind: kind("box", STEEL), "a mesh must be a Mesh, such as"),
    (lambda kind: kind(kl.box(), "steel"), "a material must be a Material"),
    (lambda kind: kind(kl.box(), massless()), "mass of a body must be > 0|density", kl.KratosLiteError),
)
def test_what_no_body_is_made_of(kind, action, words, error):
    with pytest.raises(error, match=words):
        action(kind)


def massive(kind=kl.RigidBody, mass=1.0, inertia=(1.0, 1.0, 1.0), **options):
    """Return a body without a mesh."""
    properties = kl.MassProperties(mass=mass, inertia=np.diag(inertia), volume=1.0)
    return kind(mass_properties=properties, **options)


def elastic(**options):
    return body_of(kl.FiniteElementBody, **options)


FRAME = "frame must be one of spatial, follower"
X = (0.5, 0.5, 0.5)
IMPLICIT = "of a finite-element body are linearly_implicit, explicit"
WHOLE_MODES = "modes must be a whole number ≥ 6"
AS_MANY, ASCEND = "as many values as times", "times of a series must ascend"


@table(
    (lambda: massive(mass=-1.0), "mass of a body must be > 0 kg; got -1", kl.ModelError),
    (
        lambda: kl.FiniteElementBody(box(1, [[9.0, 9, 9]]), STEEL),
        "node 9 belongs to no el.*, so it has no mass",
        kl.ModelError,
    ),
    (kl.RigidBody, "a rigid body needs a mesh and a material, or its mass_properties"),
    (lambda: kl.PseudoRigidBody(material=STEEL), "needs a mesh, or its mass_properties"),
    (
        lambda: massive(kl.PseudoRigidBody, inertia=(5.0, 10.0, 1.0), material=STEEL),
        "triangle inequality",
        kl.ModelError,
    ),
    (lambda: elastic(formulation="corotational", integrator="ENERGY_MOMENTUM"), IMPLICIT),
    (lambda: elastic(formulation="modal", integrator="ENERGY_MOMENTUM"), IMPLICIT),
    (lambda: elastic(formulation="TLL"), "(?s)formulation of a finite-element body.*TLL"),
    (lambda: elastic(modes=9), "modes are for formulation='modal'"),
    (lambda: elastic(formulation="modal", modes=5), WHOLE_MODES),
    (lambda: elastic(formulation="modal", modes=99), r"1 … 24 modes; got 99"),
    (lambda: elastic(damping=-1.0), "a damping must be one number ≥ 0, in s"),
    *((lambda m=m: elastic(formulation="modal", modes=m), WHOLE_MODES) for m in (6.5, "many", True)),
    (lambda: elastic(formulation=3), "unknown formulation of a finite-element body 3"),
    (lambda: kl.FixedBody(None), "a mesh must be a Mesh, such as"),
    *((lambda no=no: kl.integrate(no, 1e-3, 3), "a sequence of bodies is") for no in (3, "body", None, {})),
    (lambda: kl.convert(kl.FixedBody(kl.box()), kl.RigidBody), "a fixed body has no mass", kl.ModelError),
    (lambda: elastic().position((2, 0, 0)), "outside the mesh", kl.MeshError),
    (lambda: kl.TimeSeries([0, 1], [0]), AS_MANY),
    (lambda: kl.TimeSeries([], []), AS_MANY),
    (lambda: kl.TimeSeries([0, 0], [1, 2]), ASCEND),
    (lambda: kl.TimeSeries([0, NAN], [1, 2]), "times must be finite"),
    (lambda: kl.TimeSeries([0, 1], [1, NAN]), "values must be finite"),
    (lambda: kl.Force((NAN, 5, 5), (1, 0, 0)), "a point must be finite"),
    (lambda: kl.Force("x+", (1, 0, 0)), "got 'x\\+'; a force on a part of a model is kl.Resultant"),
    (lambda: kl.Force(X, (1, NAN, 0)), "a force must be finite"),
    (lambda: kl.Force(X, (1, 0)), r"a force must have shape \(..., 3\)"),
    (lambda: kl.Force(X, (1, 0, 0), frame="body"), FRAME),
    (lambda: kl.Torque((1, 0, 0), frame="body"), FRAME),
    (lambda: kl.Torque((1, NAN, 0)), "a torque must be finite"),
    (lambda: kl.Spring(X, (1, 1, 1), -5.0), "stiffness of a spring must be one number ≥ 0"),
    (lambda: kl.Spring(X, (1, 0, 0), [1, 2]), "the stiffness of a spring must be one number"),
    (lambda: kl.Spring(X, (1, 1, 1), 5.0, damping=-1), "damping of a spring must be one number"),
    (lambda: kl.Spring(X, (1, 0, 0), 1, length=-1), "the length of a spring must be one number"),
    (lambda: kl.Spring(X, (1, 0, 0), 1, length="long"), "the length of a spring must be made of"),
    (lambda: kl.FollowerPressure("z+", NAN), "a pressure"),
    (lambda: kl.Callback(3), "a callback is a function"),
    (lambda: kl.FixPoint((0, NAN, 0)), "material points"),
    (lambda: kl.FixPoint(np.zeros((0, 3))), "a FixPoint needs one point at least"),
    (lambda: kl.FixDirection(X, (0, 0, 0)), "a direction needs three components"),
    (lambda: kl.FixDirection(X, (0, NAN, 0)), "a direction must be finite"),
    (lambda: kl.PrescribedVelocity(X, (1, 0, 0), NAN), "a velocity"),
    (lambda: kl.PrescribedDisplacement(X, (1, 0, 0), "up"), "a displacement"),
    (lambda: kl.PrescribedAcceleration(X, (1, 0, 0), [1, 2]), "an acceleration"),
    (lambda: kl.RigidLink([[0, 0, 0]], (1, 0, 0)), r"a point must have shape \(3,\)"),
)
def test_what_is_not_made(action, words, error):
    with pytest.raises(error, match=words):
        action()


@pytest.mark.parametrize(
    ("kind", "integrator"), list(zip(KINDS, ("DEF_EXP", "RIG_NEG", "DEF_IMP"), strict=True))
)
def test_an_integrator_of_another_kind(kind, integrator):
    words = f"integrators of a {kind.kind} body are {', '.join(kind.integrators)}; got '{integrator}'"
    with pytest.raises(kl.InputError, match=words):
        body_of(kind, integrator=integrator)
    refused(body_of(kind), lambda body: setattr(body, "integrator", integrator), words)


# ---- what is done to a body --------------------------------------------------------------------------


def load(make, *said):
    return lambda body: body.add(make()), *said


def constraint(make, *said):
    return lambda body: body.constrain(make()), *said


def integrated(words, **arguments):
    return lambda body: kl.integrate(body, **{"dt": 1e-3, "steps": 3, **arguments}), words


VELOCITIES = (1, 2), (1, 2, NAN), "fast", (1, 2, 1j)
POINTS = (1, 2), (NAN, 0, 0), np.zeros((2, 2, 3))
MANY = np.ones((8, 3))
SUBSTEPS = "substeps must be a whole number ≥ 1, or 'auto'"


@each_kind
@table(
    *((lambda body, v=v: body.set_velocity(v), "a velocity") for v in VELOCITIES),
    *((lambda body, v=v: body.set_velocity((1, 0, 0), v), "an angular velocity") for v in VELOCITIES),
    *((lambda body, X=X: body.position(X), "material points") for X in POINTS),
    *((lambda body, X=X: body.velocity(X), "material points") for X in POINTS),
    load(lambda: kl.Force((5, 5, 5), (1, 0, 0)), "outside the mesh", kl.MeshError),
    load(lambda: kl.Spring((9, 0, 0), (1, 1, 1), 5.0), "outside the mesh", kl.MeshError),
    load(lambda: kl.FollowerPressure("lid", 5.0), "lid", kl.KratosLiteError),
    load(lambda: kl.Pressure("lid", 5.0), "lid", kl.KratosLiteError),
    load(lambda: kl.Force(X, MANY[:2]), "a force of shape"),
    load(lambda: "weight", "a load such as Gravity or Force is needed; got str"),
    constraint(lambda: kl.FixPoint([[0, 0, 0], [5, 5, 5]]), "outside the mesh", kl.MeshError),
    constraint(lambda: kl.RigidLink((0, 0, 0), (0, 0, 0)), "a rigid link needs a length"),
    (lambda body: body.set_velocity(linear=MANY), r"a velocity of shape .* does not fit a single body"),
    (lambda body: body.rotate(np.broadcast_to(np.eye(3), (4, 3, 3))), "a rotation of shape"),
    (lambda body: body.angular_momentum((1, 2)), r"a point must have shape \(3,\)"),
    (lambda body: setattr(body, "damping", NAN), "a damping must be finite"),
    (lambda body: setattr(body, "damping", -1.0), "a damping must be one number"),
    (lambda body: setattr(body, "tolerance", NAN), "a tolerance must be finite"),
    (lambda body: setattr(body, "tolerance", -1.0), "a tolerance must be one number"),
    (lambda body: type(body)(body.mesh, body.material, integrator=""), "the integrators of a"),
    *(integrated(SUBSTEPS, substeps=value) for value in (0, "many", NAN, 2.5, None, [1], True)),
)
def test_what_every_body_refuses(kind, action, words, error):
    refused(body_of(kind), action, words, error)


@pytest.mark.parametrize(
    ("kind", "q", "words"),
    [
        (kl.RigidBody, np.r_[2 * np.eye(3).ravel(), 0, 0, 0], "rotation"),
        (kl.RigidBody, np.r_[np.diag([1.0, 1, -1]).ravel(), 0, 0, 0], "rotation"),
        (kl.RigidBody, np.zeros(11), r"shape \(12,\); got \(11,\)"),
        (kl.RigidBody, np.full(12, NAN), "a configuration must be finite"),
        (kl.PseudoRigidBody, np.r_[np.diag([1.0, 1, -1]).ravel(), 0, 0, 0], "det F > 0; got -1"),
        (kl.PseudoRigidBody, np.zeros(12), "det F > 0; got 0"),
        (kl.PseudoRigidBody, np.full(12, NAN), "a configuration must be finite"),
        (kl.FiniteElementBody, np.zeros(23), r"shape \(24,\)"),
        (kl.FiniteElementBody, np.full(24, np.inf), "a configuration must be finite"),
        (kl.FiniteElementBody, -2 * kl.box().points.ravel(), "invert element 1"),
        (kl.FiniteElementBody, "far away", "a configuration"),
    ],
)
def test_a_configuration_that_is_none(kind, q, words):
    refused(body_of(kind), lambda body: body.set_configuration(q), words)


def rigid():
    return body_of(kl.RigidBody)


def many():
    return kl.RigidBody(mass_properties=kl.MassProperties.box([[1.0, 1, 1]] * 2, [1.0, 1.0]))


def held_elsewhere():
    """Return what holds another body."""
    rigid().constrain(hold := kl.FixPoint((0, 0, 0)))
    return hold


NO_MESH = "acts on .*mesh; this body has none", kl.ModelError
PAIR = "a torque acts on rigid bodies; give a .* one a pair of forces", kl.ModelError
NO_CONSTRAINT = "a constraint such as FixPoint is needed; got {}; loads are for body.add"
ROTATIONS = 2 * np.eye(3), np.diag([1.0, 1, -1]), np.full((3, 3), NAN), np.eye(2)


@pytest.mark.parametrize(
    ("make", "row"),
    [
        *((rigid, (lambda body, R=R: body.rotate(R), "rotation")) for R in ROTATIONS),
        *(
            (rigid, (lambda body, a=a: body.add(kl.Gravity((0, 0, 1)), amplitude=a), "amplitude of a load"))
            for a in (NAN, "big", [1.0, 2.0])
        ),
        *((lambda kind=kind: body_of(kind), load(lambda: kl.Torque((1, 0, 0)), *PAIR)) for kind in KINDS[1:]),
        (massive, load(lambda: kl.Traction("z+", (1, 0, 0)), *NO_MESH)),
        (massive, load(lambda: kl.FollowerPressure("z+", 1.0), *NO_MESH)),
        (massive, load(lambda: kl.BodyForce((1, 0, 0)), *NO_MESH)),
        (massive, load(lambda: kl.Pressure("z+", 1.0, follower=True), "FollowerPressure", kl.ModelError)),
        (
            lambda: kl.FixedBody(kl.box()),
            load(lambda: kl.Gravity((0, 0, 1)), "loads do not affect a fixed body", kl.ModelError),
        ),
        (
            lambda: kl.FixedBody(kl.box()),
            constraint(lambda: kl.FixPoint((0, 0, 0)), "a fixed body needs no constraint", kl.ModelError),
        ),
        *(
            (rigid, constraint(lambda wrong=wrong: wrong, NO_CONSTRAINT.format(type(wrong).__name__)))
            for wrong in (kl.Gravity((0, 0, 1)), kl.Force((0, 0, 0), (1, 0, 0)), "hold", None)
        ),
        (
            rigid,
            load(
                lambda: kl.FixPoint((0, 0, 0)), "a FixPoint is a constraint, not a load: use body.constrain"
            ),
        ),
        (rigid, constraint(held_elsewhere, "holds another body already", kl.ModelError)),
        (many, constraint(lambda: kl.FixPoint((0, 0, 0)), "one by one", kl.ModelError)),
    ],
    ids=lambda value: value[1] if isinstance(value, tuple) else "",
)
def test_what_bodies_of_one_kind_refuse(make, row):
    refused(make(), *row)


@each_kind
@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda q, u, t: np.zeros(5), "a callback must return a generalized force of shape"),
        (lambda q, u, t: np.full_like(u, NAN), "what a callback returns at t = .* must be finite"),
        *(
            (lambda q, u, t, v=v: v, "what a callback returns at t = .* s must be")
            for v in ("much", None, NAN)
        ),
    ],
)
def test_callbacks_that_return_nonsense(kind, function, words):
    body = body_of(kind)
    body.add(kl.Callback(function))
    refused(body, lambda body: list(kl.integrate(body, 1e-4, 3)), words)


@each_kind
@pytest.mark.parametrize(
    ("E", "density", "speed"), [(210.0, 7850.0, "0.164 m/s"), (2.1e5, 7.85e-9, "5.17e\\+06 m/s")]
)
def test_units_that_may_be_wrong_are_told(kind, E, density, speed, caplog):
    body = kind(kl.box(), kl.Isotropic3D(E, 0.3, density))
    if kind is kl.RigidBody:  # has no waves
        assert not caplog.records
        return
    assert re.search(f"is {speed} in Isotropic3D.* E in Pa and the density in kg/m³", caplog.messages[0])
    assert body.warnings() == caplog.messages


@pytest.mark.parametrize(("E", "density"), [(1e3, 1000.0), (1050e9, 3510.0), (1.0, 0.0)])  # jelly, diamond
def test_sound_units_leave_no_doubt(E, density):
    from kratos_lite.model.checks import check_wave_speeds

    assert check_wave_speeds([kl.Isotropic3D(E, 0.2, density)]) == []


@pytest.mark.parametrize("kind", KINDS)
def test_constraints_that_contradict_each_other(kind):
    body = body_of(kind)
    body.set_velocity()
    body.constrain(kl.PrescribedVelocity((0, 0, 0), (1, 0, 0), 1.0))
    body.constrain(kl.PrescribedVelocity((0, 0, 0), (1, 0, 0), 2.0))
    refused(body, lambda body: list(kl.integrate(body, 1e-3, 2)), "they contradict each other", kl.SolveError)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_an_explicit_step_beyond_its_stability(kind):
    body = body_of(kind, integrator="DEF_EXP")
    critical = body.critical_step()
    refused(
        body,
        lambda body: kl.integrate(body, 1.01 * critical, 10),
        r"the explicit integrator is not stable with steps of .* s: the critical step is .*substeps='auto'",
    )
    states = list(kl.integrate(body, 5 * critical, 3, substeps="auto"))
    assert states[-1].step == 3
    assert states[-1].time == pytest.approx(15 * critical)
    assert np.isfinite(states[-1].q).all()


@pytest.mark.parametrize(
    ("kind", "integrator"),
    [(kl.RigidBody, "RIG_NEG"), (kl.PseudoRigidBody, "DEF_LIM"), (kl.FiniteElementBody, "DEF_LIM")],
)
def test_a_motion_that_blows_up_stops(kind, integrator):
    body = body_of(kind, integrator=integrator)
    body.u[...] = 1e200
    with (
        pytest.raises(kl.SolveError, match=r"no longer finite|beyond all numbers"),
        np.errstate(all="ignore"),
    ):
        list(kl.integrate(body, 1.0, 5))


def test_the_acronyms_of_solfec_name_the_same_formulations():
    for acronym, word in (("TL", "total_lagrangian"), ("BC", "corotational"), ("BC-MODAL", "modal")):
        body = kl.FiniteElementBody(kl.box(), kl.Isotropic3D(1e6, 0.3, 1.0), formulation=acronym)
        assert body.formulation.name == word

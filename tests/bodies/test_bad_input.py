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


@pytest.fixture
def refused():
    """Return a function that does something to a body, expects an error, and that nothing has changed."""

    def check(body, action, error, words):
        before = snapshot(body)
        with pytest.raises(error, match=words):
            action(body)
        assert snapshot(body) == before

    return check


# ---- making bodies ---------------------------------------------------------------------------------


def inverted():
    mesh = kl.box()
    return kl.Mesh(mesh.points * (1, 1, -1), mesh.blocks)


def flat():
    mesh = kl.box()
    return kl.Mesh(mesh.points * (1, 1, 0), mesh.blocks)


def with_lost_node():
    mesh = kl.box()
    return kl.Mesh(np.vstack([mesh.points, [[9.0, 9, 9]]]), mesh.blocks)


@each_kind
@pytest.mark.parametrize("mesh", [inverted, flat], ids=["inverted", "flat"])
def test_a_mesh_without_positive_volume(kind, mesh):
    with pytest.raises(kl.KratosLiteError, match=r"(?i)jacobian|inverted|volume|same place"):
        kind(mesh(), STEEL)


@each_kind
def test_a_mesh_that_is_none(kind):
    with pytest.raises(kl.InputError, match="a Mesh is needed"):
        kind("box", STEEL)


@each_kind
def test_a_material_that_is_none(kind):
    with pytest.raises(kl.InputError, match="a material such as Isotropic3D is needed"):
        kind(kl.box(), "steel")


@each_kind
def test_no_mass(kind):
    with pytest.raises(kl.KratosLiteError, match=r"mass of a body must be > 0|density"):
        kind(kl.box(), kl.Isotropic3D(E=1e6, nu=0.3, density=0.0))


def test_a_negative_mass():
    with pytest.raises(kl.ModelError, match="mass of a body must be > 0 kg; got -1"):
        kl.RigidBody(mass_properties=kl.MassProperties(mass=-1.0, inertia=np.eye(3)))


def test_a_node_without_mass():
    with pytest.raises(kl.ModelError, match="node 9 belongs to no element, so it has no mass"):
        kl.FiniteElementBody(with_lost_node(), STEEL)


def test_nothing_to_make_a_body_of():
    with pytest.raises(
        kl.InputError, match="a rigid body needs a mesh and a material, or its mass_properties"
    ):
        kl.RigidBody()
    with pytest.raises(kl.InputError, match="needs a mesh, or its mass_properties"):
        kl.PseudoRigidBody(material=STEEL)


def test_an_inertia_that_no_deformable_body_has():
    top = kl.MassProperties(mass=1.0, inertia=np.diag([5.0, 10.0, 1.0]), volume=1.0)
    with pytest.raises(kl.ModelError, match="triangle inequality"):
        kl.PseudoRigidBody(material=STEEL, mass_properties=top)


@pytest.mark.parametrize(
    ("kind", "integrator", "words"),
    [
        (
            kl.RigidBody,
            "DEF_EXP",
            "of a rigid body are momentum_conserving, explicit, implicit; got 'DEF_EXP'",
        ),
        (kl.PseudoRigidBody, "RIG_NEG", "integrators of a pseudo-rigid body are .*; got 'RIG_NEG'"),
        (kl.FiniteElementBody, "DEF_IMP", "integrators of a finite-element body are .*; got 'DEF_IMP'"),
    ],
)
def test_an_integrator_of_another_kind(kind, integrator, words, refused):
    with pytest.raises(kl.InputError, match=words):
        body_of(kind, integrator=integrator)
    refused(body_of(kind), lambda body: setattr(body, "integrator", integrator), kl.InputError, words)


@pytest.mark.parametrize("formulation", ["corotational", "modal"])
def test_energy_momentum_is_for_the_total_lagrangian_formulation(formulation):
    with pytest.raises(kl.InputError, match="of a finite-element body are linearly_implicit, explicit"):
        body_of(kl.FiniteElementBody, formulation=formulation, integrator="ENERGY_MOMENTUM")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"formulation": "TLL"}, "(?s)formulation of a finite-element body.*TLL"),
        ({"modes": 9}, "modes are for formulation='modal'"),
        ({"formulation": "modal", "modes": 5}, "modes must be at least 6"),
        ({"formulation": "modal", "modes": 99}, r"1 … 24 modes; got 99"),
        ({"damping": -1.0}, "a damping must be one number of seconds, ≥ 0"),
        ({"damping": NAN}, "a damping"),
        ({"damping": [0.1, 0.2]}, "a damping"),
    ],
)
def test_options_that_make_no_sense(options, words):
    with pytest.raises(kl.InputError, match=words):
        body_of(kl.FiniteElementBody, **options)


# ---- configurations and velocities -----------------------------------------------------------------


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
def test_a_configuration_that_is_none(kind, q, words, refused):
    refused(body_of(kind), lambda body: body.set_configuration(q), kl.InputError, words)


def test_a_rotation_that_is_none(refused):
    body = body_of(kl.RigidBody)
    for R in (2 * np.eye(3), np.diag([1.0, 1, -1]), np.full((3, 3), NAN), np.eye(2)):
        refused(body, lambda body, R=R: body.rotate(R), kl.InputError, "rotation")


@each_kind
@pytest.mark.parametrize("value", [(1, 2), (1, 2, NAN), "fast", (1, 2, 1j), [[1, 2, 3, 4]]])
def test_a_velocity_that_is_none(kind, value, refused):
    refused(body_of(kind), lambda body: body.set_velocity(value), kl.InputError, "a velocity")
    refused(body_of(kind), lambda body: body.set_velocity((1, 0, 0), value), kl.InputError, "velocity")


@each_kind
@pytest.mark.parametrize("X", [(1, 2), (NAN, 0, 0), np.zeros((2, 2, 3))])
def test_points_that_are_none(kind, X):
    with pytest.raises(kl.InputError, match="material points"):
        body_of(kind).position(X)
    with pytest.raises(kl.InputError, match="material points"):
        body_of(kind).velocity(X)


def test_a_point_outside_of_elements():
    with pytest.raises(kl.MeshError, match="outside the mesh"):
        body_of(kl.FiniteElementBody).position((2, 0, 0))


# ---- loads -----------------------------------------------------------------------------------------


@each_kind
@pytest.mark.parametrize(
    ("load", "error", "words"),
    [
        (lambda: kl.Force((5, 5, 5), (1, 0, 0)), kl.MeshError, "outside the mesh"),
        (lambda: kl.Force((NAN, 5, 5), (1, 0, 0)), kl.InputError, "material points"),
        (lambda: kl.Force((0, 0, 0), (1, NAN, 0)), kl.InputError, "a force must be finite"),
        (lambda: kl.Force((0, 0, 0), (1, 0)), kl.InputError, "a force must have three components"),
        (lambda: kl.Force((0, 0, 0), (1, 0, 0), frame="body"), kl.InputError, "'spatial' or 'follower'"),
        (lambda: kl.Torque((1, 0, 0), frame="body"), kl.InputError, "'spatial' or 'follower'"),
        (lambda: kl.Torque((1, NAN, 0)), kl.InputError, "a torque must be finite"),
        (
            lambda: kl.Spring((0, 0, 0), (1, 1, 1), -5.0),
            kl.InputError,
            "stiffness of a spring must be one number ≥ 0",
        ),
        (lambda: kl.Spring((0, 0, 0), (1, 1, 1), 5.0, damping=-1), kl.InputError, "damping of a spring"),
        (lambda: kl.Spring((9, 0, 0), (1, 1, 1), 5.0), kl.MeshError, "outside the mesh"),
        (lambda: kl.FollowerPressure("lid", 5.0), kl.KratosLiteError, "lid"),
        (lambda: kl.FollowerPressure("z+", NAN), kl.InputError, "a pressure"),
        (lambda: kl.Pressure("lid", 5.0), kl.KratosLiteError, "lid"),
        (lambda: kl.Gravity((0, NAN, 0)), kl.InputError, "gravity"),
        (lambda: kl.Callback(3), kl.InputError, "a callback is a function"),
        (lambda: "weight", kl.InputError, "a load such as Gravity or Force is needed; got str"),
    ],
)
def test_loads_that_are_refused(kind, load, error, words, refused):
    refused(body_of(kind), lambda body: body.add(load()), error, words)


@pytest.mark.parametrize("amplitude", [NAN, "big", [1.0, 2.0]])
def test_amplitudes_that_are_refused(amplitude, refused):
    body = body_of(kl.RigidBody)
    refused(
        body,
        lambda body: body.add(kl.Gravity((0, 0, 1)), amplitude=amplitude),
        kl.InputError,
        "amplitude of a load",
    )


@pytest.mark.parametrize("kind", KINDS[1:])
def test_a_torque_on_a_body_that_deforms(kind, refused):
    refused(
        body_of(kind),
        lambda body: body.add(kl.Torque((1, 0, 0))),
        kl.ModelError,
        "a torque acts on rigid bodies; give a .* one a pair of forces",
    )


@pytest.mark.parametrize(
    "load", [kl.Traction("z+", (1, 0, 0)), kl.FollowerPressure("z+", 1.0), kl.BodyForce((1, 0, 0))]
)
def test_a_load_on_faces_of_a_body_without_a_mesh(load, refused):
    body = kl.RigidBody(mass_properties=kl.MassProperties(mass=1.0, inertia=np.eye(3)))
    refused(body, lambda body: body.add(load), kl.ModelError, "acts on .*mesh; this body has none")


@each_kind
@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda q, u, t: np.zeros(5), "a callback must return a generalized force of shape"),
        (lambda q, u, t: np.full_like(u, NAN), "what a callback returns at t = .* must be finite"),
    ],
)
def test_callbacks_that_return_nonsense(kind, function, words, refused):
    body = body_of(kind)
    body.add(kl.Callback(function))
    refused(body, lambda body: list(kl.integrate(body, 1e-4, 3)), kl.InputError, words)


def test_nothing_pushes_or_holds_a_fixed_body(refused):
    floor = kl.FixedBody(kl.box())
    refused(
        floor, lambda body: body.add(kl.Gravity((0, 0, 1))), kl.ModelError, "loads do not affect a fixed body"
    )
    refused(
        floor,
        lambda body: body.constrain(kl.FixPoint((0, 0, 0))),
        kl.ModelError,
        "a fixed body needs no constraint",
    )


@pytest.mark.parametrize(
    ("times", "values", "words"),
    [
        ([0, 1], [0], "as many values as times"),
        ([], [], "as many values as times"),
        ([[0, 1]], [[0, 1]], "as many values as times"),
        ([0, 0], [1, 2], "times of a series must ascend"),
        ([1, 0], [1, 2], "times of a series must ascend"),
        ([0, NAN], [1, 2], "times must be finite"),
        ([0, 1], [1, NAN], "values must be finite"),
    ],
)
def test_series_that_are_none(times, values, words):
    with pytest.raises(kl.InputError, match=words):
        kl.TimeSeries(times, values)


# ---- constraints -----------------------------------------------------------------------------------


@each_kind
@pytest.mark.parametrize(
    ("constraint", "error", "words"),
    [
        (lambda: kl.FixPoint((5, 5, 5)), kl.MeshError, "outside the mesh"),
        (lambda: kl.FixPoint([[0, 0, 0], [5, 5, 5]]), kl.MeshError, "outside the mesh"),
        (lambda: kl.FixPoint((0, NAN, 0)), kl.InputError, "material points"),
        (lambda: kl.FixDirection((0, 0, 0), (0, 0, 0)), kl.InputError, "a direction needs three components"),
        (lambda: kl.FixDirection((0, 0, 0), (0, NAN, 0)), kl.InputError, "a direction must be finite"),
        (lambda: kl.PrescribedVelocity((0, 0, 0), (1, 0, 0), NAN), kl.InputError, "a velocity"),
        (lambda: kl.PrescribedDisplacement((0, 0, 0), (1, 0, 0), "up"), kl.InputError, "a displacement"),
        (lambda: kl.PrescribedAcceleration((0, 0, 0), (1, 0, 0), [1, 2]), kl.InputError, "an acceleration"),
        (lambda: kl.RigidLink((0, 0, 0), (0, 0, 0)), kl.InputError, "a rigid link needs a length"),
        (lambda: kl.RigidLink([[0, 0, 0]], (1, 0, 0)), kl.InputError, r"one point \(3,\) is needed"),
        (lambda: kl.RigidLink((9, 0, 0), (1, 0, 0)), kl.MeshError, "outside the mesh"),
    ],
)
def test_constraints_that_are_refused(kind, constraint, error, words, refused):
    refused(body_of(kind), lambda body: body.constrain(constraint()), error, words)


@pytest.mark.parametrize("load", [kl.Gravity((0, 0, 1)), kl.Force((0, 0, 0), (1, 0, 0)), "hold", None])
def test_a_load_is_no_constraint(load, refused):
    words = f"a constraint such as FixPoint is needed; got {type(load).__name__}; loads are for body.add"
    refused(body_of(kl.RigidBody), lambda body: body.constrain(load), kl.InputError, words)


def test_a_constraint_is_no_load(refused):
    words = "a FixPoint is a constraint, not a load: use body.constrain"
    refused(body_of(kl.RigidBody), lambda body: body.add(kl.FixPoint((0, 0, 0))), kl.InputError, words)


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


def test_a_constraint_holds_one_body(refused):
    one, other, hold = body_of(kl.RigidBody), body_of(kl.RigidBody), kl.FixPoint((0, 0, 0))
    one.constrain(hold)
    refused(other, lambda body: body.constrain(hold), kl.ModelError, "holds another body already")


def test_many_bodies_take_no_constraint(refused):
    many = kl.RigidBody(mass_properties=kl.MassProperties.box([[1.0, 1, 1]] * 2, [1.0, 1.0]))
    refused(many, lambda body: body.constrain(kl.FixPoint((0, 0, 0))), kl.ModelError, "one by one")


@pytest.mark.parametrize("kind", KINDS)
def test_constraints_that_contradict_each_other(kind, refused):
    body = body_of(kind)
    body.set_velocity()
    body.constrain(kl.PrescribedVelocity((0, 0, 0), (1, 0, 0), 1.0))
    body.constrain(kl.PrescribedVelocity((0, 0, 0), (1, 0, 0), 2.0))
    refused(body, lambda body: list(kl.integrate(body, 1e-3, 2)), kl.SolveError, "they contradict each other")


# ---- integrate -----------------------------------------------------------------------------------------


@each_kind
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"dt": 0.0}, "a step must be one number > 0, in s; got 0"),
        ({"dt": -1e-3}, "a step must be one number > 0, in s"),
        ({"dt": NAN}, "a step must be finite"),
        ({"dt": "short"}, "a step"),
        ({"dt": [1e-3, 1e-3]}, "a step must be one number"),
        ({"steps": 0}, "steps must be a whole number ≥ 1; got 0"),
        ({"steps": 2.5}, "steps must be a whole number ≥ 1; got 2.5"),
        ({"steps": True}, "steps must be a whole number ≥ 1"),
        ({"every": 0}, "every must be a whole number ≥ 1"),
        ({"substeps": 0}, "substeps must be a whole number ≥ 1, or 'auto'"),
        ({"substeps": "many"}, "substeps must be a whole number ≥ 1, or 'auto'"),
        ({"substeps": NAN}, "substeps must be a whole number ≥ 1, or 'auto'"),
        ({"substeps": 2.5}, "substeps must be a whole number ≥ 1, or 'auto'"),
    ],
)
def test_arguments_of_integrate_that_are_refused(kind, arguments, words, refused):
    arguments = {"dt": 1e-3, "steps": 3, **arguments}
    refused(body_of(kind), lambda body: kl.integrate(body, **arguments), kl.InputError, words)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_an_explicit_step_beyond_its_stability(kind, refused):
    body = body_of(kind, integrator="DEF_EXP")
    critical = body.critical_step()
    refused(
        body,
        lambda body: kl.integrate(body, 1.01 * critical, 10),
        kl.InputError,
        r"the explicit integrator is not stable with steps of .* s: the critical step is .*substeps='auto'",
    )
    states = list(kl.integrate(body, 5 * critical, 3, substeps="auto"))
    assert states[-1].step == 3
    assert states[-1].time == pytest.approx(15 * critical)
    assert np.isfinite(states[-1].q).all()


@pytest.mark.parametrize("value", [3, "body", None, {}, []])
def test_something_that_is_no_body(value):
    with pytest.raises(kl.KratosLiteError):
        list(kl.integrate(value, 1e-3, 3))


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

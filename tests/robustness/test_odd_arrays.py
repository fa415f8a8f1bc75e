"""Odd values in every argument for arrays: an error of the library, or a finite result and no warning."""

import inspect
import re
import warnings
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import kratos_lite as kl

ROCK = kl.Isotropic3D(E=1e9, nu=0.3, density=2000.0, alpha=1e-5)
BRICK = kl.KinematicLinear3D8N
BALL = kl.MassProperties(2.0, np.eye(3))
CUBE, WHEEL = kl.box(element=BRICK.__name__), kl.annulus(0.5, 1.0, 0.2, (1, 12, 1), BRICK.__name__)
VECTOR, POINT = (0.1, -0.2, 0.3), (0.5, 0.5, 0.75)
INPUT = re.compile(r"ArrayLike|Where|Points|Sequence\[(int|float)\]|OfPlace|Factor|At\b")
"""Annotations of what users give; others are of arrays that the library makes."""


STRAIN = np.array([1e-3, 0, 0, 2e-4, 0, 0])


def static():
    model = kl.Model(CUBE, ROCK)
    model.fix("z-")
    return model


RESULT, RESPONSE = static().solve(), static().harmonic([10.0])


def loaded(load, amplitude=None):
    model = static()
    model.add(load, amplitude=amplitude)
    return model.solve().u


def stepped(**options):
    analysis = static().transient(**options)
    return [state.values["u"] for state in kl.integrate(analysis, 1e-4, 2)]


def moved(kind, added, **options):
    body = kind(CUBE, ROCK)
    (body.constrain if isinstance(added, CONSTRAINTS) else body.add)(added, **options)
    return [state.values["q"] for state in kl.integrate(body, 1e-4, 2)]


def after(kind, name, *arguments, **options):
    body = kind(CUBE, ROCK)
    value = getattr(body, name)(*arguments, **options)
    return [v for v in (value, body.q, body.u) if v is not None]


def changed(name, *arguments, **options):
    model = static()
    getattr(model, name)(*arguments, **options)
    return model.solve().u


def tied(dependents=(0, 1), independents=(12, 13), constant=0.0, weights=1.0):
    model = kl.Model(CUBE, ROCK)
    model.constrain(dependents, independents, constant, weights=weights)
    return model.supports.constraints.weights


def remote(kind, where="z+", point=POINT, **done):
    """Return displacements under a load on a remote point, after calls of its methods."""
    model = static()
    made = getattr(model, kind)(where, point)
    model.add(made.load(**{"force": VECTOR, **done.pop("load", {})}))
    for name, argument in done.items():
        getattr(made, name)(value=argument)
    return model.solve().u


def coupled(mesh, name, *arguments, **options):
    """Return displacements of a body between its ends, with a tie."""
    model = kl.Model(mesh, ROCK)
    ends = mesh.extent[:, 2]
    model.fix(np.flatnonzero(np.isin(mesh.points[:, 2], ends)))
    getattr(model, name)(*arguments, **options)
    model.add(kl.Gravity(VECTOR))
    return model.solve().u


def repeated(where, strain=STRAIN):
    """Return displacements of a cell that is periodic along z."""
    model = kl.Model(CUBE, ROCK)
    model.fix(range(1))
    model.periodic(where, "z+", strain=strain)
    model.periodic("x-", "x+")
    model.periodic("y-", "y+")
    return model.solve().u


def swung(**options):
    model = static()
    model.add(kl.Traction("z+", VECTOR))
    return model.harmonic(**{"frequencies": [10.0], **options}).at([POINT])


def released(where):
    model = static()
    model.fix(range(8))
    model.release(where)
    return model.supports.fixed.astype(float)


def written_modes(values, shapes):
    with TemporaryDirectory() as folder:
        kl.write_modes(Path(folder) / "modes.pvd", CUBE, values, shapes)


def element(name, *arguments):
    return getattr(BRICK(BRICK.nodes), name)(*arguments)


def enhanced(name, *arguments):
    return getattr(kl.EnhancedStrain3D8N(BRICK.nodes), name)(*arguments)


PRESCRIBED = (POINT, VECTOR, 0.0)
STACK = kl.join({"lower": CUBE, "upper": kl.box(origin=(0, 0, 1))})
CENTRAL = np.flatnonzero(kl.box(cells=(1, 1, 2)).points[:, 2] == 0.5)
BOLT = kl.split(kl.box(cells=(1, 1, 2)), lambda X: X[:, 2] == 0.5)
NODES, CELLS, TOP = np.arange(4), np.arange(8)[None], CUBE.nodes("z+")
TURNED = 1e-3 * CUBE.points[:, ::-1]
U, STRESS = np.full((8, 3), 1e-3), np.full(6, 1e3)
CONSTRAINTS = (
    *(kl.FixPoint, kl.FixDirection, kl.RigidLink),
    *(kl.PrescribedDisplacement, kl.PrescribedVelocity, kl.PrescribedAcceleration),
)
KINDS = (kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody)
Case = dict[tuple[str, str], tuple]
CASES: Case = {
    ("Block", "nodes"): (lambda v: kl.Mesh(CUBE.points, [kl.Block(BRICK.__name__, v)]).used_nodes(), CELLS),
    ("Block", "ids"): (lambda v: kl.Block(BRICK.__name__, CELLS, v).ids, [7]),
    ("Block", "properties"): (lambda v: kl.Block(BRICK.__name__, CELLS, properties=v).properties, [7]),
    ("Block", "lines"): (lambda v: kl.Block(BRICK.__name__, CELLS, lines=v).ids, [7]),
    ("Part", "nodes"): (lambda v: CUBE.replace(parts={"a": kl.Part(nodes=v)}).nodes("a"), NODES),
    ("Part", "elements"): (lambda v: CUBE.replace(parts={"a": kl.Part(elements=v)}).elements("a"), [0]),
    ("Mesh", "points"): (lambda v: kl.Model(kl.Mesh(v, CUBE.blocks), ROCK).check_geometry(), CUBE.points),
    ("Mesh", "node_ids"): (lambda v: kl.Mesh(CUBE.points, node_ids=v).node_rows([3]), np.arange(8)),
    ("Mesh.nodes", "where"): (CUBE.nodes, NODES),
    ("Mesh.elements", "where"): (CUBE.elements, [0]),
    ("Mesh.faces", "where"): (CUBE.faces, NODES),
    ("Mesh.face_rows", "where"): (CUBE.face_rows, NODES),
    ("Mesh.add_part", "where"): (lambda v: CUBE.replace().add_part("a", v), NODES),
    ("Mesh.node_rows", "ids"): (CUBE.node_rows, NODES),
    ("Mesh.locate", "points"): (lambda v: CUBE.locate(v).rows, [POINT]),
    ("annulus", "cells"): (lambda v: kl.annulus(1, 2, 1, v).points, (1, 4, 1)),
    ("Structure.fix", "where"): (lambda v: changed("fix", v), NODES),
    ("Structure.release", "where"): (released, NODES),
    ("Structure.fix", "value"): (lambda v: changed("fix", "z+", "xyz", v), VECTOR),
    ("Structure.assign", "where"): (lambda v: changed("assign", ROCK, v), [0]),
    ("Structure.symmetry", "where"): (lambda v: changed("symmetry", v), TOP),
    ("Structure.rigid", "where"): (lambda v: remote("rigid", v), TOP),
    ("Structure.rigid", "point"): (lambda v: remote("rigid", "z+", v), POINT),
    ("Structure.distribute", "where"): (lambda v: remote("distribute", v), TOP),
    ("Structure.distribute", "point"): (lambda v: remote("distribute", "z+", v), POINT),
    ("RemotePoint.load", "force"): (lambda v: remote("rigid", load={"force": v}), VECTOR),
    ("RemotePoint.load", "moment"): (lambda v: remote("rigid", load={"moment": v}), VECTOR),
    ("RemotePoint.fix", "value"): (lambda v: remote("rigid", fix=v), VECTOR),
    ("RemotePoint.fix_rotation", "value"): (lambda v: remote("rigid", fix_rotation=v), VECTOR),
    ("ElasticSupport", "stiffness"): (lambda v: loaded(kl.ElasticSupport("z+", v)), (1e5, 2e5, 3e5)),
    ("Structure.add_mass", "inertia"): (
        lambda v: changed("add_mass", static().rigid("z+", POINT), 1.0, v),
        np.eye(3),
    ),
    ("Structure.tie", "a"): (lambda v: coupled(STACK, "tie", v, "upper.z-"), STACK.nodes("lower.z+")),
    ("Structure.tie", "b"): (lambda v: coupled(STACK, "tie", "lower.z+", v), STACK.nodes("upper.z-")),
    ("Structure.periodic", "a"): (repeated, CUBE.nodes("z-")),
    ("Structure.periodic", "b"): (lambda v: changed("periodic", "x-", v), CUBE.nodes("x+")),
    ("Structure.periodic", "strain"): (lambda v: repeated("z-", v), STRAIN),
    ("Structure.pretension", "a"): (
        lambda v: coupled(BOLT, "pretension", v, "cut+", force=1.0),
        BOLT.nodes("cut-"),
    ),
    ("Structure.pretension", "b"): (
        lambda v: coupled(BOLT, "pretension", "cut-", v, length=1e-3),
        BOLT.nodes("cut+"),
    ),
    ("Structure.pretension", "amplitude"): (
        lambda v: coupled(BOLT, "pretension", "cut-", "cut+", force=1.0, amplitude=v),
        2.0,
    ),
    ("split", "where"): (lambda v: kl.split(kl.box(cells=(1, 1, 2)), v).points, CENTRAL),
    ("Structure.scale_stiffness", "factors"): (lambda v: changed("scale_stiffness", v), [0.5]),
    ("Structure.scale_stiffness", "where"): (lambda v: changed("scale_stiffness", 0.5, v), [0]),
    ("Model.harmonic", "frequencies"): (lambda v: swung(frequencies=v), [10.0, 20.0]),
    ("Model.harmonic", "damping"): (lambda v: swung(damping=v), np.full(12, 0.01)),
    ("HarmonicResponse.columns", "point"): (
        lambda v: list(RESPONSE.columns(v).values()),
        POINT,
    ),
    ("Result.section", "part"): (lambda v: RESULT.section(("z", 0.5), part=v).force, [0]),
    ("FiniteJ2Plasticity3D", "curve"): (
        lambda v: np.array(kl.FiniteJ2Plasticity3D(1e9, 0.3, 1e6, curve=v).curve),
        ((0.1, 2e6), (0.2, 3e6)),
    ),
    ("Section.moment_about", "point"): (RESULT.section(("z", 0.5)).moment_about, VECTOR),
    ("converge", "meshes"): (
        lambda v: kl.converge(lambda h: static(), lambda result: 1.0, v).values,
        [3.0, 2.0, 1.0],
    ),
    ("Anisotropic3D", "stiffness"): (lambda v: kl.Anisotropic3D(v).C, ROCK.C),
    ("Anisotropic3D", "alpha"): (lambda v: kl.Anisotropic3D(ROCK.C, alpha=v).expansion, STRAIN),
    ("turned", "axes"): (lambda v: kl.Anisotropic3D(ROCK.C).turned(v).C, np.eye(3)),
    ("J2Plasticity3D", "curve"): (
        lambda v: kl.J2Plasticity3D(1e9, 0.3, 1e6, curve=v).evaluate(
            0.1 * STRAIN, kl.J2Plasticity3D(1e9, 0.3, 1e6).initial_state(), 1.0
        )[0],
        ((0.1, 2e6), (0.2, 3e6)),
    ),
    ("Cartesian", "x"): (lambda v: kl.Cartesian(v).directions(POINT), VECTOR),
    ("Cartesian", "y"): (lambda v: kl.Cartesian((0, 0, 1), v).directions(POINT), VECTOR),
    ("Structure.use_rule", "where"): (lambda v: changed("use_rule", 2, v), [0]),
    ("Structure.add_prestress", "stress"): (lambda v: changed("add_prestress", v), STRESS),
    ("Structure.add_prestress", "where"): (lambda v: changed("add_prestress", STRESS, v), [0]),
    ("Structure.set_stress_free_state", "displacement"): (
        lambda v: changed("set_stress_free_state", v),
        1e-3 * CUBE.points[:, ::-1],
    ),
    ("Structure.add", "amplitude"): (lambda v: loaded(kl.Gravity(VECTOR), v), 2.0),
    ("Mesh.area", "where"): (CUBE.area, TOP),
    ("LineLoad", "where"): (lambda v: loaded(kl.LineLoad(v, VECTOR)), NODES),
    ("LineLoad", "traction"): (lambda v: kl.LineLoad("z+", v).traction, VECTOR),
    ("Temperature", "values"): (lambda v: loaded(kl.Temperature(v)), np.arange(8.0)),
    ("Temperature", "where"): (lambda v: loaded(kl.Temperature(20.0, where=v)), [0]),
    ("NodalForces", "values"): (lambda v: loaded(kl.NodalForces(v)), U),
    ("Result.displacement", "where"): (RESULT.displacement, NODES),
    ("Result.reaction", "where"): (RESULT.reaction, NODES),
    ("reaction_resultant", "where"): (lambda v: kl.reaction_resultant(static(), RESULT, v), NODES),
    ("reaction_resultant", "center"): (lambda v: kl.reaction_resultant(static(), RESULT, "z-", v), VECTOR),
    ("DisplacementAt", "point"): (lambda v: kl.DisplacementAt(v, "z").value(RESULT), POINT),
    ("StressAt", "point"): (lambda v: kl.StressAt(v, "zz").value(RESULT), POINT),
    ("MeanDisplacement", "part"): (lambda v: kl.MeanDisplacement(v, "z").value(RESULT), TOP),
    ("ReactionOf", "part"): (lambda v: kl.ReactionOf(v, "z").value(RESULT), NODES),
    ("Structure.fix", "field"): (
        lambda v: changed("fix", "z+", "xyz", field=lambda X: v),
        VECTOR,
    ),
    ("Torque", "torque"): (lambda v: moved(kl.RigidBody, kl.Torque(v)), VECTOR),
    ("Body.add", "amplitude"): (lambda v: moved(kl.RigidBody, kl.Gravity(VECTOR), amplitude=v), 2.0),
    ("LinearMaterial.stress", "strain"): (ROCK.stress, STRESS * 1e-6),
    ("KinematicLinear", "X"): (lambda v: BRICK(v).detJ(VECTOR), BRICK.nodes),
    **{
        (f"KinematicLinear.{name}", "xi"): (lambda v, name=name: element(name, v), VECTOR)
        for name in ("B", "J", "dNdX", "detJ", "position")
    },
    ("EnhancedStrain3D8N.strain_at", "C"): (lambda v: enhanced("strain_at", VECTOR, U, v), ROCK.C),
    ("EnhancedStrain3D8N.B", "C"): (lambda v: enhanced("B", VECTOR, v), ROCK.C),
    ("BBar3D10N.kept", "C"): (lambda v: kl.BBar3D10N(kl.BBar3D10N.nodes).kept(v), ROCK.C),
    **{
        (f"KinematicLinear.{name}", "density"): (lambda v, name=name: element(name, v), 2.0)
        for name in ("mass", "scalar_mass", "lumped_mass")
    },
    ("MassProperties", "mass"): (lambda v: kl.MassProperties(v, np.eye(3)).mass, 2.0),
    ("MassProperties", "inertia"): (lambda v: kl.MassProperties(2.0, v).inertia, np.eye(3)),
    ("MassProperties", "volume"): (lambda v: kl.MassProperties(2.0, np.eye(3), volume=v).mass, 2.0),
    ("MassProperties", "center"): (lambda v: kl.MassProperties(2.0, np.eye(3), center=v).center, VECTOR),
    ("MassProperties", "euler"): (lambda v: kl.MassProperties(2.0, euler=v).inertia, np.eye(3)),
    ("Rotation", "axis"): (lambda v: kl.ale.Rotation(v, rate=1.0).direction, VECTOR),
    ("Rotation", "rate"): (lambda v: kl.ale.Rotation("z", rate=v).direction, 0.1),
    ("Rotation", "center"): (lambda v: kl.ale.Rotation("z", rate=1.0, center=v).center, VECTOR),
    ("Rotation", "acceleration"): (lambda v: kl.ale.Rotation("z", rate=1.0, acceleration=v).direction, 0.1),
    ("Rotation", "center_velocity"): (lambda v: turned(center_velocity=v), (0, 0, 0)),
    ("Rotation", "center_acceleration"): (lambda v: turned(center_acceleration=v), (0, 0, 0)),
    ("Rotation", "part"): (lambda v: turned(part=v), np.arange(12)),
    ("Translation", "direction"): (lambda v: kl.ale.Translation(v, rate=1.0).direction, VECTOR),
    ("Translation", "rate"): (lambda v: loaded(kl.ale.Translation("x", rate=v)), 0.1),
    ("Translation", "acceleration"): (lambda v: loaded(kl.ale.Translation("x", rate=0, acceleration=v)), 0.1),
    ("Translation", "part"): (lambda v: loaded(kl.ale.Translation("x", rate=0.1, part=v)), [0]),
    ("material_velocity", "displacement"): (lambda v: kl.material_velocity(flowing(), v), U),
    ("material_acceleration", "displacement"): (lambda v: kl.material_acceleration(flowing(), v), U),
    ("material_derivative", "field"): (lambda v: kl.material_derivative(flowing(), v), U),
    ("material_derivative", "partial"): (lambda v: kl.material_derivative(flowing(), U, partial=[v]), U),
    ("Constraint", "points"): (lambda v: moved(kl.PseudoRigidBody, kl.FixPoint(v)), [POINT]),
    **{
        (f"Prescribed{what}", argument): (
            lambda v, what=what, i=i: moved(
                kl.RigidBody, getattr(kl, f"Prescribed{what}")(*PRESCRIBED[:i], v, *PRESCRIBED[i + 1 :])
            ),
            PRESCRIBED[i],
        )
        for what in ("Displacement", "Velocity", "Acceleration")
        for i, argument in enumerate(("points", "direction", what.lower()))
    },
    ("Callback", "function"): (lambda v: moved(kl.RigidBody, kl.Callback(lambda *_: v)), np.zeros(6)),
    ("FollowerPressure", "where"): (
        lambda v: moved(kl.FiniteElementBody, kl.FollowerPressure(v, 1.0)),
        TOP,
    ),
    ("MassProperties.with_", "changes"): (
        lambda v: kl.MassProperties(2.0, np.eye(3)).with_(mass=v).mass,
        3.0,
    ),
    ("Model.local_system", "u"): (lambda v: static().local_system(1, v)[0], U),
    ("Result.at", "points"): (lambda v: list(RESULT.at(v).columns().values()), [POINT]),
    ("Result.along", "a"): (lambda v: RESULT.along(v, (0.9, 0.9, 0.9), n=3).linear, POINT),
    ("Result.along", "b"): (lambda v: RESULT.along((0.9, 0.9, 0.9), v, n=3).linear, POINT),
    ("write_modes", "values"): (lambda v: written_modes(v, np.ones((1, 8, 3))), [1.0]),
    ("write_modes", "shapes"): (lambda v: written_modes([1.0], v), np.ones((1, 8, 3))),
}


def each(owner, call, **samples):
    """Return a case for every argument of a call; the others are as given."""
    return {
        (owner, name): (lambda v, name=name: call(**{**samples, name: v}), sample)
        for name, sample in samples.items()
    }


def loads(kind, options=None, **samples):
    return each(kind.__name__, lambda **given: loaded(kind(**given, **(options or {}))), **samples)


def on(body, kind, *more, **samples):
    return each(kind.__name__, lambda **given: moved(body, kind(*given.values(), *more)), **samples)


def of_element(name, **samples):
    return each(f"KinematicLinear.{name}", lambda **given: element(name, *given.values()), **samples)


CASES |= {
    **loads(kl.BodyForce, force=VECTOR, where=[0]),
    **loads(kl.Gravity, acceleration=VECTOR, where=[0]),
    **loads(kl.Resultant, where=TOP, force=VECTOR, moment=VECTOR, about=POINT),
    **loads(kl.Traction, where=TOP, traction=VECTOR),
    **loads(kl.Pressure, where=TOP, pressure=1.0),
    **loads(kl.PointLoad, {"each": True}, where=NODES, force=VECTOR),
    **each(
        "TimeSeries", lambda **v: [kl.TimeSeries(**v)(t) for t in (0.5, 2)], times=[0, 1.0], values=[0, 1]
    ),
    **each("TransientAnalysis", stepped, displacement=0 * U, velocity=0 * U),
    **each(
        "Structure.constrain", tied, dependents=[0, 1], independents=[12, 13], constant=[0, 0.1], weights=0.5
    ),
    **each("box", lambda **v: kl.box(**v).points, size=POINT, cells=(1, 2, 1), origin=VECTOR),
    **on(kl.RigidBody, kl.Force, point=POINT, force=VECTOR),
    **on(kl.RigidBody, kl.FixDirection, points=POINT, direction=VECTOR),
    **on(kl.RigidBody, kl.RigidLink, point=POINT, anchor=VECTOR),
    **on(kl.PseudoRigidBody, kl.Spring, 1e3, point=(0.5, 0.5, 0.5), anchor=VECTOR),
    **of_element("strain_at", xi=VECTOR, u=U),
    **of_element("local_system", C=ROCK.C, u=U),
    **of_element("stress", C=ROCK.C, u=U),
    **of_element("strain", u=U),
    **of_element("stiffness", C=ROCK.C),
    **of_element("stiffness_by_axis", C=ROCK.C),
    **of_element("body_force", b=VECTOR),
    **of_element("internal_force", stress=np.ones((8, 6))),
}
for made, owner in ((lambda **v: kl.Mesh(CUBE.points, **v), "Mesh"), (CUBE.replace, "Mesh.replace")):
    for name in ("blocks", "conditions"):
        CASES[owner, name] = (lambda v, m=made, n=name: m(**{n: {BRICK.__name__: v}}).boundary, CELLS)
for law in (kl.J2Softening3D, kl.TrescaSoftening3D, kl.CoulombSoftening3D, kl.ConeSoftening3D):
    for name, sample in (("strains", [1e-3, 2e-3]), ("stresses", [1e6, 5e5])):
        given = {"friction": 30.0, "curve": 4, "strains": [1e-3, 2e-3], "stresses": [1e6, 5e5]}
        CASES[law.__name__, name] = (
            lambda v, law=law, name=name, given=given: getattr(
                law(1e9, 0.3, 1e6, 1e3, **{**given, name: v}), name
            ),
            sample,
        )
for axes in (kl.Cylindrical, kl.Spherical):
    for name in ("center", "axis"):
        CASES[axes.__name__, name] = (lambda v, a=axes, n=name: a(**{n: v}).directions(POINT), VECTOR)
for axes in (kl.Cartesian(VECTOR), kl.Cylindrical(), kl.Spherical()):
    own = type(axes).__name__
    CASES[f"{own}.directions", "points"] = (axes.directions, [POINT])
    for call, values in ((axes.vectors, [VECTOR]), (axes.globally, [VECTOR]), (axes.stresses, [STRESS])):
        CASES[f"{own}.{call.__name__}", "values"] = (lambda v, f=call: f(v, [POINT]), values)
        CASES[f"{own}.{call.__name__}", "points"] = (lambda v, f=call, s=values: f(s, v), [POINT])
CASES["Mesh.replace", "points"] = (lambda v: CUBE.replace(points=v).points, CUBE.points)
for kind in KINDS:
    own = kind.__name__
    CASES |= {
        (f"{own}.set_velocity", "linear"): (lambda v, k=kind: after(k, "set_velocity", v), VECTOR),
        (f"{own}.set_velocity", "angular"): (lambda v, k=kind: after(k, "set_velocity", angular=v), VECTOR),
        (f"{own}.position", "X"): (lambda v, k=kind: after(k, "position", v), POINT),
        (f"{own}.velocity", "X"): (lambda v, k=kind: after(k, "velocity", v), POINT),
        (f"{own}.rotate", "rotation"): (lambda v, k=kind: after(k, "rotate", v), np.eye(3)),
        (f"{own}.angular_momentum", "about"): (lambda v, k=kind: after(k, "angular_momentum", v), VECTOR),
        (f"{own}.set_configuration", "q"): (
            lambda v, k=kind: after(k, "set_configuration", v),
            kind(CUBE, ROCK).q,
        ),
    }


def flowing():
    model = static()
    model.add(kl.ale.Translation("x", rate=1.0))
    return model


def turned(**options):
    model = kl.Model(WHEEL, ROCK)
    model.fix("inner")
    model.add(kl.ale.Rotation("z", rate=1.0, **options))
    return model.solve().u


def odd(sample):
    """Yield names and odd values, among them the right one in odd clothes."""
    right = np.asarray(sample)
    yield "right", sample
    yield from {
        "none": None, "text": "abc", "number as text": "1.5", "dict": {1: 2}, "object": object(),
        "nothing": [], "ragged": [[1, 2], [3]], "zero-dimensional float": np.array(1.5),
        "huge integer": 2**70, "list of None": [None, 1], "true": True,
        "mask of another length": np.ones(5, bool), "minus one": [-1], "four axes": np.zeros((1, 1, 1, 1)),
        "fractions": [Fraction(1, 2)] * 3, "huge": 1e308, "no columns": np.zeros((3, 0)),
        "dates": np.array(["2020-01-01"] * 3, "M8[D]"), "durations": np.array([1, 2, 3], "m8[s]"),
        "structured": np.zeros(3, [("x", float)]), "unsigned": np.uint64(2**63),
    }.items()  # fmt: skip
    yield "imaginary", right + 1j
    for kind in (np.float32, np.longdouble, object, str, np.int8, bool):
        with np.errstate(all="ignore"):
            yield np.dtype(kind).name, right.astype(kind)
    yield "long double beyond double", np.full(right.shape, np.longdouble("1e4000"))
    for size in (-1e308, 1e200, 1e49, 1e-308, np.inf, np.nan):
        yield f"all {size:g}", np.full(right.shape, size)
    yield "list", right.tolist()
    yield "one more", np.stack([right, right])
    if right.ndim:
        yield "backwards", right[::-1]
        yield "by columns", np.asfortranarray(right)
        yield "one longer", np.concatenate([right, right[:1]])
        yield "one shorter", right[:-1]
        yield "flat", right.ravel()
        yield "masked", np.ma.masked_array(right, np.zeros(right.shape, bool))


def is_absurd(value):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return not (np.abs(np.asarray(value, float)) < 1e10).all()
    except (TypeError, ValueError, OverflowError):
        return False


def numbers_of(value):
    """Yield the arrays of numbers in a result."""
    if isinstance(value, (list, tuple)):
        for one in value:
            yield from numbers_of(one)
    elif value is not None and np.asarray(value).dtype.kind in "fciub":
        yield np.asarray(value)


@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_odd_values_are_refused_in_words_or_give_finite_results(case):
    call, sample = CASES[case]
    found = []
    for name, value in odd(sample):
        if case[0].startswith("KinematicLinear") and is_absurd(value):
            continue  # elements pass on what is not finite, as states that diverge may be
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                result = call(value)
                if not all(np.isfinite(array).all() for array in numbers_of(result)):
                    found.append(f"{name}: not finite: {result!r:.200}")
            except kl.KratosLiteError as error:
                if name == "right" and "acts on lines" not in str(error):
                    found.append(f"{name}: {error}")
            except Exception as error:
                found.append(f"{name}: {type(error).__name__}: {error!s:.200}")
    assert not found, "\n".join(found)


def inputs():
    """Yield (owner, parameter) of what users give to public constructors and methods."""
    for module in (kl, kl.ale):
        for name in module.__all__:
            thing = getattr(module, name)
            members = [(name, thing)] if inspect.isfunction(thing) else []
            if inspect.isclass(thing) and not issubclass(thing, Exception):
                members = [(thing.__init__.__qualname__.split(".")[0], thing.__init__)]
                members += [(f.__qualname__, f) for _, f in inspect.getmembers(thing, inspect.isfunction)]
            for owner, function in members:
                if "._" in owner or not getattr(function, "__module__", "").startswith("kratos_lite"):
                    continue
                for parameter in inspect.signature(function).parameters.values():
                    if INPUT.search(str(parameter.annotation)):
                        yield owner, parameter.name


def test_every_argument_that_takes_arrays_is_tried():
    tried = {(owner.split(".")[-1], name) for owner, name in CASES}
    missing = {(owner.split(".")[-1], name) for owner, name in inputs()} - tried - ELSEWHERE
    assert not missing, sorted(missing)


ELSEWHERE = {
    *((owner, name) for owner in ("Motion", "AlongDirection") for name in ("direction", "points")),
    *(("Motion", name) for name in ("rate", "acceleration", "part")),
    *((name, "C") for name in ("internal_force", "strain")),
    *((name, "xi") for name in ("N", "dN")),
    *(("plot", name) for name in ("clim", "displacement", "modes", "points", "values")),
    *(("animate", name) for name in ("clim", "modes", "values")),
    *(("material_point", name) for name in ("strain", "stress")),
    ("PlacedCell", "X"),
    *(("RemotePoint", name) for name in ("where", "point")),
    ("plot", "point"),
    ("Block", "shape"),
    ("UMAT", "constants"),
    ("AroundAxis", "center"),
    ("AroundAxis", "axis"),
}
"""Arguments of bases, of pictures, of shapes, which trust their callers, and of subroutines."""

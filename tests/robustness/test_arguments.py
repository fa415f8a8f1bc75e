"""Wrong arguments of the public functions end in an error of the library with a clear text."""

import numpy as np
import pytest

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
TOP = (7, "x")


def model():
    one = kl.Model(kl.box(cells=(2, 2, 2)), STEEL)
    one.fix("z-")
    one.add(kl.Gravity((0, 0, -9.81)))
    return one


def solved_with(load):
    one = model()
    one.add(load)
    return one.solve()


WRONG = {
    "mesh": (lambda: kl.Model(None), "a mesh must be a Mesh, such as"),
    "material number": (
        lambda: kl.Model(kl.box(), 5),
        "a material must be a Material, .*; got 5",
    ),
    "material word": (
        lambda: kl.Model(kl.box(), "steel"),
        "a material must be a Material, such as .*; got '",
    ),
    "material part": (lambda: kl.Model(kl.box(), {"zz": STEEL}), "there is no part 'zz'"),
    "material property": (lambda: kl.Model(kl.box(), {99: STEEL}), "no element has property 99"),
    "no material": (lambda: kl.Model(kl.box()).solve(), "has no material"),
    "assign rows": (lambda: model().assign(STEEL, [99]), "element indices must lie in 0 … 7"),
    "axes number": (lambda: model().fix("x-", 5), "axes must be some of x, y, z"),
    "axes letter": (lambda: model().fix("x-", "X"), "axes must be some of x, y, z"),
    "axes twice": (lambda: model().fix("x-", "xx"), "each once"),
    "value word": (lambda: model().fix("x-", "x", "abc"), "must be made of real numbers; got 'abc'"),
    "value nan": (lambda: model().fix("x-", "x", np.nan), "must be finite; got nan"),
    "value shape": (lambda: model().fix("x+", "xz", [1, 2, 3]), "one per axis of 'xz'"),
    "where float": (lambda: model().fix(1.5), "nodes are chosen by part name"),
    "where row": (lambda: model().fix([99]), "node indices must lie in 0 … 26"),
    "where slip": (lambda: model().fix("Z++"), r"Did you mean z\+\?"),
    "where mask": (lambda: model().fix(np.ones(5, bool)), r"a mask of nodes must have shape \(27,\)"),
    "where x y z": (lambda: model().fix(lambda x, y, z: x == 0), r"X is \(m, 3\), all places at once"),
    "where and": (
        lambda: model().fix(lambda X: X[:, 0] and X[:, 1]),
        "functions and & take arrays",
    ),
    "where X[3]": (lambda: model().fix(lambda X: X[:, 3] == 0), "a choice of nodes: the function fails"),
    "where X[0]": (lambda: model().fix(lambda X: X[0] == 0), r"x is X\[:, 0\]"),
    "where nothing": (lambda: model().fix(np.zeros(27, bool)), "cannot fix xyz: no node is chosen"),
    "where unknown": (lambda: model().fix("top"), "there is no part 'top'"),
    "link negative": (lambda: model().constrain((-1, "x"), {TOP: 1.0}), "a degree of freedom is"),
    "link axis": (lambda: model().constrain((1, "xy"), {TOP: 1.0}), "a degree of freedom is"),
    "link independents": (
        lambda: model().constrain((1, "x"), [TOP]),
        "dependents, .* must be whole numbers; got",
    ),
    "link weight": (
        lambda: model().constrain((1, "x"), {TOP: "a"}),
        "weights of a constraint must be made of real",
    ),
    "link constant": (
        lambda: model().constrain((1, "x"), {TOP: 1.0}, np.inf),
        "constant of a constraint must be finite",
    ),
    "load class": (lambda: model().add(kl.Gravity), "or Traction is needed; got the class Gravity: call it"),
    "gravity number": (lambda: kl.Gravity(-9.81), r"must be \(3,\) or \(n, 3\) .*got the number -9.81"),
    "gravity plane": (lambda: kl.Gravity((0, 1)), r"got shape \(2,\)"),
    "force rows": (lambda: solved_with(kl.BodyForce(np.ones((99, 3)))), r"BodyForce needs shape \(27, 3\)"),
    "traction rows": (
        lambda: kl.Traction("z+", np.ones((4, 2))),
        r"a traction must be \(3,\) or \(n, 3\) in Pa",
    ),
    "constants all one": (lambda: kl.Orthotropic3D(*[1.0] * 9), "C must be positive definite"),
    "Poisson's ratio": (lambda: kl.Isotropic3D(E=1.0, nu=-1.0), "-1 must be > -1: the shear modulus"),
    "stress component": (lambda: kl.StressAt((0, 0, 0), np.ones(3)), "component must be one of xx"),
    "picture path": (lambda: kl.plot(model().mesh, 3), "a path to a file must be text"),
    "critical rate": (lambda: kl.critical_rate("x"), "a model"),
    "long path": (lambda: kl.read("x" * 300), "File name too long"),
    "array beyond memory": (
        lambda: kl.Traction("z+", np.broadcast_to(0.0, (2**40, 3))),
        r"a traction must have at most 1e\+11 numbers; got shape",
    ),
    "tiny error": (lambda: model().solve(error=1e-320), "error must be a fraction between 1e-08 and 1"),
    "traction edge": (lambda: solved_with(kl.Traction([26, 25], (0, 0, 1))), "a traction finds no face"),
    "pressure list": (lambda: kl.Pressure("z+", [[1, 2]]), "a pressure must be one number"),
    "pressure nan": (lambda: kl.Pressure("z+", np.nan), "a pressure must be finite"),
    "pressure normal": (lambda: kl.Pressure("z+", 1.0, "inward"), "normal must be 'outward' or 'nodes'"),
    "newmark": (lambda: kl.Newmark(0.5, 0.25), "β = 0.5, γ = 0.25: are they swapped"),
    "newmark explicit": (lambda: kl.Newmark(0.0, 0.5), "for an explicit integrator"),
    "point rows": (lambda: kl.PointLoad([1, 2], np.ones((2, 3))), r"a point load must be \(3,\) in N"),
    "nodal shape": (
        lambda: solved_with(kl.NodalForces(np.ones((2, 3)))),
        r"nodal forces need shape \(27, 3\)",
    ),
    "nodal vector": (lambda: kl.NodalForces(np.ones(3)), r"nodal forces must be \(n, 3\)"),
    "activate shape": (
        lambda: model().set_stress_free_state(np.zeros(3)),
        r"the initial displacement must have shape \(27, 3\)",
    ),
    "prestress five": (lambda: model().add_prestress(np.zeros(5)), "a prestress has six components"),
    "prestress rows": (
        lambda: model().add_prestress(np.zeros((3, 6))),
        r"or shape \(8, 6\); got shape \(3, 6\)",
    ),
    "rule word": (lambda: model().use_rule("x"), "a Rule or an INTEGRATION_ORDER 1 … 5 is needed; got 'x'"),
    "solver": (lambda: model().solve("cholesky"), "solver must be one of auto, dense, direct, amg"),
    "tolerance": (lambda: model().solve(tolerance=0), "tolerance must be a number between 0 and 1; got 0"),
    "progress": (lambda: model().solve(progress=5), "progress must be a function"),
    "dense": (lambda: kl.Model(kl.box(cells=(15, 15, 15)), STEEL).solve("dense"), "can still move"),
    "place": (
        lambda: model().solve().stress("nodes"),
        "at must be one of gauss, element, node, averaged, raw; got 'nodes'",
    ),
    "box size": (lambda: kl.box((-1, 1, 1)), "size must be three lengths > 0 m"),
    "box origin": (lambda: kl.box(origin=(np.nan, 0, 0)), "origin must be finite"),
    "box cells": (lambda: kl.box(cells=(0, 1, 1)), "cells must be three whole numbers ≥ 1"),
    "box cells one": (lambda: kl.box(cells=3), "cells must be three whole numbers ≥ 1; got 3"),
    "box element": (lambda: kl.box(element="KinematicLinear3D9N"), "unknown element .* Did you mean"),
    "box element class": (lambda: kl.box(element=kl.KinematicLinear3D8N), "element must be a name such as"),
    "annulus": (lambda: kl.annulus(2, 1, 1), "an annulus needs 0 < inner < outer"),
    "annulus cells": (lambda: kl.annulus(1, 2, 1, (1, 2, 1)), "at least 3 cells around; got 2"),
    "empty": (lambda: kl.Model(kl.Mesh(np.zeros((0, 3))), STEEL).solve(), "the model has no elements"),
}


@pytest.mark.parametrize("name", sorted(WRONG))
def test_wrong_arguments_are_explained(name):
    call, text = WRONG[name]
    with pytest.raises(kl.KratosLiteError, match=text):
        call()


def test_a_full_matrix_of_a_large_model_is_refused_before_it_takes_the_memory():
    one = kl.Model(kl.box(cells=(15, 15, 15)), STEEL)
    one.fix("z-")
    one.add(kl.Traction("z+", (0, 0, 1.0)))
    with pytest.raises(
        kl.InputError, match="solver='dense' is for up to 10000 degrees of freedom; got 12288"
    ):
        one.solve("dense")


def test_numbers_of_every_kind_are_accepted():
    one = kl.Model(kl.box(cells=np.array([2, 2, 2])), {np.int64(1): STEEL})
    one.fix(np.array([0, 1, 2], dtype=np.uint8), "xyz", np.float32(0))
    one.fix("z-", value=[0, 0, 0])
    one.constrain((np.int32(26), "z"), {(np.int64(25), "z"): 1}, 0)
    one.add(kl.Gravity([0, 0, -10]))
    one.add(kl.Pressure(np.arange(27), np.float64(2)))
    assert np.isfinite(one.solve(tolerance=np.float64(1e-8)).u).all()

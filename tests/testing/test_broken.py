"""The conformance kit rejects broken shapes, rules, elements and materials, and says by which check."""

from contextlib import ExitStack
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.elements import ELEMENTS, KinematicLinear
from kratos_lite.elements.b_bar_3d8n import BBar3D8N
from kratos_lite.elements.enhanced_strain_3d8n import EnhancedStrain3D8N
from kratos_lite.errors import InputError
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.quadrature import Rule, hexahedron, pyramid, tetrahedron
from kratos_lite.shapes import SHAPES, Shape
from kratos_lite.shapes.hexahedra import Hexahedron8, Hexahedron20
from kratos_lite.shapes.pyramids import Pyramid5
from kratos_lite.shapes.tetrahedra import Tetrahedron4, Tetrahedron10
from kratos_lite.testing import (
    ConformanceError,
    Finding,
    assert_conforms,
    check_element,
    check_material,
    check_rule,
    check_shape,
    failures,
    patches,
    report,
    shapes,
)
from kratos_lite.testing import elements as element_checks
from kratos_lite.testing.report import run, title

BRICK, BRICK20, TET4, TET10, PYRAMID13 = (ELEMENTS[f"KinematicLinear3D{n}N"] for n in (8, 20, 4, 10, 13))


@pytest.fixture(autouse=True)
def _clean_registries():
    """Broken classes register themselves: forget them after each test."""
    with ExitStack() as stack:
        for registry in (ELEMENTS, SHAPES, MATERIALS):
            stack.enter_context(registry.temporary())
        yield


def failed(findings):
    return {finding.check: finding for finding in failures(findings)}


def alone(shape):
    """Return what checks of a shape find by themselves, without waiting for those of the cause."""
    return failed(run(shapes.BASIC + shapes.DEPENDENT + shapes.DATA, shape))


OF_ELEMENTS = element_checks.SINGLE + element_checks.MASS + patches.CHECKS


def alone_element(element, checks=OF_ELEMENTS):
    return failed(run(checks, element))


def not_run(findings):
    return {finding.check: finding.detail for finding in findings if finding.skipped}


def derived(parent, **changes):
    """Return a shape like `parent` with some of its data or functions changed."""
    return type(f"Broken{parent.__name__}", (parent,), {"nodes": parent.nodes, **changes})


def with_functions(parent, N=None, dN=None, **data):
    return derived(parent, **{k: staticmethod(f) for k, f in (("N", N), ("dN", dN)) if f}, **data)


MAY_OVERRIDE = {"B", "local_system", "batched", "shape", "rule", "mass_rule", "spurious_modes"}


def broken(parent, **changes):
    """Return an element with other data or methods, also with those that a class may not override.

    Its B takes many elements, unless changes say otherwise.
    """
    changes = {"batched": True} | changes
    kind = type("Broken", (parent,), {name: changes[name] for name in changes.keys() & MAY_OVERRIDE})
    for name in changes.keys() - MAY_OVERRIDE:
        setattr(kind, name, changes[name])
    return kind


# ---- shapes ------------------------------------------------------------------------------------


def r_for_s(dN, r, s, t):
    dN[..., 6, 1] = 4 * (1 - s - 2 * r - t)


def of_solfec(dN, x, y, z):
    """Add the error of dr/dz = x y in place of x y / (1 - z)², with r = x y z / (1 - z)."""
    signs = np.array([np.sign(X[0] * X[1]) for X in Pyramid5.nodes])
    dN[..., 2] += signs / 4 * (x * y - x * y / (1 - z) ** 2)[..., None]


def two_that_cancel(dN, r, s, t):
    dN[..., 6, 1] += 0.5 * r
    dN[..., 5, 1] -= 0.5 * r


def one_too_large(dN, r, s, t):
    dN[..., 6, 1] += 0.5 * r


def in_the_eighth_digit(dN, r, s, t):
    dN *= 1 + 1e-7


def infinite_at_the_apex(dN, x, y, z):
    dN[..., 4, 2] = 1 + 0 / (1 - z)


def with_dN(parent, change):
    """Return a shape whose derivatives are changed in place."""

    def dN(xi):
        out = np.array(parent.dN(xi))
        change(out, *np.moveaxis(np.asarray(xi, dtype=float), -1, 0))
        return out

    return with_functions(parent, dN=dN)


@pytest.mark.parametrize(
    ("parent", "change", "check", "by_itself", "texts"),
    [
        (Tetrahedron10, r_for_s, "derivatives", {"partition of unity", "reproduction"}, ["dN[6] / d s at "]),
        (Pyramid5, of_solfec, "derivatives", {"partition of unity", "bounded"}, []),
        (Tetrahedron10, two_that_cancel, "derivatives", {"reproduction"}, ["dN[6] / d s", "dN[5] / d s"]),
        (Hexahedron8, in_the_eighth_digit, "derivatives", {"reproduction"}, []),
        (Pyramid5, infinite_at_the_apex, "bounded", {"partition of unity"}, ["xi = (0, 0, 1)"]),
    ],
)
def test_wrong_derivatives_are_named(parent, change, check, by_itself, texts):
    shape = with_dN(parent, change)
    findings = check_shape(shape)
    found = failed(findings)
    assert set(alone(shape)) == {check} | by_itself
    if check == "derivatives":
        assert set(found) == {check}
        later = ("partition of unity", "reproduction", "bounded")
        assert [not_run(findings)[name] for name in later] == ["fix derivatives first"] * 3
    assert all(text in found[check].detail for text in texts)
    assert ("also" in found[check].detail) == (change in (of_solfec, two_that_cancel, in_the_eighth_digit))


def test_the_pyramid_of_solfec_is_found_by_its_derivatives_alone():
    element = broken(KinematicLinear, shape=with_dN(Pyramid5, of_solfec), rule=pyramid(2))
    assert set(failed(check_element(element))) == {"derivatives"}
    assert not alone_element(element)  # no patch test sees it: linear displacements stay exact


@pytest.mark.parametrize("parent", [Tetrahedron10, Hexahedron20])
def test_nodes_and_functions_in_different_orders_are_found(parent):
    order = [0, 1, 3, 2, *range(4, len(parent.nodes))]
    functions = lambda xi: parent.N(xi)[..., order], lambda xi: parent.dN(xi)[..., order, :]
    shape = with_functions(parent, *functions)
    found = failed(check_shape(shape))
    assert set(found) == {"kronecker"}
    assert set(alone(shape)) == {"kronecker", "reproduction"}
    assert found["kronecker"].measured == 1
    assert found["kronecker"].detail.startswith("N[2] at node 2")
    shape = with_functions(parent, *functions, nodes=parent.nodes[order])
    assert set(failed(check_shape(shape))) == {"mid edges", "faces"}


def test_a_function_with_a_singular_slope_is_found():
    def N(xi):
        out = np.array(Pyramid5.N(xi))
        out[..., 4] = np.sqrt(out[..., 4])
        return out

    assert {"derivatives", "bounded"} <= set(alone(with_functions(Pyramid5, N)))


def test_functions_that_take_one_point_at_a_time_fail_only_broadcasting():
    def N(xi):
        r, s, t = xi
        return np.array([1 - r - s - t, r, s, t])

    found = failed(check_shape(with_functions(Tetrahedron4, N)))
    assert set(found) == {"broadcasting"}
    assert "raises ValueError" in found["broadcasting"].detail
    assert "at test_broken.py:" in found["broadcasting"].detail


def test_an_exception_in_N_is_a_finding_with_its_line():
    def N(xi):
        raise ZeroDivisionError("by hand")

    findings = check_shape(with_functions(Tetrahedron4, N))
    found = failed(findings)
    line = N.__code__.co_firstlineno + 1
    assert set(found) == {"derivatives"}
    text = f"raises ZeroDivisionError: by hand at test_broken.py:{line}"
    assert str(found["derivatives"]) == f"derivatives: {text}"
    same = "stops at the same error as 'derivatives'"
    assert {k: v for k, v in not_run(findings).items() if k in ("broadcasting", "kronecker")} == {
        "broadcasting": same,
        "kronecker": same,
    }


def test_a_result_of_the_wrong_size_is_named():
    found = failed(check_shape(with_functions(Tetrahedron4, lambda xi: Tetrahedron4.N(xi)[..., :3])))
    assert any(
        "N at xi = (" in f.detail and "has shape (3,); expected (4,)" in f.detail for f in found.values()
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_fails(value):
    shape = with_functions(Tetrahedron4, lambda xi: Tetrahedron4.N(xi) * value)
    assert {"derivatives", "kronecker"} <= set(failed(check_shape(shape)))
    found = alone(shape)
    assert {"derivatives", "kronecker", "partition of unity", "reproduction", "bounded"} <= set(found)


FIRST, *REST = Tetrahedron10.faces


@pytest.mark.parametrize(
    ("changes", "check", "text"),
    [
        ({"faces": ((0, 1, 2), *Tetrahedron4.faces[1:])}, "faces", "clockwise from outside"),
        ({"faces": Tetrahedron4.faces[:3]}, "faces", "is not used once in each direction"),
        ({"faces": ()}, "faces", "lists no faces"),
        ({"faces": ((0, 2), *Tetrahedron4.faces[1:])}, "faces", "has 2 nodes"),
        ({"to_vtk": (0, 1, 2, 2)}, "node orders", "to_vtk"),
        ({"to_gmsh": (0, 1, 2)}, "node orders", "to_gmsh"),
        ({"degree": 2}, "reproduction", "degree claimed: 2"),
        ({"degree": 0}, "reproduction", "span degree 1 completely; write degree = 1"),
        ({"degree": 10**6}, "definition", "says degree = 1000000; an integer from 0 to 9"),
        ({"corners": 3}, "definition", "says corners = 3; a tetrahedron has 4"),
        ({"cell": "tet"}, "definition", "has the cell 'tet'; cells are point, line"),
        ({"vtk": 0}, "definition", "says vtk = 0: results cannot be saved with it; write vtk = 10"),
        ({"nodes": 2 * Tetrahedron4.nodes}, "definition", "first nodes that are not the corners"),
        ({"nodes": np.zeros((4, 2))}, "definition", "has nodes (4, 2); a tetrahedron has (4 to 200, 3)"),
        ({"edges": ((0, 7),)}, "definition", "edges or faces that are not 0 to 3"),
        ({"faces": (FIRST[:3], *REST)}, "faces", "should list the nodes"),
        ({"faces": ((*FIRST[:3], *FIRST[:2:-1]), *REST)}, "faces", "out of order"),
    ],
)
def test_wrong_data_of_a_shape_are_found(changes, check, text):
    parent = Tetrahedron10 if REST[-1] in changes.get("faces", ()) else Tetrahedron4
    found = failed(check_shape(derived(parent, **changes)))
    assert set(found) == {check}
    assert text in found[check].detail


# ---- rules -------------------------------------------------------------------------------------


def rule_like(rule, points=None, weights=None, degree=None):
    return Rule(
        np.array(rule.points if points is None else points),
        np.array(rule.weights if weights is None else weights),
        rule.degree if degree is None else degree,
        "broken",
    )


def heavier(rule):
    return rule_like(rule, weights=rule.weights * 1.01)


def five_points():
    """Return a five-point rule of degree 2 for the pyramid: right in itself, too weak for 13 nodes."""
    z1, z2 = 1 / 4 - np.sqrt(3 / 320), 1 / 4 + np.sqrt(3 / 20)
    points = [[x, y, z1] for x in (-0.5, 0.5) for y in (-0.5, 0.5)] + [[0, 0, z2]]
    return Rule(np.array(points), np.array([4 / 15] * 4 + [4 / 15]), 2, "five points")


def truncated():
    a, b = 0.58541020, 0.13819660
    points = np.full((4, 3), b)
    points[1:] += (a - b) * np.eye(3)
    return Rule(points, np.full(4, 1 / 24), 2, "eight digits")


def test_constants_cut_to_eight_digits_fail_the_rule():
    (finding,) = failures(check_rule("tetrahedron", truncated()))
    assert (finding.check, finding.limit) == ("monomials", 1e-13)
    assert 1e-10 < finding.measured < 1e-7


@pytest.mark.parametrize(
    ("cell", "rule", "checks", "text"),
    [
        ("pyramid", five_points(), set(), ""),  # right in itself
        ("tetrahedron", heavier(tetrahedron(2)), {"weights", "monomials"}, ""),
        ("tetrahedron", rule_like(tetrahedron(2), degree=3), {"monomials"}, ""),
        ("hexahedron", rule_like(hexahedron(3), degree=4), {"monomials"}, ""),
        ("pyramid", rule_like(pyramid(3), degree=4), {"monomials"}, ""),
        ("hexahedron", rule_like(BRICK.rule, BRICK.rule.points * 2), {"monomials", "points inside"}, ""),
        ("wedge", tetrahedron(2), {"weights", "monomials"}, ""),
        ("hexahedron", rule_like(hexahedron(3), weights=np.ones(7)), {"sizes"}, "weights (7,); expected"),
        ("hexahedron", rule_like(hexahedron(3), weights=np.full(8, np.nan)), {"sizes"}, "finite"),
        ("triangle", tetrahedron(2), {"sizes"}, "points (4, 3)"),
        ("sphere", tetrahedron(2), {"sizes"}, "cell 'sphere' is not known"),
    ],
)
def test_wrong_rules_are_found(cell, rule, checks, text):
    found = failed(check_rule(cell, rule))
    assert set(found) == checks
    assert not text or text in found["sizes"].detail


# ---- elements ----------------------------------------------------------------------------------


TRACE = np.array([1.0, 1, 1, 0, 0, 0])


def mean_dilatation(self, xi):
    """Selective integration by mean dilatation: Hughes, Int. J. Num. Meth. Eng. 15 (1980) 1413-1418."""
    B, dV = BRICK.B(self, xi), self.dV[..., None]
    mean = (TRACE @ BRICK.B(self, self.rule.points) * dV).sum(axis=-2) / dV.sum(axis=-2)
    return B + TRACE[:, None] * ((mean - TRACE @ B) / 3)[..., None, :]


@pytest.mark.parametrize("B", [mean_dilatation, BRICK.B])
def test_an_element_of_its_own_B_conforms(B):
    findings = check_element(broken(BRICK, B=B, batched=False))
    assert not failures(findings)
    assert len([finding for finding in findings if finding.passed]) >= 30


def rows_times(*factors, B=mean_dilatation):
    """Return a B whose rows are multiplied by factors."""
    return {"B": lambda self, xi: np.array(factors, dtype=float)[:, None] * B(self, xi)}


def center_dilatation(self, xi):
    B, center = BRICK.B(self, xi), BRICK.B(self, np.zeros(3))
    return B + TRACE[:, None] * (TRACE @ (center - B) / 3)[..., None, :]


def depends_on_the_place(self, xi):
    place = self.X.sum(axis=(-2, -1))[..., None, None]
    return mean_dilatation(self, xi) + 1e-9 * place * TRACE[:, None]


def far_from_the_origin(self, xi):
    away = np.abs(self.X).max(axis=(-2, -1))[..., None, None]
    X = self.X + 1e-14 * away * np.sin(np.arange(24.0)).reshape(8, 3)
    return BRICK(X).B(xi)


def unscaled(self, xi):
    """j0 / j is left out: the modes have a mean on distorted cells, and do work on constant stress."""
    J0, J = self.J(np.zeros(3)), self.J(xi)
    ratio = np.linalg.det(J0)[..., None] / np.linalg.det(J)
    return EnhancedStrain3D8N._modes(self, xi) / ratio[..., None, None]


def with_a_mean(self, xi):
    G = EnhancedStrain3D8N._modes(self, xi).copy()
    G[..., 0] += 0.1 * G[..., :1, :, 0]
    return G


def in_global_axes(self, xi):
    """Three shears more, in x, y, z in place of the frame of the cell."""
    G = EnhancedStrain3D8N._modes(self, xi)
    more = np.zeros((*G.shape[:-1], 3))
    for c in range(3):
        more[..., 3 + c, c] = xi[:, c] * xi[:, (c + 1) % 3]
    return np.concatenate([G, more], axis=-1)


def every_product(self, xi):
    """All six monomials for all six strains: nothing but constant strain has energy left."""
    products = np.column_stack([xi, xi * np.roll(xi, -1, axis=1)])
    modes = np.einsum("gp,cd->gcpd", products, np.eye(6)).reshape(len(xi), 6, 36)
    return np.broadcast_to(modes, (*self.X.shape[:-2], *modes.shape))


def projected_without_volumes(self, xi, values):
    mean = values.mean(axis=-2, keepdims=True)
    return np.broadcast_to(mean, (*mean.shape[:-2], len(xi), mean.shape[-1]))


def changed_K(change):
    """Return the local system of a brick whose K (..., 24, 24) is changed, knowing its nodes."""

    def local_system(self, C, u):
        K = change(BRICK.local_system(self, C, u)[0].copy(), self.X)
        return K, (K @ u.reshape(*u.shape[:-2], 24, 1)).reshape(*K.shape[:-2], 8, 3)

    return {"local_system": local_system, "batched": True}


def first_node_heavier(K, X):
    K[..., :3, :] *= 1 + 1e-9
    K[..., :3] *= 1 + 1e-9
    return K


def unsymmetric(K, X):
    K[..., 0, 4] *= 1 + 1e-9
    return K


def stiffer_if_flat(K, X):
    size = np.ptp(X, axis=-2)
    return K * (1 + 1e-8 * (size.max() > 50 * size.min()))


def one_mode_less(self, xi):
    return EnhancedStrain3D8N._modes(self, xi)[..., 1:]


def last_first(K, X):
    return K[::-1] if K.ndim == 3 else K


NORMALS_ALONE = rows_times(1, 1, 1, 0, 0, 0, B=BRICK.B)
PLAIN_SYSTEM = {"local_system": lambda self, C, u: BRICK(self.X).local_system(C, u)}
WEAK = {"rank", "linear patch", "quadratic patch", "bending"}
with SHAPES.temporary():
    OPEN_BRICK = derived(Hexahedron8, faces=Hexahedron8.faces[:5])
    WRONG_TET10 = with_dN(Tetrahedron10, one_too_large)
SHEAR = {"strain operator", "frame invariance", "linear patch"}


ONE_POINT, HALF_SHEAR = {"rule": hexahedron(1)}, (1, 1, 1, 0.5, 0.5, 0.5)
WRONG_DN = {"shape": WRONG_TET10, "rule": tetrahedron(2)}
ALONE = [
    (BRICK, rows_times(1, 1, 1, 2, 1, 1, B=BRICK.B), SHEAR),
    (BRICK, rows_times(*HALF_SHEAR, B=BRICK.B), SHEAR),
    (TET10, rows_times(*HALF_SHEAR, B=TET10.B), SHEAR),
    (
        BRICK,
        {"B": lambda self, xi: BRICK.B(self, xi)[..., [0, 1, 2, 3, 5, 4], :]},
        {"strain operator"},
        "it is that of ZX: rows of B are XX, YY, ZZ, XY, YZ, ZX",
    ),
    (BRICK, NORMALS_ALONE | PLAIN_SYSTEM, {"strain operator", "stretched", "linear patch"}),
    (BRICK, changed_K(stiffer_if_flat), {"stretched"}),
    (BBar3D8N, {"_projected": projected_without_volumes}, {"linear patch"}),
    (BRICK20, {"lumped_mass": lambda self, rho: self.scalar_mass(rho).sum(axis=-1)}, {"lumped mass"}),
    (BRICK, {"lumped_mass": lambda self, rho: 0.99 * BRICK.lumped_mass(self, rho)}, {"mass total"}),
    (
        BRICK,
        {"shape": OPEN_BRICK},
        {"faces", "shared faces"},
        "the boundary of a 2x1x1 box has the area 8 (10)",
    ),
    (BRICK20, {"rule": hexahedron(3)}, {"rank", "bending"}, "12 zero-energy modes on the reference cell"),
    (PYRAMID13, {"rule": five_points()}, WEAK, "9 zero-energy modes on the"),
    (PYRAMID13, {"rule": pyramid(3)}, {"rank"}),
    (TET10, {"rule": tetrahedron(1)}, WEAK | {"stretched"}),
    (BRICK, ONE_POINT, {"rank", "linear patch", "bending"}),
    (TET10, {"rule": truncated()}, {"rule monomials"}),
    (TET10, {"rule": heavier(tetrahedron(2))}, {"rule weights", "rule monomials"}),
    (KinematicLinear, WRONG_DN, {"derivatives"}),
]
"""Broken elements, the only checks that they fail, and a text in what these say."""
AMONG_OTHERS = [
    (BRICK, {"B": lambda self, xi: BRICK.B(self, 0.9 * np.asarray(xi))}, "linear patch"),
    (BRICK, {"B": lambda self, xi: BRICK.B(self, np.zeros(3))}, "rank"),
    (BRICK, {"B": center_dilatation}, "linear patch"),
    (BRICK, NORMALS_ALONE, "rank"),
    (
        BRICK,
        {"B": lambda self, xi: 0 * BRICK.B(self, xi)},
        "rank",
        "24 zero-energy modes on the reference cell, 24",
    ),
    (BRICK, {"B": lambda self, xi: 0 * BRICK.B(self, xi)}, "linear patch", "K is singular"),
    (BRICK, rows_times(1, 1, 1, 1, 0, 1), "strain operator", "strain YZ at Gauss point"),
    (BRICK, rows_times(1, -1, 1, 1, 1, 1), "strain operator", "strain YY at Gauss point"),
    (BRICK, rows_times(-1, -1, -1, -1, -1, -1), "strain operator"),
    (BRICK, rows_times(*HALF_SHEAR), "linear patch"),
    (BRICK, {"B": lambda self, xi: np.roll(mean_dilatation(self, xi), 3, axis=-1)}, "rigid motions"),
    (BRICK, {"B": lambda self, xi: mean_dilatation(self, xi) + 1e-9}, "rigid motions"),
    (BRICK, {"B": depends_on_the_place}, "strain operator"),
    (BRICK, {"B": far_from_the_origin}, "offset", "error of K at a distance c"),
    (EnhancedStrain3D8N, {"_modes": unscaled}, "linear patch"),
    (EnhancedStrain3D8N, {"_modes": with_a_mean}, "linear patch"),
    (EnhancedStrain3D8N, {"_modes": one_mode_less}, "numbering invariance"),
    (EnhancedStrain3D8N, {"_modes": in_global_axes}, "frame invariance"),
    (EnhancedStrain3D8N, {"_modes": every_product}, "rank"),
    (BRICK, {"spurious_modes": 12} | ONE_POINT, "rank", "modes in a patch of 2x2x2 bricks"),
    (TET4, {"mass_rule": tetrahedron(1)}, "consistent mass"),
    (TET10, {"mass_rule": tetrahedron(2)}, "consistent mass"),
    (BRICK20, {"mass_rule": hexahedron(3)}, "consistent mass"),
    (PYRAMID13, {"mass_rule": pyramid(3)}, "consistent mass"),
    (BRICK, changed_K(lambda K, X: np.where(np.abs(K) < 1e-8, 0.0, K)), "length scaling"),
    (BRICK, changed_K(first_node_heavier), "numbering invariance", "K with its nodes listed as ("),
    (BRICK, changed_K(unsymmetric), "symmetry"),
    (BRICK, changed_K(last_first), "stiffness", "gives other values for many elements"),
    (BRICK, {"body_force": lambda self, b: BRICK.body_force(self, b)[..., ::-1]}, "body force"),
    (BRICK, {"internal_force": lambda self, s, C=None: -BRICK.internal_force(self, s, C)}, "internal force"),
]
"""Broken elements, a check that they fail, perhaps among others, and a text in what it says."""


@pytest.mark.parametrize(("parent", "changes", "checks", "text"), [(*case, "")[:4] for case in ALONE])
def test_a_broken_element_fails_these_checks_alone(parent, changes, checks, text):
    found = failed(check_element(broken(parent, **changes)))
    assert set(found) == checks
    assert any(text in finding.detail for finding in found.values())


@pytest.mark.parametrize(("parent", "changes", "check", "text"), [(*case, "")[:4] for case in AMONG_OTHERS])
def test_a_broken_element_fails_this_check(parent, changes, check, text):
    one = [function for function in OF_ELEMENTS if title(function) == check]
    assert text in alone_element(broken(parent, **changes), one)[check].detail


@pytest.mark.parametrize(
    ("parent", "changes", "checks"),
    [
        (TET10, {"rule": heavier(tetrahedron(2))}, {"volume"}),
        (TET10, {"rule": truncated()}, {"quadratic patch", "bending"}),
        (KinematicLinear, WRONG_DN, {"linear patch", "quadratic patch", "rigid motions", "strain operator"}),
    ],
)
def test_checks_of_the_element_find_wrong_rules_and_shapes_by_themselves(parent, changes, checks):
    assert checks <= set(alone_element(broken(parent, **changes)))


def test_more_points_or_a_higher_degree_than_any_element_needs_are_refused_at_once():
    for rule in (tetrahedron(degree=39), rule_like(tetrahedron(2), degree=10**9)):
        findings = check_element(broken(TET10, rule=rule, mass_rule=tetrahedron(4)))
        assert set(failed(findings)) == {"rule sizes"}
        assert "are checked up to 1000 points and degree 20" in failed(findings)["rule sizes"].detail
        assert not_run(findings)["rank"] == "fix rule sizes first"


def test_a_wrong_mass_rule_holds_up_only_the_checks_of_the_mass():
    findings = check_element(broken(TET10, mass_rule=heavier(tetrahedron(4))))
    assert set(failed(findings)) == {"mass rule weights", "mass rule monomials"}
    assert set(not_run(findings)) == {"body force", "mass total", "consistent mass", "lumped mass"}


def test_an_error_inside_the_library_shows_the_line_that_led_to_it():
    class Broken(BRICK):
        def B(self, xi):
            return BRICK(self.X[:7]).B(xi)

    detail = failed(check_element(Broken))["strain operator"].detail
    line = Broken.B.__code__.co_firstlineno + 1
    assert detail.startswith(
        "raises MeshError: nodes X of a KinematicLinear3D8N must have shape (..., 8, 3); got (7, 3) at"
    )
    assert detail.endswith(f"test_broken.py:{line}")


def test_an_exception_in_an_element_is_a_finding():
    class Broken(BRICK):
        def local_system(self, C, u):
            raise RuntimeError("not written yet")

    findings = check_element(Broken)
    assert list(failed(findings)) == ["stiffness"]
    assert "raises RuntimeError: not written yet at test_broken.py:" in failed(findings)["stiffness"].detail
    assert not_run(findings)["rank"] == "stops at the same error as 'stiffness'"


def test_arguments_that_are_missing_name_no_line_of_the_library():
    class Broken(BRICK):
        def local_system(self, C):
            return C

    detail = failed(check_element(Broken))["stiffness"].detail
    assert detail.endswith("given; an element has local_system(self, C, u)")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({}, "states no shape"),
        ({"shape": "hexahedron", "nodes": None}, "states no shape"),
        ({"shape": Hexahedron8, "rule": 8}, "states no rule"),
        ({"shape": SHAPES["Triangle3"], "rule": tetrahedron(2)}, "which is not a solid"),
    ],
)
def test_an_element_without_its_parts_is_one_finding(changes, text):
    kind = type("Broken", (KinematicLinear,), {})
    for name, value in changes.items():
        setattr(kind, name, value)
    (finding,) = check_element(kind)
    assert finding.check == "definition"
    assert not finding.passed
    assert text in finding.detail


def test_a_shape_that_no_box_is_made_of_skips_the_patches_honestly():
    third = np.array([[1 / 3, 0.0, 0.0]])

    class Tetrahedron4Plus(Shape):
        cell, corners, degree = "tetrahedron", 4, 1
        nodes, faces, edges = np.vstack([Tetrahedron4.nodes, third]), Tetrahedron4.faces, Tetrahedron4.edges

        @staticmethod
        def N(xi):
            r, s, t = np.moveaxis(np.asarray(xi, dtype=float), -1, 0)
            bubble = 4.5 * r * (1 - r - s - t)
            return np.stack([1 - r - s - t - 2 * bubble / 3, r - bubble / 3, s, t, bubble], axis=-1)

        @staticmethod
        def dN(xi):
            r, s, t = np.moveaxis(np.asarray(xi, dtype=float), -1, 0)
            slope = 4.5 * np.stack([1 - 2 * r - s - t, -r, -r], axis=-1)
            corners = np.broadcast_to(Tetrahedron4.dN(xi), (*r.shape, 4, 3))
            share = np.array([2 / 3, 1 / 3, 0, 0])[:, None]
            return np.concatenate([corners - share * slope[..., None, :], slope[..., None, :]], axis=-2)

    class Odd(KinematicLinear):
        shape, rule = Tetrahedron4Plus, tetrahedron(2)

    findings = {finding.check: finding for finding in check_element(Odd)}
    for check in ("linear patch", "bending", "shared faces"):
        assert findings[check].skipped
        assert not findings[check].passed
        assert "not its corners and the middles" in findings[check].detail


def test_assert_conforms_reports_every_failure_in_one_error():
    def dN(xi):
        out = Tetrahedron4.dN(xi)
        out[..., 3, 2] = 1.25
        return out

    with pytest.raises(ConformanceError) as caught:
        assert_conforms(with_functions(Tetrahedron4, dN=dN))
    lines = str(caught.value).splitlines()
    assert lines[0] == "BrokenTetrahedron4 does not conform: 1 of 6 checks failed, 4 not run"
    assert lines[1].startswith("  FAILED  derivatives: 0.25 exceeds 1e-09: dN[3] / d t at xi = (")
    assert lines[1].endswith("): dN gives 1.25, differences of N give 1")
    assert len(lines) == 2


def test_a_long_report_is_cut_and_counted():
    text = report("Broken", [Finding(f"check {i}", False, 1.0, 0.0, "no") for i in range(23)])
    assert text.splitlines()[20:] == ["  FAILED  check 19: no", "  … and 3 more"]


def test_failures_stand_first_and_what_was_not_run_is_one_line():
    findings = [
        Finding("first", True, 0.0, 0.0, "", claim="it holds"),
        Finding("second", False, 0.0, 0.0, "there are none", skipped=True),
        Finding("third", False, 1.0, 0.0, "mend this"),
        *(Finding(f"later {i}", False, 0.0, 0.0, "fix third first", skipped=True) for i in range(4)),
    ]
    assert report("My8N", findings, whole=True).splitlines() == [
        "My8N does not conform: 1 of 2 checks failed, 5 not run",
        "  FAILED  third: mend this",
        "  ok      first: it holds",
        "  not run second (there are none); 4 checks (fix third first)",
    ]
    assert report("Mine", findings[1:2], whole=True).splitlines()[0] == "Mine: nothing was checked"


def test_a_finding_that_passes_says_what_holds_and_not_how_to_fix_it():
    texts = [str(finding) for finding in check_element(BRICK20) if finding.passed]
    assert len(texts) == 34
    assert any(text.startswith("faces: faces are outward, closed") for text in texts)
    assert not any("problem" in text or "helps" in text for text in texts)


# ---- materials ---------------------------------------------------------------------------------


with MATERIALS.temporary():

    @dataclass(frozen=True)
    class Made(LinearMaterial):
        """A material of any C that checks nothing itself."""

        factor: float = 1.0
        density: float = 0.0
        isotropic: ClassVar[bool] = True

        def check(self):
            pass

        def elasticity(self):
            return self.factor * Isotropic3D(E=1e9, nu=0.3).elasticity()


def changed(**methods):
    return type("Broken", (Made,), methods)()


def C_with(i, j, value):
    C = Made().elasticity()
    C[i, j] = value
    return C


HEAVY = {"density": property(lambda self: 7850.0), "__init__": lambda self: None}
SLATE = kl.Orthotropic3D(9e9, 9e9, 5e9, 0.2, 0.27, 0.27, 3.75e9, 2e9, 2e9).C


def test_the_materials_that_are_broken_below_conform_before():
    assert not failures(check_material(Made()))
    slate = {"elasticity": lambda self: SLATE, "transversely_isotropic": (0, 0, 1)}
    assert not failures(check_material(changed(**slate)))


@pytest.mark.parametrize(
    ("methods", "checks"),
    [
        ({"elasticity": lambda self: C_with(0, 1, 1e8)}, {"symmetry", "isotropy"}),
        ({"elasticity": lambda self: C_with(3, 3, 1e8)}, {"isotropy"}),
        ({"elasticity": lambda self: C_with(3, 3, -1e8)}, {"positive definite", "isotropy"}),
        ({"elasticity": lambda self: -Made().elasticity()}, {"positive definite"}),
        ({"elasticity": lambda self: 0 * Made().elasticity()}, {"positive definite"}),
        ({"elasticity": lambda self: np.linalg.inv(Made().elasticity())}, {"isotropy", "magnitude"}),
        ({"elasticity": lambda self: Isotropic3D(210e3, 0.3).C, **HEAVY}, {"magnitude"}),
        ({"elasticity": lambda self: SLATE, "transversely_isotropic": (1, 0, 0)}, {"isotropy"}),
        ({"density": property(lambda self: -1.0), "__init__": lambda self: None}, {"density"}),
    ],
)
def test_broken_materials_are_found(methods, checks):
    assert set(failed(check_material(changed(**methods)))) == checks


def test_twice_the_shear_modulus_in_C_is_named():
    tensors = changed(elasticity=lambda self: Made().elasticity() * [1, 1, 1, 2, 2, 2])
    assert failed(check_material(tensors))["isotropy"].detail.endswith("is 2 μ, of engineering shear it is μ")


def test_a_class_for_an_instance_or_one_for_a_class_is_refused():
    with pytest.raises(InputError, match="check_element takes the class of an element; got"):
        check_element(BRICK(BRICK.nodes))
    with pytest.raises(InputError, match=r"a law must be a Material, such as MyLaw\(E=1e6\)"):
        check_material(Made)


def test_a_C_of_the_wrong_size_is_a_finding():
    found = failed(check_material(changed(elasticity=lambda self: np.eye(3))))
    assert found["symmetry"].detail == "raises C must be (6, 6) and finite; its shape is (3, 3)"

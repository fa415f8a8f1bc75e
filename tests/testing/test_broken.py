"""The conformance kit rejects broken shapes, rules, elements and materials, and says by which check."""

from contextlib import ExitStack
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from kratos_lite.elements import ELEMENTS, KinematicLinear
from kratos_lite.elements.b_bar_3d8n import BBar3D8N
from kratos_lite.elements.enhanced_strain_3d8n import EnhancedStrain3D8N
from kratos_lite.elements.kinematic_linear_3d4n import KinematicLinear3D4N
from kratos_lite.elements.kinematic_linear_3d8n import KinematicLinear3D8N
from kratos_lite.elements.kinematic_linear_3d10n import KinematicLinear3D10N
from kratos_lite.elements.kinematic_linear_3d13n import KinematicLinear3D13N
from kratos_lite.elements.kinematic_linear_3d20n import KinematicLinear3D20N
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.quadrature import Rule, hexahedron, pyramid, rule_for, tetrahedron
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
from kratos_lite.testing.report import run

MATRICES = {"stiffness", "rank", "rigid motions", "linear patch", "quadratic patch", "bending"}


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


def alone_element(element):
    return failed(run(element_checks.SINGLE + element_checks.MASS + patches.CHECKS, element))


def not_run(findings):
    return {finding.check: finding.detail for finding in findings if finding.skipped}


def derived(parent, **changes):
    """Return a shape like `parent` with some of its data or functions changed."""
    return type(f"Broken{parent.__name__}", (parent,), {"nodes": parent.nodes, **changes})


def with_functions(parent, N=None, dN=None):
    changes = {k: staticmethod(f) for k, f in (("N", N), ("dN", dN)) if f}
    return derived(parent, **changes)


# ---- shapes ------------------------------------------------------------------------------------


def test_registries_forget_what_a_test_registers():
    before = list(SHAPES)
    with SHAPES.temporary():
        derived(Tetrahedron4)
        assert "BrokenTetrahedron4" in SHAPES
    assert list(SHAPES) == before


def test_a_derivative_with_r_where_s_belongs_is_named():
    def dN(xi):
        r, s, t = np.moveaxis(np.asarray(xi, dtype=float), -1, 0)
        out = Tetrahedron10.dN(xi)
        out[..., 6, 1] = 4 * (1 - s - 2 * r - t)
        return out

    shape = with_functions(Tetrahedron10, dN=dN)
    findings = check_shape(shape)
    found = failed(findings)
    assert set(found) == {"derivatives"}
    assert not_run(findings) == dict.fromkeys(
        ("partition of unity", "reproduction", "bounded"), "fix derivatives first"
    )
    assert set(alone(shape)) == {"derivatives", "partition of unity", "reproduction"}
    detail = found["derivatives"].detail
    assert detail.startswith("dN[6] / d s at xi = (")
    assert "also" not in detail
    assert 0.1 < found["derivatives"].measured < 4


def test_the_pyramid_of_solfec_is_found():
    """dr/dz = x y in place of x y / (1 - z)², with r = x y z / (1 - z)."""

    def dN(xi):
        x, y, z = np.moveaxis(np.asarray(xi, dtype=float), -1, 0)
        signs = [np.sign(X[0] * X[1]) for X in Pyramid5.nodes]
        wrong = np.stack([sign / 4 * (x * y - x * y / (1 - z) ** 2) for sign in signs], axis=-1)
        out = Pyramid5.dN(xi)
        out[..., 2] += wrong
        return out

    made = with_functions(Pyramid5, dN=dN)
    assert set(failed(check_shape(made))) == {"derivatives"}

    class Broken(KinematicLinear):
        shape, rule = made, pyramid(2)

    assert set(failed(check_element(Broken))) == {"derivatives"}
    assert not alone_element(Broken)  # no patch test sees it: linear displacements stay exact


def test_wrong_derivatives_that_still_sum_to_zero_are_named_both():
    def dN(xi):
        out = Tetrahedron10.dN(xi)
        wrong = 0.5 * np.asarray(xi)[..., 0]
        out[..., 6, 1] += wrong
        out[..., 5, 1] -= wrong
        return out

    found = failed(check_shape(with_functions(Tetrahedron10, dN=dN)))
    assert "partition of unity" not in found
    detail = found["derivatives"].detail
    assert "dN[6] / d s" in detail
    assert "dN[5] / d s" in detail


def test_a_derivative_wrong_in_the_eighth_digit_is_found():
    shape = with_functions(Hexahedron8, dN=lambda xi: Hexahedron8.dN(xi) * (1 + 1e-7))
    assert set(failed(check_shape(shape))) == {"derivatives"}
    assert set(alone(shape)) == {"derivatives", "reproduction"}


@pytest.mark.parametrize("parent", [Tetrahedron10, Hexahedron20])
def test_functions_in_another_order_than_the_nodes_are_found(parent):
    order = [0, 1, 3, 2, *range(4, len(parent.nodes))]
    shape = with_functions(
        parent, lambda xi: parent.N(xi)[..., order], lambda xi: parent.dN(xi)[..., order, :]
    )
    found = failed(check_shape(shape))
    assert set(found) == {"kronecker"}
    assert set(alone(shape)) == {"kronecker", "reproduction"}
    assert found["kronecker"].measured == 1
    assert found["kronecker"].detail.startswith("N[2] at node 2")


@pytest.mark.parametrize("parent", [Tetrahedron10, Hexahedron20])
def test_nodes_and_functions_both_swapped_are_found_by_edges_and_faces(parent):
    order = [0, 1, 3, 2, *range(4, len(parent.nodes))]
    shape = derived(
        parent,
        nodes=parent.nodes[order],
        N=staticmethod(lambda xi: parent.N(xi)[..., order]),
        dN=staticmethod(lambda xi: parent.dN(xi)[..., order, :]),
    )
    assert set(failed(check_shape(shape))) == {"mid edges", "faces"}


def test_an_infinite_derivative_at_the_apex_is_found():
    def dN(xi):
        z = np.asarray(xi, dtype=float)[..., 2]
        out = Pyramid5.dN(xi)
        out[..., 4, 2] = 1 + 0 / (1 - z)
        return out

    found = failed(check_shape(with_functions(Pyramid5, dN=dN)))
    assert set(found) == {"bounded", "partition of unity"}
    assert "xi = (0, 0, 1)" in found["bounded"].detail
    assert np.isnan(found["bounded"].measured)


def test_a_function_with_a_singular_slope_is_found():
    def N(xi):
        out = np.array(Pyramid5.N(xi))
        out[..., 4] = np.sqrt(out[..., 4])
        return out

    assert "derivatives" in failed(check_shape(with_functions(Pyramid5, N)))
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
    ],
)
def test_wrong_data_of_a_shape_are_found(changes, check, text):
    found = failed(check_shape(derived(Tetrahedron4, **changes)))
    assert set(found) == {check}
    assert text in found[check].detail


def test_a_face_without_its_mid_edge_nodes_or_with_them_out_of_order_is_found():
    first, *rest = Tetrahedron10.faces
    for face, text in ((first[:3], "should list the nodes"), ((*first[:3], *first[:2:-1]), "out of order")):
        found = failed(check_shape(derived(Tetrahedron10, faces=(face, *rest))))
        assert set(found) == {"faces"}
        assert text in found["faces"].detail


# ---- rules -------------------------------------------------------------------------------------


def rule_like(rule, points=None, weights=None, degree=None):
    return Rule(
        np.array(rule.points if points is None else points),
        np.array(rule.weights if weights is None else weights),
        rule.degree if degree is None else degree,
        "broken",
    )


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
    found = failed(check_rule("tetrahedron", truncated()))
    assert set(found) == {"monomials"}
    assert 1e-10 < found["monomials"].measured < 1e-7
    assert found["monomials"].limit == 1e-13


@pytest.mark.parametrize("cell", ["hexahedron", "wedge", "tetrahedron", "pyramid"])
def test_rules_of_the_library_conform_up_to_the_largest_that_is_checked(cell):
    assert not [d for d in range(20) if failures(check_rule(cell, rule_for(cell, d)))]


def test_the_five_point_rule_is_right_in_itself():
    assert not failures(check_rule("pyramid", five_points()))


@pytest.mark.parametrize(
    ("cell", "rule", "checks"),
    [
        (
            "tetrahedron",
            rule_like(tetrahedron(2), weights=tetrahedron(2).weights * 1.01),
            {"weights", "monomials"},
        ),
        ("tetrahedron", rule_like(tetrahedron(2), degree=3), {"monomials"}),
        ("hexahedron", rule_like(hexahedron(3), degree=4), {"monomials"}),
        ("pyramid", rule_like(pyramid(3), degree=4), {"monomials"}),
        (
            "hexahedron",
            rule_like(hexahedron(3), points=hexahedron(3).points * 2),
            {"monomials", "points inside"},
        ),
        ("wedge", tetrahedron(2), {"weights", "monomials"}),
    ],
)
def test_wrong_rules_are_found(cell, rule, checks):
    assert set(failed(check_rule(cell, rule))) == checks


def test_a_rule_with_sizes_that_do_not_fit_is_found():
    assert "sizes" in failed(check_rule("hexahedron", rule_like(hexahedron(3), weights=np.ones(7))))
    assert "sizes" in failed(check_rule("triangle", tetrahedron(2)))
    assert "sizes" in failed(check_rule("hexahedron", rule_like(hexahedron(3), weights=np.full(8, np.nan))))


def test_an_unknown_cell_is_a_finding():
    assert "cell 'sphere' is not known" in failed(check_rule("sphere", tetrahedron(2)))["sizes"].detail


# ---- elements ----------------------------------------------------------------------------------


def from_B(parent, change):
    """Return an element of a changed B."""

    class Broken(parent):
        def B(self, xi):
            return change(super().B(xi))

    return Broken


def damaged(parent, **methods):
    """Return an element of the library as it would be with other methods, which a class may not override."""
    kind = type("Broken", (parent,), {})
    for name, method in methods.items():
        setattr(kind, name, method)
    return kind


def rows_times(factors):
    return lambda B: B * np.array(factors, dtype=float)[:, None]


def test_an_element_made_of_its_own_B_conforms():
    assert not failures(check_element(from_B(KinematicLinear3D8N, lambda B: B)))


TRACE = np.array([1.0, 1, 1, 0, 0, 0])


with ELEMENTS.temporary():

    class Bbar3D8N(KinematicLinear3D8N):
        """Selective integration by mean dilatation: Hughes, Int. J. Num. Meth. Eng. 15 (1980) 1413-1418."""

        def B(self, xi):
            B, dV = super().B(xi), self.dV[..., None]
            mean = (TRACE @ super().B(self.rule.points) * dV).sum(axis=-2) / dV.sum(axis=-2)
            return B + TRACE[:, None] * ((mean - TRACE @ B) / 3)[..., None, :]


def test_a_B_bar_element_conforms():
    found = check_element(Bbar3D8N)
    assert not failures(found)
    assert len([finding for finding in found if finding.passed]) >= 30


def at_wrong_points(self, xi):
    return KinematicLinear3D8N.B(self, 0.9 * np.asarray(xi))


def at_the_center(self, xi):
    return KinematicLinear3D8N.B(self, np.zeros(3))


def center_dilatation(self, xi):
    B, center = KinematicLinear3D8N.B(self, xi), KinematicLinear3D8N.B(self, np.zeros(3))
    return B + TRACE[:, None] * (TRACE @ (center - B) / 3)[..., None, :]


@pytest.mark.parametrize(
    ("B", "check"),
    [
        (at_wrong_points, "linear patch"),
        (at_the_center, "rank"),
        (center_dilatation, "linear patch"),
        (lambda self, xi: rows_times([1, 1, 1, 1, 0, 1])(Bbar3D8N.B(self, xi)), "strain operator"),
        (lambda self, xi: rows_times([1, -1, 1, 1, 1, 1])(Bbar3D8N.B(self, xi)), "strain operator"),
        (lambda self, xi: -Bbar3D8N.B(self, xi), "strain operator"),
        (lambda self, xi: rows_times([1, 1, 1, 0.5, 0.5, 0.5])(Bbar3D8N.B(self, xi)), "linear patch"),
        (lambda self, xi: np.roll(Bbar3D8N.B(self, xi), 3, axis=-1), "rigid motions"),
        (lambda self, xi: Bbar3D8N.B(self, xi) + 1e-9, "rigid motions"),
        (lambda self, xi: Bbar3D8N.B(self, xi) + 1e-9 * self.X.sum() * TRACE[:, None], "strain operator"),
    ],
)
def test_an_own_B_that_is_broken_is_found(B, check):
    assert check in failed(check_element(type("Broken", (Bbar3D8N,), {"B": B})))


def unscaled(self, xi):
    """j0 / j is left out: the modes have a mean on distorted cells, and do work on constant stress."""
    J0, J = self.J(np.zeros(3)), self.J(xi)
    ratio = np.linalg.det(J0)[..., None] / np.linalg.det(J)
    return EnhancedStrain3D8N._modes(self, xi) / ratio[..., None, None]


def with_a_mean(self, xi):
    G = EnhancedStrain3D8N._modes(self, xi).copy()
    G[..., 0] += 0.1 * G[..., :1, :, 0]
    return G


def one_left_out(self, xi):
    return EnhancedStrain3D8N._modes(self, xi)[..., 1:]


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


@pytest.mark.parametrize(
    ("modes", "check"),
    [
        (unscaled, "linear patch"),
        (with_a_mean, "linear patch"),
        (one_left_out, "numbering invariance"),
        (in_global_axes, "frame invariance"),
        (every_product, "rank"),
    ],
)
def test_enhanced_modes_that_are_broken_are_found(modes, check):
    assert check in failed(check_element(damaged(EnhancedStrain3D8N, _modes=modes)))


def test_a_dilatation_projected_without_the_volumes_of_the_points_is_found():
    def _projected(self, xi):
        B = KinematicLinear3D8N.B(self, self.rule.points)
        mean = (TRACE @ B).mean(axis=-2, keepdims=True)
        return np.broadcast_to(mean, (*mean.shape[:-2], len(xi), mean.shape[-1]))

    assert set(failed(check_element(damaged(BBar3D8N, _projected=_projected)))) == {"linear patch"}


def test_spurious_modes_that_a_patch_keeps_are_found():
    class Broken(KinematicLinear3D8N):
        spurious_modes = 12
        rule = hexahedron(1)

    assert "spurious modes in a patch of 2x2x2 bricks" in failed(check_element(Broken))["rank"].detail


def test_digits_lost_in_flat_cells_are_found():
    class Broken(KinematicLinear3D8N):
        batched = True

        def local_system(self, C, u):
            size, (K, r) = np.ptp(self.X, axis=-2), super().local_system(C, u)
            factor = 1 + 1e-8 * (size.max() > 50 * size.min())
            return K * factor, r * factor

    assert set(failed(check_element(Broken))) == {"stretched"}


@pytest.mark.parametrize("parent", [KinematicLinear3D8N, KinematicLinear3D10N])
@pytest.mark.parametrize("factors", [[1, 1, 1, 0, 0, 0], [1, 1, 1, 2, 1, 1], [1, 1, 1, 0.5, 0.5, 0.5]])
def test_wrong_shear_rows_of_B_are_found(parent, factors):
    found = failed(check_element(from_B(parent, rows_times(factors))))
    expected = {"strain operator", "frame invariance", "linear patch"}
    if not any(factors[3:]):  # K is singular, and bends as rounding has it
        expected |= {"rank"}
        found.pop("bending", None)
    assert set(found) == expected
    assert any(name in found["strain operator"].detail for name in ("XY", "YZ", "ZX"))


def test_shear_rows_in_another_order_are_found():
    element = from_B(KinematicLinear3D8N, lambda B: B[..., [0, 1, 2, 3, 5, 4], :])
    assert set(failed(check_element(element))) == {"strain operator"}


def test_a_local_system_that_does_not_belong_to_the_strain_is_found():
    class Broken(KinematicLinear3D8N):
        def B(self, xi):
            return rows_times([1, 1, 1, 0, 0, 0])(super().B(xi))

        def local_system(self, C, u):
            return KinematicLinear3D8N(self.X).local_system(C, u)

    assert set(failed(check_element(Broken))) == {"strain operator", "stretched", "linear patch"}


def test_a_wrong_derivative_is_found_in_the_element_too():
    def dN(xi):
        out = Tetrahedron10.dN(xi)
        out[..., 6, 1] += 0.5 * np.asarray(xi)[..., 0]
        return out

    class Broken(KinematicLinear):
        shape = with_functions(Tetrahedron10, dN=dN)
        rule, mass_rule = tetrahedron(2), tetrahedron(4)

    assert set(failed(check_element(Broken))) == {"derivatives"}
    found = failed(check_shape(Broken.shape)) | alone_element(Broken)
    assert {"derivatives", "linear patch", "quadratic patch", "rigid motions", "strain operator"} <= set(
        found
    )


def element_with(parent, **changes):
    return type(f"Broken{parent.__name__}", (parent,), changes)


@pytest.mark.parametrize(
    ("parent", "rule", "checks"),
    [
        (KinematicLinear3D20N, hexahedron(3), {"rank", "bending"}),
        (
            KinematicLinear3D13N,
            five_points(),
            {"rank", "linear patch", "quadratic patch", "bending"},
        ),
        (KinematicLinear3D13N, pyramid(3), {"rank"}),
        (
            KinematicLinear3D10N,
            tetrahedron(1),
            {"rank", "stretched", "linear patch", "quadratic patch", "bending"},
        ),
        (KinematicLinear3D8N, hexahedron(1), {"rank", "linear patch", "bending"}),
        (KinematicLinear3D10N, truncated(), {"rule monomials"}),
        (
            KinematicLinear3D10N,
            rule_like(tetrahedron(2), weights=tetrahedron(2).weights * 1.01),
            {"rule weights", "rule monomials"},
        ),
    ],
)
def test_rules_that_are_wrong_or_too_weak_are_found(parent, rule, checks):
    found = failed(check_element(element_with(parent, rule=rule)))
    assert set(found) == checks


def test_checks_of_the_element_find_wrong_rules_by_themselves():
    heavy = rule_like(tetrahedron(2), weights=tetrahedron(2).weights * 1.01)
    assert {"volume"} <= set(alone_element(element_with(KinematicLinear3D10N, rule=heavy)))
    cut = alone_element(element_with(KinematicLinear3D10N, rule=truncated()))
    assert {"quadratic patch", "bending"} <= set(cut)


def test_more_points_or_a_higher_degree_than_any_element_needs_are_refused_at_once():
    for rule in (tetrahedron(degree=39), rule_like(tetrahedron(2), degree=10**9)):
        findings = check_element(element_with(KinematicLinear3D10N, rule=rule, mass_rule=tetrahedron(4)))
        assert set(failed(findings)) == {"rule sizes"}
        assert "are checked up to 1000 points and degree 20" in failed(findings)["rule sizes"].detail
        assert not_run(findings)["rank"] == "fix rule sizes first"


def test_a_wrong_mass_rule_holds_up_only_the_checks_of_the_mass():
    heavy = rule_like(tetrahedron(4), weights=tetrahedron(4).weights * 1.01)
    findings = check_element(element_with(KinematicLinear3D10N, mass_rule=heavy))
    assert set(failed(findings)) == {"mass rule weights", "mass rule monomials"}
    assert set(not_run(findings)) == {"body force", "mass total", "consistent mass", "lumped mass"}


def test_spurious_modes_are_counted():
    found = failed(check_element(element_with(KinematicLinear3D20N, rule=hexahedron(3))))
    assert found["rank"].measured == 6
    assert found["rank"].detail.startswith("12 zero-energy modes on the reference cell")
    found = failed(check_element(element_with(KinematicLinear3D13N, rule=five_points())))
    assert found["rank"].detail.startswith("9 zero-energy modes on the reference cell, 9 on a distorted one")


@pytest.mark.parametrize(
    ("parent", "rule"),
    [
        (KinematicLinear3D4N, tetrahedron(1)),
        (KinematicLinear3D10N, tetrahedron(2)),
        (KinematicLinear3D20N, hexahedron(3)),
        (KinematicLinear3D13N, pyramid(3)),
    ],
)
def test_a_mass_rule_with_too_few_points_is_found(parent, rule):
    assert "consistent mass" in failed(check_element(element_with(parent, mass_rule=rule)))


def test_row_sums_as_lumped_mass_of_a_quadratic_element_are_found():
    def lumped_mass(self, density):
        return self.scalar_mass(density).sum(axis=-1)

    broken = damaged(KinematicLinear3D20N, lumped_mass=lumped_mass)
    assert set(failed(check_element(broken))) == {"lumped mass"}


def test_a_mass_that_is_not_all_there_is_found():
    def lumped_mass(self, density):
        return 0.99 * KinematicLinear3D8N.lumped_mass(self, density)

    assert set(failed(check_element(damaged(KinematicLinear3D8N, lumped_mass=lumped_mass)))) == {"mass total"}


with ELEMENTS.temporary():

    class ChangedStiffness(KinematicLinear3D8N):
        """Takes a change of K."""

        batched = True

        def local_system(self, C, u):
            K = self.change(super().local_system(C, u)[0])
            return K, (K @ u.reshape(*u.shape[:-2], 24, 1)).reshape(*K.shape[:-2], 8, 3)

        def change(self, K):
            return K


def test_an_absolute_tolerance_is_found_by_scaling():
    class Broken(ChangedStiffness):
        def change(self, K):
            return np.where(np.abs(K) < 1e-8, 0.0, K)

    assert "length scaling" in failed(check_element(Broken))


def test_a_node_that_is_treated_unlike_the_others_is_found():
    class Broken(ChangedStiffness):
        def change(self, K):
            K = K.copy()
            K[..., :3, :] *= 1 + 1e-9
            K[..., :3] *= 1 + 1e-9
            return K

    found = failed(check_element(Broken))
    assert found["numbering invariance"].detail.startswith("K with its nodes listed as (")
    assert not {"symmetry", "rank", "length scaling"} & set(found)


def test_digits_lost_far_from_the_origin_are_found():
    class Broken(KinematicLinear3D8N):
        def B(self, xi):
            X = self.X + 1e-14 * np.abs(self.X).max() * np.sin(np.arange(24.0)).reshape(8, 3)
            return KinematicLinear3D8N(X).B(xi)

    found = failed(check_element(Broken))
    assert 20 < found["offset"].measured < 2000
    assert not {"rank", "mass total"} & set(found)


def test_a_face_left_out_is_missed_on_the_boundary_of_a_patch():
    class Broken(KinematicLinear):
        shape, rule = derived(Hexahedron8, faces=Hexahedron8.faces[:5]), hexahedron(3)

    found = failed(check_element(Broken))
    assert set(found) == {"faces", "shared faces"}
    assert found["shared faces"].detail.startswith("the boundary of a 2x1x1 box has the area 8 (10)")


def test_an_error_inside_the_library_shows_the_line_that_led_to_it():
    class Broken(KinematicLinear3D8N):
        def B(self, xi):
            return KinematicLinear3D8N(self.X[:7]).B(xi)

    detail = failed(check_element(Broken))["strain operator"].detail
    line = Broken.B.__code__.co_firstlineno + 1
    assert detail.startswith(
        "raises MeshError: nodes X of a KinematicLinear3D8N must have shape (..., 8, 3); got (7, 3) at"
    )
    assert detail.endswith(f"test_broken.py:{line}")


def test_an_unsymmetric_stiffness_is_found():
    class Broken(ChangedStiffness):
        def change(self, K):
            K = K.copy()
            K[..., 0, 4] *= 1 + 1e-9
            return K

    assert "symmetry" in failed(check_element(Broken))


def test_a_batch_that_mixes_its_cells_is_found():
    class Broken(ChangedStiffness):
        def change(self, K):
            return K[::-1] if K.ndim == 3 else K

    assert "gives other values for many elements" in failed(check_element(Broken))["stiffness"].detail


def test_loads_that_are_wrong_are_found():
    base = KinematicLinear3D8N
    broken = damaged(
        base,
        body_force=lambda self, b: base.body_force(self, b)[..., ::-1],
        internal_force=lambda self, stress, C=None: -base.internal_force(self, stress, C),
    )
    assert {"body force", "internal force"} <= set(failed(check_element(broken)))


def test_an_exception_in_an_element_is_a_finding():
    class Broken(KinematicLinear3D8N):
        def local_system(self, C, u):
            raise RuntimeError("not written yet")

    findings = check_element(Broken)
    assert list(failed(findings)) == ["stiffness"]
    assert "raises RuntimeError: not written yet at test_broken.py:" in failed(findings)["stiffness"].detail
    assert not_run(findings)["rank"] == "stops at the same error as 'stiffness'"


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
    texts = [str(finding) for finding in check_element(KinematicLinear3D20N) if finding.passed]
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


def test_the_material_that_is_broken_below_conforms_before():
    assert not failures(check_material(Made()))


@pytest.mark.parametrize(
    ("methods", "checks"),
    [
        ({"elasticity": lambda self: C_with(0, 1, 1e8)}, {"symmetry", "isotropy"}),
        ({"elasticity": lambda self: C_with(3, 3, 1e8)}, {"isotropy"}),
        ({"elasticity": lambda self: C_with(3, 3, -1e8)}, {"positive definite", "isotropy"}),
        ({"elasticity": lambda self: -Made().elasticity()}, {"positive definite"}),
        ({"elasticity": lambda self: 0 * Made().elasticity()}, {"positive definite"}),
        ({"stress": lambda self, e: np.asarray(e) @ self.C * 1.001}, {"tangent"}),
        ({"stress": lambda self, e: np.asarray(e) @ self.C + 1e3}, {"stress at rest", "isotropy"}),
        ({"stress": lambda self, e: self.C @ np.asarray(e)}, {"broadcasting"}),
        ({"stress": lambda self, e: np.asarray(e) @ self.C[:, [0, 1, 2, 3, 5, 4]]}, {"tangent", "isotropy"}),
        ({"density": property(lambda self: -1.0), "__init__": lambda self: None}, {"density"}),
    ],
)
def test_broken_materials_are_found(methods, checks):
    assert set(failed(check_material(changed(**methods)))) == checks


def test_a_C_of_the_wrong_size_is_a_finding():
    found = failed(check_material(changed(elasticity=lambda self: np.eye(3))))
    assert found["symmetry"].detail == "raises C must be (6, 6) and finite; its shape is (3, 3)"

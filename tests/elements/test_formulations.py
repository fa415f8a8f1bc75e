"""Which element class a word means for a shape, and which one does not lock with a material."""

from typing import ClassVar

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.elements.formulations import bulk_over_shear, element_of, formulations_of
from kratos_lite.elements.kinematic_linear import ELEMENTS
from kratos_lite.shapes.hexahedra import Hexahedron8, Hexahedron20
from kratos_lite.shapes.tetrahedra import Tetrahedron4
from kratos_lite.shapes.wedges import Wedge15

STEEL, RUBBER = kl.Isotropic3D(E=210e9, nu=0.3), kl.Isotropic3D(E=1e6, nu=0.499)


def test_formulations_of_a_shape_are_those_of_the_registry():
    words = {word: kind.__name__ for word, kind in formulations_of(Hexahedron8).items()}
    assert words == {
        "total_lagrangian": "TotalLagrangianElement3D8N",
        "f_bar": "FBar3D8N",
        "standard": "KinematicLinear3D8N",
        "enhanced": "EnhancedStrain3D8N",
        "b_bar": "BBar3D8N",
    }
    assert set(formulations_of(Hexahedron20)) == {"total_lagrangian", "standard", "b_bar", "reduced"}
    assert set(formulations_of(Wedge15)) == {"total_lagrangian", "standard", "b_bar"}
    assert list(formulations_of(Tetrahedron4)) == ["total_lagrangian", "standard"]


@pytest.mark.parametrize(
    ("nodes", "compressible", "incompressible"),
    [
        (4, "KinematicLinear", "KinematicLinear"),
        (5, "KinematicLinear", "KinematicLinear"),
        (6, "KinematicLinear", "KinematicLinear"),
        (8, "EnhancedStrain", "EnhancedStrain"),
        *((n, "KinematicLinear", "BBar") for n in (10, 13, 15, 20, 27)),
    ],
)
def test_the_element_that_does_not_lock_depends_on_shape_and_material(nodes, compressible, incompressible):
    for material, family in ((STEEL, compressible), (RUBBER, incompressible)):
        found = element_of(f"Element3D{nodes}N", None, material.C)
        assert found.__name__ == f"{family}3D{nodes}N"
        assert element_of(f"KinematicLinear3D{nodes}N", "non_locking", material.C) is found


def test_names_of_elements_hold_without_a_word():
    for name in ("KinematicLinear3D8N", "SmallDisplacementElement3D8N", "BBar3D20N", "Reduced3D20N"):
        assert element_of(name, None, RUBBER.C) is ELEMENTS[name]


def test_bulk_over_shear_modulus_of_isotropic_materials_is_that_of_the_textbook():
    for nu in (0.0, 0.2, 0.45, 0.4999):
        exact = 2 * (1 + nu) / (3 * (1 - 2 * nu))
        assert abs(bulk_over_shear(kl.Isotropic3D(E=3.0, nu=nu).C) / exact - 1) < 1e-9


def test_a_material_stiff_along_fibers_alone_is_not_nearly_incompressible():
    S = np.diag([1 / 300e9, 1 / 8e9, 1 / 8e9, 1 / 3e9, 1 / 3e9, 1 / 3e9])
    C = np.linalg.inv(S)
    assert C[:3, :3].sum() / 9 / 3e9 > 9.7  # it would be by the mean of C alone
    assert element_of("Element3D20N", None, C).__name__ == "KinematicLinear3D20N"


def test_elements_of_users_are_never_replaced():
    with ELEMENTS.temporary():

        class Mine3D8N(kl.KinematicLinear3D8N):
            aliases: ClassVar = ("Yours3D8N",)

        mesh = kl.box(element="Mine3D8N")
        for word in (None, "enhanced", "non_locking", "b_bar"):
            groups = kl.Model(mesh, STEEL, formulation=word).element_groups()
            assert [group.element for group in groups] == [Mine3D8N]
        assert element_of("Yours3D8N", "enhanced", STEEL.C) is Mine3D8N
        assert element_of("KinematicLinear3D8N", "standard", STEEL.C) is kl.KinematicLinear3D8N


def test_a_formulation_of_a_user_is_a_word_like_others():
    with ELEMENTS.temporary():

        class Mine3D4N(kl.KinematicLinear3D4N):
            formulation = "mine"

        groups = kl.Model(kl.box(element="KinematicLinear3D4N"), STEEL, formulation="mine").element_groups()
        assert groups[0].element is Mine3D4N


@pytest.mark.parametrize("name", list(ELEMENTS))
def test_strain_at_points_is_that_of_b(name):
    """Of several elements with several rows of points, and of an element with one."""
    kind, rng = ELEMENTS[name], np.random.default_rng(7)
    X = kind.nodes + 0.05 * rng.random((3, *kind.nodes.shape))
    u, xi, C = rng.random(X.shape), 0.3 * rng.random((2, 5, 3)), kl.Isotropic3D(E=1.0, nu=0.4999).C
    many, one = kind(X), kind(X[0])
    wanted = np.einsum("epqij,ej->epqi", many.B(xi, C), u.reshape(3, -1))
    np.testing.assert_allclose(many.strain_at(xi, u, C), wanted, rtol=0, atol=1e-14)
    np.testing.assert_allclose(one.strain_at(xi[1, 2], u[0], C), wanted[0, 1, 2], rtol=0, atol=1e-14)

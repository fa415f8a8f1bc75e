"""Everything that is registered passes the conformance kit."""

import sys

import numpy as np
import pytest

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import InputError
from kratos_lite.materials import MATERIALS
from kratos_lite.materials.anisotropic3d import Anisotropic3D
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.materials.orthotropic3d import Orthotropic3D
from kratos_lite.quadrature import CELLS, rule_for
from kratos_lite.shapes import SHAPES
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.testing import (
    assert_conforms,
    check,
    check_element,
    check_material,
    check_rule,
    check_shape,
    failures,
    report,
)
from tests.materials.test_laws import BY_STEPS, LAWS

ORTHOTROPIC = Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.45, 0.31, 0.37, 0.7e9, 0.05e9, 0.65e9, 450.0)
MATERIALS_TO_CHECK = [
    Isotropic3D(E=210e9, nu=0.3, density=7850.0),
    Isotropic3D(E=1.0, nu=0.0),
    Isotropic3D(E=10.0, nu=-0.9),
    Isotropic3D(E=1e12, nu=0.4999),
    ORTHOTROPIC,
    Orthotropic3D(1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
    Anisotropic3D(ORTHOTROPIC.C, 450.0).turned(np.linalg.qr(np.vander([1.0, 2.0, 3.0]))[0]),
    *(law for law, _ in LAWS),
]
LINEAR = {name for name in ELEMENTS if name.endswith(("3D4N", "3D5N", "3D6N", "3D8N"))}
OWN_STRAIN = {name for name in ELEMENTS if name.startswith(("BBar", "Enhanced", "FBar"))}


def show(name, findings):
    assert not failures(findings), report(name, findings)


def skipped(findings):
    return {finding.check for finding in findings if finding.skipped}


@pytest.mark.parametrize("law", [law for law, _ in BY_STEPS], ids=lambda law: type(law).__name__)
def test_a_law_with_steps_of_kratos_conforms_but_for_its_steps(law):
    assert {found.check for found in failures(check_material(law))} <= {"one step or two", "staying"}


@pytest.mark.parametrize("name", list(SHAPES))
def test_each_shape_conforms(name):
    show(name, check_shape(SHAPES[name]))


@pytest.mark.parametrize("degree", [*range(10), 13, 16, 19])
@pytest.mark.parametrize("cell", list(CELLS))
def test_each_rule_has_the_degree_that_it_claims(cell, degree):
    rule = rule_for(cell, degree)
    assert rule.degree >= degree
    findings = check_rule(cell, rule)
    assert len(findings) == 4
    assert not skipped(findings)
    show(repr(rule), findings)


@pytest.mark.parametrize("name", list(ELEMENTS))
def test_each_element_conforms(name):
    findings = check_element(ELEMENTS[name])
    show(name, findings)
    expected = {"mid edges"} if name in LINEAR else set()
    assert skipped(findings) == expected | ({"quadratic patch"} if name in LINEAR | OWN_STRAIN else set())


def test_each_element_and_shape_is_registered():
    assert len(ELEMENTS.values()) == 27
    assert len(SHAPES.values()) == 17


@pytest.mark.parametrize("material", MATERIALS_TO_CHECK, ids=lambda material: type(material).__name__)
def test_each_material_conforms(material):
    findings = check_material(material)
    show(f"{material}", findings)
    if material.is_linear:
        expected = set() if isinstance(material, Isotropic3D) else {"isotropy"}
    else:
        expected = set() if "plastic_strain" in material.internal_variables else {"elastic strain"}
        expected |= set() if material.symmetric_tangent else {"symmetric tangent"}
        expected |= {"staying", "one step or two"} if material.rate_dependent else set()
    assert skipped(findings) == expected


def test_each_material_is_checked():
    package = {name: vars(module) for name, module in sys.modules.items() if name.startswith("kratos_lite.")}
    shipped = {law for law in MATERIALS.values() if law is package.get(law.__module__, {}).get(law.__name__)}
    assert {type(law) for law in (*MATERIALS_TO_CHECK, *(law for law, _ in BY_STEPS))} == shipped


@pytest.mark.parametrize("subject", [ELEMENTS["KinematicLinear3D4N"], Hexahedron8, ORTHOTROPIC, LAWS[0][0]])
def test_assert_conforms_takes_elements_shapes_and_materials(subject):
    assert_conforms(subject)
    name, findings = check(subject)
    count = sum(not finding.skipped for finding in findings)
    assert report(name, findings).startswith(f"{name} conforms: {count} checks passed")


@pytest.mark.parametrize("subject", [Isotropic3D, rule_for("line", 3), "KinematicLinear3D8N", None])
def test_assert_conforms_refuses_anything_else(subject):
    with pytest.raises(InputError, match="an element class, a shape class or a material instance; got"):
        assert_conforms(subject)

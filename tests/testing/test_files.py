"""Checking the file of a student: what is found in it, and what is said about a file that does not run."""

import re

import pytest

from kratos_lite.elements import ELEMENTS, kinematic_linear_3d6n
from kratos_lite.errors import InputError
from kratos_lite.materials import MATERIALS
from kratos_lite.shapes import SHAPES
from kratos_lite.testing import failures, run_file

SHAPE = '''
"""A tetrahedron of one's own."""
from __future__ import annotations
import numpy as np
from kratos_lite.elements import KinematicLinear
from kratos_lite.quadrature import tetrahedron
from kratos_lite.shapes import Shape


class MyTetrahedron(Shape):
    """Four nodes."""
    cell, corners, degree = "tetrahedron", 4, 1
    nodes = np.vstack([np.zeros(3), np.eye(3)])
    edges = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
    faces = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
    vtk = 10

    @staticmethod
    def N(xi):
        xi = np.asarray(xi, float)
        return np.concatenate([1 - xi.sum(axis=-1, keepdims=True), xi], axis=-1)

    @staticmethod
    def dN(xi):
        slopes = np.vstack([-np.ones(3), np.eye(3)])
        return np.broadcast_to(slopes, (*np.shape(xi)[:-1], 4, 3))
'''
ELEMENT = (
    SHAPE
    + '''

class MyElement(KinematicLinear):
    """An element of it."""
    shape = MyTetrahedron
    rule = tetrahedron(degree=2)
'''
)

LAW = '''
"""Transversely isotropic elasticity."""
from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from kratos_lite.materials import LinearMaterial


@dataclass(frozen=True)
class Transverse(LinearMaterial):
    E_p: float
    E_z: float
    nu_p: float
    nu_zp: float
    G_z: float
    density: float = 0.0

    def compliance(self):
        S = np.diag([1/self.E_p, 1/self.E_p, 1/self.E_z, 2*(1+self.nu_p)/self.E_p, 1/self.G_z, 1/self.G_z])
        S[0, 1] = S[1, 0] = -self.nu_p / self.E_p
        S[:2, 2] = S[2, :2] = -self.nu_zp / self.E_z
        return S
'''


STEEL = '''
"""Perfect plasticity."""
from dataclasses import dataclass
import numpy as np
import kratos_lite as kl


@dataclass(frozen=True)
class Perfect(kl.Material):
    E: float
    nu: float
    yield_stress: float
    density: float = 0.0

    internal_variables = {"plastic_strain": 6}

    def response(self, strain, state, dt):
        elastic = kl.Isotropic3D(self.E, self.nu)
        stress = (strain - state["plastic_strain"]) @ elastic.C
        s = stress.copy()
        s[..., :3] -= stress[..., :3].mean(axis=-1, keepdims=True)
        q = np.sqrt(1.5 * (s**2 @ [1, 1, 1, 2, 2, 2]))
        excess = np.maximum(1 - self.yield_stress / np.maximum(q, 1.0), 0.0)[..., None]
        flow = excess * s / (2 * elastic.lame[1])
        new = state["plastic_strain"] + flow * [1, 1, 1, 2, 2, 2]
        return stress - excess * s, None, {"plastic_strain": new}


steel = Perfect(E=200e9, nu=0.3, yield_stress=250e6)
'''


@pytest.fixture
def checked(tmp_path):
    def run(text, name="mine.py"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return run_file(path)

    return run


def test_an_element_is_checked_with_its_shape_and_forgotten(checked):
    before = [list(registry) for registry in (ELEMENTS, SHAPES, MATERIALS)]
    ((name, findings),) = checked(ELEMENT)
    assert name == "MyElement"
    assert not failures(findings)
    assert len(findings) == 34
    assert [list(registry) for registry in (ELEMENTS, SHAPES, MATERIALS)] == before


def test_a_file_that_reuses_a_name_of_the_library_does_not_replace_it(checked):
    shipped = ELEMENTS["KinematicLinear3D6N"]
    match = r"two classes of the element KinematicLinear3D6N: .*kinematic_linear_3d6n\.py, one in .*mine\.py"
    with pytest.raises(InputError, match=match):
        checked(ELEMENT.replace("MyElement", "KinematicLinear3D6N"))
    assert ELEMENTS["KinematicLinear3D6N"] is shipped
    assert ELEMENTS["SmallDisplacementElement3D6N"] is shipped


def test_a_wrong_sign_in_the_file_is_named(checked):
    ((_, findings),) = checked(ELEMENT.replace("np.eye(3)])\n        return", "-np.eye(3)])\n        return"))
    assert "dN[3] / d t at xi = (" in {f.check: f for f in failures(findings)}["derivatives"].detail


def test_an_error_in_a_function_is_named_with_the_line_of_the_file(checked):
    text = ELEMENT.replace("broadcast_to(slopes", "broadcast_to(slope")
    ((_, findings),) = checked(text)
    line = 1 + text[: text.index("(slope,")].count("\n")
    detail = {f.check: f for f in failures(findings)}["derivatives"].detail
    assert detail == f"raises NameError: name 'slope' is not defined at mine.py:{line}"


def test_a_shape_alone_and_an_element_with_another_rule_are_checked(checked):
    text = "import kratos_lite as kl\nclass Reduced(kl.KinematicLinear3D20N):\n"
    found = dict(checked(f"{SHAPE}{text}    rule = kl.quadrature.hexahedron(3)\n"))
    assert list(found) == ["Reduced", "MyTetrahedron"]
    assert {f.check for f in failures(found["Reduced"])} == {"rank", "bending"}
    assert not failures(found["MyTetrahedron"])


@pytest.mark.parametrize(
    ("text", "name", "count"),
    [
        (LAW + "\nslate = Transverse(9e9, 5e9, 0.2, 0.15, 2e9)\n", "slate (Transverse)", 5),
        (STEEL, "steel (Perfect)", 13),
    ],
    ids=["linear", "not linear"],
)
def test_a_material_is_checked_as_the_instance_that_the_file_makes(checked, text, name, count):
    ((named, findings),) = checked(text)
    assert (named, len(findings)) == (name, count)
    assert not failures(findings)
    assert [f.check for f in findings if f.skipped] == ["isotropy"]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (".mean(axis=-1, keepdims=True)", ".mean()", r"use \[\.\.\., i\] for components"),
        ("new = state", "new = state['plastic_strain']; new +=  0 * state", "state in place"),
        ("excess = np", "if q < 1:\n            return 0\n        excess = np", r"mine.py:\d+; .* np\.where"),
        (
            '    internal_variables = {"plastic_strain": 6}\n',
            "",
            "'plastic_strain', which .* declared are none; add it to internal_variables",
        ),
        ("state, dt)", "state)", r"were given; a law has response\(self, strain, state, dt\)"),
        (
            '(strain - state["plastic_strain"]) @ elastic.C',
            "elastic.C @ strain",
            r"mine.py:\d+; .* strain @ C$",
        ),
        (', {"plastic_strain": new}', "", "got 2 values$"),
        ("return stress - excess * s", "return stress * (1 - excess)", "is a factor 2 of shear missing"),
    ],
)
def test_a_law_with_a_mistake_is_told_the_cure(checked, old, new, says):
    ((_, findings),) = checked(STEEL.replace(old, new))
    assert re.search(says, failures(findings)[0].detail)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('{"plastic_strain": 6}', '{"plastic_strain"}', "name → numbers at each Gauss point"),
        ("    density: float = 0.0\n", "", "add density: float = 0.0 to its constants"),
        ("internal_variables =", "internal_variables: dict =", "write it without a type"),
    ],
)
def test_a_law_that_cannot_be_made_is_told_the_cure(checked, old, new, says):
    with pytest.raises(InputError, match=says):
        checked(STEEL.replace(old, new))


def test_a_material_without_an_instance_says_how_to_make_one(checked):
    ((name, (finding,)),) = checked(LAW)
    assert name == "Transverse"
    assert not finding.passed
    assert not finding.passed
    assert "soil = Transverse(" in finding.detail


def test_a_file_of_the_library_itself_may_have_its_names():
    ((name, findings),) = run_file(kinematic_linear_3d6n.__file__)
    assert name == "KinematicLinear3D6N"
    assert not failures(findings)


def test_a_class_without_its_base_is_named(checked):
    found = dict(checked(LAW.replace("(LinearMaterial)", "")))
    (finding,) = failures(found["Transverse"])
    assert str(finding) == (
        "base class: Transverse has compliance but is no LinearMaterial, so nothing uses it: "
        "write class Transverse(LinearMaterial)"
    )


def test_a_material_that_is_no_dataclass_is_named_with_and_without_an_instance(checked):
    bare = LAW.replace("@dataclass(frozen=True)\n", "")
    (finding,) = failures(dict(checked(bare))["Transverse"])
    assert finding.detail == "Transverse lists constants: add @dataclass(frozen=True) above it"
    with pytest.raises(InputError, match=r"takes no arguments; add @dataclass\(frozen=True\) above class Tr"):
        checked(bare + "\nslate = Transverse(9e9, 5e9, 0.2, 0.15, 2e9)\n")


def test_a_shape_without_its_vtk_number_is_told_the_number_and_checked_all_the_same(checked):
    ((_, findings),) = checked(ELEMENT.replace("    vtk = 10\n", ""))
    (finding,) = failures(findings)
    assert finding.check == "definition"
    assert "write vtk = 10 in the shape" in finding.detail
    assert len(findings) == 34


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = (1\n", r"mine\.py:1:5: not valid Python: '\(' was never closed"),
        ("a = 1\nb = nothing\n", r"mine\.py:2: the file stops with NameError: name 'nothing' is not defined"),
        ("import no_such_module_here\n", r"mine\.py:1: the file stops with ModuleNotFoundError"),
        ("import sys\nsys.exit(3)\n", r"mine\.py:2: the file stops with SystemExit: 3"),
        (
            "def f():\n    g()\ndef g():\n    1 / 0\nf()\n",
            r"mine\.py:4: the file stops with ZeroDivisionError",
        ),
        (
            "from kratos_lite import Isotropic3D\n\nx = Isotropic3D(E=1.0, nu=0.5)\n",
            r"mine\.py:3: the .*nu .* must be < 0.5",
        ),
        ("", r"mine\.py: nothing to check; a file defines a subclass of KinematicLinear, Shape or"),
        ("from kratos_lite import KinematicLinear3D8N\n", r"mine\.py: nothing to check"),
    ],
)
def test_a_file_that_does_not_run_or_has_nothing_to_check_is_one_clear_error(checked, text, message):
    with pytest.raises(InputError, match=message):
        checked(text)


def test_a_file_that_is_missing_or_not_text_is_one_clear_error(tmp_path):
    with pytest.raises(InputError, match=r"none\.py: there is no such file"):
        run_file(tmp_path / "none.py")
    with pytest.raises(InputError, match="cannot be read"):
        run_file(tmp_path)
    (tmp_path / "bytes.py").write_bytes(b"\x00\xff\xfe")
    with pytest.raises(InputError, match=r"bytes\.py.*not valid Python"):
        run_file(tmp_path / "bytes.py")

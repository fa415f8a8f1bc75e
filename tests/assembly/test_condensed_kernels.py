"""Kernels of elements that do not lock: thin cells, other rules, materials at the limit, own classes."""

import numpy as np
import pytest
from computing import compiled, same_on_all_threads
from rounding import all_close

from kratos_lite.assembly import element_groups, nodal_values
from kratos_lite.assembly import gauss_point_fields as fields
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.enhanced_strain_3d8n import EnhancedStrain3D8N
from kratos_lite.errors import InputError, MaterialError
from kratos_lite.materials import LinearMaterial
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.quadrature import Rule, hexahedron


def of_elasticity(C):
    """Return a material of any C."""
    return type("Any", (), {"C": C, "stress": LinearMaterial.stress})()


NAMES = [name for name in sorted(ELEMENTS) if ELEMENTS[name].formulation in ("enhanced", "b_bar")]
STEEL, RUBBER = Isotropic3D(210e9, 0.3), Isotropic3D(1e6, 0.4999)
A = np.random.default_rng(8).standard_normal((6, 6))
CRYSTAL = of_elasticity((A @ A.T + 6 * np.eye(6)) * 1e9)
pytestmark = compiled


def group_of(element, material=STEEL, sizes=(1.0, 1.0, 1.0), distortion=0.03, rule=None, count=11):
    """Return points and a group of cells apart from each other, turned and distorted, with prestress."""
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    cells = element.nodes + distortion * rng.uniform(-1, 1, (count, *element.nodes.shape))
    points = (cells * sizes @ turn + rng.uniform(-1, 1, (count, 1, 3))).reshape(-1, 3)
    nodes = np.arange(len(points), dtype=np.int32).reshape(count, -1)
    prestress = rng.standard_normal((count, 6)) * 0.1 * np.abs(material.C).max()
    return points, ElementGroup(element, rule or element.rule, material, nodes, np.arange(count), prestress)


def everything(points, group):
    """Return what kernels compute of a group with random displacements, by name."""
    u = np.random.default_rng(1).uniform(-1, 1, points.shape)
    found = {f"stress {s}": fields.at_gauss(points, group, u, stress=s) for s in (True, False)}
    for s in (True, False):
        means, nodal = nodal_values.averages(points, [group], u, len(group), stress=s)
        found |= {f"means {s}": means, f"nodal {s}": nodal}
    energy, mises, _ = fields.totals(points, [group], u)
    found |= {"energy": np.array(energy), "mises": np.array(mises)}
    found["load"] = fields.internal_load(points, [group], u)
    found["K"] = assemble_stiffness(points, [group], Pattern(len(points), [group.nodes])).data
    return found


def assert_same(points, group, monkeypatch, tolerance=1e-11):
    """Assert that kernels and NumPy give the same."""
    found = everything(points, group)
    with monkeypatch.context() as without:
        without.setattr(element_groups, "kernels", lambda name: None)
        wanted = everything(points, group)
    all_close(found, wanted, tolerance)


@pytest.mark.parametrize("material", [STEEL, RUBBER, CRYSTAL], ids=["isotropic", "incompressible", "general"])
@pytest.mark.parametrize("distortion", [0.0, 0.03], ids=["affine", "distorted"])
@pytest.mark.parametrize("name", NAMES)
def test_kernels_give_what_the_classes_give(name, distortion, material, monkeypatch):
    assert_same(*group_of(ELEMENTS[name], material, distortion=distortion), monkeypatch)


@pytest.mark.parametrize("name", NAMES)
def test_thin_cells(name, monkeypatch):
    points, group = group_of(ELEMENTS[name], CRYSTAL, (1.0, 1.0, 1e-4), distortion=0.0)
    assert_same(points, group, monkeypatch, 1e-8)  # a thickness of 1e-4 has twelve digits


@pytest.mark.parametrize("distortion", [0.0, 0.03], ids=["affine", "distorted"])
@pytest.mark.parametrize("skew", [False, True], ids=["degree 5", "skew"])
def test_enhanced_modes_take_other_rules(skew, distortion, monkeypatch):
    rule = hexahedron(degree=5)
    if skew:  # the mean of ξηζ is not 0
        corners = 0.5 * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
        points = np.vstack([hexahedron(degree=3).points, corners])
        rule = Rule(points, np.repeat([0.75, 0.5], [8, 4]), 1, "skew")
    assert_same(*group_of(EnhancedStrain3D8N, STEEL, distortion=distortion, rule=rule), monkeypatch)


@pytest.mark.parametrize("name", ["EnhancedStrain3D8N", "BBar3D10N", "BBar3D27N"])
def test_results_do_not_depend_on_the_number_of_threads(name):
    points, group = group_of(ELEMENTS[name], CRYSTAL, count=700)
    same_on_all_threads(lambda: everything(points, group), (1, 2))


@pytest.mark.parametrize("name", ["EnhancedStrain3D8N", "BBar3D27N", "BBar3D10N"])
def test_a_class_with_a_B_of_its_own_is_computed_by_it(name):
    base = ELEMENTS[name]
    with ELEMENTS.temporary():
        own = type("Own", (base,), {"B": lambda self, xi, C: 0.5 * base.B(self, xi, C)})
        points, group = group_of(own)
        found, plain = everything(points, group), everything(*group_of(base))
        all_close(
            {"strain": found["stress False"], "K": found["K"]},
            {"strain": plain["stress False"] / 2, "K": plain["K"] / 4},
            1e-11,
        )


def test_what_enhanced_modes_cannot_take_is_refused():
    points, group = group_of(EnhancedStrain3D8N)
    u = np.zeros_like(points)
    group.rule = hexahedron(degree=1)
    with pytest.raises(InputError, match="2x2x2 points or more"):
        fields.at_gauss(points, group, u)
    group.rule = EnhancedStrain3D8N.rule
    group.material = of_elasticity(np.diag([1.0, 1, 1, 1, 1, -1]))
    with pytest.raises(MaterialError, match="positive definite; got C with the eigenvalues -1 … 1 Pa"):
        assemble_stiffness(points, [group], Pattern(len(points), [group.nodes]))

"""Assembly: both paths, compiled and NumPy, against the sum of full element matrices."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from computing import EITHER, compiled, same, same_on_all_threads
from own_elements import tetrahedron_of_seven_nodes
from rounding import close
from systems import pattern_of, stiffness_of

import kratos_lite as kl
from kratos_lite.assembly import element_groups, sparsity_pattern
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_dense, assemble_stiffness
from kratos_lite.native import kernels

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
WOOD = kl.Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.4, 0.3, 0.4, 0.7e9, 0.05e9, 0.6e9, 450.0)
ROOT = np.random.default_rng(3).standard_normal((6, 6))
CRYSTAL = SimpleNamespace(C=ROOT @ ROOT.T + np.eye(6))
"""A material without any symmetry."""
NAMES = [name for name in sorted(kl.ELEMENTS) if kl.ELEMENTS[name].formulation != "f_bar"]
"""Those that take linear laws."""
MODULE = kernels("stiffness")


@pytest.fixture(params=EITHER)
def path(request, monkeypatch):
    """Run a test on both paths."""
    if request.param == "numpy":
        for module in (element_groups, sparsity_pattern):
            monkeypatch.setattr(module, "kernels", lambda name: None)
    return request.param


def scene(name, cells=(3, 2, 2), distortion=0.0, material=STEEL):
    """Return points and groups of a skewed box whose nodes are moved at random."""
    mesh = kl.box((1.0, 1.5, 0.8), cells=cells, element=name)
    points = mesh.points @ np.array([[1.0, 0.2, 0.0], [0.0, 1.1, 0.3], [0.1, 0.0, 0.9]])
    points = points + distortion * np.random.default_rng(4).uniform(-1, 1, points.shape)
    return points, [replace(group, material=material) for group in kl.Model(mesh, STEEL).element_groups()]


def assert_sum(points, groups, tolerance=1e-13):
    """Assert that the sparse matrix is the dense one, and return it."""
    K = stiffness_of(points, groups)
    close(K.scipy().toarray(), assemble_dense(points, groups), tolerance)
    return K


# ---- pattern ---------------------------------------------------------------------------------


@compiled
@pytest.mark.parametrize("name", NAMES)
def test_compiled_pattern_is_that_of_scipy(name):
    points, groups = scene(name)
    arguments = len(points), [group.nodes for group in groups]
    compiled = MODULE.pattern(*arguments)
    assert [array.dtype for array in compiled] == [np.int32, np.int32]
    same(compiled, tuple(sparsity_pattern._pattern(*arguments)))


@compiled
def test_compiled_pattern_of_scattered_nodes_in_several_groups():
    rng = np.random.default_rng(5)
    n = 20_000
    nodes = [np.array([rng.choice(n, k, replace=False) for _ in range(300)], np.int32) for k in (4, 7, 20)]
    nodes.append(np.empty((0, 8), np.int32))
    want = sparsity_pattern._pattern(n, nodes)
    assert (np.diff(want[0]) == 0).any()
    same(MODULE.pattern(n, nodes), tuple(want))
    same_on_all_threads(lambda: MODULE.pattern(n, nodes))


@compiled
@pytest.mark.parametrize("wrong", [-1, 10])
def test_nodes_that_are_not_there_are_refused(wrong):
    with pytest.raises(ValueError, match="names a node that is not there"):
        MODULE.pattern(10, [np.array([[0, 1, 2, wrong]], np.int32)])


# ---- stiffness -------------------------------------------------------------------------------


@pytest.mark.parametrize("material", [STEEL, WOOD, CRYSTAL], ids=["isotropic", "orthotropic", "general"])
@pytest.mark.parametrize("distortion", [0.0, 0.02], ids=["straight", "distorted"])
@pytest.mark.parametrize("name", NAMES)
def test_stiffness_is_the_sum_of_the_elements(path, name, distortion, material):
    assert_sum(*scene(name, (2, 2, 1), distortion, material))


@pytest.mark.parametrize("count", [1, 7, 8, 9, 17])
def test_any_number_of_elements(path, count):
    points, (group,) = scene("KinematicLinear3D8N", (3, 3, 2), 0.02)
    part = ElementGroup(group.element, group.rule, STEEL, group.nodes[:count], group.rows[:count])
    K = assert_sum(points, [part])
    assert (np.diff(K.indptr) == 0).sum() == len(points) - len(np.unique(part.nodes))


def test_several_shapes_rules_and_materials(path):
    points, (bricks,) = scene("KinematicLinear3D8N", (4, 2, 2), 0.02)
    tetrahedra = bricks.nodes[5:9][:, [0, 1, 3, 4]]
    wedges = bricks.nodes[9:][:, [0, 1, 3, 4, 5, 7]]
    reduced = kl.quadrature.hexahedron(degree=1)
    four, six = (kl.ELEMENTS[f"KinematicLinear3D{k}N"] for k in (4, 6))
    table = (
        (bricks.element, bricks.rule, STEEL, bricks.nodes[:3]),
        (bricks.element, reduced, WOOD, bricks.nodes[3:5]),
        (four, four.rule, WOOD, tetrahedra),
        (six, six.rule, STEEL, wedges),
    )
    assert_sum(points, [ElementGroup(*parts, np.arange(len(parts[-1]))) for parts in table])


def test_an_element_of_a_user_with_seven_nodes(path):
    with tetrahedron_of_seven_nodes() as element:
        points, (tens,) = scene("KinematicLinear3D10N", (2, 2, 1), 0.01)
        group = ElementGroup(element, element.rule, STEEL, tens.nodes[:, :7], tens.rows)
        assert not element.custom
        assert_sum(points, [group])


@compiled
@pytest.mark.parametrize("order", ["given", "scattered"])
@pytest.mark.parametrize(
    ("name", "cells"), [("KinematicLinear3D8N", (23, 5, 3)), ("KinematicLinear3D10N", (7, 3, 3))]
)
def test_stiffness_does_not_depend_on_the_number_of_threads(name, cells, order):
    points, (group,) = scene(name, cells, 0.01)
    if order == "scattered":
        group.nodes = group.nodes[np.random.default_rng(6).permutation(len(group))]
    pattern = pattern_of(points, [group])
    same_on_all_threads(lambda: assemble_stiffness(points, [group], pattern).data)


@compiled
def test_a_pattern_of_another_mesh_is_refused():
    points, (group,) = scene("KinematicLinear3D8N")
    other = Pattern(len(points), [group.nodes[:4]])
    other.connectivity = [np.ascontiguousarray(group.nodes)]
    with pytest.raises(ValueError, match="misses nodes that share an element"):
        assemble_stiffness(points, [group], other)

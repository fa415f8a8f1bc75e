"""Fields at Gauss points: the compiled way and the element's own methods give the same."""

import numpy as np
import pytest
from computing import compiled, same_on_all_threads
from meshes import NAMES, changed_at, joined, with_block
from rounding import all_close, close
from systems import stiffness_of

import kratos_lite as kl
from kratos_lite.assembly import element_groups, mass_and_convection, nodal_extrapolation
from kratos_lite.assembly import gauss_point_fields as fields
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.model import checks
from kratos_lite.quadrature import Rule, hexahedron

CONDENSED = [name for name in sorted(kl.ELEMENTS) if kl.ELEMENTS[name].formulation in ("enhanced", "b_bar")]
WOOD = kl.Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.4, 0.3, 0.4, 0.7e9, 0.05e9, 0.7e9, 450.0)
SOIL = kl.Isotropic3D(210e6, 0.3, 7620.0)


@pytest.fixture
def numpy_only(monkeypatch):
    """Leave the kernels aside from the moment that the returned function is called."""
    return lambda: monkeypatch.setattr(element_groups, "kernels", lambda name: None)


def distorted(name, cells=(3, 2, 2)):
    """Return a box of elements whose nodes are moved by a tenth of a cell at most."""
    mesh = kl.box(size=(3.0, 2.0, 2.0), cells=cells, element=name)
    shift = np.random.default_rng(len(name)).uniform(-0.05, 0.05, mesh.points.shape)
    mesh = mesh.replace(points=mesh.points + shift * (3.0 / cells[0]))
    return mesh


def strained(mesh, seed=3):
    """Return groups with two materials and prestress, and displacements of a size of 1e-3."""
    rng = np.random.default_rng(seed)
    model = kl.Model(mesh, SOIL)
    model.assign(WOOD, np.arange(0, mesh.n_elements, 3))
    model.add_prestress(rng.standard_normal((mesh.n_elements, 6)) * 1e6)
    return model.element_groups(), 1e-3 * rng.standard_normal(mesh.points.shape)


def everything(points, groups, u):
    """Return all that the module computes of groups, and their stiffness, by name."""
    found, m = {}, sum(map(len, groups))
    for i, group in enumerate(groups):
        found[f"volumes {i}"] = fields.volumes(points, group)
        found[f"stress {i}"] = fields.at_gauss(points, group, u)
        found[f"strain {i}"] = fields.at_gauss(points, group, u, stress=False)
    found["internal load"] = fields.internal_load(points, groups, u)
    for what in (True, False):
        means, nodal = nodal_extrapolation.averages(
            points, groups, u, m, what, nodal_extrapolation.extrapolation
        )
        found |= {f"means {what}": means, f"nodal {what}": nodal}
    for name, value in zip(("energy", "mises", "row"), fields.totals(points, groups, u), strict=True):
        found[name] = np.array(value)
    found["K"] = stiffness_of(points, groups).data
    return found


def of_mesh(mesh):
    """Return all that is computed of a strained mesh, and of its loads and mass, by name."""
    groups, u = strained(mesh)
    found, some = everything(mesh.points, groups, u), np.arange(1, mesh.n_elements, 2)
    for label, force in (("constant", (1.0, -2.0, 3.0)), ("nodal", u)):
        found[f"{label} force"] = kl.BodyForce(force).forces(mesh, groups)
        found[f"{label} force of some"] = kl.BodyForce(force, some).forces(mesh, groups)
    found["weight"] = kl.Gravity((0, 0, -9.81)).forces(mesh, groups)
    found["lumped mass"] = mass_and_convection.lumped_mass(mesh.points, groups)
    return found


@compiled
@pytest.mark.parametrize("name", [*NAMES, "all"])
def test_kernels_give_what_the_elements_own_methods_give(name, numpy_only):
    mesh = joined(*map(distorted, NAMES + CONDENSED)) if name == "all" else distorted(name)
    found = of_mesh(mesh)
    numpy_only()
    all_close(found, of_mesh(mesh), 1e-11)


@compiled
@pytest.mark.parametrize(
    ("name", "cells"), [("KinematicLinear3D4N", 14), ("EnhancedStrain3D8N", 9), ("BBar3D10N", 5)]
)
def test_results_do_not_depend_on_the_number_of_threads(name, cells):
    mesh = distorted(name, (cells, cells, cells))
    assert mesh.n_elements > 16384 or cells < 14  # more than are added together
    same_on_all_threads(lambda: of_mesh(mesh))


# ---- elements that do not lock ------------------------------------------------------------------------


def of_elasticity(C):
    """Return a material of any C."""
    return type("Any", (), {"C": C, "is_linear": True, "stress": kl.LinearMaterial.stress})()


STEEL, RUBBER = kl.Isotropic3D(210e9, 0.3), kl.Isotropic3D(1e6, 0.4999)
A = np.random.default_rng(8).standard_normal((6, 6))
CRYSTAL = of_elasticity((A @ A.T + 6 * np.eye(6)) * 1e9)


def group_of(element, material=STEEL, sizes=(1.0, 1.0, 1.0), distortion=0.03, rule=None, count=11):
    """Return points and a group of cells apart from each other, turned and distorted, with prestress."""
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    cells = element.nodes + distortion * rng.uniform(-1, 1, (count, *element.nodes.shape))
    points = (cells * sizes @ turn + rng.uniform(-1, 1, (count, 1, 3))).reshape(-1, 3)
    nodes = np.arange(len(points), dtype=np.int32).reshape(count, -1)
    prestress = rng.standard_normal((count, 6)) * 0.1 * np.abs(material.C).max()
    return points, ElementGroup(element, rule or element.rule, material, nodes, np.arange(count), prestress)


def of_group(points, group):
    return everything(points, [group], np.random.default_rng(1).uniform(-1, 1, points.shape))


def assert_same(scene, numpy_only, tolerance=1e-11):
    """Assert that kernels and NumPy give the same."""
    found = of_group(*scene)
    numpy_only()
    all_close(found, of_group(*scene), tolerance)


@compiled
@pytest.mark.parametrize("material", [STEEL, RUBBER, CRYSTAL], ids=["isotropic", "incompressible", "general"])
@pytest.mark.parametrize("distortion", [0.0, 0.03], ids=["affine", "distorted"])
@pytest.mark.parametrize("name", CONDENSED)
def test_kernels_give_what_the_classes_give(name, distortion, material, numpy_only):
    assert_same(group_of(kl.ELEMENTS[name], material, distortion=distortion), numpy_only)


@pytest.mark.parametrize("name", CONDENSED)
def test_thin_cells(name, numpy_only):
    scene = group_of(kl.ELEMENTS[name], CRYSTAL, (1.0, 1.0, 1e-4), distortion=0.0)
    assert_same(scene, numpy_only, 1e-8)  # a thickness of 1e-4 has twelve digits


@compiled
@pytest.mark.parametrize("distortion", [0.0, 0.03], ids=["affine", "distorted"])
@pytest.mark.parametrize("skew", [False, True], ids=["degree 5", "skew"])
def test_enhanced_modes_take_other_rules(skew, distortion, numpy_only):
    rule = hexahedron(degree=5)
    if skew:  # the mean of ξηζ is not 0
        corners = 0.5 * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
        points = np.vstack([hexahedron(degree=3).points, corners])
        rule = Rule(points, np.repeat([0.75, 0.5], [8, 4]), 1, "skew")
    assert_same(group_of(kl.EnhancedStrain3D8N, STEEL, distortion=distortion, rule=rule), numpy_only)


@pytest.mark.parametrize("name", ["EnhancedStrain3D8N", "BBar3D27N", "BBar3D10N"])
def test_a_class_with_a_B_of_its_own_is_computed_by_it(name):
    base = kl.ELEMENTS[name]
    with kl.ELEMENTS.temporary():
        own = type("Own", (base,), {"B": lambda self, xi, C: 0.5 * base.B(self, xi, C)})
        (points, group), (_, plain) = group_of(own, count=2), group_of(base, count=2)
        strain, of_plain = (fields.at_gauss(points, each, points, stress=False) for each in (group, plain))
        close(strain, of_plain / 2, 1e-11)
        close(stiffness_of(points, [group]).data, stiffness_of(points, [plain]).data / 4, 1e-11)


def test_what_enhanced_modes_cannot_take_is_refused():
    points, group = group_of(kl.EnhancedStrain3D8N)
    u = np.zeros_like(points)
    group.rule = hexahedron(degree=1)
    with pytest.raises(kl.InputError, match="2x2x2 points or more"):
        fields.at_gauss(points, group, u)
    group.rule = kl.EnhancedStrain3D8N.rule
    group.material = of_elasticity(np.diag([1.0, 1, 1, 1, 1, -1]))
    with pytest.raises(kl.MaterialError, match="positive definite; got C with the eigenvalues -1 … 1 Pa"):
        stiffness_of(points, [group])


# ---- who is computed by the kernels ----------------------------------------------------------------


def batch_of(element, material=SOIL):
    mesh = distorted("KinematicLinear3D8N")
    nodes = mesh.blocks[0].nodes
    return mesh.points, ElementGroup(element, element.rule, material, nodes, np.arange(len(nodes)))


@compiled
def test_elements_of_others_are_computed_by_the_kernels(monkeypatch):
    with kl.ELEMENTS.temporary():

        class Fine8N(kl.KinematicLinear3D8N):
            rule = hexahedron(degree=5)

    def refuse(self, points, chunk=None):
        raise AssertionError("computed by the element's own methods")

    points, group = batch_of(Fine8N)
    monkeypatch.setattr(ElementGroup, "at", refuse)
    assert fields.volumes(points, group).shape == (12, 27)
    assert fields.at_gauss(points, group, points).shape == (12, 27, 6)


# ---- exact values ----------------------------------------------------------------------------------


def test_nodal_values_of_a_uniform_strain_are_that_strain_however_many_elements_share_a_node():
    mesh = kl.box(cells=(2, 2, 1))
    strain = 1e-3 * np.array([1.0, -2.0, 3.0, 0.0, 0.0, 0.0])
    groups = kl.Model(mesh, WOOD).element_groups()
    means, nodal = nodal_extrapolation.averages(
        mesh.points,
        groups,
        mesh.points * strain[:3],
        mesh.n_elements,
        False,
        nodal_extrapolation.extrapolation,
    )
    for found in (means, nodal):
        np.testing.assert_allclose(found, np.tile(strain, (len(found), 1)), rtol=0, atol=1e-16)


@compiled
def test_far_from_the_origin_no_digits_of_the_shape_are_lost():
    mesh = kl.box(cells=(4, 4, 4))
    group = kl.Model(mesh, SOIL).element_groups()[0]
    np.testing.assert_allclose(fields.volumes(mesh.points + 2.0**30, group), 1 / 512, rtol=1e-14)


@compiled
def test_wrong_arguments_are_refused():
    points, group = batch_of(kl.KinematicLinear3D8N)
    with pytest.raises(ValueError, match="nodes must be rows of points"):
        fields.volumes(points[:-1], group)
    with pytest.raises(ValueError, match="a nodal field must be"):
        fields.at_gauss(points, group, points[:-1])


# ---- det J ---------------------------------------------------------------------------------------


def verdict(mesh, kind):
    """Return the notes of check_jacobians, or the text of its error."""
    try:
        return checks.check_jacobians(mesh, [kind])
    except kl.MeshError as error:
        return str(error)


def turned(mesh):
    nodes = mesh.blocks[0].nodes
    return with_block(mesh, nodes=changed_at(nodes, [2, 5], nodes[[2, 5]][:, [4, 5, 6, 7, 0, 1, 2, 3]]))


def flattened(mesh):
    normal = np.array([0.6, 0.0, 0.8])
    return mesh.replace(points=mesh.points - (mesh.points @ normal)[:, None] * normal)


def swapped(mesh):
    nodes = mesh.blocks[0].nodes
    return with_block(mesh, nodes=changed_at(nodes, (3, [0, 1]), nodes[3, [1, 0]]))


def folded(mesh):
    corner = mesh.blocks[0].nodes[0]
    apex = 1.1 * mesh.points[corner[[1, 3, 4]]].mean(axis=0)
    return mesh.replace(points=changed_at(mesh.points, corner[0], apex))


def collapsed(mesh):
    one, other = mesh.blocks[0].nodes[0, :2]
    return mesh.replace(points=changed_at(mesh.points, one, mesh.points[other]))


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (turned, "is inverted"),
        (flattened, "must be > 0"),
        (swapped, "two of its nodes look swapped"),
        (folded, "slightly < 0 at a node"),
        (collapsed, "det J = 0 at a corner node"),
    ],
)
def test_both_ways_refuse_bad_shapes_alike(spoil, text, numpy_only):
    mesh = spoil(kl.box(cells=(3, 2, 2)))
    found = verdict(mesh, kl.KinematicLinear3D8N)
    assert text in str(found)
    numpy_only()
    assert verdict(mesh, kl.KinematicLinear3D8N) == found


def bowed(mesh):
    """Return a mesh whose edge through the middle of the box is bent."""
    middle = mesh.nodes((0.5, 0.5, 0.5))
    return mesh.replace(points=changed_at(mesh.points, middle, [0.5, 0.5, 0.1]))


def with_swapped_middles(mesh):
    nodes = mesh.blocks[0].nodes
    return with_block(mesh, nodes=changed_at(nodes, (0, [5, 9]), nodes[0, [9, 5]]))


@pytest.mark.parametrize(
    ("spoil", "text"), [(bowed, "its curved edges fold it"), (with_swapped_middles, "nodes look swapped")]
)
def test_a_fold_by_curved_edges_is_told_from_swapped_nodes(spoil, text):
    assert text in verdict(spoil(kl.box(element="KinematicLinear3D10N")), kl.KinematicLinear3D10N)


@pytest.mark.parametrize("name", NAMES)
def test_both_ways_refuse_flat_elements_alike(name, numpy_only):
    kind, found = kl.ELEMENTS[name], []
    for seed in range(8):
        mesh = kl.box(cells=(2, 2, 1), element=name)
        turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
        mesh = mesh.replace(points=mesh.points * [1, 1, 0] @ turn + seed)  # in a plane but for rounding
        found.append((mesh, verdict(mesh, kind)))
    numpy_only()
    for mesh, text in found:
        assert "must be > 0" in text
        assert verdict(mesh, kind) == text


@pytest.mark.parametrize("scale", [1e-60, 1e-6, 1.0, 1e6, 1e49])
def test_a_tetrahedron_with_two_nodes_at_one_place_has_no_volume_at_any_scale(scale):
    points = scale * np.array([[0.1, 0.2, 0.3], [1.3, 0.7, 0.2], [0.4, 1.1, 0.9], [0.4, 1.1, 0.9]])
    mesh = kl.Mesh(points, {"KinematicLinear3D4N": [range(4)]})
    with pytest.raises(kl.MeshError, match="no volume"):
        checks.check_jacobians(mesh, [kl.KinematicLinear3D4N])


@compiled
def test_good_elements_need_no_closer_look_and_bad_ones_do():
    mesh = distorted("KinematicLinear3D20N")
    _, dN = element_groups.tabulate(kl.KinematicLinear3D20N.shape, kl.KinematicLinear3D20N.rule)
    args = mesh.blocks[0].nodes, kl.KinematicLinear3D20N, dN, len(dN)
    assert fields.clearly_positive(mesh.points, *args).all()
    assert not fields.clearly_positive(-mesh.points, *args).any()
    assert not fields.clearly_positive(mesh.points * np.nan, *args).any()
    assert not fields.clearly_positive(
        mesh.points * [1, 1, 1e-12], *args
    ).any()  # nearly flat: rounding would decide

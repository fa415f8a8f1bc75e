"""Fields at Gauss points: the compiled way and the element's own methods give the same."""

import json

import numpy as np
import pytest
from computing import compiled, printed, same_on_all_threads
from meshes import changed_at, joined, with_block
from rounding import all_close

import kratos_lite as kl
from kratos_lite.assembly import element_groups, mass_and_convection, nodal_values
from kratos_lite.assembly import gauss_point_fields as fields
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.kinematic_linear_3d4n import KinematicLinear3D4N
from kratos_lite.elements.kinematic_linear_3d8n import KinematicLinear3D8N
from kratos_lite.elements.kinematic_linear_3d20n import KinematicLinear3D20N
from kratos_lite.errors import MeshError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.materials.orthotropic3d import Orthotropic3D
from kratos_lite.model import checks
from kratos_lite.quadrature import hexahedron

NAMES = [f"KinematicLinear3D{n}N" for n in (4, 5, 6, 8, 10, 13, 15, 20, 27)]
CONDENSED = ["EnhancedStrain3D8N", *(f"BBar3D{n}N" for n in (8, 10, 13, 15, 20, 27))]
WOOD = Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.4, 0.3, 0.4, 0.7e9, 0.05e9, 0.7e9, 450.0)
SOIL = Isotropic3D(210e6, 0.3, 7620.0)


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


def everything(mesh):
    """Return all that the module computes of a mesh, by name."""
    P, (groups, u) = mesh.points, strained(mesh)
    found = {f"volumes {i}": fields.volumes(P, b) for i, b in enumerate(groups)}
    found |= {f"stress {i}": fields.at_gauss(P, b, u) for i, b in enumerate(groups)}
    found |= {f"strain {i}": fields.at_gauss(P, b, u, stress=False) for i, b in enumerate(groups)}
    found["internal load"] = fields.internal_load(P, groups, u)
    for what in (True, False):
        found[f"means {what}"], found[f"nodal {what}"] = nodal_values.averages(
            P, groups, u, mesh.n_elements, stress=what
        )
    energy, mises, row = fields.totals(P, groups, u)
    found |= {"energy": np.array(energy), "mises": np.array(mises), "row": np.array(row)}
    some = np.arange(1, mesh.n_elements, 2)
    for label, force in (("constant", (1.0, -2.0, 3.0)), ("nodal", u)):
        found[f"{label} force"] = kl.BodyForce(force).forces(mesh, groups)
        found[f"{label} force of some"] = kl.BodyForce(force, some).forces(mesh, groups)
    found["weight"] = kl.Gravity((0, 0, -9.81)).forces(mesh, groups)
    found["lumped mass"] = mass_and_convection.lumped_mass(P, groups)
    return found


@compiled
@pytest.mark.parametrize("name", [*NAMES, *CONDENSED, "all"])
def test_kernels_give_what_the_elements_own_methods_give(name, numpy_only):
    mesh = joined(*map(distorted, NAMES + CONDENSED)) if name == "all" else distorted(name)
    found = everything(mesh)
    numpy_only()
    all_close(found, everything(mesh), 1e-11)


@compiled
def test_results_do_not_depend_on_the_number_of_threads():
    mesh = distorted("KinematicLinear3D4N", (14, 14, 14))
    assert mesh.n_elements > 16384  # more than are added together
    same_on_all_threads(lambda: everything(mesh))


SCRIPT = """
import json, numpy as np, kratos_lite as kl
mesh = kl.box(cells=(3, 3, 3), element="KinematicLinear3D10N")
mesh = mesh.replace(points=mesh.points + 0.02 * np.sin(9 * mesh.points[:, [1, 2, 0]]))
model = kl.Model(mesh, kl.Isotropic3D(1e9, 0.3, 2000.0))
model.fix("z-")
model.add(kl.Gravity((1.0, 2.0, -9.81)))
result = model.solve()
print(json.dumps([*result.totals(), *result.stress("node").sum(axis=0), *result.stress("element")[5]]))
"""


@compiled
@pytest.mark.parametrize(
    "variable", ["KRATOS_LITE_ISA=base", "KRATOS_LITE_ISA=avx2", "KRATOS_LITE_KERNELS=numpy"]
)
def test_other_instruction_sets_and_numpy_give_the_same_solution(variable):
    name, value = variable.split("=")
    best, other = (np.array(json.loads(printed(SCRIPT, **more))) for more in ({}, {name: value}))
    np.testing.assert_allclose(other, best, rtol=1e-9, atol=1e-9 * np.abs(best).max())


# ---- who is computed by the kernels ----------------------------------------------------------------


def batch_of(element, material=SOIL):
    mesh = distorted("KinematicLinear3D8N")
    nodes = mesh.blocks[0].nodes
    return mesh.points, ElementGroup(element, element.rule, material, nodes, np.arange(len(nodes)))


@compiled
def test_elements_of_others_are_computed_by_the_kernels(monkeypatch):
    with ELEMENTS.temporary():

        class Fine8N(KinematicLinear3D8N):
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
    means, nodal = nodal_values.averages(
        mesh.points, groups, mesh.points * strain[:3], mesh.n_elements, stress=False
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
    points, group = batch_of(KinematicLinear3D8N)
    with pytest.raises(ValueError, match="nodes must be rows of points"):
        fields.volumes(points[:-1], group)
    with pytest.raises(ValueError, match="a nodal field must be"):
        fields.at_gauss(points, group, points[:-1])


# ---- det J ---------------------------------------------------------------------------------------


def verdict(mesh, kind):
    """Return the notes of check_jacobians, or the text of its error."""
    try:
        return checks.check_jacobians(mesh, [kind])
    except MeshError as error:
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
def test_both_ways_judge_bad_shapes_alike(spoil, text, numpy_only):
    mesh = spoil(kl.box(cells=(3, 2, 2)))
    found = verdict(mesh, KinematicLinear3D8N)
    assert text in str(found)
    numpy_only()
    assert verdict(mesh, KinematicLinear3D8N) == found


@pytest.mark.parametrize("name", NAMES)
def test_both_ways_judge_flat_elements_alike(name, numpy_only):
    kind, found = ELEMENTS[name], []
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
    with pytest.raises(MeshError, match="no volume"):
        checks.check_jacobians(mesh, [KinematicLinear3D4N])


@compiled
def test_good_elements_need_no_closer_look_and_bad_ones_do():
    mesh = distorted("KinematicLinear3D20N")
    _, dN = element_groups.tabulate(KinematicLinear3D20N.shape, KinematicLinear3D20N.rule)
    args = mesh.blocks[0].nodes, KinematicLinear3D20N, dN, len(dN)
    assert fields.clearly_positive(mesh.points, *args).all()
    assert not fields.clearly_positive(-mesh.points, *args).any()
    assert not fields.clearly_positive(mesh.points * np.nan, *args).any()
    assert not fields.clearly_positive(
        mesh.points * [1, 1, 1e-12], *args
    ).any()  # nearly flat: rounding would decide

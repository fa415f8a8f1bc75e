"""Edges of the design: many elements at a node, few unknowns, inheritance, bodies that meet at corners."""

import numpy as np
import pytest
from meshes import joined
from rounding import round_off

import kratos_lite as kl
from kratos_lite.assembly.sparsity_pattern import PatternCache
from kratos_lite.assembly.stiffness import assemble_dense
from kratos_lite.materials import MATERIALS
from kratos_lite.solvers.constraints import rigid_modes

STEEL = kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0)


def fan(n, levels=1):
    """Return n wedges around the z axis per level."""
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    level = np.vstack([[[0, 0, 0]], ring])
    points = np.vstack([level + np.array([0, 0, z]) for z in range(levels + 1)])
    i = np.arange(n)
    base = np.column_stack([0 * i, 1 + i, 1 + (i + 1) % n])
    nodes = np.vstack([np.hstack([base + k * (n + 1), base + (k + 1) * (n + 1)]) for k in range(levels)])
    return kl.Mesh(points, {"KinematicLinear3D6N": nodes})


@pytest.mark.parametrize("n", [128, 255, 256])
def test_any_number_of_elements_may_share_a_node_pair(n):
    model = kl.Model(fan(n), STEEL)
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -9.81)))
    sparse, full = model.solve("direct").u, model.solve("dense").u
    assert np.abs(sparse - full).max() < (1e-12 + round_off(model)) * np.abs(full).max()


def test_pattern_is_kept_until_the_connectivity_changes():
    nodes = kl.box(cells=(3, 3, 3)).blocks[0].nodes
    cache = PatternCache()
    first = cache.get(64, [nodes])
    assert cache.get(64, [nodes.copy()]) is first
    other = nodes.copy()
    other[0, [0, 1]] = other[0, [1, 0]]
    assert cache.get(64, [other]) is not first


def test_few_free_unknowns_of_a_large_model_take_no_full_matrix():
    model = kl.Model(kl.box(cells=(12, 12, 12)), STEEL)
    model.fix(lambda X: (np.round(12 * X) % 2 == 0).any(axis=1))  # every cell keeps one free corner
    model.fix(lambda X: X[:, 0] >= 0, "x")
    model.add(kl.Gravity((0, 0, -9.81)))
    report = model.solve().report
    assert report.unknowns == 2 * 6**3
    assert report.solver in ("amg", "direct")


def test_subclasses_do_not_take_the_names_of_their_parents():
    with MATERIALS.temporary(), kl.ELEMENTS.temporary():

        class Softer(kl.Isotropic3D):
            pass

        class Softer8N(kl.KinematicLinear3D8N):
            pass

        assert MATERIALS["LinearElastic3DLaw"] is kl.Isotropic3D
        assert MATERIALS["Softer"] is Softer
        assert kl.ELEMENTS["Softer8N"] is Softer8N
        assert kl.ELEMENTS["SmallDisplacementElement3D8N"] is kl.KinematicLinear3D8N


def test_lumped_mass_is_positive_on_distorted_elements():
    kind = kl.KinematicLinear3D27N
    rng = np.random.default_rng(3)
    element = kind(kind.nodes + rng.uniform(-0.3, 0.3, (200, 27, 3)))
    valid = (element.dV > 0).all(axis=1)
    rows = element.scalar_mass(1.0).sum(axis=-1)
    assert (rows[valid] < 0).any()
    lumped = element.lumped_mass(1.0)[valid]
    assert (lumped > 0).all()
    np.testing.assert_allclose(
        lumped.sum(axis=1), element.scalar_mass(1.0)[valid].sum(axis=(1, 2)), rtol=1e-12
    )


@pytest.mark.parametrize("name", ["Point1", "Line2"])
def test_traction_refuses_conditions_that_are_no_faces(name):
    from kratos_lite.shapes import SHAPES

    mesh = kl.box()
    shape = SHAPES[name]
    nodes = mesh.nodes("z+")[: len(shape.nodes)][None, :].astype(np.int32)
    top = kl.Part(nodes=mesh.nodes("z+"), conditions=np.array([0]))
    mesh = mesh.replace(
        conditions=[kl.Block(name, nodes, [7], shape=shape)], parts={**mesh.parts, "top": top}
    )
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    model.add(kl.Traction("top", (0, 0, 1.0)))
    with pytest.raises(
        kl.ModelError, match=rf"acts on faces; it meets other conditions, {name} \(the first is 7\)"
    ):
        model.solve()


def test_checkerboard_of_cells_that_meet_at_edges_is_solved_if_it_is_held():
    mesh = kl.box((2, 2, 1), (2, 2, 1))
    block = mesh.blocks[0]
    mesh = mesh.replace(blocks=[block.take(np.array([0, 3]))])
    model = kl.Model(mesh, STEEL)
    model.fix(mesh.blocks[0].nodes[0], "xyz")
    with pytest.raises(
        kl.ModelError, match=r"can still move: rotation about z \(it hangs on a node or an edge"
    ):
        model.check()
    held = kl.Model(mesh, STEEL)
    held.fix(lambda X: X[:, 2] == 0, "xyz")
    held.add(kl.Gravity((0, 0, -9.81)))
    assert np.isfinite(held.solve().u).all()


def test_body_whose_nodes_all_belong_to_others_is_still_a_body():
    """Three rows of cells: the middle one touches the outer ones along edges only."""
    mesh = kl.box((3, 3, 3), (3, 3, 3))
    block = mesh.blocks[0]
    middle = np.round(mesh.points[block.nodes].mean(axis=1) * 2).astype(int)
    mesh = mesh.replace(blocks=[block.take((middle.sum(axis=1) // 2) % 2 == 0)])
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    free = ~(model.supports.fixed | ~mesh.used_nodes()[:, None]).ravel()
    K = assemble_dense(mesh.points, model.element_groups())[np.ix_(free, free)]
    values = np.linalg.eigvalsh(K)
    assert values[0] > 1e-3 * values[-1]
    assert np.isfinite(model.solve().u).all()


def test_rigid_modes_of_the_model_carry_no_stress():
    model = kl.Model(kl.box(cells=(2, 1, 1), element="KinematicLinear3D20N"), STEEL)
    K = assemble_dense(model.mesh.points, model.element_groups())
    R = rigid_modes(model.mesh.points)
    assert R.shape == (3 * model.mesh.n_nodes, 6)
    assert np.abs(K @ R).max() < 1e-12 * np.abs(K).max()
    np.testing.assert_array_equal(R, rigid_modes(model.mesh.points))


@pytest.mark.parametrize("n", [2, 61, 62])
def test_chain_of_cells_that_share_single_edges_is_a_mechanism(n):
    mesh = joined(*(kl.box(origin=(i, i, 0)) for i in range(n)), welded=True)
    model = kl.Model(mesh, STEEL)
    model.fix(mesh.blocks[0].nodes[0])
    model.add(kl.Gravity((1.0, -2.0, 0.0)))
    with pytest.raises((kl.ModelError, kl.SolveError), match=r"can still move|hardly resists|backward error"):
        model.solve()


def test_boundary_follows_the_blocks():
    mesh = kl.box(cells=(3, 3, 3))
    before = sum(len(block) for block in mesh.boundary)
    block = mesh.blocks[0]
    inner = np.linalg.norm(mesh.points[block.nodes].mean(axis=1) - [0.5, 0.5, 5 / 6], axis=1) < 1e-9
    mesh = mesh.replace(blocks=[block.take(~inner)])
    assert sum(len(block) for block in mesh.boundary) == before - 1 + 5
    assert len(mesh.element_ids) == 26
    assert sum(len(face) for face in mesh.faces("z+")) == 8


def test_points_of_a_replaced_rule_must_see_a_positive_jacobian():
    from kratos_lite.quadrature import hexahedron

    points = kl.KinematicLinear3D8N.nodes / 2 + 0.5
    points[6] = [0.48, 0.48, 0.9]  # a fold at one corner, slight enough for the own rule to be solved with
    element = kl.KinematicLinear3D8N(points)
    fine = hexahedron(degree=19)
    own = np.array([element.detJ(xi) for xi, _ in element.rule])
    assert own.min() > 0 > min(element.detJ(xi) for xi, _ in fine)
    model = kl.Model(kl.Mesh(points, {"KinematicLinear3D8N": [range(8)]}), STEEL)
    model.use_rule(fine)
    with pytest.raises(kl.MeshError, match=r"element 1 .* at all points of Rule"):
        model.check()

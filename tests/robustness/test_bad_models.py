"""Broken bodies end in one clear error or a warning; never in a plausible wrong number."""

import numpy as np
import pytest
from meshes import changed_at, joined, named, with_block

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
SOLVERS = ("dense", "direct", "amg")
KINDS = [4, 5, 6, 8, 10, 13, 15, 20, 27]


def model_of(mesh, material=STEEL, *, rollers=False):
    model = kl.Model(mesh, material)
    model.add(kl.Gravity((0, 0, -9.81)))
    if rollers:
        for side in ("x-", "x+", "y-", "y+", "z-"):
            model.fix(side, side[0])
    else:
        model.fix("z-")
    return model


@pytest.mark.parametrize("nodes", KINDS)
def test_two_swapped_nodes_are_named(nodes):
    mesh = kl.box(cells=(2, 2, 2), element=named(nodes))
    rows = mesh.blocks[0].nodes
    mesh = with_block(mesh, nodes=changed_at(rows, (0, [1, 2]), rows[0, [2, 1]]))
    text = rf"element 1 \({named(nodes)}\): det J = -\S+ at .* must be > 0; nodes "
    with pytest.raises(kl.MeshError, match=text):
        model_of(mesh).solve()


@pytest.mark.parametrize("nodes", [4, 10])
def test_a_mirrored_tetrahedron_is_called_inverted(nodes):
    mesh = kl.box(element=named(nodes))
    mesh = mesh.replace(points=mesh.points * [-1, 1, 1])
    with pytest.raises(kl.MeshError, match=r"inverted; mesh\.reoriented\(\) corrects") as caught:
        model_of(mesh).solve()
    assert str(caught.value).endswith("; 5 more elements are inverted, too")


@pytest.mark.parametrize(
    ("points", "ending", "lines"),
    [([-1, 1, 1], "26 more elements are inverted, too", 1), ([0, 1, 1], "… and 7 more", 21)],
)
def test_many_bad_elements_are_counted(points, ending, lines):
    mesh = kl.box(cells=(3, 3, 3))
    mesh = mesh.replace(points=mesh.points * points)
    with pytest.raises(kl.MeshError) as caught:
        model_of(mesh).solve()
    assert str(caught.value).endswith(ending)
    assert len(str(caught.value).splitlines()) == lines


def hanging(model):
    model.add(kl.Gravity((0, 0, -9.81)))


def bottom(model):
    model.fix("z-", "z")


def line(model):
    model.fix(lambda X: (X[:, 0] == 0) & (X[:, 2] == 0))


@pytest.mark.parametrize(
    ("support", "solver", "motions"),
    [
        *((hanging, solver, "translation x, y, z; rotation about x, y, z") for solver in SOLVERS),
        (bottom, "auto", "translation x, y; rotation about z"),
        (line, "auto", r"rotation about y\. Fix more"),
    ],
)
def test_motions_that_are_left_are_named(support, solver, motions):
    model = kl.Model(kl.box(cells=(2, 2, 2)), STEEL)
    support(model)
    with pytest.raises(kl.ModelError, match=f"can still move: {motions}"):
        model.solve(solver)


def test_half_of_a_body_that_floats_is_named_and_coincident_nodes_are_counted():
    low, high = kl.box(), kl.box(origin=(0, 0, 1))
    model = kl.Model(joined(low, high), STEEL)
    model.fix("z-")
    with pytest.raises(
        kl.ModelError, match=r"the component of node 9 \(8 nodes\) can still move: translation x, y, z"
    ):
        model.solve()
    model.fix("z+")
    assert any("4 pairs of nodes coincide" in text for text in model.solve().report.warnings)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    ("shift", "words"),
    [((1, 0, 1), "rotation about y"), ((1, 1, 1), "rotation about x, y, z")],
    ids=["edge", "corner"],
)
def test_bodies_that_hang_together_by_an_edge_or_a_corner_can_turn_there(solver, shift, words):
    model = kl.Model(joined(kl.box(), kl.box(origin=shift), welded=True), STEEL)
    model.fix("z-")
    with pytest.raises(
        kl.ModelError, match=rf"can still move: {words} \(it hangs on a node or an edge only\)"
    ):
        model.solve(solver)
    model.fix("z+")
    assert np.isfinite(model.solve(solver).u).all()


def test_three_bricks_in_a_closed_ring_of_edges_and_faces_are_one_body():
    """Bricks 1 and 3 share an edge only, but brick 2 holds both by faces."""
    mesh = kl.box(cells=(2, 1, 2))
    model = kl.Model(kl.Mesh(mesh.points, {named(8): mesh.blocks[0].nodes[:3]}), STEEL)
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    assert np.abs(model.solve().u).max() < 1e-2


def test_constraint_weights_of_any_size_do_not_hide_supports():
    model = kl.Model(kl.box(), STEEL)
    model.fix("z-")
    top = [int(n) for n in model.mesh.nodes("z+")]
    model.constrain((top[0], "x"), {(top[1], "x"): 1e9})
    assert model.check() == []


def test_a_needle_held_at_one_end_is_held():
    model = kl.Model(kl.box((1e5, 1, 1)), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (1.0, 0, 0)))
    long = model.solve().displacement("x+")[:, 0].mean() / 1e5
    short = kl.Model(kl.box((1e2, 1, 1)), STEEL)
    short.fix("x-")
    short.add(kl.Traction("x+", (1.0, 0, 0)))
    assert long == pytest.approx(short.solve().displacement("x+")[:, 0].mean() / 1e2, rel=1e-4)


ISOTROPIC = {"E": 1.0, "nu": 0.3}
ORTHOTROPIC = dict.fromkeys(("E_x", "E_y", "E_z", "G_xy", "G_yz", "G_xz"), 1)
ORTHOTROPIC |= dict.fromkeys(("nu_xy", "nu_yz", "nu_xz"), 0)


@pytest.mark.parametrize(
    ("constants", "text"),
    [
        ({"E": 0.0}, r"E \(YOUNG_MODULUS\) 0 must be > 0 Pa"),
        ({"E": np.nan}, r"E \(YOUNG_MODULUS\) must be finite; got nan"),
        ({"E": 10**400}, r"E \(YOUNG_MODULUS\) must be finite"),
        ({"E": "steel"}, r"E \(YOUNG_MODULUS\) must be a number; got 'steel'"),
        ({"E": True}, r"E \(YOUNG_MODULUS\) must be a number; got True"),
        ({"nu": 0.5}, r"nu \(POISSON_RATIO\) 0.5 must be < 0.5"),
        ({"nu": -1.0}, r"nu \(POISSON_RATIO\) -1 must be > -1"),
        ({"density": -1.0}, r"density \(DENSITY\) -1 must be ≥ 0"),
        ({"nu_xy": 1.1}, r"nu_xy² = 1.21 must be < E_x / E_y = 1"),
        ({"nu_xy": 0.9, "nu_yz": 0.9, "nu_xz": 0.9}, "the three Poisson ratios together are too large"),
        ({"G_yz": 0}, r"G_yz \(SHEAR_MODULUS_YZ\) 0 must be > 0 Pa"),
    ],
)
def test_impossible_material_constants_are_refused(constants, text):
    is_plain = constants.keys() <= {"E", "nu", "density"}
    law, good = (kl.Isotropic3D, ISOTROPIC) if is_plain else (kl.Orthotropic3D, ORTHOTROPIC)
    with pytest.raises(kl.MaterialError, match=text):
        law(**{**good, **constants})


SOFT = kl.Isotropic3D(E=1e6, nu=0.4999, density=1.0)
BRICK = kl.box(element=named(8))


def folded():
    mesh = kl.box()
    corner = mesh.nodes(lambda X: X.sum(axis=1) == 3)
    return model_of(mesh.replace(points=changed_at(mesh.points, corner, (0.65, 0.65, 0.65))))


def with_quarter_points():
    mesh = kl.box(element=named(20))
    edge = mesh.nodes(lambda X: X[:, 0] == 0.5)
    return model_of(mesh.replace(points=changed_at(mesh.points, (edge, 0), 0.25)))


def without_mass():
    light = kl.Model(kl.box(), kl.Isotropic3D(E=1.0, nu=0.0))
    light.fix("z-")
    light.add(kl.Gravity((0, 0, -9.81)))
    return light


def loaded_where_fixed():
    model = kl.Model(kl.box(), STEEL)
    model.fix("z-")
    model.add(kl.PointLoad("z-", (0, 0, 1.0), each=True))
    return model


def stacked(element):
    """Return a brick under a cell of another kind."""
    return model_of(joined(kl.box(), kl.box(element=element, origin=(0, 0, 1)), welded=True))


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (folded, "1 elements have det J slightly < 0 at a node"),
        (with_quarter_points, "1 elements have det J = 0 at a corner node (singular corner)"),
        (lambda: model_of(BRICK, SOFT), "KinematicLinear3D8N may lock"),
        (
            lambda: model_of(
                kl.Mesh(BRICK.points, {named(8): [BRICK.blocks[0].nodes[0]] * 2}, parts=BRICK.parts)
            ),
            "1 elements have the same nodes as another (1 and 2): both count",
        ),
        (lambda: stacked(named(20)), "share the corners of a face but not its further nodes"),
        (lambda: stacked(named(4)), "1 four-sided faces (the first of element 1) meet triangles"),
        (without_mass, "gravity acts on no mass: every material has density 0; give density in kg/m³"),
        (loaded_where_fixed, "all loads act on fixed components, so nothing moves"),
    ],
)
def test_what_is_odd_is_solved_with_a_warning(made, text):
    assert any(text in warning for warning in made().solve().report.warnings)


def test_quadratic_tetrahedra_without_a_named_formulation_do_not_lock():
    assert model_of(kl.box(element="Element3D10N"), SOFT).solve().report.warnings == []


NODES = kl.box().blocks[0].nodes
POINTS = kl.box().points


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: kl.box().replace(points=changed_at(POINTS, (3, 1), np.nan)), r"finite; got nan at \[3, 1\]"),
        (
            lambda: model_of(with_block(BRICK, nodes=changed_at(NODES, (0, 1), NODES[0, 0]))).solve(),
            r"element 1 \(KinematicLinear3D8N\) uses node 1 more than once",
        ),
        (
            lambda: with_block(kl.box(), nodes=changed_at(NODES, (0, 6), 8)),
            r"element 1 .* uses node indices \[.*\]; indices are 0 … 7",
        ),
        (
            lambda: with_block(kl.box(), nodes=changed_at(NODES, (0, 6), -1)),
            "nodes are indices of points, from 0; got -1",
        ),
    ],
)
def test_broken_coordinates_and_node_lists_are_named(make, text):
    with pytest.raises(kl.MeshError, match=text):
        make()


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        ({"nodes": kl.box().blocks[0].nodes[:, :4]}, r"nodes must be whole numbers of shape \(m, 8\)"),
        ({"nodes": kl.box().blocks[0].nodes * 1.0}, r"nodes must be whole numbers of shape \(m, 8\)"),
        ({"nodes": [0, 1, 2]}, r"nodes must be whole numbers of shape \(m, 8\)"),
        ({"nodes": [[0, 1], [2]]}, r"nodes must be whole numbers of shape \(m, 8\)"),
        ({"nodes": np.full((1, 8), 2**40)}, r"nodes must be below 2\^31"),
        ({"properties": [1, 2]}, r"properties must be whole numbers of shape \(1,\)"),
        ({"properties": [True]}, r"properties must be whole numbers of shape \(1,\)"),
        ({"ids": 3}, r"ids must be whole numbers of shape \(1,\); got shape \(\)"),
        ({"name": None}, "the name of a block must be a str"),
    ],
)
def test_blocks_of_the_wrong_form_are_refused(spoil, words):
    with pytest.raises(kl.MeshError, match=words):
        with_block(kl.box(), **spoil)


def test_a_mesh_is_made_of_a_dict_or_of_blocks():
    box, cells = kl.box(), kl.box().blocks[0].nodes
    made = kl.Mesh(box.points.tolist(), {"KinematicLinear3D8N": cells.tolist()})
    assert (made.n_elements, made.blocks[0].shape) == (1, box.blocks[0].shape)
    np.testing.assert_array_equal(made.points, box.points)
    made = kl.Mesh(box.points, [kl.Block("KinematicLinear3D8N", [list(range(8))])])
    assert (made.element_ids.tolist(), made.blocks[0].properties.tolist()) == ([1], [1])
    made = kl.Mesh(box.points, {"KinematicLinear3D8N": cells, "KinematicLinear3D4N": [[0, 1, 2, 4]] * 2})
    assert made.element_ids.tolist() == [1, 2, 3]
    for wrong in ([[0, 1, 2, 3]], "KinematicLinear3D8N", cells, 3, [None], made):
        with pytest.raises(kl.MeshError, match=r"nodes by element name, as in kl\.Mesh\(points, \{'Kin"):
            kl.Mesh(box.points, wrong)
    with pytest.raises(kl.MeshError, match="no element 'tetra'; with 4 nodes there is KinematicLinear3D4N"):
        kl.Mesh(box.points, {"tetra": [[0, 1, 2, 3]]})
    with pytest.raises(kl.MeshError, match="no element 'line', nor any with 2 nodes"):
        kl.Mesh(box.points, {"line": [[0, 1]]})
    with pytest.raises(kl.MeshError, match="points must be made of real numbers"):
        kl.Mesh(box.points + 1j)


def test_a_rule_that_leaves_hourglass_modes_is_reported_and_one_of_another_cell_refused():
    from kratos_lite.quadrature import pyramid, tetrahedron

    model = model_of(kl.box(cells=(2, 2, 2), element="KinematicLinear3D8N"), rollers=True)
    model.use_rule(1)
    assert any("12 hourglass modes" in text for text in model.check())
    for rule in (tetrahedron(2), pyramid(3)):
        model.use_rule(rule)
        with pytest.raises(kl.InputError, match="does not fit KinematicLinear3D8N"):
            model.solve()


@pytest.mark.parametrize("nodes", KINDS)
def test_one_gauss_point_still_gives_a_constant_stress_at_the_nodes(nodes):
    mesh = kl.box(element=named(nodes))
    model = kl.Model(mesh, STEEL)
    model.use_rule(1)
    model.fix(np.arange(mesh.n_nodes), "xyz", 1e-3 * mesh.points)
    np.testing.assert_allclose(model.solve().stress("node")[:, :3], 525e3, rtol=1e-10)


@pytest.mark.parametrize("nodes", KINDS)
def test_sound_meshes_of_every_kind_give_no_warning_but_of_locking(nodes):
    assert others(model_of(kl.box(cells=(2, 2, 2), element=named(nodes)))) == []
    wheel = kl.Model(kl.annulus(1.0, 2.0, 0.5, (1, 5, 1), named(nodes)), STEEL)
    wheel.fix("inner")
    assert others(wheel) == []


def others(model):
    """Return the warnings that are not about locking in bending."""
    return [text for text in model.check() if "bending" not in text]


@pytest.mark.parametrize(
    "use", [kl.Model.solve, kl.Model.matrices, lambda model: list(kl.integrate(model.transient(), 1e-3, 1))]
)
@pytest.mark.parametrize("amplitude", [None, 2.0])
def test_a_load_on_a_node_without_elements_is_refused_by_every_analysis(use, amplitude):
    cube = kl.box()
    model = kl.Model(kl.Mesh(np.vstack([cube.points, [[5.0, 5.0, 5.0]]]), cube.blocks), STEEL)
    model.fix(list(range(4)))
    model.add(kl.PointLoad([8], (0.0, 0.0, 1.0)), amplitude=amplitude)
    with pytest.raises(kl.ModelError, match="node 9 carries a load but belongs to no element"):
        use(model)

"""Refinement: volumes, boundaries, parts, hanging nodes, and the patch test across them."""

import copy
import pickle

import numpy as np
import pytest
from meshes import KINDS, area

import kratos_lite as kl
from kratos_lite.mesh.refinement import raised, refine

QUADRATIC = ("10N", "13N", "15N", "20N", "27N")
UNIT = kl.Isotropic3D(E=1.0, nu=0.3)
SLOPE = np.array([[0.1, 0.02, 0.03], [0.04, -0.1, 0.02], [0.01, 0.05, 0.2]])


def block(kind, cells=(2, 2, 1)):
    return kl.box((1.0, 1.3, 0.7), cells, "KinematicLinear3D" + kind)


def thrice(mesh):
    """Return a mesh refined three times near one corner, so that more than one level meets."""
    for last in ([0], [0, 3], [5]):
        mesh = refine(mesh, last).mesh
    return mesh


def volume(mesh):
    return sum(group.at(mesh.points).dV.sum() for group in kl.Model(mesh, UNIT).element_groups())


def assert_whole(mesh):
    """Assert that volume and surface are those of the block."""
    assert abs(volume(mesh) - 0.91) < 1e-12
    assert abs(area(mesh.boundary, mesh) - 2 * (1.3 + 0.7 + 0.91)) < 1e-12


def in_order(points):
    return points[np.lexsort(points.round(9).T)]


@pytest.mark.parametrize("kind", KINDS)
def test_volume_and_surface_stay(kind):
    mesh = thrice(block(kind))
    assert_whole(mesh)
    for side, size in (("x-", 0.91), ("y+", 0.7), ("z-", 1.3)):
        assert abs(area(mesh.faces(side), mesh) - size) < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_uniform_refinement_has_no_hanging_nodes_and_the_nodes_of_a_finer_box(kind):
    mesh = refine(block(kind)).mesh
    assert mesh.hanging is None
    if kind in ("8N", "20N", "27N", "6N", "15N"):
        finer = block(kind, (4, 4, 2))
        assert mesh.n_nodes == finer.n_nodes
        np.testing.assert_allclose(in_order(mesh.points), in_order(finer.points), rtol=0, atol=1e-12)


def boundary_nodes(mesh):
    return np.unique(np.concatenate([b.nodes.ravel() for b in mesh.boundary]))


def quadratic(X):
    x, y, z = X.T
    return np.stack([x * x + y * z, x * y - z * z, y * y - 2 * x * z], axis=1)


def assert_exact(mesh, kind):
    """Assert that a model finds a linear, and if it can a quadratic displacement, given on its surface."""
    model = kl.Model(mesh, UNIT)
    model.fix(boundary_nodes(mesh), field=lambda X: X @ SLOPE)
    assert np.abs(model.solve().u - mesh.points @ SLOPE).max() < 1e-13
    if kind in QUADRATIC:
        model = kl.Model(mesh, UNIT)
        model.fix(boundary_nodes(mesh), field=quadratic)
        lam, mu = 0.3 / (1.3 * 0.4), 1 / 2.6
        model.add(kl.BodyForce((-lam - 3 * mu, 2 * mu, -2 * mu)))  # div u = x, Δu = (2, -2, 2)
        assert np.abs(model.solve().u - quadratic(mesh.points)).max() < 1e-11


@pytest.mark.parametrize("kind", KINDS)
def test_fields_of_the_space_are_exact_across_hanging_nodes(kind):
    mesh = thrice(block(kind, (2, 2, 2)))
    assert len(mesh.hanging) > 0
    assert_exact(mesh, kind)


ACROSS = [("8N", "z"), ("8N", "x"), ("20N", "y"), ("27N", "z"), ("27N", "x"), ("6N", "z"), ("15N", "z")]


@pytest.mark.parametrize(("kind", "along"), ACROSS)
def test_cells_cut_across_a_direction_keep_their_edges_along_it(kind, along):
    direction = np.eye(3)["xyz".index(along)]
    mesh = block(kind, (2, 2, 2))
    n = mesh.n_elements
    for rows in ([0], [0, 3], [2], [5]):
        mesh = refine(mesh, rows, direction).mesh
    assert (mesh.n_elements - n) % 3 == 0
    assert_whole(mesh)
    places = mesh.points[np.concatenate([b.nodes[:, : b.shape.corners].ravel() for b in mesh.blocks])]
    assert len(set((places @ direction).round(9))) == 3
    assert_exact(mesh, kind)


def test_conditions_are_halved_or_quartered_with_cells_cut_across():
    plain = block("8N", (2, 1, 1))
    faces = [plain.faces(side)[0].nodes for side in ("x-", "z+")]
    shape = plain.boundary[0].shape
    mesh = plain.replace(conditions=[kl.Block("SurfaceCondition3D4N", np.vstack(faces), shape=shape)])
    finer = refine(mesh, None, (0, 0, 1))
    assert np.bincount(finer.conditions).tolist() == [2, 4, 4]
    assert abs(area(finer.mesh.conditions, finer.mesh) - 0.91 - 1.3) < 1e-12


def test_reactions_at_hanging_nodes_go_to_their_independents():
    """A column under its weight: the support carries it all, and inner nodes carry nothing."""
    mesh = thrice(block("8N", (2, 2, 2)))
    model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.3, density=2.0))
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -10.0)))
    result = model.solve()
    assert abs(result.reaction("z-")[:, 2].sum() - 18.2) < 1e-9
    inner = np.setdiff1d(np.arange(mesh.n_nodes), mesh.nodes("z-"))
    assert np.abs(result.reactions[inner]).max() < 1e-9


def test_neighbors_differ_by_one_level():
    mesh = block("8N", (3, 3, 1))
    for _ in range(4):
        centers = np.concatenate([mesh.points[b.nodes].mean(axis=1) for b in mesh.blocks])
        mesh = refine(mesh, [int(np.linalg.norm(centers - (0.34, 0.44, 0.0), axis=1).argmin())]).mesh
    (cells,) = mesh.blocks
    X = mesh.points[cells.nodes]
    size = (X.max(axis=1) - X.min(axis=1))[:, 0]
    low, high = X.min(axis=1), X.max(axis=1)
    for i in range(len(cells)):
        gap = np.maximum(low - high[i], low[i] - high)
        touching = (gap < 1e-9).all(axis=1) & ((gap > -1e-9).sum(axis=1) <= 2)  # a face or an edge at least
        assert size[touching].max() / size[i] < 2.1
        assert size[i] / size[touching].min() < 2.1


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("cells", [(1, 1, 1), (3, 2, 1)])
def test_sides_of_a_box_one_cell_thick_keep_to_themselves(kind, cells):
    coarse = block(kind, cells)
    for finer in (refine(coarse), refine(coarse, [0])):
        for side, axis, end in (("x-", 0, 0.0), ("y+", 1, 1.3), ("z-", 2, 0.0), ("z+", 2, 0.7)):
            on = np.flatnonzero(np.abs(finer.mesh.points[:, axis] - end) < 1e-12)
            assert sorted(finer.mesh.nodes(side)) == on.tolist()


def test_both_sides_of_a_quadratic_plate_in_one_part_leave_the_middle_out():
    coarse = block("20N", (2, 2, 1))
    coarse.add_part("faces", lambda X: (X[:, 2] == 0) | (X[:, 2] == 0.7))
    z = refine(coarse).mesh.points[refine(coarse).mesh.nodes("faces"), 2]
    assert set(z.round(12)) == {0.0, 0.7}


def test_lines_planes_and_volumes_inside_the_body_grow():
    places = {
        "line": lambda X: (X[:, 0] == 0.5) & (X[:, 1] == 0.65),
        "plane": lambda X: X[:, 0] == 0.5,
        "half": lambda X: X[:, 2] <= 0.35 + 1e-12,
        "edge": lambda X: (X[:, 0] == 0) & (X[:, 1] == 0),
    }
    coarse = block("8N", (4, 4, 4))
    for name, place in places.items():
        coarse.add_part(name, place)
    mesh = refine(coarse).mesh
    for name, place in places.items():
        assert sorted(mesh.nodes(name)) == np.flatnonzero(place(mesh.points)).tolist(), name


def test_elements_and_conditions_of_parts_are_refined_with_their_parents():
    plain = block("8N", (2, 1, 1))
    (side,) = plain.faces("x-")
    coarse = plain.replace(
        conditions=[kl.Block("SurfaceCondition3D4N", side.nodes, shape=side.shape)],
        parts={"left": kl.Part(nodes=plain.nodes("x-"), elements=[0], conditions=[0])},
    )
    finer = refine(coarse, [0])
    left = finer.mesh.part("left")
    assert len(left.elements) == 8
    assert (finer.elements[left.elements] == 0).all()
    assert len(left.conditions) == 4
    assert abs(area(finer.mesh.faces("left"), finer.mesh) - 0.91) < 1e-12
    other = refine(coarse, [1])
    assert len(other.mesh.part("left").conditions) == 1
    up = raised(coarse)
    assert up.mesh.conditions[0].name == "SurfaceCondition3D8N"
    assert abs(area(up.mesh.faces("left"), up.mesh) - 0.91) < 1e-12


def test_ids_of_what_stays_stay_and_new_ones_are_new():
    coarse = kl.Mesh(block("8N").points, block("8N").blocks, node_ids=10 * np.arange(1, 19))
    mesh = refine(coarse, [1]).mesh
    assert (mesh.node_ids[:18] == coarse.node_ids).all()
    assert len(set(mesh.node_ids)) == mesh.n_nodes
    assert len(set(mesh.element_ids)) == mesh.n_elements
    assert set(coarse.element_ids) - set(mesh.element_ids) == {2}


def test_a_curved_cell_keeps_its_form():
    """Children of a cell with 27 nodes lie on its isoparametric map."""
    ring = kl.annulus(1.0, 2.0, 1.0, (1, 6, 1), "KinematicLinear3D27N")
    assert abs(volume(refine(ring, [0, 3]).mesh) - volume(ring)) < 1e-12
    finer = refine(ring)
    middle = finer.interpolate(ring.points)
    assert np.abs(finer.mesh.points - middle).max() == 0


def test_nodal_fields_of_the_space_stay_what_they_are():
    coarse = thrice(block("20N"))
    finer = refine(coarse, [0, 7])
    assert np.abs(finer.interpolate(quadratic(coarse.points)) - quadratic(finer.mesh.points)).max() < 1e-12


@pytest.mark.parametrize(
    ("old", "new"),
    [("8N", "20N"), ("8N", "27N"), ("4N", "10N"), ("6N", "15N"), ("5N", "13N"), ("20N", "27N")],
)
def test_raised_meshes_are_those_of_the_higher_element(old, new):
    mesh = raised(block(old), lambda name: "KinematicLinear3D" + new).mesh
    same = block(new)
    np.testing.assert_allclose(in_order(mesh.points), in_order(same.points), rtol=0, atol=1e-12)
    sizes = [{name: len(part.nodes) for name, part in m.parts.items()} for m in (mesh, same)]
    assert sizes[0] == sizes[1]


SHELL = kl.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [kl.Block("Shell3D3N", [[0, 1, 2]])])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: raised(refine(block("8N"), [0]).mesh), "raise the order first"),
        (lambda: refine(block("8N"), [9]), "element indices"),
        (lambda: refine(block("8N"), [True]), "mask of elements"),
        (lambda: refine(block("8N"), [0.5]), "elements are chosen"),
        (lambda: refine(SHELL), "cannot be refined"),
        *(
            (
                lambda kind=kind: refine(block(kind), None, (1.0, 1.0, 0.0)),
                "not every element has edges along",
            )
            for kind in ("4N", "5N", "8N")
        ),
    ],
)
def test_what_cannot_be_refined_is_refused(call, words):
    with pytest.raises(kl.MeshError, match=words):
        call()


def test_copies_keep_their_hanging_nodes():
    mesh = refine(block("8N"), [0]).mesh
    for twin in (copy.deepcopy(mesh), pickle.loads(pickle.dumps(mesh)), mesh.replace(points=2 * mesh.points)):
        assert len(twin.hanging) == len(mesh.hanging)
        assert sum(map(len, twin.boundary)) == sum(map(len, mesh.boundary))

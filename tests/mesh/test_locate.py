"""Points in a mesh: which element contains them, where in it they lie, and those outside."""

import numpy as np
import pytest
from meshes import NAMES, four_cells, joined

import kratos_lite as kl
from kratos_lite.bodies.rotations import exp
from kratos_lite.mesh.boxes import BoxTree, cell_boxes
from kratos_lite.shapes.faces import Quadrilateral4
from kratos_lite.shapes.inverse import inverse_map

TURN = exp([0.3, -0.8, 0.5])

each_element = pytest.mark.parametrize("name", NAMES)


def points_in(shape, count, seed=0):
    """Return random points of the reference cell, some of them near its corners and edges."""
    corners = shape.nodes[: shape.corners]
    return np.random.default_rng(seed).dirichlet(np.full(len(corners), 0.5), count) @ corners


def bent(name, cells=(3, 3, 3)):
    """Return a turned box whose nodes follow a smooth map, so that quadratic cells are curved."""
    mesh = kl.box((1.0, 2.0, 3.0), cells, name, origin=(-0.5, -1.0, -1.5))
    x, y, z = mesh.points.T
    wave = np.column_stack([0.1 * np.sin(2 * y + z), 0.08 * np.cos(3 * x - z), 0.1 * np.sin(x * y + z)])
    return mesh.replace(points=(mesh.points + wave) @ TURN.T)


def points_of(mesh, per_cell=4, seed=0):
    """Return random points of every element with the row of each."""
    X, rows, start = [], [], 0
    for part in mesh.blocks:
        for cell, nodes in enumerate(part.nodes):
            X.append(part.shape.N(points_in(part.shape, per_cell, seed + cell)) @ mesh.points[nodes])
            rows += [start + cell] * per_cell
        start += len(part)
    return np.vstack(X), np.array(rows)


# ---- there and back --------------------------------------------------------------------------------


@each_element
def test_points_of_a_bent_mesh_come_back(name):
    mesh = bent(name)
    X, rows = points_of(mesh)
    found = mesh.locate(X)
    assert found.inside.all()
    np.testing.assert_allclose(found.interpolate(mesh.points), X, rtol=0, atol=1e-12)
    assert found.rows.tolist() == rows.tolist()
    assert (found.block == 0).all()
    assert (found.cell == found.rows).all()


@each_element
def test_every_node_locates_to_itself(name):
    for mesh in (kl.box((1.0, 2.0, 3.0), (2, 2, 2), name), bent(name)):
        found, (block,) = mesh.locate(mesh.points), mesh.blocks
        assert found.inside.all()
        same = block.nodes[found.cell] == np.arange(mesh.n_nodes)[:, None]
        assert same.any(axis=1).all()
        place = same.argmax(axis=1)
        assert found.xi.tolist() == block.shape.nodes[place].tolist()
        unit = np.eye(block.nodes.shape[1])[place]
        np.testing.assert_allclose(block.shape.N(found.xi), unit, rtol=0, atol=1e-12)


@each_element
def test_a_point_of_several_elements_belongs_to_the_lowest_row(name):
    mesh = bent(name, (2, 2, 2))
    nodes, shape = mesh.blocks[0].nodes, mesh.blocks[0].shape
    lowest = [int(np.flatnonzero((nodes == node).any(axis=1))[0]) for node in range(mesh.n_nodes)]
    assert mesh.locate(mesh.points).rows.tolist() == lowest
    for face in shape.faces:
        middle = shape.nodes[[a for a in face if a < shape.corners]].mean(axis=0)
        X = shape.N(middle) @ mesh.points[nodes]
        found = mesh.locate(X)
        assert found.inside.all()
        assert (found.rows <= np.arange(len(X))).all()
        assert mesh.locate(X[::-1]).rows[::-1].tolist() == found.rows.tolist()


def test_the_middle_of_a_shared_face_belongs_to_the_lower_row_whatever_the_sizes():
    pair = kl.box((1.0, 1.0, 1.0), (2, 1, 1))
    points = np.where(pair.points == [[1.0, np.nan, np.nan]], 100.0, pair.points)
    for order in ([0, 1], [1, 0]):
        mesh = kl.Mesh(points, {"KinematicLinear3D8N": pair.blocks[0].nodes[order]})
        assert mesh.locate([0.5, 0.3, 0.7]).rows == 0


@pytest.mark.parametrize(
    ("name", "size", "seed"),
    [
        ("KinematicLinear3D10N", 0.15, 8),
        ("KinematicLinear3D13N", 0.1, 2),
        ("KinematicLinear3D15N", 0.15, 9),
        ("KinematicLinear3D27N", 0.3, 6),
    ],
)
def test_a_point_whose_first_way_leads_to_another_xi_is_found(name, size, seed):
    """Newton from the middle of these cells ends outside them; from near a node it finds the point."""
    shape, rng = kl.ELEMENTS[name].shape, np.random.default_rng(seed)
    X = shape.nodes + size * rng.uniform(-1, 1, shape.nodes.shape)
    xi = points_in(shape, 2000, seed)
    if shape.cell == "pyramid":
        h = 10.0 ** -rng.uniform(0, 6, 200)
        xi = np.vstack([xi, np.column_stack([rng.uniform(-1, 1, (200, 2)) * h[:, None], 1 - h])])
    assert (np.linalg.det(np.swapaxes(shape.dN(xi), 1, 2) @ X) > 0.02).all()
    p = shape.N(xi) @ X
    assert not inverse_map(shape, X, p).inside.all()
    found = kl.Mesh(X, {name: [np.arange(len(X))]}).locate(p)
    assert found.inside.all()
    np.testing.assert_allclose(found.xi, xi, rtol=0, atol=1e-11)


def test_quarter_point_elements_locate_their_points_and_the_singular_node():
    """With mid-edge nodes at a quarter det J = 0 at the corner."""
    X = kl.ELEMENTS["KinematicLinear3D20N"].nodes.copy()
    X[[8, 11, 12]] = (X[[8, 11, 12]] + X[0]) / 2
    mesh = kl.Mesh(X, {"KinematicLinear3D20N": [np.arange(20)]})
    xi = points_in(mesh.blocks[0].shape, 200)
    p = np.vstack([mesh.blocks[0].shape.N(xi) @ X, X])
    found = mesh.locate(p)
    assert found.inside.all()
    np.testing.assert_allclose(found.interpolate(X), p, rtol=0, atol=1e-12)
    assert found.xi[200].tolist() == [-1, -1, -1]


# ---- mixed meshes, scales, gaps --------------------------------------------------------------------


def test_blocks_without_a_shape_without_cells_or_of_faces_contain_nothing():
    mesh = four_cells()
    nodes = mesh.blocks[0].nodes
    strange = kl.Block("Spring", nodes[:, :2], np.array([1]), np.array([1]), None)
    empty = kl.Block("KinematicLinear3D8N", [])
    shell = kl.Block("Shell", nodes[:, :4], np.array([1]), np.array([1]), Quadrilateral4)
    mesh = kl.Mesh(mesh.points, [strange, empty, shell, *mesh.blocks, empty])
    X, rows = points_of(four_cells(), 20)
    found = mesh.locate(X)
    assert found.rows.tolist() == (rows + 2).tolist()
    assert found.block.tolist() == (rows + 3).tolist()
    np.testing.assert_allclose(found.interpolate(mesh.points), X, rtol=0, atol=1e-12)
    only_strange = kl.Mesh(mesh.points, [strange])
    assert not only_strange.locate(X).inside.any()
    with pytest.raises(kl.MeshError, match="outside the mesh, which has no elements"):
        only_strange.locate(X[0], required=True)


@pytest.mark.parametrize(("scale", "distance"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e3), (1.0, 1e9)])
@each_element
def test_other_units_and_far_from_the_origin(name, scale, distance):
    mesh = bent(name, (2, 2, 2))
    X, _ = points_of(mesh, 3)
    mesh, X = mesh.replace(points=scale * mesh.points + distance), scale * X + distance
    found = mesh.locate(X)
    assert found.inside.all()
    error = np.abs(found.interpolate(mesh.points) - X).max()
    assert error <= 1e-12 * scale + 40 * np.finfo(float).eps * distance  # sums of 20 terms
    assert mesh.locate(mesh.points).inside.all()


def test_a_thin_gap_belongs_to_nobody():
    gap = 1e-6
    mesh = joined(*(kl.box((1.0, 1.0, 1.0), (2, 2, 2), origin=(x, 0, 0)) for x in (0, 1 + gap)))
    x = 1 + gap * np.array([-1, 1, 2, 3, 5]) / 4
    found = mesh.locate(np.column_stack([x, 0 * x + 0.3, 0 * x + 0.8]))
    assert found.inside.tolist() == [True, False, False, False, True]
    assert (found.rows >= 8).tolist() == [False, False, False, False, True]
    with pytest.raises(kl.MeshError, match=r"lies outside the mesh, about 4.9\de-07 m from element"):
        found[2].require()


@pytest.mark.parametrize(
    ("cells", "places"),
    [((60, 2, 2), lambda X: X * [0.01, 1, 1] @ exp([0.0, 0.0, 0.7]).T), ((20, 20, 1), lambda X: X**8)],
    ids=["thin and slanted", "of very different sizes"],
)
def test_cells_whose_boxes_are_hard_to_search(cells, places):
    mesh = kl.box((1.0, 1.0, 1.0), cells)
    mesh = mesh.replace(points=places(mesh.points))
    X, _ = points_of(mesh, 3)
    np.testing.assert_allclose(mesh.locate(X).interpolate(mesh.points), X, rtol=1e-12, atol=1e-16)


def test_boxes_enclose_curved_cells_and_fit_straight_ones():
    for name in NAMES:
        shape = kl.ELEMENTS[name].shape
        xi = points_in(shape, 2000)
        for seed in range(8):
            X = shape.nodes + 0.3 * np.random.default_rng(seed).uniform(-1, 1, shape.nodes.shape)
            low, high = cell_boxes(X, kl.Block(name, [np.arange(len(X))]))
            assert ((low <= shape.N(xi) @ X) & (shape.N(xi) @ X <= high)).all()
        low, high = cell_boxes(shape.nodes, kl.Block(name, [np.arange(len(X))]))
        np.testing.assert_allclose([low[0], high[0]], [shape.nodes.min(0), shape.nodes.max(0)], atol=1e-7)


@pytest.mark.parametrize("n", [0, 1, 2, 8, 9, 500])
def test_the_tree_finds_what_a_scan_finds(n):
    rng = np.random.default_rng(n)
    low = rng.uniform(0, 1, (n, 3))
    high = low + rng.uniform(0, 0.4, (n, 3))
    if n > 5:
        low[3], high[3] = np.inf, -np.inf
    x = rng.uniform(0, 1.4, (300, 3))
    at, box = BoxTree(low, high).around(x)
    scan = np.argwhere(((low <= x[:, None]) & (x[:, None] <= high)).all(axis=2))
    assert sorted(zip(at.tolist(), box.tolist(), strict=True)) == [tuple(pair) for pair in scan.tolist()]


def test_many_points_are_found_as_few_are(monkeypatch):
    mesh = bent("KinematicLinear3D20N")
    X, _ = points_of(mesh, 3)
    once = mesh.locate(X)
    monkeypatch.setattr("kratos_lite.mesh.locate.POINTS_AT_ONCE", 7)
    again = mesh.locate(X)
    assert again.rows.tolist() == once.rows.tolist()
    assert again.xi.tolist() == once.xi.tolist()


# ---- outside ---------------------------------------------------------------------------------------


@each_element
def test_points_outside_are_told_from_points_inside(name):
    mesh = kl.box((1.0, 2.0, 3.0), (2, 2, 2), name)
    x = np.random.default_rng(0).uniform(-0.5, 3.5, (500, 3))
    found, inside = mesh.locate(x), ((x >= 0) & (x <= [1, 2, 3])).all(axis=1)
    assert found.inside.tolist() == inside.tolist()
    for numbers in (found.rows, found.block, found.cell):
        assert (numbers[~inside] == -1).all()
    values = found.interpolate(mesh.points)
    assert np.isnan(found.xi[~inside]).all()
    assert np.isnan(values[~inside]).all()
    np.testing.assert_allclose(values[inside], x[inside], rtol=0, atol=1e-13)


def test_the_error_says_which_point_how_far_and_the_cure():
    mesh = kl.box((1.0, 1.0, 1.0), (2, 1, 1), element="KinematicLinear3D8N")
    points = [[0.5, 0.5, 0.5], [1.25, 0.5, 0.5], [0.0, 0.0, 9.0]]
    with pytest.raises(
        kl.MeshError,
        match=r"point 1 at \[1.25, 0.5, 0.5\] m \(and 1 more of 3\) lies outside the mesh, "
        r"about 0.25 m from element 2 \(KinematicLinear3D8N\); move it into the mesh, or choose .*\.inside",
    ):
        mesh.locate(points, required=True)
    with pytest.raises(
        kl.MeshError, match=r"^the point at \[-1.0, 0.0, 0.0\] m lies outside the mesh, about 1 m from"
    ):
        mesh.locate([-1.0, 0.0, 0.0], required=True)
    with pytest.raises(kl.MeshError, match=r"^point 0, 1 at"):
        mesh.locate([[points[0], points[1]]], required=True)
    found = mesh.locate(points)
    for refused in (found.require, found.weights):
        with pytest.raises(kl.MeshError, match="point 1 at"):
            refused()
    with pytest.raises(kl.MeshError, match="the point at"):
        found.nodes_and_weights(2)
    assert found[found.inside].require().rows.tolist() == [0]


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([[0.0, np.nan, 0.0]], "points to locate must be finite"),
        ([[0.0, 1.0]], r"shape \(m, 3\) or \(3,\); got \(1, 2\)"),
        (1.0, r"shape \(m, 3\) or \(3,\); got \(\)"),
        ("middle", "points to locate must be made of real numbers"),
    ],
)
def test_wrong_points_are_refused(points, words):
    with pytest.raises(kl.InputError, match=words):
        kl.box().locate(points)
    with pytest.raises(kl.InputError, match=r"nodal values must have shape \(8, …\); got \(7, 3\)"):
        kl.box().locate([[0.5, 0.5, 0.5]]).interpolate(np.zeros((7, 3)))


# ---- values ----------------------------------------------------------------------------------------


def test_one_point_none_and_any_leading_axes():
    mesh = bent("KinematicLinear3D8N")
    X, _ = points_of(mesh, 2)
    field = mesh.points @ [1.0, 2.0, 3.0] + 4.0
    one = mesh.locate(X[5])
    assert one.rows.shape == one.block.shape == one.cell.shape == one.interpolate(field).shape == ()
    grid = mesh.locate(X[:12].reshape(2, 6, 3))
    tensors = np.repeat(mesh.points[:, :, None], 2, axis=2)
    np.testing.assert_allclose(grid.interpolate(tensors)[..., 1], X[:12].reshape(2, 6, 3), atol=1e-13)
    none = mesh.locate(np.zeros((0, 3)))
    assert none.require().interpolate(mesh.points).shape == (0, 3)
    assert none.weights().shape == (0, mesh.n_nodes)


@each_element
def test_weights_interpolate_and_their_transpose_keeps_force_and_moment(name):
    mesh = bent(name, (2, 2, 2))
    X, _ = points_of(mesh, 3)
    found = mesh.locate(X)
    f = np.random.default_rng(2).uniform(-1, 1, X.shape)
    W = found.weights()
    nodal = W.T @ f
    v = np.random.default_rng(3).uniform(-1, 1, mesh.points.shape)
    assert np.vdot(v, nodal) == pytest.approx(np.vdot(found.interpolate(v), f), rel=1e-12)
    np.testing.assert_allclose(nodal.sum(axis=0), f.sum(axis=0), rtol=0, atol=1e-12)
    moments = (np.cross(at, force).sum(axis=0) for at, force in ((mesh.points, nodal), (X, f)))
    np.testing.assert_allclose(*moments, rtol=0, atol=1e-11)
    np.testing.assert_allclose(W @ v, found.interpolate(v), rtol=0, atol=1e-14)

"""Chains of hundreds of cells that hang together by edges and corners are mechanisms, and named so."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.model.rigid_body_modes import rigid_blocks

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0)
CUBE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])


def cells(corners):
    """Return unit cubes at whole-numbered corners (k, 3), which share the nodes where they meet."""
    every = (np.asarray(corners)[:, None] + CUBE).reshape(-1, 3)
    points, nodes = np.unique(every, axis=0, return_inverse=True)
    mesh = kl.Mesh(points.astype(float), {"KinematicLinear3D8N": nodes.reshape(-1, 8)})
    return kl.Model(mesh, STEEL)


def staircase(n, step=(1, 0, 1)):
    """Return cubes one step from each other: along an edge (two ones) or a corner (three)."""
    return cells(np.arange(n)[:, None] * np.array(step))


def hold(model, corner):
    """Fix the nodes of the cube at a corner."""
    lower = np.asarray(corner, dtype=float)
    model.fix(lambda X: ((X >= lower - 0.1) & (X <= lower + 1.1)).all(axis=1), "xyz")


def test_a_chain_on_corners_can_turn_about_all_axes():
    model = staircase(200, (1, 1, 1))
    hold(model, (0, 0, 0))
    with pytest.raises(kl.ModelError, match=r"can still move: rotation about x, y, z \(it hangs"):
        model.check()


@pytest.mark.parametrize("n", [30, 200])
def test_a_chain_on_edges_can_turn_about_them(n):
    model = staircase(n)
    hold(model, (0, 0, 0))
    with pytest.raises(kl.ModelError) as error:
        model.check()
    assert str(error.value).count("can still move") == 20
    first, second, *_ = str(error.value).split("; the component")
    assert "can still move: rotation about y (it hangs on a node or an edge only)" in first
    assert "can still move: translation (-1 0 1); rotation about y (it hangs" in second


@pytest.mark.parametrize("step", [(1, 0, 1), (1, 1, 1)])
def test_a_chain_whose_cells_are_all_held_is_none(step):
    model = staircase(200, step)
    model.fix(lambda X: np.ones(len(X), dtype=bool), "xyz"[: 3 if step[1] else 2])
    if not step[1]:
        model.fix(lambda X: X[:, 1] == 0, "z")
    model.check()


def test_one_free_hinge_among_hundreds_of_held_cells_is_found():
    model = staircase(200)
    model.fix(lambda X: np.abs(X[:, 0] - 100.5) > 0.6, "xyz")
    model.check()  # held on both of its edges
    model = staircase(200)
    model.fix(lambda X: X[:, 0] + X[:, 2] < 399, "xyz")
    with pytest.raises(kl.ModelError) as error:
        model.check()
    assert str(error.value).count("can still move") == 1
    assert "can still move: rotation about y (it hangs on a node or an edge only)" in str(error.value)


def ring(n):
    """Return a closed ring of cubes on edges along y: n steps up, n down, and back."""
    turns = ((1, 1), (1, -1), (-1, -1), (-1, 1))
    corners = [(0, 0)]
    for dx, dz in turns:
        for _ in range(n):
            corners.append((corners[-1][0] + dx, corners[-1][1] + dz))
    return cells([(x, 0, z) for x, z in corners[:-1]])


@pytest.mark.parametrize("n", [4, 50])
def test_a_closed_ring_of_hinges_is_a_mechanism(n):
    """A linkage of 4 n bars in a plane: all but three of its angles are free."""
    model = ring(n)
    hold(model, (0, 0, 0))
    with pytest.raises(kl.ModelError, match=r"can still move: rotation about y \(it hangs"):
        model.check()


def test_a_closed_ring_of_hinges_that_is_held_in_its_plane_is_none():
    model = ring(50)
    model.fix(lambda X: X[:, 1] == 0, "xyz")
    model.check()


def test_chains_and_blocks_mixed():
    """Blocks of two cells that share a face turn as one; their hinges stay hinges."""
    model = cells([(2 * i + j, 0, i) for i in range(150) for j in (0, 1)])
    hold(model, (0, 0, 0))
    with pytest.raises(kl.ModelError, match=r"\(12 nodes\) can still move: rotation about y \(it hangs"):
        model.check()


def test_blocks_that_share_three_nodes_are_one():
    """Linear cells beside quadratic ones share the corners of a face, but no face."""
    fine = kl.box((1, 1, 100), (1, 1, 100), "KinematicLinear3D20N")
    nodes = fine.blocks[0].nodes
    blocks = {"KinematicLinear3D20N": nodes[::2], "KinematicLinear3D8N": nodes[1::2, :8]}
    assert rigid_blocks(kl.Mesh(fine.points, blocks)).count == 1


def test_the_cost_grows_with_the_number_of_cells(monkeypatch):
    """No full matrix of all modes is made."""
    sizes = []
    plain = np.linalg.svd
    monkeypatch.setattr(np.linalg, "svd", lambda A, **k: sizes.append(np.shape(A)[-1]) or plain(A, **k))
    model = staircase(800)
    hold(model, (0, 0, 0))
    with pytest.raises(kl.ModelError, match="can still move"):
        model.check()
    assert max(sizes) <= 12

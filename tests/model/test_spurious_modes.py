"""Reduced integration is refused where elements can deform without stress: against dense eigenvalues."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.model.spurious_modes import check_spurious_modes

STEEL = kl.Isotropic3D(E=1.0, nu=0.3)
ROW = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
SQUARE = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
L = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
CLAMP = (("x-", "xyz"),)
BRIDGE = [*SQUARE, (2, 0, 0), (3, 0, 0), (4, 0, 0), (3, 1, 0), (4, 1, 0)]


def cubes(places, element, supports=()):
    """Return unit cubes at places, with supports on the sides x- … z+ of the whole grid."""
    n = [max(place[axis] for place in places) + 1 for axis in range(3)]
    mesh = kl.box(n, n, element)
    block = mesh.blocks[0]
    corner = mesh.points[block.nodes].min(axis=1).round().astype(int).tolist()
    wanted = [row for row, place in enumerate(corner) if tuple(place) in places]
    used, nodes = np.unique(block.nodes[wanted], return_inverse=True)
    part = kl.Mesh(mesh.points[used], {element: nodes.reshape(-1, 20)})
    model = kl.Model(part, STEEL)
    for side, axes in supports:
        axis = "xyz".index(side[0])
        at = part.points[:, axis] == (0 if side[1] == "-" else n[axis])
        model.fix(at, axes)
    return model


def stiffness(model):
    """Return the dense stiffness of the free degrees of freedom, element by element."""
    K = np.zeros((3 * model.mesh.n_nodes,) * 2)
    for group in model.element_groups():
        for nodes, k in zip(group.nodes, group.at(model.mesh.points).stiffness(STEEL.C), strict=True):
            dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
            K[np.ix_(dofs, dofs)] += k
    free = ~model.supports.fixed.ravel()
    return K[np.ix_(free, free)]


def spurious(places, supports):
    """Return how many modes have no energy with 2x2x2 points beyond those with 3x3x3."""
    counts = []
    for element in ("Reduced3D20N", "KinematicLinear3D20N"):
        values = np.linalg.eigvalsh(stiffness(cubes(places, element, supports)))
        counts.append(int((values < 1e-9 * values.max()).sum()))
    return counts[0] - counts[1]


def refused(places, supports):
    model = cubes(places, "Reduced3D20N", supports)
    try:
        check_spurious_modes(model.mesh, model.element_groups(), model.supports)
    except kl.ModelError:
        return True
    return False


@pytest.mark.parametrize(
    ("places", "supports", "modes"),
    [
        (ROW[:1], (), 6),
        (ROW[:2], (), 3),
        (ROW, (), 4),
        (ROW, CLAMP, 3),
        (ROW[:1], CLAMP, 1),
        (ROW[:1], (("x-", "xyz"), ("x+", "xyz")), 0),
        (ROW, (("x-", "xyz"), ("x+", "xyz")), 2),
        (L, (), 2),
        (SQUARE, (), 0),
        (SQUARE, CLAMP, 0),
        ([*BRIDGE[:4], (2, 0, 0)], (), 1),
        (BRIDGE, (), 0),
        (ROW[:2], (("y-", "y"),), 0),
        (ROW[:2], (("x-", "x"),), 3),
        (ROW[:1], (("x-", "x"), ("y-", "y")), 0),
    ],
)
def test_elements_are_refused_where_dense_eigenvalues_show_spurious_modes(places, supports, modes):
    assert spurious(places, supports) == modes
    assert refused(places, supports) == (modes > 0)


def test_random_patches_with_random_supports_are_never_wrongly_accepted():
    rng, seen = np.random.default_rng(5), []
    for _ in range(25):
        n = rng.integers(1, 3, 3)
        every = [(i, j, k) for i in range(n[0]) for j in range(n[1]) for k in range(n[2])]
        places = [place for place in every if rng.random() < 0.8] or every[:1]
        sides = [f"{'xyz'[rng.integers(3)]}{'-+'[rng.integers(2)]}" for _ in range(rng.integers(3))]
        supports = [(side, str(rng.choice(["xyz", side[0], "y"]))) for side in sides]
        try:
            modes = spurious(places, supports)
        except kl.ModelError:
            continue  # no node lies on that side
        assert modes == 0 or refused(places, supports), (places, supports)
        seen.append(modes == 0)
    assert 0 < sum(seen) < len(seen)


def test_a_model_of_a_chain_is_refused_with_an_element_and_the_cure():
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1), "Reduced3D20N"), STEEL)
    model.fix("x-")
    message = r"element 1 \(Reduced3D20N\) .*deform without stress.*take BBar3D20N or KinematicLinear3D20N"
    with pytest.raises(kl.ModelError, match=message):
        model.solve()
    with pytest.raises(kl.ModelError, match=message):
        model.modes(3)
    named = kl.Model(kl.box((4, 1, 1), (4, 1, 1), "KinematicLinear3D20N"), STEEL, formulation="reduced")
    named.fix("x-")
    with pytest.raises(kl.ModelError, match=message):
        named.check()


def test_a_neighbor_with_full_integration_holds_a_reduced_one():
    mesh = kl.box((3, 1, 1), (3, 1, 1), "Reduced3D20N")
    nodes = mesh.blocks[0].nodes
    model = kl.Model(
        kl.Mesh(mesh.points, {"KinematicLinear3D20N": nodes[[0, 2]], "Reduced3D20N": nodes[1:2]}), STEEL
    )
    values = np.linalg.eigvalsh(stiffness(model))
    assert (values < 1e-9 * values.max()).sum() == 6
    check_spurious_modes(model.mesh, model.element_groups(), model.supports)

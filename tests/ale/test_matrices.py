"""The scalar matrices of a motion, those of the shape in all formulations: exact, and on any mesh."""

import numpy as np
import pytest
from meshes import NAMES, elsewhere

import kratos_lite as kl
from kratos_lite.ale import Rotation, Translation
from kratos_lite.bodies.rotations import exp
from kratos_lite.elements.surface import area_vectors
from kratos_lite.quadrature import rule_for

UNIT = kl.Isotropic3D(E=1.0, nu=0.3, density=1.0)


def one(kind: str) -> kl.Model:
    """Return one element on the unit cube or the unit simplex, with density 1."""
    shape = kl.ELEMENTS[kind].shape
    X = (shape.nodes + 1) / 2 if shape.cell == "hexahedron" else shape.nodes
    return kl.Model(kl.Mesh(X, {kind: [range(len(X))]}), UNIT)


def distorted(kind: str) -> kl.Model:
    """Return a box whose nodes are mapped by a curved function, away from the origin."""
    mesh = kl.box((1.0, 0.8, 0.6), (2, 2, 2), kind, origin=(0.3, -0.2, 0.1))
    x, y, z = mesh.points.T
    shift = 0.06 * np.column_stack([np.sin(2 * y + z), np.cos(3 * x), np.sin(x + 2 * y) * z])
    mesh = mesh.replace(points=mesh.points + shift)
    return kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3, density=2.5))


def scaled(matrix: np.ndarray) -> float:
    return float(np.abs(matrix).max())


# ---- exact values ----------------------------------------------------------------------------------


def test_rotation_of_the_unit_cube(wheels):
    m = wheels.matrices(Rotation("z"), one("KinematicLinear3D8N"))
    G = np.array([[0, 2, 0, -2, 0, 1, 0, -1], [0, 4, -2, -2, 0, 2, -1, -1]]) / 72
    H = np.array(
        [
            [4, -4, 4, -4, 2, -2, 2, -2],
            [-4, 124, -34, -86, -2, 62, -17, -43],
        ]
    )
    np.testing.assert_allclose(m.G[:2], G, atol=1e-15)
    np.testing.assert_allclose(m.H[:2], H / 1080, atol=1e-15)
    assert abs(np.trace(m.G)) < 1e-15
    assert np.trace(m.H) == pytest.approx(79 / 135, rel=1e-14)
    assert np.abs(m.G).sum() == pytest.approx(7 / 6, rel=1e-14)
    assert np.abs(m.H).sum() == pytest.approx(9 / 5, rel=1e-14)


def test_loads_of_the_unit_cube(wheels):
    terms = wheels.matrices(Rotation("z"), one("KinematicLinear3D8N")).terms
    centrifugal, euler = terms.centrifugal * 24, terms.euler * 24
    np.testing.assert_allclose(centrifugal[:, 0], [1, 2, 2, 1, 1, 2, 2, 1], atol=1e-14)
    np.testing.assert_allclose(centrifugal[:, 1], [1, 1, 2, 2, 1, 1, 2, 2], atol=1e-14)
    np.testing.assert_allclose(euler[:, 0], [-1, -1, -2, -2, -1, -1, -2, -2], atol=1e-14)
    np.testing.assert_allclose(euler[:, 1], [1, 2, 2, 1, 1, 2, 2, 1], atol=1e-14)
    assert not centrifugal[:, 2].any()
    assert not euler[:, 2].any()


def test_translation_of_the_unit_cube(wheels):
    m = wheels.matrices(Translation("x"), one("KinematicLinear3D8N"))
    np.testing.assert_allclose(m.G[0] * 72, [4, -4, -2, 2, 2, -2, -1, 1], atol=1e-14)
    np.testing.assert_allclose(m.H[0] * 36, [4, -4, -2, 2, 2, -2, -1, 1], atol=1e-14)
    assert np.abs(m.G).sum() == pytest.approx(2, rel=1e-14)
    assert np.abs(m.H).sum() == pytest.approx(4, rel=1e-14)
    assert not m.terms.centrifugal.any()
    assert not m.terms.euler.any()


def test_unit_simplex(wheels):
    m = wheels.matrices(Rotation("z"), one("KinematicLinear3D4N"))
    np.testing.assert_allclose(m.G[:2] * 120, [[0, 1, -1, 0], [1, 1, -2, 0]], atol=1e-14)
    np.testing.assert_allclose(m.H[0] * 120, [2, -1, -1, 0], atol=1e-14)
    assert np.abs(m.G).sum() == pytest.approx(0.1, rel=1e-14)
    assert np.abs(m.H).sum() == pytest.approx(0.1, rel=1e-14)
    t = wheels.matrices(Translation("x"), one("KinematicLinear3D4N"))
    np.testing.assert_allclose(t.G[0] * 24, [1, -1, 0, 0], atol=1e-14)
    np.testing.assert_allclose(t.H[0] * 6, [1, -1, 0, 0], atol=1e-14)


# ---- what holds on any mesh ------------------------------------------------------------------------

MOTIONS = {
    "rotation": Rotation((1.0, 2.0, -0.5), center=(0.3, -4.0, 1.0)),
    "translation": Translation((1.0, -0.4, 0.3)),
}


@pytest.mark.parametrize("kind", NAMES)
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_constants_and_linear_fields(kind, motion, wheels):
    """G 1 = H 1 = 0, and G u = M (c·grad u) of a linear u, whose gradient every element has exactly."""
    model = distorted(kind)
    X, L = model.mesh.points, np.random.default_rng(7).standard_normal((3, 3))
    m = wheels.matrices(motion, model)
    ones = np.ones(len(X))
    assert scaled(m.G @ ones) < 1e-14 * scaled(m.G) * len(X)
    assert scaled(m.H @ ones) < 1e-14 * scaled(m.H) * len(X)
    np.testing.assert_allclose(m.H, m.H.T, atol=1e-15 * scaled(m.H))
    assert np.linalg.eigvalsh(m.H).min() > -1e-13 * scaled(m.H)
    c = motion.field(X) @ L.T
    assert scaled(m.G @ X @ L.T - m.M @ c) <= 1e-14 * scaled(np.abs(m.G) @ np.abs(X @ L.T))


def affine(kind: str) -> kl.Mesh:
    """Return a sheared box of affine cells."""
    mesh = kl.box((1.0, 0.8, 0.6), (3, 3, 3), kind, origin=(0.3, -0.2, 0.1))
    mesh = mesh.replace(points=mesh.points @ np.array([[1.0, 0.2, 0.1], [0.0, 0.9, -0.3], [0.1, 0.0, 1.1]]))
    return mesh


STRAIGHT = [
    kind for kind in NAMES if kl.ELEMENTS[kind].shape.cell == "hexahedron" or kind[-2:] in ("4N", "6N")
]


def skewed(kind: str) -> kl.Mesh:
    """Return a box under a trilinear map, whose cells are no parallelepipeds but have straight edges."""
    mesh = kl.box((1.0, 0.8, 0.6), (3, 3, 3), kind, origin=(0.3, -0.2, 0.1))
    x, y, z = mesh.points.T
    shift = np.column_stack([0.4 * x * y * z + 0.2 * y * z, 0.3 * x * z - 0.2 * y * x, 0.5 * x * y])
    return mesh.replace(points=mesh.points + shift)


@pytest.mark.parametrize(
    ("kind", "shaped"), [(kind, affine) for kind in NAMES] + [(kind, skewed) for kind in STRAIGHT]
)
def test_second_derivative_inside(kind, shaped, wheels):
    """-H u = M (L A² X) of a linear u where the test function vanishes on the boundary, at inner nodes.

    The rule has this exactly on skewed cells, too, although (c·grad N_i)(c·grad N_j) is no polynomial there.
    """
    mesh = shaped(kind)
    motion, L = MOTIONS["rotation"], np.random.default_rng(5).standard_normal((3, 3))
    model = kl.Model(mesh, UNIT)
    m = wheels.matrices(motion, model)
    inside = np.ones(mesh.n_nodes, dtype=bool)
    for part in ("x-", "x+", "y-", "y+", "z-", "z+"):
        inside[mesh.nodes(part)] = False
    expected = m.M @ ((mesh.points - motion.center) @ (L @ motion.A @ motion.A).T)
    size = scaled(np.abs(m.H) @ np.abs(mesh.points @ L.T))
    assert scaled((m.H @ mesh.points @ L.T + expected)[inside]) <= 1e-13 * size
    assert scaled(expected[inside]) > 1e-6 * size


def boundary_flux(model: kl.Model, motion) -> np.ndarray:
    """Return ∫ ρ N_i N_j c·n dA over the boundary, (n, n), by a rule fine enough for curved faces."""
    out = np.zeros((model.mesh.n_nodes,) * 2)
    for block in model.mesh.boundary:
        rule = rule_for(block.shape.cell, 9)
        X = model.mesh.points[block.nodes]
        N = np.array([block.shape.N(xi) for xi in rule.points])
        flux = (motion.field(N @ X) * area_vectors(block.shape, X, rule)).sum(axis=-1)
        local = 2.5 * (N.T * flux[:, None, :]) @ N
        for nodes, matrix in zip(block.nodes, local, strict=True):
            out[np.ix_(nodes, nodes)] += matrix
    return out


@pytest.mark.parametrize("kind", NAMES)
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_symmetric_part_is_the_flux_through_the_boundary(kind, motion, wheels):
    model = distorted(kind)
    m = wheels.matrices(motion, model)
    np.testing.assert_allclose(m.G + m.G.T, boundary_flux(model, motion), atol=1e-13 * scaled(m.G))
    np.testing.assert_allclose(m.S, (m.G - m.G.T) / 2, atol=1e-16)


@pytest.mark.parametrize("kind", ["KinematicLinear3D8N", "KinematicLinear3D10N"])
def test_objectivity(kind, wheels):
    """Mesh, axis and center turned and shifted far away together: the same matrices, turned loads."""
    R, shift = exp(np.array([0.4, -1.1, 0.7])), np.array([300.0, -200.0, 50.0])
    model = distorted(kind)
    turned = elsewhere(model, model.mesh.points @ R.T + shift)
    axis, center = np.array([1.0, 2.0, -0.5]), np.array([0.3, -0.1, 0.2])
    a = wheels.matrices(Rotation(axis, center=center), model)
    b = wheels.matrices(Rotation(R @ axis, center=R @ center + shift), turned)
    for name in "GH":
        np.testing.assert_allclose(getattr(b, name), getattr(a, name), atol=1e-12 * scaled(getattr(a, name)))
    np.testing.assert_allclose(
        b.terms.centrifugal, a.terms.centrifugal @ R.T, atol=1e-11 * scaled(a.terms.centrifugal)
    )
    np.testing.assert_allclose(b.terms.euler, a.terms.euler @ R.T, atol=1e-11 * scaled(a.terms.euler))
    c, d = (wheels.matrices(Translation(v), m) for v, m in ((axis, model), (R @ axis, turned)))
    np.testing.assert_allclose(d.G, c.G, atol=1e-12 * scaled(c.G))


@pytest.mark.parametrize("kind", ["8N", "20N", "27N"])
def test_nothing_passes_through_a_uniform_rim(kind, wheels):
    """On meshes alike all around G is skew; on graded ones it is not, and S is its skew part."""
    model = wheels.disk(kind, 2, 16)
    m = wheels.matrices(Rotation("z"), model)
    share = scaled(m.G.T @ np.ones(len(m.G))) / scaled(m.G)
    assert share < (1e-13 if kind == "8N" else 2e-3)
    if kind == "8N":
        np.testing.assert_allclose(m.S, m.G, atol=1e-14 * scaled(m.G))
    model = graded(model)
    g = wheels.matrices(Rotation("z"), model)
    assert scaled(g.G + g.G.T) > 1e-3 * scaled(g.G)
    np.testing.assert_array_equal(g.S, -g.S.T)


def graded(model: kl.Model) -> kl.Model:
    """Return a wheel whose nodes are moved around the axis so that no mirror symmetry is left."""
    mesh = model.mesh
    r, angle = np.hypot(*mesh.points.T[:2]), np.arctan2(mesh.points[:, 1], mesh.points[:, 0])
    angle = angle + 0.4 * np.sin(angle) + 0.25 * np.sin(2 * angle + 0.7)
    return elsewhere(model, np.column_stack([r * np.cos(angle), r * np.sin(angle), mesh.points[:, 2]]))

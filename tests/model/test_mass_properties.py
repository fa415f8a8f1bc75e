"""Mass properties: closed forms, an integration over the surface, and everything that must be refused."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from meshes import NAMES, four_cells

import kratos_lite as kl
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import InputError, MeshError, ModelError
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.shapes.faces import FACE_SHAPES

each_element = pytest.mark.parametrize("name", NAMES)


def steel(density=7.0):
    return kl.Isotropic3D(E=1.0, nu=0.3, density=density)


def group(name, nodes, density=7.0):
    kind, nodes = ELEMENTS[name], np.atleast_2d(nodes).astype(np.int32)
    return ElementGroup(kind, kind.rule, steel(density), nodes, np.arange(len(nodes)))


def of_mesh(mesh, density=7.0):
    return MassProperties.of(mesh.points, kl.Model(mesh, steel(density)).element_groups())


def of_cell(name, X, density=7.0):
    return MassProperties.of(X, [group(name, np.arange(len(X)), density)])


def distorted(name, seed=1, size=0.1):
    X = ELEMENTS[name].nodes
    return X + size * np.random.default_rng(seed).uniform(-1, 1, X.shape)


def by_surface(shape, X):
    """Return ∫1, ∫X (3,), ∫XX^T (3, 3) of a cell by ∫ f dV = ∮ f x·n dA / (3 + degree of f)."""
    x, w = np.polynomial.legendre.leggauss(12)
    r, s = (a.ravel() for a in np.meshgrid(x, x))
    weights = np.outer(w, w).ravel()
    total = [0.0, np.zeros(3), np.zeros((3, 3))]
    for face in shape.faces:
        side = FACE_SHAPES[len(face)]
        if side.corners == 3:  # a square collapsed on the triangle
            points = np.column_stack([(1 + r) / 2, (1 - r) * (1 + s) / 4])
            gamma = weights * (1 - r) / 8
        else:
            points, gamma = np.column_stack([r, s]), weights
        Y, tangents = side.N(points) @ X[list(face)], X[list(face)].T @ side.dN(points)
        flux = (Y * np.cross(tangents[..., 0], tangents[..., 1])).sum(axis=1) * gamma
        total[0] += flux.sum() / 3
        total[1] += flux @ Y / 4
        total[2] += (Y * flux[:, None]).T @ Y / 5
    return total


def assert_same(one, other, rtol=1e-12, atol=0.0):
    for name in ("mass", "volume", "center", "euler", "inertia"):
        a, b = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(a, b, rtol=rtol, atol=atol + rtol * np.abs(b).max(), err_msg=name)


# ---- closed forms ----------------------------------------------------------------------------------


@each_element
def test_a_box_of_any_element_has_the_moments_of_a_box(name):
    mesh = kl.box((0.4, 0.6, 1.0), cells=(1, 2, 3), element=name, origin=(-0.2, -0.3, -0.5))
    body = of_mesh(mesh, density=1000.0)
    assert_same(body, MassProperties.box((0.4, 0.6, 1.0), 1000.0), atol=1e-14)
    np.testing.assert_allclose(body.euler, np.diag([3.2, 7.2, 20.0]), rtol=1e-13, atol=1e-13)


@each_element
def test_distorted_cells_as_by_the_divergence_theorem(name):
    for seed in range(3):
        X = distorted(name, seed)
        volume, first, second = by_surface(ELEMENTS[name].shape, X)
        center = first / volume
        expected = MassProperties(
            7 * volume,
            volume=volume,
            center=center,
            euler=7 * (second - volume * np.outer(center, center)),
        )
        assert_same(of_cell(name, X), expected)


def test_a_ball_of_curved_elements_converges_with_the_fourth_power():
    errors = []
    for n in (2, 4):
        mesh = kl.box((2.0, 2.0, 2.0), (n, n, n), "KinematicLinear3D27N", origin=(-1.0, -1.0, -1.0))
        x = mesh.points
        length = np.maximum(np.linalg.norm(x, axis=1), 1e-300)
        mesh = mesh.replace(points=x * (np.abs(x).max(axis=1) / length)[:, None])
        body, ball = of_mesh(mesh), MassProperties.ball(1.0, 7.0)
        assert np.abs(body.center).max() < 1e-14
        np.testing.assert_allclose(body.euler, body.euler[0, 0] * np.eye(3), atol=1e-13)
        errors.append([abs(body.volume / ball.volume - 1), abs(body.inertia[0, 0] / ball.inertia[0, 0] - 1)])
    assert max(errors[1]) < 1.1e-3
    assert (np.array(errors[0]) / errors[1] > 13).all()


# ---- several cells, materials, places --------------------------------------------------------------


def test_a_mixed_mesh_with_a_density_per_block_is_the_sum_of_its_cells():
    mesh = four_cells()
    points, cells = mesh.points, {block.name: block.nodes[0] for block in mesh.blocks}
    densities = dict(zip(cells, (1.0, 20.0, 3.0, 400.0), strict=True))
    groups = [group(name, nodes, densities[name]) for name, nodes in cells.items()]
    empty = replace(groups[0], nodes=groups[0].nodes[:0], rows=groups[0].rows[:0])
    body = MassProperties.of(points, [empty, *groups])
    alone = [of_cell(name, points[nodes], densities[name]) for name, nodes in cells.items()]
    mass = sum(part.mass for part in alone)
    center = sum(part.mass * part.center for part in alone) / mass
    euler = sum(
        part.euler + part.mass * np.outer(part.center - center, part.center - center) for part in alone
    )
    volume = sum(part.volume for part in alone)
    assert_same(body, MassProperties(mass, volume=volume, center=center, euler=euler))


@each_element
def test_a_body_far_away_loses_only_what_its_coordinates_lose(name):
    X = np.round(distorted(name) * 2**20) / 2**20  # 20 bits: the same at 1e6 m, where 2^-33 is the last
    near, far = of_cell(name, X), of_cell(name, X + 1e6)
    assert_same(far.with_(center=near.center), near, rtol=1e-14)
    np.testing.assert_allclose(far.center - 1e6, near.center, rtol=0, atol=2e-9)


def test_the_order_of_magnitude_of_a_thin_plate_survives():
    mesh = kl.box((1.0, 1.0, 1e-7), cells=(2, 2, 1), origin=(5.0, 5.0, 0.0))
    np.testing.assert_allclose(of_mesh(mesh).euler[2, 2], 7e-7 * 1e-14 / 12, rtol=1e-12)


# ---- values that are given -------------------------------------------------------------------------


def test_a_top_without_a_mesh():
    top = MassProperties(mass=1.0, inertia=np.diag([5.0, 10.0, 1.0]))
    assert top.inertia.tolist() == np.diag([5.0, 10.0, 1.0]).tolist()
    assert top.euler.tolist() == np.diag([3.0, -2.0, 7.0]).tolist()
    assert top.center.tolist() == [0, 0, 0]
    assert np.isnan(top.volume)
    with pytest.raises(ModelError, match="needs its volume"):
        top.check_deformable()
    with pytest.raises(ModelError, match=r"smallest eigenvalue is -2 kg m².*triangle inequality"):
        top.with_(volume=1.0).check_deformable()
    MassProperties.box((1.0, 2.0, 3.0), 1.0).check_deformable()


def test_values_are_read_only():
    top = MassProperties(mass=1.0, inertia=np.eye(3))
    with pytest.raises(FrozenInstanceError):
        top.mass = 2.0
    with pytest.raises(ValueError, match="read-only"):
        top.inertia[0, 0] = 2.0


def test_single_values_are_replaced_and_the_others_stay():
    body = MassProperties.box((1.0, 2.0, 3.0), 6.0)
    heavy = body.with_(mass=99.0)
    assert_same(heavy.with_(mass=body.mass), body, rtol=1e-16)
    turned = body.with_(inertia=np.diag([4.0, 5.0, 6.0]), center=[1.0, 0.0, 0.0])
    assert turned.euler.diagonal().tolist() == [3.5, 2.5, 1.5]
    assert float(turned.mass) == 36.0
    assert replace(body, mass=99.0).mass == 99.0
    assert body.with_(euler=np.eye(3)).inertia.tolist() == (2 * np.eye(3)).tolist()
    with pytest.raises(InputError, match=r"contradict each other.*with_\(inertia=…\)"):
        replace(body, inertia=np.eye(3))
    with pytest.raises(InputError, match="no 'weight'; its values are mass, inertia, volume, center, euler"):
        body.with_(weight=1.0)


def test_many_bodies_at_once():
    sides = np.array([[1.0, 2.0, 3.0], [0.4, 0.6, 1.0]])
    boxes = MassProperties.box(sides, [1.0, 1000.0])
    single = [MassProperties.box(side, rho) for side, rho in zip(sides, (1.0, 1000.0), strict=True)]
    assert boxes.euler.shape == (2, 3, 3)
    assert_same(boxes, MassProperties.stack(single), rtol=1e-16)
    tops = MassProperties(mass=[1.0, 2.0, 3.0], inertia=np.eye(3))
    assert tops.inertia.shape == (3, 3, 3)
    assert tops.center.shape == (3, 3)
    assert tops.volume.shape == (3,)
    assert MassProperties.ball([[1.0], [2.0]], [5.0, 6.0, 7.0]).mass.shape == (2, 3)
    assert MassProperties.stack([boxes, boxes]).mass.shape == (2, 2)
    boxes.check_deformable()
    ball = MassProperties.ball(0.5, 3.0)
    np.testing.assert_allclose(ball.inertia, 0.4 * np.pi / 2 * 0.25 * np.eye(3), rtol=1e-15)


# ---- what is refused -------------------------------------------------------------------------------

EYE, BALL, BALLS = np.eye(3), MassProperties.ball(1.0, 1.0), MassProperties.ball([1.0], 1.0)


@pytest.mark.parametrize(
    ("values", "kind", "words"),
    [
        ({"mass": 0.0, "inertia": EYE}, ModelError, "mass of a body must be > 0 kg; got 0"),
        ({"mass": [1.0, -2.0], "inertia": EYE}, ModelError, "mass of a body must be > 0 kg; got -2"),
        ({"mass": np.nan, "inertia": EYE}, InputError, "mass of a body must be finite"),
        ({"mass": "1 kg", "inertia": EYE}, InputError, "mass of a body must be made of real numbers"),
        ({"mass": 1.0, "inertia": EYE, "volume": 0.0}, ModelError, "volume of a body must be > 0 m³; got 0"),
        ({"mass": 1.0, "inertia": EYE, "volume": np.inf}, InputError, "volume of a body must be finite"),
        ({"mass": 1.0, "inertia": EYE, "volume": "big"}, InputError, "volume of a body must be made of real"),
        ({"mass": 1.0, "inertia": EYE, "center": [0.0]}, InputError, r"center .* \(..., 3\); got \(1,\)"),
        ({"mass": 1.0}, InputError, "a body needs its inertia"),
        ({"mass": 1.0, "inertia": [5.0, 10.0, 1.0]}, InputError, r"inertia .* \(..., 3, 3\); got \(3,\)"),
        ({"mass": 1.0, "inertia": EYE, "euler": EYE}, InputError, "contradict each other"),
        ({"mass": 1.0, "inertia": [EYE, EYE], "euler": EYE}, InputError, "contradict each other"),
        ({"mass": 1.0, "inertia": EYE + np.eye(3, k=1)}, ModelError, "symmetric; entries differ by 1 kg"),
        ({"mass": 1.0, "inertia": np.diag([1.0, 2.0, -3.0])}, ModelError, "smallest eigenvalue is -3 kg"),
        ({"mass": 1.0, "inertia": np.diag([1.0, 1.0, 0.0])}, ModelError, "positive definite"),
        ({"mass": 1.0, "inertia": np.ones((3, 3))}, ModelError, "positive definite"),
        ({"mass": 1.0, "euler": np.diag([1.0, 0.0, 0.0])}, ModelError, "not a straight line"),
        ({"mass": [1.0, 2.0], "inertia": [EYE] * 3}, InputError, r"leading axes .* mass \(2,\), inertia"),
    ],
)
def test_wrong_values_are_refused(values, kind, words):
    with pytest.raises(kind, match=words):
        MassProperties(**values)


def test_wrong_boxes_balls_and_stacks_are_refused():
    for make, error, text in (
        (lambda: MassProperties.box((1.0, 0.0, 1.0), 1.0), ModelError, "side of a body must be > 0 m; got 0"),
        (lambda: MassProperties.box((1.0, 1.0), 1.0), InputError, "side of a body"),
        (lambda: MassProperties.ball(1.0, -1.0), ModelError, "density of a body must be > 0 kg/m³; got -1"),
        (lambda: MassProperties.stack([]), InputError, "got none"),
        (lambda: MassProperties.stack([BALL, BALLS]), InputError, "same leading axes"),
    ):
        with pytest.raises(error, match=text):
            make()


def test_broken_meshes_are_refused():
    name, mesh = "KinematicLinear3D8N", kl.box((1.0, 1.0, 1.0), cells=(3, 1, 1))
    nodes = mesh.blocks[0].nodes.copy()
    with pytest.raises(MeshError, match="no elements"):
        MassProperties.of(mesh.points, [])
    with pytest.raises(ModelError, match=r"density 0.*give each material a density"):
        MassProperties.of(mesh.points, [group(name, nodes, 0.0)])
    with pytest.raises(InputError, match="points of a mesh must be finite"):
        MassProperties.of(mesh.points * np.nan, [group(name, nodes)])
    with pytest.raises(MeshError, match=r"index 0 .*has volume 0 m³"):
        MassProperties.of(mesh.points * [1, 1, 0], [group(name, nodes)])
    nodes[1] = nodes[1][[4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(MeshError, match=r"index 1 .*3D8N\) has volume -0\.333 m³.*reoriented\(\)"):
        MassProperties.of(mesh.points, [group(name, nodes)])

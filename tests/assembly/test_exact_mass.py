"""Mass, body forces and volumes of cells of any geometry beside rules of a much higher degree."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from computing import compiled, same_on_all_threads
from meshes import NAMES
from rounding import close
from systems import pattern_of

import kratos_lite as kl
from kratos_lite.ale import MotionMatrices, Rotation
from kratos_lite.assembly import element_groups
from kratos_lite.assembly.gauss_point_fields import body_force
from kratos_lite.assembly.mass_and_convection import inertia_matrices, lumped_mass
from kratos_lite.elements.exact_rules import AFFINE, CURVED, STRAIGHT, exact_rule, geometries
from kratos_lite.elements.surface import surface_pressure
from kratos_lite.quadrature import hexahedron, rule_for, tetrahedron
from kratos_lite.shapes.faces import Quadrilateral4, Quadrilateral8, Quadrilateral9, Triangle3, Triangle6
from kratos_lite.solvers.mass import Mass

FACES = (Triangle3, Triangle6, Quadrilateral4, Quadrilateral8, Quadrilateral9)
GEOMETRIES = ("ideal", "affine", "straight", "curved")
SHEAR = np.array([[1.0, 0.2, 0.1], [0.0, 0.9, -0.3], [0.1, 0.0, 1.1]])


def cell(kind, geometry):
    """Return the nodes (n, 3) of a cell."""
    shape, rng = kl.ELEMENTS[kind].shape, np.random.default_rng(len(kind) + len(geometry))
    if geometry == "ideal":
        return shape.nodes
    if geometry == "straight":
        linear = shape.linear()
        corners = linear.nodes @ SHEAR + rng.uniform(-0.2, 0.2, linear.nodes.shape)
        return linear.N(shape.nodes) @ corners
    return shape.nodes @ SHEAR + 0.3 + (geometry == "curved") * rng.uniform(-0.08, 0.08, shape.nodes.shape)


@cache
def table(shape):
    """Return weights (g,), N (g, n) and dN (g, n, 3) of a rule of degree 19."""
    rule = rule_for(shape.cell, 19)
    return rule.weights, shape.N(rule.points), shape.dN(rule.points)


def fine(shape, X):
    """Return N (g, n), dN/dX (g, n, 3), and the volumes (g,) of a rule of degree 19."""
    weights, N, dN = table(shape)
    J = X.T @ dN
    return N, dN @ np.linalg.inv(J), np.linalg.det(J) * weights


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", NAMES)
def test_mass_body_force_and_volume_are_those_of_a_rule_of_much_higher_degree(kind, geometry):
    X = cell(kind, geometry)
    element = kl.ELEMENTS[kind](X)
    N, _, dV = fine(element.shape, X)
    M, b = (N.T * dV) @ N, np.random.default_rng(1).uniform(-1, 1, X.shape)
    close(element.scalar_mass(), M)
    close(element.body_force(b), M @ b)
    close(element.body_force((1.0, -2.0, 3.0)), np.outer(dV @ N, (1.0, -2.0, 3.0)))
    close(element.volume(), dV.sum())
    close(element.lumped_mass(2.0).sum(), 2 * dV.sum())


def test_the_mass_of_each_element_has_its_own_density():
    X = np.stack([cell("KinematicLinear3D8N", geometry) for geometry in ("affine", "curved")])
    element = kl.ELEMENTS["KinematicLinear3D8N"](X)
    N, _, dV = fine(element.shape, X[1])
    close(element.scalar_mass([3.0, 7.0])[1], 7 * (N.T * dV) @ N)


def test_lumped_mass_of_a_quadratic_cell_is_the_scaled_diagonal():
    """The row sums of its corners are negative."""
    kind, soil = "KinematicLinear3D20N", kl.Isotropic3D(1e7, 0.3, 7.0)
    mesh = kl.box(element=kind)
    mesh = mesh.replace(points=mesh.points @ SHEAR)
    (nodes,) = mesh.blocks[0].nodes
    N, _, dV = fine(kl.ELEMENTS[kind].shape, mesh.points[nodes])
    diagonal = (N**2 * dV[:, None]).sum(axis=0)
    expected = 7.0 * dV.sum() * diagonal / diagonal.sum()
    close(lumped_mass(mesh.points, kl.Model(mesh, soil).element_groups())[nodes], expected)


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", NAMES)
def test_convective_matrix_is_exact_and_the_second_is_exact_on_affine_cells(kind, geometry):
    """H is a rational function elsewhere: measured up to 3e-3 of its largest entry for this distortion."""
    X = cell(kind, geometry)
    shape = kl.ELEMENTS[kind].shape
    model = kl.Model(kl.Mesh(X, {kind: [range(len(X))]}), kl.Isotropic3D(E=1.0, nu=0.3, density=2.0))
    groups, motion = model.element_groups(), Rotation((1.0, 2.0, -0.5), center=(0.3, -0.1, 0.2))
    pattern = pattern_of(X, groups)
    terms = MotionMatrices(motion, X, groups, pattern, Mass(X, groups, pattern, False))
    N, gradients, dV = fine(shape, X)
    along = (gradients @ motion.field(N @ X)[:, :, None])[..., 0]
    order = np.ix_(np.arange(len(X)), np.arange(len(X)))
    G, H = (terms.times(data, np.eye(len(X)))[order] for data in (terms.G, terms.H))
    close(G, 2 * (N.T * dV) @ along)
    close(H, 2 * (along.T * dV) @ along, 1e-13 if geometry in ("ideal", "affine") else 5e-3)


@pytest.mark.parametrize("kind", NAMES)
def test_the_rule_follows_the_geometry_of_each_cell(kind):
    shape = kl.ELEMENTS[kind].shape
    X = np.stack([cell(kind, geometry) for geometry in GEOMETRIES])
    found = geometries(shape, X).tolist()
    simplex, p = shape.cell == "tetrahedron", shape.degree
    assert found[:2] == [AFFINE, AFFINE]
    assert found[2] == (AFFINE if simplex else STRAIGHT)
    assert found[3] == ((AFFINE if simplex else STRAIGHT) if p == 1 else CURVED)
    far = geometries(shape, X + 1e5).tolist()
    assert far == found
    points = [len(exact_rule(shape, 2, geometry)) for geometry in (AFFINE, STRAIGHT, CURVED)]
    assert points == sorted(points)
    if shape.cell == "hexahedron":
        assert points == ([8, 27, 27] if p == 1 else [27, 64, 125])


def mixed(kind):
    """Return points, groups and pattern of a box with affine, straight and curved cells."""
    mesh = kl.box((1.1, 0.9, 1.3), (3, 2, 4), kind)
    rng, shape = np.random.default_rng(3), kl.ELEMENTS[kind].shape
    (block,) = mesh.blocks
    warped = mesh.points.copy()
    corners = np.unique(block.nodes[:, : shape.corners])
    corners = corners[warped[corners, 0] > 0.5]
    warped[corners] += 0.03 * rng.uniform(-1, 1, (len(corners), 3))
    linear = shape.linear()
    for nodes in block.nodes:
        warped[nodes] = linear.N(shape.nodes) @ warped[nodes[: shape.corners]]
    bent = warped[:, 2] > 0.9
    warped[bent] += 0.01 * rng.uniform(-1, 1, (int(bent.sum()), 3))
    mesh = mesh.replace(points=warped)
    groups = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3, density=3.0)).element_groups()
    return SimpleNamespace(points=warped, groups=groups, pattern=pattern_of(warped, groups))


def computed(at):
    b = np.random.default_rng(4).uniform(-1, 1, at.points.shape)
    (group,) = at.groups
    return {
        "M": inertia_matrices(at.points, at.groups, at.pattern, "M")["M"],
        "lumped": lumped_mass(at.points, at.groups),
        "nodal": body_force(at.points, group, b),
        "constant": body_force(at.points, group, b[0]),
        "geometry": element_groups.geometries_of(at.points, group),
    }


@compiled
@pytest.mark.parametrize("kind", NAMES)
def test_a_mesh_of_cells_of_all_geometries_is_the_same_compiled_and_in_numpy(kind, monkeypatch):
    at = mixed(kind)
    ours = computed(at)
    same_on_all_threads(lambda: computed(at), (1, 2, 3))
    if not kind.endswith(("4N", "10N")):
        assert len(np.unique(ours["geometry"])) >= 2
    monkeypatch.setattr(element_groups, "kernels", lambda name: None)
    for name, values in computed(at).items():
        close(ours[name], values, 1e-14)


def test_a_stated_mass_rule_is_used_as_it_is():
    with kl.ELEMENTS.temporary():

        class Coarse(kl.KinematicLinear3D27N):
            mass_rule = hexahedron(degree=1)

        class Fine(kl.KinematicLinear3D10N):
            mass_rule = tetrahedron(degree=9)

    X = cell("KinematicLinear3D27N", "curved")
    N = Coarse.shape.N(np.zeros(3))
    close(Coarse(X).scalar_mass(), 8 * np.outer(N, N) * Coarse(X).detJ(np.zeros(3)))
    X = cell("KinematicLinear3D10N", "curved")
    close(Fine(X).scalar_mass(), kl.KinematicLinear3D10N(X).scalar_mass())


@pytest.mark.parametrize("shape", FACES)
def test_pressure_on_warped_and_curved_faces_is_that_of_a_rule_of_much_higher_degree(shape):
    rng = np.random.default_rng(2)
    X = np.column_stack([shape.nodes, np.zeros(len(shape.nodes))])
    X += rng.uniform(-0.15, 0.15, X.shape)
    p, expected = rng.uniform(1, 2, len(X)), np.zeros_like(X)
    for xi, weight in rule_for(shape.cell, 19):
        N, tangents = shape.N(xi), X.T @ shape.dN(xi)
        expected -= weight * np.outer(N, N @ p * np.cross(*tangents.T))
    close(surface_pressure(shape, X, p), expected)

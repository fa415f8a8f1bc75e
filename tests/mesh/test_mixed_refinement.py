"""Cuts that keep an edge and cuts that do not, one after the other: fields stay continuous."""

import numpy as np
import pytest
from meshes import area

import kratos_lite as kl
from kratos_lite.mesh.refinement import refine
from kratos_lite.shapes import LINEAR
from kratos_lite.shapes.faces import FACE_SHAPES

SIZE = (1.0, 1.3, 0.7)


def hexahedra_and_wedges(kind):
    """Return a box of hexahedra, of which those along one edge are cut into two wedges each."""
    mesh = kl.box(SIZE, (2, 2, 2), "KinematicLinear3D8N")
    nodes = mesh.blocks[0].nodes
    edge = (mesh.points[nodes][..., :2].mean(axis=1) < 0.65).all(axis=1)
    wedges = np.vstack([nodes[edge][:, [0, 1, 2, 4, 5, 6]], nodes[edge][:, [0, 2, 3, 4, 6, 7]]])
    blocks = [kl.Block("KinematicLinear3D8N", nodes[~edge]), kl.Block("KinematicLinear3D6N", wedges)]
    return kl.Mesh(mesh.points, blocks)


def with_skin(mesh):
    """Return a mesh with a condition on each outer face."""
    skin = [kl.Block(f"SurfaceCondition3D{b.nodes.shape[1]}N", b.nodes, shape=b.shape) for b in mesh.boundary]
    return mesh.replace(conditions=skin)


def jump(mesh, rng):
    """Return the largest difference between elements of a random field at random points of faces."""
    u = rng.normal(size=mesh.n_nodes)
    u = u if mesh.hanging is None else mesh.hanging.interpolate(u)
    points = []
    for block in mesh.blocks:
        for face in block.shape.faces:
            corners = block.nodes[:, list(face[: FACE_SHAPES[len(face)].corners])]
            weights = rng.dirichlet(np.ones(corners.shape[1]), size=len(block))
            points.append(np.einsum("mc,mcd->md", weights, mesh.points[corners]))
    points = np.concatenate(points)
    high = np.full(len(points), -np.inf)
    low = -high
    for block in mesh.blocks:
        linear, X = LINEAR[block.shape.cell], mesh.points[block.nodes[:, : block.shape.corners]]
        center = linear.nodes.mean(axis=0)
        J = np.swapaxes(X, 1, 2) @ linear.dN(center)
        xi = center + (points - X.mean(axis=1)[:, None]) @ np.swapaxes(np.linalg.inv(J), 1, 2)
        cell, at = np.nonzero((linear.N(xi) > -1e-9).all(axis=-1))
        value = (block.shape.N(xi[cell, at]) * u[block.nodes[cell]]).sum(axis=1)
        np.maximum.at(high, at, value)
        np.minimum.at(low, at, value)
    return (high - low).max()


def corners_of(blocks):
    return {tuple(sorted(face)) for b in blocks for face in b.nodes[:, : b.shape.corners].tolist()}


@pytest.mark.parametrize("kind", ["8N", "20N", "27N", "6N", "15N", "mixed"])
def test_fields_are_continuous_after_cuts_of_any_directions(kind):
    box = (
        hexahedra_and_wedges(kind) if kind == "mixed" else kl.box(SIZE, (2, 2, 2), f"KinematicLinear3D{kind}")
    )
    ways = [*np.eye(3), None] if kind in ("8N", "20N", "27N") else [np.eye(3)[2], None]
    hung = 0
    for seed in range(8):
        rng, mesh = np.random.default_rng(seed), with_skin(box)
        for _ in range(3):
            marked = rng.random(mesh.n_elements) < rng.choice([0.05, 0.1, 0.3])
            mesh = refine(mesh, marked, ways[rng.integers(len(ways))]).mesh
            assert jump(mesh, rng) < 1e-9
            assert len(np.unique(mesh.points.round(9), axis=0)) == mesh.n_nodes
            assert abs(area(mesh.boundary, mesh) - 2 * (1.3 + 0.7 + 0.91)) < 1e-12
            assert corners_of(mesh.conditions) == corners_of(mesh.boundary)
        hung += mesh.hanging is not None
    assert hung > 5


@pytest.mark.parametrize("kind", ["8N", "20N"])
def test_the_energy_at_a_reentrant_edge_stays_below_that_of_a_finer_mesh(kind):
    """Under forces, the energy of continuous fields grows from mesh to nested mesh."""
    box = kl.box((2.0, 2.0, 1.0), (2, 2, 1), f"KinematicLinear3D{kind}")
    nodes = box.blocks[0].nodes
    nodes = nodes[(box.points[nodes].mean(axis=1)[:, :2] < 1).any(axis=1)]
    used, nodes = np.unique(nodes, return_inverse=True)
    coarse = kl.Mesh(box.points[used], [kl.Block(f"KinematicLinear3D{kind}", nodes.reshape(3, -1))])

    def energy(mesh):
        model = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3))
        model.fix(lambda X: X[:, 0] == 0)
        model.add(kl.BodyForce((0.0, 1.0, 0.5)))
        return model.solve().energy()

    def near_edge(mesh):
        centers = mesh.points[mesh.blocks[0].nodes].mean(axis=1)
        return np.linalg.norm(centers[:, :2] - 1, axis=1) < 0.8

    once = refine(coarse).mesh
    across = refine(once, near_edge(once), (0, 0, 1)).mesh
    mixed = refine(across, near_edge(across)).mesh
    energies = [energy(mesh) for mesh in (coarse, once, across, mixed, refine(refine(once).mesh).mesh)]
    assert (np.diff(energies) > 0).all()

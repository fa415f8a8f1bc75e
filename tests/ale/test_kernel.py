"""M, G and H: compiled as in NumPy for every element, whatever the threads."""

from dataclasses import replace

import numpy as np
import pytest
from computing import compiled, same_on_all_threads
from rounding import all_close, close

import kratos_lite as kl
from kratos_lite.ale import MotionMatrices, Rotation, Translation
from kratos_lite.assembly import element_groups
from kratos_lite.assembly.mass_and_convection import inertia_matrices
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.native import kernels
from kratos_lite.solvers.mass import Mass

KINDS = (4, 5, 6, 8, 10, 13, 15, 20, 27)
VELOCITY = np.random.default_rng(1).uniform(-1, 1, (3, 4))


def parts(kind, cells=(3, 2, 3), amount=0.05):
    """Return points, groups and pattern of a distorted box of two materials."""
    mesh = kl.box((1.1, 0.9, 1.3), cells, f"KinematicLinear3D{kind}N")
    shift = np.random.default_rng(kind).uniform(-1, 1, mesh.points.shape)
    mesh = mesh.replace(points=mesh.points + amount / max(cells) * shift)
    light, heavy = (kl.Isotropic3D(E=1.0, nu=0.3, density=density) for density in (2.0, 700.0))
    m = mesh.n_elements
    properties = np.where(np.arange(m) < m // 3, 1, 2)
    mesh = mesh.replace(blocks=[replace(mesh.blocks[0], properties=properties)])
    model = kl.Model(mesh, {1: light, 2: heavy})
    groups = model.element_groups()
    assert len(groups) == 2
    return mesh.points, groups, Pattern(mesh.n_nodes, [group.nodes for group in groups])


def numpy_matrices(monkeypatch, *arguments):
    with monkeypatch.context() as patch:
        patch.setattr(element_groups, "kernels", lambda name: None)
        return inertia_matrices(*arguments)


@compiled
@pytest.mark.parametrize("kind", KINDS)
def test_compiled_is_numpy(kind, monkeypatch):
    arguments = (*parts(kind), "MGH", VELOCITY)
    all_close(inertia_matrices(*arguments), numpy_matrices(monkeypatch, *arguments), 1e-13)


@compiled
@pytest.mark.parametrize("kind", KINDS)
def test_threads_change_no_bit(kind):
    arguments = (*parts(kind, (7, 3, 4)), "MGH", VELOCITY)
    same_on_all_threads(lambda: inertia_matrices(*arguments))


@pytest.mark.parametrize("names", ["M", "G", "H", "MG", "GH"])
def test_only_what_is_asked_for_is_made_and_nothing_else_changes(names):
    points, groups, pattern = parts(8)
    every = inertia_matrices(points, groups, pattern, "MGH", VELOCITY)
    some = inertia_matrices(points, groups, pattern, names, VELOCITY)
    assert "".join(some) == names
    for name in names:
        np.testing.assert_array_equal(some[name], every[name])


def test_velocity_is_linear_in_its_numbers():
    points, groups, pattern = parts(10)

    def made(velocity):
        return inertia_matrices(points, groups, pattern, "GH", velocity)

    moved = VELOCITY.copy()
    moved[:, 3] += VELOCITY[:, :3] @ (1.0, 2.0, 3.0)
    again = inertia_matrices(points - (1.0, 2.0, 3.0), groups, pattern, "GH", moved)
    all_close(again, made(VELOCITY), 1e-13)
    all_close(made(-2 * VELOCITY), {"G": -2 * made(VELOCITY)["G"], "H": 4 * made(VELOCITY)["H"]}, 1e-13)


@pytest.mark.parametrize(
    "motion", [Rotation("z", 1.0, center=(1e3, 2e3, 0.0)), Translation((1.0, 2.0, 2.0), 1.0)]
)
def test_matrices_of_a_motion_act_on_linear_fields_as_they_must(motion):
    points, groups, pattern = parts(27, amount=0.0)
    terms = MotionMatrices(motion, points, groups, pattern, Mass(points, groups, pattern, False))
    c, mass = motion.field(points), terms.mass.scalar
    close(terms.times(terms.G, points), mass @ c, 1e-11)
    twice = points.T @ terms.times(terms.H, points)
    np.testing.assert_allclose(twice, c.T @ (mass @ c), rtol=0, atol=1e-12 * abs(twice).max())


@compiled
def test_wrong_arguments_are_refused():
    points, _, pattern = parts(8)
    one = np.zeros((3, 8))
    nodes = np.zeros((1, 8), dtype=np.int32)
    rest = (np.zeros(3), VELOCITY, pattern.indptr, pattern.indices)
    add = kernels("inertia").add
    with pytest.raises(ValueError, match=r"dN must be \(g, k, 3\)"):
        add(points, nodes, one, np.zeros((3, 7, 3)), *rest)
    with pytest.raises(ValueError, match="rows of points"):
        add(points, nodes - 1, one, np.zeros((3, 8, 3)), *rest)
    with pytest.raises(ValueError, match=r"data must be float \(nnz,\)"):
        add(points, nodes, one, np.zeros((3, 8, 3)), *rest, M=np.zeros(3))
    far = pattern.indices + np.int32(len(points))
    with pytest.raises(ValueError, match="column that is not there"):
        add(points, nodes, one, np.zeros((3, 8, 3)), *rest[:-1], far, M=np.zeros(len(far)))

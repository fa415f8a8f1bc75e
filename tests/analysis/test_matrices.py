"""Matrices of models and elements: solved by SciPy, and summed up from elements; see tests/reference."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=2e5, nu=0.3, density=7.0)


def mixed_model(density=7.0):
    """Return a distorted model of two kinds, two materials, two rules, prestress, loads and supports."""
    mesh = kl.box((2.0, 1.0, 1.0), (3, 2, 1))
    shift = 0.05 * np.random.default_rng(3).uniform(-1, 1, mesh.points.shape)
    nodes, hexes = mesh.points + shift, mesh.blocks[0]
    wedge = hexes.nodes[-1]  # one cell is cut into two wedges
    wedges = np.array([wedge[[0, 1, 2, 4, 5, 6]], wedge[[0, 2, 3, 4, 6, 7]]])
    spare = np.vstack([[[9.0, 9.0, 9.0]], nodes])  # a node without elements, in front
    shapes = [kl.ELEMENTS[name].shape for name in ("KinematicLinear3D8N", "KinematicLinear3D6N")]
    blocks = [
        kl.Block("KinematicLinear3D8N", hexes.nodes[:-1] + 1, np.arange(11, 16), np.ones(5, int), shapes[0]),
        kl.Block("KinematicLinear3D6N", wedges + 1, np.array([7, 8]), np.full(2, 2), shapes[1]),
    ]
    model = kl.Model(
        kl.Mesh(spare, blocks),
        {
            1: kl.Isotropic3D(E=2e5, nu=0.3, density=density),
            2: kl.Isotropic3D(E=3e4, nu=0.1, density=density),
        },
    )
    model.use_rule(3, [1])
    model.add_prestress([5.0, -3.0, 2.0, 1.0, 4.0, -2.0], [0, 6])
    model.set_stress_free_state(1e-4 * np.sin(np.arange(spare.size)).reshape(-1, 3))
    model.fix(lambda X: X[:, 0] < 0.1)
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    model.add(kl.BodyForce((0.0, 30.0, 0.0), [2, 5]), amplitude=2.0)
    return model


def constrained(model):
    """Add prescribed displacements, a multi-point constraint and a point load."""
    right = np.flatnonzero((model.mesh.points[:, 0] > 1.9) & (model.mesh.points[:, 0] < 3))
    model.fix(right[:1], "y", 2e-3)
    model.constrain((int(right[1]), "z"), {(int(right[2]), "z"): 0.5, (int(right[0]), "y"): 1.0}, 1e-4)
    model.add(kl.PointLoad(right[-1:], (0.0, 0.0, 40.0)))
    return model


@pytest.mark.parametrize("change", [lambda model: model, constrained], ids=["supports", "constraints"])
def test_scipy_solves_the_matrices_of_a_model(change):
    model = change(mixed_model())
    m, u = model.matrices(), model.solve().u
    q = spsolve((m.T.T @ m.K @ m.T).tocsc(), m.T.T @ (m.f - m.K @ m.c))
    found = m.T @ q + m.c
    assert np.abs(found.reshape(-1, 3) - u).max() < 1e-11 * np.abs(u).max()
    assert (m.T @ q)[m.free] == pytest.approx(q)
    reactions = (m.K @ found - m.f).reshape(-1, 3)
    assert np.abs(reactions - model.solve().reactions).max() < 1e-9 * np.abs(reactions).max()


def test_sums_over_elements_are_the_matrices_of_the_model():
    model = mixed_model()
    m, n = model.matrices(), 3 * model.mesh.n_nodes
    K, M, f = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    for element in model.mesh.element_ids.tolist():
        Ke, re, Me, dofs = model.local_system(element)
        K[np.ix_(dofs, dofs)] += Ke
        M[np.ix_(dofs, dofs)] += Me
        f[dofs] += re
    for found, expected in ((m.K.toarray(), K), (m.M.toarray(), M), (m.f, f)):
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
    assert not m.C.nnz
    assert np.abs(m.K.toarray()[:3]).max() == 0  # of a node without elements


def test_residuals_of_elements_balance_at_the_solution():
    model = mixed_model()
    u, total = model.solve().u, np.zeros(3 * model.mesh.n_nodes)
    for element in model.mesh.element_ids.tolist():
        local = model.local_system(element, u)
        total[local.dofs] += local.r
    free = model.matrices().free
    assert np.abs(total[free]).max() < 1e-10 * np.abs(total).max()
    assert np.abs(total + model.solve().reactions.ravel()).max() < 1e-9 * np.abs(total).max()


def test_damping_and_lumped_mass():
    model = mixed_model()
    m = model.matrices(lumped=True, rayleigh=(3.0, 1e-3))
    assert (m.M.toarray() == np.diag(m.M.diagonal())).all()
    volume = sum(model.element_groups()[i].at(model.mesh.points).volume().sum() for i in range(3))
    assert abs(m.M.diagonal().sum() - 3 * 7.0 * volume) < 1e-12 * m.M.diagonal().sum()
    assert np.abs((m.C - 3.0 * m.M - 1e-3 * m.K).toarray()).max() < 1e-12 * np.abs(m.C.toarray()).max()


def test_matrices_of_a_model_without_density_have_no_mass():
    m = mixed_model(density=0.0).matrices()
    assert m.M.nnz == 0
    assert m.K.nnz > 0


def test_matrices_at_a_time_have_the_supports_and_loads_of_that_time():
    model = kl.Model(kl.box(), STEEL)
    model.fix("z-")
    model.fix("z+", "z", kl.TimeSeries([0.0, 1.0], [0.0, 0.5]))
    model.add(kl.Gravity((0, 0, -1.0)), amplitude=lambda t: 1 + t)
    start, later = model.matrices(), model.matrices(time=0.5)
    assert np.abs(later.f - 1.5 * start.f).max() < 1e-14
    assert set(later.c.tolist()) == {0.0, 0.25}
    assert not start.c.any()


def test_matrices_of_a_wheel_hold_the_terms_of_its_rotation():
    wheel = kl.Model(kl.annulus(0.3, 1.0, 0.2), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    wheel.fix("inner")
    wheel.add(kl.ale.Rotation("z", rate=20.0))
    m, u = wheel.matrices(), wheel.solve().u
    found = m.T @ spsolve((m.T.T @ m.K @ m.T).tocsc(), m.T.T @ m.f)
    assert np.abs(found.reshape(-1, 3) - u).max() < 1e-9 * np.abs(u).max()
    assert np.abs((m.C + m.C.T).toarray()).max() < 1e-9 * np.abs(m.C.toarray()).max()  # gyroscopic


def test_wrong_arguments_are_refused():
    model = mixed_model()
    with pytest.raises(kl.MeshError, match="no element has the id 99"):
        model.local_system(99)
    with pytest.raises(kl.InputError, match="displacement"):
        model.local_system(7, np.zeros(3))
    with pytest.raises(kl.InputError, match="lumped must be True or False"):
        model.matrices(lumped="yes")
    with pytest.raises(kl.InputError, match="time"):
        model.matrices(time="now")

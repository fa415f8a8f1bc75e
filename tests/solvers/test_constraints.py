"""Multi-point constraints in arrays: eliminated as by hand, and solved as by a matrix."""

import numpy as np
import pytest
from computing import compiled

import kratos_lite as kl
from kratos_lite.assembly.matrix_free import MatrixFree
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.constraints import Constraints
from kratos_lite.solvers.elimination import eliminate
from kratos_lite.solvers.linear_solver import on_all

LAW = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
FREE, ZERO = np.zeros((20, 3), dtype=bool), np.zeros((20, 3))


def rows(*given):
    """Return constraints of (dependent, {independent: weight}, constant)."""
    start = np.cumsum([0, *(len(terms) for _, terms, _ in given)])
    dofs = [dof for _, terms, _ in given for dof in terms]
    weights = [weight for _, terms, _ in given for weight in terms.values()]
    return Constraints(
        np.array([dependent for dependent, _, _ in given]),
        start,
        np.array(dofs, dtype=np.int64),
        np.array(weights, dtype=float),
        np.array([constant for _, _, constant in given], dtype=float),
    )


def as_dict(constraints):
    return {
        dependent: (dict(zip(independents.tolist(), weights.tolist(), strict=True)), constant)
        for dependent, independents, weights, constant in constraints
    }


def test_chains_end_at_what_is_free_or_prescribed():
    """u5 = 2 u4 + 1, u4 = u3 / 2 + u9 - 3, u3 = 4 u0 + u1; u9 = 0.5 is prescribed."""
    fixed, values = FREE.copy(), ZERO.copy()
    fixed.flat[9], values.flat[9] = True, 0.5
    given = rows((5, {4: 2.0}, 1.0), (4, {3: 0.5, 9: 1.0}, -3.0), (3, {0: 4.0, 1: 1.0}, 0.0))
    found = as_dict(eliminate(given, fixed, values))
    assert found == {5: ({0: 4.0, 1: 1.0}, -4.0), 4: ({0: 2.0, 1: 0.5}, -2.5), 3: ({0: 4.0, 1: 1.0}, 0.0)}


@pytest.mark.parametrize("seed", range(5))
def test_random_constraints_hold(seed):
    """With free dofs at random, every dependent found fulfills every constraint given."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(60)
    given = [
        (int(order[i]), {int(d): rng.normal() for d in rng.choice(order[i + 1 :], 3)}, rng.normal())
        for i in range(40)
    ]
    found = eliminate(rows(*given), FREE, ZERO)
    u = rng.standard_normal(60)
    assert not set(found.independents) & {dependent for dependent, _, _ in given}
    for dependent, independents, weights, constant in found:
        u[dependent] = weights @ u[independents] + constant
    for dependent, terms, constant in given:
        expected = sum(weight * u[dof] for dof, weight in terms.items()) + constant
        np.testing.assert_allclose(u[dependent], expected, rtol=0, atol=1e-9 * np.abs(u).max())


def test_a_chain_of_thousands():
    n = 5000
    chain = rows(*((i, {i + 1: 1.0}, 1.0) for i in range(n)))
    found = eliminate(chain, np.zeros((2000, 3), dtype=bool), np.zeros((2000, 3)))
    assert (found.independents == n).all()
    np.testing.assert_array_equal(found.constants, n - np.arange(n))


def tied_blocks(kind):
    """Return two blocks whose facing sides are one by ties, the lower one held."""
    lower = kl.box((1.0, 1.2, 0.5), (3, 3, 2), kind)
    upper = kl.box((1.0, 1.2, 0.5), (3, 3, 2), kind, origin=(0, 0, 0.5))
    n, (block,) = lower.n_nodes, lower.blocks
    above = kl.Block(block.name, upper.blocks[0].nodes + n, ids=block.ids + len(block))
    model = kl.Model(kl.Mesh(np.vstack([lower.points, upper.points]), [block, above]), LAW)
    model.fix(model.mesh.points[:, 2] == 0.0)
    model.add(kl.Traction(model.mesh.points[:, 2] > 0.99, (1e6, 2e5, -3e6)))
    below, over = lower.nodes("z+"), upper.nodes("z-")
    place = {tuple(p): i for i, p in zip(below, lower.points[below].round(9), strict=True)}
    partner = np.array([place[tuple(p)] for p in upper.points[over].round(9)])
    return model, n + over, partner


@pytest.mark.parametrize("kind", ["8N", "10N", "20N", "27N"])
def test_tied_blocks_are_one_block(kind):
    whole = kl.Model(kl.box((1.0, 1.2, 1.0), (3, 3, 4), kind), LAW)
    whole.fix("z-")
    whole.add(kl.Traction("z+", (1e6, 2e5, -3e6)))
    model, dependents, independents = tied_blocks(kind)
    for axis in range(3):
        model.constrain(3 * dependents + axis, 3 * independents + axis)
    result = model.solve(solver="amg")
    top = whole.solve().at((0.5, 0.6, 1.0)).displacement
    np.testing.assert_allclose(
        result.at((0.5, 0.6, 1.0)).displacement, top, rtol=0, atol=1e-7 * abs(top).max()
    )


def test_arrays_and_pairs_say_the_same():
    model, dependents, independents = tied_blocks("8N")
    pairs = tied_blocks("8N")[0]
    other = independents[::-1]
    model.constrain(3 * dependents, 3 * np.stack([independents, other], axis=1), 1e-4, weights=[[0.75, 0.25]])
    for a, b, c in zip(dependents, independents, other, strict=True):
        terms = {(int(b), "x"): 0.75}
        terms[int(c), "x"] = terms.get((int(c), "x"), 0.0) + 0.25
        pairs.constrain((int(a), "x"), terms, 1e-4)
    found, expected = (as_dict(m.supports.dependents()) for m in (model, pairs))
    assert found == expected


@compiled
@pytest.mark.parametrize("kind", ["8N", "10N", "20N"])
def test_products_of_ties_are_those_of_the_matrix(kind):
    """Ties of single axes, across axes and of whole nodes, with weights: against T^T K T."""
    model, dependents, independents = tied_blocks(f"KinematicLinear3D{kind}")
    pair = np.stack([independents[1:], independents[:-1]], axis=1)
    model.constrain(3 * dependents[2:] + 2, 3 * independents[2:] + 2)
    model.constrain(3 * dependents[2:], 3 * pair[1:] + [0, 1], weights=[[0.7, -0.4]])
    for axis in range(3):
        model.constrain(3 * dependents[:2] + axis, 3 * pair[:2] + axis, weights=[[0.7, 0.2]])
    system = ConstrainedSystem(model.mesh.points, model.element_groups(), model.supports.constraint_map)
    T, free = system.constraint_map.T, system.constraint_map.free
    K, q = MatrixFree(system.points, system.groups), np.random.default_rng(1).standard_normal(len(free))
    expected = T.T @ (K.scipy() @ (T @ q))
    x = np.zeros(T.shape[0])
    x[free] = q
    tied = K.tie(on_all(T, free))
    scale = 1e-12 * np.abs(expected).max()
    np.testing.assert_allclose((tied @ x)[free], expected, rtol=0, atol=scale)
    several = tied.times(np.stack([x, 3 * x]))[:, free]
    np.testing.assert_allclose(several, np.stack([expected, 3 * expected]), rtol=0, atol=3 * scale)
    u = T @ q
    np.testing.assert_allclose(K @ u, K.scipy() @ u, rtol=0, atol=scale)


@compiled
def test_wrong_ties_are_refused():
    model = tied_blocks("8N")[0]
    product = MatrixFree(model.mesh.points, model.element_groups()).product
    one = np.ones(1, dtype=np.int32)
    for changed in (
        {"dependents": one * 10**6},
        {"independents": -one},
        {"indptr": np.array([0, 2], np.int32)},
        {"weights": np.ones(3)},
    ):
        given = {
            "dependents": one,
            "indptr": np.array([0, 1], np.int32),
            "independents": 5 * one,
            "weights": np.ones(1),
        }
        with pytest.raises(ValueError, match=r"must|is needed"):
            product.tie(*(given | changed).values())


@compiled
def test_a_tie_of_unlike_meshes_takes_the_iterations_and_memory_of_joined_cells():
    found = []
    for mesh in (
        kl.box((1, 1, 0.8), (10, 10, 8)),
        kl.join(
            {"a": kl.box((1, 1, 0.4), (10, 10, 4)), "b": kl.box((1, 1, 0.4), (11, 11, 4), origin=(0, 0, 0.4))}
        ),
    ):
        model = kl.Model(mesh, LAW)
        if mesh.n_nodes > 11**2 * 9:
            model.tie("a.z+", "b.z-")
        model.fix("x-")
        system = ConstrainedSystem(
            mesh.points, model.element_groups(), model.supports.constraint_map, solver="amg"
        )
        iterations = system.solve(mesh.points * mesh.points[:, :1])[1].iterations
        found.append((iterations, system.equations._multigrid.memory / mesh.points.size))
    (joined, most), (tied, memory) = found
    assert tied <= joined + 1
    assert memory < 1.5 * most


@compiled
def test_few_tied_elements_without_a_matrix_are_solved_on_one_level():
    lower, upper = (
        kl.box((1, 1, 0.5), (m, m, 1), "KinematicLinear3D8N", (0, 0, z)) for m, z in ((2, 0.0), (3, 0.5))
    )
    mesh = kl.join({"a": lower, "b": upper})
    model = kl.Model(mesh, LAW)
    model.tie("a.z+", "b.z-")
    model.fix("x-")
    found = [
        ConstrainedSystem(
            mesh.points, model.element_groups(), model.supports.constraint_map, solver=solver
        ).solve(mesh.points)
        for solver in ("amg", "direct")
    ]
    (u, solution), (exact, _) = found
    assert solution.method == "amg"
    assert solution.iterations < 25
    np.testing.assert_allclose(u, exact, rtol=0, atol=1e-9 * np.abs(exact).max())

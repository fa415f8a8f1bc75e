"""Random models by kratos_lite and by the reference; `python -m tests.reference N` takes as many as asked."""

import numpy as np
import pytest

from tests.reference import rules, shapes, solid
from tests.reference.compare import CLEAR, LIMIT, compare
from tests.reference.problems import random_problem

SEEDS = range(60)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_model_has_the_solution_of_the_reference(seed):
    found = compare(seed)
    assert max(found.values()) <= LIMIT, found


def test_the_random_models_have_everything_that_is_to_be_compared():
    problems = [random_problem(seed) for seed in SEEDS]
    kinds = {kind for problem in problems for kind, *_ in problem.cells}
    assert kinds == {4, 5, 6, 8, 10, 13, 15, 20, 27}
    assert any(len({kind for kind, *_ in problem.cells}) >= 3 for problem in problems)
    for name in ("links", "forces", "tractions", "pressures"):
        assert sum(bool(getattr(problem, name)) for problem in problems) > 10, name
    for name in ("gravity", "body_force", "prestress", "stress_free"):
        assert sum(getattr(problem, name) is not None for problem in problems) > 10, name
    assert any(len(constants) == 9 for problem in problems for *_, constants in problem.materials)
    singular = [solid.singularity(p, solid.matrices(p)[0]) < CLEAR for p in problems[:40]]
    assert 3 <= sum(singular) < 20


# ---- the reference itself ----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", shapes.CORNERS)
def test_cells_of_the_reference_have_the_volume_that_their_faces_enclose(kind):
    """V = ∫ x·n dA / 3 over the faces of a distorted cell; and linear displacements have their strain."""
    X = shapes.nodes_of(kind)
    X = X + np.random.default_rng(kind).uniform(-0.05, 0.05, X.shape)
    _, gradients, dV = solid.gauss_points(kind, X, "mass")
    enclosed = 0.0
    for face in shapes.faces_of(kind, range(kind)):
        xi, weights = rules.FACE[len(face)]
        N, dN = shapes.plane(len(face), xi)
        normals = np.cross(*np.moveaxis(X[list(face)].T @ dN, -1, 0))
        enclosed += weights @ ((N @ X[list(face)]) * normals).sum(axis=1) / 3
    assert abs(dV.sum() / enclosed - 1) < 1e-13
    B, spin = solid.strain_operators(gradients), np.array([[0, -3, 2], [3, 0, -1], [-2, 1, 0.0]])
    assert np.abs(B @ (X @ spin.T + 1.0).ravel()).max() < 1e-12
    stretch = np.array([[1, 2, 6], [2, 3, 5], [6, 5, 4.0]])
    expected = [1, 3, 4, 4, 10, 12]
    np.testing.assert_allclose(B @ (X @ stretch).ravel(), np.tile(expected, (len(B), 1)), atol=1e-11)


@pytest.mark.parametrize("kind", shapes.CORNERS)
def test_rules_of_the_reference_integrate_monomials(kind):
    """∫ x² over the reference cell, by hand."""
    exact = {4: 1 / 60, 6: 1 / 6, 5: 4 / 15, 8: 8 / 3}[len(shapes.CORNERS[kind])]
    for rule in (rules.STIFFNESS, rules.MASS):
        xi, weights = rule[kind]
        if kind != 4 or len(weights) > 1:
            assert abs(weights @ xi[:, 0] ** 2 / exact - 1) < 1e-13

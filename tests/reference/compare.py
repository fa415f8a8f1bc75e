"""Solve a problem by kratos_lite and by the reference, and measure how far apart they are."""

import itertools

import numpy as np

import kratos_lite as kl
from tests.reference import rules, solid
from tests.reference.problems import random_problem

SINGULAR = 3e-14
"""Share of the largest eigenvalue below which the reference calls a stiffness singular."""
LIMIT = 1e-9
"""Difference, as a share of the largest value, that counts as one."""
CLEAR = 1e-8
"""Share above which it is clearly regular; nothing is asked in between."""


def material_of(C, density, constants):
    """Return the material of kratos_lite."""
    kind = kl.Isotropic3D if len(constants) == 2 else kl.Orthotropic3D
    return kind(*map(float, constants), density=density)


def model_of(problem):
    """Return the problem as a model, with one block for each run of cells of a kind."""
    blocks, number = [], itertools.count(1)
    for kind, cells in itertools.groupby(problem.cells, key=lambda cell: cell[0]):
        _, nodes, materials = zip(*cells, strict=True)
        ids = [next(number) for _ in nodes]
        blocks.append(kl.Block(f"KinematicLinear3D{kind}N", nodes, ids, np.array(materials) + 1))
    used = {material for _, _, material in problem.cells}
    materials = {number + 1: material_of(*problem.materials[number]) for number in used}
    model = kl.Model(kl.Mesh(problem.points, blocks), materials)
    add_loads(model, problem)
    for dof, value in problem.fixed.items():
        model.fix([dof // 3], "xyz"[dof % 3], value)
    for dependent, independents, constant in problem.links:
        weights = {(dof // 3, "xyz"[dof % 3]): weight for dof, weight in independents.items()}
        model.constrain((dependent // 3, "xyz"[dependent % 3]), weights, constant)
    if problem.prestress is not None:
        model.add_prestress(problem.prestress)
    if problem.stress_free is not None:
        model.set_stress_free_state(problem.stress_free)
    return model


def add_loads(model, problem):
    if problem.gravity is not None:
        model.add(kl.Gravity(problem.gravity))
    if problem.body_force is not None:
        model.add(kl.BodyForce(problem.body_force))
    for node, force in problem.forces.items():
        model.add(kl.PointLoad([node], force))
    for nodes, traction in problem.tractions:
        model.add(kl.Traction(np.array(nodes), traction))
    for nodes, pressure in problem.pressures:
        model.add(kl.Pressure(np.array(nodes), pressure))


def difference(found, expected, scale=0.0):
    """Return the largest difference as a share of the largest value, or of a scale if that is larger."""
    size = max(float(np.abs(expected).max(initial=0.0)), scale)
    gap = float(np.abs(np.asarray(found) - expected).max(initial=0.0))
    return gap / size if size else gap


def compare(seed):
    """Return the differences by quantity, or why the problem was refused by both."""
    problem = random_problem(seed)
    K, M, f = solid.matrices(problem)
    share = solid.singularity(problem, K)
    found = {"equations": equations(problem, K, M, f)}
    if share < CLEAR:
        return found | {"refused": refused(problem, share)}
    found |= statics(problem, K, f)
    return found | dynamics(problem, K, M, f)


def equations(problem, K, M, f):
    """Return the largest difference of stiffness, mass and loads of the model with its supports left out."""
    model = model_of(problem)
    made = model.matrices()
    loads = np.asarray(made.f).ravel()
    scale = 1e-3 * np.abs(f).max(initial=0.0)
    return max(difference(made.K.toarray(), K), difference(made.M.toarray(), M), difference(loads, f, scale))


def refused(problem, share):
    """Return 0 if kratos_lite refuses a mechanism, else 1; between the limits either is right."""
    try:
        model_of(problem).solve()
    except kl.KratosLiteError:
        return 0.0
    return 1.0 if share < SINGULAR else 0.0


def statics(problem, K, f):
    """Return differences of displacements, reactions, stresses and energy."""
    result = model_of(problem).solve()
    u, residual = solid.solve(problem, K, f)
    held = [
        *problem.fixed,
        *(dof for dependent, independents, _ in problem.links for dof in (dependent, *independents)),
    ]
    reactions = np.zeros(len(u))
    reactions[held] = residual[held]
    force = np.abs(K).max() * np.abs(u).max(initial=0.0)
    stress = [
        stress_at(result, e + 1, rules.STIFFNESS[kind][0]) for e, (kind, *_) in enumerate(problem.cells)
    ]
    expected = solid.stresses(problem, u)
    largest = max(float(np.abs(s).max()) for s in expected)
    return {
        "displacement": difference(result.u.ravel(), u),
        "reaction": difference(result.reactions.ravel(), reactions, 1e-3 * force),
        "stress": max(difference(a, b, largest) for a, b in zip(stress, expected, strict=True)),
        "energy": difference(result.energy(), solid.energy(problem, K, u)),
    }


def stress_at(result, element, xi):
    """Return the stress (g, 6) of an element in the order of the Gauss points xi (g, 3)."""
    given = result.at_integration_points("INTEGRATION_POINT_LOCAL", element)
    distance = np.abs(given[None] - xi[:, None]).max(axis=2)
    assert distance.min(axis=1).max() < 1e-12, "the Gauss points of an element have moved"
    return result.at_integration_points("CAUCHY_STRESS_VECTOR", element)[distance.argmin(axis=1)]


def dynamics(problem, K, M, f):
    """Return differences of natural frequencies and of three steps of Newmark's method from rest."""
    squares = solid.frequencies(problem, K, M)
    count = min(4, len(squares))
    if not count:
        return {}
    frequencies = model_of(problem).modes(count)[0]
    found = {"frequency": difference(np.square(frequencies), squares[:count])}
    if any(problem.fixed.values()) or any(constant for *_, constant in problem.links):
        return found  # supports that jump at the start
    h = 0.3 / np.sqrt(squares[0])
    *_, last = kl.integrate(model_of(problem).transient(integrator=kl.Newmark()), dt=h, steps=3)
    found["newmark"] = difference(last.u.ravel(), solid.newmark(problem, K, M, f, h, 3))
    return found

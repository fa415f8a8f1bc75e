"""Large displacements: exact balances, derivatives, the highest frequency; compiled and NumPy agree."""

import itertools

import numpy as np
import pytest
from computing import EITHER, compiled, same_on_all_threads
from meshes import NAMES
from rounding import all_close, close
from scipy.linalg import eigh
from systems import pattern_of

import kratos_lite as kl
from kratos_lite.assembly import element_groups, finite_strain
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.bodies.rotations import exp
from kratos_lite.testing.patches import patch

WOOD = kl.Orthotropic3D(11e3, 0.9e3, 0.5e3, 0.4, 0.3, 0.4, 0.7e3, 0.05e3, 0.7e3, 450.0)
SOIL = kl.Isotropic3D(2e3, 0.3, 700.0)
UNIT = kl.Isotropic3D(1.0, 0.3, 1.0)
STEPS = [(False, 0.0), (True, 0.0), (True, 0.3)]
elements = pytest.mark.parametrize("name", NAMES)


@pytest.fixture(params=EITHER)
def way(request, monkeypatch):
    """Compute with the kernels, then without."""
    if request.param == "numpy":
        monkeypatch.setattr(element_groups, "kernels", lambda name: None)
    return request.param


def moved(name, cells=(2, 1, 1), prestress=0.0):
    """Return points, groups of two materials, and q and dq without symmetry of some 10 % strain.

    Nodes are moved by a tenth of a cell at most.
    """
    mesh, rng = kl.box(tuple(map(float, cells)), cells, name), np.random.default_rng(4)
    shift = np.random.default_rng(len(name)).uniform(-0.05, 0.05, mesh.points.shape)
    mesh = mesh.replace(points=mesh.points + shift)
    model = kl.Model(mesh, SOIL)
    model.assign(WOOD, np.arange(0, mesh.n_elements, 2))
    if prestress:
        model.add_prestress(rng.standard_normal((mesh.n_elements, 6)) * prestress)
    turned = mesh.points @ (exp(np.array([0.4, -0.9, 0.3])) - np.eye(3)).T
    q = turned + 0.03 * rng.standard_normal(mesh.points.shape)
    return mesh.points, model.element_groups(), q, 0.04 * rng.standard_normal(mesh.points.shape)


# ---- balances --------------------------------------------------------------------------------------


@elements
def test_rotation_gives_no_force(name, way):
    points, groups, _, _ = moved(name)
    R = exp(np.array([1.0, -2.0, 0.5]))
    q = points @ (R - np.eye(3)).T + [3.0, -1.0, 2.0]
    load = finite_strain.internal_load(points, groups, q)
    assert np.abs(load).max() < 1e-14 * 11e3
    assert finite_strain.strain_energy(points, groups, q) < 1e-24


@elements
def test_work_of_a_step_is_the_change_of_energy(name, way):
    points, groups, q, dq = moved(name, prestress=30.0)
    work = float((finite_strain.internal_load(points, groups, q, dq) * dq).sum())
    before, after = (finite_strain.strain_energy(points, groups, v) for v in (q, q + dq))
    assert work == pytest.approx(after - before, abs=1e-13 * (before + after))
    assert abs(work) > 1e-3 * before


@elements
@pytest.mark.parametrize(("step", "damping"), STEPS)
def test_net_force_and_moment_are_zero(name, step, damping, way):
    points, groups, q, dq = moved(name, prestress=30.0)
    load = finite_strain.internal_load(points, groups, q, dq if step else None, damping)
    middle = points + q + (dq / 2 if step else 0)
    size = np.abs(load).sum()
    assert np.abs(load.sum(axis=0)).max() < 1e-14 * size
    assert np.abs(np.cross(middle, load).sum(axis=0)).max() < 1e-14 * size * np.abs(middle).max()


def test_damping_takes_energy_whatever_the_step(way):
    points, groups, q, dq = moved(NAMES[3])
    plain, damped = (finite_strain.internal_load(points, groups, q, dq, d) for d in (0.0, 0.3))
    assert ((damped - plain) * dq).sum() > 0
    np.testing.assert_allclose(
        finite_strain.internal_load(points, groups, q, dq, 0.6) - plain, 2 * (damped - plain), atol=1e-9
    )


def test_small_steps_keep_digits_of_strain(way):
    """A step of 1e-12 changes E by 1e-12 to ten digits, not to the four that F+ - F would leave."""
    points, groups, _, dq = moved(NAMES[3])
    zero = np.zeros_like(points)
    tiny = finite_strain.internal_load(points, groups, zero, 1e-12 * dq)
    K = finite_strain.stiffness(points, groups, pattern_of(points, groups), zero)
    close(tiny.ravel(), 0.5e-12 * (K @ dq.ravel()), 1e-10)


def traction_forces(mesh, P):
    """Return the nodal forces of P·n on the six faces of a box that begins at the origin."""
    total = np.zeros_like(mesh.points)
    for axis, side in itertools.product(range(3), (0.0, 1.0)):
        on = np.flatnonzero(np.abs(mesh.points[:, axis] - side) < 1e-9)
        normal = (2 * side - 1) * np.eye(3)[axis]
        total += kl.Traction(on, P @ normal).forces(mesh, [])
    return total


@elements
def test_homogeneous_deformation_is_carried_by_surface_tractions(name, way):
    element = kl.ELEMENTS[name]
    points, nodes = patch(element.shape, (2, 2, 2), move=0.08)
    nodes = nodes.astype(np.int32)
    mesh = kl.Mesh(points, {name: nodes})
    F = np.eye(3) + np.random.default_rng(6).uniform(-0.2, 0.2, (3, 3))
    E = (F.T @ F - np.eye(3)) / 2
    lam, mu = SOIL.C[0, 1], SOIL.C[3, 3]
    P = F @ (lam * np.trace(E) * np.eye(3) + 2 * mu * E)
    group = ElementGroup(element, element.rule, SOIL, nodes, np.arange(len(nodes)))
    q = points @ (F - np.eye(3)).T
    load = finite_strain.internal_load(points, [group], q)
    np.testing.assert_allclose(load, traction_forces(mesh, P), rtol=0, atol=1e-13 * np.abs(P).max())
    energy = lam / 2 * np.trace(E) ** 2 + mu * (E * E).sum()
    assert finite_strain.strain_energy(points, [group], q) == pytest.approx(energy, rel=1e-12)


# ---- derivatives -----------------------------------------------------------------------------------


def fourth_order(f, h):
    """Return the derivative of f at 0, exact for polynomials of degree four."""
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)


@elements
def test_load_is_the_derivative_of_energy(name, way):
    points, groups, q, dq = moved(name, prestress=30.0)
    work = float((finite_strain.internal_load(points, groups, q) * dq).sum())
    slope = fourth_order(lambda h: finite_strain.strain_energy(points, groups, q + h * dq), 1.0)
    assert slope == pytest.approx(work, rel=1e-11)


@elements
@pytest.mark.parametrize(("step", "damping"), STEPS)
def test_stiffness_is_the_derivative_of_load(name, step, damping, way):
    points, groups, q, dq = moved(name, prestress=30.0)
    v = np.random.default_rng(9).standard_normal(q.shape)
    at = (lambda h: (q, dq + h * v)) if step else (lambda h: (q + h * v, None))
    K = finite_strain.stiffness(points, groups, pattern_of(points, groups), *at(0.0), damping)
    slope = fourth_order(lambda h: finite_strain.internal_load(points, groups, *at(h), damping), 0.1)
    close((K @ v.ravel()).reshape(-1, 3), slope, 1e-11)
    asymmetry = np.abs((K.scipy() - K.scipy().T).toarray()).max() / K.norm()
    assert (asymmetry > 1e-3) if step else (asymmetry < 1e-15)


def test_stiffness_at_rest_is_linear_and_that_of_an_empty_step_is_half(way):
    points, groups, q, _ = moved(NAMES[3])
    pattern, zero = pattern_of(points, groups), np.zeros_like(q)
    linear = assemble_stiffness(points, groups, pattern)
    at_rest = finite_strain.stiffness(points, groups, pattern, zero)
    np.testing.assert_allclose(at_rest.data, linear.data, rtol=0, atol=1e-15 * linear.norm())
    tangent = finite_strain.stiffness(points, groups, pattern, q)
    step = finite_strain.stiffness(points, groups, pattern, q, zero)
    np.testing.assert_allclose(step.data, tangent.data / 2, rtol=0, atol=1e-15 * tangent.norm())


# ---- mean gradient, frequencies --------------------------------------------------------------------


@elements
def test_nodal_gradients_give_the_mean_deformation_gradient(name):
    points, groups, q, _ = moved(name)
    g, V = finite_strain.nodal_gradients(points, groups)
    elements = [group.at(points) for group in groups]
    wanted = sum(
        np.einsum("mg,mgij->ij", e.dV, np.swapaxes(e._gauss[1] @ q[b.nodes][:, None], -1, -2))
        for e, b in zip(elements, groups, strict=True)
    )
    np.testing.assert_allclose(q.T @ g, wanted, rtol=0, atol=1e-13)
    assert pytest.approx(sum(float(e.dV.sum()) for e in elements), rel=1e-14) == V


def true_frequency(points, groups, q, lumped):
    """Return the largest frequency of the assembled dense eigenproblem."""
    n = len(points)
    K = finite_strain.stiffness(points, groups, pattern_of(points, groups), q).scipy().toarray()
    M = np.zeros((n, n))
    for group in groups:
        element, rho = group.at(points), group.material.density
        masses = element.scalar_mass(rho)
        if lumped:
            masses = element.lumped_mass(rho)[:, :, None] * np.eye(masses.shape[-1])
        for nodes, m in zip(group.nodes, masses, strict=True):
            M[np.ix_(nodes, nodes)] += m
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(3)), eigvals_only=True)[-1]))


@elements
@pytest.mark.parametrize("lumped", [False, True])
def test_highest_frequency_is_a_bound(name, lumped):
    points, groups, q, _ = moved(name, cells=(3, 2, 1))
    zero = np.zeros_like(q)
    for state in (q, zero):
        bound = finite_strain.highest_frequency(points, groups, state, lumped)
        true = true_frequency(points, groups, state, lumped)
        assert true <= bound <= 4 * true
    linear = finite_strain.highest_frequency(points, groups, None, lumped)
    assert linear == pytest.approx(bound, rel=1e-12)


def test_highest_frequencies_of_the_reference_cells():
    """Largest eigenvalues of K of single cells with E = ρ = 1, ν = 0.3: those of Solfec, but the pyramid."""
    largest = {4: 1.005427, 5: 2.448228, 6: 2.237320, 8: 2.5}
    for k, value in largest.items():
        element = kl.ELEMENTS[f"KinematicLinear3D{k}N"]
        assert np.linalg.eigvalsh(element(element.nodes).stiffness(UNIT.C))[-1] == pytest.approx(
            value, rel=1e-6
        )
    cube = kl.Model(kl.box((2.0, 2.0, 2.0)), UNIT)
    points, groups = cube.mesh.points, cube.element_groups()
    # each node of the cube of edge 2 has the mass 1
    assert finite_strain.highest_frequency(points, groups, lumped=True) == pytest.approx(2.5**0.5, rel=1e-12)


def test_frequency_needs_a_density():
    model = kl.Model(kl.box(), kl.Isotropic3D(1.0, 0.3))
    with pytest.raises(kl.MaterialError, match="density > 0"):
        finite_strain.highest_frequency(model.mesh.points, model.element_groups())


# ---- compiled --------------------------------------------------------------------------------------


def everything(points, groups, q, dq):
    """Return all that has a kernel, by name."""
    pattern = pattern_of(points, groups)
    found = {}
    for step, damping in STEPS:
        key, change = f"{step} {damping}", dq if step else None
        found[f"load {key}"] = finite_strain.internal_load(points, groups, q, change, damping)
        found[f"stiffness {key}"] = finite_strain.stiffness(points, groups, pattern, q, change, damping).data
    found["energy"] = np.array(finite_strain.strain_energy(points, groups, q))
    return found


@compiled
@elements
def test_compiled_is_numpy(name, monkeypatch):
    given = moved(name, cells=(3, 2, 2), prestress=30.0)
    fast = everything(*given)
    monkeypatch.setattr(element_groups, "kernels", lambda name: None)
    all_close(fast, everything(*given), 1e-13)


@compiled
@pytest.mark.parametrize("name", [NAMES[0], NAMES[3], NAMES[7]])
def test_threads_change_no_bit(name):
    given = moved(name, cells=(11, 7, 4), prestress=30.0)
    same_on_all_threads(lambda: everything(*given))

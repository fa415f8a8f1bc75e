"""Values at integration points by Kratos's names, and anywhere in a mesh, beside plain NumPy."""

import numpy as np
import pytest
from meshes import NAMES

import kratos_lite as kl
from kratos_lite.analysis.fields import QUANTITIES

E, NU = 3e5, 0.3
LAM, MU = E * NU / (1 + NU) / (1 - 2 * NU), E / 2 / (1 + NU)
PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]


def held_model(mesh, u, material=None):
    """Return a model whose displacements are all prescribed."""
    model = kl.Model(mesh, material or kl.Isotropic3D(E=E, nu=NU, density=1.0))
    model.fix(np.arange(mesh.n_nodes), "xyz", u)
    return model


def distorted(kind, seed=0):
    mesh = kl.box((1.0, 0.8, 0.6), (2, 1, 1), element=kind)
    shift = 0.03 * np.random.default_rng(seed).uniform(-1, 1, mesh.points.shape)
    return kl.Mesh(mesh.points + shift, mesh.blocks)


def voigt(tensor, factor=1.0):
    """Return a tensor (3, 3) as xx yy zz xy yz xz, shear times a factor."""
    return np.array([tensor[p] * (1.0 if p[0] == p[1] else factor) for p in PAIRS])


def by_hand(mesh, u, element):
    """Return values (g, ...) of one element by name, by a loop over its Gauss points."""
    block, kind = mesh.blocks[0], kl.ELEMENTS[mesh.blocks[0].name]
    nodes = block.nodes[list(block.ids).index(element)]
    found = []
    for xi, gamma in kind.rule:
        dN, N = kind.shape.dN(xi), kind.shape.N(xi)
        J = mesh.points[nodes].T @ dN
        gradient = u[nodes].T @ dN @ np.linalg.inv(J)
        strain = (gradient + gradient.T) / 2
        stress = LAM * np.trace(strain) * np.eye(3) + 2 * MU * strain
        deviator = stress - np.trace(stress) / 3 * np.eye(3)
        one = np.eye(u[nodes].size).reshape(-1, len(nodes), 3)
        H = np.swapaxes(one, 1, 2) @ dN @ np.linalg.inv(J)
        values = {
            "STRAIN_INTERPOLATION_OPERATOR": np.array([voigt((h + h.T) / 2, 2.0) for h in H]).T,
            "STRAIN": voigt(strain, 2.0),
            "GREEN_LAGRANGE_STRAIN_VECTOR": voigt(strain, 2.0),
            "GREEN_LAGRANGE_STRAIN_TENSOR": strain,
            "STRESSES": voigt(stress),
            "CAUCHY_STRESS_VECTOR": voigt(stress),
            "CAUCHY_STRESS_TENSOR": stress,
            "PK2_STRESS_VECTOR": voigt(stress),
            "PK2_STRESS_TENSOR": stress,
            "VON_MISES_STRESS": np.sqrt(1.5 * (deviator**2).sum()),
            "STRAIN_ENERGY": (strain * stress).sum() / 2,
            "CONSTITUTIVE_MATRIX": np.diag([2 * MU] * 3 + [MU] * 3) + np.pad(np.full((3, 3), LAM), (0, 3)),
            "JACOBIAN": np.linalg.det(J),
            "JACOBIAN_0": np.linalg.det(J),
            "INTEGRATION_WEIGHT": gamma * np.linalg.det(J),
            "INTEGRATION_COORDINATES": N @ mesh.points[nodes],
            "INTEGRATION_POINT_GLOBAL": N @ mesh.points[nodes],
            "INTEGRATION_POINT_LOCAL": xi,
            "DISPLACEMENT": N @ u[nodes],
            "DEFORMATION_GRADIENT": np.eye(3) + strain,
        }
        found.append(values)
    return {name: np.array([values[name] for values in found]) for name in values}


@pytest.mark.parametrize("kind", NAMES)
def test_values_at_integration_points_are_those_of_a_loop_over_them(kind):
    mesh = distorted(kind)
    u = 1e-3 * np.random.default_rng(1).uniform(-1, 1, mesh.points.shape)
    result, element = held_model(mesh, u).solve(), int(mesh.element_ids[-1])
    exact = by_hand(mesh, u, element)
    assert exact.keys() == set(QUANTITIES)
    for name, expected in exact.items():
        got, every = (result.at_integration_points(name, element=e) for e in (element, None))
        assert got.shape == expected.shape, name
        assert np.abs(got - expected).max() <= 1e-11 * np.abs(expected).max(), name
        assert every.shape == (mesh.n_elements, *expected.shape), name
        assert np.abs(every[-1] - got).max() <= 1e-14 * np.abs(got).max(), name


def test_documentation_lists_every_quantity():
    assert all(f"``{name}``" in kl.Result.at_integration_points.__doc__ for name in QUANTITIES)


def test_energy_of_prestressed_elements_with_a_B_of_their_own_is_that_of_the_result():
    with kl.ELEMENTS.temporary():

        class HalfAsStiff(kl.KinematicLinear3D8N):
            def B(self, xi):
                return np.sqrt(0.5) * super().B(xi)

        mesh = distorted("HalfAsStiff")
        model = held_model(mesh, linear(mesh.points)[0])
        model.add_prestress([1e3, 0.0, 0.0, 0.0, 50.0, 0.0])
        result = model.solve()
        density, weight = map(result.at_integration_points, ("STRAIN_ENERGY", "INTEGRATION_WEIGHT"))
        eps = linear(mesh.points)[1][0]
        by_hand = (LAM * eps[:3].sum() ** 2 + 2 * MU * (eps[:3] ** 2).sum() + MU * (eps[3:] ** 2).sum()) / 4
        assert np.abs(density - by_hand).max() < 1e-12 * by_hand
        assert abs((density * weight).sum() - result.energy()) < 1e-12 * result.energy()


def test_elements_with_different_rules_give_a_list():
    mesh = kl.box(cells=(2, 1, 1))
    model = held_model(mesh, 1e-3 * mesh.points)
    model.use_rule(3, [1])
    result = model.solve()
    values = result.at_integration_points("CAUCHY_STRESS_VECTOR")
    assert [value.shape for value in values] == [(8, 6), (27, 6)]
    assert [value.shape for value in result.principal_stresses()] == [(8, 3), (27, 3)]


def test_unknown_quantities_and_elements_are_named():
    result = held_model(kl.box(), np.zeros((8, 3))).solve()
    for name, element, words in (
        ("VON_MISES", None, r"must be one of DISPLACEMENT, .*Did you mean VON_MISES"),
        ("STRAIN", 7, "no element has the id 7; ids run from 1 to 1"),
        ("STRAIN", "one", "id of an element must be a whole number"),
    ):
        with pytest.raises((kl.InputError, kl.MeshError), match=words):
            result.at_integration_points(name, element=element)


# ---- anywhere in the mesh ----------------------------------------------------------------------------


def quadratic(X):
    """Return a displacement (n, 3) of second degree, and its strain (n, 6)."""
    x, y, z = X.T
    u = np.array([x * x + y * z, 2 * x * y - z, y * y - 3 * x * z + x]).T
    zero = np.zeros_like(x)
    return 1e-3 * u, 1e-3 * np.array([2 * x, 2 * x, -3 * x, z + 2 * y, -1 + 2 * y, y - 3 * z + 1 + zero]).T


def linear(X):
    A = 1e-3 * np.array([[1.0, 2.0, 0.5], [-1.0, 3.0, 1.0], [0.0, 4.0, 2.0]])
    return X @ A.T, np.tile(voigt((A + A.T) / 2, 2.0), (len(X), 1))


def inner_points(count=40):
    return np.random.default_rng(2).uniform(0.1, 0.5, (count, 3)) * [1.6, 1.2, 1.0]


@pytest.mark.parametrize("kind", NAMES)
def test_strains_at_points_of_a_field_that_the_element_holds_are_exact(kind):
    regular = kl.box((1.0, 0.8, 0.6), (2, 1, 1), element=kind)
    mesh, field = (regular, quadratic) if kind[-3:] in ("10N", "20N", "27N") else (distorted(kind), linear)
    result, points = held_model(mesh, field(mesh.points)[0]).solve(), inner_points()
    u, strain = field(points)
    assert np.abs(result.at(points).displacement - u).max() < 1e-13
    assert np.abs(result.at(points).strain - strain).max() < 1e-13
    stress = strain * ([2 * MU] * 3 + [MU] * 3)
    stress[:, :3] += LAM * strain[:, :3].sum(axis=1, keepdims=True)
    assert np.abs(result.at(points).stress - stress).max() < 1e-12 * np.abs(stress).max()
    assert result.at(points).von_mises.shape == (40,)


@pytest.mark.parametrize("kind", NAMES)
def test_values_at_gauss_points_are_found_again_by_their_places(kind):
    mesh = distorted(kind)
    u = 1e-3 * np.random.default_rng(1).uniform(-1, 1, mesh.points.shape)
    model = held_model(mesh, u)
    model.set_stress_free_state(u[::-1])
    model.add_prestress(np.arange(6.0 * mesh.n_elements).reshape(-1, 6))
    result = model.solve()
    places = result.at_integration_points("INTEGRATION_COORDINATES")
    for at_gauss, at_points in (
        (result.strain(), result.at(places).strain),
        (result.stress(), result.at(places).stress),
    ):
        assert np.abs(at_points - at_gauss).max() < 1e-10 * np.abs(at_gauss).max()


def test_points_may_be_one_none_or_located_before():
    mesh = distorted("KinematicLinear3D8N")
    result = held_model(mesh, linear(mesh.points)[0]).solve()
    point = [0.4, 0.4, 0.3]
    assert result.at(point).strain.shape == (6,)
    assert result.at(np.zeros((0, 3))).stress.shape == (0, 6)
    located = mesh.locate([point, [9.0, 9.0, 9.0]])
    inside = result.at(located[located.inside]).stress
    assert (inside == result.at([point]).stress).all()


def test_a_point_outside_the_mesh_is_an_error_that_says_how_far():
    result = held_model(kl.box(), np.zeros((8, 3))).solve()
    with pytest.raises(kl.MeshError, match=r"point 1 at .* lies outside the mesh"):
        result.at([[0.5, 0.5, 0.5], [2.0, 0.5, 0.5]])
    larger = result.mesh.replace(points=result.mesh.points * 10)  # of the same size, but with other gradients
    with pytest.raises(kl.InputError, match="these points were located in another mesh"):
        result.at(larger.locate([0.5, 0.5, 0.5]))
    with pytest.raises(kl.InputError, match="recovered must be True or False"):
        result.at([0.5, 0.5, 0.5], recovered="yes")


def test_points_in_place_of_a_word_are_sent_to_at():
    result = held_model(kl.box(), np.zeros((8, 3))).solve()
    for method in (result.stress, result.strain, result.von_mises, result.tresca, result.principal_stresses):
        with pytest.raises(kl.InputError, match=r"one of gauss, element, .* result\.at\(points\)\.stress"):
            method([0.5, 0.5, 0.5])


def test_recovered_stresses_at_nodes_are_those_of_the_nodes_and_do_not_cross_materials():
    mesh = kl.box((2, 1, 1), (4, 2, 2), element="KinematicLinear3D20N")
    mesh.add_part("left", lambda X: X[:, 0] < 1.01)
    mesh.add_part("right", lambda X: X[:, 0] > 0.99)
    soft, stiff = (kl.Isotropic3D(E=E, nu=0.0) for E in (1e5, 1e6))
    model = kl.Model(mesh, {"left": soft, "right": stiff})
    x = mesh.points[:, 0]
    u = np.zeros_like(mesh.points)
    u[:, 0] = x * x
    model.fix(np.arange(mesh.n_nodes), "xyz", u)
    result = model.solve()
    inner = mesh.points[np.abs(x - 1) > 0.01]
    values = result.at(inner, recovered=True)
    assert np.abs(values.stress - result.stress("node")[np.abs(x - 1) > 0.01]).max() < 1e-6
    beside = result.at([[1 - 1e-9, 0.4, 0.4], [1 + 1e-9, 0.4, 0.4]], recovered=True)
    assert np.abs(beside.stress[:, 0] / [2e5, 2e6] - 1).max() < 1e-6
    assert np.abs(beside.displacement[:, 0] - 1).max() < 1e-6


def test_stresses_of_points_and_places_are_functions_of_the_same_tensor():
    mesh = distorted("KinematicLinear3D8N")
    u = 1e-3 * np.random.default_rng(1).uniform(-1, 1, mesh.points.shape)
    result, points = held_model(mesh, u).solve(), inner_points(6).reshape(2, 3, 3)
    values = result.at(points)
    tensor = values.stress[..., [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]
    principal = np.linalg.eigvalsh(tensor)[..., ::-1]
    size = np.abs(principal).max()
    assert np.abs(values.principal_stresses - principal).max() < 1e-14 * size
    assert np.abs(values.tresca - principal[..., 0] + principal[..., 2]).max() < 1e-14 * size
    V = values.principal_directions
    assert np.abs(V @ tensor @ np.swapaxes(V, -1, -2) - principal[..., None] * np.eye(3)).max() < 1e-14 * size
    for at, shape in (("gauss", (2, 8)), ("element", (2,)), ("node", (12,))):
        stress = result.stress(at)
        assert result.tresca(at).shape == shape
        mises = np.sqrt(
            ((result.principal_stresses(at) - stress[..., :3].mean(-1)[..., None]) ** 2).sum(-1) * 1.5
        )
        assert np.abs(result.von_mises(at) - mises).max() < 1e-14 * size
        assert result.principal_directions(at).shape == (*shape, 3, 3)


@pytest.mark.parametrize("parent", ["KinematicLinear3D8N", "BBar3D8N"])
def test_own_b_operator_gives_the_strain_at_points(parent):
    with kl.ELEMENTS.temporary():

        class TwiceTheStrain(kl.ELEMENTS[parent]):
            def B(self, xi):
                return 2 * super().B(xi)

        mesh = kl.box(element="TwiceTheStrain")
        u, strain = linear(mesh.points)
        result = held_model(mesh, u).solve()
        assert np.abs(result.at([[0.2, 0.7, 0.4]]).strain - 2 * strain[0]).max() < 1e-15


def test_states_of_a_transient_have_stresses_at_points():
    bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
    bar.fix("z-")
    bar.add(kl.Traction("z+", (0, 0, 1e3)))
    transient = bar.transient()
    *_, state = kl.integrate(transient, dt=1e-3, steps=20)
    stress = transient.result(state).at([0.3, 0.3, 0.3]).stress
    top = state.u[bar.mesh.nodes("z+"), 2].mean()
    assert abs(stress[2] - 1e6 * top) < 1e-9 * abs(stress[2])

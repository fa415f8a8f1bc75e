"""Recovered stresses: polynomials are exact, materials apart, hanging nodes harmless, kernels as NumPy."""

from dataclasses import replace

import numpy as np
import pytest
from computing import compiled, same_on_all_threads
from meshes import KINDS

import kratos_lite as kl
from kratos_lite import voigt
from kratos_lite.assembly import nodal_recovery, polynomial_fit
from kratos_lite.assembly.nodal_recovery import Recovery, sampling
from kratos_lite.assembly.patches import patches
from kratos_lite.assembly.polynomial_fit import Lists, Samples, fit, lists
from kratos_lite.mesh.refinement import refine
from kratos_lite.verification import scenes
from kratos_lite.verification.errors import errors
from kratos_lite.verification.meshes import element, split, warped

STEEL = kl.Isotropic3D(E=210e9, nu=0.3)


@pytest.fixture
def numpy_alone(monkeypatch):
    """Compute with the reference of the kernels."""
    monkeypatch.setattr(polynomial_fit, "kernels", lambda name: None)
    monkeypatch.setattr(nodal_recovery, "kernels", lambda name: None)
    monkeypatch.setattr("kratos_lite.assembly.patches.kernels", lambda name: None)


def region_of(mesh, material=STEEL):
    (region,) = Recovery(mesh, kl.Model(mesh, material).element_groups()).regions
    return region


def polynomial(degree, seed=1):
    """Return a function: six random polynomials of places."""
    powers = np.array([p for p in np.ndindex(*(degree + 1,) * 3) if sum(p) <= degree])
    factors = np.random.default_rng(seed).uniform(-1, 1, (len(powers), 6))
    return lambda X: np.prod(X[..., None, :] ** powers, axis=-1) @ factors


# ---- what is reproduced ----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_polynomials_of_the_degree_of_the_element_are_recovered_on_distorted_meshes(kind):
    mesh = warped(kind, 3)
    region = region_of(mesh)
    (group,) = region.groups
    field = polynomial(group.element.shape.degree)
    values = field(group.at(mesh.points).gauss_points())
    if (T := sampling(group.element, group.rule).from_gauss) is not None:
        # trilinear functions of an element take part: give their values at the samples
        N = sampling(group.element, group.rule).N
        wanted = field(N @ mesh.points[group.nodes])
        values = np.linalg.pinv(T) @ wanted
    found = region.at_nodes(mesh.points, [values])
    exact = field(mesh.points)
    if sampling(group.element, group.rule).means:
        exact = polynomial(1)(mesh.points)  # means of elements stand for linear fields on straight cells
        found = region.at_nodes(mesh.points, [polynomial(1)(group.at(mesh.points).gauss_points())])
    assert np.abs(found - exact).max() < 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("kind", KINDS)
def test_a_linear_displacement_has_constant_recovered_strain_and_stress(kind):
    mesh = warped(kind, 2)
    model = kl.Model(mesh, STEEL)
    gradient = np.random.default_rng(2).uniform(-1e-3, 1e-3, (3, 3))
    model.fix(np.arange(mesh.n_nodes), "xyz", mesh.points @ gradient.T)
    result = model.solve()
    strain = voigt.symmetric_gradient(gradient)
    assert np.abs(result.strain("node") - strain).max() < 1e-12
    assert np.abs(result.stress("node") - strain @ STEEL.C).max() < 1e-12 * 210e9
    assert result.error().relative < 1e-9
    assert not result.error().warnings


def bricks_and_wedges():
    """Return a box of bricks beside one of wedges."""
    grid = kl.box((2, 1, 1), (4, 2, 2))
    bricks = grid.blocks[0].nodes
    left = grid.points[bricks].mean(axis=1)[:, 0] < 1
    wedges = split(grid.points, bricks[~left], "6N").blocks[0]
    return kl.Mesh(
        grid.points, [kl.Block(element("8N"), bricks[left]), kl.Block(element("6N"), wedges.nodes)]
    )


LINEAR = {
    "two shapes": bricks_and_wedges,
    **{
        f"{kind} in layers {cells}": lambda kind=kind, cells=cells: kl.box((2, 1, 0.5), cells, element(kind))
        for kind in ("8N", "20N", "EnhancedStrain3D8N", "10N", "15N")
        for cells in ((1, 1, 1), (4, 1, 1), (3, 3, 1))
    },
    **{
        f"{kind} beside hanging nodes": lambda kind=kind: (
            refine(kl.box((1, 1, 1), (3, 3, 3), element(kind)), np.array([0, 1, 4])).mesh
        )
        for kind in ("8N", "20N")
    },
}


@pytest.mark.parametrize("mesh", LINEAR.values(), ids=LINEAR)
def test_linear_fields_are_recovered(mesh):
    mesh = mesh()
    region, field = region_of(mesh), polynomial(1)
    values = [field(group.at(mesh.points).gauss_points()) for group in region.groups]
    assert np.abs(region.at_nodes(mesh.points, values) - field(mesh.points)).max() < 1e-9


@pytest.mark.parametrize(("kind", "fraction"), [("10N", 0.5), ("15N", 1.0), ("20N", 1.0)])
def test_nodes_have_their_fraction_of_what_polynomials_leave_of_the_samples(kind, fraction, monkeypatch):
    """Recovered = polynomial + fraction · (mean of the extrapolated - that of the polynomials there)."""
    mesh = warped(kind, 3)
    region = region_of(mesh)
    (group,) = region.groups
    values = np.random.default_rng(4).normal(size=(len(group), len(group.rule), 6))
    found, plain = region.at_nodes(mesh.points, [values]), sampling(group.element, group.rule)

    def recovered(factor):
        way = replace(plain, to_nodes=factor * plain.to_nodes / plain.to_nodes.sum(axis=1).mean())
        monkeypatch.setattr(nodal_recovery, "sampling", lambda *_: way)
        return region.at_nodes(mesh.points, [values])

    polynomials, whole = recovered(0.0), recovered(1.0)
    np.testing.assert_allclose(found, polynomials + fraction * (whole - polynomials), atol=1e-12)


# ---- materials --------------------------------------------------------------------------------------


def two_materials():
    mesh = kl.box((1, 1, 2), (2, 2, 4))
    model, centers = kl.Model(mesh, STEEL), mesh.points[mesh.blocks[0].nodes].mean(axis=1)
    model.assign(kl.Isotropic3D(E=70e9, nu=0.2), np.flatnonzero(centers[:, 2] > 1))
    rows = np.arange(mesh.n_nodes)
    model.fix(rows, "xyz", np.column_stack([mesh.points[:, 0] * 1e-3, 0 * rows, 0 * rows]))
    return model


def test_materials_are_recovered_apart_and_an_interface_has_their_mean():
    result = two_materials().solve()
    z = result.mesh.points[:, 2]
    stress = result.stress("node")
    low, high = (kl.Isotropic3D(E=E, nu=nu).C[:, 0] * 1e-3 for E, nu in ((210e9, 0.3), (70e9, 0.2)))
    for rows, exact in ((z < 0.9, low), (z > 1.1, high), (np.abs(z - 1) < 1e-9, (low + high) / 2)):
        assert np.abs(stress[rows] - exact).max() < 1e-9 * low.max()
    assert result.error().relative < 1e-9
    averaged = result.stress("averaged")
    assert np.abs(averaged[np.abs(z - 1) < 1e-9] - (low + high) / 2).max() < 1e-9 * low.max()


def test_prestress_is_in_recovered_stress_and_not_in_the_error():
    model = kl.Model(kl.box(cells=(3, 3, 3)), STEEL)
    model.add_prestress(np.random.default_rng(3).uniform(-1e6, 1e6, (27, 6)))
    model.fix(np.arange(64), "xyz")
    result = model.solve()
    assert result.error().absolute == 0
    assert np.abs(result.stress("node")).max() > 1e4


# ---- places by name ---------------------------------------------------------------------------------


def test_raw_stress_has_a_row_for_each_node_of_each_element():
    scene = scenes.manufactured("20N", 2)
    result = scene.model.solve()
    raw, nodes = result.stress("raw"), result.mesh.blocks[0].nodes
    assert raw.shape == (8, 20, 6)
    total = np.zeros((result.mesh.n_nodes, 6))
    np.add.at(total, nodes, raw)
    mean = total / np.bincount(nodes.ravel())[:, None]
    assert np.abs(mean - result.stress("averaged")).max() < 1e-12 * np.abs(mean).max()


@pytest.mark.parametrize(
    ("kind", "most", "worst"),
    [
        ("20N", 5e-3, 9e-3),
        ("Reduced3D20N", 2e-3, 7e-3),
        ("8N", 2e-2, 5e-2),
        ("EnhancedStrain3D8N", 2.2e-2, 5e-2),
    ],
)
def test_recovered_hoop_stress_of_a_sphere_is_closer_than_averaged(kind, most, worst):
    """Mean and largest error on the inside of Lame's sphere: σ_φ = (1 + b³ / 2a³) / (b³ / a³ - 1) p."""
    result = scenes.sphere(kind, 6).model.solve()
    X = result.mesh.points
    inner = np.abs(np.linalg.norm(X, axis=1) - 1) < 1e-9
    error = {}
    for place in ("node", "averaged"):
        sigma = voigt.tensor(result.stress(place)[inner])
        radial = np.einsum("ni,nij,nj->n", X[inner], sigma, X[inner])
        hoop = (np.trace(sigma, axis1=1, axis2=2) - radial) / 2
        off = np.abs(hoop / (5 / 7) - 1)
        error[place] = np.array([off.mean(), off.max()])
    assert (error["node"] < (most, worst)).all()
    assert (error["averaged"] > error["node"] * (1.5, 1.2)).all()


# ---- patches ------------------------------------------------------------------------------------------


def test_patches_of_inner_nodes_are_their_elements_and_those_outside_take_them_over():
    mesh = kl.box(cells=(3, 3, 3))
    region = region_of(mesh)
    sizes, inside = region.patches.elements.lengths, (np.abs(mesh.points - 0.5) < 0.4).all(axis=1)
    assert (sizes[inside] == 8).all()
    own = np.add.reduceat(region.patches.weights == 1, region.patches.elements.start[:-1])
    assert (own[inside] == 8).all()
    assert sorted(set(own[~inside].tolist())) == [1, 2, 4]


@pytest.mark.parametrize(("kind", "size"), [("8N", 27), ("EnhancedStrain3D8N", 27), ("20N", 8), ("27N", 8)])
def test_patches_on_the_surface_have_a_second_layer_among_linear_bricks(kind, size):
    region = region_of(kl.box((1, 1, 1), (3, 3, 3), element(kind)))
    wide = region.patches.wide
    assert wide.sum() == (56 if size == 27 else 0)
    assert (region.patches.elements.lengths == np.where(wide, 27, 8)).all()
    thin = region_of(kl.box((1, 1, 1), (4, 4, 1), element(kind)))
    assert not thin.patches.wide.any()


def test_weights_in_wide_patches_fall_with_the_distance():
    mesh = kl.box(cells=(3, 3, 3))
    found = region_of(mesh).patches
    entries = slice(*found.elements.start[:2])  # of the corner (0, 0, 0)
    centers = mesh.points[mesh.blocks[0].nodes[found.elements.entries[entries]]].mean(axis=1)
    far = np.linalg.norm(centers, axis=1) / np.linalg.norm(centers, axis=1).min()
    np.testing.assert_allclose(found.weights[entries], far**-4.0, rtol=1e-12)


def test_hanging_nodes_take_the_patches_of_their_independents():
    mesh = kl.box(cells=(2, 1, 1))
    none = np.zeros(mesh.n_nodes, dtype=bool)
    independents = lists(np.array([0, 0]), np.array([1, 2]), 1)
    found = patches(mesh.blocks, mesh.points, none, np.array([0]), independents)
    assert found.of.lengths[0] == 2
    assert len(found.elements) == mesh.n_nodes - 1


# ---- kernels ---------------------------------------------------------------------------------------------


def compared(scene):
    result = scene.model.solve()
    found = Recovery(result.mesh, result.groups)
    return [found.nodal(result.u), *found.products(result.u, result.u, result.mesh.n_elements)]


@pytest.mark.parametrize(
    ("kind", "n"), [("4N", 2), ("6N", 2), ("8N", 2), ("8N", 3), ("10N", 2), ("13N", 2), ("20N", 2)]
)
def test_kernels_agree_with_numpy(kind, n, request):
    scene = scenes.manufactured(kind, n, 0.15)
    compiled = compared(scene)
    request.getfixturevalue("numpy_alone")
    for one, other in zip(compiled, compared(scene), strict=True):
        assert np.abs(one - other).max() < 1e-10 * np.abs(other).max()


@pytest.mark.parametrize("kind", ["8N", "10N"])
def test_error_of_a_product_is_the_square_where_both_are_one(kind):
    result = scenes.manufactured(kind, 2).model.solve()
    found, m = Recovery(result.mesh, result.groups), result.mesh.n_elements
    both = zip(found.products(result.u, result.u, m), found.products(result.u, 2 * result.u, m), strict=True)
    for squares, products in both:
        assert np.abs(products - 2 * squares).max() < 1e-12 * squares.max()


def test_fits_of_rank_deficient_samples_agree_with_numpy(request):
    rng = np.random.default_rng(4)
    places, values = rng.uniform(-1, 1, (60, 3)), rng.uniform(-1, 1, (60, 6))
    places[30:, 2] = 0.25  # a plane
    samples = Samples(places, values, np.arange(0, 61, 5))
    rows = Lists(np.array([0, 6, 12, 15]), np.array([*range(12), 0, 4, 9]))
    arguments = samples, rows, rng.uniform(0.1, 1, 15), np.array([3, 2, 3]), np.array([0, 0, 1])
    one = fit(*arguments).at(places, lists(np.arange(60), np.arange(60) % 3, 60))
    request.getfixturevalue("numpy_alone")
    other = fit(*arguments).at(places, lists(np.arange(60), np.arange(60) % 3, 60))
    assert np.abs(one - other).max() < 1e-9 * np.abs(other).max()


@compiled
def test_results_do_not_depend_on_the_number_of_threads():
    scene = scenes.manufactured("20N", 4)
    same_on_all_threads(lambda: tuple(compared(scene)), (1, 2, 3))


# ---- the estimate --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scene",
    [
        scenes.manufactured("8N", 6, 0.1),
        scenes.manufactured("20N", 4, 0.1),
        scenes.manufactured("10N", 4),
        scenes.manufactured("EnhancedStrain3D8N", 6),
        *(scenes.sphere(kind, 4) for kind in ("8N", "15N")),
        scenes.cavity("10N", 4),
        *(scenes.l_domain(*case) for case in (("8N", 8), ("27N", 6))),
    ],
    ids=lambda scene: f"{scene.name}-{scene.kind}",
)
def test_the_reported_error_is_between_the_true_one_and_twice_that(scene):
    result = scene.model.solve()
    effectivity = result.error().relative / errors(scene, result.u)["energy"]
    assert 1 < effectivity < 2


def test_parts_of_the_elements_add_up_to_the_whole():
    result = scenes.sphere("8N", 3).model.solve()
    error = result.error()
    assert error.per_element.shape == (81,)
    assert np.linalg.norm(error.per_element) == pytest.approx(error.absolute)
    assert "in the energy norm" in str(error)
    assert "energy norm" in dict(result.table())["estimated error"]


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (lambda: scenes.l_domain("8N", 8), "re-entrant corner"),
        (lambda: scenes.sphere("8N", 1), "3 elements are too few"),
        (lambda: scenes.cook("8N", 8, kl.Isotropic3D(E=1.0, nu=0.4999)), "lock near ν = ½"),
    ],
)
def test_warnings_name_what_speaks_against_the_estimate(scene, words):
    assert any(words in text for text in scene().model.solve().error().warnings)


def test_a_model_without_load_has_no_error():
    model = kl.Model(kl.box(cells=(2, 2, 2)), STEEL)
    model.fix("z-")
    error = model.solve().error()
    assert error.absolute == error.relative == 0
    assert error.warnings == []


def test_nodes_without_elements_have_no_stress():
    box = kl.box(cells=(2, 2, 2))
    mesh = kl.Mesh(np.vstack([box.points, [[9.0, 9, 9]]]), box.blocks)
    model = kl.Model(mesh, STEEL)
    model.fix(lambda X: X[:, 2] < 0.1)
    model.add(kl.PointLoad(lambda X: (X[:, 2] > 0.9) & (X[:, 0] < 2), (0, 0, 1.0), each=True))
    assert (model.solve().stress("node")[-1] == 0).all()

"""Quantities of interest: their values, and their estimated beside their true errors."""

from functools import cache

import numpy as np
import pytest
from meshes import KINDS

import kratos_lite as kl
from kratos_lite.analysis.error_estimate import SAFETY
from kratos_lite.assembly.nodal_recovery import Recovery
from kratos_lite.errors import InputError, MeshError, ModelError
from kratos_lite.verification import fields, scenes
from kratos_lite.verification.meshes import on_boundary, straight

E, NU = 1.0, 0.3
LAM, MU = fields.lame(E, NU)


@cache
def factor(power, order):
    """Return a derivative of x (1-x) x^power, a polynomial."""
    return np.polynomial.Polynomial([0] * (power + 1) + [1, -1]).deriv(order)


def bump(X, orders=(0, 0, 0)):
    """Return 64 x (1-x) y (1-y) z (1-z) (1 + 0.4 x - 0.3 y z²) or its derivatives."""
    out = 0.0
    for weight, powers in ((64.0, (0, 0, 0)), (25.6, (1, 0, 0)), (-19.2, (0, 1, 2))):
        x, y, z = (factor(*key)(X[..., axis]) for axis, key in enumerate(zip(powers, orders, strict=True)))
        out = out + weight * x * y * z
    return out


DIRECTION = np.array([1.0, -0.5, 0.7])


def force(X):
    """Return the body force that makes `bump` times DIRECTION the exact field."""
    axes = np.eye(3, dtype=int)
    laplace = sum(bump(X, 2 * a) for a in axes)
    div = [sum(DIRECTION[j] * bump(X, axes[i] + axes[j]) for j in range(3)) for i in range(3)]
    return np.stack([-(LAM + MU) * div[i] - MU * DIRECTION[i] * laplace for i in range(3)], axis=-1)


def clamped_cube(kind, n):
    """Return a cube clamped on all sides, whose exact displacement is `bump` times DIRECTION."""
    mesh = straight(kind, (n, n, n), lambda X: X)
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=NU))
    model.fix(on_boundary(mesh))
    model.add(kl.BodyForce(force))
    return model


def pulled_bar(kind="KinematicLinear3D8N", cells=(4, 2, 2), end=0.01):
    """Return a bar 2 x 1 x 1 clamped at one end, the other displaced along x."""
    model = kl.Model(kl.box((2, 1, 1), cells, kind), kl.Isotropic3D(E=1e3, nu=0.3))
    model.fix("x-")
    model.fix("x+", "x", end)
    return model


# ---- values ------------------------------------------------------------------------------------------


def test_values_are_those_of_the_result():
    result = pulled_bar().solve()
    point = (1.3, 0.4, 0.2)
    assert kl.DisplacementAt(point, "y").value(result) == pytest.approx(result.at(point).displacement[1])
    assert kl.StressAt(point, "xy").value(result) == result.at(point).stress[3]
    assert kl.StressAt(point, "xz").value(result) == result.at(point).stress[5]
    reaction = kl.ReactionOf("x-", "x").value(result)
    assert reaction == pytest.approx(result.reaction("x-")[:, 0].sum())
    assert kl.MeanDisplacement("x+", "x").value(result) == pytest.approx(0.01)


def test_mean_displacement_is_an_integral_not_the_mean_of_nodes():
    mesh = kl.box((1, 1, 1), (2, 1, 1))
    mesh = mesh.replace(points=mesh.points**2)  # cells of unequal length
    model = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3))
    model.fix(np.arange(12), "xyz", mesh.points * [1.0, 2.0, 3.0])
    result = model.solve()
    assert kl.MeanDisplacement("y+", "x").value(result) == pytest.approx(0.5)
    everything = kl.MeanDisplacement(np.arange(12), "z")
    assert everything.value(result) == pytest.approx(1.5)


def test_mean_over_a_volume_inside():
    mesh = kl.box((1, 1, 1), (3, 3, 3))
    model = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3))
    model.fix(on_boundary(mesh), "xyz", mesh.points[on_boundary(mesh)] @ np.diag([1.0, 2.0, 3.0]))
    inside = (np.abs(mesh.points - 0.5) < 0.2).all(axis=1)
    mean = kl.MeanDisplacement(inside, "z").value(model.solve())
    assert mean == pytest.approx(1.5)


@pytest.mark.parametrize("kind", ["KinematicLinear3D8N", "EnhancedStrain3D8N", "KinematicLinear3D10N"])
def test_loads_are_derivatives_of_values_or_of_means_around_points(kind):
    """In one brick, or the pieces of it, the mean around a point is that of the body."""
    model = kl.Model(kl.box((2, 1, 1), (1, 1, 1), kind), kl.Isotropic3D(E=1e3, nu=0.3))
    change = np.random.default_rng(1).uniform(-1, 1, model.mesh.points.shape)
    model.fix(np.arange(model.mesh.n_nodes), "xyz", change)
    result = model.solve()
    volume = result.at_integration_points("INTEGRATION_WEIGHT")
    mean = (result.stress("gauss") * volume[..., None]).sum(axis=(0, 1)) / 2.0
    point = (0.9, 0.4, 0.45)
    assert (kl.StressAt(point, "yy").load(result) * change).sum() == pytest.approx(mean[1])
    assert (kl.StressAt(point, "zx").load(result) * change).sum() == pytest.approx(mean[5])
    for quantity in (kl.MeanDisplacement("z+", "x"), kl.DisplacementAt(point, "y")):
        assert (quantity.load(result) * change).sum() == pytest.approx(quantity.value(result))


# ---- errors ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_no_error_where_the_mesh_has_the_exact_field(kind):
    mesh = kl.box((1.0, 0.8, 0.6), (2, 2, 2), f"KinematicLinear3D{kind}")
    model = kl.Model(mesh, kl.Isotropic3D(E=1e3, nu=0.3))
    for side in ("x-", "y-", "z-"):
        model.fix(side, side[0])
    model.add(kl.Traction("x+", (5.0, 0.0, 0.0)))
    result = model.solve()
    for quantity, scale in (
        (kl.DisplacementAt((1, 0.8, 0.6), "x"), 5e-3),
        (kl.MeanDisplacement("y+", "y"), 1e-3),
        (kl.ReactionOf("x-", "x"), 2.4),
        (kl.StressAt((0.3, 0.2, 0.5), "xx"), 5.0),
    ):
        error = result.error(of=quantity)
        assert abs(quantity.value(result)) > 0.2 * scale
        assert error.absolute < 1e-9 * scale
        assert abs(error.signed) <= max(error.absolute, 1e-12 * scale)


def test_reaction_of_what_is_pulled_has_the_energy_error():
    """R = 2 U / δ, and the energy U of a solution under prescribed displacements is too large by ‖e‖² / 2."""
    model = pulled_bar(end=0.01)
    result = model.solve()
    error = result.error(of=kl.ReactionOf("x+", "x"))
    assert error.value == pytest.approx(2 * result.energy() / 0.01)
    squares, _ = Recovery(result.mesh, result.groups).products(result.u, result.u, result.mesh.n_elements)
    assert error.signed == pytest.approx(-squares.sum() / 0.01)
    assert error.per_element == pytest.approx(-squares / 0.01)
    other = result.error(of=kl.ReactionOf("x-", "x"))
    assert other.signed == pytest.approx(-error.signed)


def test_displacement_under_the_load_has_the_energy_error():
    """u = 2 U / F, and the energy of a solution under loads is too small by ‖e‖² / 2."""
    model = kl.Model(kl.box((3, 1, 1), (6, 2, 2)), kl.Isotropic3D(E=1e3, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (0.0, 0.0, 2.0)))
    result = model.solve()
    error = result.error(of=kl.MeanDisplacement("x+", "z"))
    assert error.value == pytest.approx(2 * result.energy() / 2.0)
    squares, _ = Recovery(result.mesh, result.groups).products(result.u, result.u, result.mesh.n_elements)
    assert error.signed == pytest.approx(squares.sum() / 2.0)
    assert error.relative == pytest.approx(error.absolute / (error.value + error.signed))
    assert error.absolute == pytest.approx(SAFETY["recovery"] ** 2 * squares.sum() / 2.0)


@pytest.mark.parametrize(("kind", "n", "low", "high"), [("8N", 8, 0.7, 1.3), ("4N", 6, 0.6, 1.4)])
def test_error_of_a_mean_beside_the_exact_one(kind, n, low, high):
    model = clamped_cube(kind, n)
    half = kl.MeanDisplacement(lambda X: X[:, 0] < 0.5 + 1e-9, "x")
    half.load = lambda result: _over_half(model, result)
    result = model.solve()
    x, w = np.polynomial.legendre.leggauss(6)
    x, w = (x + 1) / 2, w / 2
    grid = np.stack(np.meshgrid(x / 2, x, x, indexing="ij"), axis=-1)
    exact = (bump(grid) * w[:, None, None] * w[:, None] * w).sum() * DIRECTION[0]
    error = result.error(of=half)
    true = exact - error.value
    assert low * true < error.signed < high * true
    assert abs(true) < error.absolute


POINTS = np.random.default_rng(5).uniform(0.1, 0.9, (6, 3))


def stress_xx(point):
    gradient = fields.gradient(lambda X: bump(X)[..., None] * DIRECTION, point)
    return LAM * np.trace(gradient) + 2 * MU * gradient[0, 0]


@pytest.mark.parametrize(
    ("kind", "n", "share", "slack"), [("8N", 6, 0.4, 9), ("4N", 6, 0.4, 6), ("20N", 3, 0.9, 9)]
)
def test_errors_at_points_beside_the_exact_ones(kind, n, share, slack):
    """In the mean the estimate of stresses misses their error by less than a share of it, with its sign."""
    result, norm = clamped_cube(kind, n).static().solve(), np.linalg.norm
    errors = [result.error(of=kl.StressAt(point, "xx")) for point in POINTS]
    true = np.array([stress_xx(point) - e.value for point, e in zip(POINTS, errors, strict=True)])
    assert norm([e.signed for e in errors] - true) < share * norm(true)
    assert norm(true) < norm([e.absolute for e in errors]) < 6 * norm(true)
    errors = [result.error(of=kl.DisplacementAt(point, "z")) for point in POINTS]
    absolute = np.array([e.absolute for e in errors])
    true = np.array([bump(point) * DIRECTION[2] - e.value for point, e in zip(POINTS, errors, strict=True)])
    assert (np.abs(true) < absolute).mean() > 0.8
    assert norm(true) < norm(absolute) < slack * norm(true)


@pytest.mark.parametrize("kind", ["EnhancedStrain3D8N", "KinematicLinear3D20N", "KinematicLinear3D10N"])
def test_the_safe_figure_of_stresses_in_a_bent_bar_is_no_smaller_than_their_errors(kind):
    """Coarse bars, where recovered stresses at a point may be those of the elements by chance."""
    fine = fine_bar()
    result = bent_bar(kind, (8, 2, 2)).static().solve()
    for point in np.random.default_rng(3).uniform((0.6, 0.05, 0.05), (3.4, 0.95, 0.95), (4, 3)):
        exact = fine.at(point).stress
        for component, stress in zip(("xx", "yy", "zz", "xy", "yz", "zx"), exact, strict=True):
            error = result.error(of=kl.StressAt(point, component))
            assert abs(stress - error.value) < 1.5 * error.absolute + 2e-3 * np.abs(exact).max()


@cache
def fine_bar():
    return bent_bar("KinematicLinear3D27N", (16, 4, 4)).solve()


def bent_bar(kind, cells):
    model = kl.Model(kl.box((4, 1, 1), cells, element=kind), kl.Isotropic3D(E=210e9, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1e6)))
    return model


COOK_TIP, COOK_REACTION = 9.5703, 1208.9
"""m and N: u_y of the upper corner and the reaction of one face, of 40 x 40 cells of 27 nodes."""


@pytest.mark.parametrize(("kind", "n", "low"), [("8N", 8, 0.5), ("4N", 12, 0.7), ("27N", 6, 0.25)])
def test_cook(kind, n, low):
    """Stresses have no limit in a corner of the support, which costs part of the estimate."""
    result = scenes.cook(kind, n).model.static().solve()
    for quantity, exact in (
        (kl.DisplacementAt((48, 60, 0), "y"), COOK_TIP),
        (kl.ReactionOf("z+", "z"), COOK_REACTION),
    ):
        error = result.error(of=quantity)
        true = exact - error.value
        assert low * true < error.signed < 1.6 * true
        assert 0.9 * true < error.absolute < 4 * true


@pytest.mark.parametrize(("kind", "n"), [("10N", 4), ("20N", 4), ("20N", 8)])
def test_the_safe_figure_of_quadratic_elements_reaches_the_error_of_a_tip_beyond_a_corner(kind, n):
    error = scenes.cook(kind, n).model.solve().error(of=kl.DisplacementAt((48, 60, 0), "y"))
    true = COOK_TIP - error.value
    assert 0.9 * true < error.absolute < 3 * true
    assert 0 < error.signed < true
    assert any("few elements contribute" in text for text in error.warnings) == (n == 8)


def _over_half(model, result):
    from kratos_lite.assembly.gauss_point_fields import body_force

    (group,) = result.groups
    half = group.take(result.mesh.points[group.nodes].mean(axis=1)[:, 0] < 0.5)
    return body_force(result.mesh.points, half, np.array([2.0, 0.0, 0.0]))


def test_the_mean_around_a_point_takes_all_elements_that_share_a_corner():
    """A point in the cell at one corner of 27: the 8 cells around that cell's inner corner."""
    mesh = kl.box((3, 3, 3), (3, 3, 3))
    model = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.3))
    model.fix("z-")
    for cell, around in (((0, 0, 0), 8), ((0, 0, 1), 12), ((1, 1, 1), 27), ((2, 2, 2), 8), ((2, 0, 1), 12)):
        group = kl.StressAt(np.add(cell, (0.4, 0.3, 0.6)), "xx")._around(model.solve())
        centers = mesh.points[group.nodes].mean(axis=1) - 0.5
        assert len(group) == around
        assert (np.abs(centers - cell).max(axis=1) < 1.5).all()


def test_a_part_that_nothing_moves_has_no_error():
    mesh = scenes.joined([kl.box(cells=(2, 2, 2), origin=(2.0 * i, 0, 0)) for i in range(2)])
    model = kl.Model(mesh, kl.Isotropic3D(E=1e3, nu=0.3))
    model.fix("z-")
    top = (mesh.points[:, 2] == 1) & (mesh.points[:, 0] < 1.5)
    model.add(kl.Traction(top, (1.0, 0.0, 0.0)))
    analysis = model.static()
    result = analysis.solve()
    assert result.error(of=kl.DisplacementAt((2.5, 0.5, 1.0), "x")).absolute == 0
    loaded = result.error(of=kl.DisplacementAt((0.5, 0.5, 1.0), "x"))
    assert 0 < loaded.signed <= loaded.absolute
    again = model.solve().error(of=kl.DisplacementAt((0.5, 0.5, 1.0), "x"))
    assert again.signed == pytest.approx(loaded.signed)


@pytest.mark.parametrize("kind", ["4N", "8N", "10N", "20N"])
def test_the_stress_in_a_layer_takes_no_part_of_the_layer_beside_it(kind):
    """Two layers are pulled side by side: the stress jumps between them, and is exact."""
    mesh = kl.box((4, 1, 1), (2, 1, 4), f"KinematicLinear3D{kind}")
    (block,) = mesh.blocks
    upper = np.flatnonzero(mesh.points[block.nodes].mean(axis=1)[:, 2] > 0.5)
    model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.0))
    model.assign(kl.Isotropic3D(E=1e9, nu=0.0), upper)
    for part, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
        model.fix(part, axis)
    model.fix("x+", "x", 0.01)
    result = model.solve()
    for z, stress in ((0.3, 2.5e3), (0.49, 2.5e3), (0.51, 2.5e6)):
        found = result.error(of=kl.StressAt((2, 0.4, z), "xx"))
        assert found.value == pytest.approx(stress)
        assert found.absolute < 1e-8 * stress
    lower = result.stress_of_material(0)[:, 0]
    assert np.abs(lower[mesh.points[:, 2] < 0.6] - 2.5e3).max() < 1e-6
    assert not lower[mesh.points[:, 2] > 0.6].any()


def test_prestress_and_prescribed_values_are_no_part_of_the_adjoint():
    plain, other = pulled_bar(), pulled_bar()
    other.add_prestress([7.0, 7.0, 7.0, 0.0, 0.0, 0.0])
    for model in (plain, other):
        model.fix("y-", "y", 0.0)
    a, b = (model.solve() for model in (plain, other))
    one, two = (result.error(of=kl.StressAt((1.2, 0.4, 0.3), "xx")) for result in (a, b))
    stress = b.at((1.2, 0.4, 0.3)).stress - a.at((1.2, 0.4, 0.3)).stress
    assert two.value - one.value == pytest.approx(stress[0])
    assert one.per_element.shape == two.per_element.shape


def test_hanging_nodes_of_a_support_belong_to_its_reaction():
    """A fine bar beside a coarse one on the same support: dependents there follow nodes that are held."""
    model = pulled_bar()
    held = model.solve().error(of=kl.ReactionOf("x+", "x"))
    tied = kl.Model(model.mesh, kl.Isotropic3D(E=1e3, nu=0.3))
    tied.fix("x-")
    rows = tied.mesh.nodes("x+")
    tied.fix(rows[:1], "x", 0.01)
    for row in rows[1:]:
        tied.constrain((int(row), "x"), {(int(rows[0]), "x"): 1.0})
    found = tied.solve().error(of=kl.ReactionOf("x+", "x"))
    assert found.value == pytest.approx(held.value)
    assert found.signed == pytest.approx(held.signed)


def test_a_support_that_goes_on_beside_the_part_is_reported():
    result = pulled_bar().solve()
    assert result.error(of=kl.ReactionOf("x-", "x")).warnings == []
    shared = result.error(of=kl.ReactionOf(lambda X: (X[:, 0] == 0) & (X[:, 1] < 0.6), "y")).warnings
    assert len(shared) == 1
    assert shared[0].startswith("2 faces beside the part are held along y, too")


def test_faces_beside_the_part_of_which_two_corners_are_held_carry_nothing():
    def part(X):
        return (X[:, 0] == 0) & (X[:, 1] < 0.6)

    model = kl.Model(kl.box((2, 1, 1), (4, 2, 2)), kl.Isotropic3D(E=1e3, nu=0.3))
    model.fix(part)
    model.fix("x+", "x", 0.01)
    assert model.solve().error(of=kl.ReactionOf(part, "y")).warnings == []


def test_a_quantity_of_your_own():
    class Opening(kl.Quantity):
        unit = "m"

        def value(self, result):
            return float((self.load(result) * result.u).sum())

        def load(self, result):
            one, other = (kl.MeanDisplacement(part, "y").load(result) for part in ("y+", "y-"))
            return one - other

    model = pulled_bar()
    result = model.solve()
    error = result.error(of=Opening())
    assert error.value == pytest.approx(2 * kl.MeanDisplacement("y+", "y").value(result))
    assert error.unit == "m"
    assert "m" in str(error)


# ---- what is refused ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("quantity", "kind", "words"),
    [
        (lambda: kl.DisplacementAt((0, 0), "x"), InputError, "a point must have shape"),
        (lambda: kl.DisplacementAt((0, 0, np.nan), "x"), InputError, "must be finite"),
        (lambda: kl.DisplacementAt((0, 0, 0), "w"), InputError, "axis must be one of x, y, z"),
        (lambda: kl.MeanDisplacement("x+", 1), InputError, "axis must be one of x, y, z"),
        (lambda: kl.ReactionOf("x-", "xy"), InputError, "axis must be one of x, y, z"),
        (lambda: kl.StressAt((0, 0, 0), "xw"), InputError, "component must be one of xx, yy, zz, xy, yz, zx"),
        (lambda: "tip", InputError, "of must be a Quantity, such as kl.DisplacementAt"),
        (lambda: kl.DisplacementAt, InputError, "of must be a Quantity"),
        (lambda: kl.DisplacementAt((9, 0, 0), "x"), MeshError, "lies outside the mesh"),
        (lambda: kl.StressAt((9, 0, 0), "xx"), MeshError, "lies outside the mesh"),
        (lambda: kl.MeanDisplacement("nowhere", "x"), MeshError, "there is no part 'nowhere'"),
        (
            lambda: kl.MeanDisplacement([0, 1], "x"),
            ModelError,
            "neither a face on the boundary nor an element",
        ),
        (lambda: kl.ReactionOf("nowhere", "x"), MeshError, "there is no part 'nowhere'"),
        (lambda: kl.ReactionOf(lambda X: X[:, 0] == 1, "y"), ModelError, "nothing is prescribed on the part"),
    ],
)
def test_wrong_quantities(quantity, kind, words):
    with pytest.raises(kind, match=words):
        pulled_bar(cells=(2, 1, 1)).solve().error(of=quantity())


def test_a_reaction_that_constraints_share_is_refused():
    model = pulled_bar(cells=(2, 1, 1))
    inner = model.mesh.nodes(lambda X: np.abs(X[:, 0] - 1) < 1e-9)
    end = model.mesh.nodes("x+")
    model.constrain((int(inner[0]), "x"), {(int(end[0]), "x"): 0.5})
    result = model.solve()
    with pytest.raises(ModelError, match="multi-point constraints tie the part"):
        result.error(of=kl.ReactionOf("x+", "x"))


def test_a_model_that_has_changed_is_refused():
    model = pulled_bar(cells=(2, 1, 1))
    result = model.solve()
    model.fix("y-", "y")
    with pytest.raises(ModelError, match="the model has changed since"):
        result.error(of=kl.DisplacementAt((1, 1, 1), "z"))


def test_results_of_a_motion_or_a_time_are_refused():
    wheel = kl.Model(kl.annulus(0.2, 1.0, 0.1), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    wheel.fix("inner")
    wheel.add(kl.ale.Rotation("z", rate=10.0))
    with pytest.raises(InputError, match="needs the model and the matrix of a static"):
        wheel.solve().error(of=kl.DisplacementAt((0.5, 0, 0), "x"))

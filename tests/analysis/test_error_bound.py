"""The bound of the error by stresses in equilibrium: never below the true error, and by how much above."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError
from kratos_lite.quadrature import rule_for
from kratos_lite.verification import fields, scenes
from kratos_lite.verification.errors import norms
from kratos_lite.verification.meshes import on_plane, warped

KINDS = ["4N", "5N", "6N", "8N", "10N", "13N", "15N", "20N", "27N"]


def true_error(scene, result):
    """Return the energy norm of the error beside an exact field, in √J."""
    (group,) = result.groups
    share = norms(scene.exact, scene.model.mesh.points, [group], result.u)[1]
    rule = rule_for(group.element.shape.cell, 8)
    placed = group.element(scene.model.mesh.points[group.nodes], rule)
    X = np.stack([placed.shape.N(xi) for xi in rule.points]) @ placed.X
    strain = fields.gradient(scene.exact, X)
    strain = (strain + np.swapaxes(strain, -1, -2)) / 2
    lam, mu = fields.lame(group.material.E, group.material.nu)
    trace = np.trace(strain, axis1=-2, axis2=-1)
    density = lam * trace**2 + 2 * mu * (strain**2).sum(axis=(-1, -2))
    return share * np.sqrt((density * placed.dV).sum())


@pytest.mark.parametrize("kind", KINDS)
def test_no_error_where_the_mesh_has_the_exact_field(kind):
    """On warped faces of quadratic cells the traction of a constant stress is no polynomial."""
    mesh = warped(kind, 2)
    model = kl.Model(mesh, kl.Isotropic3D(E=1e3, nu=0.3))
    for axis, letter in enumerate("xyz"):
        model.fix(on_plane(mesh, axis, 0.0), letter)
    model.add(kl.Traction(on_plane(mesh, 0, 1.0), (5.0, 0.0, 0.0)))
    bound = model.solve().error(method="equilibrated")
    assert bound.relative < (1e-6 if kind in ("4N", "5N", "6N", "8N", "10N") else 1e-4)
    assert bound.method == "equilibrated"


@pytest.mark.parametrize(("kind", "n", "slack"), [("8N", 3, 1.2), ("6N", 3, 1.2), ("4N", 3, 2.5)])
def test_gravity_cube(kind, n, slack):
    """u_z is quadratic: exact for quadratic elements, an error for linear ones."""
    scene = scenes.cube(kind, n)
    result = scene.model.solve()
    true, bound = true_error(scene, result), result.error(method="equilibrated")
    assert true * (1 - 1e-6) < bound.absolute < slack * true
    assert np.sqrt((bound.per_element**2).sum()) == pytest.approx(bound.absolute)


@pytest.mark.parametrize("kind", ["10N", "15N", "20N", "27N"])
def test_quadratic_elements_have_the_gravity_cube(kind):
    assert scenes.cube(kind, 2).model.solve().error(method="equilibrated").relative < 1e-6


@pytest.mark.parametrize(("kind", "n", "slack"), [("10N", 2, 3.5), ("20N", 2, 2.5), ("27N", 2, 1.5)])
def test_sphere_under_pressure(kind, n, slack):
    scene = scenes.sphere(kind, n)
    result = scene.model.solve()
    true, bound = true_error(scene, result), result.error(method="equilibrated")
    assert true < bound.absolute < slack * true


COOK = 2 * 457.48
"""Twice the energy of Cook's membrane in J, good to 1e-4: quadratic elements, extrapolated."""


@pytest.mark.parametrize(
    ("kind", "n", "slack"),
    [("8N", 6, 4.0), ("20N", 3, 2.6), ("4N", 6, 16.0), ("10N", 3, 11.0), ("6N", 6, 13.0)],
)
def test_cook(kind, n, slack):
    """‖u‖² - ‖u_h‖² = ‖e‖² under loads alone; its cells are flat, which costs slack."""
    result = scenes.cook(kind, n).model.solve()
    true = np.sqrt(COOK - 2 * result.energy())
    assert true < result.error(method="equilibrated").absolute < slack * true


def block(mesh):
    """Return a cube clamped at its bottom, with a weight, a pressure and a traction that varies."""
    model = kl.Model(mesh, kl.Isotropic3D(E=1e3, nu=0.3, density=2.0))
    model.fix(on_plane(mesh, 2, 0.0))
    model.add(kl.Gravity((3.0, 2.0, -9.81)), amplitude=0.5)
    model.add(kl.Pressure(on_plane(mesh, 0, 0.0), 4.0))
    model.add(kl.Traction(on_plane(mesh, 2, 1.0), lambda X: np.outer(X[:, 1], [3.0, 0.0, 1.0])))
    model.add(kl.BodyForce(mesh.points @ np.diag([1.0, 0.0, 2.0])))
    return model


@pytest.mark.parametrize("kind", KINDS)
def test_every_element_under_every_load(kind):
    """The reference is a finer mesh of quadratic elements: the energy grows towards the exact one."""
    result = block(kl.box(cells=(2, 2, 2), element=f"KinematicLinear3D{kind}")).solve()
    fine = block(kl.box(cells=(6, 6, 6), element="KinematicLinear3D20N")).solve()
    true = np.sqrt(2 * fine.energy() - 2 * result.energy())
    bound = result.error(method="equilibrated").absolute
    assert true < bound < 5 * true


def test_prestress_and_two_materials():
    mesh = kl.box((2, 1, 1), (4, 2, 2), "KinematicLinear3D8N")
    model = kl.Model(mesh, kl.Isotropic3D(E=1e3, nu=0.0))
    model.assign(kl.Isotropic3D(E=5e3, nu=0.0), mesh.elements()[: mesh.n_elements // 2])
    model.fix("x-")
    model.add_prestress([3.0, 0, 0, 0, 0, 0])
    model.add(kl.Traction("x+", (5.0, 0.0, 0.0)))
    assert model.solve().error(method="equilibrated").relative < 1e-6


# ---- what is refused ------------------------------------------------------------------------------------


def bar(kind="KinematicLinear3D8N"):
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1), kind), kl.Isotropic3D(E=1e3, nu=0.3))
    model.fix("x-")
    return model


def test_a_point_load_is_refused():
    model = bar()
    model.add(kl.PointLoad(lambda X: X[:, 0] == 2, (0, 0, 1.0)))
    with pytest.raises(ModelError, match=r"takes loads per area and volume.*got PointLoad"):
        model.solve().error(method="equilibrated")


def test_a_support_of_points_is_refused():
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1), "KinematicLinear3D8N"), kl.Isotropic3D(E=1e3, nu=0.3))
    model.fix(lambda X: (X[:, 0] != 1) & (X[:, 2] == 0))
    model.add(kl.Gravity((0, 0, -1.0)))
    model.assign(kl.Isotropic3D(E=1e3, nu=0.3, density=1.0))
    with pytest.raises(
        ModelError, match=r"a force acts on node .* that is neither a traction nor a body force"
    ):
        model.solve().error(method="equilibrated")


def test_constraints_are_refused():
    model = bar()
    model.constrain((11, "x"), {(10, "x"): 1.0})
    model.add(kl.Traction("x+", (5.0, 0.0, 0.0)))
    with pytest.raises(ModelError, match="takes neither multi-point constraints nor hanging"):
        model.solve().error(method="equilibrated")


def test_elements_with_a_strain_of_their_own_are_refused():
    model = bar("EnhancedStrain3D8N")
    model.add(kl.Traction("x+", (5.0, 0.0, 0.0)))
    with pytest.raises(ModelError, match="EnhancedStrain3D8N has its own"):
        model.solve().error(method="equilibrated")


def test_unknown_methods_and_bounds_of_quantities_are_refused():
    model = bar()
    model.add(kl.Traction("x+", (5.0, 0.0, 0.0)))
    result = model.solve()
    with pytest.raises(InputError, match="method must be one of recovery, equilibrated"):
        result.error(method="exact")
    with pytest.raises(InputError, match="the error of a quantity is estimated by recovery"):
        result.error(of=kl.ReactionOf("x-", "x"), method="equilibrated")

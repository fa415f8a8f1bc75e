"""Bodies that supports leave free: solved without rigid motions where their loads balance, else refused."""

import numpy as np
import pytest
from meshes import joined

import kratos_lite as kl
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.mesh.hanging import is_corner
from kratos_lite.model.loads.body import BodyForce
from kratos_lite.solvers.constraints import rigid_modes

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
STRING = kl.Isotropic3D(E=210e9, nu=0.0, density=7850.0)
ELEMENTS = ["KinematicLinear3D8N", "KinematicLinear3D10N"]
FAR = np.array((3e4, -2e4, 1e4))


def bar(cells=(3, 2, 2), element=ELEMENTS[0], material=STEEL):
    return kl.Model(kl.box((3.0, 1.0, 1.0), cells, element), material)


def pull(model, stress=1e6, faces=("x-", "x+")):
    for face, sign in zip(faces, (-1.0, 1.0), strict=True):
        model.add(kl.Traction(face, (sign * stress, 0.0, 0.0)))
    return model


def stretched(X, strain=1e6 / STEEL.E):
    """Return the displacement of the bar under 1 MPa, from its center."""
    return strain * (X - (X.max(axis=0) + X.min(axis=0)) / 2) * (1.0, -STEEL.nu, -STEEL.nu)


def near(values, exact, share=1e-9):
    assert np.abs(values - exact).max() < share * np.abs(exact).max()


def shared(model, u):
    """Return ∫ R^T u dV (6,) of the rigid modes of a body, as a share of ∫ |R| |u| dV at most."""
    R = rigid_modes(model.mesh.points).reshape(-1, 3, 6)
    forces = [BodyForce(R[..., k]).forces(model.mesh, model.element_groups()) for k in range(6)]
    volume = BodyForce((1.0, 0.0, 0.0)).forces(model.mesh, model.element_groups()).sum()
    return np.array([(f * u).sum() for f in forces]) / np.abs(R).max() / np.abs(u).max() / volume


SMALL, LARGE = (3, 2, 2), (12, 4, 4)


@pytest.mark.parametrize(
    ("solver", "cells"),
    [("dense", SMALL), ("direct", SMALL), ("amg", SMALL), ("direct", LARGE), ("amg", LARGE)],
)
@pytest.mark.parametrize("element", ELEMENTS)
def test_a_free_bar_that_is_pulled_has_the_exact_displacement(element, solver, cells):
    model = pull(bar(cells, element))
    result = model.solve(solver)
    near(result.u, stretched(model.mesh.points))
    near(result.stress("element"), np.tile([1e6, 0, 0, 0, 0, 0], (model.mesh.n_elements, 1)))
    assert abs(result.energy() - 1e6**2 / STEEL.E / 2 * 3) < 1e-9 * result.energy()
    assert not result.reactions.any()
    (note,) = result.report.notes
    assert note.startswith(f"the body ({model.mesh.n_nodes} nodes) can still move: translation x, y, z; rot")


def test_numbering_and_place_change_nothing_but_roundings():
    model, rng = pull(bar(element=ELEMENTS[1])), np.random.default_rng(0)
    model.add_prestress(rng.standard_normal((model.mesh.n_elements, 6)) * 1e6)
    u, old = model.solve("direct").u, model.mesh
    assert np.abs(shared(model, u)).max() < 1e-12
    order = rng.permutation(old.n_nodes)
    block = old.blocks[0]
    nodes = np.argsort(order)[block.nodes].astype(np.int32)
    blocks = [kl.Block(block.name, nodes, block.ids, block.properties, block.shape)]
    for shift, error in ((0 * FAR, 1e-12), (FAR, 1e-9)):
        other = kl.Model(kl.Mesh(old.points[order] + shift, blocks), STEEL)
        sides = [(lambda X, x=x: np.abs(X[:, 0] - x) < 1e-6) for x in (shift[0], shift[0] + 3)]
        pull(other, faces=sides).add_prestress(model.prestress)
        near(other.solve("direct").u, u[order], error)


def test_own_strain_and_own_stress_are_in_balance_by_nature():
    """Warm bodies have no stress, and a uniform stress is let go: u = α ΔT x and -C^-1 σ0 x."""
    warm, stressed = bar(element=ELEMENTS[1]), bar()
    X = warm.mesh.points - warm.mesh.points.mean(axis=0)
    turned = np.cross((1e-3, -2e-3, 3e-3), X) + 0.1
    warm.set_stress_free_state(1.2e-5 * 80 * (X - (X.max(axis=0) + X.min(axis=0)) / 2) + turned)
    result = warm.solve()
    near(result.u, 1.2e-5 * 80 * (X - (X.max(axis=0) + X.min(axis=0)) / 2))
    assert np.abs(result.stress("element")).max() < 1e-6 * STEEL.E * 1.2e-5 * 80
    stressed.add_prestress((1e6, 0, 0, 0, 0, 0))
    result = stressed.solve()
    near(result.u, -stretched(stressed.mesh.points))
    assert np.abs(result.stress("element")).max() < 1e-3


def test_a_bar_that_rotates_about_its_middle():
    """E u' = ρ ω² (a² - x²) / 2 between free ends at ± a; linear elements are exact at nodes."""
    model, factor = bar((8, 1, 1), material=STRING), STRING.density * 30.0**2
    model.add(BodyForce(lambda X: factor * (X - 1.5) * (1.0, 0.0, 0.0)))
    x = model.mesh.points[:, 0] - 1.5
    near(model.solve().u[:, 0], factor / STRING.E * (1.5**2 * x / 2 - x**3 / 6))


def wheel(axis="z", center=(0.0, 0.0, 0.0)):
    """Return a free rotor between the radii 0.3 and 1 m, 0.2 m thick, the origin in its middle."""
    mesh = kl.annulus(0.3, 1.0, 0.2, cells=(1, 24, 1), element="KinematicLinear3D20N")
    middle = (mesh.points.max(axis=0) + mesh.points.min(axis=0)) / 2
    model = kl.Model(mesh.replace(points=mesh.points - middle), STEEL)
    model.add(kl.ale.Rotation(axis, 100.0, center=center, stiffening=True))
    return model


@pytest.mark.parametrize("held", [False, True])
def test_centrifugal_stress_of_a_free_body_is_that_of_the_virial(held):
    """∫ σ_kk dV = ∫ ρ r_k² dV where nothing reacts: u = x_i e times K_σ times u = x_j e."""
    model = wheel()
    if held:
        model.fix(lambda X: np.abs(X[:, 2]) < 1e-9, "z")
    e = EquationsOfMotion(model)
    pattern, X = e.system.pattern, e.system.points
    row = np.repeat(np.arange(len(X)), np.diff(pattern.indptr))
    sums = [[(e.stiffening * X[row, i] * X[pattern.indices, j]).sum() for i in range(3)] for j in range(3)]
    second = STEEL.density * 0.2 * np.pi / 4 * (1 - 0.3**4)
    near(np.array(sums), np.diag([second, second, 0.0]), 1e-4)


@pytest.mark.parametrize(
    ("axis", "center", "what"), [("z", (1e-3, 0, 0), "force"), ((1e-3, 0, 1), (0, 0, 0), "moment")]
)
def test_a_rotor_out_of_balance_is_refused(axis, center, what):
    with pytest.raises(kl.ModelError) as error:
        wheel(axis, center).complex_modes(8)
    assert ("are (0 0 0) N" in str(error.value)) == (what == "moment")
    assert str(error.value).endswith("or let it turn about a principal axis through its center of mass")


def bars():
    """Return two bars beside each other, and the nodes of the second."""
    one, other = kl.box((3, 1, 1), (3, 2, 2)), kl.box((3, 1, 1), (3, 2, 2), origin=(4, 0, 2))
    return kl.Model(joined(one, other), STEEL), one.n_nodes


def ends(*places):
    return [(lambda X, x=x: X[:, 0] == x) for x in places]


def test_bodies_apart_balance_each_for_itself():
    model, n = bars()
    pull(model, 1e6, ends(0, 3))
    with pytest.raises(kl.ModelError, match=r"free: the component of node 37 \(36 nodes\) .* z\. Fix more"):
        model.solve()
    pull(model, -3e6, ends(4, 7))
    u = model.solve().u
    near(u[:n], stretched(model.mesh.points[:n]))
    near(u[n:], -3 * stretched(model.mesh.points[n:]))
    cases = {"one": kl.Traction("x+", (1e6, 0, 0))}
    with pytest.raises(kl.ModelError, match="do not balance"):
        model.solve_cases(cases)


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_bodies_that_constraints_tie_balance_as_one(solver):
    model, n = bars()
    left, right = (model.mesh.nodes(where) for where in ends(4, 3))
    for dependent, independent in zip(left.tolist(), right.tolist(), strict=True):
        for axis in "xyz":
            model.constrain((dependent, axis), {(independent, axis): 1.0})
    pull(model, 1e6, ends(0, 7))
    result = model.solve(solver)
    near(result.stress("element"), np.tile([1e6, 0, 0, 0, 0, 0], (24, 1)))
    as_one = model.mesh.points.copy()
    as_one[n:] -= (1, 0, 2)
    near(result.u, stretched(as_one))
    model.add_prestress(np.random.default_rng(0).standard_normal((24, 6)) * 1e6)
    glued = kl.Model(model.mesh.replace(points=as_one), STEEL)
    assert np.abs(shared(glued, model.solve(solver).u)).max() < 1e-9
    assert "rotation about x, y, z; the component of node 37 (36 nodes) can still" in result.report.notes[0]
    model.add(kl.PointLoad([40], (0, 1e-3, 0)))
    with pytest.raises(kl.ModelError, match=r"together they are \(0 0.001 0\) N"):
        model.solve(solver)


def test_a_periodic_cell_needs_no_support():
    model = bar((3, 2, 1))
    left, right = (model.mesh.nodes(side) for side in ("x-", "x+"))
    for independent, dependent in zip(left.tolist(), right.tolist(), strict=True):
        for axis, jump in zip("xyz", (3e-3, 0.0, 0.0), strict=True):
            model.constrain((dependent, axis), {(independent, axis): 1.0}, jump)
    result = model.solve()
    near(result.u, stretched(model.mesh.points, 1e-3))
    assert "translation x, y, z; rotation about x;" in result.report.notes[0]


def test_rollers_on_one_side_leave_what_balances_along_them():
    model = pull(bar(element=ELEMENTS[1]))
    model.fix("z-", "z", 1e-4)
    near(model.solve().u, stretched(model.mesh.points) + np.array((0, 0, 1e-4 - 0.15 * 1e6 / STEEL.E)))
    model.add(kl.Gravity((0, 0, -9.81)))
    assert abs(model.solve().reactions.sum(axis=0) - (0, 0, 9.81 * 7850 * 3)).max() < 1e-6
    model.add(kl.PointLoad([0], (0, 1.0, 0)))
    text = (
        r"translation x, y; rotation about z, and its loads do not balance: together they are \(0 1 -231025\)"
    )
    with pytest.raises(kl.ModelError, match=text):
        model.solve()


def test_a_couple_is_no_balance():
    model = bar()
    for face, sign in (("x-", -1), ("x+", 1)):
        model.add(kl.Traction(face, (0, 0, sign * 2e3)))
    text = r"are \(0 0 0\) N and \(0 -6000 0\) N m about \(1.5 0.5 0.5\)\. Fix .* add loads that bal"
    with pytest.raises(kl.ModelError, match=text):
        model.solve()
    assert model.static().model is model  # whether loads balance is known with the loads


def test_stretched_between_rollers_it_needs_no_load():
    model = bar()
    model.fix("x-", "x")
    model.fix("x+", "x", 3e-3)
    near(model.solve().u[:, 1:], stretched(model.mesh.points, 1e-3)[:, 1:])


def bent(cells, element):
    """Return a bar that hangs in the air by the shear at its ends."""
    model = bar(cells, element)
    for face in ("x-", "x+"):
        model.add(kl.Traction(face, (0, 0, 1e5)))
    model.add(BodyForce((0, 0, -2e5 / 3)))
    return model


def test_errors_of_quantities_of_free_bodies():
    """The displacement of a point is that without rigid motions, in its adjoint, too."""
    middle, values, found = kl.DisplacementAt((1.5, 0.5, 0.5), "z"), [], []
    for n in (1, 4):
        result = bent((6 * n, 2 * n, 2 * n), f"KinematicLinear3D{20 if n > 1 else 8}N").solve()
        found.append(result.error(of=middle))
        values.append(middle.value(result))
    missed = values[1] - values[0]
    assert abs(missed) > 0.05 * abs(values[1])
    assert abs(found[0].signed - missed) < 0.3 * abs(missed)
    assert found[0].absolute > abs(missed)


def test_hanging_nodes_hold_no_rotation():
    """What rounding leaves of a rotation in their equations is no support."""
    model = bent((6, 2, 2), "KinematicLinear3D20N")
    finer = model.solve(error=0.02, quantity=kl.DisplacementAt((1.5, 0.5, 0.5), "z"))
    assert finer.mesh.hanging is not None
    assert "translation x, y, z; rotation about x, y, z;" in finer.report.notes[0]
    assert np.abs(shared(kl.Model(finer.mesh, STEEL), finer.u)).max() < 1e-9


@pytest.mark.parametrize(
    "mesh",
    [
        kl.annulus(0.3, 1.0, 0.2, (2, 16, 1), "KinematicLinear3D20N"),
        kl.box((1, 1, 1), (2, 2, 2), "KinematicLinear3D10N"),
    ],
    ids=["20N", "10N"],
)
def test_free_motions_are_held_at_corners_of_elements(mesh):
    """The linear level of quadratic elements has no other nodes."""
    model = kl.Model(mesh, STEEL)
    constrained = model.free_motions(model.element_groups()).constrained
    assert constrained.sum() == 6
    assert is_corner(mesh.blocks, mesh.n_nodes)[constrained.any(axis=1)].all()

"""Ties of faces that do not match: constant stress, rigid motions and supports pass through them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kratos_lite as kl
from kratos_lite import voigt
from kratos_lite.solvers.constraints import rigid_modes

STEEL = kl.Isotropic3D(E=200e9, nu=0.3, density=7800.0)
GRADIENT = np.array([[1.0, 0.2, 0.3], [0.1, -0.5, 0.4], [0.2, 0.3, 0.7]]) * 1e-3
STRESS = STEEL.C @ voigt.symmetric_gradient(GRADIENT)
PAIRS = ["8N 8N", "4N 4N", "4N 8N", "20N 20N", "27N 27N", "10N 10N", "20N 10N", "10N 8N", "8N 27N", "15N 20N"]


def field(X):
    return X @ GRADIENT.T


def blocks(pair, one=(1, 2, 3), other=(2, 3, 2)):
    """Return two unit cubes side by side along x, each with nodes of its own."""
    a, b = (f"KinematicLinear3D{nodes}" for nodes in pair.split())
    return kl.join({"a": kl.box(cells=one, element=a), "b": kl.box(cells=other, element=b, origin=(1, 0, 0))})


def tied(mesh):
    model = kl.Model(mesh, STEEL, formulation="standard")
    model.tie("a.x+", "b.x-")
    return model


def pulled(mesh):
    """Return a tied model under tractions of constant stress."""
    model, T = tied(mesh), STRESS[[[0, 3, 5], [3, 1, 4], [5, 4, 2]]]
    for axis, letter in enumerate("xyz"):
        model.add(kl.Traction(f"{letter}-", -T[axis]))
        model.add(kl.Traction(f"{letter}+", T[axis]))
    return model


def stress_error(result):
    every = result.stress()
    every = [every] if isinstance(every, np.ndarray) else every
    return max(np.abs(stress - STRESS).max() for stress in every) / np.abs(STRESS).max()


@pytest.mark.parametrize("pair", PAIRS)
def test_constant_stress_passes(pair):
    assert stress_error(pulled(blocks(pair)).solve()) < 1e-10


@pytest.mark.parametrize("other", [(2, 3, 2), (1, 1, 2)], ids=["a depends", "b depends"])
@pytest.mark.parametrize("part", ["a.y-", "b.y-"])
def test_a_rigid_part_may_hold_nodes_of_a_tied_face(part, other):
    """Held, it is a support; free, it moves all without stress and carries the load, whatever is tied."""
    held, model = (tied(blocks("8N 8N", other=other)) for _ in range(2))
    held.fix(part)
    hub = model.rigid(part, (0.5, -1, 0.5))
    hub.fix("xyz")
    hub.fix_rotation("xyz")
    for each in (held, model):
        each.add(kl.Traction("y+", (1e6, 2e6, -1e6)))
    result = model.solve()
    assert np.abs(result.u - held.solve().u).max() < 1e-9 * np.abs(result.u).max()
    force, moment = hub.reaction(result)
    assert np.abs(force + result.report.total_load).max() < 1e-3
    arms = model.mesh.points - hub.point
    assert np.abs(moment + np.cross(arms, result.loads).sum(axis=0)).max() < 1e-3
    moved = tied(blocks("8N 8N", other=other))
    hub = moved.rigid(part, (0.5, -1, 0.5))
    hub.fix("xyz", (1e-3, 2e-3, 0))
    hub.fix_rotation("xyz", (0, 1e-3, 2e-3))
    result = moved.solve()
    assert max(np.abs(stress).max() for stress in result.stress()) < 1e-3
    assert np.abs(hub.rotation(result) - [0, 1e-3, 2e-3]).max() < 1e-12


@pytest.mark.parametrize("hold", ["fix", "rigid"])
@pytest.mark.parametrize("other", [(2, 2, 1), (2, 3, 4)], ids=["a depends", "b depends"])
def test_a_face_tied_to_one_that_is_held_as_a_whole_is_held(other, hold):
    """All nodes of the face may depend on those of the other: it is as if that were held, too."""
    results = []
    for parts in (["a.x+"], ["b.x-"], ["a.x+", "b.x-"]):
        model = tied(blocks("8N 8N", other=other))
        for part in parts:
            if hold == "fix":
                model.fix(part, "xyz", 1e-6)
            else:
                hub = model.rigid(part, (1, 0.5, 0.5))
        model.fix("a.x-")
        model.add(kl.Traction("b.x+", (1e6, 2e6, 0)) if hold == "fix" else hub.load((1e6, 2e6, 0)))
        results.append(model.solve())
    for result in results[1:]:
        assert np.abs(result.u - results[0].u).max() < 1e-9 * np.abs(result.u).max()


def test_parts_that_are_not_tied_are_named():
    model = kl.Model(blocks("8N 8N"), STEEL)
    model.fix("a.x-")
    model.add(kl.Traction("b.x+", (1e6, 0, 0)))
    with pytest.raises(kl.ModelError, match=r"in part 'b' the component of .*, or tie the parts, or add"):
        model.solve()


def test_a_tie_said_again_replaces_the_first_in_either_order():
    model = pulled(blocks("8N 8N"))
    model.tie("b.x-", "a.x+", tolerance=0.1)
    assert sum(name == "tie" for name, _ in model.table()) == 1
    assert stress_error(model.solve()) < 1e-10


@pytest.mark.parametrize("pair", ["8N 8N", "20N 10N", "4N 4N"])
def test_constant_stress_passes_where_supports_hold_nodes_of_both_sides(pair):
    model = pulled(blocks(pair))
    model.fix("z-", field=field)
    model.fix("y+", field=field)
    model.fix(lambda X: (X[:, 2] == 1) & (X[:, 1] > 0.3), "xy", field=lambda X: field(X)[:, :2])
    assert stress_error(model.solve()) < 1e-10


def skewed(mesh):
    """Return a mesh whose cells are no parallelograms, with straight edges."""
    X, (block,) = mesh.points.copy(), mesh.blocks
    bent = np.sin(np.pi * X[:, 1]) * np.sin(np.pi * X[:, 2])
    X[:, 1:] += np.outer(bent, (0.08, -0.06))
    c, N = block.shape.corners, block.shape.linear().N(block.shape.nodes)
    X[block.nodes] = N @ X[block.nodes[:, :c]]
    return mesh.replace(points=X)


@pytest.mark.parametrize("pair", ["8N 8N", "20N 27N"])
def test_constant_stress_passes_through_skewed_faces(pair):
    one, other = (f"KinematicLinear3D{nodes}" for nodes in pair.split())
    a, b = kl.box(cells=(1, 3, 2), element=one), kl.box(cells=(1, 2, 3), element=other, origin=(1, 0, 0))
    assert stress_error(pulled(kl.join({"a": skewed(a), "b": skewed(b)})).solve()) < 1e-10


def test_equal_meshes_are_tied_node_by_node():
    mesh = blocks("20N 20N", (1, 2, 2), (1, 2, 2))
    every = tied(mesh).supports.constraints
    assert len(every) == len(every.independents) == 3 * 21
    assert np.abs(every.weights - 1).max() < 1e-12
    pairs = mesh.points[every.dependents // 3] - mesh.points[every.independents // 3]
    assert np.abs(pairs).max() < 1e-14


def test_the_covered_part_depends_on_the_other():
    """A small block on a large face: whichever comes first, its nodes depend."""
    plate = kl.box((1, 1, 0.1), (7, 7, 1))
    stud = kl.box((0.3, 0.3, 0.5), (1, 1, 1), origin=(0.31, 0.22, 0.1))
    mesh = kl.join({"plate": plate, "stud": stud})
    for parts in (("plate.z+", "stud.z-"), ("stud.z-", "plate.z+")):
        model = kl.Model(mesh, STEEL)
        model.tie(*parts)
        assert set(model.supports.constraints.dependents // 3) == set(mesh.nodes("stud.z-"))
        model.fix("z-")
        model.add(kl.Traction("stud.z+", (1e5, 0, 1e5)))
        reaction = model.solve().reaction("z-").sum(axis=0)
        assert np.abs(reaction - [-9e3, 0, -9e3]).max() < 1e-5


def rings(inner, outer, gap=0.0):
    """Return two rings, one in the other, of so many cells around."""
    a = kl.annulus(0.5, 1.0, 0.3, cells=(1, inner, 1))
    b = kl.annulus(1.0 + gap, 2.0, 0.3, cells=(2, outer, 2))
    return kl.join({"a": a, "b": b})


@pytest.mark.parametrize("gap", [0.0, 0.02])
def test_rigid_motions_pass_where_faces_are_curved_or_apart(gap):
    model = kl.Model(rings(10, 16, gap), STEEL)
    model.tie("a.outer", "b.inner", tolerance=0.1)
    row, dof, weight = model.supports.constraint_rows()
    left = np.zeros((row.max() + 1, 6))
    np.add.at(left, row, weight[:, None] * rigid_modes(model.mesh.points)[dof])
    assert np.abs(left).max() < 1e-12
    assert model.free_motions(model.element_groups()).counts.tolist() == [6]


@pytest.mark.parametrize("kind", ["8N", "4N", "20N", "10N"])
@pytest.mark.parametrize("cells", [1, 2, 3])
def test_rigid_motions_pass_a_gap_where_nodes_lie_opposite_one_another(kind, cells):
    element = f"KinematicLinear3D{kind}"
    low = kl.box(cells=(cells, cells, 1), element=element)
    mesh = kl.join({"low": low, "top": kl.box(cells=(3, 3, 1), element=element, origin=(0, 0, 1.1))})
    model = kl.Model(mesh, STEEL)
    model.tie("low.z+", "top.z-", tolerance=0.2)
    c, U = model.supports.constraints, rigid_modes(mesh.points)
    follow = np.zeros((len(c), 6))
    np.add.at(follow, c.owner, c.weights[:, None] * U[c.independents])
    assert np.abs(follow - U[c.dependents]).max() < 1e-12


@pytest.mark.parametrize("mode", range(6))
def test_a_prescribed_rigid_motion_passes_the_gap_of_a_turned_mesh(mode):
    """All forces are rounding, which weights of ties of quadratic cells make larger."""
    element, turn = "KinematicLinear3D20N", Rotation.random(random_state=0).as_matrix()
    low = kl.box(cells=(2, 2, 1), element=element)
    mesh = kl.join({"low": low, "top": kl.box(cells=(3, 3, 1), element=element, origin=(0, 0, 1.1))})
    model = kl.Model(mesh.replace(points=mesh.points @ turn.T), STEEL)
    model.tie("low.z+", "top.z-", tolerance=0.2)
    motion = 1e-3 * rigid_modes(model.mesh.points)[:, mode].reshape(-1, 3)
    held = model.mesh.nodes("low.z-")
    model.fix(held, "xyz", motion[held])
    assert np.abs(model.solve().u - motion).max() < 1e-12


def two_rings():
    """Return a cylinder of two unlike rings that are tied, between walls across its axis."""
    a = kl.annulus(0.5, 1.0, 0.1, cells=(2, 16, 1), element="20N")
    b = kl.annulus(1.0, 2.0, 0.1, cells=(3, 20, 1), element="20N")
    model = kl.Model(kl.join({"a": a, "b": b}), STEEL)
    model.tie("a.outer", "b.inner")
    model.fix("z-", "z")
    model.fix("z+", "z")
    return model


def test_a_thick_cylinder_of_two_unlike_rings():
    """Lamé: u_r of a cylinder under inner pressure with plane strain, through the tie."""
    model = two_rings()
    model.add(kl.Pressure("a.inner", 1e8))
    u = model.solve().displacement("b.outer")
    p, r, R, nu = 1e8, 0.5, 2.0, STEEL.nu
    exact = (1 + nu) / STEEL.E * p * r**2 / (R**2 - r**2) * ((1 - 2 * nu) * R + R)
    radial = np.linalg.norm(u[:, :2], axis=1)
    assert np.abs(radial / exact - 1).max() < 2e-3


def test_nodes_that_walls_hold_in_part_keep_their_ties():
    """A weight along the axis moves all nodes alike that are halfway between the walls."""
    model = two_rings()
    model.fix("a.inner", "xy")
    model.add(kl.BodyForce((0, 0, 1e6)))
    result = model.solve()
    for part in ("a.outer", "b.inner"):
        nodes = model.mesh.nodes(part)
        moved = result.u[nodes[np.abs(model.mesh.points[nodes, 2] - 0.05) < 1e-9], 2]
        assert np.ptp(moved) < 1e-4 * moved.mean()


def test_three_blocks_that_meet_in_an_edge():
    """Nodes of the edge depend by one tie; the others pass their multipliers on."""
    a, c = kl.box((1, 1, 1), (2, 2, 2)), kl.box((2, 1, 1), (3, 3, 3), origin=(0, 0, 1))
    mesh = kl.join({"a": a, "b": kl.box((1, 1, 1), (3, 4, 3), origin=(1, 0, 0)), "c": c})
    model = pulled(mesh)
    model.tie("c.z-", lambda X: (X[:, 2] == 1) & (np.arange(len(X)) < mesh.nodes("c").min()))
    assert stress_error(model.solve()) < 1e-10


def test_rollers_in_local_axes_meet_the_tie():
    axes = kl.Cartesian((1, 1, 0), (-1, 1, 0))
    turn = np.array([[1, -1, 0], [1, 1, 0], [0, 0, 2**0.5]]) / 2**0.5
    mesh = blocks("8N 8N")
    model = tied(mesh.replace(points=mesh.points @ turn.T))
    model.fix(np.flatnonzero(mesh.points[:, 2] == 0), "z")
    model.fix(np.flatnonzero(mesh.points[:, 1] == 0), "y", local=axes)
    model.fix(np.flatnonzero(mesh.points[:, 0] == 0), "x", local=axes)
    model.fix(np.flatnonzero(mesh.points[:, 0] == 2), "x", 2e-3, local=axes)
    stress = axes.stresses(model.solve().stress("node"), model.mesh.points)
    assert np.abs(stress - [200e6, 0, 0, 0, 0, 0]).max() < 1e-1


def test_a_tie_can_be_released_from_supports_and_held_again():
    """Constraints follow supports that come later, or go."""
    model = tied(blocks("8N 8N"))
    before = len(model.supports.constraints)
    model.fix("z-", name="floor")
    dependents = model.supports.constraints.dependents
    assert len(dependents) < before
    assert not model.supports.fixed.flat[dependents].any()
    model.release("floor")
    assert len(model.supports.constraints) == before


def test_modes_and_files_know_ties(tmp_path):
    model = tied(blocks("8N 8N"))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1e6)))
    kl.write(tmp_path / "tied.mdpa", model)
    again = kl.read(tmp_path / "tied.mdpa")
    assert np.abs(again.modes(3)[0] / model.modes(3)[0] - 1).max() < 1e-9


def test_the_summary_names_ties():
    assert "tie          a.x+ to b.x-: 12 nodes depend on the others" in str(tied(blocks("8N 8N")))


def test_nodes_that_hang_on_a_tied_face_are_refused():
    mesh = kl.join({"a": kl.box(cells=(1, 2, 2)), "b": kl.box(cells=(1, 1, 1), origin=(1, 0, 0))})
    model = tied(mesh)
    model.fix("x-")
    model.add(kl.PointLoad((2.0, 1.0, 1.0), (0, 0, -1e3)))
    with pytest.raises(kl.ModelError, match="nodes hang there"):
        model.solve(error=1e-2, most_unknowns=3000)


FAR = "neither covers the other: some are 0.5 m apart, farther than"


@pytest.mark.parametrize(
    ("a", "b", "options", "message"),
    [
        ("a.x+", "a.x+", {}, "both have node 13, and 11 more"),
        ("a.x+", "a.y-", {}, "both have node"),
        ("b.x-", (0.0, 0.0, 0.0), {}, "no face has all its nodes there"),
        ("a.x-", "b.x+", {}, "neither covers the other; tie parts"),
        ("a.x+", "b.y-", {}, "neither covers the other"),
        ("a.x+", "c.x-", {"tolerance": 0.1}, FAR),
        ("a.x+", "d.x-", {}, "neither covers the other; tie parts"),
        ("a.x+", "e", {}, "there is no part 'e'"),
        ("a.x+", "b.x-", {"tolerance": -1.0}, "tolerance of a tie"),
    ],
)
def test_what_cannot_be_tied_is_refused(a, b, options, message):
    mesh = kl.join(
        {
            "a": kl.box(cells=(1, 2, 3)),
            "b": kl.box(cells=(2, 3, 2), origin=(1, 0, 0)),
            "c": kl.box(origin=(1.5, 0, 0)),
            "d": kl.box(cells=(1, 2, 2), origin=(1, 0.6, 0.6)),
        }
    )
    model = kl.Model(mesh, STEEL)
    with pytest.raises(kl.KratosLiteError, match=message):
        model.tie(a, b, **options)

"""What a solution does without: each is found by itself, named in the report, and changes no result."""

import numpy as np
import pytest
from computing import BUILT
from meshes import elsewhere, joined

import kratos_lite as kl
from kratos_lite.analysis.nodal_loads import initial_loads
from kratos_lite.solvers import constrained_system as system
from kratos_lite.solvers.constrained_system import ConstrainedSystem

STEEL = kl.Isotropic3D(E=2e9, nu=0.3, density=1000.0)


def bodies(n=3, cells=(2, 2, 2), held="z-"):
    """Return n bricks side by side that do not touch, each with a clamped bottom and a part of its own."""
    meshes = [kl.box(cells=cells, element="KinematicLinear3D8N", origin=(1.5 * i, 0, 0)) for i in range(n)]
    nodes, elements = np.arange(meshes[0].n_nodes), np.arange(meshes[0].n_elements)
    parts = {f"b{i}": kl.Part(nodes + i * len(nodes), elements + i * len(elements)) for i in range(n)}
    model = kl.Model(joined(*meshes).replace(parts=parts), STEEL)
    model.fix(held)
    return model


def everything(model, result, solver="direct"):
    """Compare a result with a solution of all equations of all elements."""
    whole = ConstrainedSystem(
        model.mesh.points,
        model.element_groups(),
        model.supports.constraint_map,
        solver=solver,
        tolerance=1e-13,
    )
    forces = np.array(result.loads)
    initial = initial_loads(model, model.element_groups())
    forces = forces if initial is None else forces - initial
    u, _ = whole.solve(forces)
    assert len(whole.nodes) == model.mesh.used_nodes().sum()
    np.testing.assert_allclose(result.u, u, rtol=0, atol=1e-11 * np.abs(u).max())
    reactions = whole.residual(u, forces)
    held = model.supports.fixed
    size = np.abs(reactions).max()
    np.testing.assert_allclose(result.reactions[held], reactions[held], rtol=0, atol=1e-11 * size)


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_parts_that_nothing_moves_stay_at_rest(solver):
    model = bodies()
    model.add(kl.Gravity((1.0, 0, -9.81), "b1"))
    model.add(kl.PointLoad([0], (1.0, 2.0, 3.0)))  # on a support of the first
    ready = model.static(solver, tolerance=1e-13)
    result = ready.solve()
    assert result.report.skipped[0] == "2 of 3 parts (54 nodes), as nothing moves them"
    assert ready.system.nodes.tolist() == list(range(27, 54))
    assert not result.displacement("b0").any()
    assert not result.displacement("b2").any()
    np.testing.assert_array_equal(result.reactions[0], (-1.0, -2.0, -3.0))
    assert result.report.unknowns == 3 * 54
    everything(model, result)


def test_a_part_that_moves_in_another_case_only_stays_exactly_at_rest():
    model = bodies(2)
    weight = {name: [kl.Gravity((1.0, 2.0, 3.0), name)] for name in ("b0", "b1")}
    found = model.solve_cases(weight, "amg", tolerance=1e-13)
    assert not found["b0"].displacement("b1").any()
    assert not found["b1"].displacement("b0").any()
    for result in found.values():
        everything(model, result)
        assert result.report.skipped[0] == "1 of 2 parts (27 nodes), as nothing moves them"
    ready = model.static()
    first = ready.solve(weight["b0"])
    assert len(ready.system.nodes) == 27
    both = ready.solve(weight["b1"])  # a part that is new to the equations
    assert len(ready.system.nodes) == 54
    np.testing.assert_allclose(both.displacement("b1"), first.displacement("b0"), rtol=1e-11)


def by_fixed_independent(model):
    model.fix([0], "x", 1e-3, override=True)
    model.constrain((26, "x"), {(0, "x"): 1.0})


def by_initial_displacement(model):
    u0 = np.zeros_like(model.mesh.points)
    u0[26] = 1e-3
    model.set_stress_free_state(u0)


@pytest.mark.parametrize(
    ("move", "count"),
    [
        (lambda model: model.fix(np.array([0, 3, 9]), "z", 1e-3, override=True), 3),
        (lambda model: model.constrain((26, "x"), {(53, "x"): 1.0}), 2),  # to another part
        (lambda model: model.constrain((26, "x"), {(25, "x"): 1.0}, 1e-3), 3),
        (by_fixed_independent, 3),
        (lambda model: model.add_prestress((1e6, 0, 0, 0, 0, 0), "b0"), 3),
        (by_initial_displacement, 3),
    ],
)
def test_a_part_without_load_is_solved_if_anything_else_moves_it(move, count):
    model = bodies()
    model.add(kl.Gravity((1.0, 0, -9.81), "b1"))
    move(model)
    result = model.solve()
    assert result.report.skipped[0] == f"1 of {count} parts (27 nodes), as nothing moves them"
    assert np.abs(result.displacement("b0")).max() > 1e-9
    assert not result.displacement("b2").any()
    everything(model, result)


def test_parts_joined_by_an_edge_are_one():
    mesh = kl.box((2, 2, 1), (2, 2, 1))
    mesh = mesh.replace(blocks=[mesh.blocks[0].take(np.array([0, 3]))])
    model = kl.Model(mesh, STEEL)
    model.fix(lambda X: X[:, 2] == 0)
    model.add(kl.Gravity((0, 0, -9.81), [0]))
    result = model.solve()
    assert not any("parts" in text for text in result.report.skipped)
    everything(model, result, "dense")


def test_parts_at_rest_are_checked_all_the_same():
    free = bodies(held=lambda X: (X[:, 2] == 0) & (X[:, 0] < 2.9))
    free.add(kl.Gravity((0, 0, -9.81), "b0"))
    with pytest.raises(kl.ModelError, match=r"the component of node 55 \(27 nodes\) can still move"):
        free.solve()
    broken = bodies()
    broken = elsewhere(broken, np.where(np.arange(81)[:, None] < 54, 1, [-1, 1, 1]) * broken.mesh.points)
    broken.add(kl.Gravity((0, 0, -9.81), "b0"))
    with pytest.raises(kl.MeshError, match="inverted"):
        broken.solve()


@pytest.fixture
def without_matrices(monkeypatch):
    def never(*_, **__):
        raise AssertionError("nothing should be assembled")

    for name in ("assemble_dense", "assemble_stiffness"):
        monkeypatch.setattr(system, name, never)


@pytest.mark.parametrize("solver", ["auto", "dense", "direct", "amg"])
@pytest.mark.usefixtures("without_matrices")
def test_without_load_nothing_is_assembled_or_solved(solver):
    model = bodies()
    result = model.solve(solver)
    assert not result.u.any()
    assert not result.reactions.any()
    assert not result.stress().any()
    assert (result.report.solver, result.report.iterations) == ("none", 0)
    assert result.report.skipped[0] == "assembly and solution, as nothing moves"
    assert result.report.warnings == ["no load acts and no displacement is prescribed, so nothing moves"]


@pytest.mark.usefixtures("without_matrices")
def test_loads_on_supports_alone_go_straight_into_them():
    model = bodies(1)
    model.add(kl.PointLoad("z-", (1.0, 2.0, 3.0), each=True))
    result = model.solve()
    assert not result.u.any()
    expected = np.where(model.mesh.points[:, 2:] == 0, [-1.0, -2.0, -3.0], 0.0)
    np.testing.assert_array_equal(result.reactions, expected)


@pytest.mark.usefixtures("without_matrices")
def test_a_node_without_elements_keeps_its_prescribed_value_though_nothing_moves():
    mesh = kl.box()
    model = kl.Model(kl.Mesh(np.vstack([mesh.points, [[5, 5, 5]]]), mesh.blocks), STEEL)
    model.fix(range(4), "xyz")
    model.fix([4], "xyz")
    model.fix([8], "y", 0.25)
    np.testing.assert_array_equal(model.solve().u[8], (0, 0.25, 0))


@pytest.mark.parametrize("element", ["KinematicLinear3D8N", "KinematicLinear3D10N"])
@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_elements_whose_nodes_are_all_held_are_left_out(element, solver):
    model = kl.Model(kl.box((4, 1, 1), (8, 2, 2), element), STEEL)
    model.add_prestress((1e3, 0, 0, 2e2, 0, 0), [0, 1])
    model.fix(lambda X: X[:, 0] < 2.1)
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    ready = model.static(solver, tolerance=1e-13)
    result = ready.solve()
    left = model.mesh.n_elements // 2
    assert f"{left} elements, as all their nodes are constrained" in result.report.skipped
    assert sum(len(group) for group in ready.system.groups) == left
    assert ready.system.nodes.min() > 0
    everything(model, result)


def test_elements_on_a_moved_support_are_needed():
    model = kl.Model(kl.box((4, 1, 1), (8, 2, 2)), STEEL)
    model.fix(lambda X: X[:, 0] < 2.1)
    model.fix("x-", "y", 1e-3, override=True)
    result = model.solve()
    assert "12 elements, as all their nodes are constrained" in result.report.skipped
    assert np.abs(result.reaction("x-")).max() > 0
    everything(model, result)


def test_nodes_without_elements_and_prescribed_components_are_named():
    mesh = kl.box()
    model = kl.Model(kl.Mesh(np.vstack([[[5, 5, 5]], mesh.points]), [shifted(mesh.blocks[0], 1)]), STEEL)
    model.fix(lambda X: X[:, 2] == 0)
    model.add(kl.Gravity((0, 0, -9.81)))
    report = model.solve().report
    assert report.skipped == ["12 prescribed degrees of freedom", "1 nodes without elements"]
    assert report.unknowns == 12
    assert ("skipped", "; ".join(report.skipped)) in model.solve().table()


def shifted(block, by):
    return kl.Block(block.name, block.nodes + np.int32(by), block.ids, block.properties, block.shape)


def test_solving_computes_neither_stress_nor_mass(monkeypatch):
    asked = []
    for name in ("strain", "scalar_mass", "lumped_mass"):
        right = getattr(kl.KinematicLinear, name)

        def counted(*arguments, name=name, right=right):
            asked.append(name)
            return right(*arguments)

        monkeypatch.setattr(kl.KinematicLinear, name, counted)
    model = bodies(1)
    model.add(kl.Traction("z+", (1.0, 0, 1.0)))
    result = model.solve()
    assert asked == ([] if BUILT else ["strain"])  # of which NumPy computes the forces inside, once
    assert result.stress().any()
    asked.clear()
    element = model.element_groups()[0].at(model.mesh.points)
    element.strain(np.zeros((8, 8, 3)))
    assert asked == ["strain"]

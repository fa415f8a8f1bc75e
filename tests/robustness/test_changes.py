"""What was solved stays right, whatever is changed, refused or moved as a whole."""

from dataclasses import replace

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.model.spurious_modes import check_rules
from kratos_lite.solvers import constrained_system as system

ROCK = kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0)


def pressed(stress=1e5):
    """Return a block between two plates, with initial stress."""
    model = kl.Model(kl.box(cells=(2, 2, 2), element="KinematicLinear3D8N"), ROCK)
    model.fix("z-")
    model.fix("z+", "z", 1e-3)
    model.add_prestress([stress, 0, 0, 0, 0, 0])
    return model


def refuse(model, equations):
    """Have a change of the constraints refused, and take it back."""
    before = model.supports.constraints
    model.constrain((13, "x"), {(14, "x"): 1.0})
    model.constrain((14, "x"), {(13, "x"): 1.0}, 1e-3)
    with pytest.raises(kl.ModelError, match="contradicts itself"):
        equations.solve()
    model.supports.constraints = before


def test_prescribed_values_are_taken_over_after_a_refusal():
    model = pressed()
    equations = model.static()
    equations.solve()
    model.fix("z+", "z", 5e-3, override=True)
    refuse(model, equations)
    np.testing.assert_allclose(equations.solve().u, model.solve().u, rtol=0, atol=1e-15)


def test_initial_stress_that_was_refused_leaves_nothing_behind():
    model = pressed()
    equations = model.static()
    right = equations.solve().stress("element")
    model.add_prestress([1e7, 0, 0, 0, 0, 0])
    refuse(model, equations)
    model.add_prestress([-1e7, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(equations.solve().stress("element"), right)


def carried(kind, shift, cells=(4, 4, 4), held="xyz"):
    """Return a block whose bottom and top are moved alike."""
    model = kl.Model(kl.box(cells=cells, element=kind), ROCK)
    for side in ("z-", "z+"):
        model.fix(side, held, shift)
    return model


@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("kind", ["KinematicLinear3D8N", "KinematicLinear3D20N", "KinematicLinear3D10N"])
def test_supports_may_carry_a_body_along(kind, solver):
    shift = np.random.default_rng(4).normal(size=3) * 1e-3
    result = carried(kind, shift).solve(solver)
    np.testing.assert_allclose(result.u, np.tile(shift, (len(result.u), 1)), rtol=0, atol=1e-15)
    assert np.abs(result.stress("element")).max() < 1e-4  # Pa, of a modulus of 1e9
    assert result.report.force_error == result.report.moment_error == 0


def test_a_body_that_is_carried_along_deforms_as_one_that_stays():
    moved, still = carried("KinematicLinear3D8N", (1e-3, 2e-3, 0.0)), carried("KinematicLinear3D8N", 0.0)
    for model in (moved, still):
        model.add(kl.Gravity((0, 0, -9.81)))
    a, b = moved.solve("amg"), still.solve("amg")
    np.testing.assert_allclose(a.u - b.u, np.tile((1e-3, 2e-3, 0), (len(a.u), 1)), rtol=0, atol=1e-16)


@pytest.mark.parametrize("lift", [0.0, 1e-3])
def test_lost_equilibrium_is_an_error(monkeypatch, lift):
    right = system.assemble_dense
    monkeypatch.setattr(system, "assemble_dense", lambda *a: right(*a) * (1 + 0.1 * np.eye(24)))
    model = kl.Model(kl.box(), ROCK)
    model.fix("z-")
    model.fix("z+", "z", lift) if lift else model.add(kl.Gravity((0, 0, -9.81)))
    with pytest.raises(kl.SolveError, match="miss equilibrium by"):
        model.solve("dense")


def test_a_mesh_does_not_change_and_gives_others():
    points, cells = kl.box().points.copy(), kl.box().blocks[0].nodes.copy()
    mesh = kl.Mesh(points, {"KinematicLinear3D8N": cells}, parts={"top": kl.Part(nodes=[4, 5])})
    points += 1
    cells[:] = 0  # the arrays that it was made of are the caller's
    assert mesh.points.min() == 0
    assert mesh.blocks[0].nodes.max() == 7
    for name, value in (("points", points), ("blocks", ()), ("parts", {}), ("node_ids", [1])):
        with pytest.raises(kl.MeshError, match=rf"does not change; .* mesh\.replace\({name}=\.\.\.\)"):
            setattr(mesh, name, value)
    for owner, name in ((pressed(), "mesh"), (mesh.blocks[0], "nodes"), (mesh.parts["top"], "nodes")):
        with pytest.raises(AttributeError):
            setattr(owner, name, None)
    with pytest.raises(TypeError):
        mesh.parts["top"] = kl.Part()
    taller = mesh.replace(points=mesh.points * [1, 1, 2])
    assert (mesh.points[:, 2].max(), taller.points[:, 2].max()) == (1, 2)
    assert taller.parts == mesh.parts


def test_warnings_of_rules_come_once():
    model = pressed()
    model.use_rule(1)
    groups = model.element_groups()
    same = [replace(group, rule=replace(group.rule, name="another")) for group in groups]
    (text,) = check_rules(model.mesh, groups + same)
    assert text.startswith("KinematicLinear3D8N with 1 Gauss point has 12 hourglass modes")


def test_what_a_model_was_checked_with_cannot_be_changed_in_place():
    model = pressed()
    model.set_stress_free_state(np.zeros_like(model.mesh.points))
    mesh, block = model.mesh, model.mesh.blocks[0]
    arrays = [mesh.points, mesh.node_ids, mesh.parts["z-"].nodes, block.nodes, block.ids, block.properties]
    arrays += [model.prestress, model.initial_displacement]
    for array in (*arrays, model.supports.fixed, model.supports.values):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1

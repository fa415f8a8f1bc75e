"""`Model(mesh, material, formulation)`: which element classes compute a model."""

import numpy as np
import pytest

import kratos_lite as kl

STEEL, RUBBER = kl.Isotropic3D(E=210e9, nu=0.3), kl.Isotropic3D(E=1e6, nu=0.499)


def kinds(model):
    return [group.element.__name__ for group in model.element_groups()]


@pytest.mark.parametrize(
    ("word", "name"),
    [
        (None, "KinematicLinear3D8N"),
        ("standard", "KinematicLinear3D8N"),
        ("enhanced", "EnhancedStrain3D8N"),
        ("b_bar", "BBar3D8N"),
        ("non_locking", "EnhancedStrain3D8N"),
    ],
)
def test_a_word_chooses_the_element_class(word, name):
    mesh = kl.box(element="KinematicLinear3D8N")
    model = kl.Model(mesh, STEEL, formulation=word)
    assert kinds(model) == [name]
    assert model.mesh is mesh  # whose names stay


@pytest.mark.parametrize(
    ("law", "nodes", "name"),
    [
        (kl.J2Plasticity3D(2e11, 0.3, 2e8), 8, "BBar3D8N"),
        (kl.J2Plasticity3D(2e11, 0.3, 2e8), 20, "BBar3D20N"),
        (kl.J2Plasticity3D(2e11, 0.3, 2e8), 6, "KinematicLinear3D6N"),
        (kl.NeoHookean3D(1e6, 0.3), 8, "TotalLagrangianElement3D8N"),
        (kl.NeoHookean3D(1e6, 0.499), 8, "FBar3D8N"),
    ],
)
def test_a_nonlinear_law_chooses_the_element_that_does_not_lock_in_flow(law, nodes, name):
    assert kinds(kl.Model(kl.box(element=f"Element3D{nodes}N"), law)) == [name]


@pytest.mark.parametrize("cells", [(4, 1, 1), (40, 1, 1)])
def test_enhanced_bricks_whose_law_may_flow_bend_as_those_of_its_elasticity(cells):
    tips = []
    for law in (STEEL, kl.J2Plasticity3D(210e9, 0.3, 250e9)):
        model = kl.Model(kl.box((1, 0.1, 0.1), cells), law, formulation="enhanced")
        model.fix("x-")
        model.add(kl.Resultant("x+", (0, 0, -1e3)))
        tips.append(model.solve().displacement("x+")[:, 2].mean())
    assert abs(tips[1] / tips[0] - 1) < 1e-9


def test_the_word_can_be_changed_and_counts_as_a_change():
    model = kl.Model(kl.box((1, 1, 4), (2, 2, 4), element="KinematicLinear3D8N"), STEEL)
    model.fix("z-")
    model.add(kl.Traction("z+", (1e6, 0, 0)))
    analysis = model.static()
    plain = analysis.solve().u
    model.formulation = "enhanced"
    enhanced = analysis.solve().u
    assert np.abs(enhanced).max() > 1.02 * np.abs(plain).max()
    model.formulation = None
    assert np.abs(analysis.solve().u - plain).max() < 1e-12 * np.abs(plain).max()


def test_each_material_has_the_element_that_does_not_lock_with_it():
    mesh = kl.box((1, 1, 2), (2, 2, 2), element="KinematicLinear3D20N")
    mesh.add_part("low", lambda X: X[:, 2] <= 1)
    model = kl.Model(mesh, STEEL, formulation="non_locking")
    model.assign(RUBBER, "low")
    found = {group.element.__name__: group.material for group in model.element_groups()}
    assert found == {"KinematicLinear3D20N": STEEL, "BBar3D20N": RUBBER}
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -1.0)))
    model.add(kl.Traction("z+", (0, 0, 1e3)))
    text = dict(model.solve().table())["formulation"]
    assert text.startswith("non_locking, as requested: ")
    assert "BBar3D20N for Isotropic3D(E=1000000.0, nu=0.499" in text


@pytest.mark.parametrize(
    ("element", "text"),
    [
        ("Element3D8N", "non_locking, as the mesh names none: EnhancedStrain3D8N"),
        ("EnhancedStrain3D8N", ""),
    ],
)
def test_the_report_says_what_was_chosen_where_the_mesh_names_no_formulation(element, text):
    model = kl.Model(kl.box(element=element), STEEL)
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1e6)))
    result = model.solve()
    assert result.report.formulation == text
    rows = dict(result.table())
    assert (rows["elements"], rows.get("formulation", "")) == ("1 EnhancedStrain3D8N", text)
    assert ("non_locking, as the mesh names none" in str(model)) == bool(text)


@pytest.mark.parametrize(
    ("element", "word", "message"),
    [
        ("KinematicLinear3D4N", "enhanced", r"element 1 \(KinematicLinear3D4N\): there is no formulation"),
        ("KinematicLinear3D4N", "b_bar", "with 4 nodes .* total_lagrangian, standard, non_locking"),
        ("KinematicLinear3D20N", "enhanced", "total_lagrangian, standard, reduced, b_bar, non_locking"),
        ("KinematicLinear3D8N", "reduced", "total_lagrangian, standard, f_bar, enhanced, b_bar, non_locking"),
        ("KinematicLinear3D8N", "enhnced", "must be one of b_bar, enhanced, .*Did you mean enhanced"),
        ("KinematicLinear3D8N", 3, "formulation must be one of .*; got 3"),
    ],
)  # fmt: skip
def test_a_formulation_that_an_element_does_not_have_is_refused(element, word, message):
    with pytest.raises(kl.InputError, match=message):
        kl.Model(kl.box(element=element), STEEL, formulation=word)
    model = kl.Model(kl.box(element=element), STEEL)
    with pytest.raises(kl.InputError, match=message):
        model.formulation = word
    assert model.formulation is None

"""What takes linear laws and small displacements alone refuses others with one error; the rest takes them."""

import numpy as np
import pytest

import kratos_lite as kl

STEEL = kl.J2Plasticity3D(200e9, 0.3, 200e6, 2e9, density=7850.0)
SOFT = kl.Isotropic3D(1e6, 0.3, density=1000.0)
MODELS = {"J2Plasticity3D": (STEEL, None), "large displacements": (SOFT, "total_lagrangian")}


def bar(law, formulation):
    """Return a clamped bar under a load."""
    model = kl.Model(kl.box((1, 1, 4), cells=(1, 1, 4), element="Element3D8N"), law, formulation=formulation)
    model.fix("z-")
    model.add(kl.Traction("z+", (1.0, 0, 0)))
    return model


def moving(model):
    model.release("z-")
    model.add(kl.ale.Translation("z", rate=1.0, boundaries="absorbing"))
    return model


REFUSED = {
    "a requested error": lambda model: model.solve(error=0.1),
    "static analysis": lambda model: model.static(),
    "static analysis with": lambda model: model.solve_cases({"one": kl.Gravity((0, 0, -9.81))}),
    "backend='petsc'": lambda model: model.solve(backend="petsc"),
    "the local system": lambda model: model.local_system(1, 1e-3 * model.mesh.points),
    "a motion": lambda model: moving(model).solve(),
    "a motion of": lambda model: moving(model).transient(),
    "a motion of the": lambda model: moving(model).complex_modes(1),
    "a motion of the material": lambda model: moving(model).check(),
}


@pytest.mark.parametrize("named", MODELS)
@pytest.mark.parametrize("what", REFUSED)
def test_one_clear_error(what, named):
    with pytest.raises(kl.ModelError, match=rf"{what}.*takes linear laws .*; got {named}; take model\.solve"):
        REFUSED[what](bar(*MODELS[named]))


@pytest.mark.parametrize("named", MODELS)
def test_modes_are_those_of_the_law_at_rest(named):
    model = bar(*MODELS[named])
    (group,) = model.element_groups()
    law, word = group.material, group.element.formulation
    word = "standard" if word == "total_lagrangian" else word
    linear = bar(kl.Isotropic3D(law.E, law.nu, law.density), word)
    assert np.abs(model.modes(3)[0] / linear.modes(3)[0] - 1).max() < 1e-9
    K = linear.matrices().K
    assert np.abs((model.matrices().K - K).toarray()).max() < 1e-9 * np.abs(K.data).max()


@pytest.mark.parametrize("named", MODELS)
def test_results_are_compared_and_checked(named):
    model = bar(*MODELS[named])
    result = model.solve()
    found = kl.compare(result, model.solve())
    assert found.displacement.maximum == 0.0
    assert found.energies[0] == found.energies[1] > 0
    assert isinstance(model.check(), list)

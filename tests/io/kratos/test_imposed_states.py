"""The set_initial_state_process of run files: closed forms, in one step or several, and refusals."""

import numpy as np
import pytest
from run_files import box_mdpa, materials, process, run_file, write

import kratos_lite as kl
from kratos_lite.errors import InputError

E, NU = 2e9, 0.3
ROLLERS = [
    process("assign_scalar_variable_process", f"Structure.{side}", f"DISPLACEMENT_{axis}", value=0.0)
    for side, axis in (("Bottom", "Z"), ("Front", "Y"), ("Left", "X"))
]


def folder(path, law="LinearElastic3DLaw", settings=None, element=None, **variables):
    """Write a box on rollers with an imposed state, and return its run file."""
    text = box_mdpa()
    if element:
        text = text.replace("SmallDisplacementElement3D8N", element)
    for name, nodes in (("Front", (1, 2, 3, 10, 11, 12, 19, 20, 21)), ("Left", range(1, 10))):
        rows = "\n".join(map(str, nodes))
        text += f"Begin SubModelPart {name}\nBegin SubModelPartNodes\n{rows}\nEnd SubModelPartNodes\n"
        text += "End SubModelPart\n"
    (path / "box.mdpa").write_text(text)
    write(path, materials("Structure.Body", 1.0, E, NU, law, **variables), "materials.json")
    parameters = {"model_part_name": "Structure.Body"} | (settings or {})
    state = {"python_module": "set_initial_state_process", "Parameters": parameters}
    time = {"step": 0.5, "end": 1.0} if variables else {}
    return write(path, run_file(ROLLERS, [state], analysis_type="non_linear", **time))


STEEL = {"YIELD_STRESS": 1e6, "FRACTURE_ENERGY": 1e6, "HARDENING_CURVE": 3}


@pytest.mark.parametrize(
    ("law", "variables"),
    [("LinearElastic3DLaw", {}), ("SmallStrainIsotropicPlasticity3DVonMisesVonMises", STEEL)],
)
def test_a_free_body_takes_the_strain_that_the_state_imposes(tmp_path, law, variables):
    """ε = ε0 - C⁻¹ σ0 without stress, whether or not it is elastic."""
    strain = np.array([1e-4, -2e-4, 3e-4, 0, 0, 0])
    stress = np.array([1e5, 2e5, -1e5, 0, 0, 0])
    settings = {"imposed_strain": [1e-4, "-2*1e-4", 3e-4, 0, 0, 0], "imposed_stress": stress.tolist()}
    result = kl.run(kl.read_case(folder(tmp_path, law, settings, **variables))).result
    exact = strain - np.linalg.solve(kl.Isotropic3D(E, NU).C, stress)
    assert np.abs(result.u - result.mesh.points * exact[:3]).max() < 1e-10 * np.abs(exact).max()
    assert np.abs(result.stress()).max() < 1e-9 * E * np.abs(strain).max()


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"imposed_stress": [0, 0, 0]}, "imposed_stress.*six numbers"),
        ({"imposed_strain": [0, 0, 0, 0, 0, None]}, "imposed_strain.*six numbers"),
        ({"imposed_strain": ["x", 0, 0, 0, 0, 0]}, "imposed_strain.*'x'"),
        ({"imposed_strain": ["t", 0, 0, 0, 0, 0]}, "imposed_strain.*changes with t"),
        ({"imposed_deformation_gradient": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "gradient.*not supported"),
        ({"interval": [0.6, "End"]}, "interval.*all steps"),
        ({"model_part_name": "Structure.Bulk"}, "no part 'Structure.Bulk'"),
        ({"imposed_strains": [0] * 6}, "imposed_strain"),
    ],
)
def test_states_that_cannot_be_imposed(tmp_path, settings, says):
    path = folder(tmp_path, "SmallStrainIsotropicPlasticity3DVonMisesVonMises", settings, **STEEL)
    with pytest.raises(InputError, match=says):
        kl.read_case(path)


def test_a_law_of_finite_strain_has_no_imposed_state(tmp_path):
    path = folder(tmp_path, "HyperElastic3DLaw", element="TotalLagrangianElement3D8N")
    with pytest.raises(InputError, match="NeoHookean3D has no initial state here"):
        kl.read_case(path)

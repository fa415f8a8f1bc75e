"""Stresses are C strain: a material that overrides them is refused, and equilibrium is that of them."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.materials import MATERIALS


class Cracked:
    """No tension."""

    def stress(self, strain):
        return np.minimum(np.asarray(strain) @ self.C, 0)


@pytest.mark.parametrize(
    "own", [{"stress": Cracked.stress}, {"C": lambda self: np.eye(6)}, {}], ids=["own", "method C", "mixin"]
)
def test_a_material_that_overrides_stress_or_C_is_refused(own):
    bases, name = (kl.Isotropic3D,) if own else (Cracked, kl.Isotropic3D), min(own, default="stress")
    with pytest.raises(kl.MaterialError, match=rf"^Own overrides {name}, .* compliance\(\) or elasticity"):
        type("Own", bases, own)
    assert "Own" not in MATERIALS


def test_the_equilibrium_of_a_report_is_that_of_the_stresses_of_the_result():
    model = kl.Model(kl.box(cells=(2, 2, 2)), kl.Isotropic3D(E=1e6, nu=0.3, density=7850.0))
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -9.81)))
    model.add_prestress([100.0, 200, 300, 10, 20, 30])
    result = model.solve()
    f = np.zeros_like(result.u)
    for nodes, stress in zip(model.mesh.blocks[0].nodes, result.stress(), strict=True):
        f[nodes] += kl.KinematicLinear3D8N(model.mesh.points[nodes]).internal_force(stress)
    miss = np.abs(f - result.loads - result.reactions).sum()
    size = np.abs(result.loads).sum() + np.abs(result.reactions).sum()
    assert miss / size < 1e-12
    assert result.report.force_error < 1e-12

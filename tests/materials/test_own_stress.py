"""A material whose stress is not C strain is refused before anything is solved."""

from dataclasses import dataclass

import numpy as np
import pytest
from rounding import close

import kratos_lite as kl
from kratos_lite.materials import MATERIALS

with MATERIALS.temporary():

    @dataclass(frozen=True)
    class Stiffening(kl.Isotropic3D):
        """Stiffer with strain."""

        def stress(self, strain):
            return (1 + 1e3 * (strain**2).sum(-1, keepdims=True)) * (strain @ self.C)

    @dataclass(frozen=True)
    class Tensile(kl.Isotropic3D):
        """No compression."""

        def stress(self, strain):
            return np.maximum(np.asarray(strain) @ self.C, 0)

    @dataclass(frozen=True)
    class Doubled(kl.Isotropic3D):
        """Linear, but not with its C."""

        def stress(self, strain):
            return 2 * super().stress(strain)

    @dataclass(frozen=True)
    class Sheared(kl.Isotropic3D):
        """One shear modulus is another."""

        def stress(self, strain):
            return super().stress(strain) * np.array([1, 1, 1, 1, 1, 1.001])

    @dataclass(frozen=True)
    class OneAtATime(kl.Isotropic3D):
        """Takes one strain."""

        def stress(self, strain):
            return self.C @ strain

    @dataclass(frozen=True)
    class Same(kl.Isotropic3D):
        """The same, written again."""

        def stress(self, strain):
            return np.einsum("ij,...j->...i", self.C, strain)


def block(material):
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), material(E=1e6, nu=0.3, density=7850.0))
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -9.81)))
    return model


ANALYSES = {
    "static": lambda m: block(m).solve(),
    "load cases": lambda m: block(m).solve_cases({"a": [kl.Gravity((0, 0, -1))]}),
    "modes": lambda m: block(m).modes(2),
    "complex modes": lambda m: block(m).complex_modes(2),
    "transient": lambda m: block(m).transient(),
    "matrices": lambda m: block(m).matrices(),
    "local system": lambda m: block(m).local_system(1),
    "finite-element body": lambda m: kl.FiniteElementBody(kl.box(), m(1e6, 0.3, 7850.0)),
    "pseudo-rigid body": lambda m: kl.PseudoRigidBody(kl.box(), m(1e6, 0.3, 7850.0)),
}


@pytest.mark.parametrize("analysis", ANALYSES)
def test_every_analysis_refuses_a_stress_that_is_not_C_strain(analysis):
    text = r"Stiffening.stress is not C strain: at the strain \(.*\) it gives \(.*\) Pa, C gives \(.*\) Pa; "
    with pytest.raises(kl.MaterialError, match=text + r"materials are linear: override elasticity\(\)"):
        ANALYSES[analysis](Stiffening)


@pytest.mark.parametrize("material", [Tensile, Doubled, Sheared])
def test_other_stresses_that_are_not_C_strain_are_refused(material):
    with pytest.raises(kl.MaterialError, match=f"{material.__name__}.stress is not C strain"):
        block(material).solve()


def test_a_stress_of_one_strain_at_a_time_is_refused():
    with pytest.raises(kl.MaterialError, match=r"OneAtATime.stress\(strain\) must take strains \(..., 6\)"):
        block(OneAtATime).solve()


def test_a_pseudo_rigid_body_of_given_mass_refuses_it_too():
    properties = kl.RigidBody(kl.box(), kl.Isotropic3D(1e6, 0.3, 7850.0)).mass_properties
    with pytest.raises(kl.MaterialError, match="is not C strain"):
        kl.PseudoRigidBody(material=Doubled(1e6, 0.3, 7850.0), mass_properties=properties)


def test_a_stress_that_is_C_strain_is_taken_and_tried_once():
    calls = []

    @dataclass(frozen=True)
    class Counted(Same):
        def stress(self, strain):
            calls.append(np.shape(strain))
            return super().stress(strain)

    with MATERIALS.temporary():
        model, usual = block(Counted), block(kl.Isotropic3D)
        model.check_geometry()
        for _ in range(3):
            model.element_groups()
        assert len(calls) == 1
        result, plain = model.solve(), usual.solve()
    close(result.stress(), plain.stress(), 1e-9)
    assert result.report.force_error < 1e-12


def test_the_equilibrium_of_a_report_is_that_of_the_stresses_of_the_result():
    model = block(kl.Isotropic3D)
    model.add_prestress([100.0, 200, 300, 10, 20, 30])
    result = model.solve()
    f = np.zeros_like(result.u)
    for nodes, stress in zip(model.mesh.blocks[0].nodes, result.stress(), strict=True):
        f[nodes] += kl.KinematicLinear3D8N(model.mesh.points[nodes]).internal_force(stress)
    miss = np.abs(f - result.loads - result.reactions).sum()
    size = np.abs(result.loads).sum() + np.abs(result.reactions).sum()
    assert miss / size < 1e-12
    assert result.report.force_error < 1e-12


def test_a_stress_that_differs_where_two_strains_are_positive_alone_is_refused():
    with MATERIALS.temporary():

        class Bilinear(kl.Isotropic3D):
            def stress(self, strain):
                both = (strain[..., 0] > 0) & (strain[..., 1] > 0)
                return np.where(both[..., None], 0.5, 1.0) * super().stress(strain)

    model = kl.Model(kl.box(), Bilinear(E=1e6, nu=0.0, density=1.0))
    with pytest.raises(kl.MaterialError, match=r"Bilinear\.stress is not C strain"):
        model.modes(1)

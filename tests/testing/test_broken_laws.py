"""Laws with the mistakes that students make: the kit must name each."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.materials import MATERIALS
from kratos_lite.testing import check_material, failures
from kratos_lite.testing.laws import BEYOND, _directions, limits


@pytest.fixture(autouse=True)
def _own_names():
    with MATERIALS.temporary():
        yield


def steel(change):
    """Return J2 plasticity whose response is changed: from arguments and answer to answer."""

    @dataclass(frozen=True)
    class Broken(kl.J2Plasticity3D):
        aliases: ClassVar[tuple[str, ...]] = ()

        def response(self, strain, state, dt):
            return change(self, strain, state, *super().response(strain, state, dt))

    return Broken(200e9, 0.3, 250e6, 5e9, 1e9)


def shear_forgotten(law, strain, state, s, D, new):
    step = new["plastic_strain"] - state["plastic_strain"]
    return s, D, new | {"plastic_strain": state["plastic_strain"] + step * [1, 1, 1, 0.5, 0.5, 0.5]}


def pressure_scaled(law, strain, state, s, D, new):
    trial = (strain - state["plastic_strain"]) @ kl.Isotropic3D(law.E, law.nu).C
    factor = np.linalg.norm(s, axis=-1) / np.maximum(np.linalg.norm(trial, axis=-1), 1e-300)
    return trial * np.minimum(factor, 1.0)[..., None], None, new


def elastic_tangent(law, strain, state, s, D, new):
    return s, kl.Isotropic3D(law.E, law.nu).C, new


def sign_of_normals(law, strain, state, s, D, new):
    """The tangent has + n n in place of - n n where the law flows."""
    C = kl.Isotropic3D(law.E, law.nu).C
    return s, np.where(np.abs(D - C) > 1e-9 * C.max(), 2 * C - D, C), new


def elasticity_of_shear(law, strain, state, s, D, new):
    D = np.array(np.broadcast_to(D, (*s.shape, 6)))
    flows = np.abs(new["plastic_strain"] - state["plastic_strain"]).max(axis=-1) > 0
    D[..., 3, 3] *= np.where(flows, 1.0, 2.0)
    return s, D, new


def hardened_twice(law, strain, state, s, D, new):
    p = new["accumulated_plastic_strain"]
    return s, D, new | {"accumulated_plastic_strain": 2 * p - state["accumulated_plastic_strain"]}


def state_overwritten(law, strain, state, s, D, new):
    state["plastic_strain"][...] = new["plastic_strain"]
    return s, D, new | {"plastic_strain": state["plastic_strain"]}


def strain_changed(law, strain, state, s, D, new):
    strain *= 2
    return s, D, new


def stress_at_rest(law, strain, state, s, D, new):
    return s + 1e6, D, new


def last_state_kept(law, strain, state, s, D, new):
    return s, D, {name: values.copy() for name, values in state.items()}


def yield_forgotten_in_pressure(law, strain, state, s, D, new):
    twisted = np.array(D)
    twisted[..., 0, 1] *= 1.01
    return s, twisted, new


@pytest.mark.parametrize(
    ("change", "check", "says"),
    [
        (shear_forgotten, "elastic strain", "engineering shear"),
        (pressure_scaled, "elastic strain", "as the stress does"),
        (elastic_tangent, "tangent", "it is the C of elasticity"),
        (sign_of_normals, "tangent", ", where its state changes, "),
        (
            elasticity_of_shear,
            "tangent",
            "XY is 1.538e+11 Pa, against differences 7.692e+10, where it is elas",
        ),
        (hardened_twice, "one step or two", "updated twice"),
        (state_overwritten, "contract", "in place"),
        (strain_changed, "contract", "work on copies"),
        (stress_at_rest, "rest", "stress at rest"),
        (last_state_kept, "elastic strain", "engineering shear"),
        (yield_forgotten_in_pressure, "tangent", "∂σ_XX/∂ε_YY is"),
    ],
    ids=lambda v: getattr(v, "__name__", ""),
)
def test_the_kit_names_the_mistake(change, check, says):
    found = {finding.check: finding for finding in failures(check_material(steel(change)))}
    assert check in found
    assert says in found[check].detail


def test_the_elastic_limit_is_that_of_von_mises_in_each_direction():
    law, ways = kl.J2Plasticity3D(200e9, 0.3, 250e6), _directions()
    trial = limits(law, ways) * ways @ kl.Isotropic3D(200e9, 0.3).C
    trial[:, :3] -= trial[:, :3].mean(axis=1, keepdims=True)
    yields = np.sqrt(1.5 * trial**2 @ [1, 1, 1, 2, 2, 2]) / 250e6
    assert yields.min() > 1
    assert yields.max() * max(factor for factor in BEYOND if factor < 1) < 1


with MATERIALS.temporary():

    @dataclass(frozen=True)
    class Timeless(kl.GeneralizedMaxwell3D):
        def response(self, strain, state, dt):
            return super().response(strain, state, 1.0)

    @dataclass(frozen=True)
    class Perpetual(kl.Material):
        """Stiff while it is pulled, soft while it goes back: it gives energy."""

        E: float
        density: float = 0.0
        internal_variables: ClassVar = {"last": 6}
        symmetric_tangent: ClassVar[bool] = False

        def response(self, strain, state, dt):
            out = np.abs(strain) < np.abs(state["last"])
            return self.E * strain * np.where(out, 2.0, 1.0), None, {"last": strain.copy()}

    @dataclass(frozen=True)
    class Grained(kl.NeoHookean3D):
        aliases: ClassVar[tuple[str, ...]] = ()

        def response(self, strain, state, dt):
            stress, D, new = super().response(strain, state, dt)
            stress, D = stress.copy(), D.copy()
            stress[..., 0] *= 1.001
            D[..., 0, :] *= 1.001
            return stress, D, new


@pytest.mark.parametrize(
    ("law", "check", "says"),
    [
        (Timeless(1e9, 0.3, 0.5, 1.0), "rate", "is dt ignored"),
        (Perpetual(1e9), "dissipation", "energy gained"),
        (Grained(1e6, 0.3), "isotropy", "turned"),
        (Grained(1e6, 0.3), "symmetric tangent", "D against"),
    ],
    ids=lambda v: type(v).__name__ if isinstance(v, kl.Material) else "",
)
def test_laws_against_what_they_claim(law, check, says):
    found = {finding.check: finding for finding in failures(check_material(law))}
    assert check in found
    assert says in found[check].detail

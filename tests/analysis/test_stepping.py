"""The loop through time: names of integrators, an own one, loops without an end, substeps of models."""

from itertools import islice

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.integrators import BODY_INTEGRATORS, BodyIntegrator, body_integrator


def stone(**options):
    return kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0), **options)


def bar():
    model = kl.Model(kl.box(), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1e3)))
    return model


@pytest.mark.parametrize(
    ("word", "alias"),
    [("explicit", "RIG_POS"), ("momentum_conserving", "RIG_NEG"), ("implicit", "RIG_IMP")],
)
def test_acronyms_of_solfec_are_aliases_of_words(word, alias):
    assert stone(integrator=alias).integrator == word
    assert body_integrator(stone(integrator=word)).name == word


def test_an_integrator_of_models_is_found_by_its_name():
    assert str(bar().transient(integrator="hht").integrator) == "hht(-0.05)"


def test_an_own_integrator_of_bodies_is_a_class():
    kept = kl.RigidBody.integrators
    try:

        class Rest(BodyIntegrator):
            name = "rest"
            bodies = kl.RigidBody

            def step(self, body, h, v):
                return np.zeros_like(body.u)

        body = stone(integrator="rest")
        body.set_velocity((1, 0, 0))
        *_, end = kl.integrate(body, 0.1, 5)
        assert (end.time, end.integrator) == (pytest.approx(0.5), "rest")
        np.testing.assert_array_equal(body.mass_center(), body.center)
    finally:
        kl.RigidBody.integrators = kept
        BODY_INTEGRATORS.pop((kl.RigidBody, "rest"), None)


def test_without_a_number_of_steps_it_goes_on_until_it_is_left():
    for subject in (stone(), bar().transient()):
        states = list(islice(kl.integrate(subject, 1e-3, every=2), 3))
        assert [state.step for state in states] == [2, 4, 6]
        assert subject.step == 6
        *_, end = kl.integrate(subject, 1e-3, until=lambda state: state.step >= 9)
        assert end.step == 9


def test_substeps_of_a_model_are_shorter_steps():
    *_, parts = kl.integrate(bar().transient(), 2e-3, 10, substeps=2)
    *_, short = kl.integrate(bar().transient(), 1e-3, 20)
    np.testing.assert_allclose(parts.u, short.u, rtol=1e-12)
    assert (parts.step, parts.substeps) == (10, 2)
    explicit = bar().transient(integrator="central_difference")
    critical = explicit.critical_step()
    *_, end = kl.integrate(explicit, 3 * critical, 2, substeps="auto")
    assert end.substeps == 4

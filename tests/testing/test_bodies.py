"""The checks of a kind of body: all kinds pass, broken ones are found."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.testing import failures
from kratos_lite.testing.bodies import check_body

KINDS = (kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody)


def failed(kind):
    return {finding.check for finding in failures(check_body(kind))}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_conforms(kind):
    findings = check_body(kind)
    assert [str(finding) for finding in findings if not finding.passed] == []
    assert len(findings) == (5 if kind is kl.RigidBody else 10)


def test_a_force_without_its_moment_is_found():
    class Broken(kl.RigidBody):
        def generalized_force(self, X, force, q):
            return super().generalized_force(self.center, force, q)

    assert failed(Broken) == {"conjugacy"}


def test_mass_in_the_nodes_is_not_that_of_a_box():
    class Broken(kl.FiniteElementBody):
        def __init__(self, mesh, material):
            super().__init__(mesh, material, lumped=True)

    assert failed(Broken) == {"momenta"}


def test_a_load_of_twice_the_stiffness_is_found():
    class Broken(kl.FiniteElementBody):
        def internal_force(self, q=None):
            return 2 * super().internal_force(q)

    assert failed(Broken) == {"energy", "tangent"}


def test_an_unsymmetric_mass_is_found():
    class Broken(kl.PseudoRigidBody):
        def times_mass(self, v):
            return super().times_mass(v) + 0.1 * np.roll(v, 1, axis=-1)

    assert "mass matrix" in failed(Broken)


def test_something_that_is_no_kind():
    with pytest.raises(kl.InputError, match="check a class of bodies"):
        check_body("rigid")

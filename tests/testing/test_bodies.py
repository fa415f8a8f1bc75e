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


def lumped(self, mesh, material):
    kl.FiniteElementBody.__init__(self, mesh, material, lumped=True)


def without_moment(self, X, force, q):
    return kl.RigidBody.generalized_force(self, self.center, force, q)


def doubled(self, q=None):
    return 2 * kl.FiniteElementBody.internal_force(self, q)


def unsymmetric(self, v):
    return kl.PseudoRigidBody.times_mass(self, v) + 0.1 * np.roll(v, 1, axis=-1)


@pytest.mark.parametrize(
    ("parent", "changes", "checks"),
    [
        (kl.RigidBody, {"generalized_force": without_moment}, {"conjugacy"}),
        (kl.FiniteElementBody, {"__init__": lumped}, {"momenta"}),
        (kl.FiniteElementBody, {"internal_force": doubled}, {"energy", "tangent"}),
        (kl.PseudoRigidBody, {"times_mass": unsymmetric}, {"mass matrix"}),
    ],
)
def test_broken_kinds_are_found(parent, changes, checks):
    found = failed(type("Broken", (parent,), changes))
    assert found == checks or found > checks == {"mass matrix"}


def test_something_that_is_no_kind():
    with pytest.raises(kl.InputError, match="check a class of bodies"):
        check_body("rigid")

"""What tests of bodies share."""

import numpy as np
import pytest

import kratos_lite as kl

BRICK = (0.4, 0.6, 1.0)


@pytest.fixture(scope="session")
def brick():
    """Return a function that makes the box of sides .4, .6 and 1 m about the origin, of any kind."""

    def make(kind=kl.FiniteElementBody, E=1e6, cells=(1, 1, 1), element="KinematicLinear3D8N", **options):
        mesh = kl.box(BRICK, cells, element, origin=(-0.2, -0.3, -0.5))
        return kind(mesh, kl.Isotropic3D(E=E, nu=0.3, density=1000.0), **options)

    return make


@pytest.fixture(scope="session")
def drift():
    """Return a function that gives |b - a| / |a| of vectors."""

    def relative(a, b):
        return float(np.linalg.norm(np.asarray(b) - a) / np.linalg.norm(a))

    return relative

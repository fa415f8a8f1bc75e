"""Time integrators of models and bodies: a new one is a file here, and its import below."""

from kratos_lite.analysis.integrators import finite_element, pseudo_rigid, rigid  # noqa: F401 (they register)
from kratos_lite.analysis.integrators.base import (
    BODY_INTEGRATORS,
    INTEGRATORS,
    BodyIntegrator,
    ModelIntegrator,
    body_integrator,
)
from kratos_lite.analysis.integrators.central_difference import CentralDifference
from kratos_lite.analysis.integrators.generalized_alpha import HHT, Bossak, GeneralizedAlpha, Newmark

__all__ = [
    "BODY_INTEGRATORS",
    "HHT",
    "INTEGRATORS",
    "BodyIntegrator",
    "Bossak",
    "CentralDifference",
    "GeneralizedAlpha",
    "ModelIntegrator",
    "Newmark",
    "body_integrator",
]

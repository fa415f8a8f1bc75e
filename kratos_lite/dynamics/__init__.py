"""Dynamics of models: transients, natural frequencies, and steady motion of the material through the mesh."""

from kratos_lite.dynamics.equations import EquationsOfMotion
from kratos_lite.dynamics.schemes import CentralDifference, generalised_alpha, hht, newmark
from kratos_lite.dynamics.transient import Moment, Transient

__all__ = [
    "CentralDifference",
    "EquationsOfMotion",
    "Moment",
    "Transient",
    "generalised_alpha",
    "hht",
    "newmark",
]

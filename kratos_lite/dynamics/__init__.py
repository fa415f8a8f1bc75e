"""Dynamics of models: transients, natural frequencies, and steady motion of the material through the mesh."""

from kratos_lite.dynamics.equations import EquationsOfMotion
from kratos_lite.dynamics.modal import critical_rate
from kratos_lite.dynamics.moment import Moment
from kratos_lite.dynamics.outputs import material_velocity, reaction_resultant
from kratos_lite.dynamics.schemes import CentralDifference, bossak, generalised_alpha, hht, newmark
from kratos_lite.dynamics.transient import Transient

__all__ = [
    "CentralDifference",
    "EquationsOfMotion",
    "Moment",
    "Transient",
    "bossak",
    "critical_rate",
    "generalised_alpha",
    "hht",
    "material_velocity",
    "newmark",
    "reaction_resultant",
]

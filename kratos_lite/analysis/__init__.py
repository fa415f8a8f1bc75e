"""Dynamics of models: transients, natural frequencies, and steady motion of the material through the mesh."""

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.modal import critical_rate
from kratos_lite.analysis.moment import Moment
from kratos_lite.analysis.outputs import material_velocity, reaction_resultant
from kratos_lite.analysis.schemes import CentralDifference, bossak, generalized_alpha, hht, newmark
from kratos_lite.analysis.transient import Transient

__all__ = [
    "CentralDifference",
    "EquationsOfMotion",
    "Moment",
    "Transient",
    "bossak",
    "critical_rate",
    "generalized_alpha",
    "hht",
    "material_velocity",
    "newmark",
    "reaction_resultant",
]

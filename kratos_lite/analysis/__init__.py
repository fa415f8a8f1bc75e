"""Analyses: statics, transients, natural frequencies, steady motion; and the one loop through time."""

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.integrators import HHT, Bossak, CentralDifference, GeneralizedAlpha, Newmark
from kratos_lite.analysis.modal import critical_rate
from kratos_lite.analysis.outputs import material_velocity, reaction_resultant
from kratos_lite.analysis.state import State
from kratos_lite.analysis.stepping import integrate
from kratos_lite.analysis.transient import TransientAnalysis

__all__ = [
    "HHT",
    "Bossak",
    "CentralDifference",
    "EquationsOfMotion",
    "GeneralizedAlpha",
    "Newmark",
    "State",
    "TransientAnalysis",
    "critical_rate",
    "integrate",
    "material_velocity",
    "reaction_resultant",
]

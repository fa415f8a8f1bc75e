"""Loads: body forces, surface loads, nodal forces, and loads on the conditions of a file."""

from kratos_lite.model.loads.base import Load, ScaledLoad, TimeDependentLoad
from kratos_lite.model.loads.body import BodyForce, Gravity
from kratos_lite.model.loads.conditions import ConditionLoads
from kratos_lite.model.loads.nodal import NodalForces, PointLoad
from kratos_lite.model.loads.surface import SURFACES, LineLoad, Pressure, Traction, outward

__all__ = [
    "SURFACES",
    "BodyForce",
    "ConditionLoads",
    "Gravity",
    "LineLoad",
    "Load",
    "NodalForces",
    "PointLoad",
    "Pressure",
    "ScaledLoad",
    "TimeDependentLoad",
    "Traction",
    "outward",
]

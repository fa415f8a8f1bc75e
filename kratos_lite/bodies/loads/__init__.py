"""Loads on bodies: forces and torques fixed in space or in the body, following pressure, springs, callbacks.

A load is bound to a body when it is added; what is bound gives the generalized force at any configuration.
Loads of models (gravity, tractions, dead pressure, …) act through their nodal forces, on every kind of body.
"""

from kratos_lite.bodies.loads.base import AppliedLoad, BodyLoad
from kratos_lite.bodies.loads.forces import Callback, Force, Spring, Torque
from kratos_lite.bodies.loads.pressure import FollowerPressure

__all__ = [
    "AppliedLoad",
    "BodyLoad",
    "Callback",
    "FollowerPressure",
    "Force",
    "Spring",
    "Torque",
]

"""Bodies in motion: rigid, pseudo-rigid and finite-element, with one protocol for all.

Source: Solfec-1.0, theory manual.
"""

from kratos_lite.bodies.body import BODIES, Body
from kratos_lite.bodies.constraints import (
    Constraint,
    FixDirection,
    FixPoint,
    PrescribedAcceleration,
    PrescribedDisplacement,
    PrescribedVelocity,
    RigidLink,
)
from kratos_lite.bodies.conversion import convert
from kratos_lite.bodies.equilibrium import find_equilibrium
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.bodies.loads import Callback, FollowerPressure, Force, Spring, Torque
from kratos_lite.bodies.pseudo_rigid import PseudoRigidBody
from kratos_lite.bodies.rigid import FixedBody, RigidBody
from kratos_lite.time_series import TimeSeries

__all__ = [
    "BODIES",
    "Body",
    "Callback",
    "Constraint",
    "FiniteElementBody",
    "FixDirection",
    "FixPoint",
    "FixedBody",
    "FollowerPressure",
    "Force",
    "PrescribedAcceleration",
    "PrescribedDisplacement",
    "PrescribedVelocity",
    "PseudoRigidBody",
    "RigidBody",
    "RigidLink",
    "Spring",
    "TimeSeries",
    "Torque",
    "convert",
    "find_equilibrium",
]

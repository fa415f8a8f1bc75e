"""Constraints on a single body: fixed points and directions, prescribed motions, rigid links."""

from kratos_lite.bodies.constraints.base import Constraint
from kratos_lite.bodies.constraints.points import (
    FixDirection,
    FixPoint,
    PrescribedAcceleration,
    PrescribedDisplacement,
    PrescribedVelocity,
    RigidLink,
)

__all__ = [
    "Constraint",
    "FixDirection",
    "FixPoint",
    "PrescribedAcceleration",
    "PrescribedDisplacement",
    "PrescribedVelocity",
    "RigidLink",
]

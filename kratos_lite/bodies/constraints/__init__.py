"""Constraints on a single body: fixed points and directions, prescribed motions, rigid links."""

from kratos_lite.bodies.constraints.base import Constraint
from kratos_lite.bodies.constraints.fixed import FixDirection, FixPoint, RigidLink
from kratos_lite.bodies.constraints.prescribed import (
    PrescribedAcceleration,
    PrescribedDisplacement,
    PrescribedVelocity,
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

"""Arbitrary Lagrangian-Eulerian terms: a body of revolution that rotates, a frame that moves along a body."""

from kratos_lite.ale.matrices import MotionMatrices
from kratos_lite.ale.motion import Motion
from kratos_lite.ale.rotation import Rotation
from kratos_lite.ale.translation import Translation

__all__ = ["Motion", "MotionMatrices", "Rotation", "Translation"]

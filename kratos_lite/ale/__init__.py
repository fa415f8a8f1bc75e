"""ALE terms: a rotating body of revolution, and a frame that moves along a long body."""

from kratos_lite.ale.matrices import MotionMatrices
from kratos_lite.ale.motion import Motion, Rotation, Translation

__all__ = ["Motion", "MotionMatrices", "Rotation", "Translation"]

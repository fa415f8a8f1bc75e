"""Scenes: a body, what acts on it, and how it is to be marched, as JSON or as a Python script."""

from kratos_lite.io.scenes.describe import describe_scene
from kratos_lite.io.scenes.scene import OUTPUTS, BodyScene, is_scene, read_scene

__all__ = ["OUTPUTS", "BodyScene", "describe_scene", "is_scene", "read_scene"]

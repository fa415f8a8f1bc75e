"""Loads: body forces, surface loads, nodal forces, and loads on the conditions of a file."""

from kratos_lite.model.loads.base import Load, ScaledLoad, TimeDependentLoad

__all__ = ["Load", "ScaledLoad", "TimeDependentLoad"]

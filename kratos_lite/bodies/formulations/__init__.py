"""Formulations: how the deformation of a finite-element body becomes a load; a new one is one file.

Source: Solfec-1.0 theory, finite-element formulations.
"""

from kratos_lite.bodies.formulations.base import FORMULATIONS, Formulation
from kratos_lite.bodies.formulations.corotational import Corotational, Modal
from kratos_lite.bodies.formulations.total_lagrangian import TotalLagrangian

__all__ = ["FORMULATIONS", "Corotational", "Formulation", "Modal", "TotalLagrangian"]

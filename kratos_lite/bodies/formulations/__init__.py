"""Forms: how the deformation of a finite-element body becomes a load; a new one is one file.

Source: Solfec-1.0 theory, finite-element formulations.
"""

from kratos_lite.bodies.formulations.base import FORMS, Form
from kratos_lite.bodies.formulations.corotational import Corotational
from kratos_lite.bodies.formulations.modal import Modal
from kratos_lite.bodies.formulations.total_lagrangian import TotalLagrangian

__all__ = ["FORMS", "Corotational", "Form", "Modal", "TotalLagrangian"]

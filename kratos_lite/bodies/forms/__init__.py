"""Forms: how the deformation of a finite-element body becomes a load; a new one is one file.

Source: Solfec-1.0 theory, finite-element formulations.
"""

from kratos_lite.bodies.forms.base import FORMS, Form
from kratos_lite.bodies.forms.corotational import Corotational
from kratos_lite.bodies.forms.modal import Modal
from kratos_lite.bodies.forms.total_lagrangian import TotalLagrangian

__all__ = ["FORMS", "Corotational", "Form", "Modal", "TotalLagrangian"]

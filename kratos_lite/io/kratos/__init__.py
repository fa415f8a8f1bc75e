"""What Kratos data mean for a model (`to_model`), and the way back (`to_document`)."""

from kratos_lite.io.kratos.to_model import model_from
from kratos_lite.io.kratos.variables import Variables

__all__ = ["Variables", "model_from"]

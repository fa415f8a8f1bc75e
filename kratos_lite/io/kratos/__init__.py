"""What Kratos data mean for a model, and the way back."""

from kratos_lite.io.kratos.to_document import document_from
from kratos_lite.io.kratos.to_model import model_from
from kratos_lite.io.kratos.variables import Variables

__all__ = ["Variables", "document_from", "model_from"]

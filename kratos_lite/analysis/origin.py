"""Origin of a result: the analysis that has solved it, as long as its model is the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from kratos_lite.errors import ModelError
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array


class Analysis(Protocol):
    """What has solved a structure, and solves it for other loads."""

    model: Structure

    def adjoint(self, load: Array, motion: Array) -> Array:
        """Return the displacement (n, 3) under a load alone, with supports displaced by a motion alone."""


@dataclass(frozen=True, eq=False)
class Origin:
    """An analysis, and the version of its model, when it was solved."""

    analysis: Analysis
    version: tuple[int, int]

    @property
    def model(self) -> Structure:
        """The structure, as it was solved."""
        return self._unchanged().model

    def adjoint(self, load: Array, motion: Array) -> Array:
        """Return the displacement (n, 3) under a load alone, with supports displaced by a motion alone."""
        return self._unchanged().adjoint(load, motion)

    def _unchanged(self) -> Analysis:
        """Return the analysis of the model as it was."""
        if self.version != self.analysis.model.version:
            raise ModelError("the model has changed since this solution; solve it again")
        return self.analysis

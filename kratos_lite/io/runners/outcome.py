"""Outcome: what a case came to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from kratos_lite.analysis.result import Result
from kratos_lite.io.case import Case, Comparison
from kratos_lite.io.outputs import write_at_end
from kratos_lite.tabular import in_units

if TYPE_CHECKING:
    from kratos_lite.analysis.harmonic import HarmonicResponse

WIDTH = 22
"""Of the left column of tables."""


@dataclass
class Outcome:
    """What a case came to; printed, it is the summary.

    Attributes
    ----------
    case : what was run.
    rows : the summary: labels and values; those of the result where there are none.
    result : of a model at its end, or None.
    lines : a table instead of the summary, as of natural frequencies.
    found : what comparisons found after steps, by their numbers.
    modes : ω in rad/s, complex λ in 1/s or factors of buckling (k,), and shapes (k, n, 3); or None.
    response : to loads that swing, or None.
    """

    case: Case
    rows: list[tuple[str, str]]
    result: Result | None = None
    lines: list[str] = field(default_factory=list)
    found: dict[int, list[tuple[float, str]]] = field(default_factory=dict)
    modes: tuple[Any, Any] | None = None
    response: HarmonicResponse | None = None

    def __str__(self) -> str:
        return "\n".join(self.summary())

    def summary(self, *, verbose: bool = False) -> list[str]:
        """Return the lines of the summary.

        Parameters
        ----------
        verbose : say also what the solution did without.

        Returns
        -------
        list of str
            A label and a value each.
        """
        rows = self.rows or (self.result.table() if self.result else [])
        for where, part in self.case.outputs.sections if self.result else ():
            rows = [*rows, *self.result.section(where, part=part).table()]  # type: ignore[union-attr]
        shown = [(name, text) for name, text in rows if verbose or name != "skipped"]
        units = self.case.model.units if self.case.is_of_model else "SI"
        return [*self.lines, *(f"{name:<{WIDTH}}{in_units(text, units)}" for name, text in shown)]

    def compare(self) -> list[str]:
        """Return a line for each expected value of the case: passed, failed or not evaluated.

        Returns
        -------
        list of str
            Nothing where there is no result.
        """
        if self.modes is not None:
            of_modes = (each for each in self.case.expected if not isinstance(each, Comparison))
            return [each(self.modes[0]) for each in of_modes]
        return [] if self.result is None else self.case.compare(self.result, self.found)

    def write(self) -> list[str]:
        """Write what the end gives; return all files of the case, also those written before.

        Returns
        -------
        list of str
            Paths.

        Raises
        ------
        InputError
            A file cannot be written.
        """
        if self.result is not None:
            write_at_end(self.case.outputs, self.result, in_time=self.case.time is not None)
        return [
            *self.case.outputs.paths(),
            *(line for each in self.case.outputs.in_steps for line in each.summary()),
        ]

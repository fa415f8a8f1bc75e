"""RateWatch: the critical rate of a motion in time, and a warning when the rate comes near it."""

from __future__ import annotations

import logging

import numpy as np

from kratos_lite.ale.checks import critical_rate_estimate, near_critical
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.modal import critical_rates
from kratos_lite.solvers.plan import REPEATED_LIMIT

_log = logging.getLogger("kratos_lite")


class RateWatch:
    """Looks at the rate of a motion, and warns once when it comes near the critical one.

    Parameters
    ----------
    e : the equations, which take the warnings; without a motion there is nothing to see.

    Attributes
    ----------
    critical : the lowest critical rate, infinite without a motion.
    of_mesh : that of the mesh itself; None where it is but an estimate.
    """

    def __init__(self, e: EquationsOfMotion) -> None:
        self.equations, self.critical = e, np.inf
        self.of_mesh: float | None = None
        free = len(e.system.constraint_map.free)
        self._done = e.terms is None or not free or (e.terms.motion.steady and not e.rates(0.0)[0])
        if e.terms is None or self._done:
            return
        if free <= REPEATED_LIMIT and not e.free_motions.any:
            self.critical = self.of_mesh = float(critical_rates(e, 1)[0])
        else:
            self.critical = critical_rate_estimate(e.terms)

    def look(self, time: float) -> None:
        """Warn if the rate of a time in s is near the critical one, and no warning came before."""
        e = self.equations
        if self._done or e.terms is None:
            return
        for text in near_critical(e.terms.motion, time, self.critical, self.of_mesh is not None):
            self._done = True
            e.warnings.append(f"at t = {time:g} s {text}" if time else text)
            if time:
                _log.warning("%s", e.warnings[-1])

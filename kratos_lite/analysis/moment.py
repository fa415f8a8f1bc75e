"""Moment: a model at one time, saved and read again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.io.atomic import read_arrays, write_arrays
from kratos_lite.typing import Array

FIELDS = ("u", "v", "a", "reactions", "time", "step", "imbalance")


@dataclass(frozen=True, eq=False)
class Moment:
    """A model at one time.

    Attributes
    ----------
    time, step : s, and number of steps taken.
    u, v, a : displacement, velocity, acceleration (n, 3) in m, m/s, m/s².
    reactions : (n, 3) N, forces of supports and constraints on the body; 0 where nothing acts.
    imbalance : N, largest free component of M a + C v + K u - f, by which `put` knows other loads.
    """

    time: float
    step: int
    u: Array
    v: Array
    a: Array
    reactions: Array
    imbalance: float = float("nan")

    def save(self, path: str | Path) -> None:
        """Write the moment to an .npz file, as a whole or not at all; a march can go on from it."""
        write_arrays(path, {name: np.asarray(getattr(self, name)) for name in FIELDS})

    @classmethod
    def load(cls, path: str | Path) -> Moment:
        """Read a moment; InputError if the file holds none."""
        file = read_arrays(path, FIELDS, "a moment that Moment.save wrote")
        one = [file[name] for name in ("time", "step", "imbalance")]
        if any(number.shape for number in one):
            raise InputError(f"{path}: a series of moments, not one that Moment.save wrote")
        time, step, left = (number.item() for number in one)
        return cls(time, step, file["u"], file["v"], file["a"], file["reactions"], left)

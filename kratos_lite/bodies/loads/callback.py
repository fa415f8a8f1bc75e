"""Loads that are functions of the user."""

from __future__ import annotations

from collections.abc import Callable

from numpy.typing import ArrayLike

from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.loads.base import AppliedLoad, BodyLoad
from kratos_lite.errors import InputError
from kratos_lite.typing import Array
from kratos_lite.validation import finite


class Callback(BodyLoad):
    """A load of your own.

    Parameters
    ----------
    function : takes configuration q, velocity u and time t in s, and returns the generalized force
        (..., dofs); for a rigid body also nine numbers: spatial force, spatial and referential torque.
    of_velocity : whether it depends on u; then each step is taken twice, with the old velocity and with the
        mean of old and new.

    Raises
    ------
    InputError
        It is not a function.

    Examples
    --------
    >>> import numpy as np
    >>> top = Callback(lambda q, u, t: np.r_[0, 0, 0, -20 * np.cross(q[6:9], [0, 0, 1]), 0, 0, 0])
    """

    def __init__(
        self, function: Callable[[Array, Array, float], ArrayLike], *, of_velocity: bool = True
    ) -> None:
        if not callable(function):
            raise InputError(f"a callback is a function of q, u and t; got {function!r}")
        self.function, self.of_velocity = function, bool(of_velocity)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body."""

        def generalized(q: Array, u: Array, time: float) -> Array:
            out = finite(self.function(q, u, time), f"what a callback returns at t = {time:g} s")
            if body.takes_torques and out.shape == (*q.shape[:-1], 9):
                total = body.generalized_torque(out[..., 3:6], q)
                total[..., :3] += out[..., 6:]
                total[..., 3:] = out[..., :3]
                return total
            if out.shape != u.shape:
                nine = " (or 9 numbers a body)" if body.takes_torques else ""
                raise InputError(
                    f"a callback must return a generalized force of shape {u.shape}{nine}; got {out.shape}"
                )
            return out

        return AppliedLoad(generalized, follows_velocity=self.of_velocity)

"""States as .npz files, from which integrations go on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kratos_lite.analysis.state import BODY_FIELDS, MODEL_FIELDS, STEP_FIELDS, State
from kratos_lite.atomic import read_arrays, write_arrays
from kratos_lite.errors import InputError

HEAD = ("kind", "integrator", "time", "step", "substeps")
WHAT = "a state that kl.write wrote"


def write_state(path: str | Path, state: State) -> None:
    """Write a state, as a whole or not at all; InputError unless the path ends with .npz."""
    if Path(path).suffix.lower() != ".npz":
        raise InputError(f"{path}: a state is written as .npz")
    write_arrays(path, {**{name: np.asarray(getattr(state, name)) for name in HEAD}, **state.values})


def read_state(path: str | Path) -> State:
    """Read the state of a body or a model that `kl.write` wrote.

    Parameters
    ----------
    path : the .npz file.

    Returns
    -------
    State

    Raises
    ------
    InputError
        There is no such file, or it holds no state.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> path = getfixture("tmp_path") / "rest.npz"
    >>> notes = kl.write(path, kl.State.of(body))
    >>> kl.read_state(path).restore(body)
    """
    head = read_arrays(path, HEAD, WHAT)
    if head["time"].shape or head["step"].shape:
        raise InputError(f"{path}: a series of states, not one that kl.write wrote")
    try:
        kind, integrator = str(head["kind"].item()), str(head["integrator"].item())
        time, step, substeps = float(head["time"]), int(head["step"]), int(head["substeps"])
    except (ValueError, TypeError, OverflowError):
        raise InputError(f"{path}: not {WHAT}") from None
    fields = STEP_FIELDS if integrator == "quasi_static" else MODEL_FIELDS
    values = read_arrays(path, fields if kind == "model" else BODY_FIELDS, WHAT, others=True)
    values = {name: array for name, array in values.items() if name not in HEAD}
    is_counted = head["step"].dtype.kind in "iu" and 0 <= step < 2**62
    if not is_counted or head["kind"].dtype.kind != "U" or any(a.dtype != float for a in values.values()):
        raise InputError(f"{path}: not {WHAT}")
    if not np.isfinite([time, *(np.abs(array).max(initial=0.0) for array in values.values())]).all():
        raise InputError(f"{path}: a state that is not finite, so nothing can go on from it")
    return State(kind, integrator, time, step, values, substeps)

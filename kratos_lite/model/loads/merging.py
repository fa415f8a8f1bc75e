"""Merging: of many loads, constant ones that differ in faces and size alone are evaluated as one load."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from copy import copy
from typing import Any

import numpy as np

from kratos_lite.mesh import Mesh
from kratos_lite.model.loads.base import DistributedLoad, Load

AT_ONCE = 2**15
"""Faces that are evaluated together, so that they take little memory."""


def joined(mesh: Mesh, acting: Iterable[tuple[float, Load]]) -> Iterator[tuple[float, Load]]:
    """Yield loads with a factor each, those of one kind as one load."""
    kinds: dict[Hashable, list[tuple[float, Any]]] = {}
    for factor, load in acting:
        kind = _kind(load)
        if kind is None:
            yield factor, load
        else:
            kinds.setdefault(kind, []).append((factor, load))
    for same in kinds.values():
        from kratos_lite.model.loads.surface import faces_of_rows, loaded_rows  # a quick start without them

        load = same[0][1]
        rows = [loaded_rows(mesh, one.where, load.what, load.cells) for _, one in same]
        portion = np.cumsum([len(some) for some in rows]) // AT_ONCE
        for ones in np.split(np.arange(len(same)), np.flatnonzero(np.diff(portion)) + 1):
            new = copy(load)  # its value is a list of theirs, and `properties` of its faces are numbers in it
            new.where = faces_of_rows(mesh, [rows[i] for i in ones], load.what, load.cells)
            setattr(new, load.nodal[0], [same[i][0] * getattr(same[i][1], load.nodal[0]) for i in ones])
            yield 1.0, new


def _kind(load: Load) -> Hashable:
    """Return what loads share that are evaluated together; None of one that is evaluated alone."""
    if not isinstance(load, DistributedLoad) or load.local is not None or "each_face" not in vars(type(load)):
        return None
    others = dict(vars(load))
    value, _ = others.pop(load.nodal[0]), others.pop("where")
    uniform = np.ndim(value) < load.nodal[1] and not callable(value)
    return (type(load), *others.values()) if uniform else None

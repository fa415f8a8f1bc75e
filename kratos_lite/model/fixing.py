"""Fixing: one call that prescribes or releases displacements, and the motion that comes of it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from kratos_lite.errors import InputError
from kratos_lite.model.equal import key_of
from kratos_lite.typing import Array, Ints

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

AXES = "xyz"
Selected: TypeAlias = "str | Callable[[Array], ArrayLike] | None"
"""Nodes by part name or predicate, or None where rows were given."""


def axis_numbers(axes: str) -> list[int]:
    """Return the axis numbers of a word such as ``"xz"``.

    >>> axis_numbers("xz")
    [0, 2]
    """
    known = isinstance(axes, str) and axes and set(axes) <= set(AXES)
    if not known or len(set(axes)) != len(axes):
        raise InputError(f"axes must be some of x, y, z, each once, such as 'xz'; got {axes!r}")
    return [AXES.index(a) for a in axes]


@dataclass(frozen=True, eq=False)
class PrescribedMotion:
    """The displacement of nodes along an axis as a function of time.

    Attributes
    ----------
    rows : the nodes.
    axis : 0, 1 or 2.
    function : takes the time in s, returns m; its values are checked.
    given : the function as the caller gave it.
    """

    rows: Ints
    axis: int
    function: Callable[[float], float]
    given: object


@dataclass(frozen=True, eq=False)
class Fixing:
    """One call of `Structure.fix`, from which a finer mesh is fixed alike.

    Attributes
    ----------
    where : nodes by part name or predicate, or None where rows were given.
    rows : the nodes.
    axes : such as ``"xz"``.
    value : m; as given, or a function of time.
    field : function of places, or None.
    override : whether it won over earlier ones.
    name : of the support, or None.
    released : whether the nodes were released along the axes instead.
    """

    where: Selected
    rows: Ints
    axes: str
    value: ArrayLike | Callable[[float], float]
    field: Callable[[Array], ArrayLike] | None
    override: bool
    name: str | None = None
    released: bool = False

    def __str__(self) -> str:
        where = self.where if isinstance(self.where, str) else f"{len(self.rows)} nodes"
        if self.released:
            return f"{where}: {self.axes} released"
        value = "by a field" if self.field is not None else "as a function of time"
        if not callable(self.value) and self.field is None:
            value = f"= {self.value:g} m" if isinstance(self.value, (int, float)) else "by values"
        return f"{self.name + ': ' if self.name else ''}{where}, {self.axes} {value}"

    @property
    def key(self) -> Hashable:
        """What equal calls share."""
        return key_of([self.rows, self.axes, self.value, self.field])

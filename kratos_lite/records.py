"""Records: classes made of their fields, as dataclasses are, that take no time to define; and their tables.

`dataclasses.dataclass` compiles the methods of each class anew, half a millisecond at every start of a
program; those of records are shared.  A record becomes a dataclass when anybody asks it for what dataclasses
have: `dataclasses.fields`, a subclass that is one, `inspect.signature`; and to say which argument is wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

__all__ = ["Tabular", "aligned", "field", "names_of", "record", "replace"]

if TYPE_CHECKING:
    from dataclasses import dataclass as record
    from dataclasses import field
else:

    def record(kind: type | None = None, *, frozen: bool = False, eq: bool = True) -> Any:
        """Make a class a record; the options are those of `dataclasses.dataclass`.

        >>> @record(frozen=True)
        ... class Spring:
        ...     stiffness: float
        ...     length: float = 1.0
        >>> Spring(2.0), Spring(2.0) == Spring(stiffness=2.0, length=1.0)
        (Spring(stiffness=2.0, length=1.0), True)
        """
        if kind is None:
            return lambda kind: record(kind, frozen=frozen, eq=eq)
        defaults: dict[str, Any] = {}
        for base in reversed(kind.__mro__[1:]):
            defaults |= vars(base).get("_defaults", {})
        for name, what in vars(kind).get("__annotations__", {}).items():
            if not str(what).startswith("ClassVar"):
                defaults[name] = vars(kind).get(name, REQUIRED)
        kind._defaults, kind._options = defaults, {"frozen": frozen, "eq": eq}
        shared = {"__init__": _init, "__repr__": _repr, **{name: _Later(name) for name in LATER}}
        if eq:
            shared |= {"__eq__": _eq, "__hash__": _hash if frozen else None}
        if frozen:
            shared |= {"__setattr__": _set, "__delattr__": _delete}
        kind._shared = [name for name in shared if name not in vars(kind)]
        for name in kind._shared:
            setattr(kind, name, shared[name])
        return kind

    class field:
        """A default that is made anew for each object."""

        def __init__(self, *, default_factory: Callable[[], Any]) -> None:
            self.default_factory = default_factory


LATER = ("__dataclass_fields__", "__dataclass_params__", "__match_args__", "__signature__")
"""What a record has only from the moment when it is asked for."""
REQUIRED = object()
"""In place of the default of a field that has none."""


def aligned(rows: list[tuple[str, str]]) -> str:
    """Return labels and values as lines of two columns.

    >>> print(aligned([("E", "210e9 Pa"), ("nu", "0.3")]))
    E   210e9 Pa
    nu  0.3
    """
    width = max((len(label) for label, _ in rows), default=0)
    return "\n".join(f"{label:<{width}}  {value}" for label, value in rows)


class Tabular:
    """What is shown as a table of labels and values, printed or in a notebook."""

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary.

        Returns
        -------
        Labels and values.
        """
        return []

    def __str__(self) -> str:
        return aligned(self.table())

    def _repr_html_(self) -> str:
        from html import escape  # notebooks alone need it

        cell = '<td style="text-align: left">'
        rows = "".join(
            f"<tr>{cell}{escape(label)}</td>{cell}{escape(text)}</td></tr>\n" for label, text in self.table()
        )
        return f"<table>\n<caption>{escape(type(self).__name__)}</caption>\n{rows}</table>"


def replace(item: Any, **changes: Any) -> Any:
    """Return a copy of a record with other values of some fields."""
    return type(item)(**{name: getattr(item, name) for name in names_of(type(item))} | changes)


def names_of(kind: Any) -> tuple[str, ...]:
    """Return the names of the fields of a record or dataclass; none of another class."""
    if "_defaults" in vars(kind) or not hasattr(kind, "__dataclass_fields__"):
        return tuple(vars(kind).get("_defaults", ()))
    from dataclasses import fields

    return tuple(item.name for item in fields(kind))


class _Later:
    """What a record has as a dataclass; it becomes one when this is read."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, item: Any, kind: Any) -> Any:
        _complete(kind)
        return getattr(kind, self.name)


def _complete(kind: Any) -> Any:
    """Make the record that a class is or derives from a dataclass, and return it."""
    import dataclasses

    owner = next(base for base in kind.__mro__ if "_shared" in vars(base))
    for name in owner._shared:
        delattr(owner, name)
    del owner._shared
    for name, default in owner._defaults.items():
        if type(default) is field and name in vars(owner):
            setattr(owner, name, dataclasses.field(default_factory=default.default_factory))
    return dataclasses.dataclass(**owner._options)(owner)


def _init(self: Any, *args: Any, **kwargs: Any) -> None:
    given = dict(zip(self._defaults, args))  # noqa: B905 (others have defaults)
    values = {**self._defaults, **given, **kwargs}
    wrong = len(args) > len(given) or len(values) > len(self._defaults) or not given.keys().isdisjoint(kwargs)
    for name, value in values.items():
        if value is REQUIRED:
            wrong = True
        elif type(value) is field:
            values[name] = value.default_factory()
    if wrong:
        _complete(type(self)).__init__(self, *args, **kwargs)  # it says which argument
        return
    vars(self).update(values)
    if hasattr(self, "__post_init__"):
        self.__post_init__()


def _repr(self: Any) -> str:
    values = ", ".join(f"{name}={getattr(self, name)!r}" for name in self._defaults)
    return f"{type(self).__qualname__}({values})"


def _values(self: Any) -> tuple[Any, ...]:
    return tuple(getattr(self, name) for name in self._defaults)


def _eq(self: Any, other: object) -> Any:
    return _values(self) == _values(other) if other.__class__ is self.__class__ else NotImplemented


def _hash(self: Any) -> int:
    return hash(_values(self))


def _set(self: Any, name: str, value: Any) -> None:
    _refuse(self, "assign to", name)
    object.__setattr__(self, name, value)


def _delete(self: Any, name: str) -> None:
    _refuse(self, "delete", name)
    object.__delattr__(self, name)


def _refuse(self: Any, what: str, name: str) -> None:
    """Raise the error of frozen dataclasses; attributes that a subclass adds may change."""
    if "_options" in vars(type(self)) or name in self._defaults:
        from dataclasses import FrozenInstanceError

        raise FrozenInstanceError(f"cannot {what} field {name!r}")

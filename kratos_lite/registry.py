"""Registry: classes put themselves under their names; files and scripts look them up."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Generic, ParamSpec, TypeVar, cast

from kratos_lite.errors import InputError, nearest

T = TypeVar("T")
P = ParamSpec("P")
R = TypeVar("R")
FEW = 12
"""Names that are all listed where none is near to an unknown one."""


def remembered(function: Callable[P, R]) -> Callable[P, R]:
    """Keep the results of a function of classes, rules and numbers, so that each is made once."""
    return cast("Callable[P, R]", lru_cache(maxsize=256)(function))


class Registry(Generic[T]):
    """Names to classes, with aliases and a helpful answer to an unknown name.

    Examples
    --------
    >>> colors = Registry[int]("color")
    >>> colors.add("red", 1, aliases=["rouge"])
    >>> colors["rouge"], sorted(colors)
    (1, ['red'])
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._items: dict[str, T] = {}
        self._aliases: dict[str, str] = {}

    def add(self, name: str, item: T, aliases: Iterable[str] = ()) -> None:
        """Register `item`; a later one of the same name replaces it (a script may be run twice)."""
        self._items[name] = item
        for alias in aliases:
            self._aliases[alias] = name

    def __getitem__(self, name: str) -> T:
        key = name if name in self._items else self._aliases.get(name, name)
        if key not in self._items:
            known = [*self._items, *self._aliases]
            hint = nearest(name, known) if isinstance(name, str) else ""
            if not hint and 0 < len(known) <= FEW:
                hint = f" There are {', '.join(known)}"
            raise InputError(f"unknown {self.kind} {name!r}.{hint}")
        return self._items[key]

    def __contains__(self, name: object) -> bool:
        return name in self._items or name in self._aliases

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._items))

    def values(self) -> list[T]:
        """Return the registered classes in the order in which they came."""
        return list(self._items.values())

    def aliases(self, name: str) -> list[str]:
        """Return the other names under which `name` is found."""
        return [alias for alias, target in self._aliases.items() if target == name]

    @contextmanager
    def temporary(self) -> Iterator[None]:
        """Forget, on leaving, whatever was registered or replaced inside the ``with`` block.

        >>> colors = Registry[int]("color")
        >>> with colors.temporary():
        ...     colors.add("red", 1)
        >>> "red" in colors
        False
        """
        items, aliases = dict(self._items), dict(self._aliases)
        try:
            yield
        finally:
            self._items, self._aliases = items, aliases

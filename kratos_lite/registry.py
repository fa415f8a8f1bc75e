"""Registry: classes put themselves under their names; files and scripts look them up."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from typing import Any, Generic, TypeVar, cast

from kratos_lite.errors import InputError, nearest

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])
FEW = 30
"""Names that are all listed where none is near to an unknown one."""


def remembered(function: F) -> F:
    """Keep the results of a function of classes, rules and numbers, so that each is made once."""
    return cast("F", lru_cache(maxsize=256)(function))


class Registry(Generic[T]):
    """Names to classes, with aliases and a helpful answer to an unknown name."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._items: dict[str, T] = {}
        self._aliases: dict[str, str] = {}
        self._expected: dict[str, str] = {}

    def expect(self, name: str, module: str, aliases: Iterable[str] = ()) -> None:
        """Know of an item that a module registers; the module is imported when the item is requested."""
        self._expected[name] = module
        self._aliases.update(dict.fromkeys(aliases, name))

    def add(self, name: str, item: T, aliases: Iterable[str] = ()) -> None:
        """Register `item`, in place of one of the same name and file; InputError for one of another file."""
        aliases = list(aliases)
        for word in (name, *aliases):
            self._refuse_taken(word, item)
        self._items[name] = item
        self._aliases.update(dict.fromkeys(aliases, name))

    def _refuse_taken(self, word: str, item: T) -> None:
        """Raise InputError if a word means an item from another file."""
        name = word if self._has(word) else self._aliases.get(word, word)
        if self._expected.get(name, item.__module__) != item.__module__:
            self._import(name)
        if name in self._items and (first := _home(self._items[name])) != (second := _home(item)):
            raise InputError(
                f"there are two classes of the {self.kind} {word}: one in {first}, one in {second}; give one "
                "another name"
            )

    def _import(self, *names: str) -> None:
        """Import the modules of items that are expected."""
        for name in names:
            if name in self._expected and name not in self._items:
                import_module(self._expected[name])

    def __getitem__(self, name: str) -> T:
        if name not in self:
            known = [*self, *self._aliases]
            hint = nearest(name, known) if isinstance(name, str) else ""
            shown = known if len(known) <= FEW else list(self)
            if not hint and 0 < len(shown) <= FEW:
                hint = f" There are {', '.join(shown)}"
            raise InputError(f"unknown {self.kind} {name!r}.{hint}")
        name = name if self._has(name) else self._aliases[name]
        self._import(name)
        return self._items[name]

    def attribute(self, name: str) -> T:
        """Return an item by its own name, as an attribute of the package that registers it."""
        if not self._has(name):
            raise AttributeError(f"there is no {self.kind} {name!r}")
        return self[name]

    def __contains__(self, name: object) -> bool:
        if not (self._has(name) or name in self._aliases):
            self._import(*self._expected)  # one of the modules may add it as an alias
        return self._has(name) or name in self._aliases

    def _has(self, name: object) -> bool:
        return name in self._items or name in self._expected

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._expected | self._items))

    def values(self, ending: str = "") -> list[T]:
        """Return the registered classes; of those not imported yet, the ones whose names end like this."""
        self._import(*(name for name in self._expected if name.endswith(ending)))
        return [self._items[name] for name in self if name in self._items]

    def aliases(self, name: str) -> list[str]:
        """Return the other names under which `name` is found."""
        return [alias for alias, target in self._aliases.items() if target == name]

    @contextmanager
    def temporary(self) -> Iterator[None]:
        """Forget, on leaving, whatever was registered or replaced inside the ``with`` block."""
        self._import(*self._expected)
        items, aliases = dict(self._items), dict(self._aliases)
        try:
            yield
        finally:
            self._items, self._aliases = items, aliases


def _home(item: object) -> str:
    """Return the file that an item comes from, or the module of one that is not from a file."""
    module = getattr(item, "__module__", "")
    file = getattr(sys.modules.get(module), "__file__", None)
    return os.path.realpath(file) if file else f"the session ({module})"

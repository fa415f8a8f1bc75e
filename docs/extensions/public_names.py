"""The directive ``public-names``: the reference of names of the library, from their docstrings."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any

from sphinx.util.docutils import SphinxDirective


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("public-names", PublicNames)
    return {"parallel_read_safe": True}


class PublicNames(SphinxDirective):
    """Names of a module, one a line; ``+`` behind a class shows what it inherits, ``-`` no members."""

    has_content = True
    optional_arguments = 1

    def run(self) -> list[Any]:
        """Return the table of the names and what each of them is."""
        module = self.arguments[0] if self.arguments else "kratos_lite"
        words = [line.split() for line in self.content if line.strip()]
        lines = [f".. currentmodule:: {module}", "", ".. autosummary::", ""]
        lines += [f"   {name}" for name, *_ in words]
        for name, *options in words:
            lines += ["", *_entry(module, name, options)]
        return self.parse_text_to_nodes("\n".join(["````{eval-rst}", *lines, "````"]))


def _entry(module: str, name: str, options: list[str]) -> list[str]:
    """Return the directive that shows a name."""
    thing = getattr(import_module(module), name)
    if inspect.isclass(thing):
        lines = [f".. autoclass:: {name}"]
        lines += [] if "-" in options else ["   :members:"]
        return [*lines, "   :inherited-members: object"] if "+" in options else lines
    return [f".. {'autofunction' if callable(thing) and hasattr(thing, '__name__') else 'autodata'}:: {name}"]

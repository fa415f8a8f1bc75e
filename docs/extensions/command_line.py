"""The directive ``command-line``: every command and option of ``kratos-lite``, from its parsers."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from typing import Any

from sphinx.util.docutils import SphinxDirective

from kratos_lite.cli.parser import EXIT_CODES, build_parser


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True}


class CommandLine(SphinxDirective):
    """All commands, or the exit codes."""

    optional_arguments = 1

    def run(self) -> list[Any]:
        """Return sections of commands, with a table for each group of options."""
        lines = _exit_codes() if self.arguments else _commands()
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def _exit_codes() -> Iterator[str]:
    yield from ("| code | meaning |", "| --- | --- |")
    for line in EXIT_CODES.splitlines()[1:]:
        code, _, text = line.strip().partition(" ")
        yield f"| {code} | {text.strip()} |"


def _commands() -> Iterator[str]:
    (commands,) = (a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction))
    for choice in commands._choices_actions:
        parser = commands.choices[choice.dest]
        yield from (f"## {choice.dest}", "", f"{choice.help[0].upper()}{choice.help[1:]}.", "")
        for group in parser._action_groups:
            yield from _group(group)
        if parser.epilog:
            examples = [line.removeprefix("  ") for line in parser.epilog.splitlines()[1:]]
            yield from ("```text", *examples, "```", "")


def _group(group: argparse._ArgumentGroup) -> Iterator[str]:
    """Yield the table of one group of options, if it has any but ``--help``."""
    shown = [action for action in group._group_actions if action.dest != "help"]
    if not shown:
        return
    title = {"positional arguments": "what", "options": "option"}.get(group.title or "", group.title)
    yield from (f"| {title} | |", "| --- | --- |")
    for action in shown:
        yield f"| `{_words(action)}` | {_text(action)} |"
    yield ""


def _words(action: argparse.Action) -> str:
    """Return how an option is written."""
    value = action.metavar or (
        "\\|".join(map(str, action.choices)) if action.choices else action.dest.upper()
    )
    names = ", ".join(action.option_strings)
    takes = action.nargs != 0
    return f"{names} {value}".strip() if names and takes else names or str(value)


def _text(action: argparse.Action) -> str:
    """Return the help of an option, as one cell of a table."""
    text = (action.help or "").replace("%%", "%").replace("|", "\\|").replace("*", "\\*").replace("_", "\\_")
    return re.sub(r"(?<![\w-])(--\w[\w-]*)", r"`\1`", text)

"""The parser of the command line: its errors are short and name what was likely meant."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from typing import NoReturn

from kratos_lite.errors import nearest

COMMANDS = {"march": "solve, with --time STEP:STEPS", "run": "solve"}
"""Words for which a command of another name does what is likely meant."""


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Looks for the width of the terminal when help is shown, not for each option that is added."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=80)

    def format_help(self) -> str:
        """Return the text for this terminal."""
        fitting = argparse.HelpFormatter(self._prog)
        self._width, self._max_help_position = fitting._width, fitting._max_help_position
        return super().format_help()


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, which the list of all options would hide."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the words, and end."""
        self.exit(2, f"error: {message}{self._hint(message)}\n{self.prog} --help lists what there is\n")

    def _hint(self, message: str) -> str:
        """Return the known choice or command nearest to what is wrong."""
        choice = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if not choice:
            return ""
        other = COMMANDS.get(choice[1], "") if "COMMAND" in message else ""
        known = re.findall(r"[\w-]+", choice[2])
        return f". Did you mean {other}?" if other else f".{nearest(choice[1], known)}".removesuffix(".")

    def refuse(self, command: str, rest: Sequence[str]) -> NoReturn:
        """Say which words a command does not know, what they are near to, and end."""
        of_command = self._commands()[command]
        wrong = [word for word in rest if re.match("--?[a-zA-Z]", word)]
        said = [self._unknown(command, word.partition("=")[0]) for word in wrong]
        if not wrong:
            said = [f"{word!r} is one word too many" for word in rest[:1]]
            if all(re.fullmatch(r"[-+.\deE]+", word) for word in rest):
                said[0] += "; the numbers of one option are joined by commas, as in --gravity 0,0,-9.81"
        of_command.error(" ".join(said))

    def _unknown(self, command: str, word: str) -> str:
        """Return what an option may mean that a command does not have."""
        name = word.lstrip("-")
        options = {
            of: [known[2:] for known in parser._option_string_actions if known.startswith("--")]
            for of, parser in self._commands().items()
        }
        homes = [of for of, names in options.items() if name in names]
        hint = re.sub(r"\b(called|mean|or) ", r"\1 --", nearest(name, options[command]))
        if homes and not hint:
            hint = f" {command} does not take it; {' and '.join(homes)} {'does' if len(homes) == 1 else 'do'}"
        return f"{word}: there is no such option.{hint}" if not homes else f"{word}:{hint}"

    def _commands(self) -> dict[str, Parser]:
        (commands,) = (a for a in self._actions if isinstance(a, argparse._SubParsersAction))
        return dict(commands.choices)

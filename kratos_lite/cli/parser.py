"""The parser of the command line, whose errors are short and name what was likely meant."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

from kratos_lite import __version__
from kratos_lite.cli import commands
from kratos_lite.cli.options import GROUPS, Option
from kratos_lite.errors import nearest

EXIT_CODES = """exit codes:
  0    done
  1    a defect of kratos-lite, or a row of verify that fails
  2    bad input, or an output that cannot be written
  3    solved, but an expected value of the run file, or the requested error, is not reached
  130  interrupted with Ctrl-C; 143 by SIGTERM"""
MODEL = ".mdpa, an .elem set or its stem, ProjectParameters.json or its folder, or a mesh that meshio reads"
SCRIPT = "a .py script with a case, or with body, dt and steps"
TARGET = ".mdpa, .elem, .vtu or any format of meshio, chosen by the extension"
COMMANDS = {
    "solve": {"input": f"{MODEL}; or {SCRIPT}"},
    "info": {"input": f"{MODEL}; or {SCRIPT}"},
    "check": {"input": f"{MODEL}; {SCRIPT}; or a .py file that defines elements or materials"},
    "convert": {"input": MODEL, "output": TARGET},
    "verify": {
        "names": "problems, families or patterns such as '*cylinder*' (all); .py files of own elements"
    },
}
"""Commands, and what stands behind each without a name."""
FILES = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}
"""What shtab takes for the names of files, where it completes words in a shell."""
DEBUG = Option("--debug", None, "show the traceback of an error")
LENIENT = Option("--lenient", None, "accept .mdpa rows that are broken over lines")
OF_INFO = Option("--units", "SET", "consistent units of all numbers in the file, a label: mm N MPa t … (SI)")
OF_VERIFY = (
    Option("--element", "NAME", "only this one, such as 3D8N; may be given several times (all)", many=True),
    Option("-o --output", "OUT", "write the table as .md or .json"),
    Option("--list", None, "list the problems and their sources instead"),
)
OPTIONS = {"info": (OF_INFO, LENIENT), "verify": OF_VERIFY}
"""Of the commands that have more than one of their own."""


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
        known = re.findall(r"[\w-]+", choice[2]) if choice else []
        return f".{nearest(choice[1], known)}".removesuffix(".") if choice else ""

    def refuse_first(self, words: Sequence[str]) -> None:
        """Refuse an option before any command that is none of ours: it may be misspelt."""
        first = words[0] if words else ""
        if first.startswith("-") and first not in self._option_string_actions:
            near = nearest(first, self._option_string_actions)
            self.error(f"{first}: there is no such option.{near}")

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
        options = {of: [o[2:] for o in p._option_string_actions] for of, p in self._commands().items()}
        homes = [of for of, names in options.items() if name in names]
        hint = re.sub(r"\b(called|mean|or) ", r"\1 --", nearest(name, filter(None, options[command])))
        if homes and not hint:
            hint = f" {command} does not take it; {' and '.join(homes)} {'does' if len(homes) == 1 else 'do'}"
        return f"{word}:{hint}" if homes else f"{word}: there is no such option.{hint}"

    def _commands(self) -> dict[str, Parser]:
        (commands,) = (a for a in self._actions if isinstance(a, argparse._SubParsersAction))
        return dict(commands.choices)


def build_parser() -> Parser:
    """Return the parser of all commands."""
    description = "Finite elements for solids: from an input file to displacements and stresses."
    style: dict[str, Any] = {"formatter_class": Formatter, "allow_abbrev": False}
    parser = Parser(prog="kratos-lite", description=description, epilog=EXIT_CODES, **style)
    parser.add_argument("--version", action="version", version=f"kratos-lite {__version__}")
    case = Parser(add_help=False, **style)
    for title, options in GROUPS.items():
        _add(case.add_argument_group(title), options)
    subparsers = parser.add_subparsers(prog="kratos-lite", dest="command", required=True, metavar="COMMAND")
    for name, words in COMMANDS.items():
        text, _, examples = (getattr(commands, name).__doc__ or "").partition("\n\n")
        command = subparsers.add_parser(
            name,
            help=text[:1].lower() + text[1:].rstrip("."),
            description=text,
            epilog=f"examples:\n{re.sub('^ *', '  ', examples.strip(), flags=re.M)}",
            parents=[case] if name in ("solve", "check") else [],
            **style,
        )
        # "-1,0,0" and "-z:30" are values, not options
        command._negative_number_matcher = re.compile(r"-([\d.]|[xyz]:)")
        for word, meaning in words.items():
            many = "*" if word == "names" else "+" if name in ("info", "check") else None
            command.add_argument(word, help=meaning, nargs=many).complete = FILES  # type: ignore[attr-defined]
        _add(command, (*OPTIONS.get(name, (LENIENT,)), DEBUG))
    # All its words, also --help, are for the program that it runs.
    subparsers.add_parser("bench", help="run the benchmarks of a source checkout", add_help=False)
    subparsers.add_parser("ccx", help="solve a deck in place of CalculiX: -i JOB", add_help=False)
    return parser


def _add(group: Any, options: Iterable[Option]) -> None:
    for option in options:
        settings: dict[str, Any] = {"action": "append", "default": []} if option.many else {}
        if option.form is None:
            settings["action"] = "store_true"
        elif "|" in option.form:
            settings["choices"] = option.form.split("|")
        else:
            settings["metavar"] = option.form
        added = group.add_argument(*option.names.split(), help=option.help, **settings)
        if "OUT" in (option.form or "") or "STATE" in (option.form or ""):
            added.complete = FILES


def with_values(words: Sequence[str]) -> list[str]:
    """Return the words with options of PETSc, which begin with a dash, joined to ``--petsc``.

    >>> with_values(["solve", "a.mdpa", "--petsc", "-ksp_view"])
    ['solve', 'a.mdpa', '--petsc=-ksp_view']
    """
    joined: list[str] = []
    for word in words:
        if joined[-1:] == ["--petsc"]:
            joined[-1] = f"--petsc={word}"
        else:
            joined.append(word)
    return joined
